//! PDOs.

use crate::model::{Pdo, PdoEntry, SlotIndex};
use crate::notes::Notes;
use crate::texts::{name, short};
use crate::xml::Element;

/// Entries of a PDO: as many as its subindices can count.
const ENTRY_LIMIT: usize = 254;
/// PDOs of one direction of a device or module: as many indices as the profile has for them are 512.
const PDO_LIMIT: usize = 2048;

/// An index that may count up with the slot.
pub(crate) fn slot_index(element: Element, notes: &mut Notes) -> SlotIndex {
    if element.is("DependOnSlotGroup", notes) {
        element.problem(
            "an index that counts up with the group of slots isn't understood: it is taken as it stands",
            notes,
        );
    }
    SlotIndex { index: element.u16(notes).unwrap_or(0), depends_on_slot: element.is("DependOnSlot", notes) }
}

/// One more PDO of a list.
pub(crate) fn add(element: Element, pdos: &mut Vec<Pdo>, notes: &mut Notes) {
    if pdos.len() < PDO_LIMIT {
        pdos.extend(read(element, notes));
    } else {
        element.problem(
            format!("there are more than {PDO_LIMIT} PDOs of one direction: this one is left out"),
            notes,
        );
    }
}

/// A PDO; `None` where it has no index.
fn read(element: Element, notes: &mut Notes) -> Option<Pdo> {
    let sync_manager = element.attribute_number("Sm", 0..=31, notes).map(|number| number as u8);
    let mut pdo = Pdo {
        line: element.line(),
        sync_manager,
        fixed: element.is("Fixed", notes),
        mandatory: element.is("Mandatory", notes),
        is_virtual: element.is("Virtual", notes),
        ..Pdo::default()
    };
    let mut has_index = false;
    for child in element.children(notes) {
        match child.name() {
            "Index" => {
                pdo.index = slot_index(child, notes);
                has_index = pdo.index.index != 0;
            }
            "Name" => name(child, &mut pdo.name, notes),
            "Exclude" => pdo.excludes.push(slot_index(child, notes)),
            "Entry" if pdo.entries.len() == ENTRY_LIMIT => {
                child
                    .problem(format!("a PDO has at most {ENTRY_LIMIT} entries: this one is left out"), notes);
                break;
            }
            "Entry" => pdo.entries.push(entry(child, notes)),
            // Which of them may be left out in favour of which.
            "ExcludedSm" => child.set_aside(notes),
            _ => child.skip(notes),
        }
    }
    if !has_index {
        element.problem("the PDO has no index: it is left out", notes);
    }
    has_index.then_some(pdo)
}

fn entry(element: Element, notes: &mut Notes) -> PdoEntry {
    let (mut entry, before) = (PdoEntry::default(), notes.told());
    if element.child("Index").is_none() {
        element.problem("the entry has no index; a gap has 0", notes);
    }
    for child in element.children(notes) {
        match child.name() {
            "Index" => entry.index = slot_index(child, notes),
            "SubIndex" => entry.subindex = child.u8(notes).unwrap_or(0),
            "BitLen" => entry.bits = child.u8(notes).unwrap_or(0),
            "Name" => name(child, &mut entry.name, notes),
            "DataType" => entry.data_type = short(child.text()),
            _ => child.skip(notes),
        }
    }
    // Some makers keep places free by gaps without a bit.
    if entry.bits == 0 && !entry.is_gap() {
        element.problem("the entry has no length of 1 to 255 bits", notes);
    }
    entry.is_unclear = notes.told() != before;
    entry
}
