//! Which cells of a floor are occupied.

mod image;
mod polygons;
mod rectangles;
mod settings;
mod solid;

use omnibase_platform::Pose2;

use crate::Point;
pub use image::{Image, ImageError};
pub use settings::{Mode, Settings, SettingsError};
pub(crate) use solid::{Solid, range};

#[cfg(test)]
mod tests;

/// Most cells of a map.
pub const MOST_CELLS: usize = 1 << 24;
/// A cell of this occupancy or more, in percent, is in the way.
const OCCUPIED_PERCENT: u8 = 50;

/// What is known of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cell {
    /// How sure it is that something stands there, in percent.
    Occupancy(u8),
    /// Nothing.
    Unknown,
}

/// A floor in square cells, row by row from y = 0 upwards.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// Cells along x.
    pub width: usize,
    /// Cells along y.
    pub height: usize,
    /// The side of a cell, m.
    pub cell_m: f64,
    /// Where the outer corner of the first cell lies, and how the rows are turned.
    pub map_from_grid: Pose2,
    /// Which cells are in the way, beside the polygons.
    pub blocked: Vec<bool>,
    /// Polygons that are in the way, exactly.
    pub(crate) solids: Vec<Solid>,
}

/// Why a map was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MapError {
    /// The YAML file.
    #[error("{0}")]
    Settings(#[from] SettingsError),
    /// The image.
    #[error("{name}: {error}")]
    Image {
        /// The image's name.
        name: String,
        /// What is wrong with it.
        error: ImageError,
    },
    /// The image couldn't be read.
    #[error("{name}: {why}")]
    Unread {
        /// The image's name.
        name: String,
        /// Why.
        why: String,
    },
    /// Sides of cells of no use, or too many cells.
    #[error("{what}: expected {expected}, found {found}")]
    Size {
        /// What.
        what: &'static str,
        /// What it may be.
        expected: String,
        /// What it is.
        found: String,
    },
}

/// What becomes of cells of which nothing is known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Unknown {
    /// They are in the way.
    #[default]
    Blocked,
    /// They are free.
    Free,
}

impl Map {
    /// An empty floor.
    pub fn empty([width, height]: [usize; 2], cell_m: f64) -> Result<Map, MapError> {
        let size = |what, expected: String, found: String| MapError::Size { what, expected, found };
        if !(cell_m.is_finite() && (1e-4..=10.0).contains(&cell_m)) {
            return Err(size("side of a cell", "0.0001 m to 10 m".into(), format!("{cell_m} m")));
        }
        let count = width.checked_mul(height).filter(|count| (1..=MOST_CELLS).contains(count));
        let Some(count) = count else {
            let found = format!("{width} by {height}");
            return Err(size("cells", format!("1 to {MOST_CELLS}"), found));
        };
        let map_from_grid = Pose2::default();
        Ok(Map { width, height, cell_m, map_from_grid, blocked: vec![false; count], solids: Vec::new() })
    }

    /// A map of ROS's map_server: its YAML file, and a reader for the image that it names.
    pub fn read(
        yaml: &str,
        unknown: Unknown,
        read: impl FnOnce(&str) -> Result<Vec<u8>, String>,
    ) -> Result<Map, MapError> {
        let settings = Settings::parse(yaml)?;
        let name = settings.image.clone();
        let bytes = read(&name).map_err(|why| MapError::Unread { name: name.clone(), why })?;
        let image = Image::read(&bytes).map_err(|error| MapError::Image { name, error })?;
        Map::of_image(&settings, &image, unknown)
    }

    /// What the settings make of an image.
    pub fn of_image(settings: &Settings, image: &Image, unknown: Unknown) -> Result<Map, MapError> {
        let mut map = Map::empty([image.width, image.height], settings.resolution_m)?;
        let [x_m, y_m, heading_rad] = settings.origin;
        map.map_from_grid = Pose2::new(x_m, y_m, heading_rad);
        // An image's first row is the farthest one.
        for (row, from) in (0..map.height).rev().enumerate() {
            for column in 0..map.width {
                let cell = settings.cell(image.pixels[from * map.width + column]);
                map.blocked[row * map.width + column] = match cell {
                    Cell::Occupancy(percent) => percent >= OCCUPIED_PERCENT,
                    Cell::Unknown => unknown == Unknown::Blocked,
                };
            }
        }
        Ok(map)
    }

    /// A floor that holds a room with these corners and nothing else.
    pub fn of_room(corners: &[Point], cell_m: f64) -> Result<Map, MapError> {
        let range = |axis: usize| {
            let values = || corners.iter().map(|corner| corner[axis]);
            [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)]
        };
        let ranges = [range(0), range(1)];
        let count = |[low, high]: [f64; 2]| ((high - low) / cell_m).ceil().clamp(0.0, 1e9) as usize + 2;
        let mut map = Map::empty(ranges.map(count), cell_m)?;
        map.map_from_grid = Pose2::new(ranges[0][0] - cell_m, ranges[1][0] - cell_m, 0.0);
        map.keep_inside(corners);
        Ok(map)
    }

    /// A part of it, from a column and a row on, in cells half as large.
    pub(crate) fn finer(&self, low: [usize; 2], size: [usize; 2]) -> Result<Map, MapError> {
        let mut map = Map::empty(size.map(|count| 2 * count), 0.5 * self.cell_m)?;
        let [x, y] = low.map(|at| at as f64);
        map.map_from_grid = self.map_from_grid.then(Pose2::new(x * self.cell_m, y * self.cell_m, 0.0));
        for (at, blocked) in map.blocked.iter_mut().enumerate() {
            let [column, row] = [at % (2 * size[0]), at / (2 * size[0])].map(|at| at / 2);
            *blocked = self.blocked[(low[1] + row) * self.width + low[0] + column];
        }
        let finer = |solid: &Solid| {
            Solid::new(
                solid.corners().iter().map(|corner| [2.0 * (corner[0] - x), 2.0 * (corner[1] - y)]).collect(),
            )
        };
        map.solids = self.solids.iter().map(finer).collect();
        Ok(map)
    }

    /// A place as the grid has it, in cells.
    pub(crate) fn grid_cells(&self, in_map_m: Point) -> Point {
        let at = self.map_from_grid.inverse().then(Pose2::new(in_map_m[0], in_map_m[1], 0.0));
        [at.x_m / self.cell_m, at.y_m / self.cell_m]
    }

    /// The centre of a cell, m.
    pub fn centre_m(&self, column: usize, row: usize) -> Point {
        let [x, y] = [column, row].map(|at| (at as f64 + 0.5) * self.cell_m);
        let at = self.map_from_grid.then(Pose2::new(x, y, 0.0));
        [at.x_m, at.y_m]
    }
}
