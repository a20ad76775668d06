//! CANopen over EtherCAT: the CoE header, SDO headers, SDO Information, emergencies (ETG.1000.6, ETG.1000.5).
//!
//! Layouts only: who answers what, toggles, and segment order are the partners' logic.

use crate::bytes::{put_u16, u16_at, u32_at};
use core::fmt;

/// Bytes of the CoE header.
pub const HEADER: usize = 2;
/// Bytes of an SDO header: command, index, subindex, four data bytes.
pub const SDO_HEADER: usize = 8;
/// Bytes of an SDO Information header: opcode, reserved, fragments left.
pub const INFO_HEADER: usize = 4;

/// The CoE service: the upper nibble of the CoE header.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Service {
    /// Emergency.
    Emergency = 1,
    /// SDO request.
    SdoRequest = 2,
    /// SDO response.
    SdoResponse = 3,
    /// Transmit PDO.
    TxPdo = 4,
    /// Receive PDO.
    RxPdo = 5,
    /// Transmit PDO, remote request.
    TxPdoRemote = 6,
    /// Receive PDO, remote request.
    RxPdoRemote = 7,
    /// SDO Information.
    SdoInfo = 8,
}

impl Service {
    /// The service of a nibble.
    pub fn from_code(code: u8) -> Option<Self> {
        Some(match code {
            1 => Service::Emergency,
            2 => Service::SdoRequest,
            3 => Service::SdoResponse,
            4 => Service::TxPdo,
            5 => Service::RxPdo,
            6 => Service::TxPdoRemote,
            7 => Service::RxPdoRemote,
            8 => Service::SdoInfo,
            _ => return None,
        })
    }
}

/// Writes the CoE header for `service`. Panics where `bytes` is shorter than [`HEADER`].
pub fn write_header(bytes: &mut [u8], service: Service) {
    put_u16(bytes, 0, (service as u16) << 12);
}

/// The service nibble of a CoE message; `None` where the bytes are too short.
pub fn service_code(bytes: &[u8]) -> Option<u8> {
    (bytes.len() >= HEADER).then(|| (u16_at(bytes, 0) >> 12) as u8)
}

/// An object and a subindex in it. Displays as `6041:00`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ObjectAddress {
    /// Object index.
    pub index: u16,
    /// Subindex.
    pub subindex: u8,
}

impl ObjectAddress {
    /// The object `index:subindex`.
    pub const fn new(index: u16, subindex: u8) -> Self {
        ObjectAddress { index, subindex }
    }
}

impl fmt::Display for ObjectAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04x}:{:02x}", self.index, self.subindex)
    }
}

/// Bits of the first SDO byte. Client commands stand in the top three bits (specifier), as do server answers.
pub mod sdo {
    /// Client: download segment.
    pub const CLIENT_DOWNLOAD_SEGMENT: u8 = 0 << 5;
    /// Client: initiate download.
    pub const CLIENT_DOWNLOAD: u8 = 1 << 5;
    /// Client: initiate upload.
    pub const CLIENT_UPLOAD: u8 = 2 << 5;
    /// Client: upload segment.
    pub const CLIENT_UPLOAD_SEGMENT: u8 = 3 << 5;
    /// Either side: abort.
    pub const ABORT: u8 = 4 << 5;
    /// Server: upload segment.
    pub const SERVER_UPLOAD_SEGMENT: u8 = 0 << 5;
    /// Server: download segment accepted.
    pub const SERVER_DOWNLOAD_SEGMENT: u8 = 1 << 5;
    /// Server: upload accepted.
    pub const SERVER_UPLOAD: u8 = 2 << 5;
    /// Server: download accepted.
    pub const SERVER_DOWNLOAD: u8 = 3 << 5;
    /// The specifier bits.
    pub const SPECIFIER: u8 = 7 << 5;
    /// Complete access (initiate) .
    pub const COMPLETE_ACCESS: u8 = 1 << 4;
    /// Toggle (segments).
    pub const TOGGLE: u8 = 1 << 4;
    /// Expedited transfer (initiate).
    pub const EXPEDITED: u8 = 1 << 1;
    /// The size is indicated (initiate).
    pub const SIZE_INDICATED: u8 = 1 << 0;
    /// No more segments (segments).
    pub const LAST_SEGMENT: u8 = 1 << 0;

    /// Bits 2 and 3 of an expedited transfer: bytes without data, for `length` of 1 to 4.
    pub const fn expedited_unused(length: usize) -> u8 {
        ((4 - length) as u8 & 3) << 2
    }

    /// Data bytes of an expedited transfer whose size is indicated.
    pub const fn expedited_length(command: u8) -> usize {
        4 - (command >> 2 & 3) as usize
    }

    /// Bits 1 to 3 of a segment shorter than seven bytes: bytes without data.
    pub const fn segment_unused(length: usize) -> u8 {
        if length < 7 { ((7 - length) as u8) << 1 } else { 0 }
    }

    /// Bytes without data in a segment of ten bytes (header included).
    pub const fn segment_unused_bytes(command: u8) -> usize {
        (command >> 1 & 7) as usize
    }
}

/// The eight bytes with which an SDO transfer starts, is answered or aborted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SdoHeader {
    /// Command byte, see [`sdo`].
    pub command: u8,
    /// The object.
    pub object: ObjectAddress,
    /// Four bytes: expedited data, complete size, or abort code.
    pub data: [u8; 4],
}

impl SdoHeader {
    /// Reads the header at the start of `bytes`; `None` where they are too short.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        (bytes.len() >= SDO_HEADER).then(|| SdoHeader {
            command: bytes[0],
            object: ObjectAddress::new(u16_at(bytes, 1), bytes[3]),
            data: [bytes[4], bytes[5], bytes[6], bytes[7]],
        })
    }

    /// Writes the header to the start of `bytes`. Panics where they are too short.
    pub fn write(&self, bytes: &mut [u8]) {
        bytes[0] = self.command;
        put_u16(bytes, 1, self.object.index);
        bytes[3] = self.object.subindex;
        bytes[4..8].copy_from_slice(&self.data);
    }

    /// The four bytes as size or abort code.
    pub fn value(&self) -> u32 {
        u32_at(&self.data, 0)
    }
}

/// An SDO abort code; [`AbortCode::text`] has its words.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct AbortCode(pub u32);

macro_rules! abort_codes {
    ($($code:literal $name:ident $text:literal;)*) => {
        impl AbortCode {
            $(#[doc = $text] pub const $name: AbortCode = AbortCode($code);)*

            /// What the code means; `None` for a code that the standard doesn't name.
            pub fn text(self) -> Option<&'static str> {
                match self.0 { $($code => Some($text),)* _ => None }
            }
        }
    };
}

abort_codes! {
    0x0503_0000 TOGGLE "toggle bit not changed";
    0x0504_0000 TIMEOUT "SDO protocol timeout";
    0x0504_0001 COMMAND "command specifier not valid or unknown";
    0x0504_0005 OUT_OF_MEMORY "out of memory";
    0x0601_0000 UNSUPPORTED_ACCESS "unsupported access to an object";
    0x0601_0001 WRITE_ONLY "attempt to read a write-only object";
    0x0601_0002 READ_ONLY "attempt to write a read-only object";
    0x0601_0003 SUBINDEX_ZERO_FIRST "subindex cannot be written, subindex 0 must be 0 for write access";
    0x0601_0004 COMPLETE_ACCESS "SDO complete access not supported for objects of variable length";
    0x0601_0005 LENGTH_EXCEEDS_MAILBOX "object length exceeds mailbox size";
    0x0601_0006 MAPPED_TO_RXPDO "object mapped to RxPDO, SDO download blocked";
    0x0602_0000 NO_SUCH_OBJECT "the object does not exist in the object dictionary";
    0x0604_0041 NOT_MAPPABLE "the object cannot be mapped into the PDO";
    0x0604_0042 PDO_LENGTH "number and length of the mapped objects exceed the PDO length";
    0x0604_0043 PARAMETER_INCOMPATIBLE "general parameter incompatibility";
    0x0604_0047 INTERNAL_INCOMPATIBILITY "general internal incompatibility in the device";
    0x0606_0000 HARDWARE "access failed due to a hardware error";
    0x0607_0010 LENGTH "data type or length of the parameter does not match";
    0x0607_0012 TOO_LONG "data type does not match, the parameter is too long";
    0x0607_0013 TOO_SHORT "data type does not match, the parameter is too short";
    0x0609_0011 NO_SUCH_SUBINDEX "the subindex does not exist";
    0x0609_0030 VALUE_RANGE "value range of the parameter exceeded";
    0x0609_0031 VALUE_TOO_HIGH "value of the parameter written too high";
    0x0609_0032 VALUE_TOO_LOW "value of the parameter written too low";
    0x0609_0033 MODULE_LIST "detected module list does not match the configured one";
    0x0609_0036 MAX_BELOW_MIN "maximum value is less than minimum value";
    0x0800_0000 GENERAL "general error";
    0x0800_0020 CANNOT_TRANSFER "data cannot be transferred or stored to the application";
    0x0800_0021 LOCAL_CONTROL "data cannot be transferred or stored because of local control";
    0x0800_0022 DEVICE_STATE "data cannot be transferred or stored in the present device state";
    0x0800_0023 NO_DICTIONARY "object dictionary generation failed or no object dictionary";
}

impl fmt::Display for AbortCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "0x{:08x} {}", self.0, self.text().unwrap_or("not named by the standard"))
    }
}

/// SDO Information opcodes (seven bits; bit 7 says that more fragments follow).
pub mod info {
    /// Request for the object list.
    pub const LIST_REQUEST: u8 = 1;
    /// Object list.
    pub const LIST_RESPONSE: u8 = 2;
    /// Request for an object's description.
    pub const OBJECT_REQUEST: u8 = 3;
    /// Object description: index 2, data type 2, max subindex 1, object code 1, name.
    pub const OBJECT_RESPONSE: u8 = 4;
    /// Request for an entry's description: index 2, subindex 1, value info 1.
    pub const ENTRY_REQUEST: u8 = 5;
    /// Entry description: index 2, subindex 1, value info 1, data type 2, bit length 2, access 2, then values and name.
    pub const ENTRY_RESPONSE: u8 = 6;
    /// Error: abort code 4.
    pub const ERROR: u8 = 7;
    /// Bit of the opcode byte: incomplete.
    pub const INCOMPLETE: u8 = 0x80;
    /// List type: the lengths of the five lists.
    pub const LIST_LENGTHS: u16 = 0;
    /// List type: all objects.
    pub const LIST_ALL: u16 = 1;
}

/// The SDO Information header behind the CoE header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InfoHeader {
    /// Opcode without the incomplete bit, see [`info`].
    pub opcode: u8,
    /// More fragments follow.
    pub incomplete: bool,
    /// Fragments that follow.
    pub fragments_left: u16,
}

impl InfoHeader {
    /// Reads the header at the start of `bytes`; `None` where they are too short.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        (bytes.len() >= INFO_HEADER).then(|| InfoHeader {
            opcode: bytes[0] & 0x7F,
            incomplete: bytes[0] & info::INCOMPLETE != 0,
            fragments_left: u16_at(bytes, 2),
        })
    }

    /// Writes the header to the start of `bytes`. Panics where they are too short.
    pub fn write(&self, bytes: &mut [u8]) {
        bytes[0] = self.opcode | if self.incomplete { info::INCOMPLETE } else { 0 };
        bytes[1] = 0;
        put_u16(bytes, 2, self.fragments_left);
    }
}

/// An emergency: error code, error register, five bytes of the manufacturer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Emergency {
    /// Error code (CiA 301, device profiles).
    pub code: u16,
    /// Error register (object 0x1001).
    pub register: u8,
    /// Manufacturer specific.
    pub data: [u8; 5],
}

impl Emergency {
    /// Bytes behind the CoE header.
    pub const LENGTH: usize = 8;

    /// Reads the bytes behind the CoE header; `None` where they are too short.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        (bytes.len() >= Self::LENGTH).then(|| Emergency {
            code: u16_at(bytes, 0),
            register: bytes[2],
            data: [bytes[3], bytes[4], bytes[5], bytes[6], bytes[7]],
        })
    }

    /// Writes the bytes behind the CoE header. Panics where they are too short.
    pub fn write(&self, bytes: &mut [u8]) {
        put_u16(bytes, 0, self.code);
        bytes[2] = self.register;
        bytes[3..8].copy_from_slice(&self.data);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn expedited_download_of_two_bytes_has_the_command_byte_of_the_standard() {
        let command = sdo::CLIENT_DOWNLOAD | sdo::EXPEDITED | sdo::SIZE_INDICATED | sdo::expedited_unused(2);
        assert_eq!(command, 0x2B);
        assert_eq!(sdo::expedited_length(command), 2);
        let mut bytes = [0; 8];
        let header = SdoHeader { command, object: ObjectAddress::new(0x6040, 0), data: [6, 0, 0, 0] };
        header.write(&mut bytes);
        assert_eq!(bytes, [0x2B, 0x40, 0x60, 0x00, 0x06, 0x00, 0x00, 0x00]);
        assert_eq!(SdoHeader::read(&bytes), Some(header));
        assert_eq!(SdoHeader::read(&bytes[..7]), None);
    }

    #[test]
    fn segments_count_their_unused_bytes() {
        assert_eq!(sdo::segment_unused(7), 0);
        assert_eq!(sdo::segment_unused_bytes(sdo::segment_unused(3)), 4);
    }

    #[test]
    fn services_stand_in_the_top_nibble() {
        let mut bytes = [0; 2];
        write_header(&mut bytes, Service::SdoRequest);
        assert_eq!(bytes, [0x00, 0x20]);
        assert_eq!(service_code(&bytes).and_then(Service::from_code), Some(Service::SdoRequest));
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_back(
            command: u8,
            index: u16,
            subindex: u8,
            data: [u8; 4],
            opcode in 0u8..128,
            incomplete: bool,
            fragments_left: u16,
            more: [u8; 5],
        ) {
            let mut bytes = [0; 8];
            let sdo = SdoHeader { command, object: ObjectAddress::new(index, subindex), data };
            sdo.write(&mut bytes);
            prop_assert_eq!(SdoHeader::read(&bytes), Some(sdo));
            let info = InfoHeader { opcode, incomplete, fragments_left };
            info.write(&mut bytes);
            prop_assert_eq!(InfoHeader::read(&bytes), Some(info));
            let emergency = Emergency { code: index, register: subindex, data: more };
            emergency.write(&mut bytes);
            prop_assert_eq!(Emergency::read(&bytes), Some(emergency));
        }

        #[test]
        fn any_bytes_are_read_without_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..16)) {
            prop_assert_eq!(SdoHeader::read(&bytes).is_some(), bytes.len() >= SDO_HEADER);
            prop_assert_eq!(InfoHeader::read(&bytes).is_some(), bytes.len() >= INFO_HEADER);
            prop_assert_eq!(Emergency::read(&bytes).is_some(), bytes.len() >= Emergency::LENGTH);
            prop_assert_eq!(service_code(&bytes).is_some(), bytes.len() >= HEADER);
        }
    }
}
