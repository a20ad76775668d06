//! Rooms of the grid benchmarks: maps `NAME.map` with scenarios `NAME.map.scen` beside them, whose optimal lengths along eight directions
//! are known (N. Sturtevant, *Benchmarks for Grid-Based Pathfinding*, 2012).

use std::io;
use std::path::Path;

use omnibase_plan::{Cost, Footprint, Map, Plan, PlanError, Space, Task, Until, plan};
use omnibase_platform::Pose2;

/// A room and what is asked in it.
pub struct Room {
    pub name: String,
    pub space: Space,
    /// Column and row of both ends, and the optimal length along eight directions, in cells.
    pub asked: Vec<([[usize; 2]; 2], f64)>,
}

/// All rooms of a folder, by name.
pub fn read(folder: &Path, cell_m: f64) -> io::Result<Vec<Room>> {
    let mut paths: Vec<_> = std::fs::read_dir(folder)?.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.sort();
    let is_map = |path: &&std::path::PathBuf| path.extension().is_some_and(|ending| ending == "map");
    let mut rooms = Vec::new();
    for path in paths.iter().filter(is_map) {
        let Ok(scenarios) = std::fs::read_to_string(format!("{}.scen", path.display())) else { continue };
        let Some(map) = map(&std::fs::read_to_string(path)?, cell_m) else { continue };
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let asked = scenarios.lines().filter_map(asked).collect();
        rooms.push(Room { name, space: Space::new(map), asked });
    }
    Ok(rooms)
}

/// The map of a text, its rows from below.
fn map(text: &str, cell_m: f64) -> Option<Map> {
    let (header, rows) = text.split_once("map\n")?;
    let number =
        |key: &str| header.lines().find_map(|line| line.strip_prefix(key)?.trim().parse::<usize>().ok());
    let (height, width) = (number("height ")?, number("width ")?);
    let mut map = Map::empty([width, height], cell_m).ok()?;
    for (row, line) in rows.lines().take(height).enumerate() {
        for (column, cell) in line.bytes().take(width).enumerate() {
            map.blocked[row * width + column] = !matches!(cell, b'.' | b'G' | b'S');
        }
    }
    Some(map)
}

fn asked(line: &str) -> Option<([[usize; 2]; 2], f64)> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let number = |at: usize| words.get(at)?.parse::<usize>().ok();
    Some(([[number(4)?, number(5)?], [number(6)?, number(7)?]], words.get(8)?.parse().ok()?))
}

impl Room {
    /// A plan from centre to centre with headings.
    pub fn plan(
        &self,
        footprint: &Footprint,
        ends: [[usize; 2]; 2],
        headings_rad: [f64; 2],
        clearance_m: f64,
    ) -> Result<Plan, PlanError> {
        let cell_m = self.space.map.cell_m;
        let pose = |end: usize| {
            let [x, y] = ends[end].map(|at| (at as f64 + 0.5) * cell_m);
            Pose2::new(x, y, headings_rad[end])
        };
        plan(&Task {
            space: &self.space,
            footprint,
            from: pose(0),
            to: pose(1),
            clearance_m,
            cost: Cost::Shortest,
            until: Until::default(),
        })
    }
}
