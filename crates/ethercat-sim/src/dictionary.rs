//! The object dictionary: objects described by data, and their values in one arena.
//!
//! Objects are looked up by index for SDOs; the cyclic path uses [`Field`]s and [`pdo::Copy`]s, which are plain
//! offsets into the arena and cost a load or a store.

mod access;
mod complete;
mod field;
mod object;
pub mod pdo;
pub mod standard;
#[cfg(test)]
mod tests;

pub use access::Access;
pub use complete::FirstSubindex;
pub use field::{Field, Scalar};
pub use object::{DataType, Entry, Object, ObjectCode};

use omnibase_ethercat_wire::AlState;
use omnibase_ethercat_wire::coe::{AbortCode, ObjectAddress};

/// An object dictionary with its present values.
#[derive(Clone, Debug)]
pub struct Dictionary {
    objects: Vec<Object>,
    values: Vec<u8>,
    defaults: Vec<u8>,
}

impl Dictionary {
    /// A dictionary of these objects with their default values.
    ///
    /// Where an index comes twice, the first one counts.
    pub fn new(mut objects: Vec<Object>) -> Self {
        objects.sort_by_key(|object| object.index);
        objects.dedup_by_key(|object| object.index);
        let mut values = Vec::new();
        for entry in objects.iter_mut().flat_map(|object| &mut object.entries) {
            entry.offset = values.len();
            entry.length = entry.default.len();
            values.extend_from_slice(&entry.default);
            values.resize(entry.offset + entry.capacity, 0);
            entry.default_length = entry.length;
            entry.default = Vec::new();
        }
        Dictionary { objects, defaults: values.clone(), values }
    }

    /// Every object, by rising index.
    pub fn objects(&self) -> &[Object] {
        &self.objects
    }

    /// The object of this index.
    pub fn object(&self, index: u16) -> Option<&Object> {
        self.position(index).map(|position| &self.objects[position])
    }

    /// The entry at this address.
    pub fn entry(&self, address: ObjectAddress) -> Option<&Entry> {
        self.object(address.index)?.entry(address.subindex)
    }

    /// The value of an entry of this dictionary.
    pub fn value(&self, entry: &Entry) -> &[u8] {
        &self.values[entry.offset..entry.offset + entry.length]
    }

    /// The default value of an entry of this dictionary.
    pub fn default_value(&self, entry: &Entry) -> &[u8] {
        &self.defaults[entry.offset..entry.offset + entry.default_length]
    }

    /// The value at this address, whatever the rights say; `None` where there is no such entry.
    pub fn peek(&self, address: ObjectAddress) -> Option<&[u8]> {
        self.entry(address).map(|entry| self.value(entry))
    }

    /// The value at this address as an unsigned number of at most 8 bytes.
    pub fn peek_number(&self, address: ObjectAddress) -> Option<u64> {
        let value = self.peek(address)?;
        (value.len() <= 8).then(|| little_endian(value))
    }

    /// The value at this address as an SDO upload in `state` reads it.
    pub fn read(&self, address: ObjectAddress, state: AlState) -> Result<&[u8], AbortCode> {
        let object = self.object(address.index).ok_or(AbortCode::NO_SUCH_OBJECT)?;
        let entry = object.entry(address.subindex).ok_or(AbortCode::NO_SUCH_SUBINDEX)?;
        entry.access.check_read(state)?;
        Ok(self.value(entry))
    }

    /// Whether an SDO download of `data` in `state` is allowed: existence, rights, length, range.
    pub fn check_write(&self, address: ObjectAddress, data: &[u8], state: AlState) -> Result<(), AbortCode> {
        let object = self.object(address.index).ok_or(AbortCode::NO_SUCH_OBJECT)?;
        let entry = object.entry(address.subindex).ok_or(AbortCode::NO_SUCH_SUBINDEX)?;
        entry.access.check_write(state)?;
        entry.check_value(data)
    }

    /// Stores a value that was checked before; does nothing where the address or the length is impossible.
    pub fn store(&mut self, address: ObjectAddress, data: &[u8]) {
        let Some(position) = self.position(address.index) else { return };
        let Some(entry) = self.objects[position].entry_mut(address.subindex) else { return };
        if data.len() > entry.capacity {
            return;
        }
        if entry.has_variable_length() {
            entry.length = data.len();
        }
        self.values[entry.offset..entry.offset + data.len()].copy_from_slice(data);
    }

    /// Makes every value its default.
    pub fn restore_defaults(&mut self) {
        self.values.copy_from_slice(&self.defaults);
        for entry in self.objects.iter_mut().flat_map(|object| &mut object.entries) {
            entry.length = entry.default_length;
        }
    }

    /// Makes the values that may be kept ([`Access::BACKUP`]) their defaults: they outlast power.
    pub fn keep(&mut self) {
        let entries = self.objects.iter_mut().flat_map(|object| &mut object.entries);
        for entry in entries.filter(|entry| entry.access.0 & Access::BACKUP.0 != 0) {
            let range = entry.offset..entry.offset + entry.length;
            self.defaults[range.clone()].copy_from_slice(&self.values[range]);
            entry.default_length = entry.length;
        }
    }

    /// The arena, for process data.
    pub(crate) fn arena(&self) -> &[u8] {
        &self.values
    }

    /// The arena, for process data.
    pub(crate) fn arena_mut(&mut self) -> &mut [u8] {
        &mut self.values
    }

    fn position(&self, index: u16) -> Option<usize> {
        self.objects.binary_search_by_key(&index, |object| object.index).ok()
    }
}

/// At most eight little-endian bytes as a number.
pub(crate) fn little_endian(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |number, byte| number << 8 | u64::from(*byte))
}
