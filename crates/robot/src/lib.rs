//! The control half of a robot: from the drives' inputs to their outputs, once a cycle.
//!
//! - [`Robot::compute`]: the cycle, one function whose stages stand in source order.
//! - [`signals`]: the plain structs that flow between stages, all in one [`CycleRecord`].
//! - [`stages`]: what a device, estimator, reference, controller and safety chain are; [`Registry`]: all that is chosen by name.
//! - [`config`]: a robot's file and its [`RobotPlan`]; [`check`]: from the one to the other, with every problem and its place.
//! - [`joystick_shape`]: [`JoystickShape`], gains, dead zones and expo of a joystick, which change while the robot runs.
//! - [`guard`]: the footprint stays inside the fence and off obstacles.
//! - [`layouts`], [`devices`], [`peripherals`], [`estimators`], [`references`], [`controllers`]: the built-in kinds; [`limiter`], [`safety`].
//!
//! Principles: a cycle has no link, no clock, no queue and no allocation: the same inputs give the same bits, so a
//! record can be replayed. A lost frame, a NaN and a drive's fault are values that end in a defined stop.
#![forbid(unsafe_code)]

mod ability;
mod blind_ramp;
mod built_in;
pub mod check;
pub mod config;
pub mod controllers;
mod cycle;
mod decay;
pub mod devices;
mod drive_modes;
pub mod dry;
pub mod estimators;
mod events;
mod grip;
pub mod guard;
mod image;
pub mod joystick_shape;
pub mod layouts;
mod lifecycle;
pub mod limiter;
mod motion;
mod obstacle;
pub mod peripherals;
mod receivers;
pub mod references;
pub mod registry;
pub mod safety;
mod settings;
pub mod signals;
pub mod stages;
mod swing;
pub mod torque_loop;
mod traction;
mod unread;

pub use ability::Ability;
pub use config::{Problem, RobotFile, RobotPlan};
pub use cycle::Robot;
pub use image::{ImageBuffer, ProcessImage};
pub use joystick_shape::{AxisShape, JoystickShape};
pub use registry::{Registry, StageError};
pub use settings::MOST_SETTINGS;
pub use signals::{CycleRecord, CycleTime, Exchange, Phase, Request, RequestKind};
