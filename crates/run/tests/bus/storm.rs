//! Power cycles and pulled cables, many in a row, by a seed.

use std::time::Duration;

use omnibase_ethercat_sim::Fault;
use omnibase_robot::signals::Phase;
use omnibase_robot::{Exchange, RequestKind};

use crate::bench::{Bench, plan_with};

/// The next random number (splitmix64).
fn random(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

/// So many power cycles and pulled cables; nothing may end in a wrong state.
fn storm(clock_source: &str, seed: u64, faults: u32) {
    let mut bench = Bench::new(&plan_with(&[&format!("bus.clock_source = \"{clock_source}\"")]));
    let mut state = seed;
    bench.enable();
    let mut longest = 0;
    for number in 0..faults {
        let position = (random(&mut state) % 3) as usize;
        let off_ms = 1 + random(&mut state) % 300;
        let name = format!("fault {number} of seed {seed}: SubDevice {position} for {off_ms} ms");
        // The cable towards the next one, or the supply; position 0 takes all with it.
        let is_cable = random(&mut state) & 1 == 0 && position < 2;
        if is_cable {
            bench.inject(position, Fault::CableCut { port: 1 });
        } else {
            bench.inject(position, Fault::PowerCycle { off_for: Duration::from_millis(off_ms) });
        }
        let mut back = None;
        for cycle in 0..20_000 {
            if is_cable && cycle == off_ms {
                bench.inject(position, Fault::CableRestored { port: 1 });
            }
            let exchange = bench.cycle(None);
            assert!(
                cycle < 10 || !matches!(bench.robot.phase(), Phase::Holding | Phase::Tracking),
                "{name}: the robot moves by itself"
            );
            // In a line everybody before the fault is still there, and misses nothing.
            for before in 0..position + usize::from(is_cable) {
                assert_eq!(bench.al_status(before), 8, "{name}: SubDevice {before} in cycle {cycle}");
            }
            if cycle > off_ms && exchange == Exchange::Complete {
                back = Some(cycle - off_ms);
                break;
            }
        }
        let back = back.unwrap_or_else(|| panic!("{name}: not back; {:?}", bench.events));
        longest = longest.max(back);
        // What is under way ends; a short one may have been tolerated.
        for _ in 0..6000 {
            if matches!(bench.robot.phase(), Phase::Fault | Phase::Holding) {
                break;
            }
            bench.cycle(None);
        }
        for position in 0..3 {
            assert_eq!(bench.al_status(position), 8, "{name}");
        }
        if bench.robot.phase() == Phase::Fault {
            bench.cycle(Some(RequestKind::Acknowledge));
            bench.enable();
        }
        assert_eq!(bench.robot.phase(), Phase::Holding, "{name}");
        bench.events.clear();
    }
    let figures = bench.session.figures();
    println!(
        "{faults} faults, {} cycles: {} losses, {} recoveries, the longest way back {longest} cycles",
        bench.cycles, figures.losses, figures.recoveries
    );
    assert_eq!(figures.losses, figures.recoveries);
    for position in 0..3 {
        assert!(bench.clock_ns(position) < 1000);
    }
}

#[test]
fn random_power_cycles_and_pulled_cables_end_in_op() {
    storm("distributed_clock", 7, 1000);
}

#[test]
fn they_do_where_the_host_leads_the_clocks() {
    storm("host", 8, 300);
}
