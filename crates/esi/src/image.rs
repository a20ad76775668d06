//! The SII (EEPROM) image that follows from a device's file (ETG.2010).

use omnibase_ethercat_wire::bytes::u16_at;
use omnibase_ethercat_wire::coe::ObjectAddress;
use omnibase_ethercat_wire::sii::{
    self, DcMode, General, Header, Identity, Image, MailboxArea, SyncManagerUsage,
};

use crate::Assembly;
use crate::model::{Device, FmmuUse, Mailbox, Pdo, SmUse};

/// What stands in the EEPROM of the device, whatever modules are in its slots; `vendor_id` is the file's.
///
/// A number that can't be read ([`Device::problems`]) is 0 here: no image for an EEPROM.
pub fn eeprom(device: &Device, vendor_id: u32) -> Image {
    with_modules(&Assembly { device, modules: Vec::new() }, vendor_id)
}

/// Bytes of what stands in the EEPROM of the device, whatever size its file gives.
pub fn content_bytes(device: &Device) -> usize {
    let mut image = eeprom(device, 0);
    image.header.size_kibit_less_one = 0;
    image.emit().len()
}

/// The same with the PDOs of its modules: no EEPROM has them, the device makes them of its modules.
pub fn with_modules(assembly: &Assembly, vendor_id: u32) -> Image {
    let device = assembly.device;
    let mut strings = Strings(Vec::new());
    let general = general(device, &mut strings);
    let mut pdos = |outputs: bool| -> Vec<sii::Pdo> {
        let (chosen, _) = assembly.default_pdos(outputs);
        let all = assembly.pdos(outputs);
        let shown = all.iter().map(|pdo| {
            let default = chosen.iter().find(|one| one.index.index == pdo.index.index);
            sii_pdo(pdo, default.and_then(|one| one.sync_manager), &mut strings)
        });
        shown.collect()
    };
    let (rx_pdos, tx_pdos) = (pdos(true), pdos(false));
    let dc_modes = device.dc_modes.iter().map(|mode| DcMode {
        sync0_cycle_ns: mode.sync0.cycle_ns as u32,
        sync0_shift_ns: mode.sync0.shift_ns as u32,
        sync1_shift_ns: mode.sync1.shift_ns as u32,
        sync1_cycle_factor: mode.sync1.factor.unwrap_or(0) as i16,
        assign_activate: mode.assign_activate,
        sync0_cycle_factor: mode.sync0.factor.unwrap_or(0) as i16,
        name: strings.index(&mode.name),
        description: strings.index(mode.description.english()),
        reserved: [0; 4],
    });
    let dc_modes = dc_modes.collect();
    Image {
        header: header(device, vendor_id),
        strings: strings.0,
        general: Some(general),
        fmmus: fmmus(device),
        sync_managers: device
            .sync_managers
            .iter()
            .map(|one| sync_manager(one, &rx_pdos, &tx_pdos, device))
            .collect(),
        tx_pdos,
        rx_pdos,
        dc_modes,
        ..Image::default()
    }
}

/// The mailboxes by their SyncManagers.
fn mailbox_area(device: &Device) -> MailboxArea {
    let find = |usage| device.sync_managers.iter().find(|one| one.usage == usage);
    match (find(SmUse::MailboxOut), find(SmUse::MailboxIn)) {
        (Some(out), Some(into)) => MailboxArea {
            receive_offset: out.start.unwrap_or(0),
            receive_size: out.default_size.unwrap_or(0),
            send_offset: into.start.unwrap_or(0),
            send_size: into.default_size.unwrap_or(0),
        },
        _ => MailboxArea::default(),
    }
}

/// Bits of the protocols. A file that has mailboxes and doesn't say what they speak is one that was made from a bus: CoE.
fn protocols(device: &Device) -> u16 {
    let Some(Mailbox { coe, eoe, foe, soe, aoe, voe, .. }) = &device.mailbox else {
        let is_there = device.sync_managers.iter().any(|one| one.usage == SmUse::MailboxOut);
        return if is_there { sii::PROTOCOL_COE } else { 0 };
    };
    let all = [
        (*aoe, sii::PROTOCOL_AOE),
        (*eoe, sii::PROTOCOL_EOE),
        (coe.is_some(), sii::PROTOCOL_COE),
        (*foe, sii::PROTOCOL_FOE),
        (*soe, sii::PROTOCOL_SOE),
        (*voe, sii::PROTOCOL_VOE),
    ];
    all.iter().filter(|(there, _)| *there).fold(0, |bits, (_, bit)| bits | bit)
}

fn header(device: &Device, vendor_id: u32) -> Header {
    let eeprom = device.eeprom.clone().unwrap_or_default();
    let word = |bytes: &[u8], number: usize| {
        if bytes.len() >= 2 * number + 2 { u16_at(bytes, 2 * number) } else { 0 }
    };
    let (config, boot) = (&eeprom.config_data, &eeprom.bootstrap);
    let identity = Identity {
        vendor_id,
        product_code: device.product_code.unwrap_or(0),
        revision: device.revision.unwrap_or(0),
        serial: 0,
    };
    let mut header = Header {
        pdi_control: word(config, 0),
        pdi_configuration: word(config, 1),
        sync_pulse_length: word(config, 2),
        pdi_configuration_2: word(config, 3),
        identity,
        bootstrap_mailbox: MailboxArea {
            receive_offset: word(boot, 0),
            receive_size: word(boot, 1),
            send_offset: word(boot, 2),
            send_size: word(boot, 3),
        },
        mailbox: mailbox_area(device),
        mailbox_protocols: protocols(device),
        size_kibit_less_one: (eeprom.byte_size / 128).saturating_sub(1).min(0xFFFF) as u16,
        version: 1,
        ..Header::default()
    };
    header.checksum = u16::from(header.computed_checksum());
    header
}

fn general(device: &Device, strings: &mut Strings) -> General {
    let coe = device.mailbox.as_ref().and_then(|mailbox| mailbox.coe.as_ref());
    let known =
        coe.map_or(if protocols(device) & sii::PROTOCOL_COE != 0 { sii::COE_SDO } else { 0 }, |coe| {
            let all = [
                (true, sii::COE_SDO),
                (coe.sdo_info, sii::COE_SDO_INFO),
                (coe.pdo_assign, sii::COE_PDO_ASSIGN),
                (coe.pdo_config, sii::COE_PDO_CONFIGURATION),
                (coe.pdo_upload, sii::COE_PDO_UPLOAD),
                (coe.complete_access, sii::COE_COMPLETE_ACCESS),
            ];
            all.iter().filter(|(there, _)| *there).fold(0, |bits, (_, bit)| bits | bit)
        });
    let mailbox = device.mailbox.as_ref();
    let flags = [
        (device.start_to_safeop_no_sync, sii::FLAG_SAFE_OP),
        (mailbox.is_some_and(|mailbox| mailbox.data_link_layer), sii::FLAG_MAILBOX_DLL),
        (device.refuses_lrw, sii::FLAG_NO_LRW),
        (device.identifies_by_al_status, sii::FLAG_IDENT_AL_STATUS),
        (device.identification_address.is_some(), sii::FLAG_IDENT_MEMORY),
    ];
    let port = |(number, letter): (usize, char)| {
        let kind = match letter {
            'Y' => 1,
            'K' => 3,
            'H' => 4,
            _ => 0,
        };
        kind << (4 * number)
    };
    General {
        group: strings.index(&device.group),
        order: strings.index(&device.type_name),
        name: strings.index(device.names.english()),
        coe_details: known,
        foe_details: u8::from(mailbox.is_some_and(|mailbox| mailbox.foe)),
        eoe_details: u8::from(mailbox.is_some_and(|mailbox| mailbox.eoe)),
        flags: flags.iter().filter(|(there, _)| *there).fold(0, |bits, (_, bit)| bits | bit),
        ebus_current_ma: device.ebus_current_ma.unwrap_or(0).clamp(-0x8000, 0x7FFF) as i16,
        physical_ports: device.ports.chars().take(4).enumerate().map(port).sum(),
        identification_address: device.identification_address.unwrap_or(0),
        rest: vec![0; 12],
        ..General::default()
    }
}

fn fmmus(device: &Device) -> Vec<sii::FmmuUsage> {
    let mut usages: Vec<sii::FmmuUsage> = if device.fmmus.is_empty() {
        let of_manager = |one: &crate::model::SyncManager| match one.usage {
            SmUse::Outputs => Some(sii::FmmuUsage::Outputs),
            SmUse::Inputs => Some(sii::FmmuUsage::Inputs),
            _ => None,
        };
        device.sync_managers.iter().filter_map(of_manager).collect()
    } else {
        let usage = |usage: &FmmuUse| match usage {
            FmmuUse::Outputs => sii::FmmuUsage::Outputs,
            FmmuUse::Inputs => sii::FmmuUsage::Inputs,
            FmmuUse::MailboxState => sii::FmmuUsage::MailboxState,
            FmmuUse::Other => sii::FmmuUsage::Unused,
        };
        device.fmmus.iter().map(usage).collect()
    };
    // The category has whole words.
    if !usages.len().is_multiple_of(2) {
        usages.push(sii::FmmuUsage::Unused);
    }
    usages
}

fn sync_manager(
    one: &crate::model::SyncManager,
    rx_pdos: &[sii::Pdo],
    tx_pdos: &[sii::Pdo],
    device: &Device,
) -> sii::SyncManager {
    let number = device.sync_managers.iter().position(|other| std::ptr::eq(other, one)).unwrap_or(0) as u8;
    let bytes = |pdos: &[sii::Pdo]| {
        let assigned = pdos.iter().filter(|pdo| pdo.sync_manager == Some(number));
        assigned.map(sii::Pdo::bit_length).sum::<u32>().div_ceil(8).min(0xFFFF) as u16
    };
    let size = one.default_size.unwrap_or(0);
    let (usage, length) = match one.usage {
        SmUse::MailboxOut => (SyncManagerUsage::MailboxOut, size),
        SmUse::MailboxIn => (SyncManagerUsage::MailboxIn, size),
        SmUse::Outputs => (SyncManagerUsage::Outputs, bytes(rx_pdos)),
        SmUse::Inputs => (SyncManagerUsage::Inputs, bytes(tx_pdos)),
        SmUse::Unused => (SyncManagerUsage::Unused, size),
    };
    let flags =
        [(one.enabled, sii::SM_ENABLE), (one.is_virtual, sii::SM_VIRTUAL), (one.op_only, sii::SM_OP_ONLY)];
    sii::SyncManager {
        start: one.start.unwrap_or(0),
        length,
        control: one.control.unwrap_or(0),
        status: 0,
        enable: flags.iter().filter(|(there, _)| *there).fold(0, |bits, (_, bit)| bits | bit),
        usage,
    }
}

fn sii_pdo(pdo: &Pdo, default: Option<u8>, strings: &mut Strings) -> sii::Pdo {
    let flags = [
        (pdo.mandatory, sii::PDO_MANDATORY),
        (default.is_some(), sii::PDO_DEFAULT),
        (pdo.fixed, sii::PDO_FIXED),
        (pdo.is_virtual, sii::PDO_VIRTUAL),
    ];
    let entries = pdo.entries.iter().map(|entry| sii::PdoEntry {
        object: if entry.is_gap() { ObjectAddress::new(0, 0) } else { entry.object() },
        name: strings.index(entry.name.english()),
        data_type: entry.type_code().unwrap_or(0) as u8,
        bit_length: entry.bits,
        flags: 0,
    });
    let entries = entries.collect();
    sii::Pdo {
        index: pdo.index.index,
        sync_manager: default,
        synchronization: 0,
        name: strings.index(pdo.name.english()),
        flags: flags.iter().filter(|(there, _)| *there).fold(0, |bits, (_, bit)| bits | bit),
        entries,
    }
}

/// The string table while it grows.
struct Strings(Vec<Vec<u8>>);

impl Strings {
    /// The standard's index of a text; 0 for an empty one, or when the table is full.
    fn index(&mut self, text: &str) -> u8 {
        if text.is_empty() {
            return 0;
        }
        let known = self.0.iter().position(|string| string == text.as_bytes());
        match known {
            Some(position) => (position + 1) as u8,
            None if self.0.len() < 255 => {
                self.0.push(text.as_bytes().to_vec());
                self.0.len() as u8
            }
            None => 0,
        }
    }
}
