//! A way in the shortest time that the platform's limits allow, with a bounded jerk: from rest to rest, or passing its ends with speeds.
//!
//! First the fastest progress without regard to jerk ([`crate::reach`]), then the mean of it over a window of
//! time: its path is the same, its acceleration continuous, its jerk at most twice the acceleration over the
//! window.
//!
//! Where the mean exceeds a limit, for it looks past bends, the limits are lowered there and the progress is
//! found again. Where the mean costs much, the best motion near it is sought first, over the whole of it at
//! once.

mod bounds;
mod free;
mod grid;
mod optimum;
mod runs;
mod smooth;

pub use bounds::{Heat, Limit, PlatformBounds};
pub use free::Turned;
pub use runs::{Passing, WayEnd, WithRuns};

use crate::geometry::GeometricPath;
use crate::polynomial::over_time;
use crate::reach::{AccelerationBounds, Reached, Unreachable};
use crate::trajectory::{LONGEST_S, Setpoint, Trajectory};
use bounds::Warming;
use grid::{Excess, Grid};
use optimum::Assessment;
use smooth::{PARTS, Progress};

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
    /// The grid that it needs is finer than any use.
    #[error("limits, or lengths of the way, are so far apart that {most} parts of it aren't enough")]
    TooFine {
        /// Most parts that there may be.
        most: usize,
    },
    /// A motion beyond any use.
    #[error("it takes {found_s} s, expected at most {LONGEST_S} s")]
    TooLong {
        /// How long it takes.
        found_s: f64,
    },
}

/// Rounds of making the grid finer, and before the first search; one that halves no more than one of so many parts is the last.
const ROUNDS: usize = 16;
const FIRST_ROUNDS: usize = 2;
const FEW: usize = 16;
/// Rounds of lowering limits where the mean exceeds them; the rest is done by stretching the whole. After so many by more than asked for:
/// few places are left, whose neighbours follow.
const LOWERINGS: usize = 16;
const FEW_AFTER: usize = 2;
const MORE: f64 = 2.0;
/// What a limit may be exceeded by before a round, over itself; the last stretch takes it away.
const NEAR: f64 = 1e-3;
/// What the jerk may cost, over the time without regard to it, before the best motion near by is sought.
const COSTS: f64 = 0.02;
/// The best motion near the mean isn't compared with the smoothed one where it is longer than the mean by less than this part of it.
const LONGER: f64 = 0.01;
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

/// What a motion is smoothed from: the fastest progress without regard to jerk.
struct Start {
    grid: Grid,
    reached: Reached,
    acceleration: AccelerationBounds,
    /// The window whose mean keeps the jerk without lowering limits but at bends, s.
    window_s: f64,
}

impl Start {
    /// On the first grid.
    fn new(path: &impl GeometricPath, bounds: &PlatformBounds) -> Result<Start, FastestError> {
        let acceleration = bounds.acceleration();
        let grid = Grid::new(path, bounds)?;
        let mut reached = Reached::new(grid.intervals.len());
        reached.solve(&grid.intervals, &grid.most, &acceleration, [0.0, 0.0])?;
        let window_s = bounds.first_window_s(&grid.intervals, &reached.x);
        Ok(Start { grid, reached, acceleration, window_s })
    }

    /// Makes the grid finer, by so many rounds at most.
    fn resolve(
        &mut self,
        path: &impl GeometricPath,
        bounds: &PlatformBounds,
        rounds: usize,
    ) -> Result<(), FastestError> {
        let Start { grid, reached, acceleration, .. } = self;
        for _ in 0..rounds {
            let parts = grid.unresolved(path, bounds, acceleration, reached)?;
            if !grid.split(path, bounds, &parts, reached)? {
                break;
            }
            reached.solve(&grid.intervals, &grid.most, acceleration, [0.0, 0.0])?;
            // What is halved is then as fine as it must be, but for a share that doesn't count.
            let halved = parts.iter().filter(|parts| **parts > 1).count();
            if FEW * halved <= parts.len() && parts.iter().all(|parts| *parts <= 2) {
                break;
            }
        }
        self.window_s = bounds.first_window_s(&self.grid.intervals, &self.reached.x);
        Ok(())
    }

    /// The mean, with limits lowered so that it keeps them all.
    fn smoothed(
        &self,
        path: &impl GeometricPath,
        bounds: &PlatformBounds,
        mean: Progress,
    ) -> Result<Progress, FastestError> {
        let window_s = self.window_s;
        let (mut grid, mut reached) = (self.grid.clone(), self.reached.clone());
        reached.is_new.fill(true);
        let joints = path.breaks();
        let mut calm: f64 = 0.0;
        let mut round = 0;
        let mut found = FastestTrajectory::of(path, mean);
        loop {
            let duration_s = found.duration_s();
            // It becomes longer by each round.
            if duration_s.is_nan() || duration_s > LONGEST_S {
                return Err(FastestError::TooLong { found_s: duration_s });
            }
            round += 1;
            let is_near = grid.near(&reached, window_s);
            let looks = Looks { grid: &grid, joints: &joints, window_s, is_near: &is_near };
            let (mut excesses, mut most) = found.excesses(&looks, bounds, &mut calm);
            // What cools is slower: a look before the others' rounds, and one behind them.
            let is_kept = most <= 1.0 + NEAR || round == LOWERINGS;
            let hot = if round == 1 || is_kept { found.too_hot(bounds) } else { Vec::new() };
            most = hot.iter().map(|excess| excess.pace).fold(most, f64::max);
            if most <= 1.0 + NEAR || round == LOWERINGS {
                found.progress.stretch(most);
                let found_s = found.duration_s();
                let is_short = found_s < LONGEST_S;
                return if is_short { Ok(found.progress) } else { Err(FastestError::TooLong { found_s }) };
            }
            if round > FEW_AFTER {
                excesses.iter_mut().for_each(|excess| excess.pace = excess.pace.powf(MORE));
            }
            let parts = grid.too_long(&excesses, &reached, window_s);
            grid.split(path, bounds, &parts, &mut reached)?;
            let before = grid.pace.clone();
            grid.lower(&excesses, &before);
            grid.slow(&hot, &before);
            grid.apply(&mut reached);
            reached.solve(&grid.intervals, &grid.most, &self.acceleration, [0.0, 0.0])?;
            found = FastestTrajectory::of(path, Progress::new(&grid.sigma, &reached.x, window_s));
        }
    }

    /// Whether the jerk costs so much, for the mean is longer by its window, that the best motion near by is worth its search.
    fn is_costly(&self) -> bool {
        self.window_s > COSTS * self.lasts_s()
    }

    /// How long the motion takes without regard to jerk, s.
    fn lasts_s(&self) -> f64 {
        (0..self.grid.intervals.len()).map(|at| self.grid.lasts_s(&self.reached, at)).sum()
    }

    /// The mean over the window, which may exceed limits: it looks past bends.
    fn mean(&self) -> Progress {
        Progress::new(&self.grid.sigma, &self.reached.x, self.window_s)
    }

    /// The shortest motion near one that may exceed limits, within all of them.
    fn shortest_near(
        &self,
        path: &impl GeometricPath,
        bounds: &PlatformBounds,
        near: &Progress,
        lasts_s: f64,
    ) -> Option<Progress> {
        let joints = path.breaks();
        let is_near = vec![true; self.grid.intervals.len()];
        let looks = Looks { grid: &self.grid, joints: &joints, window_s: 0.0, is_near: &is_near };
        let look = |progress: &Progress| {
            let motion = FastestTrajectory::of(path, progress.clone());
            let mut paces = vec![1.0_f64; progress.piece_count()];
            motion.look(&looks, bounds, |piece, _, pace| paces[piece] = paces[piece].max(pace));
            Assessment {
                paces,
                squares: motion.warming(bounds, PARTS).map_or_else(Vec::new, |warming| warming.squares()),
            }
        };
        let costs = near.duration_s() / lasts_s - 1.0;
        optimum::shortest(path, bounds, near, [self.window_s, costs], look)
    }
}

impl<P: GeometricPath> FastestTrajectory<P> {
    /// The fastest motion along a path.
    pub fn new(path: P, bounds: &PlatformBounds) -> Result<FastestTrajectory<P>, FastestError> {
        FastestTrajectory::that(path, bounds, |_, _| true)
    }

    /// The fastest motion along a path, but another one than the mean is taken only where its progress is as it must be.
    fn that(
        path: P,
        bounds: &PlatformBounds,
        is_so: impl Fn(&P, &Progress) -> bool,
    ) -> Result<FastestTrajectory<P>, FastestError> {
        // The mean looks past whatever is shorter than its window, and one window holds for the whole.
        let near = |start: &Start, progress: &Progress| {
            let lasts_s = start.lasts_s();
            if progress.duration_s() <= (1.0 + COSTS) * lasts_s {
                return None;
            }
            start.shortest_near(&path, bounds, progress, lasts_s).filter(|found| is_so(&path, found))
        };
        // Lowered limits make the mean longer, never shorter.
        let is_short = |best: &Option<Progress>, mean: &Progress| {
            best.as_ref().is_some_and(|best| best.duration_s() <= (1.0 + LONGER) * mean.duration_s())
        };
        let mut start = Start::new(&path, bounds)?;
        // What the best motion is sought near to need not be told finely.
        start.resolve(&path, bounds, FIRST_ROUNDS)?;
        let mut best = None;
        let mut is_found = false;
        if start.is_costly() {
            let mean = start.mean();
            best = near(&start, &mean);
            is_found = is_short(&best, &mean);
        }
        if !is_found {
            start.resolve(&path, bounds, ROUNDS)?;
            let mean = start.mean();
            best = best.or_else(|| near(&start, &mean));
            if !is_short(&best, &mean) {
                let smoothed = start.smoothed(&path, bounds, mean)?;
                let others = [best.or_else(|| near(&start, &smoothed)), Some(smoothed)];
                best = others.into_iter().flatten().min_by(|a, b| a.duration_s().total_cmp(&b.duration_s()));
            }
        }
        let progress = best.expect("the mean, at least");
        Ok(FastestTrajectory::of(path, progress))
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
        self.look(looks, bounds, |_, time_s, pace| {
            if pace > 1.0 + 0.5 * NEAR {
                let between = [-0.5, 0.5].map(|part| self.progress.at(time_s + part * looks.window_s)[0]);
                found.push(Excess { between, pace });
                most = most.max(pace);
            } else {
                *calm = calm.max(pace);
            }
        });
        (found, most.max(*calm))
    }

    /// Tells pieces of the progress with times and how many times as long the motion would have to take there to keep its limits.
    fn look(&self, looks: &Looks<'_>, bounds: &PlatformBounds, mut take: impl FnMut(usize, f64, f64)) {
        let (mut interval, mut joint, mut of_path) = (0, 0, 0);
        let Looks { grid, joints, is_near, .. } = looks;
        let at =
            |axes: [[f64; 4]; 3], progress| Setpoint::from_axes(axes.map(|axis| over_time(axis, progress)));
        // The way where the piece before ends.
        let mut before = None;
        let beside = BESIDE * self.path.length();
        for piece in 0..self.progress.piece_count() {
            let (begin_s, begin) = self.progress.in_piece(piece, 0.0);
            let sigma = begin[0];
            while interval + 1 < is_near.len() && grid.sigma[interval + 1] <= sigma {
                interval += 1;
            }
            if !is_near[interval] {
                before = None;
                continue;
            }
            let (end_s, end) = self.progress.in_piece(piece, 1.0);
            let axes = before.unwrap_or_else(|| self.path.sample_near(sigma, 1.0, &mut of_path));
            take(piece, begin_s, bounds.pace(&at(axes, begin)));
            let (middle_s, middle) = self.progress.in_piece(piece, 0.5);
            take(piece, middle_s, bounds.pace(&self.along(middle, 1.0, &mut of_path)));
            // Where the way's third derivative jumps, the jerk does: both sides of it count.
            joint += joints[joint..].iter().take_while(|joint| **joint <= sigma).count();
            for sigma in joints[joint..].iter().take_while(|joint| **joint < end[0]) {
                let (time_s, progress) = self.progress.in_piece_at(piece, *sigma);
                for side in [-1.0, 1.0] {
                    let [_, rate, second, third] = progress;
                    let beside = [sigma + side * beside, rate, second, third];
                    take(piece, time_s, bounds.pace(&self.along(beside, side, &mut of_path)));
                }
            }
            // At its end the next piece begins: only the jerk jumps.
            let axes = self.path.sample_near(end[0], 1.0, &mut of_path);
            let next = joints[joint..].iter().find(|joint| **joint > end[0] - beside);
            let is_at_joint = next.is_some_and(|joint| *joint < end[0] + beside);
            let of_end = if is_at_joint { self.path.sample(end[0] - beside, -1.0) } else { axes };
            take(piece, end_s, bounds.pace_of_jerk(&at(of_end, end)));
            before = Some(axes);
        }
    }

    /// How warm it makes motors, where that counts, by so many of its pieces together.
    fn warming(&self, bounds: &PlatformBounds, pieces: usize) -> Option<Warming> {
        let heat = bounds.heat.as_ref()?;
        let times_s: Vec<f64> = self.progress.times_s().iter().copied().step_by(pieces).collect();
        let mut of_path = 0;
        let along = |time_s| self.along(self.progress.at(time_s), 1.0, &mut of_path);
        Some(heat.warming(times_s, along))
    }

    /// Where motors become too hot.
    fn too_hot(&self, bounds: &PlatformBounds) -> Vec<Excess> {
        let Some(warming) = self.warming(bounds, 1) else { return Vec::new() };
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
