//! The fastest progress along a path whose limits are known at the points of a grid.
//!
//! With a path q(σ), x = σ̇² and u = σ̈ the speed is q'·√x and the acceleration q'·u + q''·x: limits on them
//! are linear or a disk in (u, x).
//!
//! Backwards along the grid follows from which x the end can still be reached, forwards the greatest x that
//! stays inside (reachability analysis: H. Pham and Q.-C. Pham, *A New Approach to Time-Optimal Path
//! Parameterization Based on Reachability Analysis*, IEEE T-RO 34(3), 2018).
//!
//! Each interval keeps its limits at both of its ends (collocation by interpolation), so singular points need
//! no care of their own.

use std::ops::Range;

/// Limits on the acceleration, in its axes: x and y in m/s², the turn in rad/s².
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AccelerationBounds {
    /// The length of its part along x and y at most; `None`: no limit of that kind.
    pub length: Option<f64>,
    /// Planes: their normal times the acceleration is at most this.
    pub planes: Vec<Plane>,
    /// What resists the motion: each row, over the path's direction, with the wrench of itself where the way goes along it.
    pub resistance: Vec<[f64; 3]>,
}

/// One linear limit on the acceleration.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Plane {
    /// Its normal.
    pub normal: [f64; 3],
    /// The greatest product of the normal with the acceleration, positive: standing still is allowed everywhere.
    pub most: f64,
    /// How much of that a unit of each axis of what resists takes; what helps gives nothing.
    pub resisted: [f64; 3],
}

impl Plane {
    /// What resistance leaves of the most, over which it is in size at least a part.
    pub fn left(&self, resistance: &[f64; 3]) -> f64 {
        let taken: f64 = self.resisted.iter().zip(resistance).map(|(part, of)| part * of).sum();
        self.most - taken.clamp(0.0, MOST_TAKEN * self.most)
    }
}

/// No resistance takes more of what a plane leaves than this: standing still stays allowed.
const MOST_TAKEN: f64 = 0.9;
/// Where a row's product with the direction is this part of its terms' sizes and more it counts wholly, and below in proportion.
const WHOLE_FROM: f64 = 0.1;

/// What resists on a way of a direction, by rows as [`AccelerationBounds`] has them.
pub fn resisting(rows: &[[f64; 3]], rate: &[f64; 3]) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for row in rows {
        let terms: [f64; 3] = std::array::from_fn(|axis| row[axis] * rate[axis]);
        let size: f64 = terms.iter().map(|term| term.abs()).sum();
        let along = terms.iter().sum::<f64>() / (WHOLE_FROM * size).max(f64::MIN_POSITIVE);
        sum = std::array::from_fn(|axis| sum[axis] + along.clamp(-1.0, 1.0) * row[axis]);
    }
    sum
}

/// What the path does to the axes at a place: its first and second derivative by σ.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bend {
    /// q'.
    pub rate: [f64; 3],
    /// q''.
    pub curve: [f64; 3],
}

/// A part of the path with a constant σ̈.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Interval {
    /// Its length in σ, positive.
    pub length: f64,
    /// The path at its beginning and its end.
    pub ends: [Bend; 2],
    /// By how much its limits count: accelerations by this factor.
    pub share: f64,
}

/// Why there is no motion: from this point of the grid on the end can't be reached within the limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the limits leave no motion at point {0} of the grid")]
pub struct Unreachable(pub usize);

/// The greatest x = σ̇² at every point of the grid: one more than intervals.
///
/// `most` holds the greatest x at each point by limits on speed. `ends` is x at the beginning and at the end; what is beyond the
/// limits there is refused.
pub fn fastest(
    intervals: &[Interval],
    most: &[f64],
    bounds: &AccelerationBounds,
    ends: [f64; 2],
) -> Result<Vec<f64>, Unreachable> {
    let mut found = Reached::new(intervals.len());
    found.solve(intervals, most, bounds, ends)?;
    Ok(found.x)
}

/// The fastest progress, found again where its limits changed.
#[derive(Clone, Debug)]
pub struct Reached {
    /// The greatest x at every point of the grid.
    pub x: Vec<f64>,
    /// Which of them are new since the solution before.
    pub is_new: Vec<bool>,
    /// From where the end can be reached: x from the first to the second.
    reach: Vec<[f64; 2]>,
    reach_is_new: Vec<bool>,
    /// Intervals whose limits changed, or those on the speed at one of their ends.
    changed: Vec<bool>,
}

impl Reached {
    /// Nothing is known yet of so many intervals.
    pub fn new(count: usize) -> Reached {
        Reached {
            x: vec![f64::NAN; count + 1],
            is_new: vec![true; count + 1],
            reach: vec![[f64::NAN; 2]; count + 1],
            reach_is_new: vec![true; count + 1],
            changed: vec![true; count],
        }
    }

    /// The limits of an interval changed.
    pub fn change(&mut self, interval: usize) {
        let last = self.changed.len().saturating_sub(1);
        self.changed[interval.saturating_sub(1)..=(interval + 1).min(last)].fill(true);
    }

    /// Each interval was split into so many parts.
    pub fn split(&mut self, parts: &[usize]) {
        let old = std::mem::replace(self, Reached::new(parts.iter().sum()));
        let (mut from, mut to) = (0, 0);
        for run in parts.chunk_by(|one, other| *one == 1 && *other == 1) {
            let (end, count) = (from + run.len(), run.iter().sum::<usize>());
            // Whoever is split is alone: its first point stays.
            self.copy_points(&old, from..end, to);
            if run[0] == 1 {
                self.changed[to..to + count].copy_from_slice(&old.changed[from..end]);
            }
            (from, to) = (end, to + count);
        }
        self.copy_points(&old, parts.len()..parts.len() + 1, to);
    }

    fn copy_points(&mut self, old: &Reached, from: Range<usize>, to: usize) {
        let into = to..to + from.len();
        self.x[into.clone()].copy_from_slice(&old.x[from.clone()]);
        self.is_new[into.clone()].copy_from_slice(&old.is_new[from.clone()]);
        self.reach[into.clone()].copy_from_slice(&old.reach[from.clone()]);
        self.reach_is_new[into].copy_from_slice(&old.reach_is_new[from]);
    }

    /// Solves where something changed; the arguments are those of [`fastest`], the same ones but for what was changed.
    pub fn solve(
        &mut self,
        intervals: &[Interval],
        most: &[f64],
        bounds: &AccelerationBounds,
        ends: [f64; 2],
    ) -> Result<(), Unreachable> {
        let count = intervals.len();
        let mut scene = Scene::default();
        let end = [ends[1], ends[1]];
        (self.reach_is_new[count], self.reach[count]) = (self.reach[count] != end, end);
        if ends[1] > most[count] * (1.0 + ROUNDING) {
            return Err(Unreachable(count));
        }
        for at in (0..count).rev() {
            self.reach_is_new[at] = false;
            if !self.changed[at] && !self.reach_is_new[at + 1] {
                continue;
            }
            scene.look(&intervals[at], bounds);
            scene.target = Some((self.reach[at + 1], intervals[at].length));
            let highest = scene.highest(most[at]).ok_or(Unreachable(at))?;
            let reach = [scene.lowest(highest), highest];
            (self.reach_is_new[at], self.reach[at]) = (self.reach[at] != reach, reach);
        }
        let [low, high] = self.reach[0];
        if !(low * (1.0 - ROUNDING)..=high * (1.0 + ROUNDING)).contains(&ends[0]) {
            return Err(Unreachable(0));
        }
        (self.is_new[0], self.x[0]) = (self.x[0] != ends[0], ends[0]);
        let mut x = ends[0].clamp(low, high);
        for (at, interval) in intervals.iter().enumerate() {
            let is_same = !self.changed[at] && !self.is_new[at] && !self.reach_is_new[at + 1];
            if is_same {
                (self.is_new[at + 1], x) = (false, self.x[at + 1]);
                continue;
            }
            scene.look(interval, bounds);
            let u = scene.upper(x).at.max(scene.lower(x).at);
            let [low, high] = self.reach[at + 1];
            x = (x + 2.0 * interval.length * u).clamp(low, high);
            (self.is_new[at + 1], self.x[at + 1]) = (self.x[at + 1] != x, x);
        }
        self.changed.fill(false);
        Ok(())
    }
}

/// What an interval would allow half way if it were halved.
#[derive(Debug, Default)]
pub struct Middle {
    scene: Scene,
}

impl Middle {
    /// The greatest x there between those at the interval's ends; `middle` is the path there, and x at most by limits on speed.
    pub fn highest(
        &mut self,
        interval: &Interval,
        bend: &Bend,
        most: f64,
        ends: [f64; 2],
        bounds: &AccelerationBounds,
    ) -> f64 {
        let [first, second] = &interval.ends;
        let after = ends[0] + interval.length * self.at(first, interval, bounds).upper(ends[0]).at;
        let before = ends[1] - interval.length * self.at(second, interval, bounds).lower(ends[1]).at;
        self.at(bend, interval, bounds).highest(most).unwrap_or(0.0).min(after).min(before)
    }

    fn at(&mut self, bend: &Bend, interval: &Interval, bounds: &AccelerationBounds) -> &Scene {
        self.scene.clear();
        self.scene.add(bend, bend.rate, bounds, interval.share);
        &self.scene
    }
}

/// Relative, for what is equal but for rounding.
const ROUNDING: f64 = 1e-9;
/// A coefficient of u below this part of its row's other one bounds x alone.
const FLAT: f64 = 1e-14;
/// Bounds that differ by less are equal, over the size of what they are sums of.
const EQUAL: f64 = 1e-13;
/// Newton's steps at most; a handful is usual.
const STEPS: usize = 60;

/// All limits on (u, x) of one interval.
#[derive(Debug, Default)]
struct Scene {
    /// u·row[0] + x·row[1] <= row[2]: those that bound u from above, and from below.
    above: Vec<[f64; 3]>,
    below: Vec<[f64; 3]>,
    disks: Vec<Disk>,
    /// x must not be greater, by limits that don't depend on u.
    ceiling: f64,
    /// Which x must be met at the end of the interval, and its length.
    target: Option<([f64; 2], f64)>,
}

/// |p·u + r·x| <= most: pp = p·p, pr = p·r, det = (p × r)².
#[derive(Clone, Copy, Debug)]
struct Disk {
    p: [f64; 2],
    r: [f64; 2],
    most: f64,
}

/// A bound of u at some x: its value, its slope over x, the size of what it is the sum of, and the disk that makes it.
#[derive(Clone, Copy, Debug)]
struct Bound {
    at: f64,
    slope: f64,
    size: f64,
    disk: Option<Disk>,
}

impl Bound {
    /// Where a·u + b·x is the most that it may be.
    fn line(most: f64, [a, b]: [f64; 2], x: f64) -> Bound {
        let size = (most.abs() + (b * x).abs()) / a.abs();
        Bound { at: (most - b * x) / a, slope: -b / a, size, disk: None }
    }
}

impl Disk {
    fn products(&self) -> (f64, f64, f64) {
        let Disk { p, r, .. } = self;
        let cross = p[0] * r[1] - p[1] * r[0];
        (p[0] * p[0] + p[1] * p[1], p[0] * r[0] + p[1] * r[1], cross * cross)
    }

    /// Its bound of u at x, above for `sign` 1 and below for −1.
    fn bound(self, x: f64, sign: f64) -> Bound {
        let (pp, pr, det) = self.products();
        let root = (pp * self.most * self.most - x * x * det).max(0.0).sqrt();
        let slope =
            if det > 0.0 { (-pr - sign * x * det / root.max(f64::MIN_POSITIVE)) / pp } else { -pr / pp };
        let size = (pr * x).abs() / pp + self.most / pp.sqrt();
        Bound { at: (-pr * x + sign * root) / pp, slope, size, disk: Some(self) }
    }

    /// Where a line u = at + slope·(x − x0) meets its edge: the smaller and the greater x.
    fn meets(self, line: &Bound, x0: f64) -> Option<[f64; 2]> {
        let offset = line.at - line.slope * x0;
        let e: [f64; 2] = std::array::from_fn(|axis| self.p[axis] * line.slope + self.r[axis]);
        let (pp, ..) = self.products();
        let pe = self.p[0] * e[0] + self.p[1] * e[1];
        let ee = e[0] * e[0] + e[1] * e[1];
        let under = offset * offset * pe * pe - ee * (offset * offset * pp - self.most * self.most);
        (under >= 0.0 && ee > 0.0)
            .then(|| [-offset * pe - under.sqrt(), -offset * pe + under.sqrt()].map(|part| part / ee))
    }
}

impl Scene {
    /// Takes the limits of an interval.
    fn look(&mut self, interval: &Interval, bounds: &AccelerationBounds) {
        let Interval { length, ends: [first, second], share } = interval;
        self.clear();
        self.add(first, first.rate, bounds, *share);
        // At the end x is greater by 2·length·u.
        let at_end = std::array::from_fn(|axis| second.rate[axis] + 2.0 * length * second.curve[axis]);
        self.add(second, at_end, bounds, *share);
    }

    fn clear(&mut self) {
        self.above.clear();
        self.below.clear();
        self.disks.clear();
        self.ceiling = f64::INFINITY;
        self.target = None;
    }

    /// Takes the limits at a place where u makes an acceleration of p·u, and x one of the path's curve.
    fn add(&mut self, bend: &Bend, p: [f64; 3], bounds: &AccelerationBounds, share: f64) {
        let r = bend.curve;
        let is_resisted = !bounds.resistance.is_empty();
        let resistance = if is_resisted { resisting(&bounds.resistance, &bend.rate) } else { [0.0; 3] };
        for plane in &bounds.planes {
            let n = plane.normal;
            let [a, b] = [p, r].map(|v| n[0] * v[0] + n[1] * v[1] + n[2] * v[2]);
            let most = share * if is_resisted { plane.left(&resistance) } else { plane.most };
            if a.abs() > FLAT * b.abs() {
                let rows = if a > 0.0 { &mut self.above } else { &mut self.below };
                rows.push([a, b, most]);
            } else if b > 0.0 {
                self.ceiling = self.ceiling.min(most / b);
            }
        }
        let Some(most) = bounds.length else { return };
        let disk = Disk { p: [p[0], p[1]], r: [r[0], r[1]], most: most * share };
        let (pp, _, det) = disk.products();
        let rr = r[0] * r[0] + r[1] * r[1];
        if pp > FLAT * FLAT * rr {
            self.ceiling = self.ceiling.min(disk.most * (pp / det).sqrt());
            self.disks.push(disk);
        } else if rr > 0.0 {
            self.ceiling = self.ceiling.min(disk.most / rr.sqrt());
        }
    }

    fn upper(&self, x: f64) -> Bound {
        self.bound(x, 1.0, &self.above)
    }

    fn lower(&self, x: f64) -> Bound {
        self.bound(x, -1.0, &self.below)
    }

    /// The bound of u at x that is met first: from above for `sign` 1, from below for −1.
    fn bound(&self, x: f64, sign: f64, rows: &[[f64; 3]]) -> Bound {
        let target =
            self.target.map(|([low, high], length)| [2.0 * length, 1.0, if sign > 0.0 { high } else { low }]);
        let mut first = (f64::INFINITY, None);
        let mut take = |row: &[f64; 3]| {
            let at = sign * ((row[2] - row[1] * x) / row[0]);
            if at < first.0 {
                first = (at, Some(*row));
            }
        };
        rows.iter().for_each(&mut take);
        target.iter().for_each(&mut take);
        let free = Bound { at: sign * f64::INFINITY, slope: 0.0, size: 0.0, disk: None };
        let mut bound = first.1.map_or(free, |[a, b, most]| Bound::line(most, [a, b], x));
        for disk in &self.disks {
            let other = disk.bound(x, sign);
            if sign * other.at < sign * bound.at {
                bound = other;
            }
        }
        bound
    }

    /// The greatest x at which some u keeps all limits, at most `most`.
    fn highest(&self, most: f64) -> Option<f64> {
        let mut x = most.min(self.ceiling);
        let mut shift = EQUAL;
        for _ in 0..STEPS {
            let Some(next) = self.nearer(x, 1) else { return Some(x) };
            // Right of x nothing is sought, and at a disk's tip rounding hides how far there is to go.
            x = next.min(x * (1.0 - shift));
            shift = 0.5_f64.min(2.0 * shift);
            if x.is_nan() || x < 0.0 {
                break;
            }
        }
        self.nearer(0.0, 1).is_none().then_some(0.0)
    }

    /// The least x at which some u keeps all limits, where `highest` is the greatest.
    fn lowest(&self, highest: f64) -> f64 {
        let mut x = 0.0;
        // At rest all limits leave u = 0.
        if self.target.is_some_and(|([low, _], _)| low == 0.0) {
            return x;
        }
        for _ in 0..STEPS {
            match self.nearer(x, 0) {
                Some(next) if next > x && next < highest => x = next,
                Some(_) => return highest,
                None => return x,
            }
        }
        x
    }

    /// A place nearer to where limits leave a u, without passing it (Newton's method: what they leave is concave in x); `None`
    /// where they do. `side`: 1 from greater x, 0 from smaller ones.
    fn nearer(&self, x: f64, side: usize) -> Option<f64> {
        let (upper, lower) = (self.upper(x), self.lower(x));
        let gap = upper.at - lower.at;
        if gap >= -EQUAL * (upper.size + lower.size) {
            return None;
        }
        // A disk's edge is steep where it is narrow: it is met exactly, by the other's tangent.
        let met = match (upper.disk, lower.disk) {
            (Some(disk), other) if other.is_none() || upper.slope.abs() >= lower.slope.abs() => {
                disk.meets(&lower, x)
            }
            (_, Some(disk)) => disk.meets(&upper, x),
            _ => {
                let slope = upper.slope - lower.slope;
                let leads = if side == 1 { slope < 0.0 } else { slope > 0.0 };
                return Some(if leads { x - gap / slope } else { [f64::INFINITY, f64::NEG_INFINITY][side] });
            }
        };
        Some(met.map_or([f64::INFINITY, f64::NEG_INFINITY][side], |met| met[side]))
    }
}
