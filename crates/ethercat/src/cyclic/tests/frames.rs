//! Which frames are taken, and what becomes of the inputs where some are missing.

use super::*;

#[test]
fn outputs_go_out_and_inputs_of_this_cycle_come_in() {
    let mut bench = Bench::new(3);
    bench.image.outputs.fill(0x5A);
    assert_eq!(bench.cycle(), Exchange::Complete);
    assert!(bench.segment().outputs.iter().all(|byte| *byte == 0x5A));
    assert!(bench.image.inputs.iter().all(|byte| *byte == 1));
    assert_eq!(bench.bus.clock(), Some(DcTime(5_001_000_000)));
    assert_eq!(bench.bus.status(), Some(SegmentStatus { answered: 3, bits: 2 }));
    assert_eq!((bench.bus.frames_per_cycle(), bench.segment().sent), (1, 1));
    let commands: Vec<_> = bench.bus.commands_used().iter().map(Command::name).collect();
    assert_eq!(commands, ["BRD", "LRD", "LWR", "FRMW"]);
}

#[test]
fn a_lost_frame_is_a_value_and_leaves_the_inputs_alone() {
    let mut bench = Bench::new(3);
    bench.cycle();
    bench.segment().fault = Box::new(|_, queue| queue.clear());
    assert_eq!(bench.cycle(), Exchange::Lost { lost: 1, sent: 1 });
    assert!(bench.image.inputs.iter().all(|byte| *byte == 1));
    assert_eq!(bench.bus.freshness(0), Freshness::FrameLost);
    assert_eq!(bench.bus.counters().frames_lost, 1);
}

#[test]
fn of_several_frames_one_lost_holds_all_inputs_back_and_says_whose_are_missing() {
    let mut bench = Bench::new(200);
    assert!(bench.bus.frames_per_cycle() >= 6);
    assert_eq!(bench.cycle(), Exchange::Complete);
    bench.segment().fault = Box::new(|_, queue| {
        queue.pop_back();
    });
    let sent = bench.bus.frames_per_cycle() as u16;
    assert_eq!(bench.cycle(), Exchange::Lost { lost: 1, sent });
    assert!(bench.image.inputs.iter().all(|byte| *byte == 1));
    assert_eq!(bench.bus.freshness(199), Freshness::FrameLost);
    assert_eq!(bench.bus.freshness(0), Freshness::HeldBack);
    bench.segment().fault = Box::new(|_, queue| queue.make_contiguous().reverse());
    assert_eq!(bench.cycle(), Exchange::Complete);
    assert!(bench.image.inputs.iter().all(|byte| *byte == 3));
}

#[test]
fn frames_that_are_late_by_256_and_65536_cycles_are_not_taken() {
    for age in [1u64, 255, 256, 257, 65_536] {
        let mut bench = Bench::new(1);
        let mut kept: Option<Vec<u8>> = None;
        bench.segment().fault = Box::new(move |exchange, queue| {
            if exchange == 1 {
                kept = queue.pop_front();
            } else if exchange == 1 + age {
                // Only the old one arrives.
                *queue = kept.take().into_iter().collect();
            }
        });
        for exchange in 1..=age + 1 {
            let expected = if exchange == 1 || exchange == age + 1 {
                Exchange::Lost { lost: 1, sent: 1 }
            } else {
                Exchange::Complete
            };
            assert_eq!(bench.cycle(), expected, "age {age}, exchange {exchange}");
        }
        assert_eq!(bench.bus.counters().late, 1);
    }
}

#[test]
fn duplicates_reflected_and_foreign_frames_are_counted_and_dropped() {
    let mut bench = Bench::new(3);
    bench.segment().fault = Box::new(|exchange, queue| match exchange {
        1 => {
            let mut reflected = queue[0].clone();
            reflected[6] &= !2;
            let mut foreign = queue[0].clone();
            foreign[7] ^= 1;
            queue.push_front(vec![0; 20]);
            queue.push_front(reflected);
            queue.push_front(foreign);
        }
        2 => queue.push_back(queue[0].clone()),
        3 => {}
        // The same command and index, another address; then another length.
        4 => queue[0][FIRST + 12 + 8 + 4] ^= 1,
        5 => queue[0][FIRST + 12 + 8 + 6] ^= 1,
        _ => {}
    });
    const FIRST: usize = 16;
    assert_eq!(bench.cycle(), Exchange::Complete);
    assert_eq!(bench.bus.counters().foreign, 3);
    assert_eq!(bench.cycle(), Exchange::Complete);
    assert_eq!(bench.cycle(), Exchange::Complete);
    assert_eq!(bench.bus.counters().late, 1, "the second copy came a cycle later");
    assert_eq!(bench.cycle(), Exchange::Lost { lost: 1, sent: 1 });
    assert_eq!(bench.cycle(), Exchange::Lost { lost: 1, sent: 1 });
}

#[test]
fn a_flood_of_foreign_frames_does_not_hold_the_cycle() {
    let mut bench = Bench::new(1);
    bench.segment().fault = Box::new(|_, queue| *queue = (0..10_000).map(|_| vec![0xAA; 60]).collect());
    assert_eq!(bench.cycle(), Exchange::Lost { lost: 1, sent: 1 });
    assert!(bench.bus.counters().foreign <= 100);
}

#[test]
fn steering_writes_the_hosts_time_and_without_one_writes_nothing() {
    let mut bench = Bench::with(members(2), ClockUse::Steer { reference: 0 });
    bench.bus.steer_clock(Some(DcTime(77)));
    assert_eq!(bench.cycle(), Exchange::Complete);
    assert_eq!(bench.segment().registers[&(0x1000, 0x0910)], 77u64.to_le_bytes());
    bench.segment().registers.clear();
    bench.bus.steer_clock(None);
    assert_eq!(bench.cycle(), Exchange::Complete);
    assert!(bench.segment().registers.is_empty());
}

#[test]
fn a_segment_without_subdevices_is_complete_and_sends_nothing() {
    let mut bench = Bench::new(0);
    assert_eq!(bench.cycle(), Exchange::Complete);
    assert_eq!(bench.segment().sent, 0);
    assert_eq!(bench.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
}
