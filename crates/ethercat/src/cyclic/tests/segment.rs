//! A small segment, frame by frame, and a cycle on it.

use super::*;
use crate::config::Every;
use crate::image::{Area, Packing};
use crate::wire::bytes::put_u16;
use crate::wire::frame::Datagrams;
use core::time::Duration;
use std::collections::BTreeMap;

pub const BYTES: u32 = 20;
pub const CYCLE: Duration = Duration::from_millis(1);

pub fn members(count: u16) -> Vec<Member> {
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
        every: Every::CYCLE,
        op_only: Vec::new(),
        clock: Some(DcWidth::Bits64),
        sync: DcConfig::Sync0 { cycle_ns: 1_000_000, shift_ns: 0 },
        assign_activate: 0x0300,
        timeouts: Timeouts::default(),
    };
    (0..count).map(member).collect()
}

/// What a test does to the frames of one exchange: gets all answers, leaves those that arrive.
pub type Fault = Box<dyn FnMut(u64, &mut VecDeque<Vec<u8>>)>;

/// SubDevices with outputs, inputs and registers; each input byte is the number of the exchange.
pub struct Segment {
    pub plan: ImagePlan,
    pub alive: Vec<bool>,
    pub status: Vec<u16>,
    pub code: u16,
    pub registers: BTreeMap<(u16, u16), Vec<u8>>,
    pub outputs: Vec<u8>,
    pub queue: VecDeque<Vec<u8>>,
    pub exchange: u64,
    pub time: u64,
    pub refuses: Option<u16>,
    pub fault: Fault,
    pub sent: u64,
    pub log: Vec<(u8, u32)>,
}

impl Segment {
    pub fn new(plan: &ImagePlan, count: u16) -> Self {
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

    pub fn station(&mut self, command: u8, station: u16, register: u16, data: &mut [u8]) -> u16 {
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

    pub fn process(&mut self, frame: &mut [u8]) {
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
pub struct Faulty(pub Segment, pub bool);

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

pub struct Bench {
    pub bus: CyclicBus<Faulty>,
    pub image: ProcessImage,
    pub now: HostTime,
}

impl Bench {
    pub fn new(count: u16) -> Self {
        Self::with(members(count), ClockUse::Distribute { reference: 0 })
    }

    pub fn with(members: Vec<Member>, clock: ClockUse) -> Self {
        let count = members.len() as u16;
        let clock = if count == 0 { ClockUse::None } else { clock };
        let plan = ImagePlan::new(&members, clock).unwrap();
        let segment = Segment::new(&plan, count);
        let image = plan.image();
        let parts = CyclicParts { members, plan, mailboxes: Vec::new() };
        Bench { bus: CyclicBus::new(Faulty(segment, false), parts), image, now: HostTime(0) }
    }

    pub fn segment(&mut self) -> &mut Segment {
        &mut self.bus.link_mut().0
    }

    pub fn cycle(&mut self) -> Exchange {
        self.now = self.now + CYCLE;
        let segment = self.segment();
        segment.exchange += 1;
        segment.time += CYCLE.as_nanos() as u64;
        self.bus.exchange(&mut self.image, self.now).unwrap()
    }

    pub fn to(&mut self, goal: Goal) -> TransitionStatus {
        self.bus.request(goal, TransitionOptions::default(), self.now);
        for _ in 0..60_000 {
            self.cycle();
            if !matches!(self.bus.transition(), TransitionStatus::Moving { .. }) {
                break;
            }
        }
        self.bus.transition().clone()
    }

    pub fn in_op(count: u16) -> Self {
        let mut bench = Bench::new(count);
        assert_eq!(bench.to(Goal::Op), TransitionStatus::Reached(Goal::Op));
        bench
    }
}
