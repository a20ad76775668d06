//! The table of an axis, as written.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::drive_tables::{EncoderName, SpeedUnit, TurnDirection};

/// A drive of the profile CiA 402 that turns no wheel: a lift, a joint, a turret. Positions, speeds and accelerations are in
/// its `unit`, `unit`/s and `unit`/s².
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct AxisTable {
    /// Unit of its position.
    pub unit: Option<AxisUnit>,
    /// Encoder counts per revolution of the motor.
    #[schemars(range(min = 1))]
    pub counts_per_revolution: Option<u32>,
    /// Revolutions of the motor per revolution of the shaft; default: 1.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub gear_ratio: Option<f64>,
    /// Metres per revolution of the shaft, of an axis in m.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub feed_m: Option<f64>,
    /// Whether positive counts move the axis backwards; default: `forward`.
    pub direction: Option<TurnDirection>,
    /// Whether the encoder keeps its count without supply; default: `incremental`, which must be homed.
    pub encoder: Option<EncoderName>,
    /// Unit of the drive's speed objects, and per second of its acceleration objects; default: `counts_s`.
    pub speed_unit: Option<SpeedUnit>,
    /// The motor's rated torque, N·m: 1000 in the drive's torque objects.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub rated_torque_nm: Option<f64>,
    /// The most torque of the motor, N·m; default: the rated torque.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub torque_limit_nm: Option<f64>,
    /// Modes in which it may be moved; default: `["csp"]`.
    pub modes: Option<Vec<AxisMode>>,
    /// The least and the greatest position to which it moves.
    pub position_limits: Option<[f64; 2]>,
    /// Greatest speed.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub speed_limit: Option<f64>,
    /// Greatest acceleration.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub acceleration_limit: Option<f64>,
    /// Greatest jerk, `unit`/s³; default: none.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub jerk_limit: Option<f64>,
    /// How fast a stop slows down; default: the greatest acceleration.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub stop_deceleration: Option<f64>,
    /// How far it may be from its set point.
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub following_error: Option<f64>,
    /// Its position where the drive counts 0: at its home, where it is homed; default: 0.
    pub zero_position: Option<f64>,
    /// How it finds its home.
    pub homing: Option<HomingTable>,
    /// Where it stands at first in the simulated robot; default: in the middle of its limits.
    pub simulated_position: Option<f64>,
}

/// How a drive finds its home by itself.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct HomingTable {
    /// Method of the profile (0x6098), as 17: the negative limit switch; below 0: the manufacturer's.
    #[schemars(range(min = -128, max = 127))]
    pub method: Option<i8>,
    /// Speed on the way to the switch (0x6099.1).
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub switch_speed: Option<f64>,
    /// Speed on the way to zero (0x6099.2).
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub zero_speed: Option<f64>,
    /// Acceleration (0x609A).
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub acceleration: Option<f64>,
    /// After so long it has failed, s; default: 60.
    #[schemars(extend("exclusiveMinimum" = 0.0), range(max = 3600.0))]
    pub timeout_s: Option<f64>,
}

/// Unit of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AxisUnit {
    /// Metres.
    M,
    /// Radians.
    Rad,
}

/// A mode in which an axis is moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AxisMode {
    /// Cyclic synchronous position: the cycle plans the way and streams set points.
    Csp,
    /// Profile position: the drive plans the way to each set point.
    Pp,
    /// Profile velocity: the drive runs at a speed.
    Pv,
}
