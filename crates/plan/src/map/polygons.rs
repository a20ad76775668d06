//! Polygons and circles on a map.

use std::borrow::Cow;

use super::{Map, Solid};
use crate::Point;

impl Map {
    /// Blocks every cell that a circle touches; its radius in m.
    pub fn block_circle(&mut self, centre_m: Point, radius_m: f64) {
        let [x, y] = self.grid_cells(centre_m);
        let radius = radius_m.max(0.0) / self.cell_m;
        let (width, height) = (self.width, self.height);
        for row in cells(y - radius, y + radius, height) {
            let off = outside(y, row);
            if off > radius {
                continue;
            }
            let half = (radius * radius - off * off).sqrt();
            for column in cells(x - half, x + half, width) {
                self.blocked[row * width + column] = true;
            }
        }
    }

    /// Blocks what is within a distance of the sides of a closed polygon, m.
    pub fn block_sides(&mut self, corners_m: &[Point], distance_m: f64) {
        for (number, from) in corners_m.iter().enumerate() {
            let to = corners_m[(number + 1) % corners_m.len()];
            let side = [to[0] - from[0], to[1] - from[1]];
            let size = side[0].hypot(side[1]);
            if distance_m <= 0.0 || size <= 0.0 {
                continue;
            }
            let off = [-side[1] / size * distance_m, side[0] / size * distance_m];
            let corner = |at: &Point, sign: f64| [at[0] + sign * off[0], at[1] + sign * off[1]];
            self.block_polygon(&[corner(from, 1.0), corner(&to, 1.0), corner(&to, -1.0), corner(from, -1.0)]);
            self.block_circle(*from, distance_m);
        }
    }

    /// Puts a closed polygon in the way, exactly.
    pub fn block_polygon(&mut self, corners_m: &[Point]) {
        self.solids.push(Solid::new(corners_m.iter().map(|corner| self.grid_cells(*corner)).collect()));
    }

    /// Which cells are in the way, those that a polygon touches too.
    pub fn touched(&self) -> Cow<'_, [bool]> {
        if self.solids.is_empty() {
            return Cow::Borrowed(&self.blocked);
        }
        let mut all = self.clone();
        for solid in &self.solids {
            all.mark_sides(solid.corners());
            all.mark_rows(solid.corners(), |is_inside| is_inside);
        }
        Cow::Owned(all.blocked)
    }

    /// Blocks every cell that isn't wholly inside a closed polygon.
    pub fn keep_inside(&mut self, corners_m: &[Point]) {
        let corners: Vec<Point> = corners_m.iter().map(|corner| self.grid_cells(*corner)).collect();
        self.mark_sides(&corners);
        self.mark_rows(&corners, |is_inside| !is_inside);
    }

    /// Blocks the cells that a polygon's sides go through. A side along a border of cells leaves both free: what lies inside
    /// is told by the cells' centres.
    fn mark_sides(&mut self, corners: &[Point]) {
        for (number, from) in corners.iter().enumerate() {
            let to = corners[(number + 1) % corners.len()];
            let (low, high) = if from[1] <= to[1] { (*from, to) } else { (to, *from) };
            for row in cells(low[1], high[1], self.height) {
                let part = |y: f64| match high[1] - low[1] {
                    rise if rise > 0.0 => ((y - low[1]) / rise).clamp(0.0, 1.0),
                    _ => 0.0,
                };
                let x = |part: f64| low[0] + part * (high[0] - low[0]);
                let (mut one, mut other) = (x(part(row as f64)), x(part(row as f64 + 1.0)));
                if high[1] - low[1] <= 0.0 {
                    (one, other) = (low[0], high[0]);
                }
                for column in cells(one.min(other), one.max(other), self.width) {
                    self.blocked[row * self.width + column] = true;
                }
            }
        }
    }

    /// Blocks cells by whether their centres lie inside.
    fn mark_rows(&mut self, corners: &[Point], blocks: impl Fn(bool) -> bool) {
        let mut crossings: Vec<f64> = Vec::new();
        for row in 0..self.height {
            let y = row as f64 + 0.5;
            crossings.clear();
            for (number, from) in corners.iter().enumerate() {
                let to = corners[(number + 1) % corners.len()];
                if (from[1] > y) != (to[1] > y) {
                    crossings.push(from[0] + (y - from[1]) / (to[1] - from[1]) * (to[0] - from[0]));
                }
            }
            crossings.sort_by(f64::total_cmp);
            // Whose centre lies at a crossing or behind it is beyond it.
            let ends = crossings.iter().map(|x| (x - 0.5).ceil().clamp(0.0, self.width as f64) as usize);
            let row = &mut self.blocked[row * self.width..(row + 1) * self.width];
            let (mut begin, mut is_inside) = (0, false);
            for end in ends.chain([row.len()]) {
                if blocks(is_inside) && end > begin {
                    row[begin..end].fill(true);
                }
                (begin, is_inside) = (end, !is_inside);
            }
        }
    }
}

/// How near a border counts as on it, in cells.
const ON_BORDER: f64 = 1e-9;

/// The cells whose inside a range of coordinates touches; along a border none.
fn cells(from: f64, to: f64, count: usize) -> std::ops::Range<usize> {
    let first = (from + ON_BORDER).floor().clamp(0.0, count as f64) as usize;
    let end = (to - ON_BORDER).ceil().clamp(0.0, count as f64) as usize;
    first..end.max(first)
}

/// How far a coordinate is outside a cell.
fn outside(at: f64, cell: usize) -> f64 {
    let low = cell as f64;
    (low - at).max(at - low - 1.0).max(0.0)
}
