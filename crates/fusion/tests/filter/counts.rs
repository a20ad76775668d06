//! What the filter costs in instructions. What it is in a release `cargo bench -p omnibase-fusion` prints, with what drives the
//! filter in it.

#[path = "../../../trials/tests/callgrind.rs"]
mod callgrind;

use std::collections::VecDeque;

use omnibase_fusion::Filter;

use crate::faulty::every;
use crate::world::{World, gyro, mouse, settings, tracker};

/// The most of a cycle with gyro, two mice and poses at 100 Hz that are 20 ms late.
const MOST: u64 = 19_900;
/// Cycles before all is learnt, and with those that are counted.
const CYCLES: [u64; 2] = [2000, 4000];

fn run(cycles: u64) {
    let sensors = [gyro(), mouse(0.2, 0.1), mouse(-0.2, 0.1), tracker()];
    let (mut world, mut filter) = (World::new(1, &sensors), Filter::new(settings(), &sensors));
    let mut under_way = VecDeque::new();
    for cycle in 0..cycles {
        let motion = world.step();
        filter.advance(world.now_ns, &motion);
        for (place, sensor) in
            sensors.iter().enumerate().filter(|(_, sensor)| cycle.is_multiple_of(every(sensor)))
        {
            let reading = world.read(place);
            under_way.push_back((world.now_ns, place, reading));
            if sensor.kind != tracker().kind {
                let (instant_ns, place, reading) = under_way.pop_back().expect("this one");
                assert!(filter.hear(place, instant_ns, &reading));
            }
        }
        if under_way.front().is_some_and(|(instant_ns, ..)| instant_ns + 20_000_000 <= world.now_ns) {
            let (instant_ns, place, reading) = under_way.pop_front().expect("one");
            assert!(filter.hear(place, instant_ns, &reading));
        }
        std::hint::black_box(filter.estimate());
    }
}

#[test]
fn a_cycle_costs_no_more_instructions_than_it_may() {
    let functions =
        ["advance", "hear", "estimate"].map(|name| format!("omnibase_fusion::filter::Filter::{name}"));
    let functions = functions.each_ref().map(String::as_str);
    let test = "counts::a_cycle_costs_no_more_instructions_than_it_may";
    callgrind::a_cycle_costs_at_most(MOST, test, &functions, CYCLES, run);
}
