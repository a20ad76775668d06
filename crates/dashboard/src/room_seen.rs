//! What a page is shown of the room: its map, and the way through it.

use omnibase_platform::Pose2;
use omnibase_run::room::Room;
use schemars::JsonSchema;
use serde::Serialize;

/// What a page is told of it.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct WaySeen {
    /// Where it goes: x m, y m, heading rad.
    pub(crate) goal: [f64; 3],
    /// What it does, or how it ended, in words.
    pub(crate) text: String,
    /// It is under way.
    pub(crate) under_way: bool,
    /// It ended without being there.
    pub(crate) failed: bool,
}

/// The map as a page draws it.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct MapSeen {
    /// Cells along x and y.
    size: [usize; 2],
    /// Side of a cell, m.
    cell_m: f64,
    /// Outer corner of the first cell in odom, and how the rows are turned: x m, y m, rad.
    odom_from_grid: [f64; 3],
    /// Each row from below: how many cells are free, then in the way, then free, and so on.
    rows: Vec<Vec<usize>>,
    /// Polygons that are in the way, in odom, m.
    blocked_m: Vec<Vec<[f64; 2]>>,
    /// Walls that were drawn while it runs, likewise.
    walls_m: Vec<Vec<[f64; 2]>>,
}

impl MapSeen {
    /// The room's.
    pub(crate) fn of(room: &Room, walls_m: &[Vec<[f64; 2]>]) -> Self {
        let walls_m = walls_m.to_vec();
        let blocked_m = room.blocked_m();
        let Some(map) = room.map() else {
            let (size, odom_from_grid) = ([0; 2], [0.0; 3]);
            return MapSeen { size, cell_m: 0.0, odom_from_grid, rows: Vec::new(), blocked_m, walls_m };
        };
        let runs = |row: &[bool]| {
            let mut runs = vec![0];
            let mut is_blocked = false;
            for cell in row {
                if *cell != is_blocked {
                    is_blocked = *cell;
                    runs.push(0);
                }
                if let Some(last) = runs.last_mut() {
                    *last += 1;
                }
            }
            runs
        };
        let Pose2 { x_m, y_m, heading_rad } = map.map_from_grid;
        MapSeen {
            size: [map.width, map.height],
            cell_m: map.cell_m,
            odom_from_grid: [x_m, y_m, heading_rad],
            rows: map.blocked.chunks_exact(map.width).map(runs).collect(),
            blocked_m,
            walls_m,
        }
    }
}
