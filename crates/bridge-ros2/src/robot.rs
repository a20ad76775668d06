//! Which robot is meant, and what it tells of itself once.

use anyhow::Context as _;
use omnibase_client::robots::{Endpoint, Found, latest};
use omnibase_description::{Body, Description, Wheel};
use serde::Deserialize;

use crate::arguments::Arguments;

/// Where whoever starts a bridge for a robot says which one it is: [`Found`] as JSON.
const ROBOT: &str = "OMNIBASE_ROBOT";
/// The secret of those who may command.
const TOKEN: &str = "OMNIBASE_TOKEN";

/// The robot that is meant.
pub fn meant(arguments: &Arguments) -> anyhow::Result<Found> {
    if let Some(address) = arguments.at {
        let token = match &arguments.token_file {
            Some(path) => std::fs::read_to_string(path).with_context(|| path.display().to_string())?,
            None => std::env::var(TOKEN).unwrap_or_default(),
        };
        let token = token.trim().to_owned();
        return Ok(Found { robot: String::new(), place: Endpoint::Address(address), token });
    }
    match std::env::var(ROBOT) {
        Ok(text) => serde_json::from_str(&text).context(ROBOT),
        Err(_) => Ok(latest()?),
    }
}

/// What doesn't change while it runs, as `/api/robot` says it.
#[derive(Clone, Debug, Deserialize)]
pub struct Facts {
    /// The robot's name.
    pub name: String,
    /// Whether it is simulated.
    pub simulated: bool,
    /// What it weighs.
    pub body: Body,
    /// In the order of its file.
    pub wheels: Vec<Wheel>,
    /// x m, y m in the platform's frame.
    pub footprint: Vec<[f64; 2]>,
    /// Names of all values, as `state/pose_x_m`.
    pub columns: Vec<String>,
    /// What it never exceeds.
    pub limits: Limits,
}

/// What a robot never exceeds.
#[derive(Clone, Debug, Deserialize)]
pub struct Limits {
    /// Of the platform, m/s.
    pub speed_m_s: f64,
    /// Of the platform, rad/s.
    pub turn_speed_rad_s: f64,
    /// Of a wheel, rad/s.
    pub wheel_speed_rad_s: f64,
    /// Of a wheel, N·m.
    pub wheel_torque_nm: f64,
}

impl Facts {
    /// Asks the robot.
    pub fn of(found: &Found) -> anyhow::Result<Facts> {
        serde_json::from_value(found.read("robot")?).context("what the robot tells of itself")
    }

    /// As URDF is made of it.
    pub fn description(&self) -> Description {
        Description {
            name: self.name.clone(),
            body: self.body,
            footprint_m: self.footprint.clone(),
            wheels: self.wheels.clone(),
            wheel_speed_rad_s: self.limits.wheel_speed_rad_s,
            wheel_torque_nm: self.limits.wheel_torque_nm,
        }
    }
}
