//! One wheel: where it stands, how it rolls, and what the simulation tells about it.

use crate::floor::Contact;

/// A driven wheel with rollers; mounted on the body, its axle horizontal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelParameters {
    /// Contact point in `base_link`.
    pub position_m: [f64; 2],
    /// Direction in `base_link` in which the wheel rolls when its motor turns positive; any length but zero.
    pub rolling_direction: [f64; 2],
    /// Direction in `base_link` along which it transmits force: the axis of the roller that touches the floor. Equal to
    /// the rolling direction for an omni wheel, at 45 deg to it for a mecanum wheel; any length but zero.
    pub force_direction: [f64; 2],
    /// Radius.
    pub radius_m: f64,
    /// Spin inertia about the axle of the wheel and whatever is fixed to it.
    pub inertia_kg_m2: f64,
    /// Dry friction of bearings and seals.
    pub bearing_coulomb_n_m: f64,
    /// Viscous friction of bearings and motor.
    pub bearing_viscous_n_m_s: f64,
    /// Friction with the floor.
    pub contact: Contact,
}

impl WheelParameters {
    /// Dry bearing friction by default: 0.5·0.0015·load·bore (SKF, *Rolling bearings*, deep groove) for 350 N on a
    /// 60 mm bore is 0.016 N·m; the rest is seals.
    pub const BEARING_COULOMB_N_M: f64 = 0.05;
    /// Viscous friction by default: an assumption, 1 % of the rated torque of a 7 N·m motor at 14 rad/s.
    pub const BEARING_VISCOUS_N_M_S: f64 = 0.005;

    /// An omni wheel: it transmits force in the direction in which it rolls.
    pub fn omni(position_m: [f64; 2], rolling_direction: [f64; 2], radius_m: f64) -> Self {
        Self::mecanum(position_m, rolling_direction, rolling_direction, radius_m)
    }

    /// A wheel whose rollers' axes point along `force_direction`, with the default frictions and the inertia of a
    /// solid disc of 2.5 kg.
    pub fn mecanum(
        position_m: [f64; 2],
        rolling_direction: [f64; 2],
        force_direction: [f64; 2],
        radius_m: f64,
    ) -> Self {
        Self {
            position_m,
            rolling_direction,
            force_direction,
            radius_m,
            inertia_kg_m2: 0.5 * 2.5 * radius_m * radius_m,
            bearing_coulomb_n_m: Self::BEARING_COULOMB_N_M,
            bearing_viscous_n_m_s: Self::BEARING_VISCOUS_N_M_S,
            contact: Contact::default(),
        }
    }
}

/// Whether a contact holds along its force direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Grip {
    /// It sticks (or creeps below the friction limit).
    #[default]
    Sticking,
    /// It slides: the force is at the Coulomb limit.
    Sliding,
}

/// The truth about one wheel after a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WheelState {
    /// Angle turned since the start, counting on over full turns.
    pub angle_rad: f64,
    /// Speed.
    pub speed_rad_s: f64,
    /// Load on the floor.
    pub normal_load_n: f64,
    /// Slip speed over the floor along the force direction; zero while it rolls, but for creep and an elastic tread's
    /// giving way.
    pub slip_m_s: f64,
    /// Speed at which the roller rolls over the floor, across the force direction.
    pub roller_m_s: f64,
    /// How far the tread gave way, along the force direction and across it.
    pub deflection_m: [f64; 2],
    /// Whether it holds.
    pub grip: Grip,
}
