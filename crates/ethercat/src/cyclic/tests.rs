//! The cycle against a small segment of its own making, frame by frame.

use super::*;
use crate::config::{CyclicControl, DcConfig, LrwPermission};
use crate::image::{Area, ClockUse, Packing};
use crate::subdevice::{DcWidth, Direction};
use crate::wire::AlStatusCode;
use crate::wire::bytes::{put_u16, u32_at};
use crate::wire::frame::Datagrams;
use core::time::Duration;
use std::collections::{BTreeMap, VecDeque};

const BYTES: u32 = 20;
const CYCLE: Duration = Duration::from_millis(1);

fn members(count: u16) -> Vec<Member> {
    let area = |sync_manager, direction| Area {
        sync_manager,
        direction,
        bit_length: BYTES * 8,
        packing: Packing::Bytes,
    };
    let member = |position| Member {
        position,
        station: 0x1000 + position,
        lrw: LrwPermission::Barred,
        areas: vec![area(2, Direction::Outputs), area(3, Direction::Inputs)],
        mailbox: None,
        clock: Some(DcWidth::Bits64),
        sync: DcConfig::Sync0 { cycle_ns: 1_000_000, shift_ns: 0 },
        cyclic_control: CyclicControl::Write,
    };
    (0..count).map(member).collect()
}

/// What a test does to the frames of one exchange: gets all answers, leaves those that arrive.
type Fault = Box<dyn FnMut(u64, &mut VecDeque<Vec<u8>>)>;

/// SubDevices with outputs, inputs and registers; each input byte is the number of the exchange.
struct Segment {
    plan: ImagePlan,
    alive: Vec<bool>,
    status: Vec<u16>,
    code: u16,
    registers: BTreeMap<(u16, u16), Vec<u8>>,
    outputs: Vec<u8>,
    queue: VecDeque<Vec<u8>>,
    exchange: u64,
    time: u64,
    refuses: Option<u16>,
    fault: Fault,
    sent: u64,
    log: Vec<(u8, u32)>,
}

impl Segment {
    fn new(plan: &ImagePlan, count: u16) -> Self {
        Segment {
            plan: plan.clone(),
            alive: vec![true; usize::from(count)],
            status: vec![2; usize::from(count)],
            code: 0,
            registers: BTreeMap::new(),
            outputs: vec![0; plan.outputs.length],
            queue: VecDeque::new(),
            exchange: 0,
            time: 5_000_000_000,
            refuses: None,
            fault: Box::new(|_, _| {}),
            sent: 0,
            log: Vec::new(),
        }
    }

    fn station(&mut self, command: u8, station: u16, register: u16, data: &mut [u8]) -> u16 {
        let position = usize::from(station.wrapping_sub(0x1000));
        if !self.alive.get(position).copied().unwrap_or(false) || self.refuses == Some(register) {
            return 0;
        }
        if command == 5 {
            self.registers.insert((station, register), data.to_vec());
            if register == 0x0120 {
                self.status[position] = u16_at(data, 0) & 0x0F;
            }
            return 1;
        }
        match register {
            0x0130 => {
                put_u16(data, 0, self.status[position]);
                if data.len() >= 6 {
                    put_u16(data, 4, self.code);
                }
            }
            _ => {
                if let Some(value) = self.registers.get(&(station, register)) {
                    let length = data.len().min(value.len());
                    data[..length].copy_from_slice(&value[..length]);
                }
            }
        }
        1
    }

    fn process(&mut self, frame: &mut [u8]) {
        frame[6] |= 2;
        let datagrams: Vec<_> = Datagrams::new(frame)
            .unwrap()
            .map(|datagram| datagram.map(|d| (d.header, d.offset)).unwrap())
            .collect();
        for (header, offset) in datagrams {
            self.log.push((header.command, header.address));
            let range = offset + 10..offset + 10 + header.length;
            let (low, high) = (header.address as u16, (header.address >> 16) as u16);
            let mut counter = 0;
            let touched: u16 = self
                .plan
                .frames
                .iter()
                .flat_map(|frame| &frame.datagrams)
                .filter(|datagram| datagram.address.raw() == header.address)
                .flat_map(|datagram| &datagram.touches)
                .filter(|touch| self.alive[usize::from(touch.position)])
                .map(|touch| touch.count)
                .sum();
            let data = &mut frame[range.clone()];
            match header.command {
                4 | 5 => counter = self.station(header.command, low, high, data),
                7 => {
                    for position in (0..self.alive.len()).filter(|position| self.alive[*position]) {
                        counter += 1;
                        let bits = u16_at(data, 0) | self.status[position];
                        put_u16(data, 0, bits);
                    }
                    put_u16(frame, offset + 2, counter);
                }
                10 => {
                    let start = (header.address - self.plan.inputs.start) as usize;
                    for (at, byte) in data.iter_mut().enumerate() {
                        let position = (start + at) / BYTES as usize;
                        if self.alive[position] {
                            *byte = self.exchange as u8;
                        }
                    }
                    counter = touched;
                }
                11 => {
                    let start = (header.address - self.plan.outputs.start) as usize;
                    self.outputs[start..start + data.len()].copy_from_slice(data);
                    counter = touched;
                }
                14 if self.alive[0] => {
                    data.copy_from_slice(&self.time.to_le_bytes()[..data.len()]);
                    counter = self.alive.iter().filter(|alive| **alive).count() as u16;
                }
                _ => {}
            }
            put_u16(frame, range.end, counter);
        }
    }
}

impl Link for Segment {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        let mut frame = frame.to_vec();
        self.process(&mut frame);
        self.sent += 1;
        self.queue.push_back(frame);
        Ok(())
    }

    fn receive(&mut self, buffer: &mut [u8], _deadline: HostTime) -> Result<Option<usize>, LinkError> {
        let Some(frame) = self.queue.pop_front() else { return Ok(None) };
        buffer[..frame.len()].copy_from_slice(&frame);
        Ok(Some(frame.len()))
    }
}

/// Applies the faults: the answers of an exchange are all there when the first is received.
struct Faulty(Segment, bool);

impl Link for Faulty {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.1 = true;
        self.0.send(frame)
    }
    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        if core::mem::take(&mut self.1) {
            let exchange = self.0.exchange;
            (self.0.fault)(exchange, &mut self.0.queue);
        }
        self.0.receive(buffer, deadline)
    }
}

struct Bench {
    bus: CyclicBus<Faulty>,
    image: ProcessImage,
    now: HostTime,
}

impl Bench {
    fn new(count: u16) -> Self {
        Self::with(members(count), ClockUse::Distribute { reference: 0 })
    }

    fn with(members: Vec<Member>, clock: ClockUse) -> Self {
        let count = members.len() as u16;
        let clock = if count == 0 { ClockUse::None } else { clock };
        let plan = ImagePlan::new(&members, clock).unwrap();
        let segment = Segment::new(&plan, count);
        let image = plan.image();
        let parts = CyclicParts { members, plan, mailboxes: Vec::new() };
        Bench { bus: CyclicBus::new(Faulty(segment, false), parts), image, now: HostTime(0) }
    }

    fn segment(&mut self) -> &mut Segment {
        &mut self.bus.link_mut().0
    }

    fn cycle(&mut self) -> Exchange {
        self.now = self.now + CYCLE;
        let segment = self.segment();
        segment.exchange += 1;
        segment.time += CYCLE.as_nanos() as u64;
        self.bus.exchange(&mut self.image, self.now).unwrap()
    }

    fn to(&mut self, goal: Goal) -> Phase {
        self.bus.request(goal, TransitionOptions::default(), self.now);
        for _ in 0..60_000 {
            self.cycle();
            if !matches!(self.bus.phase(), Phase::Moving { .. }) {
                break;
            }
        }
        self.bus.phase()
    }

    fn in_op(count: u16) -> Self {
        let mut bench = Bench::new(count);
        assert_eq!(bench.to(Goal::Op), Phase::Reached(Goal::Op));
        bench
    }
}

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
fn a_short_count_keeps_the_inputs_and_the_culprit_is_named_within_two_cycles() {
    for count in [3, 100] {
        let mut bench = Bench::in_op(count);
        bench.cycle();
        let before = bench.image.inputs.clone();
        let gone = usize::from(count) - 2;
        bench.segment().alive[gone] = false;
        assert!(matches!(bench.cycle(), Exchange::ShortCount { .. }));
        assert_eq!(bench.image.inputs, before);
        bench.cycle();
        assert_eq!(bench.bus.health()[gone], Health::Silent, "{count}");
        assert_eq!(bench.bus.health().iter().filter(|health| **health != Health::Well).count(), 1);
        // From now on the others' inputs are taken, its own are not.
        assert_eq!(bench.cycle(), Exchange::Without { unwell: 1 });
        let now = bench.segment().exchange as u8;
        for position in 0..usize::from(count) {
            let bytes = &bench.image.inputs[position * BYTES as usize..][..BYTES as usize];
            let expected = if position == gone { before[0] } else { now };
            assert!(bytes.iter().all(|byte| *byte == expected), "SubDevice {position}");
        }
        assert_eq!(bench.bus.freshness(gone as u16), Freshness::Unwell);
        assert_eq!(bench.bus.freshness(0), Freshness::Fresh);
        // A second one is noticed, although the count is short already.
        bench.segment().alive[1] = false;
        if gone != 1 {
            assert!(matches!(bench.cycle(), Exchange::ShortCount { .. }));
        }
        bench.segment().alive.fill(true);
        bench.cycle();
        bench.cycle();
        assert_eq!(bench.cycle(), Exchange::Complete);
        assert!(bench.bus.health().iter().all(|health| *health == Health::Well));
    }
}

#[test]
fn a_subdevice_that_falls_back_is_named_with_its_code() {
    let mut bench = Bench::in_op(3);
    bench.segment().status[1] = 0x14;
    bench.segment().code = 0x001B;
    bench.cycle();
    bench.cycle();
    let health = Health::NotOperational { status: 0x14, code: AlStatusCode::SM_WATCHDOG };
    assert_eq!(bench.bus.health(), [Health::Well, health, Health::Well]);
}

#[test]
fn the_way_to_op_locks_programs_sync_and_passes_safe_op() {
    let mut bench = Bench::new(3);
    for station in 0x1001..0x1003 {
        bench.segment().registers.insert((station, 0x092C), 0x8000_0100u32.to_le_bytes().to_vec());
    }
    assert_eq!(bench.to(Goal::Op), Phase::Reached(Goal::Op));
    let segment = bench.segment();
    for station in 0x1000..0x1003 {
        let register = |register| &segment.registers[&(station, register)];
        assert_eq!(register(0x0981), &[3]);
        assert_eq!(u32_at(register(0x09A0), 0), 1_000_000);
        let start = u64::from_le_bytes(register(0x0990)[..].try_into().unwrap());
        assert_eq!(start % 1_000_000, 0);
        assert!(!segment.registers.contains_key(&(station, 0x09A4)));
    }
    let order = |register: u32| {
        segment.log.iter().position(|(command, at)| *command == 5 && at >> 16 == register).unwrap()
    };
    assert!(order(0x0980) < order(0x09A0) && order(0x09A0) < order(0x0990));
    assert!(order(0x0990) < order(0x0120), "SYNC0 is armed before SAFE-OP is asked");
    let states: Vec<u16> = bench.segment().status.clone();
    assert_eq!(states, [8, 8, 8]);
}

#[test]
fn what_keeps_a_segment_from_op_is_named() {
    let mut bench = Bench::new(3);
    bench.segment().registers.insert((0x1002, 0x092C), 5000u32.to_le_bytes().to_vec());
    let Phase::Failed(error) = bench.to(Goal::Op) else { panic!("{:?}", bench.bus.phase()) };
    assert!(matches!(error, TransitionError::NotLocked { position: 2, difference_ns: 5000, .. }), "{error}");

    let mut bench = Bench::new(3);
    bench.segment().refuses = Some(0x09A0);
    let Phase::Failed(error) = bench.to(Goal::Op) else { panic!("{:?}", bench.bus.phase()) };
    assert_eq!(error.to_string(), "SubDevice 0 does not take register 0x09a0: working counter 0");
    // 0x0980 may be refused.
    let mut bench = Bench::new(3);
    bench.segment().refuses = Some(0x0980);
    assert_eq!(bench.to(Goal::Op), Phase::Reached(Goal::Op));
}

#[test]
fn a_refused_state_carries_code_cause_and_what_was_programmed() {
    let mut bench = Bench::new(2);
    bench.bus.request(Goal::Op, TransitionOptions::default(), bench.now);
    loop {
        bench.cycle();
        if let Phase::Moving { step: Step::Await(AlState::SafeOp), .. } = bench.bus.phase() {
            break;
        }
    }
    bench.segment().status[1] = 0x12;
    bench.segment().code = 0x001E;
    for _ in 0..3 {
        bench.cycle();
    }
    let Phase::Failed(error) = bench.bus.phase() else { panic!("{:?}", bench.bus.phase()) };
    assert_eq!(
        error.to_string(),
        "SubDevice 1 refuses SAFE-OP and is in PRE-OP with error: 0x001e invalid input configuration; \
         probable cause: SM3 length differs from the mapped inputs; programmed: 20 bytes of outputs, \
         20 bytes of inputs, SYNC0 every 1000000 ns shifted by 0 ns"
    );
}

#[test]
fn any_exchange_lost_on_the_way_to_op_delays_it_at_most() {
    for bad in 1..60u64 {
        let mut bench = Bench::new(2);
        bench.segment().fault = Box::new(move |exchange, queue| {
            if exchange == bad {
                queue.clear();
            }
        });
        assert_eq!(bench.to(Goal::Op), Phase::Reached(Goal::Op), "exchange {bad}");
    }
}

#[test]
fn the_clean_end_leaves_op_then_switches_sync_off() {
    let mut bench = Bench::in_op(3);
    assert_eq!(bench.to(Goal::Init), Phase::Reached(Goal::Init));
    let segment = bench.segment();
    assert_eq!(segment.status, [1, 1, 1]);
    assert_eq!(segment.registers[&(0x1001, 0x0981)], [0]);
    let last = |register: u32, log: &[(u8, u32)]| {
        log.iter().rposition(|(command, at)| *command == 5 && at >> 16 == register).unwrap()
    };
    let first_ask =
        segment.log.iter().rposition(|(command, at)| *command == 5 && at >> 16 == 0x0981).unwrap();
    assert!(first_ask < last(0x0120, &segment.log));
}

#[test]
fn registers_are_read_and_written_beside_the_cycle_without_changing_it() {
    let mut bench = Bench::in_op(3);
    let sent = bench.segment().sent;
    let cycles = bench.bus.counters().cycles;
    let request = |tag, way, data| AcyclicRequest {
        tag,
        position: 1,
        work: AcyclicWork::Registers { way, register: 0x0982, data },
    };
    bench.bus.submit(request(1, RegisterWay::Write, vec![7, 8])).unwrap();
    bench.bus.submit(request(2, RegisterWay::Read, vec![0, 0])).unwrap();
    let mut completions = Vec::new();
    for _ in 0..10 {
        assert_eq!(bench.cycle(), Exchange::Complete);
        completions.extend(bench.bus.poll_completion());
    }
    assert_eq!(completions.len(), 2);
    assert_eq!(completions[1].tag, 2);
    assert_eq!(completions[1].result, Ok(()));
    let AcyclicWork::Registers { data, .. } = &completions[1].work else { panic!() };
    assert_eq!(data, &[7, 8]);
    let frames = bench.segment().sent - sent;
    assert_eq!(frames, bench.bus.counters().cycles - cycles, "one frame a cycle, as before");
}

#[test]
fn acyclic_requests_that_cannot_be_served_are_refused_by_name() {
    let mut bench = Bench::new(1);
    let work = || AcyclicWork::Registers { way: RegisterWay::Read, register: 0, data: vec![0; 100] };
    bench.bus.submit(AcyclicRequest { tag: 1, position: 5, work: work() }).unwrap();
    bench.bus.submit(AcyclicRequest { tag: 2, position: 0, work: work() }).unwrap();
    let mailbox =
        crate::mailbox::MailboxRequest::upload(crate::wire::coe::ObjectAddress::new(0x1000, 0), vec![]);
    bench.bus.submit(AcyclicRequest { tag: 3, position: 0, work: AcyclicWork::Mailbox(mailbox) }).unwrap();
    bench.cycle();
    let results: Vec<_> =
        core::iter::from_fn(|| bench.bus.poll_completion()).map(|done| done.result).collect();
    assert_eq!(
        results,
        [
            Err(AcyclicError::NoSubDevice { position: 5 }),
            Err(AcyclicError::TooLong { found: 100, limit: 32 }),
            Err(AcyclicError::NoMailbox { position: 0 }),
        ]
    );
    for tag in 0..CAPACITY as u64 {
        bench.bus.submit(AcyclicRequest { tag, position: 0, work: work() }).unwrap();
    }
    assert!(bench.bus.submit(AcyclicRequest { tag: 0, position: 0, work: work() }).is_err());
}

#[test]
fn a_register_that_nobody_takes_ends_in_an_error() {
    let mut bench = Bench::new(1);
    bench.segment().refuses = Some(0x0982);
    let work = AcyclicWork::Registers { way: RegisterWay::Write, register: 0x0982, data: vec![1] };
    bench.bus.submit(AcyclicRequest { tag: 1, position: 0, work }).unwrap();
    let done = (0..1000).find_map(|_| {
        bench.cycle();
        bench.bus.poll_completion()
    });
    assert!(matches!(done.unwrap().result, Err(AcyclicError::Register { register: 0x0982, .. })));
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
    assert_eq!(bench.to(Goal::Op), Phase::Reached(Goal::Op));
}

#[test]
fn a_thousand_subdevices_reach_op_and_a_culprit_is_found_among_them() {
    let mut bench = Bench::in_op(1000);
    bench.segment().alive[777] = false;
    bench.cycle();
    bench.cycle();
    assert_eq!(
        bench.bus.health()[777],
        Health::Silent,
        "those whom the short datagram touches are asked first"
    );
    for _ in 0..6 {
        assert!(matches!(bench.cycle(), Exchange::ShortCount { .. }), "all others have yet to answer");
    }
    assert_eq!(bench.cycle(), Exchange::Without { unwell: 1 });
}
