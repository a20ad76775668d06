//! Other programs that send inputs: as written, and resolved.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::signals::{Carries, Frame, SignalLayout, SignalName, SourceName};

/// One program that sends inputs while the robot runs, over its API or by `omnibase send`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SourceTable {
    /// Its name: small letters, digits and underscores, at most 24; its values are called `name.value`.
    pub name: Option<String>,
    /// What it sends; default: `values`.
    pub carries: Option<CarriesName>,
    /// Its values, where it sends `values`.
    pub input: Vec<SentTable>,
    /// What it sent longer ago isn't believed, ms; default: 100.
    #[schemars(range(min = 1, max = 60_000))]
    pub max_age_ms: Option<u32>,
}

/// A value that a program sends.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SentTable {
    /// Its name: small letters, digits and underscores, at most 24.
    pub name: Option<String>,
    /// Its unit; default: none.
    pub unit: Option<String>,
    /// Below this it isn't believed; default: no bound.
    pub least: Option<f64>,
    /// Above this it isn't believed; default: no bound.
    pub greatest: Option<f64>,
}

/// What a program sends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CarriesName {
    /// Values by name.
    #[default]
    Values,
    /// A pose in odom with its covariance: `x`, `y`, `heading`, `covariance_xx`, `_xy`, `_xh`, `_yy`, `_yh`, `_hh`, in m
    /// and rad.
    Pose,
    /// A velocity in base_link: `x`, `y` in m/s, `heading` in rad/s.
    VelocityInBody,
    /// A velocity in odom, with the same values.
    VelocityInOdom,
}

impl From<CarriesName> for Carries {
    fn from(name: CarriesName) -> Self {
        match name {
            CarriesName::Values => Carries::Values,
            CarriesName::Pose => Carries::Pose,
            CarriesName::VelocityInBody => Carries::Velocity(Frame::Body),
            CarriesName::VelocityInOdom => Carries::Velocity(Frame::Odom),
        }
    }
}

/// One program that sends inputs.
#[derive(Clone, Debug, PartialEq)]
pub struct SourcePlan {
    /// Its name.
    pub name: String,
    /// What it sends.
    pub carries: Carries,
    /// Its values, in the order in which they stand in a cycle's record.
    pub input: Vec<SentPlan>,
    /// What it sent longer ago isn't believed, ns.
    pub max_age_ns: u64,
    /// It tells poses to a sensor: what was measured earlier than what was heard counts all the same.
    pub any_order: bool,
}

/// A value that a program sends.
#[derive(Clone, Debug, PartialEq)]
pub struct SentPlan {
    /// Its name, without the program's.
    pub name: String,
    /// Its unit; empty where it has none.
    pub unit: String,
    /// Least and greatest value that are believed.
    pub bounds: [f64; 2],
}

impl SourcePlan {
    /// Adds the names of its values behind those that are there.
    pub(crate) fn add_to(&self, layout: &mut SignalLayout) {
        layout.sources.push(SourceName { name: self.name.clone(), carries: self.carries });
        layout.inputs.extend(self.input.iter().map(|sent| SignalName {
            name: format!("{}.{}", self.name, sent.name),
            unit: sent.unit.clone(),
        }));
    }
}
