//! Whether there is a way at all: told by what lies between halls alone.
//!
//! Where the disc around the whole footprint fits any heading will do: such cells that hang together are a hall. Every other cell belongs to the
//! region of the hall that is the fewest steps away. A way from hall to hall crosses borders of regions, and only from borders on it is looked
//! whether it gets to a hall. What lies along the walls of a hall, by far the most, isn't looked at.

use std::collections::VecDeque;

use super::{NOBODY, Turning};
use crate::search::Queue;

/// A cell and a heading's number.
pub(super) type State = (usize, usize);

/// Which hall each cell belongs to.
pub(super) struct Regions {
    /// [`NOBODY`] where no hall is.
    hall: Vec<u32>,
    /// To the hall.
    steps: Vec<u32>,
    halls: usize,
}

/// What of places and headings hangs together, as far as it was looked at: halls first, then parts of regions.
struct Parts<'a> {
    /// The part of each state, and one more; 0 where it wasn't looked at.
    of: Vec<u32>,
    /// Another part that hangs together with each one, itself where there is none.
    joined: Vec<usize>,
    queue: Queue<'a>,
}

impl Parts<'_> {
    fn add(&mut self) -> usize {
        self.joined.push(self.joined.len());
        self.joined.len() - 1
    }

    fn first(&mut self, mut part: usize) -> usize {
        while self.joined[part] != part {
            self.joined[part] = self.joined[self.joined[part]];
            part = self.joined[part];
        }
        part
    }

    fn join(&mut self, one: usize, other: usize) {
        let (one, other) = (self.first(one), self.first(other));
        self.joined[one] = other;
    }

    fn are_joined(&mut self, one: usize, other: usize) -> bool {
        self.first(one) == self.first(other)
    }
}

impl Turning<'_, '_> {
    /// Whether any of the last states is reached from any of the first ones, all of which are.
    pub(super) fn hang_together(&mut self, begins: &[State], ends: &[State], regions: &Regions) -> bool {
        let mut parts = Parts {
            of: vec![0; self.looked.len()],
            joined: (0..regions.halls).collect(),
            queue: self.inner.queue(),
        };
        let [from, to] = [begins, ends].map(|states| {
            let part = parts.add();
            for state in states {
                let own = self.part(*state, regions, &mut parts);
                parts.join(part, own);
            }
            part
        });
        for cells in self.borders(regions) {
            if parts.are_joined(from, to) || self.inner.is_over() {
                break;
            }
            self.cross(cells, regions, &mut parts);
        }
        parts.are_joined(from, to)
    }

    /// Which hall each cell belongs to; halls that hang together by cells that join them are one.
    pub(super) fn regions(&self, joins: impl Fn(usize) -> bool) -> Regions {
        let cells = self.looked.len() / self.headings;
        let mut regions = Regions { hall: vec![NOBODY; cells], steps: vec![0; cells], halls: 0 };
        let mut left = Vec::new();
        let mut edge = VecDeque::new();
        for cell in 0..cells {
            if !self.outer.is_open(cell) || regions.hall[cell] != NOBODY {
                continue;
            }
            let hall = regions.halls as u32;
            regions.halls += 1;
            regions.hall[cell] = hall;
            left.push(cell);
            while let Some(at) = left.pop() {
                let is_hall = self.outer.is_open(at);
                let (neighbours, count) = self.inner.neighbours(at);
                for next in &neighbours[..count] {
                    if is_hall && !self.outer.is_open(*next) {
                        edge.push_back(at);
                    }
                    if joins(*next) && regions.hall[*next] == NOBODY {
                        regions.hall[*next] = hall;
                        left.push(*next);
                    }
                }
            }
        }
        // What joins halls belongs to the nearest one, too.
        for cell in (0..cells).filter(|cell| !self.outer.is_open(*cell)) {
            regions.hall[cell] = NOBODY;
        }
        while let Some(at) = edge.pop_front() {
            let (neighbours, count) = self.inner.neighbours(at);
            for next in &neighbours[..count] {
                if regions.hall[*next] == NOBODY {
                    regions.hall[*next] = regions.hall[at];
                    regions.steps[*next] = regions.steps[at] + 1;
                    edge.push_back(*next);
                }
            }
        }
        regions
    }

    /// Neighbours that belong to different halls.
    fn borders(&self, regions: &Regions) -> Vec<[usize; 2]> {
        let of_cell = |cell: usize| {
            let (neighbours, count) = self.inner.neighbours(cell);
            let others = neighbours.into_iter().take(count);
            others
                .filter(move |next| cell < *next && regions.hall[cell] != regions.hall[*next])
                .map(move |next| [cell, next])
        };
        (0..regions.hall.len()).filter(|cell| regions.hall[*cell] != NOBODY).flat_map(of_cell).collect()
    }

    /// Joins what a border parts, with every heading with which a step leads across.
    fn cross(&mut self, cells: [usize; 2], regions: &Regions, parts: &mut Parts<'_>) {
        for heading in 0..self.headings {
            let [from, to] = cells.map(|cell| (cell, heading));
            if self.is_free(from.0, heading) && self.is_free(to.0, heading) && self.is_step_free(from, to) {
                let [one, other] = [from, to].map(|state| self.part(state, regions, parts));
                parts.join(one, other);
            }
        }
    }

    /// The part to which a free state belongs: its region is looked at up to the hall, or as far as it gets.
    fn part(&mut self, begin: State, regions: &Regions, parts: &mut Parts<'_>) -> usize {
        let hall = regions.hall[begin.0];
        let own = self.state(begin.0, begin.1);
        if self.outer.is_open(begin.0) {
            return hall as usize;
        }
        if parts.of[own] != 0 {
            return parts.of[own] as usize - 1;
        }
        let part = parts.add();
        parts.of[own] = part as u32 + 1;
        parts.queue.clear();
        parts.queue.add(regions.steps[begin.0] as f32, own);
        while let Some(state) = parts.queue.next() {
            let (cell, heading) = (state / self.headings, state % self.headings);
            let (neighbours, count) = self.inner.neighbours(cell);
            let turns = [heading + 1, heading + self.headings - 1].map(|next| (cell, next % self.headings));
            let steps = neighbours[..count].iter().map(|next| (*next, heading));
            for (to, heading_to) in steps.chain(turns) {
                if regions.hall[to] != hall {
                    continue;
                }
                let next = self.state(to, heading_to);
                let known = if self.outer.is_open(to) { hall + 1 } else { parts.of[next] };
                if known == part as u32 + 1
                    || !self.is_free(to, heading_to)
                    || !self.is_step_free((cell, heading), (to, heading_to))
                {
                    continue;
                }
                // What was looked at before got to the hall, or it would hold this one.
                if known != 0 {
                    parts.join(part, known as usize - 1);
                    return part;
                }
                parts.of[next] = part as u32 + 1;
                parts.queue.add(regions.steps[to] as f32, next);
            }
        }
        part
    }
}
