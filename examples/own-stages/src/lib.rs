//! Stages of one's own: what `docs/guides/extend.md` explains, to be copied.
//!
//! - [`device`]: a drive that maps no speed; it is taken from the encoder.
//! - [`estimator`]: the simplest odometry that works.
//! - [`reference`](mod@reference): to the left and back, several times.
//! - [`controller`]: speed control with an integral part.
//! - [`custom`]: reads their settings from the robot's file.
//! - [`simulated`]: the simulated robot in the process, on virtual time.
//!
//! [`register`] puts them into a registry by the names that `robot.toml` uses.
#![forbid(unsafe_code)]

pub mod controller;
pub mod custom;
pub mod device;
pub mod estimator;
pub mod reference;
pub mod simulated;

use omnibase_robot::Registry;

/// Registers the stages of this crate beside those that are there.
pub fn register(registry: &mut Registry) {
    registry
        .device("speed_from_counts", device::defaults(), |plan| {
            Ok(Box::new(device::SpeedFromCounts::new(plan)?))
        })
        .estimator("midpoint_odometry", |plan| Ok(Box::new(estimator::MidpointOdometry::new(plan))))
        .reference("sway", |plan| Ok(Box::new(reference::Sway::new(plan)?)))
        .controller("pi_speed", |plan| Ok(Box::new(controller::PiSpeed::new(plan)?)));
}
