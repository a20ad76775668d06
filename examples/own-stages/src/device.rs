//! A drive that maps no actual speed (0x606C): it is taken from the encoder instead.

use crate::custom::Custom;
use omnibase_robot::config::DrivePlan;
use omnibase_robot::devices::Cia402Device;
use omnibase_robot::registry::DeviceDefaults;
use omnibase_robot::signals::{CycleTime, DriveMeasurement, DriveProgress};
use omnibase_robot::stages::{Device, DriveCommand};
use omnibase_robot::{Registry, StageError};

/// What the robot's file need not say: the same as for a drive of the profile.
pub fn defaults() -> DeviceDefaults {
    Registry::with_built_in().device_defaults("cia402").cloned().unwrap_or_default()
}

/// A CiA 402 drive whose speed is the filtered derivative of its position.
///
/// States, modes and scaling are left to the built-in device; only what differs is written here.
#[derive(Clone, Debug)]
pub struct SpeedFromCounts {
    drive: Cia402Device,
    filter_1_s: f64,
    read_ns: Option<u64>,
    speed_rad_s: f64,
}

impl SpeedFromCounts {
    /// The device of a drive; `custom.filter_1_s` is the filter's cut-off, 1/s.
    pub fn new(plan: &DrivePlan) -> Result<Self, StageError> {
        let table = format!("drive {}: custom", plan.name);
        let custom = Custom { table: &table, values: &plan.custom };
        custom.only(&["filter_1_s"])?;
        Ok(SpeedFromCounts {
            drive: Cia402Device::new(plan)?,
            filter_1_s: custom.number("filter_1_s", 1.0..=10_000.0)?,
            read_ns: None,
            speed_rad_s: 0.0,
        })
    }
}

impl Device for SpeedFromCounts {
    fn read(&mut self, time: &CycleTime, inputs: &[u8]) -> DriveMeasurement {
        let measured = self.drive.read(time, inputs);
        // Only complete exchanges are read: after lost ones the increment spans several periods.
        if let Some(before_ns) = self.read_ns
            && time.now_ns > before_ns
        {
            let passed_s = (time.now_ns - before_ns) as f64 * 1e-9;
            let keep = (-self.filter_1_s * passed_s).exp();
            self.speed_rad_s = keep * self.speed_rad_s + (1.0 - keep) * measured.increment_rad / passed_s;
        }
        self.read_ns = Some(time.now_ns);
        DriveMeasurement { speed_rad_s: self.speed_rad_s, ..measured }
    }

    fn write(&mut self, time: &CycleTime, command: &DriveCommand, outputs: &mut [u8]) -> DriveProgress {
        self.drive.write(time, command, outputs)
    }

    fn acknowledge(&mut self) {
        self.drive.acknowledge();
    }

    fn problem(&self) -> Option<String> {
        self.drive.problem()
    }
}
