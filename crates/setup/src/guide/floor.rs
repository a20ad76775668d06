//! On the floor: a metre ahead, and ways against a tape, each while the key is held.

mod driving;

use driving::{Drive, Driving};

use std::sync::atomic::AtomicBool;

use omnibase_calibrate::{
    Build, Dataset, PlaceSample, Run, SensorMount, Solution, Step as Increment, Tolerances, solve,
};
use omnibase_ethercat::wire::Clock;
use omnibase_platform::{PerWheel, Pose2, Twist2, Wheel};
use omnibase_robot::estimators::covariance_settings;
use omnibase_robot::{Registry, Robot};
use omnibase_session::session::Session;

use super::{ATTEMPTS, Guide, Leave, SetupError, in_words};
use crate::record::{Leg, Step};
use crate::robot_file;

/// Speeds on the floor: slower than anybody walks.
const SPEED_M_S: f64 = 0.1;
const TURN_SPEED_RAD_S: f64 = 0.25;
/// What the first metre is long, m.
const METRE_M: f64 = 1.0;
/// A platform that doesn't move so much of the way that was told went another one.
const LEAST_SHARE: f64 = 0.5;
/// Nor one that turned by so much more, or less, than its wheels say, degrees.
const MOST_TURN_DEG: f64 = 45.0;
/// Wheels and tape differ by so much where nothing is wrong but measures.
const USUAL_SHARE: f64 = 0.05;
/// A way that is driven once more begins where there is room for it.
const AGAIN: &str = "put the robot back to where it began, two metres free all round, and drive it again";
/// What a tape on the floor is good for: m, and rad between two marks of the platform.
const TAPE_M: f64 = 2e-3;
const TAPE_RAD: f64 = 5e-3;

/// One way on the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
struct FloorMotion {
    name: &'static str,
    twist: Twist2,
    /// Until it has gone so far, m or rad by its wheels.
    far: f64,
    words: &'static str,
}

impl FloorMotion {
    /// How far it went of what was told, m or rad: along its way, or round.
    fn gone(&self, [x_m, y_m, turned_rad]: [f64; 3]) -> f64 {
        match self.name {
            "round" => turned_rad,
            "aside" => y_m,
            _ => x_m,
        }
    }
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

/// What of findings is of a way that is driven.
fn driven(way: &FloorMotion) -> String {
    format!("way {}", way.name)
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
                let text = format!("it didn't come to its end ({}): {AGAIN}, or go on without?", drive.words);
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
            let text = format!(
                "{AGAIN}; or leave, put the file that you began with right, and begin anew; or shall it be asked again, for that was said by mistake?"
            );
            return match self.choose(
                format!("wrong {}", way.name),
                text,
                &["again", "ask again"].map(str::to_owned),
            )? {
                choice if choice == "again" => Ok(None),
                _ => self.tape(way, leg),
            };
        }
        self.record.found_of(&driven(way), Vec::new());
        for _ in 0..ATTEMPTS {
            let text = "by the tape, from mark to mark: how far along its x, m? (a mark below its base before and after)";
            let x_m = self.measure(format!("tape x {}", way.name), text.to_owned())?;
            let text = "how far along its y, to the left, m?".to_owned();
            let y_m = self.measure(format!("tape y {}", way.name), text)?;
            let text = "how far did it turn to the left, degrees?".to_owned();
            let turned_deg = self.measure(format!("tape turn {}", way.name), text)?;
            leg.measured = [x_m, y_m, turned_deg.to_radians()];
            let share = way.gone(leg.measured) / way.gone(leg.told);
            let aside_m = (x_m - leg.told[0]).hypot(y_m - leg.told[1]);
            let turned_deg = (leg.measured[2] - leg.told[2]).to_degrees();
            let is_far = aside_m > METRE_M * LEAST_SHARE || turned_deg.abs() > MOST_TURN_DEG;
            if (LEAST_SHARE..=1.0 / LEAST_SHARE).contains(&share) && !is_far {
                let text = format!(
                    "{}: by the tape it went {:.1} % of what its wheels say: radius of the wheels, or gear, aren't as the file has them",
                    way.name,
                    100.0 * share
                );
                let is_unusual = (share - 1.0).abs() > USUAL_SHARE;
                self.record
                    .found_of(&format!("tape {}", way.name), Vec::from_iter(is_unusual.then_some(text)));
                return Ok(Some(leg));
            }
            let text = format!(
                "by the tape it went {:.0} % of what its wheels say, and stands {aside_m:.3} m and {turned_deg:.1}° beside where they say: \
                 measure again; or {AGAIN}?",
                100.0 * share
            );
            let choices = ["measure", "again"].map(str::to_owned);
            if self.choose(format!("wrong {}", way.name), text, &choices)? == "again" {
                return Ok(None);
            }
        }
        Err(Leave)
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
        let robot = Robot::build(&plan, &registry).map_err(|error| in_words(&error))?;
        let mut driving = Driving::new(session, robot, &plan, way);
        driving.while_held(&mut *self.hand, self.wished.key_s)?;
        driving.end()
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
