//! What jogs write over in drives: read right before, put back right after. Where that was cut off, a drive is as it was once it lost
//! its supply, for nothing of a jog is stored in it.

use std::collections::{BTreeMap, BTreeSet};

use omnibase_ethercat::start_up::SdoAccess;
use omnibase_ethercat::transaction::Access;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::{Clock, register};
use omnibase_robot::Registry;
use omnibase_robot::config::DrivePlan;

use super::at_start::{AtStart, JOG_WRITES, MAX_TORQUE, MODE, OFFSETS, has};
use super::reading::{held, number};
use super::{
    ATTEMPTS, AnyBus, Guide, Leave, SetupError, has_its_numbers, in_words, is_it, is_product, seen, who,
};
use crate::jog::JOGGED_IN;
use crate::record::{FoundDrive, GONE_ON, LEFT};
use crate::robot_file;

/// What of findings drives hold a jog's max torque.
const LIMITED: &str = "limited as by jogs";
/// The greatest max torque that a jog is given, per mille of the rated.
pub const MOST_JOG_TORQUE_PER_MILLE: u16 = 500;

/// What a drive held before a motion.
#[derive(Clone, Debug)]
pub(crate) struct Before {
    pub(super) drive: FoundDrive,
    /// Nobody was asked anything since.
    is_in_sight: bool,
}

/// Drives that didn't get back what they held, each with the reason.
pub(super) type Refused = Vec<(FoundDrive, String)>;

impl<C: Clock> Guide<'_, C> {
    /// Reads what the next jog writes over; of what an earlier one wrote there and that isn't put back yet, what it read counts.
    pub(super) fn remember(&mut self, bus: &mut AnyBus<C>) -> Result<(), SetupError> {
        self.put_back(bus);
        self.on_bus = bus.subdevices().len();
        let mut read = Vec::new();
        for drive in &mut self.record.drives {
            drive.was = held(bus, &self.plan, drive).map_err(|error| in_words(&error))?;
            if let Some(object) = AtStart::of_drive(&self.plan, &self.plan.bus, drive).missing(&drive.was) {
                return Err(SetupError::Bus(format!(
                    "SubDevice {}: its {object} can't be read, so nobody could put it back behind a jog: jog it again, or by its maker's tool",
                    drive.position
                )));
            }
            let mut its = drive.clone();
            let earlier = self.written.iter().find(|one| is_same(&one.drive, drive));
            for one in earlier.map_or(Vec::new(), |earlier| earlier.drive.was.clone()) {
                its.was.retain(|new| !is_of(&one, new));
                drive.was.iter_mut().filter(|new| is_of(&one, new)).for_each(|new| new.clone_from(&one));
            }
            read.push(its);
        }
        for drive in read {
            if !self.record.jogged.iter().any(|one| is_same(one, &drive)) {
                self.record.jogged.push(drive.clone());
            }
            self.written.push(Before { drive, is_in_sight: true });
        }
        // Nobody could say later who may hold what a jog wrote.
        (self.keep)(&self.record).map_err(SetupError::Unkept)
    }

    /// What jogs of this program wrote over is as it was; what isn't stays remembered.
    pub(super) fn put_back(&mut self, bus: &mut AnyBus<C>) -> Refused {
        // Behind one that is dark others may stand at its place.
        if bus.subdevices().len() != self.on_bus {
            self.lose_sight();
        }
        let (mut left, mut refused) = (Vec::<Before>::new(), Refused::new());
        // Whose max torque waits is known by what else of him was refused.
        let mut all = self.written.clone();
        all.sort_by_key(|before| has(&before.drive.was, (MAX_TORQUE, 0)));
        for mut before in all {
            let drive = &before.drive;
            let now = bus.subdevices().get(usize::from(drive.position)).map(seen);
            // It may have got an alias since.
            let known = self.record.drives.iter().find(|one| is_same(one, drive)).unwrap_or(drive);
            let words = match now.map(|now| is_it(known, &now)) {
                None => vec!["nobody is in its place".to_owned()],
                Some(false) => vec!["another one is in its place".to_owned()],
                Some(true) if self.is_doubtful(&before) => match self.max_torque(bus, drive) {
                    // It lost its supply, or was set by somebody.
                    Some(now) if !is_limit(&now) => Vec::new(),
                    _ => {
                        vec![
                            "one that looks like it held something else, and may be in its place by now"
                                .to_owned(),
                        ]
                    }
                },
                Some(true) => {
                    let is_limited = left.iter().any(|one| is_same(&one.drive, &before.drive));
                    self.write_back(bus, &mut before, is_limited)
                }
            };
            if !words.is_empty() {
                refused.push((before.drive.clone(), words.join("; ")));
            }
            match left.iter_mut().find(|one| is_same(&one.drive, &before.drive)) {
                Some(earlier) => earlier.drive.was.append(&mut before.drive.was),
                None if words.is_empty() => {}
                None => left.push(before),
            }
        }
        self.record.jogged.retain(|one| {
            let is_in = |all: &[Before]| all.iter().any(|before| is_same(&before.drive, one));
            is_in(&left) || !is_in(&self.written)
        });
        self.written = left;
        // Whoever is asked from now on may plug and set.
        self.lose_sight();
        refused
    }

    /// Who lost its supply holds what is stored in it.
    pub(super) fn forget_lost(&mut self, bus: &AnyBus<C>, lost: &BTreeSet<u16>) {
        let all = bus.subdevices().iter().filter(|one| lost.contains(&one.position)).map(seen);
        let all: Vec<FoundDrive> = all.collect();
        let is_lost =
            |drive: &FoundDrive| all.iter().any(|now| now.position == drive.position && is_it(drive, now));
        self.written.retain(|before| !is_lost(&before.drive));
        self.record.jogged.retain(|drive| !is_lost(drive));
    }

    /// Somebody may have plugged these elsewhere, or set something in them.
    pub(super) fn lose_sight(&mut self) {
        self.written.iter_mut().for_each(|one| one.is_in_sight = false);
    }

    /// Whether this may be another drive by now, which held something else.
    fn is_doubtful(&self, before: &Before) -> bool {
        let drive = &before.drive;
        let is_other = |one: &FoundDrive| one.position != drive.position && is_it(drive, one);
        let mut all = self.record.drives.iter().chain(self.written.iter().map(|one| &one.drive));
        let held_other = |one: &FoundDrive| drive.was.iter().any(|was| !one.was.contains(was));
        !before.is_in_sight && all.any(|one| is_other(one) && held_other(one))
    }

    /// What one drive held; in words what it refuses, which alone is left of it. Since it was out of sight it may have lost its supply, or
    /// been set by somebody: what no jog writes stays then. Its max torque comes last, and not where it `is_limited` for something else
    /// that it refused: who isn't limited has all of it.
    fn write_back(&mut self, bus: &mut AnyBus<C>, before: &mut Before, is_limited: bool) -> Vec<String> {
        let position = before.drive.position;
        let (last, first): (Vec<_>, Vec<_>) =
            std::mem::take(&mut before.drive.was).into_iter().partition(|(index, ..)| *index == MAX_TORQUE);
        let mut refused = Vec::new();
        for one in first.into_iter().chain(last) {
            let (index, subindex, was) = &one;
            let object = ObjectAddress::new(*index, *subindex);
            let now = bus.sdo_read(position, object, SdoAccess::Entry).ok();
            if now.as_ref() == Some(was) {
                continue;
            }
            let held = number(was);
            if let Some(now) =
                now.filter(|now| !before.is_in_sight && !self.is_of_jog(&before.drive, object, now))
            {
                let now = number(&now);
                self.record.note(format!(
                    "SubDevice {position}: {object} was {held} before it was jogged, and is {now}, which no jog writes: that stays"
                ));
            } else if *index == MAX_TORQUE && (is_limited || !refused.is_empty()) {
                before.drive.was.push(one);
            } else if let Err(error) = bus.sdo_write(position, object, was) {
                refused.push(format!("{object} was {held}, and can't be put back: {error}"));
                before.drive.was.push(one);
            }
        }
        refused
    }

    /// Whether a jog may have written this: its limit, its mode, or none by whoever maps it; how it synchronises; what the file asks.
    fn is_of_jog(&self, drive: &FoundDrive, object: ObjectAddress, bytes: &[u8]) -> bool {
        let is_nothing = bytes.iter().all(|byte| *byte == 0);
        match (object.index, object.subindex) {
            (MAX_TORQUE, 0) => is_limit(bytes),
            (MODE, 0) => is_nothing || bytes == [JOGGED_IN.code() as u8],
            (index, 0) if OFFSETS.iter().any(|(offset, _)| *offset == index) => is_nothing,
            other => {
                JOG_WRITES.contains(&other)
                    || AtStart::of_drive(&self.plan, &self.plan.bus, drive).writes(object, bytes)
            }
        }
    }

    /// What a drive has as its max torque.
    fn max_torque(&self, bus: &mut AnyBus<C>, drive: &FoundDrive) -> Option<Vec<u8>> {
        bus.sdo_read(drive.position, ObjectAddress::new(MAX_TORQUE, 0), SdoAccess::Entry).ok()
    }

    /// Whether the file gives the drive's wheel this max torque, or, before it was seen which that is, any wheel of such a product; the
    /// file that was wished, or the one that was made of it by what was found.
    fn is_wished(&self, drive: &FoundDrive, bytes: &[u8]) -> bool {
        let is_its = |plan: &&DrivePlan| {
            drive.wheel.as_ref().map_or(is_product(plan, drive), |wheel| *wheel == plan.name)
        };
        let made = self.text().and_then(|text| Ok(robot_file::plan(&text, &Registry::with_built_in())?)).ok();
        let mut plans =
            self.plan.drives.iter().chain(made.iter().flat_map(|plan| &plan.drives)).filter(is_its);
        plans.any(|plan| {
            let limit = plan.scale.torque_limit_per_mille(plan.torque_limit.wheel_nm);
            let parameters = plan.parameters.iter().filter(|one| one.index == MAX_TORQUE);
            bytes == limit.to_le_bytes() || parameters.map(|one| &one.data[..]).any(|data| data == bytes)
        })
    }

    /// A motion is over. Where frames were lost nobody is looked for: whoever is dark shows later by that that its supply was gone.
    pub(super) fn after_motion(&mut self, is_lost: bool) {
        if is_lost {
            self.lose_sight();
            return;
        }
        // One that hangs keeps all from it.
        let mut positions = BTreeMap::<String, Vec<String>>::new();
        for (drive, why) in self.leave_as_found() {
            positions.entry(why).or_default().push(drive.position.to_string());
        }
        for (why, positions) in positions {
            let positions = positions.join(", ");
            self.hand.tell(&format!(
                "what was held before the motion isn't put back yet into SubDevice {positions}: {why}"
            ));
        }
    }

    /// The same with a bus of its own; who didn't get it back, and why.
    pub(super) fn leave_as_found(&mut self) -> Refused {
        if self.written.is_empty() {
            return Refused::new();
        }
        let refused = match self.bus() {
            Ok(mut bus) => self.put_back(&mut bus),
            Err(error) => {
                self.lose_sight();
                self.written.iter().map(|one| (one.drive.clone(), error.to_string())).collect()
            }
        };
        self.kept();
        refused
    }

    /// Says who isn't as he was before he was jogged, and why where that is known.
    pub(super) fn tell_left(&mut self, refused: &Refused) {
        if self.record.jogged.is_empty() && !self.record.has_found(LEFT) {
            return;
        }
        let text = |one: &FoundDrive| {
            let why = refused.iter().find(|(drive, _)| is_same(drive, one));
            let why = why.map_or(String::new(), |(_, why)| format!(" ({why})"));
            format!(
                "SubDevice {} ({}) was jogged: max torque, mode and synchronisation are as the jog left them until it is switched off and \
                 on{why}",
                one.position,
                who(one)
            )
        };
        let texts = self.record.jogged.iter().map(text).collect();
        self.tell_found_of(LEFT, texts);
        self.kept();
    }

    /// Whoever was jogged and didn't get back what he held lost his supply since, or somebody goes on with what he holds. `false` where
    /// it is left. Who isn't there stays remembered until somebody says that he is gone for good.
    pub(super) fn are_as_stored(&mut self) -> Result<bool, SetupError> {
        self.leave_as_found();
        let (mut needed, mut there, mut is_asked) = (0, Vec::new(), false);
        let mut lost = BTreeSet::new();
        for _ in 0..ATTEMPTS {
            if self.record.jogged.is_empty() {
                return Ok(true);
            }
            // Whoever is scanned has an address again.
            let (answering, now) = self.who_lost_supply()?;
            let kept = if answering < needed {
                self.hand.tell(&format!(
                    "{answering} SubDevices answer, and {needed} did before: wait until all drives are up, and say it again"
                ));
                "drives".to_owned()
            } else {
                if answering > needed {
                    // Who was cut off may stand before those that were seen.
                    lost.clear();
                }
                lost.extend(now);
                needed = answering;
                let looked = self.who_was_jogged().map(|all| there = all);
                let kept_supply = there.iter().map(|one| one.position).filter(|one| !lost.contains(one));
                let kept_supply: Vec<String> = kept_supply.map(|one| one.to_string()).collect();
                let are_up = looked.and_then(|()| match kept_supply[..] {
                    // Half of an EEPROM is made whole behind this.
                    [] if self.record.writing.is_none() => self.bus().map(drop),
                    _ => Ok(()),
                });
                match are_up {
                    Ok(()) if kept_supply.is_empty() => return Ok(self.no_longer_jogged(there)),
                    Ok(()) => format!("SubDevices {}", kept_supply.join(", ")),
                    Err(error) => {
                        self.hand.tell(&format!("{error}: wait until all drives are up, and say it again"));
                        "drives".to_owned()
                    }
                }
            };
            let text = if std::mem::replace(&mut is_asked, true) && kept != "drives" {
                format!(
                    "{kept} never lost their supply since that was asked: switch it off and on; or go on with what they hold now?"
                )
            } else {
                format!(
                    "a jog was cut off, and {kept} hold what it wrote (max torque, mode, synchronisation) until they are switched off and on: \
                     switch the supply of all drives off, wait until they are dark, switch it on again, and wait until they \
                     are up; or go on with what they hold now, as theirs?"
                )
            };
            let choices = ["done", "go on"].map(str::to_owned);
            match self.choose("jogged".to_owned(), text, &choices) {
                Err(Leave) => return Ok(false),
                Ok(said) if said == choices[0] => {}
                Ok(_) => {
                    let text = format!(
                        "gone on though {kept} weren't switched off and on since a jog was cut off: what they hold may be that one's"
                    );
                    let is_any = there.iter().any(|one| !lost.contains(&one.position));
                    self.tell_found_of(GONE_ON, Vec::from_iter(is_any.then_some(text)));
                    return Ok(self.no_longer_jogged(there));
                }
            }
        }
        Ok(false)
    }

    /// Who on the bus may have been jogged, by his numbers.
    fn who_was_jogged(&mut self) -> Result<Vec<FoundDrive>, SetupError> {
        let bus = self.scanned()?;
        let all = bus.subdevices().iter().map(seen);
        let is_jogged = |one: &FoundDrive| self.record.jogged.iter().any(|other| has_its_numbers(other, one));
        Ok(all.filter(is_jogged).collect())
    }

    /// What these hold is theirs; who isn't among them is asked for. `false` where it is left.
    fn no_longer_jogged(&mut self, mut these: Vec<FoundDrive>) -> bool {
        let mut is_one = |one: &FoundDrive| {
            let at = these.iter().position(|other| has_its_numbers(one, other));
            at.map(|at| these.remove(at)).is_some()
        };
        self.record.jogged.retain(|one| !is_one(one));
        self.written.clear();
        for one in self.record.jogged.clone() {
            let text = format!(
                "SubDevice {} ({}) was jogged and isn't on the bus: it holds what the jog wrote until it is switched off and on. `remember` \
                 that, or is it `gone` for good?",
                one.position,
                who(&one)
            );
            match self.choose("gone for good".to_owned(), text, &["remember", "gone"].map(str::to_owned)) {
                Err(Leave) => return false,
                Ok(said) if said == "gone" => {
                    self.record.jogged.retain(|other| *other != one);
                    self.record.note(format!(
                        "gone for good, as was said: {}, which a jog was cut off in",
                        who(&one)
                    ));
                }
                Ok(_) => {}
            }
        }
        self.record.found_of(LEFT, Vec::new());
        self.kept();
        true
    }

    /// How many SubDevices answer, and whose chip forgot the address that the last scan gave it: their supply was gone. Who was merely cut
    /// off has it still, and lost its torque by the end of the jog or by its watchdog.
    pub(super) fn who_lost_supply(&mut self) -> Result<(u16, Vec<u16>), SetupError> {
        let mut bus = self.opened()?;
        let there = bus.count().unwrap_or(0);
        let has_lost = |position: &u16| {
            let address = Access::read_at("the station address", *position, register::STATION_ADDRESS, 2);
            bus.transactor().perform_one(address).is_ok_and(|read| read.data == [0, 0])
        };
        Ok((there, (0..there).filter(has_lost).collect()))
    }

    /// Who is limited as by a jog, though none is left: one that stores by itself, or one that was jogged elsewhere. Of whom that isn't
    /// known now, what was found stays.
    pub(super) fn tell_limited(&mut self) {
        let mut texts = Vec::new();
        for drive in &self.record.drives {
            let begins = format!("SubDevice {}: its max torque (6072) is ", drive.position);
            match drive.was.iter().find(|(index, ..)| *index == MAX_TORQUE) {
                None => texts.extend(self.record.found_before(LIMITED, &begins)),
                Some((.., its)) if is_limit(its) && !self.is_wished(drive, its) => texts.push(format!(
                    "{begins}{} per mille of the rated, which a jog may have left there: where nobody wished that, set it by the maker's tool",
                    number(its)
                )),
                Some(_) => {}
            }
        }
        if texts.is_empty() && self.record.drives.iter().all(|drive| has(&drive.was, (MAX_TORQUE, 0))) {
            self.record.found_of(GONE_ON, Vec::new());
        }
        self.tell_found_of(LIMITED, texts);
    }

    /// The same at the end, and who adds something: what was told before may be over, and drives may have been swapped since.
    pub(super) fn look_at_end(&mut self) {
        let Ok(mut bus) = self.bus() else { return };
        let mut now = Vec::new();
        for drive in &self.record.drives {
            let Ok(was) = held(&mut bus, &self.plan, drive) else { return };
            now.push(was);
        }
        self.record.drives.iter_mut().zip(now).for_each(|(drive, was)| drive.was = was);
        self.tell_offsets();
        self.tell_limited();
        self.kept();
    }

    /// Why what a drive holds now isn't stored in it: something of it may be what a jog left there.
    pub(super) fn left_by_jog(&self, bus: &mut AnyBus<C>, drive: &FoundDrive) -> Option<String> {
        if self.record.jogged.iter().any(|one| is_same(one, drive)) {
            return Some("it holds what a jog wrote: switch it off and on, then store".to_owned());
        }
        let is_own = |now: &Vec<u8>| !is_limit(now) || self.is_wished(drive, now);
        (!self.max_torque(bus, drive).as_ref().is_some_and(is_own)).then(|| {
            "its max torque (6072) is as a jog may leave it: set it by the maker's tool, then store"
                .to_owned()
        })
    }

    /// What somebody had written into a drive is what is put back from then on.
    pub(super) fn keep_wished(&mut self, drive: &FoundDrive, object: ObjectAddress, bytes: &[u8]) {
        let its = self.written.iter_mut().map(|one| &mut one.drive).filter(|one| is_same(one, drive));
        for was in its.flat_map(|one| &mut one.was) {
            if (was.0, was.1) == (object.index, object.subindex) {
                was.2 = bytes.to_vec();
            }
        }
    }
}

/// Whether a max torque is one that a jog may have left: its limit, or none by whoever maps it.
fn is_limit(bytes: &[u8]) -> bool {
    matches!(*bytes, [low, high] if u16::from_le_bytes([low, high]) <= MOST_JOG_TORQUE_PER_MILLE)
}

/// Whether both are of one object.
fn is_of(one: &(u16, u8, Vec<u8>), other: &(u16, u8, Vec<u8>)) -> bool {
    (one.0, one.1) == (other.0, other.1)
}

/// Whether it is a drive with these numbers at this place.
fn is_same(one: &FoundDrive, other: &FoundDrive) -> bool {
    one.position == other.position && has_its_numbers(one, other)
}
