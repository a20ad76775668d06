//! A device as it is plugged together: with modules in its slots.

mod doubts;

use std::collections::{BTreeMap, BTreeSet};

use crate::dictionary::{OdObject, usual_bits};
use crate::doubt::Doubt;
use crate::model::{Device, InitCommand, Module, Pdo, PdoEntry, SlotIndex, Slots, SmUse};
use crate::notes::FileNote;

/// Transitions whose commands are sent in PRE-OP, and those whose commands are sent in SAFE-OP.
const SENT: [&[&str]; 2] = [&["IP", "PS"], &["SO"]];

/// The object that is told which modules are configured (ETG.5001).
pub(crate) const CONFIGURED_MODULES: u16 = 0xF030;

/// A device with modules in its slots, the first one in slot 1.
#[derive(Clone, Debug)]
pub struct Assembly<'a> {
    /// The device.
    pub device: &'a Device,
    /// Its modules, in the order of slots.
    pub modules: Vec<&'a Module>,
}

/// Why modules don't go together with a device.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AssemblyError {
    /// It has no slots.
    #[error("{device} has no slots for modules")]
    NoSlots {
        /// The device's type.
        device: String,
    },
    /// There are more of them than it has slots.
    #[error("{device} has slots for {most} modules, asked are {found}")]
    TooMany {
        /// The device's type.
        device: String,
        /// Slots.
        most: usize,
        /// Modules.
        found: usize,
    },
    /// It doesn't fit the slot.
    #[error(
        "slot {slot} of {device} takes modules of the classes {classes}, {module} is of the class \"{class}\""
    )]
    WrongClass {
        /// The device's type.
        device: String,
        /// Slot, from 1.
        slot: usize,
        /// Classes that fit.
        classes: String,
        /// The module's type.
        module: String,
        /// Its class.
        class: String,
    },
    /// Where modules go can't be read.
    #[error("numbers of the slots of {device} can't be read: nobody knows where modules go")]
    UnclearSlots {
        /// The device's type.
        device: String,
    },
    /// A module is to be told to the device and its file doesn't say as what.
    #[error(
        "the file has no ModuleIdent of {module} in slot {slot} that can be read, and {device} is to be told it"
    )]
    NoIdent {
        /// The device's type.
        device: String,
        /// Slot, from 1.
        slot: usize,
        /// The module's type.
        module: String,
    },
    /// An index would be beyond 0xFFFF.
    #[error("in slot {slot} the index 0x{index:04X} would count up beyond 0xFFFF")]
    Index {
        /// Slot, from 1.
        slot: usize,
        /// Index in the first slot.
        index: u16,
    },
}

/// Where a command comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CommandSource {
    /// The device's own.
    Device,
    /// The list of modules that the device is to be told.
    ModuleList,
    /// A module's.
    Module {
        /// Its slot, from 1.
        slot: usize,
    },
}

/// An SDO to be written, its indices counted up with the slot.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Command {
    /// The command.
    pub command: InitCommand,
    /// Where it comes from.
    pub source: CommandSource,
}

impl<'a> Assembly<'a> {
    /// The device with these modules in slots 1 and up.
    pub fn new(device: &'a Device, modules: Vec<&'a Module>) -> Result<Self, AssemblyError> {
        let name = || device.type_name.clone();
        let assembly = Assembly { device, modules };
        if assembly.modules.is_empty() {
            return Ok(assembly);
        }
        let Some(slots) = &device.slots else { return Err(AssemblyError::NoSlots { device: name() }) };
        if slots.is_unclear() {
            return Err(AssemblyError::UnclearSlots { device: name() });
        }
        // The list of modules (0xF030) has 255 subindices.
        let most = if slots.download_idents { places(slots).min(255) } else { places(slots) };
        let found = assembly.modules.len();
        if found > most {
            return Err(AssemblyError::TooMany { device: name(), most, found });
        }
        for (slot, module) in (1..).zip(&assembly.modules).filter(|(_, module)| !module.is_none()) {
            let kind = kind_of_slot(slots, slot);
            let fits = kind.is_none_or(|kind| {
                let by_ident = module.ident.is_some_and(|ident| kind.idents.contains(&ident));
                let free = kind.classes.is_empty() && kind.idents.is_empty();
                free || by_ident || kind.classes.contains(&module.class)
            });
            if !fits {
                let classes = kind.map_or(String::new(), |kind| kind.classes.join(", "));
                let (module, class) = (module.type_name.clone(), module.class.clone());
                return Err(AssemblyError::WrongClass { device: name(), slot, classes, module, class });
            }
            if slots.download_idents && module.ident.is_none() {
                return Err(AssemblyError::NoIdent {
                    device: name(),
                    slot,
                    module: module.type_name.clone(),
                });
            }
            let too_far = indices_of(module, slots)
                .find(|(index, increment)| assembly.shifted(*index, slot, *increment).is_none());
            if let Some((wrong, _)) = too_far {
                return Err(AssemblyError::Index { slot, index: wrong.index });
            }
        }
        Ok(assembly)
    }

    fn shifted(&self, index: SlotIndex, slot: usize, increment: Option<u16>) -> Option<u16> {
        if !index.depends_on_slot {
            return Some(index.index);
        }
        let shift = u16::try_from(slot - 1).ok()?.checked_mul(increment?)?;
        index.index.checked_add(shift)
    }

    fn place(&self, index: SlotIndex, slot: usize, increment: Option<u16>) -> SlotIndex {
        let index = self.shifted(index, slot, increment).unwrap_or(index.index);
        SlotIndex { index, depends_on_slot: false }
    }

    fn place_pdo(&self, pdo: &Pdo, slot: usize, slots: &Slots) -> Pdo {
        let mut placed = pdo.clone();
        placed.index = self.place(pdo.index, slot, slots.pdo_increment);
        for excluded in &mut placed.excludes {
            *excluded = self.place(*excluded, slot, slots.pdo_increment);
        }
        for entry in &mut placed.entries {
            entry.index = self.place(entry.index, slot, slots.index_increment);
        }
        placed
    }

    /// Every PDO of a direction, those of modules with the indices of their slots: groups in their order, in each the
    /// device's own first.
    pub fn pdos(&self, outputs: bool) -> Vec<Pdo> {
        let own = if outputs { &self.device.rx_pdos } else { &self.device.tx_pdos };
        let Some(slots) = &self.device.slots else { return own.clone() };
        let mut placed: Vec<(usize, Pdo)> =
            own.iter().map(|pdo| (self.device.pdo_group, pdo.clone())).collect();
        for (slot, module) in (1..).zip(&self.modules) {
            let own = if outputs { &module.rx_pdos } else { &module.tx_pdos };
            placed.extend(own.iter().map(|pdo| (module.pdo_group, self.place_pdo(pdo, slot, slots))));
        }
        placed.sort_by_key(|(group, _)| *group);
        placed.into_iter().map(|(_, pdo)| pdo).collect()
    }

    /// The PDOs that are assigned where nobody wishes otherwise, each with its SyncManager, and what is doubtful.
    pub fn default_pdos(&self, outputs: bool) -> (Vec<Pdo>, Vec<Doubt>) {
        let usage = if outputs { SmUse::Outputs } else { SmUse::Inputs };
        let managers = &self.device.sync_managers;
        let first = managers.iter().position(|one| one.usage == usage).map(|number| number as u8);
        let all = self.pdos(outputs);
        // Those that are chosen, and those that these exclude, each with who does.
        let (mut indices, mut barred) = (BTreeSet::new(), BTreeMap::new());
        let (mut chosen, mut doubts): (Vec<Pdo>, Vec<Doubt>) = (Vec::new(), Vec::new());
        for pdo in &all {
            let index = pdo.index.index;
            let sync_manager = match (pdo.sync_manager, first) {
                (Some(number), _) => number,
                (None, Some(sync_manager)) if pdo.mandatory => {
                    doubts.push(Doubt::MandatoryWithoutSyncManager { pdo: index, sync_manager });
                    sync_manager
                }
                _ => continue,
            };
            if managers.get(usize::from(sync_manager)).is_none_or(|one| one.usage != usage) {
                doubts.push(Doubt::WrongSyncManager { pdo: index, sync_manager });
                continue;
            }
            if indices.contains(&index) {
                doubts.push(Doubt::SamePdo { pdo: index, line: pdo.line });
                continue;
            }
            let (kind, [first, last]) =
                if outputs { ("RxPdo", [0x1600, 0x17FF]) } else { ("TxPdo", [0x1A00, 0x1BFF]) };
            if !(first..=last).contains(&index) {
                doubts.push(Doubt::OddPdoIndex { line: pdo.line, kind, index, first, last });
            }
            let excludes = || pdo.excludes.iter().map(|one| one.index);
            let stays = barred.get(&index).copied().or_else(|| excludes().find(|one| indices.contains(one)));
            if let Some(stays) = stays {
                doubts.push(Doubt::Excluded { stays, left_out: index });
                continue;
            }
            let contradicts = |entry: &&PdoEntry| {
                let usual = entry.type_code().map_or(0, usual_bits);
                !entry.is_unclear && usual != 0 && usual != u32::from(entry.bits)
            };
            doubts.extend(pdo.entries.iter().filter(contradicts).map(|entry| Doubt::OtherType {
                line: pdo.line,
                index: entry.index.index,
                bits: entry.bits,
                data_type: entry.data_type.clone(),
            }));
            indices.insert(index);
            excludes().for_each(|one| {
                barred.entry(one).or_insert(index);
            });
            chosen.push(Pdo { sync_manager: Some(sync_manager), ..pdo.clone() });
        }
        if chosen.is_empty() && !all.is_empty() {
            let kind = if outputs { "RxPdo" } else { "TxPdo" };
            doubts.push(Doubt::NoDefault { kind, count: all.len() });
        }
        (chosen, doubts)
    }

    /// What the device wants written, in the order in which it is sent: the list of modules, its own commands, those of
    /// its modules by slot.
    pub fn commands(&self) -> Vec<Command> {
        let mut commands = self.module_list();
        let of = |mailbox: &Option<crate::model::Mailbox>| {
            mailbox
                .as_ref()
                .and_then(|mailbox| mailbox.coe.as_ref())
                .map_or(Vec::new(), |coe| coe.commands.clone())
        };
        commands.extend(
            of(&self.device.mailbox)
                .into_iter()
                .map(|command| Command { command, source: CommandSource::Device }),
        );
        let increment = self.device.slots.as_ref().and_then(|slots| slots.index_increment);
        for (slot, module) in (1..).zip(&self.modules) {
            for command in of(&module.mailbox) {
                let index = self.place(command.index, slot, increment);
                let command = InitCommand { index, ..command };
                commands.push(Command { command, source: CommandSource::Module { slot } });
            }
        }
        commands
    }

    /// The modules' idents into 0xF030: emptied, filled, counted.
    fn module_list(&self) -> Vec<Command> {
        let wanted = self.device.slots.as_ref().is_some_and(|slots| slots.download_idents);
        if !wanted || self.modules.is_empty() {
            return Vec::new();
        }
        let write = |subindex: u8, data: &[u8], comment: String| {
            let index = SlotIndex { index: CONFIGURED_MODULES, depends_on_slot: false };
            let (transitions, data) = (vec!["PS".to_owned()], data.to_vec());
            let command =
                InitCommand { transitions, index, subindex, data, comment, ..InitCommand::default() };
            Command { command, source: CommandSource::ModuleList }
        };
        let mut commands = vec![write(0, &[0], "the list of modules is emptied".to_owned())];
        for (slot, module) in (1..=u8::MAX).zip(&self.modules) {
            let ident = module.ident.unwrap_or(0);
            let what = if module.is_none() { "empty" } else { &module.type_name };
            commands.push(write(slot, &ident.to_le_bytes(), format!("slot {slot}: {what}")));
        }
        let count = self.modules.len() as u8;
        commands.push(write(0, &[count], "how many modules there are".to_owned()));
        commands
    }

    /// The object dictionary, modules' objects with the indices of their slots.
    pub fn objects(&self) -> Vec<OdObject> {
        let mut objects = self.device.dictionary.clone();
        let increments = self
            .device
            .slots
            .as_ref()
            .map_or((None, None), |slots| (slots.index_increment, slots.pdo_increment));
        for (slot, module) in (1..).zip(&self.modules) {
            for object in &module.dictionary {
                let increment = if object.is_pdo() { increments.1 } else { increments.0 };
                let index = self.place(object.index, slot, increment);
                objects.push(OdObject { index, ..object.clone() });
            }
        }
        // A maker's own command is right where its dictionary's type is too short for it.
        for Command { command, .. } in self.commands() {
            let entries = objects.iter_mut().filter(|object| object.index.index == command.index.index);
            let mut entries = entries.flat_map(|object| &mut object.entries);
            if let Some(entry) = entries.find(|entry| entry.subindex == command.subindex && entry.is_text()) {
                entry.bits = entry.bits.max(8 * command.data.len() as u32);
            }
        }
        objects
    }

    /// What of the device and its modules can't be read or contradicts itself.
    pub fn problems(&self) -> impl Iterator<Item = &FileNote> {
        let of_modules = self.modules.iter().flat_map(|module| &module.problems);
        self.device.problems.iter().chain(of_modules)
    }
}

impl Command {
    /// Whether it is sent in PRE-OP on the way up.
    pub fn is_for_pre_op(&self) -> bool {
        self.is_for(SENT[0])
    }

    /// Whether it is sent in SAFE-OP on the way up.
    pub fn is_for_safe_op(&self) -> bool {
        self.is_for(SENT[1])
    }

    fn is_for(&self, transitions: &[&str]) -> bool {
        self.command.transitions.iter().any(|one| transitions.contains(&one.as_str()))
    }

    /// Whether it is sent on the way up at all.
    fn is_sent(&self) -> bool {
        self.is_for_pre_op() || self.is_for_safe_op()
    }

    /// Whether a robot's file can have it sent as one of a SubDevice's `parameters`.
    pub fn is_parameter(&self) -> bool {
        let InitCommand { complete_access, subindex, data, .. } = &self.command;
        self.is_sent() && !data.is_empty() && (!complete_access || *subindex <= 1)
    }
}

/// Every index of a module, with how far it counts up from slot to slot.
fn indices_of<'a>(
    module: &'a Module,
    slots: &Slots,
) -> impl Iterator<Item = (SlotIndex, Option<u16>)> + use<'a> {
    let (objects, pdos) = (slots.index_increment, slots.pdo_increment);
    let of_pdos = module.rx_pdos.iter().chain(&module.tx_pdos).flat_map(move |pdo| {
        let own = std::iter::once(pdo.index).chain(pdo.excludes.iter().copied()).map(move |one| (one, pdos));
        own.chain(pdo.entries.iter().map(move |entry| (entry.index, objects)))
    });
    let of_objects = module
        .dictionary
        .iter()
        .map(move |object| (object.index, if object.is_pdo() { pdos } else { objects }));
    let coe = module.mailbox.as_ref().and_then(|mailbox| mailbox.coe.as_ref());
    let of_commands = coe.into_iter().flat_map(|coe| &coe.commands).map(move |one| (one.index, objects));
    of_pdos.chain(of_objects).chain(of_commands)
}

/// How many modules fit.
fn places(slots: &Slots) -> usize {
    slots.slots.iter().map(|slot| slot.most.unwrap_or(0) as usize).sum()
}

/// The kind of a slot, from 1.
fn kind_of_slot(slots: &Slots, number: usize) -> Option<&crate::model::Slot> {
    let mut before = 0;
    slots.slots.iter().find(|slot| {
        before += slot.most.unwrap_or(0) as usize;
        number <= before
    })
}
