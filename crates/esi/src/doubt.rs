//! What somebody should look at before a device is used as its file says.

use std::fmt;

use crate::notes::FileNote;

/// What somebody should look at before the device is used as its file says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Doubt {
    /// Two PDOs that are assigned by default exclude each other: the second one is left out.
    Excluded {
        /// The one that stays.
        stays: u16,
        /// The one that is left out.
        left_out: u16,
    },
    /// A PDO that must be assigned has no SyncManager in the file.
    MandatoryWithoutSyncManager {
        /// The PDO.
        pdo: u16,
        /// The SyncManager that it gets.
        sync_manager: u8,
    },
    /// The device has PDOs and none of them is assigned by default.
    NoDefault {
        /// `RxPdo` or `TxPdo`.
        kind: &'static str,
        /// PDOs of which some may be chosen.
        count: usize,
    },
    /// A PDO is assigned to a SyncManager that isn't one of its direction.
    WrongSyncManager {
        /// The PDO.
        pdo: u16,
        /// The SyncManager.
        sync_manager: u8,
    },
    /// A PDO of an index that another one has, too: the second one is left out.
    SamePdo {
        /// The PDO.
        pdo: u16,
        /// Line of the one that is left out.
        line: u32,
    },
    /// A PDO's index isn't of those that a SubDevice maps (ETG.1000.6).
    OddPdoIndex {
        /// Line of the PDO.
        line: u32,
        /// `RxPdo` or `TxPdo`.
        kind: &'static str,
        /// Its index.
        index: u16,
        /// The first index of its direction, and the last.
        first: u16,
        /// Likewise.
        last: u16,
    },
    /// Modules in two slots have a PDO or an object in common.
    SameIndices {
        /// Slots, from 1.
        slots: [usize; 2],
        /// The PDO or the object that is mapped.
        index: u16,
    },
    /// Something of the device or a module can't be read or contradicts itself.
    Unread(FileNote),
    /// An entry of a PDO has more or fewer bits than its type.
    OtherType {
        /// Line of the PDO.
        line: u32,
        /// Object that is mapped.
        index: u16,
        /// Bits of the entry.
        bits: u8,
        /// The type.
        data_type: String,
    },
    /// A command without data.
    NoData {
        /// Line of the command.
        line: u32,
        /// Object.
        index: u16,
    },
    /// A command that writes a whole object at once, but for its beginning.
    CompleteAccess {
        /// Line of the command.
        line: u32,
        /// Object.
        index: u16,
        /// From where on.
        subindex: u8,
    },
    /// What belongs into the EEPROM is longer than the file says that it is.
    EepromTooSmall {
        /// Bytes by the file.
        says: u32,
        /// Bytes of the content.
        needs: usize,
    },
    /// The mailbox or process data of a SyncManager take more memory than there is before the next one's.
    NoRoom {
        /// The SyncManager.
        sync_manager: u8,
        /// Whether it is a mailbox.
        is_mailbox: bool,
        /// Its bytes.
        bytes: u32,
        /// How often the chip keeps them.
        buffers: u32,
        /// Where they begin, and where the next area does.
        start: u16,
        /// Likewise.
        next: u16,
    },
    /// The modules' addresses (0xF020) are to be written, which are in no maker's file.
    ModuleAddresses,
    /// Fewer modules than a kind of slots asks for.
    TooFewModules {
        /// The kind's first slot, from 1, and its last.
        first: usize,
        /// Likewise.
        last: usize,
        /// So many are to be there.
        least: usize,
        /// So many are.
        found: usize,
    },
    /// Data of modules that begin at multiples of so many bytes.
    Alignment {
        /// The group of PDOs, from 0.
        group: usize,
        /// The bytes.
        bytes: u8,
    },
    /// SyncManagers for mailboxes that aren't one each way.
    Mailboxes {
        /// To the device.
        to: usize,
        /// From it.
        from: usize,
    },
    /// Commands of protocols that aren't spoken here.
    ForeignCommands {
        /// How many.
        count: u32,
    },
    /// A command has more bytes than the file's own dictionary gives its object.
    LongerThanItsObject {
        /// Line of the command.
        line: u32,
        /// Object.
        index: u16,
        /// Bytes of the command.
        bytes: usize,
        /// Bytes of the object's type.
        given: usize,
    },
    /// A command that is sent at another change of state than ours are sent at.
    OtherTransition {
        /// Line of the command.
        line: u32,
        /// Its changes of state.
        transitions: String,
    },
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Doubt::Excluded { stays, left_out } => write!(
                f,
                "0x{stays:04X} and 0x{left_out:04X} exclude each other and both are assigned by default: 0x{left_out:04X} is left out"
            ),
            Doubt::MandatoryWithoutSyncManager { pdo, sync_manager } => write!(
                f,
                "0x{pdo:04X} is mandatory and the file assigns it to no SyncManager: SyncManager {sync_manager} is taken, the first of its direction"
            ),
            Doubt::NoDefault { kind, count } => {
                write!(f, "none of its {count} {kind}s is assigned by default: choose which you need")
            }
            Doubt::WrongSyncManager { pdo, sync_manager } => {
                write!(
                    f,
                    "0x{pdo:04X} is assigned to SyncManager {sync_manager}, which the file doesn't have for its direction"
                )
            }
            Doubt::SamePdo { pdo, line } => {
                write!(f, "0x{pdo:04X} stands there twice: the one of line {line} is left out")
            }
            Doubt::OddPdoIndex { line, kind, index, first, last } => write!(
                f,
                "the {kind} of line {line} is 0x{index:04X}, where those of its direction are 0x{first:04X} to 0x{last:04X}: a robot's \
                 file takes no other"
            ),
            Doubt::SameIndices { slots: [one, other], index } => write!(
                f,
                "the modules in slots {one} and {other} both have 0x{index:04X}: the file doesn't tell them apart"
            ),
            Doubt::Unread(problem) => write!(f, "{problem}"),
            Doubt::OtherType { line, index, bits, data_type } => write!(
                f,
                "the PDO of line {line} has 0x{index:04X} with {bits} bits, and says that it is of the type {data_type}: the bits are taken"
            ),
            Doubt::NoData { line, index } => {
                write!(f, "the command of line {line} to 0x{index:04X} has no data: it isn't sent")
            }
            Doubt::CompleteAccess { line, index, subindex } => write!(
                f,
                "the command of line {line} writes 0x{index:04X} at once from subindex {subindex} on (complete access), which begins at 0 or 1: it isn't sent; write its entries one by one where the device takes them so"
            ),
            Doubt::EepromTooSmall { says, needs } => write!(
                f,
                "its file says that the EEPROM has {says} bytes, and what belongs into it takes {needs}: it doesn't fit"
            ),
            Doubt::NoRoom { sync_manager, is_mailbox: true, bytes, start, next, .. } => write!(
                f,
                "the mailbox of SyncManager {sync_manager} has {bytes} bytes from 0x{start:04X} on, but the area of another begins at 0x{next:04X}: the device will refuse that; look for a newer file of its maker"
            ),
            Doubt::NoRoom { sync_manager, is_mailbox: false, bytes, buffers, start, next } => write!(
                f,
                "SyncManager {sync_manager} has {bytes} bytes and keeps them {buffers} times from 0x{start:04X} on, but the area of another begins at 0x{next:04X}: the device will refuse that; take fewer modules or PDOs"
            ),
            Doubt::ModuleAddresses => f.write_str(
                "the list of its modules' addresses (0xF020) is to be written at a start (DownloadModuleAddressList): add it to its `parameters`",
            ),
            Doubt::TooFewModules { first, last, least, found } => write!(
                f,
                "slots {first} to {last} are to have at least {least} modules, {found} are given: the device may stay out of OP; name \
                 them with --slot"
            ),
            Doubt::Alignment { group, bytes } => write!(
                f,
                "data of the modules of group {group} begin at multiples of {bytes} bytes (ModulePdoGroup), which isn't done here: \
                 compare the lengths with those that the device asks for"
            ),
            Doubt::Mailboxes { to, from } => write!(
                f,
                "{to} SyncManagers are for mailboxes to the device and {from} for those from it: a device with a mailbox has one of each"
            ),
            Doubt::ForeignCommands { count } => {
                write!(f, "{count} commands of EoE or SoE aren't sent: these protocols aren't spoken here")
            }
            Doubt::LongerThanItsObject { line, index, bytes, given } => write!(
                f,
                "the command of line {line} writes {bytes} bytes to 0x{index:04X}, for which the file's dictionary has {given}: a device may refuse it"
            ),
            Doubt::OtherTransition { line, transitions } => write!(
                f,
                "the command of line {line} is for {transitions}: there it isn't sent, for commands are sent on the way up, in PRE-OP (IP, PS) and SAFE-OP (SO), and on the way down nothing waits for a mailbox"
            ),
        }
    }
}
