//! A SubDevice's object dictionary with its values, by SDO Information.

use crate::progress;
use crate::target::AnyBus;
use crate::value::DataType;
use omnibase_ethercat::SetUpError;
use omnibase_ethercat::mailbox::EntryDescription;
use omnibase_ethercat::start_up::SdoAccess;
use omnibase_ethercat_wire::coe::ObjectAddress;
use omnibase_run::live::{EntryType, ObjectType, entry_unit};
use serde::Serialize;
use std::io::{self, Write};

/// The access bits that allow reading, one for each state.
const READABLE: u16 = 0b00_0111;
/// Object code of a single variable.
const VARIABLE: u8 = 7;

/// One object.
#[derive(Debug, Serialize)]
pub struct Object {
    /// Index.
    pub index: u16,
    /// Name.
    pub name: String,
    /// 7 variable, 8 array, 9 record.
    pub object_code: u8,
    /// CoE data type.
    pub data_type: u16,
    /// The highest subindex.
    pub max_subindex: u8,
    /// Its entries.
    pub entries: Vec<Entry>,
    /// Why it could not be described.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

/// One entry of an object.
#[derive(Debug, Serialize)]
pub struct Entry {
    /// Subindex.
    pub subindex: u8,
    /// Name.
    pub name: String,
    /// CoE data type.
    pub data_type: u16,
    /// Length, bits.
    pub bit_length: u16,
    /// Access bits: 0 to 2 read in PRE-OP, SAFE-OP, OP; 3 to 5 write; 6 and 7 mappable.
    pub access: u16,
    /// What its number is a number of; empty where nobody says it.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub unit: String,
    /// The value as number, text or hexadecimal digits; null where it can't be read.
    pub value: serde_json::Value,
    /// The value in words.
    #[serde(skip)]
    pub words: String,
    /// Why it could not be read.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

impl Object {
    /// Prints it, a line for each entry: index, rights, name, type, value.
    pub fn print(&self, output: &mut dyn Write) -> io::Result<()> {
        let object = self;
        if let Some(error) = &object.error {
            return writeln!(output, "    {:04x}      {error}", object.index);
        }
        let single = object.entries.len() == 1 && object.object_code == 7;
        if !single {
            writeln!(output, "    {:04x}      {}", object.index, object.name)?;
        }
        for entry in &object.entries {
            let value = match (&entry.error, entry.access & 0b111) {
                (Some(error), _) => error.as_str(),
                (None, 0) => "write only",
                (None, _) => &entry.words,
            };
            let unit = if entry.error.is_none() && entry.access & 0b111 != 0 { &entry.unit } else { "" };
            let space = if unit.is_empty() { "" } else { " " };
            let name = if single && entry.name.is_empty() { &object.name } else { &entry.name };
            writeln!(
                output,
                "    {:04x}:{:02x}   {} {:<32} {:<6} {value}{space}{unit}{}",
                object.index,
                entry.subindex,
                rights(entry.access),
                name,
                DataType::from_coe(entry.data_type),
                states(entry.access)
            )?;
        }
        Ok(())
    }
}

/// Reading and writing, in whichever state, and mapping.
fn rights(access: u16) -> String {
    let mark = |mask: u16, mark: char| if access & mask != 0 { mark } else { '-' };
    [mark(0b111, 'r'), mark(0b11_1000, 'w'), mark(1 << 6, 'o'), mark(1 << 7, 'i')].iter().collect()
}

/// The states in which an entry can be read and written, where these aren't all.
fn states(access: u16) -> String {
    let only = |bits: u16, what: &str| {
        let states = ["PRE-OP", "SAFE-OP", "OP"].into_iter().enumerate();
        let those: Vec<_> = states.filter(|(at, _)| bits & (1 << at) != 0).map(|(_, name)| name).collect();
        match those.len() {
            0 | 3 => String::new(),
            _ => format!("  ({what} in {} only)", those.join(" and ")),
        }
    };
    only(access & 0b111, "read") + &only(access >> 3 & 0b111, "written")
}

/// Who answers what a dictionary is made of. An inner `Err` is the SubDevice's own refusal, in words; an outer one ends it all.
pub trait Objects {
    /// The indices of all objects.
    fn list(&mut self) -> anyhow::Result<Vec<u16>>;
    /// What an object is.
    fn object(&mut self, index: u16) -> anyhow::Result<Result<ObjectType, String>>;
    /// What an entry is.
    fn entry(&mut self, address: ObjectAddress) -> anyhow::Result<Result<EntryType, String>>;
    /// An entry's bytes.
    fn value(&mut self, address: ObjectAddress) -> anyhow::Result<Result<Vec<u8>, String>>;
}

/// A SubDevice of a segment that this program set up.
pub struct OnBus<'a> {
    /// The segment.
    pub bus: &'a mut AnyBus,
    /// The SubDevice.
    pub position: u16,
}

impl Objects for OnBus<'_> {
    fn list(&mut self) -> anyhow::Result<Vec<u16>> {
        Ok(self.bus.object_list(self.position)?)
    }

    fn object(&mut self, index: u16) -> anyhow::Result<Result<ObjectType, String>> {
        described(self.bus.describe_object(self.position, index), ObjectType::read)
    }

    fn entry(&mut self, address: ObjectAddress) -> anyhow::Result<Result<EntryType, String>> {
        let described = described(self.bus.describe_entry(self.position, address, 0), EntryType::read)?;
        let read = |object| self.bus.sdo_read(self.position, object, SdoAccess::Entry).ok();
        Ok(described.map(|entry| EntryType { unit: entry_unit(address, read), ..entry }))
    }

    fn value(&mut self, address: ObjectAddress) -> anyhow::Result<Result<Vec<u8>, String>> {
        described(self.bus.sdo_read(self.position, address, SdoAccess::Entry), |bytes| Some(bytes.to_vec()))
    }
}

/// What bytes say; they are too short where `read` has nothing.
fn described<T>(
    bytes: Result<Vec<u8>, SetUpError>,
    read: impl FnOnce(&[u8]) -> Option<T>,
) -> anyhow::Result<Result<T, String>> {
    Ok(match bytes {
        Ok(bytes) => read(&bytes).ok_or_else(|| format!("description of {} bytes is too short", bytes.len())),
        Err(error) => Err(refusal(error)?),
    })
}

/// Reads the dictionary of a SubDevice, where `only` names objects just these; `done` is told each.
///
/// An object or entry that the SubDevice refuses is kept with its reason; only a lost SubDevice is an error.
pub fn read(
    of: &mut dyn Objects,
    only: &[u16],
    done: &mut dyn FnMut(&Object) -> anyhow::Result<()>,
) -> anyhow::Result<Vec<Object>> {
    let indices = if only.is_empty() { of.list()? } else { only.to_vec() };
    let bar = progress::bar(indices.len() as u64, "objects");
    let mut objects = Vec::with_capacity(indices.len());
    for index in indices {
        let object = object(of, index)?;
        done(&object)?;
        objects.push(object);
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(objects)
}

fn object(of: &mut dyn Objects, index: u16) -> anyhow::Result<Object> {
    let (found, error) = match of.object(index)? {
        Ok(found) => (found, None),
        Err(error) => (ObjectType::default(), Some(error)),
    };
    let ObjectType { name, object_code, data_type, max_subindex } = found;
    let is_described = error.is_none();
    let mut object = Object { index, name, object_code, data_type, max_subindex, entries: Vec::new(), error };
    let last = if object_code == VARIABLE { 0 } else { max_subindex };
    for subindex in (0..=last).filter(|_| is_described) {
        object.entries.extend(entry(of, ObjectAddress::new(index, subindex))?);
    }
    Ok(object)
}

/// One entry; `None` where the object has a hole.
fn entry(of: &mut dyn Objects, address: ObjectAddress) -> anyhow::Result<Option<Entry>> {
    let Ok(EntryType { name, data_type, bit_length, access, unit }) = of.entry(address)? else {
        return Ok(None);
    };
    let mut entry = Entry {
        subindex: address.subindex,
        name,
        data_type,
        bit_length,
        access,
        unit,
        value: serde_json::Value::Null,
        words: String::new(),
        error: None,
    };
    if access & READABLE == 0 {
        return Ok(Some(entry));
    }
    match of.value(address)? {
        Ok(value) => {
            let data_type = DataType::from_coe(data_type);
            entry.value = data_type.to_json(&value);
            entry.words = data_type.to_words(&value);
        }
        Err(error) => entry.error = Some(error),
    }
    Ok(Some(entry))
}

/// The type of an entry as the SubDevice describes it; `None` where it doesn't.
pub fn data_type(
    bus: &mut AnyBus,
    position: u16,
    address: ObjectAddress,
) -> Result<Option<DataType>, SetUpError> {
    match bus.describe_entry(position, address, 0) {
        Ok(bytes) => {
            Ok(EntryDescription::read(&bytes).map(|description| DataType::from_coe(description.data_type)))
        }
        Err(error) => refusal(error).map(|_| None),
    }
}

/// The words of a SubDevice's own refusal; anything else is an error of the whole.
fn refusal(error: SetUpError) -> Result<String, SetUpError> {
    match error {
        SetUpError::Request { cause, .. } if cause.is_refusal() => Ok(cause.to_string()),
        error => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rights_tell_the_states_that_they_are_bound_to() {
        let told = |access| format!("{}{}", rights(access), states(access));
        assert_eq!(told(0b00_111_111), "rw--");
        assert_eq!(told(0b01_000_111), "r-o-");
        assert_eq!(told(0b00_001_111), "rw--  (written in PRE-OP only)");
        assert_eq!(told(0b10_011_100), "rw-i  (read in OP only)  (written in PRE-OP and SAFE-OP only)");
    }
}
