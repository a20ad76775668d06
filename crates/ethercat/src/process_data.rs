//! Areas of a SubDevice's memory, what is mapped into them, and where that stands in the logical address space.

use alloc::string::String;
use alloc::vec::Vec;
use core::time::Duration;

use crate::wire::coe::ObjectAddress;
use crate::wire::sii::{self, SyncManagerUsage};

/// A stretch of a SubDevice's memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MemoryArea {
    /// Address of the first byte.
    pub start: u16,
    /// Bytes.
    pub length: u16,
}

/// Both mailboxes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MailboxConfig {
    /// From the MainDevice to the SubDevice (SM0).
    pub write: MemoryArea,
    /// From the SubDevice to the MainDevice (SM1).
    pub read: MemoryArea,
    /// Protocols, bits `sii::PROTOCOL_*`.
    pub protocols: u16,
    /// How long each message waits for its answer, where a request doesn't say otherwise.
    pub answer_timeout: Duration,
}

impl MailboxConfig {
    /// Whether the SubDevice speaks CoE.
    pub fn speaks_coe(&self) -> bool {
        self.protocols & sii::PROTOCOL_COE != 0
    }
}

/// The way that process data go.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Direction {
    /// From the MainDevice.
    Outputs,
    /// To the MainDevice.
    Inputs,
}

/// One object (or a gap) in a PDO.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MappedObject {
    /// The object; index 0 is a gap.
    pub object: ObjectAddress,
    /// Its length in the process data, bits.
    pub bit_length: u8,
    /// CoE data type, where the SII gives one.
    pub data_type: Option<u8>,
    /// Its name, where the SII gives one.
    pub name: Option<String>,
}

/// One PDO as it is mapped.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MappedPdo {
    /// 0x16xx (outputs) or 0x1Axx (inputs).
    pub index: u16,
    /// Its name, where the SII gives one.
    pub name: Option<String>,
    /// What it maps, in order.
    pub entries: Vec<MappedObject>,
}

impl MappedPdo {
    /// Sum of the entries' lengths, bits.
    pub fn bit_length(&self) -> u32 {
        self.entries.iter().map(|entry| u32::from(entry.bit_length)).sum()
    }
}

/// A place in the logical address space (32-bit byte address), to the bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LogicalBits {
    /// Byte address of the first bit.
    pub address: u32,
    /// First bit in that byte, 0 to 7.
    pub start_bit: u8,
    /// Bits.
    pub bit_length: u32,
}

/// When a SyncManager is switched on (SII category 41, byte 6).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Activation {
    /// Before SAFE-OP.
    #[default]
    SafeOp,
    /// Between SAFE-OP and OP.
    OpOnly,
    /// Never: it is virtual, its area is reached by FMMUs alone.
    Never,
}

/// A SyncManager as it is programmed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SyncManager {
    /// Which one.
    pub index: u8,
    /// Its memory; a length of 0 leaves it switched off.
    pub area: MemoryArea,
    /// Control byte (0x0804 + 8n).
    pub control: u8,
    /// Switched on before SAFE-OP.
    pub enabled: bool,
    /// When it is switched on, where it carries anything.
    pub activation: Activation,
    /// What it is for.
    pub usage: SyncManagerUsage,
    /// PDOs assigned to it, in order; empty for mailboxes.
    pub pdos: Vec<MappedPdo>,
    /// Its process data in the logical address space; `None` for mailboxes, for a length of 0, and before the
    /// process image is planned.
    pub logical: Option<LogicalBits>,
}

impl SyncManager {
    /// The way of its process data; `None` for mailboxes and unused ones.
    pub fn direction(&self) -> Option<Direction> {
        match self.usage {
            SyncManagerUsage::Outputs => Some(Direction::Outputs),
            SyncManagerUsage::Inputs => Some(Direction::Inputs),
            _ => None,
        }
    }

    /// Its index, where it carries something and is switched on between SAFE-OP and OP.
    pub fn op_only(&self) -> Option<u8> {
        (self.activation == Activation::OpOnly && self.area.length > 0).then_some(self.index)
    }

    /// Bits of process data mapped to it.
    pub fn bit_length(&self) -> u32 {
        self.pdos.iter().map(MappedPdo::bit_length).sum()
    }

    /// Its eight registers from 0x0800 + 8n.
    pub fn registers(&self) -> [u8; 8] {
        let [start_low, start_high] = self.area.start.to_le_bytes();
        let [length_low, length_high] = self.area.length.to_le_bytes();
        [start_low, start_high, length_low, length_high, self.control, 0, u8::from(self.enabled), 0]
    }
}
