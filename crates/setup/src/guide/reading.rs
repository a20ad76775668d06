//! Who is on the bus, and parameters: what is done in PRE-OP.

use std::ops::RangeInclusive;

use omnibase_ethercat::error::SetUpError;
use omnibase_ethercat::mailbox::MailboxError;
use omnibase_ethercat::start_up::{ReadBack, SdoAccess};
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::{Clock, sii};

use omnibase_robot::RobotPlan;
use omnibase_robot::config::{DrivePlan, ParameterPlan, ParameterState};

use super::at_start::{AtStart, JOG_WRITES, OFFSETS, STORE};
use super::naming::name_of;
use super::{AnyBus, Guide, SetupError, in_words, is_it, seen, who};
use crate::record::{FoundDrive, Step};

/// The profile of drives in 0x1000.
const DRIVES: u32 = 402;
/// What of findings drives add to what they are told.
const OFFSET: &str = "added by drives";
/// "save" in 0x1010:01.
const SAVE: u32 = 0x6576_6173;

/// Objects of CiA 402 in counts, where no factor group says otherwise: windows, positions, speeds, accelerations.
const IN_COUNTS: [u16; 12] =
    [0x6065, 0x6067, 0x606D, 0x607C, 0x607F, 0x6080, 0x6081, 0x6083, 0x6084, 0x6085, 0x6099, 0x609A];

/// Counts per turn of a motor that are believed.
const TOLD_COUNTS: RangeInclusive<f64> = 1.0..=268_435_456.0;
/// Turns of a motor per turn of its shaft that are believed.
const TOLD_GEAR: RangeInclusive<f64> = 0.001..=1000.0;

impl<C: Clock> Guide<'_, C> {
    /// The segment in PRE-OP, each SubDevice as it describes itself.
    pub(super) fn bus(&mut self) -> Result<AnyBus<C>, SetupError> {
        let mut bus = self.scanned()?;
        bus.configure(&[]).map_err(|error| in_words(&error))?;
        Ok(bus)
    }

    pub(super) fn drives_on(&self, bus: &mut AnyBus<C>) -> Vec<FoundDrive> {
        let mut drives = Vec::new();
        for position in 0..bus.subdevices().len() as u16 {
            let one = &bus.subdevices()[usize::from(position)];
            // Whether it is found by its switch is chosen later.
            let mut found = FoundDrive { identification: None, ..seen(one) };
            let speaks_coe = one.sii.header.mailbox_protocols & sii::PROTOCOL_COE != 0;
            let mut read = |index, subindex| read_number(bus, position, ObjectAddress::new(index, subindex));
            if !speaks_coe || read(0x1000, 0).is_none_or(|kind| kind & 0xFFFF != DRIVES) {
                continue;
            }
            let mut ratio = |index| {
                let (above, below) = (f64::from(read(index, 1)?), f64::from(read(index, 2)?));
                (above > 0.0 && below > 0.0).then_some(above / below)
            };
            // A jog's speed comes of them: what no motor has isn't believed.
            found.told_counts = ratio(0x608F).filter(|counts| TOLD_COUNTS.contains(counts));
            found.told_gear = ratio(0x6091).filter(|gear| TOLD_GEAR.contains(gear));
            found.rated_torque_nm =
                read(0x6076, 0).filter(|torque| *torque > 0).map(|torque| f64::from(torque) / 1000.0);
            drives.push(found);
        }
        drives
    }

    /// Finds the drives and notes what those say of themselves that may turn a wheel; `false` where it is left.
    pub(super) fn find(&mut self) -> Result<bool, SetupError> {
        if !self.written.is_empty() && !self.are_as_stored()? {
            return Ok(false);
        }
        let mut bus = self.bus()?;
        let mut drives = self.drives_on(&mut bus);
        let others = bus.subdevices().len() - drives.len();
        let text = format!("{} drives, and {others} SubDevices that are none", drives.len());
        self.hand.tell(&text);
        self.record.note(text);
        if !self.set_apart(bus.subdevices(), &mut drives)? {
            return Ok(false);
        }
        let mut found = Vec::new();
        for drive in &mut drives {
            drive.was = held(&mut bus, &self.plan, drive).map_err(|error| in_words(&error))?;
            let rated = drive.rated_torque_nm.map_or("not told".to_owned(), |torque| format!("{torque} N·m"));
            let counts = drive.told_counts.map_or("not told".to_owned(), |counts| counts.to_string());
            let text = format!(
                "{} {}: vendor 0x{:08x}, product 0x{:08x}, serial {}, rated torque {rated}, counts per turn {counts}",
                drive.position, drive.name, drive.vendor_id, drive.product_code, drive.serial
            );
            self.hand.tell(&text);
            self.record.note(text);
            let unknown = AtStart::of_drive(&self.plan, &self.plan.bus, drive).unknown(&drive.was);
            if !unknown.is_empty() {
                let objects: Vec<String> = unknown.iter().map(ToString::to_string).collect();
                let text = format!(
                    "SubDevice {}: jogs don't write {} as every start of the robot does: what stands there can't be read, so nobody could put \
                     it back",
                    drive.position,
                    objects.join(", ")
                );
                self.hand.tell(&text);
                self.record.note(text);
            }
            let of_file = self.scale_of(drive).rated_torque_nm;
            if let Some(rated) = drive.rated_torque_nm.filter(|rated| (rated / of_file - 1.0).abs() > 0.01) {
                let text = format!(
                    "SubDevice {}: it says that its motor's rated torque is {rated} N·m (0x6076), the file says {of_file}: look at the motor's plate",
                    drive.position
                );
                found.push(text);
            }
        }
        self.tell_found_of("said by drives", found);
        self.are_enough(drives.len())?;
        if !self.are_products_meant(&drives)? {
            return Ok(false);
        }
        self.record.drives = drives;
        // They may be others than before.
        self.record.found_of(OFFSET, Vec::new());
        self.tell_offsets();
        self.tell_limited();
        Ok(true)
    }

    /// The drives are those of when the set-up was left.
    pub(super) fn compare(&mut self) -> Result<(), SetupError> {
        let mut bus = self.bus()?;
        self.are_those_found(&bus)?;
        let now = self.drives_on(&mut bus);
        for was in &self.record.drives {
            if !now.iter().any(|one| one.position == was.position) {
                let found = "no drive".to_owned();
                return Err(SetupError::Changed { position: was.position, expected: who(was), found });
            }
        }
        let left_over: Vec<u16> =
            self.record.drives.iter().filter(|one| self.is_left_over(one)).map(|one| one.position).collect();
        for was in &mut self.record.drives {
            let now = now.iter().find(|one| one.position == was.position);
            if let Some(now) = now.filter(|_| left_over.contains(&was.position)) {
                was.alias = now.alias;
            }
            was.was = held(&mut bus, &self.plan, was).map_err(|error| in_words(&error))?;
        }
        let (mut shown, mut named) = (Vec::new(), Vec::new());
        for was in self.record.drives.iter_mut().filter(|was| was.written_alias.is_some()) {
            // Nobody else has it or will have it, drive or not.
            let with_it = bus
                .subdevices()
                .iter()
                .filter(|one| was.written_alias.is_some_and(|alias| one.claims_alias(alias)));
            let is_shown =
                now.iter().any(|one| one.position == was.position && one.alias == was.written_alias);
            if is_shown && with_it.map(|one| one.position).eq([was.position]) {
                was.alias = was.written_alias.take();
                named.extend(was.wheel.clone());
                let by = if was.is_by_position { "its position, as was wished" } else { "it" };
                shown.push(format!(
                    "SubDevice {} shows alias {} by now: it is found by {by}",
                    was.position,
                    was.alias.unwrap_or_default()
                ));
            }
        }
        for wheel in named {
            self.record.found_of(&name_of(&wheel), Vec::new());
        }
        for text in shown {
            self.hand.tell(&text);
            self.record.note(text);
        }
        self.tell_offsets();
        self.tell_limited();
        Ok(())
    }

    /// Who adds something to what it is told; of whom that isn't known now, what was found stays.
    pub(super) fn tell_offsets(&mut self) {
        let mut texts = Vec::new();
        for drive in &self.record.drives {
            for (index, bytes) in OFFSETS {
                let begins = format!("SubDevice {}: {index:04X} is ", drive.position);
                let Some((.., was)) = drive.was.iter().find(|one| one.0 == index) else {
                    texts.extend(self.record.found_before(OFFSET, &begins));
                    continue;
                };
                let was = if was.len() == bytes { signed(was) } else { 0 };
                if was != 0 {
                    texts.push(format!(
                        "{begins}{was}, which is added to all that it is told; a jog takes it out and puts it back, so the \
                         robot would drive with it: write 0 by the maker's tool"
                    ));
                }
            }
        }
        self.tell_found_of(OFFSET, texts);
    }

    /// Drives that nothing tells apart may have been swapped since they were jogged: somebody says whether they were, and who was
    /// jogged is jogged again where he doesn't know. `false` where he leaves.
    pub(super) fn are_in_their_places(&mut self) -> Result<bool, SetupError> {
        let drives = &self.record.drives;
        let alike: Vec<String> = drives
            .iter()
            .filter(|one| one.wheel.is_some())
            .filter(|one| {
                let is_alike = drives.iter().any(|other| other.position != one.position && is_it(one, other));
                // A lift may be in a wheel's place by now.
                is_alike || self.record.others.iter().any(|other| is_it(one, &other.as_drive()))
            })
            .map(|one| one.position.to_string())
            .collect();
        if alike.is_empty() {
            return Ok(true);
        }
        let text = format!(
            "nothing tells SubDevices {} from others (no serial number, alias or switch): is each plugged in where it was when its wheel turned?",
            alike.join(", ")
        );
        let choices = ["as before", "jog again"].map(str::to_owned);
        let Ok(said) = self.choose("places".to_owned(), text, &choices) else { return Ok(false) };
        if said == choices[1] {
            self.record.note("drives may have been swapped: begun again with who is on the bus".to_owned());
            self.record.begin_again();
            if !self.find()? {
                return Ok(false);
            }
            self.finish(Step::Find);
        }
        Ok(true)
    }

    /// Says what somebody has to look at, and keeps it.
    pub(super) fn tell_found(&mut self, text: String) {
        self.hand.tell(&text);
        self.record.found(text);
    }

    /// The same of what is looked at again and again: what an earlier look found counts no more.
    pub(super) fn tell_found_of(&mut self, what: &str, texts: Vec<String>) {
        texts.iter().for_each(|text| self.hand.tell(text));
        self.record.found_of(what, texts);
    }

    /// Says, and keeps until it is done, why a step failed for a wheel.
    pub(super) fn tell_failed(&mut self, step: Step, wheel: &str, text: String) {
        self.hand.tell(&text);
        self.record.failed(step, Some(wheel), text);
    }

    /// The file's parameters against what the drives hold: shown, written where wished, stored where wished.
    pub(super) fn parameters(&mut self) -> Result<bool, SetupError> {
        let mut bus = self.bus()?;
        self.are_those_found(&bus)?;
        self.put_back(&mut bus);
        let drives = self.record.drives.clone();
        for drive in drives.iter().filter(|drive| drive.wheel.is_some()) {
            let wheel = drive.wheel.clone().unwrap_or_default();
            let plan = self.plan.drives.iter().find(|plan| plan.name == wheel).cloned();
            let Some(plan) = plan else { continue };
            if let Some(text) = other_units(&plan, drive) {
                self.tell_found(text);
            }
            let mut differing = Vec::new();
            let (to_store, at_each_start): (Vec<_>, Vec<_>) =
                plan.parameters.into_iter().partition(can_be_stored);
            if !at_each_start.is_empty() {
                let objects = at_each_start.iter().map(|one| ObjectAddress::new(one.index, one.subindex));
                let objects: Vec<String> = objects.map(|object| object.to_string()).collect();
                let text = format!(
                    "{wheel}: {} can't be compared and stored here (whole objects, commands, what is for SAFE-OP): every start \
                     writes them",
                    objects.join(", ")
                );
                self.hand.tell(&text);
                self.record.note(text);
            }
            for parameter in to_store {
                let object = ObjectAddress::new(parameter.index, parameter.subindex);
                let found = bus.sdo_read(drive.position, object, SdoAccess::Entry).ok();
                if found.as_ref() == Some(&parameter.data) {
                    continue;
                }
                let found = found.map_or("nothing that can be read".to_owned(), |found| number(&found));
                let text = format!("{wheel}: {object} is {found}, the file says {}", number(&parameter.data));
                self.hand.tell(&text);
                self.record.note(text);
                differing.push((object, parameter.data));
            }
            if differing.is_empty() {
                self.hand.tell(&format!("{wheel}: all parameters are as the file says"));
                self.record.make_good(Step::Parameters, Some(&wheel));
                continue;
            }
            let choices = ["write", "store", "leave them"].map(str::to_owned);
            let text = format!(
                "{wheel}: write {} parameters; or write and store them in the drive (0x1010)?",
                differing.len()
            );
            let Ok(choice) = self.choose(format!("parameters {}", drive.position), text, &choices) else {
                return Ok(false);
            };
            self.record.make_good(Step::Parameters, Some(&wheel));
            if choice == "leave them" {
                continue;
            }
            for (object, bytes) in differing {
                let written = bus.sdo_write(drive.position, object, &bytes);
                let back = written.and_then(|()| bus.sdo_read(drive.position, object, SdoAccess::Entry));
                let data = number(&bytes);
                match back.map(|back| number(&back)) {
                    Ok(back) if back == data => {
                        self.keep_wished(drive, object, &bytes);
                        self.record.note(format!("{wheel}: {object} written: {data}"))
                    }
                    Ok(back) => {
                        self.tell_found(format!(
                            "{wheel}: {object} was written {data} and reads back {back}"
                        ));
                    }
                    Err(error) => self.tell_found(format!("{wheel}: {object} isn't {data} now: {error}")),
                }
            }
            if choice == "store" {
                if let Some(why) = self.left_by_jog(&mut bus, drive) {
                    let text = format!("{wheel}: not stored: {why}");
                    self.hand.tell(&text);
                    self.record.pass_over(Step::Parameters, Some(&wheel), text);
                    continue;
                }
                match bus.sdo_write(drive.position, ObjectAddress::new(STORE, 1), &SAVE.to_le_bytes()) {
                    Ok(()) => self.record.note(format!("{wheel}: stored (0x1010)")),
                    Err(error) => self.tell_found(format!(
                        "{wheel}: it doesn't store: {error}; the file writes them at each start"
                    )),
                }
            }
        }
        Ok(true)
    }
}

/// What a jog would write over in a drive, as it is now. What it says no to is left out, and no jog writes it; an error where it
/// doesn't say anything.
pub(super) fn held<C: Clock>(
    bus: &mut AnyBus<C>,
    plan: &RobotPlan,
    drive: &FoundDrive,
) -> Result<Vec<(u16, u8, Vec<u8>)>, SetUpError> {
    let mut held = Vec::new();
    let of_file = AtStart::of_drive(plan, &plan.bus, drive);
    for (index, subindex) in JOG_WRITES.into_iter().chain(of_file.objects()) {
        let object = ObjectAddress::new(index, subindex);
        match bus.sdo_read(drive.position, object, SdoAccess::Entry) {
            Ok(bytes) => held.push((index, subindex, bytes)),
            Err(error) if is_no(&error) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(held)
}

/// Whether it is a drive's own no.
pub(super) fn is_no(error: &SetUpError) -> bool {
    matches!(error, SetUpError::Request { cause: MailboxError::Aborted { .. }, .. })
}

/// Whether a drive can be asked for it now, and may keep it.
fn can_be_stored(parameter: &ParameterPlan) -> bool {
    parameter.index != STORE
        && parameter.state == ParameterState::PreOp
        && parameter.access == SdoAccess::Entry
        && parameter.read_back == ReadBack::Compare
}

/// Parameters that are written in counts, where the file has them for another wheel than was found.
fn other_units(plan: &DrivePlan, drive: &FoundDrive) -> Option<String> {
    let of_file = f64::from(plan.scale.counts_per_revolution) * plan.scale.gear_ratio;
    let found = f64::from(drive.counts_per_revolution?) * drive.gear_ratio?;
    let in_counts = plan.parameters.iter().filter(|parameter| IN_COUNTS.contains(&parameter.index));
    let names: Vec<String> = in_counts.map(|parameter| format!("{:04X}", parameter.index)).collect();
    ((found / of_file - 1.0).abs() > 0.01 && !names.is_empty()).then(|| {
        format!(
            "{}: {} in the file's `parameters` are in counts, for {of_file} per turn of the wheel; it has {found}: {:.3} times as \
             much is the same at the wheel",
            plan.name,
            names.join(", "),
            found / of_file
        )
    })
}

fn read_number<C: Clock>(bus: &mut AnyBus<C>, position: u16, object: ObjectAddress) -> Option<u32> {
    let bytes = bus.sdo_read(position, object, SdoAccess::Entry).ok()?;
    (bytes.len() <= 4).then(|| bytes.iter().rev().fold(0, |number, byte| number << 8 | u32::from(*byte)))
}

/// The same with a sign; 0 of more than eight bytes.
fn signed(bytes: &[u8]) -> i64 {
    let sign = if bytes.last().is_some_and(|last| *last >= 0x80) { 0xFF } else { 0 };
    let mut all = [sign; 8];
    let Some(low) = all.get_mut(..bytes.len()) else { return 0 };
    low.copy_from_slice(bytes);
    i64::from_le_bytes(all)
}

/// Little-endian bytes as people read numbers.
pub(super) fn number(bytes: &[u8]) -> String {
    match bytes.len() {
        1..=8 => bytes.iter().rev().fold(0u64, |number, byte| number << 8 | u64::from(*byte)).to_string(),
        _ => format!("{bytes:02x?}"),
    }
}
