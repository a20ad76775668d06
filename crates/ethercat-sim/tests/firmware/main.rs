//! Devices driven by raw frames: states and their codes, mailbox, CoE, process data, drives.

mod rig;
mod states;
