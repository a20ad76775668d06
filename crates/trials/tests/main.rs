//! What the simulated machine shows of a robot. One executable for all: it is linked once, and what takes long runs beside the rest.
//! A part alone: `cargo test -p omnibase-trials stops::`.

mod accuracy;
mod accuracy_table;
mod approaches;
mod braking;
mod builds;
mod calibration;
mod callgrind;
mod counts;
mod events;
mod fence;
mod grip;
mod learning;
mod mujoco;
mod one_machine;
mod same_bits;
mod seeded;
mod sensed;
#[path = "../../host/src/skipped.rs"]
mod skipped;
mod slip;
mod stops;
mod torque_limit;
mod weak_motors;
mod wiring;
