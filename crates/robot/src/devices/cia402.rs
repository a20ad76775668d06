//! Any drive of the profile CiA 402, by configuration alone.

use std::f64::consts::TAU;

use omnibase_cia402::{
    DriveRequest, Enabling, EnablingError, ErrorCode, Feedback, Mode, PositionCounts, Progress, Settings,
    StatusWord, Targets,
};

use super::field::{Field, nearest};
use super::{DeviceDefaults, pdo};
use crate::config::{DrivePlan, DriveScale, EncoderName, SpeedUnit, TurnDirection};
use crate::registry::Made;
use crate::signals::{CycleTime, DriveMeasurement, DriveProgress, WheelCommand};
use crate::stages::{Device, DriveCommand};

pub(super) fn defaults() -> DeviceDefaults {
    DeviceDefaults {
        outputs: vec![pdo(
            0x1600,
            &[(0x6040, 0, 16), (0x6060, 0, 8), (0, 0, 8), (0x60FF, 0, 32), (0x6071, 0, 16)],
        )],
        inputs: vec![pdo(
            0x1A00,
            &[
                (0x6041, 0, 16),
                (0x6061, 0, 8),
                (0, 0, 8),
                (0x6064, 0, 32),
                (0x606C, 0, 32),
                (0x6077, 0, 16),
                (0x603F, 0, 16),
            ],
        )],
        ..Default::default()
    }
}

/// Time constant with which a speed is made out of counts, s: single counts of a coarse encoder are no speed.
const SPEED_FILTER_S: f64 = 0.01;

/// Objects that the device reads, and where they lie.
#[derive(Clone, Copy, Debug)]
struct Inputs {
    status: Field,
    position: Field,
    speed: Option<Field>,
    torque: Option<Field>,
    mode: Option<Field>,
    error: Option<Field>,
}

/// Objects that the device writes, and where they lie.
#[derive(Clone, Copy, Debug)]
struct Outputs {
    control: Field,
    mode: Option<Field>,
    position: Option<Field>,
    speed: Option<Field>,
    torque: Option<Field>,
    /// Max torque, positive and negative torque limit; those that are mapped.
    torque_limits: [Option<Field>; 3],
    interpolated_position: Option<Field>,
}

/// A drive of the profile CiA 402.
#[derive(Clone, Debug)]
pub struct Cia402Device {
    inputs: Inputs,
    outputs: Outputs,
    /// Wheel angle of one count, rad; negative where the motor turns backwards.
    rad_per_count: f64,
    /// Wheel speed of one unit of the speed objects, rad/s.
    rad_s_per_speed_unit: f64,
    /// Wheel torque of one per mille, N·m.
    nm_per_mille: f64,
    scale: DriveScale,
    /// The most that its wheel ever gets, N·m.
    torque_limit_nm: f64,
    encoder: EncoderName,
    enabling: Enabling,
    feedback: Feedback,
    last_counts: Option<PositionCounts>,
    /// When that was, ns.
    last_ns: u64,
    /// Wheel speed out of the counts, where the drive sends none, rad/s.
    counted_rad_s: f64,
    progress: DriveProgress,
}

impl Cia402Device {
    /// A drive as its plan says; refused where an object is missing that it can't do without.
    pub fn new(plan: &DrivePlan) -> Made<Self> {
        let input = |index| Field::find(&plan.inputs, index, 0);
        let output = |index| Field::find(&plan.outputs, index, 0);
        let inputs = Inputs {
            status: Field::needed(&plan.inputs, 0x6041, "the status word")?,
            position: Field::needed(&plan.inputs, 0x6064, "the actual position")?,
            speed: input(0x606C),
            torque: input(0x6077),
            mode: input(0x6061),
            error: input(0x603F),
        };
        let outputs = Outputs {
            control: Field::needed(&plan.outputs, 0x6040, "the control word")?,
            mode: output(0x6060),
            position: output(0x607A),
            speed: output(0x60FF),
            torque: output(0x6071),
            torque_limits: [0x6072, 0x60E0, 0x60E1].map(output),
            interpolated_position: Field::find(&plan.outputs, 0x60C1, 1),
        };
        let DriveScale { counts_per_revolution, gear_ratio, direction, speed_unit, rated_torque_nm, .. } =
            plan.scale;
        let sign = match direction {
            TurnDirection::Forward => 1.0,
            TurnDirection::Backward => -1.0,
        };
        let rad_per_count = sign * TAU / f64::from(counts_per_revolution) / gear_ratio;
        let rad_s_per_speed_unit = match speed_unit {
            SpeedUnit::CountsS => rad_per_count,
            SpeedUnit::Rpm => sign * TAU / 60.0 / gear_ratio,
            SpeedUnit::MilliRpm => sign * TAU / 60_000.0 / gear_ratio,
        };
        Ok(Cia402Device {
            inputs,
            outputs,
            rad_per_count,
            rad_s_per_speed_unit,
            nm_per_mille: sign * rated_torque_nm * gear_ratio / 1000.0,
            scale: plan.scale,
            torque_limit_nm: plan.torque_limit.wheel_nm,
            encoder: plan.encoder,
            enabling: Enabling::new(Settings::default()),
            feedback: Feedback {
                status: StatusWord::default(),
                mode_code: inputs.mode.map(|_| 0),
                actual: Targets::default(),
                error: inputs.error.map(|_| ErrorCode::NONE),
            },
            last_counts: None,
            last_ns: 0,
            counted_rad_s: 0.0,
            progress: DriveProgress::Unknown,
        })
    }
}

impl Device for Cia402Device {
    fn read(&mut self, time: &CycleTime, inputs: &[u8]) -> DriveMeasurement {
        let get = |field: Field| field.read(inputs);
        let counts = PositionCounts(get(self.inputs.position));
        let increment = self.last_counts.map_or(0, |last| counts.since(last));
        self.last_counts = Some(counts);
        let increment_rad = f64::from(increment) * self.rad_per_count;
        let elapsed_s = time.now_ns.saturating_sub(self.last_ns) as f64 * 1e-9;
        self.last_ns = time.now_ns;
        if elapsed_s > 0.0 {
            self.counted_rad_s +=
                (increment_rad - self.counted_rad_s * elapsed_s) / (elapsed_s + SPEED_FILTER_S);
        }
        self.feedback = Feedback {
            status: StatusWord(get(self.inputs.status) as u16),
            mode_code: self.inputs.mode.map(|field| get(field) as i8),
            actual: Targets {
                position_counts: counts.0,
                velocity_units: self.inputs.speed.map_or(0, get),
                torque_per_mille: self.inputs.torque.map_or(0, get) as i16,
            },
            error: self.inputs.error.map(|field| ErrorCode(get(field) as u16)),
        };
        DriveMeasurement {
            position_counts: counts.0,
            increment_rad,
            speed_rad_s: match self.inputs.speed {
                Some(_) => f64::from(self.feedback.actual.velocity_units) * self.rad_s_per_speed_unit,
                None => self.counted_rad_s,
            },
            torque_nm: f64::from(self.feedback.actual.torque_per_mille) * self.nm_per_mille,
            status: self.feedback.status,
            mode_code: self.feedback.mode_code.unwrap_or(0),
            error: self.feedback.error.unwrap_or(ErrorCode::NONE),
            progress: self.progress,
        }
    }

    fn write(&mut self, time: &CycleTime, command: &DriveCommand, outputs: &mut [u8]) -> DriveProgress {
        let mut targets = self.feedback.actual;
        let torque_limit_nm = command.torque_limit_nm.min(self.torque_limit_nm);
        let torque_limit = self.scale.torque_limit_per_mille(torque_limit_nm).min(i16::MAX as u16) as i16;
        match command.command {
            WheelCommand::SpeedRadS(speed) => {
                targets.velocity_units = nearest(speed / self.rad_s_per_speed_unit, 32)
            }
            WheelCommand::TorqueNm(torque) => {
                let torque = nearest(torque / self.nm_per_mille, 16) as i16;
                targets.torque_per_mille = torque.clamp(-torque_limit, torque_limit);
            }
        }
        let request = DriveRequest { wanted: command.wanted, mode: command.mode, targets };
        let output = self.enabling.advance(time.now_ns, &self.feedback, &request);
        self.outputs.control.write(outputs, output.control.0.into());
        let mut put = |field: Option<Field>, value: i32| {
            if let Some(field) = field {
                field.write(outputs, value);
            }
        };
        put(self.outputs.mode, output.mode.code().into());
        put(self.outputs.position, output.targets.position_counts);
        put(self.outputs.interpolated_position, output.targets.position_counts);
        put(self.outputs.speed, output.targets.velocity_units);
        put(self.outputs.torque, output.targets.torque_per_mille.into());
        for field in self.outputs.torque_limits {
            put(field, torque_limit.into());
        }
        self.progress = match output.progress {
            Progress::Stepping { .. } => DriveProgress::UnderWay,
            Progress::SwitchingMode { .. } => DriveProgress::SwitchingMode,
            Progress::Running => DriveProgress::Running,
            Progress::Holding(_) => DriveProgress::Idle,
            Progress::Stopped(EnablingError::Fault(_) | EnablingError::FaultPersists(_)) => {
                DriveProgress::Fault
            }
            Progress::Stopped(EnablingError::QuickStop | EnablingError::QuickStopByDrive) => {
                DriveProgress::QuickStop
            }
            Progress::Stopped(_) => DriveProgress::Failed,
        };
        self.progress
    }

    fn restarted(&mut self) {
        self.last_counts = None;
        self.counted_rad_s = 0.0;
    }

    fn count_range_rad(&self) -> Option<f64> {
        // Half of the 32 bits in which the count wraps.
        let range_rad = f64::from(1_u32 << 31) * self.rad_per_count.abs();
        (self.encoder == EncoderName::Absolute).then_some(range_rad)
    }

    fn acknowledge(&mut self) {
        self.enabling.acknowledge();
    }

    fn problem(&self) -> Option<String> {
        self.enabling.problem().map(|problem| problem.to_string())
    }
}

/// The mode in which a drive follows a command.
pub(crate) fn mode_of(command: &WheelCommand) -> Mode {
    match command {
        WheelCommand::SpeedRadS(_) => Mode::CyclicSynchronousVelocity,
        WheelCommand::TorqueNm(_) => Mode::CyclicSynchronousTorque,
    }
}
