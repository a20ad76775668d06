//! Both ends of a ring, from which anything comes back: any bytes in both copies of a frame, lost, late, at either end.
//!
//! Nothing may panic. Where both copies of a frame come back with nothing but counters in them, the answer has the frame's
//! datagrams and both counters added up, and the ring is told as whole or broken as the copies went.
#![no_main]

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::time::Duration;

use libfuzzer_sys::fuzz_target;
use omnibase_ethercat::redundant::RedundantLink;
use omnibase_ethercat::wire::frame::{DATAGRAM_HEADER, Datagrams, FrameBuilder, MAX_FRAME};
use omnibase_ethercat::wire::{Address, Clock, Command, HostTime, Link, LinkError, RingState, register};

/// One end: what was sent there, and what will come.
#[derive(Clone, Default)]
struct End {
    sent: Rc<RefCell<Vec<Vec<u8>>>>,
    coming: Rc<RefCell<VecDeque<Vec<u8>>>>,
}

impl Link for End {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.sent.borrow_mut().push(frame.to_vec());
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], _deadline: HostTime) -> Result<Option<usize>, LinkError> {
        let Some(frame) = self.coming.borrow_mut().pop_front() else { return Ok(None) };
        buffer[..frame.len()].copy_from_slice(&frame);
        Ok(Some(frame.len()))
    }
}

/// Each look takes a microsecond.
#[derive(Clone, Default)]
struct Ticking(Rc<RefCell<u64>>);

impl Clock for Ticking {
    fn now(&self) -> HostTime {
        *self.0.borrow_mut() += 1000;
        HostTime(*self.0.borrow())
    }

    fn sleep_until(&mut self, instant: HostTime) {
        let mut now = self.0.borrow_mut();
        *now = (*now).max(instant.0);
    }
}

fn take(bytes: &mut &[u8]) -> Option<u8> {
    let (first, rest) = bytes.split_first()?;
    *bytes = rest;
    Some(*first)
}

/// Where the counters of a frame's datagrams stand.
fn counters_at(frame: &[u8]) -> Vec<usize> {
    let datagrams = Datagrams::new(frame).expect("a frame of ours").map_while(Result::ok);
    datagrams.map(|one| one.offset + DATAGRAM_HEADER + one.header.length).collect()
}

/// The frame as it comes back at some end with small counters; `false` where the bytes changed more of it.
fn returned(mut frame: Vec<u8>, bytes: &mut &[u8]) -> Option<(Vec<u8>, bool)> {
    for at in counters_at(&frame) {
        frame[at] = take(bytes)? & 0x0F;
    }
    let changes = take(bytes)? % 8;
    for _ in 0..changes {
        let at = usize::from(take(bytes)?) % frame.len();
        frame[at] = take(bytes)?;
    }
    let cut = take(bytes)?;
    if cut > 0xF0 {
        frame.truncate(frame.len().saturating_sub(usize::from(cut & 0x0F)).max(1));
    }
    let is_true = changes == 0 && cut <= 0xF0;
    Some((frame, is_true))
}

fn frame(number: u8) -> Vec<u8> {
    let mut frame = FrameBuilder::new();
    let push = |frame: &mut FrameBuilder, command, address, data: &[u8]| {
        frame.push(command, number, address, data).unwrap();
    };
    push(&mut frame, Command::Frmw, Address::station(0x1001, register::DC_SYSTEM_TIME), &[7; 8]);
    push(&mut frame, Command::Brd, Address::broadcast(register::AL_STATUS), &[0; 2]);
    push(&mut frame, Command::Aprd, Address::position(2, register::STATION_ADDRESS), &[0; 2]);
    push(&mut frame, Command::Lrw, Address::Logical(0x1_0000), &[number; 20]);
    frame.bytes().to_vec()
}

/// How a copy comes back.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Passage {
    Lost,
    Turned,
    Through,
    Twice,
}

const WAYS: [Passage; 4] = [Passage::Lost, Passage::Turned, Passage::Through, Passage::Twice];

fuzz_target!(|bytes: &[u8]| {
    let mut bytes = bytes;
    let ends = [End::default(), End::default()];
    let clock = Ticking::default();
    let mut link = RedundantLink::new(ends[0].clone(), ends[1].clone(), clock.clone());
    let mut buffer = [0; MAX_FRAME];
    for number in (0u8..=255).cycle() {
        let Some(what) = take(&mut bytes) else { return };
        let ways = [0, 1].map(|copy| WAYS[usize::from(what >> (2 * copy) & 3)]);
        let sent = frame(number);
        link.send(&sent).unwrap();
        let mut copies = Vec::new();
        for (copy, end) in ends.iter().enumerate() {
            let Some(frame) = end.sent.borrow_mut().pop() else { continue };
            let at = match ways[copy] {
                Passage::Lost => continue,
                Passage::Turned => copy,
                Passage::Through | Passage::Twice => 1 - copy,
            };
            let Some((frame, is_true)) = returned(frame, &mut bytes) else { return };
            ends[at].coming.borrow_mut().push_back(frame.clone());
            if ways[copy] == Passage::Twice {
                ends[at].coming.borrow_mut().push_back(frame.clone());
            }
            copies.push((frame, is_true));
        }
        let deadline = clock.now() + Duration::from_micros(100);
        let mut answers = Vec::new();
        while let Some(length) = link.receive(&mut buffer, deadline).unwrap() {
            answers.push(buffer[..length].to_vec());
        }
        let are_true = copies.iter().all(|(_, is_true)| *is_true) && !ways.contains(&Passage::Twice);
        let [(first, _), (second, _)] = &copies[..] else { continue };
        if !are_true {
            continue;
        }
        let [answer] = &answers[..] else { panic!("{} answers to two true copies", answers.len()) };
        assert_eq!(answer.len(), sent.len());
        let places = counters_at(&sent);
        assert_eq!(counters_at(answer), places);
        for &at in &places {
            assert_eq!(answer[at], first[at] + second[at], "the counter at {at}");
        }
        // The second datagram is the broadcast that counts who is there.
        let before = u16::from(first[places[1]]);
        match (ways, link.ring()) {
            ([Passage::Through, Passage::Through], Some(RingState::Whole)) => {}
            ([Passage::Turned, Passage::Turned], Some(RingState::Broken { before: told, behind })) => {
                assert!(told == before && behind >= before, "{told} and {behind}, {before} answered");
            }
            ([Passage::Turned, Passage::Through] | [Passage::Through, Passage::Turned], Some(_)) => {}
            (ways, state) => panic!("{ways:?} and {state:?}"),
        }
    }
});
