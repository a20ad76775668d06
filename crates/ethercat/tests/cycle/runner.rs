//! A segment file brought up and cycled in virtual time, over a link that notes what passes.

use std::collections::BTreeSet;
use std::time::Duration;

use omnibase_ethercat::cyclic::{
    ClockDirection, DcFollower, FollowerGains, Goal, HostToDc, Phase, TransitionOptions,
};
use omnibase_ethercat::wire::frame::Datagrams;
use omnibase_ethercat::wire::{Clock, Command, HostTime, Link, LinkError};
use omnibase_ethercat::{
    Bus, BusOptions, CyclicBus, DcConfig, Exchange, ProcessImage, SubDevice, SubDeviceConfig,
};
use omnibase_ethercat_sim::{FaultLink, Segment, SegmentFile, SimLink, VirtualClock, in_process};

/// Notes every command and the number of frames.
pub struct SpyLink {
    pub inner: FaultLink<SimLink>,
    pub commands: BTreeSet<Command>,
    pub frames: u64,
}

impl SpyLink {
    pub fn segment(&mut self) -> &mut Segment {
        self.inner.inner_mut().segment_mut()
    }
}

impl Link for SpyLink {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.frames += 1;
        for datagram in Datagrams::new(frame).expect("a frame of ours") {
            let code = datagram.expect("a datagram of ours").header.command;
            self.commands.insert(Command::from_code(code).expect("a known command"));
        }
        self.inner.send(frame)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        self.inner.receive(buffer, deadline)
    }
}

/// The segment of one of the files that the repository ships.
pub fn segment_file(name: &str) -> Segment {
    let path = format!("{}/../../segments/{name}", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
    SegmentFile::parse(&text).unwrap().build(std::path::Path::new(&path).parent().unwrap()).unwrap()
}

/// SYNC0 at the cycle for every SubDevice.
pub fn synchronous(count: usize, cycle: Duration) -> Vec<SubDeviceConfig> {
    let dc = DcConfig::Sync0 { cycle_ns: cycle.as_nanos() as u32, shift_ns: 0 };
    (0..count).map(|_| SubDeviceConfig { dc, ..SubDeviceConfig::default() }).collect()
}

/// A cycling segment and the clocks that belong to it.
pub struct Runner {
    pub bus: CyclicBus<SpyLink>,
    pub image: ProcessImage,
    pub clock: VirtualClock,
    pub subdevices: Vec<SubDevice>,
    pub cycle: Duration,
    pub follower: DcFollower,
    pub leader: Option<HostToDc>,
    wake: HostTime,
}

impl Runner {
    /// From power-on to PRE-OP with everything configured.
    pub fn new(segment: Segment, configs: &[SubDeviceConfig], following: ClockDirection) -> Self {
        let (link, clock) = in_process(segment);
        let link = SpyLink { inner: FaultLink::new(link, 1), commands: BTreeSet::new(), frames: 0 };
        let mut bus = Bus::new(link, clock, BusOptions::default());
        bus.scan().unwrap();
        bus.configure(configs).unwrap();
        let ready = bus.into_cyclic(following).unwrap();
        let cycle = Duration::from_millis(1);
        let wake = ready.clock.now();
        Runner {
            image: ready.bus.plan().image(),
            bus: ready.bus,
            clock: ready.clock,
            subdevices: ready.subdevices,
            cycle,
            follower: DcFollower::new(cycle, cycle / 2, FollowerGains::default()),
            leader: (following == ClockDirection::DcFollowsHost).then(HostToDc::new),
            wake,
        }
    }

    /// One cycle; the next follows the distributed clock, or leads it.
    pub fn cycle(&mut self) -> Exchange {
        self.clock.sleep_until(self.wake);
        if let Some(leader) = &self.leader {
            self.bus.steer_clock(leader.time_at(self.wake));
        }
        let exchange = self.bus.exchange(&mut self.image, self.wake + self.cycle * 4 / 5).unwrap();
        let fresh = !matches!(exchange, Exchange::Lost { .. });
        let clock = self.bus.clock().filter(|_| fresh);
        if let (Some(leader), Some(clock)) = (&mut self.leader, clock) {
            leader.read(self.wake, clock);
            self.wake = self.wake + self.cycle;
        } else {
            self.wake = self.follower.next_wake(self.wake, clock);
        }
        exchange
    }

    /// So many cycles, whatever becomes of them.
    pub fn cycles(&mut self, count: usize) {
        for _ in 0..count {
            self.cycle();
        }
    }

    pub fn segment(&mut self) -> &mut Segment {
        self.bus.link_mut().segment()
    }

    /// Cycles until the goal is reached or refused.
    pub fn to(&mut self, goal: Goal) -> Phase {
        self.bus.request(goal, TransitionOptions::default(), self.wake);
        for _ in 0..60_000 {
            self.cycle();
            if !matches!(self.bus.phase(), Phase::Moving { .. }) {
                break;
            }
        }
        self.bus.phase()
    }

    /// The farthest clock, as the SubDevices' own registers 0x092C show it, ns.
    pub fn worst_clock_ns(&mut self) -> u32 {
        let devices = self.segment().sub_devices().iter();
        let differences = devices.filter_map(|device| device.esc().peek(0x092C, 4));
        let magnitude = |bytes: &[u8]| u32::from_le_bytes(bytes.try_into().unwrap()) & 0x7FFF_FFFF;
        differences.map(magnitude).max().unwrap_or(0)
    }
}
