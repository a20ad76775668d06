//! What receivers hear, on a program's way to the robot.

use crate::progress::{note, warn};
use anyhow::Context;
use omnibase_receive::{Receivers, Seat};
use omnibase_robot::RobotPlan;
use omnibase_robot::config::{InputOwner, ReceiverPlan};
use omnibase_robot::signals::Heard;
use omnibase_run::channels::Known;
use omnibase_run::live::Live;
use std::sync::Arc;

/// A receiver sits where programs sit: what it says is judged by its instant, and counted.
struct ProgramSeat(Live);

impl Seat for ProgramSeat {
    fn clock_ns(&self) -> u64 {
        self.0.clock_ns()
    }

    fn hear(&self, source: usize, heard: &Heard) {
        // Refusals are counted with the source's, where `omnibase get sources` shows them.
        let _ = self.0.send_inputs(source, heard);
    }

    fn say(&self, source: &str, words: &str) {
        note(format_args!("source {source}: {words}"));
    }
}

/// Whether a receiver hears a source.
fn is_received(plan: &RobotPlan, source: usize) -> bool {
    plan.sources[source].receiver != ReceiverPlan::Program
}

/// Whether the simulated robot tells a source itself.
fn is_simulated(plan: &RobotPlan, source: usize) -> bool {
    let told = plan.sensors.iter().filter(|sensor| sensor.from == InputOwner::Source(source));
    let mut simulated = plan.simulation.sensor.iter().filter_map(|table| table.name.as_deref());
    let names: Vec<&str> = told.map(|sensor| sensor.name.as_str()).collect();
    simulated.any(|name| names.contains(&name))
}

/// Whether any source of a plan waits for what comes in by a receiver.
pub(super) fn are_wanted(plan: &RobotPlan, known: Known) -> bool {
    (0..plan.sources.len()).any(|source| is_wanted(plan, known, source))
}

fn is_wanted(plan: &RobotPlan, known: Known, source: usize) -> bool {
    is_received(plan, source) && !(known == Known::Truth && is_simulated(plan, source))
}

/// Starts the receivers of a plan for a robot in real time.
pub(super) fn start(plan: &RobotPlan, known: Known, live: &Live) -> anyhow::Result<Receivers> {
    let seat: Arc<dyn Seat> = Arc::new(ProgramSeat(live.clone()));
    Receivers::start(&plan.sources, |source| is_wanted(plan, known, source), &seat)
        .map_err(|(source, error)| anyhow::Error::from(error).context(format!("source {source}")))
        .context("nobody could be heard")
}

/// On virtual time nothing from outside can be heard.
pub(super) fn none_on_virtual_time(plan: &RobotPlan) {
    for (place, source) in plan.sources.iter().enumerate() {
        if is_wanted(plan, Known::Truth, place) {
            warn(format_args!(
                "source {} is silent: on virtual time nobody from outside is heard; --dashboard drives in real time",
                source.name
            ));
        }
    }
}
