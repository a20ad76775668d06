//! The shortest way of a disc: Lazy Theta* over the cells' centres, pulled taut.
//!
//! Source: Nash, Koenig, Tovey, Lazy Theta* (2010). A place is open where the disc fits; a step from centre to centre needs all
//! four corners of the square between them open, so that no occupied cell reaches in between by more than a few tenths of a
//! millimetre.

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
    radius: f32,
    until: Until<'a>,
}

impl<'a> Search<'a> {
    /// For a disc of a radius, m, by each cell's clearance, in cells.
    pub fn new(space: &Space, clearance: &'a [f32], radius_m: f64) -> Self {
        let radius = (radius_m / space.map.cell_m) as f32;
        let (width, height) = (space.map.width, space.map.height);
        let per_width = 1.0 / width as f64;
        Search { width, height, per_width, clearance, radius, until: Until::default() }
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

    pub(crate) fn index(&self, column: usize, row: usize) -> usize {
        row * self.width + column
    }

    /// A cell, or one beside it, where the disc fits.
    pub(crate) fn open_near(&self, at: usize) -> Option<usize> {
        let (column, row) = self.split(at);
        let columns = column.saturating_sub(1)..(column + 2).min(self.width);
        let rows = row.saturating_sub(1)..(row + 2).min(self.height);
        let cells = rows.flat_map(|row| columns.clone().map(move |column| (column, row)));
        let open = cells.map(|(column, row)| self.index(column, row)).filter(|cell| self.is_open(*cell));
        open.min_by(|a, b| self.apart(at, *a).total_cmp(&self.apart(at, *b)))
    }

    /// Whether few cells hang together with one.
    pub(crate) fn is_small(&self, from: usize) -> bool {
        let everywhere = Search { radius: 0.5, ..*self };
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

    pub(crate) fn place(&self, at: usize) -> [f32; 2] {
        let (column, row) = self.split(at);
        [column as f32, row as f32]
    }

    pub(crate) fn apart(&self, a: usize, b: usize) -> f32 {
        distance(self.place(a), self.place(b))
    }

    /// The neighbours that one step leads to.
    pub(crate) fn neighbours(&self, at: usize) -> ([usize; 8], usize) {
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
        found
    }

    /// Whether the disc gets straight from one centre to another.
    pub fn sees(&self, from: usize, to: usize) -> bool {
        let ([x, y], [x_to, y_to]) = (self.place(from), self.place(to));
        let (dx, dy) = (x_to - x, y_to - y);
        let length = (dx * dx + dy * dy).sqrt();
        if length <= 0.0 {
            return self.is_open(from);
        }
        let (ux, uy) = (dx / length, dy / length);
        let mut done = 0.0_f32;
        while done < length {
            let (px, py) = (x + done * ux, y + done * uy);
            // Places are never below 0: a cast cuts as `floor` does, at once.
            let (near_x, near_y) = ((px + 0.5) as usize as f32, (py + 0.5) as usize as f32);
            let off = ((px - near_x) * (px - near_x) + (py - near_y) * (py - near_y)).sqrt();
            let spare = self.clearance[near_y as usize * self.width + near_x as usize] - self.radius - off;
            if spare >= 1.0 {
                done += spare;
                continue;
            }
            // Close to something: the square that is being crossed must be open at all its corners.
            let Some(leaves) = self.crosses([px, py], [ux, uy]) else { return false };
            // In a very long map a small step could be rounded away.
            done = (done + leaves).max(done.next_up());
        }
        self.is_open(to)
    }

    /// How far it is from a place to the end of its square, along a direction; `None` where a corner isn't open.
    fn crosses(&self, [px, py]: [f32; 2], [ux, uy]: [f32; 2]) -> Option<f32> {
        /// Behind a border by this, in cells, one is in the next square.
        const INSIDE: f32 = 1e-3;
        let range = |p: f32, u: f32| {
            let low = if u > 0.0 { (p + INSIDE).floor() } else { (p - INSIDE).ceil() };
            // A way along a line of centres needs only that line.
            if u.abs() < 1e-6 { [p.round(), p.round()] } else { [low, low + u.signum()] }
        };
        let ([x0, x1], [y0, y1]) = (range(px, ux), range(py, uy));
        for y in [y0, y1] {
            for x in [x0, x1] {
                let is_inside = x >= 0.0 && y >= 0.0 && x < self.width as f32 && y < self.height as f32;
                if !is_inside || !self.is_open(y as usize * self.width + x as usize) {
                    return None;
                }
            }
        }
        let to = |p: f32, end: f32, u: f32| if u.abs() < 1e-6 { f32::INFINITY } else { (end - p) / u };
        Some(to(px, x1, ux).min(to(py, y1, uy)).max(INSIDE))
    }

    /// The cells of the shortest way where it turns, both ends with it; `None` where there is none.
    pub fn shortest(&self, from: usize, to: usize) -> Option<Vec<usize>> {
        if !self.is_open(from) || !self.is_open(to) {
            return None;
        }
        let mut tree = Tree::new(self.clearance.len());
        tree.reach(from, NOBODY, 0.0);
        let goal = self.place(to);
        let mut queue = self.queue();
        queue.add(self.apart(from, to), from);
        while let Some(at) = queue.next() {
            if tree.done[at] {
                continue;
            }
            self.settle(&mut tree, at);
            tree.done[at] = true;
            if at == to {
                let mut way = tree.way(to);
                self.pull(&mut way);
                return Some(way);
            }
            let parent = match tree.parent[at] {
                NOBODY => at,
                parent => parent as usize,
            };
            let (turn, so_far) = (self.place(parent), tree.length[parent]);
            let (neighbours, count) = self.neighbours(at);
            for next in &neighbours[..count] {
                if tree.done[*next] {
                    continue;
                }
                let place = self.place(*next);
                let length = so_far + distance(turn, place);
                if length < tree.length[*next] {
                    tree.reach(*next, parent as u32, length);
                    queue.add(length + distance(place, goal), *next);
                }
            }
        }
        None
    }

    /// Looks whether a cell's parent sees it; otherwise the best neighbour becomes its parent.
    fn settle(&self, tree: &mut Tree, at: usize) {
        let parent = tree.parent[at];
        if parent == NOBODY || self.sees(parent as usize, at) {
            return;
        }
        let (neighbours, count) = self.neighbours(at);
        let mut best = (f32::INFINITY, NOBODY);
        for next in neighbours[..count].iter().filter(|next| tree.done[**next]) {
            let length = tree.length[*next] + self.apart(*next, at);
            if length < best.0 {
                best = (length, *next as u32);
            }
        }
        tree.reach(at, best.1, best.0);
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
            let everywhere = Search { radius: 0.0, ..*self };
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

/// How each cell is reached.
struct Tree {
    length: Vec<f32>,
    parent: Vec<u32>,
    done: Vec<bool>,
}

impl Tree {
    fn new(cells: usize) -> Self {
        Tree { length: vec![f32::INFINITY; cells], parent: vec![NOBODY; cells], done: vec![false; cells] }
    }

    fn reach(&mut self, at: usize, parent: u32, length: f32) {
        self.length[at] = length;
        self.parent[at] = parent;
    }

    fn way(&self, to: usize) -> Vec<usize> {
        let mut way = vec![to];
        while let Some(parent) = way.last().map(|at| self.parent[*at]).filter(|parent| *parent != NOBODY) {
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
