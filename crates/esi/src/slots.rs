//! Slots and modules.

use std::collections::BTreeMap;

use crate::model::{Module, PdoGroup, Slot, Slots};
use crate::notes::Notes;
use crate::texts::{name, short};
use crate::xml::Element;
use crate::{dictionary, mailbox, pdo};

/// Slots of a device, modules of all kinds.
const SLOT_LIMIT: i64 = 4096;

/// The slots of a device.
pub(crate) fn read(element: Element, notes: &mut Notes) -> Slots {
    let mut increment =
        |name| element.attribute_number_or(name, 0, 0..=0x1000, notes).map(|number| number as u16);
    let (index_increment, pdo_increment) = (increment("SlotIndexIncrement"), increment("SlotPdoIncrement"));
    let mut slots = Slots {
        download_idents: element.is("DownloadModuleIdentList", notes)
            | element.is("DownloadModuleList", notes),
        download_addresses: element.is("DownloadModuleAddressList", notes),
        index_increment,
        pdo_increment,
        ..Slots::default()
    };
    for child in element.children(notes) {
        match child.name() {
            "Slot" => slots.slots.push(slot(child, notes)),
            "ModulePdoGroup" => {
                let mut number = |name, most| child.attribute_number(name, 0..=most, notes);
                slots.groups.push(PdoGroup {
                    alignment: number("Alignment", 255).unwrap_or(1) as u8,
                    rx_pdo: number("RxPdo", 0xFFFF).map(|index| index as u16),
                    tx_pdo: number("TxPdo", 0xFFFF).map(|index| index as u16),
                });
            }
            "Modules" => slots.modules.extend(modules(child, notes)),
            _ => child.skip(notes),
        }
    }
    slots
}

fn slot(element: Element, notes: &mut Notes) -> Slot {
    let mut number = |name, absent| {
        element.attribute_number_or(name, absent, 0..=SLOT_LIMIT, notes).map(|number| number as u32)
    };
    let (least, most) = (number("MinInstances", 0), number("MaxInstances", 1));
    if let (Some(least), Some(most)) = (least, most)
        && least > most
    {
        let text = format!(
            "at least {least} modules are to be there (MinInstances), and at most {most} (MaxInstances)"
        );
        element.problem(text, notes);
    }
    let mut slot = Slot { least, most, ..Slot::default() };
    for child in element.children(notes) {
        match child.name() {
            "Name" => name(child, &mut slot.name, notes),
            "ModuleClass" => {
                for part in child.children(notes) {
                    match part.name() {
                        "Class" => slot.classes.push(short(part.text())),
                        "Name" => part.set_aside(notes),
                        _ => part.skip(notes),
                    }
                }
            }
            "ModuleIdent" => {
                slot.idents.extend(child.u32(notes));
            }
            _ => child.skip(notes),
        }
    }
    slot
}

/// The modules of a list.
pub(crate) fn modules(element: Element, notes: &mut Notes) -> Vec<Module> {
    let (mut modules, mut lines) = (Vec::new(), BTreeMap::new());
    for child in element.children(notes) {
        if child.name() != "Module" {
            child.skip(notes);
            continue;
        }
        let read = module(child, notes);
        let line = *lines.entry(read.ident).or_insert(read.line);
        if line != read.line && read.ident.is_some() {
            child.problem(
                format!("its ModuleIdent is that of the module of line {line}, which is meant by it"),
                notes,
            );
        }
        modules.push(read);
    }
    modules
}

fn module(element: Element, notes: &mut Notes) -> Module {
    let before = notes.told();
    let mut module = Module { line: element.line(), ..Module::default() };
    let mut profiles = Vec::new();
    for child in element.children(notes) {
        match child.name() {
            "Type" => {
                module.type_name = short(child.text());
                let mut number = |name, most| child.attribute_number(name, 0..=most, notes);
                module.ident = number("ModuleIdent", 0xFFFF_FFFF).map(|ident| ident as u32);
                module.pdo_group = number("ModulePdoGroup", 255).unwrap_or(0) as usize;
                module.class = short(child.attribute("ModuleClass").unwrap_or_default().to_owned());
            }
            "Name" => name(child, &mut module.names, notes),
            "RxPdo" => pdo::add(child, &mut module.rx_pdos, notes),
            "TxPdo" => pdo::add(child, &mut module.tx_pdos, notes),
            "Mailbox" => module.mailbox = Some(mailbox::read(child, notes)),
            "Profile" => dictionary::profile(child, &mut profiles, &mut module.dictionary, notes),
            _ => child.skip(notes),
        }
    }
    if module.ident.is_none() {
        element.problem("the module has no ModuleIdent: it can't be told to the device", notes);
    }
    module.problems = notes.since(before, element);
    module
}
