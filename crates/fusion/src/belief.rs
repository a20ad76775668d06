//! What is believed: the pose, what is wrong with wheels and sensors, and their covariance.
//!
//! A step u of the body as its wheels tell it is truly u + E·u − s·T. E is what wrong radii, directions and places of the
//! wheels make of it (to first order a constant matrix, whatever the layout), s the speed by which they slip over the
//! floor: a Gauss-Markov process whose strength goes with the motion.

use nalgebra::SMatrix;
use omnibase_platform::{BodyStep, Pose2};

use crate::sensor::MAX_RATES;

/// Numbers that are estimated together: pose, E, s, and two of each sensor that tells a speed.
pub const STATES: usize = OWN + 2 * MAX_RATES;
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

/// The share of slip that is left after a time, s.
pub(crate) fn slip_kept(time_s: f64) -> f64 {
    (-time_s / SLIP_TIME_S).exp()
}

/// All that is estimated, number by number: an error of it, or what one number has to do with each.
pub(crate) type Along = [f64; STATES];

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

    /// What errors make of each number.
    pub(crate) fn of(&self, errors: &Along) -> [f64; M] {
        let mut twist = [0.0; 3];
        for (axis, of_twist) in twist.iter_mut().enumerate() {
            *of_twist = self.of_twist(axis, errors);
        }
        let mut made = [0.0; M];
        for (made, Row { pose, twist: by, own }) in made.iter_mut().zip(&self.rows) {
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

    /// The covariance of each number with all that is estimated.
    fn carried(&self, covariance: &[Along; STATES]) -> [Along; M] {
        let mut carried = [[0.0; STATES]; M];
        let mut add = |values: &Along, derivative: &dyn Fn(&Row) -> f64| {
            for (carried, row) in carried.iter_mut().zip(&self.rows) {
                match derivative(row) {
                    0.0 => {}
                    factor => add_scaled(carried, factor, values),
                }
            }
        };
        for axis in 0..3 {
            if self.rows.iter().any(|row| row.pose[axis] != 0.0) {
                add(&covariance[axis], &|row| row.pose[axis]);
            }
            if self.rows.iter().any(|row| row.twist[axis] != 0.0) {
                let at = GEOMETRY + 3 * axis;
                let mut of_twist = [0.0; STATES];
                add_scaled(&mut of_twist, -1.0, &covariance[SLIP + axis]);
                for (speed, values) in self.by_wheels.iter().zip(&covariance[at..]) {
                    add_scaled(&mut of_twist, *speed, values);
                }
                add(&of_twist, &|row| row.twist[axis]);
            }
        }
        for n in 0..2 {
            if self.rows.iter().any(|row| row.own[n] != 0.0) {
                add(&covariance[self.own + n], &|row| row.own[n]);
            }
        }
        carried
    }
}

/// Pose, errors and covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Belief {
    /// Where the platform is.
    pub map_from_body: Pose2,
    errors: [f64; ERRORS],
    covariance: [Along; STATES],
}

/// A reading against what is believed.
#[derive(Clone, Copy, Debug)]
pub struct Innovation<const M: usize> {
    difference: [f64; M],
    /// How it depends on what is estimated.
    pub(crate) rows: Rows<M>,
    /// L with L·Lᵀ = S.
    root: [[f64; M]; M],
    carried: [Along; M],
    /// ν'·S⁻¹·ν: chi² with M degrees of freedom where all is as believed.
    pub nis: f64,
}

/// A reading whose numbers have variance 1 and nothing to do with each other: L⁻¹ of all, ready to be taken in.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Whitened<const M: usize> {
    /// By how much it is off.
    pub(crate) off: [f64; M],
    /// Its covariance with all that is estimated: what one of each number off moves.
    pub(crate) moves: [Along; M],
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

/// How the error of a pose after a step depends on all errors before it.
struct Carrying {
    /// What an error of the step makes of the pose, and what one of the heading does.
    turned: [[f64; 3]; 3],
    swept: [f64; 3],
    u: [f64; 3],
    time_s: f64,
}

impl Carrying {
    fn new(from: Pose2, to: Pose2, step: BodyStep, time_s: f64) -> Carrying {
        let (dx, dy) = (to.x_m - from.x_m, to.y_m - from.y_m);
        let (sin, cos) = (0.5 * (from.heading_rad + to.heading_rad)).sin_cos();
        Carrying {
            turned: [[cos, -sin, -0.5 * dy], [sin, cos, 0.5 * dx], [0.0, 0.0, 1.0]],
            swept: [-dy, dx, 0.0],
            u: [step.x_m, step.y_m, step.angle_rad],
            time_s,
        }
    }

    /// What is wrong with the step's component of such a number, from what is wrong with E and slip.
    fn wrong(&self, p: impl Fn(usize) -> f64, i: usize) -> f64 {
        let u = &self.u;
        u[0] * p(GEOMETRY + 3 * i) + u[1] * p(GEOMETRY + 3 * i + 1) + u[2] * p(GEOMETRY + 3 * i + 2)
            - self.time_s * p(SLIP + i)
    }

    /// What something made of all that is estimated, after the step; itself it makes the step longer by so much.
    fn along(&self, made: &mut Along, longer: [f64; 3]) {
        let steps = [0, 1, 2].map(|i| self.wrong(|place| made[place], i) + longer[i]);
        let turn = made[2];
        for ((made, turned), swept) in made.iter_mut().zip(&self.turned).zip(self.swept) {
            *made += swept * turn + turned.iter().zip(steps).map(|(turned, step)| turned * step).sum::<f64>();
        }
    }

    /// Covariance of the pose after the step with the first `N` numbers before it.
    fn rows<const N: usize>(&self, p: &[Along; STATES]) -> [[f64; N]; 3] {
        let mut steps = [[0.0; N]; 3];
        for (i, step) in steps.iter_mut().enumerate() {
            for (column, value) in step.iter_mut().enumerate() {
                *value = self.wrong(|place| p[place][column], i);
            }
        }
        let (turned, swept) = (&self.turned, &self.swept);
        let mut rows = [[0.0; N]; 3];
        for (r, row) in rows.iter_mut().enumerate() {
            for (column, value) in row.iter_mut().enumerate() {
                *value = p[r][column]
                    + swept[r] * p[2][column]
                    + turned[r][0] * steps[0][column]
                    + turned[r][1] * steps[1][column]
                    + turned[r][2] * steps[2][column];
            }
        }
        rows
    }

    /// The covariance of the pose after the step.
    fn block<const N: usize>(&self, rows: &[[f64; N]; 3]) -> [[f64; 3]; 3] {
        let (turned, swept) = (&self.turned, &self.swept);
        let mut block = [[0.0; 3]; 3];
        for (row, values) in rows.iter().zip(&mut block) {
            let wrong = [0, 1, 2].map(|i| self.wrong(|place| row[place], i));
            for (q, value) in values.iter_mut().enumerate() {
                *value = row[q]
                    + swept[q] * row[2]
                    + turned[q][0] * wrong[0]
                    + turned[q][1] * wrong[1]
                    + turned[q][2] * wrong[2];
            }
        }
        std::array::from_fn(|r| std::array::from_fn(|q| 0.5 * (block[r][q] + block[q][r])))
    }
}

impl<const M: usize> Innovation<M> {
    /// By how much the reading is off.
    pub(crate) fn off(&self) -> [f64; M] {
        self.difference
    }

    /// What the square of each number was expected to be.
    pub(crate) fn expected(&self) -> [f64; M] {
        self.root.map(|row| row.iter().map(|value| value * value).sum())
    }

    /// L⁻¹ of numbers.
    pub(crate) fn whiten(&self, mut values: [f64; M]) -> [f64; M] {
        for r in 0..M {
            let known: f64 = (0..r).map(|c| self.root[r][c] * values[c]).sum();
            values[r] = (values[r] - known) / self.root[r][r];
        }
        values
    }

    pub(crate) fn whitened(&self) -> Whitened<M> {
        let mut moves = self.carried;
        for r in 0..M {
            let (known, rest) = moves.split_at_mut(r);
            for (known, factor) in known.iter().zip(&self.root[r]) {
                add_scaled(&mut rest[0], -factor, known);
            }
            let per = 1.0 / self.root[r][r];
            rest[0].iter_mut().for_each(|value| *value *= per);
        }
        Whitened { off: self.whiten(self.difference), moves }
    }
}

impl Belief {
    /// At a pose, with variances of all errors in their order and the covariance of E.
    pub fn new(map_from_body: Pose2, geometry: &SMatrix<f64, 9, 9>) -> Belief {
        let mut covariance = [[0.0; STATES]; STATES];
        for row in 0..9 {
            for column in 0..9 {
                covariance[GEOMETRY + row][GEOMETRY + column] = geometry[(row, column)];
            }
        }
        Belief { map_from_body, errors: [0.0; ERRORS], covariance }
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

    /// All may be off along this by something of such a variance.
    pub(crate) fn widen_along(&mut self, along: &Along, variance: f64) {
        for (row, values) in self.covariance.iter_mut().enumerate() {
            for (column, value) in values.iter_mut().enumerate() {
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

    /// Carries the belief along a step that took a time, s, in which slip had such standard deviations, m/s and rad/s: that of
    /// this step, its mean over that time. With it goes what somethings made of all that is estimated, and by how much the step is
    /// longer by each. Gives the step as it is believed.
    pub(crate) fn advance<'a>(
        &mut self,
        step: BodyStep,
        time_s: f64,
        slip_sigma: [f64; 3],
        made: impl Iterator<Item = (&'a mut Along, [f64; 3])>,
    ) -> BodyStep {
        self.forget_slip(time_s, slip_sigma);
        let truly = self.corrected(step, time_s);
        let to = self.map_from_body.moved_by(truly);
        let carrying = Carrying::new(self.map_from_body, to, step, time_s);
        let keep = slip_kept(time_s);
        for (made, longer) in made {
            made[SLIP..OWN].iter_mut().for_each(|slip| *slip *= keep);
            carrying.along(made, longer);
        }
        let rows = carrying.rows::<STATES>(&self.covariance);
        let block = carrying.block(&rows);
        let p = &mut self.covariance;
        for r in 0..3 {
            for column in 3..STATES {
                p[r][column] = rows[r][column];
                p[column][r] = rows[r][column];
            }
            p[r][..3].copy_from_slice(&block[r]);
        }
        self.map_from_body = to;
        truly
    }

    /// The covariance of the pose a little further on, at `to`, after a step that took a time, s: xx, xy, xψ, yy, yψ, ψψ.
    pub fn pose_covariance_at(&self, to: Pose2, step: BodyStep, time_s: f64) -> [f64; 6] {
        let carrying = Carrying::new(self.map_from_body, to, step, time_s);
        // The pose depends on nothing beyond.
        let p = carrying.block(&carrying.rows::<OWN>(&self.covariance));
        [p[0][0], p[0][1], p[0][2], p[1][1], p[1][2], p[2][2]]
    }

    fn forget_slip(&mut self, time_s: f64, sigma: [f64; 3]) {
        let keep = slip_kept(time_s);
        for (i, sigma) in sigma.iter().enumerate() {
            let at = SLIP + i;
            self.errors[at - 3] *= keep;
            for place in 0..STATES {
                self.covariance[at][place] *= keep;
                self.covariance[place][at] *= keep;
            }
            self.covariance[at][at] += sigma * sigma * (1.0 - keep * keep);
        }
    }

    /// A reading against what is believed: by how much it is off, how that depends on what is estimated, and the
    /// covariance of its own noise. `None` where that can't be one.
    pub fn innovation<const M: usize>(
        &self,
        difference: [f64; M],
        rows: &Rows<M>,
        noise: &SMatrix<f64, M, M>,
    ) -> Option<Innovation<M>> {
        let carried = rows.carried(&self.covariance);
        let mut expected = [[0.0; M]; M];
        for (r, (expected, carried)) in expected.iter_mut().zip(&carried).enumerate() {
            for (c, (expected, of)) in expected.iter_mut().zip(rows.of(carried)).enumerate() {
                *expected = of + noise[(r, c)];
            }
        }
        let root = root_of(&expected)?;
        let mut innovation = Innovation { difference, rows: *rows, root, carried, nis: 0.0 };
        innovation.nis = innovation.whiten(difference).iter().map(|off| off * off).sum();
        innovation.nis.is_finite().then_some(innovation)
    }

    /// Takes it in. The covariance stays symmetric to the bit: what one number takes from two places it takes alike.
    pub(crate) fn correct<const M: usize>(&mut self, Whitened { off, moves }: &Whitened<M>) {
        for (row, values) in self.covariance.iter_mut().enumerate() {
            for moved in moves {
                add_scaled(values, -moved[row], moved);
            }
        }
        let mut change = [0.0; STATES];
        for (moved, off) in moves.iter().zip(off) {
            add_scaled(&mut change, *off, moved);
        }
        self.shift(&change);
    }

    /// Moves all that is estimated.
    pub(crate) fn shift(&mut self, change: &Along) {
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
