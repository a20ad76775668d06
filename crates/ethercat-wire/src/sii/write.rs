//! Writing an image.

use super::*;
use crate::bytes::{put_u16, put_u32};

impl Image {
    /// The image's bytes, padded with 0xFF to the size that its header announces.
    ///
    /// Categories come in the order strings, general, FMMUs, SyncManagers, TxPDOs, RxPDOs, DC, others; empty ones
    /// are left out. Strings longer than 255 bytes and PDOs of more than 255 entries are cut: the format can't
    /// hold them.
    pub fn emit(&self) -> Vec<u8> {
        let mut bytes = self.header.bytes().to_vec();
        if !self.strings.is_empty() {
            let mut data = alloc::vec![self.strings.len().min(255) as u8];
            for string in self.strings.iter().take(255) {
                let text = &string[..string.len().min(255)];
                data.push(text.len() as u8);
                data.extend_from_slice(text);
            }
            push_category(&mut bytes, CATEGORY_STRINGS, &data);
        }
        if let Some(general) = &self.general {
            push_category(&mut bytes, CATEGORY_GENERAL, &general.bytes());
        }
        push_records(&mut bytes, CATEGORY_FMMU, self.fmmus.iter().map(|usage| [usage.code()]));
        push_records(&mut bytes, CATEGORY_SYNC_MANAGERS, self.sync_managers.iter().map(SyncManager::bytes));
        push_records(&mut bytes, CATEGORY_TX_PDO, self.tx_pdos.iter().map(Pdo::bytes));
        push_records(&mut bytes, CATEGORY_RX_PDO, self.rx_pdos.iter().map(Pdo::bytes));
        push_records(&mut bytes, CATEGORY_DC, self.dc_modes.iter().map(DcMode::bytes));
        for category in &self.other {
            push_category(&mut bytes, category.kind, &category.data);
        }
        bytes.extend_from_slice(&CATEGORY_END.to_le_bytes());
        let size = (usize::from(self.header.size_kibit_less_one) + 1) * 128;
        if bytes.len() < size {
            bytes.resize(size, 0xFF);
        }
        bytes
    }
}

/// Appends a category, its data padded to whole words.
fn push_category(bytes: &mut Vec<u8>, kind: u16, data: &[u8]) {
    let words = data.len().div_ceil(2);
    bytes.extend_from_slice(&kind.to_le_bytes());
    bytes.extend_from_slice(&(words as u16).to_le_bytes());
    bytes.extend_from_slice(data);
    if data.len() % 2 == 1 {
        bytes.push(0);
    }
}

/// Appends records, those that one category can't hold in further ones of the same kind.
fn push_records<R: AsRef<[u8]>>(bytes: &mut Vec<u8>, kind: u16, records: impl Iterator<Item = R>) {
    let longest = usize::from(u16::MAX) * 2;
    let mut data = Vec::new();
    for record in records {
        let record = record.as_ref();
        if data.len() + record.len() > longest {
            push_category(bytes, kind, &data);
            data.clear();
        }
        data.extend_from_slice(record);
    }
    if !data.is_empty() {
        push_category(bytes, kind, &data);
    }
}

impl Pdo {
    fn bytes(&self) -> Vec<u8> {
        let entries = &self.entries[..self.entries.len().min(255)];
        let mut bytes = self.index.to_le_bytes().to_vec();
        bytes.extend_from_slice(&[
            entries.len() as u8,
            self.sync_manager.unwrap_or(0xFF),
            self.synchronization,
            self.name,
        ]);
        bytes.extend_from_slice(&self.flags.to_le_bytes());
        for entry in entries {
            bytes.extend_from_slice(&entry.object.index.to_le_bytes());
            bytes.extend_from_slice(&[entry.object.subindex, entry.name, entry.data_type, entry.bit_length]);
            bytes.extend_from_slice(&entry.flags.to_le_bytes());
        }
        bytes
    }
}

impl Header {
    /// The 128 bytes: the named fields over `raw`.
    pub fn bytes(&self) -> [u8; HEADER] {
        let mut bytes = self.raw;
        let mut word = |index: usize, value: u16| put_u16(&mut bytes, index * 2, value);
        word(0, self.pdi_control);
        word(1, self.pdi_configuration);
        word(2, self.sync_pulse_length);
        word(3, self.pdi_configuration_2);
        word(4, self.alias);
        word(7, self.checksum);
        for (index, mailbox) in [(0x14, self.bootstrap_mailbox), (0x18, self.mailbox)] {
            word(index, mailbox.receive_offset);
            word(index + 1, mailbox.receive_size);
            word(index + 2, mailbox.send_offset);
            word(index + 3, mailbox.send_size);
        }
        word(0x1C, self.mailbox_protocols);
        word(0x3E, self.size_kibit_less_one);
        word(0x3F, self.version);
        let mut double = |index: usize, value: u32| put_u32(&mut bytes, index * 2, value);
        double(0x08, self.identity.vendor_id);
        double(0x0A, self.identity.product_code);
        double(0x0C, self.identity.revision);
        double(0x0E, self.identity.serial);
        bytes
    }
}

impl General {
    /// Bytes with a meaning of their own; [`General::rest`] follows.
    pub const FIXED: usize = 20;

    fn bytes(&self) -> Vec<u8> {
        let mut bytes = alloc::vec![
            self.group,
            self.image,
            self.order,
            self.name,
            self.reserved,
            self.coe_details,
            self.foe_details,
            self.eoe_details,
            self.soe_channels,
            self.ds402_channels,
            self.sysman_class,
            self.flags,
        ];
        bytes.extend_from_slice(&self.ebus_current_ma.to_le_bytes());
        bytes.extend_from_slice(&self.group_again.to_le_bytes());
        bytes.extend_from_slice(&self.physical_ports.to_le_bytes());
        bytes.extend_from_slice(&self.identification_address.to_le_bytes());
        bytes.extend_from_slice(&self.rest);
        bytes
    }
}

impl FmmuUsage {
    /// The usage of a code.
    pub fn from_code(code: u8) -> Self {
        match code {
            0 => FmmuUsage::Unused,
            1 => FmmuUsage::Outputs,
            2 => FmmuUsage::Inputs,
            3 => FmmuUsage::MailboxState,
            other => FmmuUsage::Other(other),
        }
    }

    /// The code as it stands in the image.
    pub fn code(self) -> u8 {
        match self {
            FmmuUsage::Unused => 0,
            FmmuUsage::Outputs => 1,
            FmmuUsage::Inputs => 2,
            FmmuUsage::MailboxState => 3,
            FmmuUsage::Other(code) => code,
        }
    }
}

impl SyncManagerUsage {
    /// The usage of a code.
    pub fn from_code(code: u8) -> Self {
        match code {
            0 => SyncManagerUsage::Unused,
            1 => SyncManagerUsage::MailboxOut,
            2 => SyncManagerUsage::MailboxIn,
            3 => SyncManagerUsage::Outputs,
            4 => SyncManagerUsage::Inputs,
            other => SyncManagerUsage::Other(other),
        }
    }

    /// The code as it stands in the image.
    pub fn code(self) -> u8 {
        match self {
            SyncManagerUsage::Unused => 0,
            SyncManagerUsage::MailboxOut => 1,
            SyncManagerUsage::MailboxIn => 2,
            SyncManagerUsage::Outputs => 3,
            SyncManagerUsage::Inputs => 4,
            SyncManagerUsage::Other(code) => code,
        }
    }
}

impl SyncManager {
    fn bytes(&self) -> [u8; 8] {
        let ([s0, s1], [l0, l1]) = (self.start.to_le_bytes(), self.length.to_le_bytes());
        [s0, s1, l0, l1, self.control, self.status, self.enable, self.usage.code()]
    }
}

impl DcMode {
    /// Bytes of one mode.
    pub const LENGTH: usize = 24;

    fn bytes(&self) -> [u8; Self::LENGTH] {
        let mut bytes = [0; Self::LENGTH];
        put_u32(&mut bytes, 0, self.sync0_cycle_ns);
        put_u32(&mut bytes, 4, self.sync0_shift_ns);
        put_u32(&mut bytes, 8, self.sync1_shift_ns);
        put_u16(&mut bytes, 12, self.sync1_cycle_factor as u16);
        put_u16(&mut bytes, 14, self.assign_activate);
        put_u16(&mut bytes, 16, self.sync0_cycle_factor as u16);
        bytes[18] = self.name;
        bytes[19] = self.description;
        bytes[20..24].copy_from_slice(&self.reserved);
        bytes
    }
}
