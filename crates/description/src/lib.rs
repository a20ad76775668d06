//! A robot as other programs draw it and compute with it: its body and its wheels, written as URDF and as MJCF.
//!
//! - [`Description`]: what is known of it. [`urdf`] and [`mjcf`]: the same as text.
//! - [`parts`]: how mass and inertia, which are known of the whole, are spread over base and wheels.
//!
//! `base_link` lies on the floor where the pose counts from: x forward, y left, z up (REP-103). Units are SI.
#![forbid(unsafe_code)]

mod mjcf;
pub mod parts;
mod urdf;

pub use mjcf::mjcf;
pub use urdf::{Names, urdf};

use serde::{Deserialize, Serialize};

/// A robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Description {
    /// Its name.
    pub name: String,
    /// All of it.
    pub body: Body,
    /// Corners of its convex outline on the floor in base_link, m.
    pub footprint_m: Vec<[f64; 2]>,
    /// In the order of its file.
    pub wheels: Vec<Wheel>,
    /// Greatest speed of a wheel, rad/s.
    pub wheel_speed_rad_s: f64,
    /// Greatest torque of a wheel, N·m.
    pub wheel_torque_nm: f64,
}

/// Body, payload and wheels together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Body {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Moment of inertia about the vertical axis through the centre of mass, kg·m².
    pub inertia_kg_m2: f64,
    /// Centre of mass in base_link: x, y and height over the floor, m.
    pub centre_m: [f64; 3],
}

/// A wheel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Wheel {
    /// Its name.
    pub name: String,
    /// Where it touches the floor in base_link, m.
    pub position_m: [f64; 2],
    /// Direction in base_link in which it rolls when its motor turns positive.
    pub rolling: [f64; 2],
    /// Its radius, m.
    pub radius_m: f64,
    /// Its moment of inertia about its axis, kg·m².
    pub inertia_kg_m2: f64,
    /// Its rotor's, seen at the wheel (times gear ratio squared), kg·m².
    pub rotor_inertia_kg_m2: f64,
}

impl Wheel {
    /// The unit vector in base_link about which it turns: it rolls to where axis × up points.
    pub fn axis(&self) -> [f64; 2] {
        let [x, y] = self.rolling;
        let length = x.hypot(y);
        // Without the sign of zero.
        [-y / length + 0.0, x / length + 0.0]
    }
}

/// A text as an attribute of XML may hold it.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests;
