//! The stages of this robot: each in a file of its own, each with one line below.
#![forbid(unsafe_code)]

pub mod controller;
pub mod estimator;

use omnibase::prelude::*;

/// Registers the stages of this crate beside the built-in ones.
pub fn register(registry: &mut Registry) {
    registry.controllers.add(controller::kind(), controller::make);
    registry.estimators.add(estimator::kind(), estimator::make);
}
