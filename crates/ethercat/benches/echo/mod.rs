//! A link that answers every frame with the right working counters and costs next to nothing.

use omnibase_ethercat::config::{Every, LrwPermission, Timeouts};
use omnibase_ethercat::cyclic::{Goal, TransitionOptions, TransitionStatus};
use omnibase_ethercat::image::{Area, ClockUse, Member, Packing};
use omnibase_ethercat::mailbox::DEFAULT_TIMEOUT;
use omnibase_ethercat::subdevice::{DcWidth, Direction, MailboxConfig, MemoryArea};
use omnibase_ethercat::wire::bytes::{put_u16, u16_at, u32_at};
use omnibase_ethercat::wire::frame::{DATAGRAM_HEADER, FIRST_DATAGRAM, MAX_FRAME, PROCESSED_BIT};
use omnibase_ethercat::wire::{HostTime, Link, LinkError};
use omnibase_ethercat::{CyclicBus, CyclicParts, DcConfig, ImagePlan, ProcessImage};

/// Frames that are under way at once.
const SLOTS: usize = 32;
const FPRD: u8 = 4;
const FPWR: u8 = 5;
const BRD: u8 = 7;
const LRD: u8 = 10;

/// Servos with `bytes` of outputs and as many of inputs.
pub fn servos(count: u16, bytes: u32) -> Vec<Member> {
    let area = |sync_manager, direction| Area {
        sync_manager,
        direction,
        bit_length: bytes * 8,
        packing: Packing::Bytes,
    };
    let memory = MemoryArea { start: 0x1000, length: 128 };
    let member = |position| Member {
        position,
        station: 0x1000 + position,
        lrw: LrwPermission::Barred,
        areas: vec![area(2, Direction::Outputs), area(3, Direction::Inputs)],
        mailbox: Some(MailboxConfig {
            write: memory,
            read: memory,
            protocols: 4,
            answer_timeout: DEFAULT_TIMEOUT,
        }),
        every: Every::CYCLE,
        op_only: Vec::new(),
        clock: Some(DcWidth::Bits64),
        sync: DcConfig::Off,
        assign_activate: 0,
        timeouts: Timeouts::default(),
    };
    (0..count).map(member).collect()
}

/// Answers frames.
pub struct Echo {
    slots: Vec<([u8; MAX_FRAME], usize)>,
    head: usize,
    tail: usize,
    plan: ImagePlan,
    count: u16,
    state: u16,
    /// Offsets and values of the working counters of each frame of a cycle, once they are known.
    known: Vec<Vec<(usize, u16)>>,
    next_known: usize,
    /// From now on frames are those of a plain cycle in their order: they are answered without being read.
    pub blind: bool,
    /// Stands in the inputs again and again, little endian, from the first byte of each datagram on.
    pub stamp: u32,
}

impl Echo {
    /// Answers the frames of this plan.
    pub fn new(plan: &ImagePlan, count: u16) -> Self {
        Echo {
            slots: vec![([0; MAX_FRAME], 0); SLOTS],
            head: 0,
            tail: 0,
            plan: plan.clone(),
            count,
            state: 2,
            known: vec![Vec::with_capacity(256); plan.frames.len() + 1],
            next_known: 0,
            blind: false,
            stamp: 0,
        }
    }

    /// Reads the frame at the head and answers it; allocates nothing once `known` has its size.
    fn answer(&mut self) {
        let (frame, _) = &mut self.slots[self.head % SLOTS];
        let first = u32_at(&frame[..], FIRST_DATAGRAM + 2);
        let mut planned = self.plan.frames.iter();
        let number = planned.position(|one| one.datagrams[0].address.raw() == first);
        // The last one is for frames that no plain cycle has.
        let number = number.unwrap_or(self.known.len() - 1);
        let known = &mut self.known[number];
        known.clear();
        let mut offset = FIRST_DATAGRAM;
        loop {
            let (command, address) = (frame[offset], u32_at(&frame[..], offset + 2));
            let flags = u16_at(&frame[..], offset + 6);
            let length = usize::from(flags & 0x07FF);
            let (data, register) = (offset + DATAGRAM_HEADER, address >> 16);
            let planned = self.plan.frames.iter().flat_map(|frame| &frame.datagrams);
            let mut planned = planned.filter(|one| one.command.code() == command);
            let expected = planned.find(|one| one.address.raw() == address).map_or(0, |one| one.expected);
            let counter = match command {
                FPWR if register == 0x0120 => {
                    self.state = u16_at(&frame[..], data) & 0x0F;
                    1
                }
                FPRD if register == 0x0130 => {
                    put_u16(&mut frame[..], data, self.state);
                    1
                }
                FPRD | FPWR => 1,
                BRD => {
                    put_u16(&mut frame[..], data, self.state);
                    known.push((data, self.state));
                    self.count
                }
                LRD => {
                    for word in frame[data..data + length].chunks_mut(4) {
                        word.copy_from_slice(&self.stamp.to_le_bytes()[..word.len()]);
                    }
                    expected
                }
                _ => expected,
            };
            put_u16(&mut frame[..], data + length, counter);
            known.push((data + length, counter));
            offset = data + length + 2;
            if flags & 0x8000 == 0 {
                return;
            }
        }
    }
}

impl Link for Echo {
    #[inline]
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        let slot = &mut self.slots[self.head % SLOTS];
        slot.0[..frame.len()].copy_from_slice(frame);
        slot.0[6] |= PROCESSED_BIT;
        slot.1 = frame.len();
        if self.blind {
            for &(offset, counter) in &self.known[self.next_known] {
                put_u16(&mut slot.0[..], offset, counter);
            }
            self.next_known += 1;
            if self.next_known == self.plan.frames.len() {
                self.next_known = 0;
            }
        } else {
            self.answer();
        }
        self.head += 1;
        Ok(())
    }

    #[inline]
    fn receive(&mut self, buffer: &mut [u8], _deadline: HostTime) -> Result<Option<usize>, LinkError> {
        if self.tail == self.head {
            return Ok(None);
        }
        let slot = &self.slots[self.tail % SLOTS];
        buffer[..slot.1].copy_from_slice(&slot.0[..slot.1]);
        self.tail += 1;
        Ok(Some(slot.1))
    }
}

/// A cycle in OP over a wrapper of an [`Echo`] that still reads frames.
pub fn operational<L: Link>(
    count: u16,
    bytes: u32,
    wrap: impl FnOnce(Echo) -> L,
) -> (CyclicBus<L>, ProcessImage) {
    let members = servos(count, bytes);
    let plan = ImagePlan::new(&members, ClockUse::Distribute { reference: 0 }).unwrap();
    let echo = Echo::new(&plan, count);
    let mut image = plan.image();
    let mut bus = CyclicBus::new(wrap(echo), CyclicParts { members, plan, mailboxes: Vec::new() });
    bus.request(Goal::Op, TransitionOptions::default(), HostTime(0));
    for cycle in 1..10_000 {
        bus.exchange(&mut image, HostTime(cycle * 1_000_000)).unwrap();
        if *bus.transition() == TransitionStatus::Reached(Goal::Op) {
            return (bus, image);
        }
    }
    panic!("no OP: {:?}", bus.transition());
}
