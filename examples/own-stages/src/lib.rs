//! Stages of one's own: what `docs/guides/extend.md` explains, to be copied.
//!
//! - [`device`]: a drive that maps no speed; it is taken from the encoder.
//! - [`estimator`]: the simplest odometry that works.
//! - [`reference`](mod@reference): to the left and back, several times.
//! - [`controller`]: speed control with an integral part.
//! - [`custom`]: reads their settings from the robot's file.
//!
//! [`register`] puts them into a registry by the names that `robot.toml` uses; [`simulate`] runs a robot with them.
#![forbid(unsafe_code)]

pub mod controller;
pub mod custom;
pub mod device;
pub mod estimator;
pub mod reference;

use omnibase_ethercat_sim::in_process;
use omnibase_robot::{Registry, Robot, RobotPlan};
use omnibase_run::{Progress, Ran, Setup, simulated};
use std::sync::atomic::AtomicBool;

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

/// Runs a robot once, from bring-up to the drives' end, on the simulated robot of its plan and on virtual time.
pub fn simulate(plan: &RobotPlan, registry: &Registry) -> anyhow::Result<Ran> {
    let (segment, machine) = simulated::segment(plan)?;
    let (link, clock) = in_process(segment);
    let setup = Setup {
        plan,
        robot: Robot::build(plan, registry)?,
        machine: Some(machine),
        recording: None,
        live: None,
        stop: &AtomicBool::new(false),
        progress: &Progress::default(),
    };
    Ok(omnibase_run::run(link, clock, setup, &mut |text| eprintln!("warning: {text}"))?)
}
