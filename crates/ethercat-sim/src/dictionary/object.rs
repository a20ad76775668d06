//! Objects and entries as data.

use super::Access;
use omnibase_ethercat_wire::coe::AbortCode;
use std::borrow::Cow;

/// A CoE data type by its code (ETG.1020).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DataType(pub u16);

impl DataType {
    /// No type: gaps.
    pub const NONE: DataType = DataType(0);
    /// One bit.
    pub const BOOLEAN: DataType = DataType(0x01);
    /// Signed, 8 bits.
    pub const INTEGER8: DataType = DataType(0x02);
    /// Signed, 16 bits.
    pub const INTEGER16: DataType = DataType(0x03);
    /// Signed, 32 bits.
    pub const INTEGER32: DataType = DataType(0x04);
    /// Unsigned, 8 bits.
    pub const UNSIGNED8: DataType = DataType(0x05);
    /// Unsigned, 16 bits.
    pub const UNSIGNED16: DataType = DataType(0x06);
    /// Unsigned, 32 bits.
    pub const UNSIGNED32: DataType = DataType(0x07);
    /// Text.
    pub const VISIBLE_STRING: DataType = DataType(0x09);
    /// Bytes.
    pub const OCTET_STRING: DataType = DataType(0x0A);
    /// Bytes of any number.
    pub const DOMAIN: DataType = DataType(0x0F);
    /// Signed, 64 bits.
    pub const INTEGER64: DataType = DataType(0x15);
    /// Unsigned, 64 bits.
    pub const UNSIGNED64: DataType = DataType(0x1B);
    /// Record: PDO mapping.
    pub const PDO_MAPPING: DataType = DataType(0x21);
    /// Record: identity.
    pub const IDENTITY: DataType = DataType(0x23);
    /// Record: SyncManager synchronisation.
    pub const SYNC_PARAMETER: DataType = DataType(0x29);
    /// Record without a type of its own.
    pub const RECORD: DataType = DataType(0x2A);

    /// Whether values of the type may have any length up to the entry's capacity.
    pub fn has_variable_length(self) -> bool {
        matches!(self, DataType::VISIBLE_STRING | DataType::OCTET_STRING | DataType::DOMAIN)
    }

    /// Whether values are signed numbers.
    pub fn is_signed(self) -> bool {
        matches!(self, DataType::INTEGER8 | DataType::INTEGER16 | DataType::INTEGER32 | DataType::INTEGER64)
    }
}

/// The object code of an object description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum ObjectCode {
    /// One value.
    Variable = 7,
    /// Values of one type.
    Array = 8,
    /// Values of several types.
    Record = 9,
}

/// An entry of an object: one value.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Subindex.
    pub subindex: u8,
    /// Name.
    pub name: Cow<'static, str>,
    /// Type.
    pub data_type: DataType,
    /// Length in bits; of a string: of its capacity.
    pub bit_length: u16,
    /// Rights.
    pub access: Access,
    /// Smallest and largest value that a download may have.
    pub limits: Option<(i64, i64)>,
    pub(super) default: Vec<u8>,
    pub(super) capacity: usize,
    pub(super) offset: usize,
    pub(super) length: usize,
    pub(super) default_length: usize,
}

macro_rules! numbers {
    ($($function:ident $number:ty, $data_type:ident;)*) => {
        $(#[doc = concat!("A read-only `", stringify!($number), "` with this default.")]
        pub fn $function(subindex: u8, name: impl Into<Cow<'static, str>>, default: $number) -> Self {
            Entry::new(subindex, name, DataType::$data_type, default.to_le_bytes().to_vec())
        })*
    };
}

impl Entry {
    /// A read-only entry whose length is that of its default value.
    pub fn new(
        subindex: u8,
        name: impl Into<Cow<'static, str>>,
        data_type: DataType,
        default: Vec<u8>,
    ) -> Self {
        Entry {
            subindex,
            name: name.into(),
            data_type,
            bit_length: u16::try_from(default.len() * 8).unwrap_or(u16::MAX),
            access: Access::READ,
            limits: None,
            capacity: default.len(),
            length: default.len(),
            default_length: default.len(),
            default,
            offset: 0,
        }
    }

    numbers! {
        integer8 i8, INTEGER8;
        integer16 i16, INTEGER16;
        integer32 i32, INTEGER32;
        unsigned8 u8, UNSIGNED8;
        unsigned16 u16, UNSIGNED16;
        unsigned32 u32, UNSIGNED32;
        unsigned64 u64, UNSIGNED64;
    }

    /// Read-only text.
    pub fn text(subindex: u8, name: impl Into<Cow<'static, str>>, text: &str) -> Self {
        Entry::new(subindex, name, DataType::VISIBLE_STRING, text.as_bytes().to_vec())
    }

    /// Read-only bits, zero at first: `bit_length` of them, kept in as many bytes as they need.
    pub fn bits(
        subindex: u8,
        name: impl Into<Cow<'static, str>>,
        data_type: DataType,
        bit_length: u16,
    ) -> Self {
        let bytes = usize::from(bit_length).div_ceil(8);
        Entry { bit_length, ..Entry::new(subindex, name, data_type, vec![0; bytes]) }
    }

    /// The same with these rights.
    pub fn with_access(self, access: Access) -> Self {
        Entry { access, ..self }
    }

    /// The same with these limits.
    pub fn with_limits(self, minimum: i64, maximum: i64) -> Self {
        Entry { limits: Some((minimum, maximum)), ..self }
    }

    /// The same with room for values of up to `bytes`, where the type has a variable length.
    pub fn with_capacity(self, bytes: usize) -> Self {
        let capacity = bytes.max(self.default.len());
        Entry { capacity, bit_length: u16::try_from(capacity * 8).unwrap_or(u16::MAX), ..self }
    }

    /// Whether values may have any length up to the capacity.
    pub fn has_variable_length(&self) -> bool {
        self.data_type.has_variable_length()
    }

    /// Bytes that the entry can hold.
    pub fn capacity(&self) -> usize {
        self.capacity
    }

    /// Offset of the value in the dictionary's arena.
    pub(crate) fn offset(&self) -> usize {
        self.offset
    }

    /// Whether a value may be stored here: its length and range.
    pub(super) fn check_value(&self, data: &[u8]) -> Result<(), AbortCode> {
        if data.len() > self.capacity {
            return Err(AbortCode::TOO_LONG);
        }
        if self.has_variable_length() {
            return Ok(());
        }
        if data.len() < self.capacity {
            return Err(AbortCode::TOO_SHORT);
        }
        if !self.bit_length.is_multiple_of(8)
            && self.capacity <= 8
            && super::little_endian(data) >> self.bit_length != 0
        {
            return Err(AbortCode::VALUE_RANGE);
        }
        let Some((minimum, maximum)) = self.limits else { return Ok(()) };
        let number = self.number(data);
        if number > maximum {
            Err(AbortCode::VALUE_TOO_HIGH)
        } else if number < minimum {
            Err(AbortCode::VALUE_TOO_LOW)
        } else {
            Ok(())
        }
    }

    fn number(&self, data: &[u8]) -> i64 {
        let raw = super::little_endian(&data[..data.len().min(8)]);
        let unused = 64 - 8 * data.len().clamp(1, 8) as u32;
        if self.data_type.is_signed() {
            ((raw << unused) as i64) >> unused
        } else {
            i64::try_from(raw).unwrap_or(i64::MAX)
        }
    }
}

/// An object: its description and its entries, by rising subindex.
#[derive(Clone, Debug)]
pub struct Object {
    /// Index.
    pub index: u16,
    /// Name.
    pub name: Cow<'static, str>,
    /// Shape.
    pub code: ObjectCode,
    /// Type: of the value, of an array's values, or of the record.
    pub data_type: DataType,
    pub(super) entries: Vec<Entry>,
}

impl Object {
    /// One value; the entry's name becomes the object's.
    pub fn variable(index: u16, entry: Entry) -> Self {
        let (name, data_type) = (entry.name.clone(), entry.data_type);
        Object {
            index,
            name,
            code: ObjectCode::Variable,
            data_type,
            entries: vec![Entry { subindex: 0, ..entry }],
        }
    }

    /// Values of several types; subindex 0 is added where `entries` hasn't it.
    pub fn record(
        index: u16,
        name: impl Into<Cow<'static, str>>,
        data_type: DataType,
        entries: Vec<Entry>,
    ) -> Self {
        Object { index, name: name.into(), code: ObjectCode::Record, data_type, entries: with_count(entries) }
    }

    /// Values of one type; subindex 0 is added where `entries` hasn't it.
    pub fn array(index: u16, name: impl Into<Cow<'static, str>>, entries: Vec<Entry>) -> Self {
        let data_type = entries.last().map_or(DataType::NONE, |entry| entry.data_type);
        Object { index, name: name.into(), code: ObjectCode::Array, data_type, entries: with_count(entries) }
    }

    /// Adds the entries of `other` whose subindices aren't here; values keep theirs, and a single value stays one.
    pub fn add_missing(&mut self, other: Object) {
        if self.code == ObjectCode::Variable || other.code == ObjectCode::Variable {
            return;
        }
        self.entries.extend(other.entries);
        // Stable: of two with one subindex the own one stands first and stays.
        self.entries.sort_by_key(|entry| entry.subindex);
        self.entries.dedup_by_key(|entry| entry.subindex);
    }

    /// The same in the place of `other`: with its rights as well, and its entries that this one hasn't.
    pub fn in_place_of(mut self, other: Object) -> Self {
        for entry in &mut self.entries {
            if let Some(before) = other.entry(entry.subindex) {
                entry.access = entry.access | before.access;
            }
        }
        self.add_missing(other);
        self
    }

    /// Every entry, by rising subindex.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// The entry of this subindex.
    pub fn entry(&self, subindex: u8) -> Option<&Entry> {
        let position = self.entries.binary_search_by_key(&subindex, |entry| entry.subindex).ok()?;
        Some(&self.entries[position])
    }

    pub(super) fn entry_mut(&mut self, subindex: u8) -> Option<&mut Entry> {
        let position = self.entries.binary_search_by_key(&subindex, |entry| entry.subindex).ok()?;
        Some(&mut self.entries[position])
    }

    /// The largest subindex.
    pub fn max_subindex(&self) -> u8 {
        self.entries.last().map_or(0, |entry| entry.subindex)
    }
}

fn with_count(mut entries: Vec<Entry>) -> Vec<Entry> {
    entries.sort_by_key(|entry| entry.subindex);
    entries.dedup_by_key(|entry| entry.subindex);
    if entries.first().is_none_or(|entry| entry.subindex != 0) {
        let count = entries.last().map_or(0, |entry| entry.subindex);
        entries.insert(0, Entry::unsigned8(0, "Number of entries", count));
    }
    entries
}
