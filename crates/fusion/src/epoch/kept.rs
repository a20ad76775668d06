//! What flaws may have made of the pose: kept until a pose tells where the platform is.
//!
//! How far a flaw is off is told by the last seconds, and forgotten by them. What it made of the pose isn't gone
//! by that: it stays where it is in map, whether the platform drives on or stands, and a heading that is off
//! sweeps the place along the way. Only who tells of the pose takes it away, by as much as it draws the pose.

use nalgebra::{Matrix3, SymmetricEigen};
use omnibase_platform::Pose2;

/// Below this nothing is left, m² and rad².
const NOTHING: f64 = 1e-18;
/// A matrix of three rows has its axes within a few rounds; what isn't finite might never have.
const MOST_ROUNDS: usize = 100;

/// Its covariance, x, y and heading in map.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Kept(Matrix3<f64>);

impl Kept {
    /// A step goes on, from one pose to another.
    pub(super) fn goes_on(&mut self, from: Pose2, to: Pose2) {
        let (dx, dy) = (to.x_m - from.x_m, to.y_m - from.y_m);
        self.becomes(&Matrix3::new(1.0, 0.0, -dy, 0.0, 1.0, dx, 0.0, 0.0, 1.0));
    }

    /// Each error of the pose becomes such a one.
    pub(super) fn becomes(&mut self, errors: &Matrix3<f64>) {
        if self.is_none() {
            return;
        }
        let made = errors * self.0 * errors.transpose();
        self.0 = 0.5 * (made + made.transpose());
        if self.0.trace() < NOTHING {
            self.0 = Matrix3::zeros();
        }
    }

    /// It is at least this, along each direction.
    pub(super) fn is_at_least(&mut self, covariance: &Matrix3<f64>) {
        if *covariance != Matrix3::zeros() {
            self.0 += positive(covariance - self.0);
        }
    }

    /// So much of it is counted elsewhere from now on.
    pub(super) fn is_counted(&mut self, covariance: &Matrix3<f64>) {
        if !self.is_none() {
            self.0 = positive(self.0 - covariance);
        }
    }

    /// xx, xy, xψ, yy, yψ, ψψ.
    pub(super) fn covariance(&self) -> [f64; 6] {
        let p = &self.0;
        [p[(0, 0)], p[(0, 1)], p[(0, 2)], p[(1, 1)], p[(1, 2)], p[(2, 2)]]
    }

    fn is_none(&self) -> bool {
        self.0 == Matrix3::zeros()
    }
}

/// From xx, xy, xψ, yy, yψ, ψψ.
pub(super) fn symmetric([xx, xy, xh, yy, yh, hh]: [f64; 6]) -> Matrix3<f64> {
    Matrix3::new(xx, xy, xh, xy, yy, yh, xh, yh, hh)
}

/// What of a symmetric matrix is more than nothing, along its own axes; what isn't finite stays as it is.
fn positive(matrix: Matrix3<f64>) -> Matrix3<f64> {
    let is_finite = matrix.iter().all(|value| value.is_finite());
    let eigen = is_finite.then(|| SymmetricEigen::try_new(matrix, f64::EPSILON, MOST_ROUNDS)).flatten();
    let Some(SymmetricEigen { eigenvectors, eigenvalues }) = eigen else { return matrix };
    let axes = eigenvectors.column_iter().zip(&eigenvalues);
    axes.map(|(axis, value)| axis * axis.transpose() * value.max(0.0)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn least(matrix: Matrix3<f64>) -> f64 {
        matrix.symmetric_eigenvalues().min()
    }

    #[test]
    fn it_is_at_least_each_of_what_it_ever_was_along_each_direction() {
        let of = |x: f64, y: f64, turn: f64| nalgebra::Vector3::new(x, y, turn);
        let all = [of(0.03, 0.0, 0.0), of(0.0, 0.02, 1e-3), of(0.01, -0.01, 5e-3), of(-0.02, 0.02, 0.0)];
        let mut kept = Kept::default();
        for one in all {
            kept.is_at_least(&(one * one.transpose()));
        }
        for one in all {
            assert!(least(kept.0 - one * one.transpose()) > -1e-15, "{one}");
        }
        let again = kept;
        kept.is_at_least(&(all[0] * all[0].transpose()));
        assert!((kept.0 - again.0).norm() < 1e-15, "the same again makes nothing of it");
    }

    #[test]
    fn what_is_not_finite_ends_too_and_stays_no_number() {
        for odd in [f64::NAN, f64::INFINITY] {
            for (row, column) in [(1, 1), (0, 2)] {
                let mut kept = Kept::default();
                let mut made = Matrix3::from_diagonal(&[1e-4, 1e-4, 1e-4].into());
                (made[(row, column)], made[(column, row)]) = (odd, odd);
                kept.is_at_least(&made);
                assert!(kept.covariance().iter().any(|value| !value.is_finite()), "{odd}: {}", kept.0);
            }
        }
    }

    #[test]
    fn a_heading_that_is_off_sweeps_the_place_and_is_counted_once() {
        let turned = Matrix3::from_diagonal(&[0.0, 0.0, 1e-6].into());
        let mut kept = Kept::default();
        kept.is_at_least(&turned);
        kept.goes_on(Pose2::new(0.0, 0.0, 0.3), Pose2::new(2.0, 0.0, 0.1));
        let [xx, .., yy, yh, hh] = kept.covariance();
        for (is, expected) in [(xx, 0.0), (yy, 4e-6), (yh, 2e-6), (hh, 1e-6)] {
            assert!((is - expected).abs() < 1e-18, "{is:e}, expected {expected:e}");
        }
        kept.is_counted(&kept.0.clone());
        assert!(kept.0.norm() < 1e-18, "{}", kept.0);
    }
}
