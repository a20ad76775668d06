//! The filter against worlds of its own model: order, consistency, faults.

mod consistency;
mod clocks;
mod faults;
mod inertial;
mod lively;
mod order;
mod world;
