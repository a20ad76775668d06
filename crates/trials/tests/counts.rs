//! What a cycle of the simulated robot costs in instructions, without the robot's own computation. What the whole is in a release
//! the bench `simulated_robot` tells.

use omnibase_robot::RequestKind;
use omnibase_trials::{Trial, framed, plan_of, robots};

use crate::callgrind;

/// Frames, chips, firmware, drives and machine.
const MOST_FRAMED: u64 = 40_500;
/// Drives and machine alone.
const MOST_ALONE: u64 = 30_800;

/// Three wheels on a circle, one turn in twenty seconds.
fn on_a_circle(cycles: u64) -> String {
    let duration_s = cycles as f64 * 1e-3;
    let circle = format!(
        "\n[reference]\nkind = \"circle\"\nradius_m = 0.5\nturns = {:?}\nduration_s = {duration_s:?}\n",
        0.05 * duration_s
    );
    format!("{}{circle}", robots::BMM)
}

#[test]
fn a_cycle_of_the_simulated_robot_costs_no_more_instructions_than_it_may() {
    let test = "counts::a_cycle_of_the_simulated_robot_costs_no_more_instructions_than_it_may";
    let functions = ["*SimLink as *Link>::send", "*SimLink as *Link>::receive"];
    callgrind::a_cycle_costs_at_most(MOST_FRAMED, test, &functions, [1000, 1500], |cycles| {
        assert!(framed::track(&on_a_circle(cycles)).finished);
    });
}

#[test]
fn a_cycle_without_frames_and_chips_costs_no_more_instructions_than_it_may() {
    let test = "counts::a_cycle_without_frames_and_chips_costs_no_more_instructions_than_it_may";
    let functions = ["omnibase_trials::trial::Trial::exchange"];
    callgrind::a_cycle_costs_at_most(MOST_ALONE, test, &functions, [500, 1000], |cycles| {
        let mut trial = Trial::new(plan_of(&on_a_circle(4000)));
        trial.enable();
        trial.step(Some(RequestKind::Track));
        trial.run(cycles);
    });
}
