//! The way of a footprint that has to turn to get through: A* over places and headings.
//!
//! Where a disc around the whole footprint fits, the heading doesn't count and a place is one state; elsewhere it is one state a
//! heading. What is left of a way to the goal is never longer than the way of the disc that every heading covers. Whether there is a way at all is
//! known before, by `passages`.
//!
//! A state is a cell and a part of all headings. It stands in the middle of both, or, where that isn't free, beside it: in the middle of passages
//! always, elsewhere on the way back and where there is no way else. Doors at any angle, a few tenths of a cell wider than the footprint, are passed that way.

use std::collections::HashMap;

use omnibase_platform::{Pose2, wrap_angle_rad};

use crate::gaps::is_near_ridge;
use crate::search::{Queue, Search};
use crate::space::Checker;

mod passages;
#[cfg(test)]
mod tests;

use passages::State;

const NOBODY: u32 = u32::MAX;
/// What is known of a state: it wasn't looked at, it is free, or something is in the way.
const UNKNOWN: u8 = 0;
const FREE: u8 = 1;
const BLOCKED: u8 = 2;
/// What a turn by one radian costs, in parts of the way that the farthest corner makes by it.
const TURN_COST: f64 = 0.03;
/// What is left of a way counts so many times: far fewer states are looked at, and the way is shortened afterwards.
const EAGER: f32 = 1.1;
/// From one heading to the next the farthest corner moves by about so many cells.
const CORNER_STEP: f64 = 1.5;
/// Headings of a cell, at least and at most.
const HEADINGS: [usize; 2] = [16, 96];
/// Parts of a cell and of a step of the heading by which a state in a passage may stand beside its middle.
const PARTS: [f64; 3] = [-1.0 / 3.0, 0.0, 1.0 / 3.0];
/// Where an outline that is smaller by this all around doesn't fit the whole one fits nowhere near, in cells.
const FIT: f64 = 0.8;
/// A way for which more states than this were taken isn't looked for from the other end, too: it takes as long again.
const MOST_TAKEN_TWICE: usize = 100_000;
/// Most places with headings, about 10 bytes each: a robot's process keeps all its memory locked.
const MOST_STATES: usize = 1 << 27;
/// Most cells of a map in which turning is looked at.
pub(crate) const MOST_TURNING_CELLS: usize = MOST_STATES / HEADINGS[0];

/// A place of a way, and its heading where it counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellPose {
    /// In cells.
    pub x: f64,
    /// In cells.
    pub y: f64,
    /// In rad; `None` where any will do.
    pub heading_rad: Option<f64>,
}

/// How states are reached.
struct Tree<'a> {
    /// The cost of what is done, and the least that is known of cells where every heading fits; at least 1, 0 where nothing is known.
    cost: Vec<f32>,
    parent: Vec<u32>,
    done: Vec<bool>,
    /// States, and from which one each is reached: it is looked at once it is the next, which most never are.
    queue: Queue<'a, [u32; 2]>,
}

/// A search over places and headings.
pub struct Turning<'a, 'c> {
    checker: &'c mut Checker<'a>,
    /// The same for a smaller outline: where it doesn't fit, the whole one fits nowhere near.
    smaller: Option<Checker<'a>>,
    clearance: &'c [f32],
    /// Of states that aren't free in the middle of their cell with the middle of their heading where else they stand.
    fitted: HashMap<usize, Pose2>,
    /// Whether that is looked for everywhere; else where walls on more sides than one are near.
    fits_everywhere: bool,
    /// Where every heading fits.
    outer: Search<'c>,
    /// Where one may fit.
    inner: Search<'c>,
    width: usize,
    /// Where in the map the first cell lies, in cells.
    low: [f64; 2],
    headings: usize,
    turn_cost: f32,
    /// Of each state: [`UNKNOWN`], [`FREE`] or [`BLOCKED`].
    looked: Vec<u8>,
    /// States from which a way was looked for.
    taken: usize,
}

impl<'a, 'c> Turning<'a, 'c> {
    /// For a footprint with the room that is kept, by the searches of its outer disc and of its inner one, and each cell's clearance, in a part of
    /// the map that begins at a column and a row; `None` where it is too large.
    pub(crate) fn new(
        checker: &'c mut Checker<'a>,
        outer: Search<'c>,
        inner: Search<'c>,
        clearance: &'c [f32],
        low: [usize; 2],
    ) -> Option<Self> {
        let cells = clearance.len();
        if cells > MOST_TURNING_CELLS {
            return None;
        }
        let outer_cells = f64::from(outer.radius());
        let wanted = std::f64::consts::TAU * outer_cells / CORNER_STEP;
        // Right angles are among them.
        let [least, most] = HEADINGS;
        let most = (MOST_STATES / cells.max(1) / 8 * 8).min(most);
        let headings = ((wanted / 8.0).ceil() as usize * 8).clamp(least, most);
        let smaller = checker.smaller(FIT);
        Some(Turning {
            smaller,
            clearance,
            fitted: HashMap::new(),
            fits_everywhere: false,
            checker,
            outer,
            inner,
            width: outer.size()[0],
            low: low.map(|at| at as f64),
            headings,
            turn_cost: (TURN_COST * outer_cells) as f32,
            looked: vec![UNKNOWN; cells * headings],
            taken: 0,
        })
    }

    fn heading_rad(&self, heading: usize) -> f64 {
        heading as f64 * std::f64::consts::TAU / self.headings as f64
    }

    /// A state of a cell; where all headings fit there is only one.
    fn state(&self, cell: usize, heading: usize) -> usize {
        cell * self.headings + if self.outer.is_open(cell) { 0 } else { heading }
    }

    fn pose(&self, cell: usize, heading: usize) -> Pose2 {
        if !self.fitted.is_empty()
            && let Some(fitted) = self.fitted.get(&(cell * self.headings + heading))
        {
            return *fitted;
        }
        let heading_rad = self.heading_rad(heading);
        let [x, y] = match self.inner.gap(cell) {
            Some(gap) => gap.at,
            None => [(cell % self.width) as f64 + 0.5, (cell / self.width) as f64 + 0.5],
        };
        Pose2::new(x + self.low[0], y + self.low[1], heading_rad)
    }

    fn is_free(&mut self, cell: usize, heading: usize) -> bool {
        if self.outer.is_open(cell) {
            return true;
        }
        if !self.inner.takes(cell) {
            return false;
        }
        let state = cell * self.headings + heading;
        if self.looked[state] == UNKNOWN {
            let pose = self.pose(cell, heading);
            let is_free = self.checker.is_free_in_cells(&pose) || self.fits(cell, state, &pose);
            self.looked[state] = if is_free { FREE } else { BLOCKED };
        }
        self.looked[state] == FREE
    }

    /// Whether a state that isn't free in its middle is beside it: then it stands nearest to the mean of where it is.
    fn fits(&mut self, cell: usize, state: usize, middle: &Pose2) -> bool {
        let may_fit = self.fits_everywhere || is_near_ridge(self.clearance, self.width, cell);
        if !may_fit || self.smaller.as_mut().is_some_and(|smaller| !smaller.is_free_in_cells(middle)) {
            return false;
        }
        let turn_rad = std::f64::consts::TAU / self.headings as f64;
        let places = PARTS
            .into_iter()
            .flat_map(|x| PARTS.into_iter().flat_map(move |y| PARTS.map(|turn| [x, y, turn])));
        let free: Vec<[f64; 3]> = places
            .filter(|[x, y, turn]| {
                let pose = Pose2::new(middle.x_m + x, middle.y_m + y, middle.heading_rad + turn * turn_rad);
                self.checker.is_free_in_cells(&pose)
            })
            .collect();
        let count = free.len() as f64;
        let mean = [0, 1, 2].map(|axis| free.iter().map(|place| place[axis]).sum::<f64>() / count);
        let off = |place: &[f64; 3]| (0..3).map(|axis| (place[axis] - mean[axis]).powi(2)).sum::<f64>();
        let Some([x, y, turn]) = free.iter().min_by(|a, b| off(a).total_cmp(&off(b))) else { return false };
        let pose = Pose2::new(middle.x_m + x, middle.y_m + y, middle.heading_rad + turn * turn_rad);
        self.fitted.insert(state, pose);
        true
    }

    /// Whether a step between two free states is.
    fn is_step_free(&mut self, from: State, to: State) -> bool {
        let (from, mut to) = (self.pose(from.0, from.1), self.pose(to.0, to.1));
        to.heading_rad = from.heading_rad + wrap_angle_rad(to.heading_rad - from.heading_rad);
        self.checker.is_free_between_in_cells(&from, &to)
    }

    /// From every cell to a goal, in cells of way for the disc that all headings cover.
    fn ways_to(&self, goal: usize) -> Vec<f32> {
        let mut length = vec![f32::INFINITY; self.looked.len() / self.headings];
        length[goal] = 0.0;
        let mut queue = self.inner.queue();
        queue.add(0.0, goal);
        while let Some(at) = queue.next() {
            let (neighbours, count) = self.inner.neighbours(at);
            for next in &neighbours[..count] {
                let found = length[at] + self.inner.apart(at, *next);
                if found + 1e-3 < length[*next] {
                    length[*next] = found;
                    queue.add(found, *next);
                }
            }
        }
        length
    }

    /// States near a pose from which nothing is in the way to it: cell and heading.
    fn around(&mut self, pose: &Pose2) -> Vec<State> {
        let turn = wrap_angle_rad(pose.heading_rad).rem_euclid(std::f64::consts::TAU);
        let below = (turn / std::f64::consts::TAU * self.headings as f64).floor() as usize;
        let mut found = Vec::new();
        let at = [pose.x_m - self.low[0], pose.y_m - self.low[1]];
        let [column, row] = at.map(|at| at.max(0.0) as usize);
        for row in row.saturating_sub(1)..=row + 1 {
            for column in column.saturating_sub(1)..=column + 1 {
                for heading in [below, below + 1].map(|heading| heading % self.headings) {
                    let cell = row * self.width + column;
                    let is_there = column < self.width && cell < self.looked.len() / self.headings;
                    if !is_there || !self.is_free(cell, heading) {
                        continue;
                    }
                    let mut to = self.pose(cell, heading);
                    to.heading_rad = pose.heading_rad + wrap_angle_rad(to.heading_rad - pose.heading_rad);
                    if self.checker.is_motion_free_in_cells(pose, &to) {
                        found.push((cell, heading));
                    }
                }
            }
        }
        found
    }

    /// The places of a way between two poses in cells, looked for from the last one where that is asked for; `None` where there is none.
    pub(crate) fn passed(&mut self, from: &Pose2, to: &Pose2, is_back: bool) -> Option<Vec<CellPose>> {
        if is_back {
            return self.way_back(from, to);
        }
        for everywhere in [false, true] {
            if everywhere {
                self.look_everywhere();
            }
            let (begins, ends) = (self.around(from), self.around(to));
            if let Some(way) = self.way(&begins, &ends) {
                return Some(way);
            }
        }
        None
    }

    /// Whether there may be a way between two poses in cells, where the footprint gets wherever the inner disc does past cells that are barred for
    /// it: only through these it is looked.
    pub(crate) fn may_pass(&mut self, from: &Pose2, to: &Pose2, past: &Search<'_>) -> bool {
        let regions = self.regions(|cell| past.takes(cell));
        self.look_everywhere();
        let (begins, ends) = (self.around(from), self.around(to));
        self.hang_together(&begins, &ends, &regions)
    }

    /// The places of ways between two poses in cells: the shortest as it is looked for from the first one and from the last one, which
    /// are off by other roundings; none where there is none.
    pub(crate) fn shortest(&mut self, from: &Pose2, to: &Pose2) -> Vec<Vec<CellPose>> {
        let outer = self.outer;
        let regions = self.regions(|cell| outer.is_open(cell));
        // Doors that are hardly wide enough are looked for on the way back, and where there is no other way.
        for everywhere in [false, true] {
            if everywhere {
                self.look_everywhere();
            }
            let (begins, ends) = (self.around(from), self.around(to));
            if self.hang_together(&begins, &ends, &regions) {
                let there = self.way(&begins, &ends);
                let back = if self.taken <= MOST_TAKEN_TWICE { self.way_back(from, to) } else { None };
                return there.into_iter().chain(back).collect();
            }
            if self.inner.is_over() {
                break;
            }
        }
        Vec::new()
    }

    /// The places of the shortest way as it is looked for from the last pose, everywhere.
    fn way_back(&mut self, from: &Pose2, to: &Pose2) -> Option<Vec<CellPose>> {
        self.look_everywhere();
        let (begins, ends) = (self.around(to), self.around(from));
        let mut way = self.way(&begins, &ends)?;
        way.reverse();
        Some(way)
    }

    /// From now on states that aren't free in their middles are looked for beside them everywhere.
    fn look_everywhere(&mut self) {
        self.fits_everywhere = true;
        let blocked = self.looked.iter_mut().filter(|looked| **looked == BLOCKED);
        blocked.for_each(|looked| *looked = UNKNOWN);
    }

    /// The places of the shortest way from any of the first states to any of the last ones.
    fn way(&mut self, begins: &[State], ends: &[State]) -> Option<Vec<CellPose>> {
        let goal = ends.first()?.0;
        let left = self.ways_to(goal);
        let slack = 4.0;
        let states = self.looked.len();
        let mut tree = Tree {
            cost: vec![0.0; states],
            parent: vec![0; states],
            done: vec![false; states],
            queue: self.outer.queue(),
        };
        let is_end: Vec<usize> = ends.iter().map(|(cell, heading)| self.state(*cell, *heading)).collect();
        let estimate = |cell: usize| EAGER * (left[cell] - slack).max(0.0);
        for (cell, heading) in begins {
            tree.queue.add(1.0 + estimate(*cell), [self.state(*cell, *heading) as u32, NOBODY]);
        }
        while let Some([state, before]) = tree.queue.next() {
            let at = state as usize;
            if tree.done[at] {
                continue;
            }
            tree.cost[at] = match before {
                NOBODY => 1.0,
                before => match self.step([before as usize, at]) {
                    Some(step) => tree.cost[before as usize] + step,
                    None => continue,
                },
            };
            (tree.done[at], tree.parent[at]) = (true, before);
            self.taken += 1;
            if is_end.contains(&at) {
                return Some(self.places(at, &tree.parent));
            }
            self.spread(at, &mut tree, estimate);
        }
        None
    }

    /// What a step between neighbouring states costs; `None` where something is in its way.
    fn step(&mut self, states: [usize; 2]) -> Option<f32> {
        let [(from, heading_from), (to, heading_to)] =
            states.map(|state| (state / self.headings, state % self.headings));
        // Where all headings fit it is whatever the other one's is.
        let [any_from, any_to] = [from, to].map(|cell| self.outer.is_open(cell));
        let heading_from = if any_from { heading_to } else { heading_from };
        let heading_to = if any_to { heading_from } else { heading_to };
        let is_free = any_from && any_to
            || self.is_free(to, heading_to) && self.is_step_free((from, heading_from), (to, heading_to));
        is_free.then(|| if from == to { self.turn_step() } else { self.inner.apart(from, to) })
    }

    /// Adds the neighbours of a state.
    fn spread(&self, state: usize, tree: &mut Tree<'_>, estimate: impl Fn(usize) -> f32) {
        let (cell, heading) = (state / self.headings, state % self.headings);
        let (is_any, so_far) = (self.outer.is_open(cell), tree.cost[state]);
        let add = |tree: &mut Tree<'_>, next: usize, heading: usize, length: f32| {
            let to = self.state(next, heading);
            if tree.done[to] || self.looked[to] == BLOCKED {
                return;
            }
            let found = so_far + length;
            // Between places where all headings fit nothing is in the way: only the shortest step counts.
            if is_any && self.outer.is_open(next) {
                if tree.cost[to] != 0.0 && found >= tree.cost[to] {
                    return;
                }
                tree.cost[to] = found;
            }
            tree.queue.add(found + estimate(next), [to as u32, state as u32]);
        };
        let (neighbours, count) = self.inner.neighbours(cell);
        for next in &neighbours[..count] {
            let length = self.inner.apart(cell, *next);
            // Where all headings fit there is one state, whatever they are here.
            let all = is_any && !self.outer.is_open(*next);
            let headings = if all { 0..self.headings } else { heading..heading + 1 };
            headings.for_each(|heading| add(tree, *next, heading, length));
        }
        if !is_any {
            for next in [heading + 1, heading + self.headings - 1] {
                add(tree, cell, next % self.headings, self.turn_step());
            }
        }
    }

    fn turn_step(&self) -> f32 {
        self.turn_cost * std::f32::consts::TAU / self.headings as f32
    }

    fn places(&self, end: usize, parent: &[u32]) -> Vec<CellPose> {
        let before = |state: &usize| Some(parent[*state]).filter(|before| *before != NOBODY);
        let states = std::iter::successors(Some(end), |state| before(state).map(|before| before as usize));
        let place = |state: usize| {
            let (cell, heading) = (state / self.headings, state % self.headings);
            let pose = self.pose(cell, heading);
            let heading_rad = (!self.outer.is_open(cell)).then_some(pose.heading_rad);
            CellPose { x: pose.x_m, y: pose.y_m, heading_rad }
        };
        let mut places: Vec<CellPose> = states.map(place).collect();
        places.reverse();
        places
    }
}
