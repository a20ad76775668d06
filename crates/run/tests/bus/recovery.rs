//! One SubDevice goes and comes back: it is named, the robot stops, the others miss nothing.

use std::time::Duration;

use omnibase_ethercat_sim::Fault;
use omnibase_ethercat_sim::pdi::ApplicationFault;
use omnibase_robot::signals::{Phase, SafetyReason};
use omnibase_robot::{Exchange, RequestKind};

use crate::bench::{Bench, plan, plan_with};

const OP: u8 = 8;
/// SYNC0 of the simulated drives has its place when the clocks agree to so many ns.
const LOCKED_NS: u32 = 1000;

/// Cycles until everybody is in OP and the exchange complete, while those of `others` stay in OP in every cycle.
fn until_back(bench: &mut Bench, others: &[usize]) -> u64 {
    for cycle in 0..20_000 {
        let exchange = bench.cycle(None);
        assert_ne!(exchange, Exchange::Lost, "cycle {cycle}");
        for &other in others {
            assert_eq!(bench.al_status(other), OP, "drive {other} in cycle {cycle}: {:?}", bench.events);
        }
        if exchange == Exchange::Complete {
            return cycle;
        }
    }
    panic!("nobody came back: {:?}", bench.events);
}

#[test]
fn a_power_cycled_sgdv_is_named_within_two_cycles_and_back_in_op_within_three_seconds() {
    let mut bench = Bench::new(&plan(""));
    bench.enable();
    bench.run(100);
    bench.inject(2, Fault::PowerCycle { off_for: Duration::from_millis(400) });
    let lost_in = bench.cycles + 1;
    bench.run(2);
    let named = bench.told("lost: it does not answer");
    assert_eq!(named.len(), 1, "{:?}", bench.events);
    assert!(named[0].0 < lost_in + 2 && named[0].1.contains("(SubDevice 2)"), "{named:?}");
    bench.run(3);
    assert_eq!(bench.robot.phase(), Phase::QuickStopping);
    // The rest of the time without power.
    bench.run(395);
    let cycles = until_back(&mut bench, &[0, 1]);
    println!("back in OP {cycles} cycles after it answers again");
    assert!(cycles < 3000, "{cycles} ms");
    assert_eq!(bench.al_status(2), OP);
    assert!(bench.clock_ns(2) < LOCKED_NS, "{} ns", bench.clock_ns(2));
    assert_eq!(bench.peek(2, 0x0981, 1), [3], "SYNC0 is on");
    assert_eq!(bench.told("back in OP").len(), 1, "{:?}", bench.events);
    // No torque until a person says so.
    bench.run(6000);
    assert_eq!(bench.robot.phase(), Phase::Fault);
    assert_eq!(bench.robot.record().stop_reason, SafetyReason::DeviceLost);
    bench.cycle(Some(RequestKind::Acknowledge));
    bench.run(10);
    bench.enable();
    bench.run(1000);
    assert_eq!(bench.robot.phase(), Phase::Holding);
    let pose = bench.robot.record().state.odom_from_body;
    assert!(pose.x_m.abs() < 1e-3 && pose.y_m.abs() < 1e-3, "the new origin moved nothing: {pose:?}");
}

#[test]
fn the_way_back_takes_less_than_three_seconds_at_the_longest_cycle_of_an_sgdv_too() {
    let mut bench = Bench::new(&plan_with(&["bus.cycle_us = 4000"]));
    bench.enable();
    bench.inject(2, Fault::PowerCycle { off_for: Duration::from_millis(400) });
    bench.run(100);
    let cycles = until_back(&mut bench, &[0, 1]);
    println!("back in OP {} ms after it answers again", 4 * cycles);
    assert!(4 * cycles < 2000, "{} ms: with room for a machine that is busy", 4 * cycles);
    assert_eq!(bench.al_status(2), OP);
}

#[test]
fn a_cable_that_is_pulled_and_put_back_brings_its_drives_back() {
    let mut bench = Bench::new(&plan(""));
    bench.enable();
    bench.inject(1, Fault::CableCut { port: 1 });
    bench.run(700);
    assert_eq!(bench.told("(SubDevice 2): lost").len(), 1, "{:?}", bench.events);
    bench.inject(1, Fault::CableRestored { port: 1 });
    until_back(&mut bench, &[0, 1]);
    assert_eq!(bench.told("(SubDevice 2): back in OP").len(), 1, "{:?}", bench.events);
    assert!(bench.clock_ns(2) < LOCKED_NS);
}

#[test]
fn a_drive_that_leaves_op_by_itself_is_named_with_its_code_and_brought_back() {
    let mut bench = Bench::new(&plan(""));
    bench.enable();
    bench.inject(0, Fault::Application(ApplicationFault::AlError(0x001A)));
    bench.run(3);
    let named = bench.told("(SubDevice 0): lost: it is in SAFE-OP with error");
    assert_eq!(named.len(), 1, "{:?}", bench.events);
    until_back(&mut bench, &[1, 2]);
    assert_eq!(bench.al_status(0), OP);
}

#[test]
fn the_reference_clock_goes_and_comes_and_nobody_is_stepped() {
    let mut bench = Bench::new(&plan(""));
    bench.enable();
    bench.run(2000);
    // So quick that the links behind it are up again: only the reference clock is gone.
    bench.inject(0, Fault::PowerOff);
    bench.inject(0, Fault::PowerOn);
    bench.run(3);
    assert_eq!(bench.told("(SubDevice 1): is the reference clock").len(), 1, "{:?}", bench.events);
    let mut worst = 0;
    for cycle in 0..6000 {
        bench.cycle(None);
        for other in [1, 2] {
            assert_eq!(bench.al_status(other), OP, "drive {other} in cycle {cycle}");
            worst = worst.max(bench.clock_ns(other));
        }
    }
    // The delays differ by the way of the frame, some hundred ns; a step would be milliseconds.
    assert!(worst < 3000, "{worst} ns");
    assert_eq!(bench.told("(SubDevice 0): is the reference clock").len(), 1, "{:?}", bench.events);
    assert!((0..3).all(|position| bench.al_status(position) == OP), "{:?}", bench.events);
}

#[test]
fn emergencies_and_error_counters_are_told_by_name() {
    let mut bench = Bench::new(&plan(""));
    bench.enable();
    bench.inject(1, Fault::Application(ApplicationFault::DriveFault(0x7500)));
    bench.inject(0, Fault::CrcErrors { port: 0, frames: 2 });
    bench.run(1000);
    assert_eq!(
        bench.told("(SubDevice 1): emergency 0xff00, error register 0x01, data [00, 75,").len(),
        1,
        "{:?}",
        bench.events
    );
    assert_eq!(bench.told("(SubDevice 1): drive fault").len(), 1, "{:?}", bench.events);
    assert_eq!(
        bench.told("(SubDevice 0): 2 damaged frames arrived at port 0").len(),
        1,
        "{:?}",
        bench.events
    );
    let figures = bench.session.figures();
    assert_eq!((figures.emergencies, figures.drive_faults, figures.crc_errors), (1, 1, 2));
    assert_eq!(figures.frames_lost, 2);
}
