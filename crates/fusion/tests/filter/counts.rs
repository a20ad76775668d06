//! What the filter costs in instructions, counted by callgrind: counts repeat, whatever else the machine does.
//!
//! The test starts itself under valgrind. Tests are less optimised than a release; what it is there `cargo bench -p omnibase-fusion`
//! prints, with what drives the filter in it.

use std::collections::VecDeque;
use std::process::Command;

use omnibase_fusion::Filter;

use crate::faulty::every;
use crate::world::{World, gyro, mouse, settings, tracker};

/// How many cycles are driven, where the test runs under valgrind.
const COUNTED: &str = "OMNIBASE_FUSION_COUNTED";
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

/// Instructions of the filter in so many cycles; `None` without valgrind.
fn counted(cycles: u64) -> Option<u64> {
    let mut valgrind = Command::new("valgrind");
    valgrind.args(["--tool=callgrind", "--callgrind-out-file=/dev/null"]);
    for function in ["advance", "hear", "estimate"] {
        valgrind.arg(format!("--toggle-collect=omnibase_fusion::filter::Filter::{function}"));
    }
    let test = "counts::a_cycle_costs_no_more_instructions_than_it_may";
    valgrind.arg(std::env::current_exe().expect("this test"));
    valgrind.args(["--exact", test, "--test-threads=1"]).env(COUNTED, cycles.to_string());
    let output = valgrind.output().ok()?;
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}");
    let count = told.lines().find_map(|line| line.split("Collected : ").nth(1)).expect("a count");
    Some(count.trim().parse().expect("a number"))
}

#[test]
fn a_cycle_costs_no_more_instructions_than_it_may() {
    if let Some(cycles) = std::env::var_os(COUNTED) {
        return run(cycles.to_str().and_then(|cycles| cycles.parse().ok()).expect("a number of cycles"));
    }
    let (Some(before), Some(after)) = (counted(CYCLES[0]), counted(CYCLES[1])) else {
        return eprintln!("SKIPPED: instructions aren't counted without valgrind");
    };
    let each = (after - before) / (CYCLES[1] - CYCLES[0]);
    println!("{each} instructions a cycle");
    assert!(each > 1000, "{each} instructions a cycle are too few to be true");
    assert!(each <= MOST, "{each} instructions a cycle, at most {MOST}");
}
