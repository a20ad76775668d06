//! The SII: a device's EEPROM image (ETG.2010), read without loss and written.
//!
//! [`Image::parse`] keeps what it can read of a damaged image and names the rest as [`SiiDefect`]s.

mod read;
mod write;

use crate::coe::ObjectAddress;
use crate::printable::printable;
use alloc::string::String;
use alloc::vec::Vec;

/// Bytes before the first category.
pub const HEADER: usize = 0x80;
/// Category: strings.
pub const CATEGORY_STRINGS: u16 = 10;
/// Category: data types.
pub const CATEGORY_DATA_TYPES: u16 = 20;
/// Category: general.
pub const CATEGORY_GENERAL: u16 = 30;
/// Category: FMMU usage.
pub const CATEGORY_FMMU: u16 = 40;
/// Category: SyncManagers.
pub const CATEGORY_SYNC_MANAGERS: u16 = 41;
/// Category: TxPDOs (inputs of the MainDevice).
pub const CATEGORY_TX_PDO: u16 = 50;
/// Category: RxPDOs (outputs of the MainDevice).
pub const CATEGORY_RX_PDO: u16 = 51;
/// Category: distributed clocks.
pub const CATEGORY_DC: u16 = 60;
/// End of the categories.
pub const CATEGORY_END: u16 = 0xFFFF;

/// Bit of [`Header::mailbox_protocols`] and of nothing else: ADS over EtherCAT.
pub const PROTOCOL_AOE: u16 = 1 << 0;
/// Ethernet over EtherCAT.
pub const PROTOCOL_EOE: u16 = 1 << 1;
/// CANopen over EtherCAT.
pub const PROTOCOL_COE: u16 = 1 << 2;
/// File access over EtherCAT.
pub const PROTOCOL_FOE: u16 = 1 << 3;
/// Servo drive profile over EtherCAT.
pub const PROTOCOL_SOE: u16 = 1 << 4;
/// Vendor specific.
pub const PROTOCOL_VOE: u16 = 1 << 5;

/// [`General::coe_details`]: SDO.
pub const COE_SDO: u8 = 1 << 0;
/// [`General::coe_details`]: SDO Information.
pub const COE_SDO_INFO: u8 = 1 << 1;
/// [`General::coe_details`]: PDO assignment (0x1C12, 0x1C13) can be written.
pub const COE_PDO_ASSIGN: u8 = 1 << 2;
/// [`General::coe_details`]: PDO mapping (0x16xx, 0x1Axx) can be written.
pub const COE_PDO_CONFIGURATION: u8 = 1 << 3;
/// [`General::coe_details`]: PDO upload at start.
pub const COE_PDO_UPLOAD: u8 = 1 << 4;
/// [`General::coe_details`]: complete access.
pub const COE_COMPLETE_ACCESS: u8 = 1 << 5;

/// PDO flag: it must be assigned.
pub const PDO_MANDATORY: u16 = 1 << 0;
/// PDO flag: it is assigned by default.
pub const PDO_DEFAULT: u16 = 1 << 1;
/// PDO flag: its entries can't be changed.
pub const PDO_FIXED: u16 = 1 << 4;
/// PDO flag: it carries what the device itself makes of it.
pub const PDO_VIRTUAL: u16 = 1 << 5;
/// [`General::flags`]: start to SAFE-OP is allowed.
pub const FLAG_SAFE_OP: u8 = 1 << 0;
/// [`General::flags`]: LRW isn't supported.
pub const FLAG_NO_LRW: u8 = 1 << 1;
/// [`General::flags`]: mailbox data link layer.
pub const FLAG_MAILBOX_DLL: u8 = 1 << 2;
/// [`General::flags`]: identification by AL status code.
pub const FLAG_IDENT_AL_STATUS: u8 = 1 << 3;

/// [`General::flags`]: identification at [`General::identification_address`].
pub const FLAG_IDENT_MEMORY: u8 = 1 << 4;

/// [`SyncManager::enable`]: the SyncManager is to be enabled.
pub const SM_ENABLE: u8 = 1 << 0;
/// [`SyncManager::enable`]: there is no such SyncManager; its area is reached by FMMUs alone.
pub const SM_VIRTUAL: u8 = 1 << 2;
/// [`SyncManager::enable`]: it is enabled on the way from SAFE-OP to OP.
pub const SM_OP_ONLY: u8 = 1 << 3;

/// Who made the device, which one, which revision, which piece.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Identity {
    /// Vendor, given by the ETG.
    pub vendor_id: u32,
    /// Product code, given by the vendor.
    pub product_code: u32,
    /// Revision.
    pub revision: u32,
    /// Serial number; 0 where the vendor gives none.
    pub serial: u32,
}

/// Offsets and sizes of both mailboxes in the SubDevice's memory, bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MailboxArea {
    /// From the MainDevice: offset.
    pub receive_offset: u16,
    /// From the MainDevice: size.
    pub receive_size: u16,
    /// To the MainDevice: offset.
    pub send_offset: u16,
    /// To the MainDevice: size.
    pub send_size: u16,
}

/// The fixed part, words 0x00 to 0x3F. Words that the standard reserves are kept in `reserved`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Header {
    /// Initial value of registers 0x0140 and 0x0141.
    pub pdi_control: u16,
    /// Initial value of 0x0150 and 0x0151.
    pub pdi_configuration: u16,
    /// SYNC pulse length, units of 10 ns (0x0982).
    pub sync_pulse_length: u16,
    /// Initial value of 0x0152 and 0x0153.
    pub pdi_configuration_2: u16,
    /// Station alias.
    pub alias: u16,
    /// Word 7: checksum of words 0 to 6 in its low byte.
    pub checksum: u16,
    /// Identity.
    pub identity: Identity,
    /// Mailboxes in BOOT.
    pub bootstrap_mailbox: MailboxArea,
    /// Mailboxes otherwise.
    pub mailbox: MailboxArea,
    /// Word 0x1C: mailbox protocols, bits `PROTOCOL_*`.
    pub mailbox_protocols: u16,
    /// Word 0x3E: size of the EEPROM in KiBit, less one.
    pub size_kibit_less_one: u16,
    /// Word 0x3F: version of the layout, 1.
    pub version: u16,
    /// All 128 bytes as they were, so that words without a name survive.
    pub raw: [u8; HEADER],
}

/// Category 30.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct General {
    /// String index of the group; string indices count from 1, 0 is none.
    pub group: u8,
    /// String index of the image.
    pub image: u8,
    /// String index of the order number.
    pub order: u8,
    /// String index of the name.
    pub name: u8,
    /// Reserved.
    pub reserved: u8,
    /// Bits `COE_*`.
    pub coe_details: u8,
    /// FoE is there.
    pub foe_details: u8,
    /// EoE is there.
    pub eoe_details: u8,
    /// SoE channels, reserved by now.
    pub soe_channels: u8,
    /// DS402 channels, reserved by now.
    pub ds402_channels: u8,
    /// Sysman class, reserved by now.
    pub sysman_class: u8,
    /// Bits `FLAG_*`.
    pub flags: u8,
    /// Current drawn from the EBUS, mA; negative feeds.
    pub ebus_current_ma: i16,
    /// Group index once more (ETG.2010 pads here).
    pub group_again: u16,
    /// Four bits per port, port 0 lowest: 0 none, 1 MII, 2 reserved, 3 EBUS, 4 fast hot connect.
    pub physical_ports: u16,
    /// Register address at which the device shows its identification (0 none).
    pub identification_address: u16,
    /// What follows, reserved (twelve bytes in the standard's layout).
    pub rest: Vec<u8>,
}

/// What an FMMU is for (category 40).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FmmuUsage {
    /// Not used (0; 0xFF, which pads odd counts, is `Other`).
    Unused,
    /// Outputs.
    Outputs,
    /// Inputs.
    Inputs,
    /// Mailbox state.
    MailboxState,
    /// A code that the standard doesn't name.
    Other(u8),
}

/// What a SyncManager is for (category 41).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SyncManagerUsage {
    /// Not used or unknown.
    Unused,
    /// Mailbox from the MainDevice.
    MailboxOut,
    /// Mailbox to the MainDevice.
    MailboxIn,
    /// Process data from the MainDevice.
    Outputs,
    /// Process data to the MainDevice.
    Inputs,
    /// A code that the standard doesn't name.
    Other(u8),
}

/// A SyncManager as category 41 describes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SyncManager {
    /// Physical start address.
    pub start: u16,
    /// Length, bytes.
    pub length: u16,
    /// Control register (0x0804).
    pub control: u8,
    /// Status register; don't care.
    pub status: u8,
    /// Bit 0: enabled; bit 1: fixed content; bit 2: virtual; bit 3: enabled in OP only.
    pub enable: u8,
    /// What it is for.
    pub usage: SyncManagerUsage,
}

/// A PDO as categories 50 and 51 describe it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pdo {
    /// Index, 0x16xx or 0x1Axx.
    pub index: u16,
    /// The SyncManager it is assigned to by default; `None` (0xFF) where it isn't.
    pub sync_manager: Option<u8>,
    /// Synchronisation unit.
    pub synchronization: u8,
    /// String index of the name.
    pub name: u8,
    /// Flags.
    pub flags: u16,
    /// What it maps, in order.
    pub entries: Vec<PdoEntry>,
}

impl Pdo {
    /// Sum of the entries' lengths.
    pub fn bit_length(&self) -> u32 {
        self.entries.iter().map(|entry| u32::from(entry.bit_length)).sum()
    }
}

/// One mapped object. Index 0 is a gap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PdoEntry {
    /// The object.
    pub object: ObjectAddress,
    /// String index of the name.
    pub name: u8,
    /// CoE data type.
    pub data_type: u8,
    /// Length in bits.
    pub bit_length: u8,
    /// Flags.
    pub flags: u16,
}

/// A synchronisation mode as category 60 describes it: 24 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DcMode {
    /// SYNC0 cycle time, ns; 0 takes the MainDevice's cycle.
    pub sync0_cycle_ns: u32,
    /// SYNC0 shift, ns.
    pub sync0_shift_ns: u32,
    /// SYNC1 shift against SYNC0, ns.
    pub sync1_shift_ns: u32,
    /// SYNC1 cycle as a factor of SYNC0's; negative divides.
    pub sync1_cycle_factor: i16,
    /// Value for the activation register 0x0980 (16 bits, 0x0981 in the high byte).
    pub assign_activate: u16,
    /// SYNC0 cycle as a factor of the MainDevice's; negative divides.
    pub sync0_cycle_factor: i16,
    /// String index of the name.
    pub name: u8,
    /// String index of the description.
    pub description: u8,
    /// The rest, reserved.
    pub reserved: [u8; 4],
}

/// A category that this crate gives no meaning, kept as it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OtherCategory {
    /// Category type.
    pub kind: u16,
    /// Its bytes.
    pub data: Vec<u8>,
}

/// A whole SII image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// The fixed part.
    pub header: Header,
    /// Strings as their bytes; index 1 of the standard is element 0 here.
    pub strings: Vec<Vec<u8>>,
    /// Category 30.
    pub general: Option<General>,
    /// Category 40.
    pub fmmus: Vec<FmmuUsage>,
    /// Category 41.
    pub sync_managers: Vec<SyncManager>,
    /// Category 50: inputs of the MainDevice.
    pub tx_pdos: Vec<Pdo>,
    /// Category 51: outputs of the MainDevice.
    pub rx_pdos: Vec<Pdo>,
    /// Category 60.
    pub dc_modes: Vec<DcMode>,
    /// Categories without meaning here.
    pub other: Vec<OtherCategory>,
}

impl Default for Header {
    /// Zeros, layout version 1, an EEPROM of 2 KiB.
    fn default() -> Self {
        Header {
            pdi_control: 0,
            pdi_configuration: 0,
            sync_pulse_length: 0,
            pdi_configuration_2: 0,
            alias: 0,
            checksum: 0,
            identity: Identity::default(),
            bootstrap_mailbox: MailboxArea::default(),
            mailbox: MailboxArea::default(),
            mailbox_protocols: 0,
            size_kibit_less_one: 15,
            version: 1,
            raw: [0; HEADER],
        }
    }
}

impl Default for Image {
    /// A default header and nothing else.
    fn default() -> Self {
        Image {
            header: Header::default(),
            strings: Vec::new(),
            general: None,
            fmmus: Vec::new(),
            sync_managers: Vec::new(),
            tx_pdos: Vec::new(),
            rx_pdos: Vec::new(),
            dc_modes: Vec::new(),
            other: Vec::new(),
        }
    }
}

impl Image {
    /// The string of a standard's index as [printable] text; `None` for index 0 or one that isn't there.
    pub fn string(&self, index: u8) -> Option<String> {
        let bytes = self.strings.get(usize::from(index).checked_sub(1)?)?;
        Some(printable(bytes))
    }

    /// The device's name from the general category.
    pub fn name(&self) -> Option<String> {
        self.string(self.general.as_ref()?.name)
    }
}

/// The image is too short to say anything.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("SII image of {found} bytes is shorter than its fixed part of 128")]
pub struct ImageTooShort {
    /// Bytes there.
    pub found: usize,
}

/// Something in an image that couldn't be read, and where; the rest was.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SiiDefect {
    /// Byte offset in the image.
    pub offset: usize,
    /// What is wrong, with expected and found.
    pub text: String,
}

impl core::fmt::Display for SiiDefect {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "byte 0x{:04x}: {}", self.offset, self.text)
    }
}

/// Checksum of words 0 to 6: CRC-8, polynomial x^8+x^2+x+1, start value 0xFF (ETG.2010).
pub fn checksum(first_words: &[u8; 14]) -> u8 {
    first_words.iter().fold(0xFF, |crc, byte| {
        (0..8).fold(crc ^ byte, |crc, _| if crc & 0x80 != 0 { (crc << 1) ^ 0x07 } else { crc << 1 })
    })
}

#[cfg(test)]
mod tests;
