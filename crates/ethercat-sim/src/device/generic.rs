//! A device made from an SII image alone: identity, mailbox, PDOs and ports are what the image says.

use super::axis::Axis;
use super::panel::{IoPanel, MOST_BYTES};
use super::servo::{self, Servo, ServoConfig};
use super::{Device, Moment, Outputs, Piece};
use crate::dictionary::pdo::Direction;
use crate::dictionary::standard::{self, Mapping, Nameplate, PdoMap};
use crate::dictionary::{Access, DataType, Dictionary, Entry, Object, little_endian};
use crate::firmware::{
    FileStore, Firmware, FirmwareConfig, MailboxProtocols, PdoRules, ProcessSyncManager, SmActivation,
    StateControl, SyncMonitoring, Synchronization, TransitionTimes,
};
use crate::{EscConfig, SubDevice};
use omnibase_ethercat_wire::HostTime;
use omnibase_ethercat_wire::coe::{AbortCode, ObjectAddress};
use omnibase_ethercat_wire::register;
use omnibase_ethercat_wire::sii::{self, Image, ImageTooShort, MailboxArea, Pdo, SyncManagerUsage};

/// Bit of the PDI control word: the chip answers AL control by itself (0x0141 bit 0).
const EMULATION: u16 = 1 << 8;
/// The name of the file that a device with FoE has from the beginning.
pub const FIRMWARE: &str = "firmware.bin";
/// End of the process-data memory of the simulated chip (8 KiB).
const MEMORY_END: u16 = 0x3000;

/// A SubDevice from an image, and its terminals.
#[derive(Debug)]
pub struct Generic {
    /// The SubDevice.
    pub sub_device: SubDevice,
    /// Its inputs and outputs.
    pub panel: IoPanel,
    /// Its files; `None` where its image knows no FoE.
    pub files: Option<FileStore>,
}

impl Generic {
    /// A device with exactly this image. Alias and serial number of `piece` count where they aren't 0.
    pub fn from_sii(bytes: &[u8], piece: &Piece) -> Result<Self, ImageTooShort> {
        Generic::with_objects(bytes, piece, Vec::new())
    }

    /// The same with more objects behind its mailbox; those that it has anyway stay as they are.
    pub fn with_objects(bytes: &[u8], piece: &Piece, more: Vec<Object>) -> Result<Self, ImageTooShort> {
        let (image, _) = Image::parse(bytes)?;
        Ok(Generic::assemble(&image, bytes.to_vec(), piece, More { objects: more, ..More::default() }))
    }

    /// A device that behaves as `image` says and has `bytes` in its EEPROM.
    pub(super) fn assemble(image: &Image, mut bytes: Vec<u8>, piece: &Piece, more: More) -> Self {
        if piece.alias != 0 || piece.serial != 0 {
            personalize(image, piece, &mut bytes);
        }
        let process_data = process_sync_managers(image);
        let mut objects = objects(image, piece, &process_data, more.device_type);
        for object in more.objects {
            match objects.iter_mut().find(|known| known.index == object.index) {
                Some(known) => known.add_missing(object),
                None => objects.push(object),
            }
        }
        if let Some((servo, _)) = &more.drive {
            add_standard_objects(servo, &mut objects);
        }
        let dictionary = Dictionary::new(objects);
        let terminals = |direction| mapped_objects(image, direction);
        let panel = IoPanel::new(&terminals(Direction::Inputs), &terminals(Direction::Outputs));
        let mailbox = (image.header.mailbox != MailboxArea::default()).then(|| {
            let coe = image.header.mailbox_protocols & sii::PROTOCOL_COE != 0;
            (image.header.mailbox, if coe { MailboxProtocols::Coe } else { MailboxProtocols::Nothing })
        });
        let has_bootstrap = image.header.bootstrap_mailbox != MailboxArea::default();
        let config = FirmwareConfig {
            state_control: if image.header.pdi_control & EMULATION != 0 {
                StateControl::Emulated
            } else {
                StateControl::Firmware
            },
            identification: piece.identification,
            mailbox,
            bootstrap: has_bootstrap.then_some(image.header.bootstrap_mailbox),
            process_data,
            pdo_rules: more.pdo_rules,
            synchronization: synchronization(image),
            times: TransitionTimes::default(),
        };
        let chip = EscConfig::default();
        let refused = match &image.general {
            Some(general) if general.flags & sii::FLAG_NO_LRW != 0 => register::FEATURE_NO_LRW,
            _ => 0,
        };
        let esc = EscConfig {
            port_descriptor: port_descriptor(image),
            features: chip.features | refused,
            sii: bytes.clone(),
            dc_offset_ns: piece.dc_offset_ns,
            dc_drift_ppm: piece.dc_drift_ppm,
            ..chip
        };
        let device: Box<dyn Device> = match more.drive {
            Some((servo, axis)) => Box::new(Servo::on(servo, &dictionary, axis)),
            None => {
                Box::new(Terminals { modules: more.modules, ..Terminals::new(&dictionary, panel.clone()) })
            }
        };
        let mut firmware = Firmware::new(config, dictionary, device);
        let has_files = image.header.mailbox_protocols & sii::PROTOCOL_FOE != 0;
        let files = has_files.then(|| FileStore::with_firmware(FIRMWARE, &bytes));
        if let Some(files) = &files {
            firmware = firmware.with_files(files.clone());
        }
        Generic { sub_device: SubDevice::new(esc, Box::new(firmware)), panel, files }
    }
}

/// What a device has beyond its image.
#[derive(Default)]
pub(super) struct More {
    /// Objects; of those that the image makes anyway, the entries that it doesn't have.
    pub objects: Vec<Object>,
    /// Idents of the modules in its slots: the only ones that 0xF030 takes.
    pub modules: Vec<u32>,
    /// Which PDOs go together: mandatory ones and exclusions, of which no image tells enough.
    pub pdo_rules: PdoRules,
    /// Object 0x1000, of which no image tells: the number of a profile in its low 16 bits.
    pub device_type: u32,
    /// A drive's servo, and what it moves.
    pub drive: Option<(ServoConfig, Box<dyn Axis>)>,
}

/// The objects that a servo works on stand in the place of those by which its image and its maker's file describe them.
fn add_standard_objects(servo: &ServoConfig, objects: &mut Vec<Object>) {
    for own in servo::standard_objects(servo) {
        match objects.iter_mut().find(|known| known.index == own.index) {
            Some(known) => *known = own.in_place_of(known.clone()),
            None => objects.push(own),
        }
    }
}

/// The object that is told which modules are configured.
const CONFIGURED_MODULES: u16 = 0xF030;

/// Puts alias and serial number into the image.
fn personalize(image: &Image, piece: &Piece, bytes: &mut [u8]) {
    let mut header = image.header.clone();
    if piece.alias != 0 {
        header.alias = piece.alias;
    }
    if piece.serial != 0 {
        header.identity.serial = piece.serial;
    }
    header.checksum = u16::from(header.computed_checksum());
    bytes[..sii::HEADER].copy_from_slice(&header.bytes());
}

/// The direction of a SyncManager by its usage or, where the image gives none, by its control register.
fn direction(sm: &sii::SyncManager) -> Option<Direction> {
    match sm.usage {
        SyncManagerUsage::Outputs => Some(Direction::Outputs),
        SyncManagerUsage::Inputs => Some(Direction::Inputs),
        _ => None,
    }
}

fn process_sync_managers(image: &Image) -> Vec<ProcessSyncManager> {
    let starts = |after: u16| {
        let later = image.sync_managers.iter().map(|sm| sm.start).filter(move |start| *start > after);
        later.min().unwrap_or(MEMORY_END)
    };
    (0..=u8::MAX)
        .zip(&image.sync_managers)
        .filter_map(|(number, sm)| {
            let buffers = if sm.control & 3 == 0 { 3 } else { 1 };
            let room = starts(sm.start).max(sm.start) - sm.start;
            Some(ProcessSyncManager {
                number,
                direction: direction(sm)?,
                start: sm.start,
                control: sm.control,
                max_bytes: (room / buffers).max(sm.length),
                listed_bytes: if sm.enable & sii::SM_ENABLE != 0 { sm.length } else { 0 },
                activation: match (sm.enable & sii::SM_VIRTUAL, sm.enable & sii::SM_OP_ONLY) {
                    (0, 0) => SmActivation::SafeOp,
                    (0, _) => SmActivation::OpOnly,
                    _ => SmActivation::Virtual,
                },
            })
        })
        .collect()
}

fn synchronization(image: &Image) -> Synchronization {
    let with_sync0 = image.dc_modes.iter().any(|mode| mode.assign_activate & 0x0100 != 0);
    let dc = if with_sync0 { Synchronization::SYNC0 | Synchronization::SYNC1 } else { 0 };
    Synchronization {
        supported: Synchronization::FREE_RUN | Synchronization::SYNC_MANAGER | dc,
        cycle_step_ns: 1,
        shortest_cycle_ns: 50_000,
        longest_cycle_ns: u32::MAX,
        monitoring: SyncMonitoring::Op,
    }
}

/// Register 0x0007 from the general category's ports; four MII ports where it doesn't say.
fn port_descriptor(image: &Image) -> u8 {
    let ports = image.general.as_ref().map_or(0, |general| general.physical_ports);
    if ports == 0 {
        return 0xFF;
    }
    (0..4).fold(0, |descriptor, port| {
        let kind = match ports >> (4 * port) & 0xF {
            0 => 0,
            3 => 2,
            _ => 3,
        };
        descriptor | kind << (2 * port)
    })
}

fn objects(
    image: &Image,
    piece: &Piece,
    process_data: &[ProcessSyncManager],
    device_type: u32,
) -> Vec<Object> {
    let mut identity = image.header.identity;
    if piece.serial != 0 {
        identity.serial = piece.serial;
    }
    let mut objects = standard::nameplate_objects(&Nameplate {
        device_type,
        name: image.name().unwrap_or_default(),
        hardware_version: String::new(),
        software_version: String::new(),
        identity,
    });
    let types: Vec<u8> = image.sync_managers.iter().map(|sm| sm.usage.code()).collect();
    objects.push(standard::sync_manager_types(&types));
    let pdos = || image.rx_pdos.iter().chain(&image.tx_pdos);
    let details = image.general.as_ref().map_or(0, |general| general.coe_details);
    let can_configure = details & sii::COE_PDO_CONFIGURATION != 0;
    for pdo in pdos() {
        let is_open = can_configure && pdo.flags & sii::PDO_FIXED == 0;
        let mapping = if is_open { Mapping::Configurable } else { Mapping::Fixed };
        objects.push(standard::mapping(&map(image, pdo), mapping));
    }
    for sm in process_data {
        let assigned: Vec<u16> = pdos()
            .filter(|pdo| {
                pdo.sync_manager == Some(sm.number) && Direction::of_pdo(pdo.index) == Some(sm.direction)
            })
            .map(|pdo| pdo.index)
            .collect();
        objects.push(standard::assignment(sm.number, &assigned, Mapping::Configurable));
    }
    let Synchronization { supported, shortest_cycle_ns, .. } = synchronization(image);
    for index in [0x1C32, 0x1C33] {
        objects.push(standard::sync_parameter(index, 1, supported, shortest_cycle_ns));
    }
    objects.extend(process_objects(image));
    objects
}

fn map(image: &Image, pdo: &Pdo) -> PdoMap {
    PdoMap {
        index: pdo.index,
        name: image.string(pdo.name).unwrap_or_default(),
        entries: pdo.entries.iter().map(|entry| (entry.object, entry.bit_length)).collect(),
    }
}

/// Every mapped object once, in the order of the PDOs.
fn mapped_objects(image: &Image, direction: Direction) -> Vec<ObjectAddress> {
    let pdos = match direction {
        Direction::Outputs => &image.rx_pdos,
        Direction::Inputs => &image.tx_pdos,
    };
    let mut objects: Vec<ObjectAddress> = Vec::new();
    for entry in pdos.iter().flat_map(|pdo| &pdo.entries) {
        if entry.object.index > 0x1F && !objects.contains(&entry.object) {
            objects.push(entry.object);
        }
    }
    objects
}

/// The objects that the PDOs map, as the PDOs describe them.
fn process_objects(image: &Image) -> Vec<Object> {
    let mut entries: Vec<(u16, Entry)> = Vec::new();
    for (pdos, access) in [
        (&image.rx_pdos, Access::READ_WRITE | Access::RX_PDO),
        (&image.tx_pdos, Access::READ | Access::TX_PDO),
    ] {
        for mapped in pdos.iter().flat_map(|pdo| &pdo.entries).filter(|mapped| mapped.object.index > 0x1F) {
            let known = entries.iter_mut().find(|(index, entry)| {
                (*index, entry.subindex) == (mapped.object.index, mapped.object.subindex)
            });
            if let Some((_, entry)) = known {
                entry.access = entry.access | access;
                continue;
            }
            let name = image.string(mapped.name).unwrap_or_default();
            let data_type = data_type(mapped.data_type, mapped.bit_length);
            let entry = Entry::bits(mapped.object.subindex, name, data_type, u16::from(mapped.bit_length));
            entries.push((mapped.object.index, entry.with_access(access)));
        }
    }
    entries.sort_by_key(|(index, entry)| (*index, entry.subindex));
    entries
        .chunk_by(|one, other| one.0 == other.0)
        .map(|object| {
            let (index, first) = &object[0];
            if object.len() == 1 && first.subindex == 0 {
                return Object::variable(*index, first.clone());
            }
            let name = format!("Object 0x{index:04X}");
            let entries = object.iter().map(|(_, entry)| entry.clone()).collect();
            Object::record(*index, name, DataType::RECORD, entries)
        })
        .collect()
}

/// The image's type where it fits the length; strings and unknown types become plain bytes.
fn data_type(code: u8, bit_length: u8) -> DataType {
    let data_type = DataType(u16::from(code));
    if data_type.has_variable_length() || code == 0 {
        return match bit_length {
            1 => DataType::BOOLEAN,
            2..=7 => DataType(0x2F + u16::from(bit_length)),
            16 => DataType::UNSIGNED16,
            32 => DataType::UNSIGNED32,
            64 => DataType::UNSIGNED64,
            _ => DataType::UNSIGNED8,
        };
    }
    data_type
}

/// Process data at the terminals.
struct Terminals {
    panel: IoPanel,
    /// Offset and bytes of each input and output in the arena, in the panel's order.
    inputs: Vec<(usize, usize)>,
    outputs: Vec<(usize, usize)>,
    /// Idents of the modules in its slots.
    modules: Vec<u32>,
}

impl Terminals {
    fn new(dictionary: &Dictionary, panel: IoPanel) -> Self {
        let place = |object| {
            let bytes = |entry: &Entry| (entry.offset(), entry.capacity().min(MOST_BYTES));
            dictionary.entry(object).map_or((0, 0), bytes)
        };
        let inputs = panel.inputs().map(place).collect();
        // What is shown of an output is a number.
        let outputs = panel.outputs().map(place).map(|(offset, bytes)| (offset, bytes.min(8))).collect();
        Terminals { panel, inputs, outputs, modules: Vec::new() }
    }

    fn show_outputs(&self, dictionary: &Dictionary, outputs: Outputs) {
        for (position, (offset, bytes)) in self.outputs.iter().enumerate() {
            let value = match outputs {
                Outputs::Safe => 0,
                _ => little_endian(&dictionary.arena()[*offset..*offset + *bytes]),
            };
            self.panel.set_output_at(position, value);
        }
    }
}

impl Device for Terminals {
    /// Other modules than stand in the slots are refused, as couplers do.
    fn check_write(&self, _: &Dictionary, object: ObjectAddress, data: &[u8]) -> Result<(), AbortCode> {
        if object.index != CONFIGURED_MODULES || self.modules.is_empty() {
            return Ok(());
        }
        let fits = match object.subindex {
            0 => little_endian(data) == 0 || little_endian(data) == self.modules.len() as u64,
            slot => {
                let module = self.modules.get(usize::from(slot) - 1);
                module.is_some_and(|ident| u64::from(*ident) == little_endian(data))
            }
        };
        if fits { Ok(()) } else { Err(AbortCode::VALUE_RANGE) }
    }

    fn power_on(&mut self, dictionary: &mut Dictionary, _: HostTime) {
        self.show_outputs(dictionary, Outputs::Safe);
    }

    fn run(&mut self, dictionary: &mut Dictionary, moment: Moment) {
        self.panel.measure(moment.now);
        for (position, (offset, bytes)) in self.inputs.iter().enumerate() {
            let value = self.panel.input_at(position);
            dictionary.arena_mut()[*offset..*offset + *bytes].copy_from_slice(&value[..*bytes]);
        }
        self.show_outputs(dictionary, moment.outputs);
    }
}
