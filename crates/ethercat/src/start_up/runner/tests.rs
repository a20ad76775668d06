//! Steps against scripted answers.

use super::*;
use crate::wire::coe::ObjectAddress;
use crate::wire::{Address, Command};

const TARGET: Target = Target { position: 3, station: 0x1004 };

fn runner(steps: Vec<StartUpStep>) -> StartUpRunner {
    StartUpRunner::new(TARGET, Application::Controller, steps, None)
}

/// Takes the next request and its data.
fn request(runner: &mut StartUpRunner, now: HostTime) -> (Command, u16, Vec<u8>) {
    let Next::Send(request) = runner.next(now) else { panic!("nothing to send") };
    let Address::Station { station: 0x1004, register } = request.address else { panic!("{request:?}") };
    let mut data = vec![0; request.length];
    runner.fill(&mut data);
    (request.command, register, data)
}

fn counted(data: &[u8]) -> Answer<'_> {
    Answer::Returned { working_counter: 1, data }
}

#[test]
fn a_clock_is_set_to_the_reference_without_forgetting_its_present_offset() {
    let mut runner = runner(vec![StartUpStep::ClockOffset { delay_ns: 400 }]);
    let now = HostTime(0);
    let (command, register, mut data) = request(&mut runner, now);
    assert_eq!((command, register, data.len()), (Command::Fprd, 0x0910, 24));
    // It shows 5000 with an offset of 1000; the segment's time at its place is 700 000 + 400.
    data[..8].copy_from_slice(&5_000u64.to_le_bytes());
    data[16..].copy_from_slice(&1_000u64.to_le_bytes());
    runner.set_reference_time(DcTime(700_000));
    runner.answer(counted(&data), now);
    let (command, register, data) = request(&mut runner, now);
    assert_eq!((command, register), (Command::Fpwr, 0x0920));
    assert_eq!(data, (1_000u64 + 700_400 - 5_000).to_le_bytes());
    runner.answer(counted(&data), now);
    assert_eq!(runner.next(now), Next::Done(Ok(())));
}

#[test]
fn without_a_reference_time_the_clock_is_not_set() {
    let mut runner = runner(vec![StartUpStep::ClockOffset { delay_ns: 400 }]);
    let mut now = HostTime(0);
    for _ in 0..ATTEMPTS {
        let (.., data) = request(&mut runner, now);
        runner.answer(counted(&data), now);
        now = now + PAUSE;
    }
    assert!(matches!(
        runner.next(now),
        Next::Done(Err(StartUpError {
            position: 3,
            cause: StartUpFailure::Registers { register: 0x0910, found: Found::WorkingCounter(1), .. }
        }))
    ));
}

fn step(register: u16, refusal: Refusal) -> StartUpStep {
    StartUpStep::Registers { register, data: vec![7], what: "a register", refusal }
}

#[test]
fn a_refused_register_is_tried_again_and_then_named_or_passed_over() {
    let steps = vec![step(0x0980, Refusal::IsTolerated), step(0x0420, Refusal::IsError)];
    let mut runner = runner(steps);
    let mut now = HostTime(0);
    let mut seen = Vec::new();
    let result = loop {
        match runner.next(now) {
            Next::Send(_) => {
                let (command, register, data) = request(&mut runner, now);
                assert_eq!((command, &data[..]), (Command::Fpwr, &[7][..]));
                seen.push(register);
                runner.answer(Answer::Returned { working_counter: 0, data: &data }, now);
            }
            Next::WaitUntil(instant) => now = instant,
            Next::Done(result) => break result,
        }
    };
    assert_eq!(seen, [0x0980, 0x0980, 0x0980, 0x0980, 0x0420, 0x0420, 0x0420, 0x0420]);
    assert_eq!(
        result.unwrap_err().to_string(),
        "SubDevice 3: a register (register 0x0420): working counter 0 where working counter 1 was expected"
    );
}

#[test]
fn a_lost_frame_is_no_refusal() {
    let mut runner = runner(vec![step(0x0980, Refusal::IsTolerated)]);
    let mut now = HostTime(0);
    for _ in 0..ATTEMPTS {
        request(&mut runner, now);
        runner.answer(Answer::Lost, now);
        now = now + PAUSE;
    }
    let Next::Done(Err(error)) = runner.next(now) else { panic!("passed over") };
    assert!(matches!(error.cause, StartUpFailure::Registers { found: Found::Nothing, .. }));
    assert_eq!(
        error.to_string(),
        "SubDevice 3: a register (register 0x0980): the frame did not come back: it was lost on its way, nobody \
         refused it"
    );
}

#[test]
fn what_it_cannot_do_is_named() {
    let sdo = SdoWrite {
        object: ObjectAddress::new(0x1600, 0),
        data: vec![0],
        access: crate::start_up::SdoAccess::Entry,
        refusal: Refusal::IsError,
        read_back: ReadBack::Skip,
        origin: Some("line 3".into()),
    };
    let Next::Done(Err(error)) = runner(vec![StartUpStep::Sdo(sdo)]).next(HostTime(0)) else { panic!() };
    let text = "SubDevice 3: SDO 1600:00 was asked, but the SubDevice has no CoE mailbox (line 3)";
    assert_eq!(error.to_string(), text);
    let Next::Done(Err(error)) = runner(vec![StartUpStep::ArmSync]).next(HostTime(0)) else { panic!() };
    assert_eq!(error.cause, StartUpFailure::NeedsCycle);
}
