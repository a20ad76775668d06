//! The cycle against simulated segments, in virtual time.

#[path = "../../benches/echo/mod.rs"]
mod echo;
mod faults;
mod operation;
mod rates;
mod returns;
mod ring;
mod runner;
mod safe_op;
