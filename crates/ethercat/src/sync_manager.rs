//! SyncManagers as the SII describes them, and as they are programmed.

use alloc::vec::Vec;

use crate::config::SubDeviceConfig;
use crate::mailbox::DEFAULT_TIMEOUT;
use crate::process_data::{
    Activation, Direction, MailboxConfig, MappedObject, MappedPdo, MemoryArea, SyncManager,
};
use crate::wire::coe::ObjectAddress;
use crate::wire::sii::{self, Image, SyncManagerUsage};

/// Control byte of the mailbox from the MainDevice: mailbox mode, written by the MainDevice, interrupts the
/// application.
const MAILBOX_WRITE_CONTROL: u8 = 0x26;
/// Control byte of the mailbox to the MainDevice.
const MAILBOX_READ_CONTROL: u8 = 0x22;
/// Control byte of outputs: three buffers, written by the MainDevice, watchdog triggered.
const OUTPUTS_CONTROL: u8 = 0x64;
/// Control byte of inputs: three buffers, read by the MainDevice.
const INPUTS_CONTROL: u8 = 0x20;
/// Bit of the control byte by which writing triggers the watchdog of the process data: without it that watches nothing.
pub const TRIGGERS_WATCHDOG: u8 = 0x40;
/// Mode and direction bits of the control byte.
const MODE_AND_DIRECTION: u8 = 0x0F;
/// Byte of a SyncManager's registers that says what it is and does.
pub const CONTROL: u16 = 4;
/// Byte of a SyncManager's registers that switches it on.
pub const ACTIVATE: u16 = 6;
/// Object that assigns PDOs to SyncManager 0; the others follow.
pub const ASSIGNMENT: u16 = 0x1C10;

/// The mailboxes of a SubDevice: the user's, else the SII's; `None` where it has none.
pub fn mailbox_config(image: &Image, config: &SubDeviceConfig) -> Option<MailboxConfig> {
    if let Some(mailbox) = config.mailbox {
        return Some(mailbox);
    }
    let header = &image.header;
    let areas = header.mailbox;
    let there = areas.receive_size > 0 && areas.send_size > 0 && header.mailbox_protocols != 0;
    there.then_some(MailboxConfig {
        write: MemoryArea { start: areas.receive_offset, length: areas.receive_size },
        read: MemoryArea { start: areas.send_offset, length: areas.send_size },
        protocols: header.mailbox_protocols,
        answer_timeout: config.timeouts.mailbox.unwrap_or(DEFAULT_TIMEOUT),
    })
}

/// The SyncManagers that the SII lists, within `count`, mailboxes first; process data as the SII maps them.
pub fn from_sii(image: &Image, mailbox: Option<MailboxConfig>, count: u8) -> Vec<SyncManager> {
    let mut managers = Vec::with_capacity(usize::from(count));
    for (index, listed) in (0..count).zip(&image.sync_managers) {
        managers.push(SyncManager {
            index,
            area: MemoryArea { start: listed.start, length: 0 },
            control: control(listed.usage, listed.control),
            enabled: false,
            activation: activation(listed.enable),
            usage: listed.usage,
            pdos: Vec::new(),
            logical: None,
        });
    }
    if let Some(mailbox) = mailbox {
        let usages = [
            (SyncManagerUsage::MailboxOut, MAILBOX_WRITE_CONTROL, mailbox.write),
            (SyncManagerUsage::MailboxIn, MAILBOX_READ_CONTROL, mailbox.read),
        ];
        for (index, (usage, default_control, area)) in (0..count).zip(usages) {
            let listed = image.sync_managers.get(usize::from(index));
            let listed = listed.filter(|listed| listed.usage == usage);
            let manager = SyncManager {
                index,
                area,
                control: listed.map_or(default_control, |listed| control(usage, listed.control)),
                enabled: true,
                activation: Activation::SafeOp,
                usage,
                pdos: Vec::new(),
                logical: None,
            };
            match managers.get_mut(usize::from(index)) {
                Some(place) => *place = manager,
                None => managers.push(manager),
            }
        }
    }
    for manager in &mut managers {
        if let Some(direction) = manager.direction() {
            let pdos = pdos_from_sii(image, direction, manager.index);
            map(manager, pdos);
        }
    }
    managers
}

/// Has the outputs trigger the watchdog of the process data, whatever the SII says of that.
pub fn watch(managers: &mut [SyncManager]) {
    for manager in managers.iter_mut().filter(|manager| manager.usage == SyncManagerUsage::Outputs) {
        manager.control |= TRIGGERS_WATCHDOG;
    }
}

/// When a SyncManager with these flags is switched on.
fn activation(flags: u8) -> Activation {
    match (flags & sii::SM_VIRTUAL, flags & sii::SM_OP_ONLY) {
        (0, 0) => Activation::SafeOp,
        (0, _) => Activation::OpOnly,
        _ => Activation::Never,
    }
}

/// Process data of so many bytes without PDOs: gaps.
pub fn gaps(bytes: u16) -> MappedPdo {
    const LONGEST: u32 = 248;
    let gap = |bits: u32| MappedObject {
        object: ObjectAddress::new(0, 0),
        bit_length: bits as u8,
        data_type: None,
        name: None,
    };
    let bits = u32::from(bytes) * 8;
    let whole = (0..bits / LONGEST).map(|_| LONGEST);
    let entries = whole.chain([bits % LONGEST]).filter(|bits| *bits > 0).map(gap);
    MappedPdo { index: 0, name: None, entries: entries.collect() }
}

/// The listed control byte where its mode and direction fit the usage, else the usual one.
fn control(usage: SyncManagerUsage, listed: u8) -> u8 {
    let usual = match usage {
        SyncManagerUsage::MailboxOut => MAILBOX_WRITE_CONTROL,
        SyncManagerUsage::MailboxIn => MAILBOX_READ_CONTROL,
        SyncManagerUsage::Outputs => OUTPUTS_CONTROL,
        SyncManagerUsage::Inputs => INPUTS_CONTROL,
        SyncManagerUsage::Unused | SyncManagerUsage::Other(_) => return listed,
    };
    let is_mailbox = matches!(usage, SyncManagerUsage::MailboxOut | SyncManagerUsage::MailboxIn);
    // Process data may use one buffer (mode 2) instead of three; their direction must fit all the same.
    let mask = if is_mailbox { MODE_AND_DIRECTION } else { MODE_AND_DIRECTION & !0x03 };
    if listed & mask == usual & mask { listed } else { usual }
}

/// Gives a SyncManager its PDOs, and the length that follows from them; without length it is switched off.
pub fn map(manager: &mut SyncManager, pdos: Vec<MappedPdo>) {
    manager.pdos = pdos;
    manager.area.length = u16::try_from(manager.bit_length().div_ceil(8)).unwrap_or(u16::MAX);
    manager.enabled = manager.area.length > 0 && manager.activation == Activation::SafeOp;
}

fn pdos_from_sii(image: &Image, direction: Direction, sync_manager: u8) -> Vec<MappedPdo> {
    let pdos = match direction {
        Direction::Outputs => &image.rx_pdos,
        Direction::Inputs => &image.tx_pdos,
    };
    pdos.iter()
        .filter(|pdo| pdo.sync_manager == Some(sync_manager))
        .map(|pdo| mapped_pdo(image, pdo))
        .collect()
}

fn mapped_pdo(image: &Image, pdo: &sii::Pdo) -> MappedPdo {
    let entry = |entry: &sii::PdoEntry| MappedObject {
        object: entry.object,
        bit_length: entry.bit_length,
        data_type: Some(entry.data_type).filter(|&data_type| data_type != 0),
        name: image.string(entry.name),
    };
    MappedPdo {
        index: pdo.index,
        name: image.string(pdo.name),
        entries: pdo.entries.iter().map(entry).collect(),
    }
}

/// The names that the SII has for a PDO that was read from the device.
pub fn name_from_sii(image: &Image, pdo: &mut MappedPdo) {
    let listed = image.rx_pdos.iter().chain(&image.tx_pdos).find(|listed| listed.index == pdo.index);
    let Some(listed) = listed else { return };
    pdo.name = image.string(listed.name);
    for entry in &mut pdo.entries {
        let named =
            listed.entries.iter().find(|named| named.object == entry.object && named.object.index != 0);
        if let Some(named) = named {
            entry.name = image.string(named.name);
            entry.data_type = Some(named.data_type).filter(|&data_type| data_type != 0);
        }
    }
}
