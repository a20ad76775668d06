//! Places between centres: a gap that hardly takes a disc may hold no cell whose centre does, though the gap's middle lies in some of them.
//!
//! The middle of a gap is a ridge of the clearance. A cell on it is represented by the place on its square where there is most room.

use std::borrow::Cow;

use crate::Point;
use crate::space::Space;

/// Where the clearance rises by less than this a cell, a ridge is near: beside one wall, straight or bent, it rises by all but 1.
const RIDGE_RISE: f32 = 0.9;
/// A square's centre is so far from its corners, in cells.
const HALF_DIAGONAL: f32 = std::f32::consts::FRAC_1_SQRT_2;
/// Steps of looking for the most room, each half of the one before, in cells.
const STEPS: [f64; 8] = [0.4, 0.2, 0.1, 0.05, 0.025, 0.012, 0.006, 0.003];
/// Between two looks along a piece that all but touches, in cells.
const LOOK: f64 = 0.05;
/// A piece may come nearer than the radius by this, in cells: rounding.
const TOUCH: f64 = 1e-6;

/// The cells around one, each beside its opposite.
pub(crate) const AROUND: [[isize; 2]; 8] =
    [[1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [-1, -1], [1, -1], [-1, 1]];

/// A cell's place in a gap.
#[derive(Clone, Copy, Debug)]
pub struct Gap {
    /// Where, in cells as the grid has it.
    pub(crate) at: Point,
    /// To which of the cells around it gets straight, by [`AROUND`].
    links: u8,
    /// From the cell's centre to what is nearest, in cells.
    pub(crate) room: f32,
}

impl Gap {
    /// Whether it gets straight to the cell in a direction of [`AROUND`].
    pub(crate) fn leads(&self, direction: usize) -> bool {
        self.links >> direction & 1 == 1
    }
}

/// Each cell's clearance, and the gaps of a disc.
#[derive(Clone, Debug)]
pub struct Gaps<'a> {
    /// In cells; of a gap its number, from −1 downwards.
    pub(crate) clearance: Cow<'a, [f32]>,
    pub(crate) gaps: Vec<Gap>,
}

/// A part of a map.
#[derive(Clone, Debug)]
pub struct Part {
    /// Its first column and row.
    pub(crate) low: [usize; 2],
    /// How many columns and rows it has.
    pub(crate) size: [usize; 2],
    /// Whether each of its cells counts, row by row.
    pub(crate) counts: Vec<bool>,
    /// Columns of the map.
    pub(crate) width: usize,
}

impl Part {
    /// What is known of its cells, by what is known of each cell of the map: 0 of those that don't count.
    pub(crate) fn of(&self, known: &[f32]) -> Vec<f32> {
        let cell =
            |at: usize| (self.low[1] + at / self.size[0]) * self.width + self.low[0] + at % self.size[0];
        let counts = self.counts.iter().enumerate();
        counts.map(|(at, counts)| if *counts { known[cell(at)] } else { 0.0 }).collect()
    }
}

/// The number of a gap by its cell's clearance.
pub(crate) fn number(clearance: f32) -> Option<usize> {
    (clearance < 0.0).then(|| (-clearance) as usize - 1)
}

impl<'a> Gaps<'a> {
    /// For a disc of a radius, in cells, among cells of this clearance, in cells: of those whose centres have less room than `below`. Ends of a
    /// way, in cells, are places of their cells, where the disc fits there.
    pub fn new(space: &Space, clearance: &'a [f32], radius: f32, below: f32, ends: &[Point]) -> Self {
        let width = space.map.width;
        let range = (radius - HALF_DIAGONAL).max(0.0)..below;
        let is_near_ridge = |at: usize| is_near_ridge(clearance, width, at);
        let near = clearance.iter().enumerate().filter(|(_, room)| range.contains(room));
        // Nothing stands in an occupied cell.
        let near = near.map(|(at, _)| at).filter(|at| !space.map.blocked[*at] && is_near_ridge(*at));
        let found = near.filter_map(|cell| Some((cell, middle(space, cell, f64::from(radius))?)));
        let mut found: Vec<(usize, Point)> = found.collect();
        let centre = |cell: usize| [(cell % width) as f64 + 0.5, (cell / width) as f64 + 0.5];
        // An open cell whose diagonal step fits though a cell beside it isn't open: that step is one through a gap.
        let is_open = |cell: usize| clearance.get(cell).is_some_and(|room| *room >= radius);
        let narrow = below.max(radius)..radius + HALF_DIAGONAL;
        let narrow = clearance.iter().enumerate().filter(|(_, room)| narrow.contains(room));
        let narrow = narrow.map(|(at, _)| at).filter(|at| is_near_ridge(*at));
        found.extend(narrow.map(|cell| (cell, centre(cell))).filter(|(cell, at)| {
            AROUND[4..].iter().any(|[x, y]| {
                let [side, other] = [*x, y * width as isize].map(|step| cell.wrapping_add_signed(step));
                let next = cell.wrapping_add_signed(x + y * width as isize);
                is_open(next)
                    && !(is_open(side) && is_open(other))
                    && is_free(space, [*at, centre(next)], f64::from(radius))
            })
        }));
        for end in ends.iter().filter(|end| space.distance(**end, f64::from(radius)) >= f64::from(radius)) {
            let cell = end[1] as usize * width + end[0] as usize;
            found.retain(|(other, _)| *other != cell);
            found.push((cell, *end));
        }
        let mut all = Gaps { clearance: Cow::Borrowed(clearance), gaps: Vec::new() };
        for (number, (cell, at)) in found.iter().enumerate() {
            all.clearance.to_mut()[*cell] = -(number as f32) - 1.0;
            all.gaps.push(Gap { at: *at, links: 0, room: clearance[*cell] });
        }
        for (number, (cell, at)) in found.iter().enumerate() {
            let leads = |[x, y]: [isize; 2]| {
                let next = cell.wrapping_add_signed(x + y * width as isize);
                let to = all.place(next, width, radius)?;
                is_free(space, [*at, to], f64::from(radius)).then_some(())
            };
            let links = AROUND.iter().enumerate().filter(|(_, step)| leads(**step).is_some());
            all.gaps[number].links = links.fold(0, |links, (direction, _)| links | 1 << direction);
        }
        all
    }

    /// Leaves nothing of some cells.
    pub(crate) fn bar(&mut self, cells: &[usize]) {
        let clearance = self.clearance.to_mut();
        cells.iter().for_each(|cell| clearance[*cell] = 0.0);
    }

    /// The same of a part of the map alone, whose cells have the numbers of a map that is no larger.
    pub(crate) fn within(&self, part: &Part) -> Gaps<'static> {
        let mut gaps = Vec::new();
        let mut cut = |clearance: f32| match number(clearance) {
            Some(number) => {
                let gap = self.gaps[number];
                let at = [0, 1].map(|axis| gap.at[axis] - part.low[axis] as f64);
                gaps.push(Gap { at, ..gap });
                -(gaps.len() as f32)
            }
            None => clearance,
        };
        let clearance = part.of(&self.clearance).into_iter().map(&mut cut).collect();
        Gaps { clearance: Cow::Owned(clearance), gaps }
    }

    /// Where a disc stands in a cell; `None` where it doesn't.
    fn place(&self, cell: usize, width: usize, radius: f32) -> Option<Point> {
        let clearance = self.clearance[cell];
        match number(clearance) {
            Some(number) => Some(self.gaps[number].at),
            None if clearance >= radius => Some([(cell % width) as f64 + 0.5, (cell / width) as f64 + 0.5]),
            None => None,
        }
    }
}

/// Whether things on more sides than one are near a cell, by each cell's clearance.
pub(crate) fn is_near_ridge(clearance: &[f32], width: usize, at: usize) -> bool {
    let column = at % width;
    if column == 0 || at < width || column + 1 == width || at + width >= clearance.len() {
        return false;
    }
    let rise = [clearance[at + 1] - clearance[at - 1], clearance[at + width] - clearance[at - width]];
    0.5 * rise[0].hypot(rise[1]) < RIDGE_RISE
}

/// Where on a cell's square there is most room; `None` where a disc doesn't fit.
fn middle(space: &Space, cell: usize, radius: f64) -> Option<Point> {
    let low = [(cell % space.map.width) as f64, (cell / space.map.width) as f64];
    let most = radius + 2.0;
    let mut best = low.map(|at| at + 0.5);
    let mut room = space.distance(best, most);
    for step in STEPS {
        loop {
            let next = |[x, y]: &[isize; 2]| {
                let by = |axis: usize, steps: isize| {
                    (best[axis] + step * steps as f64).clamp(low[axis], low[axis] + 1.0)
                };
                let place = [by(0, *x), by(1, *y)];
                (place, space.distance(place, most))
            };
            match AROUND.iter().map(next).max_by(|a, b| a.1.total_cmp(&b.1)) {
                Some((place, more)) if more > room + 1e-9 => (best, room) = (place, more),
                _ => break,
            }
        }
        // Half a step finer nothing rises by more than what all finer steps together make.
        if room + 4.0 * step < radius {
            return None;
        }
    }
    (room >= radius).then_some(best)
}

/// Whether a disc gets straight from one place to another.
fn is_free(space: &Space, [from, to]: [Point; 2], radius: f64) -> bool {
    let way = [to[0] - from[0], to[1] - from[1]];
    let length = way[0].hypot(way[1]);
    let mut done = 0.0;
    loop {
        let part = if length > 0.0 { f64::min(done / length, 1.0) } else { 1.0 };
        let room = space.distance([from[0] + part * way[0], from[1] + part * way[1]], radius + 2.0);
        if room < radius - TOUCH {
            return false;
        }
        if part >= 1.0 {
            return true;
        }
        done += (room - radius).max(LOOK);
    }
}
