//! The filter against worlds of its own model: order, consistency, faults.

mod clocks;
mod consistency;
mod faults;
mod faulty;
mod held;
mod inertial;
mod lively;
mod order;
mod silence;
mod two_poses;
mod world;
