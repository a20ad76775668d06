//! What a run is measured by.
//!
//! - [`tracking`], [`truth`]: how far off the robot was, as it believed and in truth.
//! - [`measured`]: how far off a person found it on the floor.
//! - [`timing`], [`quantiles`]: how long cycles took, and what happened in the worst ones.
//! - [`pauses`]: whose pauses cost cycles, and what to do.
//! - [`events`], [`slips`], [`summary`]: what happened, and all of it together.
#![forbid(unsafe_code)]

pub mod events;
pub mod measured;
pub mod pauses;
pub mod quantiles;
pub mod slips;
pub mod summary;
pub mod timing;
pub mod tracking;
pub mod truth;

pub use summary::Summary;
