//! Other MainDevices against the simulated segment.
//!
//! A simulator that is tested with its own MainDevice alone proves little: here EtherCrab (as a crate) and SOEM
//! (as the Python package `pysoem`) drive it over a virtual cable.
#![forbid(unsafe_code)]

pub mod ethercrab;
