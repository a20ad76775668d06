//! EtherCAT SubDevices and segments simulated at frame level.
#![forbid(unsafe_code)]

pub mod pdi;
