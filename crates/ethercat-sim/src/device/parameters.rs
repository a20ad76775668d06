//! Objects that a device has for the parameters that are written to it.

use omnibase_ethercat_wire::coe::ObjectAddress;

use crate::dictionary::{Access, DataType, Entry, Object};

/// The entries of an object that is written whole, from this subindex (0 or 1), each with its bytes: of one length, where the bytes
/// can be shared out so, else single bytes.
pub fn entries_of_whole(first: ObjectAddress, data: &[u8]) -> Vec<(ObjectAddress, usize)> {
    // Subindex 0 takes two bytes: how many entries follow, and a gap.
    let (told, rest) = match data {
        [count, _, rest @ ..] if first.subindex == 0 => (usize::from(*count), rest.len()),
        data => (data.len(), data.len()),
    };
    let bytes = if told > 0 && rest.is_multiple_of(told) { rest / told } else { 1 };
    let bytes = if [1, 2, 4].contains(&bytes) { bytes } else { 1 };
    (1..=u8::MAX).take(rest / bytes).map(|entry| (ObjectAddress::new(first.index, entry), bytes)).collect()
}

/// Adds the objects of parameters to those of a device; what it has itself stays as it is.
pub(super) fn add_objects(objects: &mut Vec<Object>, parameters: &[(ObjectAddress, usize)]) {
    for own in self::objects(parameters) {
        match objects.iter_mut().find(|object| object.index == own.index) {
            Some(known) => known.add_missing(own),
            None => objects.push(own),
        }
    }
}

/// The objects of parameters, those of one index together.
pub(super) fn objects(parameters: &[(ObjectAddress, usize)]) -> Vec<Object> {
    let mut sorted = parameters.to_vec();
    sorted.sort_by_key(|(at, _)| (at.index, at.subindex));
    sorted.dedup_by_key(|(at, _)| *at);
    let entry = |(at, bytes): &(ObjectAddress, usize)| {
        let data_type = match bytes {
            1 => DataType::UNSIGNED8,
            2 => DataType::UNSIGNED16,
            _ => DataType::UNSIGNED32,
        };
        Entry::bits(at.subindex, "Parameter", data_type, 8 * *bytes as u16).with_access(Access::READ_WRITE)
    };
    sorted
        .chunk_by(|one, other| one.0.index == other.0.index)
        .map(|group| match group {
            [one] if one.0.subindex == 0 => Object::variable(one.0.index, entry(one)),
            _ => {
                let entries = group.iter().map(entry).collect();
                Object::record(group[0].0.index, "Parameters", DataType::RECORD, entries)
            }
        })
        .collect()
}
