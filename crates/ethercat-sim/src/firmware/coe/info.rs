//! SDO Information server: lists, object and entry descriptions, in as many fragments as they need.

use super::{MailboxFault, Served, message};
use crate::dictionary::{Access, Dictionary, Object};
use omnibase_ethercat_wire::bytes::u16_at;
use omnibase_ethercat_wire::coe::{AbortCode, HEADER, INFO_HEADER, InfoHeader, ObjectAddress, Service, info};

/// Value info: the default value.
const WITH_DEFAULT: u8 = 1 << 4;
/// Value info: the smallest value.
const WITH_MINIMUM: u8 = 1 << 5;
/// Value info: the largest value.
const WITH_MAXIMUM: u8 = 1 << 6;

/// Answers a request with all fragments of its answer.
pub(super) fn answer(body: &[u8], served: &Served) -> Result<Vec<Vec<u8>>, MailboxFault> {
    let header = InfoHeader::read(body).ok_or(MailboxFault::TooShort)?;
    let data = &body[INFO_HEADER..];
    let result = match header.opcode {
        info::LIST_REQUEST => (data.len() >= 2)
            .then(|| list(served.dictionary, u16_at(data, 0)))
            .ok_or(MailboxFault::TooShort)?,
        info::OBJECT_REQUEST => (data.len() >= 2)
            .then(|| object(served.dictionary, u16_at(data, 0)))
            .ok_or(MailboxFault::TooShort)?,
        info::ENTRY_REQUEST => {
            let address = (data.len() >= 4).then(|| ObjectAddress::new(u16_at(data, 0), data[2]));
            entry(served.dictionary, address.ok_or(MailboxFault::TooShort)?, data[3])
        }
        _ => Err(AbortCode::COMMAND),
    };
    Ok(match result {
        Ok((opcode, content)) => fragments(opcode, &content, served.room),
        Err(abort) => fragments(info::ERROR, &abort.0.to_le_bytes(), served.room),
    })
}

type Content = Result<(u8, Vec<u8>), AbortCode>;

fn list(dictionary: &Dictionary, kind: u16) -> Content {
    let mut content = kind.to_le_bytes().to_vec();
    match kind {
        info::LIST_LENGTHS => {
            for kind in 1..=5 {
                let count = dictionary.objects().iter().filter(|object| is_in_list(object, kind)).count();
                content.extend_from_slice(&(count as u16).to_le_bytes());
            }
        }
        1..=5 => {
            for object in dictionary.objects().iter().filter(|object| is_in_list(object, kind)) {
                content.extend_from_slice(&object.index.to_le_bytes());
            }
        }
        _ => return Err(AbortCode::UNSUPPORTED_ACCESS),
    }
    Ok((info::LIST_RESPONSE, content))
}

fn is_in_list(object: &Object, kind: u16) -> bool {
    let access = match kind {
        1 => return true,
        2 => Access::RX_PDO,
        3 => Access::TX_PDO,
        4 => Access::BACKUP,
        _ => Access::SETTING,
    };
    object.entries().iter().any(|entry| entry.access.contains(access))
}

fn object(dictionary: &Dictionary, index: u16) -> Content {
    let object = dictionary.object(index).ok_or(AbortCode::NO_SUCH_OBJECT)?;
    let mut content = index.to_le_bytes().to_vec();
    content.extend_from_slice(&object.data_type.0.to_le_bytes());
    content.extend_from_slice(&[object.max_subindex(), object.code as u8]);
    content.extend_from_slice(object.name.as_bytes());
    Ok((info::OBJECT_RESPONSE, content))
}

fn entry(dictionary: &Dictionary, address: ObjectAddress, value_info: u8) -> Content {
    let object = dictionary.object(address.index).ok_or(AbortCode::NO_SUCH_OBJECT)?;
    let entry = object.entry(address.subindex).ok_or(AbortCode::NO_SUCH_SUBINDEX)?;
    let mut given = if entry.has_variable_length() { 0 } else { value_info & WITH_DEFAULT };
    if entry.limits.is_some() {
        given |= value_info & (WITH_MINIMUM | WITH_MAXIMUM);
    }
    let mut content = address.index.to_le_bytes().to_vec();
    content.extend_from_slice(&[address.subindex, given]);
    content.extend_from_slice(&entry.data_type.0.to_le_bytes());
    content.extend_from_slice(&entry.bit_length.to_le_bytes());
    content.extend_from_slice(&entry.access.0.to_le_bytes());
    if given & WITH_DEFAULT != 0 {
        content.extend_from_slice(dictionary.default_value(entry));
    }
    if let Some((minimum, maximum)) = entry.limits {
        let bytes = entry.capacity().min(8);
        if given & WITH_MINIMUM != 0 {
            content.extend_from_slice(&minimum.to_le_bytes()[..bytes]);
        }
        if given & WITH_MAXIMUM != 0 {
            content.extend_from_slice(&maximum.to_le_bytes()[..bytes]);
        }
    }
    content.extend_from_slice(entry.name.as_bytes());
    Ok((info::ENTRY_RESPONSE, content))
}

/// Splits `content` so that each message fits into `room` bytes of service data.
fn fragments(opcode: u8, content: &[u8], room: usize) -> Vec<Vec<u8>> {
    let room = room.saturating_sub(HEADER + INFO_HEADER).max(2) & !1;
    let count = content.len().div_ceil(room).max(1);
    (0..count)
        .map(|number| {
            let part = &content[number * room..content.len().min((number + 1) * room)];
            let left = count - 1 - number;
            let header = InfoHeader { opcode, incomplete: left > 0, fragments_left: left as u16 };
            let mut body = vec![0; INFO_HEADER];
            header.write(&mut body);
            body.extend_from_slice(part);
            message(Service::SdoInfo, &body)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_answers_come_in_fragments_that_count_down() {
        let content: Vec<u8> = (0..100).collect();
        // 64 bytes of mailbox: 58 of service data, 52 behind both headers.
        let messages = fragments(info::LIST_RESPONSE, &content, 58);
        assert_eq!(messages.iter().map(Vec::len).collect::<Vec<_>>(), [58, 54]);
        let headers: Vec<InfoHeader> =
            messages.iter().map(|message| InfoHeader::read(&message[HEADER..]).unwrap()).collect();
        assert_eq!(headers[0], InfoHeader { opcode: 2, incomplete: true, fragments_left: 1 });
        assert_eq!(headers[1], InfoHeader { opcode: 2, incomplete: false, fragments_left: 0 });
        let joined: Vec<u8> = messages.iter().flat_map(|message| message[6..].to_vec()).collect();
        assert_eq!(joined, content);
        assert_eq!(fragments(info::LIST_RESPONSE, &[], 58).len(), 1, "an empty answer is one message");
    }
}
