//! A way that keeps to the middle: what is near a wall and far from the ridge between walls costs more.
//!
//! The ridge is the generalised Voronoi diagram of what is in the way: where the distance to it no longer rises. The field is that of
//! Dolgov, Thrun, Montemerlo, Diebel, Path Planning for Autonomous Vehicles in Unknown Semi-structured Environments (2010).

use crate::distance::{self, Between};
use crate::search::Search;
use crate::space::Space;

/// Walls farther away than this cost nothing, m.
const FAR_M: f64 = 2.5;
/// How fast the field falls with the distance from a wall, m.
const FALL_M: f64 = 0.5;
/// A step where the field is 1 costs so many times its length more.
const WEIGHT: f32 = 6.0;
/// Where the clearance rises by less than this a cell, it is a ridge; elsewhere it rises by 1.
const RIDGE_RISE: f32 = 0.85;

/// The cost of a cell's length beside the length itself, row by row.
pub fn field(space: &Space) -> Vec<f32> {
    let (width, height, cell_m) = (space.map.width, space.map.height, space.map.cell_m);
    let clearance = space.clearance();
    let is_ridge = |at: usize| {
        let (column, row) = (at % width, at / width);
        if column == 0 || row == 0 || column + 1 == width || row + 1 == height || clearance[at] <= 0.0 {
            return false;
        }
        let rise = [clearance[at + 1] - clearance[at - 1], clearance[at + width] - clearance[at - width]];
        0.5 * rise[0].hypot(rise[1]) < RIDGE_RISE
    };
    let ridges: Vec<bool> = (0..clearance.len()).map(is_ridge).collect();
    let to_ridge = distance::squares(&ridges, width, Between::Centres);
    let value = |(clearance, square): (&f32, f64)| {
        let (wall_m, ridge_m) = (f64::from(*clearance) * cell_m, square.sqrt().min(1e6) * cell_m);
        if wall_m >= FAR_M {
            return 0.0;
        }
        let far = (FAR_M - wall_m) / FAR_M;
        let between = ridge_m / (wall_m + ridge_m).max(f64::MIN_POSITIVE);
        (FALL_M / (FALL_M + wall_m) * between * far * far) as f32
    };
    clearance.iter().zip(to_ridge).map(value).collect()
}

impl Search<'_> {
    /// The cells of the way that costs least by a field; `None` where there is none.
    pub fn cheapest(&self, [from, to]: [usize; 2], field: &[f32]) -> Option<Vec<usize>> {
        if !self.takes(from) || !self.takes(to) {
            return None;
        }
        let mut cost = vec![f32::INFINITY; field.len()];
        let mut parent = vec![u32::MAX; field.len()];
        let mut done = vec![false; field.len()];
        cost[from] = 0.0;
        let mut queue = self.queue();
        queue.add(0.0, from);
        while let Some(at) = queue.next() {
            if std::mem::replace(&mut done[at], true) {
                continue;
            }
            if at == to {
                let mut way = vec![to];
                while let Some(next) = way.last().map(|at| parent[*at]).filter(|next| *next != u32::MAX) {
                    way.push(next as usize);
                }
                way.reverse();
                return Some(self.straightened(&way, field));
            }
            let (neighbours, count) = self.neighbours(at);
            for next in neighbours[..count].iter().filter(|next| !done[**next]) {
                let found = cost[at] + self.step_cost([at, *next], field);
                if found < cost[*next] {
                    cost[*next] = found;
                    parent[*next] = at as u32;
                    queue.add(found + self.apart(*next, to), *next);
                }
            }
        }
        None
    }

    fn step_cost(&self, [from, to]: [usize; 2], field: &[f32]) -> f32 {
        self.apart(from, to) * (1.0 + WEIGHT * 0.5 * (field[from] + field[to]))
    }

    /// Leaves out what of a way isn't cheaper than going straight.
    fn straightened(&self, way: &[usize], field: &[f32]) -> Vec<usize> {
        let mut along = vec![0.0];
        for pair in way.windows(2) {
            along.push(along[along.len() - 1] + self.step_cost([pair[0], pair[1]], field));
        }
        let mut kept = vec![way[0]];
        let mut at = 0;
        while at + 1 < way.len() {
            let mut next = at + 1;
            while next + 1 < way.len() {
                let straight = [way[at], way[next + 1]];
                let is_cheap = self.straight_cost(straight, field) <= (along[next + 1] - along[at]) * 1.001;
                if !is_cheap || !self.sees(straight[0], straight[1]) {
                    break;
                }
                next += 1;
            }
            kept.push(way[next]);
            at = next;
        }
        kept
    }

    fn straight_cost(&self, [from, to]: [usize; 2], field: &[f32]) -> f32 {
        let ([x, y], [x_to, y_to]) = (self.place(from), self.place(to));
        let length = self.apart(from, to);
        let count = length.ceil().max(1.0) as usize;
        let value = |number: usize| {
            let part = (number as f32 + 0.5) / count as f32;
            let [x, y] = [x + part * (x_to - x), y + part * (y_to - y)].map(|at| at.round() as usize);
            field[self.index(x, y)]
        };
        length * (1.0 + WEIGHT * (0..count).map(value).sum::<f32>() / count as f32)
    }
}
