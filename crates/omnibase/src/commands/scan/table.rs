//! What `scan` found, as tables for a robot's file.

use crate::dictionary::{Objects, OnBus};
use crate::robot_table::{RobotTable, TO_FILL, in_array, plain_name, signal_type};
use crate::target::AnyBus;
use crate::value::DataType;
use omnibase_ethercat::Warning;
use omnibase_ethercat::start_up::SdoAccess;
use omnibase_ethercat::subdevice::{Direction, MappedObject, MappedPdo, SubDevice};
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::sii;

/// What a wheel is told, by speed or torque, and bits.
const TARGETS: [(u16, u8); 2] = [(0x60FF, 32), (0x6071, 16)];
/// Device type (0x1000) of drives: the profile's number in its lower half.
const DRIVES: u32 = 402;
const CONTROL_WORD: u16 = 0x6040;
const STATUS_WORD: u16 = 0x6041;
/// Objects that the cycle of a wheel needs, with direction, bits and what they are.
const NEEDED: [(Direction, u16, u8, &str); 4] = [
    (Direction::Outputs, CONTROL_WORD, 16, "control word"),
    (Direction::Outputs, 0x6060, 8, "mode of operation"),
    (Direction::Inputs, STATUS_WORD, 16, "status word"),
    (Direction::Inputs, 0x6064, 32, "position"),
];
/// Bits of 0x6502: cyclic synchronous velocity and torque.
const CSV: u32 = 1 << 8;
const CST: u32 = 1 << 9;
/// Signals that are written out of one direction of a device.
const SIGNALS: usize = 32;

/// The tables of every SubDevice of a segment in PRE-OP. Reads objects, writes none.
pub fn of(bus: &mut AnyBus) -> String {
    let mut text = String::from(
        "# Written by `omnibase scan --toml`. Lines marked FILL IN are what no bus tells: measure them, take their `# ` away.\n",
    );
    let mut warnings = RobotTable::default();
    bus.warnings().iter().for_each(|warning| warnings.comment(&format!("WARNING: {warning}.")));
    text.push_str(warnings.text());
    let mut names = Vec::new();
    for position in 0..bus.subdevices().len() as u16 {
        let one = bus.subdevices()[usize::from(position)].clone();
        text.push('\n');
        text.push_str(&table(bus, &one, &mut names));
    }
    text
}

/// A number that a drive tells of itself.
fn read(bus: &mut AnyBus, one: &SubDevice, index: u16, subindex: u8) -> Option<u32> {
    let bytes = bus.sdo_read(one.position, ObjectAddress::new(index, subindex), SdoAccess::Entry).ok()?;
    (1..=4)
        .contains(&bytes.len())
        .then(|| bytes.iter().rev().fold(0, |number, byte| number << 8 | u32::from(*byte)))
}

fn table(bus: &mut AnyBus, one: &SubDevice, names: &mut Vec<String>) -> String {
    let mut table = RobotTable::default();
    let identity = one.identity;
    table.comment(&format!("SubDevice {}: {}, serial {}.", one.position, one.name, identity.serial));
    if let Some(cause) = &one.broken {
        table.comment(&format!("BROKEN, so it is left out: {cause}."));
        return table.text().to_owned();
    }
    let speaks_coe = one.mailbox.is_some_and(|mailbox| mailbox.speaks_coe());
    let mut maps = [Direction::Outputs, Direction::Inputs].map(|direction| pdos(one, direction));
    if speaks_coe {
        ask_dictionary(bus, one.position, &mut maps);
    }
    let tells_profile = speaks_coe && read(bus, one, 0x1000, 0).is_some_and(|kind| kind & 0xFFFF == DRIVES);
    let is_drive =
        tells_profile || is_mapped(&maps[0], CONTROL_WORD, 16) && is_mapped(&maps[1], STATUS_WORD, 16);
    let protocols = one.mailbox.map_or(0, |mailbox| mailbox.protocols);
    for (bit, name) in [(sii::PROTOCOL_SOE, "SoE"), (sii::PROTOCOL_EOE, "EoE")] {
        if protocols & bit != 0 {
            table.comment(&format!("It speaks {name}, too, which isn't spoken here."));
        }
    }
    table.head(if is_drive { "[[drive]]" } else { "[[device]]" });
    let name = plain_name(&one.name, if is_drive { "wheel" } else { "device" }, names);
    table.line(&format!("name = \"{name}\""), "choose your own; of a drive: its wheel");
    place(bus, one, &mut table);
    if is_drive {
        table.line(
            "device = \"cia402\"",
            if tells_profile {
                "profile 402 (0x1000); `omnibase check --kinds` lists what is known better"
            } else {
                "its map has control and status word of profile 402, though 0x1000 doesn't tell it"
            },
        );
    } else if maps.iter().all(Vec::is_empty) {
        let is_damaged = |warning: &Warning| matches!(warning, Warning::Eeprom { position, .. } if *position == one.position);
        if bus.warnings().iter().any(is_damaged) {
            table.comment("WARNING: its EEPROM is damaged: what it has of process data isn't known.");
        }
        table.line("kind = \"ignore\"", "it names no process data");
    } else {
        table.line("kind = \"io\"", "inputs and outputs");
    }
    table.line(&format!("vendor_id = \"0x{:X}\"", identity.vendor_id), "another maker's is refused");
    table.line(&format!("product_code = \"0x{:X}\"", identity.product_code), "");
    table.line(
        &format!("revision = \"0x{:X}\"", identity.revision),
        "leave it out where another one fits too",
    );
    for (key, pdos) in [("outputs", &maps[0]), ("inputs", &maps[1])] {
        map_lines(key, pdos, &mut table);
    }
    if is_drive {
        drive(bus, one, &maps, &mut table);
    } else {
        modules(bus, one, &mut table);
        signals(&maps, &mut table);
    }
    table.text().to_owned()
}

/// What it is found by: an alias or a switch that it has alone, else its position.
fn place(bus: &AnyBus, one: &SubDevice, table: &mut RobotTable) {
    let is_own = |is_its: &dyn Fn(&SubDevice) -> bool| {
        bus.subdevices().iter().filter(|other| is_its(other)).count() == 1
    };
    let (alias, identification) = (one.alias, one.identification);
    if let Some(alias) = alias.filter(|alias| is_own(&|other| other.claims_alias(*alias))) {
        return table.line(&format!("alias = {alias}"), "found by it wherever it is plugged in");
    }
    if let Some(number) = identification.filter(|_| is_own(&|other| other.identification == identification)) {
        return table.line(
            &format!("identification = {number}"),
            "shown by its switch: found by it wherever it is plugged in",
        );
    }
    let reason = match (alias, identification) {
        (Some(alias), _) => format!("others have its alias {alias}, too: the order of the cable counts"),
        (None, Some(number)) => {
            format!("other switches show its {number}, too: the order of the cable counts")
        }
        (None, None) => "it has no alias: the order of the cable counts".to_owned(),
    };
    table.line(&format!("position = {}", one.position), &reason);
}

/// Which modules are in its slots, so that others are refused.
fn modules(bus: &mut AnyBus, one: &SubDevice, table: &mut RobotTable) {
    let Ok(Some(found)) = bus.read_modules(one.position) else { return };
    if found.detected.iter().all(|ident| *ident == 0) {
        return;
    }
    table.line("parameters = [", "written at the start, in PRE-OP");
    table.line("  { object = \"0xF030\", type = \"u8\", value = 0 },", "the list of modules is emptied");
    for (slot, ident) in (1..).zip(&found.detected) {
        let line = format!("  {{ object = \"0xF030.{slot}\", type = \"u32\", value = {ident} }},");
        table.line(&line, &format!("slot {slot}: module 0x{ident:08x} is there now (0xF050)"));
    }
    let count = found.detected.len();
    table.line(
        &format!("  {{ object = \"0xF030\", type = \"u8\", value = {count} }},"),
        "how many modules there are",
    );
    table.line("]", "");
}

/// PDOs of a direction, as they are mapped now.
fn pdos(one: &SubDevice, direction: Direction) -> Vec<MappedPdo> {
    one.process_data(direction).flat_map(|manager| manager.pdos.iter().cloned()).collect()
}

/// Asks the dictionary for names and types of entries that the EEPROM doesn't describe.
fn ask_dictionary(bus: &mut AnyBus, position: u16, maps: &mut [Vec<MappedPdo>; 2]) {
    let entries = maps.iter_mut().flatten().flat_map(|pdo| &mut pdo.entries);
    for entry in entries.filter(|entry| entry.object.index != 0 && entry.data_type.is_none()) {
        // Who doesn't answer one takes as long to say nothing to the others.
        let Ok(told) = OnBus { bus, position }.entry(entry.object) else { return };
        if let Ok(told) = told {
            entry.data_type = u8::try_from(told.data_type).ok();
            entry.name.get_or_insert(told.name);
        }
    }
}

fn map_lines(key: &str, pdos: &[MappedPdo], table: &mut RobotTable) {
    if pdos.is_empty() {
        return;
    }
    table.line(&format!("{key} = ["), "as it maps now");
    for pdo in pdos {
        let entry = |entry: &MappedObject| match (entry.object.index, entry.object.subindex) {
            (0, _) => format!("pad:{}", entry.bit_length),
            (index, 0) => format!("{index:04X}:{}", entry.bit_length),
            (index, subindex) => format!("{index:04X}.{subindex}:{}", entry.bit_length),
        };
        let map: Vec<String> = pdo.entries.iter().map(entry).collect();
        let line = format!("  {{ pdo = \"0x{:04X}\", map = \"{}\" }},", pdo.index, map.join(" "));
        table.line(&line, pdo.name.as_deref().unwrap_or_default());
    }
    table.line("]", "");
}

/// Whether an object of these bits is mapped at a whole byte.
fn is_mapped(pdos: &[MappedPdo], object: u16, bits: u8) -> bool {
    let mut bit = 0u32;
    pdos.iter().flat_map(|pdo| &pdo.entries).any(|entry| {
        let here = bit;
        bit += u32::from(entry.bit_length);
        (entry.object.index, entry.bit_length) == (object, bits) && here.is_multiple_of(8)
    })
}

/// Encoder, gear, torques, modes: what the drive tells, and what must be measured.
fn drive(bus: &mut AnyBus, one: &SubDevice, maps: &[Vec<MappedPdo>; 2], table: &mut RobotTable) {
    let mut told = |index, subindex| read(bus, one, index, subindex).filter(|number| *number > 0);
    let encoder = told(0x608F, 1).zip(told(0x608F, 2));
    let gear = told(0x6091, 1).zip(told(0x6091, 2));
    let (rated_torque, rated_current) = (told(0x6076, 0), told(0x6075, 0));
    let (max_torque, max_current, modes) = (told(0x6072, 0), told(0x6073, 0), told(0x6502, 0));
    match encoder {
        Some((counts, turns)) if counts.is_multiple_of(turns) => {
            table.line(
                &format!("counts_per_revolution = {}", counts / turns),
                "0x608F; confirm it: `omnibase setup` does",
            );
        }
        Some((counts, turns)) => table.left_to_fill(
            "counts_per_revolution = 1_048_576",
            &format!("0x608F says {counts} counts in {turns} turns, no whole number"),
        ),
        None => table.left_to_fill(
            "counts_per_revolution = 1_048_576",
            "counts of 0x6064 in a turn of the motor; 0x608F doesn't tell",
        ),
    }
    match gear {
        Some((motor, shaft)) => {
            let ratio = f64::from(motor) / f64::from(shaft);
            let reason =
                format!("0x6091: {motor} of the motor, {shaft} of the shaft; MEASURE: turn the wheel once");
            table.line(&format!("gear_ratio = {ratio:?}"), &reason);
        }
        None => table.left_to_fill(
            "gear_ratio = 1.0",
            "turns of the motor per turn of the wheel; 0x6091 doesn't tell",
        ),
    }
    match rated_torque {
        Some(torque) => table.line(
            &format!("rated_torque_nm = {:?}", f64::from(torque) / 1000.0),
            "0x6076: compare it with the motor's plate, for all torques are counted in it",
        ),
        None => table.left_to_fill("rated_torque_nm = 7.0", "the motor's plate; 0x6076 doesn't tell"),
    }
    match (max_torque, rated_torque) {
        (Some(limit), Some(rated)) => {
            let peak = f64::from(limit) * f64::from(rated) / 1e6;
            table.line(
                &format!("peak_torque_nm = {peak:?}"),
                &format!("0x6072 is {limit} per mille: what it is set to now"),
            );
        }
        _ => table.left_to_fill("peak_torque_nm = 21.0", "the motor's data sheet; default: the rated torque"),
    }
    for (current, object, what) in [(rated_current, "0x6075", "rated"), (max_current, "0x6073", "max")] {
        if let Some(current) = current {
            let unit = if object == "0x6075" { "mA" } else { "per mille of rated" };
            table.comment(&format!("Its {what} current ({object}) is {current} {unit}."));
        }
    }
    table.comment(
        "MEASURE which way its wheel turns: `direction`, forward or backward; jog it: `omnibase setup`.",
    );
    if let Some(modes) = modes {
        for (bit, name, law) in [(CSV, "csv", "speed"), (CST, "cst", "torque")] {
            if modes & bit == 0 {
                table.comment(&format!(
                    "WARNING: it has no mode {name} (0x6502 is 0x{modes:X}): no law that commands {law}."
                ));
            }
        }
    }
    for (direction, object, bits, what) in NEEDED {
        let map = &maps[usize::from(direction == Direction::Inputs)];
        if !is_mapped(map, object, bits) {
            let key = if direction == Direction::Inputs { "inputs" } else { "outputs" };
            table.comment(&format!(
                "{TO_FILL}: put {object:04X}:{bits} ({what}) into `{key}`: its map lacks it."
            ));
        }
    }
    if TARGETS.iter().all(|(object, bits)| !is_mapped(&maps[0], *object, *bits)) {
        table.comment(&format!(
            "{TO_FILL}: put 60FF:32 (target velocity), or 6071:16 (target torque) for a law of torque, into `outputs`: its map lacks both."
        ));
    }
    if one.dc.is_none() {
        table.comment("WARNING: it has no distributed clock: `bus.synchronisation` by SYNC0 isn't for it.");
    }
}

/// A signal for each entry.
fn signals(maps: &[Vec<MappedPdo>; 2], table: &mut RobotTable) {
    let mut taken = vec!["age".to_owned()];
    for (key, pdos) in [("output", &maps[0]), ("input", &maps[1])] {
        let entries = pdos.iter().flat_map(|pdo| &pdo.entries).filter(|entry| entry.object.index != 0);
        let entries: Vec<&MappedObject> = entries.collect();
        if entries.is_empty() {
            continue;
        }
        table.line(
            &format!("{key} = ["),
            "name them for what hangs there; scale and unit as the data sheet says",
        );
        for (number, entry) in entries.iter().enumerate() {
            let told = entry.name.clone().unwrap_or_default();
            let name = plain_name(&told, key, &mut taken);
            let object = format!("{:04X}.{}", entry.object.index, entry.object.subindex);
            let told_type = entry.data_type.map(|code| DataType::from_coe(code.into()));
            let kind = signal_type(entry.bit_length, told_type.unwrap_or(DataType::Bytes));
            let line = match kind {
                Some("bool") => format!("  {{ name = \"{name}\", object = \"{object}\" }},"),
                Some(kind) => format!("  {{ name = \"{name}\", object = \"{object}\", type = \"{kind}\" }},"),
                None => format!("  # {}", in_array(&name, &object, entry.bit_length)),
            };
            let line = if number >= SIGNALS && kind.is_some() { format!("  #{}", &line[1..]) } else { line };
            let reason = match (told_type, entry.bit_length) {
                (Some(_), _) | (None, 1) => told,
                (None, _) => {
                    format!("{told} MEASURE: nobody tells whether it has a sign").trim_start().to_owned()
                }
            };
            table.line(&line, &reason);
        }
        table.line("]", "");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::target::AnyClock;
    use omnibase_ethercat::wire::Link;
    use omnibase_ethercat::{Bus, BusOptions};
    use omnibase_ethercat_sim::{SegmentFile, in_process};

    /// From the next power-on two would have it.
    #[test]
    fn an_alias_that_another_eeprom_has_already_names_nobody() {
        let text = "[[subdevice]]\nkind = \"servo\"\nalias = 7\n[[subdevice]]\nkind = \"servo\"\n";
        let segment = SegmentFile::parse(text).unwrap().build(std::path::Path::new(".")).unwrap();
        let (link, clock) = in_process(segment);
        let mut bus =
            Bus::new(Box::new(link) as Box<dyn Link>, AnyClock::Virtual(clock), BusOptions::default());
        bus.scan().unwrap();
        bus.configure(&[]).unwrap();
        assert!(of(&mut bus).contains("\nalias = 7 "));
        let before = bus.read_sii(1).unwrap();
        let after = bus.sii_with_alias(1, 7).unwrap().unwrap();
        bus.write_sii(1, &before, &after).unwrap();
        bus.scan().unwrap();
        bus.configure(&[]).unwrap();
        let tables = of(&mut bus);
        assert!(
            !tables.contains("\nalias = ") && tables.contains("others have its alias 7, too"),
            "{tables}"
        );
    }
}
