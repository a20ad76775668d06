//! From state to state in the shortest time with limited jerk, all axes arriving together (L. Berscheid and T. Kröger, "Jerk-limited
//! Real-time Trajectory Generation with Arbitrary Target States", RSS 2021), by `rsruckig`.
//!
//! Limits of a length become limits of axes: a way that begins and ends along its own direction has them whole, and is straight. Any
//! other way has a part of them along that direction and a part across, so that both together keep the length: the more across the
//! faster its ends move across.

use omnibase_platform::{Pose2, Twist2};
use rsruckig::prelude::{
    IgnoreErrorHandler, InputParameter, Ruckig, RuckigResult, Synchronization, Trajectory as Profiles,
};

use crate::limits::Limits;
use crate::trajectory::{LONGEST_S, Setpoint};

/// Parts of the limits along a way and across it, right triangles, by the part of the limits with which its ends move across at most.
const PARTS: [(f64, [f64; 2]); 3] =
    [(0.02, [0.995, 0.0998]), (0.1, [0.95, 0.312]), (f64::INFINITY, [0.8, 0.6])];
/// What is across by less than this part of the limits is rounding.
const STRAIGHT: f64 = 1e-9;
/// Shorter than that a way has no direction, m.
const NO_WAY_M: f64 = 1e-9;

/// Value, rate and rate of rate of each axis.
pub type AxisStates = [[f64; 3]; 3];

/// Why there is no motion from a state to a state.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoMotion {
    /// Some number isn't finite, or a limit isn't positive.
    #[error("a state or a limit is no number that can be planned with")]
    NotFinite,
    /// The state to come to breaks a limit.
    #[error("the state to come to lies beyond the limits")]
    Beyond,
}

/// A motion from state to state. Planned anew it allocates nothing.
pub struct PointToPoint {
    planner: Ruckig<3, IgnoreErrorHandler>,
    input: InputParameter<3>,
    profiles: Profiles<3>,
    /// Where it began, and the direction of its first axis, rad.
    origin: Pose2,
    along_rad: f64,
    end: Setpoint,
    duration_s: f64,
}

impl std::fmt::Debug for PointToPoint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let PointToPoint { origin, end, duration_s, .. } = self;
        f.debug_struct("PointToPoint")
            .field("origin", origin)
            .field("end", end)
            .field("duration_s", duration_s)
            .finish()
    }
}

impl Default for PointToPoint {
    /// At rest at the origin.
    fn default() -> Self {
        let mut input = InputParameter::new(None);
        input.synchronization = Synchronization::Phase;
        PointToPoint {
            planner: Ruckig::new(None, 1e-3),
            input,
            profiles: Profiles::new(None),
            origin: Pose2::default(),
            along_rad: 0.0,
            end: Setpoint::default(),
            duration_s: 0.0,
        }
    }
}

impl PointToPoint {
    /// Plans from a setpoint to one, both with their speed and acceleration; its jerk doesn't count.
    pub fn plan(&mut self, from: &Setpoint, to: &Setpoint, limits: &Limits) -> Result<(), NoMotion> {
        let way = [
            to.odom_from_base.x_m - from.odom_from_base.x_m,
            to.odom_from_base.y_m - from.odom_from_base.y_m,
        ];
        let along_rad = if way[0].hypot(way[1]) > NO_WAY_M {
            way[1].atan2(way[0])
        } else {
            from.twist_in_odom.vy_m_s.atan2(from.twist_in_odom.vx_m_s)
        };
        let state = |setpoint: &Setpoint| -> AxisStates {
            let (sin, cos) = along_rad.sin_cos();
            let turned = |x: f64, y: f64| [cos * x + sin * y, cos * y - sin * x];
            let (pose, origin) = (&setpoint.odom_from_base, &from.odom_from_base);
            let place = turned(pose.x_m - origin.x_m, pose.y_m - origin.y_m);
            let [speed, rate] = [&setpoint.twist_in_odom, &setpoint.acceleration_in_odom]
                .map(|twist| turned(twist.vx_m_s, twist.vy_m_s));
            let turn = pose.heading_rad - origin.heading_rad;
            [
                [place[0], speed[0], rate[0]],
                [place[1], speed[1], rate[1]],
                [turn, setpoint.twist_in_odom.w_rad_s, setpoint.acceleration_in_odom.w_rad_s],
            ]
        };
        let states = [state(from), state(to)];
        let length = [limits.speed_m_s, limits.acceleration_m_s2, limits.jerk_m_s3];
        let turning = [limits.rate_rad_s, limits.angular_acceleration_rad_s2, limits.angular_jerk_rad_s3];
        let across =
            |[_, [_, speed, rate], _]: &AxisStates| (speed.abs() / length[0]).max(rate.abs() / length[1]);
        let across = across(&states[0]).max(across(&states[1]));
        let parts = PARTS.into_iter().find(|(most, _)| across <= *most).map_or([1.0; 2], |(_, parts)| parts);
        let [along, across] = if across <= STRAIGHT { [1.0; 2] } else { parts };
        let most = [length.map(|most| along * most), length.map(|most| across * most), turning];
        let duration_s = self.plan_axes(states, most)?;
        (self.origin, self.along_rad) = (from.odom_from_base, along_rad);
        (self.end, self.duration_s) = (*to, duration_s);
        Ok(())
    }

    /// Plans three axes between two states within their greatest speeds, accelerations and jerks; how long it takes, s.
    pub fn plan_axes(&mut self, [from, to]: [AxisStates; 2], most: AxisStates) -> Result<f64, NoMotion> {
        let is_number = |numbers: &AxisStates| numbers.as_flattened().iter().all(|number| number.is_finite());
        let is_limit = most.as_flattened().iter().all(|most| *most > 0.0);
        if !(is_number(&from) && is_number(&to) && is_number(&most) && is_limit) {
            return Err(NoMotion::NotFinite);
        }
        for (axis, most) in most.iter().enumerate() {
            let [_, speed, rate] = to[axis];
            // Its acceleration began and ends within the limits, too.
            if speed.abs() + rate * rate / (2.0 * most[2]) > most[0] || rate.abs() > most[1] {
                return Err(NoMotion::Beyond);
            }
            let input = &mut self.input;
            [input.current_position[axis], input.current_velocity[axis], input.current_acceleration[axis]] =
                from[axis];
            [input.target_position[axis], input.target_velocity[axis], input.target_acceleration[axis]] =
                to[axis];
            [input.max_velocity[axis], input.max_acceleration[axis], input.max_jerk[axis]] = *most;
        }
        match self.planner.calculate(&self.input, &mut self.profiles) {
            Ok(RuckigResult::Working | RuckigResult::Finished)
                if self.profiles.get_duration() <= LONGEST_S =>
            {
                Ok(self.profiles.get_duration())
            }
            _ => Err(NoMotion::Beyond),
        }
    }

    /// How long it takes, s.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Where it ends.
    pub fn end(&self) -> Setpoint {
        self.end
    }

    /// The setpoint at a time since its beginning, s; behind its end the state that it came to, as if it rested.
    pub fn sample(&self, time_s: f64) -> Setpoint {
        if time_s.is_nan() || time_s >= self.duration_s {
            return Setpoint::at_rest(self.end.odom_from_base);
        }
        let mut axes = [[0.0; 4]; 3];
        self.profiles.state_to_integrate_from(time_s.max(0.0), &mut 0, |axis, t, p, v, a, j| {
            axes[axis] = [p + t * (v + t * (a / 2.0 + t * j / 6.0)), v + t * (a + t * j / 2.0), a + t * j, j];
        });
        let (sin, cos) = self.along_rad.sin_cos();
        let of = |order: usize| {
            let [along, across, turn] = axes.map(|axis| axis[order]);
            Twist2::new(cos * along - sin * across, sin * along + cos * across, turn)
        };
        let place = of(0);
        Setpoint {
            odom_from_base: Pose2::new(
                self.origin.x_m + place.vx_m_s,
                self.origin.y_m + place.vy_m_s,
                self.origin.heading_rad + place.w_rad_s,
            ),
            twist_in_odom: of(1),
            acceleration_in_odom: of(2),
            jerk_in_odom: of(3),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits {
        speed_m_s: 1.0,
        acceleration_m_s2: 1.5,
        jerk_m_s3: 40.0,
        rate_rad_s: 1.5,
        angular_acceleration_rad_s2: 3.0,
        angular_jerk_rad_s3: 80.0,
    };

    #[test]
    fn a_way_from_rest_is_straight_and_as_fast_as_the_limits_of_its_length() {
        let mut motion = PointToPoint::default();
        let to = Setpoint::at_rest(Pose2::new(3.0, 4.0, 0.5));
        motion.plan(&Setpoint::default(), &to, &LIMITS).unwrap();
        // v/a + a/j and the way at full speed (seven phases).
        let best_s = 1.0 / 1.5 + 1.5 / 40.0 + 5.0;
        assert!((motion.duration_s() - best_s).abs() < 1e-9, "{} {best_s}", motion.duration_s());
        for at in 0..=100 {
            let now = motion.sample(motion.duration_s() * f64::from(at) / 100.0);
            let pose = now.odom_from_base;
            assert!((4.0 * pose.x_m - 3.0 * pose.y_m).abs() < 1e-9, "{pose:?}");
            assert!((pose.x_m / 3.0 - pose.heading_rad / 0.5).abs() < 1e-9, "{pose:?}");
        }
    }

    #[test]
    fn from_a_moving_state_it_begins_as_it_is_keeps_the_limits_and_ends_there() {
        let mut motion = PointToPoint::default();
        let from = Setpoint {
            odom_from_base: Pose2::new(0.3, -0.2, 0.1),
            twist_in_odom: Twist2::new(0.3, 0.5, -0.4),
            acceleration_in_odom: Twist2::new(-0.7, 0.2, 1.0),
            ..Setpoint::default()
        };
        let to = Setpoint::at_rest(Pose2::new(1.0, -1.0, 1.0));
        motion.plan(&from, &to, &LIMITS).unwrap();
        let first = motion.sample(0.0);
        let near = |a: Twist2, b: Twist2| (a.vx_m_s - b.vx_m_s).hypot(a.vy_m_s - b.vy_m_s) < 1e-9;
        assert!(near(first.twist_in_odom, from.twist_in_odom));
        assert!(near(first.acceleration_in_odom, from.acceleration_in_odom));
        let last = motion.sample(motion.duration_s() * (1.0 - 1e-9));
        assert!(last.odom_from_base.distance_m(to.odom_from_base) < 1e-6);
        for at in 0..1000 {
            let now = motion.sample(motion.duration_s() * f64::from(at) / 1000.0);
            assert!(now.acceleration_in_odom.speed_m_s() < 1.5 + 1e-9);
            assert!(now.jerk_in_odom.speed_m_s() < 40.0 + 1e-9);
            assert!(now.twist_in_odom.speed_m_s() < 1.0 + 1e-9);
        }
    }

    #[test]
    fn what_is_no_number_or_beyond_the_limits_is_refused_and_changes_nothing() {
        let mut motion = PointToPoint::default();
        let to = Setpoint::at_rest(Pose2::new(1.0, 0.0, 0.0));
        motion.plan(&Setpoint::default(), &to, &LIMITS).unwrap();
        let before_s = motion.duration_s();
        let nan = Setpoint::at_rest(Pose2::new(f64::NAN, 0.0, 0.0));
        assert_eq!(motion.plan(&Setpoint::default(), &nan, &LIMITS), Err(NoMotion::NotFinite));
        let none = Limits { jerk_m_s3: 0.0, ..LIMITS };
        assert_eq!(motion.plan(&Setpoint::default(), &to, &none), Err(NoMotion::NotFinite));
        let fast = Setpoint { twist_in_odom: Twist2::new(2.0, 0.0, 0.0), ..to };
        assert_eq!(motion.plan(&Setpoint::default(), &fast, &LIMITS), Err(NoMotion::Beyond));
        assert_eq!(motion.duration_s(), before_s);
    }
}
