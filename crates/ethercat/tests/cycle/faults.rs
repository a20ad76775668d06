//! The cycle on a cable that loses, delays, repeats and swaps frames, and with SubDevices that fail.

use std::time::Duration;

use omnibase_ethercat::cyclic::{
    AcyclicRequest, AcyclicWork, ClockDirection, Comeback, Freshness, Goal, Health, RecoveryError,
    TransitionStatus,
};
use omnibase_ethercat::mailbox::{MailboxRequest, ObjectList, Operation, list_indices};
use omnibase_ethercat::start_up::SdoAccess;
use omnibase_ethercat::wire::HostTime;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::{Bus, BusOptions, Exchange};
use omnibase_ethercat_sim::pdi::ApplicationFault;
use omnibase_ethercat_sim::{Fault, FaultAction, FaultLink, FaultRates, Injection, Target, in_process};

use crate::echo;
use crate::runner::{Runner, segment_file, synchronous};

const MILLISECOND: Duration = Duration::from_millis(1);

/// One frame in a hundred suffers one of these; delays reach beyond two wraps of an 8-bit index.
const RATES: FaultRates = FaultRates {
    drop_request_ppm: 2000,
    drop_answer_ppm: 2000,
    delay_ppm: 3000,
    delay_frames: 600,
    duplicate_ppm: 3000,
    reorder_ppm: 3000,
    corrupt_ppm: 0,
    short_count_ppm: 1000,
};

/// Inputs carry the number of the cycle in which the segment was asked; seed 20260.
fn no_stale_input(servos: u16, frames: u64) {
    let (mut bus, mut image) = echo::operational(servos, 16, |echo| FaultLink::new(echo, 20_260));
    bus.link_mut().set_rates(RATES);
    let per_cycle = bus.frames_per_cycle() as u64;
    let (mut complete, mut lost, mut short) = (0u64, 0u64, 0u64);
    for cycle in 1..=frames / per_cycle {
        bus.link_mut().inner_mut().stamp = cycle as u32;
        let before = image.inputs.clone();
        match bus.exchange(&mut image, HostTime(20_000_000_000 + cycle * 1_000_000)).unwrap() {
            Exchange::Complete => {
                complete += 1;
                let stamp = (cycle as u32).to_le_bytes();
                assert!(image.inputs.chunks(4).all(|word| word == stamp), "stale input in cycle {cycle}");
                assert_eq!(bus.freshness(0), Freshness::Fresh);
            }
            Exchange::Lost { .. } => {
                lost += 1;
                assert_eq!(image.inputs, before, "cycle {cycle}");
            }
            Exchange::ShortCount { .. } => {
                short += 1;
                assert_eq!(image.inputs, before, "cycle {cycle}");
            }
            // Nobody is silent here, so nobody may be left out.
            Exchange::Without { .. } => panic!("cycle {cycle}"),
        }
    }
    let counters = bus.counters();
    println!("{servos} servos: {complete} complete, {lost} lost, {short} short, {counters:?}");
    assert!(complete > 8 * lost && lost > 0 && short > 0);
    assert!(counters.late > 0 && counters.duplicate > 0);
    assert!(bus.health().iter().all(|health| *health == Health::Operational));
}

#[test]
fn a_million_frames_on_a_bad_cable_bring_no_stale_input() {
    no_stale_input(3, 700_000);
    no_stale_input(100, 300_000);
}

#[test]
fn a_frame_that_is_late_by_one_turn_of_an_index_is_not_taken_for_new() {
    // A frame that is late by exactly 256, 512 or 65536 frames is what an 8- or 16-bit index would take for new.
    for late in [256u64, 512, 65_536] {
        let (mut bus, mut image) = echo::operational(3, 16, |echo| FaultLink::new(echo, 1));
        bus.link_mut().set_rates(FaultRates { delay_ppm: 1, delay_frames: 1, ..FaultRates::default() });
        let first = bus.link().counts().frames;
        bus.link_mut()
            .inject(Injection { target: Target::Frame(first), action: FaultAction::Delay { frames: late } });
        for cycle in 1..=late + 2 {
            bus.link_mut().inner_mut().stamp = cycle as u32;
            if bus.exchange(&mut image, HostTime(20_000_000_000 + cycle)).unwrap() == Exchange::Complete {
                assert_eq!(image.inputs[..4], (cycle as u32).to_le_bytes());
            }
        }
        assert_eq!(bus.counters().late, 1, "late by {late}");
    }
}

#[test]
fn simulated_drives_stay_in_op_on_a_bad_cable() {
    let mut runner = Runner::new(
        segment_file("three-sgdv.toml"),
        &synchronous(3, MILLISECOND),
        ClockDirection::CycleFollowsDc,
    );
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    runner.bus().link_mut().inner.set_rates(RATES);
    let complete = (0..20_000).filter(|_| runner.cycle() == Exchange::Complete).count();
    assert!(complete > 19_500, "{complete} of 20000");
    runner.bus().link_mut().inner.set_rates(FaultRates::default());
    // What was under way may still disturb the first.
    for _ in 0..700 {
        runner.cycle();
    }
    assert!((0..100).all(|_| runner.cycle() == Exchange::Complete));
    assert!(runner.worst_clock_ns() < 1000);
    assert!(runner.bus().health().iter().all(|health| *health == Health::Operational));
}

/// Puts one request through the cycle and gives its result, and how many cycles it took.
fn through_the_cycle(runner: &mut Runner, position: u16, request: MailboxRequest) -> (Vec<u8>, u32) {
    let request = AcyclicRequest { tag: 7, position, work: AcyclicWork::Mailbox(request) };
    runner.bus().submit(request).unwrap();
    for cycle in 1..20_000 {
        let frames = runner.bus().link().frames;
        assert_eq!(runner.cycle(), Exchange::Complete);
        assert_eq!(runner.bus().link().frames - frames, 1, "acyclic work rides in the frame of the cycle");
        if let Some(done) = runner.bus().poll_completion() {
            assert_eq!((done.tag, done.position, done.result), (7, position, Ok(())));
            let AcyclicWork::Mailbox(request) = done.work else { panic!("other work") };
            return (request.data, cycle);
        }
    }
    panic!("no completion");
}

#[test]
fn sdos_and_the_dictionary_are_read_in_op_without_touching_the_cycle() {
    let object = ObjectAddress::new(0x1008, 0);
    let (link, clock) = in_process(segment_file("three-sgdv.toml"));
    let mut bus = Bus::new(link, clock, BusOptions::default());
    bus.scan().unwrap();
    bus.configure(&[]).unwrap();
    let name = bus.sdo_read(1, object, SdoAccess::Entry).unwrap();
    let objects = bus.object_list(1).unwrap();

    let mut runner = Runner::new(
        segment_file("three-sgdv.toml"),
        &synchronous(3, MILLISECOND),
        ClockDirection::CycleFollowsDc,
    );
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    let (read, cycles) =
        through_the_cycle(&mut runner, 1, MailboxRequest::upload(object, Vec::with_capacity(64)));
    assert_eq!(read, name);
    assert!(cycles < 20, "{cycles} cycles for one SDO");
    let list = MailboxRequest::new(Operation::List(ObjectList::All), Vec::with_capacity(4096));
    let (list, _) = through_the_cycle(&mut runner, 1, list);
    assert!(list_indices(&list).eq(objects));
    let torque = ObjectAddress::new(0x6072, 0);
    through_the_cycle(&mut runner, 2, MailboxRequest::download(torque, vec![0x2C, 0x01]));
    assert!(runner.worst_clock_ns() < 1000);
}

#[test]
fn a_power_cycled_drive_is_named_within_two_cycles_and_the_others_miss_none() {
    let mut runner = Runner::new(
        segment_file("three-sgdv.toml"),
        &synchronous(3, MILLISECOND),
        ClockDirection::CycleFollowsDc,
    );
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    // It restarts so quickly that the links behind it are up again: it has forgotten its address.
    runner.segment().inject(1, Fault::PowerOff).unwrap();
    runner.segment().inject(1, Fault::PowerOn).unwrap();
    assert!(matches!(runner.cycle(), Exchange::ShortCount { .. }));
    runner.cycle();
    assert_eq!(runner.bus().health(), [Health::Operational, Health::Silent, Health::Operational]);
    for _ in 0..100 {
        assert_eq!(runner.cycle(), Exchange::Without { not_operational: 1 });
        assert_eq!(runner.bus().freshness(2), Freshness::Fresh);
    }
}

#[test]
fn a_power_cycled_drive_comes_back_to_op_and_the_others_miss_no_cycle() {
    let mut runner = Runner::new(
        segment_file("three-sgdv.toml"),
        &synchronous(3, MILLISECOND),
        ClockDirection::CycleFollowsDc,
    );
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    runner.segment().inject(1, Fault::PowerOff).unwrap();
    runner.segment().inject(1, Fault::PowerOn).unwrap();
    runner.cycle();
    runner.cycle();
    assert!(runner.bus().recover(1));
    assert!(!runner.bus().recover(1), "it is on its way already");
    let mut recovered = None;
    for cycle in 0..5000 {
        let frames = runner.bus().link().frames;
        let exchange = runner.cycle();
        assert!(
            matches!(exchange, Exchange::Without { .. } | Exchange::Complete),
            "cycle {cycle}: {exchange:?} while drive 1 comes back"
        );
        assert!(runner.bus().link().frames - frames <= 2, "a diagnosis round is one frame more");
        recovered = recovered.or_else(|| runner.bus().poll_recovered());
        if recovered.is_some() && runner.bus().health().iter().all(|health| *health == Health::Operational) {
            println!("back in OP after {cycle} cycles");
            break;
        }
    }
    assert_eq!(recovered, Some((1, Ok(Comeback::Restarted))));
    assert!((0..1000).all(|_| runner.cycle() == Exchange::Complete));
    assert!(runner.worst_clock_ns() < 1000, "{} ns", runner.worst_clock_ns());
    // Its mailbox works again.
    let name = MailboxRequest::upload(ObjectAddress::new(0x1008, 0), Vec::with_capacity(64));
    assert!(!through_the_cycle(&mut runner, 1, name).0.is_empty());
}

#[test]
fn one_of_two_lost_drives_comes_back_while_the_third_misses_no_cycle() {
    let mut runner = Runner::new(
        segment_file("three-sgdv.toml"),
        &synchronous(3, MILLISECOND),
        ClockDirection::CycleFollowsDc,
    );
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    for position in [1, 2] {
        runner.segment().inject(position, Fault::PowerOff).unwrap();
        runner.segment().inject(position, Fault::PowerOn).unwrap();
    }
    runner.cycle();
    runner.cycle();
    assert_eq!(runner.cycle(), Exchange::Without { not_operational: 2 });
    assert!(runner.bus().recover(1));
    let ended = (0..5000).find_map(|cycle| {
        let exchange = runner.cycle();
        assert!(matches!(exchange, Exchange::Without { .. }), "cycle {cycle}: {exchange:?}");
        assert_eq!(runner.bus().freshness(0), Freshness::Fresh);
        runner.bus().poll_recovered()
    });
    assert_eq!(ended, Some((1, Ok(Comeback::Restarted))));
}

#[test]
fn another_product_in_the_place_of_a_lost_one_is_refused() {
    let mut runner = Runner::new(
        segment_file("three-sgdv.toml"),
        &synchronous(3, MILLISECOND),
        ClockDirection::CycleFollowsDc,
    );
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    runner.segment().inject(2, Fault::PowerOff).unwrap();
    assert!(runner.bus().recover(2));
    let end = |runner: &mut Runner| {
        (0..20_000).find_map(|_| {
            runner.cycle();
            runner.bus().poll_recovered()
        })
    };
    assert!(matches!(end(&mut runner), Some((2, Err(RecoveryError::NotThere { position: 2, .. })))));
    runner.segment().inject(2, Fault::PowerOn).unwrap();
    let mut gone = runner.subdevices[2].clone();
    gone.identity.product_code = 7;
    runner.bus().prepare(&gone);
    assert!(runner.bus().recover(2));
    let expected = (0x0539, 7);
    let error = RecoveryError::OtherProduct { position: 2, expected, found: (0x0539, 0x0220_0001) };
    assert_eq!(end(&mut runner), Some((2, Err(error))));
}

#[test]
fn a_drive_with_an_al_error_is_named_with_its_code() {
    let mut runner = Runner::new(
        segment_file("three-sgdv.toml"),
        &synchronous(3, MILLISECOND),
        ClockDirection::CycleFollowsDc,
    );
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    runner.segment().inject(2, Fault::Application(ApplicationFault::AlError(0x001A))).unwrap();
    runner.cycle();
    runner.cycle();
    runner.cycle();
    let Health::NotOperational { status, code } = runner.bus().health()[2] else { panic!() };
    assert_eq!((status, code.0), (0x14, 0x001A));
}

#[test]
fn an_emergency_is_found_without_being_asked_for() {
    let mut runner = Runner::new(
        segment_file("three-sgdv.toml"),
        &synchronous(3, MILLISECOND),
        ClockDirection::CycleFollowsDc,
    );
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    runner.segment().inject(1, Fault::Application(ApplicationFault::DriveFault(0x0710))).unwrap();
    let found = (0..1000).find_map(|_| {
        runner.cycle();
        runner.bus().take_emergency()
    });
    assert_eq!(found.expect("an emergency").0, 1);
}
