//! The page on which a running robot is seen and led, and the API under it.
//!
//! - [`Dashboard`]: the server, in a thread of its own; the cycle never waits for it.
//! - [`access`]: who may do what: with the token everything, without it reading, and that on loopback alone.
//! - [`call`]: what a client may ask of the robot, in words of JSON.
//! - [`about`]: what doesn't change while a robot runs; [`seen`]: what does, thirty times a second.
//! - [`Streams`]: the same values for PlotJuggler and Foxglove.
//!
//! Principles: everything that comes in is bounded, counted and checked; what a page commands ends with the page.
#![forbid(unsafe_code)]

pub mod about;
pub mod access;
mod bus;
pub mod call;
mod connections;
mod desk;
mod page;
mod planned;
mod routes;
pub mod seen;
mod server;
mod shared;
mod socket;
mod strangers;
mod streams;
mod tick;
mod work;

pub use about::About;
pub use access::Access;
pub use server::{Dashboard, DashboardError};
pub use streams::Streams;
