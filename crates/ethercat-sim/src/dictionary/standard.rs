//! The objects of the communication profile (CiA 301, ETG.1000.6, ETG.1020).

use super::{Access, DataType, Entry, Object, pdo};
use omnibase_ethercat_wire::coe::ObjectAddress;
use omnibase_ethercat_wire::sii::Identity;

/// Most entries of a mapping object.
pub const MAPPING_ENTRIES: u8 = 32;
/// Most entries of an assignment object.
pub const ASSIGNMENT_ENTRIES: u8 = 8;

/// What 0x1000, 0x1008 to 0x100A and 0x1018 say.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Nameplate {
    /// 0x1000.
    pub device_type: u32,
    /// 0x1008.
    pub name: String,
    /// 0x1009.
    pub hardware_version: String,
    /// 0x100A.
    pub software_version: String,
    /// 0x1018.
    pub identity: Identity,
}

/// Subindex 1 of 0x1010: all parameters.
pub const STORE_PARAMETERS: ObjectAddress = ObjectAddress::new(0x1010, 1);
/// What must be written there, "save"; and what it then reads: it stores when it is told so (CiA 301).
pub const SAVE: [u8; 4] = *b"save";
const STORES_ON_COMMAND: u32 = 1;

/// 0x1010, by which a user has parameters kept.
pub fn store_parameters() -> Object {
    let all = Entry::unsigned32(1, "Store all parameters", STORES_ON_COMMAND).with_access(Access::READ_WRITE);
    Object::array(STORE_PARAMETERS.index, "Store parameters", vec![all])
}

/// Parameters kept, where that entry was written.
pub fn keep_parameters(dictionary: &mut super::Dictionary) {
    dictionary.keep();
    dictionary.store(STORE_PARAMETERS, &STORES_ON_COMMAND.to_le_bytes());
}

/// Whether the user may write an assignment or a mapping.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mapping {
    /// It is as it is.
    Fixed,
    /// It can be written in PRE-OP.
    Configurable,
}

impl Mapping {
    fn access(self) -> Access {
        match self {
            Mapping::Fixed => Access::READ,
            Mapping::Configurable => Access::READ_WRITE_PRE_OP,
        }
    }
}

/// A PDO: what it maps by default.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PdoMap {
    /// 0x16xx or 0x1Axx.
    pub index: u16,
    /// Name.
    pub name: String,
    /// Objects and their bits; object 0x0000 is a gap.
    pub entries: Vec<(ObjectAddress, u8)>,
}

/// Error register, names, versions, identity and error settings.
pub fn nameplate_objects(nameplate: &Nameplate) -> Vec<Object> {
    let Identity { vendor_id, product_code, revision, serial } = nameplate.identity;
    vec![
        Object::variable(0x1000, Entry::unsigned32(0, "Device type", nameplate.device_type)),
        Object::variable(
            0x1001,
            Entry::unsigned8(0, "Error register", 0).with_access(Access::READ | Access::TX_PDO),
        ),
        Object::variable(0x1008, Entry::text(0, "Device name", &nameplate.name)),
        Object::variable(0x1009, Entry::text(0, "Hardware version", &nameplate.hardware_version)),
        Object::variable(0x100A, Entry::text(0, "Software version", &nameplate.software_version)),
        Object::record(
            0x1018,
            "Identity",
            DataType::IDENTITY,
            vec![
                Entry::unsigned32(1, "Vendor ID", vendor_id),
                Entry::unsigned32(2, "Product code", product_code),
                Entry::unsigned32(3, "Revision", revision),
                Entry::unsigned32(4, "Serial number", serial),
            ],
        ),
        Object::record(
            0x10F1,
            "Error settings",
            DataType::RECORD,
            vec![
                Entry::unsigned32(1, "Local error reaction", 1).with_access(Access::READ_WRITE),
                Entry::unsigned16(2, "Sync error counter limit", 9).with_access(Access::READ_WRITE),
            ],
        ),
    ]
}

/// 0x1C00: what each SyncManager is for (1 and 2 mailbox, 3 outputs, 4 inputs, 0 unused).
pub fn sync_manager_types(types: &[u8]) -> Object {
    let entries = (1..=u8::MAX).zip(types).map(|(subindex, kind)| {
        Entry::unsigned8(subindex, format!("SyncManager {} type", subindex - 1), *kind)
    });
    Object::array(0x1C00, "SyncManager type", entries.collect())
}

/// The assignment object of a SyncManager.
pub fn assignment(sync_manager: u8, pdos: &[u16], mapping: Mapping) -> Object {
    let access = mapping.access();
    let room = match mapping {
        Mapping::Fixed => pdos.len().min(255) as u8,
        Mapping::Configurable => ASSIGNMENT_ENTRIES.max(pdos.len().min(255) as u8),
    };
    let mut entries =
        vec![Entry::unsigned8(0, "Number of assigned PDOs", pdos.len().min(255) as u8).with_access(access)];
    entries.extend((1..=room).map(|subindex| {
        let pdo = pdos.get(usize::from(subindex) - 1).copied().unwrap_or(0);
        Entry::unsigned16(subindex, format!("PDO {subindex}"), pdo).with_access(access)
    }));
    let name = format!("SyncManager {sync_manager} PDO assignment");
    Object::array(pdo::ASSIGNMENTS.start() + u16::from(sync_manager), name, entries)
}

/// The mapping object of a PDO.
pub fn mapping(map: &PdoMap, mapping: Mapping) -> Object {
    let access = mapping.access();
    let count = map.entries.len().min(255) as u8;
    let room = match mapping {
        Mapping::Fixed => count,
        Mapping::Configurable => MAPPING_ENTRIES.max(count),
    };
    let mut entries = vec![Entry::unsigned8(0, "Number of mapped objects", count).with_access(access)];
    entries.extend((1..=room).map(|subindex| {
        let mapped = map.entries.get(usize::from(subindex) - 1).map_or(0, |(object, bits)| {
            u32::from(object.index) << 16 | u32::from(object.subindex) << 8 | u32::from(*bits)
        });
        Entry::unsigned32(subindex, format!("Mapped object {subindex}"), mapped).with_access(access)
    }));
    Object::record(map.index, map.name.clone(), DataType::PDO_MAPPING, entries)
}

/// 0x1C32 or 0x1C33: how a SyncManager's process data are synchronised.
pub fn sync_parameter(index: u16, default_mode: u16, supported_modes: u16, minimum_cycle_ns: u32) -> Object {
    let settable = Access::READ_WRITE_PRE_OP;
    let name = if index == 0x1C32 { "Output SyncManager parameter" } else { "Input SyncManager parameter" };
    Object::record(
        index,
        name,
        DataType::SYNC_PARAMETER,
        vec![
            Entry::unsigned16(1, "Synchronization type", default_mode).with_access(settable),
            Entry::unsigned32(2, "Cycle time", 0).with_access(settable),
            Entry::unsigned32(3, "Shift time", 0).with_access(settable),
            Entry::unsigned16(4, "Synchronization types supported", supported_modes),
            Entry::unsigned32(5, "Minimum cycle time", minimum_cycle_ns),
            Entry::unsigned32(6, "Calc and copy time", 20_000),
            Entry::unsigned16(8, "Get cycle time", 0).with_access(Access::READ_WRITE),
            Entry::unsigned32(9, "Delay time", 0),
            Entry::unsigned32(10, "Sync0 cycle time", 0).with_access(settable),
            Entry::unsigned16(11, "SM event missed counter", 0),
            Entry::unsigned16(12, "Cycle exceeded counter", 0),
            Entry::bits(32, "Sync error", DataType::BOOLEAN, 1).with_access(Access::READ | Access::TX_PDO),
        ],
    )
}
