//! What a kind is that is chosen by name, the keys that it reads, and where it is chosen.

use std::ops::RangeInclusive;

use super::{FileContent, capital};

/// One kind: what people read about it, and by what its table is checked.
#[derive(Clone, Debug)]
pub struct Kind {
    /// Its name in the robot's file.
    pub name: &'static str,
    /// What it is, in one line.
    pub meaning: &'static str,
    /// The keys of its table that it reads.
    pub keys: Vec<Key>,
}

/// A key that a kind reads.
#[derive(Clone, Debug)]
pub struct Key {
    /// Its name.
    pub name: &'static str,
    /// Whether it must be given.
    pub is_needed: bool,
    /// A key of the table `custom`; `None` for those of the table itself, whose meaning and bounds stand there.
    pub custom: Option<Custom>,
    /// What a file gives whose name is its value; `None` where it names none.
    pub file: Option<FileContent>,
}

/// What a key of the table `custom` is.
#[derive(Clone, Debug, PartialEq)]
pub struct Custom {
    /// Its meaning with its unit, in one line.
    pub meaning: &'static str,
    /// Bounds of a number; `None` for a value of any type.
    pub bounds: Option<RangeInclusive<f64>>,
}

/// A key that must be given.
pub fn needed(name: &'static str) -> Key {
    Key { name, is_needed: true, custom: None, file: None }
}

/// A key that may be given.
pub fn optional(name: &'static str) -> Key {
    Key { is_needed: false, ..needed(name) }
}

impl Kind {
    /// Whether it reads a key, seen from its table.
    pub(crate) fn reads(&self, path: &str) -> bool {
        self.keys.iter().any(|key| key.path() == path)
    }

    /// The keys that it reads, seen from its table.
    pub fn paths(&self) -> Vec<String> {
        self.keys.iter().map(Key::path).collect()
    }
}

impl Key {
    /// A number in the table `custom`: its meaning with its unit, and its bounds.
    #[must_use]
    pub fn number(self, meaning: &'static str, bounds: RangeInclusive<f64>) -> Self {
        Key { custom: Some(Custom { meaning, bounds: Some(bounds) }), ..self }
    }

    /// A value of any type in the table `custom`, which the stage checks itself.
    #[must_use]
    pub fn value(self, meaning: &'static str) -> Self {
        Key { custom: Some(Custom { meaning, bounds: None }), ..self }
    }

    /// Its name as seen from the table of its kind.
    pub fn path(&self) -> String {
        self.beside(self.name)
    }

    /// The name of another key of the same table, as seen from the table of its kind.
    pub(crate) fn beside(&self, name: &str) -> String {
        format!("{}{name}", if self.custom.is_some() { "custom." } else { "" })
    }
}

/// Where kinds of one sort are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sort {
    /// What one of them is called.
    pub name: &'static str,
    /// Its table in the robot's file.
    pub table: &'static str,
    /// The key by which it is chosen.
    pub key: &'static str,
    /// What is chosen where the file says nothing.
    pub default: Option<&'static str>,
    /// Keys of the table that are read for every kind; empty: all of them.
    common: &'static [&'static str],
}

impl Sort {
    /// The table's definition in the JSON schema.
    pub(super) fn definition(&self) -> String {
        format!("{}Table", capital(self.table.rsplit('.').next().unwrap_or(self.table)))
    }

    /// Whether a key of the table is read whatever the kind is.
    pub(crate) fn is_common(&self, key: &str) -> bool {
        self.common.is_empty() || self.common.contains(&key)
    }
}

pub(super) const CONTROLLER: Sort = Sort {
    name: "controller",
    table: "controller",
    key: "kind",
    default: None,
    common: &["kind", "others", "custom"],
};
pub(super) const REFERENCE: Sort = Sort {
    name: "reference",
    table: "reference",
    key: "kind",
    default: Some("hold"),
    common: &["kind", "custom"],
};
pub(super) const ESTIMATOR: Sort = Sort {
    name: "estimator",
    table: "estimator",
    key: "kind",
    default: Some("wheel_odometry"),
    common: &["kind", "custom"],
};
pub(super) const DEVICE: Sort =
    Sort { name: "device", table: "drive", key: "device", default: Some("cia402"), common: &[] };
pub(super) const PERIPHERAL: Sort = Sort {
    name: "peripheral",
    table: "device",
    key: "kind",
    default: None,
    common: &[
        "name",
        "position",
        "alias",
        "identification",
        "group",
        "every",
        "dc",
        "timeouts",
        "kind",
        "vendor_id",
        "product_code",
        "revision",
        "custom",
    ],
};
pub(super) const EVENT: Sort =
    Sort { name: "event", table: "simulation.event", key: "kind", default: None, common: &["at_s", "kind"] };
pub(super) const RECEIVER: Sort = Sort {
    name: "receiver",
    table: "source",
    key: "receiver",
    default: Some("program"),
    common: &["name", "receiver", "max_age_ms"],
};
pub(super) const LAYOUT: Sort = Sort {
    name: "layout",
    table: "platform",
    key: "layout",
    default: None,
    common: &["layout", "wheel_radius_m", "mass_kg", "footprint_m", "custom"],
};
