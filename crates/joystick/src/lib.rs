//! The joystick at the robot's computer, a gamepad as well, by Linux evdev: from its events to what a person wishes.
//!
//! - [`event`]: [`RawEvent`], the kernel's `struct input_event`, from bytes that may be anything.
//! - [`description`]: [`Description`], what a device is and has; [`State`], where its axes and buttons are.
//! - [`shaping`]: [`Shaping`], from a raw axis to −1..1: offset, dead zone, expo, gain.
//! - [`ready`]: which ready map belongs to a device.
//! - [`map`]: [`Map`], which axis and button of a device does what: a ready map with the robot file's changes.
//! - [`joystick`]: [`Joystick`], the state machine: dead-man, frames, stop, loss, enabling again; gives [`JoystickCommand`]s.
//! - [`device`]: [`Device`], what a joystick's events come from; [`EvdevDevice`], the kernel's.
//! - [`find`]: which devices there are, and the one that a map fits.
//! - [`recording`]: events in a file, written and played.
//! - [`port`]: [`Port`], a device that may come and go, joined with its joystick.
//!
//! Nothing here belongs to the cycle's thread, and nothing waits or asks a clock: time is an argument. What a joystick
//! says is a part, −1..1, of the greatest speeds of whatever it drives.
#![forbid(unsafe_code)]

pub mod description;
pub mod device;
pub mod event;
pub mod find;
pub mod joystick;
pub mod map;
pub mod port;
pub mod ready;
pub mod recording;
pub mod shaping;

pub use description::{AxisRange, Description, State};
pub use device::{Device, EvdevDevice};
pub use event::RawEvent;
pub use find::{Finder, Installed};
pub use joystick::{Block, Hold, Joystick, JoystickCommand, JoystickFrame, Presence, Requests};
pub use map::{JoystickMapError, Map};
pub use port::Port;
pub use recording::{Recorded, Recorder};
pub use shaping::Shaping;
