//! Status word, control word and the drive's state machine (CiA 402-2, "Power drive system state machine").

use core::fmt;

/// A state of the drive's power state machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DriveState {
    /// The drive starts up; it takes no commands yet.
    NotReadyToSwitchOn,
    /// Ready for parameters; high power must not be on.
    SwitchOnDisabled,
    /// High power may be switched on.
    ReadyToSwitchOn,
    /// The power stage is ready, the motor carries no torque.
    SwitchedOn,
    /// The motor follows its setpoints.
    OperationEnabled,
    /// The drive brakes by its quick stop function, or holds after it.
    QuickStopActive,
    /// A fault occurred and the drive reacts to it (ramp, or torque off).
    FaultReactionActive,
    /// A fault is stored; the motor carries no torque.
    Fault,
}

impl DriveState {
    /// Every state, in the order of the standard.
    pub const ALL: [DriveState; 8] = [
        DriveState::NotReadyToSwitchOn,
        DriveState::SwitchOnDisabled,
        DriveState::ReadyToSwitchOn,
        DriveState::SwitchedOn,
        DriveState::OperationEnabled,
        DriveState::QuickStopActive,
        DriveState::FaultReactionActive,
        DriveState::Fault,
    ];

    /// Mask and value by which the state stands in the status word.
    pub const fn mask_and_value(self) -> (u16, u16) {
        match self {
            DriveState::NotReadyToSwitchOn => (0x4F, 0x00),
            DriveState::SwitchOnDisabled => (0x4F, 0x40),
            DriveState::ReadyToSwitchOn => (0x6F, 0x21),
            DriveState::SwitchedOn => (0x6F, 0x23),
            DriveState::OperationEnabled => (0x6F, 0x27),
            DriveState::QuickStopActive => (0x6F, 0x07),
            DriveState::FaultReactionActive => (0x4F, 0x0F),
            DriveState::Fault => (0x4F, 0x08),
        }
    }

    /// The standard's name.
    pub const fn name(self) -> &'static str {
        match self {
            DriveState::NotReadyToSwitchOn => "Not ready to switch on",
            DriveState::SwitchOnDisabled => "Switch on disabled",
            DriveState::ReadyToSwitchOn => "Ready to switch on",
            DriveState::SwitchedOn => "Switched on",
            DriveState::OperationEnabled => "Operation enabled",
            DriveState::QuickStopActive => "Quick stop active",
            DriveState::FaultReactionActive => "Fault reaction active",
            DriveState::Fault => "Fault",
        }
    }
}

impl fmt::Display for DriveState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

macro_rules! word {
    ($(#[$doc:meta])* $name:ident { $($(#[$bit_doc:meta])* $bit:ident = $value:literal;)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
        pub struct $name(pub u16);

        impl $name {
            $($(#[$bit_doc])* pub const $bit: $name = $name($value);)*

            /// Whether every bit of `bits` is set.
            pub const fn contains(self, bits: $name) -> bool {
                self.0 & bits.0 == bits.0
            }

            /// This word with the bits of `bits` set.
            #[must_use]
            pub const fn with(self, bits: $name) -> $name {
                $name(self.0 | bits.0)
            }

            /// This word with the bits of `bits` cleared.
            #[must_use]
            pub const fn without(self, bits: $name) -> $name {
                $name(self.0 & !bits.0)
            }
        }

        impl fmt::Debug for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, concat!(stringify!($name), "({:#06x})"), self.0)
            }
        }
    };
}

word! {
    /// The status word, object 0x6041.
    StatusWord {
        /// Bit 0.
        READY_TO_SWITCH_ON = 0x0001;
        /// Bit 1.
        SWITCHED_ON = 0x0002;
        /// Bit 2.
        OPERATION_ENABLED = 0x0004;
        /// Bit 3.
        FAULT = 0x0008;
        /// Bit 4: high voltage is applied to the power stage.
        VOLTAGE_ENABLED = 0x0010;
        /// Bit 5, active low: 0 while the drive reacts to a quick stop.
        QUICK_STOP = 0x0020;
        /// Bit 6.
        SWITCH_ON_DISABLED = 0x0040;
        /// Bit 7: a warning is present; the state does not change.
        WARNING = 0x0080;
        /// Bit 8: the manufacturer's.
        MANUFACTURER_8 = 0x0100;
        /// Bit 9: the drive obeys the control word.
        REMOTE = 0x0200;
        /// Bit 10: target reached (profile modes), or the manufacturer's.
        TARGET_REACHED = 0x0400;
        /// Bit 11: an internal limit is active.
        INTERNAL_LIMIT = 0x0800;
        /// Bit 12 in csp, csv, cst: the drive follows the command value.
        FOLLOWS_COMMAND = 0x1000;
        /// Bit 12 in pp: the new set-point is acknowledged.
        SETPOINT_ACKNOWLEDGED = 0x1000;
        /// Bit 12 in hm: homing attained.
        HOMING_ATTAINED = 0x1000;
        /// Bit 13 in csp and pp: following error; in hm: homing error.
        FOLLOWING_ERROR = 0x2000;
    }
}

impl StatusWord {
    /// The state by the standard's masks; `None` for a pattern that the standard gives no meaning.
    pub fn state(self) -> Option<DriveState> {
        STATES[usize::from(self.0 & STATE_BITS)]
    }
}

/// The bits of the status word that any state's mask has.
const STATE_BITS: u16 = 0x6F;
/// The state by those bits.
const STATES: [Option<DriveState>; STATE_BITS as usize + 1] = {
    let mut states = [None; STATE_BITS as usize + 1];
    let mut bits = 0;
    while bits < states.len() {
        let mut at = 0;
        while at < DriveState::ALL.len() && states[bits].is_none() {
            let (mask, value) = DriveState::ALL[at].mask_and_value();
            if bits as u16 & mask == value {
                states[bits] = Some(DriveState::ALL[at]);
            }
            at += 1;
        }
        bits += 1;
    }
    states
};

word! {
    /// The control word, object 0x6040.
    ControlWord {
        /// Bit 0.
        SWITCH_ON = 0x0001;
        /// Bit 1.
        ENABLE_VOLTAGE = 0x0002;
        /// Bit 2, active low: 0 asks for a quick stop.
        QUICK_STOP = 0x0004;
        /// Bit 3.
        ENABLE_OPERATION = 0x0008;
        /// Bit 4 in pp: take the target position.
        NEW_SETPOINT = 0x0010;
        /// Bit 4 in hm: start homing; in ip: interpolate.
        START = 0x0010;
        /// Bit 5 in pp: do not finish the present move first.
        CHANGE_IMMEDIATELY = 0x0020;
        /// Bits 4 to 6 in vl: enable ramp, unlock ramp, use the target.
        VELOCITY_RAMP = 0x0070;
        /// Bit 7: the rising edge resets a fault.
        FAULT_RESET = 0x0080;
        /// Bit 8.
        HALT = 0x0100;
        /// The command "shutdown": to Ready to switch on.
        COMMAND_SHUTDOWN = 0x0006;
        /// The command "switch on": to Switched on.
        COMMAND_SWITCH_ON = 0x0007;
        /// The command "enable operation".
        COMMAND_ENABLE_OPERATION = 0x000F;
        /// The command "disable voltage": to Switch on disabled.
        COMMAND_DISABLE_VOLTAGE = 0x0000;
        /// The command "quick stop".
        COMMAND_QUICK_STOP = 0x0002;
    }
}

/// The state in which somebody wants the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Wanted {
    /// No voltage: the motor is free at once. The only way out of a quick stop.
    SwitchOnDisabled,
    /// High power may be on, the motor is free.
    ReadyToSwitchOn,
    /// One step before operation.
    SwitchedOn,
    /// The motor follows its setpoints.
    OperationEnabled,
    /// The drive brakes by its quick stop function and stays there.
    QuickStop,
}

impl Wanted {
    /// Whether a drive in `state` is where it is wanted.
    ///
    /// A drive that isn't in operation counts as stopped.
    pub fn is_reached(self, state: DriveState) -> bool {
        match self {
            Wanted::SwitchOnDisabled => state == DriveState::SwitchOnDisabled,
            Wanted::ReadyToSwitchOn => state == DriveState::ReadyToSwitchOn,
            Wanted::SwitchedOn => state == DriveState::SwitchedOn,
            Wanted::OperationEnabled => state == DriveState::OperationEnabled,
            Wanted::QuickStop => state != DriveState::OperationEnabled,
        }
    }

    /// The name of the wish, in the standard's words.
    pub const fn name(self) -> &'static str {
        match self {
            Wanted::SwitchOnDisabled => "Switch on disabled",
            Wanted::ReadyToSwitchOn => "Ready to switch on",
            Wanted::SwitchedOn => "Switched on",
            Wanted::OperationEnabled => "Operation enabled",
            Wanted::QuickStop => "Quick stop",
        }
    }
}

impl fmt::Display for Wanted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The control word that takes a drive in `state` one step towards `wanted`.
///
/// - A quick stop is held whatever is wanted, except [`Wanted::SwitchOnDisabled`]: the standard's way straight
///   back to operation (transition 16) is never taken.
/// - In a fault the reset bit is low, so that a later reset has its rising edge; see
///   [`Enabling::acknowledge`](crate::Enabling::acknowledge).
pub fn next_control_word(state: DriveState, wanted: Wanted) -> ControlWord {
    use DriveState as S;
    match (state, wanted) {
        (S::NotReadyToSwitchOn | S::FaultReactionActive | S::Fault, _) | (_, Wanted::SwitchOnDisabled) => {
            ControlWord::COMMAND_DISABLE_VOLTAGE
        }
        (S::QuickStopActive, _) | (_, Wanted::QuickStop) => ControlWord::COMMAND_QUICK_STOP,
        (S::SwitchOnDisabled, _) | (_, Wanted::ReadyToSwitchOn) => ControlWord::COMMAND_SHUTDOWN,
        (S::ReadyToSwitchOn, _) | (_, Wanted::SwitchedOn) => ControlWord::COMMAND_SWITCH_ON,
        (S::SwitchedOn | S::OperationEnabled, Wanted::OperationEnabled) => {
            ControlWord::COMMAND_ENABLE_OPERATION
        }
    }
}
