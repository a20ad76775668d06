//! A device made from its maker's file (ESI): identity, mailbox, PDOs, objects and modules are what the file says.

use super::Piece;
use super::axis::{Axis, Load, SingleAxis};
use super::generic::{Generic, More};
use super::parameters;
use super::servo::{self, ServoConfig};
use crate::SubDevice;
use crate::dictionary::{Access, DataType, Entry, Object};
use crate::firmware::PdoRules;
use crate::segment_file::EsiDevice;
use omnibase_esi::model::{ObjectRights, OdEntry, OdObject, OdShape, SlotIndex};
use omnibase_esi::{Assembly, Command, EsiFile, image};
use omnibase_ethercat_wire::coe::ObjectAddress;
use std::path::Path;

/// Objects of the communication profile that the image makes and the file's aren't taken for: identity, assignments.
const OWN: [core::ops::RangeInclusive<u16>; 4] =
    [0x1000..=0x1018, 0x1600..=0x17FF, 0x1A00..=0x1BFF, 0x1C00..=0x1C33];
/// Device type: its low 16 bits are the number of the profile.
const DEVICE_TYPE: u16 = 0x1000;
/// Profile of drives (CiA 402).
const DRIVES: u32 = 402;
/// What a drive is commanded by, and what it shows.
const CONTROLWORD: u16 = 0x6040;
const STATUSWORD: u16 = 0x6041;
/// Which modules are configured, and which are there (ETG.5001).
const CONFIGURED_MODULES: u16 = 0xF030;
const DETECTED_MODULES: u16 = 0xF050;

/// The device that a segment file asks for, its files looked for in `base_dir`; a drive moves `axis`, or a motor of its own.
pub(crate) fn build(
    wanted: &EsiDevice,
    base_dir: &Path,
    piece: &Piece,
    axis: Option<Box<dyn Axis>>,
) -> Result<SubDevice, String> {
    let read = |path: &Path| {
        let path = base_dir.join(path);
        EsiFile::read(&path).map_err(|error| format!("{}: {error}", path.display()))
    };
    let file = read(&wanted.file)?;
    let others =
        wanted.module_files.iter().map(|path| read(path)).collect::<Result<Vec<EsiFile>, String>>()?;
    let device = file.device(&wanted.device)?;
    let module = |name: &String| device.module(std::iter::once(&file).chain(&others), name);
    let modules = wanted.modules.iter().map(module).collect::<Result<Vec<_>, String>>()?;
    let assembly = Assembly::new(device, modules).map_err(|error| error.to_string())?;
    if let Some(problem) = assembly.problems().next() {
        return Err(format!("{}: {problem}", device.type_name));
    }
    let (servo, load) = match &wanted.servo {
        Some(_) if !is_drive(&assembly) => {
            return Err(format!(
                "{} has a table \"servo\" and is no drive: its file has no profile 402 with 0x6040 and 0x6041 in its PDOs",
                device.type_name
            ));
        }
        given => given.clone().unwrap_or_default(),
    };
    let axis = axis.unwrap_or_else(|| Box::new(SingleAxis::new(load)));
    let vendor_id = file.vendor.id.unwrap_or(0);
    Ok(on_axis(&assembly, vendor_id, piece, servo, axis)?.sub_device)
}

/// A device with its modules; a drive has a motor of its own. Names what of it can't be simulated.
pub fn from_assembly(assembly: &Assembly, vendor_id: u32, piece: &Piece) -> Result<Generic, String> {
    let axis = Box::new(SingleAxis::new(Load::default()));
    on_axis(assembly, vendor_id, piece, ServoConfig::default(), axis)
}

/// Whether it is a drive of one axis by CiA 402; axes in slots have their objects elsewhere.
fn is_drive(assembly: &Assembly) -> bool {
    let is_mapped = |outputs, index| {
        let pdos = assembly.pdos(outputs);
        pdos.iter().flat_map(|pdo| &pdo.entries).any(|entry| entry.index.index == index)
    };
    assembly.device.slots.is_none()
        && device_type(assembly) & 0xFFFF == DRIVES
        && is_mapped(true, CONTROLWORD)
        && is_mapped(false, STATUSWORD)
}

/// A servo's PDOs have its objects as CiA 402 has them.
fn check_lengths(assembly: &Assembly, servo: &ServoConfig) -> Result<(), String> {
    let standard = servo::standard_objects(servo);
    let pdos = [assembly.pdos(true), assembly.pdos(false)].concat();
    for entry in pdos.iter().flat_map(|pdo| &pdo.entries) {
        let object = standard.iter().find(|object| object.index == entry.index.index);
        let known = object.and_then(|object| object.entry(entry.subindex));
        if let Some(known) = known.filter(|known| known.bit_length != u16::from(entry.bits)) {
            return Err(format!(
                "{}: its PDOs have 0x{:04X} with {} bits, expected {} by CiA 402",
                assembly.device.type_name, entry.index.index, entry.bits, known.bit_length
            ));
        }
    }
    Ok(())
}

fn on_axis(
    assembly: &Assembly,
    vendor_id: u32,
    piece: &Piece,
    servo: ServoConfig,
    axis: Box<dyn Axis>,
) -> Result<Generic, String> {
    let drive = is_drive(assembly).then_some((servo, axis));
    if let Some((servo, _)) = &drive {
        check_lengths(assembly, servo)?;
    }
    let bytes = image::eeprom(assembly.device, vendor_id).emit();
    let mut objects: Vec<Object> = Vec::new();
    let is_own = |object: &OdObject| OWN.iter().any(|range| range.contains(&object.index.index));
    for object in assembly.objects().iter().filter(|object| !is_own(object)) {
        objects.push(described(object));
    }
    let idents: Vec<u32> = assembly.modules.iter().map(|module| module.ident.unwrap_or(0)).collect();
    if assembly.device.slots.is_some() {
        objects.retain(|object| ![CONFIGURED_MODULES, DETECTED_MODULES].contains(&object.index));
        objects.extend(module_lists(&idents));
    }
    for command in assembly.commands() {
        make_room(&command, &mut objects);
    }
    let image = image::with_modules(assembly, vendor_id);
    let (device_type, pdo_rules) = (device_type(assembly), pdo_rules(assembly));
    let more = More { objects, modules: idents, pdo_rules, device_type, drive };
    Ok(Generic::assemble(&image, bytes, piece, more))
}

/// What the file has to be assigned, and what it has not to be assigned together.
fn pdo_rules(assembly: &Assembly) -> PdoRules {
    let mut rules = PdoRules::default();
    for outputs in [true, false] {
        let mandatory = assembly.default_pdos(outputs).0.into_iter().filter(|pdo| pdo.mandatory);
        rules.mandatory.extend(mandatory.map(|pdo| pdo.index.index));
        for pdo in assembly.pdos(outputs) {
            rules.excluded.extend(pdo.excludes.iter().map(|other| [pdo.index.index, other.index]));
        }
    }
    rules
}

/// Object 0x1000 as the file's dictionary has it, else the number of its profile: a drive's where it is one of several.
fn device_type(assembly: &Assembly) -> u32 {
    let objects = assembly.objects();
    let written = objects.iter().find(|object| object.index.index == DEVICE_TYPE);
    let written = written.and_then(|object| object.entries.first()?.default.first_chunk());
    let profiles = &assembly.device.profiles;
    let profile = profiles.iter().find(|profile| **profile == DRIVES).or(profiles.first());
    written.map_or(profile.map_or(0, |profile| profile & 0xFFFF), |bytes| u32::from_le_bytes(*bytes))
}

fn module_lists(idents: &[u32]) -> [Object; 2] {
    let entries = |access: Access, value: &dyn Fn(usize) -> u32| -> Vec<Entry> {
        let count = idents.len().min(usize::from(u8::MAX)) as u8;
        let mut entries = vec![Entry::unsigned8(0, "Number of entries", count).with_access(access)];
        let slot = |slot: u8| {
            let name = format!("Module ident of slot {slot}");
            Entry::unsigned32(slot, name, value(usize::from(slot) - 1)).with_access(access)
        };
        entries.extend((1..=count).map(slot));
        entries
    };
    [
        Object::array(
            CONFIGURED_MODULES,
            "Configured module ident list",
            entries(Access::READ_WRITE_PRE_OP, &|_| 0),
        ),
        Object::array(
            DETECTED_MODULES,
            "Detected module ident list",
            entries(Access::READ, &|slot| idents[slot]),
        ),
    ]
}

fn described(object: &OdObject) -> Object {
    let OdObject { index: SlotIndex { index, .. }, name, shape, entries } = object;
    let entries: Vec<Entry> = entries.iter().map(entry).collect();
    match (shape, entries) {
        (OdShape::Variable, mut entries) if entries.len() == 1 => {
            let mut entry = entries.remove(0);
            entry.name = name.clone().into();
            Object::variable(*index, entry)
        }
        (OdShape::Array, entries) => Object::array(*index, name.clone(), entries),
        (_, entries) => Object::record(*index, name.clone(), DataType::RECORD, entries),
    }
}

fn entry(entry: &OdEntry) -> Entry {
    let OdEntry { subindex, name, type_code, bits, rights, default } = entry;
    let bytes = bits.div_ceil(8).max(1) as usize;
    let data_type = DataType(*type_code);
    let value = &default[..default.len().min(bytes)];
    let described = if data_type.has_variable_length() {
        Entry::new(*subindex, name.clone(), data_type, value.to_vec()).with_capacity(bytes)
    } else {
        let mut value = value.to_vec();
        value.resize(bytes, 0);
        let bit_length = (*bits).clamp(1, u32::from(u16::MAX)) as u16;
        let mut entry = Entry::new(*subindex, name.clone(), data_type, value);
        entry.bit_length = bit_length;
        entry
    };
    described.with_access(access(rights))
}

fn access(rights: &ObjectRights) -> Access {
    let [pre_op, safe_op, op] = rights.write_in;
    let all = [
        (rights.read, Access::READ),
        (pre_op, Access::WRITE_PRE_OP),
        (safe_op, Access::WRITE_SAFE_OP),
        (op, Access::WRITE_OP),
        (rights.rx_pdo, Access::RX_PDO),
        (rights.tx_pdo, Access::TX_PDO),
    ];
    all.iter().filter(|(there, _)| *there).fold(Access::NONE, |access, (_, bits)| access | *bits)
}

/// A device takes what its maker has it told, also where the file's dictionary doesn't have the object; what is for SAFE-OP
/// there alone.
fn make_room(one: &Command, objects: &mut Vec<Object>) {
    let command = &one.command;
    let rights = match one.is_for_safe_op() && !one.is_for_pre_op() {
        true => Access::READ | Access::WRITE_SAFE_OP,
        false => Access::READ_WRITE,
    };
    if command.complete_access {
        let address = ObjectAddress::new(command.index.index, command.subindex);
        return parameters::add_objects(objects, &parameters::entries_of_whole(address, &command.data));
    }
    let bytes = command.data.len();
    let data_type = match bytes {
        1 => DataType::UNSIGNED8,
        2 => DataType::UNSIGNED16,
        4 => DataType::UNSIGNED32,
        _ => DataType::OCTET_STRING,
    };
    let value = if data_type.has_variable_length() { Vec::new() } else { vec![0; bytes] };
    let name =
        if command.comment.is_empty() { "Told at the start".to_owned() } else { command.comment.clone() };
    let entry = Entry::new(command.subindex, name.clone(), data_type, value).with_access(rights);
    let entry = if data_type.has_variable_length() { entry.with_capacity(bytes) } else { entry };
    let index = command.index.index;
    if let Some(known) = objects.iter_mut().find(|object| object.index == index) {
        known.add_missing(Object::record(index, name, DataType::RECORD, vec![entry]));
    } else if command.subindex == 0 {
        objects.push(Object::variable(index, entry));
    } else {
        objects.push(Object::record(index, name, DataType::RECORD, vec![entry]));
    }
}
