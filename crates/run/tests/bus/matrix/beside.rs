//! What happens beside the bus: the dashboard's thread or the recorder dies, the line to the page becomes slow, the way is
//! blocked; with everything as in a run.

use std::fs::File;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};

use omnibase_ethercat::wire::{HostTime, Link, LinkError};
use omnibase_ethercat_sim::{SimLink, in_process};
use omnibase_platform::{Pose2, Twist2};
use omnibase_record::run::{OnFull, RunFiles, RunRecorder};
use omnibase_robot::guard::Obstacle;
use omnibase_robot::signals::{Frame, StopCategory};
use omnibase_robot::{Registry, RequestKind, Robot};
use omnibase_run::channels::{Known, Rows};
use omnibase_run::live::{Ages, Ask, Asker, Stamp, StickWish, live};
use omnibase_run::{Progress, Setup, run, simulated};

use super::case::{STATES, State};
use super::{CIRCLE, NOTICED_MS};
use crate::bench::plan;

const AGES: Ages = Ages { stick_ns: 200_000_000, session_ns: 1_000_000_000 };
/// How late a slow line is, ns.
const SLOW_NS: u64 = 2_000_000_000;
/// Obstacles that block every way: so many, so far away, so large.
const RING: u32 = 12;
const RING_M: f64 = 0.9;
const RING_RADIUS_M: f64 = 0.25;

/// What happens.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Trouble {
    Nothing,
    /// The dashboard's thread dies.
    Dashboard,
    /// The recorder dies.
    Recorder,
    /// What the page says comes late from now on.
    SlowLine,
    /// Obstacles come to stand all around.
    Obstacles,
}

impl Trouble {
    /// The cycle at which the run is ended, long after.
    fn end(self) -> u64 {
        if self == Trouble::Obstacles { 25_000 } else { 6000 }
    }
}

/// A link into the simulated robot that tells somebody of each frame.
struct Told<F> {
    link: SimLink,
    tell: F,
}

impl<F: FnMut()> Link for Told<F> {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        (self.tell)();
        self.link.send(frame)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        self.link.receive(buffer, deadline)
    }
}

/// What a run came to.
struct Came {
    /// From then until it ramped down, ms.
    ramp_ms: Option<u64>,
    /// How fast it was before its end, rad/s.
    speed_rad_s: f64,
    /// Where it was at the end: exact.
    pose: [u64; 3],
    /// The last phase that was told before its end.
    is_holding: bool,
}

/// Obstacles all around a place, too near to each other for the robot.
fn ring(around: Pose2) -> impl Iterator<Item = RequestKind> {
    (0..RING).map(move |index| {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(index) / f64::from(RING)).sin_cos();
        let centre_m = [around.x_m + RING_M * cos, around.y_m + RING_M * sin];
        let obstacle = Obstacle { centre_m, radius_m: RING_RADIUS_M, velocity_m_s: [0.0; 2] };
        RequestKind::SetObstacle { index, obstacle }
    })
}

fn came(state: State, trouble: Trouble) -> Came {
    let end_cycle = trouble.end();
    let at = match state {
        State::Starting => 203,
        State::Holding => 1500,
        State::Tracking => 3000,
        State::ByHand => 2000,
        State::Stopping => 3050,
    };
    let plan = plan(CIRCLE);
    let (segment, machine) = simulated::segment(&plan).unwrap();
    let (link, clock) = in_process(segment);
    let (stop, progress) = (AtomicBool::new(false), Progress::default());
    let rows = Rows::new(&plan.record_layout(), Known::Truth);
    let pipe = std::env::temp_dir().join(format!("omnibase-matrix-{state:?}-{}", std::process::id()));
    let (mut recorder, mut recording, mut reader) = (None, None, None);
    if trouble == Trouble::Recorder {
        assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        reader = Some(File::options().read(true).write(true).open(&pipe).unwrap());
        let files = RunFiles { columns: Some(pipe.clone()), ..RunFiles::default() };
        let (started, sink) = RunRecorder::start(&files, rows.schema(), OnFull::Drop).unwrap();
        (recorder, recording) = (Some(started), Some((rows, sink)));
    }
    let (hand, end) = live(AGES, StopCategory::RampThenRemove, &[]);
    let page = hand.begin_session().unwrap();
    let (mut hand, mut last, mut speed_rad_s, mut slow_since_ns) = (Some(hand), 0, 0.0, None);
    let tell = || {
        let cycle = progress.cycles.load(Ordering::Relaxed);
        if cycle == last {
            return;
        }
        last = cycle;
        if cycle >= at {
            match trouble {
                Trouble::Nothing | Trouble::SlowLine | Trouble::Obstacles => {}
                Trouble::Dashboard => hand = None,
                // Whatever it writes fails from here on, as on a full disk.
                Trouble::Recorder => reader = None,
            }
        }
        if cycle == end_cycle {
            let machine = machine.lock();
            speed_rad_s = (0..3).map(|wheel| machine.shaft(wheel).speed_rad_s.abs()).fold(0.0, f64::max);
            stop.store(true, Ordering::Relaxed);
        }
        let Some(hand) = &hand else { return };
        if trouble == Trouble::Obstacles && cycle == at {
            for kind in ring(hand.snapshot().record.state.odom_from_body) {
                hand.send(page, Ask::Robot(kind));
            }
        }
        let now_ns = hand.clock_ns();
        slow_since_ns = slow_since_ns.or((trouble == Trouble::SlowLine && cycle >= at).then_some(now_ns));
        let stamp = slow_since_ns
            .map_or(Stamp::Here, |since_ns| Stamp::Told(since_ns.max(now_ns.saturating_sub(SLOW_NS))));
        let by = Asker::from(page).stamped(stamp);
        hand.send(by, Ask::Alive);
        let moves = matches!(state, State::Tracking | State::Stopping);
        let ask = match cycle {
            200 => Ask::Robot(RequestKind::Enable),
            1000 if moves => Ask::Robot(RequestKind::Track),
            3000 if state == State::Stopping => Ask::Robot(RequestKind::Stop(StopCategory::RampAndHold)),
            900 if state == State::ByHand => Ask::Stick(StickWish::Released),
            1000.. if state == State::ByHand => {
                Ask::Stick(StickWish::Held { twist: Twist2::new(0.3, 0.1, 0.2), frame: Frame::Body })
            }
            _ => return,
        };
        hand.send(by, ask);
    };
    let setup = Setup {
        plan: &plan,
        robot: Robot::build(&plan, &Registry::with_built_in()).unwrap(),
        machine: Some(machine.clone()),
        script: None,
        recording,
        live: Some(end),
        stop: &stop,
        progress: &progress,
    };
    let ran = run(Told { link, tell }, clock, setup, &mut |_| ()).unwrap();
    assert!(ran.ended.is_ok(), "{state:?}, {trouble:?}: {:?}", ran.ended);
    if let Some(recorder) = recorder {
        std::fs::remove_file(&pipe).unwrap();
        assert!(recorder.finish().failure.is_some(), "{state:?}: the recorder noticed nothing");
    }
    let events = &ran.summary.events;
    let ramp =
        events.iter().find(|event| event.text == "ramping down" && event.time_s * 1e3 >= at as f64 - 1.5);
    let truth = machine.truth().pose;
    let phases = events.iter().filter(|event| event.time_s * 1e3 < end_cycle as f64 - 5.0);
    let mut phases =
        phases.filter(|event| ["holding", "ramping down", "tracking the reference"].contains(&&*event.text));
    Came {
        is_holding: phases.next_back().is_some_and(|event| event.text == "holding"),
        ramp_ms: ramp.map(|event| (event.time_s * 1e3).round() as u64 - at).filter(|ms| ms + at < end_cycle),
        speed_rad_s,
        pose: [truth.x_m.to_bits(), truth.y_m.to_bits(), truth.heading_rad.to_bits()],
    }
}

/// What comes of a page that isn't heard any more, or too late.
fn without_page(trouble: Trouble) -> [String; 5] {
    STATES.map(|state| {
        let came = came(state, trouble);
        assert!(came.is_holding, "{state:?}");
        assert!(came.speed_rad_s < super::STANDING_RAD_S, "{state:?}: {} rad/s", came.speed_rad_s);
        let age_ns = match state {
            State::Tracking => Some(AGES.session_ns),
            State::ByHand => Some(AGES.stick_ns),
            State::Starting | State::Holding | State::Stopping => None,
        };
        match (age_ns, came.ramp_ms) {
            (Some(age_ns), Some(ms)) => {
                let age_ms = age_ns / 1_000_000;
                // Its last word is a cycle older than its death.
                assert!((age_ms - 2..=age_ms + NOTICED_MS).contains(&ms), "{state:?}: after {ms} ms");
                format!("ramp after {ms} ms; stands, torque stays; holding")
            }
            (None, None) => "goes on: holding".to_owned(),
            (_, ramp_ms) => panic!("{state:?}: {ramp_ms:?}"),
        }
    })
}

/// What comes of a robot that can go nowhere any more.
fn blocked() -> [String; 5] {
    STATES.map(|state| {
        let came = came(state, Trouble::Obstacles);
        // A person's stick is held back, and goes on to be heard.
        assert_eq!(came.is_holding, state != State::ByHand, "{state:?}");
        let follows = state == State::Tracking;
        assert_eq!(follows, came.ramp_ms.is_some(), "{state:?}: {:?}", came.ramp_ms);
        match (came.ramp_ms, state) {
            (Some(ms), _) => {
                // It goes on as far as it can, and is given up after 5 s without headway; its path takes 12 s.
                assert!((5_000..17_000).contains(&ms), "{ms} ms");
                assert!(came.speed_rad_s < super::STANDING_RAD_S, "{} rad/s", came.speed_rad_s);
                format!("ramp after {ms} ms; stands, torque stays; holding")
            }
            (None, State::ByHand) => "held back: tracking".to_owned(),
            (None, _) => "goes on: holding".to_owned(),
        }
    })
}

/// The rows of all.
pub fn rows() -> String {
    let dashboard = without_page(Trouble::Dashboard);
    let line = without_page(Trouble::SlowLine);
    let recorder = STATES.map(|state| {
        let (without, with) = (came(state, Trouble::Nothing), came(state, Trouble::Recorder));
        assert_eq!(without.pose, with.pose, "{state:?}: the robot went elsewhere");
        "goes on, to the bit as without a recorder"
    });
    format!(
        "| the dashboard's thread is dead, and it commanded | nothing is enabled yet | {} |\n\
         | the line to the page that commanded becomes 2 s slow | nothing is enabled yet | {} |\n\
         | obstacles block every way | nothing is enabled yet | {} |\n\
         | the disk is full, or the recorder is dead | nothing is enabled yet | {} |\n",
        dashboard.join(" | "),
        line.join(" | "),
        blocked().join(" | "),
        recorder.join(" | ")
    )
}
