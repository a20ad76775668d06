//! What a drive is commanded by: what its law commands, or a mode of its own.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::mapping::is_mapped;
use super::plan::DrivePlan;
use crate::signals::Quantity;

/// What a drive is commanded by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DriveMode {
    /// Speeds (csv).
    Speed,
    /// Torques (cst).
    Torque,
}

/// Why a drive can't be commanded in a mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Misfit {
    /// The law commands torques, and no speed follows from a torque.
    NoSpeedOfATorque,
    /// The law commands speeds, and nothing makes torques of them.
    NoSpeedLoop,
    /// The object that is told isn't in the drive's process data, whole and at a byte.
    NotMapped {
        /// Its index.
        object: u16,
        /// Its length.
        bits: u8,
    },
}

impl DrivePlan {
    /// Why the drive can't follow a law that commands so, in a mode; `None` is the mode in which it takes what the law
    /// commands. Nothing where it can.
    pub fn misfits(&self, mode: Option<DriveMode>, commanded: Quantity) -> Vec<Misfit> {
        let (object, bits) = match (commanded, mode) {
            (Quantity::Nothing, _) => return Vec::new(),
            (Quantity::Torque, Some(DriveMode::Speed)) => return vec![Misfit::NoSpeedOfATorque],
            (Quantity::Speed, None | Some(DriveMode::Speed)) => (0x60FF, 32),
            (_, Some(DriveMode::Torque)) | (Quantity::Torque, None) => (0x6071, 16),
        };
        let needs_loop = (commanded, mode) == (Quantity::Speed, Some(DriveMode::Torque));
        let no_loop = (needs_loop && self.speed_loop.is_none()).then_some(Misfit::NoSpeedLoop);
        let not_mapped =
            (!is_mapped(&self.outputs, object, bits)).then_some(Misfit::NotMapped { object, bits });
        no_loop.into_iter().chain(not_mapped).collect()
    }
}
