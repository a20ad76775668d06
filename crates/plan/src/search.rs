//! The shortest way of a disc: over the cells' places, pulled taut.
//!
//! A place is open where the disc fits: a cell's centre, in a gap and at the ends of a way another place of it. A step from centre to centre needs
//! all four corners of the square between them open, so that no occupied cell reaches in between by more than a few tenths of a millimetre.
//!
//! - `tree`: how cells are reached from one end, until the other one is.
//! - `sight`: whether the disc gets straight from one place to another.
//! - `queue`: which cell is next.

use crate::gaps::{AROUND, Gap, Gaps, number};
use crate::space::Space;
use crate::until::Until;

mod queue;
mod sight;
#[cfg(test)]
mod tests;
mod tree;

pub(crate) use queue::Queue;

/// A disc's places.
#[derive(Clone, Copy, Debug)]
pub struct Search<'a> {
    width: usize,
    height: usize,
    /// One over the width.
    per_width: f64,
    clearance: &'a [f32],
    gaps: &'a [Gap],
    radius: f32,
    /// From a barred cell to what is nearest there is at most so much more room than the disc needs, in cells; 0 where none is barred.
    barred: f32,
    until: Until<'a>,
}

impl<'a> Search<'a> {
    /// For a disc of a radius, m, by each cell's clearance, in cells.
    pub fn new(space: &Space, clearance: &'a [f32], radius_m: f64) -> Self {
        let radius = (radius_m / space.map.cell_m) as f32;
        Search::of_cells([space.map.width, space.map.height], clearance, radius)
    }

    /// For a disc of a radius, in cells, in so many columns and rows.
    pub(crate) fn of_cells([width, height]: [usize; 2], clearance: &'a [f32], radius: f32) -> Self {
        let per_width = 1.0 / width as f64;
        let until = Until::default();
        Search { width, height, per_width, clearance, gaps: &[], radius, barred: 0.0, until }
    }

    /// The same through gaps, too.
    pub fn through(space: &Space, gaps: &'a Gaps<'_>, radius_m: f64) -> Self {
        Search { gaps: &gaps.gaps, ..Search::new(space, &gaps.clearance, radius_m) }
    }

    /// The same by other clearances, in cells, in a map of so many columns and rows.
    pub(crate) fn of(&self, size: [usize; 2], clearance: &'a [f32]) -> Self {
        Search { until: self.until, ..Search::of_cells(size, clearance, self.radius) }
    }

    /// The same by other gaps, in a map of so many columns and rows.
    pub(crate) fn by(&self, size: [usize; 2], gaps: &'a Gaps<'_>) -> Self {
        Search { gaps: &gaps.gaps, ..self.of(size, &gaps.clearance) }
    }

    /// The same by gaps of which cells are barred that had at most so much more room than the disc needs, in cells.
    pub(crate) fn barred(&self, gaps: &'a Gaps<'_>, room: f32) -> Self {
        Search { barred: room, ..self.by([self.width, self.height], gaps) }
    }

    /// The same, which finds nothing more once it is over.
    #[must_use]
    pub fn until(self, until: Until<'a>) -> Self {
        Search { until, ..self }
    }

    /// Whether whoever waits ends it.
    pub(crate) fn is_over(&self) -> bool {
        self.until.is_over()
    }

    pub(crate) fn queue<T: Copy>(&self) -> Queue<'a, T> {
        Queue::new(self.until)
    }

    /// Column and row. A product is several times as fast as a division, and exact: half a cell is far more than its rounding.
    fn split(&self, at: usize) -> (usize, usize) {
        let row = ((at as f64 + 0.5) * self.per_width) as usize;
        (at - row * self.width, row)
    }

    /// Columns and rows.
    pub(crate) fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// In cells.
    pub(crate) fn radius(&self) -> f32 {
        self.radius
    }

    /// From each cell's centre to what is nearest, in cells.
    pub(crate) fn clearance(&self) -> &'a [f32] {
        self.clearance
    }

    /// Whether the disc fits at a cell's centre.
    pub fn is_open(&self, at: usize) -> bool {
        self.clearance[at] >= self.radius
    }

    /// The gap whose place a cell has.
    pub(crate) fn gap(&self, at: usize) -> Option<&'a Gap> {
        self.gaps.get(number(self.clearance[at])?)
    }

    /// Whether the disc fits at a cell's place.
    pub(crate) fn takes(&self, at: usize) -> bool {
        self.is_open(at) || self.gap(at).is_some()
    }

    /// From a cell's centre to what is nearest, in cells, also where the cell's place is another one.
    fn room(&self, at: usize) -> f32 {
        self.gap(at).map_or(self.clearance[at], |gap| gap.room)
    }

    pub(crate) fn index(&self, column: usize, row: usize) -> usize {
        row * self.width + column
    }

    /// A cell, or one beside it, where the disc fits.
    pub(crate) fn open_near(&self, at: usize) -> Option<usize> {
        let (column, row) = self.split(at);
        let columns = column.saturating_sub(1)..(column + 2).min(self.width);
        let rows = row.saturating_sub(1)..(row + 2).min(self.height);
        let cells = rows.flat_map(|row| columns.clone().map(move |column| (column, row)));
        let open = cells.map(|(column, row)| self.index(column, row)).filter(|cell| self.takes(*cell));
        open.min_by(|a, b| self.apart(at, *a).total_cmp(&self.apart(at, *b)))
    }

    /// Whether few cells hang together with one.
    pub(crate) fn is_small(&self, from: usize) -> bool {
        let everywhere = Search { radius: 0.5, gaps: &[], ..*self };
        let mut seen = vec![false; self.clearance.len()];
        let mut left = vec![from];
        let mut count = 0;
        while let Some(at) = left.pop() {
            if std::mem::replace(&mut seen[at], true) {
                continue;
            }
            count += 1;
            let (neighbours, size) = everywhere.neighbours(at);
            left.extend(neighbours[..size].iter().filter(|next| !seen[**next]));
        }
        2 * count < self.clearance.iter().filter(|clearance| **clearance >= 0.5).count()
    }

    /// Where the disc stands in a cell, from the first cell's centre.
    pub(crate) fn place(&self, at: usize) -> [f32; 2] {
        if !self.gaps.is_empty()
            && let Some(gap) = self.gap(at)
        {
            return gap.at.map(|at| (at - 0.5) as f32);
        }
        let (column, row) = self.split(at);
        [column as f32, row as f32]
    }

    pub(crate) fn apart(&self, a: usize, b: usize) -> f32 {
        distance(self.place(a), self.place(b))
    }

    /// The neighbours that one step leads to.
    pub(crate) fn neighbours(&self, at: usize) -> ([usize; 8], usize) {
        if let Some(gap) = self.gap(at) {
            let is_linked = |direction, to| gap.leads(direction) && self.takes(to);
            return self.linked(at, is_linked, ([0; 8], 0));
        }
        let (column, row) = self.split(at);
        let (left, right) = (column > 0, column + 1 < self.width);
        let (below, above) = (row > 0, row + 1 < self.height);
        let open = |is_there: bool, to: usize| is_there && self.is_open(to);
        let (w, e) = (open(left, at.wrapping_sub(1)), open(right, at + 1));
        let (s, n) = (open(below, at.wrapping_sub(self.width)), open(above, at + self.width));
        let mut found = ([0; 8], 0);
        let mut add = |is_there: bool, to: usize| {
            if is_there {
                found.0[found.1] = to;
                found.1 += 1;
            }
        };
        add(w, at.wrapping_sub(1));
        add(e, at + 1);
        add(s, at.wrapping_sub(self.width));
        add(n, at + self.width);
        for (row_open, row_at) in [(s, at.wrapping_sub(self.width)), (n, at + self.width)] {
            for (side_open, to) in [(w, row_at.wrapping_sub(1)), (e, row_at.wrapping_add(1))] {
                add(row_open && side_open && self.is_open(to), to);
            }
        }
        if self.gaps.is_empty() || found.1 == 8 {
            return found;
        }
        // A gap leads here where the opposite direction does from it.
        self.linked(at, |direction, to| self.gap(to).is_some_and(|gap| gap.leads(direction ^ 1)), found)
    }

    /// The cells around one that it is linked to, beside those that were found.
    fn linked(
        &self,
        at: usize,
        is_linked: impl Fn(usize, usize) -> bool,
        mut found: ([usize; 8], usize),
    ) -> ([usize; 8], usize) {
        let (column, row) = self.split(at);
        for (direction, [x, y]) in AROUND.into_iter().enumerate() {
            let (Some(column), Some(row)) = (column.checked_add_signed(x), row.checked_add_signed(y)) else {
                continue;
            };
            if column < self.width && row < self.height && is_linked(direction, self.index(column, row)) {
                found.0[found.1] = self.index(column, row);
                found.1 += 1;
            }
        }
        found
    }

    /// The cells of the shortest way where it turns, both ends with it; `None` where there is none.
    pub fn shortest(&self, from: usize, to: usize) -> Option<Vec<usize>> {
        let mut way = self.tree(from, to)?.way(to);
        self.pull(&mut way);
        Some(way)
    }

    /// Leaves out turns that aren't needed, and moves the others to where the way is shorter.
    pub(crate) fn pull(&self, way: &mut Vec<usize>) {
        for _ in 0..MOST_PULLS {
            let before = way.clone();
            let mut at = 1;
            while at + 1 < way.len() {
                if self.sees(way[at - 1], way[at + 1]) {
                    way.remove(at);
                    at = at.max(2) - 1;
                    continue;
                }
                way[at] = self.pulled(way[at - 1], way[at], way[at + 1]);
                at += 1;
            }
            if *way == before {
                break;
            }
        }
    }

    /// A turn moved cell by cell to where the way through it is shortest.
    fn pulled(&self, from: usize, mut at: usize, to: usize) -> usize {
        let length = |at: usize| self.apart(from, at) + self.apart(at, to);
        loop {
            let (neighbours, count) = self.neighbours(at);
            let shorter =
                neighbours[..count].iter().copied().filter(|next| length(*next) < length(at) - 1e-4);
            let seen = shorter.filter(|next| self.sees(from, *next) && self.sees(*next, to));
            match seen.min_by(|a, b| length(*a).total_cmp(&length(*b))) {
                Some(next) => at = next,
                None => return at,
            }
        }
    }

    /// The length of a way, in cells.
    pub fn length(&self, way: &[usize]) -> f64 {
        way.windows(2).map(|pair| f64::from(self.apart(pair[0], pair[1]))).sum()
    }

    /// The greatest disc, as a radius in cells, that gets from one cell to another.
    pub fn widest(&self, from: usize, to: usize) -> f32 {
        let mut best = vec![-1.0_f32; self.clearance.len()];
        best[from] = self.clearance[from];
        // Keys rise where room falls, finely: within one key of the queue cells come in any order.
        let most = self.clearance.iter().copied().fold(0.0, f32::max);
        let mut queue = self.queue();
        queue.add(KEYS * (most - best[from]), from);
        while let Some(at) = queue.next() {
            if at == to {
                break;
            }
            let everywhere = Search { radius: 0.0, gaps: &[], ..*self };
            let (neighbours, count) = everywhere.neighbours(at);
            for next in &neighbours[..count] {
                let room = best[at].min(self.clearance[*next]);
                if room > best[*next] {
                    best[*next] = room;
                    queue.add(KEYS * (most - room), *next);
                }
            }
        }
        best[to].max(0.0)
    }
}

fn distance([ax, ay]: [f32; 2], [bx, by]: [f32; 2]) -> f32 {
    ((ax - bx) * (ax - bx) + (ay - by) * (ay - by)).sqrt()
}

/// Of the room that is looked for, keys in one of ways.
const KEYS: f32 = 16.0;
/// Rounds of pulling.
const MOST_PULLS: usize = 50;
