//! The filter against worlds of its own model: order, consistency, faults.

mod consistency;
mod faults;
mod order;
mod world;
