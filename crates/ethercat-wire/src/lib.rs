//! What both ends of an EtherCAT cable agree on: byte layouts, register addresses, and the link between them.
//!
//! The MainDevice (`omnibase-ethercat`) and the simulated segment (`omnibase-ethercat-sim`) share this crate
//! and nothing else, so that a mistake in one of them cannot cancel out in the other. Every layout here is
//! pinned by bytes from outside: the standard, and recordings of real devices.
//!
//! - [`frame`]: Ethernet frames and the datagrams in them; [`Command`], [`Address`].
//! - [`register`]: the ESC register map; [`al`]: application layer states and status codes.
//! - [`sii`]: the device's EEPROM image; [`mailbox`], [`coe`] and [`foe`]: acyclic data.
//! - [`link`]: the two functions through which frames leave and arrive; [`time`]: instants that don't mix.
//!
//! No operating system and no logic of a protocol partner is in here. Layouts are checked once, when bytes
//! become a value; afterwards nothing can fail.
#![forbid(unsafe_code)]
#![cfg_attr(not(test), no_std)]
extern crate alloc;

pub mod al;
pub mod bytes;
pub mod coe;
pub mod command;
pub mod foe;
pub mod frame;
pub mod link;
pub mod mailbox;
pub mod printable;
pub mod register;
pub mod sii;
pub mod time;

pub use al::{AlState, AlStatusCode};
pub use command::{Address, Command};
pub use link::{Link, LinkError, RingState};
pub use time::{Clock, DcTime, HostTime, spoken};
