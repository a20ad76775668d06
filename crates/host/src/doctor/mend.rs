//! Changes that mend a finding, made and undone.

use super::Machine;
use crate::ethtool::{self, EthtoolError};
use std::fmt;
use std::io;

/// One change.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Mend {
    /// A file of `/proc` or `/sys` gets this value.
    Write {
        /// The file.
        path: String,
        /// Its value.
        value: String,
    },
    /// A setting of a network interface gets this value.
    Nic {
        /// The interface.
        interface: String,
        /// The setting.
        setting: NicSetting,
        /// Its value: microseconds, or 0 and 1 for off and on.
        value: u32,
    },
}

/// A setting of a network interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NicSetting {
    /// How long the card may hold received frames back, us.
    ReceiveDelay,
    /// How long the card may hold the note "sent" back, us.
    SendDelay,
    /// The driver chooses the delay of reception by load.
    AdaptiveReceive,
    /// The driver chooses the delay of sending by load.
    AdaptiveSend,
    /// The kernel joins received frames (GRO).
    ReceiveOffload,
    /// The card joins received frames (LRO).
    LargeReceiveOffload,
    /// Energy-Efficient Ethernet.
    EnergyEfficient,
}

impl NicSetting {
    /// The options of `ethtool` that set it, with the value's place left out.
    fn ethtool(self) -> (&'static str, &'static str) {
        match self {
            NicSetting::ReceiveDelay => ("-C", "rx-usecs"),
            NicSetting::SendDelay => ("-C", "tx-usecs"),
            NicSetting::AdaptiveReceive => ("-C", "adaptive-rx"),
            NicSetting::AdaptiveSend => ("-C", "adaptive-tx"),
            NicSetting::ReceiveOffload => ("-K", "gro"),
            NicSetting::LargeReceiveOffload => ("-K", "lro"),
            NicSetting::EnergyEfficient => ("--set-eee", "eee"),
        }
    }

    /// As `ethtool` calls it.
    pub(super) fn name(self) -> &'static str {
        self.ethtool().1
    }

    /// A value as `ethtool` takes it.
    pub(super) fn value(self, value: u32) -> String {
        match self {
            NicSetting::ReceiveDelay | NicSetting::SendDelay => value.to_string(),
            _ => if value == 0 { "off" } else { "on" }.to_owned(),
        }
    }
}

impl fmt::Display for Mend {
    /// The command that does the same.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Mend::Write { path, value } => write!(f, "echo {value} | sudo tee {path}"),
            Mend::Nic { interface, setting, value } => {
                let (option, name) = setting.ethtool();
                write!(f, "sudo ethtool {option} {interface} {name} {}", setting.value(*value))
            }
        }
    }
}

/// What a change did.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Change {
    /// The change.
    pub mend: Mend,
    /// The value before; the change with it undoes what was done.
    pub undo: Mend,
}

/// Why a change wasn't made.
#[derive(Debug, thiserror::Error)]
pub enum MendError {
    /// The value before can't be read, so that the change could not be undone.
    #[error("`{0}` can't be read, so that a change could not be undone")]
    Unreadable(String),
    /// The kernel refused the value.
    #[error("`{path}` does not take `{value}`: {reason}")]
    Refused {
        /// The file.
        path: String,
        /// The value.
        value: String,
        /// What the kernel said.
        reason: io::Error,
    },
    /// The driver refused the setting.
    #[error(transparent)]
    Ethtool(#[from] EthtoolError),
    /// The value was taken and yet isn't there.
    #[error("`{0}` was accepted and did not change anything")]
    Ignored(String),
}

impl Mend {
    /// Makes the change and reads it back.
    pub fn apply(&self, machine: &Machine) -> Result<Change, MendError> {
        let undo = match self {
            Mend::Write { path, value } => {
                let before = value_of(machine, path)?;
                machine.write(path, value).map_err(|reason| MendError::Refused {
                    path: path.clone(),
                    value: value.clone(),
                    reason,
                })?;
                if value_of(machine, path)? != *value {
                    return Err(MendError::Ignored(self.to_string()));
                }
                Mend::Write { path: path.clone(), value: before }
            }
            Mend::Nic { interface, setting, value } => {
                let before = ethtool::get(interface, *setting)?;
                ethtool::set(interface, *setting, *value)?;
                if ethtool::get(interface, *setting)? != *value {
                    return Err(MendError::Ignored(self.to_string()));
                }
                Mend::Nic { interface: interface.clone(), setting: *setting, value: before }
            }
        };
        Ok(Change { mend: self.clone(), undo })
    }
}

/// What a file says: the chosen one where it lists choices.
fn value_of(machine: &Machine, path: &str) -> Result<String, MendError> {
    let text = machine.text(path).ok_or_else(|| MendError::Unreadable(path.to_owned()))?;
    let chosen = super::machine::chosen(&text, ['[', ']'])
        .or_else(|| super::machine::chosen(&text, ['(', ')']))
        .map(str::to_owned);
    Ok(chosen.unwrap_or(text))
}
