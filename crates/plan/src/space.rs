//! A map in which footprints are looked for: exact, row by row.

use omnibase_platform::Pose2;

use crate::Point;
use crate::distance::{self, Between};
use crate::footprint::{Footprint, placed};
use crate::map::Map;

/// How far a footprint may reach into a cell that is in the way, in cells: rounding.
const TOUCH: f64 = 1e-9;
/// No step of a motion is looked at more finely than this, m.
const FINEST_M: f64 = 0.005;

/// A map with what makes looking fast. Beyond its borders everything is in the way.
#[derive(Clone, Debug)]
pub struct Space {
    /// The map.
    pub map: Map,
    /// From each cell's centre to the nearest square in the way, in cells.
    clearance: Vec<f32>,
    /// How many cells before each one of its row are in the way; a row has one more than cells.
    counts: Vec<u32>,
}

/// Looks for a footprint with some room around it.
#[derive(Clone, Debug)]
pub struct Checker<'a> {
    space: &'a Space,
    /// The outline with its room, in cells.
    outline: Vec<Point>,
    /// From base_link to its farthest corner, in cells.
    reach: f64,
    /// How far points may move from one look to the next, in cells.
    step: f64,
    rows: Vec<[f64; 2]>,
}

impl Space {
    /// Of a map.
    pub fn new(map: Map) -> Space {
        let (width, height) = (map.width, map.height);
        let squares = distance::squares(&map.blocked, width, Between::CentreAndSquare);
        let clearance = squares.iter().enumerate().map(|(at, square)| {
            let (column, row) = (at % width, at / width);
            let border = column.min(width - 1 - column).min(row).min(height - 1 - row) as f64 + 0.5;
            square.sqrt().min(border) as f32
        });
        let clearance = clearance.collect();
        let mut counts = Vec::with_capacity((width + 1) * height);
        for row in map.blocked.chunks_exact(width) {
            let mut count = 0;
            counts.push(0);
            for blocked in row {
                count += u32::from(*blocked);
                counts.push(count);
            }
        }
        Space { map, clearance, counts }
    }

    /// From each cell's centre to the nearest square in the way or the border, in cells, row by row.
    pub fn clearance(&self) -> &[f32] {
        &self.clearance
    }

    /// A checker for a footprint with room around it, m.
    pub fn checker(&self, footprint: &Footprint, room_m: f64) -> Checker<'_> {
        let cell_m = self.map.cell_m;
        // What is looked at with half a step of room covers all that lies between two looks.
        let step_m = (0.5 * room_m).max(FINEST_M);
        let outline: Vec<Point> =
            if room_m > 0.0 { footprint.around(room_m) } else { footprint.corners_m().to_vec() };
        let outline: Vec<Point> = outline.iter().map(|corner| corner.map(|part| part / cell_m)).collect();
        let reach = outline.iter().map(|corner| corner[0].hypot(corner[1])).fold(0.0, f64::max);
        Checker { space: self, outline, reach, step: step_m / cell_m, rows: Vec::new() }
    }

    /// From a place in cells to the nearest thing in the way, at least, in cells.
    pub(crate) fn room(&self, pose: &Pose2) -> f64 {
        self.least_clearance([pose.x_m, pose.y_m]).unwrap_or(0.0).max(0.0)
    }

    /// Whether a row has anything in the way between two coordinates.
    fn is_row_free(&self, row: usize, [from, to]: [f64; 2]) -> bool {
        let width = self.map.width;
        let first = (from + TOUCH).floor().max(0.0) as usize;
        let end = ((to - TOUCH).ceil().max(0.0) as usize).min(width);
        let counts = &self.counts[row * (width + 1)..(row + 1) * (width + 1)];
        end <= first || counts[end] == counts[first]
    }

    /// A place's clearance is at least this, in cells; `None` beyond the borders.
    fn least_clearance(&self, [x, y]: Point) -> Option<f64> {
        if !(x >= 0.0 && y >= 0.0) {
            return None;
        }
        let (column, row) = (x as usize, y as usize);
        if column >= self.map.width || row >= self.map.height {
            return None;
        }
        let off = (x - column as f64 - 0.5).hypot(y - row as f64 - 0.5);
        Some(f64::from(self.clearance[row * self.map.width + column]) - off)
    }
}

impl Checker<'_> {
    /// Whether nothing is in the way of a pose in the map's frame.
    pub fn is_free(&mut self, pose: &Pose2) -> bool {
        let pose = self.in_cells(pose);
        self.is_free_in_cells(&pose)
    }

    /// A pose in the map's frame as the grid has it, in cells.
    pub(crate) fn in_cells(&self, pose: &Pose2) -> Pose2 {
        let map = &self.space.map;
        let at = map.map_from_grid.inverse().then(*pose);
        Pose2 { x_m: at.x_m / map.cell_m, y_m: at.y_m / map.cell_m, ..at }
    }

    pub(crate) fn is_free_in_cells(&mut self, pose: &Pose2) -> bool {
        match self.space.least_clearance([pose.x_m, pose.y_m]) {
            Some(clearance) if clearance >= self.reach => true,
            Some(_) => {
                let corners = placed(&self.outline, pose);
                self.is_polygon_free(&corners)
            }
            None => false,
        }
    }

    /// Whether nothing is in the way of a motion along which place and heading change evenly.
    pub fn is_motion_free(&mut self, from: &Pose2, to: &Pose2) -> bool {
        let [from, to] = [from, to].map(|pose| self.in_cells(pose));
        self.is_motion_free_in_cells(&from, &to)
    }

    pub(crate) fn is_motion_free_in_cells(&mut self, from: &Pose2, to: &Pose2) -> bool {
        let turn_rad = to.heading_rad - from.heading_rad;
        let way = [to.x_m - from.x_m, to.y_m - from.y_m];
        let length = way[0].hypot(way[1]);
        let moves = length + self.reach * turn_rad.abs();
        let mut done = 0.0;
        // At each look all is free for as far as the clearance lasts.
        loop {
            let part: f64 = if moves > 0.0 { (done / moves).min(1.0) } else { 1.0 };
            let pose = Pose2 {
                x_m: from.x_m + part * way[0],
                y_m: from.y_m + part * way[1],
                heading_rad: from.heading_rad + part * turn_rad,
            };
            let Some(clearance) = self.space.least_clearance([pose.x_m, pose.y_m]) else { return false };
            let spare = clearance - self.reach;
            if spare < 0.0 {
                let corners = placed(&self.outline, &pose);
                if !self.is_polygon_free(&corners) {
                    return false;
                }
            }
            if part >= 1.0 {
                return true;
            }
            // The last look is at the end itself.
            done = (done + spare.max(self.step)).min(moves);
        }
    }

    /// Whether a convex polygon touches nothing, in cells: a row of cells meets it in one range.
    fn is_polygon_free(&mut self, corners: &[Point]) -> bool {
        let range = |axis: usize| {
            let each = || corners.iter().map(|corner| corner[axis]);
            [each().fold(f64::INFINITY, f64::min), each().fold(f64::NEG_INFINITY, f64::max)]
        };
        let ([left, right], [low, high]) = (range(0), range(1));
        let map = &self.space.map;
        let is_within = left >= -TOUCH && low >= -TOUCH;
        if !(is_within && right <= map.width as f64 + TOUCH && high <= map.height as f64 + TOUCH) {
            return false;
        }
        let first = (low + TOUCH).floor().max(0.0) as usize;
        let end = ((high - TOUCH).ceil().max(0.0) as usize).min(map.height);
        self.rows.clear();
        self.rows.resize(end.saturating_sub(first), [f64::INFINITY, f64::NEG_INFINITY]);
        for (number, from) in corners.iter().enumerate() {
            let to = corners[(number + 1) % corners.len()];
            let (below, above) = if from[1] <= to[1] { (*from, to) } else { (to, *from) };
            let slope = if above[1] > below[1] { (above[0] - below[0]) / (above[1] - below[1]) } else { 0.0 };
            let last = (above[1].floor().max(0.0) as usize).min(end.max(1) - 1);
            for row in (below[1].floor().max(0.0) as usize).max(first)..=last {
                let [y_from, y_to] = [(row as f64).max(below[1]), (row as f64 + 1.0).min(above[1])];
                let ends = if above[1] > below[1] {
                    [y_from, y_to].map(|y| below[0] + slope * (y - below[1]))
                } else {
                    [below[0], above[0]]
                };
                let range = &mut self.rows[row - first];
                range[0] = range[0].min(ends[0]).min(ends[1]);
                range[1] = range[1].max(ends[0]).max(ends[1]);
            }
        }
        self.rows.iter().enumerate().all(|(row, range)| self.space.is_row_free(first + row, *range))
    }
}
