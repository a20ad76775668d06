//! What a drive is commanded by: what its law commands, or a mode of its own.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a drive is commanded by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DriveMode {
    /// Speeds (csv).
    Speed,
    /// Torques (cst).
    Torque,
}
