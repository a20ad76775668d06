//! The page on which a running robot is seen and led, and the API under it.
//!
//! - [`Dashboard`]: the server, in a thread of its own; the cycle never waits for it.
//! - [`access`]: who may do what: with the token everything, without it reading, and that on loopback alone.
//! - [`call`]: what a client may ask of the robot, in words of JSON.
//! - [`robot_info`]: what doesn't change while a robot runs; [`status`]: what does, thirty times a second.
//! - [`setup_page`]: the page of a robot that is being set up, with a button that is held.
//! - `states`: every cycle, for programs that follow.
//! - [`openapi`]: the API described, for programs and people.
//! - [`Streams`]: the same values for PlotJuggler; `foxglove`: the robot drawn, its events and values for the Foxglove app.
//!
//! Principles: everything that comes in is bounded, counted and checked; what a page commands ends with the page.
#![forbid(unsafe_code)]

pub mod access;
mod bus;
pub mod call;
mod call_handler;
mod connections;
mod drive_to;
mod foxglove;
mod gate;
mod inputs;
pub mod openapi;
mod page;
mod planned;
pub mod robot_info;
mod room_seen;
mod routes;
mod server;
pub mod setup_page;
mod shared;
mod socket;
mod states;
pub mod status;
mod strangers;
mod streams;
mod tick;
mod work;

pub use access::Access;
pub use robot_info::RobotInfo;
pub use server::{Dashboard, DashboardError};
pub use setup_page::SetupPage;
pub use streams::Streams;
