//! What a gyro claims that never was seen to tell a turn: that there is none.
//!
//! One that is dead says the same as one of a platform that goes straight, and a control law that holds the
//! heading that is believed keeps it so: what wheels truly turn is taken for slip and for their geometry, each
//! reading within its gate.
//!
//! So until a gyro was seen to tell of a turn as the others do ([`super::flaws`]), or too long after that, what
//! is told counts with the pose being no better known than by wheels that turned as they said. That isn't so
//! any more as soon as it is shown, or a pose tells the heading.

use omnibase_platform::{BodyStep, Pose2};

use super::{Epoch, Knowledge, Mounted, rates};
use crate::belief::SLIP_TIME_S;
use crate::filter::FilterSettings;

/// What may be wrong with a pose, x, y and heading in map, because wheels turned as they said.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Unshown {
    /// By how much less they are believed to have turned, and what that makes of the place.
    off: [f64; 3],
    /// What one of each error makes of it by which wheels turn with a way forth, aside, and a turn.
    by_geometry: [[f64; 3]; 3],
    /// Covariance by unseen slip of the turn: xx, xy, xψ, yy, yψ, ψψ.
    by_slip: [f64; 6],
}

impl Unshown {
    /// A step goes on, from one pose to another, that wheels tell as such a one; by so much less it is believed to turn.
    fn goes_on(&mut self, from: Pose2, to: Pose2, step: BodyStep, less_rad: f64, slip_rad2: f64) {
        let (dx, dy) = (to.x_m - from.x_m, to.y_m - from.y_m);
        let swept = |off: &mut [f64; 3], turned: f64| {
            let middle = off[2] + 0.5 * turned;
            off[0] -= dy * middle;
            off[1] += dx * middle;
            off[2] += turned;
        };
        swept(&mut self.off, less_rad);
        for (made, way) in self.by_geometry.iter_mut().zip([step.x_m, step.y_m, step.angle_rad]) {
            swept(made, way);
        }
        let [xx, xy, xh, yy, yh, hh] = &mut self.by_slip;
        *xx += dy * (dy * *hh - 2.0 * *xh);
        *xy += dx * *xh - dy * *yh - dx * dy * *hh;
        *yy += dx * (dx * *hh + 2.0 * *yh);
        *xh -= dy * *hh;
        *yh += dx * *hh;
        *hh += slip_rad2;
    }

    /// Its covariance, xx, xy, xψ, yy, yψ, ψψ, with that of what wheels make of a step.
    pub(crate) fn covariance(&self, settings: &FilterSettings) -> [f64; 6] {
        if *self == Unshown::default() {
            return [0.0; 6];
        }
        let of_turn = |a: usize, b: usize| settings.geometry[(6 + a, 6 + b)];
        let of = |r: usize, c: usize| {
            let by_geometry: f64 = (0..9)
                .map(|n| self.by_geometry[n / 3][r] * of_turn(n / 3, n % 3) * self.by_geometry[n % 3][c])
                .sum();
            self.off[r] * self.off[c] + by_geometry
        };
        let all = [of(0, 0), of(0, 1), of(0, 2), of(1, 1), of(1, 2), of(2, 2)];
        std::array::from_fn(|n| all[n] + self.by_slip[n])
    }
}

impl Epoch {
    /// Counts with it while no gyro that is believed was shown right. Where none is believed any more, it is what they made of the pose,
    /// and what was learnt of the wheels was theirs.
    pub(super) fn count_unshown(
        &self,
        settings: &FilterSettings,
        sensors: &[Mounted],
        from: Pose2,
        truly: BodyStep,
        known: &mut Knowledge,
    ) {
        let (mut is_believed, mut is_shown) = (false, false);
        for (_, (place, _)) in rates(sensors).filter(|(_, (_, kind))| kind.is_gyro()) {
            let standing = &known.standings[place];
            let speaks = standing.is_believed() && standing.silent_s(self.end_ns).is_finite();
            is_believed |= speaks;
            is_shown |= speaks && known.is_shown(&sensors[place]);
        }
        if is_believed && !is_shown {
            let step = self.step();
            let slip = settings.slip_sigma(step, self.time_s)[2];
            let slip_rad2 = 2.0 * SLIP_TIME_S * self.time_s * slip * slip;
            let to = known.belief.map_from_body;
            known.unshown.goes_on(from, to, step, truly.angle_rad - step.angle_rad, slip_rad2);
        } else if known.unshown != Unshown::default() {
            if !is_believed {
                known.belief.widen_pose(known.unshown.covariance(settings));
                known.belief.forget_wheels(&settings.geometry);
            }
            known.unshown = Unshown::default();
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::SMatrix;

    use super::*;
    use crate::belief::{Belief, FLAWS, Meanwhile};

    /// What wheels make of the pose by their turn alone is what a belief counts with that knows of nothing else.
    #[test]
    fn the_covariance_of_wheels_that_turned_as_they_said_is_that_of_a_belief_without_readings() {
        let geometry = SMatrix::<f64, 9, 9>::from_fn(|r, c| match (r, c) {
            (6.., 6..) => [[4e-6, 1e-6, 0.0], [1e-6, 9e-6, -2e-6], [0.0, -2e-6, 1e-6]][r - 6][c - 6],
            _ => 0.0,
        });
        let settings = FilterSettings { wheels: Default::default(), geometry, period_ns: 1_000_000 };
        let mut belief = Belief::new(Pose2::default(), &geometry, 0);
        let mut unshown = Unshown::default();
        let meanwhile = Meanwhile {
            time_s: 5e-3,
            slip_kept: 0.97,
            slip_sigma: [0.0; 3],
            slip_least: [0.0; 3],
            flaws_kept: [1.0; FLAWS],
            longer: [[0.0; 3]; 2],
        };
        for n in 0..2000 {
            let phase = 3e-3 * f64::from(n);
            let step = BodyStep::new(2e-3 * phase.cos(), 1e-3 * (2.0 * phase).sin(), 1e-3 * phase.sin());
            let from = belief.map_from_body;
            belief.advance(&belief.clone(), step, &meanwhile);
            unshown.goes_on(from, belief.map_from_body, step, 0.0, 0.0);
        }
        for (one, other) in unshown.covariance(&settings).iter().zip(belief.pose_covariance()) {
            assert!(other != 0.0 && (one - other).abs() < 1e-9 * other.abs(), "{one:e} {other:e}");
        }
    }
}
