//! Process data of slow SubDevices go in each n-th cycle only.

use std::time::Duration;

use omnibase_ethercat::config::Every;
use omnibase_ethercat::cyclic::{ClockDirection, Comeback, Freshness, Goal, Health, TransitionStatus};
use omnibase_ethercat::wire::{Clock, Command};
use omnibase_ethercat::{DcConfig, Exchange, SubDeviceConfig};
use omnibase_ethercat_sim::pdi::Pdi;
use omnibase_ethercat_sim::{Fault, FaultAction, Injection, Segment, SegmentFile, Target};

use crate::runner::Runner;

const CYCLE_NS: u32 = 1_000_000;
const EVERY: u16 = 4;
/// Positions of the slow ones.
const SLOW: [u16; 3] = [2, 3, 4];

/// Two drives in every cycle, then three terminals of 8 + 8 bits in each fourth.
fn segment(drive: &str) -> Segment {
    let text = format!(
        "[[subdevice]]\nkind = \"{drive}\"\ncount = 2\n[[subdevice]]\nkind = \"digital-io\"\ninputs = 8\noutputs = 8\ncount = 3\n"
    );
    SegmentFile::parse(&text).unwrap().build(std::path::Path::new(".")).unwrap()
}

fn configs() -> Vec<SubDeviceConfig> {
    let drive = SubDeviceConfig {
        dc: DcConfig::Sync0 { cycle_ns: CYCLE_NS, shift_ns: 0 },
        ..SubDeviceConfig::default()
    };
    let slow = SubDeviceConfig { every: Every::nth(EVERY).unwrap(), ..SubDeviceConfig::default() };
    [drive.clone(), drive, slow.clone(), slow.clone(), slow].into()
}

fn operational(drive: &str) -> Runner {
    let mut runner = Runner::new(segment(drive), &configs(), ClockDirection::CycleFollowsDc);
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    runner
}

/// What the terminal at `position` was told last.
fn told(runner: &mut Runner, position: u16) -> u8 {
    let mut told = [0];
    runner.segment().pdi(usize::from(position)).unwrap().read(0x1000, &mut told);
    told[0]
}

fn tell(runner: &mut Runner, position: u16, value: u8) {
    let placements = runner.bus().plan().placements_of(position).to_vec();
    let outputs = placements.iter().find(|one| one.sync_manager == 0).unwrap();
    runner.image.outputs[outputs.bytes()].fill(value);
}

fn only_in_their_turns(drive: &str, command: Command) {
    let mut runner = operational(drive);
    let mut turns = [0; SLOW.len()];
    let mut most_frames = 0;
    for cycle in 0..10 * u64::from(EVERY) {
        let value = cycle as u8 + 1;
        SLOW.iter().for_each(|position| tell(&mut runner, *position, value));
        let frames = runner.bus().link().frames;
        assert_eq!(runner.cycle(), Exchange::Complete, "cycle {cycle}");
        most_frames = most_frames.max(runner.bus().link().frames - frames);
        for (turns, position) in turns.iter_mut().zip(SLOW) {
            let has_gone = !runner.bus().rests(position);
            assert_eq!(told(&mut runner, position) == value, has_gone, "cycle {cycle}, terminal {position}");
            *turns += u32::from(has_gone);
            match runner.bus().freshness(position) {
                Freshness::Fresh => assert!(has_gone),
                Freshness::Resting { cycles } => assert!(!has_gone && (1..EVERY.into()).contains(&cycles)),
                other => panic!("cycle {cycle}, terminal {position}: {other:?}"),
            }
        }
        assert_eq!(runner.bus().freshness(0), Freshness::Fresh);
    }
    assert_eq!(turns, [10; SLOW.len()]);
    assert_eq!(most_frames, 2, "never two slow ones in one cycle");
    assert!(runner.bus().link().commands.contains(&command));
}

#[test]
fn slow_ones_are_written_and_read_in_their_turns_and_never_together() {
    only_in_their_turns("servo", Command::Lrw);
    // These refuse LRW.
    only_in_their_turns("sgdv", Command::Lwr);
}

#[test]
fn op_is_believed_once_the_slowest_have_had_their_turn() {
    let mut configs = configs();
    configs.truncate(3);
    configs[2].every = Every::nth(500).unwrap();
    let text =
        "[[subdevice]]\nkind = \"servo\"\ncount = 2\n[[subdevice]]\nkind = \"digital-io\"\ninputs = 8\n";
    let segment = SegmentFile::parse(text).unwrap().build(std::path::Path::new(".")).unwrap();
    let mut runner = Runner::new(segment, &configs, ClockDirection::CycleFollowsDc);
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    // One turn in SAFE-OP, and one in OP.
    assert!(runner.bus().counters().cycles >= 1000, "{:?}", runner.bus().counters());
}

#[test]
fn a_lost_slow_frame_is_a_lost_exchange_and_its_values_stay_old_until_the_next_turn() {
    let mut runner = operational("servo");
    while runner.bus().rests(2) {
        runner.cycle();
    }
    // The next turn is lost on its way, behind the frame of its cycle that comes back.
    (1..EVERY).for_each(|_| assert_eq!(runner.cycle(), Exchange::Complete));
    let next = runner.bus().link_mut().inner.counts().frames;
    let lost = Injection { target: Target::Frame(next + 1), action: FaultAction::DropRequest };
    runner.bus().link_mut().inner.inject(lost);
    tell(&mut runner, 2, 0x5A);
    let before = runner.image.inputs.clone();
    assert_eq!(runner.cycle(), Exchange::Lost { lost: 1, sent: 2 });
    assert_eq!(runner.bus().freshness(2), Freshness::FrameLost);
    assert_eq!(runner.bus().freshness(0), Freshness::HeldBack);
    assert_eq!(runner.image.inputs, before);
    for cycle in 1..u64::from(EVERY) {
        assert_eq!(runner.cycle(), Exchange::Complete);
        assert_eq!(runner.bus().freshness(2), Freshness::Resting { cycles: u64::from(EVERY) + cycle });
        assert_ne!(told(&mut runner, 2), 0x5A);
    }
    assert_eq!(runner.cycle(), Exchange::Complete);
    assert_eq!((runner.bus().freshness(2), told(&mut runner, 2)), (Freshness::Fresh, 0x5A));
}

#[test]
fn a_slow_one_that_loses_power_is_named_at_once_and_comes_back_while_the_others_go_on() {
    let mut runner = operational("sgdv");
    for end in 0..u64::from(EVERY) {
        runner.cycles(100 + end as usize);
        runner.segment().inject(4, Fault::PowerOff).unwrap();
        runner.segment().inject(4, Fault::PowerOn).unwrap();
        let mut held_back = 0;
        for cycle in 0..3 * u64::from(EVERY) {
            let exchange = runner.cycle();
            held_back += u32::from(matches!(exchange, Exchange::ShortCount { .. }));
            assert!(!matches!(exchange, Exchange::Lost { .. }), "{exchange:?}");
            if cycle >= 2 {
                assert_eq!(runner.bus().health()[4], Health::Silent, "cycle {cycle}");
                assert_eq!(runner.bus().freshness(4), Freshness::NotOperational);
                assert!(runner.bus().freshness(0) == Freshness::Fresh, "cycle {cycle}: {exchange:?}");
            }
        }
        assert!(held_back <= 1, "{held_back} exchanges were held back");
        assert!(runner.bus().recover(4));
        let back = (0..5000).find_map(|_| {
            let exchange = runner.cycle();
            assert!(matches!(exchange, Exchange::Complete | Exchange::Without { .. }), "{exchange:?}");
            runner.bus().poll_recovered()
        });
        assert_eq!(back, Some((4, Ok(Comeback::Restarted))));
        runner.cycles(2 * usize::from(EVERY));
        assert!(runner.bus().health().iter().all(|health| *health == Health::Operational));
    }
}

#[test]
fn a_slow_drive_is_synchronised_behind_its_own_frames_and_stays_so_where_cycles_are_left_out() {
    let cycle = Duration::from_nanos(CYCLE_NS.into());
    let mut configs = configs();
    configs.truncate(2);
    configs[1].every = Every::nth(EVERY).unwrap();
    configs[1].dc = DcConfig::Sync0 { cycle_ns: CYCLE_NS * u32::from(EVERY), shift_ns: 0 };
    let text = "[[subdevice]]\nkind = \"servo\"\ncount = 2\n";
    for left_out in 0..u64::from(EVERY) {
        let segment = SegmentFile::parse(text).unwrap().build(std::path::Path::new(".")).unwrap();
        let mut runner = Runner::new(segment, &configs, ClockDirection::CycleFollowsDc);
        // The turn doesn't begin with the period of SYNC0 by chance.
        runner.cycles(left_out as usize);
        assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
        for round in 0..50 {
            if round % 10 == 5 {
                let now = runner.paced.clock().now();
                runner.paced.clock().advance_to(now + cycle * (1 + left_out as u32));
            }
            assert_eq!(runner.cycle(), Exchange::Complete);
            if runner.bus().rests(1) {
                continue;
            }
            let passed = runner.bus().clock().unwrap();
            let sync0 = runner.segment().sub_devices()[1].esc().peek(0x0990, 8).unwrap().to_vec();
            let sync0 = u64::from_le_bytes(sync0.try_into().unwrap());
            let behind = (sync0 as i64 - passed.0 as i64).rem_euclid(i64::from(CYCLE_NS) * i64::from(EVERY));
            assert!(behind < CYCLE_NS.into(), "SYNC0 comes {behind} ns behind its frame, round {round}");
        }
    }
}
