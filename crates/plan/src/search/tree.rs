//! How cells are reached: Lazy Theta*, by lengths as they are once a way is drawn taut.
//!
//! Source: Nash, Koenig, Tovey, Lazy Theta* (2010). Cells' centres are up to a cell farther from what is in the way than the disc gets, and a
//! way with many turns would seem longer by as many cells: of two ways on different sides the longer one would be taken.

use super::{Search, distance};
use crate::ahead::Ahead;

pub(super) const NOBODY: u32 = u32::MAX;
/// Where ways turn there is at most so much more room than the disc needs; with more they turn in the open, and stay where they are, in cells.
const MOST_SPARE: f32 = 1.8;

/// How each cell is reached.
pub(super) struct Tree {
    pub(super) cells: Vec<Reached>,
}

/// How a cell is reached: what belongs together lies together.
#[derive(Clone, Copy)]
pub(super) struct Reached {
    pub(super) length: f32,
    pub(super) parent: u32,
    pub(super) is_done: bool,
    /// Whether ways turn there: then the length is that to where they turn.
    is_turn: bool,
}

impl Tree {
    fn new(cells: usize) -> Self {
        Tree {
            cells: vec![
                Reached { length: f32::INFINITY, parent: NOBODY, is_done: false, is_turn: false };
                cells
            ],
        }
    }

    fn reach(&mut self, at: usize, parent: u32, length: f32) {
        let cell = &mut self.cells[at];
        (cell.length, cell.parent) = (length, parent);
    }

    pub(super) fn way(&self, to: usize) -> Vec<usize> {
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

impl Search<'_> {
    /// How cells are reached until another one is; `None` where it isn't.
    pub(super) fn tree(&self, from: usize, to: usize) -> Option<Tree> {
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
            let (turn, so_far) = (self.turn(parent), tree.cells[parent].length);
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
            let length = self.length_at_turn(tree, *next) + distance(self.turn(*next), self.place(at));
            if length < best.0 {
                best = (length, *next as u32);
            }
        }
        if best.1 != NOBODY {
            let turn = best.1 as usize;
            tree.cells[turn].length = self.length_at_turn(tree, turn);
            tree.cells[turn].is_turn = true;
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

    /// Where a way that turns at a cell turns once it is drawn taut: as near to what is in the way as the disc gets.
    fn turn(&self, at: usize) -> [f32; 2] {
        let [x, y] = self.place(at);
        let spare = self.clearance[at] - self.radius;
        if !(0.0..MOST_SPARE).contains(&spare) {
            return [x, y];
        }
        let here = self.clearance[at];
        // How fast the room rises along an axis, by the side on which it falls; between two sides of a passage it does on both.
        let rise = |step: usize| {
            let [low, high] = [at.wrapping_sub(step), at + step]
                .map(|cell| self.clearance.get(cell).map_or(0.0, |_| self.room(cell)));
            (here - low).clamp(0.0, 1.0) - (here - high).clamp(0.0, 1.0)
        };
        let (across, along) = (rise(1), rise(self.width));
        let shift = spare / (across * across + along * along).sqrt().max(1.0);
        [x - shift * across, y - shift * along]
    }

    /// The length to where ways turn at a cell.
    fn length_at_turn(&self, tree: &Tree, at: usize) -> f32 {
        let reached = tree.cells[at];
        if reached.is_turn || reached.parent == NOBODY {
            return reached.length;
        }
        let from = self.turn(reached.parent as usize);
        reached.length + distance(from, self.turn(at)) - distance(from, self.place(at))
    }
}
