//! Drives that take torques under a control law that commands speeds: the cycle closes their speed loops.

use crate::config::{DriveMode, RobotPlan, SpeedLoopPlan, WheelLimits};
use crate::signals::{CycleTime, DriveMeasurement, WheelCommand};

/// The loops of a robot's wheels.
#[derive(Clone, Debug)]
pub(crate) struct SpeedLoops {
    /// By wheel; `None` for a drive that takes what the control law commands.
    all: Vec<Option<SpeedLoop>>,
}

/// One loop: proportional and integral.
#[derive(Clone, Copy, Debug)]
struct SpeedLoop {
    plan: SpeedLoopPlan,
    integral_nm: f64,
    last_nm: f64,
}

impl SpeedLoops {
    pub(crate) fn new(plan: &RobotPlan) -> Self {
        let by_torque = |mode| mode == Some(DriveMode::Torque);
        let loops = plan.drives.iter().map(|drive| {
            let plan = drive.speed_loop.filter(|_| by_torque(drive.mode))?;
            Some(SpeedLoop { plan, integral_nm: 0.0, last_nm: 0.0 })
        });
        SpeedLoops { all: loops.collect() }
    }

    /// What a wheel's drive is told where nothing is commanded.
    pub(crate) fn idle(&mut self, wheel: usize, idle: WheelCommand) -> WheelCommand {
        match self.all.get_mut(wheel) {
            Some(Some(one)) => {
                (one.integral_nm, one.last_nm) = (0.0, 0.0);
                WheelCommand::TorqueNm(0.0)
            }
            Some(None) | None => idle,
        }
    }

    /// What a wheel's drive is told for what is commanded; `measured` is `None` where it wasn't heard in this cycle.
    pub(crate) fn close(
        &mut self,
        time: &CycleTime,
        (wheel, command): (usize, WheelCommand),
        measured: Option<&DriveMeasurement>,
        limits: &WheelLimits,
    ) -> WheelCommand {
        match (self.all.get_mut(wheel), command) {
            (Some(Some(one)), WheelCommand::SpeedRadS(speed_rad_s)) => {
                // What isn't known changes nothing: as long as that is tolerated.
                if let Some(measured) = measured {
                    one.step(speed_rad_s - measured.speed_rad_s, time.period_s(), limits.torque_nm);
                }
                WheelCommand::TorqueNm(one.last_nm)
            }
            (_, command) => command,
        }
    }
}

impl SpeedLoop {
    fn step(&mut self, error_rad_s: f64, period_s: f64, limit_nm: f64) {
        let SpeedLoopPlan { gain_nm_s_rad, integral_s } = self.plan;
        let integral_nm = self.integral_nm + gain_nm_s_rad * error_rad_s * period_s / integral_s;
        let wished_nm = gain_nm_s_rad * error_rad_s + integral_nm;
        self.last_nm = wished_nm.clamp(-limit_nm, limit_nm);
        // At its limit the integral only goes back.
        if self.last_nm == wished_nm || error_rad_s * wished_nm < 0.0 {
            self.integral_nm = integral_nm.clamp(-limit_nm, limit_nm);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAN: SpeedLoopPlan = SpeedLoopPlan { gain_nm_s_rad: 2.0, integral_s: 0.5 };

    #[test]
    fn its_torque_is_proportional_and_integral_within_the_limit() {
        let mut one = SpeedLoop { plan: PLAN, integral_nm: 0.0, last_nm: 0.0 };
        for _ in 0..500 {
            one.step(1.0, 1e-3, 100.0);
        }
        // 2 N·m of the error, and as much again after half a second.
        assert!((one.last_nm - 4.0).abs() < 1e-9, "{}", one.last_nm);
        one.step(10.0, 1e-3, 5.0);
        assert_eq!(one.last_nm, 5.0);
    }

    #[test]
    fn at_its_limit_the_integral_stays() {
        let mut one = SpeedLoop { plan: PLAN, integral_nm: 0.0, last_nm: 0.0 };
        for _ in 0..10_000 {
            one.step(10.0, 1e-3, 5.0);
        }
        one.step(-0.1, 1e-3, 5.0);
        assert!(one.last_nm < 0.0, "{}", one.last_nm);
    }
}
