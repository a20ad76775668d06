//! The table of the floor's grip, and what is made of it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What is known of the floor's friction.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct GripTable {
    /// The floor's friction where it is least: what a sliding wheel is given, over its load. Accelerations, stops and torques are
    /// held so low that every wheel grips; default: with `memory` what slipping wheels found, else nothing is held back.
    #[schemars(range(min = 0.01, max = 2.0))]
    pub friction: Option<f64>,
    /// Height of the centre of mass over the floor, with the highest load, m: by it an acceleration shifts the wheels' loads;
    /// default: 0.4.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub centre_of_mass_height_m: Option<f64>,
    /// A file beside this one in which the friction that was found is kept between runs; default: it is forgotten.
    pub memory: Option<String>,
}

/// What is known of the floor's friction before the robot moves.
#[derive(Clone, Debug, PartialEq)]
pub struct GripPlan {
    /// Never more than this is counted on.
    pub friction: Option<f64>,
    /// Height of the centre of mass over the floor, m; and where the file tells it.
    pub height_m: f64,
    /// What it tells.
    pub told_height_m: Option<f64>,
    /// The file that keeps what was found.
    pub memory: Option<String>,
    /// What an earlier run found.
    pub remembered: Option<RememberedFloor>,
}

/// What a run found of its floor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RememberedFloor {
    /// Force that the floor gave a sliding wheel, over its load.
    pub friction: f64,
    /// The standard deviation of that.
    pub friction_sigma: f64,
}
