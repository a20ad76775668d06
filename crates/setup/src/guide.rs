//! The steps, one after the other.

mod alias_write;
mod apart;
mod at_start;
mod before;
mod brakes;
mod error;
mod floor;
mod jogging;
mod naming;
mod operational;
mod reading;
mod stops;
#[cfg(test)]
mod tests;

use before::Before;
pub use before::MOST_JOG_TORQUE_PER_MILLE;
pub use error::SetupError;
pub use floor::Calibrated;

use std::time::Duration;

use omnibase_ethercat::subdevice::SubDevice;
use omnibase_ethercat::wire::{Clock, Link};
use omnibase_ethercat::{Bus, BusOptions};
use omnibase_robot::Registry;
use omnibase_robot::config::{DrivePlan, DriveScale, Identity, RobotPlan, SpeedUnit};

use crate::hand::{Answer, Hand, Question};
use crate::record::{FoundDrive, Record, Step};
use crate::robot_file;

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

/// Writes this text as the robot's file, whole at every instant; the record says what may be written over. An error says in words why
/// it stays as it was.
pub type WriteFile<'a> = &'a mut dyn FnMut(&Record, &str) -> Result<(), String>;

/// A way to the segment: link and clock, as often as it is asked for.
pub type Open<'a, C> = &'a mut dyn FnMut() -> Result<(Box<dyn Link>, C), String>;

/// A segment on which nothing is cyclic yet.
pub(crate) type AnyBus<C> = Bus<Box<dyn Link>, C>;

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
    write: WriteFile<'a>,
    /// What drives held before the jogs of this program, until it is put back.
    pub(crate) written: Vec<Before>,
    /// How many SubDevices were on the bus when the last motion began.
    pub(crate) on_bus: usize,
}

/// Who stands outside of a set-up.
pub struct Outside<'a> {
    /// Whoever answers, and holds the key.
    pub hand: &'a mut dyn Hand,
    /// Called with the record after each thing that was done.
    pub keep: Keep<'a>,
    /// Keeps what an EEPROM held, of the SubDevice at this position, before it is written; an error leaves it unwritten.
    pub back_up: BackUp<'a>,
    /// Writes the robot's file.
    pub write: WriteFile<'a>,
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
    let has_alias = now.alias == was.alias || was.written_alias.is_some() && now.alias == was.written_alias;
    let shows = was.identification.is_none() || now.identification == was.identification;
    has_its_numbers(was, now) && has_alias && shows
}

/// Whether two may be one drive, by what nobody writes into it.
pub(crate) fn has_its_numbers(was: &FoundDrive, now: &FoundDrive) -> bool {
    let numbers = |one: &FoundDrive| (one.vendor_id, one.product_code, one.serial);
    numbers(was) == numbers(now)
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
        Outside { hand, keep, back_up, write }: Outside<'a>,
    ) -> Result<Self, SetupError> {
        let plan = robot_file::plan(&wished.base, &Registry::with_built_in())?;
        Ok(Guide { wished, plan, open, hand, record, keep, back_up, write, written: Vec::new(), on_bus: 0 })
    }

    /// A segment on which nothing was looked at yet.
    pub(crate) fn opened(&mut self) -> Result<AnyBus<C>, SetupError> {
        let (link, clock) = (self.open)().map_err(SetupError::Open)?;
        Ok(Bus::new(link, clock, BusOptions::default()))
    }

    /// The segment in INIT, everybody looked at.
    pub(crate) fn scanned(&mut self) -> Result<AnyBus<C>, SetupError> {
        let mut bus = self.opened()?;
        bus.scan().map_err(|error| in_words(&error))?;
        Ok(bus)
    }

    /// Keeps what was found so far; whoever can't is told at once, for nobody wants to find it all again.
    pub(crate) fn kept(&mut self) {
        if let Err(error) = (self.keep)(&self.record) {
            self.hand.tell(&format!("what was found so far can't be kept: {error}"));
        }
    }

    /// Every step that isn't done yet. However it ends, what jogs wrote over in the drives is put back, or told where it can't be.
    pub fn run(&mut self) -> Result<Ended, SetupError> {
        let robot = self.robot();
        let is_another = self.record.robot.as_ref().is_some_and(|begun| *begun != robot);
        let ended = if is_another && !self.record.done.is_empty() {
            Err(SetupError::OtherRobot)
        } else {
            self.record.robot = Some(robot);
            self.steps()
        };
        let refused = self.leave_as_found();
        self.tell_left(&refused);
        if ended.is_ok() {
            self.look_at_end();
        }
        ended
    }

    /// The robot that the file means: what was seen counts against its wheels and their places.
    fn robot(&self) -> String {
        let names: Vec<&str> = self.plan.drives.iter().map(|drive| drive.name.as_str()).collect();
        format!("{names:?} {:?}", self.plan.kinematics.wheels())
    }

    fn steps(&mut self) -> Result<Ended, SetupError> {
        if !self.are_as_stored()? || !self.finish_alias()? {
            return Ok(Ended::Left(None));
        }
        for step in Step::ALL {
            let is_over = self.record.done.contains(&step);
            let was_passed_over = self.record.passed_over_of(step);
            let was_done = is_over && was_passed_over.is_none();
            self.hand.step(step, was_done);
            // Who was there must be there still.
            if step == Step::Find && was_done && !self.is_as_it_was()? {
                return Ok(Ended::Left(None));
            }
            if was_done {
                continue;
            }
            if let (Some(words), Some(name)) = (was_passed_over.filter(|_| is_over), step.offered_as()) {
                match self.is_made_good(name, &words) {
                    Ok(true) => {}
                    Ok(false) => {
                        self.hand.passed_over(step);
                        continue;
                    }
                    Err(Leave) => return self.left(),
                }
            }
            let done = match step {
                Step::Find => self.find()?,
                Step::Jog => self.jog_all()?,
                Step::Enable => self.enable_all()?,
                Step::SafeTorqueOff => self.stop_all()?,
                Step::Parameters => self.parameters()?,
                Step::Name => self.name_all()?,
                Step::Brake => self.brakes()?,
                Step::File => self.file()?,
                Step::FirstMetre => self.first_metre()?,
                Step::Calibration => self.calibrate()?,
            };
            if !done {
                return self.left();
            }
            self.finish(step);
        }
        Ok(Ended::File(self.text()?))
    }

    /// Whoever was found is there still, where he was, and holds what he held; `false` where it is left.
    fn is_as_it_was(&mut self) -> Result<bool, SetupError> {
        self.compare()?;
        if !self.is_nobody_gone()? || !self.are_in_their_places()? {
            return Ok(false);
        }
        let mut bus = self.bus()?;
        let mut drives = self.record.drives.clone();
        self.take_back(&mut bus, &mut drives);
        if !self.set_apart(bus.subdevices(), &mut drives)? {
            return Ok(false);
        }
        self.record.drives = drives;
        self.are_enough(self.record.drives.len())?;
        Ok(true)
    }

    /// Writes the robot's file. What it shall be is on record before: whoever takes the set-up up again knows it for its own.
    pub fn write_file(&mut self, text: &str) -> Result<(), SetupError> {
        self.record.to_be_written = Some(text.to_owned());
        let written = (self.keep)(&self.record).and_then(|()| (self.write)(&self.record, text));
        let text = self.record.to_be_written.take();
        written.map_err(SetupError::Unwritten)?;
        self.record.written = text;
        Ok(())
    }

    /// The robot's file is where it belongs before that is on record.
    fn file(&mut self) -> Result<bool, SetupError> {
        if !self.is_startable()? {
            return Ok(false);
        }
        self.write_file(&self.text()?)?;
        Ok(true)
    }

    /// A start of the robot finds everybody by the file; else what drives are found by is asked again.
    fn is_startable(&mut self) -> Result<bool, SetupError> {
        let is_so = self.finds_all()?;
        if !is_so {
            self.record.done.retain(|step| *step != Step::Name);
        }
        Ok(is_so)
    }

    fn left(&mut self) -> Result<Ended, SetupError> {
        self.kept();
        let has_file = self.record.done.contains(&Step::File);
        Ok(Ended::Left(if has_file { Some(self.text()?) } else { None }))
    }

    /// Whether what was passed over is done now.
    fn is_made_good(&mut self, name: &str, words: &str) -> Result<bool, Leave> {
        let text = format!("{words}: passed over before. Do it now, or go on without?");
        let choices = ["now", "go on"].map(str::to_owned);
        Ok(self.choose(format!("passed {name}"), text, &choices)? == choices[0])
    }

    /// The robot's file, of what was found so far.
    fn text(&self) -> Result<String, SetupError> {
        Ok(robot_file::write(&self.wished.base, &self.record, &Registry::with_built_in())?)
    }

    fn finish(&mut self, step: Step) {
        match self.record.passed_over_of(step) {
            Some(words) => {
                self.record.note(format!("passed over: {words}"));
                self.hand.passed_over(step);
            }
            None => self.record.note(format!("done: {}", step.words())),
        }
        if !self.record.done.contains(&step) {
            self.record.done.push(step);
        }
        self.kept();
    }

    /// An answer among the choices, asked again until it is one; `Err` where somebody leaves. Nothing said is no answer: what hands have
    /// done is said.
    pub(crate) fn choose(&mut self, id: String, text: String, choices: &[String]) -> Result<String, Leave> {
        let question = Question { id, text, choices: choices.to_vec(), default: None };
        for _ in 0..ATTEMPTS {
            match self.hand.ask(&question) {
                Answer::Leave => return Err(Leave),
                Answer::Text(said) if choices.iter().any(|choice| choice == said.trim()) => {
                    return Ok(said.trim().to_owned());
                }
                Answer::Text(said) => {
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
        self.number_of(id, text, Some(default), Range::Within(least, most))
    }

    /// Any number that was measured, asked again until it is one: nobody measures by saying nothing.
    pub(crate) fn measure(&mut self, id: String, text: String) -> Result<f64, Leave> {
        self.number_of(id, text, None, Range::Any)
    }

    fn number_of(
        &mut self,
        id: String,
        text: String,
        default: Option<f64>,
        range: Range,
    ) -> Result<f64, Leave> {
        let shown = default.map(|default| default.to_string());
        let question = Question { id, text, choices: Vec::new(), default: shown };
        for _ in 0..ATTEMPTS {
            match self.hand.ask(&question) {
                Answer::Leave => return Err(Leave),
                Answer::Text(said) => match (said.trim().parse::<f64>(), default) {
                    (Ok(number), _) if range.holds(number) => return Ok(number),
                    (_, Some(default)) if said.trim().is_empty() => return Ok(default),
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
