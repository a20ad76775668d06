//! The hardware half of the simulation at the level of registers and frames, without any MainDevice.

mod bench;
mod commands;
