//! A robot on its simulated bus, cycle by cycle, with a hand on the segment.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::atomic::AtomicBool;

use omnibase_ethercat::wire::frame::FrameBuilder;
use omnibase_ethercat::wire::{Address, Command, HostTime, Link, LinkError};
use omnibase_ethercat_sim::{Fault, FaultLink, Segment, SimLink, VirtualClock, in_process};
use omnibase_robot::signals::{CycleTime, Phase};
use omnibase_robot::{CycleRecord, Exchange, Registry, Request, RequestKind, Robot, RobotPlan};
use omnibase_run::{RobotText, simulated};
use omnibase_session::session::Session;

pub const BMM: &str = include_str!("../../../../robots/bmm.toml");

/// The plan of the BMM with more text in its file.
pub fn plan(more: &str) -> RobotPlan {
    plan_changed(more, &[])
}

/// As [`plan`], with settings changed as the command line does.
pub fn plan_changed(more: &str, changes: &[&str]) -> RobotPlan {
    let changes = changes.iter().map(|change| (*change).to_owned()).collect();
    let text = RobotText { text: format!("{BMM}\n{more}"), changes, ..RobotText::default() };
    text.load(&Registry::with_built_in()).unwrap().plan
}

/// The plan of the BMM with other settings, as on a command line.
pub fn plan_with(changes: &[&str]) -> RobotPlan {
    let changes = changes.iter().map(|change| (*change).to_owned()).collect();
    let text = RobotText { text: BMM.to_owned(), changes, ..RobotText::default() };
    text.load(&Registry::with_built_in()).unwrap().plan
}

/// What happens to frames beside the faults of the link itself.
#[derive(Default)]
pub struct Meddler {
    /// Frames of somebody else that are still to arrive.
    pub foreign: u32,
    /// Answers that are still to be cut short.
    pub short: u32,
    /// Frames for which the link says that it is down.
    pub down: u32,
    /// What breaks as soon as so many frames were sent.
    pub later: Option<(u64, usize, Fault)>,
}

/// A link that a test can reach while somebody else owns it.
#[derive(Clone)]
pub struct Shared(pub Rc<RefCell<FaultLink<SimLink>>>, pub Rc<RefCell<Meddler>>);

impl Link for Shared {
    fn is_connected(&self) -> Option<bool> {
        self.0.borrow().is_connected()
    }

    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        let mut link = self.0.borrow_mut();
        let sent = link.counts().frames;
        if let Some((_, position, fault)) = self.1.borrow_mut().later.take_if(|(at, ..)| sent >= *at) {
            link.inner_mut().segment_mut().inject(position, fault).unwrap();
        }
        let mut meddler = self.1.borrow_mut();
        if meddler.down > 0 {
            meddler.down -= 1;
            return Err(LinkError::Down);
        }
        link.send(frame)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        let mut meddler = self.1.borrow_mut();
        if meddler.foreign > 0 {
            meddler.foreign -= 1;
            let mut frame = FrameBuilder::new();
            // Somebody else's MainDevice asks for states.
            frame.push(Command::Brd, 0xEE, Address::broadcast(0x0130), &[0; 2]).unwrap();
            let bytes = frame.bytes();
            buffer[..bytes.len()].copy_from_slice(bytes);
            return Ok(Some(bytes.len()));
        }
        let received = self.0.borrow_mut().receive(buffer, deadline)?;
        Ok(match received {
            Some(length) if meddler.short > 0 => {
                meddler.short -= 1;
                Some(length / 2)
            }
            received => received,
        })
    }
}

/// A robot in OP.
pub struct Bench<L: Link = Shared> {
    pub session: Session<L, VirtualClock>,
    pub robot: Robot,
    pub link: L,
    pub cycles: u64,
    /// Periods that were left out.
    pub left_out: u64,
    pub events: Vec<(u64, String)>,
    period_ns: u64,
}

impl Bench {
    pub fn new(plan: &RobotPlan) -> Self {
        let (segment, _machine) = simulated::segment(plan).unwrap();
        Bench::on(plan, segment)
    }

    pub fn on(plan: &RobotPlan, segment: Segment) -> Self {
        let (link, clock) = in_process(segment);
        Bench::with(plan, link, clock)
    }

    pub fn with(plan: &RobotPlan, link: SimLink, clock: VirtualClock) -> Self {
        Bench::behind(plan, shared(link), clock)
    }

    pub fn inject(&mut self, position: usize, fault: Fault) {
        self.link.0.borrow_mut().inner_mut().segment_mut().inject(position, fault).unwrap();
    }

    /// Registers of a simulated SubDevice.
    pub fn peek(&self, position: usize, register: u16, length: usize) -> Vec<u8> {
        let link = self.link.0.borrow();
        link.inner().segment().sub_devices()[position].esc().peek(register, length).unwrap().to_vec()
    }

    /// Writes registers of a simulated SubDevice, by a frame that the bus knows nothing of.
    pub fn write_register(&mut self, position: u16, register: u16, data: &[u8]) {
        let mut frame = FrameBuilder::new();
        frame.push(Command::Apwr, 0, Address::position(position, register), data).unwrap();
        let mut bytes = frame.bytes().to_vec();
        let mut link = self.link.0.borrow_mut();
        let segment = link.inner_mut().segment_mut();
        let now = segment.now();
        segment.process(&mut bytes, now).expect("the segment is there");
    }

    pub fn al_status(&self, position: usize) -> u8 {
        self.peek(position, 0x0130, 1)[0]
    }

    /// Register 0x092C without its sign, ns.
    pub fn clock_ns(&self, position: usize) -> u32 {
        let bytes = self.peek(position, 0x092C, 4);
        u32::from_le_bytes(bytes.try_into().unwrap()) & 0x7FFF_FFFF
    }

    /// What the clock of a simulated SubDevice shows, and the virtual time, ns.
    pub fn dc_and_host_ns(&self, position: usize) -> (u64, u64) {
        let link = self.link.0.borrow();
        let segment = link.inner().segment();
        let time = segment.sub_devices()[position].esc().system_time(segment.now());
        (time.expect("it has a clock").0, segment.now().0)
    }
}

/// A link that can be reached, and meddled with.
pub fn shared(link: SimLink) -> Shared {
    Shared(Rc::new(RefCell::new(FaultLink::new(link, 1))), Rc::default())
}

impl<L: Link + Clone> Bench<L> {
    /// A robot in OP behind any link.
    pub fn behind(plan: &RobotPlan, link: L, clock: VirtualClock) -> Self {
        let mut session = Session::prepare(link.clone(), clock, plan, &mut |warning| {
            assert!(warning.starts_with("hot-connect group"), "{warning}")
        })
        .unwrap();
        assert!(session.reach_op(&AtomicBool::new(false)).unwrap());
        let robot = Robot::build(plan, &Registry::with_built_in()).unwrap();
        let period_ns = plan.bus.cycle_ns;
        Bench { session, robot, link, cycles: 0, left_out: 0, events: Vec::new(), period_ns }
    }

    /// One cycle of the robot.
    pub fn cycle(&mut self, request: Option<RequestKind>) -> Exchange {
        self.step(request.map(Request::lasting))
    }

    /// As [`Bench::cycle`], with a request that counts for so long, ns.
    pub fn cycle_for(&mut self, kind: RequestKind, for_ns: u64) -> Exchange {
        let valid_until_ns = (self.cycles + 1) * self.period_ns + for_ns;
        self.step(Some(Request { kind, valid_until_ns }))
    }

    fn step(&mut self, request: Option<Request>) -> Exchange {
        let (exchange, times) = self.session.exchange().unwrap();
        self.cycles += times.periods;
        self.left_out += times.periods - 1;
        let time = CycleTime::on_grid(self.cycles, self.period_ns);
        let record: CycleRecord = *self.robot.compute(time, exchange, request, self.session.image());
        self.session.look_at_drives(record.measurements.present());
        while let Some(words) = self.session.take_event() {
            self.events.push((self.cycles, words.to_string()));
        }
        exchange
    }

    pub fn run(&mut self, cycles: u64) {
        for _ in 0..cycles {
            self.cycle(None);
        }
    }

    /// Drives enabled, robot holding.
    pub fn enable(&mut self) {
        self.cycle(None);
        self.cycle(Some(RequestKind::Enable));
        for _ in 0..2000 {
            if self.robot.phase() == Phase::Holding {
                return;
            }
            self.cycle(None);
        }
        panic!("not holding: {:?}, {:?}", self.robot.phase(), self.events);
    }

    /// Events with these words, by cycle.
    pub fn told(&self, words: &str) -> Vec<(u64, String)> {
        self.events.iter().filter(|(_, text)| text.contains(words)).cloned().collect()
    }
}
