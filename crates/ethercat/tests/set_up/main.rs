//! The set-up against the simulated segment.

mod sabotage;
mod scan;
mod segment;
mod under_fire;
