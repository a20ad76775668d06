//! What wheels that aren't quite as their layout says make of the pose.
//!
//! A wheel's radius, direction and place are wrong by the same all the time, so that their errors p add up along the way
//! and come back where it closes. The pose is off by J·p, to first order, with J = ∂pose/∂p integrated along the motion,
//! and its covariance is J·Σ·Jᵀ.
//!
//! With R·ω = B·ξ (see [`Kinematics`]), a wheel's row b = (aₓ, a_y, x·a_y − y·aₓ)/(a·u) shows its surface the
//! way b·ξ. Where the wheel is another one, a step ξ is wrong by B⁺ times what each surface shows wrong, to
//! first order.
//!
//! What four and more wheels contradict each other by, their treads share out: B⁺ is that of the step's
//! [`Treads`], not of the odometry's own fit, which differs from it only by what wheels that are as they are
//! said to be never say.
//!
//! | error | a wheel's surface shows too much by |
//! |---|---|
//! | radius, by a share ρ | −ρ·b·ξ |
//! | direction of the mounted wheel, by δ | δ·(−a_y·ξₓ + aₓ·ξ_y + (x·aₓ + y·a_y)·ξψ)/(a·u) |
//! | place, by ε along the lever arm of its force | ε·ξψ/(a·u) |

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::PoseGrowth;
use super::covariance::CovarianceSettings;
use crate::kinematics::Kinematics;
use crate::layout::unit;
use crate::se2::{BodyStep, Pose2};
use crate::tread::{Treads, fit};
use crate::wheel::{MAX_WHEELS, PerWheel};

/// How well the wheels are where and what they are said to be: standard deviations of each wheel by itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GeometrySigmas {
    /// Of the true rolling radius, over the radius.
    pub radius_share: f64,
    /// Of the direction in which the wheel is mounted, in rad.
    pub direction_rad: f64,
    /// Of each coordinate of the place where it touches the ground, in m.
    pub position_m: f64,
}

impl Default for GeometrySigmas {
    /// Wheels as a workshop builds and measures them, without a drive that calibrates them.
    fn default() -> Self {
        GeometrySigmas { radius_share: 3e-3, direction_rad: 5e-3, position_m: 2e-3 }
    }
}

/// How many errors a wheel has: radius, direction, lever arm.
const ERRORS: usize = 3;
/// A hub that goes less in a step counts as going so far, m.
const HUB_STANDS_M: f64 = 1e-9;

/// A wheel's part in a wrong step.
#[derive(Clone, Copy, Debug, Default)]
struct Part {
    /// The body's step per metre of the wheel's surface: a column of B⁺.
    step: Vector3<f64>,
    /// What its surface shows wrong at one standard deviation of each error, in m per unit of the step.
    shown: [Vector3<f64>; ERRORS],
    /// The share of its square that contradicts the other wheels: 1 − b·(column of B⁺); 0 with three wheels.
    contradicts: f64,
}

/// The error of the pose in odom, in m and rad, at one standard deviation of each error of each wheel.
#[derive(Clone, Debug)]
pub(super) struct GeometryErrors {
    wheels: usize,
    rows: [[f64; 3]; MAX_WHEELS],
    treads: Treads,
    parts: [Part; MAX_WHEELS],
    errors: [[Vector3<f64>; ERRORS]; MAX_WHEELS],
}

impl GeometryErrors {
    pub(super) fn new(kinematics: &Kinematics, sigmas: &GeometrySigmas) -> GeometryErrors {
        let wheels = kinematics.wheel_count();
        let mut parts = [Part::default(); MAX_WHEELS];
        for (at, (part, wheel)) in parts.iter_mut().zip(kinematics.wheels()).enumerate() {
            let turned =
                PerWheel::from_fn(wheels, |other| if other == at { 1.0 / wheel.radius_m } else { 0.0 });
            let (step, _) = kinematics.body_step(&turned);
            part.step = Vector3::new(step.x_m, step.y_m, step.angle_rad);
            let (u, a) = (unit(wheel.rolling_direction), unit(wheel.force_direction));
            let cosine = a[0] * u[0] + a[1] * u[1];
            let [x, y] = wheel.position_m;
            let row = Vector3::from(kinematics.matrix()[at]);
            part.contradicts = (1.0 - row.dot(&part.step)).max(0.0);
            let across = Vector3::new(-a[1], a[0], x * a[0] + y * a[1]) / cosine;
            part.shown = [
                row * -sigmas.radius_share,
                across * sigmas.direction_rad,
                Vector3::new(0.0, 0.0, sigmas.position_m / cosine),
            ];
        }
        let mut rows = [[0.0; 3]; MAX_WHEELS];
        rows[..wheels].copy_from_slice(kinematics.matrix());
        GeometryErrors {
            wheels,
            rows,
            treads: Treads::new(kinematics.wheels()),
            parts,
            errors: [[Vector3::zeros(); ERRORS]; MAX_WHEELS],
        }
    }

    /// The body's step per metre of each wheel's surface, as treads share it out in a step; `None` where that is the fit's, as of three
    /// wheels, which have nothing to share.
    fn shared(&self, step: &Vector3<f64>) -> Option<[Vector3<f64>; MAX_WHEELS]> {
        if self.wheels <= 3 {
            return None;
        }
        let resists = self.treads.resistances((*step).into(), HUB_STANDS_M);
        fit(&self.rows[..self.wheels], &resists)
    }

    /// Covariance of the matrix that a step is wrong by, row by row: to first order E·ξ with the same E in every step.
    pub(super) fn step_covariance(&self) -> SMatrix<f64, 9, 9> {
        let mut sum = SMatrix::zeros();
        for part in self.parts.iter().take(self.wheels) {
            for shown in &part.shown {
                let wrong = SVector::<f64, 9>::from_fn(|at, _| part.step[at / 3] * shown[at % 3]);
                sum += wrong * wrong.transpose();
            }
        }
        sum
    }

    /// The pose is known anew; what is wrong with the wheels isn't.
    pub(super) fn reset(&mut self) {
        self.errors = [[Vector3::zeros(); ERRORS]; MAX_WHEELS];
    }

    /// Carries them along a step from one pose to the next, both in odom; the standard deviation, in m, of what they make
    /// wheels contradict each other by in it.
    pub(super) fn advance(&mut self, step: BodyStep, from: Pose2, to: Pose2) -> f64 {
        let (dx, dy) = (to.x_m - from.x_m, to.y_m - from.y_m);
        let (sin, cos) = (0.5 * (from.heading_rad + to.heading_rad)).sin_cos();
        let step = Vector3::new(step.x_m, step.y_m, step.angle_rad);
        let mut residual_m2 = 0.0;
        let shared = self.shared(&step);
        let wheels = self.parts[..self.wheels].iter().zip(&mut self.errors).enumerate();
        for (at, (part, errors)) in wheels {
            let own = shared.as_ref().map_or(&part.step, |shared| &shared[at]);
            let [x, y, turn] = (*own).into();
            let [x, y] = [cos * x - sin * y, sin * x + cos * y];
            for (error, shown) in errors.iter_mut().zip(&part.shown) {
                let shown_m = shown.dot(&step);
                residual_m2 += part.contradicts * shown_m * shown_m;
                // A wrong heading turns the way: that of the step's middle.
                let half_turn = 0.5 * shown_m * turn;
                let heading = error[2] - half_turn;
                error[0] -= dy * heading + shown_m * x;
                error[1] += dx * heading - shown_m * y;
                error[2] = heading - half_turn;
            }
        }
        residual_m2.sqrt()
    }

    /// Their part of the pose's covariance.
    pub(super) fn covariance(&self) -> Matrix3<f64> {
        let [mut xx, mut xy, mut xh, mut yy, mut yh, mut hh] = [0.0; 6];
        for error in self.errors[..self.wheels].as_flattened() {
            let [x, y, turn] = (*error).into();
            (xx, xy, xh) = (xx + x * x, xy + x * y, xh + x * turn);
            (yy, yh, hh) = (yy + y * y, yh + y * turn, hh + turn * turn);
        }
        Matrix3::new(xx, xy, xh, xy, yy, yh, xh, yh, hh)
    }

    /// By how much they and all else may make a pose more uncertain.
    ///
    /// What a way of w metres and t radians adds to an error in any direction is no greater than |B⁺ᵢ|·|shown|,
    /// and that no greater than w·|its part for x and y| + t·|its part for the heading|; lengths of vectors of
    /// such sums are no greater than the sums of their lengths (Minkowski).
    ///
    /// Where wheels are more than three, B⁺ is that of hubs that go alike for the first; what it becomes by
    /// turning is counted with the second ([`GeometryErrors::by_turning`]).
    pub(super) fn growth(&self, variances: &CovarianceSettings) -> PoseGrowth {
        let alike = self.alike();
        let length = |size: fn(&Vector3<f64>, &Vector3<f64>) -> f64| {
            let parts = self.parts.iter().zip(&alike).take(self.wheels);
            let squares =
                parts.flat_map(|(part, step)| part.shown.iter().map(move |shown| size(step, shown).powi(2)));
            squares.sum::<f64>().sqrt()
        };
        let (position_per_rad, heading_per_rad) = if self.wheels <= 3 {
            (length(|step, shown| way_of(step) * shown[2]), length(|step, shown| step[2] * shown[2]))
        } else {
            (self.by_turning(way_of), self.by_turning(|step| step[2].abs()))
        };
        PoseGrowth {
            variances: *variances,
            position_per_m: length(|step, shown| way_of(step) * way_of(shown)),
            position_per_rad,
            heading_per_m: length(|step, shown| step[2] * way_of(shown)),
            heading_per_rad,
        }
    }

    /// B⁺ where all hubs go alike.
    fn alike(&self) -> [Vector3<f64>; MAX_WHEELS] {
        let by_fit = || self.parts.map(|part| part.step);
        if self.wheels <= 3 {
            return by_fit();
        }
        fit(&self.rows[..self.wheels], self.treads.alike()).unwrap_or_else(by_fit)
    }

    /// What a radian adds at most where treads share out what wheels contradict each other by.
    ///
    /// With y what surfaces show wrong, A what B⁺ is where hubs go alike and P = 1 − B·A:
    /// B⁺·y = B⁺·y_t + A·y_w + B⁺·P·y_w, of which the second is counted per metre.
    ///
    /// Resistances are those of hubs that go alike times 1 + dᵢ, |dᵢ| ≤ t·|place of the hub|/w where
    /// they are over their own, so that B⁺·P·y_w = B⁺·d·P·y_w.
    ///
    /// And whatever resistances are, B⁺ is a mean of the inverses of all sets of three wheels (Ben-Tal and
    /// Teboulle, *Linear Algebra and its Applications* 139, 1990), so that nothing it makes is greater than
    /// what one of these does.
    fn by_turning(&self, size: fn(&Vector3<f64>) -> f64) -> f64 {
        let alike = self.alike();
        let arms_m = self.treads.arms_m();
        // Standard deviation of what each wheel contradicts the others by, per metre.
        let contradicts = |at: usize| {
            let row = Vector3::from(self.rows[at]);
            let squares = (0..self.wheels).flat_map(|other| {
                let own = f64::from(u8::from(other == at));
                let share = own - row.dot(&alike[other]);
                self.parts[other].shown.iter().map(move |shown| (share * way_of(shown)).powi(2))
            });
            squares.sum::<f64>().sqrt()
        };
        let contradicts: [f64; MAX_WHEELS] =
            std::array::from_fn(|at| if at < self.wheels { contradicts(at) } else { 0.0 });
        let of_set = |set: [usize; 3]| {
            let rows = Matrix3::from_fn(|row, axis| self.rows[set[row]][axis]);
            let Some(inverse) = rows.try_inverse() else { return 0.0 };
            let (mut turned_2, mut shared) = (0.0, 0.0);
            for (column, at) in set.into_iter().enumerate() {
                let size = size(&inverse.column(column).into_owned());
                let shown = self.parts[at].shown.iter().map(|shown| (size * shown[2]).powi(2));
                turned_2 += shown.sum::<f64>();
                shared += size * arms_m[at] * contradicts[at];
            }
            turned_2.sqrt() + shared
        };
        let sets = (0..self.wheels)
            .flat_map(|one| (0..one).flat_map(move |other| (0..other).map(move |third| [one, other, third])));
        sets.map(of_set).fold(0.0, f64::max)
    }
}

fn way_of(step: &Vector3<f64>) -> f64 {
    step[0].hypot(step[1])
}
