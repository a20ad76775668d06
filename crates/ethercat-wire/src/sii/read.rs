//! Reading an image.

use super::*;
use crate::bytes::{u16_at, u32_at};
use alloc::format;

impl Image {
    /// Reads an image of at least 128 bytes: what could be read, and what couldn't.
    ///
    /// No bytes make it panic or loop: every category's announced size is bounded by the image.
    pub fn parse(bytes: &[u8]) -> Result<(Self, Vec<SiiDefect>), ImageTooShort> {
        let Some(fixed) = bytes.first_chunk::<HEADER>() else {
            return Err(ImageTooShort { found: bytes.len() });
        };
        let mut image = Image { header: read_header(fixed), ..Image::default() };
        let mut problems = Vec::new();
        let mut note = |offset: usize, text: String| problems.push(SiiDefect { offset, text });

        let computed = image.header.computed_checksum();
        if image.header.checksum as u8 != computed {
            let found = image.header.checksum as u8;
            note(14, format!("checksum of the first words: expected 0x{computed:02x}, found 0x{found:02x}"));
        }

        let mut offset = HEADER;
        loop {
            if offset + 4 > bytes.len() {
                // A category that was cut off has been named already.
                if offset <= bytes.len() && bytes.get(offset..offset + 2) != Some(&[0xFF, 0xFF][..]) {
                    note(offset, "the image ends without the end category (0xffff)".into());
                }
                break;
            }
            let (kind, announced) = (u16_at(bytes, offset), usize::from(u16_at(bytes, offset + 2)) * 2);
            if kind == CATEGORY_END {
                break;
            }
            let start = offset + 4;
            let end = (start + announced).min(bytes.len());
            if start + announced > bytes.len() {
                let left = bytes.len() - start;
                note(offset, format!("category {kind} announces {announced} bytes, {left} are left"));
            }
            let mut category = Category { base: start, data: &bytes[start..end], note: &mut note };
            category.read(kind, &mut image);
            offset = start + announced;
        }
        Ok((image, problems))
    }
}

impl Header {
    /// The checksum of the header's first seven words as they are in its fields.
    pub fn computed_checksum(&self) -> u8 {
        let mut words = [0; 14];
        words.copy_from_slice(&self.bytes()[..14]);
        checksum(&words)
    }
}

fn read_header(fixed: &[u8; HEADER]) -> Header {
    let word = |index: usize| u16_at(fixed, index * 2);
    let double = |index: usize| u32_at(fixed, index * 2);
    let mailbox = |index: usize| MailboxArea {
        receive_offset: word(index),
        receive_size: word(index + 1),
        send_offset: word(index + 2),
        send_size: word(index + 3),
    };
    Header {
        pdi_control: word(0),
        pdi_configuration: word(1),
        sync_pulse_length: word(2),
        pdi_configuration_2: word(3),
        alias: word(4),
        checksum: word(7),
        identity: Identity {
            vendor_id: double(0x08),
            product_code: double(0x0A),
            revision: double(0x0C),
            serial: double(0x0E),
        },
        bootstrap_mailbox: mailbox(0x14),
        mailbox: mailbox(0x18),
        mailbox_protocols: word(0x1C),
        size_kibit_less_one: word(0x3E),
        version: word(0x3F),
        raw: *fixed,
    }
}

/// One category: its bytes, where they stand in the image, and where to report.
struct Category<'a, N: FnMut(usize, String)> {
    base: usize,
    data: &'a [u8],
    note: &'a mut N,
}

impl<N: FnMut(usize, String)> Category<'_, N> {
    fn read(&mut self, kind: u16, image: &mut Image) {
        match kind {
            CATEGORY_STRINGS => self.strings(&mut image.strings),
            CATEGORY_GENERAL => image.general = self.general(),
            CATEGORY_FMMU => image.fmmus.extend(self.data.iter().map(|code| FmmuUsage::from_code(*code))),
            CATEGORY_SYNC_MANAGERS => self.sync_managers(&mut image.sync_managers),
            CATEGORY_TX_PDO => self.pdos(&mut image.tx_pdos),
            CATEGORY_RX_PDO => self.pdos(&mut image.rx_pdos),
            CATEGORY_DC => self.dc_modes(&mut image.dc_modes),
            _ => image.other.push(OtherCategory { kind, data: self.data.to_vec() }),
        }
    }

    fn strings(&mut self, strings: &mut Vec<Vec<u8>>) {
        let Some((&count, _)) = self.data.split_first() else { return };
        let mut at = 1;
        for number in 1..=count {
            let Some(&length) = self.data.get(at) else {
                (self.note)(self.base + at, format!("string {number} of {count} lies behind the category"));
                return;
            };
            let (start, end) = (at + 1, at + 1 + usize::from(length));
            let Some(text) = self.data.get(start..end) else {
                let left = self.data.len() - start;
                (self.note)(
                    self.base + at,
                    format!("string {number} of {count} announces {length} bytes, {left} are left"),
                );
                return;
            };
            strings.push(text.to_vec());
            at = end;
        }
    }

    fn general(&mut self) -> Option<General> {
        let data = self.data;
        if data.len() < General::FIXED {
            let (expected, found) = (General::FIXED, data.len());
            (self.note)(self.base, format!("general category: expected {expected} bytes, found {found}"));
            return None;
        }
        Some(General {
            group: data[0],
            image: data[1],
            order: data[2],
            name: data[3],
            reserved: data[4],
            coe_details: data[5],
            foe_details: data[6],
            eoe_details: data[7],
            soe_channels: data[8],
            ds402_channels: data[9],
            sysman_class: data[10],
            flags: data[11],
            ebus_current_ma: u16_at(data, 12) as i16,
            group_again: u16_at(data, 14),
            physical_ports: u16_at(data, 16),
            identification_address: u16_at(data, 18),
            rest: data[General::FIXED..].to_vec(),
        })
    }

    fn sync_managers(&mut self, sync_managers: &mut Vec<SyncManager>) {
        let records = self.data.chunks_exact(8);
        self.leftover("SyncManager", records.remainder().len());
        sync_managers.extend(records.map(|record| SyncManager {
            start: u16_at(record, 0),
            length: u16_at(record, 2),
            control: record[4],
            status: record[5],
            enable: record[6],
            usage: SyncManagerUsage::from_code(record[7]),
        }));
    }

    fn pdos(&mut self, pdos: &mut Vec<Pdo>) {
        let mut at = 0;
        while at < self.data.len() {
            let Some(head) = self.data.get(at..at + 8) else {
                self.leftover("PDO", self.data.len() - at);
                return;
            };
            let index = u16_at(head, 0);
            let announced = usize::from(head[2]);
            let bytes = &self.data[at + 8..];
            let whole = announced.min(bytes.len() / 8);
            if whole < announced {
                (self.note)(
                    self.base + at,
                    format!("PDO 0x{index:04x} announces {announced} entries, {whole} are there"),
                );
            }
            let entries = bytes.chunks_exact(8).take(whole).map(|entry| PdoEntry {
                object: ObjectAddress::new(u16_at(entry, 0), entry[2]),
                name: entry[3],
                data_type: entry[4],
                bit_length: entry[5],
                flags: u16_at(entry, 6),
            });
            pdos.push(Pdo {
                index,
                sync_manager: (head[3] != 0xFF).then_some(head[3]),
                synchronization: head[4],
                name: head[5],
                flags: u16_at(head, 6),
                entries: entries.collect(),
            });
            at += 8 + announced * 8;
        }
    }

    fn dc_modes(&mut self, dc_modes: &mut Vec<DcMode>) {
        let records = self.data.chunks_exact(DcMode::LENGTH);
        self.leftover("DC mode", records.remainder().len());
        dc_modes.extend(records.map(|record| DcMode {
            sync0_cycle_ns: u32_at(record, 0),
            sync0_shift_ns: u32_at(record, 4),
            sync1_shift_ns: u32_at(record, 8),
            sync1_cycle_factor: u16_at(record, 12) as i16,
            assign_activate: u16_at(record, 14),
            sync0_cycle_factor: u16_at(record, 16) as i16,
            name: record[18],
            description: record[19],
            reserved: [record[20], record[21], record[22], record[23]],
        }));
    }

    fn leftover(&mut self, what: &str, bytes: usize) {
        if bytes > 0 {
            let at = self.base + self.data.len() - bytes;
            (self.note)(at, format!("{bytes} bytes are left behind the last whole {what}"));
        }
    }
}
