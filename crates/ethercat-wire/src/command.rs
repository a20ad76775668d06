//! Datagram commands and the addresses they carry (ETG.1000.4, table "Command").

use core::fmt;

/// What a datagram asks of the SubDevices that it passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u8)]
pub enum Command {
    /// No operation.
    Nop = 0,
    /// Auto-increment physical read.
    Aprd = 1,
    /// Auto-increment physical write.
    Apwr = 2,
    /// Auto-increment physical read and write.
    Aprw = 3,
    /// Configured address (station or alias) physical read.
    Fprd = 4,
    /// Configured address physical write.
    Fpwr = 5,
    /// Configured address physical read and write.
    Fprw = 6,
    /// Broadcast read: every SubDevice ORs its data in.
    Brd = 7,
    /// Broadcast write.
    Bwr = 8,
    /// Broadcast read and write.
    Brw = 9,
    /// Logical read through FMMUs.
    Lrd = 10,
    /// Logical write through FMMUs.
    Lwr = 11,
    /// Logical read and write through FMMUs.
    Lrw = 12,
    /// Auto-increment read by one SubDevice, written to all that follow.
    Armw = 13,
    /// Configured-address read by one SubDevice, written to all others.
    Frmw = 14,
}

impl Command {
    /// Every command, by rising code.
    pub const ALL: [Command; 15] = [
        Command::Nop,
        Command::Aprd,
        Command::Apwr,
        Command::Aprw,
        Command::Fprd,
        Command::Fpwr,
        Command::Fprw,
        Command::Brd,
        Command::Bwr,
        Command::Brw,
        Command::Lrd,
        Command::Lwr,
        Command::Lrw,
        Command::Armw,
        Command::Frmw,
    ];

    /// The command with this code; `None` for the codes that the standard leaves open.
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.get(usize::from(code)).copied()
    }

    /// The code as it stands in the datagram.
    pub fn code(self) -> u8 {
        self as u8
    }

    /// The standard's name, in capitals.
    pub fn name(self) -> &'static str {
        match self {
            Command::Nop => "NOP",
            Command::Aprd => "APRD",
            Command::Apwr => "APWR",
            Command::Aprw => "APRW",
            Command::Fprd => "FPRD",
            Command::Fpwr => "FPWR",
            Command::Fprw => "FPRW",
            Command::Brd => "BRD",
            Command::Bwr => "BWR",
            Command::Brw => "BRW",
            Command::Lrd => "LRD",
            Command::Lwr => "LWR",
            Command::Lrw => "LRW",
            Command::Armw => "ARMW",
            Command::Frmw => "FRMW",
        }
    }

    /// How the four address bytes of this command are to be read.
    pub fn address(self, raw: u32) -> Address {
        let (low, high) = (raw as u16, (raw >> 16) as u16);
        match self {
            Command::Aprd | Command::Apwr | Command::Aprw | Command::Armw => {
                Address::Position { position: low, register: high }
            }
            Command::Fprd | Command::Fpwr | Command::Fprw | Command::Frmw => {
                Address::Station { station: low, register: high }
            }
            Command::Nop | Command::Brd | Command::Bwr | Command::Brw => {
                Address::Broadcast { passed: low, register: high }
            }
            Command::Lrd | Command::Lwr | Command::Lrw => Address::Logical(raw),
        }
    }
}

impl fmt::Display for Command {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Whom a datagram addresses, and where in its memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Address {
    /// The auto-increment address (ADP): every SubDevice adds one, the one that sees zero answers.
    /// The SubDevice at position `n` is addressed by the two's complement `-n`.
    Position {
        /// ADP as it stands in the datagram.
        position: u16,
        /// ADO: the register or memory address.
        register: u16,
    },
    /// The configured station address, or the alias where it is enabled.
    Station {
        /// ADP: the station address.
        station: u16,
        /// ADO: the register or memory address.
        register: u16,
    },
    /// Every SubDevice; each adds one to `passed`.
    Broadcast {
        /// ADP: sent as 0, comes back as the number of SubDevices passed.
        passed: u16,
        /// ADO: the register or memory address.
        register: u16,
    },
    /// An address in the logical process image, translated by FMMUs.
    Logical(u32),
}

impl Address {
    /// The auto-increment address of the SubDevice at `position` (0 is the first).
    pub fn position(position: u16, register: u16) -> Self {
        Address::Position { position: 0u16.wrapping_sub(position), register }
    }

    /// A station address and a register.
    pub fn station(station: u16, register: u16) -> Self {
        Address::Station { station, register }
    }

    /// A register of every SubDevice.
    pub fn broadcast(register: u16) -> Self {
        Address::Broadcast { passed: 0, register }
    }

    /// The four bytes as they stand in the datagram, little endian.
    pub fn raw(self) -> u32 {
        let join = |low: u16, high: u16| u32::from(low) | u32::from(high) << 16;
        match self {
            Address::Position { position, register } => join(position, register),
            Address::Station { station, register } => join(station, register),
            Address::Broadcast { passed, register } => join(passed, register),
            Address::Logical(address) => address,
        }
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Address::Position { position, register } => {
                write!(f, "position {} register 0x{register:04x}", 0u16.wrapping_sub(*position))
            }
            Address::Station { station, register } => {
                write!(f, "station 0x{station:04x} register 0x{register:04x}")
            }
            Address::Broadcast { register, .. } => write!(f, "all, register 0x{register:04x}"),
            Address::Logical(address) => write!(f, "logical 0x{address:08x}"),
        }
    }
}
