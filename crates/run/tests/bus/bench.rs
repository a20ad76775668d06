//! A robot on its simulated bus, cycle by cycle, with a hand on the segment.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::atomic::AtomicBool;

use omnibase_ethercat::wire::frame::FrameBuilder;
use omnibase_ethercat::wire::{Address, Command, HostTime, Link, LinkError};
use omnibase_ethercat_sim::{Fault, FaultLink, Segment, SimLink, VirtualClock, in_process};
use omnibase_robot::signals::{CycleTime, Phase};
use omnibase_robot::{CycleRecord, Exchange, Registry, Request, RequestKind, Robot, RobotPlan};
use omnibase_run::session::Session;
use omnibase_run::{RobotText, simulated};

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

/// A link that a test can reach while somebody else owns it.
#[derive(Clone)]
pub struct Shared(pub Rc<RefCell<FaultLink<SimLink>>>);

impl Link for Shared {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.0.borrow_mut().send(frame)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        self.0.borrow_mut().receive(buffer, deadline)
    }
}

/// A robot in OP.
pub struct Bench {
    pub session: Session<Shared, VirtualClock>,
    pub robot: Robot,
    pub link: Shared,
    pub cycles: u64,
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
        let link = Shared(Rc::new(RefCell::new(FaultLink::new(link, 1))));
        let mut session =
            Session::prepare(link.clone(), clock, plan, &mut |warning| panic!("{warning}")).unwrap();
        assert!(session.reach_op(&AtomicBool::new(false)).unwrap());
        let robot = Robot::build(plan, &Registry::with_built_in()).unwrap();
        Bench { session, robot, link, cycles: 0, events: Vec::new(), period_ns: plan.bus.cycle_ns }
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
        let (exchange, _) = self.session.exchange().unwrap();
        self.cycles += 1;
        let time = CycleTime::on_grid(self.cycles, self.period_ns);
        let record: CycleRecord = *self.robot.compute(time, exchange, request, &mut self.session.image());
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

    /// Events with these words, by cycle.
    pub fn told(&self, words: &str) -> Vec<(u64, String)> {
        self.events.iter().filter(|(_, text)| text.contains(words)).cloned().collect()
    }
}
