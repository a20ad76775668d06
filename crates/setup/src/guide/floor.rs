//! On the floor: a metre ahead, and ways against a tape, each while the key is held.

use std::sync::atomic::AtomicBool;

use omnibase_calibrate::{
    Build, Dataset, PlaceSample, Run, SensorMount, Solution, Step as Increment, Tolerances, solve,
};
use omnibase_ethercat::wire::Clock;
use omnibase_platform::{PerWheel, Pose2, Twist2, Wheel};
use omnibase_robot::config::RobotPlan;
use omnibase_robot::estimators::covariance_settings;
use omnibase_robot::signals::{CycleRecord, CycleTime, Frame, Phase, SafetyReason, StopCategory};
use omnibase_robot::{ProcessImage, Registry, Request, RequestKind, Robot};
use omnibase_session::session::Session;

use super::{Guide, Leave, SetupError, in_words};
use crate::dead_man::DeadMan;
use crate::hand::Key;
use crate::jog::enables;
use crate::record::{Leg, Step};
use crate::robot_file;

/// Speeds on the floor: slower than anybody walks.
const SPEED_M_S: f64 = 0.1;
const TURN_SPEED_RAD_S: f64 = 0.25;
/// What the first metre is long, m.
const METRE_M: f64 = 1.0;
/// The longest drive, s; and how long somebody may take to hold the key.
const LONGEST_S: f64 = 60.0;
const WAITING_S: f64 = 60.0;
/// Increments of wheels are kept so often, s.
const KEPT_S: f64 = 0.1;
/// A platform that doesn't move so much of the way that was told went another one.
const LEAST_SHARE: f64 = 0.5;
/// Nor one that turned by so much more, or less, than its wheels say, degrees.
const MOST_TURN_DEG: f64 = 45.0;
/// Wheels and tape differ by so much where nothing is wrong but measures.
const USUAL_SHARE: f64 = 0.05;
/// What a tape on the floor is good for: m, and rad between two marks of the platform.
const TAPE_M: f64 = 2e-3;
const TAPE_RAD: f64 = 5e-3;
/// Control word (IEC 61800-7-201).
const CONTROL_WORD: u16 = 0x6040;

/// One way on the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
struct FloorMotion {
    name: &'static str,
    twist: Twist2,
    /// Until it has gone so far, m or rad by its wheels.
    far: f64,
    words: &'static str,
}

const WAYS: [FloorMotion; 3] = [
    FloorMotion {
        name: "ahead",
        twist: Twist2 { vx_m_s: SPEED_M_S, vy_m_s: 0.0, w_rad_s: 0.0 },
        far: METRE_M,
        words: "the robot drives a metre AHEAD (its x)",
    },
    FloorMotion {
        name: "aside",
        twist: Twist2 { vx_m_s: 0.0, vy_m_s: SPEED_M_S, w_rad_s: 0.0 },
        far: METRE_M,
        words: "the robot drives a metre TO ITS LEFT (its y)",
    },
    FloorMotion {
        name: "round",
        twist: Twist2 { vx_m_s: 0.0, vy_m_s: 0.0, w_rad_s: TURN_SPEED_RAD_S },
        far: core::f64::consts::TAU,
        words: "the robot turns ONCE ON ITS PLACE, to the left",
    },
];

/// What the wheels were expected to be, and what was found.
#[derive(Clone, Debug)]
pub struct Calibrated {
    /// As the file has them.
    pub expected: Build,
    /// How well they were known.
    pub tolerances: Tolerances,
    /// As they are.
    pub solution: Solution,
}

/// How a drive on the floor went.
struct Drive {
    leg: Leg,
    has_arrived: bool,
    is_gone: bool,
    /// Cycles in whose frames a drive was told to be in operation though no key was held; must be 0.
    unheld_cycles: u32,
    words: String,
}

/// Whether some drive is told to be in operation by the bytes that leave next.
fn is_enabled_by(plan: &RobotPlan, image: &mut impl ProcessImage) -> bool {
    plan.drives.iter().enumerate().any(|(wheel, drive)| {
        let mut bit = 0usize;
        for entry in drive.outputs.iter().flat_map(|pdo| &pdo.entries) {
            if entry.index == CONTROL_WORD
                && let Some([low, high, ..]) = image.outputs(wheel).get(bit / 8..)
            {
                return enables([*low, *high]);
            }
            bit += usize::from(entry.bits);
        }
        false
    })
}

/// Why the robot stopped, and which drive did that by what.
fn stopped(plan: &RobotPlan, record: &CycleRecord) -> String {
    let reason = record.stop_reason.text();
    let wheel = record.stop_where as usize;
    match (plan.drives.get(wheel), record.measurements.present().get(wheel)) {
        (Some(drive), Some(said)) if record.stop_reason == SafetyReason::Drive => {
            format!("the robot stopped: {reason}: {}, {}", drive.name, said.error)
        }
        _ => format!("the robot stopped: {reason}"),
    }
}

/// What of findings is of a way that is driven.
fn driven(way: &FloorMotion) -> String {
    format!("way {}", way.name)
}

/// How far it went of what was told: along its way, or round.
fn gone(way: &FloorMotion, pose: Pose2, turned_rad: f64) -> f64 {
    match way.name {
        "round" => turned_rad,
        "aside" => pose.y_m,
        _ => pose.x_m,
    }
}

impl<C: Clock> Guide<'_, C> {
    /// The first metre; `false` where it is left.
    pub(super) fn first_metre(&mut self) -> Result<bool, SetupError> {
        let text = "put the robot down on a free, even floor with two metres of room all round and everybody out of it, a hand on the \
                    emergency stop. Drive the first metre, or go on without?";
        let choices = ["drive", "go on"].map(str::to_owned);
        match self.choose("floor".to_owned(), text.to_owned(), &choices) {
            Err(Leave) => return Ok(false),
            Ok(choice) if choice == "go on" => {
                self.record.pass_over(Step::FirstMetre, None, "the first metre wasn't driven");
                return Ok(true);
            }
            Ok(_) => {}
        }
        if !self.is_as_jogged()? || !self.written.is_empty() && !self.are_as_stored()? {
            return Ok(false);
        }
        let Ok(is_driven) = self.measured(&WAYS[0])? else { return Ok(false) };
        if !is_driven {
            self.record.pass_over(Step::FirstMetre, None, "the first metre wasn't driven to its end");
        }
        Ok(true)
    }

    /// Whoever carried it to the floor may have plugged drives that look alike otherwise; `false` where he leaves, or they are to be jogged
    /// again.
    fn is_as_jogged(&mut self) -> Result<bool, SetupError> {
        let is_known = self.are_in_their_places()?;
        Ok(is_known && self.record.drives.iter().any(|drive| drive.wheel.is_some()))
    }

    /// Every way that wasn't driven yet, then wheels that fit what the tape said; `false` where it is left.
    pub(super) fn calibrate(&mut self) -> Result<bool, SetupError> {
        let text =
            "calibrate by a tape: a metre ahead, a metre aside, once round, each measured; or go on without?";
        let choices = ["calibrate", "go on"].map(str::to_owned);
        match self.choose("calibrate".to_owned(), text.to_owned(), &choices) {
            Err(Leave) => return Ok(false),
            Ok(choice) if choice == "go on" => {
                self.record.takes_calibration = false;
                let why = "not calibrated: `omnibase calibrate` does it at any time";
                self.record.pass_over(Step::Calibration, None, why);
                return Ok(true);
            }
            Ok(_) => {}
        }
        if !self.is_as_jogged()? || !self.written.is_empty() && !self.are_as_stored()? {
            return Ok(false);
        }
        let was_passed_over = self.record.passed_over_of(Step::FirstMetre).is_some();
        for way in WAYS {
            if self.record.legs.iter().any(|leg| leg.name == way.name) {
                continue;
            }
            if self.measured(&way)?.is_err() {
                return Ok(false);
            }
        }
        if was_passed_over && self.record.passed_over_of(Step::FirstMetre).is_none() {
            self.record.note(format!("done: {}", Step::FirstMetre.words()));
        }
        let Some(Calibrated { expected, solution, .. }) = self.calibrated()? else {
            self.record.pass_over(
                Step::Calibration,
                None,
                "not calibrated: not every way was driven to its end",
            );
            return Ok(true);
        };
        for (was, is) in expected.wheels.iter().zip(&solution.build.wheels) {
            let share = is.radius_m / was.radius_m - 1.0;
            let text = format!(
                "{}: radius {:.3} mm, the file has {:.3} ({:+.2} %)",
                is.name,
                1e3 * is.radius_m,
                1e3 * was.radius_m,
                100.0 * share
            );
            self.hand.tell(&text);
            self.record.note(text);
        }
        let text = "take these wheels into the robot's file, or leave them as they were?".to_owned();
        let choices = ["take", "leave them"].map(str::to_owned);
        match self.choose("wheels".to_owned(), text, &choices) {
            Err(Leave) => return Ok(false),
            Ok(choice) => self.record.takes_calibration = choice == "take",
        }
        self.record.make_good(Step::Calibration, None);
        Ok(true)
    }

    /// The wheels that fit the ways on the floor; `None` before all were driven.
    pub fn calibrated(&self) -> Result<Option<Calibrated>, SetupError> {
        if WAYS.iter().any(|way| self.record.legs.iter().all(|leg| leg.name != way.name)) {
            return Ok(None);
        }
        let plan = &self.plan;
        let named = plan.kinematics.wheels().iter().zip(&plan.drives);
        let expected = Build {
            wheels: named.map(|(wheel, drive)| Wheel { name: drive.name.clone(), ..wheel.clone() }).collect(),
            creep: plan.estimator.creep.unwrap_or(0.0),
            roller_resistance: plan.estimator.roller_resistance.unwrap_or(0.03),
            sensor: SensorMount::default(),
            gyro_scale: 0.0,
        };
        let settings = covariance_settings(&plan.estimator);
        let tolerances = Tolerances {
            wheel: settings.geometry,
            creep: 0.0,
            way_m2_per_m: settings.position_per_m,
            way_m2_per_rad: settings.position_per_rad,
            turn_rad2_per_m: settings.heading_per_m,
            turn_rad2_per_rad: settings.heading_per_rad,
            ..Tolerances::default()
        };
        let runs = self.record.legs.iter().map(run_of).collect();
        let solution = solve(&Dataset { runs }, &expected, &tolerances).map_err(|error| in_words(&error))?;
        Ok(Some(Calibrated { expected, tolerances, solution }))
    }

    /// Drives one way as often as it takes, and asks what the tape says; whether it was driven to its end.
    fn measured(&mut self, way: &FloorMotion) -> Result<Result<bool, Leave>, SetupError> {
        loop {
            let drive = self.drive(way)?;
            self.record.note(format!(
                "{}: {}, by its wheels {:.3} m {:.3} m {:.2}°, {} without a held key",
                way.name,
                drive.words,
                drive.leg.told[0],
                drive.leg.told[1],
                drive.leg.told[2].to_degrees(),
                drive.unheld_cycles
            ));
            self.kept();
            if drive.is_gone {
                return Ok(Err(Leave));
            }
            if !drive.has_arrived {
                let text = format!(
                    "it didn't come to its end ({}): drive that again, or go on without?",
                    drive.words
                );
                let choices = ["again", "go on"].map(str::to_owned);
                match self.choose(format!("drive {}", way.name), text, &choices) {
                    Ok(choice) if choice == "again" => continue,
                    Ok(_) => {
                        let text = format!("{}: not driven to its end: {}", way.name, drive.words);
                        self.record.found_of(&driven(way), vec![text]);
                        return Ok(Ok(false));
                    }
                    Err(Leave) => return Ok(Err(Leave)),
                }
            }
            match self.tape(way, drive.leg) {
                Err(Leave) => return Ok(Err(Leave)),
                Ok(None) => {}
                Ok(Some(leg)) => {
                    self.record.legs.retain(|other| other.name != leg.name);
                    self.record.legs.push(leg);
                    self.record.found_of(&driven(way), Vec::new());
                    if *way == WAYS[0] {
                        self.record.make_good(Step::FirstMetre, None);
                    }
                    self.kept();
                    return Ok(Ok(true));
                }
            }
        }
    }

    /// What a tape says of a way; `None` where it is driven again.
    fn tape(&mut self, way: &FloorMotion, mut leg: Leg) -> Result<Option<Leg>, Leave> {
        let choices = ["ahead", "back", "left", "right", "round to the left", "round to the right"];
        let expected = match way.name {
            "aside" => "left",
            "round" => "round to the left",
            _ => "ahead",
        };
        let text = "which way did it go?".to_owned();
        let seen = self.choose(format!("went {}", way.name), text, &choices.map(str::to_owned))?;
        if seen != expected {
            let text = format!(
                "{}: it went {seen} where {expected} was told: its wheels' places or order in `platform` aren't as they are on the robot",
                way.name
            );
            self.tell_found_of(&driven(way), vec![text]);
            let text =
                "drive it again; or leave, put the file that you began with right, and begin anew".to_owned();
            self.choose(format!("wrong {}", way.name), text, &["again".to_owned()])?;
            return Ok(None);
        }
        let [x_m, y_m, turned_rad] = leg.told;
        let text = "by the tape, from mark to mark: how far along its x, m? (a mark below its base before and after)".to_owned();
        let x_m = self.any_number(format!("tape x {}", way.name), text, x_m)?;
        let y_m = self.any_number(
            format!("tape y {}", way.name),
            "how far along its y, to the left, m?".to_owned(),
            y_m,
        )?;
        let text = "how far did it turn to the left, degrees?".to_owned();
        let turned_deg = self.any_number(format!("tape turn {}", way.name), text, turned_rad.to_degrees())?;
        leg.measured = [x_m, y_m, turned_deg.to_radians()];
        let told = gone(way, Pose2::new(leg.told[0], leg.told[1], 0.0), leg.told[2]);
        let share = gone(way, Pose2::new(x_m, y_m, 0.0), leg.measured[2]) / told;
        let aside_m = (x_m - leg.told[0]).hypot(y_m - leg.told[1]);
        let turned_deg = (leg.measured[2] - leg.told[2]).to_degrees();
        let is_far = aside_m > METRE_M * LEAST_SHARE || turned_deg.abs() > MOST_TURN_DEG;
        if !(LEAST_SHARE..=1.0 / LEAST_SHARE).contains(&share) || is_far {
            self.hand.tell(&format!(
                "by the tape it went {share:.2} of what its wheels say, to {aside_m:.3} m and {turned_deg:.1}° from where they say: measure \
                 again, or drive it again"
            ));
            self.choose(format!("wrong {}", way.name), "drive it again?".to_owned(), &["again".to_owned()])?;
            return Ok(None);
        }
        let text = format!(
            "{}: by the tape it went {share:.3} of what its wheels say: radius of the wheels, or gear, aren't as the file has them",
            way.name
        );
        let is_unusual = (share - 1.0).abs() > USUAL_SHARE;
        self.record.found_of(&format!("tape {}", way.name), Vec::from_iter(is_unusual.then_some(text)));
        Ok(Some(leg))
    }

    /// Drives one way while the key is held; let go, the drives lose their torque in the next frame.
    fn drive(&mut self, way: &FloorMotion) -> Result<Drive, SetupError> {
        let registry = Registry::with_built_in();
        let plan = robot_file::plan(&self.text()?, &registry)?;
        // Whoever carried it to the floor may have switched it off, and plugged it otherwise: the file knows no serial numbers.
        let mut bus = self.bus()?;
        self.are_those_found(&bus)?;
        self.put_back(&mut bus);
        drop(bus);
        let (link, clock) = (self.open)().map_err(SetupError::Open)?;
        let mut warnings = Vec::new();
        let mut session = Session::prepare(link, clock, &plan, &mut |words| warnings.push(words))
            .map_err(|error| in_words(&error))?;
        warnings.iter().for_each(|words| self.hand.tell(words));
        session.reach_op(&AtomicBool::new(false)).map_err(|error| in_words(&error))?;
        let mut robot = Robot::build(&plan, &registry).map_err(|error| in_words(&error))?;
        let period_s = 1e-9 * plan.bus.cycle_ns as f64;
        let cycles_of = |seconds: f64| (seconds / period_s).ceil() as u32;
        let [beat, first_beats] = self.wished.key_s.map(cycles_of);
        let mut key = DeadMan::new(beat, first_beats);
        self.hand.take_key(&format!("hold the key: {}", way.words));
        let mut drive = Drive {
            leg: Leg { name: way.name.to_owned(), period_s: KEPT_S, ..Leg::default() },
            has_arrived: false,
            is_gone: false,
            unheld_cycles: 0,
            words: "the key wasn't held".to_owned(),
        };
        let mut wheels = vec![0.0; plan.drives.len()];
        let (mut index, mut begun, mut was_held, mut turned_rad, mut cycles) = (0, None, false, 0.0, 0u32);
        let mut next_kept = cycles_of(KEPT_S);
        let mut request = None;
        let (mut was_enabled, mut is_acknowledged) = (false, false);
        loop {
            let (exchange, times) = session.exchange()?;
            index += times.periods;
            cycles += times.periods as u32;
            let time = CycleTime::on_grid(index, plan.bus.cycle_ns);
            let heard = self.hand.key();
            drive.is_gone |= heard == Key::Gone;
            let held = key.cycle(heard, times.periods);
            was_held |= held;
            let asked: Option<RequestKind> = request.take();
            // What was wished while it was held counts no more once it isn't.
            let asked =
                if held { asked } else { was_held.then_some(RequestKind::Stop(StopCategory::RemoveTorque)) };
            let acknowledges = asked == Some(RequestKind::Acknowledge);
            let asked =
                asked.map(|kind| Request { kind, valid_until_ns: time.now_ns + 2 * plan.bus.cycle_ns });
            let record = *robot.compute(time, exchange, asked, session.image());
            drive.unheld_cycles += u32::from(!held && is_enabled_by(&plan, session.image()));
            let pose = record.state.odom_from_body;
            let from = *begun.get_or_insert(pose);
            let moved = from.inverse().then(pose);
            turned_rad += omnibase_platform::wrap_angle_rad(moved.heading_rad - turned_rad);
            drive.leg.told = [moved.x_m, moved.y_m, turned_rad];
            let said = record.measurements.present();
            wheels.iter_mut().zip(said).for_each(|(sum, one)| *sum += one.increment_rad);
            if cycles >= next_kept {
                next_kept = cycles + cycles_of(KEPT_S);
                drive.leg.turned_rad.push(std::mem::replace(&mut wheels, vec![0.0; plan.drives.len()]));
            }
            self.hand.moves(is_enabled_by(&plan, session.image()), gone(way, moved, turned_rad));
            let has_gone = gone(way, moved, turned_rad) >= way.far;
            drive.has_arrived |= has_gone;
            if was_held && !held || drive.is_gone {
                drive.words = if drive.has_arrived { "driven" } else { "the key was let go" }.to_owned();
                break;
            }
            was_enabled |= matches!(record.phase, Phase::Holding | Phase::Tracking);
            if record.phase == Phase::Fault {
                let words = stopped(&plan, &record);
                if was_enabled || is_acknowledged {
                    drive.words = words;
                    break;
                }
                if !acknowledges {
                    self.hand.remark(&format!("{words}; the held key acknowledges that"));
                }
            }
            is_acknowledged |= acknowledges;
            if cycles > cycles_of(if was_held { WAITING_S + LONGEST_S } else { WAITING_S }) {
                if was_held {
                    drive.words = format!("not there after {LONGEST_S} s: {}", record.phase.name());
                }
                break;
            }
            request = match record.phase {
                Phase::Disabled if !drive.has_arrived => Some(RequestKind::Enable),
                // By a drive that failed before: it was told.
                Phase::Fault => Some(RequestKind::Acknowledge),
                Phase::Holding | Phase::Tracking if !drive.has_arrived => {
                    Some(RequestKind::Velocity { twist: way.twist, frame: Frame::Body })
                }
                Phase::Holding if said.iter().all(|one| one.stands()) => {
                    drive.words = "driven".to_owned();
                    break;
                }
                _ => None,
            };
        }
        self.hand.moves(false, gone(way, Pose2::new(drive.leg.told[0], drive.leg.told[1], 0.0), turned_rad));
        // Without torque until it stands.
        for _ in 0..cycles_of(2.0) {
            let (exchange, times) = session.exchange()?;
            index += times.periods;
            let time = CycleTime::on_grid(index, plan.bus.cycle_ns);
            let stop = Request {
                kind: RequestKind::Stop(StopCategory::RemoveTorque),
                valid_until_ns: time.now_ns + plan.bus.cycle_ns,
            };
            let record = *robot.compute(time, exchange, Some(stop), session.image());
            drive.unheld_cycles += u32::from(is_enabled_by(&plan, session.image()));
            let moved = begun.unwrap_or_default().inverse().then(record.state.odom_from_body);
            turned_rad += omnibase_platform::wrap_angle_rad(moved.heading_rad - turned_rad);
            drive.leg.told = [moved.x_m, moved.y_m, turned_rad];
            let said = record.measurements.present();
            wheels.iter_mut().zip(said).for_each(|(sum, one)| *sum += one.increment_rad);
        }
        drive.leg.turned_rad.push(wheels);
        session.end().map_err(|error| in_words(&error))?;
        Ok(drive)
    }
}

/// A way as a run with two places: where it began, and where the tape found it.
fn run_of(leg: &Leg) -> Run {
    let steps = (1u32..).zip(&leg.turned_rad).map(|(number, turned)| Increment {
        end_s: leg.period_s * f64::from(number),
        turned_rad: PerWheel::from_fn(turned.len(), |wheel| turned[wheel]),
    });
    let steps: Vec<Increment> = steps.collect();
    let end_s = steps.last().map_or(0.0, |step| step.end_s);
    let place = |instant_s, floor_from_base| PlaceSample {
        instant_s,
        floor_from_base,
        sigma_m: TAPE_M,
        sigma_rad: TAPE_RAD,
    };
    let [x_m, y_m, heading_rad] = leg.measured;
    Run {
        name: leg.name.clone(),
        steps,
        places: vec![place(0.0, Pose2::default()), place(end_s, Pose2::new(x_m, y_m, heading_rad))],
        ..Run::default()
    }
}
