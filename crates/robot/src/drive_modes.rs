//! What each drive is commanded by; where a drive takes torques under a law of speeds, the cycle closes its speed loop.

use crate::config::{DriveMode, RobotPlan, SpeedLoopPlan, WheelLimits};
use crate::signals::{CycleTime, DriveMeasurement, Quantity, WheelCommand};

/// The modes of a robot's drives, by wheel.
#[derive(Clone, Debug)]
pub(crate) struct DriveModes {
    all: Vec<OneDrive>,
}

/// One drive.
#[derive(Clone, Debug)]
struct OneDrive {
    /// `None`: what the law commands.
    mode: Option<DriveMode>,
    /// Modes in which it can follow every law of the robot.
    possible: Vec<Option<DriveMode>>,
    /// Where the file has the figures of one.
    speed_loop: Option<SpeedLoop>,
}

/// One loop: proportional and integral.
#[derive(Clone, Copy, Debug)]
struct SpeedLoop {
    plan: SpeedLoopPlan,
    integral_nm: f64,
    last_nm: f64,
}

impl DriveModes {
    /// As the robot's file says; `commanded` is what each of its laws commands.
    pub(crate) fn new(plan: &RobotPlan, commanded: &[Quantity]) -> Self {
        let all = plan.drives.iter().map(|drive| {
            let fits = |mode: &Option<DriveMode>| {
                commanded.iter().all(|quantity| drive.misfits(*mode, *quantity).is_empty())
            };
            OneDrive {
                mode: drive.mode,
                possible: [None, Some(DriveMode::Speed), Some(DriveMode::Torque)]
                    .into_iter()
                    .filter(fits)
                    .collect(),
                speed_loop: drive.speed_loop.map(SpeedLoop::new),
            }
        });
        DriveModes { all: all.collect() }
    }

    /// Commands a drive so from now on; `false` where there is none, or where it can't follow every law of the robot so.
    pub(crate) fn set(&mut self, wheel: usize, mode: Option<DriveMode>) -> bool {
        let Some(drive) = self.all.get_mut(wheel).filter(|drive| drive.possible.contains(&mode)) else {
            return false;
        };
        drive.mode = mode;
        drive.rest();
        true
    }

    /// Some drive takes torques, whatever its law commands.
    pub(crate) fn has_torque_drives(&self) -> bool {
        self.all.iter().any(|drive| drive.mode == Some(DriveMode::Torque))
    }

    /// What a wheel's drive is told where nothing is commanded.
    pub(crate) fn idle(&mut self, wheel: usize, idle: WheelCommand) -> WheelCommand {
        match self.all.get_mut(wheel) {
            Some(drive) if drive.mode == Some(DriveMode::Torque) => {
                drive.rest();
                WheelCommand::TorqueNm(0.0)
            }
            _ => idle,
        }
    }

    /// What a wheel's drive is told for what is commanded; `measured` is `None` where it wasn't heard in this cycle.
    pub(crate) fn close(
        &mut self,
        time: &CycleTime,
        wheel: usize,
        command: WheelCommand,
        measured: Option<&DriveMeasurement>,
        limits: &WheelLimits,
    ) -> WheelCommand {
        let by_torque = self.all.get_mut(wheel).filter(|drive| drive.mode == Some(DriveMode::Torque));
        match (by_torque.and_then(|drive| drive.speed_loop.as_mut()), command) {
            (Some(speed_loop), WheelCommand::SpeedRadS(speed_rad_s)) => {
                // What isn't known changes nothing: as long as that is tolerated.
                if let Some(measured) = measured {
                    speed_loop.step(speed_rad_s - measured.speed_rad_s, time.period_s(), limits.torque_nm);
                }
                WheelCommand::TorqueNm(speed_loop.last_nm)
            }
            (_, command) => command,
        }
    }
}

impl OneDrive {
    /// Nothing is left of what its loop did before.
    fn rest(&mut self) {
        self.speed_loop = self.speed_loop.map(|speed_loop| SpeedLoop::new(speed_loop.plan));
    }
}

impl SpeedLoop {
    fn new(plan: SpeedLoopPlan) -> Self {
        SpeedLoop { plan, integral_nm: 0.0, last_nm: 0.0 }
    }

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
        let mut one = SpeedLoop::new(PLAN);
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
        let mut one = SpeedLoop::new(PLAN);
        for _ in 0..10_000 {
            one.step(10.0, 1e-3, 5.0);
        }
        one.step(-0.1, 1e-3, 5.0);
        assert!(one.last_nm < 0.0, "{}", one.last_nm);
    }
}
