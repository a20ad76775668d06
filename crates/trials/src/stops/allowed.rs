//! What limits, ages and watchdogs allow a stop to take.

use omnibase_robot::config::Limits;
use omnibase_robot::signals::{Phase, SafetyAction, StopCategory};

use super::{AGES, LAG_S, Loss, Stops, WATCHDOG_NS};

impl Stops {
    /// How long it may take until the loss is noticed, s.
    pub(super) fn noticed_s(&self, loss: Loss) -> f64 {
        let ns = match loss {
            Loss::StickSilent => AGES.stick_ns,
            // A page that drives by its stick is missed as a stick first.
            Loss::PageSilent | Loss::LineSlow => AGES.session_ns,
            Loss::Killed | Loss::CableCut | Loss::CarrierLost => WATCHDOG_NS,
            Loss::WayBlocked => self.gives_up_ns(),
            Loss::DrivePower | Loss::DriveData | Loss::SupplyCut => self.tolerated_ns(),
            _ => 0,
        };
        ns as f64 * 1e-9
    }

    fn tolerated_ns(&self) -> u64 {
        let plan = &self.trial.plan;
        u64::from(plan.safety.lost_exchanges_tolerated + 1) * plan.bus.cycle_ns
    }

    /// A plan is given up once it made no headway for so long, and it may make some as far as the obstacles let it.
    fn gives_up_ns(&self) -> u64 {
        (self.trial.plan.guard.give_up_s * 1e9) as u64 + HEADWAY_NS
    }

    /// What may pass until the last wheel stands: until the loss is noticed, a ramp within the limits from the speed and
    /// acceleration of this instant, a cycle until it begins, one until it arrives, and the drives' lag.
    pub(super) fn allowed_s(&self, loss: Loss) -> f64 {
        let noticed_s = self.noticed_s(loss);
        let ramp_s = match loss {
            Loss::Category0 | Loss::SupplyCut => self.fastest_rad_s() / COASTING_RAD_S2,
            Loss::CarrierLost if loss.leaves_unbraked(self.trial.plan.safety.lost_device_stop) => {
                self.fastest_rad_s() / COASTING_RAD_S2
            }
            // The others brake by their own ramp, and leave one motion that rolls out.
            Loss::DriveFault => {
                self.fastest_rad_s() / self.quick_stop_rad_s2() + self.fastest_rad_s() / COASTING_RAD_S2
            }
            // Without one drive the platform has one motion that nobody brakes: what is left of it after the ramp of the
            // others rolls out.
            Loss::DrivePower | Loss::DriveData => {
                ramp_s(self.greatest_speeds(0.0), &self.trial.plan.limits)
                    + self.fastest_rad_s() / COASTING_RAD_S2
            }
            // Nobody leads the platform any more: each drive brakes its wheel by its own ramp.
            Loss::Killed | Loss::CableCut | Loss::CarrierLost => {
                self.fastest_rad_s() / self.quick_stop_rad_s2()
            }
            _ => ramp_s(self.greatest_speeds(noticed_s), &self.trial.plan.limits),
        };
        // A drive without process data goes on as it was until its watchdog expires.
        let goes_on_s = if loss == Loss::DriveData { WATCHDOG_NS as f64 * 1e-9 } else { 0.0 };
        noticed_s + 2.0 * self.cycle_s + goes_on_s + ramp_s + LAG_S
    }

    /// What may pass until the torque is off after the loss of one drive: the wheels that are heard stand by then.
    pub(super) fn torque_off_allowed_s(&self, loss: Loss) -> f64 {
        let noticed_s = self.noticed_s(loss);
        let quick_s = self.fastest_rad_s() / self.quick_stop_rad_s2();
        let braking_s = match self.trial.plan.safety.lost_device_stop {
            SafetyAction::Stop(StopCategory::RemoveTorque) => 0.0,
            SafetyAction::Stop(_) if self.trial.robot.phase() != Phase::Enabling => {
                ramp_s(self.greatest_speeds(0.0), &self.trial.plan.limits)
            }
            _ => quick_s,
        };
        let dragged_s = match loss {
            // It goes on as it was until its watchdog expires, then brakes by itself; the others are pulled by it.
            Loss::DriveData => WATCHDOG_NS as f64 * 1e-9 + quick_s,
            _ => 0.0,
        };
        noticed_s + 2.0 * self.cycle_s + braking_s.max(dragged_s) + 2.0 * LAG_S
    }

    /// The drives' own deceleration (0x6085, counts/s²) at the wheel.
    fn quick_stop_rad_s2(&self) -> f64 {
        let drive = &self.trial.plan.drives[0];
        let counts_s2 =
            drive.parameters.iter().find(|parameter| parameter.index == 0x6085).map(|parameter| {
                parameter.data.iter().rev().fold(0_u64, |value, byte| value << 8 | u64::from(*byte))
            });
        let counts_per_rad =
            f64::from(drive.scale.counts_per_revolution) * drive.scale.gear_ratio / std::f64::consts::TAU;
        counts_s2.unwrap_or(0) as f64 / counts_per_rad
    }

    /// Speed and acceleration that may be reached until the loss is noticed: m/s, m/s², rad/s, rad/s².
    fn greatest_speeds(&self, unnoticed_s: f64) -> [f64; 4] {
        let limits = &self.trial.plan.limits;
        let setpoint = self.trial.robot.record().setpoint;
        let (twist, acceleration) = (setpoint.twist_in_odom, setpoint.acceleration_in_odom);
        if unnoticed_s > 0.0 {
            return [
                limits.speed_m_s,
                limits.acceleration_m_s2,
                limits.turn_speed_rad_s,
                limits.turn_acceleration_rad_s2,
            ];
        }
        [twist.speed_m_s(), acceleration.speed_m_s(), twist.w_rad_s.abs(), acceleration.w_rad_s.abs()]
    }
}

/// A plan goes on to its end at the longest where it passes through obstacles that block it: the circle, ns.
const HEADWAY_NS: u64 = 10_000_000_000;

/// The least deceleration of wheels that roll out without torque, rad/s².
const COASTING_RAD_S2: f64 = 0.5;

/// The longest time of a ramp to rest within limits, from `[speed, acceleration]` along the way and about the vertical
/// axis, s. Worst is an acceleration away from rest: it has to end first (a/j, in which the speed grows by a²/2j), then
/// comes a ramp with full jerk at both ends (v/a + a/j). Both axes end together, so the longer counts.
fn ramp_s([v, a, w, e]: [f64; 4], limits: &Limits) -> f64 {
    let one = |speed: f64, now: f64, most: f64, jerk: f64| {
        let peak = speed + now * now / (2.0 * jerk);
        now / jerk + peak / most + most / jerk
    };
    one(v, a, limits.acceleration_m_s2, limits.jerk_m_s3).max(one(
        w,
        e,
        limits.turn_acceleration_rad_s2,
        limits.turn_jerk_rad_s3,
    ))
}
