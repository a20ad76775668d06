//! The CiA 402 drive profile (IEC 61800-7-201) as pure logic: it knows no bus, no robot and no clock.
//!
//! - [`state`]: [`DriveState`], [`StatusWord`], [`ControlWord`] and the way from a state to a wanted one.
//! - [`mode`]: modes of operation, their codes in 0x6060/0x6061 and their bits in 0x6502.
//! - [`enabling`]: [`Enabling`] takes one drive to Operation Enabled without a jump, switches modes while
//!   it runs, names faults, and never leaves a stop by itself.
//! - [`scaling`]: newtypes between the drive's units and SI.
//! - [`object`]: the profile's objects by index, subindex, type and name; [`error_code`]: 0x603F in words; [`mod@unit`]: what their numbers are of.
//!
//! Principles: one call per cycle with that cycle's inputs gives that cycle's outputs; time is an argument;
//! nothing allocates and nothing panics on any value that a drive may send.
#![forbid(unsafe_code)]
#![cfg_attr(not(test), no_std)]

pub mod enabling;
pub mod error_code;
pub mod mode;
pub mod object;
pub mod scaling;
pub mod state;
pub mod unit;

pub use enabling::{DriveRequest, Enabling, EnablingError, Feedback, Output, Progress, Settings, Targets};
pub use error_code::ErrorCode;
pub use mode::{Mode, Quantity, SupportedModes};
pub use object::{DataType, Object};
pub use scaling::{EncoderScale, PositionCounts, TorquePerMille, TorqueScale};
pub use state::{ControlWord, DriveState, StatusWord, Wanted, next_control_word};
pub use unit::{ObjectUnit, SiUnit, unit_of};
