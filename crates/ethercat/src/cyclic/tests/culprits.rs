//! Who is at fault.

use super::*;

#[test]
fn a_short_count_keeps_the_inputs_and_the_culprit_is_named_within_two_cycles() {
    for count in [3, 100] {
        let mut bench = Bench::in_op(count);
        bench.cycle();
        let before = bench.image.inputs.clone();
        let gone = usize::from(count) - 2;
        bench.segment().alive[gone] = false;
        assert!(matches!(bench.cycle(), Exchange::ShortCount { .. }));
        assert_eq!(bench.image.inputs, before);
        bench.cycle();
        assert_eq!(bench.bus.health()[gone], Health::Silent, "{count}");
        assert_eq!(bench.bus.health().iter().filter(|health| **health != Health::Operational).count(), 1);
        // From now on the others' inputs are taken, its own are not.
        assert_eq!(bench.cycle(), Exchange::Without { not_operational: 1 });
        let now = bench.segment().exchange as u8;
        for position in 0..usize::from(count) {
            let bytes = &bench.image.inputs[position * BYTES as usize..][..BYTES as usize];
            let expected = if position == gone { before[0] } else { now };
            assert!(bytes.iter().all(|byte| *byte == expected), "SubDevice {position}");
        }
        assert_eq!(bench.bus.freshness(gone as u16), Freshness::NotOperational);
        assert_eq!(bench.bus.freshness(0), Freshness::Fresh);
        // A second one is noticed, although the count is short already.
        bench.segment().alive[1] = false;
        if gone != 1 {
            assert!(matches!(bench.cycle(), Exchange::ShortCount { .. }));
        }
        bench.segment().alive.fill(true);
        bench.cycle();
        bench.cycle();
        assert_eq!(bench.cycle(), Exchange::Complete);
        assert!(bench.bus.health().iter().all(|health| *health == Health::Operational));
    }
}

#[test]
fn a_subdevice_that_falls_back_is_named_with_its_code() {
    let mut bench = Bench::in_op(3);
    bench.segment().status[1] = 0x14;
    bench.segment().code = 0x001B;
    bench.cycle();
    bench.cycle();
    let health = Health::NotOperational { status: 0x14, code: AlStatusCode::SM_WATCHDOG };
    assert_eq!(bench.bus.health(), [Health::Operational, health, Health::Operational]);
}

#[test]
fn a_thousand_subdevices_reach_op_and_a_culprit_is_found_among_them() {
    let mut bench = Bench::in_op(1000);
    bench.segment().alive[777] = false;
    bench.cycle();
    bench.cycle();
    assert_eq!(
        bench.bus.health()[777],
        Health::Silent,
        "those whom the short datagram touches are asked first"
    );
    for _ in 0..6 {
        assert!(matches!(bench.cycle(), Exchange::ShortCount { .. }), "all others have yet to answer");
    }
    assert_eq!(bench.cycle(), Exchange::Without { not_operational: 1 });
}

#[test]
fn a_reference_that_only_missed_a_few_questions_leads_again() {
    let mut bench = Bench::in_op(3);
    bench.segment().alive[0] = false;
    (0..3).for_each(|_| assert_ne!(bench.cycle(), Exchange::Complete));
    assert_eq!(bench.bus.clock_use(), ClockUse::Distribute { reference: 1 });
    bench.segment().alive[0] = true;
    (0..5).for_each(|_| {
        bench.cycle();
    });
    assert_eq!(bench.bus.health(), [Health::Operational; 3]);
    assert_eq!(bench.bus.clock_use(), ClockUse::Distribute { reference: 0 });
    // Where all were in doubt nobody else led.
    bench.segment().alive.fill(false);
    (0..3).for_each(|_| assert_ne!(bench.cycle(), Exchange::Complete));
    bench.segment().alive.fill(true);
    (0..5).for_each(|_| {
        bench.cycle();
    });
    assert_eq!(bench.bus.clock_use(), ClockUse::Distribute { reference: 0 });
    assert!(bench.bus.commands_used().contains(crate::wire::Command::Frmw));
}
