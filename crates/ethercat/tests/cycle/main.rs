//! The cycle against simulated segments, in virtual time.

mod operation;
mod runner;
