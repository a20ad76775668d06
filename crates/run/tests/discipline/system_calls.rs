//! The thread of the cycle asks the kernel for the frame and the time, and for nothing else: counted by strace on a run
//! over a virtual cable, with lost frames, an operator, a stop, and a recording.

use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

use omnibase_ethercat::wire::{Clock, HostTime, Link, LinkError};
use omnibase_ethercat_sim::serve;
use omnibase_host::{MonotonicClock, Namespace, PacketSocket, skipped};
use omnibase_record::run::{OnFull, RunFiles, RunRecorder};
use omnibase_robot::signals::StopCategory;
use omnibase_robot::{Registry, RequestKind, Robot};
use omnibase_run::channels::{Known, Rows};
use omnibase_run::live::{Ages, Ask, Client, live};
use omnibase_run::{Progress, Setup, run, simulated};

use super::watched::robot_with;

/// Cycles of the run that are looked at.
const CYCLES: std::ops::Range<u64> = 50..400;
/// Runs until enough of them were seen: drives that are simulated on a busy machine may answer too late to reach OP.
const ATTEMPTS: u32 = 5;
/// Long, for the same reason.
const CYCLE: &str = "bus.cycle_us = 4000";

/// The host's clock, which makes a mark in strace's output (`getppid`) in each cycle that is looked at.
struct MarkingClock<'a> {
    clock: MonotonicClock,
    progress: &'a Progress,
    stop: &'a AtomicBool,
}

impl Clock for MarkingClock<'_> {
    fn now(&self) -> HostTime {
        self.clock.now()
    }

    fn sleep_until(&mut self, instant: HostTime) {
        let cycles = self.progress.cycles.load(Ordering::Relaxed);
        if CYCLES.contains(&cycles) {
            let _ = std::os::unix::process::parent_id();
        }
        if cycles == CYCLES.end - 100 {
            self.stop.store(true, Ordering::Relaxed);
        }
        self.clock.sleep_until(instant);
    }
}

/// Loses a frame now and then.
struct LossyLink<'a> {
    link: PacketSocket,
    progress: &'a Progress,
}

impl Link for LossyLink<'_> {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        let cycles = self.progress.cycles.load(Ordering::Relaxed);
        if CYCLES.contains(&cycles) && cycles.is_multiple_of(50) {
            return Ok(());
        }
        self.link.send(frame)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        self.link.receive(buffer, deadline)
    }
}

/// Not a test by itself: what [`the_cycle_calls_the_kernel_for_frames_and_time_alone`] runs under `strace`.
#[test]
fn run_for_strace() {
    if std::env::var_os("OMNIBASE_TEST_RUN").is_none() {
        return;
    }
    let mut robot = robot_with(&[CYCLE]);
    // The simulated drives answer when this machine gets round to it.
    robot.plan.bus.receive_timeout_ns = robot.plan.bus.cycle_ns * 9 / 10;
    let progress = Progress::default();
    let (stop, served) = (AtomicBool::new(false), AtomicBool::new(false));
    let (hand, end) =
        live(Ages { stick_ns: u64::MAX, session_ns: u64::MAX }, StopCategory::RampThenRemove, &[]);
    hand.send(Client::Joystick, Ask::Robot(RequestKind::Enable)).unwrap();
    hand.send(Client::Joystick, Ask::Robot(RequestKind::Track)).unwrap();
    let path = std::env::temp_dir().join(format!("omnibase-discipline-{}.mcap", std::process::id()));
    let rows = Rows::new(&robot.plan.record_layout(), Known::BeliefAlone);
    let files =
        RunFiles { mcap: Some(path.clone()), description: robot.description.clone(), ..RunFiles::default() };
    let (recorder, sink) = RunRecorder::start(&files, rows.schema(), OnFull::Drop).unwrap();
    let (mut segment, _machine) = simulated::segment(&robot.plan).unwrap();
    let ran = std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut link = PacketSocket::open(Namespace::FAR).unwrap();
            let mut watch = |_: &mut _| match served.load(Ordering::Relaxed) {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            };
            serve(&mut segment, &mut link, &MonotonicClock, &mut watch).unwrap();
        });
        let setup = Setup {
            plan: &robot.plan,
            robot: Robot::build(&robot.plan, &Registry::with_built_in()).unwrap(),
            machine: None,
            script: None,
            recording: Some((rows, sink)),
            live: Some(end),
            stop: &stop,
            progress: &progress,
        };
        let link = LossyLink { link: PacketSocket::open(Namespace::NEAR).unwrap(), progress: &progress };
        let clock = MarkingClock { clock: MonotonicClock, progress: &progress, stop: &stop };
        let ran = run(link, clock, setup, &mut |_| {});
        served.store(true, Ordering::Relaxed);
        ran
    });
    recorder.finish();
    std::fs::remove_file(path).unwrap();
    // However it ended: on a busy machine it may be by a fault, whose cycles count too.
    eprintln!("{:?}", ran.map(|ran| (ran.summary.cycles, ran.ended)));
}

#[test]
fn the_cycle_calls_the_kernel_for_frames_and_time_alone() {
    const TEST: &str = "the_cycle_calls_the_kernel_for_frames_and_time_alone";
    let Some(namespace) = Namespace::for_test(TEST) else { return };
    if Command::new("strace").arg("-V").output().is_err() {
        return skipped(format_args!("{TEST}: strace is not installed"));
    }
    for attempt in 1..=ATTEMPTS {
        let (text, says) = traced(&namespace, attempt);
        match looked_at(&text) {
            Some(()) => return,
            None => eprintln!("attempt {attempt}: too few cycles in OP on this busy machine: {says}"),
        }
    }
    eprintln!("SKIPPED: {TEST}: in {ATTEMPTS} attempts the simulated drives never answered in time");
}

/// What strace wrote of one run, and what that said.
fn traced(namespace: &Namespace, attempt: u32) -> (String, String) {
    let name = format!("omnibase-discipline-{}-{attempt}.strace", std::process::id());
    let trace = std::env::temp_dir().join(name);
    let output = namespace.run(|| {
        Command::new("strace")
            .args(["-f", "-o"])
            .arg(&trace)
            .arg(std::env::current_exe().unwrap())
            .args(["--exact", "system_calls::run_for_strace", "--test-threads=1", "--nocapture"])
            .env("OMNIBASE_TEST_RUN", "1")
            .stdin(Stdio::null())
            .output()
            .unwrap()
    });
    let says = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{says}");
    let text = std::fs::read_to_string(&trace).unwrap();
    std::fs::remove_file(&trace).unwrap();
    (text, says)
}

/// Whether the calls between marks are those that are allowed; `None` for too few cycles.
fn looked_at(trace: &str) -> Option<()> {
    let calls = calls_between_marks(trace);
    // Frames, the time, and the questions whether the cable is in and the interface is there, which the port asks where a frame stays away.
    let allowed = ["getppid", "clock_nanosleep", "sendto", "recvfrom", "ppoll", "ioctl"];
    let others: BTreeSet<&str> =
        calls.iter().map(|(name, _)| *name).filter(|name| !allowed.contains(name)).collect();
    assert!(others.is_empty(), "the cycle also calls {others:?}");
    let ioctls = calls.iter().filter(|(name, _)| *name == "ioctl");
    assert!(
        ioctls
            .clone()
            .all(|(_, line)| ["SIOCGIFFLAGS", "SIOCGIFINDEX"].iter().any(|asked| line.contains(asked))),
        "{:?}",
        ioctls.collect::<Vec<_>>()
    );
    let count = |wanted: &str| calls.iter().filter(|(name, _)| *name == wanted).count();
    // A second of them: most of what a run does.
    (count("getppid") > 250).then(|| {
        for expected in ["sendto", "recvfrom"] {
            assert!(count(expected) > 200, "{expected}: {}; is the trace read rightly?", count(expected));
        }
    })
}

/// The calls of the thread that made marks, by name and line, from its first mark to its last.
fn calls_between_marks(trace: &str) -> Vec<(&str, &str)> {
    let lines: Vec<(&str, &str)> = trace
        .lines()
        .filter_map(|line| line.split_once(' '))
        .map(|(thread, call)| (thread, call.trim_start()))
        .collect();
    let is_mark = |(_, call): &&(&str, &str)| call.starts_with("getppid(");
    let Some((thread, _)) = lines.iter().find(is_mark) else { return Vec::new() };
    let ours: Vec<&str> = lines.iter().filter(|(of, _)| of == thread).map(|(_, call)| *call).collect();
    let mark = |call: &str| call.starts_with("getppid(");
    let (Some(first), Some(last)) =
        (ours.iter().position(|call| mark(call)), ours.iter().rposition(|call| mark(call)))
    else {
        return Vec::new();
    };
    // `<... name resumed>` is the end of a call that was counted when it began.
    let begun = ours[first..=last].iter().filter(|call| !call.starts_with(['<', '-', '+']));
    begun.filter_map(|call| Some((call.split_once('(')?.0, *call))).collect()
}
