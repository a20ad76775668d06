//! SubDevices and the cables between them: frames go in, pass everything on their way, and come back.

mod alarms;
mod sub_device;
mod topology;

pub use sub_device::SubDevice;
pub use topology::{Attachment, MainPort, Parent, TopologyError};

use crate::esc::{PdiPort, PortState, Telegram};
use crate::fault::{Fault, FaultError, Injector};
use alarms::Alarms;
use core::time::Duration;
use omnibase_ethercat_wire::bytes::{put_u16, u16_at};
use omnibase_ethercat_wire::frame::{
    DATAGRAM_HEADER, DATAGRAM_OVERHEAD, Datagrams, FrameError, MIN_FRAME, PROCESSED_BIT,
};
use omnibase_ethercat_wire::{Command, HostTime};
pub(crate) use topology::frame_order;
use topology::{Cable, Cables, Carries, FramePath, Plug, Ports};

/// Time of a byte on a 100 Mbit/s cable, ns.
const BYTE_NS: u64 = 80;
/// Bytes on the cable beside the frame itself: preamble and checksum.
const WIRE_OVERHEAD: usize = 8 + 4;
/// Bytes of silence between frames.
const INTERFRAME_GAP: usize = 12;
/// The cable that closes a ring: 20 m.
const RING_CABLE_NS: u32 = 100;
/// Datagram flag, in the high byte: the frame passed a closed port 0 already.
const CIRCULATING: u8 = 0x40;

/// How long a frame of `length` bytes occupies the cable, without the gap after it.
pub fn wire_time(length: usize) -> Duration {
    Duration::from_nanos((length.max(MIN_FRAME) + WIRE_OVERHEAD) as u64 * BYTE_NS)
}

/// How long after the start of a frame of `length` bytes the next one can start.
pub fn frame_spacing(length: usize) -> Duration {
    wire_time(length) + Duration::from_nanos(INTERFRAME_GAP as u64 * BYTE_NS)
}

/// SubDevices, their cables, and the time up to which they have run.
///
/// Everything is a function of the frames, the faults and the times that it is given: same input, same bits.
#[derive(Debug)]
pub struct Segment {
    sub_devices: Vec<SubDevice>,
    cables: Cables,
    /// From the primary interface, and from the redundant one.
    ways: [FramePath; 2],
    /// Which of them the present frame takes.
    taken: usize,
    now: HostTime,
    /// When each SubDevice has something to do, host ns.
    alarms: Alarms,
    /// Some cable may still damage frames.
    may_damage: bool,
    /// Faults from outside.
    injector: Option<Injector>,
}

impl Segment {
    /// Plugs SubDevices together: `attachments[n]` is the cable by which `sub_devices[n]` is reached.
    ///
    /// The order of the SubDevices must be the order in which a frame passes them, which is their position order.
    /// All have power; their firmware starts at time 0.
    pub fn new(sub_devices: Vec<SubDevice>, attachments: Vec<Attachment>) -> Result<Self, TopologyError> {
        if sub_devices.len() != attachments.len() {
            let (sub_devices, attachments) = (sub_devices.len(), attachments.len());
            return Err(TopologyError::Count { sub_devices, attachments });
        }
        let cables =
            Cables::new(&attachments, |position, port| sub_devices[position].esc().config().has_port(port))?;
        let alarms = Alarms::new(sub_devices.len());
        let mut segment = Segment {
            sub_devices,
            cables,
            ways: Default::default(),
            taken: 0,
            now: HostTime(0),
            alarms,
            may_damage: false,
            injector: None,
        };
        for sub_device in &mut segment.sub_devices {
            sub_device.power_on(HostTime(0));
        }
        segment.reroute();
        let passed: Vec<usize> = segment.ways[0].passages.iter().map(|passage| passage.position).collect();
        if let Some(position) = (0..segment.sub_devices.len()).find(|position| !passed.contains(position)) {
            return Err(TopologyError::Unreachable { position });
        }
        if let Some((position, &found)) =
            passed.iter().enumerate().find(|&(position, found)| position != *found)
        {
            return Err(TopologyError::Order { position, found });
        }
        for position in 0..segment.sub_devices.len() {
            segment.settle(position, HostTime(0));
        }
        Ok(segment)
    }

    /// A line: each SubDevice's port 0 on the port 1 of the one before, by 20 m of cable.
    pub fn line(sub_devices: Vec<SubDevice>) -> Result<Self, TopologyError> {
        let attachments = (0..sub_devices.len())
            .map(|position| Attachment {
                parent: match position.checked_sub(1) {
                    None => Parent::MainDevice,
                    Some(position) => Parent::SubDevice { position, port: 1 },
                },
                entry_port: 0,
                cable_delay_ns: 100,
            })
            .collect();
        Segment::new(sub_devices, attachments)
    }

    /// The SubDevices in the order of their positions.
    pub fn sub_devices(&self) -> &[SubDevice] {
        &self.sub_devices
    }

    /// The PDI of the SubDevice at `position`, to play its firmware by hand; `None` where there is none or it is off.
    pub fn pdi(&mut self, position: usize) -> Option<PdiPort<'_>> {
        let now = self.now;
        let sub_device = self.sub_devices.get_mut(position).filter(|sub_device| sub_device.powered())?;
        Some(PdiPort::new(sub_device.esc_mut(), now))
    }

    /// The instant up to which everything has happened.
    pub fn now(&self) -> HostTime {
        self.now
    }

    /// When something happens next without a frame: firmware, a SYNC pulse, a watchdog, a power-on.
    pub fn next_wake(&self) -> Option<HostTime> {
        self.alarms.earliest().map(HostTime)
    }

    /// Whether the MainDevice's own cable has a link.
    pub fn link_up(&self) -> bool {
        self.cables
            .cables
            .get(self.cables.primary)
            .is_some_and(|cable| PortView(&self.sub_devices).links(cable))
    }

    /// A hand on this segment for when it is behind a link.
    pub fn injector(&mut self) -> Injector {
        self.injector.get_or_insert_with(Injector::new).clone()
    }

    /// Lets happen everything that is due up to `now`, in the order of time.
    pub fn advance(&mut self, now: HostTime) {
        while let Some((position, fault)) = self.injector.as_ref().and_then(Injector::take) {
            // Whoever can hear of a refusal injects by the segment's own function.
            let _ = self.inject(position, fault);
        }
        while let Some(at) = self.next_wake().filter(|&at| at <= now) {
            let mut from = 0;
            while let Some(position) = self.alarms.first_due(from, at.0) {
                let power = self.sub_devices[position].powered();
                self.sub_devices[position].run_due(at);
                if self.sub_devices[position].powered() != power {
                    self.reroute();
                }
                self.settle(position, at);
                from = position + 1;
            }
        }
        self.now = self.now.max(now);
    }

    /// Runs `frame` through the segment in place, from the moment `now` at which its first bit leaves the MainDevice.
    ///
    /// Returns the instant at which its last bit is back; `None` where it is lost: a cut cable, a damaged or
    /// malformed frame, another protocol. The frame keeps its length. Lost frames have run as far as they came.
    pub fn process(&mut self, frame: &mut [u8], now: HostTime) -> Option<HostTime> {
        self.process_from(MainPort::Primary, frame, now)
            .and_then(|(back, port)| (port == MainPort::Primary).then_some(back))
    }

    /// Like [`Segment::process`] from one of the two interfaces of a ring's MainDevice; tells where it comes back.
    pub fn process_from(
        &mut self,
        from: MainPort,
        frame: &mut [u8],
        now: HostTime,
    ) -> Option<(HostTime, MainPort)> {
        self.taken = from as usize;
        self.run_frame(frame, now)
    }

    /// Closes a ring: a cable from this port to the MainDevice's redundant interface.
    pub fn close_ring(&mut self, position: usize, port: u8) -> Result<(), TopologyError> {
        let has_port = self.sub_devices.get(position).is_some_and(|one| one.esc().config().has_port(port));
        let slot = self.cables.at.get_mut(position).and_then(|ports| ports.get_mut(usize::from(port)));
        let Some(slot) = slot.filter(|_| has_port) else {
            return Err(TopologyError::NoSuchPort { position, port });
        };
        if slot.is_some() || self.cables.ring.is_some() {
            return Err(TopologyError::PortTaken { position, port });
        }
        let index = self.cables.cables.len();
        *slot = Some(index);
        let lower = Plug { position, port };
        self.cables.cables.push(Cable {
            upper: None,
            lower,
            delay_ns: RING_CABLE_NS,
            carries: Carries::Frames,
        });
        self.cables.ring = Some(index);
        self.reroute();
        Ok(())
    }

    /// The port (SubDevice and port number) into which the cable of a MainDevice's interface is plugged; `None` where
    /// there is none.
    pub fn main_plug(&self, port: MainPort) -> Option<(usize, u8)> {
        let cable = match port {
            MainPort::Primary => self.cables.cables.get(self.cables.primary),
            MainPort::Redundant => self.cables.ring.and_then(|index| self.cables.cables.get(index)),
        };
        cable.map(|cable| (cable.lower.position, cable.lower.port))
    }

    fn run_frame(&mut self, frame: &mut [u8], now: HostTime) -> Option<(HostTime, MainPort)> {
        self.advance(now);
        let now = self.now;
        let (passages, destroyed) = self.damage();
        if passages == 0 {
            return self.arrival(frame.len(), now).filter(|_| !destroyed);
        }
        match Datagrams::new(frame) {
            Ok(mut datagrams) => {
                if datagrams.any(|datagram| datagram.is_err()) {
                    return self.malformed();
                }
                frame[6] |= PROCESSED_BIT;
            }
            Err(FrameError::NotDatagrams { .. }) => {
                frame[6] |= PROCESSED_BIT;
                return self.arrival(frame.len(), now).filter(|_| !destroyed);
            }
            Err(FrameError::NotEtherCat { .. }) => return None,
            Err(_) => return self.malformed(),
        }
        let caught = self.process_datagrams(frame, passages, now);
        // Loops that this frame opens or closes are the way of the next one.
        let back = self.arrival(frame.len(), now);
        self.run_raised(passages, now);
        back.filter(|_| !destroyed && !caught)
    }

    /// All datagrams of a frame that was checked; returns whether it was caught as circulating.
    fn process_datagrams(&mut self, frame: &mut [u8], passages: usize, now: HostTime) -> bool {
        let mut offset = omnibase_ethercat_wire::frame::FIRST_DATAGRAM;
        if u16_at(frame, omnibase_ethercat_wire::frame::ETHERNET_HEADER) & 0x07FF == 0 {
            return false;
        }
        loop {
            let flags = u16_at(frame, offset + 6);
            let length = usize::from(flags & 0x07FF);
            let end = offset + DATAGRAM_OVERHEAD + length;
            let datagram = &mut frame[offset..end];
            if self.process_datagram(datagram, passages, now) {
                return true;
            }
            if flags & 0x8000 == 0 {
                return false;
            }
            offset = end;
        }
    }

    fn process_datagram(&mut self, datagram: &mut [u8], passages: usize, now: HostTime) -> bool {
        let counter_at = datagram.len() - 2;
        let counter = u16_at(datagram, counter_at);
        let (header, rest) = datagram.split_at_mut(DATAGRAM_HEADER);
        let Some(command) = Command::from_code(header[0]) else { return false };
        let data = &mut rest[..counter_at - DATAGRAM_HEADER];
        let mut telegram = Telegram {
            command,
            adp: u16_at(header, 2),
            ado: u16_at(header, 4),
            event: u16_at(header, 8),
            counter,
            data,
        };
        let mut caught = false;
        for passage in &self.ways[self.taken].passages[..passages] {
            if passage.port_0_closed {
                if header[7] & CIRCULATING != 0 {
                    caught = true;
                    break;
                }
                header[7] |= CIRCULATING;
            }
            self.sub_devices[passage.position].esc_mut().process(&mut telegram, now.0 + passage.at_ns);
        }
        put_u16(header, 2, telegram.adp);
        put_u16(header, 4, telegram.ado);
        put_u16(header, 8, telegram.event);
        let counter = telegram.counter;
        put_u16(rest, counter_at - DATAGRAM_HEADER, counter);
        caught
    }

    /// Runs firmware for which the frame that just passed meant something.
    fn run_raised(&mut self, passages: usize, now: HostTime) {
        let mut loops_changed = false;
        for n in 0..passages {
            let passage = self.way().passages[n];
            let at = HostTime(now.0 + passage.at_ns);
            let sub_device = &mut self.sub_devices[passage.position];
            loops_changed |= sub_device.esc_mut().take_loops_changed();
            sub_device.run_raised(at);
            self.alarms.set(passage.position, sub_device.due());
        }
        if loops_changed {
            self.reroute();
        }
    }

    /// Lets the firmware of one SubDevice see what was raised, and notes when it has to do something again.
    fn settle(&mut self, position: usize, at: HostTime) {
        self.sub_devices[position].run_raised(at);
        self.alarms.set(position, self.sub_devices[position].due());
    }

    fn way(&self) -> &FramePath {
        &self.ways[self.taken]
    }

    fn arrival(&self, length: usize, now: HostTime) -> Option<(HostTime, MainPort)> {
        self.way().back.map(|(back, port)| (now + Duration::from_nanos(back) + wire_time(length), port))
    }

    fn malformed(&mut self) -> Option<(HostTime, MainPort)> {
        if let Some(position) = self.way().passages.first().map(|passage| passage.position) {
            self.sub_devices[position].esc_mut().count_malformed();
        }
        None
    }

    /// How many processing units a frame passes undamaged, and whether it is destroyed after that.
    fn damage(&mut self) -> (usize, bool) {
        let all = self.way().passages.len();
        self.may_damage = self.may_damage && self.sub_devices.iter().any(SubDevice::damages);
        if !self.may_damage {
            return (all, false);
        }
        let damaged = self.ways[self.taken]
            .arrivals
            .iter()
            .position(|arrival| self.sub_devices[arrival.position].take_damage(usize::from(arrival.port)));
        let Some(first) = damaged else { return (all, false) };
        for (n, arrival) in self.ways[self.taken].arrivals[first..].iter().enumerate() {
            let esc = self.sub_devices[arrival.position].esc_mut();
            esc.count_damaged(usize::from(arrival.port), n > 0);
        }
        (self.way().arrivals[first].passed, true)
    }

    /// Injects a fault at the SubDevice at `position`, now.
    pub fn inject(&mut self, position: usize, fault: Fault) -> Result<(), FaultError> {
        let count = self.sub_devices.len();
        let now = self.now;
        let sub_device =
            self.sub_devices.get_mut(position).ok_or(FaultError::NoSuchSubDevice { position, count })?;
        match fault {
            Fault::PowerOff => sub_device.power_off(),
            Fault::PowerOn => sub_device.power_on(now),
            Fault::PowerCycle { off_for } => {
                sub_device.power_off();
                sub_device.power_on_at(now + off_for);
            }
            Fault::CableCut { port } => self.replug(position, port, Carries::Nothing)?,
            Fault::LinkAlone { port } => self.replug(position, port, Carries::Link)?,
            Fault::CableRestored { port } => self.replug(position, port, Carries::Frames)?,
            Fault::CrcErrors { port, frames } => {
                self.cable(position, port)?;
                self.sub_devices[position].damage(usize::from(port), frames);
                self.may_damage = true;
            }
            Fault::Application(fault) => {
                if !sub_device.inject(&fault, now) {
                    return Err(FaultError::UnknownToApplication { position, fault });
                }
            }
        }
        self.reroute();
        self.settle(position, now);
        Ok(())
    }

    fn cable(&self, position: usize, port: u8) -> Result<usize, FaultError> {
        let cable = self.cables.at[position].get(usize::from(port)).copied().flatten();
        cable.ok_or(FaultError::NoCable { position, port })
    }

    fn replug(&mut self, position: usize, port: u8, carries: Carries) -> Result<(), FaultError> {
        let cable = self.cable(position, port)?;
        self.cables.cables[cable].carries = carries;
        Ok(())
    }

    /// Links, loops and the frame's way follow cables, power and loop control.
    fn reroute(&mut self) {
        for position in 0..self.sub_devices.len() {
            if !self.sub_devices[position].powered() {
                continue;
            }
            let view = PortView(&self.sub_devices);
            let cables = self.cables.at[position].map(|cable| cable.map(|index| &self.cables.cables[index]));
            let links = cables.map(|cable| cable.is_some_and(|cable| view.links(cable)));
            let passed = cables.map(|cable| cable.is_some_and(|cable| view.carries(cable)));
            let esc = self.sub_devices[position].esc_mut();
            let ports = core::array::from_fn(|port| PortState {
                link: links[port],
                closed: esc.loop_closed(port, passed[port]),
            });
            esc.set_ports(ports);
        }
        let view = PortView(&self.sub_devices);
        self.ways =
            [MainPort::Primary, MainPort::Redundant].map(|port| FramePath::follow(&self.cables, &view, port));
        let mut arrivals = vec![[None; 4]; self.sub_devices.len()];
        let mut units = vec![None; self.sub_devices.len()];
        // Where both ways lead to a chip the primary one measures.
        let [primary, redundant] = &self.ways;
        for passage in redundant.passages.iter().chain(&primary.passages) {
            units[passage.position] = Some(passage.at_ns);
        }
        for arrival in redundant.arrivals.iter().chain(&primary.arrivals) {
            if let Some(unit) = units[arrival.position] {
                arrivals[arrival.position][usize::from(arrival.port)] =
                    Some(arrival.at_ns as i64 - unit as i64);
            }
        }
        for (sub_device, arrivals) in self.sub_devices.iter_mut().zip(arrivals) {
            sub_device.esc_mut().set_port_arrivals(arrivals);
        }
    }
}

/// Cables and chips as [`FramePath::follow`] sees them.
struct PortView<'a>(&'a [SubDevice]);

impl PortView<'_> {
    /// Whether both ends of a cable see a link.
    fn links(&self, cable: &Cable) -> bool {
        let powered = |plug: Plug| self.0[plug.position].powered();
        cable.carries != Carries::Nothing && powered(cable.lower) && cable.upper.is_none_or(powered)
    }
}

impl Ports for PortView<'_> {
    fn closed(&self, plug: Plug) -> bool {
        self.0[plug.position].esc().ports()[usize::from(plug.port)].closed
    }

    fn carries(&self, cable: &Cable) -> bool {
        cable.carries == Carries::Frames && self.links(cable)
    }

    fn forward_delay_ns(&self, position: usize) -> u64 {
        u64::from(self.0[position].esc().config().forward_delay_ns)
    }
}
