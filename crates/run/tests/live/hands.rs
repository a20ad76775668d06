//! People's hands on a robot that runs in virtual time: what they do at which second, and what they see then.

use std::cell::{Cell, RefCell};
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use omnibase_ethercat::wire::{Clock, HostTime, Link, LinkError};
use omnibase_ethercat_sim::device::panel::IoPanel;
use omnibase_ethercat_sim::{SimLink, VirtualClock, in_process};
use omnibase_record::run::{OnFull, RecordedRun, Rotation, RunFiles, RunRecorder};
use omnibase_robot::config::ReferenceTable;
use omnibase_robot::signals::StopCategory;
use omnibase_robot::stages::Reference;
use omnibase_robot::{Ability, Registry, Robot, RobotPlan};
use omnibase_run::channels::{Known, Rows};
use omnibase_run::live::{Ages, Answer, Ask, Client, Live, Snapshot, StickWish, live};
use omnibase_run::simulated::Simulated;
use omnibase_run::{Progress, Ran, Replayed, RobotText, Setup, replay, run, simulated};

pub const BMM: &str = include_str!("../../../../robots/bmm.toml");
const AGES: Ages = Ages { stick_ns: 200_000_000, session_ns: 500_000_000 };

/// The robot that all of them drive.
pub fn plan() -> RobotPlan {
    let text = RobotText { text: BMM.into(), ..RobotText::default() };
    text.load(&Registry::with_built_in()).unwrap().plan
}

/// What a table asks for, within that robot's limits.
pub fn reference(table: &ReferenceTable) -> Box<dyn Reference> {
    Registry::with_built_in().make_reference(table, &Ability::of(&plan())).unwrap()
}

type Act = Box<dyn FnMut(&Live, &Snapshot)>;

struct Deed {
    from_s: f64,
    until_s: f64,
    act: Act,
}

/// What hands do.
#[derive(Default)]
pub struct Hands {
    deeds: Vec<Deed>,
    /// The cable is pulled: no frame arrives anywhere.
    is_pulled: Rc<Cell<bool>>,
    /// The terminals of the SubDevices without a wheel.
    pub panels: Vec<IoPanel>,
    /// The recording is in files of so many bytes at most.
    pub file_bytes: Option<u64>,
}

/// The cable to the simulated robot, which hands can pull.
struct Cable {
    link: SimLink,
    is_pulled: Rc<Cell<bool>>,
}

impl Link for Cable {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        if self.is_pulled.get() { Ok(()) } else { self.link.send(frame) }
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        self.link.receive(buffer, deadline)
    }
}

impl Hands {
    /// Does something once, at a second of the run.
    pub fn at(&mut self, time_s: f64, act: impl FnMut(&Live, &Snapshot) + 'static) {
        self.deeds.push(Deed { from_s: time_s, until_s: time_s, act: Box::new(act) });
    }

    /// Does something in every cycle.
    pub fn between(&mut self, from_s: f64, until_s: f64, act: impl FnMut(&Live, &Snapshot) + 'static) {
        self.deeds.push(Deed { from_s, until_s, act: Box::new(act) });
    }

    /// Pulls the cable, and puts it back.
    pub fn pull_cable(&mut self, from_s: f64, until_s: f64) {
        for (time_s, is_pulled) in [(from_s, true), (until_s, false)] {
            let cable = self.is_pulled.clone();
            self.at(time_s, move |_, _| cable.set(is_pulled));
        }
    }

    /// Asks for something.
    pub fn send(&mut self, time_s: f64, client: Client, ask: Ask) {
        let mut ask = Some(ask);
        self.at(time_s, move |live, _| {
            live.send(client, ask.take().expect("once")).expect("there is room");
        });
    }

    /// Holds a stick like that.
    pub fn stick(&mut self, from_s: f64, until_s: f64, client: Client, stick: StickWish) {
        self.between(from_s, until_s, move |live, _| {
            live.send(client, Ask::Stick(stick)).expect("there is room");
        });
    }

    /// A page is alive.
    pub fn alive(&mut self, from_s: f64, until_s: f64, client: Client) {
        self.between(from_s, until_s, move |live, _| {
            live.send(client, Ask::Alive).expect("there is room");
        });
    }

    /// Asks for something, and looks at the answer 0.1 s later.
    pub fn ask(&mut self, time_s: f64, client: Client, ask: Ask, expected: Answer) {
        let ticket = Rc::new(RefCell::new(None));
        let (sent, mut ask) = (ticket.clone(), Some(ask));
        self.at(time_s, move |live, _| *sent.borrow_mut() = live.send(client, ask.take().unwrap()));
        self.at(time_s + 0.1, move |live, _| {
            let answer = live.answer(ticket.borrow().expect("there is room"));
            assert_eq!(answer, Some(expected), "what was asked at {time_s} s");
        });
    }

    fn act(&mut self, live: &Live) {
        let seen = live.snapshot();
        let now_s = seen.record.time.now_ns as f64 * 1e-9;
        for deed in &mut self.deeds {
            if now_s >= deed.from_s && deed.from_s <= deed.until_s {
                (deed.act)(live, &seen);
                // Done once, or until its end.
                if now_s + 1e-9 >= deed.until_s {
                    deed.from_s = f64::INFINITY;
                }
            }
        }
    }
}

/// Virtual time that lets hands act whenever the cycle sleeps.
#[derive(Clone)]
struct Watched {
    clock: VirtualClock,
    live: Live,
    hands: Rc<RefCell<Hands>>,
    until_s: f64,
    stop: &'static AtomicBool,
}

impl Clock for Watched {
    fn now(&self) -> HostTime {
        self.clock.now()
    }

    fn sleep_until(&mut self, instant: HostTime) {
        self.hands.borrow_mut().act(&self.live);
        if self.live.snapshot().record.time.now_ns as f64 * 1e-9 >= self.until_s {
            self.stop.store(true, Ordering::Relaxed);
        }
        self.clock.sleep_until(instant);
    }
}

/// What came of it.
pub struct Played {
    pub ran: Ran,
    pub last: Snapshot,
    pub live: Live,
    pub replayed: Replayed,
    /// The recording, or its first file.
    pub recorded: RecordedRun,
    /// Its other files.
    pub later_files: Vec<RecordedRun>,
    pub stop: &'static AtomicBool,
}

/// Runs the simulated robot for so many seconds under these hands, and computes its recording again.
pub fn played(until_s: f64, prepare: impl FnOnce(&mut Hands)) -> Played {
    let robot = RobotText { text: BMM.into(), ..RobotText::default() };
    played_by(robot, until_s, prepare)
}

/// As [`played`], with another robot.
pub fn played_by(robot: RobotText, until_s: f64, prepare: impl FnOnce(&mut Hands)) -> Played {
    played_with(&Registry::with_built_in(), robot, until_s, prepare)
}

/// As [`played_by`], with other kinds.
pub fn played_with(
    registry: &Registry,
    robot: RobotText,
    until_s: f64,
    prepare: impl FnOnce(&mut Hands),
) -> Played {
    let robot = robot.load(registry).unwrap();
    let Simulated { segment, machine, panels, .. } = simulated::robot(&robot.plan).unwrap();
    let mut hands = Hands { panels, ..Hands::default() };
    prepare(&mut hands);
    let file_bytes = hands.file_bytes;
    let (live, end) = live(AGES, StopCategory::RampThenRemove, &robot.plan.sources);
    let (link, clock) = in_process(segment);
    let link = Cable { link, is_pulled: hands.is_pulled.clone() };
    let stop: &'static AtomicBool = Box::leak(Box::new(AtomicBool::new(false)));
    let clock = Watched { clock, live: live.clone(), hands: Rc::new(RefCell::new(hands)), until_s, stop };
    static NUMBER: AtomicUsize = AtomicUsize::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let folder = std::env::temp_dir().join(format!("omnibase-live-{}-{number}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let rows = Rows::new(&robot.plan.record_layout(), Known::Truth);
    let files = RunFiles {
        mcap: Some(folder.join("run.mcap")),
        rotation: file_bytes.map(|file_bytes| Rotation { file_bytes, files: None }),
        description: omnibase_run::describe::description(&robot, registry),
        ..RunFiles::default()
    };
    let (recorder, sink) = RunRecorder::start(&files, rows.schema(), OnFull::Wait).unwrap();
    live.describe_to(recorder.describer());
    let setup = Setup {
        plan: &robot.plan,
        robot: Robot::build(&robot.plan, registry).unwrap(),
        machine: Some(machine),
        script: None,
        recording: Some((rows, sink)),
        live: Some(end),
        stop,
        progress: &Progress::default(),
    };
    let ran = run(link, clock, setup, &mut |warning| panic!("{warning}")).unwrap();
    assert!(recorder.finish().failure.is_none());
    let mut paths: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    let read = |path: PathBuf| RecordedRun::read(&std::fs::read(path).unwrap()).unwrap();
    let mut later_files: Vec<_> = paths.into_iter().map(read).collect();
    std::fs::remove_dir_all(&folder).unwrap();
    let recorded = later_files.remove(0);
    let replayed = replay(&recorded, registry).unwrap();
    Played { ran, last: live.snapshot(), live, replayed, recorded, later_files, stop }
}
