//! What is left of a way at least: the way over blocks of cells, of which one is open where any of its cells is.
//!
//! Straight to the goal is far too little where something lies between: then almost every cell would be looked at. A block has a quarter of the
//! cells, and steps in 32 directions, which are longer than straight ones by less than a hundredth.

use crate::search::{Queue, Search};

/// The side of a block, in cells.
const SIDE: usize = 2;
/// Blocks around the map that are closed, so that no step leads out of it.
const AROUND: usize = 4;
/// By how many blocks, to the right and upwards.
type By = [isize; 2];
/// A step and what it goes through: one block of each pair is open.
type Through = (By, [[By; 2]; 3]);

/// The steps in one eighth of all directions.
const STEPS: [Through; 5] = {
    const OWN: [By; 2] = [[0, 0], [0, 0]];
    [
        ([1, 0], [OWN, OWN, OWN]),
        ([1, 1], [OWN, OWN, OWN]),
        ([2, 1], [[[1, 0], [1, 1]], OWN, OWN]),
        ([3, 2], [[[1, 1], [1, 0]], [[2, 1], [2, 2]], OWN]),
        ([4, 1], [[[1, 0], [1, 1]], [[2, 0], [2, 1]], [[3, 1], [3, 0]]]),
    ]
};
/// The most that such steps are longer than a straight way: between (1, 0) and (4, 1) in the direction between both.
const LONGER: f32 = 1.0077;
/// What blocks are off at both ends of a way, and where it turns, in cells.
const OFF: f32 = 2.0;
/// Ways are told as far as to the start, and by so many parts and cells more; what lies farther away counts as just so far.
const BEYOND: [f32; 2] = [1.1, 20.0];
/// Not reached.
const FAR: f32 = f32::INFINITY;
/// Closed: nothing is shorter.
const CLOSED: f32 = -1.0;

/// From every block the least that is left to a goal, in cells.
pub(crate) struct Ahead {
    /// Blocks of a row, those around the map with them.
    across: usize,
    length: Vec<f32>,
    /// What isn't told is no nearer.
    beyond: f32,
    goal: [f32; 2],
}

struct Step {
    to: isize,
    through: [[isize; 2]; 3],
    length: f32,
}

impl Ahead {
    /// From a cell to another, for a search's disc; `None` where nothing leads there.
    pub(crate) fn new(
        search: &Search<'_>,
        [width, height]: [usize; 2],
        from: usize,
        to: usize,
    ) -> Option<Ahead> {
        let across = width.div_ceil(SIDE) + 2 * AROUND;
        let mut length = vec![CLOSED; across * (height.div_ceil(SIDE) + 2 * AROUND)];
        for row in 0..height {
            let first = (row / SIDE + AROUND) * across + AROUND;
            for column in 0..width {
                if search.takes(search.index(column, row)) {
                    length[first + column / SIDE] = FAR;
                }
            }
        }
        let mut ahead = Ahead { across, length, beyond: FAR, goal: search.place(to) };
        let [from, to] =
            [from, to].map(|at| (at / width / SIDE + AROUND) * across + at % width / SIDE + AROUND);
        ahead.spread(search.queue(), from, to);
        (ahead.length[from] < FAR).then_some(ahead)
    }

    fn steps(&self) -> Vec<Step> {
        let mut steps: Vec<Step> = Vec::new();
        for ([x, y], through) in STEPS {
            for turn in 0..8 {
                let turned = |[x, y]: By| {
                    let [x, y] = if turn & 1 == 1 { [y, x] } else { [x, y] };
                    let [x, y] = [if turn & 2 == 2 { -x } else { x }, if turn & 4 == 4 { -y } else { y }];
                    y * self.across as isize + x
                };
                let step = Step {
                    to: turned([x, y]),
                    through: through.map(|pair| pair.map(turned)),
                    length: SIDE as f32 * ((x * x + y * y) as f32).sqrt(),
                };
                if !steps.iter().any(|other| other.to == step.to) {
                    steps.push(step);
                }
            }
        }
        steps
    }

    fn spread(&mut self, mut queue: Queue<'_>, from: usize, to: usize) {
        let steps = self.steps();
        self.length[to] = 0.0;
        queue.add(0.0, to);
        let length = &mut self.length;
        while let Some(at) = queue.next() {
            let so_far = length[at];
            if so_far > BEYOND[0] * length[from] + BEYOND[1] {
                self.beyond = so_far;
                break;
            }
            for step in &steps {
                let to = at.wrapping_add_signed(step.to);
                let found = so_far + step.length;
                if found + 1e-3 >= length[to] {
                    continue;
                }
                let is_open = |by: &isize| length[at.wrapping_add_signed(*by)] >= 0.0;
                if step.through.iter().all(|pair| pair.iter().any(is_open)) {
                    length[to] = found;
                    queue.add(found, to);
                }
            }
        }
    }

    /// From a place, as a search has it, to the goal, in cells.
    pub(crate) fn left(&self, [x, y]: [f32; 2]) -> f32 {
        let off = [x - self.goal[0], y - self.goal[1]];
        let straight = (off[0] * off[0] + off[1] * off[1]).sqrt();
        // The four blocks around it.
        let middle = 0.5 * (SIDE as f32 - 1.0);
        let [column, row] = [x, y].map(|at| (at - middle) / SIDE as f32 + AROUND as f32);
        let (low, mut least) = (row as usize * self.across + column as usize, FAR);
        for (by, [right, above]) in
            [(0, [0.0, 0.0]), (1, [1.0, 0.0]), (self.across, [0.0, 1.0]), (self.across + 1, [1.0, 1.0])]
        {
            let length = self.length[low + by];
            if length >= 0.0 {
                let off = [column.fract() - right, row.fract() - above];
                let off = SIDE as f32 * (off[0] * off[0] + off[1] * off[1]).sqrt();
                least = least.min(length + off);
            }
        }
        straight.max(least.min(self.beyond) / LONGER - OFF)
    }
}
