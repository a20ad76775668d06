//! Waits in virtual time, at a port whose frames come when they are told to.

use super::*;
use crate::{MonotonicClock, Namespace, PacketRing, PacketSocket, Waiting};
use omnibase_ethercat_wire::frame::FrameBuilder;
use omnibase_ethercat_wire::{Address, Clock, Command, Link};
use std::cell::Cell;
use std::rc::Rc;
use std::time::Duration;

/// The usual time-out of a cycle of 1 ms.
const TIMEOUT: Duration = Duration::from_micros(500);
const PERIOD: Duration = Duration::from_millis(1);
/// What a look takes.
const A_LOOK: Duration = Duration::from_nanos(200);

/// When the frame of a wait comes.
#[derive(Clone, Copy)]
enum Comes {
    /// So long behind the wait's begin.
    After(Duration),
    /// So long behind the moment at which the port goes to sleep: who answers needs its CPU.
    AfterSleep(Duration),
    Never,
}

struct Port {
    look: Look,
    time: Rc<Cell<HostTime>>,
    /// What waking up takes.
    wakes_in: Duration,
    /// Frames under way.
    due: Option<HostTime>,
    comes: Comes,
    looks: u64,
    sleeps: u64,
}

impl LooksFirst for Port {
    const LOOKS_PER_CLOCK: u32 = 4;
    const PAUSES_PER_LOOK: u32 = 1;

    fn learnt(&mut self) -> &mut Look {
        &mut self.look
    }

    fn take(&mut self, _: &mut [u8]) -> Result<Option<usize>, LinkError> {
        self.looks += 1;
        self.time.set(self.time.get() + A_LOOK);
        Ok(self.due.take_if(|due| *due <= self.time.get()).map(|_| 60))
    }

    fn sleep(&mut self, _: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        self.sleeps += 1;
        if let Comes::AfterSleep(after) = self.comes {
            self.due = Some(self.time.get() + after);
        }
        let came = self.due.take_if(|due| *due < deadline);
        let woken = came.map_or(deadline, |due| due.max(self.time.get()));
        self.time.set(woken + self.wakes_in);
        Ok(came.map(|_| 60))
    }
}

/// What some waits came to.
#[derive(Debug, PartialEq)]
struct Waits {
    /// Frames that came.
    frames: u64,
    /// Waits that slept.
    slept: u64,
    /// Time looked.
    looked: Duration,
}

impl Port {
    fn new() -> Self {
        Port {
            look: Look::default(),
            time: Rc::new(Cell::new(HostTime(1_000_000_000))),
            wakes_in: Duration::ZERO,
            due: None,
            comes: Comes::Never,
            looks: 0,
            sleeps: 0,
        }
    }

    /// Waits until `deadline` for a frame that comes as told; whether it came.
    fn wait(&mut self, comes: Comes, deadline: HostTime) -> bool {
        let begin = self.time.get();
        self.comes = comes;
        self.due = match comes {
            Comes::After(after) => Some(begin + after),
            _ => None,
        };
        let time = Rc::clone(&self.time);
        let received = self.look_then_sleep(&mut [], [begin, deadline], &mut || time.get());
        received.unwrap().is_some()
    }

    /// As many cycles of 1 ms.
    fn cycles(&mut self, count: u64, comes: impl Fn(u64) -> Comes) -> Waits {
        let (looks, slept) = (self.looks, self.sleeps);
        let mut frames = 0;
        for cycle in 0..count {
            let begin = self.time.get();
            frames += u64::from(self.wait(comes(cycle), begin + TIMEOUT));
            self.time.set(self.time.get().max(begin + PERIOD));
        }
        Waits { frames, slept: self.sleeps - slept, looked: A_LOOK * (self.looks - looks) as u32 }
    }
}

fn us(us: u64) -> Duration {
    Duration::from_micros(us)
}

#[test]
fn frames_that_come_soon_are_found_without_a_sleep() {
    for after in [0, 1, 3, 15] {
        let mut port = Port::new();
        let waits = port.cycles(10_000, |_| Comes::After(us(after)));
        assert_eq!((waits.frames, waits.slept), (10_000, 0), "{after} us");
        assert!(waits.looked <= 10_000 * (us(after) + A_LOOK), "no longer than they need: {waits:?}");
    }
}

#[test]
fn frames_that_take_longer_than_at_first_are_learnt() {
    let mut port = Port::new();
    port.wakes_in = us(20);
    port.cycles(200, |_| Comes::After(us(80)));
    assert_eq!(port.cycles(1000, |_| Comes::After(us(80))).slept, 0);
}

#[test]
fn what_nine_of_ten_take_is_usual() {
    let mut port = Port::new();
    let fifth = |cycle: u64| Comes::After(if cycle.is_multiple_of(5) { us(60) } else { us(10) });
    port.cycles(1000, fifth);
    assert_eq!(port.cycles(1000, fifth).slept, 0, "the slower fifth is looked for, too");
}

#[test]
fn a_time_that_was_slow_is_soon_forgotten() {
    let mut port = Port::new();
    for _ in 0..300 {
        let begin = port.time.get();
        assert!(port.wait(Comes::After(us(1_000_000)), begin + us(5_000_000)));
    }
    port.cycles(300, |_| Comes::After(us(10)));
    assert!(port.look.usual_ns < 12_000, "{:?}", port.look);
}

#[test]
fn a_lost_frame_costs_twice_the_usual_time_and_ends_at_the_deadline() {
    let mut port = Port::new();
    port.cycles(1000, |_| Comes::After(us(10)));
    let begin = port.time.get();
    let looks = port.looks;
    assert!(!port.wait(Comes::Never, begin + TIMEOUT));
    assert_eq!(port.time.get(), begin + TIMEOUT, "not earlier, not later");
    let looked = A_LOOK * (port.looks - looks) as u32;
    assert!(us(15) < looked && looked < us(25), "{looked:?}");
    assert_eq!(port.cycles(1000, |_| Comes::After(us(10))).slept, 0, "and nothing else");
}

#[test]
fn single_late_frames_do_not_make_looks_longer() {
    let mut port = Port::new();
    let one_in_fifty =
        |cycle: u64| if cycle.is_multiple_of(50) { Comes::After(us(400)) } else { Comes::After(us(10)) };
    let waits = port.cycles(10_000, one_in_fifty);
    assert_eq!((waits.frames, waits.slept), (10_000, 200), "the late ones alone are slept for");
    let begin = port.time.get();
    let until = port.look.begin(begin, begin + TIMEOUT).unwrap();
    assert!(until - begin < us(25), "{:?}", until - begin);
}

#[test]
fn a_slow_bus_is_slept_for() {
    let mut port = Port::new();
    let waits = port.cycles(10_000, |_| Comes::After(us(300)));
    assert_eq!((waits.frames, waits.slept), (10_000, 10_000));
    assert!(waits.looked < PERIOD * 10_000 / 1000, "a thousandth of the time: {waits:?}");
}

#[test]
fn an_end_that_needs_this_cpu_gets_it() {
    let mut port = Port::new();
    let waits = port.cycles(10_000, |_| Comes::AfterSleep(us(8)));
    assert_eq!((waits.frames, waits.slept), (10_000, 10_000));
    assert!(waits.looked < us(1000), "{waits:?}");
    // It moves to another CPU.
    let waits = port.cycles(2000, |_| Comes::After(us(8)));
    assert!(waits.slept <= 1024, "{waits:?}");
    assert_eq!(port.cycles(1000, |_| Comes::After(us(8))).slept, 0);
}

#[test]
fn a_cable_that_is_out_is_not_looked_at() {
    let mut port = Port::new();
    port.cycles(1000, |_| Comes::After(us(30)));
    let waits = port.cycles(10_000, |_| Comes::Never);
    assert_eq!(waits.frames, 0);
    assert!(waits.looked < us(2000), "{waits:?}");
}

#[test]
fn looks_pay_while_every_second_one_finds_its_frame() {
    let mut port = Port::new();
    let sometimes = |one_in: u64| {
        move |cycle: u64| {
            // Without a beat that pauses could fall in with.
            let is_late = (cycle.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32).is_multiple_of(one_in);
            if is_late { Comes::After(us(450)) } else { Comes::After(us(10)) }
        }
    };
    let waits = port.cycles(10_000, sometimes(4));
    assert!((2400..3300).contains(&waits.slept), "the late quarter and few others: {waits:?}");
    let waits = port.cycles(10_000, |cycle| match sometimes(4)(cycle) {
        Comes::After(after) if after == us(10) => Comes::After(us(450)),
        _ => Comes::After(us(10)),
    });
    assert!(waits.looked < us(10_000), "a thousandth of the time where three of four are late: {waits:?}");
}

#[test]
fn a_look_takes_a_quarter_of_the_time_until_the_deadline_at_most() {
    let mut port = Port::new();
    port.look.usual_ns = MOST_NS;
    let begin = port.time.get();
    for (timeout, look) in [(500, 125), (100, 25), (4, 1), (2000, 200), (1_000_000, 200)] {
        let until = port.look.begin(begin, begin + us(timeout));
        assert_eq!(until, Some(begin + us(look)), "{timeout} us");
    }
    assert_eq!(port.look.begin(begin, begin + us(3)), None, "not worth it");
    assert_eq!(port.look.begin(begin, begin), None);
    assert_eq!(port.look.begin(begin, HostTime(0)), None);
}

#[test]
fn all_waits_for_one_deadline_share_a_look() {
    let mut port = Port::new();
    // Foreign frames, 20 us apart, which the caller goes on waiting behind.
    let (begin, deadline) = (port.time.get(), port.time.get() + TIMEOUT);
    while port.wait(Comes::After(us(20)), deadline) {}
    assert_eq!(port.time.get(), deadline);
    let looked = A_LOOK * port.looks as u32;
    assert!(us(100) < looked && looked <= us(126), "{looked:?} of {:?}", deadline - begin);
}

#[test]
fn a_clock_that_stands_ends_the_look_all_the_same() {
    let mut port = Port::new();
    let begin = port.time.get();
    let received = port.look_then_sleep(&mut [], [begin, begin + TIMEOUT], &mut || begin);
    assert_eq!(received, Ok(None));
    assert_eq!(port.sleeps, 1);
}

#[test]
fn a_clock_that_goes_back_is_no_late_frame() {
    let mut port = Port::new();
    let begin = port.time.get();
    port.look.begin(begin, begin + TIMEOUT);
    port.look.found(HostTime(0));
    assert!(
        port.look.begin(HostTime(0), HostTime(0) + TIMEOUT).is_some_and(|until| until <= HostTime(20_000))
    );
}

/// A frame that comes while `port` looks, which its clock sends at its third reading, is found by looking.
fn finds_what_comes_meanwhile(mut port: impl LooksFirst) {
    let mut frame = FrameBuilder::new();
    frame.push_zeros(Command::Lrd, 1, Address::Logical(0), 46).unwrap();
    let mut far = PacketSocket::open(Namespace::FAR).unwrap();
    let mut beside = PacketSocket::open(Namespace::NEAR).unwrap();
    let soon = || MonotonicClock.now() + Duration::from_secs(5);
    let mut readings = 0;
    // It stands, so that it is looked for as often as is allowed; the other socket sees when the frame is there.
    let mut clock = || {
        readings += 1;
        if readings == 3 {
            far.send(frame.bytes()).unwrap();
            beside.receive(&mut [0; 2048], soon()).unwrap().expect("the frame");
        }
        HostTime(1000)
    };
    *port.learnt() = Look { usual_ns: MOST_NS, in_vain: 1, ..Look::default() };
    let wait = [HostTime(1000), soon()];
    let received = port.look_then_sleep(&mut [0; 2048], wait, &mut clock);
    assert_eq!(received, Ok(Some(frame.bytes().len())));
    assert!(readings > 3, "it was found behind a look at the clock");
    assert_eq!(port.learnt().in_vain, 0, "not by sleeping");
}

#[test]
fn both_ports_find_what_comes_while_they_look() {
    let Some(namespace) = Namespace::for_test("both_ports_find_what_comes_while_they_look") else { return };
    namespace.run(|| {
        finds_what_comes_meanwhile(PacketSocket::open(Namespace::NEAR).unwrap());
        finds_what_comes_meanwhile(PacketRing::open(Namespace::NEAR, Waiting::Sleep).unwrap());
    });
}

/// What a port learnt from one wait for a frame that never came.
fn learnt_from_a_wait<P: Link + LooksFirst>(mut port: P) -> Look {
    // A pause of this machine may have passed the deadline before the wait began: then it didn't wait.
    for _ in 0..100 {
        let begin = MonotonicClock.now();
        assert_eq!(port.receive(&mut [0; 2048], begin + Duration::from_millis(20)), Ok(None));
        if port.learnt().in_vain > 0 {
            break;
        }
    }
    *port.learnt()
}

#[test]
fn a_receive_looks_first_and_one_that_polls_never_learns() {
    let Some(namespace) = Namespace::for_test("a_receive_looks_first") else { return };
    namespace.run(|| {
        assert_eq!(learnt_from_a_wait(PacketSocket::open(Namespace::NEAR).unwrap()).in_vain, 1);
        let ring = |waiting| PacketRing::open(Namespace::NEAR, waiting).unwrap();
        assert_eq!(learnt_from_a_wait(ring(Waiting::Sleep)).in_vain, 1);
        let mut polling = ring(Waiting::BusyPoll);
        let deadline = MonotonicClock.now() + Duration::from_millis(20);
        assert_eq!(polling.receive(&mut [0; 2048], deadline), Ok(None));
        assert_eq!(*polling.learnt(), Look::default());
    });
}
