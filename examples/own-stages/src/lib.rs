//! Stages of one's own: what `docs/guides/extend.md` explains, to be copied.
//!
//! - [`device`]: a drive that maps no speed; it is taken from the encoder.
//! - [`estimator`]: the simplest odometry that works.
//! - [`reference`](mod@reference): to the left and back, several times.
//! - [`controller`]: speed control with an integral part.
#![forbid(unsafe_code)]

pub mod controller;
pub mod device;
pub mod estimator;
pub mod reference;

use omnibase::prelude::*;

/// Registers the stages of this crate beside the built-in ones.
pub fn register(registry: &mut Registry) {
    // What the robot's file need not say is the same as for a drive of the profile.
    let defaults = registry.devices.defaults("cia402").cloned().unwrap_or_default();
    registry.devices.add(device::kind(), defaults, device::SpeedFromCounts::new);
    registry.estimators.add(estimator::kind(), estimator::make);
    registry.references.add(reference::kind(), reference::Sway::new);
    registry.controllers.add(controller::kind(), controller::make);
}
