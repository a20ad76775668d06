//! What somebody should look at before a device is trusted to its file.

use std::collections::BTreeMap;

use super::{Assembly, Command, SENT};
use crate::doubt::Doubt;
use crate::image;
use crate::model::{Pdo, SmUse, SyncManager};

impl Assembly<'_> {
    /// What somebody should look at.
    pub fn doubts(&self) -> Vec<Doubt> {
        let mut doubts: Vec<Doubt> = self.problems().cloned().map(Doubt::Unread).collect();
        doubts.extend(self.default_pdos(true).1);
        doubts.extend(self.default_pdos(false).1);
        let mailboxes = || {
            let of_modules = self.modules.iter().map(|module| &module.mailbox);
            std::iter::once(&self.device.mailbox).chain(of_modules).flatten()
        };
        let count = mailboxes().map(|mailbox| mailbox.foreign_commands).sum();
        if count > 0 {
            doubts.push(Doubt::ForeignCommands { count });
        }
        doubts.extend(self.same_indices());
        if self.device.slots.as_ref().is_some_and(|slots| slots.download_addresses) {
            doubts.push(Doubt::ModuleAddresses);
        }
        doubts.extend(self.too_few_modules());
        doubts.extend(self.alignments());
        doubts.extend(self.unpaired_mailboxes());
        let says = self.device.eeprom.as_ref().map_or(0, |eeprom| eeprom.byte_size);
        let needs = image::content_bytes(self.device);
        if says != 0 && needs > says as usize {
            doubts.push(Doubt::EepromTooSmall { says, needs });
        }
        doubts.extend(self.no_room());
        doubts.extend(self.too_long());
        for Command { command, .. } in self.commands().iter().filter(|one| one.is_sent()) {
            let (line, index) = (command.line, command.index.index);
            if command.data.is_empty() {
                doubts.push(Doubt::NoData { line, index });
            } else if command.complete_access && command.subindex > 1 {
                doubts.push(Doubt::CompleteAccess { line, index, subindex: command.subindex });
            }
        }
        for Command { command, .. } in self.commands() {
            let is_other = |one: &String| !SENT.iter().any(|sent| sent.contains(&one.as_str()));
            let others: Vec<String> = command.transitions.into_iter().filter(is_other).collect();
            if !others.is_empty() {
                let transitions = others.join(", ");
                doubts.push(Doubt::OtherTransition { line: command.line, transitions });
            }
        }
        doubts
    }

    /// The maker's commands that are longer than the dictionary's type of their object.
    fn too_long(&self) -> Vec<Doubt> {
        let mut doubts = Vec::new();
        let increment = self.device.slots.as_ref().and_then(|slots| slots.index_increment);
        for (slot, module) in (1..).zip(&self.modules) {
            for command in
                module.mailbox.iter().filter_map(|one| one.coe.as_ref()).flat_map(|coe| &coe.commands)
            {
                let object = module.dictionary.iter().find(|object| object.index == command.index);
                let entry = object
                    .and_then(|object| object.entries.iter().find(|one| one.subindex == command.subindex));
                let Some(entry) = entry else { continue };
                let (bytes, given) = (command.data.len(), entry.bits.div_ceil(8) as usize);
                if bytes > given {
                    let index = self.place(command.index, slot, increment).index;
                    doubts.push(Doubt::LongerThanItsObject { line: command.line, index, bytes, given });
                }
            }
        }
        doubts
    }

    /// SyncManagers whose mailbox or default process data reach into the area of another.
    fn no_room(&self) -> Vec<Doubt> {
        let managers = &self.device.sync_managers;
        let mut pdos = self.default_pdos(true).0;
        pdos.extend(self.default_pdos(false).0);
        let beyond = |(number, manager): (u8, &SyncManager)| {
            let (start, control) = (manager.start?, manager.control?);
            let own = pdos.iter().filter(|pdo| pdo.sync_manager == Some(number));
            let is_mailbox = matches!(manager.usage, SmUse::MailboxOut | SmUse::MailboxIn);
            let bytes = match is_mailbox {
                true => u32::from(manager.default_size?),
                false => own.map(Pdo::bits).sum::<u32>().div_ceil(8),
            };
            // Buffered mode has three (ETG.1000.4, SyncManager's control).
            let buffers = if control & 3 == 0 { 3 } else { 1 };
            // Of two that begin at the same place the first is told.
            let others =
                (0..=u8::MAX).zip(managers).filter(|(_, other)| !other.is_virtual && !manager.is_virtual);
            let next = others.filter_map(|(at, other)| Some((other.start?, at)));
            let (next, _) = next.filter(|next| *next > (start, number)).min()?;
            let is_beyond = u32::from(start) + buffers * bytes > u32::from(next);
            let doubt = Doubt::NoRoom { sync_manager: number, is_mailbox, bytes, buffers, start, next };
            is_beyond.then_some(doubt)
        };
        (0..=u8::MAX).zip(managers).filter_map(beyond).collect()
    }

    /// Kinds of slots that have fewer modules than their file asks for.
    fn too_few_modules(&self) -> Vec<Doubt> {
        let Some(slots) = &self.device.slots else { return Vec::new() };
        let (mut doubts, mut before) = (Vec::new(), 0);
        for kind in &slots.slots {
            let (least, most) = (kind.least.unwrap_or(0) as usize, kind.most.unwrap_or(0) as usize);
            let own = self.modules.iter().skip(before).take(most);
            let found = own.filter(|module| !module.is_none()).count();
            if found < least && least <= most {
                let [first, last] = [before + 1, before + most];
                doubts.push(Doubt::TooFewModules { first, last, least, found });
            }
            before += most;
        }
        doubts
    }

    /// Groups whose modules' data would begin elsewhere than behind each other.
    fn alignments(&self) -> Vec<Doubt> {
        let groups = self.device.slots.iter().flat_map(|slots| &slots.groups).enumerate();
        let is_used = |group: usize| {
            let modules = self.modules.iter().filter(|module| module.pdo_group == group);
            modules.flat_map(|module| module.rx_pdos.iter().chain(&module.tx_pdos)).next().is_some()
        };
        let aligned = groups.filter(|(group, one)| one.alignment > 1 && is_used(*group));
        aligned.map(|(group, one)| Doubt::Alignment { group, bytes: one.alignment }).collect()
    }

    /// Mailboxes without their counterpart.
    fn unpaired_mailboxes(&self) -> Option<Doubt> {
        let count = |usage| self.device.sync_managers.iter().filter(|one| one.usage == usage).count();
        let [to, from] = [SmUse::MailboxOut, SmUse::MailboxIn].map(count);
        let is_right = [(0, 0), (1, 1)].contains(&(to, from));
        (!is_right).then_some(Doubt::Mailboxes { to, from })
    }

    /// Slots whose modules' PDOs or mapped objects have the same indices: each pair of slots once.
    fn same_indices(&self) -> Vec<Doubt> {
        let (mut first, mut pairs) = (BTreeMap::new(), BTreeMap::new());
        let Some(slots) = &self.device.slots else { return Vec::new() };
        for (slot, module) in (1..).zip(&self.modules) {
            let pdos = module.rx_pdos.iter().chain(&module.tx_pdos);
            for pdo in pdos.map(|pdo| self.place_pdo(pdo, slot, slots)) {
                let objects = pdo.entries.iter().filter(|entry| !entry.is_gap());
                let objects = objects.map(|entry| (entry.index.index, Some(entry.subindex)));
                for key in std::iter::once((pdo.index.index, None)).chain(objects) {
                    let other = *first.entry(key).or_insert(slot);
                    if other != slot {
                        pairs.entry([other, slot]).or_insert(key.0);
                    }
                }
            }
        }
        pairs.into_iter().map(|(slots, index)| Doubt::SameIndices { slots, index }).collect()
    }
}
