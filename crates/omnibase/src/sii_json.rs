//! An SII image as JSON, and the names that its text form shares with it.

use crate::hex;
use omnibase_ethercat_wire::sii::{
    self, COE_COMPLETE_ACCESS, COE_PDO_ASSIGN, COE_PDO_CONFIGURATION, COE_PDO_UPLOAD, COE_SDO, COE_SDO_INFO,
    FLAG_IDENT_AL_STATUS, FLAG_MAILBOX_DLL, FLAG_NO_LRW, FLAG_SAFE_OP, FmmuUsage, Image, MailboxArea,
    PROTOCOL_AOE, PROTOCOL_COE, PROTOCOL_EOE, PROTOCOL_FOE, PROTOCOL_SOE, PROTOCOL_VOE, Pdo, SiiDefect,
    SyncManagerUsage,
};
use serde::Serialize;

/// The whole image.
#[derive(Serialize)]
pub struct ImageJson {
    name: Option<String>,
    identity: IdentityJson,
    alias: u16,
    pdi_control: u16,
    pdi_configuration: u16,
    pdi_configuration_2: u16,
    sync_pulse_ns: u32,
    checksum: u8,
    expected_checksum: u8,
    mailbox: MailboxJson,
    bootstrap_mailbox: MailboxJson,
    mailbox_protocols: Vec<&'static str>,
    eeprom_bytes: u32,
    version: u16,
    general: Option<GeneralJson>,
    fmmus: Vec<String>,
    sync_managers: Vec<SyncManagerJson>,
    tx_pdos: Vec<PdoJson>,
    rx_pdos: Vec<PdoJson>,
    dc_modes: Vec<DcModeJson>,
    strings: Vec<String>,
    other_categories: Vec<CategoryJson>,
    problems: Vec<ProblemJson>,
}

#[derive(Serialize)]
struct IdentityJson {
    vendor_id: u32,
    product_code: u32,
    revision: u32,
    serial: u32,
}

#[derive(Serialize)]
struct MailboxJson {
    receive_offset: u16,
    receive_size: u16,
    send_offset: u16,
    send_size: u16,
}

#[derive(Serialize)]
struct GeneralJson {
    group: Option<String>,
    image: Option<String>,
    order: Option<String>,
    coe: Vec<&'static str>,
    foe: bool,
    eoe: bool,
    flags: Vec<&'static str>,
    ebus_current_ma: i16,
    ports: Vec<String>,
    identification_address: u16,
}

#[derive(Serialize)]
struct SyncManagerJson {
    usage: String,
    start: u16,
    length: u16,
    control: u8,
    enable: u8,
}

#[derive(Serialize)]
struct PdoJson {
    index: u16,
    name: Option<String>,
    sync_manager: Option<u8>,
    synchronization: u8,
    flags: u16,
    bit_length: u32,
    entries: Vec<EntryJson>,
}

#[derive(Serialize)]
struct EntryJson {
    index: u16,
    subindex: u8,
    name: Option<String>,
    data_type: u8,
    bit_length: u8,
    flags: u16,
}

#[derive(Serialize)]
struct DcModeJson {
    name: Option<String>,
    description: Option<String>,
    assign_activate: u16,
    sync0_cycle_ns: u32,
    sync0_cycle_factor: i16,
    sync0_shift_ns: i32,
    sync1_cycle_factor: i16,
    sync1_shift_ns: i32,
}

#[derive(Serialize)]
struct CategoryJson {
    kind: u16,
    data: String,
}

#[derive(Serialize)]
struct ProblemJson {
    offset: usize,
    text: String,
}

impl ImageJson {
    /// The image and what could not be read of it.
    pub fn new(image: &Image, problems: &[SiiDefect]) -> Self {
        let header = &image.header;
        let identity = header.identity;
        ImageJson {
            name: image.name(),
            identity: IdentityJson {
                vendor_id: identity.vendor_id,
                product_code: identity.product_code,
                revision: identity.revision,
                serial: identity.serial,
            },
            alias: header.alias,
            pdi_control: header.pdi_control,
            pdi_configuration: header.pdi_configuration,
            pdi_configuration_2: header.pdi_configuration_2,
            sync_pulse_ns: u32::from(header.sync_pulse_length) * 10,
            checksum: header.checksum as u8,
            expected_checksum: expected_checksum(image),
            mailbox: mailbox(&header.mailbox),
            bootstrap_mailbox: mailbox(&header.bootstrap_mailbox),
            mailbox_protocols: protocols(header.mailbox_protocols),
            eeprom_bytes: (u32::from(header.size_kibit_less_one) + 1) * 128,
            version: header.version,
            general: image.general.as_ref().map(|general| GeneralJson {
                group: image.string(general.group),
                image: image.string(general.image),
                order: image.string(general.order),
                coe: coe_details(general.coe_details),
                foe: general.foe_details & 1 != 0,
                eoe: general.eoe_details & 1 != 0,
                flags: general_flags(general.flags),
                ebus_current_ma: general.ebus_current_ma,
                ports: ports(general.physical_ports),
                identification_address: general.identification_address,
            }),
            fmmus: image.fmmus.iter().map(|usage| fmmu_usage(*usage)).collect(),
            sync_managers: image
                .sync_managers
                .iter()
                .map(|manager| SyncManagerJson {
                    usage: sync_manager_usage(manager.usage),
                    start: manager.start,
                    length: manager.length,
                    control: manager.control,
                    enable: manager.enable,
                })
                .collect(),
            tx_pdos: image.tx_pdos.iter().map(|pdo| pdo_json(image, pdo)).collect(),
            rx_pdos: image.rx_pdos.iter().map(|pdo| pdo_json(image, pdo)).collect(),
            dc_modes: image
                .dc_modes
                .iter()
                .map(|mode| DcModeJson {
                    name: image.string(mode.name),
                    description: image.string(mode.description),
                    assign_activate: mode.assign_activate,
                    sync0_cycle_ns: mode.sync0_cycle_ns,
                    sync0_cycle_factor: mode.sync0_cycle_factor,
                    // The standard has them signed, as ESI files do.
                    sync0_shift_ns: mode.sync0_shift_ns as i32,
                    sync1_cycle_factor: mode.sync1_cycle_factor,
                    sync1_shift_ns: mode.sync1_shift_ns as i32,
                })
                .collect(),
            strings: image.strings.iter().map(|bytes| String::from_utf8_lossy(bytes).into_owned()).collect(),
            other_categories: image
                .other
                .iter()
                .map(|category| CategoryJson { kind: category.kind, data: hex::compact(&category.data) })
                .collect(),
            problems: problems
                .iter()
                .map(|problem| ProblemJson { offset: problem.offset, text: problem.text.clone() })
                .collect(),
        }
    }
}

fn mailbox(area: &MailboxArea) -> MailboxJson {
    MailboxJson {
        receive_offset: area.receive_offset,
        receive_size: area.receive_size,
        send_offset: area.send_offset,
        send_size: area.send_size,
    }
}

fn pdo_json(image: &Image, pdo: &Pdo) -> PdoJson {
    PdoJson {
        index: pdo.index,
        name: image.string(pdo.name),
        sync_manager: pdo.sync_manager,
        synchronization: pdo.synchronization,
        flags: pdo.flags,
        bit_length: pdo.bit_length(),
        entries: pdo
            .entries
            .iter()
            .map(|entry| EntryJson {
                index: entry.object.index,
                subindex: entry.object.subindex,
                name: image.string(entry.name),
                data_type: entry.data_type,
                bit_length: entry.bit_length,
                flags: entry.flags,
            })
            .collect(),
    }
}

/// The checksum that the first seven words should have.
pub fn expected_checksum(image: &Image) -> u8 {
    let mut first = [0; 14];
    first.copy_from_slice(&image.header.raw[..14]);
    sii::checksum(&first)
}

/// Names of the bits that are set.
fn names<T: Copy + Into<u32>>(bits: T, all: &[(T, &'static str)]) -> Vec<&'static str> {
    all.iter().filter(|(bit, _)| bits.into() & (*bit).into() != 0).map(|(_, name)| *name).collect()
}

/// Mailbox protocols by name.
pub fn protocols(bits: u16) -> Vec<&'static str> {
    let all = [
        (PROTOCOL_AOE, "AoE"),
        (PROTOCOL_EOE, "EoE"),
        (PROTOCOL_COE, "CoE"),
        (PROTOCOL_FOE, "FoE"),
        (PROTOCOL_SOE, "SoE"),
        (PROTOCOL_VOE, "VoE"),
    ];
    names(bits, &all)
}

/// What CoE can do, by name.
pub fn coe_details(bits: u8) -> Vec<&'static str> {
    let all = [
        (COE_SDO, "SDO"),
        (COE_SDO_INFO, "SDO Information"),
        (COE_PDO_ASSIGN, "PDO assignment"),
        (COE_PDO_CONFIGURATION, "PDO configuration"),
        (COE_PDO_UPLOAD, "PDO upload"),
        (COE_COMPLETE_ACCESS, "complete access"),
    ];
    names(bits, &all)
}

/// Flags of the general category, by name.
pub fn general_flags(bits: u8) -> Vec<&'static str> {
    let all = [
        (FLAG_SAFE_OP, "SAFE-OP allowed"),
        (FLAG_NO_LRW, "no LRW"),
        (FLAG_MAILBOX_DLL, "mailbox data link layer"),
        (FLAG_IDENT_AL_STATUS, "identification by AL status code"),
    ];
    names(bits, &all)
}

/// The physics of ports 0 to 3: four bits each.
pub fn ports(bits: u16) -> Vec<String> {
    (0..4)
        .map(|port| match bits >> (4 * port) & 0xF {
            0 => "none".to_owned(),
            1 => "MII".to_owned(),
            3 => "EBUS".to_owned(),
            other => format!("type {other}"),
        })
        .collect()
}

/// What an FMMU is for.
pub fn fmmu_usage(usage: FmmuUsage) -> String {
    match usage {
        FmmuUsage::Unused | FmmuUsage::Other(0xFF) => "unused".to_owned(),
        FmmuUsage::Outputs => "outputs".to_owned(),
        FmmuUsage::Inputs => "inputs".to_owned(),
        FmmuUsage::MailboxState => "mailbox state".to_owned(),
        FmmuUsage::Other(code) => format!("code {code}"),
    }
}

/// What a SyncManager is for.
pub fn sync_manager_usage(usage: SyncManagerUsage) -> String {
    match usage {
        SyncManagerUsage::Unused => "unused".to_owned(),
        SyncManagerUsage::MailboxOut => "mailbox out".to_owned(),
        SyncManagerUsage::MailboxIn => "mailbox in".to_owned(),
        SyncManagerUsage::Outputs => "outputs".to_owned(),
        SyncManagerUsage::Inputs => "inputs".to_owned(),
        SyncManagerUsage::Other(code) => format!("code {code}"),
    }
}
