//! Whether pieces of polynomials surely keep to limits: by their hulls, without a search for peaks.
//!
//! A polynomial lies within the hull of its coefficients in S. N. Bernstein's basis, and so does a vector of them; halving the piece
//! (P. de Casteljau) brings the hull near it quickly.

use super::Limits;
use crate::interpolation::PointTrajectory;
use crate::polynomial::Polynomial;

/// How often a piece is halved before it counts as not sure.
const HALVINGS: u32 = 4;

/// Looks along a trajectory, in the order of time.
pub(super) struct Inside<'a> {
    pieces: &'a [[Polynomial; 3]],
    breaks_s: &'a [f64],
    limits: Limits,
    /// The first piece that ends after what was asked for last.
    next: usize,
}

impl<'a> Inside<'a> {
    pub(super) fn new(trajectory: &'a PointTrajectory, limits: &Limits) -> Self {
        let (pieces, breaks_s) = trajectory.pieces();
        Inside { pieces, breaks_s, limits: *limits, next: 0 }
    }

    /// Whether all pieces between two times, s, keep to the limits; times must not fall from call to call.
    pub(super) fn is_sure(&mut self, [from_s, to_s]: [f64; 2]) -> bool {
        while self.next + 1 < self.pieces.len() && self.breaks_s[self.next + 1] <= from_s {
            self.next += 1;
        }
        (self.next..self.pieces.len())
            .take_while(|at| self.breaks_s[*at] < to_s)
            .all(|at| self.keeps(&self.pieces[at], self.breaks_s[at + 1] - self.breaks_s[at]))
    }

    fn keeps(&self, piece: &[Polynomial; 3], duration_s: f64) -> bool {
        let Limits {
            speed_m_s,
            acceleration_m_s2,
            jerk_m_s3,
            rate_rad_s,
            angular_acceleration_rad_s2,
            angular_jerk_rad_s3,
        } = self.limits;
        let most = [
            [speed_m_s, rate_rad_s],
            [acceleration_m_s2, angular_acceleration_rad_s2],
            [jerk_m_s3, angular_jerk_rad_s3],
        ];
        let mut derived = piece.each_ref().map(|axis| axis.coefficients);
        most.into_iter().all(|most| {
            derived = derived.map(derivative);
            within(derived.map(|axis| in_bernstein(axis, duration_s)), most, HALVINGS)
        })
    }
}

fn derivative(coefficients: [f64; 6]) -> [f64; 6] {
    std::array::from_fn(|at| if at < 5 { (at + 1) as f64 * coefficients[at + 1] } else { 0.0 })
}

/// The coefficients of degree five over a duration.
fn in_bernstein(coefficients: [f64; 6], duration_s: f64) -> [f64; 6] {
    const CHOOSE: [[f64; 6]; 6] = [
        [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1.0, 1.0, 0.0, 0.0, 0.0, 0.0],
        [1.0, 2.0, 1.0, 0.0, 0.0, 0.0],
        [1.0, 3.0, 3.0, 1.0, 0.0, 0.0],
        [1.0, 4.0, 6.0, 4.0, 1.0, 0.0],
        [1.0, 5.0, 10.0, 10.0, 5.0, 1.0],
    ];
    let mut power = 1.0;
    let scaled = coefficients.map(|coefficient| {
        let scaled = coefficient * power;
        power *= duration_s;
        scaled
    });
    std::array::from_fn(|at| (0..=at).map(|k| CHOOSE[at][k] / CHOOSE[5][k] * scaled[k]).sum())
}

/// Whether x and y as a vector, and the turn, keep below two limits.
fn within(axes: [[f64; 6]; 3], most: [f64; 2], halvings: u32) -> bool {
    let [x, y, turn] = &axes;
    let straight = x.iter().zip(y).all(|(x, y)| x * x + y * y <= most[0] * most[0]);
    if straight && turn.iter().all(|turn| turn.abs() <= most[1]) {
        return true;
    }
    let ends = [0, 5];
    let exceeds = ends.iter().any(|at| x[*at].hypot(y[*at]) > most[0] || turn[*at].abs() > most[1]);
    if halvings == 0 || exceeds {
        return false;
    }
    let halves = axes.map(halved);
    [0, 1].into_iter().all(|half| within(halves.map(|halves| halves[half]), most, halvings - 1))
}

fn halved(mut controls: [f64; 6]) -> [[f64; 6]; 2] {
    let (mut first, mut second) = ([0.0; 6], [0.0; 6]);
    for level in 0..6 {
        first[level] = controls[0];
        second[5 - level] = controls[5 - level];
        for at in 0..5 - level {
            controls[at] = 0.5 * (controls[at] + controls[at + 1]);
        }
    }
    [first, second]
}
