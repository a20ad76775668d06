//! The table of the map, as written.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The room through which ways are planned (`omnibase plan`, the call `drive_to`).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct MapTable {
    /// A map of ROS's map_server: a YAML file that names a PGM or PNG file.
    pub file: Option<String>,
    /// Closed polygons that are in the way, each a list of corners x and y in the map's frame, m.
    pub blocked_m: Option<Vec<Vec<[f64; 2]>>>,
    /// The map's frame in odom: x m, y m, heading rad; default: they are the same. `set_pose` says where the robot stands.
    pub odom_from_map: Option<[f64; 3]>,
    /// What becomes of cells of which the map knows nothing; default: `blocked`.
    pub unknown: Option<UnknownCells>,
    /// Side of a cell where there is no map file, m; default: 0.05.
    #[schemars(range(min = 0.005, max = 1.0))]
    pub cell_m: Option<f64>,
    /// What the footprint keeps from walls, m; default: 0.05.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub clearance_m: Option<f64>,
    /// Which way is the best one; default: `shortest`.
    pub way: Option<BestWay>,
}

/// What becomes of cells of which a map knows nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum UnknownCells {
    /// They are in the way.
    #[default]
    Blocked,
    /// They are free.
    Free,
}

/// Which way is the best one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BestWay {
    /// The shortest one.
    #[default]
    Shortest,
    /// One that keeps to the middle between walls, along the ridge of their Voronoi diagram.
    Ridge,
}
