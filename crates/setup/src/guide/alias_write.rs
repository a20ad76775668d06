//! An alias written into an EEPROM, and what becomes of a writing that broke off: the record knows what was being written.

#[cfg(test)]
mod tests;

use omnibase_ethercat::eeprom::with_checksum;
use omnibase_ethercat::wire::{Clock, sii};

use super::{AnyBus, Guide, Leave, SetupError, in_words};
use crate::record::AliasWrite;

/// Words that the writing of an alias changes: the alias, and the checksum.
const CHANGED: [usize; 2] = [4, 7];

/// What became of a writing, by what stands in the EEPROM now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stands {
    /// It is another EEPROM, or somebody else made it whole since.
    Other,
    /// As it was before.
    AsBefore,
    /// Half of it.
    Half,
    /// All of it.
    Whole,
}

impl AliasWrite {
    fn stands(&self, found: &[u8]) -> Stands {
        let words = self.begins.chunks(2).zip(found.chunks(2)).enumerate();
        let is_its = |(word, (was, is)): (usize, (&[u8], &[u8]))| was == is || CHANGED.contains(&word);
        if self.begins.len() != found.len() || !words.clone().all(is_its) {
            return Stands::Other;
        }
        match found {
            _ if found == self.begins => Stands::AsBefore,
            _ if found == self.after() => Stands::Whole,
            _ if found == with_checksum(found.to_vec()) => Stands::Other,
            _ => Stands::Half,
        }
    }

    /// What it begins with once it is written.
    fn after(&self) -> Vec<u8> {
        let mut after = self.begins.clone();
        if let Some(place) = after.get_mut(2 * CHANGED[0]..2 * CHANGED[0] + 2) {
            place.copy_from_slice(&self.alias.to_le_bytes());
        }
        with_checksum(after)
    }
}

impl<C: Clock> Guide<'_, C> {
    /// Writes it, with what was there kept before; whether it stands in the EEPROM.
    pub(super) fn write_alias(
        &mut self,
        bus: &mut AnyBus<C>,
        number: usize,
        alias: u16,
    ) -> Result<bool, SetupError> {
        let position = self.record.drives[number].position;
        let Some(after) = bus.sii_with_alias(position, alias).map_err(|error| in_words(&error))? else {
            self.tell_found(format!(
                "SubDevice {position}: the checksum of its EEPROM is wrong: only the whole can be written (`omnibase eeprom write`)"
            ));
            return Ok(false);
        };
        let before = bus.read_sii(position).map_err(|error| in_words(&error))?;
        self.record.writing =
            Some(AliasWrite { position, alias, begins: before.iter().copied().take(sii::HEADER).collect() });
        // Without either nobody could make whole what breaks off.
        let kept = (self.back_up)(position, &before).and_then(|()| (self.keep)(&self.record));
        if let Err(error) = kept {
            self.record.writing = None;
            self.tell_found(format!(
                "SubDevice {position}: its EEPROM couldn't be kept, so it isn't written: {error}"
            ));
            return Ok(false);
        }
        bus.write_sii(position, &before, &after).map_err(|error| SetupError::BrokenOff(error.to_string()))?;
        self.alias_is_written(position, alias);
        Ok(true)
    }

    fn alias_is_written(&mut self, position: u16, alias: u16) {
        self.record.writing = None;
        if let Some(drive) = self.record.drives.iter_mut().find(|drive| drive.position == position) {
            drive.written_alias = Some(alias);
        }
        self.record.note(format!("SubDevice {position}: alias {alias} written into its EEPROM"));
        self.kept();
    }

    /// Makes an EEPROM whole whose writing broke off, as somebody wishes; `false` where it is left.
    pub(super) fn finish_alias(&mut self) -> Result<bool, SetupError> {
        let Some(writing) = self.record.writing.clone() else { return Ok(true) };
        let alias = writing.alias;
        let its = format!(
            "the EEPROM into which alias {alias} was being written (SubDevice {} then)",
            writing.position
        );
        let (mut bus, (position, stands, found)) = loop {
            let mut bus = self.scanned()?;
            match find(&mut bus, &writing) {
                Looked::Its(position, stands, found) => break (bus, (position, stands, found)),
                Looked::Another => {}
                // Half of it may stand where nobody looks.
                Looked::Unseen(why) => {
                    let text = format!(
                        "{its} can't be looked at ({why}): switch on and plug in all drives, and look again; or is it gone for good?"
                    );
                    let choices = ["look again", "gone"].map(str::to_owned);
                    match self.choose(format!("unseen {}", writing.position), text, &choices) {
                        Err(Leave) => return Ok(false),
                        Ok(said) if said == choices[0] => continue,
                        Ok(_) => {}
                    }
                }
            }
            self.record.writing = None;
            self.tell_found(format!(
                "{its} isn't on the bus, or was written by others since: whoever is broken below has its backup beside the robot's file"
            ));
            self.kept();
            return Ok(true);
        };
        if position != writing.position {
            self.were_plugged_elsewhere(position, &writing);
        }
        match stands {
            Stands::Whole => self.alias_is_written(position, alias),
            Stands::Half => {
                let text = format!(
                    "SubDevice {position}: alias {alias} was being written into its EEPROM when the set-up broke off, and half of it \
                     stands there: write the rest, or what was there before?"
                );
                let choices = ["the rest", "as before"].map(str::to_owned);
                let Ok(said) = self.choose(format!("finish {position}"), text, &choices) else {
                    return Ok(false);
                };
                let is_rest = said == choices[0];
                let wish = if is_rest { writing.after() } else { writing.begins.clone() };
                bus.write_sii(position, &found, &wish)
                    .map_err(|error| SetupError::BrokenOff(error.to_string()))?;
                if is_rest {
                    self.alias_is_written(position, alias);
                }
            }
            Stands::AsBefore | Stands::Other => {}
        }
        if self.record.writing.take().is_some() {
            self.record.note(format!("SubDevice {position}: its EEPROM is as before alias {alias}"));
            self.kept();
        }
        self.is_loaded(bus, position)
    }

    /// Who was being written stands at another place: nobody knows which wheel any drive turns, so all are found and jogged again.
    fn were_plugged_elsewhere(&mut self, position: u16, writing: &AliasWrite) {
        self.record.writing = Some(AliasWrite { position, ..writing.clone() });
        self.record.drives.clear();
        self.record.begin_again();
        self.tell_found(format!(
            "the drive into which alias {} was being written was SubDevice {} then and is SubDevice {position} now: drives were \
             plugged in elsewhere, so they are found and jogged again",
            writing.alias, writing.position
        ));
        self.kept();
    }

    /// A chip that was switched on with half an EEPROM loads it at its next power-on alone; `false` where it is left.
    fn is_loaded(&mut self, mut bus: AnyBus<C>, position: u16) -> Result<bool, SetupError> {
        bus.scan().map_err(|error| in_words(&error))?;
        if bus.subdevice(position).is_ok_and(|one| one.broken.is_none()) {
            return Ok(true);
        }
        // An interface is one's at a time.
        drop(bus);
        self.are_switched_off_and_on(&[position])
    }
}

/// What was found of the EEPROM that was being written.
enum Looked {
    /// It is here: its position, and what stands in it.
    Its(u16, Stands, Vec<u8>),
    /// All were read, and another one is at its place.
    Another,
    /// Not all could be read: why.
    Unseen(String),
}

/// Where the EEPROM is that was being written: half of it wherever it is plugged in by now, else what stands at its place.
fn find<C: Clock>(bus: &mut AnyBus<C>, writing: &AliasWrite) -> Looked {
    let mut positions: Vec<u16> = bus.subdevices().iter().map(|one| one.position).collect();
    positions.sort_by_key(|position| *position != writing.position);
    let mut at_its_place = match positions.first() {
        Some(first) if *first == writing.position => Looked::Another,
        _ => Looked::Unseen(format!("nobody is at position {}", writing.position)),
    };
    for position in positions {
        let found = match bus.read_sii_first(position, sii::HEADER) {
            Ok(found) => found,
            Err(error) => {
                at_its_place = Looked::Unseen(error.to_string());
                continue;
            }
        };
        match writing.stands(&found) {
            Stands::Half => return Looked::Its(position, Stands::Half, found),
            Stands::Other => {}
            stands if position == writing.position => at_its_place = Looked::Its(position, stands, found),
            _ => {}
        }
    }
    at_its_place
}
