//! Modes of operation: objects 0x6060, 0x6061 and 0x6502.

use core::fmt;

/// What a mode commands, and so which target object the drive follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Quantity {
    /// Target position 0x607A.
    Position,
    /// Target velocity 0x60FF (0x6042 in vl).
    Velocity,
    /// Target torque 0x6071.
    Torque,
    /// None: the drive moves by its own plan (homing).
    Nothing,
}

/// A mode of operation of the profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(i8)]
pub enum Mode {
    /// pp: the drive plans a move to each new target.
    ProfilePosition = 1,
    /// vl: velocity mode of frequency converters.
    Velocity = 2,
    /// pv: the drive ramps to the target velocity.
    ProfileVelocity = 3,
    /// tq: the drive ramps to the target torque.
    ProfileTorque = 4,
    /// hm: the drive looks for its home position.
    Homing = 6,
    /// ip: positions interpolated by the drive.
    InterpolatedPosition = 7,
    /// csp: a target position every cycle.
    CyclicSynchronousPosition = 8,
    /// csv: a target velocity every cycle.
    CyclicSynchronousVelocity = 9,
    /// cst: a target torque every cycle.
    CyclicSynchronousTorque = 10,
}

impl Mode {
    /// Every mode, by rising code.
    pub const ALL: [Mode; 9] = [
        Mode::ProfilePosition,
        Mode::Velocity,
        Mode::ProfileVelocity,
        Mode::ProfileTorque,
        Mode::Homing,
        Mode::InterpolatedPosition,
        Mode::CyclicSynchronousPosition,
        Mode::CyclicSynchronousVelocity,
        Mode::CyclicSynchronousTorque,
    ];

    /// The code in 0x6060 and 0x6061.
    pub const fn code(self) -> i8 {
        self as i8
    }

    /// The mode of a code; `None` for 0, reserved codes and the manufacturer's (negative) ones.
    pub fn from_code(code: i8) -> Option<Mode> {
        Mode::ALL.into_iter().find(|mode| mode.code() == code)
    }

    /// The mode's bit in the supported drive modes, 0x6502.
    pub const fn supported_bit(self) -> u32 {
        1 << (self.code() - 1)
    }

    /// What the mode commands.
    pub const fn quantity(self) -> Quantity {
        match self {
            Mode::ProfilePosition | Mode::InterpolatedPosition | Mode::CyclicSynchronousPosition => {
                Quantity::Position
            }
            Mode::Velocity | Mode::ProfileVelocity | Mode::CyclicSynchronousVelocity => Quantity::Velocity,
            Mode::ProfileTorque | Mode::CyclicSynchronousTorque => Quantity::Torque,
            Mode::Homing => Quantity::Nothing,
        }
    }

    /// The standard's abbreviation, as configuration files write it.
    pub const fn abbreviation(self) -> &'static str {
        match self {
            Mode::ProfilePosition => "pp",
            Mode::Velocity => "vl",
            Mode::ProfileVelocity => "pv",
            Mode::ProfileTorque => "tq",
            Mode::Homing => "hm",
            Mode::InterpolatedPosition => "ip",
            Mode::CyclicSynchronousPosition => "csp",
            Mode::CyclicSynchronousVelocity => "csv",
            Mode::CyclicSynchronousTorque => "cst",
        }
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.abbreviation())
    }
}

/// The supported drive modes, object 0x6502.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SupportedModes(pub u32);

impl SupportedModes {
    /// Whether the drive says that it has this mode.
    pub const fn supports(self, mode: Mode) -> bool {
        self.0 & mode.supported_bit() != 0
    }
}
