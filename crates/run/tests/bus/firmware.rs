//! Firmware that hangs behind a chip that answers: named, and the robot stops, until it runs again.

use omnibase_ethercat_sim::Fault;
use omnibase_ethercat_sim::pdi::ApplicationFault;
use omnibase_robot::RequestKind;
use omnibase_robot::signals::{Phase, SafetyReason};

use crate::bench::{Bench, plan};

/// Within so many cycles of 1 ms it is known: the watchdog of 100 ms, and the look at it.
const KNOWN: u64 = 150;

fn hangs(bench: &mut Bench, position: usize, hangs: bool) {
    bench.inject(position, Fault::Application(ApplicationFault::Frozen(hangs)));
}

fn held() -> Bench {
    let mut bench = Bench::new(&plan(""));
    bench.enable();
    bench.run(300);
    bench
}

#[test]
fn a_drive_whose_firmware_hangs_is_named_and_its_robot_waits_for_a_person() {
    let mut bench = held();
    hangs(&mut bench, 1, true);
    bench.run(KNOWN);
    let named = bench.told("lost: its firmware hangs");
    assert_eq!(named.len(), 1, "{:?}", bench.events);
    assert!(named[0].1.contains("(SubDevice 1)"), "{named:?}");
    assert!(bench.session.is_away(1) && !bench.session.is_away(0));
    bench.run(3000);
    assert_eq!(bench.robot.phase(), Phase::Fault);
    assert_eq!(bench.robot.record().stop_reason, SafetyReason::DeviceLost);
    // Nobody enables it while it hangs.
    bench.cycle(Some(RequestKind::Acknowledge));
    bench.run(10);
    bench.cycle(Some(RequestKind::Enable));
    bench.run(500);
    assert_ne!(bench.robot.phase(), Phase::Holding, "{:?}", bench.events);
    hangs(&mut bench, 1, false);
    bench.run(3000);
    assert_eq!(bench.told("its firmware runs again after").len(), 1, "{:?}", bench.events);
    assert_ne!(bench.robot.phase(), Phase::Holding, "a person says so first");
    assert!(!bench.session.is_away(1));
    bench.cycle(Some(RequestKind::Acknowledge));
    bench.run(10);
    bench.enable();
    bench.run(100);
    assert_eq!(bench.robot.phase(), Phase::Holding, "{:?}", bench.events);
    let figures = bench.session.figures();
    assert!(figures.losses >= 1 && figures.losses == figures.recoveries, "{figures:?}");
}

#[test]
fn one_that_hung_before_or_whose_watchdog_is_off_is_not_taken_for_lost() {
    // Off from the start, or off later.
    for is_early in [true, false] {
        let mut bench = Bench::new(&plan(""));
        if is_early {
            bench.write_register(2, 0x0410, &[0, 0]);
        }
        bench.enable();
        bench.run(300);
        bench.write_register(2, 0x0410, if is_early { &[0xE8, 0x03] } else { &[0, 0] });
        hangs(&mut bench, 2, true);
        bench.run(3 * KNOWN);
        assert!(bench.told("firmware").is_empty(), "{is_early}: {:?}", bench.events);
    }
}

#[test]
fn a_drive_that_loses_its_power_while_its_firmware_hangs_comes_back() {
    let mut bench = held();
    hangs(&mut bench, 1, true);
    bench.run(KNOWN);
    assert!(bench.session.is_away(1), "{:?}", bench.events);
    bench.inject(1, Fault::PowerCycle { off_for: std::time::Duration::from_millis(400) });
    bench.run(5000);
    assert_eq!(bench.al_status(1), 8, "{:?}", bench.events);
    assert!(!bench.session.is_away(1), "{:?}", bench.events);
    assert_eq!(bench.robot.phase(), Phase::Fault);
    bench.cycle(Some(RequestKind::Acknowledge));
    bench.run(10);
    bench.enable();
    bench.run(100);
    assert_eq!(bench.robot.phase(), Phase::Holding, "{:?}", bench.events);
}
