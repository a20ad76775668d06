//! The set-up against the simulated segment.

mod esi;
mod field;
mod flags;
mod matching;
mod operational;
mod replay;
mod scan;
mod segment;
mod servos;
mod states;
mod under_fire;
