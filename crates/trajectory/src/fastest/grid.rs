//! The grid along a way: as fine as the fastest progress asks for, with limits that are lowered place by place.

use std::collections::VecDeque;
use std::ops::Range;

use super::FastestError;
use super::bounds::PlatformBounds;
use crate::geometry::GeometricPath;
use crate::reach::{AccelerationBounds, Bend, Interval, Middle, Reached};

/// Intervals of the first grid for the whole way, about; each piece has at least one.
const FIRST: f64 = 64.0;
/// What halving all intervals may still gain, over the whole time; those that gain no more than their share of it stay.
const RESOLVED: f64 = 2e-4;
/// An interval that gains so many times its share is split into so many; into more than the most none is at once.
const COARSE: f64 = 8.0;
const GAINING: usize = 4;
const MOST_PARTS: usize = 8;
/// Most intervals of a grid, and of each piece: a way that asks for more has limits, or lengths, that rounding doesn't tell apart.
const MOST_INTERVALS: usize = 1 << 18;
const MOST_OF_PIECE: usize = 1 << 6;
/// Directions that differ by less are one, over their length.
const SAME_DIRECTION: f64 = 1e-6;

/// A part of the way on which the motion must take longer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Excess {
    /// Where, in σ.
    pub(super) between: [f64; 2],
    /// How many times as long.
    pub(super) pace: f64,
}

/// The grid along a path, and its limits.
#[derive(Clone)]
pub(super) struct Grid {
    /// σ at the points.
    pub(super) sigma: Vec<f64>,
    pub(super) intervals: Vec<Interval>,
    /// The greatest σ̇² at the points by limits on speed, and before any was lowered.
    pub(super) most: Vec<f64>,
    free: Vec<f64>,
    /// The pace to which the intervals are lowered, 1 for none; and which of them were in the last round.
    pub(super) pace: Vec<f64>,
    is_lowered: Vec<bool>,
}

/// Looks at places of a path, in rising order.
struct Looker<'a, P> {
    path: &'a P,
    bounds: &'a PlatformBounds,
    piece: usize,
}

impl<P: GeometricPath> Looker<'_, P> {
    fn look(&mut self, sigma: f64, side: f64) -> Result<(Bend, f64), FastestError> {
        let (bend, speed) = self.bounds.look(&self.path.sample_near(sigma, side, &mut self.piece));
        let size = bend.rate.iter().map(|rate| rate.abs()).sum::<f64>();
        if size > 0.0 && size.is_finite() && bend.curve.iter().all(|curve| curve.is_finite()) {
            return Ok((bend, speed.min(self.path.most_rate(sigma).powi(2))));
        }
        Err(FastestError::NoDirection { at: sigma, length: self.path.length() })
    }
}

impl Grid {
    /// The first one.
    pub(super) fn new<P: GeometricPath>(path: &P, bounds: &PlatformBounds) -> Result<Grid, FastestError> {
        let length = path.length();
        let breaks = path.breaks();
        let mut looker = Looker { path, bounds, piece: 0 };
        let (first, speed) = looker.look(0.0, 1.0)?;
        let mut grid = Grid {
            sigma: vec![0.0],
            intervals: Vec::with_capacity(breaks.len()),
            most: Vec::new(),
            free: vec![speed],
            pace: Vec::new(),
            is_lowered: Vec::new(),
        };
        let mut begin = (first, speed);
        for pair in breaks.windows(2) {
            if pair[1] <= pair[0] {
                return Err(FastestError::NoDirection { at: pair[0], length });
            }
            let count = (FIRST * (pair[1] - pair[0]) / length).ceil().clamp(1.0, FIRST) as usize;
            let (end, end_speed) = looker.look(pair[1], -1.0)?;
            let whole = Interval { length: pair[1] - pair[0], ends: [begin.0, end], share: 1.0 };
            grid.push_parts(&mut looker, &whole, count, 1.0)?;
            grid.free.push(end_speed);
            grid.sigma.push(pair[1]);
            if pair[1] < length {
                begin = looker.look(pair[1], 1.0)?;
                let last = grid.free.len() - 1;
                // A corner: nothing passes it with a speed.
                let is_corner = differ(&end.rate, &begin.0.rate);
                grid.free[last] = if is_corner { 0.0 } else { end_speed.min(begin.1) };
            }
        }
        grid.most.clone_from(&grid.free);
        Ok(grid)
    }

    /// Puts parts of an interval behind the last point, without the last part's end.
    fn push_parts<P: GeometricPath>(
        &mut self,
        looker: &mut Looker<'_, P>,
        whole: &Interval,
        count: usize,
        pace: f64,
    ) -> Result<(), FastestError> {
        let from = self.sigma[self.sigma.len() - 1];
        let length = whole.length / count as f64;
        let mut begin = whole.ends[0];
        for part in 1..count {
            let sigma = from + length * part as f64;
            let (end, speed) = looker.look(sigma, 1.0)?;
            self.intervals.push(Interval { length, ends: [begin, end], share: whole.share });
            self.free.push(speed);
            self.sigma.push(sigma);
            begin = end;
        }
        self.intervals.push(Interval { length, ends: [begin, whole.ends[1]], share: whole.share });
        self.pace.extend(std::iter::repeat_n(pace, count));
        self.is_lowered.extend(std::iter::repeat_n(false, count));
        Ok(())
    }

    /// Into how many parts each interval is split so that halving them all would gain no more than [`RESOLVED`], and so that the
    /// acceleration turns little within each.
    pub(super) fn unresolved<P: GeometricPath>(
        &self,
        path: &P,
        bounds: &PlatformBounds,
        acceleration: &AccelerationBounds,
        reached: &Reached,
    ) -> Result<Vec<usize>, FastestError> {
        let count = self.intervals.len();
        let mut looker = Looker { path, bounds, piece: 0 };
        let mut middle = Middle::default();
        let speed = |at: usize| reached.x[at].max(0.0).sqrt();
        let whole_s: f64 =
            (0..count).map(|at| self.lasts_s(reached, at)).filter(|part_s| part_s.is_finite()).sum();
        let share_s = RESOLVED * whole_s / count as f64;
        let parts = (0..count).map(|at| {
            if !reached.is_new[at] && !reached.is_new[at + 1] {
                return Ok(1);
            }
            let now_s = self.lasts_s(reached, at);
            if !now_s.is_finite() {
                return Ok(MOST_PARTS);
            }
            let interval = &self.intervals[at];
            let ends = [reached.x[at], reached.x[at + 1]];
            let turns = bounds.turn(interval, ends).ceil().clamp(1.0, MOST_PARTS as f64) as usize;
            // A gain asks for no more.
            if turns >= GAINING {
                return Ok(turns);
            }
            let (bend, most) = looker.look(0.5 * (self.sigma[at] + self.sigma[at + 1]), 1.0)?;
            let between = middle.highest(interval, &bend, most, ends, acceleration).max(0.0).sqrt();
            let halved_s = interval.length * (1.0 / (speed(at) + between) + 1.0 / (between + speed(at + 1)));
            // What it would take longer by, it exceeds limits by.
            let gain_s = (now_s - halved_s).abs();
            let parts = if gain_s > COARSE * share_s { GAINING } else { 1 + usize::from(gain_s > share_s) };
            Ok(parts.max(turns))
        });
        parts.collect()
    }

    /// Splits each interval into so many parts of equal length; whether any was.
    pub(super) fn split<P: GeometricPath>(
        &mut self,
        path: &P,
        bounds: &PlatformBounds,
        parts: &[usize],
        reached: &mut Reached,
    ) -> Result<bool, FastestError> {
        if parts.iter().all(|parts| *parts == 1) {
            return Ok(false);
        }
        let most = MOST_INTERVALS + MOST_OF_PIECE * path.breaks().len();
        if parts.iter().sum::<usize>() > most {
            return Err(FastestError::TooFine { most });
        }
        let old = std::mem::replace(
            self,
            Grid {
                sigma: vec![0.0],
                intervals: Vec::with_capacity(parts.iter().sum()),
                most: Vec::new(),
                free: vec![self.free[0]],
                pace: Vec::new(),
                is_lowered: Vec::new(),
            },
        );
        let mut looker = Looker { path, bounds, piece: 0 };
        let mut at = 0;
        for run in parts.chunk_by(|one, other| *one == 1 && *other == 1) {
            let end = at + run.len();
            // Most stay as they are; whoever is split is alone.
            if run[0] == 1 {
                self.intervals.extend_from_slice(&old.intervals[at..end]);
                self.pace.extend_from_slice(&old.pace[at..end]);
                self.is_lowered.extend(std::iter::repeat_n(false, run.len()));
            } else {
                self.push_parts(&mut looker, &old.intervals[at], run[0], old.pace[at])?;
            }
            self.free.extend_from_slice(&old.free[at + 1..=end]);
            self.sigma.extend_from_slice(&old.sigma[at + 1..=end]);
            at = end;
        }
        self.lower_speeds();
        reached.split(parts);
        Ok(true)
    }

    /// The intervals that touch a part of the way.
    fn within(&self, [from, to]: [f64; 2]) -> Range<usize> {
        let first = self.sigma.partition_point(|at| *at <= from).saturating_sub(1);
        let count = self.sigma[first..].partition_point(|at| *at <= to);
        first..(first + count).min(self.intervals.len())
    }

    /// Into how many parts intervals are split that last longer than the window, where the motion must take longer.
    pub(super) fn too_long(&self, excesses: &[Excess], reached: &Reached, window_s: f64) -> Vec<usize> {
        let mut parts = vec![1; self.intervals.len()];
        for at in excesses.iter().flat_map(|excess| self.within(excess.between)) {
            let lasts_s = self.lasts_s(reached, at);
            parts[at] = (lasts_s / window_s).ceil().clamp(1.0, MOST_PARTS as f64) as usize;
        }
        parts
    }

    /// How long an interval takes, s; infinite between two rests.
    pub(super) fn lasts_s(&self, reached: &Reached, at: usize) -> f64 {
        2.0 * self.intervals[at].length / (reached.x[at].sqrt() + reached.x[at + 1].sqrt())
    }

    /// Lowers paces to what their first one must become.
    pub(super) fn lower(&mut self, excesses: &[Excess], before: &[f64]) {
        for excess in excesses {
            let within = self.within(excess.between);
            let held = before.get(within.start).copied().unwrap_or(1.0);
            for pace in &mut self.pace[within] {
                *pace = pace.min(held / excess.pace);
            }
        }
    }

    /// Lowers each pace by the greatest factor of those that it is within; both their ends rise.
    pub(super) fn slow(&mut self, excesses: &[Excess], before: &[f64]) {
        // Those ahead of which a greater one comes later never count again.
        let mut greatest: VecDeque<(usize, f64)> = VecDeque::new();
        let mut coming = excesses.iter().map(|excess| (self.within(excess.between), excess.pace)).peekable();
        let mut slowed = Vec::with_capacity(self.pace.len());
        for at in 0..self.pace.len() {
            while let Some((within, pace)) = coming.next_if(|(within, _)| within.start <= at) {
                while greatest.back().is_some_and(|(_, last)| *last <= pace) {
                    greatest.pop_back();
                }
                greatest.push_back((within.end, pace));
            }
            while greatest.front().is_some_and(|(end, _)| *end <= at) {
                greatest.pop_front();
            }
            slowed.push(greatest.front().map_or(1.0, |(_, pace)| *pace));
        }
        for ((pace, before), factor) in self.pace.iter_mut().zip(before).zip(slowed) {
            *pace = pace.min(before / factor);
        }
    }

    /// Which intervals lie within a window of time of what is new.
    pub(super) fn near(&self, reached: &Reached, window_s: f64) -> Vec<bool> {
        let mut is_near = vec![false; self.intervals.len()];
        // How long ago something was new, to both sides; an interval more, for pieces are told by where they begin.
        let mut ago_s = f64::INFINITY;
        let mut look = |at: usize| {
            let is_new = reached.is_new[at] || reached.is_new[at + 1] || self.is_lowered[at];
            let lasts_s = self.lasts_s(reached, at);
            ago_s = if is_new { 0.0 } else { ago_s + lasts_s };
            is_near[at] |= ago_s <= 2.0 * window_s + 2.0 * lasts_s;
        };
        (0..self.intervals.len()).for_each(&mut look);
        (0..self.intervals.len()).rev().for_each(&mut look);
        is_near
    }

    /// Lets the limits follow the paces.
    pub(super) fn apply(&mut self, reached: &mut Reached) {
        for (at, (interval, pace)) in self.intervals.iter_mut().zip(&self.pace).enumerate() {
            self.is_lowered[at] = interval.share != pace * pace;
            if self.is_lowered[at] {
                interval.share = pace * pace;
                reached.change(at);
            }
        }
        self.lower_speeds();
    }

    fn lower_speeds(&mut self) {
        let beside = |at: usize| [at.checked_sub(1), Some(at)].into_iter().flatten();
        let least = |at: usize| beside(at).filter_map(|at| self.pace.get(at)).fold(1.0_f64, |a, b| a.min(*b));
        self.most = self.free.iter().enumerate().map(|(at, free)| free * least(at).powi(2)).collect();
    }
}

fn differ(a: &[f64; 3], b: &[f64; 3]) -> bool {
    let size = a.iter().chain(b).fold(0.0_f64, |most, part| most.max(part.abs()));
    a.iter().zip(b).any(|(a, b)| (a - b).abs() > SAME_DIRECTION * size)
}
