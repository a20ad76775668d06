//! SII images for devices that have none of their own.

use crate::dictionary::Dictionary;
use crate::dictionary::pdo::Direction;
use crate::dictionary::standard::PdoMap;
use crate::firmware::ProcessSyncManager;
use omnibase_ethercat_wire::sii::{
    self, DcMode, FmmuUsage, General, Header, Identity, Image, MailboxArea, Pdo, PdoEntry, SyncManager,
    SyncManagerUsage,
};

/// Words of the fixed part's configuration: PDI "on-chip bus", as of a chip with firmware beside it.
pub(super) const PDI_WITH_FIRMWARE: u16 = 0x0080;
/// Digital I/O with device emulation (0x0140 = 0x04, 0x0141 bit 0).
pub(super) const PDI_DIGITAL_IO: u16 = 0x0104;
/// Device emulation alone.
pub(super) const PDI_EMULATED: u16 = 0x0100;
/// A MII port in the general category.
pub(super) const PORT_MII: u16 = 1;
/// An EBUS port in the general category.
pub(super) const PORT_EBUS: u16 = 3;

/// What a generated image says.
pub(super) struct ImagePlan<'a> {
    pub pdi_control: u16,
    pub identity: Identity,
    pub alias: u16,
    pub group: &'a str,
    pub order: &'a str,
    pub name: &'a str,
    /// Four bits per port, port 0 lowest.
    pub ports: u16,
    pub flags: u8,
    pub mailbox: Option<Mailbox>,
    pub process_data: &'a [ProcessSyncManager],
    pub pdos: &'a [PdoMap],
    /// Names and types of mapped objects.
    pub dictionary: Option<&'a Dictionary>,
    pub dc_modes: &'a [(&'a str, u16)],
}

/// A mailbox with CoE.
#[derive(Clone, Copy)]
pub(super) struct Mailbox {
    pub area: MailboxArea,
    /// Its place in BOOT.
    pub bootstrap: MailboxArea,
    pub protocols: u16,
    pub coe_details: u8,
}

/// The bytes of an image.
pub(super) fn emit(plan: &ImagePlan) -> Vec<u8> {
    let mut strings = Strings(Vec::new());
    let general = General {
        group: strings.index(plan.group),
        order: strings.index(plan.order),
        name: strings.index(plan.name),
        coe_details: plan.mailbox.map_or(0, |mailbox| mailbox.coe_details),
        foe_details: plan.mailbox.map_or(0, |mailbox| u8::from(mailbox.protocols & sii::PROTOCOL_FOE != 0)),
        flags: plan.flags,
        physical_ports: plan.ports,
        rest: vec![0; 12],
        ..General::default()
    };
    let mut pdos = |direction| -> Vec<Pdo> {
        let of_direction = plan.pdos.iter().filter(|pdo| Direction::of_pdo(pdo.index) == Some(direction));
        of_direction.map(|pdo| describe(plan, pdo, &mut strings)).collect()
    };
    let (rx_pdos, tx_pdos) = (pdos(Direction::Outputs), pdos(Direction::Inputs));
    let dc_modes = plan.dc_modes.iter().map(|(name, assign_activate)| DcMode {
        sync0_cycle_ns: 0,
        sync0_shift_ns: 0,
        sync1_shift_ns: 0,
        sync1_cycle_factor: 0,
        assign_activate: *assign_activate,
        sync0_cycle_factor: i16::from(*assign_activate != 0),
        name: strings.index(name),
        description: 0,
        reserved: [0; 4],
    });
    let dc_modes = dc_modes.collect();
    let mut header = Header {
        pdi_control: plan.pdi_control,
        sync_pulse_length: 10,
        alias: plan.alias,
        identity: plan.identity,
        mailbox: plan.mailbox.map_or(MailboxArea::default(), |mailbox| mailbox.area),
        bootstrap_mailbox: plan.mailbox.map_or(MailboxArea::default(), |mailbox| mailbox.bootstrap),
        mailbox_protocols: plan.mailbox.map_or(0, |mailbox| mailbox.protocols),
        size_kibit_less_one: 15,
        version: 1,
        ..Header::default()
    };
    header.checksum = u16::from(header.computed_checksum());
    let strings = strings.0;
    let general = Some(general);
    let (fmmus, sync_managers) = (fmmus(plan), sync_managers(plan));
    Image { header, strings, general, fmmus, sync_managers, tx_pdos, rx_pdos, dc_modes, ..Image::default() }
        .emit()
}

fn sync_managers(plan: &ImagePlan) -> Vec<SyncManager> {
    let mut all = Vec::new();
    if let Some(Mailbox { area, .. }) = plan.mailbox {
        let (to_it, from_it) = (SyncManagerUsage::MailboxOut, SyncManagerUsage::MailboxIn);
        all.push(mailbox_sync_manager(area.receive_offset, area.receive_size, to_it));
        all.push(mailbox_sync_manager(area.send_offset, area.send_size, from_it));
    }
    let bytes = |number: u8| {
        let assigned = plan.pdos.iter().filter(|pdo| sync_manager_of(plan, pdo) == Some(number));
        assigned
            .map(|pdo| pdo.entries.iter().map(|(_, bits)| u32::from(*bits)).sum::<u32>())
            .sum::<u32>()
            .div_ceil(8)
    };
    all.extend(plan.process_data.iter().map(|sm| SyncManager {
        start: sm.start,
        length: bytes(sm.number) as u16,
        control: sm.control,
        status: 0,
        enable: 1,
        usage: match sm.direction {
            Direction::Outputs => SyncManagerUsage::Outputs,
            Direction::Inputs => SyncManagerUsage::Inputs,
        },
    }));
    all
}

fn fmmus(plan: &ImagePlan) -> Vec<FmmuUsage> {
    let of_data = plan.process_data.iter().map(|sm| match sm.direction {
        Direction::Outputs => FmmuUsage::Outputs,
        Direction::Inputs => FmmuUsage::Inputs,
    });
    let mut all: Vec<FmmuUsage> =
        of_data.chain(plan.mailbox.is_some().then_some(FmmuUsage::MailboxState)).collect();
    // The category has whole words.
    if !all.len().is_multiple_of(2) {
        all.push(FmmuUsage::Unused);
    }
    all
}

fn mailbox_sync_manager(start: u16, length: u16, usage: SyncManagerUsage) -> SyncManager {
    let control = if usage == SyncManagerUsage::MailboxOut { 0x26 } else { 0x22 };
    SyncManager { start, length, control, status: 0, enable: 1, usage }
}

/// PDOs belong to the SyncManager of their direction.
fn sync_manager_of(plan: &ImagePlan, pdo: &PdoMap) -> Option<u8> {
    let direction = Direction::of_pdo(pdo.index)?;
    plan.process_data.iter().find(|sm| sm.direction == direction).map(|sm| sm.number)
}

fn describe(plan: &ImagePlan, pdo: &PdoMap, strings: &mut Strings) -> Pdo {
    let entries = pdo.entries.iter().map(|(object, bits)| {
        let entry = plan.dictionary.and_then(|dictionary| dictionary.entry(*object));
        let boolean = if *bits == 1 { 1 } else { 0 };
        PdoEntry {
            object: *object,
            name: entry.map_or(0, |entry| strings.index(&entry.name)),
            data_type: entry.map_or(boolean, |entry| entry.data_type.0 as u8),
            bit_length: *bits,
            flags: 0,
        }
    });
    let entries = entries.collect();
    Pdo {
        index: pdo.index,
        sync_manager: sync_manager_of(plan, pdo),
        synchronization: 0,
        name: strings.index(&pdo.name),
        flags: 0,
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
        let position = known.unwrap_or_else(|| {
            if self.0.len() < 255 {
                self.0.push(text.as_bytes().to_vec());
            }
            self.0.len() - 1
        });
        (position + 1) as u8
    }
}
