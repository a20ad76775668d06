//! What comes back of an access to registers, and who is accessed.

use core::fmt;

use crate::wire::{Address, Command};

/// A SubDevice by both its names: the position for people, the station address for datagrams.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Target {
    /// Place in the order of frames.
    pub position: u16,
    /// Station address.
    pub station: u16,
}

/// What came back of an access.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Found {
    /// No frame.
    Nothing,
    /// A frame with this working counter.
    WorkingCounter(u16),
}

impl fmt::Display for Found {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Found::Nothing => f.write_str("the frame did not come back"),
            Found::WorkingCounter(found) => write!(f, "working counter {found}"),
        }
    }
}

impl Found {
    /// What came back against the working counter that was expected: a lost frame says nothing about a SubDevice.
    pub fn against(self, expected: u16) -> Unexpected {
        Unexpected { found: self, expected }
    }
}

/// What came back in place of what was expected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unexpected {
    found: Found,
    expected: u16,
}

impl fmt::Display for Unexpected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.found {
            Found::Nothing => write!(f, "{}: it was lost on its way, nobody refused it", self.found),
            Found::WorkingCounter(found) if self.expected == 1 && found > 1 => write!(
                f,
                "working counter {found} where 1 was expected: {found} SubDevices answer at one address, so neither can be believed; \
                 take one of them off, or switch all off and on"
            ),
            found => write!(f, "{found} where working counter {} was expected", self.expected),
        }
    }
}

/// An access to registers that failed after all its attempts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AccessError {
    /// What was accessed.
    pub what: &'static str,
    /// The SubDevice; `None` for all.
    pub position: Option<u16>,
    /// The command.
    pub command: Command,
    /// Whom and where.
    pub address: Address,
    /// Working counter expected.
    pub expected: u16,
    /// What came back.
    pub found: Found,
    /// Attempts made.
    pub attempts: u32,
}

impl fmt::Display for AccessError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.position {
            Some(position) => write!(f, "SubDevice {position}: ")?,
            None => f.write_str("all SubDevices: ")?,
        }
        let AccessError { what, command, address, expected, found, attempts, .. } = self;
        write!(f, "{what}: {} ({command}, {address}, {attempts} attempts)", found.against(*expected))
    }
}

impl core::error::Error for AccessError {}
