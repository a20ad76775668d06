//! A drive without electricity: its wheel turns as it was told one cycle before.

use omnibase_cia402::Wanted;
use omnibase_robot::Registry;
use omnibase_robot::registry::Kind;
use omnibase_robot::signals::{CycleTime, DriveMeasurement, DriveProgress, WheelCommand};
use omnibase_robot::stages::{Device, DriveCommand};

#[derive(Clone, Copy, Debug, Default)]
struct KinematicWheel {
    /// What the wheel does in this period, and in the next one, rad/s.
    speeds: [f64; 2],
    progress: DriveProgress,
}

impl Device for KinematicWheel {
    fn read(&mut self, time: &CycleTime, _: &[u8]) -> DriveMeasurement {
        let [speed_rad_s, next] = self.speeds;
        self.speeds = [next; 2];
        DriveMeasurement {
            increment_rad: speed_rad_s * time.period_s(),
            speed_rad_s,
            progress: self.progress,
            ..Default::default()
        }
    }

    fn write(&mut self, _: &CycleTime, command: &DriveCommand, _: &mut [u8]) -> DriveProgress {
        self.progress = match command.wanted {
            Wanted::OperationEnabled => DriveProgress::Running,
            _ => DriveProgress::Idle,
        };
        self.speeds[1] = match (self.progress, command.command) {
            (DriveProgress::Running, WheelCommand::SpeedRadS(speed)) => speed,
            _ => 0.0,
        };
        self.progress
    }
}

/// Puts kinematic wheels in the place of all devices; their defaults stay.
pub fn register_kinematic(registry: &mut Registry) {
    let kinds: Vec<Kind> = registry.devices.kinds().cloned().collect();
    for kind in kinds {
        let defaults = registry.devices.defaults(kind.name).cloned().unwrap_or_default();
        registry.devices.add(kind, defaults, |_| Ok(KinematicWheel::default()));
    }
}
