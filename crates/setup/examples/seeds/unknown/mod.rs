//! A simulated robot of which nobody knows how it is wired, and a person who looks at its wheels.

mod person;

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::atomic::AtomicBool;

use omnibase_ethercat::start_up::SdoAccess;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::{HostTime, Link, LinkError};
use omnibase_ethercat::{Bus, BusOptions};
use omnibase_ethercat_sim::{SimLink, VirtualClock, in_process};
use omnibase_robot::config::{BusPlace, RobotPlan};
use omnibase_robot::{Registry, Robot};
use omnibase_run::run::{Progress, Setup};
use omnibase_run::simulated;
use omnibase_setup::{
    Answer, BackUp, Ended, Guide, Hand, Open, Outside, Question, Record, Step, Wished, robot_file,
};
use person::{Person, World};

/// What the person begins with: a robot's file whose platform is right.
pub const BASE: &str = include_str!("../../../../../robots/bmm.toml");
/// The square that the robot drives in the end.
const SQUARE: &str = "\n[reference]\nkind = \"path\"\npoints = [[0, 0, 0, 0], [5, 2, 0, 0], [10, 2, 2, 0], [15, 0, 2, 0], [20, 0, 0, 0]]\n";
/// On blocks: what the wheels would have to move is light, and they slide on it.
const ON_BLOCKS: &str =
    "[simulation]\nstatic_friction = 0.04\nsliding_friction = 0.035\nmass_kg = 2.0\ninertia_kg_m2 = 0.2\n";
const COUNTS: [u32; 5] = [1 << 20, 1 << 17, 1 << 16, 10_000, 1 << 22];
const GEARS: [f64; 4] = [1.0, 5.0, 10.0, 12.5];

/// How a robot really is.
#[derive(Clone, Debug, PartialEq)]
pub struct Unknown {
    /// Position of each wheel's drive.
    pub positions: [i64; 3],
    /// Whether each wheel's drive counts backwards.
    pub backward: [bool; 3],
    /// Counts per turn of the motor.
    pub counts: u32,
    /// Turns of the motor per turn of the wheel.
    pub gear: f64,
    /// A wheel whose encoder counts against its motor.
    pub turned_encoder: Option<usize>,
    /// What the brake of each position's drive holds, per mille of its motor's rated torque; 0 is none.
    pub brakes: [u16; 3],
}

impl Unknown {
    /// The robot of a seed; every fourth has an encoder that is wired wrongly.
    pub fn of(seed: u64) -> Self {
        let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x5DEE_CE66;
        let mut next = |most: u64| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state % most
        };
        for _ in 0..5 {
            next(2);
        }
        let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
        let positions = orders[next(6) as usize];
        let backward = [next(2) == 1, next(2) == 1, next(2) == 1];
        let (counts, gear) = (COUNTS[next(5) as usize], GEARS[next(4) as usize]);
        let turned_encoder = (next(4) == 0).then(|| next(3) as usize);
        Unknown { positions, backward, counts, gear, turned_encoder, brakes: [0; 3] }
    }

    /// Its file, as nobody has it.
    pub fn text(&self, more: &str) -> String {
        let mut document: toml_edit::DocumentMut = BASE.parse().unwrap();
        let drives = document["drive"].as_array_of_tables_mut().unwrap();
        for (wheel, table) in drives.iter_mut().enumerate() {
            table["position"] = toml_edit::value(self.positions[wheel]);
            table["direction"] = toml_edit::value(if self.backward[wheel] { "backward" } else { "forward" });
            table["counts_per_revolution"] = toml_edit::value(i64::from(self.counts));
            table["gear_ratio"] = toml_edit::value(self.gear);
        }
        format!("{document}\n{more}")
    }

    /// Its file on blocks, and as it stands on its floor.
    pub fn placed(&self, on_blocks: bool) -> String {
        let text = self.text("");
        let on_floor = "[simulation]\nmass_kg = 70.0\ninertia_kg_m2 = 7.0\n";
        if on_blocks { text.replace(on_floor, ON_BLOCKS) } else { text }
    }

    fn plan(&self, on_blocks: bool) -> RobotPlan {
        let mut text = self.placed(on_blocks);
        if let Some(wheel) = self.turned_encoder {
            text = text.replace(
                "[simulation]\n",
                &format!("[simulation]\nturned_encoders = [\"wheel_{}\"]\n", wheel + 1),
            );
        }
        robot_file::plan(&text, &Registry::with_built_in()).unwrap()
    }
}

/// What came of a set-up.
pub struct Found {
    /// The robot's file.
    pub text: String,
    /// The record.
    pub record: Record,
    /// Questions and answers.
    pub asked: Vec<(String, String)>,
    /// What was told.
    #[allow(dead_code, reason = "the example prints figures alone")]
    pub told: Vec<String>,
    /// 0x6072 of each drive in the end.
    #[allow(dead_code, reason = "the example prints figures alone")]
    pub max_torques: Vec<Vec<u8>>,
}

/// Sets the robot up by who answers what is seen, but where `otherwise` has another answer; left once, it is taken up again.
pub fn set_up(
    robot: &Unknown,
    otherwise: &mut dyn FnMut(&Question) -> Option<Answer>,
) -> Result<Found, String> {
    set_up_in(robot, Circumstances::default(), otherwise, &mut |_, _| Ok(()))
}

/// What else is so.
#[derive(Clone, Copy, Default)]
pub struct Circumstances {
    /// In its first drive on the floor the key is let go after so many cycles.
    pub lets_go_at: Option<u32>,
    /// The drive at position 1 fails once while the key is held for what is told so.
    pub fails_while: Option<&'static str>,
    /// The drive at position 1 loses its power once so, until it is asked whether it is jogged, or driven, again.
    pub dark_while: Option<&'static str>,
    /// The emergency stop takes the drives' supply.
    pub stop_takes_supply: bool,
    /// All drives are switched off and on between two sessions.
    pub is_switched_between: bool,
    /// What the wheels' drives are named by already: aliases in their EEPROMs, or switches.
    pub places: Option<[BusPlace; 3]>,
    /// What the file writes to its drives beside the base's own: `, { … }` each.
    pub parameters: &'static str,
}

/// A link that several buses have one after the other.
pub struct SharedLink(pub Rc<RefCell<SimLink>>);

impl Link for SharedLink {
    fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
        self.0.borrow_mut().send(frame)
    }

    fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
        self.0.borrow_mut().receive(buffer, deadline)
    }
}

/// As [`set_up`], under these circumstances; `back_up` keeps an EEPROM before it is written.
pub fn set_up_in(
    robot: &Unknown,
    circumstances: Circumstances,
    otherwise: &mut dyn FnMut(&Question) -> Option<Answer>,
    mut back_up: BackUp<'_>,
) -> Result<Found, String> {
    let Circumstances {
        lets_go_at,
        fails_while,
        dark_while,
        stop_takes_supply,
        is_switched_between,
        places,
        parameters,
    } = circumstances;
    let base = BASE.replace("value = 2_500_000 }", &format!("value = 2_500_000 }}{parameters}"));
    let world = World { robot: robot.clone(), on_floor: false, machine: None, injector: None, pushed: None };
    let world = Rc::new(RefCell::new(world));
    let opened = Rc::clone(&world);
    // What drives know (faults, EEPROMs) outlives whoever opened the bus, until the robot is put down, or its wires are changed.
    let mut kept: Option<(Rc<RefCell<SimLink>>, VirtualClock)> = None;
    let mut was = (false, robot.clone());
    let mut open = move || -> Result<(Box<dyn Link>, VirtualClock), String> {
        let mut world = opened.borrow_mut();
        let is = (world.on_floor, world.robot.clone());
        if std::mem::replace(&mut was, is.clone()) != is {
            kept = None;
        }
        if let Some((link, clock)) = &kept {
            world.lay_hands();
            return Ok((Box::new(SharedLink(Rc::clone(link))), clock.clone()));
        }
        let mut plan = world.robot.plan(!world.on_floor);
        plan.drives
            .iter_mut()
            .zip(places.into_iter().flatten())
            .for_each(|(drive, place)| drive.place = place);
        let (mut segment, machine) = simulated::segment(&plan).map_err(|error| error.to_string())?;
        (world.machine, world.injector) = (Some(machine), Some(segment.injector()));
        world.lay_hands();
        let (link, clock) = in_process(segment);
        let (link, clock) = kept.insert((Rc::new(RefCell::new(link)), clock));
        Ok((Box::new(SharedLink(Rc::clone(link))), clock.clone()))
    };
    let mut person = Person {
        world,
        before: [0.0; 3],
        from: [0.0; 3],
        lets_go_at,
        fails_while,
        dark_while,
        stop_takes_supply,
        cycles: 0,
        what: String::new(),
        asked: Vec::new(),
        otherwise,
        told: Vec::new(),
    };
    let (mut kept, file) = (String::new(), RefCell::new(None));
    for _ in 0..2 {
        let record = if kept.is_empty() { Record::default() } else { Record::from_json(&kept)? };
        let wished = Wished { wheel_speed_rad_s: 3.0, ..Wished::new(base.clone()) };
        let mut keep = |record: &Record| {
            let has_file = file.borrow().is_some();
            assert!(
                has_file || !record.done.contains(&Step::File),
                "its file is written before it is called so"
            );
            kept = record.to_json();
            Ok(())
        };
        let mut write = |record: &Record, text: &str| {
            assert_eq!(
                record.to_be_written.as_deref(),
                Some(text),
                "on record, so that it is known for one's own"
            );
            *file.borrow_mut() = Some(text.to_owned());
            Ok(())
        };
        let outside =
            Outside { hand: &mut person, keep: &mut keep, back_up: &mut back_up, write: &mut write };
        let mut guide = Guide::new(wished, record, &mut open, outside).map_err(|error| error.to_string())?;
        let ended = guide.run().map_err(|error| error.to_string())?;
        let record = guide.record.clone();
        drop(guide);
        if let Ended::File(text) = ended {
            let max_torques = max_torques(&mut open)?;
            return Ok(Found { text, record, asked: person.asked, told: person.told, max_torques });
        }
        if is_switched_between {
            person.switch_off_and_on();
        }
    }
    Err(format!("it didn't end: {:?}, {:?}", person.asked.last(), person.told))
}

/// 0x6072 of each drive.
fn max_torques(open: Open<'_, VirtualClock>) -> Result<Vec<Vec<u8>>, String> {
    let (link, clock) = open()?;
    let mut bus = Bus::new(link, clock, BusOptions::default());
    bus.scan().map_err(|error| error.to_string())?;
    bus.configure(&[]).map_err(|error| error.to_string())?;
    let object = ObjectAddress::new(0x6072, 0);
    let read = |position| bus.sdo_read(position, object, SdoAccess::Entry).map_err(|error| error.to_string());
    (0..3).map(read).collect()
}

/// The same with another hand: how it ended, what was noted, and what `of` tells of the hand.
#[allow(dead_code, reason = "the example has no other hands")]
pub fn set_up_with<H: Hand, T>(
    robot: &Unknown,
    hand: &mut H,
    of: impl FnOnce(&H) -> T,
) -> (Result<Ended, String>, Record, T) {
    let plan = robot.plan(true);
    let mut open = || -> Result<(Box<dyn Link>, VirtualClock), String> {
        let (segment, _) = simulated::segment(&plan).map_err(|error| error.to_string())?;
        let (link, clock) = in_process(segment);
        Ok((Box::new(link), clock))
    };
    let mut keep = |_: &Record| Ok(());
    let wished = Wished { wheel_speed_rad_s: 3.0, ..Wished::new(BASE.to_owned()) };
    let mut back_up = |_: u16, _: &[u8]| Ok(());
    let outside = Outside { hand, keep: &mut keep, back_up: &mut back_up, write: &mut |_, _| Ok(()) };
    let mut guide = Guide::new(wished, Record::default(), &mut open, outside).expect("the base is right");
    let ended = guide.run().map_err(|error| error.to_string());
    let record = guide.record.clone();
    drop(guide);
    (ended, record, of(hand))
}

/// What of a file isn't as the robot is; none where it is right.
pub fn differences(robot: &Unknown, text: &str) -> Vec<String> {
    let registry = Registry::with_built_in();
    let (found, truth) =
        (robot_file::plan(text, &registry).unwrap(), robot_file::plan(&robot.text(""), &registry).unwrap());
    let mut differences = Vec::new();
    for (found, truth) in found.drives.iter().zip(&truth.drives) {
        if (found.place, found.scale.direction) != (truth.place, truth.scale.direction) {
            differences.push(format!("{}: {:?} {:?}", found.name, found.place, found.scale.direction));
        }
        let counts = |plan: &omnibase_robot::config::DrivePlan| {
            (plan.scale.counts_per_revolution, plan.scale.gear_ratio)
        };
        if counts(found) != counts(truth) {
            differences.push(format!("{}: {:?} for {:?}", found.name, counts(found), counts(truth)));
        }
    }
    differences
}

/// Drives the square with this file on the robot as it really is, on its floor; the true RMS error, m.
pub fn drive_square(robot: &Unknown, text: &str) -> Result<f64, String> {
    let registry = Registry::with_built_in();
    let plan = robot_file::plan(&format!("{text}{SQUARE}"), &registry).map_err(|error| error.to_string())?;
    let whole = Unknown { turned_encoder: None, ..robot.clone() };
    let (segment, machine) = simulated::segment(&whole.plan(false)).map_err(|error| error.to_string())?;
    let (link, clock) = in_process(segment);
    let setup = Setup {
        plan: &plan,
        robot: Robot::build(&plan, &registry).map_err(|error| format!("{error:?}"))?,
        machine: Some(machine),
        script: None,
        recording: None,
        live: None,
        stop: &AtomicBool::new(false),
        progress: &Progress::default(),
    };
    let ran = omnibase_run::run(link, clock, setup, &mut |_| {}).map_err(|error| error.to_string())?;
    ran.ended.map_err(|error| error.to_string())?;
    if !ran.finished {
        return Err("the square wasn't finished".to_owned());
    }
    Ok(ran.summary.rms_error_m.truth.unwrap_or(f64::INFINITY))
}
