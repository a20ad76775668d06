//! Modular devices (ETG.5001): the modules that are plugged in, against those for which the device is configured.

use alloc::vec::Vec;

use crate::bus::Bus;
use crate::error::SetUpError;
use crate::mailbox::{MailboxError, SdoAccess};
use crate::wire::coe::ObjectAddress;
use crate::wire::{Clock, Link};

/// Module idents by slot: for which the device is configured.
pub const CONFIGURED: u16 = 0xF030;
/// Module idents by slot: what it detected.
pub const DETECTED: u16 = 0xF050;
/// Slots that are looked at.
const MOST_SLOTS: u8 = 254;

/// What a modular device has in its slots; 0 is an empty one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Modules {
    /// Idents for which it is configured (0xF030); empty where it has no such object.
    pub configured: Vec<u32>,
    /// Idents that it detected (0xF050).
    pub detected: Vec<u32>,
}

impl Modules {
    /// Slots, from 1, in which something else is than was configured: slot, configured, detected.
    ///
    /// A device that isn't configured yet takes what it detected.
    pub fn differences(&self) -> Vec<(usize, u32, u32)> {
        if self.configured.iter().all(|ident| *ident == 0) {
            return Vec::new();
        }
        let at = |list: &[u32], slot: usize| list.get(slot).copied().unwrap_or(0);
        let slots = 0..self.configured.len().max(self.detected.len());
        slots
            .map(|slot| (slot + 1, at(&self.configured, slot), at(&self.detected, slot)))
            .filter(|(_, configured, detected)| configured != detected)
            .collect()
    }
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

    /// A list of idents; `None` where there is no such object.
    fn read_idents(&mut self, position: u16, index: u16) -> Result<Option<Vec<u32>>, SetUpError> {
        let mut idents = Vec::new();
        let read = |bus: &mut Self, subindex| match bus.sdo_read(
            position,
            ObjectAddress::new(index, subindex),
            SdoAccess::Entry,
        ) {
            Ok(data) => {
                let mut bytes = [0; 4];
                let length = data.len().min(4);
                bytes[..length].copy_from_slice(&data[..length]);
                Ok(Some(u32::from_le_bytes(bytes)))
            }
            Err(SetUpError::Request { cause: MailboxError::Aborted { .. }, .. }) => Ok(None),
            Err(other) => Err(other),
        };
        let Some(count) = read(self, 0)? else { return Ok(None) };
        for subindex in 1..=(count.min(u32::from(MOST_SLOTS)) as u8) {
            idents.push(read(self, subindex)?.unwrap_or(0));
        }
        Ok(Some(idents))
    }
}
