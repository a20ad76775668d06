//! The set-up against the simulated segment.

mod matching;
mod scan;
mod segment;
mod states;
mod under_fire;
