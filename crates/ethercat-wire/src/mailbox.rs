//! The mailbox header and its protocols (ETG.1000.4, "Mailbox").
//!
//! ```text
//! | length 2 | station 2 | channel:6 priority:2 | type:4 counter:3 reserved:1 | service data ...
//! ```

use crate::bytes::{put_u16, u16_at};

/// Bytes of the mailbox header.
pub const HEADER: usize = 6;

/// The protocol of a mailbox message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Protocol {
    /// Error reply.
    Error = 0,
    /// ADS over EtherCAT.
    Aoe = 1,
    /// Ethernet over EtherCAT.
    Eoe = 2,
    /// CANopen over EtherCAT.
    Coe = 3,
    /// File access over EtherCAT.
    Foe = 4,
    /// Servo drive profile over EtherCAT.
    Soe = 5,
    /// Vendor specific.
    Voe = 15,
}

impl Protocol {
    /// The protocol of a type nibble.
    pub fn from_code(code: u8) -> Option<Self> {
        Some(match code {
            0 => Protocol::Error,
            1 => Protocol::Aoe,
            2 => Protocol::Eoe,
            3 => Protocol::Coe,
            4 => Protocol::Foe,
            5 => Protocol::Soe,
            15 => Protocol::Voe,
            _ => return None,
        })
    }

    /// The standard's short name.
    pub fn name(self) -> &'static str {
        match self {
            Protocol::Error => "error",
            Protocol::Aoe => "AoE",
            Protocol::Eoe => "EoE",
            Protocol::Coe => "CoE",
            Protocol::Foe => "FoE",
            Protocol::Soe => "SoE",
            Protocol::Voe => "VoE",
        }
    }
}

/// A mailbox header; `protocol` stays a raw nibble so that nothing is lost in reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Bytes of service data behind the header.
    pub length: u16,
    /// Station address of the source (from the MainDevice: 0) or, between SubDevices, the destination.
    pub station: u16,
    /// Channel (reserved, 0).
    pub channel: u8,
    /// Priority 0 to 3.
    pub priority: u8,
    /// Type nibble; [`Protocol::from_code`] names it.
    pub protocol: u8,
    /// Counter 1 to 7; 0 means "no counter".
    pub counter: u8,
}

impl Header {
    /// A header of this protocol and counter for `length` bytes of service data.
    pub fn new(protocol: Protocol, counter: u8, length: u16) -> Self {
        Header { length, station: 0, channel: 0, priority: 0, protocol: protocol as u8, counter }
    }

    /// Writes the six bytes to the start of `bytes`. Panics where it is shorter.
    pub fn write(&self, bytes: &mut [u8]) {
        put_u16(bytes, 0, self.length);
        put_u16(bytes, 2, self.station);
        bytes[4] = (self.channel & 0x3F) | self.priority << 6;
        bytes[5] = (self.protocol & 0x0F) | (self.counter & 7) << 4;
    }
}

/// Why bytes aren't a mailbox message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MailboxError {
    /// Not even a header.
    #[error("mailbox of {found} bytes is shorter than its header of 6")]
    TooShort {
        /// Bytes there.
        found: usize,
    },
    /// The header announces more than the mailbox holds.
    #[error("mailbox header announces {announced} bytes of data, the mailbox holds {found}")]
    LengthBeyondMailbox {
        /// Length field.
        announced: usize,
        /// Bytes behind the header.
        found: usize,
    },
}

/// Reads a mailbox area: the header and exactly the service data that it announces.
pub fn read(area: &[u8]) -> Result<(Header, &[u8]), MailboxError> {
    if area.len() < HEADER {
        return Err(MailboxError::TooShort { found: area.len() });
    }
    let header = Header {
        length: u16_at(area, 0),
        station: u16_at(area, 2),
        channel: area[4] & 0x3F,
        priority: area[4] >> 6,
        protocol: area[5] & 0x0F,
        counter: area[5] >> 4 & 7,
    };
    let (announced, found) = (usize::from(header.length), area.len() - HEADER);
    if announced > found {
        return Err(MailboxError::LengthBeyondMailbox { announced, found });
    }
    Ok((header, &area[HEADER..HEADER + announced]))
}

/// Details of an error reply (protocol 0: type 1, then this).
pub fn error_text(detail: u16) -> &'static str {
    match detail {
        0x01 => "syntax of the mailbox header is wrong",
        0x02 => "the mailbox protocol is not supported",
        0x03 => "channel is not supported",
        0x04 => "the service of the protocol is not supported",
        0x05 => "the header of the protocol is wrong",
        0x06 => "the data are too short",
        0x07 => "no memory",
        0x08 => "the data are inconsistent",
        _ => "not named by the standard",
    }
}

/// The counter after `counter`: 1 to 7, then 1 again.
pub fn next_counter(counter: u8) -> u8 {
    counter % 7 + 1
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn header_bytes_are_those_of_an_sdo_upload_request() {
        let mut bytes = [0; 6];
        Header::new(Protocol::Coe, 1, 10).write(&mut bytes);
        assert_eq!(bytes, [0x0a, 0x00, 0x00, 0x00, 0x00, 0x13]);
    }

    #[test]
    fn counter_runs_from_1_to_7() {
        assert_eq!((next_counter(0), next_counter(1), next_counter(6), next_counter(7)), (1, 2, 7, 1));
    }

    #[test]
    fn announced_lengths_are_bounded_by_the_area() {
        assert_eq!(read(&[0; 5]), Err(MailboxError::TooShort { found: 5 }));
        let lying = [3, 0, 0, 0, 0, 0x23, 1, 2];
        assert_eq!(read(&lying), Err(MailboxError::LengthBeyondMailbox { announced: 3, found: 2 }));
        let (header, data) = read(&[1, 0, 0, 0, 0, 0x23, 9, 0, 0]).unwrap();
        assert_eq!((header.counter, header.protocol, data), (2, 3, &[9][..]));
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_back(
            station: u16,
            channel in 0u8..64,
            priority in 0u8..4,
            protocol in 0u8..16,
            counter in 0u8..8,
            data in prop::collection::vec(any::<u8>(), 0..64),
        ) {
            let header =
                Header { length: data.len() as u16, station, channel, priority, protocol, counter };
            let mut area = [0; 128];
            header.write(&mut area);
            area[HEADER..HEADER + data.len()].copy_from_slice(&data);
            prop_assert_eq!(read(&area), Ok((header, &data[..])));
        }

        #[test]
        fn any_bytes_are_read_without_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..40)) {
            if let Ok((header, data)) = read(&bytes) {
                prop_assert_eq!(usize::from(header.length), data.len());
            }
        }
    }
}
