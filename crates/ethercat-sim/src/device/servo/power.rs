//! The drive's power state machine (CiA 402-2, "Finite state automaton").

/// States of the power drive system.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PowerState {
    /// Starting.
    NotReadyToSwitchOn,
    /// No high voltage asked for.
    SwitchOnDisabled,
    /// High voltage may be switched on.
    ReadyToSwitchOn,
    /// High voltage is on, no torque.
    SwitchedOn,
    /// Torque.
    OperationEnabled,
    /// Stopping, or holding after a stop.
    QuickStopActive,
    /// Stopping because of a fault.
    FaultReactionActive,
    /// Fault, no torque.
    Fault,
}

impl PowerState {
    /// The statusword's state bits.
    pub fn status_bits(self) -> u16 {
        match self {
            PowerState::NotReadyToSwitchOn => 0x00,
            PowerState::SwitchOnDisabled => 0x40,
            PowerState::ReadyToSwitchOn => 0x21,
            PowerState::SwitchedOn => 0x23,
            PowerState::OperationEnabled => 0x27,
            PowerState::QuickStopActive => 0x07,
            PowerState::FaultReactionActive => 0x0F,
            PowerState::Fault => 0x08,
        }
    }

    /// Whether the drive is ready to give torque, or gives it.
    pub fn is_switched_on(self) -> bool {
        self == PowerState::SwitchedOn || self.is_energized()
    }

    /// Whether the motor gets torque.
    pub fn is_energized(self) -> bool {
        matches!(
            self,
            PowerState::OperationEnabled | PowerState::QuickStopActive | PowerState::FaultReactionActive
        )
    }
}

/// What the controlword's bits 0 to 3 ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PowerCommand {
    DisableVoltage,
    QuickStop,
    Shutdown,
    SwitchOn,
    EnableOperation,
}

impl PowerCommand {
    pub fn new(control: u16) -> Self {
        match control & 0x0F {
            bits if bits & 0b0010 == 0 => PowerCommand::DisableVoltage,
            bits if bits & 0b0100 == 0 => PowerCommand::QuickStop,
            bits if bits & 0b0001 == 0 => PowerCommand::Shutdown,
            bits if bits & 0b1000 == 0 => PowerCommand::SwitchOn,
            _ => PowerCommand::EnableOperation,
        }
    }
}

/// What a command leads to from a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reaction {
    /// Nothing.
    Stay,
    /// This state at once.
    Enter(PowerState),
    /// A stop by option code 0x605A.
    QuickStop,
    /// Down to "ready to switch on" by option code 0x605B.
    Shutdown,
    /// Down to "switched on" by option code 0x605C.
    Disable,
}

/// Transitions 2 to 12 and 16.
pub(super) fn react(state: PowerState, command: PowerCommand) -> Reaction {
    use PowerCommand as C;
    use PowerState as S;
    match (state, command) {
        (S::SwitchOnDisabled, C::Shutdown) => Reaction::Enter(S::ReadyToSwitchOn),
        (S::ReadyToSwitchOn, C::SwitchOn | C::EnableOperation) => Reaction::Enter(S::SwitchedOn),
        (S::SwitchedOn, C::EnableOperation) => Reaction::Enter(S::OperationEnabled),
        (S::SwitchedOn, C::Shutdown) => Reaction::Enter(S::ReadyToSwitchOn),
        (S::ReadyToSwitchOn | S::SwitchedOn, C::QuickStop | C::DisableVoltage) => {
            Reaction::Enter(S::SwitchOnDisabled)
        }
        (S::OperationEnabled | S::QuickStopActive, C::DisableVoltage) => Reaction::Enter(S::SwitchOnDisabled),
        (S::OperationEnabled, C::QuickStop) => Reaction::QuickStop,
        (S::OperationEnabled, C::Shutdown) => Reaction::Shutdown,
        (S::OperationEnabled, C::SwitchOn) => Reaction::Disable,
        (S::QuickStopActive, C::EnableOperation) => Reaction::Enter(S::OperationEnabled),
        _ => Reaction::Stay,
    }
}
