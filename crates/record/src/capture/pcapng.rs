//! pcapng: blocks whose length stands before and behind them.
//!
//! Block boundaries are checked here, so that a damaged block costs no more than itself; its content is read by
//! `pcap_parser` from exactly its bytes.

use super::{Capture, CaptureError, CapturedFrame, LINKTYPE_ETHERNET};
use crate::Direction;
use pcap_parser::pcapng::{
    Block, EnhancedPacketBlock, InterfaceDescriptionBlock, OptionCode, parse_block_be, parse_block_le,
};

/// Type of the section header block, the same in either byte order.
pub(super) const MAGIC: u32 = 0x0A0D_0D0A;
/// Bytes of the smallest block.
const SMALLEST_BLOCK: usize = 12;

/// What the packets of an interface need.
#[derive(Clone, Copy)]
struct Interface {
    ethernet: bool,
    units_per_second: u128,
    offset_s: i64,
    snap_length: usize,
}

pub(super) fn read(file: &[u8]) -> Result<Capture<'_>, CaptureError> {
    let Some(big_endian) = file.get(8..12).and_then(is_big_endian) else {
        return Err(CaptureError::Header { format: "pcapng", expected: 28, found: file.len() });
    };
    let mut reader =
        Reader { big_endian, file, capture: Capture::default(), interfaces: Vec::new(), number: 0 };
    let mut offset = 0;
    while offset < file.len() {
        let rest = &file[offset..];
        if rest.len() < SMALLEST_BLOCK {
            reader
                .capture
                .warn(offset, format!("the file ends inside a block, {} bytes are left over", rest.len()));
            break;
        }
        if rest[..4] == MAGIC.to_le_bytes() {
            match is_big_endian(&rest[8..12]) {
                Some(order) => reader.big_endian = order,
                None => {
                    reader
                        .capture
                        .warn(offset, "section header without byte-order magic: reading ends".to_owned());
                    break;
                }
            }
            reader.interfaces.clear();
        }
        let big_endian = reader.big_endian;
        let word = |at: usize| {
            let bytes = [rest[at], rest[at + 1], rest[at + 2], rest[at + 3]];
            if big_endian { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) }
        };
        let length = word(4) as usize;
        if length < SMALLEST_BLOCK || !length.is_multiple_of(4) {
            reader.capture.warn(offset, format!("a block can't have {length} bytes: reading ends"));
            break;
        }
        if length > rest.len() {
            let text = format!("the file ends inside a block of {length} bytes, {} are there", rest.len());
            reader.capture.warn(offset, text);
            break;
        }
        let behind = word(length - 4) as usize;
        if behind != length {
            let text = format!("block length is {length} before and {behind} behind it: reading ends");
            reader.capture.warn(offset, text);
            break;
        }
        let block = &rest[..length];
        let parsed = if big_endian { parse_block_be(block) } else { parse_block_le(block) };
        match parsed {
            Ok((_, block)) => reader.block(offset, &block),
            Err(_) => {
                reader.number += u64::from(matches!(word(0), 2 | 3 | 6));
                let text = format!("a block of type {} and {length} bytes is damaged: skipped", word(0));
                reader.capture.warn(offset, text);
            }
        }
        offset += length;
    }
    Ok(reader.capture)
}

/// Byte order of a section by its magic.
fn is_big_endian(magic: &[u8]) -> Option<bool> {
    match magic {
        [0x1A, 0x2B, 0x3C, 0x4D] => Some(true),
        [0x4D, 0x3C, 0x2B, 0x1A] => Some(false),
        _ => None,
    }
}

struct Reader<'a> {
    file: &'a [u8],
    capture: Capture<'a>,
    big_endian: bool,
    interfaces: Vec<Interface>,
    number: u64,
}

impl<'a> Reader<'a> {
    fn block(&mut self, offset: usize, block: &Block<'a>) {
        match block {
            Block::InterfaceDescription(description) => self.interface(offset, description),
            Block::EnhancedPacket(packet) => self.enhanced(offset, packet),
            Block::SimplePacket(packet) => {
                self.number += 1;
                let Some(interface) = self.interface_of(offset, 0) else { return };
                let wanted = (packet.origlen as usize).min(interface.snap_length);
                self.push(
                    offset,
                    offset + 12,
                    wanted,
                    Packet { original: packet.origlen, ..Packet::default() },
                );
            }
            _ => {}
        }
    }

    fn interface(&mut self, offset: usize, description: &InterfaceDescriptionBlock<'_>) {
        let ethernet = description.linktype.0 == LINKTYPE_ETHERNET;
        if !ethernet {
            let text = format!(
                "interface {} has link type {}, not Ethernet (1): its packets are left out",
                self.interfaces.len(),
                description.linktype.0
            );
            self.capture.warn(offset, text);
        }
        let resolution = description.if_tsresol;
        let units_per_second = match resolution & 0x80 {
            0 => 10u128.checked_pow(u32::from(resolution)),
            _ => 1u128.checked_shl(u32::from(resolution & 0x7F)),
        };
        if units_per_second.is_none() {
            self.capture.warn(offset, format!("time resolution 10^-{resolution} is read as microseconds"));
        }
        // Read here, because the parser takes it for little endian in either byte order.
        let offset_option = description.options.iter().find(|option| option.code == OptionCode::IfTsoffset);
        let offset_s =
            offset_option.and_then(|option| option.value().first_chunk::<8>()).map_or(0, |bytes| {
                if self.big_endian { i64::from_be_bytes(*bytes) } else { i64::from_le_bytes(*bytes) }
            });
        self.interfaces.push(Interface {
            ethernet,
            units_per_second: units_per_second.unwrap_or(1_000_000),
            offset_s,
            snap_length: match description.snaplen {
                0 => usize::MAX,
                limit => limit as usize,
            },
        });
    }

    fn enhanced(&mut self, offset: usize, packet: &EnhancedPacketBlock<'_>) {
        self.number += 1;
        let Some(interface) = self.interface_of(offset, packet.if_id) else { return };
        let units = u128::from(packet.ts_high) << 32 | u128::from(packet.ts_low);
        let since_offset_ns = units.saturating_mul(1_000_000_000) / interface.units_per_second;
        let ns = i128::try_from(since_offset_ns)
            .unwrap_or(i128::MAX)
            .saturating_add(i128::from(interface.offset_s) * 1_000_000_000);
        let flags = packet.options.iter().find(|option| option.code == OptionCode(2));
        let direction = flags.and_then(|option| option.value().first_chunk::<4>()).and_then(|bytes| {
            let flags = if self.big_endian { u32::from_be_bytes(*bytes) } else { u32::from_le_bytes(*bytes) };
            match flags & 3 {
                1 => Some(Direction::Inbound),
                2 => Some(Direction::Outbound),
                _ => None,
            }
        });
        let unix_ns = u64::try_from(ns.max(0)).unwrap_or(u64::MAX);
        let packet_facts = Packet { unix_ns, direction, original: packet.origlen };
        self.push(offset, offset + 28, packet.caplen as usize, packet_facts);
    }

    /// The interface of a packet, if its packets are Ethernet frames.
    fn interface_of(&mut self, offset: usize, index: u32) -> Option<Interface> {
        match self.interfaces.get(index as usize) {
            Some(interface) => interface.ethernet.then_some(*interface),
            None => {
                let text = format!(
                    "a packet names interface {index}, {} are described: left out",
                    self.interfaces.len()
                );
                self.capture.warn(offset, text);
                None
            }
        }
    }

    /// Appends the packet whose data stands at `start` of the file.
    fn push(&mut self, block_offset: usize, start: usize, length: usize, packet: Packet) {
        let Some(data) = start.checked_add(length).and_then(|end| self.file.get(start..end)) else {
            self.capture
                .warn(block_offset, format!("packet data of {length} bytes reach beyond the file: left out"));
            return;
        };
        self.capture.frames.push(CapturedFrame {
            number: self.number,
            unix_ns: packet.unix_ns,
            direction: packet.direction,
            data,
            original_length: packet.original as usize,
        });
    }
}

/// What a block says about its packet beside the data.
#[derive(Default)]
struct Packet {
    unix_ns: u64,
    direction: Option<Direction>,
    original: u32,
}
