//! The steps, one after the other.

mod at_start;
mod brakes;
mod floor;
mod jogging;
mod naming;
mod operational;
mod reading;

pub use floor::Calibrated;

use std::time::Duration;

use omnibase_ethercat::subdevice::SubDevice;
use omnibase_ethercat::wire::{Clock, Link, LinkError};
use omnibase_robot::Registry;
use omnibase_robot::config::{DrivePlan, DriveScale, Identity, RobotPlan, SpeedUnit};

use crate::hand::{Answer, Hand, Question};
use crate::record::{FoundDrive, Record, Step};
use crate::robot_file::{self, RobotFileError};

/// What is known before, and how the drives are turned.
#[derive(Clone, Debug)]
pub struct Wished {
    /// A robot's file whose platform, limits and names of wheels hold; what it says of drives is to be confirmed.
    pub base: String,
    /// The cycle.
    pub cycle: Duration,
    /// Speed of a wheel while it is jogged, rad/s.
    pub wheel_speed_rad_s: f64,
    /// Torque while it is jogged, per mille of the motor's rated.
    pub torque_per_mille: u16,
    /// The longest motion, s.
    pub longest_s: f64,
    /// How long a beat of the key counts, s; and how far its first two may be apart.
    pub key_s: [f64; 2],
}

impl Wished {
    /// Slowly and gently: half a radian per second, a tenth of the rated torque, at most a minute.
    pub fn new(base: String) -> Self {
        Wished {
            base,
            cycle: Duration::from_millis(1),
            wheel_speed_rad_s: 0.5,
            torque_per_mille: 100,
            longest_s: 60.0,
            key_s: [0.25, 1.0],
        }
    }
}

/// Why a set-up can't go on.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// The segment can't be opened.
    #[error("{0}")]
    Open(String),
    /// The bus refuses.
    #[error("{0}")]
    Bus(String),
    /// The port is broken.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// Other drives are there than were found.
    #[error(
        "this set-up found {expected} at position {position}, now there is {found}: plug and power it as it was and take the \
         set-up up again, or begin a new one"
    )]
    Changed {
        /// Position on the bus.
        position: u16,
        /// Who was there.
        expected: String,
        /// Who is.
        found: String,
    },
    /// It was begun with another robot's file.
    #[error(
        "this set-up was begun with the file of a robot with other wheels, or at other places: give that one, or begin anew"
    )]
    OtherRobot,
    /// There are fewer drives than wheels.
    #[error("the file has {wheels} wheels, on the bus are {drives} drives of the profile CiA 402")]
    TooFewDrives {
        /// Wheels of the file.
        wheels: usize,
        /// Drives found.
        drives: usize,
    },
    /// The file.
    #[error(transparent)]
    File(#[from] RobotFileError),
}

/// What became of a set-up.
#[derive(Clone, Debug, PartialEq)]
pub enum Ended {
    /// It is done: the robot's file.
    File(String),
    /// It was left, and can be taken up again from its record; the robot's file as far as it is known.
    Left(Option<String>),
}

/// Keeps the bytes of an EEPROM somewhere, by the position of its SubDevice; an error says in words why it couldn't.
pub type BackUp<'a> = &'a mut dyn FnMut(u16, &[u8]) -> Result<(), String>;

/// Keeps a record somewhere; an error says in words why it couldn't.
pub type Keep<'a> = &'a mut dyn FnMut(&Record) -> Result<(), String>;

/// A way to the segment: link and clock, as often as it is asked for.
pub type Open<'a, C> = &'a mut dyn FnMut() -> Result<(Box<dyn Link>, C), String>;

/// The set-up of one robot.
pub struct Guide<'a, C: Clock> {
    pub(crate) wished: Wished,
    pub(crate) plan: RobotPlan,
    pub(crate) open: Open<'a, C>,
    pub(crate) hand: &'a mut dyn Hand,
    /// What was found and done so far.
    pub record: Record,
    /// Called with the record after each thing that was done.
    pub(crate) keep: Keep<'a>,
    pub(crate) back_up: BackUp<'a>,
    /// A drive was in OP since what jogs write over was put back.
    has_jogged: bool,
}

/// Who stands outside of a set-up.
pub struct Outside<'a> {
    /// Whoever answers, and holds the key.
    pub hand: &'a mut dyn Hand,
    /// Called with the record after each thing that was done.
    pub keep: Keep<'a>,
    /// Keeps what an EEPROM held, of the SubDevice at this position, before it is written; an error leaves it unwritten.
    pub back_up: BackUp<'a>,
}

/// Answers that aren't one, after which the set-up is left: a program that can't answer would be asked for ever.
const ATTEMPTS: u32 = 20;

/// A drive by the numbers that tell it from others.
pub(crate) fn who(drive: &FoundDrive) -> String {
    let FoundDrive { vendor_id, product_code, serial, .. } = drive;
    let alias = drive.alias.map_or(String::new(), |alias| format!(" alias {alias}"));
    let shown = drive.identification.map_or(String::new(), |number| format!(" identification {number}"));
    format!("vendor 0x{vendor_id:08x} product 0x{product_code:08x} serial {serial}{alias}{shown}")
}

/// Whether somebody may be the drive that was found: it has its numbers, or the alias that was written into it meanwhile.
pub(crate) fn is_it(was: &FoundDrive, now: &FoundDrive) -> bool {
    let numbers = |one: &FoundDrive| (one.vendor_id, one.product_code, one.serial);
    let has_alias = now.alias == was.alias || was.written_alias.is_some() && now.alias == was.written_alias;
    let shows = was.identification.is_none() || now.identification == was.identification;
    numbers(was) == numbers(now) && has_alias && shows
}

/// A SubDevice by what tells it from others.
pub(crate) fn seen(one: &SubDevice) -> FoundDrive {
    FoundDrive {
        position: one.position,
        name: one.name.clone(),
        vendor_id: one.identity.vendor_id,
        product_code: one.identity.product_code,
        revision: one.identity.revision,
        serial: one.identity.serial,
        alias: one.alias,
        identification: one.identification,
        ..FoundDrive::default()
    }
}

/// What the bus says no to.
pub(crate) fn in_words(error: &dyn std::fmt::Display) -> SetupError {
    SetupError::Bus(error.to_string())
}

/// A step that was left half-way.
pub(crate) struct Leave;

/// Which numbers are an answer.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Range {
    Within(f64, f64),
    Any,
}

impl Range {
    fn holds(self, number: f64) -> bool {
        match self {
            Range::Within(least, most) => (least..=most).contains(&number),
            Range::Any => number.is_finite(),
        }
    }

    fn words(self) -> String {
        match self {
            Range::Within(least, most) => format!("a number from {least} to {most}"),
            Range::Any => "a number".to_owned(),
        }
    }
}

impl<'a, C: Clock> Guide<'a, C> {
    /// A set-up from the beginning, or from where `record` left it.
    pub fn new(
        wished: Wished,
        record: Record,
        open: Open<'a, C>,
        Outside { hand, keep, back_up }: Outside<'a>,
    ) -> Result<Self, SetupError> {
        let plan = robot_file::plan(&wished.base, &Registry::with_built_in())?;
        Ok(Guide { wished, plan, open, hand, record, keep, back_up, has_jogged: false })
    }

    /// Keeps what was found so far; whoever can't is told at once, for nobody wants to find it all again.
    pub(crate) fn kept(&mut self) {
        if let Err(error) = (self.keep)(&self.record) {
            self.hand.tell(&format!("what was found so far can't be kept: {error}"));
        }
    }

    /// Every step that isn't done yet. However it ends, what jogs wrote over in the drives is put back.
    pub fn run(&mut self) -> Result<Ended, SetupError> {
        let robot = self.robot();
        match &self.record.robot {
            Some(begun) if *begun != robot => return Err(SetupError::OtherRobot),
            _ => self.record.robot = Some(robot),
        }
        let ended = self.steps();
        if self.has_jogged {
            self.leave_as_found();
        }
        ended
    }

    /// The robot that the file means: what was seen counts against its wheels and their places.
    fn robot(&self) -> String {
        let names: Vec<&str> = self.plan.drives.iter().map(|drive| drive.name.as_str()).collect();
        format!("{names:?} {:?}", self.plan.kinematics.wheels())
    }

    fn steps(&mut self) -> Result<Ended, SetupError> {
        for step in Step::ALL {
            if self.record.done.contains(&step) {
                self.hand.step(step, true);
                // Who was there must be there still.
                if step == Step::Find {
                    self.compare()?;
                    if !self.are_in_their_places()? {
                        return Ok(Ended::Left(None));
                    }
                }
                continue;
            }
            self.hand.step(step, false);
            let done = match step {
                Step::Find => self.find().map(|()| true)?,
                Step::Jog => self.jog_all()?,
                Step::Enable => self.enable_all()?,
                Step::SafeTorqueOff => self.stop_all()?,
                Step::Parameters => self.parameters()?,
                Step::Name => self.name_all()?,
                Step::Brake => self.brakes()?,
                Step::File => self.text().map(|_| true)?,
                Step::FirstMetre => self.first_metre()?,
                Step::Calibration => self.calibrate()?,
            };
            if !done {
                self.kept();
                let has_file = self.record.done.contains(&Step::File);
                return Ok(Ended::Left(if has_file { Some(self.text()?) } else { None }));
            }
            self.finish(step);
        }
        Ok(Ended::File(self.text()?))
    }

    /// The robot's file, of what was found so far.
    fn text(&self) -> Result<String, SetupError> {
        Ok(robot_file::write(&self.wished.base, &self.record, &Registry::with_built_in())?)
    }

    fn finish(&mut self, step: Step) {
        self.record.note(format!("done: {}", step.words()));
        if !self.record.done.contains(&step) {
            self.record.done.push(step);
        }
        self.kept();
    }

    /// An answer among the choices, asked again until it is one; `Err` where somebody leaves. Nothing said is an answer only where
    /// there is nothing to choose.
    pub(crate) fn choose(&mut self, id: String, text: String, choices: &[String]) -> Result<String, Leave> {
        let default = choices.first().filter(|_| choices.len() == 1).cloned();
        let question = Question { id, text, choices: choices.to_vec(), default };
        for _ in 0..ATTEMPTS {
            match self.hand.ask(&question) {
                Answer::Leave => return Err(Leave),
                Answer::Said(said) if said.trim().is_empty() && question.default.is_some() => {
                    return Ok(question.default.unwrap_or_default());
                }
                Answer::Said(said) if choices.iter().any(|choice| choice == said.trim()) => {
                    return Ok(said.trim().to_owned());
                }
                Answer::Said(said) => {
                    self.hand.tell(&format!(
                        "expected one of {}, found \"{}\"",
                        choices.join(", "),
                        said.trim()
                    ));
                }
            }
        }
        Err(Leave)
    }

    /// A number above zero, asked again until it is one.
    pub(crate) fn number(
        &mut self,
        id: String,
        text: String,
        default: f64,
        [least, most]: [f64; 2],
    ) -> Result<f64, Leave> {
        self.number_of(id, text, default, Range::Within(least, most))
    }

    /// Any number, asked again until it is one.
    pub(crate) fn any_number(&mut self, id: String, text: String, default: f64) -> Result<f64, Leave> {
        // As a tape is read.
        let default = (default * 1e3).round() / 1e3;
        self.number_of(id, text, default, Range::Any)
    }

    fn number_of(&mut self, id: String, text: String, default: f64, range: Range) -> Result<f64, Leave> {
        let question = Question { id, text, choices: Vec::new(), default: Some(default.to_string()) };
        for _ in 0..ATTEMPTS {
            match self.hand.ask(&question) {
                Answer::Leave => return Err(Leave),
                Answer::Said(said) if said.trim().is_empty() => return Ok(default),
                Answer::Said(said) => match said.trim().parse::<f64>() {
                    Ok(number) if range.holds(number) => return Ok(number),
                    _ => self.hand.tell(&format!("expected {}, found \"{}\"", range.words(), said.trim())),
                },
            }
        }
        Err(Leave)
    }

    /// What the file has of this drive: that of its wheel, or, before it was seen which that is, the one of its product by which
    /// it is told the least speed.
    pub(crate) fn scale_of(&self, drive: &FoundDrive) -> DriveScale {
        let plans = &self.plan.drives;
        if let Some(plan) = plans.iter().find(|plan| drive.wheel.as_ref() == Some(&plan.name)) {
            return plan.scale;
        }
        let of_product: Vec<DriveScale> =
            plans.iter().filter(|plan| is_product(plan, drive)).map(|plan| plan.scale).collect();
        let all = plans.iter().map(|plan| plan.scale);
        let candidates = if of_product.is_empty() { all.collect() } else { of_product };
        let told = |scale: &DriveScale| units_s(scale, expected_counts(scale, drive), drive);
        let slowest = candidates.into_iter().min_by(|one, other| told(one).total_cmp(&told(other)));
        slowest.unwrap_or(plans[0].scale)
    }

    /// Counts per turn of a wheel as far as they are known: by the drive, else by the file.
    pub(crate) fn expected_counts(&self, drive: &FoundDrive) -> f64 {
        expected_counts(&self.scale_of(drive), drive)
    }

    /// Speed in the drive's units, of so many counts per second.
    pub(crate) fn speed_units(&self, counts_s: f64, drive: &FoundDrive) -> i32 {
        (units_s(&self.scale_of(drive), counts_s, drive).round() as i32).max(1)
    }
}

/// Whether the file means this product, as far as it names one.
pub(crate) fn is_product(plan: &DrivePlan, drive: &FoundDrive) -> bool {
    is_identity(&plan.identity, drive.vendor_id, drive.product_code)
}

/// Whether the file's vendor and product, as far as it has them, are these.
fn is_identity(wanted: &Identity, vendor_id: u32, product_code: u32) -> bool {
    wanted.vendor_id.is_none_or(|wanted| wanted == vendor_id)
        && wanted.product_code.is_none_or(|wanted| wanted == product_code)
}

fn expected_counts(scale: &DriveScale, drive: &FoundDrive) -> f64 {
    let counts = drive.told_counts.unwrap_or(f64::from(scale.counts_per_revolution));
    counts * drive.told_gear.unwrap_or(scale.gear_ratio)
}

fn units_s(scale: &DriveScale, counts_s: f64, drive: &FoundDrive) -> f64 {
    let counts = drive.told_counts.unwrap_or(f64::from(scale.counts_per_revolution));
    match scale.speed_unit {
        SpeedUnit::CountsS => counts_s,
        SpeedUnit::Rpm => counts_s / counts * 60.0,
        SpeedUnit::MilliRpm => counts_s / counts * 60_000.0,
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;
    use std::rc::Rc;

    use omnibase_ethercat::wire::{HostTime, LinkError};

    use super::*;

    struct Nobody;

    impl Hand for Nobody {
        fn ask(&mut self, _: &Question) -> Answer {
            Answer::Leave
        }

        fn tell(&mut self, _: &str) {}

        fn take_key(&mut self, _: &str) {}

        fn key(&mut self) -> crate::Key {
            crate::Key::Gone
        }
    }

    /// A file with two products: a drive is told the speed of its own wheel or product, and the least where neither is known.
    #[test]
    fn each_drive_has_its_own_scale() {
        const BASE: &str = include_str!("../../../robots/bmm.toml");
        let mut document: toml_edit::DocumentMut = BASE.parse().unwrap();
        let drives = document["drive"].as_array_of_tables_mut().unwrap();
        for (table, (gear, product)) in drives.iter_mut().zip([(10.0, 1), (1.0, 2), (5.0, 2)]) {
            table["gear_ratio"] = toml_edit::value(gear);
            table["product_code"] = toml_edit::value(format!("0x{product}"));
        }
        let (mut hand, mut keep) = (Nobody, |_: &Record| Ok(()));
        let mut open = || -> Result<(Box<dyn Link>, omnibase_ethercat_sim::VirtualClock), String> {
            Err("nothing is opened".to_owned())
        };
        let mut back_up = |_: u16, _: &[u8]| Ok(());
        let outside = Outside { hand: &mut hand, keep: &mut keep, back_up: &mut back_up };
        let guide =
            Guide::new(Wished::new(document.to_string()), Record::default(), &mut open, outside).unwrap();
        let gear = |wheel: Option<&str>, product_code| {
            let identity = guide.plan.drives[0].identity;
            let drive = FoundDrive {
                wheel: wheel.map(str::to_owned),
                vendor_id: identity.vendor_id.unwrap_or_default(),
                product_code,
                ..FoundDrive::default()
            };
            guide.scale_of(&drive).gear_ratio
        };
        assert_eq!([1, 2, 3].map(|product| gear(None, product)), [10.0, 1.0, 1.0]);
        assert_eq!(["wheel_1", "wheel_2", "wheel_3"].map(|wheel| gear(Some(wheel), 2)), [10.0, 1.0, 5.0]);
    }

    /// Drives are known by what tells them apart; an alias that was written counts as its own.
    #[test]
    fn a_drive_is_known_by_its_numbers_alias_and_switch() {
        let was = FoundDrive { serial: 1, alias: Some(5), written_alias: Some(7), ..FoundDrive::default() };
        let with = |alias| FoundDrive { alias, written_alias: None, ..was.clone() };
        assert!(is_it(&was, &with(Some(5))) && is_it(&was, &with(Some(7))));
        assert!(!is_it(&was, &with(Some(6))) && !is_it(&was, &with(None)));
        assert!(!is_it(&was, &FoundDrive { serial: 2, ..was.clone() }));
        let shows = |identification| FoundDrive { identification, ..was.clone() };
        assert!(is_it(&was, &shows(Some(3))), "a switch that wasn't chosen");
        assert!(!is_it(&shows(Some(3)), &shows(Some(4))));
    }

    /// An alias that was written is believed once its drive alone has it: who is no drive has it, too.
    #[test]
    fn a_written_alias_that_another_has_is_not_believed() {
        const BASE: &str = include_str!("../../../robots/bmm.toml");
        let segment = |alias_of_another: u16| {
            let text = format!(
                "[[subdevice]]\nkind = \"servo\"\nalias = 7\n[[subdevice]]\nkind = \"servo\"\ncount = 2\n\
                 [[subdevice]]\nkind = \"digital-io\"\ninputs = 8\nalias = {alias_of_another}\n"
            );
            omnibase_ethercat_sim::SegmentFile::parse(&text)
                .unwrap()
                .build(std::path::Path::new("."))
                .unwrap()
        };
        for (another, expected) in [(8, (Some(7), None)), (7, (None, Some(7)))] {
            let mut open = || -> Result<(Box<dyn Link>, omnibase_ethercat_sim::VirtualClock), String> {
                let (link, clock) = omnibase_ethercat_sim::in_process(segment(another));
                Ok((Box::new(link), clock))
            };
            let (mut hand, mut keep, mut back_up) =
                (Doubting(Vec::new()), |_: &Record| Ok(()), |_: u16, _: &[u8]| Ok(()));
            let outside = Outside { hand: &mut hand, keep: &mut keep, back_up: &mut back_up };
            let mut guide =
                Guide::new(Wished::new(BASE.to_owned()), Record::default(), &mut open, outside).unwrap();
            guide.find().unwrap();
            (guide.record.drives[0].alias, guide.record.drives[0].written_alias) = (None, Some(7));
            guide.compare().unwrap();
            let drive = &guide.record.drives[0];
            assert_eq!((drive.alias, drive.written_alias), expected, "the other one has {another}");
        }
    }

    /// Says that drives may have been swapped.
    struct Doubting(Vec<String>);

    impl Hand for Doubting {
        fn ask(&mut self, question: &Question) -> Answer {
            self.0.push(question.text.clone());
            Answer::Said("jog again".to_owned())
        }

        fn tell(&mut self, _: &str) {}

        fn take_key(&mut self, _: &str) {}

        fn key(&mut self) -> crate::Key {
            crate::Key::Gone
        }
    }

    /// Nobody knows whether drives that look alike were swapped while the set-up was left: it is asked, and they are jogged again.
    #[test]
    fn drives_that_look_alike_are_jogged_again_where_nobody_knows_their_places() {
        const BASE: &str = include_str!("../../../robots/bmm.toml");
        let plan = robot_file::plan(BASE, &Registry::with_built_in()).unwrap();
        let mut open = || -> Result<(Box<dyn Link>, omnibase_ethercat_sim::VirtualClock), String> {
            let (segment, _) = omnibase_run::simulated::segment(&plan).map_err(|error| error.to_string())?;
            let (link, clock) = omnibase_ethercat_sim::in_process(segment);
            Ok((Box::new(link), clock))
        };
        let (mut hand, mut keep, mut back_up) =
            (Doubting(Vec::new()), |_: &Record| Ok(()), |_: u16, _: &[u8]| Ok(()));
        let outside = Outside { hand: &mut hand, keep: &mut keep, back_up: &mut back_up };
        let mut guide =
            Guide::new(Wished::new(BASE.to_owned()), Record::default(), &mut open, outside).unwrap();
        guide.find().unwrap();
        guide.record.done = vec![Step::Find, Step::Jog, Step::Name];
        for (drive, serial) in guide.record.drives.iter_mut().zip([0, 0, 9]) {
            (drive.wheel, drive.serial) = (Some(format!("wheel_{}", drive.position + 1)), serial);
        }
        assert!(guide.are_in_their_places().unwrap());
        assert_eq!(guide.record.done, [Step::Find]);
        assert!(guide.record.drives.iter().all(|drive| drive.wheel.is_none()));
        assert!(hand.0.len() == 1 && hand.0[0].contains("SubDevices 0, 1 from others"), "{:?}", hand.0);
    }

    /// Keeps what is sent.
    struct Kept {
        link: omnibase_ethercat_sim::SimLink,
        sent: Rc<RefCell<Vec<Vec<u8>>>>,
    }

    impl Link for Kept {
        fn send(&mut self, frame: &[u8]) -> Result<(), LinkError> {
            self.sent.borrow_mut().push(frame.to_vec());
            self.link.send(frame)
        }

        fn receive(&mut self, buffer: &mut [u8], deadline: HostTime) -> Result<Option<usize>, LinkError> {
            self.link.receive(buffer, deadline)
        }
    }

    /// What the file has written at every start is written for a jog, too, where every drive of the product has it.
    #[test]
    fn a_jog_begins_as_the_robot_does() {
        const BASE: &str = include_str!("../../../robots/bmm.toml");
        let of_all =
            "parameters = [{ object = \"2100\", type = \"u8\", value = 0x51, state = \"safe_op\" }, ";
        let of_one = "[[drive]]\nparameters = [{ object = \"2200\", type = \"u8\", value = 0x52 }]\n";
        let terminal = "[[device]]\nname = \"coupler\"\nposition = 3\nkind = \"io\"\n\
                        outputs = [{ pdo = \"0x1600\", map = \"7000.1:16\" }]\n\
                        output = [{ name = \"level\", object = \"7000.1\", type = \"u16\" }]\n\
                        parameters = [{ object = \"8000.1\", type = \"u8\", value = 0x53 }]\n";
        let base = BASE.replacen("parameters = [", of_all, 1).replacen("[[drive]]\n", of_one, 1) + terminal;
        let plan = robot_file::plan(&base, &Registry::with_built_in()).unwrap();
        let sent = Rc::new(RefCell::new(Vec::new()));
        let mut open = || -> Result<(Box<dyn Link>, omnibase_ethercat_sim::VirtualClock), String> {
            let (segment, _) = omnibase_run::simulated::segment(&plan).map_err(|error| error.to_string())?;
            let (link, clock) = omnibase_ethercat_sim::in_process(segment);
            Ok((Box::new(Kept { link, sent: Rc::clone(&sent) }), clock))
        };
        let (mut hand, mut keep, mut back_up) = (Nobody, |_: &Record| Ok(()), |_: u16, _: &[u8]| Ok(()));
        let outside = Outside { hand: &mut hand, keep: &mut keep, back_up: &mut back_up };
        let mut guide = Guide::new(Wished::new(base.clone()), Record::default(), &mut open, outside).unwrap();
        guide.find().unwrap();
        sent.borrow_mut().clear();
        guide.operational().unwrap();
        let count = |object: [u8; 2], subindex: u8, value: u8| {
            let bytes = [object[1], object[0], subindex, value];
            sent.borrow().iter().filter(|frame| frame.windows(4).any(|part| part == bytes)).count()
        };
        assert_eq!(count([0x21, 0x00], 0, 0x51), 3, "each drive, in SAFE-OP");
        assert_eq!(count([0x80, 0x00], 1, 0x53), 1, "the coupler");
        assert_eq!(count([0x22, 0x00], 0, 0x52), 0, "whose wheel it turns isn't known");
        let was: Vec<u16> = guide.record.drives[0].was.iter().map(|(index, ..)| *index).collect();
        assert!(was.contains(&0x6085) && was.contains(&0x6072) && !was.contains(&0x2100), "{was:04x?}");
    }
}
