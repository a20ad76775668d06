//! Where a transition leads, by which steps, and how long each may take.

use core::time::Duration;

use crate::wire::AlState;

/// Limits of the way to OP.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TransitionOptions {
    /// Every clock must be nearer to the reference than this (0x092C) before SYNC0 is armed, ns.
    pub lock_limit_ns: u32,
    /// Looks at all clocks in a row that must be within the limit.
    pub lock_rounds: u32,
    /// The longest wait for that.
    pub lock_timeout: Duration,
    /// How far ahead of the present the first SYNC0 is put.
    pub sync_margin: Duration,
    /// The longest wait for a state.
    pub state_timeout: Duration,
    /// Complete exchanges in a row before OP is asked, and before it is believed; more where the slowest SubDevice's
    /// turn comes less often.
    pub settle_cycles: u32,
    /// The longest wait for those.
    pub settle_timeout: Duration,
}

impl Default for TransitionOptions {
    fn default() -> Self {
        TransitionOptions {
            lock_limit_ns: 1000,
            lock_rounds: 10,
            lock_timeout: Duration::from_secs(10),
            sync_margin: Duration::from_millis(100),
            state_timeout: Duration::from_secs(10),
            settle_cycles: 10,
            settle_timeout: Duration::from_secs(2),
        }
    }
}

/// Where a transition leads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Goal {
    /// OP, with clocks locked and SYNC as configured.
    Op,
    /// PRE-OP, SYNC off.
    PreOp,
    /// INIT, SYNC off.
    Init,
}

impl Goal {
    /// The state that everyone shall be in.
    pub fn state(self) -> AlState {
        match self {
            Goal::Op => AlState::Op,
            Goal::PreOp => AlState::PreOp,
            Goal::Init => AlState::Init,
        }
    }
}

/// The steps, in their order; [`Goal::Op`] takes the first half.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Waiting until all clocks agree with the reference.
    LockClocks,
    /// SYNC off (0x0981), so that a new start time is taken.
    SyncOff,
    /// SYNC unit given to the MainDevice (0x0980).
    CyclicControl,
    /// SYNC0 cycle time (0x09A0).
    Sync0Cycle,
    /// SYNC1 cycle time (0x09A4).
    Sync1Cycle,
    /// Start time (0x0990).
    StartTime,
    /// SYNC on (0x0981).
    SyncOn,
    /// The n-th SyncManager of each SubDevice that is on in OP alone: on, or off on the way back.
    OpOnly(u8),
    /// Asking for a state.
    Ask(AlState),
    /// Waiting for it.
    Await(AlState),
    /// Waiting for complete exchanges in that state.
    Settle(AlState),
    /// Writing the SDOs that are for SAFE-OP.
    Sdos,
}
