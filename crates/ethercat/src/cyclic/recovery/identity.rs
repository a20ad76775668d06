//! Whether who was found is the one that was lost.

use core::cmp::Ordering;

use super::{Comeback, Part, Recovery, RecoveryError, Stage, Surroundings};
use crate::found::Target;
use crate::wire::bytes::u32_at;
use crate::wire::{AlState, AlStatusCode};

impl Recovery {
    /// The same product, and the same piece where it has a number?
    pub(super) fn identify(&self) -> Result<(), RecoveryError> {
        let image = Some(self.reader.image()).filter(|image| image.len() >= 32);
        let [vendor, product, revision, serial] =
            image.map_or([0; 4], |image| [16, 20, 24, 28].map(|at| u32_at(image, at)));
        let position = self.target.position;
        let expected = (self.identity.vendor_id, self.identity.product_code);
        if (vendor, product) != expected {
            return Err(RecoveryError::OtherProduct { position, expected, found: (vendor, product) });
        }
        if revision != self.identity.revision {
            let (expected, found) = (self.identity.revision, revision);
            return Err(RecoveryError::OtherRevision { position, expected, found });
        }
        // Where neither has a number they can't be told apart.
        if serial != self.identity.serial {
            let (expected, found) = (self.identity.serial, serial);
            return Err(RecoveryError::OtherPiece { position, expected, found });
        }
        Ok(())
    }

    /// It answers at its station address, in this state.
    pub(super) fn found(&mut self, status: u16, code: AlStatusCode) {
        let is_in_op = status & 0x0F == AlState::Op.bits();
        self.stage = match (is_in_op, status & AlState::ERROR != 0) {
            (true, false) => {
                let comeback = match self.comeback {
                    Comeback::Restarted => Comeback::Restarted,
                    _ => Comeback::Stayed,
                };
                return self.succeed(comeback);
            }
            // What runs isn't taken to INIT for an error that it survived.
            (true, true) => {
                self.doubt = Some(RecoveryError::InError { position: self.target.position, code });
                Stage::Acknowledge
            }
            (false, _) if self.clock.is_some() => Stage::Surroundings,
            (false, _) => self.run(Part::Clear),
        };
    }

    /// At its place stands `found`, and it answers at its own address.
    pub(super) fn placed(&mut self, found: u16) {
        let Target { position, station: expected } = self.target;
        self.stage = match self.seen.crowd() {
            _ if found == expected => self.run(Part::Clear),
            // Those that are missing may have stood before it.
            Some(Ordering::Less) => self.run(Part::Clear),
            None => Stage::Find,
            Some(_) => return self.fail(RecoveryError::OtherStation { position, expected, found }),
        };
    }

    /// At its place stands `found` with this alias, and nobody answers at its address.
    pub(super) fn looked(&mut self, found: u16, alias: u16) {
        let Target { position, station } = self.target;
        self.stage = Stage::Find;
        match (self.seen.crowd(), self.seen.answered) {
            (None, _) | (_, None) => return,
            (Some(Ordering::Less), _) if self.place == Surroundings::Branched => return,
            (Some(Ordering::Greater), Some(found)) => {
                let expected = self.seen.expected;
                return self.fail(RecoveryError::Crowded { position, expected, found });
            }
            _ => {}
        }
        // It has its address after all: the question before was lost, or its cable wasn't back yet.
        if found == station {
            return;
        }
        if found != 0 {
            return self.fail(RecoveryError::OtherStation { position, expected: station, found });
        }
        if let Some(expected) = self.alias.filter(|expected| *expected != alias) {
            let error = RecoveryError::OtherAlias { position, expected, found: alias };
            // Until its EEPROM is loaded it has none.
            match alias {
                0 => self.doubt = Some(error),
                _ => self.fail(error),
            }
            return;
        }
        self.comeback = Comeback::Restarted;
        self.stage = Stage::Address;
    }
}
