//! The shortest way of a disc: Lazy Theta* over the cells' centres, pulled taut.
//!
//! Source: Nash, Koenig, Tovey, Lazy Theta* (2010). A place is open where the disc fits; a step from centre to centre needs all
//! four corners of the square between them open, so that no occupied cell reaches in between by more than a few tenths of a
//! millimetre.

use crate::ahead::Ahead;
use crate::gaps::{AROUND, Gap, Gaps, number};
use crate::space::Space;
use crate::until::Until;

/// Keys of the queue in a cell.
const FINE: f32 = 4.0;
const NOBODY: u32 = u32::MAX;

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
    until: Until<'a>,
}

impl<'a> Search<'a> {
    /// For a disc of a radius, m, by each cell's clearance, in cells.
    pub fn new(space: &Space, clearance: &'a [f32], radius_m: f64) -> Self {
        let radius = (radius_m / space.map.cell_m) as f32;
        let (width, height) = (space.map.width, space.map.height);
        let per_width = 1.0 / width as f64;
        Search { width, height, per_width, clearance, gaps: &[], radius, until: Until::default() }
    }

    /// The same through gaps, too.
    pub fn through(space: &Space, gaps: &'a Gaps<'_>, radius_m: f64) -> Self {
        Search { gaps: &gaps.gaps, ..Search::new(space, &gaps.clearance, radius_m) }
    }

    /// The same, which finds nothing more once it is over.
    #[must_use]
    pub fn until(self, until: Until<'a>) -> Self {
        Search { until, ..self }
    }

    pub(crate) fn queue(&self) -> Queue<'a> {
        Queue { until: self.until, ..Queue::default() }
    }

    /// Column and row. A product is several times as fast as a division, and exact: half a cell is far more than its rounding.
    fn split(&self, at: usize) -> (usize, usize) {
        let row = ((at as f64 + 0.5) * self.per_width) as usize;
        (at - row * self.width, row)
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
            return self.linked(at, |direction, _| gap.leads(direction), ([0; 8], 0));
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

    /// Whether the disc gets straight from one centre to another.
    pub fn sees(&self, from: usize, to: usize) -> bool {
        // In a gap steps are looked at, not views.
        if !self.gaps.is_empty() && (self.gap(from).is_some() || self.gap(to).is_some()) {
            return false;
        }
        let ([x, y], [x_to, y_to]) = (self.place(from), self.place(to));
        let (dx, dy) = (x_to - x, y_to - y);
        let length = (dx * dx + dy * dy).sqrt();
        if length <= 0.0 {
            return self.is_open(from);
        }
        let (across, along) = (Along::new(x, dx / length), Along::new(y, dy / length));
        let mut done = 0.0_f32;
        while done < length - INSIDE {
            // The square between four centres that is being crossed.
            let (column, row) = (across.first(done), along.first(done));
            let low = row * self.width + column;
            let spare = self.clearance[low] - self.radius;
            if spare >= FAR {
                done += spare - BESIDE;
                continue;
            }
            let high = low + if along.is_still { 0 } else { self.width };
            let beside = usize::from(!across.is_still);
            let is_open = spare >= 0.0
                && self.is_open(low + beside)
                && self.is_open(high)
                && self.is_open(high + beside);
            if !is_open {
                return false;
            }
            let (leaves, other) = (across.leaves(column), along.leaves(row));
            let leaves = if leaves < other { leaves } else { other };
            let least = done + INSIDE;
            done = if leaves > least { leaves } else { least };
        }
        self.is_open(to)
    }

    /// The cells of the shortest way where it turns, both ends with it; `None` where there is none.
    pub fn shortest(&self, from: usize, to: usize) -> Option<Vec<usize>> {
        let mut way = self.tree(from, to)?.way(to);
        self.pull(&mut way);
        Some(way)
    }

    /// How cells are reached until another one is; `None` where it isn't.
    fn tree(&self, from: usize, to: usize) -> Option<Tree> {
        if !self.takes(from) || !self.takes(to) {
            return None;
        }
        let ahead = Ahead::new(self, [self.width, self.height], from, to)?;
        let mut tree = Tree::new(self.clearance.len());
        tree.reach(from, NOBODY, 0.0);
        let mut queue = self.queue();
        queue.add(ahead.left(self.place(from)), from);
        while let Some(at) = queue.next() {
            if tree.cells[at].is_done {
                continue;
            }
            self.settle(&mut tree, at);
            tree.cells[at].is_done = true;
            if at == to {
                return Some(tree);
            }
            let parent = match tree.cells[at].parent {
                NOBODY => at,
                parent => parent as usize,
            };
            let (turn, so_far) = (self.place(parent), tree.cells[parent].length);
            let (neighbours, count) = self.neighbours(at);
            for next in &neighbours[..count] {
                let reached = tree.cells[*next];
                if reached.is_done {
                    continue;
                }
                let place = self.place(*next);
                let length = so_far + distance(turn, place);
                if length < reached.length {
                    tree.reach(*next, parent as u32, length);
                    queue.add(length + ahead.left(place), *next);
                }
            }
        }
        None
    }

    /// Looks whether a cell's parent sees it; otherwise the best neighbour becomes its parent.
    fn settle(&self, tree: &mut Tree, at: usize) {
        let parent = tree.cells[at].parent;
        if parent == NOBODY || self.is_seen_beside(tree, at) || self.sees(parent as usize, at) {
            return;
        }
        let (neighbours, count) = self.neighbours(at);
        let mut best = (f32::INFINITY, NOBODY);
        for next in neighbours[..count].iter().filter(|next| tree.cells[**next].is_done) {
            let length = tree.cells[*next].length + self.apart(*next, at);
            if length < best.0 {
                best = (length, *next as u32);
            }
        }
        tree.reach(at, best.1, best.0);
    }

    /// Whether a cell's parent sees it because it sees both neighbours between which it looks at it: their views are a cell apart at most, so
    /// that together they go through every square that one between them goes through, but for the last.
    fn is_seen_beside(&self, tree: &Tree, at: usize) -> bool {
        let parent = tree.cells[at].parent as usize;
        let ((column, row), (column_from, row_from)) = (self.split(at), self.split(parent));
        let (right, above) = (column > column_from, row > row_from);
        let (across, along) = (column.abs_diff(column_from), row.abs_diff(row_from));
        // Along a line of centres, or of diagonals, there is one neighbour.
        if across == 0 || along == 0 || across == along {
            return false;
        }
        let back =
            |cell: usize, is_rising: bool, step: usize| if is_rising { cell - step } else { cell + step };
        let (beside, below) = (back(at, right, 1), back(at, above, self.width));
        let diagonal = back(beside, above, self.width);
        let (straight, last) = if across > along { (beside, below) } else { (below, beside) };
        let is_seen = |cell: usize| {
            let reached = tree.cells[cell];
            reached.is_done && (reached.parent as usize == parent || cell == parent)
        };
        is_seen(straight)
            && is_seen(diagonal)
            && self.is_open(last)
            && (self.gaps.is_empty() || [at, parent].iter().all(|cell| self.gap(*cell).is_none()))
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
        // Keys rise where room falls.
        let most = self.clearance.iter().copied().fold(0.0, f32::max);
        let mut queue = self.queue();
        queue.add(most - best[from], from);
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
                    queue.add(most - room, *next);
                }
            }
        }
        best[to].max(0.0)
    }
}

fn distance([ax, ay]: [f32; 2], [bx, by]: [f32; 2]) -> f32 {
    ((ax - bx) * (ax - bx) + (ay - by) * (ay - by)).sqrt()
}

/// Rounds of pulling.
const MOST_PULLS: usize = 50;

/// Behind a border by this, in cells, one is in the next square; in a very long map less could be rounded away.
const INSIDE: f32 = 1e-3;
/// From any place of a square between centres to its first corner, at most, in cells.
const BESIDE: f32 = 1.5;
/// With so much more room than the disc needs squares needn't be looked at one by one, in cells.
const FAR: f32 = 3.0;

/// One coordinate along a straight way.
#[derive(Clone, Copy)]
struct Along {
    from: f32,
    rate: f32,
    per_rate: f32,
    /// From where it is to what is cut to the lower centre.
    inside: f32,
    /// Whether it goes along a line of centres, which then are all that it needs.
    is_still: bool,
}

impl Along {
    fn new(from: f32, rate: f32) -> Self {
        let is_still = rate.abs() < 1e-6;
        let inside = if is_still { 0.5 } else { INSIDE.copysign(rate) };
        Along { from, rate, per_rate: if is_still { f32::INFINITY } else { 1.0 / rate }, inside, is_still }
    }

    /// The lower one of the centres between which it is. A cast cuts as `floor` does where nothing is negative, and is no call.
    #[inline]
    fn first(&self, done: f32) -> usize {
        let at = self.from + done * self.rate + self.inside;
        if at > 0.0 { at as i32 as usize } else { 0 }
    }

    /// How far the way goes until it leaves a square that begins with this centre.
    #[inline]
    fn leaves(&self, low: usize) -> f32 {
        let end = if self.rate > 0.0 { low + 1 } else { low };
        if self.is_still { f32::INFINITY } else { (end as f32 - self.from) * self.per_rate }
    }
}

/// How each cell is reached.
struct Tree {
    cells: Vec<Reached>,
}

/// How a cell is reached: what belongs together lies together.
#[derive(Clone, Copy)]
struct Reached {
    length: f32,
    parent: u32,
    is_done: bool,
}

impl Tree {
    fn new(cells: usize) -> Self {
        Tree { cells: vec![Reached { length: f32::INFINITY, parent: NOBODY, is_done: false }; cells] }
    }

    fn reach(&mut self, at: usize, parent: u32, length: f32) {
        let cell = &mut self.cells[at];
        (cell.length, cell.parent) = (length, parent);
    }

    fn way(&self, to: usize) -> Vec<usize> {
        let mut way = vec![to];
        while let Some(parent) =
            way.last().map(|at| self.cells[*at].parent).filter(|parent| *parent != NOBODY)
        {
            way.push(parent as usize);
        }
        way.reverse();
        way
    }
}

/// A queue by keys that all but rise, in buckets.
#[derive(Default)]
pub(crate) struct Queue<'a> {
    buckets: Vec<Vec<u32>>,
    at: usize,
    taken: u32,
    until: Until<'a>,
}

impl Queue<'_> {
    pub(crate) fn add(&mut self, key: f32, cell: usize) {
        let bucket = (key * FINE).max(0.0) as usize;
        if bucket >= self.buckets.len() {
            self.buckets.resize_with(bucket + 1, Vec::new);
        }
        self.at = self.at.min(bucket);
        self.buckets[bucket].push(cell as u32);
    }

    /// The next one; `None` where there is none, or whoever waits ends it.
    pub(crate) fn next(&mut self) -> Option<usize> {
        if self.until.is_over_at(self.taken) {
            return None;
        }
        self.taken = self.taken.wrapping_add(1);
        while let Some(bucket) = self.buckets.get_mut(self.at) {
            if let Some(cell) = bucket.pop() {
                return Some(cell as usize);
            }
            self.at += 1;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::Map;

    /// Squares of one to six cells, wherever they come; the corners of the room stay free.
    fn cluttered(seed: u64, [width, height]: [usize; 2]) -> Space {
        let mut state = seed;
        let mut next = |below: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % below
        };
        let mut map = Map::empty([width, height], 1.0).unwrap();
        for _ in 0..width * height / 60 {
            let (column, row, side) = (next(width), next(height), 1 + next(6));
            for row in row..(row + side).min(height) {
                for column in column..(column + side).min(width) {
                    let is_corner = column.min(width - 1 - column) < 4 && row.min(height - 1 - row) < 4;
                    map.blocked[row * width + column] |= !is_corner;
                }
            }
        }
        Space::new(map)
    }

    #[test]
    fn whoever_is_reached_is_seen_from_where_the_way_turned() {
        let size = [90, 70];
        let (mut found, mut looked) = (0, 0);
        for seed in 0..40 {
            let space = cluttered(seed, size);
            let search = Search::new(&space, space.clearance(), 1.0);
            let (from, to) = (search.index(1, 1), search.index(size[0] - 2, size[1] - 2));
            let Some(tree) = search.tree(from, to) else { continue };
            found += 1;
            for (at, cell) in tree.cells.iter().enumerate().filter(|(_, cell)| cell.is_done) {
                if cell.parent != NOBODY {
                    looked += 1;
                    assert!(search.sees(cell.parent as usize, at), "seed {seed}: {} to {at}", cell.parent);
                }
            }
        }
        assert!(found > 20 && looked > 10_000, "{found} ways, {looked} cells");
    }

    #[test]
    fn what_is_left_of_a_way_is_never_told_longer_than_it_is_and_around_walls_hardly_shorter() {
        let size = [90, 70];
        let mut found = 0;
        for seed in 0..200 {
            let space = cluttered(seed, size);
            let search = Search::new(&space, space.clearance(), 1.0);
            let (from, to) = (search.index(1, 1), search.index(size[0] - 2, size[1] - 2));
            let Some(way) = search.shortest(from, to) else { continue };
            found += 1;
            let ahead = Ahead::new(&search, size, from, to).unwrap();
            for (number, at) in way.iter().enumerate() {
                let (left, rest) = (ahead.left(search.place(*at)), search.length(&way[number..]) as f32);
                assert!(left <= rest + 1e-3, "seed {seed}: {left} of {rest}");
            }
        }
        assert!(found > 100, "{found} ways");
        // Around the ends of three walls.
        let mut map = Map::empty([200, 200], 1.0).unwrap();
        for (column, rows) in [(50, 0..180), (100, 20..200), (150, 0..180)] {
            rows.for_each(|row| map.blocked[row * 200 + column] = true);
        }
        let space = Space::new(map);
        let search = Search::new(&space, space.clearance(), 3.0);
        let (from, to) = (search.index(10, 10), search.index(190, 10));
        let length = search.length(&search.shortest(from, to).unwrap()) as f32;
        let left = Ahead::new(&search, [200, 200], from, to).unwrap().left(search.place(from));
        assert!(length > 500.0 && left > 0.95 * length, "{left} of {length}");
        // What is closed off is told at once.
        let mut map = space.map.clone();
        (180..200).for_each(|row| map.blocked[row * 200 + 50] = true);
        let space = Space::new(map);
        let search = Search::new(&space, space.clearance(), 3.0);
        assert!(Ahead::new(&search, [200, 200], from, to).is_none() && search.shortest(from, to).is_none());
    }
}
