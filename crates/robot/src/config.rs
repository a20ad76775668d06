//! The robot's file, and the plan that is made of it.
//!
//! 1. [`RobotFile`] is the file as written; [`Source`] reads it and knows where each setting stands.
//! 2. [`RobotPlan::check`] resolves it without any hardware and gives all [`Problem`]s at once ([`check`](crate::check)).
//! 3. [`Robot::build`](crate::Robot::build) makes the stages of the cycle from the plan.

mod axis_plan;
mod axis_tables;
mod believed;
mod bus_config;
mod bus_plan;
mod custom;
mod device_plan;
mod device_tables;
mod drive_mode;
mod drive_plan;
mod drive_tables;
mod event_plan;
mod file;
mod grip_tables;
mod guard_tables;
mod joystick;
mod map_tables;
mod mapping;
mod plan;
mod problem;
mod ready_maps;
pub(crate) mod recorded_bytes;
mod reference_table;
mod run_tables;
mod sdo_writes;
mod sensor_tables;
mod simulation_tables;
mod source;
mod source_tables;
mod start_plan;
mod start_tables;
mod torque_limit;
mod units;

pub(crate) use axis_plan::AxisObject;
pub use axis_plan::{AxisLimits, AxisPlan, AxisScale, HomingPlan};
pub use axis_tables::*;
pub(crate) use believed::{ESTIMATE_BOUNDS, rated_nm, rim_per_count_m, wheel_kg};
pub use bus_config::sync_manager;
pub use bus_plan::{BusPlace, BusPlan, DriveWatchdog, Identity, ParameterPlan};
pub use custom::Parameters;
pub(crate) use device_plan::signal_layout;
pub use device_plan::{Coding, DevicePlan, InputPlan, OutputPlan};
pub use device_tables::*;
pub use drive_mode::DriveMode;
pub use drive_plan::{DrivePlan, DriveScale, Misfit, SpeedLoopPlan};
pub use drive_tables::*;
pub use event_plan::{EventPlan, Happening};
pub use file::*;
pub use grip_tables::*;
pub use guard_tables::*;
pub use joystick::*;
pub use map_tables::*;
pub use mapping::{MapEntry, PdoMapError, PdoPlan, parse_map, parse_object};
pub(crate) use mapping::{find as find_object, has_padding, is_mapped, length_with_padding};
pub use plan::*;
pub use problem::{Location, Problem, ProblemKind};
pub use reference_table::*;
pub use run_tables::*;
pub use sdo_writes::SdoWriteRule;
pub(crate) use sdo_writes::owner;
pub use sensor_tables::*;
pub use simulation_tables::*;
pub use source::{Locations, Source, choice_names, nearest};
pub use source_tables::*;
pub use start_plan::DcPlan;
pub use start_tables::*;
pub(crate) use torque_limit::TORQUE_LIMIT_OBJECTS;
pub use torque_limit::{TorqueLimit, TorqueLimitTold};
