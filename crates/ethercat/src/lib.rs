//! An EtherCAT MainDevice without an operating system in it.
//!
//! Set-up and cyclic exchange are different types: [`SubDevice`]s are found, configured and brought to PRE-OP by
//! code that may allocate and wait; what runs in the cycle does neither.
//!
//! Set-up, in the order in which it happens:
//!
//! - [`bus`]: a segment while it is being set up; [`scan`] finds what is there, [`configure`] makes of it what is
//!   asked, [`clock_setup`] makes the clocks run together.
//! - [`transaction`]: datagrams in frames, matched, repeated, their working counters checked.
//! - [`eeprom`], [`topology`], [`state`], [`sync_manager`], [`mapping`], [`fmmu`], [`watchdog`]: one matter each.
//! - [`trouble`]: what usually goes wrong with cables, power and order, and what to do.
//! - [`modules`]: what is plugged into a modular device, against what it is configured for.
//! - [`field`]: what is done to a SubDevice where it stands: its EEPROM written, files read and written (FoE).
//! - [`start_up`]: everything that takes one SubDevice from INIT to OP, as data that can be replayed.
//! - [`subdevice`]: what is known about a SubDevice; [`config`]: what the user asks of it; [`error`].
//!
//! The cycle:
//!
//! - [`image`]: where process data stand, and which datagrams of which frames carry them.
//! - [`cyclic`]: exchange, the way to OP and back, diagnosis, recovery, acyclic work, both directions of clock
//!   following.
//! - [`paced`]: the same in time: sleep, exchange, follow or lead the clocks, and the way back to INIT.
//!
//! Used by set-up and cycle alike:
//!
//! - [`redundant`]: two interfaces at the ends of a ring as one link.
//! - [`procedure`]: how a protocol that takes several datagrams is written without a link or a clock in it.
//! - [`mailbox`]: the one owner of a SubDevice's mailbox: SDOs, SDO Information, emergencies.
#![forbid(unsafe_code)]
#![cfg_attr(not(test), no_std)]
extern crate alloc;

mod address_range;
pub mod bus;
pub mod clock_setup;
pub mod config;
pub mod configure;
pub mod cyclic;
pub mod eeprom;
pub mod error;
pub mod field;
pub mod fmmu;
mod found;
mod identification;
pub mod image;
pub mod mailbox;
pub mod mapping;
pub mod mismatch;
pub mod modules;
pub mod paced;
pub mod procedure;
mod process_data;
pub mod redundant;
pub mod scan;
pub mod start_up;
pub mod state;
pub mod subdevice;
pub mod sync_manager;
pub mod topology;
pub mod transaction;
pub mod trouble;
pub mod watchdog;

pub use omnibase_ethercat_wire as wire;

pub use bus::{Bus, BusOptions, Warning};
pub use config::{DcConfig, Match, Presence, SubDeviceConfig};
pub use cyclic::{CyclicBus, CyclicParts, Exchange};
pub use error::SetUpError;
pub use image::{ImagePlan, Member, ProcessImage};
pub use procedure::{Answer, DatagramRequest, Next, Procedure};
pub use redundant::RedundantLink;
pub use start_up::{StartUpList, StartUpStep};
pub use subdevice::SubDevice;
