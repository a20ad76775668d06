//! No allocation in a running cycle, whatever happens in it.

use std::fs::File;
use std::path::PathBuf;
use std::process::Command;
use std::time::Duration;

use omnibase_ethercat_sim::Fault;
use omnibase_platform::Twist2;
use omnibase_record::run::{OnFull, RunFiles, RunRecorder};
use omnibase_robot::RequestKind;
use omnibase_robot::signals::{Apply, Frame, StopCategory};
use omnibase_run::channels::{Known, Rows};
use omnibase_run::live::{Ages, Ask, Client, Live, Pad, live};

use super::watched::{Deed, Extras, Seen, robot, watched};

/// Cycles of the run (from 1) in which something was allocated, and how often.
fn guilty(seen: &Seen) -> Vec<(usize, u64)> {
    let numbered = seen.allocations.iter().enumerate().map(|(number, count)| (number + 2, *count));
    numbered.filter(|(_, count)| *count > 0).collect()
}

#[track_caller]
fn allocates_nothing(what: &str, seen: &Seen, at_least: usize) {
    assert!(seen.allocations.len() >= at_least, "{what}: only {} cycles were seen", seen.allocations.len());
    assert_eq!(guilty(seen), [], "{what}: (cycle, allocations)");
}

#[test]
fn a_run_from_start_to_end() {
    let (ran, seen) = watched(&robot(), Extras::default());
    assert!(ran.finished, "{:?}", ran.ended);
    allocates_nothing("a quiet run", &seen, 5000);
}

#[test]
fn late_cycles_and_lost_frames() {
    let mut deeds: Vec<(u64, Deed)> = (0..200).map(|number| (1000 + 10 * number, Deed::Lose)).collect();
    deeds.extend([(3500, Deed::Oversleep(3_300_000)), (3600, Deed::Stall(2_700_000))]);
    let (ran, seen) = watched(&robot(), Extras { deeds, ..Extras::default() });
    assert_eq!(ran.summary.lost_frames, 200);
    assert!(ran.finished, "{:?}", ran.ended);
    allocates_nothing("lost frames", &seen, 5000);
}

/// The way back of a lost SubDevice is made when it is needed: beginning it and going from one of its stages to the next
/// allocates, in few cycles, while the robot stands. Everything else does not.
#[track_caller]
fn allocates_for_the_way_back_alone(what: &str, seen: &Seen, lost_at: usize, most: usize) {
    let guilty = guilty(seen);
    assert!(guilty.iter().all(|(cycle, _)| *cycle > lost_at), "{what}: before it was lost: {guilty:?}");
    assert!(guilty.len() <= most, "{what}: {} cycles allocate: {guilty:?}", guilty.len());
}

#[test]
fn a_bus_that_is_lost() {
    // Given up within these cycles; the way back to OP is tried until the run ends.
    let deeds = (0..3000).map(|number| (1000 + number, Deed::Lose)).collect();
    let (ran, seen) = watched(&robot(), Extras { deeds, ..Extras::default() });
    assert!(!ran.finished);
    let lost = Seen {
        allocations: seen.allocations[..3990.min(seen.allocations.len())].to_vec(),
        ..Seen::default()
    };
    allocates_nothing("a lost bus", &lost, 1000);
    allocates_for_the_way_back_alone("a lost bus", &seen, 3990, 200);
}

#[test]
fn a_subdevice_without_power() {
    for (fault, most) in
        [(Fault::PowerOff, 5), (Fault::PowerCycle { off_for: Duration::from_millis(50) }, 200)]
    {
        let what = format!("{fault:?}");
        let deeds = vec![(1500, Deed::Break(1, fault))];
        let (ran, seen) = watched(&robot(), Extras { deeds, ..Extras::default() });
        assert!(!ran.finished);
        assert!(seen.allocations.len() > 1500);
        allocates_for_the_way_back_alone(&what, &seen, 1500, most);
    }
}

#[test]
fn a_stop_from_outside() {
    let (ran, seen) = watched(&robot(), Extras { deeds: vec![(1500, Deed::Stop)], ..Extras::default() });
    assert!(ran.ended.is_ok());
    allocates_nothing("a stop", &seen, 1500);
}

/// What people do with a robot, at which cycle.
fn hands(live: &Live) -> Vec<(u64, Deed)> {
    let send = |ask: fn() -> Ask| {
        let live = live.clone();
        Deed::Do(Box::new(move || assert!(live.send(Client::Joystick, ask()).is_some())))
    };
    const FORWARD: Pad =
        Pad::Held { twist: Twist2 { vx_m_s: 0.3, vy_m_s: 0.0, w_rad_s: 0.1 }, frame: Frame::Odom };
    let mut deeds = vec![(200, send(|| Ask::Robot(RequestKind::Enable)))];
    deeds.extend((500..1500).map(|cycle| (cycle, send(|| Ask::Pad(FORWARD)))));
    deeds.extend([
        (1500, send(|| Ask::Pad(Pad::Released))),
        (2500, send(|| Ask::Robot(RequestKind::Track))),
        (3500, send(|| Ask::Robot(RequestKind::Pause))),
        (4000, send(|| Ask::Robot(RequestKind::Stop(StopCategory::RampAndHold)))),
        // Refused: there is no such setting.
        (4500, send(|| Ask::Robot(RequestKind::Set { index: 9999, value: 1.0, apply: Apply::Now }))),
        (5000, Deed::Stop),
    ]);
    deeds
}

const AGES: Ages = Ages { pad_ns: 200_000_000, session_ns: 500_000_000 };

#[test]
fn requests_of_an_operator() {
    let (hand, end) = live(AGES, StopCategory::RampThenRemove);
    let extras = Extras { deeds: hands(&hand), live: Some(end), ..Extras::default() };
    let (ran, seen) = watched(&robot(), extras);
    assert!(ran.summary.events.len() > 4, "{:?}", ran.summary.events);
    allocates_nothing("an operator", &seen, 4900);
}

/// A pipe that nobody empties, so that its writer waits for ever.
struct FullPipe {
    path: PathBuf,
    reader: File,
}

impl FullPipe {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("omnibase-{name}-{}", std::process::id()));
        assert!(Command::new("mkfifo").arg(&path).status().unwrap().success());
        // For both ways: opening it for one alone waits for the other.
        let reader = File::options().read(true).write(true).open(&path).unwrap();
        FullPipe { path, reader }
    }

    /// Now writers fail.
    fn close(self) {
        std::fs::remove_file(&self.path).unwrap();
        drop(self.reader);
    }
}

#[test]
fn a_recorder_that_is_full() {
    let mut robot = robot();
    let pipe = FullPipe::new("full");
    let rows = Rows::new(robot.plan.drives.len(), Known::Truth);
    let files = RunFiles {
        mcap: None,
        columns: Some(pipe.path.clone()),
        description: std::mem::take(&mut robot.description),
    };
    let (recorder, sink) = RunRecorder::start(&files, rows.schema(), OnFull::Drop).unwrap();
    // The ring holds some 20 s, so the run has to be longer: people rest for a minute.
    let (hand, end) = live(AGES, StopCategory::RampThenRemove);
    let enable = hand.clone();
    let deeds = vec![
        (
            200,
            Deed::Do(Box::new(move || {
                assert!(enable.send(Client::Joystick, Ask::Robot(RequestKind::Enable)).is_some());
            })),
        ),
        (60_000, Deed::Stop),
    ];
    let extras = Extras { deeds, recording: Some((rows, sink)), live: Some(end) };
    let (ran, seen) = watched(&robot, extras);
    assert!(ran.ended.is_ok(), "{:?}", ran.ended);
    pipe.close();
    let recorded = recorder.finish();
    assert!(recorded.failure.is_some(), "the pipe took everything");
    assert!(recorded.dropped > 1000, "the ring was hardly full: {} records dropped", recorded.dropped);
    allocates_nothing("a full recorder", &seen, 59_000);
}
