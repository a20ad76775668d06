//! A robot in virtual time whose link and clock are watched, and go wrong when told to.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};

use omnibase_ethercat::wire::{Clock, HostTime, Link, LinkError};
use omnibase_ethercat_sim::{Fault, SimLink, VirtualClock, in_process};
use omnibase_host::CountingAllocator;
use omnibase_record::run::RunSink;
use omnibase_robot::config::ReferenceTable;
use omnibase_robot::{Registry, Robot};
use omnibase_run::channels::Rows;
use omnibase_run::live::LiveEnd;
use omnibase_run::{LoadedRobot, Progress, Ran, RobotText, Setup, run, simulated};

const BMM: &str = include_str!("../../../../robots/bmm.toml");

/// Something that happens before a cycle.
pub enum Deed {
    /// The host sleeps this much longer, ns.
    Oversleep(u64),
    /// Waiting for the frame takes this much longer, ns.
    Stall(u64),
    /// The next frame is lost.
    Lose,
    /// A SubDevice fails.
    Break(usize, Fault),
    /// Somebody wants the end.
    Stop,
    /// Anything else.
    Do(Box<dyn FnMut()>),
}

/// How often this thread has asked for memory or given it back: each may lock.
fn uses_of_the_allocator() -> u64 {
    CountingAllocator::allocations_of_this_thread() + CountingAllocator::returns_of_this_thread()
}

/// What was seen of a run.
#[derive(Default)]
pub struct Observed {
    /// When the first frame of each cycle of the run was sent, ns.
    pub sent_ns: Vec<u64>,
    /// Allocations in each cycle of the run and memory given back, those of the simulated segment and of deeds taken off.
    pub allocations: Vec<u64>,
}

struct Watch {
    clock: VirtualClock,
    progress: &'static Progress,
    stop: &'static AtomicBool,
    deeds: RefCell<Vec<(u64, Deed)>>,
    seen: RefCell<Observed>,
    sent: RefCell<Vec<(u64, u64)>>,
    /// Cycles of the run when it last slept.
    cycles: Cell<u64>,
    counted: Cell<u64>,
    /// Allocations that aren't the cycle's.
    foreign: Cell<u64>,
    stall_ns: Cell<u64>,
    lose: Cell<u32>,
    broken: RefCell<Vec<(usize, Fault)>>,
}

impl Watch {
    /// Does something whose allocations aren't the cycle's.
    fn aside<R>(&self, work: impl FnOnce() -> R) -> R {
        let before = uses_of_the_allocator();
        let result = work();
        let more = uses_of_the_allocator() - before;
        self.foreign.set(self.foreign.get() + more);
        result
    }

    /// At the end of a cycle, before it sleeps: notes its allocations, and does what is due. How long to oversleep, ns.
    fn between_cycles(&self) -> u64 {
        let own = uses_of_the_allocator() - self.foreign.get();
        let cycles = self.progress.cycles.load(Ordering::Relaxed);
        let mut oversleep_ns = 0;
        self.aside(|| {
            if cycles == self.cycles.get() + 1 && cycles > 1 {
                self.seen.borrow_mut().allocations.push(own - self.counted.get());
            }
            self.cycles.set(cycles);
            let mut deeds = self.deeds.borrow_mut();
            while deeds.first().is_some_and(|(when, _)| *when <= cycles) {
                match deeds.remove(0).1 {
                    Deed::Oversleep(ns) => oversleep_ns = ns,
                    Deed::Stall(ns) => self.stall_ns.set(ns),
                    Deed::Lose => self.lose.set(self.lose.get() + 1),
                    Deed::Break(position, fault) => self.broken.borrow_mut().push((position, fault)),
                    Deed::Stop => self.stop.store(true, Ordering::Relaxed),
                    Deed::Do(mut act) => act(),
                }
            }
        });
        self.counted.set(own);
        oversleep_ns
    }
}

struct WatchedClock(Rc<Watch>);

impl Clock for WatchedClock {
    fn now(&self) -> HostTime {
        self.0.clock.now()
    }

    fn sleep_until(&mut self, instant: HostTime) {
        let oversleep_ns = self.0.between_cycles();
        self.0.clock.advance_to(HostTime(instant.0 + oversleep_ns));
    }
}

struct WatchedLink {
    link: SimLink,
    watch: Rc<Watch>,
}

impl Link for WatchedLink {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        let WatchedLink { link, watch } = self;
        watch.aside(|| {
            for (position, fault) in watch.broken.borrow_mut().drain(..) {
                link.segment_mut().inject(position, fault).unwrap();
            }
            if watch.cycles.get() > 0 {
                watch.sent.borrow_mut().push((watch.cycles.get(), watch.clock.now().0));
            }
            if watch.lose.get() > 0 {
                watch.lose.set(watch.lose.get() - 1);
                return Ok(());
            }
            link.send(frame)
        })
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        let WatchedLink { link, watch } = self;
        watch.aside(|| {
            let result = link.receive(buffer, deadline);
            let stall_ns = watch.stall_ns.replace(0);
            watch.clock.advance_to(HostTime(watch.clock.now().0 + stall_ns));
            result
        })
    }
}

/// What a run has beside the robot.
#[derive(Default)]
pub struct Extras {
    /// What happens before which cycle of the run, in order.
    pub deeds: Vec<(u64, Deed)>,
    /// Where it is recorded.
    pub recording: Option<(Rows, RunSink)>,
    /// Who leads it.
    pub live: Option<LiveEnd>,
}

/// The robot of all these tests, along a circle of 5 s.
pub fn robot() -> LoadedRobot {
    robot_with(&[])
}

/// The same with some of its file's settings changed.
pub fn robot_with(changes: &[&str]) -> LoadedRobot {
    robot_of(BMM, changes)
}

/// Another robot along the same circle.
pub fn robot_of(file: &str, changes: &[&str]) -> LoadedRobot {
    let circle = ReferenceTable {
        kind: Some("circle".to_owned()),
        radius_m: Some(0.2),
        duration_s: Some(5.0),
        ..ReferenceTable::default()
    };
    let text = RobotText {
        text: file.into(),
        changes: changes.iter().map(|change| (*change).to_owned()).collect(),
        reference: Some(circle.into()),
        ..RobotText::default()
    };
    text.load(&Registry::with_built_in()).unwrap()
}

/// Runs it.
pub fn watched(robot: &LoadedRobot, extras: Extras) -> (Ran, Observed) {
    let (segment, machine) = simulated::segment(&robot.plan).unwrap();
    let (link, clock) = in_process(segment);
    let stop: &'static AtomicBool = Box::leak(Box::new(AtomicBool::new(false)));
    let progress: &'static Progress = Box::leak(Box::default());
    let watch = Rc::new(Watch {
        clock,
        progress,
        stop,
        deeds: RefCell::new(extras.deeds),
        seen: RefCell::default(),
        sent: RefCell::default(),
        cycles: Cell::default(),
        counted: Cell::default(),
        foreign: Cell::default(),
        stall_ns: Cell::default(),
        lose: Cell::default(),
        broken: RefCell::default(),
    });
    let setup = Setup {
        plan: &robot.plan,
        robot: Robot::build(&robot.plan, &Registry::with_built_in()).unwrap(),
        machine: Some(machine),
        script: None,
        recording: extras.recording,
        live: extras.live,
        stop,
        progress,
    };
    let link = WatchedLink { link, watch: Rc::clone(&watch) };
    let ran = run(link, WatchedClock(Rc::clone(&watch)), setup, &mut |warning| panic!("{warning}")).unwrap();
    let mut seen = watch.seen.take();
    // The last sleep is the first of the way back to INIT: asking for that isn't the cycle's.
    let cycles = ran.summary.cycles as usize;
    seen.allocations.truncate(cycles.saturating_sub(2));
    // Each frame stands with the number of cycles before it; more than one in a cycle look for who is missing.
    let mut sent = watch.sent.take();
    sent.dedup_by_key(|(cycle, _)| *cycle);
    seen.sent_ns = sent.iter().filter(|(cycle, _)| *cycle < cycles as u64).map(|(_, ns)| *ns).collect();
    (ran, seen)
}
