//! What every SubDevice's table may say of its start: the longest waits, and its events of distributed clocks.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The longest waits for a SubDevice, as its maker's file gives them; default: those for any device.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct TimeoutsTable {
    /// To INIT, ms; default: 5000.
    #[schemars(range(min = 1, max = 600_000))]
    pub init_ms: Option<u32>,
    /// From INIT to PRE-OP, ms; default: 3000.
    #[schemars(range(min = 1, max = 600_000))]
    pub pre_op_ms: Option<u32>,
    /// To SAFE-OP, and from there to OP, ms; default: 10000.
    #[schemars(range(min = 1, max = 600_000))]
    pub safe_op_op_ms: Option<u32>,
    /// From a message to its mailbox to the answer, ms; default: 2000.
    #[schemars(range(min = 1, max = 600_000))]
    pub mailbox_ms: Option<u32>,
}

/// A SubDevice's events of distributed clocks, as a mode (`OpMode`) of its maker's file gives them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct DcTable {
    /// AssignActivate, as `"0x0700"`: what the registers 0x0980 (low byte) and 0x0981 are told. 0x0300 is SYNC0, 0x0400
    /// SYNC1; default: `"0x0300"`.
    pub assign_activate: Option<String>,
    /// SYNC0s in each of its cycles; default: 1.
    #[schemars(range(min = 1, max = 100))]
    pub sync0_per_cycle: Option<u16>,
    /// When in the cycle SYNC0 comes, us; default: `bus.sync0_shift_us`. Not a drive's, for drives act together.
    #[schemars(range(min = -100_000, max = 100_000))]
    pub sync0_shift_us: Option<i32>,
    /// SYNC1 comes with each n-th SYNC0; default: 1.
    #[schemars(range(min = 1, max = 1000))]
    pub sync1_every: Option<u16>,
    /// So long behind that SYNC0, us; default: 0.
    #[schemars(range(min = 0, max = 100_000))]
    pub sync1_shift_us: Option<u32>,
}
