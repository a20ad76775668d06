//! A heading that is free between its first and its last one: it turns as the motion is fastest.
//!
//! The heading is a C2 cubic spline over σ, even knots apart. Its values are sought, all at once and ever fewer
//! together, with steps that become smaller (a pattern search: R. Hooke and T. A. Jeeves, *"Direct Search"
//! Solution of Numerical and Statistical Problems*, J. ACM 8(2), 1961), on knots that become closer.
//!
//! What is made less is the time of the progress without regard to jerk, and what the jerk then costs at each
//! stop. It finds a good heading, not surely the best one.

use std::ops::Range;

use super::grid::Grid;
use super::{FastestError, FastestTrajectory, PlatformBounds};
use crate::geometry::{GeometricPath, spline_speeds};
use crate::path_points::nearest_turn_rad;
use crate::polynomial::{End, Polynomial};
use crate::reach::{AccelerationBounds, Reached};
use crate::trajectory::Trajectory;

/// Pieces of the heading's spline, one round after the other.
const PIECES: [usize; 3] = [4, 8, 16];
/// Steps of the search, rad, and how often each is tried at every knot.
const STEPS_RAD: [f64; 4] = [0.8, 0.4, 0.2, 0.1];
const SWEEPS: usize = 3;
/// A step that gains less than this part of the time isn't made.
const GAIN: f64 = 1e-4;
/// So many intervals of grids are solved at most: some seconds, whatever the way.
const INTERVALS: usize = 400_000;
/// What counts for an interval whose time the first grid doesn't tell, s.
const UNKNOWN_S: f64 = 1e3;
/// A knot that lies so close to a joint of the way, over the whole, is that joint.
const SAME: f64 = 1e-9;

/// A way with another heading.
#[derive(Clone, Debug)]
pub struct Turned<P> {
    path: P,
    turn: Turn,
}

/// A heading over σ.
#[derive(Clone, Debug)]
struct Turn {
    piece_length: f64,
    headings_rad: Vec<f64>,
    pieces: Vec<Polynomial>,
}

impl Turn {
    fn through(headings_rad: Vec<f64>, length: f64) -> Turn {
        let count = headings_rad.len() - 1;
        let piece_length = length / count as f64;
        let speeds = spline_speeds(&headings_rad, &vec![piece_length; count]);
        let end = |at: usize| End { position: headings_rad[at], speed: speeds[at], acceleration: 0.0 };
        let pieces = (0..count).map(|at| Polynomial::cubic(end(at), end(at + 1), piece_length)).collect();
        Turn { piece_length, headings_rad, pieces }
    }

    fn even([from_rad, to_rad]: [f64; 2], length: f64) -> Turn {
        let heading = |at: usize| from_rad + (to_rad - from_rad) * at as f64 / PIECES[0] as f64;
        Turn::through((0..=PIECES[0]).map(heading).collect(), length)
    }

    fn at(&self, sigma: f64) -> [f64; 4] {
        let piece = ((sigma / self.piece_length) as usize).min(self.pieces.len() - 1);
        self.pieces[piece].derivatives(sigma - piece as f64 * self.piece_length)
    }

    /// The same heading, nearly, by so many pieces.
    fn in_pieces(&self, count: usize) -> Turn {
        let length = self.piece_length * self.pieces.len() as f64;
        let last = self.headings_rad[self.headings_rad.len() - 1];
        let inner = (0..count).map(|at| self.at(length * at as f64 / count as f64)[0]);
        Turn::through(inner.chain([last]).collect(), length)
    }

    /// The same heading with other values at some knots.
    fn moved(&self, knots: Range<usize>, by_rad: f64) -> Turn {
        let mut headings_rad = self.headings_rad.clone();
        headings_rad[knots].iter_mut().for_each(|heading_rad| *heading_rad += by_rad);
        Turn::through(headings_rad, self.piece_length * self.pieces.len() as f64)
    }
}

impl<P: GeometricPath> GeometricPath for Turned<P> {
    fn length(&self) -> f64 {
        self.path.length()
    }

    fn sample(&self, sigma: f64, side: f64) -> [[f64; 4]; 3] {
        self.sample_near(sigma, side, &mut 0)
    }

    fn sample_near(&self, sigma: f64, side: f64, piece: &mut usize) -> [[f64; 4]; 3] {
        let [x, y, _] = self.path.sample_near(sigma, side, piece);
        [x, y, self.turn.at(sigma)]
    }

    fn breaks(&self) -> Vec<f64> {
        let mut breaks = self.path.breaks();
        let (of_path, near) = (breaks.len(), SAME * self.length());
        for knot in 1..self.turn.pieces.len() {
            let knot = knot as f64 * self.turn.piece_length;
            let after = breaks[..of_path].partition_point(|at| *at < knot);
            let is_joint = |at: usize| breaks.get(at).is_some_and(|at| (at - knot).abs() < near);
            if !is_joint(after) && !after.checked_sub(1).is_some_and(is_joint) {
                breaks.push(knot);
            }
        }
        breaks.sort_by(f64::total_cmp);
        breaks
    }
}

/// Looks for the heading of a way.
struct Search<'a, P> {
    path: &'a P,
    bounds: &'a PlatformBounds,
    acceleration: AccelerationBounds,
    /// Intervals that may still be solved.
    left: usize,
}

impl<P: GeometricPath> Search<'_, P> {
    /// About how long the motion takes with a heading, s; infinite where there is none, or nothing may be solved any more.
    fn lasts_s(&mut self, turn: &Turn) -> f64 {
        let path = Turned { path: self.path, turn: turn.clone() };
        if self.left == 0 {
            return f64::INFINITY;
        }
        let Ok(grid) = Grid::new(&path, self.bounds) else { return f64::INFINITY };
        let count = grid.intervals.len();
        self.left = self.left.saturating_sub(count);
        let mut reached = Reached::new(count);
        if reached.solve(&grid.intervals, &grid.most, &self.acceleration, [0.0, 0.0]).is_err() {
            return f64::INFINITY;
        }
        let parts = (0..count).map(|at| grid.lasts_s(&reached, at)).map(|part_s| part_s.min(UNKNOWN_S));
        let stops = reached.x.iter().skip(1).filter(|x| **x <= 0.0).count();
        parts.sum::<f64>() + stops as f64 * self.bounds.first_window_s(&grid.intervals, &reached.x)
    }

    /// A faster heading than one, or that one.
    fn improve(&mut self, turn: Turn) -> Turn {
        let mut found = (self.lasts_s(&turn), turn);
        for count in PIECES {
            let finer = found.1.in_pieces(count);
            let mut now = (self.lasts_s(&finer), finer);
            for step_rad in STEPS_RAD {
                for _ in 0..SWEEPS {
                    let before_s = now.0;
                    for (knots, sign) in moves(count) {
                        let moved = now.1.moved(knots, sign * step_rad);
                        let lasts_s = self.lasts_s(&moved);
                        if lasts_s < now.0 * (1.0 - GAIN) {
                            now = (lasts_s, moved);
                        }
                    }
                    if now.0 >= before_s {
                        break;
                    }
                }
            }
            if now.0 < found.0 {
                found = now;
            }
        }
        found.1
    }
}

/// Neighbouring knots that are moved together, in both directions: all between the ends first, then half as many, down to each alone.
/// To where wheels are faster a heading turns as a whole; one knot alone would only turn to and fro.
fn moves(count: usize) -> impl Iterator<Item = (Range<usize>, f64)> {
    let inner = count - 1;
    let widths = std::iter::successors(Some(inner), |width| Some(width / 2).filter(|half| *half > 0));
    let blocks = widths.flat_map(move |width| (1..=count - width).map(move |from| from..from + width));
    blocks.flat_map(|knots| [1.0, -1.0].map(|sign| (knots.clone(), sign)))
}

impl<P: GeometricPath + Clone> FastestTrajectory<Turned<P>> {
    /// The fastest motion that is found along a path whose own heading doesn't count: it turns from a first heading to a last one,
    /// rad, but for whole turns.
    ///
    /// The path must lead from place to place: where it turns on the spot it has no direction.
    pub fn with_free_heading(
        path: &P,
        ends_rad: [f64; 2],
        bounds: &PlatformBounds,
    ) -> Result<FastestTrajectory<Turned<P>>, FastestError> {
        let near_rad = nearest_turn_rad(ends_rad[1], ends_rad[0]);
        let mut ends = vec![[ends_rad[0], near_rad]];
        if near_rad != ends_rad[1] {
            ends.push(ends_rad);
        }
        let mut best: Option<Result<FastestTrajectory<Turned<P>>, FastestError>> = None;
        for ends_rad in &ends {
            let left = INTERVALS / ends.len();
            let mut search = Search { path, bounds, acceleration: bounds.acceleration(), left };
            let turn = search.improve(Turn::even(*ends_rad, path.length()));
            let found = FastestTrajectory::new(Turned { path: path.clone(), turn }, bounds);
            let is_better = match (&best, &found) {
                (Some(Ok(best)), Ok(found)) => found.duration_s() < best.duration_s(),
                (None | Some(Err(_)), _) => true,
                (Some(Ok(_)), Err(_)) => false,
            };
            if is_better {
                best = Some(found);
            }
        }
        best.expect("there is a first pair of ends")
    }
}
