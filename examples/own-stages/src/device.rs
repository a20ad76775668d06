//! A drive that maps no actual speed (0x606C): it is taken from the encoder instead.

use omnibase::prelude::*;

/// Its name, and the keys of the drives' `custom` that it reads.
pub fn kind() -> Kind {
    Kind {
        name: "speed_from_counts",
        meaning: "A CiA 402 drive whose speed is taken from its encoder",
        keys: vec![needed("filter_1_s").number("Cut-off of the filter, 1/s", 1.0..=10_000.0)],
    }
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
    /// The device of a drive.
    pub fn new(plan: &DrivePlan) -> Made<Self> {
        Ok(SpeedFromCounts {
            drive: Cia402Device::new(plan)?,
            filter_1_s: plan.custom.number("filter_1_s")?,
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
