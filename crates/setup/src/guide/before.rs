//! What jogs write over in drives: read right before, put back right after. Where that was cut off, a drive is as it was once it lost
//! its supply, for nothing of a jog is stored in it.

use omnibase_ethercat::start_up::SdoAccess;
use omnibase_ethercat::transaction::Access;
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::{Clock, register};
use omnibase_ethercat::{Bus, BusOptions};

use super::at_start::{AtStart, JOG_WRITES, MAX_TORQUE};
use super::reading::{held, number};
use super::{ATTEMPTS, AnyBus, Guide, Leave, SetupError, has_its_numbers, in_words, is_it, seen, who};
use crate::record::{FoundDrive, LEFT};

/// What of findings drives hold a jog's max torque.
const LIMITED: &str = "limited as by jogs";

/// Drives that didn't get back what they held, each with the reason.
pub(super) type Refused = Vec<(FoundDrive, String)>;

impl<C: Clock> Guide<'_, C> {
    /// Reads what the next jog writes over; what an earlier one wrote there isn't put back yet where that failed.
    pub(super) fn remember(&mut self, bus: &mut AnyBus<C>) -> Result<(), SetupError> {
        self.put_back(bus);
        self.in_sight = Some(bus.subdevices().len()).filter(|_| self.written.is_empty());
        for drive in &mut self.record.drives {
            if self.written.iter().any(|one| is_same(one, drive)) {
                continue;
            }
            drive.was = held(bus, &self.plan, drive);
            self.written.push(drive.clone());
            if !self.record.jogged.iter().any(|one| is_same(one, drive)) {
                self.record.jogged.push(drive.clone());
            }
        }
        // Nobody could say later who may hold what a jog wrote.
        (self.keep)(&self.record).map_err(SetupError::Unkept)
    }

    /// What jogs of this program wrote over is as it was; of whom it isn't, that stays remembered.
    pub(super) fn put_back(&mut self, bus: &mut AnyBus<C>) -> Refused {
        let mut refused = Refused::new();
        // Behind one that is dark others may stand at its place.
        self.in_sight = self.in_sight.filter(|count| *count == bus.subdevices().len());
        for drive in self.written.clone() {
            let now = bus.subdevices().get(usize::from(drive.position)).map(seen);
            // It may have got an alias since.
            let known = self.record.drives.iter().find(|one| is_same(one, &drive)).unwrap_or(&drive);
            let words = match now {
                None => vec!["nobody is in its place".to_owned()],
                Some(now) if !is_it(known, &now) => vec!["another one is in its place".to_owned()],
                Some(_) if self.is_doubtful(&drive) => {
                    vec![
                        "one that looks like it held something else, and may be in its place by now"
                            .to_owned(),
                    ]
                }
                Some(_) => self.write_back(bus, &drive),
            };
            if words.is_empty() {
                self.written.retain(|one| !is_same(one, &drive));
                self.record.jogged.retain(|one| !is_same(one, &drive));
            } else {
                refused.push((drive, words.join("; ")));
            }
        }
        if !refused.is_empty() {
            self.in_sight = None;
        }
        refused
    }

    /// Whether this may be another drive by now, which held something else.
    fn is_doubtful(&self, drive: &FoundDrive) -> bool {
        let is_other = |one: &FoundDrive| one.position != drive.position && is_it(drive, one);
        self.in_sight.is_none() && self.record.drives.iter().any(|one| is_other(one) && one.was != drive.was)
    }

    /// What one drive held; in words what it refuses. Since it was out of sight it may have lost its supply, or been set by somebody:
    /// what no jog writes stays then.
    fn write_back(&mut self, bus: &mut AnyBus<C>, drive: &FoundDrive) -> Vec<String> {
        let mut refused = Vec::new();
        let position = drive.position;
        for (index, subindex, was) in &drive.was {
            let object = ObjectAddress::new(*index, *subindex);
            let now = bus.sdo_read(position, object, SdoAccess::Entry).ok();
            if now.as_ref() == Some(was) {
                continue;
            }
            let before = number(was);
            if let Some(now) =
                now.filter(|now| self.in_sight.is_none() && !self.is_of_jog(drive, object, now))
            {
                let now = number(&now);
                self.record.note(format!(
                    "SubDevice {position}: {object} was {before} before it was jogged, and is {now}, which no jog writes: that stays"
                ));
            } else if let Err(error) = bus.sdo_write(position, object, was) {
                refused.push(format!("{object} was {before}, and can't be put back: {error}"));
            }
        }
        refused
    }

    /// Whether a jog may have written this: its limit, or none by whoever maps it; what it writes itself otherwise; what the file asks.
    fn is_of_jog(&self, drive: &FoundDrive, object: ObjectAddress, bytes: &[u8]) -> bool {
        match (object.index, object.subindex) {
            (MAX_TORQUE, 0) => self.is_limit(bytes) || bytes == [0, 0],
            other => {
                JOG_WRITES.contains(&other)
                    || AtStart::of_drive(&self.plan, &self.plan.bus, drive).writes(object, bytes)
            }
        }
    }

    fn is_limit(&self, bytes: &[u8]) -> bool {
        self.wished.torque_per_mille.to_le_bytes() == bytes
    }

    /// The same behind a motion, or at the end; who didn't get it back, and why.
    pub(super) fn leave_as_found(&mut self) -> Refused {
        if self.written.is_empty() {
            return Refused::new();
        }
        let refused = match self.bus() {
            Ok(mut bus) => self.put_back(&mut bus),
            Err(error) => {
                self.in_sight = None;
                self.written.iter().map(|one| (one.clone(), error.to_string())).collect()
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
    /// it is left. Who isn't there stays remembered.
    pub(super) fn are_as_stored(&mut self) -> Result<bool, SetupError> {
        self.leave_as_found();
        for _ in 0..ATTEMPTS {
            if self.record.jogged.is_empty() {
                return Ok(true);
            }
            // Whoever is scanned has an address again.
            let (_, lost) = self.who_lost_supply()?;
            let (link, clock) = (self.open)().map_err(SetupError::Open)?;
            let mut bus = Bus::new(link, clock, BusOptions::default());
            bus.scan().map_err(|error| in_words(&error))?;
            let mut there: Vec<FoundDrive> = bus.subdevices().iter().map(seen).collect();
            drop(bus);
            there.retain(|one| self.record.jogged.iter().any(|jogged| has_its_numbers(jogged, one)));
            let kept: Vec<String> = there
                .iter()
                .filter(|one| !lost.contains(&one.position))
                .map(|one| one.position.to_string())
                .collect();
            let mut is_over = kept.is_empty();
            if !is_over {
                let text = format!(
                    "a jog was cut off, and SubDevices {} hold what it wrote (max torque, mode, synchronisation) until they are switched off \
                     and on: switch the supply of all drives off, wait until they are dark, switch it on again, and wait until they are up; \
                     or go on with what they hold now, as theirs?",
                    kept.join(", ")
                );
                let choices = ["done", "go on"].map(str::to_owned);
                match self.choose("jogged".to_owned(), text, &choices) {
                    Err(Leave) => return Ok(false),
                    Ok(said) => is_over = said == choices[1],
                }
                if is_over {
                    self.record.found(format!(
                        "gone on though SubDevices {} weren't switched off and on since a jog was cut off: what they hold may be that one's",
                        kept.join(", ")
                    ));
                }
            }
            if is_over {
                let mut is_there = |one: &FoundDrive| {
                    let at = there.iter().position(|now| has_its_numbers(one, now));
                    at.map(|at| there.remove(at)).is_some()
                };
                self.record.jogged.retain(|one| !is_there(one));
                self.written.clear();
                self.record.found_of(LEFT, Vec::new());
                self.kept();
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// How many SubDevices answer, and whose chip forgot the address that the last scan gave it: their supply was gone. Who was merely cut
    /// off has it still, and lost its torque by the end of the jog or by its watchdog.
    pub(super) fn who_lost_supply(&mut self) -> Result<(u16, Vec<u16>), SetupError> {
        let (link, clock) = (self.open)().map_err(SetupError::Open)?;
        let mut bus = Bus::new(link, clock, BusOptions::default());
        let there = bus.count().unwrap_or(0);
        let has_lost = |position: &u16| {
            let address = Access::read_at("the station address", *position, register::STATION_ADDRESS, 2);
            bus.transactor().perform_one(address).is_ok_and(|read| read.data == [0, 0])
        };
        Ok((there, (0..there).filter(has_lost).collect()))
    }

    /// Who is limited as by a jog, though none is left: one that stores by itself, or one that was jogged elsewhere.
    pub(super) fn tell_limited(&mut self) {
        let is_limited = |drive: &&FoundDrive| {
            drive.was.iter().any(|(index, _, bytes)| *index == MAX_TORQUE && self.is_limit(bytes))
        };
        let text = |drive: &FoundDrive| {
            format!(
                "SubDevice {}: its max torque (6072) is {} per mille of the rated, as a jog writes it: where nobody wished that, set it by the maker's \
                 tool",
                drive.position, self.wished.torque_per_mille
            )
        };
        let texts = self.record.drives.iter().filter(is_limited).map(text).collect();
        self.tell_found_of(LIMITED, texts);
    }

    /// Why what a drive holds now isn't stored in it: something of it may be what a jog left there.
    pub(super) fn left_by_jog(&self, bus: &mut AnyBus<C>, position: u16) -> Option<String> {
        if self.record.jogged.iter().any(|one| one.position == position) {
            return Some("it holds what a jog wrote: switch it off and on, then store".to_owned());
        }
        let object = ObjectAddress::new(MAX_TORQUE, 0);
        let now = bus.sdo_read(position, object, SdoAccess::Entry).ok()?;
        (self.is_limit(&now) || now == [0, 0]).then(|| {
            format!(
                "{object} is {}, as a jog may leave it: set it by the maker's tool, then store",
                number(&now)
            )
        })
    }

    /// What somebody had written into a drive is what is put back from then on.
    pub(super) fn keep_wished(&mut self, drive: &FoundDrive, object: ObjectAddress, bytes: &[u8]) {
        let its = self.written.iter_mut().filter(|one| is_same(one, drive));
        for was in its.flat_map(|one| &mut one.was) {
            if (was.0, was.1) == (object.index, object.subindex) {
                was.2 = bytes.to_vec();
            }
        }
    }
}

/// Whether it is a drive with these numbers at this place.
fn is_same(one: &FoundDrive, other: &FoundDrive) -> bool {
    one.position == other.position && has_its_numbers(one, other)
}
