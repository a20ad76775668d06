//! Devices driven by raw frames: states and their codes, mailbox, CoE, process data, drives.

mod coe;
mod mailbox;
mod repeatable;
mod rig;
mod simple;
mod states;
