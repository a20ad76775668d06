//! Whether a wheel speeds up against its own motor: an encoder that counts the wrong way turns the drive's loop, and the law's, into
//! one that runs away.
//!
//! The floor can speed a wheel up against its motor as well: a push, a slope, a wheel that locked and grips again. That is slow,
//! or little, or the motor pushes little.

use crate::config::{RobotPlan, rated_nm};
use crate::decay::Decay;
use crate::signals::{Exchange, MAX_WHEELS};
use crate::stages::SafetyView;

/// Low-pass on speed and torque, 1/s.
const LOW_PASS_1_S: f64 = 100.0;
/// What a wheel gained against its motor is forgotten by this rate, 1/s: slopes and pushes are slower.
const FORGOTTEN_1_S: f64 = 10.0;
/// So much of its speed limit it must gain, against so much of its motor's rated torque.
const GAINED_SHARE: f64 = 0.25;
const TORQUE_SHARE: f64 = 0.2;

/// What each wheel gained.
#[derive(Clone, Debug)]
pub(super) struct RunawayWatch {
    most_rad_s: f64,
    low_pass: Decay,
    forgotten: Decay,
    /// At the wheels, N·m.
    rated_nm: [f64; MAX_WHEELS],
    wheels: [Wheel; MAX_WHEELS],
}

/// What is known of one wheel.
#[derive(Clone, Copy, Debug, Default)]
struct Wheel {
    speed_rad_s: f64,
    torque_nm: f64,
    gained_rad_s: f64,
}

impl RunawayWatch {
    pub(super) fn new(plan: &RobotPlan) -> Self {
        let most_rad_s = GAINED_SHARE * plan.limits.wheel_speed_rad_s;
        RunawayWatch {
            most_rad_s,
            low_pass: Decay::new(LOW_PASS_1_S),
            forgotten: Decay::new(FORGOTTEN_1_S),
            rated_nm: rated_nm(plan),
            wheels: [Wheel::default(); MAX_WHEELS],
        }
    }

    /// Nothing was measured yet.
    pub(super) fn reset(&mut self) {
        self.wheels = [Wheel::default(); MAX_WHEELS];
    }

    /// Takes in what was measured, once a cycle; without a complete exchange there is nothing new.
    pub(super) fn look(&mut self, view: &SafetyView<'_>) {
        if view.exchange != Exchange::Complete {
            return;
        }
        let period_s = view.time.period_s();
        let taken = 1.0 - self.low_pass.kept(period_s);
        let keep = self.forgotten.kept(period_s);
        for (wheel, drive) in self.wheels.iter_mut().zip(view.measurements.present()) {
            let before_rad_s = wheel.speed_rad_s.abs();
            wheel.speed_rad_s += taken * (drive.speed_rad_s - wheel.speed_rad_s);
            wheel.torque_nm += taken * (drive.torque_nm - wheel.torque_nm);
            let is_against = wheel.torque_nm * wheel.speed_rad_s < 0.0;
            let gains_rad_s = wheel.speed_rad_s.abs() - before_rad_s;
            // What is no number gains nothing: another check finds it.
            let gained_rad_s = (keep * wheel.gained_rad_s + gains_rad_s).max(0.0);
            wheel.gained_rad_s = if is_against { gained_rad_s } else { 0.0 };
        }
    }

    /// The first wheel that runs away.
    pub(super) fn away(&self) -> Option<usize> {
        self.wheels.iter().zip(&self.rated_nm).position(|(wheel, rated_nm)| {
            wheel.gained_rad_s > self.most_rad_s && wheel.torque_nm.abs() > TORQUE_SHARE * rated_nm
        })
    }
}
