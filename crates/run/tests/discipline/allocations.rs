//! No allocation in a running cycle, whatever happens in it.

use std::fs::File;
use std::path::PathBuf;
use std::process::Command;
use std::time::Duration;

use omnibase_ethercat_sim::Fault;
use omnibase_ethercat_sim::pdi::ApplicationFault;
use omnibase_platform::Twist2;
use omnibase_record::run::{OnFull, RunFiles, RunRecorder};
use omnibase_robot::RequestKind;
use omnibase_robot::config::AxisMode;
use omnibase_robot::guard::Obstacle;
use omnibase_robot::signals::{AxisAsk, Batch, Frame, Heard, MAX_SIGNALS, StopCategory};
use omnibase_run::Ran;
use omnibase_run::channels::{Known, Rows};
use omnibase_run::live::{Ages, Ask, Client, Live, StickWish, live};

use super::watched::{Deed, Extras, Observed, robot, robot_of, robot_with, watched};

/// Cycles of the run (from 1) in which something was allocated, and how often.
fn guilty(seen: &Observed) -> Vec<(usize, u64)> {
    let numbered = seen.allocations.iter().enumerate().map(|(number, count)| (number + 2, *count));
    numbered.filter(|(_, count)| *count > 0).collect()
}

#[track_caller]
fn allocates_nothing(what: &str, seen: &Observed, at_least: usize) {
    assert!(seen.allocations.len() >= at_least, "{what}: only {} cycles were seen", seen.allocations.len());
    assert_eq!(guilty(seen), [], "{what}: (cycle, allocations)");
    println!("{what}: no allocation in {} cycles", seen.allocations.len());
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

#[test]
fn a_bus_that_is_lost() {
    // Given up within these cycles; the way back to OP is tried until the run ends.
    let deeds = (0..3000).map(|number| (1000 + number, Deed::Lose)).collect();
    let (ran, seen) = watched(&robot(), Extras { deeds, ..Extras::default() });
    assert!(!ran.finished);
    allocates_nothing("a lost bus", &seen, 1000);
}

/// A run that goes on behind whatever happens to SubDevices, for so many cycles.
#[track_caller]
fn goes_on(what: &str, faults: &[(u64, usize, Fault)], cycles: u64) -> (Ran, Observed) {
    let robot = robot_with(&[
        "safety.after_lost_device = \"move_again_unattended\"",
        "drive_defaults.encoder = \"absolute\"",
    ]);
    let mut deeds: Vec<(u64, Deed)> =
        faults.iter().map(|(when, position, fault)| (*when, Deed::Break(*position, fault.clone()))).collect();
    deeds.push((cycles, Deed::Stop));
    let (ran, seen) = watched(&robot, Extras { deeds, ..Extras::default() });
    allocates_nothing(what, &seen, cycles as usize - 100);
    (ran, seen)
}

/// Seconds until a SubDevice is away for good are fewer than these cycles.
const AWAY: u64 = 1500;

#[test]
fn a_power_cycle_and_the_way_back_to_op() {
    let fault = Fault::PowerCycle { off_for: Duration::from_millis(50) };
    let (ran, _) = goes_on("a power cycle", &[(AWAY, 1, fault)], 6000);
    // In a line whoever is behind it is lost with it.
    let bus = ran.summary.bus;
    assert_eq!((bus.losses, bus.recoveries), (2, 2), "{:?}", ran.summary.events);
}

#[test]
fn a_cable_that_is_pulled_and_put_back() {
    let faults = [(AWAY, 1, Fault::CableCut { port: 1 }), (AWAY + 300, 1, Fault::CableRestored { port: 1 })];
    let (ran, _) = goes_on("a pulled cable", &faults, 6000);
    let bus = ran.summary.bus;
    assert_eq!((bus.losses, bus.recoveries), (1, 1), "{:?}", ran.summary.events);
}

#[test]
fn a_drive_that_leaves_op() {
    let fault = Fault::Application(ApplicationFault::AlError(0x001A));
    let (ran, _) = goes_on("a drive that left OP", &[(AWAY, 2, fault)], 6000);
    let bus = ran.summary.bus;
    assert_eq!((bus.losses, bus.recoveries), (1, 1), "{:?}", ran.summary.events);
}

#[test]
fn another_reference_clock() {
    // So quick that the links behind it are up again: only the reference clock is gone.
    let faults = [(AWAY, 0, Fault::PowerOff), (AWAY, 0, Fault::PowerOn)];
    let (ran, _) = goes_on("another reference clock", &faults, 6000);
    let bus = ran.summary.bus;
    assert_eq!((bus.losses, bus.recoveries, bus.reference_changes), (1, 1, 2), "{:?}", ran.summary.events);
}

#[test]
fn a_way_back_that_fails_again_and_again() {
    // It answers, but its mailbox is dead: each attempt ends at the first SDO, and is told once.
    let faults = [
        (AWAY, 2, Fault::PowerCycle { off_for: Duration::from_millis(50) }),
        (AWAY + 60, 2, Fault::Application(ApplicationFault::MailboxSilence(true))),
        (14_000, 2, Fault::PowerOff),
    ];
    let (ran, _) = goes_on("a way back that fails", &faults, 20_000);
    let events = format!("{:?}", ran.summary.events);
    assert!(events.contains("not taken back"), "{events}");
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
    const FORWARD: StickWish =
        StickWish::Held { twist: Twist2 { vx_m_s: 0.3, vy_m_s: 0.0, w_rad_s: 0.1 }, frame: Frame::Odom };
    let mut deeds = vec![(200, send(|| Ask::Robot(RequestKind::Enable)))];
    deeds.extend((500..1500).map(|cycle| (cycle, send(|| Ask::Stick(FORWARD)))));
    deeds.extend([
        (1500, send(|| Ask::Stick(StickWish::Released))),
        (2500, send(|| Ask::Robot(RequestKind::Track))),
        (3500, send(|| Ask::Robot(RequestKind::Pause))),
        (4000, send(|| Ask::Robot(RequestKind::Stop(StopCategory::RampAndHold)))),
        // Refused: there is no such setting.
        (4500, send(|| Ask::Robot(RequestKind::Set { index: 9999, value: 1.0, batch: Batch::ALONE }))),
        (5000, Deed::Stop),
    ]);
    deeds
}

const AGES: Ages = Ages { stick_ns: 200_000_000, session_ns: 500_000_000 };

#[test]
fn requests_of_an_operator() {
    let (hand, end) = live(AGES, StopCategory::RampThenRemove, &[]);
    let _following = hand.follow().expect("nobody follows yet");
    let extras = Extras { deeds: hands(&hand), live: Some(end), ..Extras::default() };
    let (ran, seen) = watched(&robot(), extras);
    assert!(ran.summary.events.len() > 4, "{:?}", ran.summary.events);
    allocates_nothing("an operator", &seen, 4900);
}

#[test]
fn a_robot_between_a_fence_and_an_obstacle_that_is_dragged() {
    let (hand, end) = live(AGES, StopCategory::RampThenRemove, &[]);
    let drag = |cycle: u64| {
        let (live, y_m) = (hand.clone(), 1e-4 * (cycle - 600) as f64);
        let obstacle = Obstacle { centre_m: [0.75, y_m], radius_m: 0.1, velocity_m_s: [-0.05, 0.0] };
        let ask = move || Ask::Robot(RequestKind::SetObstacle { index: 2, obstacle });
        (cycle, Deed::Do(Box::new(move || assert!(live.send(Client::Joystick, ask()).is_some()))))
    };
    let mut deeds = hands(&hand);
    deeds.extend((600..2000).step_by(33).map(drag));
    deeds.sort_by_key(|(cycle, _)| *cycle);
    let robot = robot_with(&["fence.rectangle_m = [-1.0, -1.0, 1.0, 1.0]"]);
    let (ran, seen) = watched(&robot, Extras { deeds, live: Some(end), ..Extras::default() });
    let is_told = |text: &str| ran.summary.events.iter().any(|event| event.text == text);
    assert!(is_told("an obstacle holds the motion back"), "{:?}", ran.summary.events);
    allocates_nothing("fence and obstacle", &seen, 4900);
}

const SOURCES: &str = "
[[source]]
name = \"mocap\"
carries = \"pose\"
";

#[test]
fn terminals_beside_the_drives_that_are_set_and_lost() {
    let (hand, end) = live(AGES, StopCategory::RampThenRemove, &[]);
    let mut deeds = hands(&hand);
    deeds.extend((300_u32..4900).step_by(41).map(|cycle| {
        let (live, value) = (hand.clone(), f64::from(cycle % 2));
        let ask = move || Ask::Robot(RequestKind::SetOutput { index: 0, value });
        (
            u64::from(cycle),
            Deed::Do(Box::new(move || {
                let _ = live.send(Client::Page(0), ask());
            })),
        )
    }));
    // The page is gone.
    let live = hand.clone();
    let goes = move || {
        let _ = live.send(Client::Page(0), Ask::Gone);
    };
    deeds.push((4600, Deed::Do(Box::new(goes))));
    deeds.push((4700, Deed::Break(3, Fault::PowerOff)));
    deeds.sort_by_key(|(cycle, _)| *cycle);
    let robot = robot_of(include_str!("../../../../robots/bmm_io.toml"), &[]);
    let (_, seen) = watched(&robot, Extras { deeds, live: Some(end), ..Extras::default() });
    allocates_nothing("terminals", &seen, 4900);
}

#[test]
fn programs_that_send_a_thousand_times_a_second() {
    let robot = robot_of(&[include_str!("../../../../robots/bmm.toml"), SOURCES].concat(), &[]);
    let (hand, end) = live(AGES, StopCategory::RampThenRemove, &robot.plan.sources);
    let mut deeds = hands(&hand);
    deeds.extend((300..4700_u64).map(|cycle| {
        let live = hand.clone();
        let send = move || {
            // Two, of which the second one is overtaken.
            for age_ns in [0, 1_000_000] {
                let instant_ns = live.clock_ns() - age_ns;
                let _ = live.send_inputs(0, &Heard { instant_ns, ..Heard::NOTHING });
            }
        };
        (cycle, Deed::Do(Box::new(send)))
    }));
    deeds.sort_by_key(|(cycle, _)| *cycle);
    let (_, seen) = watched(&robot, Extras { deeds, live: Some(end), ..Extras::default() });
    allocates_nothing("programs", &seen, 4900);
    assert!(hand.source_counts()[0].heard > 4000, "{:?}", hand.source_counts());
}

const LIFT: &str = include_str!("../../../../robots/bmm_lift.toml");

/// A robot with a lift, homed at first and then asked in these cycles while the base drives; what is seen of it at last.
fn lifted(
    text: &str,
    asks: &[(u64, AxisAsk)],
    mut deeds: Vec<(u64, Deed)>,
) -> (Ran, Observed, [f64; MAX_SIGNALS]) {
    let (hand, end) = live(AGES, StopCategory::RampThenRemove, &[]);
    let axis = |&(cycle, ask): &(u64, AxisAsk)| (cycle, RequestKind::Axis { device: 1, ask });
    let others = [(200, RequestKind::Enable), (600, RequestKind::Axis { device: 1, ask: AxisAsk::Home })];
    let all = asks.iter().map(axis).chain(others).chain([(3300, RequestKind::Track)]);
    deeds.extend(all.map(|(cycle, kind)| {
        let live = hand.clone();
        let send = move || assert!(live.send(Client::Command, Ask::Robot(kind)).is_some());
        (cycle, Deed::Do(Box::new(send)))
    }));
    deeds.push((5000, Deed::Stop));
    deeds.sort_by_key(|(cycle, _)| *cycle);
    let extras = Extras { deeds, live: Some(end), ..Extras::default() };
    let (ran, seen) = watched(&robot_of(text, &[]), extras);
    (ran, seen, hand.snapshot().record.signals.inputs)
}

#[test]
fn an_axis_that_is_homed_moved_and_lost_beside_the_drives() {
    let asks = [
        (3200, AxisAsk::Move { position: 0.1, mode: AxisMode::Csp }),
        (3600, AxisAsk::Move { position: 0.05, mode: AxisMode::Pp }),
        (4300, AxisAsk::Stop),
        (4400, AxisAsk::Move { position: 0.3, mode: AxisMode::Csp }),
        // Refused: it is outside.
        (4500, AxisAsk::Move { position: 7.0, mode: AxisMode::Csp }),
    ];
    let (_, seen, inputs) = lifted(LIFT, &asks, vec![(4700, Deed::Break(4, Fault::PowerOff))]);
    allocates_nothing("an axis", &seen, 4900);
    // Its position, and that it was homed.
    assert!(inputs[1] > 0.055 && inputs[6] == 1.0, "{inputs:?}");
}

#[test]
fn an_axis_that_fails_and_is_told_of() {
    let text = LIFT.replace("following_error = 0.005", "following_error = 0.000_01");
    let asks = [(3400, AxisAsk::Move { position: 0.3, mode: AxisMode::Csp })];
    let (ran, seen, _) = lifted(&text, &asks, Vec::new());
    allocates_nothing("an axis that fails", &seen, 4900);
    let events = &ran.summary.events;
    assert!(events.iter().any(|event| event.text.starts_with("lift: it was ")), "{events:?}");
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
    let rows = Rows::new(&robot.plan.record_layout(), Known::Truth);
    let files = RunFiles {
        columns: Some(pipe.path.clone()),
        description: std::mem::take(&mut robot.description),
        ..RunFiles::default()
    };
    let (recorder, sink) = RunRecorder::start(&files, rows.schema(), OnFull::Drop).unwrap();
    // The ring holds some 20 s, so the run has to be longer: people rest for a minute.
    let (hand, end) = live(AGES, StopCategory::RampThenRemove, &[]);
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
