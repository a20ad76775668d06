//! The filter against worlds of its own model: order, consistency, faults.

mod against_gtsam;
mod batch;
mod clocks;
mod consistency;
mod counts;
mod faults;
mod faulty;
mod followed;
mod held;
mod inertial;
mod lively;
mod order;
#[path = "../../../omnibase/tests/python_tools/mod.rs"]
mod python_tools;
mod silence;
mod two_poses;
mod world;

use python_tools::skipped;
