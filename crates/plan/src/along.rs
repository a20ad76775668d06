//! Along the way of the disc that every heading covers. No way is shorter: where the footprint gets along it by turning, nothing else is looked for.
//!
//! A* over the way's places, a few cells apart, and headings. A state whose footprint isn't free stands a little beside its place, or turned.

use omnibase_platform::{Pose2, wrap_angle_rad};

use crate::search::Queue;
use crate::smooth::divided;
use crate::space::Checker;
use crate::until::Until;

#[cfg(test)]
mod tests;

const NOBODY: u32 = u32::MAX;
/// From place to place, in cells.
pub(crate) const SPACING: f64 = 2.0;
/// From one heading to the next the farthest corner moves by about so many cells.
const CORNER_STEP: f64 = 1.0;
/// Headings of a place, at least and at most.
const HEADINGS: [usize; 2] = [16, 96];
/// What a turn by one radian costs, in parts of the way that the farthest corner makes by it.
const TURN_COST: f32 = 0.3;
/// What it costs to stand beside a place, in parts of how far: such a way is drawn taut again, but not always to the shortest one.
const BESIDE_COST: f32 = 1.0;
/// What is left of a way counts so many times: fewer states are looked at.
const EAGER: f32 = 1.05;
/// How far beside its place a state may stand, in cells, and how far turned, in steps of the heading: the first that is free.
const BESIDE: [[f64; 2]; 14] = [
    [0.5, 0.0],
    [-0.5, 0.0],
    [1.0, 0.0],
    [-1.0, 0.0],
    [1.5, 0.0],
    [-1.5, 0.0],
    [2.0, 0.0],
    [-2.0, 0.0],
    [0.0, 1.0 / 3.0],
    [0.0, -1.0 / 3.0],
    [0.5, 1.0 / 3.0],
    [0.5, -1.0 / 3.0],
    [-0.5, 1.0 / 3.0],
    [-0.5, -1.0 / 3.0],
];
/// The farthest of them, in cells.
const FARTHEST: f64 = 2.0;

/// Where a state stands.
#[derive(Clone, Copy)]
enum Stands {
    Unknown,
    Nowhere,
    /// In cells to the left of the way, and in steps of the heading.
    Beside([f32; 2]),
}

/// The places of a way, with headings.
pub(crate) struct Places<'a, 'c> {
    checker: &'c mut Checker<'a>,
    /// The same for an outline that is smaller by as much as a state may stand beside its place: where it doesn't fit, the whole one doesn't.
    smaller: Option<Checker<'a>>,
    ends: [Pose2; 2],
    /// With the way's direction as their heading.
    places: Vec<Pose2>,
    /// What is left of the way from each place, in cells.
    left: Vec<f32>,
    headings: usize,
    /// What a turn to the next heading costs, in cells.
    turn_cost: f32,
    /// Each state: a place and one of the headings, from that of the first end.
    stands: Vec<Stands>,
    /// What each state costs that was reached, and from which one it was.
    cost: Vec<f32>,
    parent: Vec<u32>,
    done: Vec<bool>,
    /// The last place that was reached.
    farthest: usize,
}

impl<'a, 'c> Places<'a, 'c> {
    /// Of a way from end to end in cells, for a footprint whose farthest corner is so many cells away.
    pub(crate) fn new(way: &[Pose2], ends: [Pose2; 2], checker: &'c mut Checker<'a>, reach: f64) -> Self {
        let mut places = divided(way, SPACING, 0.0);
        let count = places.len();
        let direction = |at: usize| {
            let (before, after) = (places[at.saturating_sub(1)], places[(at + 1).min(count - 1)]);
            (after.y_m - before.y_m).atan2(after.x_m - before.x_m)
        };
        let directions: Vec<f64> = (0..count).map(direction).collect();
        let mut left = vec![0.0; count];
        for at in (1..count).rev() {
            left[at - 1] = left[at] + places[at].distance_m(places[at - 1]) as f32;
        }
        places.iter_mut().zip(directions).for_each(|(place, direction)| place.heading_rad = direction);
        let wanted = std::f64::consts::TAU * reach / CORNER_STEP;
        let headings = ((wanted / 8.0).ceil() as usize * 8).clamp(HEADINGS[0], HEADINGS[1]);
        let states = count * headings;
        Places {
            smaller: checker.smaller(FARTHEST),
            checker,
            ends,
            left,
            headings,
            turn_cost: TURN_COST * (reach * std::f64::consts::TAU / headings as f64) as f32,
            stands: vec![Stands::Unknown; states],
            cost: vec![0.0; states],
            parent: vec![NOBODY; states],
            done: vec![false; states],
            farthest: 0,
            places,
        }
    }

    /// The places, with the way's direction as their heading.
    pub(crate) fn places(&self) -> &[Pose2] {
        &self.places
    }

    /// The last place that was reached.
    pub(crate) fn farthest(&self) -> usize {
        self.farthest
    }

    fn step_rad(&self) -> f64 {
        std::f64::consts::TAU / self.headings as f64
    }

    fn pose(&self, state: usize, [beside, turn]: [f64; 2]) -> Pose2 {
        let (place, heading) = (self.places[state / self.headings], state % self.headings);
        let (sin, cos) = place.heading_rad.sin_cos();
        let heading_rad = self.ends[0].heading_rad + (heading as f64 + turn) * self.step_rad();
        Pose2::new(place.x_m - beside * sin, place.y_m + beside * cos, heading_rad)
    }

    /// Where a state stands, and how far beside its place; `None` where something is in the way.
    fn stand(&mut self, state: usize) -> Option<(Pose2, f32)> {
        if let Stands::Unknown = self.stands[state] {
            let found = self.found(state).map(|beside| Stands::Beside(beside.map(|part| part as f32)));
            self.stands[state] = found.unwrap_or(Stands::Nowhere);
        }
        match self.stands[state] {
            Stands::Beside(beside) => Some((self.pose(state, beside.map(f64::from)), beside[0].abs())),
            _ => None,
        }
    }

    fn found(&mut self, state: usize) -> Option<[f64; 2]> {
        let middle = self.pose(state, [0.0; 2]);
        if self.checker.is_free_in_cells(&middle) {
            return Some([0.0; 2]);
        }
        if self.smaller.as_mut().is_some_and(|smaller| !smaller.is_free_in_cells(&middle)) {
            return None;
        }
        BESIDE.into_iter().find(|beside| {
            let pose = self.pose(state, *beside);
            self.checker.is_free_in_cells(&pose)
        })
    }

    /// The poses of a way from end to end; `None` where the footprint doesn't get along.
    pub(crate) fn way(&mut self, until: Until<'_>) -> Option<Vec<Pose2>> {
        let mut queue: Queue<'_, [u32; 2]> = Queue::new(until);
        queue.add(EAGER * self.left[0], [0, NOBODY]);
        while let Some([state, before]) = queue.next() {
            let at = state as usize;
            if self.done[at] {
                continue;
            }
            let Some((pose, beside)) = self.stand(at) else {
                self.done[at] = true;
                continue;
            };
            if before != NOBODY {
                let before = before as usize;
                let (from, _) = self.stand(before)?;
                if !self.checker.is_free_between_in_cells(&from, &near(&from, pose)) {
                    continue;
                }
                self.cost[at] = self.cost[before] + self.step_cost(before, at) + BESIDE_COST * beside;
            }
            (self.done[at], self.parent[at]) = (true, before);
            let (column, heading) = (at / self.headings, at % self.headings);
            self.farthest = self.farthest.max(column);
            if column + 1 == self.places.len() && self.is_end(&pose) {
                let mut poses = self.poses(at);
                poses.push(near(&poses[poses.len() - 1], self.ends[1]));
                return Some(poses);
            }
            for turn in [self.headings - 1, 1, 0] {
                let heading = (heading + turn) % self.headings;
                let columns = if turn == 0 { column + 1..column + 2 } else { column..column + 2 };
                for column in columns.filter(|column| *column < self.places.len()) {
                    let next = column * self.headings + heading;
                    if !self.done[next] {
                        let cost = self.cost[at] + self.step_cost(at, next);
                        queue.add(cost + EAGER * self.left[column], [next as u32, state]);
                    }
                }
            }
        }
        None
    }

    /// After [`way`](Places::way) found none, the poses to one of the places; `None` where it wasn't reached.
    pub(crate) fn way_to(&mut self, place: usize) -> Option<Vec<Pose2>> {
        let states = place * self.headings..(place + 1) * self.headings;
        let reached = states.filter(|state| self.parent[*state] != NOBODY || *state == 0);
        let best = reached.min_by(|a, b| self.cost[*a].total_cmp(&self.cost[*b]))?;
        Some(self.poses(best))
    }

    fn step_cost(&self, from: usize, to: usize) -> f32 {
        let [left_before, left] = [from, to].map(|state| self.left[state / self.headings]);
        let is_turn = from % self.headings != to % self.headings;
        left_before - left + if is_turn { self.turn_cost } else { 0.0 }
    }

    /// Whether the last end is reached from a pose at the last place.
    fn is_end(&mut self, pose: &Pose2) -> bool {
        let end = near(pose, self.ends[1]);
        (end.heading_rad - pose.heading_rad).abs() <= self.step_rad()
            && self.checker.is_free_between_in_cells(pose, &end)
    }

    /// From the first end to a state.
    fn poses(&mut self, end: usize) -> Vec<Pose2> {
        let before = |state: &usize| Some(self.parent[*state]).filter(|before| *before != NOBODY);
        let states = std::iter::successors(Some(end), |state| before(state).map(|before| before as usize));
        let mut states: Vec<usize> = states.collect();
        states.reverse();
        let mut poses: Vec<Pose2> = vec![self.ends[0]];
        let stand = |state: &usize| self.stand(*state).map(|(pose, _)| pose);
        for pose in states[1..].iter().filter_map(stand) {
            poses.push(near(&poses[poses.len() - 1], pose));
        }
        poses
    }
}

/// A pose, by whole turns as near to another one's heading as it gets.
pub(crate) fn near(to: &Pose2, pose: Pose2) -> Pose2 {
    Pose2 { heading_rad: to.heading_rad + wrap_angle_rad(pose.heading_rad - to.heading_rad), ..pose }
}
