//! SDO Information: object lists, object and entry descriptions, in fragments.

use super::outcome::{Outcome, failed};
use super::request::{MailboxError, Operation};
use crate::wire::bytes::{put_u16, u16_at, u32_at};
use crate::wire::coe::{self, AbortCode, InfoHeader, ObjectAddress, Service, info};
use alloc::vec::Vec;

const HEADERS: usize = coe::HEADER + coe::INFO_HEADER;

/// One SDO Information request as the client sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Info {
    operation: Operation,
    /// Fragments that the last message announced; `None` before the first.
    left: Option<u16>,
}

impl Info {
    pub(super) fn new(operation: Operation) -> Self {
        Info { operation, left: None }
    }

    /// Writes the request; returns its length.
    pub(super) fn write(&self, message: &mut [u8]) -> usize {
        coe::write_header(message, Service::SdoInfo);
        let (opcode, length) = match self.operation {
            Operation::DescribeObject { index } => {
                put_u16(message, HEADERS, index);
                (info::OBJECT_REQUEST, 2)
            }
            Operation::DescribeEntry { object, value_info } => {
                put_u16(message, HEADERS, object.index);
                message[HEADERS + 2] = object.subindex;
                message[HEADERS + 3] = value_info;
                (info::ENTRY_REQUEST, 4)
            }
            operation => {
                put_u16(message, HEADERS, operation.list_type());
                (info::LIST_REQUEST, 2)
            }
        };
        InfoHeader { opcode, incomplete: false, fragments_left: 0 }.write(&mut message[coe::HEADER..]);
        HEADERS + length
    }

    /// Whether the first fragment answers what was asked.
    fn is_mine(&self, opcode: u8, body: &[u8]) -> bool {
        let word = (body.len() >= 2).then(|| u16_at(body, 0));
        match self.operation {
            Operation::DescribeObject { index } => opcode == info::OBJECT_RESPONSE && word == Some(index),
            Operation::DescribeEntry { object, .. } => {
                opcode == info::ENTRY_RESPONSE
                    && word == Some(object.index)
                    && body.get(2) == Some(&object.subindex)
            }
            operation => opcode == info::LIST_RESPONSE && word == Some(operation.list_type()),
        }
    }

    fn response_opcode(&self) -> u8 {
        match self.operation {
            Operation::DescribeObject { .. } => info::OBJECT_RESPONSE,
            Operation::DescribeEntry { .. } => info::ENTRY_RESPONSE,
            _ => info::LIST_RESPONSE,
        }
    }

    /// Takes a fragment; `result` never grows beyond its capacity. Lists are stored without their type.
    pub(super) fn read(&mut self, message: &[u8], result: &mut Vec<u8>) -> Outcome {
        if coe::service_code(message) != Some(Service::SdoInfo as u8) {
            return Outcome::Stray;
        }
        let Some(header) = InfoHeader::read(&message[coe::HEADER..]) else { return Outcome::Stray };
        let mut body = &message[HEADERS..];
        if header.opcode == info::ERROR {
            if body.len() < 4 {
                return failed(MailboxError::Malformed { what: "an SDO Information error without its code" });
            }
            return failed(MailboxError::InfoRefused { code: AbortCode(u32_at(body, 0)) });
        }
        match self.left {
            None if !self.is_mine(header.opcode, body) => return Outcome::Stray,
            None if header.opcode == info::LIST_RESPONSE => body = &body[2..],
            None => {}
            Some(_) if header.opcode != self.response_opcode() => return Outcome::Stray,
            Some(left) => {
                let expected = left.saturating_sub(1);
                if header.fragments_left != expected {
                    return failed(MailboxError::FragmentLost { expected, found: header.fragments_left });
                }
            }
        }
        let received = result.len() + body.len();
        if received > result.capacity() {
            return failed(MailboxError::TooLong { needed: received, limit: result.capacity() });
        }
        result.extend_from_slice(body);
        // The count decides: it falls with every fragment, so the answer ends.
        if header.fragments_left == 0 {
            return Outcome::Done;
        }
        self.left = Some(header.fragments_left);
        Outcome::More
    }
}

/// The object indices of a list that [`Operation::List`] read.
pub fn list_indices(data: &[u8]) -> impl Iterator<Item = u16> + '_ {
    data.chunks_exact(2).map(|pair| u16_at(pair, 0))
}

/// An object's description (ETG.1000.6, "Get object description").
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ObjectDescription<'a> {
    /// Object index.
    pub index: u16,
    /// CoE data type.
    pub data_type: u16,
    /// The highest subindex.
    pub max_subindex: u8,
    /// Object code: 7 variable, 8 array, 9 record.
    pub object_code: u8,
    /// Name, in the SubDevice's bytes.
    pub name: &'a [u8],
}

impl<'a> ObjectDescription<'a> {
    /// Reads what [`Operation::DescribeObject`] brought; `None` where it is too short.
    pub fn read(data: &'a [u8]) -> Option<Self> {
        (data.len() >= 6).then(|| ObjectDescription {
            index: u16_at(data, 0),
            data_type: u16_at(data, 2),
            max_subindex: data[4],
            object_code: data[5],
            name: &data[6..],
        })
    }
}

/// An entry's description (ETG.1000.6, "Get entry description").
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EntryDescription<'a> {
    /// The entry.
    pub object: ObjectAddress,
    /// CoE data type.
    pub data_type: u16,
    /// Length in bits.
    pub bit_length: u16,
    /// Access rights: bits 0 to 2 read in PRE-OP, SAFE-OP, OP; 3 to 5 write; 6 and 7 mappable to Rx and Tx PDOs.
    pub access: u16,
    /// Unit, where it was asked for and given.
    pub unit: Option<u16>,
    /// Default value's bytes.
    pub default: Option<&'a [u8]>,
    /// Minimum's bytes.
    pub minimum: Option<&'a [u8]>,
    /// Maximum's bytes.
    pub maximum: Option<&'a [u8]>,
    /// Name, in the SubDevice's bytes.
    pub name: &'a [u8],
}

impl<'a> EntryDescription<'a> {
    /// Value information bit: the unit.
    pub const UNIT: u8 = 1 << 3;
    /// Value information bit: the default value.
    pub const DEFAULT: u8 = 1 << 4;
    /// Value information bit: the minimum.
    pub const MINIMUM: u8 = 1 << 5;
    /// Value information bit: the maximum.
    pub const MAXIMUM: u8 = 1 << 6;

    /// Reads what [`Operation::DescribeEntry`] brought; `None` where it is too short.
    pub fn read(data: &'a [u8]) -> Option<Self> {
        if data.len() < 10 {
            return None;
        }
        let (value_info, bit_length) = (data[3], u16_at(data, 6));
        let value_bytes = usize::from(bit_length).div_ceil(8);
        let mut rest = &data[10..];
        let mut field = |bit: u8, length: usize| -> Option<Option<&'a [u8]>> {
            if value_info & bit == 0 {
                return Some(None);
            }
            let (field, behind) = rest.split_at_checked(length)?;
            rest = behind;
            Some(Some(field))
        };
        let unit = field(Self::UNIT, 2)?.map(|bytes| u16_at(bytes, 0));
        let default = field(Self::DEFAULT, value_bytes)?;
        let minimum = field(Self::MINIMUM, value_bytes)?;
        let maximum = field(Self::MAXIMUM, value_bytes)?;
        Some(EntryDescription {
            object: ObjectAddress::new(u16_at(data, 0), data[2]),
            data_type: u16_at(data, 4),
            bit_length,
            access: u16_at(data, 8),
            unit,
            default,
            minimum,
            maximum,
            name: rest,
        })
    }
}
