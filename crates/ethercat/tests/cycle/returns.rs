//! Who is taken back, and who isn't.

use std::time::Duration;

use omnibase_ethercat::Match;
use omnibase_ethercat::cyclic::{
    AcyclicRequest, AcyclicWork, ClockDirection, Comeback, Goal, Health, RecoveryError, RegisterAccess,
    TransitionStatus,
};
use omnibase_ethercat::mailbox::MailboxRequest;
use omnibase_ethercat::start_up::{ReadBack, Refusal, SdoAccess, SdoWrite};
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::{Command, register};
use omnibase_ethercat_sim::{Fault, Segment, SegmentFile};

use crate::runner::{Runner, segment_file, synchronous};

const MILLISECOND: Duration = Duration::from_millis(1);

fn in_op(segment: Segment) -> Runner {
    let count = segment.sub_devices().len();
    let following = ClockDirection::CycleFollowsDc;
    let mut runner = Runner::new(segment, &synchronous(count, MILLISECOND), following);
    assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
    runner
}

/// Sends for the SubDevice at `position` and gives the end of its way.
fn way_of(runner: &mut Runner, position: u16) -> Result<Comeback, RecoveryError> {
    assert!(runner.bus().recover(position));
    let ended = (0..20_000).find_map(|_| {
        runner.cycle();
        runner.bus().poll_recovered()
    });
    let (who, ended) = ended.expect("its way ends");
    assert_eq!(who, position);
    ended
}

fn restart(runner: &mut Runner, position: usize) {
    runner.segment().inject(position, Fault::PowerOff).unwrap();
    runner.segment().inject(position, Fault::PowerOn).unwrap();
}

/// A line of servos with aliases and without serial numbers.
fn servos(text: &str) -> Segment {
    let text = format!("[[subdevice]]\nkind = \"servo\"\n{text}\n");
    SegmentFile::parse(&text).unwrap().build(std::path::Path::new(".")).unwrap()
}

#[test]
fn one_that_is_in_op_all_the_time_is_left_alone() {
    let mut runner = in_op(segment_file("three-sgdv.toml"));
    assert_eq!(way_of(&mut runner, 1), Ok(Comeback::Stayed));
    assert_eq!(runner.segment().sub_devices()[1].esc().peek(0x0130, 2).unwrap(), [8, 0]);
    let commands: Vec<_> = runner.bus().commands_used().iter().collect();
    assert!(!commands.contains(&Command::Apwr), "{commands:?}");
}

#[test]
fn one_that_is_in_op_with_an_error_has_it_acknowledged_and_stays() {
    let mut runner = in_op(segment_file("three-sgdv.toml"));
    // BOOT can't be reached from OP: it is refused with an error, in OP.
    let (way, register) = (RegisterAccess::Write, register::AL_CONTROL);
    let work = AcyclicWork::Registers { way, register, data: vec![3, 0] };
    runner.bus().submit(AcyclicRequest { tag: 0, position: 1, work }).unwrap();
    runner.cycles(20);
    let Health::NotOperational { status, .. } = runner.bus().health()[1] else {
        panic!("{:?}", runner.bus().health());
    };
    assert_eq!(status, 0x18);
    assert_eq!(way_of(&mut runner, 1), Ok(Comeback::Stayed));
    assert_eq!(runner.segment().sub_devices()[1].esc().peek(0x0130, 2).unwrap(), [8, 0]);
    runner.cycles(3);
    assert_eq!(runner.bus().health()[1], Health::Operational);
}

#[test]
fn a_way_back_is_called_off_while_nothing_was_changed() {
    let mut runner = in_op(segment_file("three-sgdv.toml"));
    runner.segment().inject(2, Fault::PowerOff).unwrap();
    assert!(runner.bus().recover(2));
    runner.cycles(50);
    assert!(runner.bus().call_off(2));
    assert!(!runner.bus().call_off(2), "it isn't on its way any more");
    runner.segment().inject(2, Fault::PowerOn).unwrap();
    assert!(runner.bus().recover(2));
    runner.cycles(200);
    assert!(!runner.bus().call_off(2), "it was given its address");
    let ended = (0..20_000).find_map(|_| {
        runner.cycle();
        runner.bus().poll_recovered()
    });
    assert_eq!(ended, Some((2, Ok(Comeback::Restarted))));
}

/// Whoever answers at its address, too, would be told what is meant for it: its way ends wherever it is.
#[test]
fn a_way_back_ends_where_another_begins_to_answer_at_its_address() {
    let window = SdoWrite {
        object: ObjectAddress::new(0x6065, 0),
        data: vec![1, 2, 0, 0],
        access: SdoAccess::Entry,
        refusal: Refusal::IsError,
        read_back: ReadBack::Compare,
        origin: None,
    };
    let mut configs = synchronous(3, MILLISECOND);
    configs[1].sdos = vec![window; 10];
    for after in (0..=200).step_by(10) {
        let segment = segment_file("three-sgdv.toml");
        let mut runner = Runner::new(segment, &configs, ClockDirection::CycleFollowsDc);
        assert_eq!(runner.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
        let station = runner.subdevices[1].station_address;
        restart(&mut runner, 1);
        assert!(runner.bus().recover(1));
        runner.cycles(after);
        let (way, register) = (RegisterAccess::Write, register::STATION_ADDRESS);
        let work = AcyclicWork::Registers { way, register, data: station.to_le_bytes().to_vec() };
        runner.bus().submit(AcyclicRequest { tag: 7, position: 2, work }).unwrap();
        let ended = (0..20_000).find_map(|_| {
            runner.cycle();
            runner.bus().poll_recovered()
        });
        let error = RecoveryError::NotAlone { position: 1, answered: 2 };
        assert_eq!(ended, Some((1, Err(error))), "after {after} cycles");
        // What is asked of it then is answered, though its mailbox was in the midst of something.
        let work = AcyclicWork::Mailbox(MailboxRequest::upload(ObjectAddress::new(0x1000, 0), Vec::new()));
        runner.bus().submit(AcyclicRequest { tag: 8, position: 1, work }).unwrap();
        let is_answered = (0..20_000).any(|_| {
            runner.cycle();
            runner.bus().poll_completion().is_some_and(|done| done.tag == 8)
        });
        assert!(is_answered, "after {after} cycles");
        assert!(runner.bus().recover(1), "it is free for another attempt");
    }
}

#[test]
fn two_of_one_product_that_are_known_by_alias_and_were_swapped_are_refused() {
    let mut runner = in_op(servos("alias = 5\ncount = 3"));
    // As if those at 1 and 2 had changed places while they were without power.
    for (position, alias) in [(1, 7), (2, 6)] {
        let mut other = runner.subdevices[position].clone();
        other.config.place = Some(Match::Alias(alias));
        runner.bus().prepare(&other);
        restart(&mut runner, position);
    }
    runner.cycles(5);
    for (position, expected, found) in [(1, 7, 6), (2, 6, 7)] {
        let error = RecoveryError::OtherAlias { position, expected, found };
        assert_eq!(way_of(&mut runner, position), Err(error));
        // Nothing was written to it.
        let esc = runner.segment().sub_devices()[usize::from(position)].esc();
        assert_eq!(esc.peek(0x0010, 2).unwrap(), [0, 0]);
    }
}

#[test]
fn the_right_alias_is_taken_back() {
    let mut runner = in_op(servos("alias = 5\ncount = 3"));
    let mut same = runner.subdevices[1].clone();
    same.config.place = Some(Match::Alias(6));
    runner.bus().prepare(&same);
    restart(&mut runner, 1);
    assert_eq!(way_of(&mut runner, 1), Ok(Comeback::Restarted));
}

#[test]
fn another_revision_is_refused() {
    let mut runner = in_op(segment_file("three-sgdv.toml"));
    let mut other = runner.subdevices[1].clone();
    let found = other.identity.revision;
    other.identity.revision = found + 1;
    runner.bus().prepare(&other);
    restart(&mut runner, 1);
    let error = RecoveryError::OtherRevision { position: 1, expected: found + 1, found };
    assert_eq!(way_of(&mut runner, 1), Err(error));
}

#[test]
fn one_that_started_anew_is_told_so_after_a_failed_attempt_too() {
    let mut runner = in_op(segment_file("three-sgdv.toml"));
    restart(&mut runner, 1);
    assert!(runner.bus().recover(1));
    // It has its address by then, and loses its cable.
    runner.cycles(100);
    runner.segment().inject(1, Fault::CableCut { port: 0 }).unwrap();
    let ended = (0..20_000).find_map(|_| {
        runner.cycle();
        runner.bus().poll_recovered()
    });
    assert!(matches!(ended, Some((1, Err(_)))), "{ended:?}");
    runner.segment().inject(1, Fault::CableRestored { port: 0 }).unwrap();
    assert_eq!(way_of(&mut runner, 1), Ok(Comeback::Restarted));
}
