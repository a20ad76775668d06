//! A way in the shortest time that the platform's limits allow, with a bounded jerk: from rest to rest, or passing its ends with speeds.
//!
//! First the fastest progress without regard to jerk ([`crate::reach`]), then the mean of it over a window of time: its path is
//! the same, its acceleration continuous, its jerk at most twice the acceleration over the window. Where the mean exceeds a limit,
//! for it looks past bends, the limits are lowered there and the progress is found again. Where the mean costs much, other windows are tried.

mod bounds;
mod free;
mod grid;
mod runs;
mod smooth;

pub use bounds::{Heat, Limit, PlatformBounds};
pub use free::Turned;
pub use runs::{Passing, WayEnd, WithRuns};

use crate::geometry::GeometricPath;
use crate::polynomial::over_time;
use crate::reach::{AccelerationBounds, Reached, Unreachable};
use crate::trajectory::{LONGEST_S, Setpoint, Trajectory};
use grid::{Excess, Grid};
use smooth::Progress;

/// A geometric path in the shortest time.
#[derive(Clone, Debug)]
pub struct FastestTrajectory<P> {
    path: P,
    progress: Progress,
    /// Times where derivatives may jump, s.
    breaks_s: Vec<f64>,
    /// When it passes the ends of its way with a speed, s.
    passes_s: [Option<f64>; 2],
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
    /// An end of the way can't be passed so fast.
    #[error("its {end} can't be passed at {asked_m_s} m/s: the limits leave {found_m_s:.3} m/s there")]
    NoSpeed {
        /// Which end.
        end: WayEnd,
        /// The speed that was asked for, m/s.
        asked_m_s: f64,
        /// The speed of the motion that was found for it, m/s.
        found_m_s: f64,
    },
    /// The way turns there without leading anywhere.
    #[error("the way turns on the spot at its {0}: nothing is passed there")]
    OnTheSpot(WayEnd),
    /// A motion beyond any use.
    #[error("it takes {found_s} s, expected at most {LONGEST_S} s")]
    TooLong {
        /// How long it takes.
        found_s: f64,
    },
}

/// Rounds of making the grid finer.
const ROUNDS: usize = 16;

/// How limits are lowered where the mean exceeds them; the rest is done by stretching the whole.
struct Lowering {
    rounds: usize,
    /// By which power of what is asked for: in the first rounds, and after them.
    powers: [f64; 2],
    first_rounds: usize,
}

/// After two rounds by more than asked for: few places are left, whose neighbours follow.
const QUICKLY: Lowering = Lowering { rounds: 16, powers: [1.0, 2.0], first_rounds: 2 };
/// By less than asked for: a place that is lowered holds its neighbours, too, which then needn't be lowered as much.
const GENTLY: Lowering = Lowering { rounds: 60, powers: [0.3, 0.3], first_rounds: 0 };
/// What a limit may be exceeded by before a round, over itself; the last stretch takes it away.
const NEAR: f64 = 1e-3;
/// A window that lasts longer than this part of the motion is tried longer and shorter, each time by one of these factors, until so many
/// in a row gain nothing; and then the best of them again, and shorter ones, with limits that are lowered gently.
const LONG_WINDOW: f64 = 0.02;
const LONGER: f64 = 1.25;
const SHORTER: f64 = 0.8;
const HARDLY_SHORTER: f64 = 0.85;
const MISSES: usize = 2;
/// Where pieces of the progress are looked at: beside their joints, and between them.
const LOOKS: [f64; 3] = [0.001, 0.5, 0.999];

/// So far beside a joint of the way its sides are looked at, over the whole: rounding is far less.
const BESIDE: f64 = 1e-9;

/// Where a motion is looked at.
struct Looks<'a> {
    grid: &'a Grid,
    /// σ of the way's joints.
    joints: &'a [f64],
    /// The mean's window, s.
    window_s: f64,
    /// Which intervals of the grid something new is near: only there is anything to see.
    is_near: &'a [bool],
}

/// The shortest motion of those that were tried, and its window.
struct Best {
    progress: Progress,
    window_s: f64,
}

/// What a motion is smoothed from: the fastest progress without regard to jerk.
struct Start {
    grid: Grid,
    reached: Reached,
    acceleration: AccelerationBounds,
    /// The window whose mean keeps the jerk without lowering limits but at bends, s.
    window_s: f64,
}

impl Start {
    fn new(path: &impl GeometricPath, bounds: &PlatformBounds) -> Result<Start, FastestError> {
        let acceleration = bounds.acceleration();
        let mut grid = Grid::new(path, bounds)?;
        let mut reached = Reached::new(grid.intervals.len());
        reached.solve(&grid.intervals, &grid.most, &acceleration, [0.0, 0.0])?;
        for _ in 0..ROUNDS {
            let parts = grid.unresolved(path, bounds, &acceleration, &reached)?;
            if !grid.split(path, bounds, &parts, &mut reached)? {
                break;
            }
            reached.solve(&grid.intervals, &grid.most, &acceleration, [0.0, 0.0])?;
        }
        let window_s = bounds.first_window_s(&grid.intervals, &reached.x);
        reached.is_new.fill(true);
        Ok(Start { grid, reached, acceleration, window_s })
    }

    /// The mean over a window, with limits lowered so that it keeps them all; given up where it lasts longer than `most_s`.
    fn smoothed(
        &self,
        path: &impl GeometricPath,
        bounds: &PlatformBounds,
        [window_s, most_s]: [f64; 2],
        lowering: &Lowering,
    ) -> Result<Progress, FastestError> {
        let (mut grid, mut reached) = (self.grid.clone(), self.reached.clone());
        let joints = path.breaks();
        let mut calm: f64 = 0.0;
        let mut round = 0;
        loop {
            let mut found = FastestTrajectory::of(path, Progress::new(&grid.sigma, &reached.x, window_s));
            let duration_s = found.duration_s();
            // It becomes longer by each round.
            if duration_s.is_nan() || duration_s > most_s.min(LONGEST_S) {
                return Err(FastestError::TooLong { found_s: duration_s });
            }
            round += 1;
            let is_near = grid.near(&reached, window_s);
            let looks = Looks { grid: &grid, joints: &joints, window_s, is_near: &is_near };
            let (mut excesses, mut most) = found.excesses(&looks, bounds, &mut calm);
            // What cools is slower: a look before the others' rounds, and one behind them.
            let is_kept = most <= 1.0 + NEAR || round == lowering.rounds;
            let hot = if round == 1 || is_kept { found.too_hot(bounds) } else { Vec::new() };
            most = hot.iter().map(|excess| excess.pace).fold(most, f64::max);
            if most <= 1.0 + NEAR || round == lowering.rounds {
                found.progress.stretch(most);
                let found_s = found.duration_s();
                let is_shorter = found_s < most_s.min(LONGEST_S);
                return if is_shorter { Ok(found.progress) } else { Err(FastestError::TooLong { found_s }) };
            }
            let power = lowering.powers[usize::from(round > lowering.first_rounds)];
            excesses.iter_mut().for_each(|excess| excess.pace = excess.pace.powf(power));
            let parts = grid.too_long(&excesses, &reached, window_s);
            grid.split(path, bounds, &parts, &mut reached)?;
            let before = grid.pace.clone();
            grid.lower(&excesses, &before);
            grid.slow(&hot, &before);
            grid.apply(&mut reached);
            reached.solve(&grid.intervals, &grid.most, &self.acceleration, [0.0, 0.0])?;
        }
    }
}

impl<P: GeometricPath> FastestTrajectory<P> {
    /// The fastest motion along a path.
    pub fn new(path: P, bounds: &PlatformBounds) -> Result<FastestTrajectory<P>, FastestError> {
        FastestTrajectory::that(path, bounds, |_, _| true)
    }

    /// The fastest motion along a path, but another mean than the first is taken only where its progress is as it must be.
    fn that(
        path: P,
        bounds: &PlatformBounds,
        is_so: impl Fn(&P, &Progress) -> bool,
    ) -> Result<FastestTrajectory<P>, FastestError> {
        let start = Start::new(&path, bounds)?;
        let progress = start.smoothed(&path, bounds, [start.window_s, f64::INFINITY], &QUICKLY)?;
        let mut best = Best { progress, window_s: start.window_s };
        // Where the jerk is small, the mean costs time: a shorter one costs less, until limits are lowered by more than that for it. By how
        // much they are isn't even over windows: one that gains nothing may be followed by one that does.
        let mut tried = |factor: f64, is_again: bool, lowering: &Lowering| {
            let mut window_s = if is_again { best.window_s } else { factor * start.window_s };
            let mut misses = 0;
            while misses < MISSES && window_s > LONG_WINDOW * best.progress.duration_s() {
                let span_s = [window_s, best.progress.duration_s()];
                match start.smoothed(&path, bounds, span_s, lowering) {
                    Ok(progress) if is_so(&path, &progress) => {
                        best = Best { progress, window_s };
                        misses = 0;
                    }
                    _ => misses += 1,
                }
                window_s *= factor;
            }
        };
        tried(LONGER, false, &QUICKLY);
        tried(SHORTER, false, &QUICKLY);
        tried(HARDLY_SHORTER, true, &GENTLY);
        Ok(FastestTrajectory::of(path, best.progress))
    }

    /// The motion that a progress makes along a path.
    fn of(path: P, progress: Progress) -> FastestTrajectory<P> {
        let breaks_s = progress.times_s().to_vec();
        FastestTrajectory { path, progress, breaks_s, passes_s: [None; 2] }
    }

    /// Where the motion exceeds limits, and by how much longer the whole would have to take to keep them; `calm` is the most that was seen
    /// where it isn't looked again.
    fn excesses(&self, looks: &Looks<'_>, bounds: &PlatformBounds, calm: &mut f64) -> (Vec<Excess>, f64) {
        let mut found = Vec::new();
        let mut most: f64 = 1.0;
        let (mut at, mut joint, mut of_path) = (0, 0, 0);
        let mut look = |time_s: f64, setpoint: &Setpoint| {
            let pace = bounds.pace(setpoint);
            if pace > 1.0 + 0.5 * NEAR {
                let between = [-0.5, 0.5].map(|part| self.progress.at(time_s + part * looks.window_s)[0]);
                found.push(Excess { between, pace });
                most = most.max(pace);
            } else {
                *calm = calm.max(pace);
            }
        };
        let Looks { grid, joints, is_near, .. } = looks;
        let beside = BESIDE * self.path.length();
        for piece in 0..self.progress.piece_count() {
            let sigma = self.progress.in_piece(piece, 0.0).1[0];
            while at + 1 < is_near.len() && grid.sigma[at + 1] <= sigma {
                at += 1;
            }
            if !is_near[at] {
                continue;
            }
            for part in LOOKS {
                let (time_s, progress) = self.progress.in_piece(piece, part);
                look(time_s, &self.along(progress, 1.0, &mut of_path));
            }
            // Where the way's third derivative jumps, the jerk does: both sides of it count.
            let end = self.progress.in_piece(piece, 1.0).1[0];
            joint += joints[joint..].iter().take_while(|joint| **joint <= sigma).count();
            for sigma in joints[joint..].iter().take_while(|joint| **joint < end) {
                let (time_s, progress) = self.progress.in_piece_at(piece, *sigma);
                for side in [-1.0, 1.0] {
                    let [_, rate, second, third] = progress;
                    let beside = [sigma + side * beside, rate, second, third];
                    look(time_s, &self.along(beside, side, &mut of_path));
                }
            }
        }
        (found, most.max(*calm))
    }

    /// Where motors become too hot.
    fn too_hot(&self, bounds: &PlatformBounds) -> Vec<Excess> {
        let Some(heat) = &bounds.heat else { return Vec::new() };
        let mut of_path = 0;
        let warming = heat.warming(self.progress.times_s(), |piece, part| {
            self.along(self.progress.in_piece(piece, part).1, 1.0, &mut of_path)
        });
        let excess = |(times_s, load): ([f64; 2], f64)| Excess {
            between: times_s.map(|time_s| self.progress.at(time_s)[0]),
            pace: load.sqrt(),
        };
        warming.windows().filter(|(_, load)| *load > 1.0 + 0.5 * NEAR).map(excess).collect()
    }

    /// The setpoint at a progress, near a piece of the path, on a side of its joints.
    fn along(&self, progress: [f64; 4], side: f64, piece: &mut usize) -> Setpoint {
        let axes = self.path.sample_near(progress[0], side, piece);
        Setpoint::from_axes(axes.map(|axis| over_time(axis, progress)))
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
        // At a joint the half counts in which it will be next.
        self.along(self.progress.at(time_s), 1.0, &mut 0)
    }

    fn breaks_s(&self) -> Vec<f64> {
        self.breaks_s.clone()
    }

    fn passes_s(&self) -> [Option<f64>; 2] {
        self.passes_s
    }
}
