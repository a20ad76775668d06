//! From power-on to OP, in OP, and back.

use omnibase_ethercat::cyclic::{ClockDirection, Goal, Health, TransitionError, TransitionStatus};
use omnibase_ethercat::wire::frame::{DATAGRAM_HEADER, Datagrams};
use omnibase_ethercat::wire::{AlState, Clock, Command, HostTime};
use omnibase_ethercat::{Exchange, SubDeviceConfig};
use omnibase_ethercat_sim::{Fault, Segment, SegmentFile};

use crate::runner::{Runner, segment_file, synchronous};
use std::time::Duration;

const MILLISECOND: Duration = Duration::from_millis(1);

fn states(runner: &mut Runner) -> Vec<Option<AlState>> {
    let devices = runner.segment().sub_devices().iter();
    devices.map(|device| AlState::from_bits(u16::from(device.esc().peek(0x0130, 1).unwrap()[0]))).collect()
}

#[test]
fn three_sgdv_are_in_op_with_locked_clocks_within_two_seconds_of_bus_time() {
    let configs = synchronous(3, MILLISECOND);
    let mut runner = Runner::new(segment_file("three-sgdv.toml"), &configs, ClockDirection::CycleFollowsDc);
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    let now = runner.paced.clock().now();
    assert!(now < HostTime(2_000_000_000), "OP at {now:?}");
    assert!(runner.worst_clock_ns() < 1000, "{} ns", runner.worst_clock_ns());
    assert_eq!(states(&mut runner), [Some(AlState::Op); 3]);
    println!("three SGDV: OP after {now:?}, farthest clock {} ns", runner.worst_clock_ns());
    let frames = runner.bus().link().frames;
    for _ in 0..2000 {
        assert_eq!(runner.cycle(), Exchange::Complete);
        assert!(runner.worst_clock_ns() < 1000, "{} ns", runner.worst_clock_ns());
    }
    assert_eq!(runner.bus().link().frames - frames, 2000, "one frame a cycle");
    let phase = runner.paced.dc_phase_ns().unwrap();
    assert!(phase.abs() < 1000, "phase {phase} ns");
    assert_eq!(states(&mut runner), [Some(AlState::Op); 3]);
    for barred in [Command::Lrw, Command::Aprw, Command::Fprw, Command::Brw] {
        assert!(!runner.bus().link().commands.contains(&barred), "{barred}");
    }
    assert_eq!(runner.to(Goal::Init), TransitionStatus::Reached(Goal::Init));
    assert_eq!(states(&mut runner), [Some(AlState::Init); 3]);
}

#[test]
fn a_hundred_servos_are_in_op_within_ten_seconds_of_bus_time() {
    let configs = synchronous(100, 2 * MILLISECOND);
    let mut runner =
        Runner::new(segment_file("hundred-servos.toml"), &configs, ClockDirection::CycleFollowsDc);
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    let now = runner.paced.clock().now();
    assert!(now < HostTime(10_000_000_000), "OP at {now:?}");
    assert!(runner.worst_clock_ns() < 1000, "{} ns", runner.worst_clock_ns());
    println!("100 servos: OP after {now:?}, farthest clock {} ns", runner.worst_clock_ns());
    assert!(runner.bus().frames_per_cycle() > 1, "images over several frames");
    for _ in 0..500 {
        assert_eq!(runner.cycle(), Exchange::Complete);
    }
    assert!(runner.bus().commands_used().contains(Command::Lrw), "all of them allow it");
}

#[test]
fn the_reference_clock_follows_the_host_without_a_step() {
    let configs = synchronous(3, MILLISECOND);
    let mut runner = Runner::new(segment_file("three-sgdv.toml"), &configs, ClockDirection::DcFollowsHost);
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    let first = runner.bus().clock().unwrap();
    let mut last = first;
    for _ in 0..3000 {
        assert_eq!(runner.cycle(), Exchange::Complete);
        let clock = runner.bus().clock().unwrap();
        // A cycle of the host's is a cycle of the clock's, 100 ppm of drift and 2 us of steering allowed.
        assert!((clock - last).abs_diff(MILLISECOND) < Duration::from_nanos(2100), "{:?}", clock - last);
        last = clock;
    }
    let error = (last - first).abs_diff(3000 * MILLISECOND);
    assert!(error < Duration::from_micros(1), "{error:?} between host and reference clock");
    assert_eq!(states(&mut runner), [Some(AlState::Op); 3]);
}

#[test]
fn an_empty_segment_is_refused_by_set_up_and_one_device_is_enough() {
    let text = "[[subdevice]]\nkind = \"servo\"\n";
    let file = omnibase_ethercat_sim::SegmentFile::parse(text).unwrap();
    let segment: Segment = file.build(std::path::Path::new(".")).unwrap();
    let mut runner = Runner::new(segment, &[SubDeviceConfig::default()], ClockDirection::NoClock);
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    assert_eq!(runner.bus().clock(), None);
    assert_eq!(runner.cycle(), Exchange::Complete);
}
#[test]
fn a_tree_of_couplers_terminals_and_drives_reaches_op() {
    let mut runner = Runner::new(segment_file("mixed-tree.toml"), &[], ClockDirection::CycleFollowsDc);
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    for _ in 0..200 {
        assert_eq!(runner.cycle(), Exchange::Complete);
    }
}

/// Terminals without a processor repeat the acknowledgement that is asked of all on the way back: no refusal, and whoever was
/// plugged in meanwhile answers with them, in INIT.
#[test]
fn whoever_is_plugged_in_meanwhile_keeps_nobody_from_the_way_back() {
    let file = "[[subdevice]]\nkind = \"digital-io\"\ninputs = 8\n[[subdevice]]\nkind = \"servo\"\n[[subdevice]]\nkind = \"servo\"\n";
    let mut segment = SegmentFile::parse(file).unwrap().build(std::path::Path::new(".")).unwrap();
    segment.inject(1, Fault::CableCut { port: 1 }).unwrap();
    let configs = [SubDeviceConfig::default(), SubDeviceConfig::default()];
    let mut runner = Runner::new(segment, &configs, ClockDirection::CycleFollowsDc);
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    runner.segment().inject(1, Fault::CableRestored { port: 1 }).unwrap();
    runner.cycles(50);
    for goal in [Goal::PreOp, Goal::Op, Goal::Init] {
        let before = runner.bus().link_mut().frames;
        assert_eq!(runner.to(goal), TransitionStatus::Reached(goal));
        let took = runner.bus().link_mut().frames - before;
        assert!(took < 1000, "{goal:?}: {took} frames");
    }
}

/// On the way up an error without a code in the very state that was asked repeats no acknowledgement.
#[test]
fn an_error_without_a_code_is_refused_on_the_way_up() {
    let mut runner = Runner::new(segment_file("three-servos.toml"), &[], ClockDirection::CycleFollowsDc);
    runner.bus().link_mut().change = |frame| {
        let statuses = Datagrams::new(frame).unwrap().map(Result::unwrap);
        let statuses = statuses.filter(|datagram| {
            let is_read = [Command::Brd, Command::Fprd].map(Command::code).contains(&datagram.header.command);
            is_read && datagram.header.address >> 16 == 0x0130
        });
        for at in statuses.map(|datagram| datagram.offset + DATAGRAM_HEADER).collect::<Vec<_>>() {
            if u16::from(frame[at]) == AlState::SafeOp.bits() {
                frame[at] |= AlState::ERROR as u8;
            }
        }
    };
    let refused = runner.to(Goal::Op);
    let TransitionStatus::Failed(error) = refused else { panic!("{refused:?}") };
    assert!(matches!(error, TransitionError::StateRefused { position: 0, status: 0x14, .. }), "{error:?}");
}

/// A part of the segment comes back with addresses that somebody else was given meanwhile: neither is believed, and that is said.
#[test]
fn two_at_one_address_are_told_from_one_that_is_silent() {
    let file = "[[subdevice]]\nkind = \"coupler\"\nname = \"hub\"\n\
                [[subdevice]]\nkind = \"servo\"\nparent = \"hub\"\nport = 1\n\
                [[subdevice]]\nkind = \"servo\"\nparent = \"hub\"\nport = 2\n";
    let segment = SegmentFile::parse(file).unwrap().build(std::path::Path::new(".")).unwrap();
    let configs = [SubDeviceConfig::default(), SubDeviceConfig::default()];
    let mut runner = Runner::behind(segment, &configs, ClockDirection::CycleFollowsDc, |bus| {
        bus.scan().unwrap();
        bus.configure(&[0, 1, 2].map(|_| SubDeviceConfig::default())).unwrap();
        let segment = bus.transactor().link.segment();
        segment.inject(0, Fault::CableCut { port: 1 }).unwrap();
        for position in [0, 2] {
            segment.inject(position, Fault::PowerOff).unwrap();
            segment.inject(position, Fault::PowerOn).unwrap();
        }
    });
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    runner.segment().inject(0, Fault::CableRestored { port: 1 }).unwrap();
    runner.cycles(50);
    assert_eq!(runner.bus().health(), [Health::Operational, Health::NotAlone]);
    assert_ne!(runner.cycle(), Exchange::Complete);
}

/// A drive keeps its supply while it is unplugged, and with it the addresses of the start that it took part in: plugged in again
/// behind another start, it answers to nobody else's.
#[test]
fn who_was_unplugged_for_a_start_answers_to_no_address_of_another() {
    let unplugged = Fault::CableCut { port: 1 };
    let configs = |count| synchronous(count, MILLISECOND);
    let segment = segment_file("three-servos.toml");
    let mut runner = Runner::behind(segment, &configs(2), ClockDirection::CycleFollowsDc, |bus| {
        bus.scan().unwrap();
        bus.configure(&[0, 1, 2].map(|_| SubDeviceConfig::default())).unwrap();
        bus.request_state(&[2], AlState::SafeOp).unwrap();
        bus.transactor().link.segment().inject(1, unplugged).unwrap();
    });
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    runner.segment().inject(1, Fault::CableRestored { port: 1 }).unwrap();
    for cycle in 0..200 {
        assert_eq!(runner.cycle(), Exchange::Complete, "cycle {cycle}");
    }
    let stations = runner.segment().sub_devices().iter();
    let stations =
        stations.map(|one| u16::from_le_bytes(one.esc().peek(0x0010, 2).unwrap().try_into().unwrap()));
    let stations: Vec<u16> = stations.collect();
    assert!(stations[2] == 0x1003 && stations[..2].iter().all(|one| *one > 0x1003), "{stations:x?}");
    assert_eq!(runner.to(Goal::Init), TransitionStatus::Reached(Goal::Init));
}
