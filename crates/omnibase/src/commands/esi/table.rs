//! A device's table for a robot's file.

use super::clocks;
use crate::robot_table::{RobotTable, TO_FILL, in_array, plain_name, signal_type};
use crate::value::DataType;
use omnibase_esi::model::{Coe, Pdo, PdoEntry};
use omnibase_esi::{Assembly, Command, CommandSource, Device, EsiFile};
use std::fmt::Write;

/// Profile of drives (CiA 402).
const DRIVES: u32 = 402;
/// Signals that are written out of one direction of a device; a robot has room for 64 of all.
const SIGNALS: usize = 32;
/// Of a parameter that is written there.
const SAFE_OP: &str = ", state = \"safe_op\"";

/// The table of a device with its modules: `[[drive]]` where it is one, else `[[device]]`.
pub fn of(file: &EsiFile, assembly: &Assembly) -> String {
    let device = assembly.device;
    let is_drive = device.profiles.contains(&DRIVES);
    let mut table = RobotTable::default();
    table.comment(&format!(
        "{}: {}, {}; line {} of its maker's file.",
        device.type_name, device.names, file.vendor.name, device.line
    ));
    for (slot, module) in (1..).zip(&assembly.modules) {
        table.comment(&format!("Slot {slot}: {}, {}", module.type_name, module.names));
    }
    for doubt in assembly.doubts() {
        table.comment(&format!("LOOK AT THIS: {doubt}."));
    }
    let maps = [assembly.default_pdos(true).0, assembly.default_pdos(false).0];
    hints(device, &mut table);
    table.head(if is_drive { "[[drive]]" } else { "[[device]]" });
    let name = plain_name(&device.type_name, "device", &mut Vec::new());
    table.line(&format!("name = \"{name}\""), "its signals are called by it: choose your own");
    table.line(
        "position = 0",
        &format!("{TO_FILL}: its place on the bus, as `omnibase scan` shows it; or `alias`"),
    );
    let commands: Vec<Command> = assembly.commands().into_iter().filter(Command::is_parameter).collect();
    if is_drive {
        table.line("device = \"cia402\"", "its profile is 402; --kinds lists devices that are known better");
    } else if !maps.iter().all(Vec::is_empty) || !commands.is_empty() {
        table.line("kind = \"io\"", "its signals are inputs and outputs; `axis` for a drive without a wheel");
    } else if assembly.problems().next().is_none() {
        table.line("kind = \"ignore\"", "it has no process data: a coupler");
    } else {
        table.left_to_fill("kind = \"?\"", "no process data of it can be read");
    }
    identity(
        "vendor_id",
        file.vendor.id,
        &format!("{}: another maker's is refused", file.vendor.name),
        &mut table,
    );
    identity("product_code", device.product_code, &device.type_name, &mut table);
    identity(
        "revision",
        device.revision,
        "this file's: leave the line out where a newer one fits too",
        &mut table,
    );
    clocks::modes(device, is_drive, &mut table);
    timeouts(device, &mut table);
    for (key, pdos) in [("outputs", &maps[0]), ("inputs", &maps[1])] {
        pdo_lines(key, pdos, device, &mut table);
    }
    parameters(&commands, &mut table);
    if is_drive {
        drive_lines(&maps, &mut table);
    } else {
        signals(&maps, &mut table);
    }
    table.text().to_owned()
}

/// A number of its identity.
fn identity(key: &str, number: Option<u32>, reason: &str, table: &mut RobotTable) {
    match number {
        Some(number) => table.line(&format!("{key} = \"0x{number:X}\""), reason),
        None => table.left_to_fill(&format!("{key} = \"?\""), "its maker's file has none that can be read"),
    }
}

/// What the file says that a robot's file has no key for.
fn hints(device: &Device, table: &mut RobotTable) {
    for (number, manager) in device.sync_managers.iter().enumerate() {
        let flags = [(manager.is_virtual, "virtual: never switched on"), (manager.op_only, "on in OP alone")];
        for (_, words) in flags.iter().filter(|(there, _)| *there) {
            table.comment(&format!("SyncManager {number} is {words}; so says its EEPROM, too."));
        }
    }
    if let Some(address) = device.identification_address {
        table.comment(&format!(
            "A switch sets its number: register 0x{address:04X} (explicit identification)."
        ));
    }
    if device.identifies_by_al_status {
        table.comment(
            "A switch sets its number (explicit identification, 0x0134): `identification = …` in place of `position` finds it \
             wherever it is plugged in.",
        );
    }
    if device.refuses_lrw {
        table.comment("It takes LRD and LWR, no LRW (UseLrdLwr); so says its EEPROM, too.");
    }
    let mailbox = device.mailbox.clone().unwrap_or_default();
    for (_, name) in [(mailbox.soe, "SoE"), (mailbox.eoe, "EoE")].iter().filter(|(there, _)| *there) {
        table.comment(&format!(
            "It speaks {name}, which isn't spoken here: nothing of it is needed for process data."
        ));
    }
    for (register, value) in &device.registers {
        table.comment(&format!("Its file wants register 0x{register:04X} to be 0x{value:X}."));
    }
}

/// The longest waits, as its maker gives them.
fn timeouts(device: &Device, table: &mut RobotTable) {
    let times = &device.timeouts;
    // One time for both halves of a mailbox's exchange: until it takes the request, and until it answers.
    let mailbox = times.response_ms.map(|response| times.request_ms.unwrap_or(0).saturating_add(response));
    let all = [
        ("init_ms", times.back_to_init_ms),
        ("pre_op_ms", times.pre_op_ms),
        ("safe_op_op_ms", times.safe_op_op_ms),
        ("mailbox_ms", mailbox),
    ];
    let known = all.iter().filter_map(|(key, time)| time.filter(|time| *time > 0).map(|time| (key, time)));
    let known: Vec<String> = known.map(|(key, time)| format!("{key} = {time}")).collect();
    if !known.is_empty() {
        table.line(&format!("timeouts = {{ {} }}", known.join(", ")), "the longest that it may take");
    }
    if let Some(time) = times.back_to_safe_op_ms.filter(|time| *time > 0) {
        table.comment(&format!(
            "It may take {time} ms from OP to SAFE-OP: nobody waits for that here, the way down leads from OP to PRE-OP and INIT."
        ));
    }
}

/// A PDO's map as a robot's file has it; what can't be read is a question mark, which no robot's file takes.
fn map(pdo: &Pdo) -> String {
    let entry = |entry: &PdoEntry| match (entry.is_gap(), entry.subindex) {
        _ if entry.is_unclear => "?".to_owned(),
        (true, _) => format!("pad:{}", entry.bits),
        (_, 0) => format!("{:04X}:{}", entry.index.index, entry.bits),
        (_, subindex) => format!("{:04X}.{subindex}:{}", entry.index.index, entry.bits),
    };
    pdo.entries.iter().map(entry).collect::<Vec<_>>().join(" ")
}

fn pdo_lines(key: &str, pdos: &[Pdo], device: &Device, table: &mut RobotTable) {
    if pdos.is_empty() {
        return;
    }
    table.line(&format!("{key} = ["), "");
    for pdo in pdos {
        let configurable =
            device.mailbox.as_ref().and_then(|one| one.coe.as_ref()).is_some_and(|coe| coe.pdo_config);
        let mut reasons = vec![format!("{}, SyncManager {}", pdo.name, pdo.sync_manager.unwrap_or(0))];
        if pdo.is_unclear() {
            reasons.insert(0, format!("{TO_FILL} what its maker's file has a number for that can't be read"));
        }
        let flags = [
            (pdo.mandatory, "mandatory"),
            (pdo.fixed || !configurable, "its entries can't be changed"),
            (!pdo.fixed && configurable, "its entries may be chosen"),
        ];
        reasons.extend(flags.iter().filter(|(there, _)| *there).map(|(_, words)| (*words).to_owned()));
        let excluded: Vec<String> = pdo.excludes.iter().map(|one| format!("0x{:04X}", one.index)).collect();
        if !excluded.is_empty() {
            reasons.push(format!("not together with {}", excluded.join(", ")));
        }
        let line = format!("  {{ pdo = \"0x{:04X}\", map = \"{}\" }},", pdo.index.index, map(pdo));
        table.line(&line, &reasons.join("; "));
    }
    table.line("]", "");
}

fn parameters(commands: &[Command], table: &mut RobotTable) {
    if commands.is_empty() {
        return;
    }
    table.line("parameters = [", "what its maker has written at the start");
    let in_state = |is_in: fn(&Command) -> bool, key| {
        commands.iter().filter(move |one| is_in(one)).map(move |one| (one, key))
    };
    let all = in_state(Command::is_for_pre_op, "").chain(in_state(Command::is_for_safe_op, SAFE_OP));
    for (Command { command, source }, state) in all {
        let data = &command.data;
        let value = match data.len() {
            _ if command.complete_access => format!("bytes = \"{}\", complete_access = true", hex(data)),
            1 => format!("type = \"u8\", value = {}", data[0]),
            2 => format!("type = \"u16\", value = {}", u16::from_le_bytes([data[0], data[1]])),
            4 => format!(
                "type = \"u32\", value = {}",
                u32::from_le_bytes([data[0], data[1], data[2], data[3]])
            ),
            _ => format!("bytes = \"{}\"", hex(data)),
        };
        let object = match command.subindex {
            0 => format!("0x{:04X}", command.index.index),
            subindex => format!("0x{:04X}.{subindex}", command.index.index),
        };
        let source = match source {
            CommandSource::Device => "its own command".to_owned(),
            CommandSource::ModuleList => "which modules are configured".to_owned(),
            CommandSource::Module { slot } => format!("of the module in slot {slot}"),
        };
        let at =
            if command.line == 0 { String::new() } else { format!(", line {} of the file", command.line) };
        let comment =
            if command.comment.is_empty() { String::new() } else { format!(": {}", command.comment) };
        let line = format!("  {{ object = \"{object}\", {value}{state} }},");
        table.line(&line, &format!("{}, {source}{at}{comment}", command.transitions.join(" ")));
    }
    table.line("]", "");
}

fn hex(data: &[u8]) -> String {
    data.iter().fold(String::new(), |mut digits, byte| {
        let _ = write!(digits, "{byte:02X}");
        digits
    })
}

/// What only the motor's plate and the drive tell.
fn drive_lines(maps: &[Vec<Pdo>; 2], table: &mut RobotTable) {
    for (line, reason) in [
        ("counts_per_revolution = 1_048_576", "counts of 0x6064 in a turn of the motor"),
        ("gear_ratio = 1.0", "turns of the motor per turn of the wheel"),
        ("rated_torque_nm = 7.0", "the motor's plate; 0x6076 in mN·m"),
        ("peak_torque_nm = 21.0", "the motor's data sheet"),
    ] {
        table.left_to_fill(line, reason);
    }
    let has = |map: &[Pdo], object: u16| {
        map.iter()
            .flat_map(|pdo| &pdo.entries)
            .any(|entry| entry.index.index == object && entry.subindex == 0)
    };
    let needed = [
        (0, 0x6040, "control word"),
        (0, 0x6060, "mode"),
        (1, 0x6041, "status word"),
        (1, 0x6064, "position"),
    ];
    for (direction, object, name) in needed {
        if !has(&maps[direction], object) {
            let list = ["outputs", "inputs"][direction];
            table.comment(&format!(
                "{TO_FILL}: the {name} 0x{object:04X} isn't in its default map; put it into `{list}`."
            ));
        }
    }
}

/// A signal for each entry.
fn signals(maps: &[Vec<Pdo>; 2], table: &mut RobotTable) {
    let mut taken = vec!["age".to_owned()];
    for (key, pdos) in [("output", &maps[0]), ("input", &maps[1])] {
        let entries = pdos.iter().flat_map(|pdo| &pdo.entries).filter(|entry| !entry.is_gap());
        let entries: Vec<&PdoEntry> = entries.collect();
        if entries.is_empty() {
            continue;
        }
        let many = entries.len() > SIGNALS;
        let reason = if many {
            "a robot has room for 64: take in those that you need"
        } else {
            "name them for what hangs there"
        };
        table.line(&format!("{key} = ["), reason);
        for (number, entry) in entries.iter().enumerate() {
            let name = plain_name(entry.name.english(), key, &mut taken);
            let object = format!("{:04X}.{}", entry.index.index, entry.subindex);
            let line = match signal_type(
                entry.bits,
                entry.type_code().map_or(DataType::Bytes, DataType::from_coe),
            ) {
                _ if entry.is_unclear => {
                    table.comment(&format!("  {name}: {TO_FILL}, a number of it can't be read"));
                    continue;
                }
                Some("bool") => format!("  {{ name = \"{name}\", object = \"{object}\" }},"),
                Some(kind) => format!("  {{ name = \"{name}\", object = \"{object}\", type = \"{kind}\" }},"),
                None => {
                    table.comment(&format!("  {}", in_array(&name, &object, entry.bits)));
                    continue;
                }
            };
            let line = if number >= SIGNALS { format!("  #{}", &line[1..]) } else { line };
            table.line(&line, &format!("{} {}", entry.name, entry.data_type));
        }
        table.line("]", "");
    }
}

/// What CoE can, in words.
pub fn coe_words(coe: &Coe) -> String {
    let all = [
        (true, "SDO"),
        (coe.sdo_info, "SDO Information"),
        (coe.pdo_assign, "PDO assignment"),
        (coe.pdo_config, "PDO configuration"),
        (coe.pdo_upload, "PDO upload"),
        (coe.complete_access, "complete access"),
        (coe.segmented, "segmented SDO"),
        (coe.diagnosis_history, "diagnosis history"),
    ];
    all.iter().filter(|(there, _)| *there).map(|(_, word)| *word).collect::<Vec<_>>().join(", ")
}
