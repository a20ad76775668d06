//! Why a transition failed.

use core::fmt;
use core::time::Duration;

use crate::config::DcConfig;
use crate::found::Found;
use crate::start_up::StartUpError;
use crate::wire::{AlState, AlStatusCode, spoken};

/// What a SubDevice was given before it refused.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Programmed {
    /// Length of its outputs, bytes.
    pub output_bytes: u32,
    /// Length of its inputs, bytes.
    pub input_bytes: u32,
    /// SYNC0 and SYNC1.
    pub sync: DcConfig,
}

impl fmt::Display for Programmed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} bytes of outputs, {} bytes of inputs, ", self.output_bytes, self.input_bytes)?;
        match self.sync {
            DcConfig::Off => f.write_str("SYNC off"),
            DcConfig::Sync0 { cycle_ns, shift_ns } => {
                write!(f, "SYNC0 every {cycle_ns} ns shifted by {shift_ns} ns")
            }
            DcConfig::Sync0And1 { cycle_ns, shift_ns, sync1_cycle_ns } => write!(
                f,
                "SYNC0 every {cycle_ns} ns shifted by {shift_ns} ns, SYNC1 with {sync1_cycle_ns} ns"
            ),
        }
    }
}

/// Names the state and the error bit of an AL status.
struct Status(u16);

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match AlState::from_bits(self.0) {
            Some(state) => write!(f, "{state}")?,
            None => write!(f, "unknown state 0x{:04x}", self.0)?,
        }
        if self.0 & AlState::ERROR != 0 { f.write_str(" with error") } else { Ok(()) }
    }
}

/// Names the probable cause, where one is known.
struct Cause(AlStatusCode);

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0.probable_cause() {
            "" => Ok(()),
            cause => write!(f, "; probable cause: {cause}"),
        }
    }
}

/// Why a transition between states failed, and where.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TransitionError {
    /// An SDO that is for SAFE-OP couldn't be written.
    #[error("in SAFE-OP, {0}")]
    Sdo(StartUpError),
    /// A clock stayed too far from the reference.
    #[error(
        "the clock of SubDevice {position} is {difference_ns} ns from the reference after {}, \
         the limit is {limit_ns} ns", spoken(*.after)
    )]
    NotLocked {
        /// The farthest clock.
        position: u16,
        /// Register 0x092C.
        difference_ns: i32,
        /// Limit.
        limit_ns: u32,
        /// How long it was tried.
        after: Duration,
    },
    /// No time came from the reference clock.
    #[error("the reference clock gave no time for {}", spoken(*.after))]
    ClockSilent {
        /// How long.
        after: Duration,
    },
    /// No frame came back with a register access, however often it was tried.
    #[error(
        "no frame came back with register 0x{register:04x} of SubDevice {position}: frames are lost on their way"
    )]
    RegisterUnheard {
        /// Position.
        position: u16,
        /// First register.
        register: u16,
    },
    /// A register access failed again and again.
    #[error(
        "SubDevice {position} does not take register 0x{register:04x}: {}", Found::WorkingCounter(*.working_counter).against(1)
    )]
    RegisterRefused {
        /// Position.
        position: u16,
        /// First register.
        register: u16,
        /// That of the last answer.
        working_counter: u16,
    },
    /// A SubDevice reports an error instead of the state.
    #[error("SubDevice {position} refuses {target} and is in {}: {code}{}; programmed: {programmed}", Status(*.status), Cause(*.code))]
    StateRefused {
        /// Position.
        position: u16,
        /// The state that was asked.
        target: AlState,
        /// AL status (0x0130).
        status: u16,
        /// Its reason.
        code: AlStatusCode,
        /// What it had been given.
        programmed: Programmed,
    },
    /// A SubDevice doesn't reach the state.
    #[error("SubDevice {position} is still in {} after {}, {target} was asked; programmed: {programmed}", Status(*.status), spoken(*.after))]
    StateTimeout {
        /// Position.
        position: u16,
        /// The state that was asked.
        target: AlState,
        /// AL status (0x0130).
        status: u16,
        /// How long it was given.
        after: Duration,
        /// What it had been given.
        programmed: Programmed,
    },
    /// A SubDevice doesn't answer any more.
    #[error("SubDevice {position} did not answer at its station address for {}", spoken(*.after))]
    Unreachable {
        /// Position.
        position: u16,
        /// How long.
        after: Duration,
    },
    /// The states are right, the process data aren't.
    #[error(
        "datagram {datagram} of frame {frame} brings working counter {received} in place of {expected} in OP"
    )]
    ProcessData {
        /// Frame of the cycle.
        frame: u16,
        /// Datagram in it.
        datagram: u16,
        /// Expected working counter.
        expected: u16,
        /// What came.
        received: u16,
    },
    /// Frames kept being lost.
    #[error("frames kept being lost for {}", spoken(*.after))]
    FramesLost {
        /// How long.
        after: Duration,
    },
}
