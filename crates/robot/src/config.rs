//! From the robot's file to objects: read, check, plan.
//!
//! 1. [`RobotFile`] is the file as written; [`Source`] reads it and knows where each setting stands.
//! 2. [`RobotPlan::check`] resolves it without any hardware and gives all [`Problem`]s at once.
//! 3. [`Robot::build`](crate::Robot::build) makes the stages of the cycle from the plan.

mod check;
mod drive_tables;
mod drives;
mod file;
mod guard_check;
mod guard_tables;
mod joystick;
mod joystick_check;
mod kind_keys;
mod mapping;
mod plan;
mod platform;
mod problem;
mod ready_maps;
mod sdo_writes;
mod source;
#[cfg(test)]
mod tests;
mod torque_limit;
mod units;

pub use check::ReadFile;
pub use drive_tables::*;
pub use file::*;
pub use guard_tables::*;
pub use joystick::*;
pub(crate) use mapping::find as find_object;
pub use mapping::{MapEntry, MapError, PdoPlan, parse_map, parse_object};
pub use plan::*;
pub use problem::{Location, Problem, ProblemKind};
pub use sdo_writes::SdoWriteRule;
pub(crate) use source::nearest;
pub use source::{Locations, Source};
pub use torque_limit::{TorqueLimit, TorqueLimitTold};
