//! Stages of one's own: what `docs/guides/extend.md` explains, to be copied.
//!
//! - [`device`]: a drive that maps no speed; it is taken from the encoder.
//! - [`estimator`]: the simplest odometry that works.
//! - [`reference`](mod@reference): to the left and back, several times.
//! - [`controller`]: speed control with an integral part.
//!
//! [`register`] puts them into a registry by the names that `robot.toml` uses; [`simulate`] runs a robot with them.
#![forbid(unsafe_code)]

pub mod controller;
pub mod device;
pub mod estimator;
pub mod reference;

use omnibase_ethercat_sim::in_process;
use omnibase_robot::{Registry, Robot, RobotPlan};
use omnibase_run::{Progress, Ran, Setup, simulated};
use std::sync::atomic::AtomicBool;

/// Registers the stages of this crate beside those that are there.
pub fn register(registry: &mut Registry) {
    device::register(registry);
    estimator::register(registry);
    reference::register(registry);
    controller::register(registry);
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
