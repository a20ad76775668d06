//! Clocks that lead and follow, in both directions.

use std::time::Duration;

use omnibase_ethercat_sim::Fault;
use omnibase_robot::Exchange;

use crate::bench::{Bench, plan_with};

const OP: u8 = 8;
const SOURCES: [&str; 2] = ["distributed_clock", "host"];

fn led_by(source: &str) -> Bench {
    let mut bench = Bench::new(&plan_with(&[&format!("bus.clock_source = \"{source}\"")]));
    bench.enable();
    bench.run(2000);
    bench
}

#[test]
fn whoever_is_power_cycled_comes_back_whoever_leads() {
    for source in SOURCES {
        for position in 0..3 {
            let name = format!("{source}, SubDevice {position}");
            let mut bench = led_by(source);
            let off_for = Duration::from_millis(100);
            bench.inject(position, Fault::PowerCycle { off_for });
            bench.run(110);
            let back = (0..5000).find(|_| bench.cycle(None) == Exchange::Complete);
            assert!(back.is_some_and(|cycles| cycles < 3000), "{name}: {back:?}, {:?}", bench.events);
            bench.run(2000);
            for one in 0..3 {
                assert_eq!(bench.al_status(one), OP, "{name}: {:?}", bench.events);
                assert!(bench.clock_ns(one) < 1000, "{name}: {} ns", bench.clock_ns(one));
            }
            assert!(bench.told("not taken back").is_empty(), "{name}: {:?}", bench.events);
        }
    }
}

#[test]
fn a_reference_that_started_anew_leads_on_where_it_was() {
    for source in SOURCES {
        let mut bench = led_by(source);
        let (dc, host) = bench.dc_and_host_ns(0);
        bench.inject(0, Fault::PowerCycle { off_for: Duration::from_millis(100) });
        bench.run(5000);
        let (later_dc, later_host) = bench.dc_and_host_ns(0);
        let (passed, expected) = (later_dc.wrapping_sub(dc), later_host - host);
        // The host's clock led for 0.6 s; quartzes drift apart by less than 100 ppm.
        assert!(passed.abs_diff(expected) < 500_000, "{source}: {passed} ns in {expected} ns");
    }
}

#[test]
fn the_reference_clock_goes_and_comes_whoever_leads() {
    for source in SOURCES {
        let mut bench = led_by(source);
        // So quick that the links behind it are up again: only the reference clock is gone.
        bench.inject(0, Fault::PowerOff);
        bench.inject(0, Fault::PowerOn);
        let mut worst = 0;
        for cycle in 0..6000 {
            bench.cycle(None);
            for other in [1, 2] {
                assert_eq!(bench.al_status(other), OP, "{source}: drive {other} in cycle {cycle}");
                worst = worst.max(bench.clock_ns(other));
            }
        }
        assert!(worst < 3000, "{source}: {worst} ns");
        assert_eq!(bench.told("(SubDevice 0): is the reference clock").len(), 1, "{:?}", bench.events);
        assert!((0..3).all(|position| bench.al_status(position) == OP), "{source}: {:?}", bench.events);
    }
}

#[test]
fn a_clock_that_strays_in_op_is_named_and_so_is_its_return() {
    for source in SOURCES {
        let mut bench = led_by(source);
        let offset = bench.peek(2, 0x0920, 8);
        let offset = u64::from_le_bytes(offset.try_into().unwrap());
        // Its control loop needs some 300 ms for that.
        bench.write_register(2, 0x0920, &(offset + 200_000).to_le_bytes());
        bench.run(5000);
        let far = bench.told("(SubDevice 2): its clock is");
        assert_eq!(far.len(), 2, "{source}: {:?}", bench.events);
        assert!(far[0].1.contains(" ns from the reference, 50000 ns are the most"), "{source}: {far:?}");
        assert!(far[1].1.contains("with the reference again"), "{source}: {far:?}");
        assert_eq!(bench.session.figures().clock_strays, 1);
        let figures = bench.session.subdevice_figures();
        assert_eq!(figures.iter().map(|one| one.clock_strays).collect::<Vec<_>>(), [0, 0, 1]);
    }
}

#[test]
fn the_reference_goes_on_following_the_host_while_drives_are_asked_what_is_wrong() {
    let mut bench = led_by("host");
    let (dc, host) = bench.dc_and_host_ns(0);
    // One that doesn't answer: the others are cycled for it.
    bench.inject(2, Fault::PowerOff);
    let codes = bench.session.error_codes().unwrap();
    assert_eq!((codes[0].is_some(), codes[2]), (true, None), "{codes:?}");
    let (later_dc, later_host) = bench.dc_and_host_ns(0);
    let (passed, expected) = (later_dc - dc, later_host - host);
    assert!(expected > 100_000_000, "{expected} ns");
    assert!(passed.abs_diff(expected) < 2000, "{passed} ns in {expected} ns");
}

/// Drives whose application is started by SYNC1 once a cycle, and whose control loops by SYNC0 four times: as their file asks, at
/// the same places of the cycle after one of them lost its supply.
#[test]
fn drives_that_beat_by_sync1_run_and_come_back_as_their_file_asks() {
    const CYCLE_NS: u64 = 1_000_000;
    let dc = "{ assign_activate = \"0x0730\", sync0_per_cycle = 4, sync1_every = 4, sync1_shift_us = 20 }";
    let mode = "[{ object = \"1C32.1\", type = \"u16\", value = 3 }]";
    let changes = [format!("drive_defaults.dc = {dc}"), format!("drive_defaults.parameters = {mode}")];
    // A drive that isn't told what starts its application takes the slower event for it.
    let mut bench = Bench::new(&plan_with(&[&changes[0]]));
    bench.enable();
    bench.run(200);
    assert_eq!(bench.robot.phase(), omnibase_robot::signals::Phase::Holding);
    let mut bench = Bench::new(&plan_with(&[&changes[0], &changes[1]]));
    bench.enable();
    bench.run(200);
    let number = |bench: &Bench, register: u16, length: usize| {
        let mut bytes = [0; 8];
        bytes[..length].copy_from_slice(&bench.peek(1, register, length));
        u64::from_le_bytes(bytes)
    };
    let as_asked = |bench: &Bench| {
        assert_eq!(number(bench, 0x0980, 2), 0x0730);
        assert_eq!((number(bench, 0x09A0, 4), number(bench, 0x09A4, 4)), (250_000, 770_000));
        // The first SYNC0 is half a cycle from the frames, so that SYNC1 is 20 us behind each fourth.
        assert_eq!(number(bench, 0x0990, 8) % CYCLE_NS, 500_000);
    };
    as_asked(&bench);
    assert_eq!(bench.robot.phase(), omnibase_robot::signals::Phase::Holding);
    bench.inject(1, Fault::PowerCycle { off_for: Duration::from_millis(100) });
    bench.run(110);
    let back = (0..5000).find(|_| bench.cycle(None) == Exchange::Complete);
    assert!(back.is_some(), "{:?}", bench.events);
    as_asked(&bench);
}
