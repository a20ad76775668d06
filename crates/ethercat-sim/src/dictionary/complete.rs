//! Complete access: a whole object in one transfer.
//!
//! Subindex 0 takes 16 bits (its value and 8 bits of padding), the entries follow bit by bit without gaps
//! (ETG.1000.6, "SDO complete access").

use super::{Dictionary, Entry, Object, ObjectCode, pdo};
use omnibase_ethercat_wire::AlState;
use omnibase_ethercat_wire::coe::{AbortCode, ObjectAddress};

/// Where a complete access starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FirstSubindex {
    /// With subindex 0, which takes 16 bits.
    Zero,
    /// With subindex 1.
    One,
}

impl FirstSubindex {
    /// The start that a request's subindex names.
    pub fn new(subindex: u8) -> Result<Self, AbortCode> {
        match subindex {
            0 => Ok(FirstSubindex::Zero),
            1 => Ok(FirstSubindex::One),
            _ => Err(AbortCode::UNSUPPORTED_ACCESS),
        }
    }
}

impl Dictionary {
    /// The whole object as a complete upload reads it; entries that can't be read are zero.
    pub fn read_complete(
        &self,
        index: u16,
        first: FirstSubindex,
        state: AlState,
    ) -> Result<Vec<u8>, AbortCode> {
        let object = complete_object(self, index)?;
        let mut bits = BitWriter::default();
        let count = &object.entries[0];
        if first == FirstSubindex::Zero {
            bits.push(self.value(count), 8);
            bits.push(&[0], 8);
        }
        for entry in present_entries(object, self.value(count)) {
            match entry.access.check_read(state) {
                Ok(()) => bits.push(self.value(entry), usize::from(entry.bit_length)),
                Err(_) => bits.push(&vec![0; entry.capacity], usize::from(entry.bit_length)),
            }
        }
        Ok(bits.bytes)
    }

    /// Splits the data of a complete download into the values of the entries, and checks each.
    ///
    /// Subindex 0 comes first where it is part of the data and can be written. Rights, lengths and ranges are
    /// checked; what the object means isn't.
    pub fn split_complete(
        &self,
        index: u16,
        first: FirstSubindex,
        state: AlState,
        data: &[u8],
    ) -> Result<Vec<(ObjectAddress, Vec<u8>)>, AbortCode> {
        let object = complete_object(self, index)?;
        let count = &object.entries[0];
        let mut bits = BitReader { bytes: data, position: 0 };
        let mut parts = Vec::new();
        let mut entries = self.value(count).to_vec();
        if first == FirstSubindex::Zero {
            let value = bits.take(8).ok_or(AbortCode::TOO_SHORT)?;
            bits.take(8).ok_or(AbortCode::TOO_SHORT)?;
            if count.access.check_write(state).is_ok() {
                count.check_value(&value)?;
                parts.push((ObjectAddress::new(index, 0), value.clone()));
                entries = value;
            } else if value != self.value(count) {
                return Err(AbortCode::READ_ONLY);
            }
        }
        for entry in present_entries(object, &entries) {
            let address = ObjectAddress::new(index, entry.subindex);
            let value = bits.take(usize::from(entry.bit_length)).ok_or(AbortCode::TOO_SHORT)?;
            self.check_write(address, &value, state)?;
            parts.push((address, value));
        }
        if data.len() * 8 >= bits.position + 8 {
            return Err(AbortCode::TOO_LONG);
        }
        Ok(parts)
    }
}

fn complete_object(dictionary: &Dictionary, index: u16) -> Result<&Object, AbortCode> {
    let object = dictionary.object(index).ok_or(AbortCode::NO_SUCH_OBJECT)?;
    if object.code == ObjectCode::Variable || object.entries.is_empty() {
        return Err(AbortCode::UNSUPPORTED_ACCESS);
    }
    if object.entries.iter().any(Entry::has_variable_length) {
        return Err(AbortCode::COMPLETE_ACCESS);
    }
    Ok(object)
}

/// The entries behind subindex 0: of PDO objects as many as subindex 0 says, of others all.
fn present_entries<'a>(object: &'a Object, count: &[u8]) -> impl Iterator<Item = &'a Entry> {
    let present = match count {
        [count] if pdo::is_pdo_object(object.index) => *count,
        _ => u8::MAX,
    };
    object.entries.iter().skip(1).filter(move |entry| entry.subindex <= present)
}

#[derive(Default)]
struct BitWriter {
    bytes: Vec<u8>,
    position: usize,
}

impl BitWriter {
    fn push(&mut self, value: &[u8], bits: usize) {
        if self.position.is_multiple_of(8) && bits == value.len() * 8 {
            self.bytes.extend_from_slice(value);
        } else {
            self.bytes.resize((self.position + bits).div_ceil(8), 0);
            pdo::copy_bits(value, 0, &mut self.bytes, self.position, bits.min(value.len() * 8));
        }
        self.position += bits;
    }
}

struct BitReader<'a> {
    bytes: &'a [u8],
    position: usize,
}

impl BitReader<'_> {
    fn take(&mut self, bits: usize) -> Option<Vec<u8>> {
        if self.position + bits > self.bytes.len() * 8 {
            return None;
        }
        let mut value = vec![0; bits.div_ceil(8)];
        pdo::copy_bits(self.bytes, self.position, &mut value, 0, bits);
        self.position += bits;
        Some(value)
    }
}
