//! The hardware half of the simulation at the level of registers and frames, without any MainDevice.

mod any_bytes;
mod bench;
mod clocks;
mod commands;
mod counts;
mod cycle;
mod firmware_events;
mod fmmus;
mod in_process;
mod pdi_socket;
mod replay;
mod sii;
#[path = "../../../host/src/skipped.rs"]
mod skipped;
mod sync_managers;
mod topology;
