//! Who is on the bus, and parameters: what is done in PRE-OP.

use std::collections::BTreeSet;
use std::ops::RangeInclusive;

use omnibase_ethercat::start_up::{ReadBack, SdoAccess};
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::{Clock, Link, sii};
use omnibase_ethercat::{Bus, BusOptions};

use omnibase_robot::config::{DrivePlan, ParameterPlan, ParameterState};

use super::at_start::{AtStart, JOG_WRITES, MAX_TORQUE, STORE};
use super::{Guide, SetupError, has_its_numbers, in_words, is_it, is_product, seen, who};
use crate::record::{FoundDevice, FoundDrive, Record, Step};

/// The profile of drives in 0x1000.
const DRIVES: u32 = 402;
/// "save" in 0x1010:01.
const SAVE: u32 = 0x6576_6173;

/// Objects of CiA 402 in counts, where no factor group says otherwise: windows, positions, speeds, accelerations.
const IN_COUNTS: [u16; 12] =
    [0x6065, 0x6067, 0x606D, 0x607C, 0x607F, 0x6080, 0x6081, 0x6083, 0x6084, 0x6085, 0x6099, 0x609A];

/// Counts per turn of a motor that are believed.
const TOLD_COUNTS: RangeInclusive<f64> = 1.0..=268_435_456.0;
/// Turns of a motor per turn of its shaft that are believed.
const TOLD_GEAR: RangeInclusive<f64> = 0.001..=1000.0;

type AnyBus<C> = Bus<Box<dyn Link>, C>;

impl<C: Clock> Guide<'_, C> {
    /// The segment in PRE-OP, each SubDevice as it describes itself.
    fn bus(&mut self) -> Result<AnyBus<C>, SetupError> {
        let (link, clock) = (self.open)().map_err(SetupError::Open)?;
        let mut bus = Bus::new(link, clock, BusOptions::default());
        bus.scan().map_err(|error| in_words(&error))?;
        bus.configure(&[]).map_err(|error| in_words(&error))?;
        Ok(bus)
    }

    fn drives_on(&self, bus: &mut AnyBus<C>) -> Vec<FoundDrive> {
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
            let at_start = AtStart::of_drive(&self.plan, &found);
            for (index, subindex) in JOG_WRITES.into_iter().chain(at_start.objects()) {
                let object = ObjectAddress::new(index, subindex);
                let Ok(bytes) = bus.sdo_read(position, object, SdoAccess::Entry) else { continue };
                // None at all is what a jog that was cut off left there.
                if index != MAX_TORQUE || bytes.iter().any(|byte| *byte != 0) {
                    found.was.push((index, subindex, bytes));
                }
            }
            drives.push(found);
        }
        drives
    }

    /// Finds the drives and notes what they say of themselves.
    pub(super) fn find(&mut self) -> Result<(), SetupError> {
        let mut bus = self.bus()?;
        let mut drives = self.drives_on(&mut bus);
        for drive in &mut drives {
            recall(&self.record.jogged, drive).into_iter().for_each(|text| self.tell_found(text));
        }
        let is_drive = |position: u16| drives.iter().any(|drive| drive.position == position);
        let others = bus.subdevices().iter().filter(|one| !is_drive(one.position));
        self.record.others = others
            .map(|one| FoundDevice {
                position: one.position,
                vendor_id: one.identity.vendor_id,
                product_code: one.identity.product_code,
            })
            .collect();
        let wheels = self.plan.drives.len();
        for drive in &drives {
            let rated = drive.rated_torque_nm.map_or("not told".to_owned(), |torque| format!("{torque} N·m"));
            let counts = drive.told_counts.map_or("not told".to_owned(), |counts| counts.to_string());
            let text = format!(
                "{} {}: vendor 0x{:08x}, product 0x{:08x}, serial {}, rated torque {rated}, counts per turn {counts}",
                drive.position, drive.name, drive.vendor_id, drive.product_code, drive.serial
            );
            self.hand.tell(&text);
            self.record.note(text);
            let of_file = self.scale_of(drive).rated_torque_nm;
            if let Some(rated) = drive.rated_torque_nm.filter(|rated| (rated / of_file - 1.0).abs() > 0.01) {
                let text = format!(
                    "SubDevice {}: it says that its motor's rated torque is {rated} N·m (0x6076), the file says {of_file}: look at the motor's plate",
                    drive.position
                );
                self.hand.tell(&text);
                self.record.found(text);
            }
        }
        for drive in &drives {
            if !self.plan.drives.iter().any(|plan| is_product(plan, drive)) {
                let devices: BTreeSet<&str> =
                    self.plan.drives.iter().map(|plan| plan.device.as_str()).collect();
                let text = format!(
                    "SubDevice {}: the file's devices ({}) are other products than vendor 0x{:08x} product 0x{:08x}: put `device` and its maps \
                     right before it is driven (`omnibase scan --toml` shows them)",
                    drive.position,
                    devices.into_iter().collect::<Vec<_>>().join(", "),
                    drive.vendor_id,
                    drive.product_code
                );
                self.hand.tell(&text);
                self.record.found(text);
            }
        }
        if drives.len() < wheels {
            let error = SetupError::TooFewDrives { wheels, drives: drives.len() };
            // What a jog left in those that are there is put back all the same.
            if !self.record.jogged.is_empty() {
                (self.record.drives, self.are_placed) = (drives, true);
            }
            return Err(error);
        }
        let text =
            format!("{} drives, and {} SubDevices that are none", drives.len(), self.record.others.len());
        self.hand.tell(&text);
        self.record.note(text);
        self.record.drives = drives;
        self.are_placed = true;
        Ok(())
    }

    /// The drives are those of when the set-up was left.
    pub(super) fn compare(&mut self) -> Result<(), SetupError> {
        let mut bus = self.bus()?;
        self.are_those_found(&bus)?;
        let mut now = self.drives_on(&mut bus);
        for was in &self.record.drives {
            if !now.iter().any(|one| one.position == was.position) {
                let found = "no drive".to_owned();
                return Err(SetupError::Changed { position: was.position, expected: who(was), found });
            }
        }
        let Record { drives, jogged, .. } = &mut self.record;
        // Nothing of a jog is in any of them: what was read just now is put back.
        self.are_placed = jogged.is_empty();
        for was in drives {
            if let Some(now) = now.iter_mut().find(|one| one.position == was.position) {
                see_again(jogged, was, now);
            }
        }
        let mut shown = Vec::new();
        for was in self.record.drives.iter_mut().filter(|was| was.written_alias.is_some()) {
            // Nobody else has it or will have it, drive or not.
            let with_it = bus
                .subdevices()
                .iter()
                .filter(|one| was.written_alias.is_some_and(|alias| one.claims_alias(alias)));
            let is_shown =
                now.iter().any(|one| one.position == was.position && one.alias == was.written_alias);
            if is_shown && with_it.map(|one| one.position).eq([was.position]) {
                (was.alias, was.is_by_position) = (was.written_alias.take(), false);
                shown.push(format!(
                    "SubDevice {} shows alias {} by now: it is found by it",
                    was.position,
                    was.alias.unwrap_or_default()
                ));
            }
        }
        for text in shown {
            self.hand.tell(&text);
            self.record.note(text);
        }
        Ok(())
    }

    /// Drives that nothing tells apart may have been swapped since they were jogged: somebody says whether they were, and who was
    /// jogged is jogged again where he doesn't know. `false` where he leaves.
    pub(super) fn are_in_their_places(&mut self) -> Result<bool, SetupError> {
        let drives = &self.record.drives;
        let jogged = |one: &&FoundDrive| one.wheel.is_some() || self.is_doubtful(one);
        let alike: Vec<String> = drives
            .iter()
            .filter(jogged)
            .filter(|one| drives.iter().any(|other| other.position != one.position && is_it(one, other)))
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
            self.record.done.clear();
            self.find()?;
            self.finish(Step::Find);
        }
        self.are_placed = true;
        Ok(true)
    }

    /// Whether this may be another drive by now, of which something else is known, and nobody said that it isn't.
    fn is_doubtful(&self, drive: &FoundDrive) -> bool {
        let known = |one: &FoundDrive| one.was.iter().cloned().collect::<BTreeSet<_>>();
        let mut alike =
            self.record.drives.iter().filter(|other| other.position != drive.position && is_it(drive, other));
        !self.are_placed && alike.any(|other| known(other) != known(drive))
    }

    /// What jogs wrote over is as it was found.
    fn put_back(&mut self, bus: &mut AnyBus<C>) {
        let mut failed = Vec::new();
        for drive in &self.record.drives {
            let now = bus.subdevices().get(usize::from(drive.position)).map(seen);
            if !now.is_some_and(|now| is_it(drive, &now)) {
                failed.push(format!(
                    "SubDevice {} isn't the drive that was jogged: max torque, mode and synchronisation of that one are as the jog left them",
                    drive.position
                ));
                continue;
            }
            if self.is_doubtful(drive) {
                failed.push(format!(
                    "SubDevice {}: nobody said that it is where it was when it was jogged, and one that looks alike held something else: max \
                     torque, mode and synchronisation are as the jog left them",
                    drive.position
                ));
                continue;
            }
            for (index, subindex, was) in &drive.was {
                let object = ObjectAddress::new(*index, *subindex);
                let is_so =
                    bus.sdo_read(drive.position, object, SdoAccess::Entry).is_ok_and(|bytes| bytes == *was);
                if is_so {
                    continue;
                }
                if let Err(error) = bus.sdo_write(drive.position, object, was) {
                    failed.push(format!("{object} was {}, and can't be put back: {error}", number(was)));
                }
            }
        }
        for drive in &self.record.drives {
            let has = |object| drive.was.iter().any(|(index, subindex, _)| (*index, *subindex) == object);
            let its = self.record.jogged.iter().filter(|one| has_its_numbers(one, drive));
            if its.flat_map(|one| &one.was).any(|(index, subindex, _)| !has((*index, *subindex))) {
                failed.push(format!(
                    "SubDevice {}: not all that it held before it was jogged is known, so that is as the jog left it",
                    drive.position
                ));
            }
        }
        let mut told = BTreeSet::new();
        for one in &self.record.jogged {
            // As many as were jogged, where they look alike.
            let places = |all: &[FoundDrive]| {
                let alike = all.iter().filter(|other| has_its_numbers(one, other));
                alike.map(|other| other.position).collect::<BTreeSet<u16>>().len()
            };
            let is_there = places(&self.record.drives) >= places(&self.record.jogged);
            if !is_there && told.insert((one.vendor_id, one.product_code, one.serial)) {
                failed.push(format!(
                    "{} was jogged and isn't among the drives that were found: its max torque, mode and synchronisation are as the jog left them",
                    who(one)
                ));
            }
        }
        if failed.is_empty() {
            self.record.jogged.clear();
        }
        failed.into_iter().for_each(|text| self.tell_found(text));
    }

    /// The same at the end, where a jog was made since the bus was seen last; whoever isn't there now is told what is left.
    pub(super) fn leave_as_found(&mut self) {
        match self.bus() {
            Ok(mut bus) => self.put_back(&mut bus),
            Err(error) => self.tell_left(&error),
        }
        self.kept();
    }

    /// Says why nothing is put back.
    pub(super) fn tell_left(&mut self, error: &SetupError) {
        self.tell_found(format!(
            "max torque, mode and synchronisation of the drives are as the last jog left them: {error}"
        ));
    }

    /// Says what somebody has to look at, and keeps it.
    pub(super) fn tell_found(&mut self, text: String) {
        self.hand.tell(&text);
        self.record.found(text);
    }

    /// The file's parameters against what the drives hold: shown, written where wished, stored where wished.
    pub(super) fn parameters(&mut self) -> Result<bool, SetupError> {
        let mut bus = self.bus()?;
        // Whatever is written now is written into those that were jogged.
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
                if let Some(why) = self.left_by_jog(&mut bus, drive.position) {
                    self.tell_found(format!("{wheel}: not stored: {why}"));
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

    /// Why what a drive holds now isn't stored in it: its max torque may be what a jog left there.
    fn left_by_jog(&self, bus: &mut AnyBus<C>, position: u16) -> Option<String> {
        let object = ObjectAddress::new(MAX_TORQUE, 0);
        let drive = self.record.drives.iter().find(|one| one.position == position)?;
        let was = drive.was.iter().find(|(index, ..)| *index == MAX_TORQUE).map(|(.., bytes)| number(bytes));
        let now = bus.sdo_read(position, object, SdoAccess::Entry).map(|bytes| number(&bytes));
        let of_jog = ["0".to_owned(), self.wished.torque_per_mille.to_string()];
        let hint = "set it by the maker's tool, then store";
        match (now, was) {
            (Ok(now), Some(was)) if now == was => None,
            (Ok(now), Some(was)) => {
                Some(format!("{object} is {now} and was {was} before it was jogged: {hint}"))
            }
            (Ok(now), None) if !of_jog.contains(&now) => None,
            (Ok(now), None) => Some(format!("{object} is {now}, which a jog may have left there: {hint}")),
            (Err(error), Some(_)) => Some(format!("{object} can't be read: {error}")),
            (Err(_), None) => None,
        }
    }

    /// What somebody had written into a drive is what is put back from then on.
    pub(super) fn keep_wished(&mut self, drive: &FoundDrive, object: ObjectAddress, bytes: &[u8]) {
        let Record { drives, jogged, .. } = &mut self.record;
        let its = |one: &&mut FoundDrive| one.position == drive.position && has_its_numbers(one, drive);
        for was in drives.iter_mut().chain(jogged).filter(its).flat_map(|one| &mut one.was) {
            if (was.0, was.1) == (object.index, object.subindex) {
                was.2 = bytes.to_vec();
            }
        }
    }
}

/// What a drive holds now is what the next jog writes over: somebody may have set it meanwhile, or the file has more parameters. Of one
/// in which an earlier jog left something, what is known stays.
pub(super) fn see_again(jogged: &[FoundDrive], was: &mut FoundDrive, now: &mut FoundDrive) {
    let its: Vec<&FoundDrive> = jogged.iter().filter(|one| has_its_numbers(one, was)).collect();
    // What nobody knows was told when it was found.
    drop(recall(jogged, now));
    for (index, subindex, bytes) in std::mem::take(&mut now.was) {
        let is_this = |one: &(u16, u8, Vec<u8>)| (one.0, one.1) == (index, subindex);
        // Nobody vouches that a jog didn't write it.
        let is_of_jog =
            JOG_WRITES.contains(&(index, subindex)) && !its.iter().any(|one| one.was.iter().any(is_this));
        match was.was.iter().position(is_this) {
            Some(place) if its.is_empty() => was.was[place].2 = bytes,
            None if its.is_empty() || !is_of_jog => was.was.push((index, subindex, bytes)),
            _ => {}
        }
    }
}

/// Takes what a drive held before its first jog for what it was found with; in words what nobody knows, for drives that look alike
/// may have been swapped.
pub(super) fn recall(jogged: &[FoundDrive], drive: &mut FoundDrive) -> Vec<String> {
    let alike: Vec<&FoundDrive> = jogged.iter().filter(|one| has_its_numbers(one, drive)).collect();
    // Its alias may have been written since.
    let has_alias = alike.iter().any(|one| one.alias == drive.alias);
    let its = alike.into_iter().filter(|one| !has_alias || one.alias == drive.alias);
    let before: BTreeSet<&(u16, u8, Vec<u8>)> = its.flat_map(|one| &one.was).collect();
    let objects: BTreeSet<(u16, u8)> =
        before.iter().map(|(index, subindex, _)| (*index, *subindex)).collect();
    let mut unknown = Vec::new();
    for object in objects {
        let values: Vec<_> =
            before.iter().filter(|(index, subindex, _)| (*index, *subindex) == object).collect();
        if drive.was.iter().any(|now| values.iter().any(|value| **value == now)) {
            continue;
        }
        drive.was.retain(|(index, subindex, _)| (*index, *subindex) != object);
        match values[..] {
            [value] => drive.was.push((*value).clone()),
            _ => unknown.push(format!(
                "SubDevice {}: {} was {} before it was jogged, by which of the drives that look alike it is: set it by the maker's tool",
                drive.position,
                ObjectAddress::new(object.0, object.1),
                values.iter().map(|(.., bytes)| number(bytes)).collect::<Vec<_>>().join(" or "),
            )),
        }
    }
    unknown
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

/// Little-endian bytes as people read numbers.
fn number(bytes: &[u8]) -> String {
    match bytes.len() {
        1..=8 => bytes.iter().rev().fold(0u64, |number, byte| number << 8 | u64::from(*byte)).to_string(),
        _ => format!("{bytes:02x?}"),
    }
}
