//! The set-up against the simulated segment.

mod matching;
mod scan;
mod segment;
mod under_fire;
