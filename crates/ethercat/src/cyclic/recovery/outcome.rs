//! How a way back ends.

use core::time::Duration;

use crate::eeprom::EepromError;
use crate::start_up::StartUpError;
use crate::wire::{AlStatusCode, spoken};

/// Why a SubDevice could not be brought back.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RecoveryError {
    /// Nobody answers at its place.
    #[error("nobody answers at position {position} after {}", spoken(*.after))]
    NotThere {
        /// Position.
        position: u16,
        /// How long it was looked for.
        after: Duration,
    },
    /// Others answer at its station address, too: whatever is written there reaches them.
    #[error("{answered} SubDevices answer at the address of SubDevice {position}")]
    NotAlone {
        /// Position.
        position: u16,
        /// SubDevices that answered.
        answered: u16,
    },
    /// Another SubDevice stands at its place.
    #[error("at position {position} stands station 0x{found:04x}, 0x{expected:04x} was expected")]
    OtherStation {
        /// Position.
        position: u16,
        /// Station address that it should have, or none.
        expected: u16,
        /// Station address that it has.
        found: u16,
    },
    /// More SubDevices answer than were set up: whose position is whose isn't certain.
    #[error(
        "{found} SubDevices answer, {expected} were set up: who stands at position {position} isn't certain"
    )]
    Crowded {
        /// Position.
        position: u16,
        /// SubDevices that were set up.
        expected: u16,
        /// SubDevices that answer.
        found: u16,
    },
    /// It is known by its alias, and at its place stands one with another: swapped with another, or replaced.
    #[error("at position {position} is alias 0x{found:04x}, 0x{expected:04x} was there")]
    OtherAlias {
        /// Position.
        position: u16,
        /// Alias (0x0012) that was there at first.
        expected: u16,
        /// Alias now.
        found: u16,
    },
    /// It is in OP with an error that doesn't let itself be acknowledged.
    #[error("SubDevice {position} is in OP with error {code}, acknowledged in vain")]
    InError {
        /// Position.
        position: u16,
        /// AL status code (0x0134).
        code: AlStatusCode,
    },
    /// It is another product.
    #[error(
        "at position {position} is vendor 0x{:08x} product 0x{:08x}, vendor 0x{:08x} product 0x{:08x} was there",
        .found.0, .found.1, .expected.0, .expected.1
    )]
    OtherProduct {
        /// Position.
        position: u16,
        /// Vendor and product that were there at first.
        expected: (u32, u32),
        /// Vendor and product now.
        found: (u32, u32),
    },
    /// It is the same product in another revision: its start-up was made for the one that was there.
    #[error("at position {position} is revision 0x{found:08x}, 0x{expected:08x} was there")]
    OtherRevision {
        /// Position.
        position: u16,
        /// Revision that was there at first.
        expected: u32,
        /// Revision now.
        found: u32,
    },
    /// It is the same product, but another piece: swapped with another, or replaced.
    #[error("at position {position} is the piece with serial number {found}, {expected} was there")]
    OtherPiece {
        /// Position.
        position: u16,
        /// Serial number that was there at first.
        expected: u32,
        /// Serial number now.
        found: u32,
    },
    /// Its EEPROM can't be read.
    #[error(transparent)]
    Eeprom(#[from] EepromError),
    /// A step of its start-up list failed.
    #[error(transparent)]
    StartUp(#[from] StartUpError),
    /// Its clock did not come near enough to the reference.
    #[error("the clock of SubDevice {position} is {difference_ns} ns from the reference after {}", spoken(*.after))]
    NotLocked {
        /// Position.
        position: u16,
        /// Register 0x092C.
        difference_ns: i32,
        /// How long it was tried.
        after: Duration,
    },
}

/// How a SubDevice was found that is in OP again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Comeback {
    /// It was in OP all the time, without an error: nothing was written to it.
    Stayed,
    /// It still had its station address: it had power all the time, and what it counted goes on.
    KeptPower,
    /// It had to be given its address: it started anew, and so did what it counts.
    Restarted,
}
