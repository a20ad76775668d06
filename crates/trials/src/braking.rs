//! Robots of every kind on every floor that are stopped under way: whether what watches their ramps leaves them alone.
//!
//! A seed draws the robot of [`crate::seeded`], when and how it is stopped, a slope, a push around the stop, and a load that changes.

use omnibase_robot::estimators::covariance_settings;
use omnibase_robot::signals::{SafetyReason, StopCategory};
use omnibase_robot::{Phase, RequestKind};
use omnibase_robot_sim::{Payload, Wrench};

use crate::approaches::Random;
use crate::seeded::Seeded;
use crate::wiring::Push;
use crate::{Trial, plan_of};

/// Longer than this no stop is watched, s.
const LONGEST_S: f64 = 12.0;

/// A robot and how it is stopped.
#[derive(Clone, Debug, PartialEq)]
pub struct Braking {
    /// The robot, its floor and its way.
    pub seeded: Seeded,
    /// When it is stopped, s after it begins.
    pub at_s: f64,
    /// How.
    pub category: StopCategory,
    /// The floor's slope, and the direction in which it falls, rad.
    pub slope_rad: [f64; 2],
    /// Who pushes it, s after it begins.
    pub push: Option<Push>,
    /// Its payload from half a second before the stop, over the one before.
    pub loaded: Option<f64>,
}

/// How a stop ended.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ended {
    /// What it was stopped for at first: asked for, or by itself before that.
    pub first: SafetyReason,
    /// What its ramp was broken off for, where it was.
    pub broken_off: Option<SafetyReason>,
    /// The furthest that it was believed to be from its set point meanwhile, m.
    pub off_m: f64,
}

impl Braking {
    /// The robot of a seed.
    pub fn new(seed: u64) -> Braking {
        let seeded = Seeded::new(seed);
        let mut random = Random::new(seed ^ 0xB4A8_E000_0000_0000);
        let at_s = random.between(0.1, 2.5);
        let category = [StopCategory::RampThenRemove, StopCategory::RampAndHold][random.below(2) as usize];
        let slope_rad = match random.below(2) {
            0 => [0.0; 2],
            _ => [random.between(0.0, 0.05), random.between(0.0, 6.2)],
        };
        let push = (random.below(2) == 0).then(|| Push {
            at_s: (at_s + random.between(-0.4, 0.4)).max(0.01),
            lasts_s: random.spread(0.1, 3.0),
            wrench: [
                random.between(-150.0, 150.0),
                random.between(-150.0, 150.0),
                random.between(-20.0, 20.0),
            ],
        });
        let loaded = (random.below(4) == 0).then(|| random.between(0.2, 2.0));
        Braking { seeded, at_s, category, slope_rad, push, loaded }
    }

    /// In one line.
    pub fn row(&self) -> String {
        let Braking { seeded, at_s, category, slope_rad: [slope, to], push, loaded } = self;
        format!(
            "{}, {category:?} at {at_s:.2} s, slope {slope:.3} to {to:.1}, push {push:?}, load {loaded:?}",
            seeded.row()
        )
    }

    /// Drives it, and stops it.
    ///
    /// # Panics
    /// Where the robot can't be made or enabled.
    pub fn ride(&self) -> Ended {
        let [slope, direction] = self.slope_rad;
        let sloping = format!("slope_rad = {slope:?}\nslope_direction_rad = {direction:?}\n");
        let plan =
            plan_of(&self.seeded.text().replace("static_friction", &format!("{sloping}static_friction")));
        let geometry = covariance_settings(&plan.estimator).geometry;
        let mut trial = Trial::on_machine(plan.clone(), |machine| self.seeded.build(machine, &geometry));
        trial.enable();
        let period_s = 1e-6 * self.seeded.cycle_us as f64;
        let mut ended = Ended::default();
        for cycle in 0..(LONGEST_S / period_s) as u64 {
            let now_s = cycle as f64 * period_s;
            let is_now = |at_s: f64| (at_s..at_s + period_s).contains(&now_s);
            if let Some(Push { at_s, lasts_s, wrench: [fx_n, fy_n, moment_n_m] }) = self.push {
                if is_now(at_s) {
                    trial.machine.lock().set_push(Wrench { fx_n, fy_n, moment_n_m });
                } else if is_now(at_s + lasts_s) {
                    trial.machine.lock().set_push(Wrench::default());
                }
            }
            if let Some(part) = self.loaded.filter(|_| is_now((self.at_s - 0.5).max(0.0))) {
                let mut machine = trial.machine.lock();
                let before = machine.body().payload();
                let payload = Payload {
                    mass_kg: part * before.mass_kg,
                    yaw_inertia_kg_m2: part * before.yaw_inertia_kg_m2,
                    ..before
                };
                if let Err(error) = machine.set_payload(payload) {
                    panic!("{error}");
                }
            }
            let before = trial.robot.phase();
            let kind = match before {
                Phase::Holding if cycle == 0 => Some(RequestKind::Track),
                _ if is_now(self.at_s) => Some(RequestKind::Stop(self.category)),
                _ => None,
            };
            let record = *trial.step(kind);
            let phase = trial.robot.phase();
            if ended.first == SafetyReason::None {
                ended.first = record.stop_reason;
            }
            if before == Phase::Stopping {
                let off_m = record.state.odom_from_body.distance_m(record.setpoint.odom_from_body);
                ended.off_m = ended.off_m.max(off_m);
                if phase == Phase::QuickStopping {
                    ended.broken_off = Some(record.stop_reason);
                }
            }
            let is_over = matches!(phase, Phase::Disabled | Phase::Fault | Phase::QuickStopping)
                || (phase == Phase::Holding && ended.first != SafetyReason::None);
            if is_over || now_s > self.at_s + 0.1 && phase == Phase::Holding {
                break;
            }
        }
        ended
    }
}
