//! What was found and done: the state that a set-up is taken up from, and the record in the end.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// A step of the set-up, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Step {
    /// Who is on the bus.
    Find,
    /// Which wheel each drive turns, which way, how many counts.
    Jog,
    /// What each drive is found by wherever it is plugged in.
    Name,
    /// Enabled without moving.
    Enable,
    /// Brakes hold while nothing is enabled.
    Brake,
    /// The safety input takes the torque.
    SafeTorqueOff,
    /// Parameters compared, written, stored.
    Parameters,
    /// The robot's file.
    File,
    /// On the floor: a metre ahead.
    FirstMetre,
    /// Ahead, aside and round, each against a tape.
    Calibration,
}

impl Step {
    /// All, in order.
    pub const ALL: [Step; 10] = [
        Step::Find,
        Step::Jog,
        Step::Name,
        Step::Enable,
        Step::Brake,
        Step::SafeTorqueOff,
        Step::Parameters,
        Step::File,
        Step::FirstMetre,
        Step::Calibration,
    ];

    /// Under which name it is offered again where it was passed over; `None` where it asks by itself, or can't be passed over.
    pub(crate) fn offered_as(self) -> Option<&'static str> {
        match self {
            Step::Enable => Some("enable"),
            Step::Brake => Some("brake"),
            Step::SafeTorqueOff => Some("stop"),
            _ => None,
        }
    }

    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Step::Find => "who is on the bus",
            Step::Jog => "which wheel, which way, how far",
            Step::Name => "alias or switch of each drive",
            Step::Brake => "brakes",
            Step::Enable => "first enable, without moving",
            Step::SafeTorqueOff => "emergency stop",
            Step::Parameters => "parameters",
            Step::File => "the robot's file",
            Step::FirstMetre => "the first metre",
            Step::Calibration => "calibration by a tape",
        }
    }
}

/// Which way a wheel turned, seen against its positive way in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Turned {
    /// The wheel's positive way.
    Forward,
    /// Against it.
    Backward,
}

/// A drive that was found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FoundDrive {
    /// Position on the bus.
    pub position: u16,
    /// Its name by its EEPROM.
    pub name: String,
    /// Vendor.
    pub vendor_id: u32,
    /// Product.
    pub product_code: u32,
    /// Revision.
    pub revision: u32,
    /// Serial number; 0 where it has none.
    pub serial: u32,
    /// Alias; `None` where it has none.
    pub alias: Option<u16>,
    /// What its identification switch shows; `None` where it has none, or none was chosen.
    #[serde(default)]
    pub identification: Option<u16>,
    /// It is found by its position, whatever alias it has or will show: another has it, too, or somebody wished so.
    #[serde(default)]
    pub is_by_position: bool,
    /// 0x6076, N·m, where it says it.
    pub rated_torque_nm: Option<f64>,
    /// What a jog writes over in it, as it was when it was looked at last: index, subindex and bytes.
    #[serde(skip)]
    pub was: Vec<(u16, u8, Vec<u8>)>,
    /// An alias that was written and that it didn't show yet; it is found by its position until then.
    #[serde(default)]
    pub written_alias: Option<u16>,
    /// Counts per turn of the motor by 0x608F, where it says it.
    pub told_counts: Option<f64>,
    /// Turns of the motor per turn of the shaft by 0x6091, where it says it.
    pub told_gear: Option<f64>,
    /// The wheel that it turned.
    pub wheel: Option<String>,
    /// Whether the emergency stop was seen to take its torque; `None` before anybody went on from there.
    #[serde(default)]
    pub is_stopped: Option<bool>,
    /// The way in which the wheel turned with positive counts.
    pub turned: Option<Turned>,
    /// Counts per turn of the wheel, as seen.
    pub seen_counts: Option<f64>,
    /// Counts per turn of the motor, as the file will have them.
    pub counts_per_revolution: Option<u32>,
    /// Turns of the motor per turn of the wheel, as the file will have them.
    pub gear_ratio: Option<f64>,
}

/// An alias that is being written into an EEPROM: what breaks off is made whole from it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct AliasWrite {
    /// Position on the bus.
    pub position: u16,
    /// The alias.
    pub alias: u16,
    /// The EEPROM's fixed part, as it was before.
    pub begins: Vec<u8>,
}

/// A SubDevice that turns no wheel: it is never jogged.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FoundDevice {
    /// Its name in the robot's file; `None` where that has none.
    #[serde(default)]
    pub name: Option<String>,
    /// Position on the bus.
    pub position: u16,
    /// Vendor.
    pub vendor_id: u32,
    /// Product.
    pub product_code: u32,
    /// Serial number; 0 where it has none.
    #[serde(default)]
    pub serial: u32,
    /// Alias; `None` where it has none.
    #[serde(default)]
    pub alias: Option<u16>,
    /// It is found by its position, whatever alias it has: another has it, too, or may have it.
    #[serde(default)]
    pub is_by_position: bool,
    /// It is a drive that turns no wheel because somebody said so.
    #[serde(default)]
    pub is_apart_by_word: bool,
}

impl FoundDevice {
    /// By what tells drives apart.
    pub(crate) fn as_drive(&self) -> FoundDrive {
        let FoundDevice { position, vendor_id, product_code, serial, alias, .. } = *self;
        FoundDrive { position, vendor_id, product_code, serial, alias, ..FoundDrive::default() }
    }
}

/// What somebody went on without.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PassedOver {
    /// The step.
    pub step: Step,
    /// The wheel; `None` where it is a step of the whole robot.
    pub wheel: Option<String>,
    /// What was found of it, in words.
    pub why: String,
}

/// One way driven on the floor.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Leg {
    /// What it was: `ahead`, `aside` or `round`.
    pub name: String,
    /// What each wheel turned in each period, rad, in the order of the file.
    pub turned_rad: Vec<Vec<f64>>,
    /// That period, s.
    pub period_s: f64,
    /// What the wheels say: x, y (m) and heading (rad) from where it began.
    pub told: [f64; 3],
    /// What the tape says.
    pub measured: [f64; 3],
}

/// Everything that was found and done.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Steps that are over, those that were passed over among them.
    pub done: Vec<Step>,
    /// What of these somebody went on without: it is offered again.
    #[serde(default)]
    pub passed_over: Vec<PassedOver>,
    /// Drives, by position.
    pub drives: Vec<FoundDrive>,
    /// Drives into which a jog wrote, until what it wrote over is put back.
    #[serde(default)]
    pub jogged: Vec<FoundDrive>,
    /// SubDevices that turn no wheel, by position.
    #[serde(default)]
    pub others: Vec<FoundDevice>,
    /// Products, as vendor and product code, that no wheel of the file has and somebody goes on with.
    #[serde(default)]
    pub products_meant: Vec<(u32, u32)>,
    /// The robot that the set-up was begun with: its wheels and their places, in words to be compared.
    #[serde(default)]
    pub robot: Option<String>,
    /// The robot's file as it was written last.
    #[serde(default)]
    pub written: Option<String>,
    /// The same as it is being written.
    #[serde(default)]
    pub to_be_written: Option<String>,
    /// An alias whose writing isn't over.
    #[serde(default)]
    pub writing: Option<AliasWrite>,
    /// What was driven on the floor, and what a tape said of it.
    #[serde(default)]
    pub legs: Vec<Leg>,
    /// Wheels that fit these ways are taken into the robot's file.
    #[serde(default)]
    pub takes_calibration: bool,
    /// What was seen that isn't as the file had it, in words.
    pub findings: Vec<String>,
    /// Which of these count until somebody looks again, by what they are of.
    #[serde(default)]
    pub standing: BTreeMap<String, Vec<String>>,
    /// What was done, in order, in words.
    pub log: Vec<String>,
}

/// What of findings jogs left in drives.
pub(crate) const LEFT: &str = "left by jogs";
/// What of findings somebody went on with.
pub(crate) const GONE_ON: &str = "gone on with what a jog left";

/// What of findings is of a step, for one wheel or the whole robot.
fn tried(step: Step, wheel: Option<&str>) -> String {
    format!("{}, {}", step.words(), wheel.unwrap_or("the robot"))
}

impl Record {
    /// A record that was kept; an error says what of it can't be read.
    pub fn from_json(text: &str) -> Result<Self, String> {
        serde_json::from_str(text).map_err(|error| format!("expected the state of a set-up, found: {error}"))
    }

    /// The record to be kept.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default()
    }

    /// Nothing is done yet: what was driven on the floor was driven by what was known then.
    pub fn begin_again(&mut self) {
        (self.done, self.legs, self.takes_calibration) = (Vec::new(), Vec::new(), false);
        for one in std::mem::take(&mut self.passed_over) {
            self.findings.retain(|text| *text != one.why);
        }
        let looked_at: Vec<String> =
            self.standing.keys().filter(|what| ![LEFT, GONE_ON].contains(&what.as_str())).cloned().collect();
        looked_at.iter().for_each(|what| self.found_of(what, Vec::new()));
    }

    /// Somebody goes on without a step, for one wheel or the whole robot; `why` is found.
    pub fn pass_over(&mut self, step: Step, wheel: Option<&str>, why: impl Into<String>) {
        self.take_up(step, wheel);
        let (wheel, why) = (wheel.map(str::to_owned), why.into());
        self.found(&why);
        self.passed_over.push(PassedOver { step, wheel, why });
    }

    /// A step failed, for one wheel or the whole robot: that is found until it is done.
    pub fn failed(&mut self, step: Step, wheel: Option<&str>, text: impl Into<String>) {
        self.found_of(&tried(step, wheel), vec![text.into()]);
    }

    /// What failed, or was passed over, is done by now: it is found no more.
    pub fn make_good(&mut self, step: Step, wheel: Option<&str>) {
        self.take_up(step, wheel);
        self.found_of(&tried(step, wheel), Vec::new());
    }

    /// What was passed over isn't any more.
    fn take_up(&mut self, step: Step, wheel: Option<&str>) {
        for one in self.passed_over.extract_if(.., |one| one.step == step && one.wheel.as_deref() == wheel) {
            self.findings.retain(|text| *text != one.why);
        }
    }

    /// Whether a step is to be done for this wheel: it wasn't yet, or was passed over.
    pub fn is_due(&self, step: Step, wheel: &str) -> bool {
        let is_it = |one: &PassedOver| one.step == step && one.wheel.as_deref() == Some(wheel);
        !self.done.contains(&step) || self.passed_over.iter().any(is_it)
    }

    /// What of a step was passed over, in words; `None` where nothing was.
    pub fn passed_over_of(&self, step: Step) -> Option<String> {
        let mut passed = self.passed_over.iter().filter(|one| one.step == step).peekable();
        passed.peek()?;
        let wheels: Vec<&str> = passed.filter_map(|one| one.wheel.as_deref()).collect();
        let of = if wheels.is_empty() { String::new() } else { format!(" of {}", wheels.join(", ")) };
        Some(format!("{}{of}", step.words()))
    }

    /// Notes something that was done.
    pub fn note(&mut self, text: impl Into<String>) {
        self.log.push(text.into());
    }

    /// Notes what of something isn't as it should be by now: what was found of it before counts no more.
    pub fn found_of(&mut self, what: &str, texts: Vec<String>) {
        let before = self.standing.insert(what.to_owned(), texts.clone()).unwrap_or_default();
        self.findings.retain(|text| !before.contains(text));
        texts.into_iter().for_each(|text| self.found(text));
    }

    /// Whether something isn't as it should be by the last look at it.
    pub(crate) fn has_found(&self, what: &str) -> bool {
        self.standing.get(what).is_some_and(|texts| !texts.is_empty())
    }

    /// What of it begins so by the last look at it.
    pub(crate) fn found_before(&self, what: &str, begins: &str) -> Vec<String> {
        let texts = self.standing.get(what).into_iter().flatten();
        texts.filter(|text| text.starts_with(begins)).cloned().collect()
    }

    /// Notes something that isn't as it should be; what was found before is none the more so.
    pub fn found(&mut self, text: impl Into<String>) {
        let text = text.into();
        self.log.push(format!("FOUND: {text}"));
        if !self.findings.contains(&text) {
            self.findings.push(text);
        }
    }
}
