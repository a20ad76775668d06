//! The exchange against links that answer, lie, repeat and babble.

use std::cell::Cell;
use std::collections::VecDeque;
use std::rc::Rc;

use super::*;
use crate::error::NoSubDevices;
use crate::wire::HostTime;
use crate::wire::bytes::{put_u16, put_u32};
use crate::wire::register;
use crate::{Bus, BusOptions};

#[derive(Clone, Default)]
struct FakeClock(Rc<Cell<u64>>);

impl Clock for FakeClock {
    fn now(&self) -> HostTime {
        HostTime(self.0.get())
    }
    fn sleep_until(&mut self, instant: HostTime) {
        self.0.set(self.0.get().max(instant.0));
    }
}

/// Gives each sent frame to a function, which gives the frames that arrive.
struct FakeLink<F> {
    clock: FakeClock,
    arriving: VecDeque<Vec<u8>>,
    answer: F,
    sent: usize,
}

impl<F: FnMut(usize, Vec<u8>) -> Vec<Vec<u8>>> Link for FakeLink<F> {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.arriving.extend((self.answer)(self.sent, frame.to_vec()));
        self.sent += 1;
        Ok(())
    }
    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        let Some(frame) = self.arriving.pop_front() else {
            self.clock.sleep_until(deadline);
            return Ok(None);
        };
        buffer[..frame.len()].copy_from_slice(&frame);
        Ok(Some(frame.len()))
    }
}

fn transactor<F: FnMut(usize, Vec<u8>) -> Vec<Vec<u8>>>(answer: F) -> Transactor<FakeLink<F>, FakeClock> {
    let clock = FakeClock::default();
    let link = FakeLink { clock: clock.clone(), arriving: VecDeque::new(), answer, sent: 0 };
    Transactor::new(link, clock, TransactionOptions::default())
}

/// The frame as a segment gives it back: passed, its working counters raised by `count`.
fn answered(mut frame: Vec<u8>, count: u16) -> Vec<u8> {
    frame[6] |= frame::PROCESSED_BIT;
    let datagrams: Vec<_> = read_all(&frame).map(|one| (one.offset, one.header.length)).collect();
    for (offset, length) in datagrams {
        put_u16(&mut frame, offset + frame::DATAGRAM_HEADER + length, count);
    }
    frame
}

fn target(position: u16) -> Target {
    Target { position, station: 0x1001 + position }
}

#[test]
fn many_accesses_share_frames() {
    let mut transactor = transactor(|_, frame| vec![answered(frame, 1)]);
    let mut accesses: Vec<_> =
        (0..1000).map(|position| Access::read("x", target(position), register::DL_STATUS, 2)).collect();
    transactor.perform(&mut accesses).unwrap();
    // 14 bytes each: 107 fit into the 1498 behind the headers.
    assert_eq!(transactor.counters.frames_sent, 1000u64.div_ceil(107));
    assert_eq!(transactor.counters.frames_received, transactor.counters.frames_sent);
}

#[test]
fn what_fails_is_repeated_and_only_that() {
    // The second datagram of the first frame is not counted; the repeat is.
    let mut transactor = transactor(|number, frame| {
        let mut frame = answered(frame, 1);
        if number == 0 {
            let second = read_all(&frame).nth(1).unwrap().offset;
            put_u16(&mut frame, second + frame::DATAGRAM_HEADER + 2, 0);
        } else {
            assert_eq!(read_all(&frame).count(), 1);
        }
        vec![frame]
    });
    let mut accesses = [0, 1, 2].map(|position| Access::read("x", target(position), register::DL_STATUS, 2));
    transactor.perform(&mut accesses).unwrap();
    assert_eq!((transactor.counters.frames_sent, transactor.counters.retries), (2, 1));
}

#[test]
fn a_wrong_working_counter_ends_as_a_named_error() {
    let mut transactor = transactor(|_, frame| vec![answered(frame, 2)]);
    let write = Access::write("the watchdog", target(7), register::WATCHDOG_DIVIDER, &[1, 0]);
    let error = transactor.perform_one(write).unwrap_err();
    let expected = "SubDevice 7: the watchdog: working counter 2 where 1 was expected: 2 SubDevices answer at one address, \
                    so neither can be believed; take one of them off, or switch all off and on \
                    (FPWR, station 0x1008 register 0x0400, 4 attempts)";
    assert_eq!(error.to_string(), expected);
}

#[test]
fn a_lost_frame_ends_as_a_named_error_in_time() {
    let mut transactor = transactor(|_, _| vec![]);
    let error = transactor.perform_one(Access::read("x", target(0), register::TYPE, 1)).unwrap_err();
    assert!(matches!(error, SetUpError::Access(AccessError { found: Found::Nothing, attempts: 4, .. })));
    let options = transactor.options;
    let limit = (options.frame_timeout + options.retry_pause) * 4;
    assert!(transactor.clock.now() <= HostTime(0) + limit, "{:?}", transactor.clock.now());
    assert_eq!(transactor.counters.frames_lost, 4);
}

#[test]
fn late_foreign_altered_and_repeated_frames_are_not_taken() {
    let mut transactor = transactor(|_, frame| {
        let mut wrong_index = answered(frame.clone(), 1);
        wrong_index[frame::FIRST_DATAGRAM + 1] ^= 0x80;
        let mut wrong_command = answered(frame.clone(), 1);
        wrong_command[frame::FIRST_DATAGRAM] = Command::Fpwr.code();
        let mut wrong_register = answered(frame.clone(), 1);
        put_u32(&mut wrong_register, frame::FIRST_DATAGRAM + 2, 0x0130_1001);
        let mut foreign = answered(frame.clone(), 1);
        foreign[6..12].copy_from_slice(&[0x12, 0x10, 0x10, 0x10, 0x10, 0x10]);
        let mut right = answered(frame.clone(), 1);
        right[frame::FIRST_DATAGRAM + frame::DATAGRAM_HEADER] = 0x42;
        vec![wrong_index, wrong_command, wrong_register, foreign, vec![1, 2, 3], frame, right.clone(), right]
    });
    for _ in 0..2 {
        let read = Access::read("x", target(0), register::TYPE, 1);
        assert_eq!(transactor.perform_one(read).unwrap().data, [0x42]);
    }
    let counters = transactor.counters;
    assert_eq!((counters.frames_received, counters.foreign, counters.reflected), (2, 2, 2));
    // The repeated answer of the first exchange arrives in the second.
    assert_eq!((counters.unmatched, counters.retries, counters.frames_lost), (2 * 4 + 1, 0, 0));
}

#[test]
fn a_babbling_neighbour_cannot_hang_it() {
    let mut transactor = transactor(|_, frame| {
        let mut foreign = answered(frame, 1);
        foreign[11] ^= 1;
        vec![foreign; 100_000]
    });
    assert!(transactor.perform_one(Access::read("x", target(0), register::TYPE, 1)).is_err());
}

#[test]
fn finding_nobody_says_why() {
    fn reason<F: FnMut(usize, Vec<u8>) -> Vec<Vec<u8>>>(answer: F) -> SetUpError {
        let Transactor { link, clock, .. } = transactor(answer);
        Bus::new(link, clock, BusOptions::default()).scan().unwrap_err()
    }
    let nobody = SetUpError::NoSubDevices;
    assert_eq!(reason(|_, _| vec![]), nobody(NoSubDevices::NothingBack));
    assert_eq!(reason(|_, frame| vec![frame]), nobody(NoSubDevices::Reflected));
    assert_eq!(reason(|_, frame| vec![answered(frame, 0)]), nobody(NoSubDevices::Unanswered));
    let foreign = |_, mut frame: Vec<u8>| {
        frame[11] ^= 1;
        vec![frame]
    };
    assert_eq!(reason(foreign), nobody(NoSubDevices::AnotherMainDevice));
    let many = SetUpError::TooManySubDevices { limit: 1000, found: 1001 };
    assert_eq!(reason(|_, frame| vec![answered(frame, 1001)]), many);
    let mut count = 0;
    let unsteady = reason(move |_, frame| {
        count += 1;
        vec![answered(frame, 1 + count % 2)]
    });
    assert!(matches!(unsteady, SetUpError::UnstableCount { attempts: 10, .. }), "{unsteady}");
}

#[test]
fn a_link_without_cable_is_named() {
    struct Down;
    impl Link for Down {
        fn send(&mut self, _: &[u8]) -> Result<(), LinkError> {
            Err(LinkError::Down)
        }
        fn receive(&mut self, _: &mut [u8], _: HostTime) -> Result<Option<usize>, LinkError> {
            Err(LinkError::Down)
        }
    }
    let error = Bus::new(Down, FakeClock::default(), BusOptions::default()).scan().unwrap_err();
    assert_eq!(error, SetUpError::NoSubDevices(NoSubDevices::LinkDown));
}
