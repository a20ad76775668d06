//! What drives held before they were jogged: remembered, and put back.

use std::collections::BTreeSet;

use omnibase_ethercat::start_up::SdoAccess;
use omnibase_ethercat::wire::Clock;
use omnibase_ethercat::wire::coe::ObjectAddress;

use super::at_start::{AtStart, JOG_WRITES, MAX_TORQUE};
use super::reading::{held, number};
use super::{AnyBus, Guide, Leave, SetupError, has_its_numbers, is_it, seen, who};
use crate::record::{FoundDevice, FoundDrive, LEFT, Record};

impl<C: Clock> Guide<'_, C> {
    /// Whether this may be another drive by now, of which something else is known, and nobody said that it isn't.
    pub(super) fn is_doubtful(&self, drive: &FoundDrive) -> bool {
        let mut alike =
            self.record.drives.iter().filter(|other| other.position != drive.position && is_it(drive, other));
        !self.are_placed && alike.any(|other| held_before(other) != held_before(drive))
    }

    /// What jogs wrote over is as it was found; of whom it isn't, that is told and stays remembered.
    pub(super) fn put_back(&mut self, bus: &mut AnyBus<C>) {
        let mut failed: Vec<(FoundDrive, String)> = Vec::new();
        let mut written_over = Vec::new();
        let mut fail = |drive: &FoundDrive, words| failed.push((drive.clone(), words));
        for drive in &self.record.drives {
            if self.record.lost_supply.contains(&drive.position) {
                fail(
                    drive,
                    format!(
                        "SubDevice {} lost its supply since it was jogged, and what is stored in it isn't known yet: nothing is put back",
                        drive.position
                    ),
                );
                continue;
            }
            let now = bus.subdevices().get(usize::from(drive.position)).map(seen);
            if !now.is_some_and(|now| is_it(drive, &now)) {
                fail(
                    drive,
                    format!(
                        "SubDevice {} isn't the drive that was jogged: max torque, mode and synchronisation of that one are as the jog left them",
                        drive.position
                    ),
                );
                continue;
            }
            if self.is_doubtful(drive) {
                fail(
                    drive,
                    format!(
                        "SubDevice {}: nobody said that it is where it was when it was jogged, and one that looks alike held something else: max \
                     torque, mode and synchronisation are as the jog left them",
                        drive.position
                    ),
                );
                continue;
            }
            let [refused, over] = self.write_back(bus, drive);
            refused.into_iter().for_each(|text| fail(drive, text));
            written_over.extend(over);
        }
        for drive in &self.record.drives {
            let has = |object| drive.was.iter().any(|(index, subindex, _)| (*index, *subindex) == object);
            let its = self.record.jogged.iter().filter(|one| has_its_numbers(one, drive));
            if its.flat_map(|one| &one.was).any(|(index, subindex, _)| !has((*index, *subindex))) {
                fail(
                    drive,
                    format!(
                        "SubDevice {}: not all that it held before it was jogged is known, so that is as the jog left it",
                        drive.position
                    ),
                );
            }
        }
        let mut told = BTreeSet::new();
        for one in &self.record.jogged {
            // As many as were jogged, where they look alike.
            let places = |all: &[FoundDrive]| {
                let alike = all.iter().filter(|other| has_its_numbers(one, other));
                alike.map(|other| other.position).collect::<BTreeSet<u16>>().len()
            };
            // One that has a serial number is there wherever it is plugged in.
            let jogged = if is_told_apart(&self.record, one) { 1 } else { places(&self.record.jogged) };
            let is_there = places(&self.record.drives) >= jogged;
            if !is_there && told.insert((one.vendor_id, one.product_code, one.serial)) {
                fail(
                    one,
                    format!(
                        "{} was jogged and isn't among the drives that may turn a wheel: its max torque, mode and synchronisation are as the jog left them",
                        who(one)
                    ),
                );
            }
        }
        self.record.jogged.retain(|one| failed.iter().any(|(drive, _)| has_its_numbers(drive, one)));
        written_over.into_iter().for_each(|text| self.tell_found(text));
        self.tell_found_of(LEFT, failed.into_iter().map(|(_, text)| text).collect());
    }

    /// What one drive held; in words what it refuses, and what somebody set since.
    fn write_back(&self, bus: &mut AnyBus<C>, drive: &FoundDrive) -> [Vec<String>; 2] {
        let [mut refused, mut over] = [Vec::new(), Vec::new()];
        let position = drive.position;
        for (index, subindex, was) in &drive.was {
            let object = ObjectAddress::new(*index, *subindex);
            let now = bus.sdo_read(position, object, SdoAccess::Entry).ok();
            if now.as_ref() == Some(was) {
                continue;
            }
            let before = number(was);
            if let Err(error) = bus.sdo_write(position, object, was) {
                refused.push(format!(
                    "SubDevice {position}: {object} was {before}, and can't be put back: {error}"
                ));
            } else if let Some(now) = now.filter(|now| !self.is_of_jog(drive, object, now)) {
                over.push(format!(
                    "SubDevice {position}: {object} was {}, which no jog by this file writes, and is {before} again, as before it was jogged: \
                     who set it since sets it again",
                    number(&now)
                ));
            }
        }
        [refused, over]
    }

    /// Whoever was jogged and is told from all others, by a serial number or alias of his own, gets back what he held, whether he turns a
    /// wheel or not: the positions of these.
    pub(super) fn put_back_known(&mut self, bus: &mut AnyBus<C>, drives: &mut [FoundDrive]) -> Vec<u16> {
        let mut known = Vec::new();
        for drive in drives {
            if self.record.lost_supply.contains(&drive.position) {
                continue;
            }
            let was = drive.clone();
            let is_its = |one: &FoundDrive| has_its_numbers(one, &was);
            let has_alias = |one: &FoundDrive| is_its(one) && was.alias.is_some() && one.alias == was.alias;
            let there: Vec<FoundDrive> = bus.subdevices().iter().map(seen).collect();
            let is_alone = |is: &dyn Fn(&FoundDrive) -> bool| there.iter().filter(|one| is(one)).count() == 1;
            let jogged = &self.record.jogged;
            let by_serial = was.serial != 0
                && is_alone(&is_its)
                && jogged.iter().filter(|one| is_its(one)).all(|one| !one.has_twins);
            let is_told: &dyn Fn(&FoundDrive) -> bool = match () {
                () if by_serial => &is_its,
                () if is_alone(&has_alias) => &has_alias,
                () => continue,
            };
            if !jogged.iter().any(is_told) || !recall(jogged, drive).is_empty() {
                continue;
            }
            known.push(drive.position);
            let [refused, over] = self.write_back(bus, drive);
            if refused.is_empty() {
                self.record.jogged.retain(|one| !is_told(one));
            }
            over.into_iter().for_each(|text| self.tell_found(text));
        }
        self.is_nothing_left();
        known
    }

    /// Whether a jog may have written this: its limit, or none by whoever maps it; what it writes itself otherwise; what the file asks.
    fn is_of_jog(&self, drive: &FoundDrive, object: ObjectAddress, bytes: &[u8]) -> bool {
        match (object.index, object.subindex) {
            (MAX_TORQUE, 0) => {
                [0, self.wished.torque_per_mille].iter().any(|limit| limit.to_le_bytes() == bytes)
            }
            other => {
                JOG_WRITES.contains(&other)
                    || AtStart::of_drive(&self.plan, &self.plan.bus, drive).writes(object, bytes)
            }
        }
    }

    /// Whether the drives on the bus are those of the robot in which a jog was cut off: what that one's held mustn't get into another's.
    pub(super) fn is_robot_that_was_jogged(&mut self) -> Result<bool, Leave> {
        let jogged: Vec<String> = self.record.jogged.iter().map(who).collect();
        let text = format!(
            "a jog was cut off before what it wrote over was put back ({}): is this the same robot, or another one?",
            jogged.join("; ")
        );
        let choices = ["same", "another"].map(str::to_owned);
        Ok(self.choose("robot".to_owned(), text, &choices)? == choices[0])
    }

    /// What earlier jogs left is put back before anything else is done; where it can't be, somebody says whether it stays remembered.
    /// `false` where he leaves.
    pub(super) fn settle(&mut self) -> Result<bool, SetupError> {
        if self.record.jogged.is_empty() {
            return Ok(true);
        }
        // What can't be asked yet is told below.
        let _ = self.see_as_stored();
        let mut bus = self.bus()?;
        self.put_back(&mut bus);
        self.kept();
        let mut asked: Vec<FoundDrive> = Vec::new();
        for one in self.record.jogged.clone() {
            if asked.iter().any(|other| has_its_numbers(other, &one)) {
                continue;
            }
            let text = format!(
                "{}: `remember` what it held before it was jogged until that can be put back, or `forget` it (it is replaced for good, or was \
                 set by its maker's tool)?",
                who(&one)
            );
            let choices = ["remember", "forget"].map(str::to_owned);
            let Ok(said) = self.choose("forget".to_owned(), text, &choices) else { return Ok(false) };
            if said == choices[1] {
                self.forget(&mut bus, &one);
            }
            asked.push(one);
        }
        self.is_nothing_left();
        Ok(true)
    }

    /// Where no jog left anything, none is found.
    pub(super) fn is_nothing_left(&mut self) {
        if self.record.jogged.is_empty() {
            self.record.found_of(LEFT, Vec::new());
        }
    }

    /// What a drive holds now is its own, whatever it held before.
    fn forget(&mut self, bus: &mut AnyBus<C>, one: &FoundDrive) {
        self.record.jogged.retain(|other| !has_its_numbers(one, other));
        for drive in self.record.drives.iter_mut().filter(|drive| has_its_numbers(one, drive)) {
            drive.was = held(bus, &self.plan, drive);
        }
        self.record.note(format!("forgotten, as was said: what {} held before it was jogged", who(one)));
        self.kept();
    }

    /// The same at the end, where a jog was made since the bus was seen last; whoever isn't there now is told what is left.
    pub(super) fn leave_as_found(&mut self) {
        let looked = self.note_who_lost_supply(0).and_then(|_| self.see_as_stored());
        match looked.and_then(|()| self.bus()) {
            Ok(mut bus) => self.put_back(&mut bus),
            Err(error) => self.tell_left(&error),
        }
        self.kept();
    }

    /// Says why nothing is put back.
    pub(super) fn tell_left(&mut self, error: &SetupError) {
        let text = format!(
            "max torque, mode and synchronisation of the drives are as the last jog left them: {error}"
        );
        self.tell_found_of(LEFT, vec![text]);
    }

    /// Why what a drive holds now isn't stored in it: something of it may be what a jog left there.
    pub(super) fn left_by_jog(&self, bus: &mut AnyBus<C>, position: u16) -> Option<String> {
        let drive = self.record.drives.iter().find(|one| one.position == position)?;
        let known = |object| drive.was.iter().find(|(index, subindex, _)| (*index, *subindex) == object);
        let of_file = drive.was.iter().map(|(index, subindex, _)| (*index, *subindex));
        let objects: BTreeSet<(u16, u8)> = JOG_WRITES.into_iter().chain(of_file).collect();
        objects.into_iter().find_map(|(index, subindex)| {
            let object = ObjectAddress::new(index, subindex);
            let now = bus.sdo_read(position, object, SdoAccess::Entry);
            let words = match (now, known((index, subindex))) {
                (Ok(now), Some((.., was))) if now == *was => return None,
                (Ok(now), Some((.., was))) => {
                    format!("{object} is {} and was {} before it was jogged", number(&now), number(was))
                }
                (Ok(now), None) => format!("{object} is {}, which a jog may have left there", number(&now)),
                (Err(error), Some(_)) => format!("{object} can't be read: {error}"),
                // It has none.
                (Err(_), None) => return None,
            };
            Some(format!("{words}: set it by the maker's tool, then store"))
        })
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

/// What a drive held before its first jog, in no order.
fn held_before(one: &FoundDrive) -> BTreeSet<&(u16, u8, Vec<u8>)> {
    one.was.iter().collect()
}

/// Whether the serial number tells a drive from all others: it has one, and nobody on the bus or among those that were jogged on one
/// bus shares its numbers.
fn is_told_apart(record: &Record, drive: &FoundDrive) -> bool {
    let is_its = |one: &&FoundDrive| has_its_numbers(one, drive);
    let others: Vec<FoundDrive> = record.others.iter().map(FoundDevice::as_drive).collect();
    let is_alone = record.drives.iter().chain(&others).filter(is_its).count() <= 1;
    drive.serial != 0 && is_alone && record.jogged.iter().filter(is_its).all(|one| !one.has_twins)
}

/// Remembers what drives held that are jogged from now on; whether anything is new. Who has a serial number of its own is one drive
/// wherever it was plugged in, others are as many as there were places, aliases and contents.
pub(super) fn remember(record: &mut Record) -> bool {
    let are_apart: Vec<bool> = record.drives.iter().map(|drive| is_told_apart(record, drive)).collect();
    let Record { drives, jogged, .. } = record;
    let (before, mut any) = (jogged.clone(), false);
    for (drive, is_apart) in drives.iter().zip(are_apart) {
        let is_kept = |one: &FoundDrive| {
            has_its_numbers(one, drive) && one.alias == drive.alias && held_before(one) == held_before(drive)
        };
        if before.iter().any(is_kept) {
            continue;
        }
        any = true;
        let mut new = FoundDrive { has_twins: drive.serial != 0 && !is_apart, ..drive.clone() };
        if is_apart {
            for one in jogged.extract_if(.., |one| has_its_numbers(one, drive)) {
                let has = |was: &(u16, u8, Vec<u8>)| {
                    new.was.iter().any(|other| (other.0, other.1) == (was.0, was.1))
                };
                let more: Vec<_> = one.was.into_iter().filter(|was| !has(was)).collect();
                new.was.extend(more);
            }
        }
        jogged.push(new);
    }
    any
}

/// What a drive holds now is what the next jog writes over: somebody may have set it meanwhile, or the file has other parameters. Of one
/// in which an earlier jog left something, what is known stays.
pub(super) fn see_again(jogged: &[FoundDrive], was: &mut FoundDrive, now: &mut FoundDrive) {
    let its: Vec<&FoundDrive> = jogged.iter().filter(|one| has_its_numbers(one, was)).collect();
    if its.is_empty() {
        was.was = std::mem::take(&mut now.was);
        return;
    }
    // What nobody knows was told when it was found.
    drop(recall(jogged, now));
    for (index, subindex, bytes) in std::mem::take(&mut now.was) {
        let is_this = |one: &(u16, u8, Vec<u8>)| (one.0, one.1) == (index, subindex);
        // Nobody vouches that a jog didn't write it.
        let is_of_jog =
            JOG_WRITES.contains(&(index, subindex)) && !its.iter().any(|one| one.was.iter().any(is_this));
        if !is_of_jog && !was.was.iter().any(is_this) {
            was.was.push((index, subindex, bytes));
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
