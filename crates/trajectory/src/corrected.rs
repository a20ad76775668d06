//! A motion beside itself: what repeats taught of where the platform gets to is added to where it is told to go.

use omnibase_platform::{Pose2, Twist2};

use crate::interpolation::{Interpolation, PointTrajectory};
use crate::path_points::PathPoints;
use crate::trajectory::{Setpoint, Trajectory};

/// The farthest that a correction may be, m and rad: more isn't made up for by repeats.
pub const MOST_CORRECTED: [f64; 2] = [0.05, 0.05];

/// About when a control counts most, s: of a correction with controls 0 to `last`, whose knots are evenly spread.
pub fn control_centre_s(duration_s: f64, last: usize, control: usize) -> f64 {
    duration_s * (control + 1) as f64 / (last + 2) as f64
}

/// Why points are no correction of a motion.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CorrectionError {
    /// It belongs to a motion of another duration.
    #[error("it was learnt for a motion of {found_s} s, this one takes {expected_s} s")]
    Duration {
        /// The motion's, s.
        expected_s: f64,
        /// From its first point to its last one, s.
        found_s: f64,
    },
    /// It doesn't begin with nothing.
    #[error("it begins beside the motion: expected 0 in its first point")]
    Beginning,
    /// It is too far.
    #[error("at {time_s} s: expected at most {} m and {} rad, found {distance_m} m and {turn_rad} rad", MOST_CORRECTED[0], MOST_CORRECTED[1])]
    TooFar {
        /// When, s.
        time_s: f64,
        /// How far, m.
        distance_m: f64,
        /// How far it turns, rad.
        turn_rad: f64,
    },
}

/// A small motion in the platform's axes: a cubic B-spline, so C2, at rest at both ends.
#[derive(Clone, Debug, PartialEq)]
pub struct Correction {
    base_from_corrected: PointTrajectory,
}

/// A trajectory with a correction on top: `odom_from_base` followed by `base_from_corrected`.
#[derive(Clone, Debug)]
pub struct Corrected<T> {
    trajectory: T,
    correction: Correction,
}

impl Correction {
    /// That of a motion of this duration, s, by its controls, each with x, y in m and heading in rad.
    pub fn new(expected_s: f64, controls: &PathPoints) -> Result<Self, CorrectionError> {
        let base_from_corrected = PointTrajectory::new(controls, Interpolation::BSpline);
        let found_s = base_from_corrected.duration_s();
        if expected_s.is_infinite() || (found_s - expected_s).abs() > 1e-3 * expected_s {
            return Err(CorrectionError::Duration { expected_s, found_s });
        }
        if controls.as_slice()[0].odom_from_base != Pose2::default() {
            return Err(CorrectionError::Beginning);
        }
        for control in controls.as_slice() {
            let Pose2 { x_m, y_m, heading_rad } = control.odom_from_base;
            let (distance_m, turn_rad) = (x_m.hypot(y_m), heading_rad.abs());
            if distance_m > MOST_CORRECTED[0] || turn_rad > MOST_CORRECTED[1] {
                return Err(CorrectionError::TooFar { time_s: control.time_s, distance_m, turn_rad });
            }
        }
        Ok(Correction { base_from_corrected })
    }

    /// How far the corrected motion is beside the motion itself at a time, s: its pose in the motion's axes.
    pub fn at(&self, time_s: f64) -> Pose2 {
        self.base_from_corrected.sample(time_s).odom_from_base
    }
}

impl<T: Trajectory> Corrected<T> {
    /// The motion with its correction.
    pub fn new(trajectory: T, correction: Correction) -> Self {
        Corrected { trajectory, correction }
    }
}

impl<T: Trajectory> Trajectory for Corrected<T> {
    fn duration_s(&self) -> f64 {
        self.trajectory.duration_s()
    }

    fn sample(&self, time_s: f64) -> Setpoint {
        let own = self.trajectory.sample(time_s);
        let small = self.correction.base_from_corrected.sample(time_s);
        let [w, dw, ddw] =
            [own.twist_in_odom.w_rad_s, own.acceleration_in_odom.w_rad_s, own.jerk_in_odom.w_rad_s];
        let d = [small.odom_from_base.x_m, small.odom_from_base.y_m];
        let [v, a, j] = [small.twist_in_odom, small.acceleration_in_odom, small.jerk_in_odom]
            .map(|rate| [rate.vx_m_s, rate.vy_m_s]);
        // (d/dt + ω×) once, twice and three times on what stands in axes that turn with ω.
        let sum = |parts: &[(f64, [f64; 2])]| {
            parts.iter().fold([0.0; 2], |sum, (factor, [x, y])| [sum[0] + factor * x, sum[1] + factor * y])
        };
        let across = |[x, y]: [f64; 2]| [-y, x];
        let velocity = sum(&[(1.0, v), (w, across(d))]);
        let acceleration = sum(&[(1.0, a), (2.0 * w, across(v)), (dw, across(d)), (-w * w, d)]);
        let jerk = sum(&[
            (1.0, j),
            (3.0 * w, across(a)),
            (3.0 * dw, across(v)),
            (ddw - w * w * w, across(d)),
            (-3.0 * w * w, v),
            (-3.0 * w * dw, d),
        ]);
        let heading_rad = own.odom_from_base.heading_rad;
        let plus = |rate: Twist2, more: [f64; 2], turn: f64| {
            let more = Twist2::new(more[0], more[1], turn).rotated(heading_rad);
            Twist2::new(rate.vx_m_s + more.vx_m_s, rate.vy_m_s + more.vy_m_s, rate.w_rad_s + more.w_rad_s)
        };
        Setpoint {
            odom_from_base: own.odom_from_base.then(small.odom_from_base),
            twist_in_odom: plus(own.twist_in_odom, velocity, small.twist_in_odom.w_rad_s),
            acceleration_in_odom: plus(
                own.acceleration_in_odom,
                acceleration,
                small.acceleration_in_odom.w_rad_s,
            ),
            jerk_in_odom: plus(own.jerk_in_odom, jerk, small.jerk_in_odom.w_rad_s),
        }
    }

    fn breaks_s(&self) -> Vec<f64> {
        let mut breaks_s = self.trajectory.breaks_s();
        breaks_s.extend(self.correction.base_from_corrected.breaks_s());
        breaks_s.sort_by(f64::total_cmp);
        breaks_s.dedup();
        breaks_s
    }

    fn passes_s(&self) -> [Option<f64>; 2] {
        self.trajectory.passes_s()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path_points::PathPoint;
    use crate::shape::{Heading, Shape, ShapeTrajectory};

    fn controls(duration_s: f64, size: f64) -> PathPoints {
        let at = |n: u32| {
            let share = f64::from(n) / 12.0;
            let bend = |times: f64| size * (times * share).sin();
            let pose = Pose2::new(bend(5.0), bend(7.0), bend(4.0));
            PathPoint { time_s: share * duration_s, odom_from_base: pose }
        };
        PathPoints::new((0..=12).map(at).collect()).unwrap()
    }

    fn circle() -> ShapeTrajectory {
        let shape = Shape::Circle { radius_m: 0.7 };
        ShapeTrajectory::new(shape, Heading::FollowsTangent, 1.0, 6.0).unwrap()
    }

    #[test]
    fn each_rate_is_that_of_the_one_below_it() {
        let corrected = Corrected::new(circle(), Correction::new(6.0, &controls(6.0, 0.02)).unwrap());
        let h = 1e-4;
        for n in 1..60 {
            // Between the breaks, where the jerk jumps.
            let time_s = 0.1 * f64::from(n) + 0.013;
            let [before, now, after] =
                [time_s - h, time_s, time_s + h].map(|time_s| corrected.sample(time_s));
            let rate = |from: Twist2, to: Twist2| {
                let by = 1.0 / (2.0 * h);
                Twist2::new(
                    by * (to.vx_m_s - from.vx_m_s),
                    by * (to.vy_m_s - from.vy_m_s),
                    by * (to.w_rad_s - from.w_rad_s),
                )
            };
            let near = |a: Twist2, b: Twist2, most: f64| {
                let off = (a.vx_m_s - b.vx_m_s).hypot(a.vy_m_s - b.vy_m_s) + (a.w_rad_s - b.w_rad_s).abs();
                assert!(off < most, "at {time_s} s: {a:?}, {b:?}");
            };
            let place = |pose: Pose2| Twist2::new(pose.x_m, pose.y_m, pose.heading_rad);
            near(now.twist_in_odom, rate(place(before.odom_from_base), place(after.odom_from_base)), 1e-5);
            near(now.acceleration_in_odom, rate(before.twist_in_odom, after.twist_in_odom), 1e-4);
            near(now.jerk_in_odom, rate(before.acceleration_in_odom, after.acceleration_in_odom), 1e-2);
        }
    }

    #[test]
    fn a_correction_begins_with_nothing_and_both_ends_rest() {
        let corrected = Corrected::new(circle(), Correction::new(6.0, &controls(6.0, 0.02)).unwrap());
        let (first, last) = (corrected.sample(0.0), corrected.sample(6.0));
        assert_eq!(first.odom_from_base, circle().sample(0.0).odom_from_base);
        for end in [first, last] {
            assert!(end.twist_in_odom.vx_m_s.hypot(end.twist_in_odom.vy_m_s) < 1e-12, "{end:?}");
        }
        let end = controls(6.0, 0.02).as_slice()[12].odom_from_base;
        let off = circle().sample(6.0).odom_from_base.inverse().then(last.odom_from_base);
        assert!((off.x_m - end.x_m).hypot(off.y_m - end.y_m) < 1e-12, "{off:?}");
    }

    #[test]
    fn what_belongs_to_another_motion_is_refused_with_the_reason() {
        let refused = |controls: &PathPoints| Correction::new(6.0, controls).unwrap_err();
        assert_eq!(
            refused(&controls(7.0, 0.02)),
            CorrectionError::Duration { expected_s: 6.0, found_s: 7.0 }
        );
        assert!(matches!(refused(&controls(6.0, 0.2)), CorrectionError::TooFar { .. }));
        let mut shifted = controls(6.0, 0.02).as_slice().to_vec();
        shifted[0].odom_from_base.x_m = 0.001;
        assert_eq!(refused(&PathPoints::new(shifted).unwrap()), CorrectionError::Beginning);
        assert!(Correction::new(f64::INFINITY, &controls(6.0, 0.02)).is_err());
    }
}
