//! A segment file brought up and cycled in virtual time, over a link that notes what passes.

use std::collections::BTreeSet;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use omnibase_ethercat::cyclic::{ClockDirection, Goal, TransitionOptions, TransitionStatus};
use omnibase_ethercat::paced::{Leader, Pace, PacedBus};
use omnibase_ethercat::wire::frame::Datagrams;
use omnibase_ethercat::wire::{Command, HostTime, Link, LinkError};
use omnibase_ethercat::{
    Bus, BusOptions, CyclicBus, DcConfig, Exchange, ProcessImage, SubDevice, SubDeviceConfig,
};
use omnibase_ethercat_sim::{FaultLink, Segment, SegmentFile, SimLink, VirtualClock, in_process};

/// Notes every command and the number of frames, and changes answers.
pub struct SpyLink {
    pub inner: FaultLink<SimLink>,
    pub commands: BTreeSet<Command>,
    pub frames: u64,
    pub change: fn(&mut [u8]),
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
        let length = self.inner.receive(buffer, deadline)?;
        if let Some(length) = length {
            (self.change)(&mut buffer[..length]);
        }
        Ok(length)
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

/// A cycling segment.
pub struct Runner {
    pub paced: PacedBus<SpyLink, VirtualClock>,
    pub image: ProcessImage,
    pub subdevices: Vec<SubDevice>,
}

impl Runner {
    /// From power-on to PRE-OP with everything configured.
    pub fn new(segment: Segment, configs: &[SubDeviceConfig], following: ClockDirection) -> Self {
        Runner::behind(segment, configs, following, |_| {})
    }

    /// The same behind what was done by the bus before.
    pub fn behind(
        segment: Segment,
        configs: &[SubDeviceConfig],
        following: ClockDirection,
        before: impl FnOnce(&mut Bus<SpyLink, VirtualClock>),
    ) -> Self {
        let (link, clock) = in_process(segment);
        let link =
            SpyLink { inner: FaultLink::new(link, 1), commands: BTreeSet::new(), frames: 0, change: |_| {} };
        let mut bus = Bus::new(link, clock, BusOptions::default());
        before(&mut bus);
        bus.scan().unwrap();
        bus.configure(configs).unwrap();
        let ready = bus.into_cyclic(following).unwrap();
        let leader = match following {
            ClockDirection::CycleFollowsDc => Leader::ReferenceClock,
            ClockDirection::DcFollowsHost => Leader::Host,
            ClockDirection::NoClock => Leader::Nobody,
        };
        let cycle = match configs.first().map(|config| config.dc) {
            Some(DcConfig::Sync0 { cycle_ns, .. }) => Duration::from_nanos(cycle_ns.into()),
            _ => Duration::from_millis(1),
        };
        let pace = Pace { cycle, timeout: cycle * 4 / 5, leader, sync0_shift_ns: 0 };
        Runner {
            image: ready.bus.plan().image(),
            subdevices: ready.subdevices,
            paced: PacedBus::new(ready.bus, ready.clock, pace),
        }
    }

    /// The bus between two cycles.
    pub fn bus(&mut self) -> &mut CyclicBus<SpyLink> {
        self.paced.bus_mut()
    }

    /// One cycle.
    pub fn cycle(&mut self) -> Exchange {
        self.paced.exchange(&mut self.image).unwrap().0
    }

    /// So many cycles, whatever becomes of them.
    pub fn cycles(&mut self, count: usize) {
        for _ in 0..count {
            self.cycle();
        }
    }

    pub fn segment(&mut self) -> &mut Segment {
        self.bus().link_mut().segment()
    }

    /// Cycles until the goal is reached or refused.
    pub fn to(&mut self, goal: Goal) -> TransitionStatus {
        let Runner { paced, image, .. } = self;
        // What became of it, the phase says.
        let _ = paced.reach(goal, TransitionOptions::default(), &AtomicBool::new(false), |paced| {
            paced.exchange(image).map(drop)
        });
        self.bus().transition().clone()
    }

    /// The farthest clock, as the SubDevices' own registers 0x092C show it, ns.
    pub fn worst_clock_ns(&mut self) -> u32 {
        let devices = self.segment().sub_devices().iter();
        let differences = devices.filter_map(|device| device.esc().peek(0x092C, 4));
        let magnitude = |bytes: &[u8]| u32::from_le_bytes(bytes.try_into().unwrap()) & 0x7FFF_FFFF;
        differences.map(magnitude).max().unwrap_or(0)
    }
}
