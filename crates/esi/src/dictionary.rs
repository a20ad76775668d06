//! The object dictionary: types, objects made of them, defaults.

use std::collections::BTreeMap;

use crate::model::SlotIndex;
use crate::notes::Notes;
use crate::pdo::slot_index;
use crate::texts::short;
use crate::xml::{Element, quoted};

/// Entries of all objects of a device; a device has some thousand.
const ENTRY_LIMIT: usize = 100_000;
/// Bits of an entry: 8 KiB.
const BIT_LIMIT: i64 = 1 << 16;
/// Most items of a type that become entries: twice as many as there are subindices.
const ITEM_LIMIT: usize = 512;

/// Who may do what with an entry.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ObjectRights {
    /// By SDO.
    pub read: bool,
    /// In PRE-OP, SAFE-OP and OP: whether it may be written there.
    pub write_in: [bool; 3],
    /// It may stand in RxPDOs.
    pub rx_pdo: bool,
    /// It may stand in TxPDOs.
    pub tx_pdo: bool,
}

/// An entry of an object.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OdEntry {
    /// Subindex.
    pub subindex: u8,
    /// Name.
    pub name: String,
    /// Type by CoE's code (ETG.1020); 0 where the file names one that is not known.
    pub type_code: u16,
    /// Bits.
    pub bits: u32,
    /// Rights.
    pub rights: ObjectRights,
    /// Its value at first, as it is sent; empty where the file gives none.
    pub default: Vec<u8>,
}

impl OdEntry {
    /// Whether its values may have any length up to its own.
    pub fn is_text(&self) -> bool {
        matches!(self.type_code, 0x09 | 0x0A)
    }
}

/// An object's shape.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OdShape {
    /// One value.
    #[default]
    Variable,
    /// Several values of one type.
    Array,
    /// Several values.
    Record,
}

/// An object.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct OdObject {
    /// Index.
    pub index: SlotIndex,
    /// Name.
    pub name: String,
    /// Shape.
    pub shape: OdShape,
    /// Entries by rising subindex.
    pub entries: Vec<OdEntry>,
}

impl OdObject {
    /// Whether it is the map of a PDO: its index counts up with the slot as PDOs do.
    pub(crate) fn is_pdo(&self) -> bool {
        (0x1600..=0x1BFF).contains(&self.index.index)
    }
}

#[derive(Clone, Debug, Default)]
struct Type {
    bits: u32,
    base: Option<String>,
    /// First subindex and number of entries.
    array: Option<(u8, u8)>,
    items: Vec<Item>,
}

#[derive(Clone, Debug, Default)]
struct Item {
    subindex: Option<u8>,
    name: String,
    kind: String,
    bits: u32,
    flags: Option<ObjectRights>,
}

/// A profile: its numbers and its dictionary.
pub(crate) fn profile(
    element: Element,
    numbers: &mut Vec<u32>,
    dictionary: &mut Vec<OdObject>,
    notes: &mut Notes,
) {
    for child in element.children(notes) {
        match child.name() {
            "ProfileNo" => numbers.extend(child.u32(notes)),
            "Dictionary" => {
                let mut types = BTreeMap::new();
                for list in child.children(notes) {
                    match list.name() {
                        "DataTypes" => read_types(list, &mut types, notes),
                        "Objects" => read_objects(list, &types, dictionary, notes),
                        _ => list.skip(notes),
                    }
                }
            }
            // Additional text for tools.
            "AddInfo" => child.set_aside(notes),
            _ => child.skip(notes),
        }
    }
}

fn read_types(list: Element, types: &mut BTreeMap<String, Type>, notes: &mut Notes) {
    for child in list.children(notes) {
        if child.name() != "DataType" {
            child.skip(notes);
            continue;
        }
        let (mut name, mut read) = (String::new(), Type::default());
        for part in child.children(notes) {
            match part.name() {
                "Name" => name = part.text(),
                "BitSize" => read.bits = part.number(0..=BIT_LIMIT * 16, notes).unwrap_or(0) as u32,
                "BaseType" => read.base = Some(part.text()),
                "ArrayInfo" => read.array = array(part, notes),
                "SubItem" => read.items.push(item(part, notes)),
                // Names of values.
                "EnumInfo" => part.set_aside(notes),
                _ => part.skip(notes),
            }
        }
        types.insert(name, read);
    }
}

fn array(element: Element, notes: &mut Notes) -> Option<(u8, u8)> {
    let (mut first, mut count) = (0, None);
    for child in element.children(notes) {
        match child.name() {
            "LBound" => first = child.u8(notes).unwrap_or(0),
            "Elements" => count = child.u8(notes),
            _ => child.skip(notes),
        }
    }
    count.map(|count| (first, count))
}

fn item(element: Element, notes: &mut Notes) -> Item {
    let mut item = Item::default();
    for child in element.children(notes) {
        match child.name() {
            "SubIdx" => item.subindex = child.u8(notes),
            "Name" => item.name = short(child.text()),
            "Type" => item.kind = child.text(),
            "BitSize" => item.bits = child.number(0..=BIT_LIMIT * 16, notes).unwrap_or(0) as u32,
            // Where it stands in the whole object: entries stand one behind the other.
            "BitOffs" => child.set_aside(notes),
            "Flags" => item.flags = Some(rights(child, notes)),
            _ => child.skip(notes),
        }
    }
    item
}

/// PRE-OP, SAFE-OP and OP, where `PreOP_SafeOP` and the like name some of them (ETG.2000, `WriteRestrictions`).
fn states_of(text: &str) -> Option<[bool; 3]> {
    let names = ["PreOP", "SafeOP", "OP"];
    let is = |one: &str, name: &str| one.eq_ignore_ascii_case(name);
    let are_known = text.split('_').all(|one| names.iter().any(|name| is(one, name)));
    are_known.then(|| names.map(|name| text.split('_').any(|one| is(one, name))))
}

fn rights(element: Element, notes: &mut Notes) -> ObjectRights {
    let mut rights = ObjectRights { read: true, ..ObjectRights::default() };
    for child in element.children(notes) {
        match child.name() {
            "Access" => {
                let access = child.text();
                rights.read = access != "wo";
                rights.write_in = match child.attribute("WriteRestrictions") {
                    _ if access == "ro" => [false; 3],
                    Some(states) => states_of(states).unwrap_or_else(|| {
                        let text = format!(
                            "WriteRestrictions: expected PreOP, SafeOP, OP with _ between them, found {}",
                            quoted(states)
                        );
                        child.problem(text, notes);
                        [true; 3]
                    }),
                    None => [true; 3],
                };
            }
            "PdoMapping" => {
                let mapping = child.text().to_ascii_uppercase();
                rights.rx_pdo = mapping.contains('R');
                rights.tx_pdo = mapping.contains('T');
            }
            // Mandatory or optional, and other hints for tools.
            "Category" | "SdoAccess" | "Backup" | "Setting" | "SafetyMapping" => child.set_aside(notes),
            _ => child.skip(notes),
        }
    }
    rights
}

fn read_objects(
    list: Element,
    types: &BTreeMap<String, Type>,
    dictionary: &mut Vec<OdObject>,
    notes: &mut Notes,
) {
    let mut entries = dictionary.iter().map(|object| object.entries.len()).sum::<usize>();
    for child in list.children(notes) {
        if child.name() != "Object" {
            child.skip(notes);
            continue;
        }
        let Some(object) = read_object(child, types, notes) else { continue };
        entries += object.entries.len();
        if entries > ENTRY_LIMIT {
            child.problem(
                format!("the dictionary has more than {ENTRY_LIMIT} entries: the rest is left out"),
                notes,
            );
            return;
        }
        dictionary.push(object);
    }
}

fn read_object(element: Element, types: &BTreeMap<String, Type>, notes: &mut Notes) -> Option<OdObject> {
    let (mut object, mut kind, mut bits) = (OdObject::default(), String::new(), 0);
    let (mut own, mut default, mut items) = (None, Vec::new(), Vec::new());
    for child in element.children(notes) {
        match child.name() {
            "Index" => object.index = slot_index(child, notes),
            "Name" => object.name = short(child.text()),
            "Type" => kind = child.text(),
            "BitSize" => bits = child.number(0..=BIT_LIMIT * 16, notes).unwrap_or(0) as u32,
            "Info" => (default, items) = info(child, notes),
            "Flags" => own = Some(rights(child, notes)),
            _ => child.skip(notes),
        }
    }
    if object.index.index == 0 {
        element.problem("the object has no index: it is left out", notes);
        return None;
    }
    let plain = ObjectRights { read: true, ..ObjectRights::default() };
    match types.get(&kind).filter(|kind| !kind.items.is_empty()) {
        None => {
            let rights = own.unwrap_or(plain);
            let (type_code, bits) = simple(types, &kind, bits);
            object.entries =
                vec![OdEntry { subindex: 0, name: object.name.clone(), type_code, bits, rights, default }];
        }
        Some(record) => {
            object.entries = entries(types, record, own.unwrap_or(plain));
            let is_array = record.items.iter().any(|item| item.subindex.is_none());
            object.shape = if is_array { OdShape::Array } else { OdShape::Record };
            for (entry, value) in object.entries.iter_mut().zip(items) {
                entry.default = value;
            }
        }
    }
    let long = object.entries.iter().find(|entry| i64::from(entry.bits) > BIT_LIMIT);
    if let Some(entry) = long {
        let text = format!(
            "subindex {} has {} bits, at most {BIT_LIMIT} are read: the object is left out",
            entry.subindex, entry.bits
        );
        element.problem(text, notes);
        return None;
    }
    Some(object)
}

/// A default value, and those of the subindices in order.
fn info(element: Element, notes: &mut Notes) -> (Vec<u8>, Vec<Vec<u8>>) {
    let (mut default, mut items) = (Vec::new(), Vec::new());
    for child in element.children(notes) {
        match child.name() {
            "DefaultData" => default = child.bytes(BIT_LIMIT as usize / 8, notes).unwrap_or_default(),
            "SubItem" => items.push(sub_item(child, notes)),
            // Decimal text, bounds and units: for tools that show values.
            "DefaultValue" | "DefaultString" | "MinData" | "MaxData" | "MinValue" | "MaxValue" | "Unit" => {
                child.set_aside(notes);
            }
            _ => child.skip(notes),
        }
    }
    (default, items)
}

/// The default value of a subindex.
fn sub_item(element: Element, notes: &mut Notes) -> Vec<u8> {
    let mut default = Vec::new();
    for child in element.children(notes) {
        match child.name() {
            "Info" => default = info(child, notes).0,
            // As in the object's type.
            "Name" => child.set_aside(notes),
            _ => child.skip(notes),
        }
    }
    default
}

fn entries(types: &BTreeMap<String, Type>, record: &Type, own: ObjectRights) -> Vec<OdEntry> {
    let mut entries: Vec<OdEntry> = Vec::new();
    for item in record.items.iter().take(ITEM_LIMIT) {
        let rights = item.flags.unwrap_or(own);
        match item.subindex {
            Some(subindex) => {
                let (type_code, bits) = simple(types, &item.kind, item.bits);
                let name = item.name.clone();
                entries.push(OdEntry { subindex, name, type_code, bits, rights, default: Vec::new() });
            }
            None => {
                let Some(array) = types.get(&item.kind) else { continue };
                let (first, count) = array.array.unwrap_or((1, 0));
                let base = array.base.as_deref().unwrap_or_default();
                let each = array.bits.checked_div(u32::from(count)).unwrap_or(0);
                let (type_code, bits) = simple(types, base, each);
                for subindex in (first..=u8::MAX).take(usize::from(count)) {
                    let name = format!("SubIndex {subindex:03}");
                    entries.push(OdEntry { subindex, name, type_code, bits, rights, default: Vec::new() });
                }
            }
        }
    }
    entries.sort_by_key(|entry| entry.subindex);
    entries.dedup_by_key(|entry| entry.subindex);
    entries
}

/// Code and bits of a type that is no record; arrays of bytes are octet strings.
fn simple(types: &BTreeMap<String, Type>, name: &str, bits: u32) -> (u16, u32) {
    if let Some(code) = type_code(name) {
        let own = types.get(name).map_or(0, |known| known.bits);
        return (code, if bits != 0 { bits } else { own.max(usual_bits(code)) });
    }
    let Some(known) = types.get(name) else { return (0, bits) };
    let bits = if bits != 0 { bits } else { known.bits };
    if known.array.is_some() {
        return (0x0A, bits);
    }
    (known.base.as_deref().and_then(type_code).unwrap_or(0), bits)
}

/// CoE's code of a base type (ETG.1020).
pub(crate) fn type_code(name: &str) -> Option<u16> {
    let bits = name.strip_prefix("BIT").and_then(|bits| bits.parse::<u16>().ok());
    if let Some(bits) = bits.filter(|bits| (1..=8).contains(bits)) {
        return Some(0x2F + bits);
    }
    if name.starts_with("STRING(") || name == "STRING" {
        return Some(0x09);
    }
    Some(match name {
        "BOOL" | "BOOLEAN" => 0x01,
        "SINT" => 0x02,
        "INT" => 0x03,
        "DINT" => 0x04,
        "USINT" => 0x05,
        "UINT" => 0x06,
        "UDINT" => 0x07,
        "REAL" => 0x08,
        "LREAL" => 0x11,
        "LINT" => 0x15,
        "ULINT" => 0x1B,
        "BYTE" => 0x1E,
        "WORD" => 0x1F,
        "DWORD" => 0x20,
        "BITARR8" => 0x2D,
        "BITARR16" => 0x2E,
        "BITARR32" => 0x2F,
        _ => return None,
    })
}

pub(crate) fn usual_bits(code: u16) -> u32 {
    match code {
        0x01 => 1,
        0x02 | 0x05 | 0x1E | 0x2D => 8,
        0x03 | 0x06 | 0x1F | 0x2E => 16,
        0x04 | 0x07 | 0x08 | 0x20 | 0x2F => 32,
        0x11 | 0x15 | 0x1B => 64,
        0x30..=0x37 => u32::from(code) - 0x2F,
        _ => 0,
    }
}
