//! Simulated drives on the motors of one machine: a segment for any MainDevice, and the truth behind it.

mod axis;

pub use axis::SharedMachine;

use crate::machine::{Machine, MachineError, MachineParameters};
use crate::motor::MotorParameters;
use omnibase_ethercat_sim::device::Piece;
use omnibase_ethercat_sim::device::drive::{Drive, DriveKind};
use omnibase_ethercat_sim::device::servo::Encoder;
use omnibase_ethercat_sim::{Segment, SubDevice, TopologyError};
use omnibase_ethercat_wire::coe::ObjectAddress;

/// A drive at a position of the bus.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveStation {
    /// Which drive.
    pub kind: DriveKind,
    /// Index of the wheel whose motor it drives.
    pub wheel: usize,
    /// Alias, serial number and clock of this piece.
    pub piece: Piece,
    /// What the position shows at first power-on, in counts: absolute encoders start anywhere.
    pub initial_position: i32,
    /// What the position shows at later power-ons.
    pub encoder: Encoder,
    /// Counts of the encoder per revolution of the motor.
    pub counts_per_revolution: u32,
    /// Objects of its maker's own, each with its bytes.
    pub parameters: Vec<(ObjectAddress, usize)>,
}

impl DriveStation {
    /// A drive for a wheel, with a clock and an encoder of its own: no two pieces are alike.
    ///
    /// Quartzes are up to 20 ppm off, and clocks started at different times; both follow from the wheel's number.
    pub fn new(kind: DriveKind, wheel: usize) -> Self {
        const DRIFT_PPM: [f64; 5] = [0.0, 11.0, -17.0, 6.0, -8.0];
        let number = wheel as u32 + 1;
        Self {
            kind,
            wheel,
            piece: Piece {
                serial: number,
                dc_offset_ns: u64::from(number) * 123_456_789,
                dc_drift_ppm: DRIFT_PPM[wheel % DRIFT_PPM.len()],
                ..Piece::default()
            },
            initial_position: i32::from_ne_bytes(number.wrapping_mul(0x3C6E_F372).to_ne_bytes()) >> 8,
            encoder: Encoder::Incremental,
            counts_per_revolution: 1 << 20,
            parameters: Vec::new(),
        }
    }

    /// The drive with the figures of its motor.
    pub fn drive(&self, motor: &MotorParameters) -> Drive {
        let mut drive = Drive::new(self.kind);
        drive.servo.rated_torque_n_m = motor.rated_torque_n_m;
        drive.servo.peak_torque_n_m = motor.peak_torque_n_m;
        drive.servo.max_speed_rad_s = motor.maximum_speed_rad_s;
        drive.servo.initial_position = self.initial_position;
        drive.servo.encoder = self.encoder;
        drive.servo.counts_per_revolution = self.counts_per_revolution;
        drive.servo.parameters.clone_from(&self.parameters);
        // The current loop is the motor's, where it runs in the machine's fine steps.
        drive.servo.torque_time_constant_s = 0.0;
        drive
    }
}

/// A whole robot with its bus.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotSimDescription {
    /// Body, wheels, motors.
    pub machine: MachineParameters,
    /// Drives in the order in which a frame passes them. A wheel without a drive turns freely.
    pub drives: Vec<DriveStation>,
}

/// A robot that can't be simulated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RobotSimError {
    /// The machine.
    #[error(transparent)]
    Machine(#[from] MachineError),
    /// A drive without a wheel.
    #[error("the drive at position {position} is for wheel {}, but there are {wheels} wheels", wheel + 1)]
    NoSuchWheel {
        /// Position of the drive, counted from 0.
        position: usize,
        /// Index of the wheel, counted from 0.
        wheel: usize,
        /// How many there are.
        wheels: usize,
    },
    /// Two drives on one motor.
    #[error("the drives at positions {first} and {second} are both for wheel {}", wheel + 1)]
    TwoDrives {
        /// Index of the wheel, counted from 0.
        wheel: usize,
        /// Position of one drive, counted from 0.
        first: usize,
        /// Position of the other.
        second: usize,
    },
}

/// A simulated robot, ready to be cabled.
#[derive(Debug)]
pub struct RobotSim {
    /// The drives, in the order of the description; other SubDevices can be put between them.
    pub sub_devices: Vec<SubDevice>,
    /// The machine that they share.
    pub machine: SharedMachine,
}

impl RobotSim {
    /// Builds machine and drives.
    pub fn new(description: &RobotSimDescription) -> Result<Self, RobotSimError> {
        let wheels = description.machine.wheels.len();
        for (position, station) in description.drives.iter().enumerate() {
            let wheel = station.wheel;
            if wheel >= wheels {
                return Err(RobotSimError::NoSuchWheel { position, wheel, wheels });
            }
            if let Some(first) = description.drives[..position].iter().position(|other| other.wheel == wheel)
            {
                return Err(RobotSimError::TwoDrives { wheel, first, second: position });
            }
        }
        let machine = SharedMachine::new(Machine::new(&description.machine)?);
        let sub_devices = description.drives.iter().map(|station| {
            let motor = &description.machine.wheels[station.wheel].motor;
            station.drive(motor).build_on(&station.piece, machine.axis(station.wheel))
        });
        Ok(Self { sub_devices: sub_devices.collect(), machine })
    }

    /// The drives alone, in a line.
    pub fn into_line(self) -> Result<(Segment, SharedMachine), TopologyError> {
        Ok((Segment::line(self.sub_devices)?, self.machine))
    }
}
