//! What dies beside the cycle: the dashboard's thread, and the recorder; with everything as in a run.

use std::fs::File;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};

use omnibase_ethercat::wire::{HostTime, Link, LinkError};
use omnibase_ethercat_sim::{SimLink, in_process};
use omnibase_platform::Twist2;
use omnibase_record::run::{OnFull, RunFiles, RunRecorder};
use omnibase_robot::signals::{Frame, StopCategory};
use omnibase_robot::{Registry, RequestKind, Robot};
use omnibase_run::channels::{Known, Rows};
use omnibase_run::live::{Ages, Ask, StickWish, live};
use omnibase_run::{Progress, Setup, run, simulated};

use super::case::{STATES, State};
use super::{CIRCLE, NOTICED_MS};
use crate::bench::plan;

const AGES: Ages = Ages { pad_ns: 200_000_000, session_ns: 1_000_000_000 };
/// The cycle at which the run is ended, long after.
const END: u64 = 6000;

/// What dies.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Dead {
    Nothing,
    Dashboard,
    Recorder,
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
    /// From the death until it ramped down, ms.
    ramp_ms: Option<u64>,
    /// How fast it was before its end, rad/s.
    speed_rad_s: f64,
    /// Where it was at the end: exact.
    pose: [u64; 3],
    /// The last phase that was told before its end.
    is_holding: bool,
}

fn came(state: State, dead: Dead) -> Came {
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
    if dead == Dead::Recorder {
        assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        reader = Some(File::options().read(true).write(true).open(&pipe).unwrap());
        let files = RunFiles { columns: Some(pipe.clone()), ..RunFiles::default() };
        let (started, sink) = RunRecorder::start(&files, rows.schema(), OnFull::Drop).unwrap();
        (recorder, recording) = (Some(started), Some((rows, sink)));
    }
    let (hand, end) = live(AGES, StopCategory::RampThenRemove, &[]);
    let page = hand.begin_session().unwrap();
    let (mut hand, mut last, mut speed_rad_s) = (Some(hand), 0, 0.0);
    let tell = || {
        let cycle = progress.cycles.load(Ordering::Relaxed);
        if cycle == last {
            return;
        }
        last = cycle;
        if cycle >= at {
            match dead {
                Dead::Nothing => {}
                Dead::Dashboard => hand = None,
                // Whatever it writes fails from here on, as on a full disk.
                Dead::Recorder => reader = None,
            }
        }
        if cycle == END {
            let machine = machine.lock();
            speed_rad_s = (0..3).map(|wheel| machine.shaft(wheel).speed_rad_s.abs()).fold(0.0, f64::max);
            stop.store(true, Ordering::Relaxed);
        }
        let Some(hand) = &hand else { return };
        hand.send(page, Ask::Alive);
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
        hand.send(page, ask);
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
    assert!(ran.ended.is_ok(), "{state:?}, {dead:?}: {:?}", ran.ended);
    if let Some(recorder) = recorder {
        std::fs::remove_file(&pipe).unwrap();
        assert!(recorder.finish().failure.is_some(), "{state:?}: the recorder noticed nothing");
    }
    let events = &ran.summary.events;
    let ramp =
        events.iter().find(|event| event.text == "ramping down" && event.time_s * 1e3 >= at as f64 - 1.5);
    let truth = machine.truth().pose;
    let phases = events.iter().filter(|event| event.time_s * 1e3 < END as f64 - 5.0);
    let mut phases =
        phases.filter(|event| ["holding", "ramping down", "tracking the reference"].contains(&&*event.text));
    Came {
        is_holding: phases.next_back().is_some_and(|event| event.text == "holding"),
        ramp_ms: ramp.map(|event| (event.time_s * 1e3).round() as u64 - at).filter(|ms| ms + at < END),
        speed_rad_s,
        pose: [truth.x_m.to_bits(), truth.y_m.to_bits(), truth.heading_rad.to_bits()],
    }
}

/// The rows of both.
pub fn rows() -> String {
    let dashboard = STATES.map(|state| {
        let came = came(state, Dead::Dashboard);
        assert!(came.is_holding, "{state:?}");
        assert!(came.speed_rad_s < super::STANDING_RAD_S, "{state:?}: {} rad/s", came.speed_rad_s);
        let age_ns = match state {
            State::Tracking => Some(AGES.session_ns),
            State::ByHand => Some(AGES.pad_ns),
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
    });
    let recorder = STATES.map(|state| {
        let (without, with) = (came(state, Dead::Nothing), came(state, Dead::Recorder));
        assert_eq!(without.pose, with.pose, "{state:?}: the robot went elsewhere");
        "goes on, to the bit as without a recorder"
    });
    format!(
        "| the dashboard's thread is dead, and it commanded | nothing is enabled yet | {} |\n\
         | the disk is full, or the recorder is dead | nothing is enabled yet | {} |\n",
        dashboard.join(" | "),
        recorder.join(" | ")
    )
}
