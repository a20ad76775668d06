//! What happened since a robot stopped: a loss and nothing else, or more than that.

use omnibase_cia402::{DriveState, ErrorCode, StatusWord};
use omnibase_robot::config::ComebackPlan;
use omnibase_robot::signals::{CycleRecord, Exchange, MAX_WHEELS, SafetyReason};

/// What was seen since the robot stopped.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct SinceStop {
    is_stopped: bool,
    /// Something else than a loss stopped it, at first or since.
    other: bool,
    /// Drives that showed a fault; bit n for wheel n.
    faulty: u16,
    /// Of them, those that said that the bus made it.
    of_the_bus: u16,
    /// A drive said that something else did.
    own_fault: bool,
    /// Drives that started anew.
    restarted: u16,
    all_wheels: u16,
    /// Exchanges in a row in which no drive was heard, and the most of them.
    unheard: u32,
    most_unheard: u32,
    /// An input was seen that stops, or doesn't enable.
    by_input: bool,
    /// Drives with high voltage while the robot ran, and those that were heard without it since.
    had_voltage: u16,
    lost_voltage: u16,
}

/// Why nothing may come by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Spoilt {
    /// It wasn't, or wasn't only, a loss.
    OtherStop,
    /// A drive's own fault.
    DriveFault,
    /// No drive was heard: a supply that was cut looks like that.
    AllVanished,
    /// A drive that was heard all the time has no high voltage.
    NoVoltage,
    /// An input stopped the robot, or didn't enable it.
    Input,
}

impl Spoilt {
    pub(super) fn text(self) -> &'static str {
        match self {
            Spoilt::OtherStop => "more than a loss stopped the robot: nothing goes on by itself",
            Spoilt::DriveFault => "a drive failed since the stop: nothing goes on by itself",
            Spoilt::AllVanished => {
                "all drives vanished, as when an emergency stop cuts the supply: nothing goes on by itself"
            }
            Spoilt::Input => "an input stopped the robot meanwhile: nothing goes on by itself",
            Spoilt::NoVoltage => {
                "a drive lost its high voltage, as by an emergency stop: nothing goes on by itself"
            }
        }
    }
}

impl SinceStop {
    /// The robot runs: what was before is over.
    pub(super) fn begin(&mut self, record: &CycleRecord) {
        let (unheard, had_voltage) = (self.unheard, self.had_voltage);
        *self = SinceStop { unheard, had_voltage, all_wheels: all_wheels(record), ..SinceStop::default() };
        for wheel in heard(record) {
            let drive = &record.measurements.drives[wheel];
            self.had_voltage |= u16::from(drive.status.contains(StatusWord::VOLTAGE_ENABLED)) << wheel;
        }
        self.count_unheard(record.exchange);
    }

    /// A cycle since.
    pub(super) fn look(&mut self, record: &CycleRecord, plan: Option<&ComebackPlan>) {
        let is_loss = matches!(record.stop_reason, SafetyReason::DeviceLost | SafetyReason::ExchangeLost);
        // Once somebody acknowledged, or asked for the drives, there is none.
        self.other |= !is_loss && (!self.is_stopped || record.stop_reason != SafetyReason::None);
        self.is_stopped = true;
        self.by_input |= plan.is_some_and(|plan| is_by_input(record, plan));
        self.all_wheels = all_wheels(record);
        if let Exchange::Restarted { wheels } = record.exchange {
            self.restarted |= wheels;
        }
        self.count_unheard(record.exchange);
        for wheel in heard(record) {
            let drive = &record.measurements.drives[wheel];
            let bit = 1 << wheel;
            let state = drive.status.state();
            if matches!(state, Some(DriveState::Fault | DriveState::FaultReactionActive)) {
                self.faulty |= bit;
                if drive.error != ErrorCode::NONE {
                    self.drive_said(wheel, drive.error, plan);
                }
            }
            // One that starts anew has none at first.
            let is_up = !matches!(state, None | Some(DriveState::NotReadyToSwitchOn));
            let is_without = !drive.status.contains(StatusWord::VOLTAGE_ENABLED);
            if is_up && is_without && self.restarted & bit == 0 {
                self.lost_voltage |= bit & self.had_voltage;
            }
        }
    }

    /// A drive said what is wrong with it.
    pub(super) fn drive_said(&mut self, wheel: usize, error: ErrorCode, plan: Option<&ComebackPlan>) {
        if error == ErrorCode::NONE || wheel >= MAX_WHEELS {
            return;
        }
        if plan.map_or(error.is_communication(), |plan| plan.is_of_the_bus(wheel, error)) {
            self.of_the_bus |= 1 << wheel;
        } else {
            self.own_fault = true;
        }
    }

    fn is_all(&self, wheels: u16) -> bool {
        self.all_wheels != 0 && wheels & self.all_wheels == self.all_wheels
    }

    fn count_unheard(&mut self, exchange: Exchange) {
        self.unheard = match exchange {
            Exchange::Lost => self.unheard.saturating_add(1),
            Exchange::Without { wheels, .. } if self.is_all(wheels) => self.unheard.saturating_add(1),
            // Nobody knows yet who was heard.
            Exchange::ShortCount { .. } => self.unheard,
            Exchange::Complete | Exchange::Restarted { .. } | Exchange::Without { .. } => 0,
        };
        self.most_unheard = self.most_unheard.max(self.unheard);
    }

    /// Why nothing may come by itself, as far as it is known by now.
    pub(super) fn spoilt(&self, plan: &ComebackPlan) -> Option<Spoilt> {
        if self.most_unheard > plan.lost_exchanges_tolerated || self.is_all(self.restarted) {
            Some(Spoilt::AllVanished)
        } else if self.own_fault {
            Some(Spoilt::DriveFault)
        } else if self.lost_voltage != 0 {
            Some(Spoilt::NoVoltage)
        } else if self.by_input {
            Some(Spoilt::Input)
        } else if self.other {
            Some(Spoilt::OtherStop)
        } else {
            None
        }
    }

    /// A fault of which no drive said why: where that isn't known it may be anything.
    pub(super) fn unexplained(&self) -> Option<Spoilt> {
        (self.faulty & !self.of_the_bus != 0).then_some(Spoilt::DriveFault)
    }
}

/// Whether somebody stops the robot by an input that is heard; one that isn't is a part of the loss.
fn is_by_input(record: &CycleRecord, plan: &ComebackPlan) -> bool {
    let signals = &record.signals;
    let stops =
        |input| signals.was_raised(input) || signals.believed(input).is_some_and(|value| value != 0.0);
    let forbids = |input| signals.was_zeroed(input) || signals.believed(input) == Some(0.0);
    plan.stop_input.is_some_and(stops) || plan.enable_input.is_some_and(forbids)
}

/// Bit n for wheel n of the robot.
fn all_wheels(record: &CycleRecord) -> u16 {
    ((1_u32 << record.measurements.present().len()) - 1) as u16
}

/// The wheels that were heard in a cycle.
fn heard(record: &CycleRecord) -> impl Iterator<Item = usize> {
    let (exchange, wheels) = (record.exchange, record.measurements.present().len());
    (0..wheels).filter(move |wheel| exchange.has_inputs_of(*wheel))
}
