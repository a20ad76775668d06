//! EtherCAT SubDevices and segments simulated at frame level.
//!
//! Hardware half: what the ESC chip and the cables do.
//!
//! - [`esc`]: one ESC, with registers, SyncManagers, FMMUs, SII interface, watchdogs and distributed clock.
//! - [`segment`]: SubDevices and the cables between them; frames go in and come back.
//! - [`fault`]: what can go wrong on request.
//! - [`fault_link`]: a link on which frames get lost, late, doubled, swapped and falsified.
//! - [`serve`](mod@serve): a segment behind a network interface, in real time.
//! - [`sim_link`]: a segment in the process, on virtual time, as a link of a MainDevice.
//! - [`sim_ring`]: a ring in the process, with both interfaces of its MainDevice.
//! - [`pdi`]: the line between the chip and the firmware behind it.
//! - [`pdi_socket`]: firmware in another process.
//!
//! Firmware half: what runs behind the chip, through [`pdi`] alone.
//!
//! - [`firmware`]: the stack: AL states with their checks, mailbox, CoE, process data.
//! - [`dictionary`]: objects as data.
//! - [`device`]: the kinds of device: any SII image, CiA 402 servo, Yaskawa SGDV, coupler, digital I/O.
//! - [`segment_file`]: a segment described in TOML.
#![forbid(unsafe_code)]

pub mod device;
pub mod dictionary;
pub mod esc;
pub mod fault;
pub mod fault_link;
pub mod firmware;
pub mod pdi;
pub mod pdi_socket;
pub mod segment;
pub mod segment_file;
pub mod serve;
pub mod sim_link;
pub mod sim_ring;

pub use esc::{DcRegisters, EscConfig};
pub use fault::{Fault, FaultError, Injector};
pub use fault_link::{FaultAction, FaultCounts, FaultLink, FaultRates, Injection, Target};
pub use pdi_socket::{Pace, SocketApplication};
pub use segment::{Attachment, MainPort, Parent, Segment, SubDevice, TopologyError};
pub use segment_file::{SegmentFile, SegmentFileError};
pub use serve::{RingEnds, Served, serve, serve_ring, until_set};
pub use sim_link::{SimLink, VirtualClock, in_process};
pub use sim_ring::{SimPort, ring_in_process};
