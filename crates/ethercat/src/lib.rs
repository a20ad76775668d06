//! An EtherCAT MainDevice without an operating system in it.
//!
//! Set-up and cyclic exchange are different types: [`SubDevice`]s are found, configured and brought to PRE-OP by
//! code that may allocate and wait; what runs in the cycle does neither.
//!
//! - [`procedure`]: how a protocol that takes several datagrams is written without a link or a clock in it.
//! - [`subdevice`]: what is known about a SubDevice; [`config`]: what the user asks of it.
//! - [`start_up`]: everything that takes one SubDevice from INIT to OP, as data that can be replayed.
//! - [`fmmu`]: one FMMU's registers.
//! - [`mailbox`]: the one owner of a SubDevice's mailbox: SDOs, SDO Information, emergencies.
#![forbid(unsafe_code)]
#![cfg_attr(not(test), no_std)]
extern crate alloc;

pub mod bus;
pub mod config;
pub mod eeprom;
pub mod error;
pub mod fmmu;
pub mod mailbox;
pub mod procedure;
pub mod scan;
pub mod start_up;
pub mod state;
pub mod subdevice;
pub mod topology;
pub mod transaction;

pub use omnibase_ethercat_wire as wire;

pub use bus::{Bus, BusOptions, Warning};
pub use config::{DcConfig, Match, SubDeviceConfig};
pub use error::SetUpError;
pub use procedure::{Answer, Next, Procedure, Request};
pub use start_up::{StartUpList, StartUpStep};
pub use subdevice::SubDevice;
