//! Modular devices (ETG.5001): the modules that are plugged in, against those for which the device is configured.

use alloc::vec::Vec;

use crate::bus::Bus;
use crate::error::SetUpError;
use crate::mailbox::{MailboxError, SdoAccess};
use crate::start_up::{SlotMismatch, StartUpStep};
use crate::wire::coe::ObjectAddress;
use crate::wire::{Clock, Link};

/// Module idents by slot: for which the device is configured.
pub const CONFIGURED: u16 = 0xF030;
/// Module idents by slot: what it detected.
pub const DETECTED: u16 = 0xF050;
/// Bytes of a whole list before its first ident: how many there are, padded.
const COUNT: usize = 2;

/// What a modular device has in its slots; 0 is an empty one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Modules {
    /// Idents for which it is configured (0xF030); empty where it has no such object.
    pub configured: Vec<u32>,
    /// Idents that it detected (0xF050).
    pub detected: Vec<u32>,
}

impl Modules {
    /// Slots in which something else is than was configured.
    ///
    /// A device that isn't configured yet takes what it detected.
    pub fn differences(&self) -> Vec<SlotMismatch> {
        if self.configured.iter().all(|ident| *ident == 0) {
            return Vec::new();
        }
        mismatches(&self.configured, &self.detected).collect()
    }
}

fn mismatches(expected: &[u32], detected: &[u32]) -> impl Iterator<Item = SlotMismatch> {
    let at = |list: &[u32], slot: usize| list.get(slot - 1).copied().unwrap_or(0);
    let slots = 1..=expected.len().max(detected.len());
    slots
        .map(move |slot| SlotMismatch { slot, expected: at(expected, slot), detected: at(detected, slot) })
        .filter(|one| one.expected != one.detected)
}

/// The list of modules that start-up steps write.
fn written_list(steps: &[StartUpStep]) -> Vec<u32> {
    let mut list = Vec::new();
    for step in steps {
        let StartUpStep::Sdo(sdo) = step else { continue };
        let (first, idents) = match (sdo.object.index, sdo.object.subindex, sdo.access) {
            (CONFIGURED, 0, SdoAccess::Complete) => (0, sdo.data.get(COUNT..).unwrap_or_default()),
            (CONFIGURED, slot @ 1.., _) => (usize::from(slot) - 1, &sdo.data[..]),
            _ => continue,
        };
        for (slot, ident) in (first..).zip(idents.chunks(size_of::<u32>())) {
            list.resize(list.len().max(slot + 1), 0);
            list[slot] = number(ident);
        }
    }
    list
}

fn number(bytes: &[u8]) -> u32 {
    bytes.iter().take(size_of::<u32>()).rev().fold(0, |number, byte| number << 8 | u32::from(*byte))
}

impl<L: Link, C: Clock> Bus<L, C> {
    /// The modules of the SubDevice at `position`, which is in PRE-OP; `None` for one that isn't modular.
    pub fn read_modules(&mut self, position: u16) -> Result<Option<Modules>, SetUpError> {
        let speaks_coe = self.subdevice(position)?.mailbox.is_some_and(|mailbox| mailbox.speaks_coe());
        if !speaks_coe {
            return Ok(None);
        }
        let Some(detected) = self.read_idents(position, DETECTED)? else { return Ok(None) };
        let configured = self.read_idents(position, CONFIGURED)?.unwrap_or_default();
        Ok(Some(Modules { configured, detected }))
    }

    /// The slot for which `object`, the list of modules or one of its entries, was refused; `None` where all is as it is expected.
    pub(crate) fn mismatched_slot(&mut self, position: u16, object: ObjectAddress) -> Option<SlotMismatch> {
        if object.index != CONFIGURED {
            return None;
        }
        let expected = written_list(&self.subdevice(position).ok()?.start_up.steps);
        let found = self.read_modules(position).ok()??;
        let is_meant = |one: &SlotMismatch| [0, one.slot].contains(&usize::from(object.subindex));
        mismatches(&expected, &found.detected).find(is_meant)
    }

    /// A list of idents; `None` where there is no such object.
    fn read_idents(&mut self, position: u16, index: u16) -> Result<Option<Vec<u32>>, SetUpError> {
        let mut idents = Vec::new();
        let read = |bus: &mut Self, subindex| match bus.sdo_read(
            position,
            ObjectAddress::new(index, subindex),
            SdoAccess::Entry,
        ) {
            Ok(data) => Ok(Some(number(&data))),
            Err(SetUpError::Request { cause: MailboxError::Aborted { .. }, .. }) => Ok(None),
            Err(other) => Err(other),
        };
        let Some(count) = read(self, 0)? else { return Ok(None) };
        for subindex in 1..=(count.min(u32::from(u8::MAX)) as u8) {
            idents.push(read(self, subindex)?.unwrap_or(0));
        }
        Ok(Some(idents))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::start_up::{ReadBack, Refusal, SdoWrite};

    #[test]
    fn a_list_is_written_entry_by_entry_or_as_a_whole() {
        let write = |index, subindex, access, data: &[u8]| {
            let (object, data) = (ObjectAddress::new(index, subindex), data.to_vec());
            let (refusal, read_back) = (Refusal::IsError, ReadBack::Compare);
            StartUpStep::Sdo(SdoWrite { object, data, access, refusal, read_back, origin: None })
        };
        let entries = [
            write(CONFIGURED, 0, SdoAccess::Entry, &[0]),
            write(CONFIGURED, 3, SdoAccess::Entry, &[9, 0, 0, 1]),
            write(CONFIGURED, 1, SdoAccess::Entry, &[7, 0, 0, 0]),
            write(DETECTED, 2, SdoAccess::Entry, &[8, 0, 0, 0]),
            write(CONFIGURED, 0, SdoAccess::Entry, &[3]),
        ];
        assert_eq!(written_list(&entries), [7, 0, 0x0100_0009]);
        let whole = write(CONFIGURED, 0, SdoAccess::Complete, &[2, 0, 7, 0, 0, 0, 9, 0, 0, 1]);
        assert_eq!(written_list(&[whole]), [7, 0x0100_0009]);
        let idents = write(CONFIGURED, 1, SdoAccess::Complete, &[7, 0, 0, 0, 9, 0, 0, 1]);
        assert_eq!(written_list(&[idents]), [7, 0x0100_0009]);
        assert_eq!(written_list(&[write(CONFIGURED, 0, SdoAccess::Complete, &[2])]), []);
    }
}
