//! What the wheels are told, and what of it is allowed.

use super::{MAX_WHEELS, coded};

/// What a command of the wheels is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quantity {
    /// Nothing: no controller had its say.
    #[default]
    Nothing,
    /// Speeds, rad/s.
    Speed,
    /// Torques, N·m.
    Torque,
}

coded!(Quantity { Nothing = 0, Speed = 1, Torque = 2 });

/// What one wheel is told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WheelCommand {
    /// Speed, rad/s.
    SpeedRadS(f64),
    /// Torque, N·m.
    TorqueNm(f64),
}

/// What the wheels are told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Commands {
    /// What the values are.
    pub quantity: Quantity,
    /// One per wheel, rad/s or N·m; those beyond the robot's wheels are 0.
    pub values: [f64; MAX_WHEELS],
    /// Factor by which all values were scaled to keep their limit and their direction; 1 where none was needed.
    pub saturation: f64,
}

impl Default for Commands {
    fn default() -> Self {
        Commands { quantity: Quantity::Nothing, values: [0.0; MAX_WHEELS], saturation: 1.0 }
    }
}

impl Commands {
    /// What wheel `index` is told; a wheel that nothing was said about stands still.
    pub fn wheel(&self, index: usize) -> WheelCommand {
        let value = self.values.get(index).copied().unwrap_or(0.0);
        match self.quantity {
            Quantity::Torque => WheelCommand::TorqueNm(value),
            Quantity::Speed => WheelCommand::SpeedRadS(value),
            Quantity::Nothing => WheelCommand::SpeedRadS(0.0),
        }
    }

    /// Whether any wheel is told anything but 0.
    pub fn is_moving(&self) -> bool {
        self.values.iter().any(|value| *value != 0.0)
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.saturation.is_finite() && self.values.iter().all(|value| value.is_finite())
    }
}

/// Stop categories of IEC 60204-1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StopCategory {
    /// 0: remove torque at once.
    #[default]
    RemoveTorque,
    /// 1: ramp down, then remove torque.
    RampThenRemove,
    /// 2: ramp down and hold.
    RampAndHold,
}

coded!(StopCategory { RemoveTorque = 0, RampThenRemove = 1, RampAndHold = 2 });

impl StopCategory {
    /// The greater, the more is taken from the drives; as [`SafetyAction::severity`].
    pub fn severity(self) -> u8 {
        SafetyAction::Stop(self).severity()
    }
}

/// A stage of the cycle, as reasons name it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stage {
    /// Devices: what was measured.
    #[default]
    Device,
    /// Estimator: what is known.
    Estimator,
    /// Reference: what is wished.
    Reference,
    /// Controller: what the wheels are told.
    Controller,
}

coded!(Stage { Device = 0, Estimator = 1, Reference = 2, Controller = 3 });

/// Why commands weren't passed on as they were.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SafetyReason {
    /// They were.
    #[default]
    None,
    /// Somebody asked for a stop.
    Requested,
    /// A measured wheel speed above its limit.
    WheelSpeed,
    /// A wished speed of the platform above its limit.
    ReferenceSpeed,
    /// A torque above its limit: it was scaled down.
    Torque,
    /// A number that isn't finite.
    NotFinite,
    /// A velocity command too old to count.
    CommandAge,
    /// More lost exchanges in a row than are tolerated.
    ExchangeLost,
    /// The platform isn't where it shall be.
    TrackingError,
    /// A drive in fault, in a quick stop of its own, or out of operation.
    Drive,
    /// Enabling took too long.
    EnablingTimeout,
    /// The ramp to a stop took too long.
    StopTimeout,
    /// A SubDevice took no part in more exchanges in a row than are tolerated, or started anew.
    DeviceLost,
    /// What was followed leads out of the fence.
    Fence,
    /// A measured wheel torque above its limit for longer than is tolerated.
    WheelTorque,
    /// Obstacles let a plan make no headway for too long.
    WayBlocked,
    /// The input that stops isn't 0, or is old.
    StopInput,
    /// The input that enables is 0, or old.
    EnableInput,
    /// A wheel's torque swings to and fro: a control loop rings.
    Oscillation,
    /// An axis failed.
    Axis,
    /// What was followed stands in odom, and nobody knows any more where the platform stands there.
    PoseUnknown,
    /// A wheel slipped further than is tolerated.
    WheelSlip,
    /// The platform moves as if a wheel's drive were wired backwards, or swapped with another's.
    Wiring,
    /// A wheel speeds up against its own motor: its encoder counts the wrong way.
    EncoderDirection,
    /// A motor gives less torque than it is asked for.
    WeakMotor,
}

coded!(SafetyReason {
    None = 0,
    Requested = 1,
    WheelSpeed = 2,
    ReferenceSpeed = 3,
    Torque = 4,
    NotFinite = 5,
    CommandAge = 6,
    ExchangeLost = 7,
    TrackingError = 8,
    Drive = 10,
    EnablingTimeout = 11,
    StopTimeout = 12,
    DeviceLost = 13,
    Fence = 14,
    WheelTorque = 15,
    WayBlocked = 16,
    StopInput = 17,
    EnableInput = 18,
    Oscillation = 20,
    Axis = 19,
    PoseUnknown = 21,
    WheelSlip = 22,
    Wiring = 23,
    EncoderDirection = 24,
    WeakMotor = 25,
});

impl SafetyReason {
    /// The reason in words.
    pub fn text(self) -> &'static str {
        match self {
            SafetyReason::None => "none",
            SafetyReason::Requested => "a stop was asked for",
            SafetyReason::WheelSpeed => "a wheel turned faster than its limit",
            SafetyReason::ReferenceSpeed => "the wished speed lay above its limit",
            SafetyReason::Torque => "a torque lay above its limit",
            SafetyReason::NotFinite => "a number wasn't finite",
            SafetyReason::CommandAge => "the velocity command was too old",
            SafetyReason::ExchangeLost => "too many exchanges in a row were lost",
            SafetyReason::TrackingError => "the platform was too far from where it should be",
            SafetyReason::Drive => "a drive failed",
            SafetyReason::EnablingTimeout => "enabling the drives took too long",
            SafetyReason::StopTimeout => "the ramp to a stop took too long",
            SafetyReason::DeviceLost => "a SubDevice was lost",
            SafetyReason::Fence => "the way led out of the fence",
            SafetyReason::WheelTorque => "a wheel's drive gave more torque than its limit",
            SafetyReason::WayBlocked => "the way is blocked",
            SafetyReason::StopInput => "the input that stops it was set, or not heard",
            SafetyReason::EnableInput => "the input that enables it was off, or not heard",
            SafetyReason::Oscillation => "a wheel's torque swung to and fro: its control loop rang",
            SafetyReason::Axis => "an axis failed",
            SafetyReason::PoseUnknown => "nobody knows any more where the platform stands",
            SafetyReason::WheelSlip => "a wheel slipped further than is tolerated",
            SafetyReason::Wiring => "a wheel seems to be wired backwards, or swapped with another",
            SafetyReason::EncoderDirection => {
                "a wheel sped up against its motor: its encoder seems to count the wrong way"
            }
            SafetyReason::WeakMotor => "a motor gave less torque than it was asked for",
        }
    }
}

/// What safety makes of the commands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SafetyAction {
    /// They go out.
    #[default]
    Pass,
    /// The reference ramps down, then what the category says; this cycle's commands still go out.
    Stop(StopCategory),
    /// The drives brake by their own quick stop: nothing that was computed is needed or trusted.
    QuickStop,
}

/// What safety allowed, and why.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Allowed {
    /// What goes to the wheels, if they listen.
    pub commands: Commands,
    /// What safety makes of it.
    pub action: SafetyAction,
    /// Why.
    pub reason: SafetyReason,
    /// Which wheel, or which stage by its code, the reason is about; 0 where it is about none.
    pub where_index: u64,
}

impl SafetyAction {
    /// The greater, the harder the stop; a harder one takes over, whatever else is under way.
    pub const fn severity(self) -> u8 {
        match self {
            SafetyAction::Pass => 0,
            SafetyAction::Stop(StopCategory::RampAndHold) => 1,
            SafetyAction::Stop(StopCategory::RampThenRemove) => 2,
            SafetyAction::QuickStop => 3,
            SafetyAction::Stop(StopCategory::RemoveTorque) => 4,
        }
    }

    /// The number by which recordings hold this action.
    pub const fn code(self) -> u64 {
        match self {
            SafetyAction::Pass => 0,
            SafetyAction::QuickStop => 1,
            SafetyAction::Stop(category) => 2 + category.code(),
        }
    }

    /// The action of a number; `None` where no action has it.
    pub const fn from_code(code: u64) -> Option<Self> {
        match code {
            0 => Some(SafetyAction::Pass),
            1 => Some(SafetyAction::QuickStop),
            2 => Some(SafetyAction::Stop(StopCategory::RemoveTorque)),
            3 => Some(SafetyAction::Stop(StopCategory::RampThenRemove)),
            4 => Some(SafetyAction::Stop(StopCategory::RampAndHold)),
            _ => None,
        }
    }
}
