//! What an ESI file says of devices and modules, in the standard's words (ETG.2000).

use omnibase_ethercat_wire::coe::ObjectAddress;

use crate::names::Names;
use crate::notes::FileNote;

pub use crate::dictionary::{ObjectRights, OdEntry, OdObject, OdShape};

/// Who made the devices.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Vendor {
    /// Number given by the ETG; `None` where the file gives none that can be read.
    pub id: Option<u32>,
    /// Name.
    pub name: Names,
}

/// A device.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Device {
    /// Line of its element, from 1.
    pub line: u32,
    /// Short name, as on its label.
    pub type_name: String,
    /// Product code.
    pub product_code: Option<u32>,
    /// Revision.
    pub revision: Option<u32>,
    /// Names in languages.
    pub names: Names,
    /// Revisions that this one replaces, as (product code where another, revision).
    pub hides: Vec<(Option<u32>, u32)>,
    /// Group's name in the file.
    pub group: String,
    /// A letter for each port: `Y` MII, `K` LVDS (EBUS), `H` MII fast hot connect, a blank none.
    pub ports: String,
    /// Current drawn from the EBUS, mA; negative feeds.
    pub ebus_current_ma: Option<i32>,
    /// Register at which the device shows a number set by a switch (explicit identification).
    pub identification_address: Option<u16>,
    /// It shows such a number in the AL status code (0x0134) where it is asked for.
    pub identifies_by_al_status: bool,
    /// It takes LRD and LWR, no LRW (`UseLrdLwr`).
    pub refuses_lrw: bool,
    /// The group of slots' PDOs in which its own stand.
    pub pdo_group: usize,
    /// How long states and mailboxes may take.
    pub timeouts: Timeouts,
    /// The device goes to SAFE-OP without a SYNC event.
    pub start_to_safeop_no_sync: bool,
    /// Profile numbers, as 402 (drives) or 5001 (modular).
    pub profiles: Vec<u32>,
    /// The object dictionary, where the file has it.
    pub dictionary: Vec<OdObject>,
    /// What each FMMU is for.
    pub fmmus: Vec<FmmuUse>,
    /// SyncManagers.
    pub sync_managers: Vec<SyncManager>,
    /// PDOs to the device, outputs of the MainDevice.
    pub rx_pdos: Vec<Pdo>,
    /// PDOs from the device, inputs of the MainDevice.
    pub tx_pdos: Vec<Pdo>,
    /// Mailbox.
    pub mailbox: Option<Mailbox>,
    /// Modes of synchronisation.
    pub dc_modes: Vec<DcMode>,
    /// Slots for modules.
    pub slots: Option<Slots>,
    /// Registers that the file wants written.
    pub registers: Vec<(u16, u32)>,
    /// EEPROM.
    pub eeprom: Option<Eeprom>,
    /// What of it can't be read or contradicts itself.
    pub problems: Vec<FileNote>,
}

/// Times, ms; `None` where the file gives none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Timeouts {
    /// INIT to PRE-OP.
    pub pre_op_ms: Option<u32>,
    /// To SAFE-OP and to OP.
    pub safe_op_op_ms: Option<u32>,
    /// Back to INIT.
    pub back_to_init_ms: Option<u32>,
    /// OP back to SAFE-OP.
    pub back_to_safe_op_ms: Option<u32>,
    /// Until a mailbox takes a request.
    pub request_ms: Option<u32>,
    /// Until a mailbox answers.
    pub response_ms: Option<u32>,
}

/// What an FMMU is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FmmuUse {
    /// Outputs.
    Outputs,
    /// Inputs.
    Inputs,
    /// State of the mailbox.
    MailboxState,
    /// Something that is not known here.
    Other,
}

/// What a SyncManager is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SmUse {
    /// Mailbox from the MainDevice.
    MailboxOut,
    /// Mailbox to the MainDevice.
    MailboxIn,
    /// Process data from the MainDevice.
    Outputs,
    /// Process data to the MainDevice.
    Inputs,
    /// Nothing that is known here.
    Unused,
}

/// A SyncManager.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SyncManager {
    /// Where its area starts; `None`, here and below, where the number can't be read.
    pub start: Option<u16>,
    /// Its length without other wish, bytes.
    pub default_size: Option<u16>,
    /// Control byte.
    pub control: Option<u8>,
    /// What it is for.
    pub usage: SmUse,
    /// It is to be enabled.
    pub enabled: bool,
    /// It stands for an area without a SyncManager: it is never switched on.
    pub is_virtual: bool,
    /// It is switched on for OP alone.
    pub op_only: bool,
}

/// A process data object.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Pdo {
    /// Line of its element, from 1.
    pub line: u32,
    /// Index.
    pub index: SlotIndex,
    /// Name.
    pub name: Names,
    /// SyncManager to which it is assigned by default.
    pub sync_manager: Option<u8>,
    /// Its entries can't be changed.
    pub fixed: bool,
    /// It must be assigned.
    pub mandatory: bool,
    /// It carries what the device itself makes of it, without objects.
    pub is_virtual: bool,
    /// PDOs that mustn't be assigned together with it.
    pub excludes: Vec<SlotIndex>,
    /// What it maps, in order.
    pub entries: Vec<PdoEntry>,
}

/// An index that counts up with the slot of its module.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SlotIndex {
    /// Index in the first slot, or of the device.
    pub index: u16,
    /// It counts up with the slot.
    pub depends_on_slot: bool,
}

/// An entry of a PDO; index 0 is a gap.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PdoEntry {
    /// Object's index.
    pub index: SlotIndex,
    /// Object's subindex.
    pub subindex: u8,
    /// Bits, 0 to 255.
    pub bits: u8,
    /// Name.
    pub name: Names,
    /// Type by name, as `UINT`; empty where none is given.
    pub data_type: String,
    /// A number of it can't be read: it isn't known what stands there.
    pub is_unclear: bool,
}

impl PdoEntry {
    /// CoE's code of its type (ETG.1020); `None` where it isn't a base type.
    pub fn type_code(&self) -> Option<u16> {
        crate::dictionary::type_code(&self.data_type)
    }
}

/// A mailbox.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Mailbox {
    /// CANopen over EtherCAT.
    pub coe: Option<Coe>,
    /// Ethernet over EtherCAT.
    pub eoe: bool,
    /// File access.
    pub foe: bool,
    /// Servo drive profile.
    pub soe: bool,
    /// ADS.
    pub aoe: bool,
    /// The maker's own.
    pub voe: bool,
    /// Data link layer: messages lost on the wire are asked for again.
    pub data_link_layer: bool,
    /// Commands of EoE and SoE, which nothing here can send: how many.
    pub foreign_commands: u32,
}

/// What CoE can.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Coe {
    /// SDO Information.
    pub sdo_info: bool,
    /// Which PDOs are assigned can be written (0x1C12, 0x1C13).
    pub pdo_assign: bool,
    /// What PDOs map can be written.
    pub pdo_config: bool,
    /// The map is to be read at the start.
    pub pdo_upload: bool,
    /// Whole objects at once.
    pub complete_access: bool,
    /// SDOs in segments.
    pub segmented: bool,
    /// A history of diagnosis messages (0x10F3).
    pub diagnosis_history: bool,
    /// Commands, in order.
    pub commands: Vec<InitCommand>,
}

/// An SDO that the maker wants written at the start.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InitCommand {
    /// Line of its element, from 1.
    pub line: u32,
    /// Changes of state at which it is sent, as `PS`: the letters are I, P, S, O, B.
    pub transitions: Vec<String>,
    /// Object's index.
    pub index: SlotIndex,
    /// Object's subindex.
    pub subindex: u8,
    /// Bytes as they are sent.
    pub data: Vec<u8>,
    /// The whole object at once.
    pub complete_access: bool,
    /// What the maker says to it.
    pub comment: String,
}

/// A mode of synchronisation.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DcMode {
    /// Name.
    pub name: String,
    /// Description.
    pub description: Names,
    /// Value of the registers 0x0980 and 0x0981.
    pub assign_activate: u16,
    /// SYNC0.
    pub sync0: SyncTimes,
    /// SYNC1.
    pub sync1: SyncTimes,
    /// A number of it can't be read.
    pub is_unclear: bool,
}

/// Times of a SYNC event.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SyncTimes {
    /// Cycle, ns; 0 takes the factor.
    pub cycle_ns: i64,
    /// Cycle as a multiple of the bus cycle (SYNC0) or of SYNC0's (SYNC1); negative divides.
    pub factor: Option<i32>,
    /// Shift, ns.
    pub shift_ns: i64,
}

/// EEPROM.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Eeprom {
    /// Size, bytes.
    pub byte_size: u32,
    /// The first words: PDI control and configuration.
    pub config_data: Vec<u8>,
    /// Mailboxes in BOOT: offset and size of both, 16 bits each.
    pub bootstrap: Vec<u8>,
}

/// Where modules go.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Slots {
    /// The list of modules that are configured is written to 0xF030.
    pub download_idents: bool,
    /// The list of the modules' addresses is written to 0xF020.
    pub download_addresses: bool,
    /// How many objects apart the indices of neighbours are; `None`, here and below, where the number can't be read.
    pub index_increment: Option<u16>,
    /// How many PDOs apart.
    pub pdo_increment: Option<u16>,
    /// Slots, each with how many times and for which modules.
    pub slots: Vec<Slot>,
    /// Groups in which the modules' PDOs stand.
    pub groups: Vec<PdoGroup>,
    /// Modules that stand in the device's own file.
    pub modules: Vec<Module>,
}

/// A kind of slot.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Slot {
    /// Name.
    pub name: Names,
    /// Least modules; `None`, here and below, where the number can't be read.
    pub least: Option<u32>,
    /// Most modules.
    pub most: Option<u32>,
    /// Classes of modules that fit.
    pub classes: Vec<String>,
    /// Modules that fit, by ident.
    pub idents: Vec<u32>,
}

/// A group of PDOs of a modular device (`ModulePdoGroup`): groups stand in their order, in each the slots in theirs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PdoGroup {
    /// Bytes at whose multiples a module's data begin.
    pub alignment: u8,
    /// Its first RxPDO.
    pub rx_pdo: Option<u16>,
    /// Its first TxPDO.
    pub tx_pdo: Option<u16>,
}

/// A module for a slot.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Module {
    /// Line of its element, from 1.
    pub line: u32,
    /// Short name.
    pub type_name: String,
    /// What it says of itself in 0xF050, and what 0xF030 is told.
    pub ident: Option<u32>,
    /// Its class.
    pub class: String,
    /// The group in which its PDOs stand.
    pub pdo_group: usize,
    /// Names in languages.
    pub names: Names,
    /// PDOs to it.
    pub rx_pdos: Vec<Pdo>,
    /// PDOs from it.
    pub tx_pdos: Vec<Pdo>,
    /// Mailbox, where its commands stand.
    pub mailbox: Option<Mailbox>,
    /// Its part of the dictionary.
    pub dictionary: Vec<OdObject>,
    /// What of it can't be read or contradicts itself.
    pub problems: Vec<FileNote>,
}

/// What stands in a slot that stays empty.
static EMPTY_SLOT: Module = Module {
    line: 0,
    type_name: String::new(),
    ident: None,
    class: String::new(),
    pdo_group: 0,
    names: Names::NONE,
    rx_pdos: Vec::new(),
    tx_pdos: Vec::new(),
    mailbox: None,
    dictionary: Vec::new(),
    problems: Vec::new(),
};

impl Module {
    /// The module of a slot that stays empty: its name is empty, its ident 0.
    pub fn none() -> &'static Module {
        &EMPTY_SLOT
    }

    /// Whether it is no module.
    pub fn is_none(&self) -> bool {
        self.type_name.is_empty() && self.ident.is_none()
    }
}

impl Device {
    /// `product:revision` as it is asked for, a question mark for what the file doesn't say.
    pub fn numbers(&self) -> String {
        format!("{}:{}", number(self.product_code), number(self.revision))
    }
}

/// A number of 32 bits in hexadecimal; a question mark where the file has none that can be read.
pub fn number(number: Option<u32>) -> String {
    number.map_or("?".to_owned(), |number| format!("0x{number:08x}"))
}

impl Slots {
    /// Whether a number is missing that says where modules go.
    pub fn is_unclear(&self) -> bool {
        let counts = self.slots.iter().map(|slot| slot.most);
        counts
            .chain([self.index_increment.map(u32::from), self.pdo_increment.map(u32::from)])
            .any(|one| one.is_none())
    }
}

impl PdoEntry {
    /// Whether it fills space only.
    pub fn is_gap(&self) -> bool {
        self.index.index == 0
    }

    /// The object of a device that has no slots.
    pub fn object(&self) -> ObjectAddress {
        ObjectAddress::new(self.index.index, self.subindex)
    }
}

impl Pdo {
    /// Whether some of it can't be read: its map isn't known.
    pub fn is_unclear(&self) -> bool {
        self.entries.iter().any(|entry| entry.is_unclear)
    }

    /// Sum of its entries' bits.
    pub fn bits(&self) -> u32 {
        self.entries.iter().map(|entry| u32::from(entry.bits)).sum()
    }
}
