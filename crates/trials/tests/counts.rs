//! What a cycle of the simulated robot costs in instructions, without the robot's own computation. What the whole is in a release
//! the bench `simulated_robot` tells.

use omnibase_robot::RequestKind;
use omnibase_trials::{Trial, framed, plan_of, robots};

use crate::callgrind;

/// Frames, chips, firmware, drives and machine.
const MOST_FRAMED: u64 = 38_400;
/// Drives and machine alone, by speed and by torque.
const MOST_ALONE: u64 = 28_600;
const MOST_BY_TORQUE: u64 = 22_000;

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
    a_cycle_alone_costs_at_most(MOST_ALONE, test, &on_a_circle(4000));
}

/// Between two beats a drive that holds its torque has nothing to do.
#[test]
fn a_cycle_by_torque_without_frames_and_chips_costs_no_more_instructions_than_it_may() {
    let test = "counts::a_cycle_by_torque_without_frames_and_chips_costs_no_more_instructions_than_it_may";
    let robot = on_a_circle(4000).replace("closed_loop_speed", "adaptive_torque");
    a_cycle_alone_costs_at_most(MOST_BY_TORQUE, test, &robot);
}

fn a_cycle_alone_costs_at_most(most: u64, test: &str, robot: &str) {
    let functions = ["omnibase_trials::trial::Trial::exchange"];
    callgrind::a_cycle_costs_at_most(most, test, &functions, [500, 1000], |cycles| {
        let mut trial = Trial::new(plan_of(robot));
        trial.enable();
        trial.step(Some(RequestKind::Track));
        trial.run(cycles);
    });
}
