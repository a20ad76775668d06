//! What is believed: the pose, what is wrong with wheels and sensors, and their covariance.
//!
//! A step u of the body as its wheels tell it is truly u + E·u − s·T. E is what wrong radii, directions and places of the
//! wheels make of it (to first order a constant matrix, whatever the layout), s the speed by which they slip over the
//! floor: a Gauss-Markov process whose strength goes with the motion.

mod carrying;

use nalgebra::{Matrix3, SMatrix};
use omnibase_platform::{BodyStep, Pose2};

use crate::sensor::{MAX_RATES, MAX_SENSORS};
use carrying::Carrying;
pub(crate) use carrying::Meanwhile;

/// Numbers that are estimated together: pose, E, s, and two of each sensor that tells a speed.
pub const STATES: usize = OWN + 2 * MAX_RATES;
/// Flaws that are followed beside them: two of the wheels, two of each sensor that tells a speed, one of each of poses.
pub const FLAWS: usize = 2 + 2 * MAX_RATES + (MAX_SENSORS - MAX_RATES);
/// The flaws of wheels: as their way and as their turn lag.
pub(crate) const WHEELS: [usize; 2] = [0, 1];
/// So many are computed along, four by four.
const COLUMNS: usize = (STATES + FLAWS).next_multiple_of(4);
/// E, row by row.
pub(crate) const GEOMETRY: usize = 3;
/// s in body axes, m/s and rad/s.
pub(crate) const SLIP: usize = 12;
/// The first sensor's own.
pub(crate) const OWN: usize = 15;
/// Numbers beside the pose.
const ERRORS: usize = STATES - 3;

/// Slip that is no part of the wheels' geometry comes and goes within so long, s: about that of a platform's own
/// accelerations.
pub(crate) const SLIP_TIME_S: f64 = 0.15;

/// What a number has to do with each that is estimated, and behind these what one of each flaw makes of it.
pub(crate) type Along = [f64; COLUMNS];

/// By how much a reading changes with one of a flaw.
pub(crate) type Change<const M: usize> = (usize, [f64; M]);

/// How one number of a reading depends on what is estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Row {
    /// On the pose.
    pub pose: [f64; 3],
    /// On the body's twist.
    pub twist: [f64; 3],
    /// On the sensor's own two.
    pub own: [f64; 2],
}

/// How the numbers of a reading do.
#[derive(Clone, Copy, Debug)]
pub struct Rows<const M: usize> {
    /// Number by number.
    pub rows: [Row; M],
    /// The body's twist as the wheels tell it, by which its errors count, m/s and rad/s.
    pub by_wheels: [f64; 3],
    /// The place of the sensor's own.
    pub own: usize,
}

fn add_scaled(sum: &mut Along, factor: f64, values: &Along) {
    for (sum, value) in sum.iter_mut().zip(values) {
        *sum += factor * value;
    }
}

impl<const M: usize> Rows<M> {
    /// What errors make of the body's twist along an axis.
    fn of_twist(&self, axis: usize, errors: &Along) -> f64 {
        let [x, y, turn] = self.by_wheels;
        let at = GEOMETRY + 3 * axis;
        x * errors[at] + y * errors[at + 1] + turn * errors[at + 2] - errors[SLIP + axis]
    }

    /// What errors make of the first `count` numbers.
    fn of(&self, errors: &Along, count: usize) -> [f64; M] {
        let twist: [f64; 3] = std::array::from_fn(|axis| self.of_twist(axis, errors));
        let mut made = [0.0; M];
        for (made, Row { pose, twist: by, own }) in made.iter_mut().zip(&self.rows).take(count) {
            *made = pose[0] * errors[0]
                + pose[1] * errors[1]
                + pose[2] * errors[2]
                + by[0] * twist[0]
                + by[1] * twist[1]
                + by[2] * twist[2]
                + own[0] * errors[self.own]
                + own[1] * errors[self.own + 1];
        }
        made
    }

    /// What each number has to do with all that is estimated, and what one of each flaw makes of it.
    fn carried(&self, covariance: &[Along; STATES]) -> [Along; M] {
        let mut carried = [[0.0; COLUMNS]; M];
        let add = |carried: &mut [Along; M], values: &Along, derivative: &dyn Fn(&Row) -> f64| {
            for (carried, row) in carried.iter_mut().zip(&self.rows) {
                let factor = derivative(row);
                if factor != 0.0 {
                    add_scaled(carried, factor, values);
                }
            }
        };
        for axis in 0..3 {
            add(&mut carried, &covariance[axis], &|row| row.pose[axis]);
            if self.rows.iter().any(|row| row.twist[axis] != 0.0) {
                let at = GEOMETRY + 3 * axis;
                let ([x, y, turn], slip) = (self.by_wheels, &covariance[SLIP + axis]);
                let by: [f64; M] = std::array::from_fn(|m| self.rows[m].twist[axis]);
                for column in 0..COLUMNS {
                    let of = |n: usize| covariance[at + n][column];
                    let made = -slip[column] + x * of(0) + y * of(1) + turn * of(2);
                    for (carried, by) in carried.iter_mut().zip(&by) {
                        carried[column] += by * made;
                    }
                }
            }
        }
        for n in 0..2 {
            add(&mut carried, &covariance[self.own + n], &|row| row.own[n]);
        }
        carried
    }
}

/// Pose, errors and covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Belief {
    /// Where the platform is.
    pub map_from_body: Pose2,
    /// So many numbers are estimated: what belongs to sensors that aren't there stays 0.
    states: usize,
    errors: [f64; ERRORS],
    /// And behind it, in each row, what one of each flaw makes of the row's number.
    covariance: [Along; STATES],
}

/// A reading against what is believed.
#[derive(Clone, Copy, Debug)]
pub struct Innovation<const M: usize> {
    difference: [f64; M],
    /// L with L·Lᵀ = S.
    root: [[f64; M]; M],
    /// By how much it is off in numbers of variance 1 that have nothing to do with each other: L⁻¹ of the difference.
    pub(crate) off: [f64; M],
    /// What one of each of these numbers off moves, and by how much one of each flaw makes it less off.
    moves: [Along; M],
    /// ν'·S⁻¹·ν: chi² with M degrees of freedom where all is as believed.
    pub nis: f64,
}

/// L with L·Lᵀ = S; `None` where S is no covariance.
fn root_of<const M: usize>(s: &[[f64; M]; M]) -> Option<[[f64; M]; M]> {
    let mut root = [[0.0; M]; M];
    for r in 0..M {
        for c in 0..=r {
            let known: f64 = (0..c).map(|n| root[r][n] * root[c][n]).sum();
            root[r][c] = if r == c { (s[r][r] - known).sqrt() } else { (s[r][c] - known) / root[c][c] };
        }
        // What is no number neither.
        if root[r][r].is_nan() || root[r][r] <= 0.0 {
            return None;
        }
    }
    Some(root)
}

/// chi² of numbers with such a covariance; infinite where that is none.
pub(crate) fn chi2<const M: usize>(off: &[f64; M], covariance: &SMatrix<f64, M, M>) -> f64 {
    let root = root_of(&std::array::from_fn(|r| std::array::from_fn(|c| covariance[(r, c)])));
    root.map_or(f64::INFINITY, |root| whiten(&root, *off).iter().map(|off| off * off).sum())
}

/// L⁻¹ of numbers.
fn whiten<const M: usize>(root: &[[f64; M]; M], mut values: [f64; M]) -> [f64; M] {
    for r in 0..M {
        let known: f64 = (0..r).map(|c| root[r][c] * values[c]).sum();
        values[r] = (values[r] - known) / root[r][r];
    }
    values
}

impl<const M: usize> Innovation<M> {
    /// By how much the reading is off.
    pub(crate) fn difference(&self) -> [f64; M] {
        self.difference
    }

    /// What the square of each number was expected to be.
    pub(crate) fn expected(&self) -> [f64; M] {
        self.root.map(|row| row.iter().map(|value| value * value).sum())
    }

    /// What is left of each error of the pose, where nobody knew of it: x, y and heading. A row of each number on the pose.
    pub(crate) fn left_of_pose(&self, by_pose: &[[f64; 3]; M]) -> Matrix3<f64> {
        let mut left = Matrix3::identity();
        for (c, mut column) in left.column_iter_mut().enumerate() {
            let off = whiten(&self.root, by_pose.map(|row| row[c]));
            for (moved, off) in self.moves.iter().zip(off) {
                (0..3).for_each(|r| column[r] -= off * moved[r]);
            }
        }
        left
    }

    /// By how much one of a flaw makes each number off, whitened.
    pub(crate) fn change(&self, flaw: usize) -> [f64; M] {
        std::array::from_fn(|m| -self.moves[m][STATES + flaw])
    }
}

impl Belief {
    /// At a pose, with the covariance of E, and so many sensors that tell speeds.
    pub fn new(map_from_body: Pose2, geometry: &SMatrix<f64, 9, 9>, rates: usize) -> Belief {
        let mut covariance = [[0.0; COLUMNS]; STATES];
        for row in 0..9 {
            for column in 0..9 {
                covariance[GEOMETRY + row][GEOMETRY + column] = geometry[(row, column)];
            }
        }
        Belief { map_from_body, states: OWN + 2 * rates, errors: [0.0; ERRORS], covariance }
    }

    /// An error, by its place.
    pub(crate) fn error(&self, place: usize) -> f64 {
        self.errors[place - 3]
    }

    /// The variance of a place.
    pub(crate) fn variance(&self, place: usize) -> f64 {
        self.covariance[place][place]
    }

    /// A variance is at least so great.
    pub(crate) fn widen_to(&mut self, place: usize, variance: f64) {
        self.covariance[place][place] = self.covariance[place][place].max(variance);
    }

    /// Adds to the variance of a place.
    pub(crate) fn widen(&mut self, place: usize, variance: f64) {
        self.covariance[place][place] += variance;
    }

    /// What one of a flaw makes of all that is estimated.
    pub(crate) fn drawn(&self, flaw: usize) -> [f64; STATES] {
        std::array::from_fn(|row| self.covariance[row][STATES + flaw])
    }

    /// One of a flaw made so much of all that is estimated.
    pub(crate) fn draw(&mut self, flaw: usize, drawn: &[f64; STATES]) {
        self.covariance.iter_mut().zip(drawn).for_each(|(row, drawn)| row[STATES + flaw] = *drawn);
    }

    /// Nothing is known any more of what flaws make.
    pub(crate) fn forget_flaws(&mut self) {
        self.covariance.iter_mut().for_each(|row| row[STATES..].fill(0.0));
    }

    /// All may be off along this by something of such a variance.
    pub(crate) fn widen_along(&mut self, along: &[f64; STATES], variance: f64) {
        for (row, values) in self.covariance.iter_mut().enumerate() {
            for (column, value) in values.iter_mut().take(STATES).enumerate() {
                *value += variance * (along[row] * along[column]);
            }
        }
    }

    /// The pose may be off by more: xx, xy, xψ, yy, yψ, ψψ.
    pub(crate) fn widen_pose(&mut self, [xx, xy, xh, yy, yh, hh]: [f64; 6]) {
        for (row, values) in [[xx, xy, xh], [xy, yy, yh], [xh, yh, hh]].iter().enumerate() {
            for (column, value) in values.iter().enumerate() {
                self.covariance[row][column] += value;
            }
        }
    }

    /// Nothing is known of the wheels but what was said of them, nor whether they slip now.
    pub(crate) fn forget_wheels(&mut self, geometry: &SMatrix<f64, 9, 9>) {
        for place in GEOMETRY..OWN {
            self.errors[place - 3] = 0.0;
            let variance = self.covariance[place][place];
            for other in 0..STATES {
                self.covariance[place][other] = 0.0;
                self.covariance[other][place] = 0.0;
            }
            self.covariance[place][place] = variance;
        }
        for row in 0..9 {
            for column in 0..9 {
                self.covariance[GEOMETRY + row][GEOMETRY + column] = geometry[(row, column)];
            }
        }
    }

    /// Covariance of the pose: xx, xy, xψ, yy, yψ, ψψ.
    pub fn pose_covariance(&self) -> [f64; 6] {
        let p = &self.covariance;
        [p[0][0], p[0][1], p[0][2], p[1][1], p[1][2], p[2][2]]
    }

    /// The pose is another one, with a covariance of its own: what is wrong with wheels and sensors stays.
    pub(crate) fn place(&mut self, map_from_body: Pose2, [xx, xy, xh, yy, yh, hh]: [f64; 6]) {
        self.map_from_body = map_from_body;
        for row in 0..3 {
            for column in 0..STATES {
                self.covariance[row][column] = 0.0;
                self.covariance[column][row] = 0.0;
            }
        }
        for (row, values) in [[xx, xy, xh], [xy, yy, yh], [xh, yh, hh]].iter().enumerate() {
            self.covariance[row][..3].copy_from_slice(values);
        }
    }

    /// What a step as the wheels tell it truly is.
    pub fn corrected(&self, step: BodyStep, time_s: f64) -> BodyStep {
        let u = [step.x_m, step.y_m, step.angle_rad];
        let row = |i: usize| {
            let e = &self.errors[GEOMETRY - 3 + 3 * i..GEOMETRY + 3 * i];
            u[i] + e[0] * u[0] + e[1] * u[1] + e[2] * u[2] - self.errors[SLIP - 3 + i] * time_s
        };
        BodyStep::new(row(0), row(1), row(2))
    }

    /// Becomes what a belief is after a step. Gives the step as it is believed.
    pub(crate) fn advance(&mut self, before: &Belief, step: BodyStep, meanwhile: &Meanwhile) -> BodyStep {
        let mut kept = [1.0; COLUMNS];
        kept[SLIP..OWN].fill(meanwhile.slip_kept);
        kept[STATES..STATES + FLAWS].copy_from_slice(&meanwhile.flaws_kept);
        let p = &mut self.covariance;
        for (row, before) in p.iter_mut().zip(&before.covariance[..before.states]) {
            for ((value, before), kept) in row.iter_mut().zip(before).zip(&kept) {
                *value = before * kept;
            }
        }
        (self.states, self.errors) = (before.states, before.errors);
        for (n, drive) in meanwhile.slip_drive().into_iter().enumerate() {
            let at = SLIP + n;
            self.errors[at - 3] *= meanwhile.slip_kept;
            p[at][at] = p[at][at].max(meanwhile.slip_least[n] * meanwhile.slip_kept);
            p[at].iter_mut().for_each(|value| *value *= meanwhile.slip_kept);
            p[at][at] += drive;
        }
        self.map_from_body = before.map_from_body;
        let truly = self.corrected(step, meanwhile.time_s);
        let to = self.map_from_body.moved_by(truly);
        let carrying = Carrying::new(self.map_from_body, to, step, meanwhile.time_s);
        let p = &mut self.covariance;
        let rows = carrying.rows::<COLUMNS>(p, &meanwhile.longer);
        let block = carrying.block(&rows);
        for (r, row) in rows.iter().enumerate() {
            p[r] = *row;
            p[r][..3].copy_from_slice(&block[r]);
            for (column, value) in row.iter().enumerate().take(self.states).skip(3) {
                p[column][r] = *value;
            }
        }
        self.map_from_body = to;
        truly
    }

    /// The covariance of the pose a little further on, at `to`, after a step that took a time, s: xx, xy, xψ, yy, yψ, ψψ.
    pub fn pose_covariance_at(&self, to: Pose2, step: BodyStep, time_s: f64) -> [f64; 6] {
        let carrying = Carrying::new(self.map_from_body, to, step, time_s);
        // The pose depends on nothing beyond.
        let p = carrying.block(&carrying.rows::<OWN>(&self.covariance, &[[0.0; 3]; 2]));
        [p[0][0], p[0][1], p[0][2], p[1][1], p[1][2], p[2][2]]
    }

    /// A reading against what is believed: by how much it is off, how that depends on what is estimated, the covariance of its own
    /// noise, and how it changes with flaws. `None` where that can't be one.
    pub(crate) fn innovation<const M: usize>(
        &self,
        difference: [f64; M],
        rows: &Rows<M>,
        noise: &SMatrix<f64, M, M>,
        changes: &[Change<M>],
    ) -> Option<Innovation<M>> {
        let mut moves = rows.carried(&self.covariance);
        let mut expected = [[0.0; M]; M];
        for (r, (expected, carried)) in expected.iter_mut().zip(&moves).enumerate() {
            for (c, (expected, of)) in expected.iter_mut().zip(rows.of(carried, r + 1)).enumerate() {
                *expected = of + noise[(r, c)];
            }
        }
        let root = root_of(&expected)?;
        let off = whiten(&root, difference);
        let nis: f64 = off.iter().map(|off| off * off).sum();
        if !nis.is_finite() {
            return None;
        }
        for (flaw, change) in changes {
            for (moves, change) in moves.iter_mut().zip(change) {
                moves[STATES + flaw] -= change;
            }
        }
        for (r, root) in root.iter().enumerate() {
            let (known, rest) = moves.split_at_mut(r);
            for (known, factor) in known.iter().zip(root) {
                add_scaled(&mut rest[0], -factor, known);
            }
            let per = 1.0 / root[r];
            rest[0].iter_mut().for_each(|value| *value *= per);
        }
        Some(Innovation { difference, root, off, moves, nis })
    }

    /// Takes it in. The covariance stays symmetric to the bit: what one number takes from two places it takes alike.
    pub(crate) fn correct<const M: usize>(&mut self, Innovation { off, moves, .. }: &Innovation<M>) {
        for (row, values) in self.covariance[..self.states].iter_mut().enumerate() {
            let factors: [f64; M] = std::array::from_fn(|m| -moves[m][row]);
            for (column, value) in values.iter_mut().enumerate() {
                let mut sum = *value;
                for (factor, moved) in factors.iter().zip(moves) {
                    sum += factor * moved[column];
                }
                *value = sum;
            }
        }
        let mut change = [0.0; STATES];
        for (moved, off) in moves.iter().zip(off) {
            for (change, moved) in change.iter_mut().zip(moved) {
                *change += off * moved;
            }
        }
        self.shift(&change);
    }

    /// Moves all that is estimated.
    pub(crate) fn shift(&mut self, change: &[f64; STATES]) {
        self.map_from_body.x_m += change[0];
        self.map_from_body.y_m += change[1];
        self.map_from_body.heading_rad += change[2];
        for (error, change) in self.errors.iter_mut().zip(&change[3..]) {
            *error += change;
        }
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.map_from_body.is_finite()
            && self.errors.iter().all(|error| error.is_finite())
            && self.covariance.iter().flatten().all(|value| value.is_finite())
    }
}
