//! A SubDevice's object dictionary with its values, by SDO Information.

use crate::progress;
use crate::target::AnyBus;
use crate::value::DataType;
use omnibase_ethercat::SetUpError;
use omnibase_ethercat::mailbox::{EntryDescription, MailboxError, ObjectDescription};
use omnibase_ethercat::start_up::SdoAccess;
use omnibase_ethercat_wire::coe::ObjectAddress;
use omnibase_ethercat_wire::printable::printable;
use serde::Serialize;

/// The access bits that allow reading in any state.
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
    /// The value as number, text or hexadecimal digits; null where it can't be read.
    pub value: serde_json::Value,
    /// The value in words.
    #[serde(skip)]
    pub words: String,
    /// Why it could not be read.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

/// Reads the whole dictionary of the SubDevice at `position`.
///
/// An object or entry that the SubDevice refuses is kept with its reason; only a lost SubDevice is an error.
pub fn read(bus: &mut AnyBus, position: u16) -> Result<Vec<Object>, SetUpError> {
    let indices = bus.object_list(position)?;
    let bar = progress::bar(indices.len() as u64, &format!("dictionary of SubDevice {position}"));
    let mut objects = Vec::with_capacity(indices.len());
    for index in indices {
        objects.push(object(bus, position, index)?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(objects)
}

fn object(bus: &mut AnyBus, position: u16, index: u16) -> Result<Object, SetUpError> {
    let mut object = Object {
        index,
        name: String::new(),
        object_code: 0,
        data_type: 0,
        max_subindex: 0,
        entries: Vec::new(),
        error: None,
    };
    let bytes = match bus.describe_object(position, index) {
        Ok(bytes) => bytes,
        Err(error) => {
            object.error = Some(refusal(error)?);
            return Ok(object);
        }
    };
    let Some(description) = ObjectDescription::read(&bytes) else {
        object.error = Some(format!("description of {} bytes is too short", bytes.len()));
        return Ok(object);
    };
    object.name = text(description.name);
    object.object_code = description.object_code;
    object.data_type = description.data_type;
    object.max_subindex = description.max_subindex;
    let last = if description.object_code == VARIABLE { 0 } else { description.max_subindex };
    for subindex in 0..=last {
        if let Some(entry) = entry(bus, position, ObjectAddress::new(index, subindex))? {
            object.entries.push(entry);
        }
    }
    Ok(object)
}

/// One entry; `None` where the object has a hole.
fn entry(bus: &mut AnyBus, position: u16, address: ObjectAddress) -> Result<Option<Entry>, SetUpError> {
    let bytes = match bus.describe_entry(position, address, 0) {
        Ok(bytes) => bytes,
        Err(error) => {
            refusal(error)?;
            return Ok(None);
        }
    };
    let Some(description) = EntryDescription::read(&bytes) else { return Ok(None) };
    let mut entry = Entry {
        subindex: address.subindex,
        name: text(description.name),
        data_type: description.data_type,
        bit_length: description.bit_length,
        access: description.access,
        value: serde_json::Value::Null,
        words: String::new(),
        error: None,
    };
    if description.access & READABLE == 0 {
        return Ok(Some(entry));
    }
    match bus.sdo_read(position, address, SdoAccess::Entry) {
        Ok(value) => {
            let data_type = DataType::from_coe(description.data_type);
            entry.value = data_type.to_json(&value);
            entry.words = data_type.to_words(&value);
        }
        Err(error) => entry.error = Some(refusal(error)?),
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
        SetUpError::Request {
            cause:
                cause @ (MailboxError::Aborted { .. }
                | MailboxError::InfoRefused { .. }
                | MailboxError::Refused { .. }
                | MailboxError::TooLong { .. }
                | MailboxError::Malformed { .. }
                | MailboxError::SizeMismatch { .. }),
            ..
        } => Ok(cause.to_string()),
        error => Err(error),
    }
}

fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
    printable(&bytes[..end])
}
