//! A device's element.

use crate::model::{Device, Eeprom, FmmuUse, SmUse, SyncManager, SyncTimes, Timeouts};
use crate::names::Names;
use crate::notes::Notes;
use crate::texts::{name, short};
use crate::xml::{Element, quoted};
use crate::{dictionary, mailbox, model, pdo, slots};

/// Longest time that a file may give, ms: an hour.
const TIME_LIMIT_MS: i64 = 3_600_000;
/// Bytes of configuration data: words 0 to 6 of the EEPROM and, by some makers, more of them.
const CONFIG_DATA_LIMIT: usize = 256;
/// Largest EEPROM, bytes: 4 MBit.
const EEPROM_LIMIT: i64 = 1 << 19;
/// The most SyncManagers: as many as a PDO's `Sm` can name.
const SYNC_MANAGER_LIMIT: usize = 32;
/// Registers that a file may want written (ETG.2000, element `ESC`).
const REGISTERS: [(&str, u16); 5] =
    [("Reg0108", 0x0108), ("Reg0400", 0x0400), ("Reg0410", 0x0410), ("Reg0420", 0x0420), ("Reg0204", 0x0204)];

/// A group: its name in the file, and the English one.
pub(crate) fn group(element: Element, notes: &mut Notes) -> (String, String) {
    let (mut kind, mut names) = (String::new(), Names::default());
    for child in element.children(notes) {
        match child.name() {
            "Type" => kind = short(child.text()),
            "Name" => name(child, &mut names, notes),
            _ => child.skip(notes),
        }
    }
    (kind, names.english().to_owned())
}

/// A device.
pub(crate) fn device(element: Element, notes: &mut Notes) -> Device {
    let before = notes.told();
    let mut device = Device {
        line: element.line(),
        ports: short(element.attribute("Physics").unwrap_or_default().to_owned()),
        ..Device::default()
    };
    for child in element.children(notes) {
        part(child, &mut device, notes);
    }
    if device.product_code.is_none() {
        element.problem("the device has no product code: nobody can tell it on the bus", notes);
    }
    if device.revision.is_none() {
        element.problem("the device has no revision: nobody can tell it from older ones", notes);
    }
    device.problems = notes.since(before, element);
    device
}

fn part(child: Element, device: &mut Device, notes: &mut Notes) {
    match child.name() {
        "Type" => identity(child, device, notes),
        "HideType" => {
            let mut number =
                |name| child.attribute_number(name, 0..=0xFFFF_FFFF, notes).map(|number| number as u32);
            let (product, revision) = (number("ProductCode"), number("RevisionNo"));
            if product.is_some() || child.attribute("ProductCode").is_none() {
                device.hides.extend(revision.map(|revision| (product, revision)));
            }
        }
        "Name" => name(child, &mut device.names, notes),
        "Info" => info(child, device, notes),
        "GroupType" => device.group = short(child.text()),
        "Profile" => dictionary::profile(child, &mut device.profiles, &mut device.dictionary, notes),
        "Fmmu" => device.fmmus.push(fmmu(child, notes)),
        "Sm" if device.sync_managers.len() < SYNC_MANAGER_LIMIT => {
            device.sync_managers.push(sync_manager(child, notes));
        }
        "Sm" => child.problem(
            format!("more than {SYNC_MANAGER_LIMIT} SyncManagers, more than any controller has: this one isn't read"),
            notes,
        ),
        "RxPdo" => pdo::add(child, &mut device.rx_pdos, notes),
        "TxPdo" => pdo::add(child, &mut device.tx_pdos, notes),
        "Mailbox" => device.mailbox = Some(mailbox::read(child, notes)),
        "Dc" => clocks(child, device, notes),
        "Slots" => device.slots = Some(slots::read(child, notes)),
        "ESC" => registers(child, device, notes),
        "Eeprom" => device.eeprom = Some(eeprom(child, notes)),
        _ => child.skip(notes),
    }
}

fn identity(element: Element, device: &mut Device, notes: &mut Notes) {
    device.type_name = short(element.text());
    let mut number =
        |name| element.attribute_number(name, 0..=0xFFFF_FFFF, notes).map(|number| number as u32);
    device.product_code = number("ProductCode");
    device.revision = number("RevisionNo");
    device.pdo_group = number("ModulePdoGroup").unwrap_or(0) as usize;
    device.refuses_lrw = element.is("UseLrdLwr", notes);
}

fn info(element: Element, device: &mut Device, notes: &mut Notes) {
    for child in element.children(notes) {
        match child.name() {
            "Electrical" => {
                for value in child.children(notes) {
                    match value.name() {
                        "EBusCurrent" => {
                            let current = value.number(-100_000..=100_000, notes);
                            device.ebus_current_ma = current.map(|current| current as i32);
                        }
                        _ => value.skip(notes),
                    }
                }
            }
            "StateMachine" => state_machine(child, device, notes),
            "Mailbox" => timeouts(child, &mut device.timeouts, notes),
            "IdentificationReg134" => device.identifies_by_al_status = child.yes(notes),
            "IdentificationAdo" => device.identification_address = child.u16(notes),
            // Kinds and labels of ports; what they are electrically stands in `Physics`.
            "Port" => child.set_aside(notes),
            _ => child.skip(notes),
        }
    }
}

fn state_machine(element: Element, device: &mut Device, notes: &mut Notes) {
    for child in element.children(notes) {
        match child.name() {
            "Timeout" => timeouts_of(child, &mut device.timeouts, notes),
            "Behavior" => {
                device.start_to_safeop_no_sync = child.is("StartToSafeopNoSync", notes);
            }
            _ => child.skip(notes),
        }
    }
}

fn timeouts(element: Element, times: &mut Timeouts, notes: &mut Notes) {
    for child in element.children(notes) {
        match child.name() {
            "Timeout" => timeouts_of(child, times, notes),
            _ => child.skip(notes),
        }
    }
}

fn timeouts_of(element: Element, times: &mut Timeouts, notes: &mut Notes) {
    for child in element.children(notes) {
        let place = match child.name() {
            "PreopTimeout" => &mut times.pre_op_ms,
            "SafeopOpTimeout" => &mut times.safe_op_op_ms,
            "BackToInitTimeout" => &mut times.back_to_init_ms,
            "BackToSafeopTimeout" => &mut times.back_to_safe_op_ms,
            "RequestTimeout" => &mut times.request_ms,
            "ResponseTimeout" => &mut times.response_ms,
            _ => {
                child.skip(notes);
                continue;
            }
        };
        *place = child.number(0..=TIME_LIMIT_MS, notes).map(|time| time as u32);
    }
}

fn fmmu(element: Element, notes: &mut Notes) -> FmmuUse {
    match element.text().as_str() {
        "Outputs" => FmmuUse::Outputs,
        "Inputs" => FmmuUse::Inputs,
        "MBoxState" => FmmuUse::MailboxState,
        "" => FmmuUse::Other,
        other => {
            let text = format!("expected Outputs, Inputs or MBoxState, found {}", quoted(other));
            element.problem(text, notes);
            FmmuUse::Other
        }
    }
}

fn sync_manager(element: Element, notes: &mut Notes) -> SyncManager {
    if element.attribute("StartAddress").is_none() {
        element.problem("the SyncManager has no StartAddress", notes);
    }
    let start = element.attribute_number("StartAddress", 0..=0xFFFF, notes).map(|start| start as u16);
    let size = element.attribute_number_or("DefaultSize", 0, 0..=0xFFFF, notes).map(|size| size as u16);
    let control = element.attribute_number_or("ControlByte", 0, 0..=0xFF, notes).map(|control| control as u8);
    // By their bits where the file doesn't say it: mode (2 is a mailbox) and direction (1 is from the MainDevice).
    let by_control = match control.map(|control| (control & 3, control >> 2 & 3)) {
        Some((2, 1)) => SmUse::MailboxOut,
        Some((2, 0)) => SmUse::MailboxIn,
        Some((_, 1)) => SmUse::Outputs,
        Some(_) => SmUse::Inputs,
        None => SmUse::Unused,
    };
    let usage = match element.text().as_str() {
        "MBoxOut" => SmUse::MailboxOut,
        "MBoxIn" => SmUse::MailboxIn,
        "Outputs" => SmUse::Outputs,
        "Inputs" => SmUse::Inputs,
        "" => by_control,
        other => {
            let text = format!("expected MBoxOut, MBoxIn, Outputs or Inputs, found {}", quoted(other));
            element.problem(text, notes);
            SmUse::Unused
        }
    };
    // `Enable` is a number: bit 0 on, bit 1 fixed content, bit 2 virtual, bit 3 in OP alone.
    let enable = match element.attribute("Enable").map(str::trim) {
        Some("true") => 1,
        Some("false") => 0,
        _ => element.attribute_number("Enable", 0..=0xFF, notes).unwrap_or(0),
    };
    SyncManager {
        start,
        default_size: size,
        control,
        usage,
        enabled: enable & 1 != 0,
        is_virtual: element.is("Virtual", notes) || enable & 4 != 0,
        op_only: element.is("OpOnly", notes) || enable & 8 != 0,
    }
}

fn clocks(element: Element, device: &mut Device, notes: &mut Notes) {
    for mode in element.children(notes) {
        if mode.name() != "OpMode" {
            mode.skip(notes);
            continue;
        }
        let (mut read, before) = (model::DcMode::default(), notes.told());
        for child in mode.children(notes) {
            match child.name() {
                "Name" => read.name = short(child.text()),
                "Desc" => name(child, &mut read.description, notes),
                "AssignActivate" => read.assign_activate = child.u16(notes).unwrap_or(0),
                "CycleTimeSync0" => cycle(child, &mut read.sync0, notes),
                "CycleTimeSync1" => cycle(child, &mut read.sync1, notes),
                "ShiftTimeSync0" => shift(child, &mut read.sync0, notes),
                "ShiftTimeSync1" => shift(child, &mut read.sync1, notes),
                _ => child.skip(notes),
            }
        }
        read.is_unclear = notes.told() != before;
        device.dc_modes.push(read);
    }
}

fn cycle(element: Element, times: &mut SyncTimes, notes: &mut Notes) {
    times.cycle_ns = element.number(0..=0xFFFF_FFFF, notes).unwrap_or(0);
    times.factor = element.attribute_number("Factor", -0x8000..=0x7FFF, notes).map(|factor| factor as i32);
}

fn shift(element: Element, times: &mut SyncTimes, notes: &mut Notes) {
    times.shift_ns = element.number(-0x7FFF_FFFF..=0x7FFF_FFFF, notes).unwrap_or(0);
}

fn registers(element: Element, device: &mut Device, notes: &mut Notes) {
    for child in element.children(notes) {
        match REGISTERS.iter().find(|(name, _)| *name == child.name()) {
            Some((_, register)) => device.registers.extend(child.u32(notes).map(|value| (*register, value))),
            None => child.skip(notes),
        }
    }
}

fn eeprom(element: Element, notes: &mut Notes) -> Eeprom {
    let mut eeprom = Eeprom::default();
    for child in element.children(notes) {
        match child.name() {
            "ByteSize" => eeprom.byte_size = child.number(0..=EEPROM_LIMIT, notes).unwrap_or(0) as u32,
            "ConfigData" => eeprom.config_data = child.bytes(CONFIG_DATA_LIMIT, notes).unwrap_or_default(),
            "BootStrap" => eeprom.bootstrap = child.bytes(16, notes).unwrap_or_default(),
            _ => child.skip(notes),
        }
    }
    eeprom
}
