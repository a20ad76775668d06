//! The tables of fence and obstacles, as written.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The fence, in odom, whose origin is the pose at start: a rectangle or a polygon.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct FenceTable {
    /// A rectangle along the axes: x_min, y_min, x_max, y_max, m; this or `polygon_m`.
    pub rectangle_m: Option<[f64; 4]>,
    /// Corners in order, each x and y, m; they needn't be convex.
    pub polygon_m: Option<Vec<[f64; 2]>>,
    /// What the footprint keeps from the fence, m: room for the error with which the motion is followed; default: 0.05.
    #[schemars(range(min = 0.0))]
    pub margin_m: Option<f64>,
    /// How many standard deviations of the believed pose are kept beside the margin; default: 3.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub sigmas: Option<f64>,
}

/// What the robot does about obstacles.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct AvoidanceTable {
    /// The way of avoiding them; default: `guarded`.
    pub kind: Option<AvoidanceKind>,
    /// What the footprint keeps from an obstacle, m; default: 0.1.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub distance_m: Option<f64>,
    /// `circulate`: coefficient of the circular speed, 1/s; times the safety circle's radius it is that speed;
    /// default: 0.5.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub circulate_1_s: Option<f64>,
    /// How many standard deviations of the believed pose are kept beside the distance; default: 3.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub sigmas: Option<f64>,
    /// A plan that makes no headway for so long is given up: category 2, "the way is blocked", s; default: 5.
    #[schemars(range(min = 0.5, max = 3600.0))]
    pub give_up_s: Option<f64>,
    /// How much faster than the path's own speed a robot may be that had to give way and catches up; default: 1.2.
    #[schemars(range(min = 1.0, max = 10.0))]
    pub catch_up_factor: Option<f64>,
}

/// A way of avoiding obstacles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AvoidanceKind {
    /// None: obstacles are shown and measured only.
    Off,
    /// The thesis's: within the safety circle of the nearest obstacle the speed becomes a circular one.
    Circulate,
    /// Braking distance, footprint, several and moving obstacles are counted: the robot never touches one by itself.
    #[default]
    Guarded,
}

impl AvoidanceKind {
    /// The number by which the setting `avoidance` holds this choice: 0 off, 1 circulate, 2 guarded.
    pub fn code(self) -> f64 {
        match self {
            AvoidanceKind::Off => 0.0,
            AvoidanceKind::Circulate => 1.0,
            AvoidanceKind::Guarded => 2.0,
        }
    }

    /// The choice of a number; `None` where no choice has it.
    pub fn from_code(code: f64) -> Option<Self> {
        [AvoidanceKind::Off, AvoidanceKind::Circulate, AvoidanceKind::Guarded]
            .into_iter()
            .find(|kind| kind.code() == code)
    }
}

/// An obstacle that is there from the start: a circle.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct ObstacleTable {
    /// Its centre in odom, x and y, m.
    pub centre_m: Option<[f64; 2]>,
    /// Its radius, m.
    #[schemars(range(min = 0.0))]
    pub radius_m: Option<f64>,
    /// Its speed in odom, x and y, m/s; default: it stands.
    pub velocity_m_s: Option<[f64; 2]>,
}
