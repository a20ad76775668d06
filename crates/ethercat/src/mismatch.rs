//! What was expected of a segment, and what is there.

use alloc::borrow::ToOwned;
use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt;

use crate::config::ExpectedIdentity;
use crate::wire::sii::Identity;

/// What was expected isn't what was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Mismatch {
    /// More or fewer SubDevices than configurations.
    Count {
        /// SubDevices that are configured.
        expected: usize,
        /// SubDevices that are there.
        found: usize,
        /// The first that has no partner, in words.
        first: String,
    },
    /// Another device than expected.
    Identity {
        /// Where.
        position: u16,
        /// The configuration's name.
        name: Option<String>,
        /// Who was expected.
        expected: ExpectedIdentity,
        /// Who is there.
        found: Identity,
        /// Where the expected one is instead, if anywhere.
        elsewhere: Option<u16>,
    },
    /// No SubDevice has this alias.
    NoSuchAlias {
        /// The alias.
        alias: u16,
        /// The aliases that SubDevices have.
        found: Vec<u16>,
        /// The configuration's name.
        name: Option<String>,
    },
    /// Several SubDevices have this alias.
    AmbiguousAlias {
        /// The alias.
        alias: u16,
        /// Who has it.
        positions: Vec<u16>,
    },
    /// No SubDevice, or several, have this explicit device identification.
    Identification {
        /// The identification.
        identification: u16,
        /// Who has it.
        positions: Vec<u16>,
        /// The identifications that SubDevices show.
        found: Vec<u16>,
        /// The configuration's name.
        name: Option<String>,
    },
    /// There is no SubDevice at this position.
    NoSuchPosition {
        /// The position.
        position: u16,
        /// SubDevices that are there.
        count: usize,
        /// The configuration's name.
        name: Option<String>,
    },
    /// Two configurations are for the same SubDevice.
    ConfiguredTwice {
        /// The SubDevice.
        position: u16,
    },
    /// Some of a hot-connect group are there, others aren't.
    PartOfGroup {
        /// The group.
        group: String,
        /// Positions of those that are there.
        present: Vec<u16>,
        /// The first that is missing, in words.
        missing: String,
    },
    /// SYNC is asked of a SubDevice without a clock.
    NoClock {
        /// The SubDevice.
        position: u16,
        /// The configuration's name.
        name: Option<String>,
    },
}

pub(crate) fn quoted(name: &Option<String>) -> String {
    name.as_ref().map_or_else(String::new, |name| alloc::format!(" ({name})"))
}

impl fmt::Display for Mismatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Mismatch::Count { expected, found, first } => {
                write!(f, "{expected} SubDevices are configured, {found} are there: {first}")
            }
            Mismatch::Identity { position, name, expected, found, elsewhere } => {
                write!(f, "SubDevice {position}{}: expected", quoted(name))?;
                let fields = [
                    ("vendor", expected.vendor_id, found.vendor_id),
                    ("product", expected.product_code, found.product_code),
                    ("revision", expected.revision, found.revision),
                    ("serial", expected.serial, found.serial),
                ];
                for (field, expected, found) in fields {
                    match expected {
                        Some(expected) if expected != found => {
                            write!(f, " {field} 0x{expected:08x} but found 0x{found:08x},")?;
                        }
                        _ => {}
                    }
                }
                match elsewhere {
                    Some(elsewhere) => write!(f, " the expected device is at position {elsewhere}"),
                    None => f.write_str(" the expected device is nowhere in the segment"),
                }
            }
            Mismatch::NoSuchAlias { alias, found, name } => {
                let found: Vec<String> = found.iter().map(|alias| format!("0x{alias:04x}")).collect();
                write!(f, "no SubDevice has alias 0x{alias:04x}{}, {}", quoted(name), those(&found))
            }
            Mismatch::AmbiguousAlias { alias, positions } => {
                write!(f, "alias 0x{alias:04x} is asked for, but SubDevices {positions:?} all have it")
            }
            Mismatch::Identification { identification, positions, found, name } if positions.is_empty() => {
                let found: Vec<String> = found.iter().map(u16::to_string).collect();
                write!(
                    f,
                    "no SubDevice has identification {identification}{}, {}: look at its switch",
                    quoted(name),
                    those(&found)
                )
            }
            Mismatch::Identification { identification, positions, name, .. } => write!(
                f,
                "identification {identification}{} is asked for, but SubDevices {positions:?} all have it",
                quoted(name)
            ),
            Mismatch::NoSuchPosition { position, count, name } => {
                write!(f, "SubDevice {position}{} is configured, the segment has {count}", quoted(name))
            }
            Mismatch::ConfiguredTwice { position } => {
                write!(f, "two configurations are for SubDevice {position}")
            }
            Mismatch::PartOfGroup { group, present, missing } => write!(
                f,
                "hot-connect group `{group}`: SubDevices {present:?} of it are there, {missing} is not; connect all of it, or none"
            ),
            Mismatch::NoClock { position, name } => {
                write!(
                    f,
                    "SubDevice {position}{}: SYNC is configured, but its controller has no distributed clock",
                    quoted(name)
                )
            }
        }
    }
}

/// What there is in place of what was looked for.
fn those(found: &[String]) -> String {
    match found {
        [] => "and none has any".to_owned(),
        found => format!("but there are {}", found.join(", ")),
    }
}

impl core::error::Error for Mismatch {}
