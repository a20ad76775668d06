//! Every fault in every state of the robot: what it does, how soon, who brakes, and where it ends. `docs/fault-matrix.md`
//! is what this prints; `UPDATE_DOCS=1 cargo test -p omnibase-run --test bus matrix` writes it anew.

mod beside;
mod case;
mod comeback;
mod ring;

use std::sync::atomic::AtomicBool;
use std::time::Duration;

use omnibase_ethercat::wire::{Clock, HostTime};
use omnibase_ethercat_sim::device::Piece;
use omnibase_ethercat_sim::device::axis::Load;
use omnibase_ethercat_sim::device::drive::{Drive, DriveKind};
use omnibase_ethercat_sim::pdi::ApplicationFault;
use omnibase_ethercat_sim::{Fault, FaultAction, Injection, Segment, Target, in_process};
use omnibase_platform::Twist2;
use omnibase_robot::signals::{Frame, Phase, SafetyReason, StopCategory};
use omnibase_robot::{RequestKind, RobotPlan};
use omnibase_robot_sim::RobotSim;
use omnibase_run::simulated;
use omnibase_session::session::Session;
use omnibase_session::supervision::BusFigures;

use crate::bench::{Bench, Shared, plan, shared};
use case::{Case, STANDING_RAD_S, STATES, State, words};

pub const CIRCLE: &str = "[reference]\nkind = \"circle\"\nradius_m = 0.5\nduration_s = 12.0\n";
/// Cycles that are watched after a fault, unless all is quiet before.
const WATCHED: u64 = 7000;
/// A robot that is to go on is watched for so long.
const GOES_ON: u64 = 2000;
/// A severe fault must show in what the robot does within so many ms; a dead process in what the drives do.
const NOTICED_MS: u64 = 10;

/// What a fault has to lead to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Expected {
    /// The robot goes on as if nothing had been.
    GoesOn,
    /// Every wheel stops, and nothing moves until a person says so.
    Stops,
    /// The same, but so many ms may pass before it is noticed.
    StopsWithin(u64),
    /// Every wheel stops where the lost thing commanded; otherwise it goes on.
    StopsByHand,
    /// It stops as it was asked to.
    EndsAsAsked,
}

/// What of the figures has to grow by a fault: one that never hits shows nothing.
type Counted = fn(&BusFigures) -> u64;

#[derive(Clone, Copy)]
enum Trouble {
    /// Something on the frames to come: an action on so many of them.
    Frames(FaultAction, u64),
    /// Frames of somebody else.
    Foreign(u32),
    /// Answers that are cut short.
    Short(u32),
    /// The interface loses its carrier for so many frames.
    Carrier(u32),
    /// Something with a SubDevice.
    Device(usize, fn() -> Fault),
    /// One more SubDevice is plugged in behind the last.
    Stranger,
    /// The clock of the last drive is put wrong by so much, ns.
    Clock(i64),
    /// The cycle's thread sleeps so many ms too long.
    Overslept(u64),
    /// The process dies: nothing is sent any more.
    Killed,
    /// The cycle's thread panics: what it owns is dropped.
    Panics,
    /// Somebody ends the run.
    Asked,
    /// The stick says nothing any more.
    StickSilent,
    /// A wish that is no number.
    NotANumber,
}

/// A fault: its name, what it is, what it leads to, and what counts it; `None` where nothing of the bus does.
type Row = (&'static str, Trouble, Expected, Option<Counted>);

const ROWS: &[Row] = &[
    (
        "one frame lost",
        Trouble::Frames(FaultAction::DropAnswer, 1),
        Expected::GoesOn,
        Some(|f| f.frames_lost),
    ),
    (
        "three frames in a row lost",
        Trouble::Frames(FaultAction::DropRequest, 3),
        Expected::GoesOn,
        Some(|f| f.frames_lost),
    ),
    (
        "ten frames in a row lost",
        Trouble::Frames(FaultAction::DropRequest, 10),
        Expected::Stops,
        Some(|f| f.frames_lost),
    ),
    (
        "the carrier is lost for 30 ms",
        Trouble::Carrier(30),
        Expected::Stops,
        Some(|f| f.frames_lost.min(f.silences)),
    ),
    (
        "the carrier is lost for 2 s",
        Trouble::Carrier(2000),
        Expected::Stops,
        Some(|f| f.frames_lost.min(f.silences).min(f.recoveries)),
    ),
    (
        "a frame late by two cycles",
        Trouble::Frames(FaultAction::Delay { frames: 2 }, 1),
        Expected::GoesOn,
        Some(|f| f.frames_late),
    ),
    (
        "a frame comes twice",
        Trouble::Frames(FaultAction::Duplicate, 1),
        Expected::GoesOn,
        Some(|f| f.frames_duplicate + f.frames_late),
    ),
    (
        "two frames change places",
        Trouble::Frames(FaultAction::Reorder, 1),
        Expected::GoesOn,
        Some(|f| f.frames_lost + f.frames_late),
    ),
    ("frames of another MainDevice", Trouble::Foreign(3), Expected::GoesOn, Some(|f| f.frames_foreign)),
    ("an answer cut short", Trouble::Short(1), Expected::GoesOn, Some(|f| f.frames_short)),
    (
        "a working counter short once",
        Trouble::Frames(FaultAction::ShortCount, 1),
        Expected::GoesOn,
        Some(|f| f.working_counter_errors),
    ),
    (
        "two frames damaged on the way out, before drive 2",
        Trouble::Device(1, || Fault::CrcErrors { port: 0, frames: 2 }),
        Expected::GoesOn,
        Some(|f| f.crc_errors),
    ),
    (
        "two frames damaged on the way back, before drive 1",
        Trouble::Device(0, || Fault::CrcErrors { port: 1, frames: 2 }),
        Expected::GoesOn,
        Some(|f| f.crc_errors),
    ),
    (
        "a drive fault, with its emergency",
        Trouble::Device(1, || Fault::Application(ApplicationFault::DriveFault(0x7500))),
        Expected::Stops,
        Some(|f| f.drive_faults.min(f.emergencies)),
    ),
    (
        "a drive's firmware hangs",
        Trouble::Device(1, || Fault::Application(ApplicationFault::Frozen(true))),
        // Its chip's watchdog, and the look at it.
        Expected::StopsWithin(150),
        Some(|f| f.losses),
    ),
    ("one more SubDevice is plugged in", Trouble::Stranger, Expected::GoesOn, Some(|f| f.surplus)),
    ("a drive's clock is 200 us wrong", Trouble::Clock(200_000), Expected::GoesOn, Some(|f| f.clock_strays)),
    ("the cycle comes 2 ms late", Trouble::Overslept(2), Expected::GoesOn, None),
    ("the cycle comes 300 ms late", Trouble::Overslept(300), Expected::Stops, None),
    ("the process is killed", Trouble::Killed, Expected::Stops, None),
    ("the cycle's thread panics", Trouble::Panics, Expected::Stops, None),
    ("Ctrl-C, SIGTERM, the end of the run", Trouble::Asked, Expected::EndsAsAsked, None),
    ("the stick falls silent", Trouble::StickSilent, Expected::StopsByHand, None),
    ("a wish that is no number", Trouble::NotANumber, Expected::StopsByHand, None),
];

/// What `on_lost_device` decides about, for each of its three values.
const LOSSES: &[Row] = &[
    (
        "working counters short for 10 cycles",
        Trouble::Frames(FaultAction::ShortCount, 30),
        Expected::Stops,
        Some(|f| f.working_counter_errors),
    ),
    (
        "a drive leaves OP (0x001A)",
        Trouble::Device(1, || Fault::Application(ApplicationFault::AlError(0x001A))),
        Expected::Stops,
        Some(|f| f.losses),
    ),
    ("a drive loses power", Trouble::Device(2, || Fault::PowerOff), Expected::Stops, Some(|f| f.losses)),
    (
        "a drive is power-cycled",
        Trouble::Device(2, || Fault::PowerCycle { off_for: Duration::from_millis(300) }),
        Expected::Stops,
        Some(|f| f.losses.min(f.recoveries)),
    ),
    (
        "the cable behind drive 1 is pulled",
        Trouble::Device(0, || Fault::CableCut { port: 1 }),
        Expected::Stops,
        Some(|f| f.losses),
    ),
    (
        "the first drive, with the reference clock, loses power: nothing comes back",
        Trouble::Device(0, || Fault::PowerOff),
        Expected::Stops,
        Some(|f| f.losses + f.silences),
    ),
];

/// The three values of `on_lost_device`.
const POLICIES: [&str; 3] = ["quick_stop", "ramp", "remove_torque"];

/// The robot's segment, with a socket behind the last drive into which one more is plugged later.
fn segment(plan: &RobotPlan) -> (Segment, omnibase_robot_sim::SharedMachine) {
    let mut robot = RobotSim::new(&simulated::description(plan)).unwrap();
    let machine = robot.machine.clone();
    robot.sub_devices.push(Drive::new(DriveKind::Generic).build(&Piece::default(), Load::default()));
    let mut segment = Segment::line(robot.sub_devices).unwrap();
    segment.inject(2, Fault::CableCut { port: 1 }).unwrap();
    (segment, machine)
}

fn brought_into(state: State, policy: &str) -> Case<Shared> {
    let plan = plan(&format!("{CIRCLE}\n[safety]\non_lost_device = \"{policy}\"\n"));
    let (segment, machine) = segment(&plan);
    let (link, clock) = in_process(segment);
    Case::new(Bench::with(&plan, link, clock.clone()), machine, clock, state)
}

/// Has something happen to frames or SubDevices from here on.
fn break_something(link: &Shared, trouble: Trouble) {
    match trouble {
        Trouble::Frames(action, count) => {
            let mut link = link.0.borrow_mut();
            let next = link.counts().frames;
            for frame in next..next + count {
                link.inject(Injection { target: Target::Frame(frame), action });
            }
        }
        Trouble::Carrier(frames) => link.1.borrow_mut().down = frames,
        Trouble::Foreign(count) => link.1.borrow_mut().foreign = count,
        Trouble::Short(count) => link.1.borrow_mut().short = count,
        Trouble::Device(position, fault) => {
            link.0.borrow_mut().inner_mut().segment_mut().inject(position, fault()).unwrap();
        }
        Trouble::Stranger => {
            let fault = Fault::CableRestored { port: 1 };
            link.0.borrow_mut().inner_mut().segment_mut().inject(2, fault).unwrap();
        }
        _ => {}
    }
}

impl Case<Shared> {
    /// What the trouble leads to: in words, and checked.
    fn suffer(mut self, (name, trouble, expected, counted): &Row, what: &str) -> String {
        let what = format!("{name}{what}, {:?}", self.state);
        let before = self.bench.session.figures();
        let left_out = self.bench.left_out;
        break_something(&self.bench.link, *trouble);
        match *trouble {
            Trouble::StickSilent => self.by_hand = None,
            Trouble::NotANumber => {
                self.by_hand = self.by_hand.map(|_| Twist2::new(f64::NAN, 0.0, 0.0));
                if self.by_hand.is_none() {
                    let twist = Twist2::new(f64::NAN, f64::INFINITY, 0.0);
                    self.bench.cycle_for(RequestKind::Velocity { twist, frame: Frame::Body }, 200_000_000);
                }
            }
            Trouble::Clock(wrong_ns) => {
                let offset = self.bench.peek(2, 0x0920, 8);
                let offset = i64::from_le_bytes(offset.try_into().unwrap()) + wrong_ns;
                self.bench.write_register(2, 0x0920, &offset.to_le_bytes());
            }
            Trouble::Overslept(ms) => self.let_pass(ms),
            Trouble::Asked => {
                self.by_hand = None;
                self.bench.cycle(Some(RequestKind::Stop(StopCategory::RampThenRemove)));
            }
            _ => {}
        }
        if matches!(trouble, Trouble::Killed | Trouble::Panics) {
            return self.goes_without_program(*trouble, &what);
        }
        let goes_on = match expected {
            Expected::GoesOn => true,
            Expected::Stops | Expected::StopsWithin(_) | Expected::EndsAsAsked => false,
            Expected::StopsByHand => self.state != State::ByHand,
        };
        // Until the carrier is back nobody is known to be out of OP.
        let silent = if let Trouble::Carrier(frames) = *trouble { u64::from(frames) + 100 } else { 0 };
        for ms in 0..if goes_on { GOES_ON } else { WATCHED } {
            self.cycle();
            self.watch();
            let is_back = ms >= silent && self.bench.session.figures().not_operational == 0;
            if self.is_quiet() && is_back {
                break;
            }
        }
        let after = self.bench.session.figures();
        if let Some(counted) = counted {
            assert!(counted(&after) > counted(&before), "{what}: nothing was counted: {after:?}");
        }
        if let Trouble::Overslept(ms) = *trouble {
            assert!(self.bench.left_out - left_out >= ms - 1, "{what}: nothing was left out");
        }
        self.judge(*expected, goes_on, &what)
    }

    fn let_pass(&mut self, ms: u64) {
        let until = HostTime(self.clock.now().0 + ms * 1_000_000);
        self.clock.sleep_until(until);
        self.bench.link.0.borrow_mut().inner_mut().segment_mut().advance(until);
        self.machine.lock().advance(until.0);
    }

    /// Nobody sends anything any more: what the drives do by themselves.
    fn goes_without_program(mut self, trouble: Trouble, what: &str) -> String {
        if matches!(trouble, Trouble::Panics) {
            let plan = plan(CIRCLE);
            // What a panic unwinds: the session is dropped, and with it goes a last word to the drives.
            let spare = Bench::on(&plan, simulated::segment(&plan).unwrap().0);
            drop(std::mem::replace(&mut self.bench.session, spare.session));
        }
        let mut state = 8;
        for ms in 1..=WATCHED {
            self.let_pass(1);
            self.watch();
            if state == 8 {
                let link = self.bench.link.0.borrow();
                let device = &link.inner().segment().sub_devices()[0];
                state = device.esc().peek(0x0130, 1).unwrap()[0] & 0x0F;
                assert!(state != 8 || ms <= 110, "{what}: still in OP after {ms} ms");
            }
        }
        assert!(self.fastest_rad_s() < STANDING_RAD_S, "{what}: {} rad/s", self.fastest_rad_s());
        let seen = *self.watch();
        format!(
            "{}{}; drives in {}",
            seen.who_braked(),
            seen.stands(),
            if state == 4 { "SAFE-OP" } else { "INIT" }
        )
    }
}

impl<L: omnibase_ethercat::wire::Link + Clone> Case<L> {
    /// Whether it came to what was expected, in words.
    pub fn judge(mut self, expected: Expected, goes_on: bool, what: &str) -> String {
        let phase = self.bench.robot.phase();
        let stands = self.fastest_rad_s() < STANDING_RAD_S;
        let reason = self.reason();
        let seen = *self.watch();
        if goes_on {
            let end = match self.state {
                State::Tracking | State::ByHand => Phase::Tracking,
                State::Starting | State::Holding | State::Stopping => Phase::Holding,
            };
            let first = seen.reaction.map(|(_, phase)| phase);
            assert_eq!((phase, first), (end, None), "{what}: {reason:?} {:?}", self.bench.events);
            return match expected {
                Expected::GoesOn => format!("goes on: {}", words(phase)),
                _ => format!("not concerned: {}", words(phase)),
            };
        }
        // A hung drive's motor has the torque that it had last, for ever.
        let can_stand = !matches!(expected, Expected::StopsWithin(_));
        assert!(stands || !can_stand, "{what}: {} rad/s in {phase:?}", self.fastest_rad_s());
        // A stop that is under way already is asked for again: it is the same.
        let (after, first) = seen.reaction.unwrap_or((1, Phase::Stopping));
        assert!(
            seen.reaction.is_some() || expected == Expected::EndsAsAsked,
            "{what}: no reaction, {phase:?}"
        );
        let by_hand = expected == Expected::StopsByHand;
        // A silent stick is missed when its last word is too old.
        let latest = match expected {
            _ if by_hand => 200 + NOTICED_MS,
            Expected::StopsWithin(ms) => ms,
            _ => NOTICED_MS,
        };
        // One that ramps down already does what `ramp` asks for; only its end differs.
        let ramps = self.state == State::Stopping && after > latest;
        assert!(after <= latest || ramps, "{what}: {first:?} only after {after} ms");
        match expected {
            Expected::StopsByHand => {
                assert!(
                    matches!(phase, Phase::Holding | Phase::Disabled | Phase::Fault),
                    "{what}: {phase:?}"
                );
            }
            Expected::EndsAsAsked => assert_eq!(phase, Phase::Disabled, "{what}"),
            _ => assert_eq!(phase, Phase::Fault, "{what}"),
        }
        let is_asked = matches!(reason, SafetyReason::None | SafetyReason::Requested);
        assert_eq!(is_asked, expected == Expected::EndsAsAsked, "{what}: {reason:?}");
        let first = match first {
            _ if ramps => "the ramp goes on",
            Phase::Fault | Phase::Disabled => "torque off",
            first => words(first),
        };
        let first = if ramps { first.to_owned() } else { format!("{first} after {after} ms") };
        let torque = match seen.torque_off_ms {
            Some(ms) if ms > after || ramps => format!(", torque off after {ms} ms"),
            Some(_) => String::new(),
            None => ", torque stays".to_owned(),
        };
        let standing = if stands { seen.stands() } else { "its own motor turns the wheels on".to_owned() };
        format!("{first}; {}{standing}{torque}; {}", seen.who_braked(), words(phase))
    }
}

/// Something breaks between INIT and OP: the start goes on, or it is refused with words, and nobody was enabled.
fn coming_up((name, trouble, ..): &Row) -> String {
    let concerns = match trouble {
        Trouble::Frames(..)
        | Trouble::Carrier(_)
        | Trouble::Foreign(_)
        | Trouble::Short(_)
        | Trouble::Device(..)
        | Trouble::Stranger => true,
        Trouble::Clock(_) | Trouble::Overslept(_) | Trouble::Killed | Trouble::Panics => false,
        Trouble::Asked | Trouble::StickSilent | Trouble::NotANumber => false,
    };
    if !concerns {
        return "nothing is enabled yet".to_owned();
    }
    let plan = plan(CIRCLE);
    let (segment, machine) = segment(&plan);
    let (link, clock) = in_process(segment);
    let link = shared(link);
    let mut session =
        Session::prepare(link.clone(), clock, &plan, &mut |warning| panic!("{warning}")).unwrap();
    // On the way from PRE-OP to SAFE-OP.
    let from = link.0.borrow().counts();
    match *trouble {
        Trouble::Device(position, fault) => {
            link.1.borrow_mut().later = Some((from.frames + 20, position, fault()));
        }
        other => break_something(&link, other),
    }
    let reached = session.reach_op(&AtomicBool::new(false));
    let sent = link.0.borrow().counts();
    match trouble {
        Trouble::Frames(..) => assert!(sent.faults > from.faults, "{name}: it hit nothing"),
        Trouble::Carrier(frames) => assert!(link.1.borrow().down < frames - 10, "{name}: it hit nothing"),
        _ => assert!(sent.frames > from.frames + 20, "{name}: over before it began"),
    }
    drop(session);
    let moved = (0..3).any(|wheel| machine.lock().shaft(wheel).speed_rad_s.abs() > 1e-9);
    assert!(!moved, "{name}: a wheel turned");
    match reached {
        Ok(true) => "reaches OP".to_owned(),
        Ok(false) => unreachable!("nobody asked for a stop"),
        Err(error) => {
            let words = error.to_string();
            assert!(words.len() > 20, "{name}: {words}");
            "no OP: the run ends and says why".to_owned()
        }
    }
}

fn row(row: &Row, policy: &str, label: &str) -> String {
    let cells = STATES.map(|state| brought_into(state, policy).suffer(row, label));
    format!("| {}{label} | {} | {} |\n", row.0, coming_up(row), cells.join(" | "))
}

#[test]
fn every_fault_in_every_state_ends_where_the_matrix_says() {
    let mut jobs: Vec<(&Row, &str, String)> = Vec::new();
    jobs.extend(ROWS.iter().map(|row| (row, "quick_stop", String::new())));
    for row in LOSSES {
        jobs.extend(POLICIES.map(|policy| (row, policy, format!(", `{policy}`"))));
    }
    // Two halves side by side: each case is a world of its own.
    let rows: Vec<String> = std::thread::scope(|scope| {
        let halves: Vec<_> = jobs
            .chunks(jobs.len().div_ceil(2))
            .map(|half| {
                scope.spawn(move || {
                    half.iter().map(|(r, policy, label)| row(r, policy, label)).collect::<Vec<_>>()
                })
            })
            .collect();
        halves.into_iter().flat_map(|half| half.join().unwrap()).collect()
    });
    let mut text = include_str!("matrix/head.md").to_owned();
    text += &rows.concat();
    text += &ring::row();
    text += &beside::rows();
    text += &comeback::rows();
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/fault-matrix.md");
    if std::env::var_os("UPDATE_DOCS").is_some() {
        std::fs::write(path, &text).unwrap();
    }
    let shipped = std::fs::read_to_string(path).unwrap_or_default();
    assert!(shipped == text, "run `UPDATE_DOCS=1 cargo test -p omnibase-run --test bus matrix`:\n{text}");
}
