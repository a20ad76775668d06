//! Every fault in every state of the robot: what it does, how soon, and where it ends. `docs/fault-matrix.md` is what
//! this prints; `UPDATE_DOCS=1 cargo test -p omnibase-run --test bus matrix` writes it anew.

use std::time::Duration;

use omnibase_ethercat::wire::{Clock, HostTime};
use omnibase_ethercat_sim::pdi::ApplicationFault;
use omnibase_ethercat_sim::{Fault, FaultAction, Injection, Target, VirtualClock, in_process};
use omnibase_platform::Twist2;
use omnibase_robot::RequestKind;
use omnibase_robot::signals::{Frame, Phase, SafetyReason, StopCategory};
use omnibase_robot_sim::SharedMachine;
use omnibase_run::simulated;

use crate::bench::{Bench, plan};

const CIRCLE: &str = "[reference]\nkind = \"circle\"\nradius_m = 0.5\nduration_s = 20.0\n";
/// Slower than this a wheel stands, rad/s.
const STANDING_RAD_S: f64 = 0.02;
/// Cycles that are watched after a fault.
const WATCHED: u64 = 7000;
/// A severe fault must show in what the robot does within so many ms; a dead process in what the drives do.
const NOTICED_MS: u64 = 10;
const WATCHDOG_MS: u64 = 110;

#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Starting,
    Holding,
    Tracking,
    ByHand,
    Stopping,
}

const STATES: [State; 5] = [State::Starting, State::Holding, State::Tracking, State::ByHand, State::Stopping];

/// What a fault has to lead to.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Expected {
    /// The robot goes on as if nothing had been.
    GoesOn,
    /// Every wheel stops, and nothing moves until a person says so.
    Stops,
    /// Every wheel stops where the lost thing commanded; otherwise it goes on.
    StopsByHand,
}

#[derive(Clone, Copy)]
enum Trouble {
    /// Something on the frames to come: an action on so many of them.
    Frames(FaultAction, u64),
    /// Something with a SubDevice.
    Device(usize, fn() -> Fault),
    /// The process dies: nothing is sent any more.
    Killed,
    /// The stick says nothing any more.
    StickSilent,
    /// A wish that is no number.
    NotANumber,
}

const TROUBLES: &[(&str, Trouble, Expected)] = &[
    ("one frame lost", Trouble::Frames(FaultAction::DropAnswer, 1), Expected::GoesOn),
    ("three frames in a row lost", Trouble::Frames(FaultAction::DropRequest, 3), Expected::GoesOn),
    ("ten frames in a row lost", Trouble::Frames(FaultAction::DropRequest, 10), Expected::Stops),
    ("a frame late by two cycles", Trouble::Frames(FaultAction::Delay { frames: 2 }, 1), Expected::GoesOn),
    ("a frame comes twice (foreign)", Trouble::Frames(FaultAction::Duplicate, 1), Expected::GoesOn),
    ("two frames change places", Trouble::Frames(FaultAction::Reorder, 1), Expected::GoesOn),
    ("a working counter short once", Trouble::Frames(FaultAction::ShortCount, 1), Expected::GoesOn),
    ("working counters short for 10 cycles", Trouble::Frames(FaultAction::ShortCount, 10), Expected::Stops),
    (
        "a drive's cable damages two frames",
        Trouble::Device(1, || Fault::CrcErrors { port: 0, frames: 2 }),
        Expected::GoesOn,
    ),
    (
        "a drive leaves OP (0x001A)",
        Trouble::Device(1, || Fault::Application(ApplicationFault::AlError(0x001A))),
        Expected::Stops,
    ),
    ("a drive loses power", Trouble::Device(2, || Fault::PowerOff), Expected::Stops),
    (
        "a drive is power-cycled",
        Trouble::Device(2, || Fault::PowerCycle { off_for: Duration::from_millis(300) }),
        Expected::Stops,
    ),
    (
        "the cable behind drive 1 is pulled",
        Trouble::Device(0, || Fault::CableCut { port: 1 }),
        Expected::Stops,
    ),
    ("the reference clock loses power", Trouble::Device(0, || Fault::PowerOff), Expected::Stops),
    (
        "a drive fault, with its emergency",
        Trouble::Device(1, || Fault::Application(ApplicationFault::DriveFault(0x7500))),
        Expected::Stops,
    ),
    ("the process is killed", Trouble::Killed, Expected::Stops),
    ("the stick falls silent", Trouble::StickSilent, Expected::StopsByHand),
    ("a wish that is no number", Trouble::NotANumber, Expected::StopsByHand),
];

/// A robot in some state, and who drives it.
struct Case {
    bench: Bench,
    machine: SharedMachine,
    clock: VirtualClock,
    by_hand: Option<Twist2>,
}

impl Case {
    fn new(state: State) -> Self {
        let plan = plan(CIRCLE);
        let (segment, machine) = simulated::segment(&plan).unwrap();
        let (link, clock) = in_process(segment);
        let mut case = Case { bench: Bench::with(&plan, link, clock.clone()), machine, clock, by_hand: None };
        match state {
            State::Starting => {
                case.bench.cycle(None);
                case.bench.cycle(Some(RequestKind::Enable));
                case.bench.run(3);
                assert_eq!(case.bench.robot.phase(), Phase::Enabling);
            }
            State::Holding => {
                case.bench.enable();
                case.bench.run(50);
            }
            State::Tracking => {
                case.bench.enable();
                case.bench.cycle(Some(RequestKind::Track));
                case.bench.run(5000);
            }
            State::ByHand => {
                case.bench.enable();
                case.by_hand = Some(Twist2::new(0.3, 0.1, 0.2));
                (0..800).for_each(|_| case.cycle());
            }
            State::Stopping => {
                case.bench.enable();
                case.bench.cycle(Some(RequestKind::Track));
                case.bench.run(5000);
                case.bench.cycle(Some(RequestKind::Stop(StopCategory::RampAndHold)));
                case.bench.run(60);
                assert_eq!(case.bench.robot.phase(), Phase::Stopping);
            }
        }
        case
    }

    fn cycle(&mut self) {
        let request = self.by_hand.map(|twist| RequestKind::Velocity { twist, frame: Frame::Body });
        match request {
            Some(kind) => self.bench.cycle_for(kind, 200_000_000),
            None => self.bench.cycle(None),
        };
    }

    fn fastest_rad_s(&self) -> f64 {
        let machine = self.machine.lock();
        (0..3).map(|wheel| machine.shaft(wheel).speed_rad_s.abs()).fold(0.0, f64::max)
    }

    /// What the trouble leads to: in words, and checked.
    fn suffer(mut self, state: State, name: &str, trouble: Trouble, expected: Expected) -> String {
        match trouble {
            Trouble::Frames(action, count) => {
                let mut link = self.bench.link.0.borrow_mut();
                let next = link.counts().frames;
                for frame in next..next + count {
                    link.inject(Injection { target: Target::Frame(frame), action });
                }
            }
            Trouble::Device(position, fault) => self.bench.inject(position, fault()),
            Trouble::Killed => {}
            Trouble::StickSilent => self.by_hand = None,
            Trouble::NotANumber => {
                self.by_hand = self.by_hand.map(|_| Twist2::new(f64::NAN, 0.0, 0.0));
                if self.by_hand.is_none() {
                    let twist = Twist2::new(f64::NAN, f64::INFINITY, 0.0);
                    self.bench.cycle_for(RequestKind::Velocity { twist, frame: Frame::Body }, 200_000_000);
                }
            }
        }
        let (mut reaction, mut moving_until) = (None, 0);
        for cycle in 1..=WATCHED {
            if matches!(trouble, Trouble::Killed) {
                let next = HostTime(self.clock.now().0 + 1_000_000);
                self.clock.sleep_until(next);
                self.bench.link.0.borrow_mut().inner_mut().segment_mut().advance(next);
                self.machine.lock().advance(next.0);
            } else {
                self.cycle();
                let phase = self.bench.robot.phase();
                let stops = match phase {
                    Phase::Stopping => state != State::Stopping,
                    Phase::QuickStopping | Phase::Fault | Phase::Disabled => true,
                    Phase::Enabling | Phase::Holding | Phase::Tracking => false,
                };
                if stops && reaction.is_none() {
                    reaction = Some((cycle, phase));
                }
            }
            if self.fastest_rad_s() >= STANDING_RAD_S {
                moving_until = cycle;
            }
        }
        let what = format!("{name}, {state:?}");
        let phase = self.bench.robot.phase();
        let stands = self.fastest_rad_s() < STANDING_RAD_S;
        let reason = self.bench.robot.record().stop_reason;
        if matches!(trouble, Trouble::Killed) {
            assert!(stands, "{what}: {} rad/s", self.fastest_rad_s());
            let ramp_ms = moving_until.saturating_sub(WATCHDOG_MS - 10);
            // An SGDV takes missing frames for a loss of synchronisation (A.A12), and its motor is free then.
            assert!(ramp_ms < 3000, "{what}: {moving_until} ms");
            return match moving_until {
                0 => "the drives let go by themselves; stands".to_owned(),
                _ => format!("the drives let go by themselves; wheels stand after {moving_until} ms"),
            };
        }
        let goes_on = match expected {
            Expected::GoesOn => true,
            Expected::Stops => false,
            Expected::StopsByHand => state != State::ByHand,
        };
        if goes_on {
            let end = match state {
                State::Tracking | State::ByHand => Phase::Tracking,
                State::Starting | State::Holding | State::Stopping => Phase::Holding,
            };
            assert_eq!((phase, reaction.map(|(_, phase)| phase)), (end, None), "{what}: {reason:?}");
            return match expected {
                Expected::GoesOn => format!("counted; goes on: {}", words(phase)),
                _ => format!("not concerned: {}", words(phase)),
            };
        }
        assert!(stands, "{what}: {} rad/s in {phase:?}", self.fastest_rad_s());
        let Some((after, first)) = reaction else { panic!("{what}: no reaction, {phase:?}") };
        let by_hand = expected == Expected::StopsByHand;
        // A silent stick is missed when its last word is too old.
        let latest = if by_hand { 200 + NOTICED_MS } else { NOTICED_MS };
        assert!(after <= latest, "{what}: {first:?} only after {after} ms");
        match by_hand {
            true => {
                assert!(matches!(phase, Phase::Holding | Phase::Disabled | Phase::Fault), "{what}: {phase:?}")
            }
            false => assert!(matches!(phase, Phase::Disabled | Phase::Fault), "{what}: {phase:?}"),
        }
        assert_ne!(reason, SafetyReason::None, "{what}");
        let stood = match moving_until {
            0 => "stands".to_owned(),
            _ => format!("wheels stand after {moving_until} ms"),
        };
        format!("{} after {after} ms; {stood}; ends {}", words(first), words(phase))
    }
}

fn words(phase: Phase) -> &'static str {
    match phase {
        Phase::Disabled => "disabled",
        Phase::Enabling => "enabling",
        Phase::Holding => "holding",
        Phase::Tracking => "tracking",
        Phase::Stopping => "ramp down",
        Phase::QuickStopping => "quick stop",
        Phase::Fault => "in fault, torque off",
    }
}

#[test]
fn every_fault_in_every_state_ends_where_the_matrix_says() {
    let mut text = "# The fault matrix\n\nEvery fault in every state of the simulated BMM at 1 kHz, its bus frame by frame, as \
                    `cargo test -p omnibase-run --test bus matrix` runs it; the test writes this page. Policies as they \
                    are where the robot's file says nothing: three lost exchanges are tolerated, then quick stop.\n\n\
                    | fault | starting | holding | tracking | by hand | stopping |\n|---|---|---|---|---|---|\n"
        .to_owned();
    for (name, trouble, expected) in TROUBLES {
        let cells = STATES.map(|state| Case::new(state).suffer(state, name, *trouble, *expected));
        text += &format!("| {name} | {} |\n", cells.join(" | "));
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/fault-matrix.md");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(path, &text).unwrap();
    }
    let shipped = std::fs::read_to_string(path).unwrap_or_default();
    assert!(shipped == text, "run `UPDATE_DOCS=1 cargo test -p omnibase-run --test bus matrix`:\n{text}");
}
