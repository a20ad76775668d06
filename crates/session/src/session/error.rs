//! Why a robot's bus isn't in OP.

use std::fmt;

use omnibase_cia402::{Mode, SupportedModes};
use omnibase_ethercat::SetUpError;
use omnibase_ethercat::cyclic::{Goal, TransitionError};
use omnibase_ethercat::image::{CycleFit, PlanError};
use omnibase_ethercat::mailbox::MailboxError;
use omnibase_ethercat::mismatch::Mismatch;
use omnibase_ethercat::paced::ReachError;
use omnibase_ethercat::start_up::{StartUpError, StartUpFailure};
use omnibase_ethercat::state::{StateError, StateFailure};
use omnibase_ethercat::wire::{AlState, LinkError};

/// Why a robot's bus couldn't be brought to OP, or kept.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// Set-up failed: nobody there, somebody else there, a parameter refused.
    #[error(transparent)]
    SetUp(#[from] SetUpError),
    /// The process data don't fit.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// A SubDevice that the robot's file doesn't name.
    #[error(
        "{0}: expected a `[[drive]]` or a `[[device]]` for every SubDevice in the robot's file; `kind = \"ignore\"` brings \
         one along that nobody reads or writes"
    )]
    Unnamed(SetUpError),
    /// A hot-connect group is plugged in where it shifts positions that the file knows others by.
    #[error(
        "`{name}` is of a hot-connect group and at position {position}; the file knows another one by position {last}, which shifts with it: \
         plug the group in behind all that are known by position, or give these an alias"
    )]
    GroupInFront {
        /// Who is of the group.
        name: String,
        /// Its position.
        position: u16,
        /// The last position that is named in the file.
        last: u16,
    },
    /// A SubDevice has other process data than its file says, and no mailbox by which they could be changed.
    #[error(
        "`{name}` (SubDevice {position}): its {direction} are `{found}`, its file says `{expected}`; they can't be changed"
    )]
    Map {
        /// Its name.
        name: String,
        /// Its position.
        position: u16,
        /// Which of its data.
        direction: &'static str,
        /// The map by the plan.
        expected: String,
        /// The map that it has.
        found: String,
    },
    /// Frames can't be back in time.
    #[error(
        "bus.cycle_us = {cycle_us}, frames awaited for {timeout_us} us: the shortest cycle that fits is {fit}; choose a longer cycle, or await frames for longer (bus.receive_timeout_us)"
    )]
    CycleTooShort {
        /// The cycle, us.
        cycle_us: u64,
        /// How long its frames are awaited, us.
        timeout_us: u64,
        /// What they need.
        fit: CycleFit,
    },
    /// A SubDevice refused a state.
    #[error(transparent)]
    Reach(ReachError),
    /// A SubDevice didn't come as far in the time that it has.
    #[error("{cause}; `timeouts = {{ {key} = … }}` in its table of the robot's file gives it longer")]
    TooSlow {
        /// What it didn't do.
        cause: Box<SessionError>,
        /// The key of the robot's file by which it has longer.
        key: &'static str,
    },
    /// The port is broken.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// A SubDevice's watchdog isn't what was written: it would stop late, or never.
    #[error(
        "`{name}` (SubDevice {position}): its watchdog is {found} (registers 0x0400, 0x0420), expected {expected}"
    )]
    Watchdog {
        /// Its name.
        name: String,
        /// Its position.
        position: u16,
        /// As the robot's file wants it.
        expected: WatchdogRegisters,
        /// As it was read back.
        found: WatchdogRegisters,
    },
    /// A SubDevice's outputs don't trigger its watchdog, though that was written: it would never stop by itself.
    #[error(
        "`{name}` (SubDevice {position}): its outputs don't trigger its watchdog (control byte of SyncManager {sync_manager} is \
         {control:#04x}, expected bit 6 to be set)"
    )]
    Unwatched {
        /// Its name.
        name: String,
        /// Its position.
        position: u16,
        /// Which of its SyncManagers.
        sync_manager: u8,
        /// Its control byte, as it was read back.
        control: u8,
    },
    /// A drive lacks a mode that its file needs.
    #[error(
        "`{name}` (SubDevice {position}): its drive has no {mode} (0x6502 = {:#010x}), and its file needs {needed}",
        .supported.0
    )]
    Mode {
        /// Its name.
        name: String,
        /// Its position.
        position: u16,
        /// The mode that it lacks.
        mode: Mode,
        /// All modes that it needs.
        needed: String,
        /// What it supports.
        supported: SupportedModes,
    },
    /// A SubDevice's process data have another length than the plan says.
    #[error("`{name}` has {found} bytes of {direction}, its file says {expected}")]
    Length {
        /// Its name.
        name: String,
        /// Which of its data.
        direction: &'static str,
        /// Bytes by the plan.
        expected: usize,
        /// Bytes on the bus.
        found: usize,
    },
}

impl From<ReachError> for SessionError {
    fn from(error: ReachError) -> Self {
        match error {
            ReachError::Link(error) => SessionError::Link(error),
            ReachError::Transition { .. } => SessionError::Reach(error).with_way_out(),
        }
    }
}

impl SessionError {
    /// A set-up by the robot's file that failed.
    pub(super) fn of_configuration(error: SetUpError) -> Self {
        match error {
            SetUpError::Mismatch(Mismatch::Count { expected, found, .. }) if found > expected => {
                SessionError::Unnamed(error)
            }
            other => SessionError::SetUp(other).with_way_out(),
        }
    }

    /// The same; where time alone was missing, with the key that gives more of it.
    fn with_way_out(self) -> Self {
        match self.key_of_time() {
            Some(key) => SessionError::TooSlow { cause: Box::new(self), key },
            None => self,
        }
    }

    fn key_of_time(&self) -> Option<&'static str> {
        let of_state = |state| match state {
            AlState::Init => "init_ms",
            AlState::PreOp | AlState::Bootstrap => "pre_op_ms",
            AlState::SafeOp | AlState::Op => "safe_op_op_ms",
        };
        let of_mailbox = |error: &MailboxError| {
            let is_late = matches!(error, MailboxError::Timeout { .. });
            is_late.then_some("mailbox_ms")
        };
        let of_change = |error: &StateError| {
            let is_late = matches!(error.cause, StateFailure::Timeout(_));
            is_late.then(|| of_state(error.requested))
        };
        let of_start_up = |error: &StartUpError| match &error.cause {
            StartUpFailure::State { error, .. } => of_change(error),
            StartUpFailure::Sdo { error, .. } => of_mailbox(error),
            _ => None,
        };
        match self {
            SessionError::SetUp(SetUpError::State(error)) => of_change(error),
            SessionError::SetUp(SetUpError::Request { cause, .. }) => of_mailbox(cause),
            SessionError::SetUp(SetUpError::StartUp(error)) => of_start_up(error),
            SessionError::Reach(ReachError::Transition { goal: Goal::Op, error }) => match &**error {
                TransitionError::StateTimeout { target, .. } => Some(of_state(*target)),
                TransitionError::Sdo(error) => of_start_up(error),
                _ => None,
            },
            _ => None,
        }
    }
}

/// The registers of a drive's process-data watchdog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WatchdogRegisters {
    /// Register 0x0400: units of 40 ns, less 2.
    pub divider: u16,
    /// Register 0x0420: multiples of the divided clock; 0 is off.
    pub process_data: u16,
}

impl fmt::Display for WatchdogRegisters {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match u64::from(self.process_data) * 40 * (u64::from(self.divider) + 2) {
            0 => f.write_str("off"),
            ns => write!(f, "{} us", ns as f64 * 1e-3),
        }
    }
}
