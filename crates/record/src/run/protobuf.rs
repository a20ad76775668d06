//! As much of protobuf's encoding as a recording needs: messages of doubles, counts, bytes and strings, and the
//! descriptors that explain them to a reader (protobuf.dev, "Encoding"; descriptor.proto).

/// What a field holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Double,
    /// A whole number of 64 bits without a sign, in as many bytes whatever it is: it compresses better than one that is shorter
    /// where it is small.
    Count,
    Text,
    /// A code of the enum with this full name.
    Choice(String),
    /// A message with this full name.
    Part(String),
}

const FIXED64: u32 = 1;
/// Fields whose key, the number above three bits of its kind, takes one byte, and those behind them whose key takes two.
const SHORT_KEYS: usize = 15;
const LONG_KEYS: usize = 2032;
const LENGTH_DELIMITED: u32 = 2;
/// The type `fixed64` in a descriptor.
const COUNT: u64 = 6;

fn push_varint(bytes: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
}

fn push_tag(bytes: &mut Vec<u8>, number: u32, wire_type: u32) {
    push_varint(bytes, u64::from(number << 3 | wire_type));
}

/// Appends field `number` as a double; all 64 bits survive, NaN's too. A zero is left out: it is what a reader takes for a field
/// that isn't there (proto3).
pub(crate) fn push_double(bytes: &mut Vec<u8>, number: u32, value: f64) {
    push_fixed(bytes, number, value.to_bits());
}

fn push_fixed(bytes: &mut Vec<u8>, number: u32, word: u64) {
    if word != 0 {
        push_tag(bytes, number, FIXED64);
        bytes.extend_from_slice(&word.to_le_bytes());
    }
}

/// Appends fields from 1 on, each the bits of a double or a count; a zero is left out, as of a double.
pub(super) fn push_words(bytes: &mut Vec<u8>, words: &[u64]) {
    // Most of a recording is made of these: keys of one byte, of two, and all the others.
    let (short, rest) = words.split_at(words.len().min(SHORT_KEYS));
    let (long, others) = rest.split_at(rest.len().min(LONG_KEYS));
    for (number, word) in (1..).zip(short).filter(|(_, word)| **word != 0) {
        let mut field = [(number << 3) as u8 | FIXED64 as u8; 9];
        field[1..].copy_from_slice(&word.to_le_bytes());
        bytes.extend_from_slice(&field);
    }
    for (number, word) in (1 + SHORT_KEYS..).zip(long).filter(|(_, word)| **word != 0) {
        let mut field = [(number << 3) as u8 | FIXED64 as u8 | 0x80; 10];
        field[1] = (number >> 4) as u8;
        field[2..].copy_from_slice(&word.to_le_bytes());
        bytes.extend_from_slice(&field);
    }
    for (number, word) in (1 + SHORT_KEYS as u32 + LONG_KEYS as u32..).zip(others) {
        push_fixed(bytes, number, *word);
    }
}

/// Appends field `number` as bytes or text.
pub(crate) fn push_bytes(bytes: &mut Vec<u8>, number: u32, value: &[u8]) {
    push_tag(bytes, number, LENGTH_DELIMITED);
    push_varint(bytes, value.len() as u64);
    bytes.extend_from_slice(value);
}

pub(crate) fn push_number(bytes: &mut Vec<u8>, number: u32, value: u64) {
    push_tag(bytes, number, 0);
    push_varint(bytes, value);
}

/// A `FileDescriptorSet` with the one message `omnibase.<name>`, its fields numbered from 1.
pub(super) fn descriptor(name: &str, fields: &[(&str, Kind)]) -> Vec<u8> {
    let fields: Vec<_> = fields.iter().map(|(name, kind)| ((*name).to_owned(), kind.clone())).collect();
    descriptor_with(name, &fields, &[])
}

/// The same with enums of the message, each an `EnumDescriptorProto`.
pub(crate) fn descriptor_with(name: &str, fields: &[(String, Kind)], enums: &[Vec<u8>]) -> Vec<u8> {
    file(name, &message_with(name, fields, enums))
}

/// A `FileDescriptorSet` with one message.
pub(super) fn file(name: &str, message: &[u8]) -> Vec<u8> {
    let mut file = Vec::new();
    push_bytes(&mut file, 1, format!("omnibase/{name}.proto").as_bytes());
    push_bytes(&mut file, 2, b"omnibase");
    push_bytes(&mut file, 4, message);
    push_bytes(&mut file, 12, b"proto3");
    let mut set = Vec::new();
    push_bytes(&mut set, 1, &file);
    set
}

/// A `DescriptorProto` with fields numbered from 1.
pub(super) fn message_with(name: &str, fields: &[(String, Kind)], enums: &[Vec<u8>]) -> Vec<u8> {
    let fields: Vec<_> = (1..).zip(fields).map(|(number, (name, kind))| field(name, number, kind)).collect();
    message(name, &fields, &[], enums)
}

/// A `DescriptorProto` of its fields, the messages and the enums in it, each described by its own.
pub(super) fn message(name: &str, fields: &[Vec<u8>], nested: &[Vec<u8>], enums: &[Vec<u8>]) -> Vec<u8> {
    let mut message = Vec::new();
    push_bytes(&mut message, 1, name.as_bytes());
    for (number, all) in [(2, fields), (3, nested), (4, enums)] {
        all.iter().for_each(|one| push_bytes(&mut message, number, one));
    }
    message
}

/// A `FieldDescriptorProto`.
pub(super) fn field(name: &str, number: u32, kind: &Kind) -> Vec<u8> {
    let mut field = Vec::new();
    push_bytes(&mut field, 1, name.as_bytes());
    push_number(&mut field, 3, u64::from(number));
    push_number(&mut field, 4, 1);
    let code = match kind {
        Kind::Double => 1,
        Kind::Count => COUNT,
        Kind::Text => 9,
        Kind::Part(_) => 11,
        Kind::Choice(_) => 14,
    };
    push_number(&mut field, 5, code);
    if let Kind::Choice(name) | Kind::Part(name) = kind {
        push_bytes(&mut field, 6, name.as_bytes());
    }
    field
}

/// A field as it stands in a message.
pub(super) enum Field<'a> {
    /// The bits of a double, or a count, as the descriptor says.
    Fixed(u32, u64),
    Bytes(u32, &'a [u8]),
    Number(u32, u64),
}

fn take_varint(bytes: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for shift in (0..64).step_by(7) {
        let (&byte, rest) = bytes.split_first()?;
        *bytes = rest;
        value |= u64::from(byte & 0x7F) << shift;
        if byte & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

/// The fields of a message, in order; ends at the first that can't be read.
pub(super) fn fields(mut bytes: &[u8]) -> impl Iterator<Item = Field<'_>> {
    std::iter::from_fn(move || {
        if bytes.is_empty() {
            return None;
        }
        let tag = take_varint(&mut bytes)?;
        let number = u32::try_from(tag >> 3).ok()?;
        match tag & 7 {
            0 => take_varint(&mut bytes).map(|value| Field::Number(number, value)),
            1 => {
                let (raw, rest) = bytes.split_first_chunk::<8>()?;
                bytes = rest;
                Some(Field::Fixed(number, u64::from_le_bytes(*raw)))
            }
            2 => {
                let length = usize::try_from(take_varint(&mut bytes)?).ok()?;
                let (data, rest) = bytes.split_at_checked(length)?;
                bytes = rest;
                Some(Field::Bytes(number, data))
            }
            _ => None,
        }
    })
}

/// A field of a message, as it is described.
pub(super) struct Described {
    pub(super) name: String,
    /// It is a count, and not a double.
    pub(super) is_count: bool,
}

/// The fields of the first message in a `FileDescriptorSet`.
pub(super) fn described(descriptor: &[u8]) -> Option<Vec<Described>> {
    Some(described_in(inner(inner(descriptor, 1)?, 4)?))
}

/// The fields of each message that is described in the first one of a `FileDescriptorSet`.
pub(super) fn described_parts(descriptor: &[u8]) -> Option<Vec<Vec<Described>>> {
    let message = inner(inner(descriptor, 1)?, 4)?;
    let parts = fields(message).filter_map(|field| match field {
        Field::Bytes(3, part) => Some(described_in(part)),
        _ => None,
    });
    Some(parts.collect())
}

fn described_in(message: &[u8]) -> Vec<Described> {
    let all = fields(message).filter_map(|field| match field {
        Field::Bytes(2, data) => Some(Described {
            name: String::from_utf8_lossy(inner(data, 1)?).into_owned(),
            is_count: fields(data).any(|field| matches!(field, Field::Number(5, COUNT))),
        }),
        _ => None,
    });
    all.collect()
}

/// The first field with this number, where it has bytes.
pub(super) fn inner(message: &[u8], wanted: u32) -> Option<&[u8]> {
    fields(message).find_map(|field| match field {
        Field::Bytes(number, data) if number == wanted => Some(data),
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_of_any_number_is_read_back_and_a_zero_left_out() {
        let words = |number| if number % 7 == 0 { 0 } else { u64::MAX / u64::from(number) };
        let row: Vec<u64> = (1..=2100).map(words).collect();
        let (mut bytes, mut plain) = (Vec::new(), Vec::new());
        push_words(&mut bytes, &row);
        (1..=2100).for_each(|number| push_double(&mut plain, number, f64::from_bits(words(number))));
        assert_eq!(bytes, plain);
        let read = fields(&bytes).map(|field| match field {
            Field::Fixed(number, word) => (number, word),
            _ => panic!("another field"),
        });
        assert!(read.eq((1..=2100).map(|number| (number, words(number))).filter(|(_, word)| *word != 0)));
    }
}
