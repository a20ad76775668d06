//! The segment as a link in virtual time, and served behind another link.

use crate::bench::{firmware, idle};
use core::ops::ControlFlow;
use core::time::Duration;
use omnibase_ethercat_sim::{EscConfig, Fault, Segment, SimLink, SubDevice, VirtualClock, in_process, serve};
use omnibase_ethercat_wire::frame::{FrameBuilder, MAX_FRAME};
use omnibase_ethercat_wire::register as reg;
use omnibase_ethercat_wire::{Address, Clock, Command, HostTime, Link, LinkError};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

fn segment(count: usize) -> Segment {
    Segment::line((0..count).map(|_| SubDevice::new(EscConfig::default(), idle())).collect()).unwrap()
}

fn brd(index: u8) -> Vec<u8> {
    let mut frame = FrameBuilder::new();
    frame.push_zeros(Command::Brd, index, Address::broadcast(0), 1).unwrap();
    frame.bytes().to_vec()
}

#[test]
fn a_frame_is_back_when_its_time_has_come() {
    let (mut link, mut clock) = in_process(segment(1));
    let mut buffer = [0; MAX_FRAME];
    clock.sleep_until(HostTime(1_000));
    link.send(&brd(1)).unwrap();
    link.send(&brd(2)).unwrap();
    // 72 byte times, twice 100 ns of cable, 300 ns of chip; the next one starts 84 byte times later.
    let first = HostTime(1_000 + 72 * 80 + 200 + 300);
    assert_eq!(link.receive(&mut buffer, HostTime(0)), Ok(None), "a deadline in the past only looks");
    assert_eq!(clock.now(), HostTime(1_000));
    assert_eq!(link.receive(&mut buffer, HostTime(5_000)), Ok(None));
    assert_eq!(clock.now(), HostTime(5_000));
    assert_eq!(link.receive(&mut buffer, HostTime(1_000_000)), Ok(Some(29)));
    assert_eq!((clock.now(), buffer[17], buffer[27]), (first, 1, 1));
    assert_eq!(link.receive(&mut buffer, HostTime(1_000_000)), Ok(Some(29)));
    assert_eq!((clock.now(), buffer[17]), (first + Duration::from_nanos(84 * 80), 2));
    assert_eq!(link.receive(&mut buffer, HostTime(1_000_000)), Ok(None));
    assert_eq!(clock.now(), HostTime(1_000_000));
}

#[test]
fn firmware_runs_while_the_main_device_waits() {
    let runs = Arc::new(Mutex::new(Vec::new()));
    let log = runs.clone();
    let app = firmware(move |_, _, now| {
        log.lock().unwrap().push(now.0);
        Some(now + Duration::from_micros(100))
    });
    let segment = Segment::line(vec![SubDevice::new(EscConfig::default(), app)]).unwrap();
    let (mut link, mut clock) = in_process(segment);
    link.receive(&mut [0; MAX_FRAME], HostTime(250_000)).unwrap();
    assert_eq!(*runs.lock().unwrap(), [0, 100_000, 200_000]);
    clock.sleep_until(HostTime(450_000));
    assert_eq!(link.segment_mut().now(), HostTime(450_000));
    assert_eq!(*runs.lock().unwrap(), [0, 100_000, 200_000, 300_000, 400_000]);
}

#[test]
fn frames_that_are_too_long_are_refused() {
    let (mut link, _) = in_process(segment(1));
    let limit = MAX_FRAME;
    assert_eq!(link.send(&[0; MAX_FRAME + 1]), Err(LinkError::FrameTooLong { limit, found: limit + 1 }));
}

/// Everything that a run shows: answers, times, and at the end all registers.
fn run() -> Vec<u8> {
    let counter = |seed: u64| {
        let mut state = seed;
        firmware(move |pdi, event, now| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(u64::from(event.0) + now.0);
            pdi.write(0x0F80, &state.to_le_bytes());
            pdi.read(reg::AL_CONTROL, &mut [0; 2]);
            pdi.read(reg::DC_SYNC0_STATUS, &mut [0; 2]);
            Some(now + Duration::from_nanos(10_000 + state % 50_000))
        })
    };
    let chip =
        |n: u64, ppm| EscConfig { dc_offset_ns: n * 1_000_007, dc_drift_ppm: ppm, ..EscConfig::default() };
    let devices = (0..4).map(|n| SubDevice::new(chip(n, n as f64 * 17.3 - 20.0), counter(n))).collect();
    let (mut link, mut clock): (SimLink, VirtualClock) = in_process(Segment::line(devices).unwrap());
    let mut seen = Vec::new();
    for n in 0..2000u16 {
        let mut frame = FrameBuilder::new();
        frame.push_zeros(Command::Armw, n as u8, Address::position(0, reg::DC_SYSTEM_TIME), 8).unwrap();
        frame.push(Command::Bwr, 1, Address::broadcast(reg::AL_CONTROL), &[(n % 9) as u8, 0]).unwrap();
        frame.push_zeros(Command::Brd, 2, Address::broadcast(0x0F80), 8).unwrap();
        if n == 100 {
            let start = 20_000_000u64.to_le_bytes();
            frame
                .push(Command::Bwr, 3, Address::broadcast(reg::DC_SYNC0_CYCLE), &[0x48, 0xE8, 1, 0])
                .unwrap();
            frame.push(Command::Bwr, 3, Address::broadcast(reg::DC_START_TIME), &start).unwrap();
            frame.push(Command::Bwr, 3, Address::broadcast(reg::DC_ACTIVATION), &[3]).unwrap();
        }
        if n == 500 {
            link.segment_mut().inject(2, Fault::PowerCycle { off_for: Duration::from_micros(3333) }).unwrap();
        }
        link.send(frame.bytes()).unwrap();
        let mut buffer = [0; MAX_FRAME];
        if let Some(length) = link.receive(&mut buffer, clock.now() + Duration::from_micros(80)).unwrap() {
            seen.extend_from_slice(&buffer[..length]);
        }
        seen.extend(clock.now().0.to_le_bytes());
        clock.sleep_until(clock.now() + Duration::from_micros(100));
    }
    for device in link.segment().sub_devices() {
        seen.extend_from_slice(device.esc().peek(0, 0x3000).unwrap());
    }
    seen
}

#[test]
fn the_same_run_gives_the_same_bits() {
    let first = run();
    assert!(first.len() > 2000 * 100);
    assert!(first == run());
}

/// The far end of a link under the test's control: frames to hand out and when they came, frames that were sent.
struct Wire {
    incoming: VecDeque<(Option<HostTime>, Vec<u8>)>,
    arrival: Option<HostTime>,
    sent: Arc<Mutex<Vec<Vec<u8>>>>,
    clock: VirtualClock,
    waits: Arc<Mutex<Vec<u64>>>,
}

impl Wire {
    fn new(clock: &VirtualClock, incoming: impl IntoIterator<Item = (Option<HostTime>, Vec<u8>)>) -> Self {
        Wire {
            incoming: incoming.into_iter().collect(),
            arrival: None,
            sent: Arc::default(),
            clock: clock.clone(),
            waits: Arc::default(),
        }
    }
}

impl Link for Wire {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.sent.lock().unwrap().push(frame.to_vec());
        // An interface without a filter shows us what we send.
        self.incoming.push_front((None, frame.to_vec()));
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        let now = self.clock.now();
        let came = |frame: &(Option<HostTime>, Vec<u8>)| frame.0.is_none_or(|arrival| arrival <= now);
        if self.incoming.front().is_some_and(came)
            && let Some((arrival, frame)) = self.incoming.pop_front()
        {
            buffer[..frame.len()].copy_from_slice(&frame);
            self.arrival = arrival;
            return Ok(Some(frame.len()));
        }
        if deadline > self.clock.now() {
            self.waits.lock().unwrap().push(deadline.0);
            self.clock.advance_to(deadline);
        }
        Ok(None)
    }

    fn arrival(&self) -> Option<HostTime> {
        self.arrival
    }
}

/// Breaks off when the segment's time has come this far.
fn until(instant: HostTime) -> impl FnMut(&mut Segment) -> ControlFlow<()> {
    move |segment| match segment.now() >= instant {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    }
}

#[test]
fn a_served_segment_answers_ignores_its_own_and_foreign_frames_and_lives_between_frames() {
    let runs = Arc::new(Mutex::new(Vec::new()));
    let log = runs.clone();
    let app = firmware(move |_, _, now| {
        log.lock().unwrap().push(now.0);
        Some(now + Duration::from_micros(100))
    });
    let mut segment = Segment::line(vec![SubDevice::new(EscConfig::default(), app)]).unwrap();
    let clock = VirtualClock::new();
    clock.advance_to(HostTime(7_000_000_000_000));
    // A MainDevice whose own address is locally administered, an ARP frame, a runt.
    let mut local = brd(9);
    local[6] |= 0x02;
    let mut arp = brd(1);
    (arp[12], arp[13]) = (0x08, 0x06);
    let incoming = [arp, vec![1; 5], brd(1), local.clone(), brd(2)];
    let mut wire = Wire::new(&clock, incoming.map(|frame| (None, frame)));
    let (sent, waits) = (Arc::clone(&wire.sent), Arc::clone(&wire.waits));
    let served = serve(&mut segment, &mut wire, &clock, &mut until(HostTime(1_000_000))).unwrap();
    assert_eq!((served.frames, served.answered, served.ignored), (3, 3, 5));
    let indices: Vec<u8> = sent.lock().unwrap().iter().map(|frame| frame[17]).collect();
    assert_eq!(indices, [1, 9, 2]);
    assert!(sent.lock().unwrap().iter().all(|frame| frame[27] == 1 && frame.len() == 29));
    // The segment's time began where the host's stood, and each wait ends where the firmware wants to run.
    assert_eq!(runs.lock().unwrap()[..4], [0, 100_000, 200_000, 300_000]);
    assert_eq!(waits.lock().unwrap()[0], 7_000_000_100_000);
}

#[test]
fn frames_that_waited_for_the_program_pass_at_the_instants_of_their_arrival() {
    let app = firmware(|_, _, now| Some(now + Duration::from_micros(100)));
    let mut segment = Segment::line(vec![SubDevice::new(EscConfig::default(), app)]).unwrap();
    let (clock, origin) = (VirtualClock::new(), 5_000_000);
    clock.advance_to(HostTime(origin));
    let at = |us: u64| Some(HostTime(origin + 1000 * us));
    let incoming = [(at(250), brd(1)), (at(450), brd(2)), (at(460), brd(3))];
    let mut wire = Wire::new(&clock, incoming);
    let slept = clock.clone();
    let mut seen = Vec::new();
    let mut watch = |segment: &mut Segment| {
        // The program falls asleep as soon as it serves.
        slept.advance_to(HostTime(origin + 1_000_000));
        if seen.last() != Some(&segment.now().0) {
            seen.push(segment.now().0);
        }
        until(HostTime(1_200_000))(segment)
    };
    let served = serve(&mut segment, &mut wire, &clock, &mut watch).unwrap();
    assert_eq!((served.frames, served.answered), (3, 3));
    assert_eq!(served.longest_wait_ns, 750_000, "the first frame: from 250 us to 1000 us");
    let us: Vec<u64> = seen.iter().map(|ns| ns / 1000).collect();
    assert_eq!(us, [0, 100, 200, 250, 300, 400, 450, 460, 500, 600, 700, 800, 900, 1000, 1100, 1200]);
}

#[test]
fn whoever_watches_injects_faults_at_their_instant() {
    let mut segment = segment(2);
    let clock = VirtualClock::new();
    let mut wire = Wire::new(&clock, []);
    let mut injected = None;
    let mut watch = |segment: &mut Segment| {
        if injected.is_none() && segment.now() >= HostTime(12_000_000) {
            segment.inject(1, Fault::PowerOff).unwrap();
            injected = Some(segment.now());
        }
        until(HostTime(20_000_000))(segment)
    };
    serve(&mut segment, &mut wire, &clock, &mut watch).unwrap();
    // Nothing happens in this segment by itself: the watcher is asked every 5 ms.
    assert_eq!(injected, Some(HostTime(15_000_000)));
    assert!(!segment.sub_devices()[1].powered());
}
