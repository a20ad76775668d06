//! A way in the shortest time that the platform's limits allow, from rest to rest, with a bounded jerk.
//!
//! First the fastest progress without regard to jerk ([`crate::reach`]), then the mean of it over a window of time: its path is
//! the same, its acceleration continuous, its jerk at most twice the acceleration over the window. Where the mean exceeds a limit,
//! for it looks past bends, the limits are lowered there and the progress is found again.

mod bounds;
mod smooth;

pub use bounds::{Heat, Limit, PlatformBounds};

use crate::geometry::GeometricPath;
use crate::polynomial::over_time;
use crate::reach::{Bend, Interval, Reached, Unreachable};
use crate::trajectory::{LONGEST_S, Setpoint, Trajectory};
use smooth::Progress;

/// A geometric path in the shortest time.
#[derive(Clone, Debug)]
pub struct FastestTrajectory<P> {
    path: P,
    progress: Progress,
    /// Times where derivatives may jump, s.
    breaks_s: Vec<f64>,
}

/// Why a way has no fastest motion.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FastestError {
    /// The limits leave none.
    #[error(transparent)]
    Unreachable(#[from] Unreachable),
    /// The way stands still in σ, or isn't finite.
    #[error("the way has no direction at {at} of {length}")]
    NoDirection {
        /// Where, in σ.
        at: f64,
        /// The way's length in σ.
        length: f64,
    },
    /// A motion beyond any use.
    #[error("it takes {found_s} s, expected at most {LONGEST_S} s")]
    TooLong {
        /// How long it takes.
        found_s: f64,
    },
}

/// Intervals of the grid for the whole way, about, and for each of its pieces at least and at most.
const GRID: f64 = 400.0;
const GRID_OF_PIECE: (f64, f64) = (4.0, 400.0);
/// Rounds of lowering limits where the mean exceeds them; the rest is done by stretching the whole.
const ROUNDS: usize = 8;
/// What a limit may be exceeded by before a round, over itself; the last stretch takes it away.
const NEAR: f64 = 1e-3;
/// Where pieces of the progress are looked at: beside their joints, and between them.
const LOOKS: [f64; 3] = [0.001, 0.5, 0.999];
/// Directions that differ by less are one, over their length.
const SAME_DIRECTION: f64 = 1e-6;

/// The grid along a path, and its limits.
struct Grid {
    /// σ at the points.
    sigma: Vec<f64>,
    intervals: Vec<Interval>,
    /// The greatest σ̇² at the points by limits on speed, and before any was lowered.
    most: Vec<f64>,
    free: Vec<f64>,
    /// The pace to which the intervals are lowered, 1 for none; and which of them were in the last round.
    pace: Vec<f64>,
    is_lowered: Vec<bool>,
}

impl Grid {
    fn new<P: GeometricPath>(path: &P, bounds: &PlatformBounds) -> Result<Grid, FastestError> {
        let length = path.length();
        let mut grid = Grid {
            sigma: vec![0.0],
            intervals: Vec::new(),
            most: Vec::new(),
            free: Vec::new(),
            pace: Vec::new(),
            is_lowered: Vec::new(),
        };
        let mut before: Option<Bend> = None;
        for pair in path.breaks().windows(2) {
            let piece = pair[1] - pair[0];
            let (fewest, most) = GRID_OF_PIECE;
            let count = (GRID * piece / length).ceil().clamp(fewest, most) as usize;
            for at in 0..count {
                let [from, to] = [at, at + 1].map(|at| pair[0] + piece * at as f64 / count as f64);
                let to = if at + 1 == count { pair[1] } else { to };
                let ((first, speed), (second, last_speed)) =
                    (bounds.look(&path.sample(from, 1.0)), bounds.look(&path.sample(to, -1.0)));
                let is_way = |bend: &Bend| {
                    let size = bend.rate.iter().map(|rate| rate.abs()).sum::<f64>();
                    size > 0.0 && size.is_finite() && bend.curve.iter().all(|curve| curve.is_finite())
                };
                if !is_way(&first) || !is_way(&second) || to <= from {
                    return Err(FastestError::NoDirection { at: from, length });
                }
                match before {
                    // A corner: nothing passes it with a speed.
                    Some(before) if differ(&before.rate, &first.rate) => grid.set_last(0.0),
                    _ => grid.set_last(speed),
                }
                grid.free.push(last_speed);
                grid.intervals.push(Interval { length: to - from, ends: [first, second], share: 1.0 });
                grid.sigma.push(to);
                before = Some(second);
            }
        }
        grid.most.clone_from(&grid.free);
        grid.pace = vec![1.0; grid.intervals.len()];
        grid.is_lowered = vec![false; grid.intervals.len()];
        Ok(grid)
    }

    /// The speed at the last point is at most this too.
    fn set_last(&mut self, most: f64) {
        match self.free.last_mut() {
            Some(last) => *last = last.min(most),
            None => self.free.push(most),
        }
    }

    /// Lowers the pace between two places.
    fn lower(&mut self, [from, to]: [f64; 2], pace: f64) {
        let first = self.sigma.partition_point(|at| *at <= from).saturating_sub(1);
        for at in first..self.intervals.len() {
            if self.sigma[at] > to {
                break;
            }
            self.pace[at] = self.pace[at].min(pace);
        }
    }

    /// Lowers the paces between two places by a factor each, as they were before.
    fn slow(&mut self, [from, to]: [f64; 2], before: &[f64], factor: f64) {
        let first = self.sigma.partition_point(|at| *at <= from).saturating_sub(1);
        let places =
            self.pace.iter_mut().zip(before).zip(&self.sigma).skip(first).take(self.intervals.len() - first);
        for ((pace, before), _) in places.take_while(|(_, at)| **at <= to) {
            *pace = pace.min(before / factor);
        }
    }

    /// Which intervals lie within a window of time of what is new.
    fn near(&self, reached: &Reached, window_s: f64) -> Vec<bool> {
        let mut is_near = vec![false; self.intervals.len()];
        let x = &reached.x;
        let lasts_s = |at: usize| 2.0 * self.intervals[at].length / (x[at].sqrt() + x[at + 1].sqrt());
        // How long ago something was new, to both sides; an interval more, for pieces are told by where they begin.
        let mut ago_s = f64::INFINITY;
        let mut look = |at: usize| {
            let is_new = reached.is_new[at] || reached.is_new[at + 1] || self.is_lowered[at];
            ago_s = if is_new { 0.0 } else { ago_s + lasts_s(at) };
            is_near[at] |= ago_s <= 2.0 * window_s + 2.0 * lasts_s(at);
        };
        (0..self.intervals.len()).for_each(&mut look);
        (0..self.intervals.len()).rev().for_each(&mut look);
        is_near
    }

    /// Lets the limits follow the paces.
    fn apply(&mut self, reached: &mut Reached) {
        for (at, (interval, pace)) in self.intervals.iter_mut().zip(&self.pace).enumerate() {
            self.is_lowered[at] = interval.share != pace * pace;
            if self.is_lowered[at] {
                interval.share = pace * pace;
                reached.change(at);
            }
        }
        for (at, (most, free)) in self.most.iter_mut().zip(&self.free).enumerate() {
            let beside =
                [at.checked_sub(1), Some(at)].map(|beside| beside.and_then(|beside| self.pace.get(beside)));
            let pace = beside.into_iter().flatten().fold(1.0_f64, |least, pace| least.min(*pace));
            *most = free * pace * pace;
        }
    }
}

fn differ(a: &[f64; 3], b: &[f64; 3]) -> bool {
    let size = a.iter().chain(b).fold(0.0_f64, |most, part| most.max(part.abs()));
    a.iter().zip(b).any(|(a, b)| (a - b).abs() > SAME_DIRECTION * size)
}

impl<P: GeometricPath> FastestTrajectory<P> {
    /// The fastest motion along a path.
    pub fn new(path: P, bounds: &PlatformBounds) -> Result<FastestTrajectory<P>, FastestError> {
        let mut grid = Grid::new(&path, bounds)?;
        let acceleration = bounds.acceleration();
        let mut reached = Reached::new(grid.intervals.len());
        let mut window_s = 0.0;
        let mut excess = 1.0;
        let mut calm: f64 = 0.0;
        let mut found = FastestTrajectory { path, progress: Progress::default(), breaks_s: Vec::new() };
        for round in 0..ROUNDS {
            reached.solve((&grid.intervals, &grid.most), &acceleration, [0.0, 0.0])?;
            if round == 0 {
                window_s = bounds.first_window_s(&grid.intervals, &reached.x);
            }
            found.progress = Progress::new(&grid.sigma, &reached.x, window_s);
            if found.progress.duration_s().is_nan() || found.progress.duration_s() > LONGEST_S {
                return Err(FastestError::TooLong { found_s: found.progress.duration_s() });
            }
            let is_near = grid.near(&reached, window_s);
            excess = found.lower(&mut grid, bounds, (window_s, &is_near), &mut calm);
            if excess <= 1.0 + NEAR {
                break;
            }
            grid.apply(&mut reached);
        }
        found.progress.stretch(excess.max(1.0));
        found.breaks_s = found.progress.times_s();
        Ok(found)
    }

    /// Lowers the pace where the motion exceeds limits; by how much longer the whole would have to take to keep them. Only near what
    /// is new there is anything to see; `calm` is the most that was seen elsewhere.
    fn lower(
        &self,
        grid: &mut Grid,
        bounds: &PlatformBounds,
        (window_s, is_near): (f64, &[bool]),
        calm: &mut f64,
    ) -> f64 {
        let mut most: f64 = 1.0;
        let before = grid.pace.clone();
        let mut at = 0;
        for (times_s, sigma) in self.progress.pieces() {
            while at + 1 < is_near.len() && grid.sigma[at + 1] <= sigma {
                at += 1;
            }
            if !is_near[at] {
                continue;
            }
            for part in LOOKS {
                let time_s = times_s[0] + part * (times_s[1] - times_s[0]);
                let pace = bounds.pace(&self.sample(time_s));
                if pace > 1.0 + 0.5 * NEAR {
                    let around = [-0.5, 0.5].map(|part| self.progress.at(time_s + part * window_s)[0]);
                    let first = grid.sigma.partition_point(|at| *at <= around[0]).saturating_sub(1);
                    let held = before.get(first).copied().unwrap_or(1.0);
                    grid.lower(around, held / pace);
                    most = most.max(pace);
                } else {
                    *calm = calm.max(pace);
                }
            }
        }
        most = most.max(*calm);
        let Some(heat) = &bounds.heat else { return most };
        for ([from_s, to_s], load) in heat.warming(self, &self.progress.times_s()).windows() {
            if load > 1.0 + 0.5 * NEAR {
                let pace = load.sqrt();
                grid.slow([from_s, to_s].map(|time_s| self.progress.at(time_s)[0]), &before, pace);
                most = most.max(pace);
            }
        }
        most
    }

    /// The path.
    pub fn path(&self) -> &P {
        &self.path
    }

    /// How far along the path it is at a time: σ, its rate, and the rates of that.
    pub fn progress(&self, time_s: f64) -> [f64; 4] {
        self.progress.at(time_s)
    }
}

impl<P: GeometricPath> Trajectory for FastestTrajectory<P> {
    fn duration_s(&self) -> f64 {
        self.progress.duration_s()
    }

    fn sample(&self, time_s: f64) -> Setpoint {
        let progress = self.progress.at(time_s);
        // At a joint the half counts in which it will be next.
        let axes = self.path.sample(progress[0], 1.0);
        Setpoint::from_axes(axes.map(|axis| over_time(axis, progress)))
    }

    fn breaks_s(&self) -> Vec<f64> {
        self.breaks_s.clone()
    }
}
