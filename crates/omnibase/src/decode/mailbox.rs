//! Mailbox messages in words.

use crate::hex;
use omnibase_ethercat_wire::bytes::{u16_at, u32_at};
use omnibase_ethercat_wire::coe::{self, AbortCode, Emergency, InfoHeader, SdoHeader, Service, info, sdo};
use omnibase_ethercat_wire::mailbox::{self, Protocol};
use omnibase_ethercat_wire::printable::printable;

/// Bytes of data shown in words; all of them stand in the datagram's data.
const SHOWN: usize = 16;

/// The message in a mailbox area, in words; `None` where the bytes aren't one.
///
/// Where a mailbox lies is not always in the capture, so any data written to or read from a SubDevice's memory may
/// be offered here: the header has to make sense.
pub fn words(area: &[u8]) -> Option<String> {
    let (header, data) = mailbox::read(area).ok()?;
    let protocol = Protocol::from_code(header.protocol)?;
    if data.is_empty() || area[5] & 0x80 != 0 || header.channel != 0 {
        return None;
    }
    let content = match protocol {
        Protocol::Coe => coe_words(data)?,
        Protocol::Error => error_words(data)?,
        _ => format!("{} bytes: {}", data.len(), hex::spaced(data, SHOWN)),
    };
    Some(format!("mailbox {} #{}: {content}", protocol.name(), header.counter))
}

fn error_words(data: &[u8]) -> Option<String> {
    if data.len() < 4 || u16_at(data, 0) != 1 {
        return None;
    }
    let detail = u16_at(data, 2);
    Some(format!("refused, 0x{detail:04x} {}", mailbox::error_text(detail)))
}

fn coe_words(data: &[u8]) -> Option<String> {
    let service = Service::from_code(coe::service_code(data)?)?;
    let body = &data[coe::HEADER..];
    Some(match service {
        Service::SdoRequest => request_words(body)?,
        Service::SdoResponse => response_words(body)?,
        Service::SdoInfo => info_words(body)?,
        Service::Emergency => {
            let emergency = Emergency::read(body)?;
            format!(
                "EMERGENCY 0x{:04x}, error register 0x{:02x}, data {}",
                emergency.code,
                emergency.register,
                hex::spaced(&emergency.data, SHOWN)
            )
        }
        Service::TxPdo | Service::RxPdo => format!("PDO, {} bytes", body.len()),
        Service::TxPdoRemote | Service::RxPdoRemote => "PDO remote request".to_owned(),
    })
}

fn request_words(body: &[u8]) -> Option<String> {
    let command = *body.first()?;
    Some(match command & sdo::SPECIFIER {
        sdo::CLIENT_DOWNLOAD => format!("SDO download {}", initiate_words(body)?),
        sdo::CLIENT_UPLOAD => {
            let header = SdoHeader::read(body)?;
            format!("SDO upload {}{}", header.object, complete(command))
        }
        sdo::CLIENT_DOWNLOAD_SEGMENT => format!("SDO download segment, {}", segment_words(body)),
        sdo::CLIENT_UPLOAD_SEGMENT => format!("SDO upload segment, toggle {}", toggle(command)),
        sdo::ABORT => abort_words(body)?,
        _ => return None,
    })
}

fn response_words(body: &[u8]) -> Option<String> {
    let command = *body.first()?;
    Some(match command & sdo::SPECIFIER {
        sdo::SERVER_UPLOAD => format!("SDO upload answer {}", initiate_words(body)?),
        sdo::SERVER_DOWNLOAD => format!("SDO download accepted {}", SdoHeader::read(body)?.object),
        sdo::SERVER_UPLOAD_SEGMENT => format!("SDO upload segment answer, {}", segment_words(body)),
        sdo::SERVER_DOWNLOAD_SEGMENT => format!("SDO download segment accepted, toggle {}", toggle(command)),
        sdo::ABORT => abort_words(body)?,
        _ => return None,
    })
}

/// Object and data of a transfer's first message.
fn initiate_words(body: &[u8]) -> Option<String> {
    let header = SdoHeader::read(body)?;
    let (object, complete) = (header.object, complete(header.command));
    if header.command & sdo::EXPEDITED != 0 {
        let length = match header.command & sdo::SIZE_INDICATED {
            0 => 4,
            _ => sdo::expedited_length(header.command),
        };
        let data = &header.data[..length];
        return Some(format!("{object}{complete} = {}", value_words(data)));
    }
    let data = &body[coe::SDO_HEADER..];
    let size = header.value();
    Some(format!("{object}{complete}, {size} bytes, here {}: {}", data.len(), hex::spaced(data, SHOWN)))
}

/// Bytes, and the number that they are if they may be one.
fn value_words(data: &[u8]) -> String {
    let digits = hex::spaced(data, SHOWN);
    match *data {
        [byte] => format!("{digits} ({byte})"),
        [low, high] => format!("{digits} ({})", u16::from_le_bytes([low, high])),
        [a, b, c, d] => format!("{digits} ({})", u32::from_le_bytes([a, b, c, d])),
        _ => digits,
    }
}

fn segment_words(body: &[u8]) -> String {
    let command = body[0];
    let mut data = &body[1..];
    if data.len() <= 7 {
        data = &data[..data.len().saturating_sub(sdo::segment_unused_bytes(command))];
    }
    let last = if command & sdo::LAST_SEGMENT != 0 { ", the last" } else { "" };
    format!("toggle {}{last}, {} bytes: {}", toggle(command), data.len(), hex::spaced(data, SHOWN))
}

fn abort_words(body: &[u8]) -> Option<String> {
    let header = SdoHeader::read(body)?;
    Some(format!("SDO ABORT {}, {}", header.object, AbortCode(header.value())))
}

fn toggle(command: u8) -> u8 {
    u8::from(command & sdo::TOGGLE != 0)
}

fn complete(command: u8) -> &'static str {
    if command & sdo::COMPLETE_ACCESS != 0 { " complete" } else { "" }
}

fn info_words(body: &[u8]) -> Option<String> {
    let header = InfoHeader::read(body)?;
    let data = &body[coe::INFO_HEADER..];
    let what = match header.opcode {
        info::LIST_REQUEST => format!("list of objects wanted, list {}", u16_of(data)?),
        info::LIST_RESPONSE => format!("list of objects, {} bytes", data.len()),
        info::OBJECT_REQUEST => format!("description of {:04x} wanted", u16_of(data)?),
        info::OBJECT_RESPONSE => {
            let name = printable(data.get(6..)?);
            format!(
                "description of {:04x}: type 0x{:04x}, up to subindex {}, \"{name}\"",
                u16_of(data)?,
                u16_at(data, 2),
                data[4]
            )
        }
        info::ENTRY_REQUEST => format!("description of {:04x}:{:02x} wanted", u16_of(data)?, data.get(2)?),
        info::ENTRY_RESPONSE => {
            data.get(9)?;
            format!(
                "description of {:04x}:{:02x}: type 0x{:04x}, {} bits, access 0x{:04x}",
                u16_at(data, 0),
                data[2],
                u16_at(data, 4),
                u16_at(data, 6),
                u16_at(data, 8)
            )
        }
        info::ERROR => format!("ERROR {}", AbortCode((data.len() >= 4).then(|| u32_at(data, 0))?)),
        _ => return None,
    };
    let more = if header.incomplete {
        format!(", {} fragments follow", header.fragments_left)
    } else {
        String::new()
    };
    Some(format!("SDO Information: {what}{more}"))
}

fn u16_of(data: &[u8]) -> Option<u16> {
    (data.len() >= 2).then(|| u16_at(data, 0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn coe(body: &[u8]) -> String {
        let mut area = vec![body.len() as u8, 0, 0, 0, 0, 0x33];
        area.extend(body);
        area.extend([0; 5]);
        words(&area).unwrap_or_default()
    }

    #[test]
    fn sdo_messages_come_in_words() {
        let cases: [(&[u8], &str); 8] = [
            (&[0, 0x20, 0x2B, 0x40, 0x60, 0, 6, 0, 0, 0], "SDO download 6040:00 = 06 00 (6)"),
            (&[0, 0x20, 0x40, 0x12, 0x1C, 0, 0, 0, 0, 0], "SDO upload 1c12:00"),
            (&[0, 0x20, 0x50, 0x12, 0x1C, 0, 0, 0, 0, 0], "SDO upload 1c12:00 complete"),
            (&[0, 0x30, 0x43, 0, 0x10, 0, 0x92, 1, 2, 0], "SDO upload answer 1000:00 = 92 01 02 00 (131474)"),
            (
                &[0, 0x30, 0x41, 8, 0x10, 0, 9, 0, 0, 0, b'a', b'b'],
                "SDO upload answer 1008:00, 9 bytes, here 2: 61 62",
            ),
            (
                &[0, 0x30, 0x80, 0x12, 0x1C, 1, 0, 0, 2, 6],
                "SDO ABORT 1c12:01, 0x06020000 the object does not exist in the object dictionary",
            ),
            (
                &[0, 0x30, 0x19, 1, 2, 3, 0, 0, 0, 0],
                "SDO upload segment answer, toggle 1, the last, 3 bytes: 01 02 03",
            ),
            (
                &[0, 0x10, 0x30, 0x81, 1, 1, 2, 3, 4, 5],
                "EMERGENCY 0x8130, error register 0x01, data 01 02 03 04 05",
            ),
        ];
        for (body, expected) in cases {
            assert_eq!(coe(body), format!("mailbox CoE #3: {expected}"));
        }
    }

    #[test]
    fn sdo_information_comes_in_words() {
        assert_eq!(
            coe(&[0, 0x80, 0x82, 0, 3, 0, 1, 0, 0, 0x10]),
            "mailbox CoE #3: SDO Information: list of objects, 4 bytes, 3 fragments follow"
        );
        assert_eq!(
            coe(&[0, 0x80, 4, 0, 0, 0, 0, 0x10, 7, 0, 0, 7, b'D', b'T']),
            "mailbox CoE #3: SDO Information: description of 1000: type 0x0007, up to subindex 0, \"DT\""
        );
    }

    #[test]
    fn refusals_come_in_words() {
        assert_eq!(
            words(&[4, 0, 0, 0, 0, 0x10, 1, 0, 2, 0]).as_deref(),
            Some("mailbox error #1: refused, 0x0002 the mailbox protocol is not supported")
        );
    }

    #[test]
    fn process_data_are_not_taken_for_a_message() {
        assert_eq!(words(&[0; 16]), None);
        assert_eq!(words(&[0xFF; 16]), None);
        assert_eq!(words(&[]), None);
    }

    #[test]
    fn no_short_message_panics() {
        for service in 0..16u8 {
            for command in 0..=255 {
                for length in 0..14 {
                    let mut body = vec![0, service << 4, command, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11];
                    body.truncate(length);
                    let _ = coe(&body);
                }
            }
        }
    }
}
