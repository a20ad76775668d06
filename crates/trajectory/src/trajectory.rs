//! What every trajectory gives: a setpoint for a time.

use omnibase_platform::{Pose2, Twist2};

/// The longest motion, and the latest time of a path point, in s: eleven days. Beyond it nobody waits for the end, and
/// the time of a cycle would be lost in rounding.
pub const LONGEST_S: f64 = 1e6;

/// Where the platform shall be, and how it shall move there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Setpoint {
    /// The pose. The heading is continuous, not wrapped.
    pub odom_from_base: Pose2,
    /// Its rate: velocity in odom.
    pub twist_in_odom: Twist2,
    /// The rate of the twist, in m/s² and rad/s².
    pub acceleration_in_odom: Twist2,
    /// The rate of the acceleration, in m/s³ and rad/s³.
    pub jerk_in_odom: Twist2,
}

impl Setpoint {
    /// A setpoint at rest.
    pub fn at_rest(odom_from_base: Pose2) -> Setpoint {
        Setpoint { odom_from_base, ..Setpoint::default() }
    }

    /// A setpoint of three axes (x, y, heading), each with its value and its first three derivatives.
    pub(crate) fn from_axes(axes: [[f64; 4]; 3]) -> Setpoint {
        let twist = |order: usize| Twist2::new(axes[0][order], axes[1][order], axes[2][order]);
        Setpoint {
            odom_from_base: Pose2::new(axes[0][0], axes[1][0], axes[2][0]),
            twist_in_odom: twist(1),
            acceleration_in_odom: twist(2),
            jerk_in_odom: twist(3),
        }
    }
}

/// A motion over time, at rest before its beginning (time 0) and after its end.
pub trait Trajectory {
    /// How long it takes, in s; infinite where it has no end.
    fn duration_s(&self) -> f64;

    /// The setpoint at a time since its beginning, in s; before and after it stands still at the ends.
    ///
    /// Allocates nothing and cannot fail.
    fn sample(&self, time_s: f64) -> Setpoint;

    /// The times between pieces, with beginning and end, rising: only there may derivatives jump. Of a motion without an
    /// end those of its beginning and of what then repeats.
    fn breaks_s(&self) -> Vec<f64> {
        vec![0.0, self.duration_s()]
    }

    /// When it passes the start and the end of its way with a speed, in s; `None` where it rests there.
    fn passes_s(&self) -> [Option<f64>; 2] {
        [None; 2]
    }
}

impl<T: Trajectory + ?Sized> Trajectory for Box<T> {
    fn duration_s(&self) -> f64 {
        (**self).duration_s()
    }

    fn sample(&self, time_s: f64) -> Setpoint {
        (**self).sample(time_s)
    }

    fn breaks_s(&self) -> Vec<f64> {
        (**self).breaks_s()
    }

    fn passes_s(&self) -> [Option<f64>; 2] {
        (**self).passes_s()
    }
}

/// A trajectory moved to another place, and slowed or quickened as a whole.
#[derive(Clone, Debug)]
pub struct Placed<T> {
    trajectory: T,
    odom_from_start: Pose2,
    stretch: f64,
}

impl<T: Trajectory> Placed<T> {
    /// The trajectory with its own coordinates as odom.
    pub fn new(trajectory: T) -> Placed<T> {
        Placed { trajectory, odom_from_start: Pose2::default(), stretch: 1.0 }
    }

    /// Moves it so that it begins at a pose, for instance where the platform stands.
    #[must_use]
    pub fn beginning_at(mut self, odom_from_base: Pose2) -> Placed<T> {
        self.odom_from_start = odom_from_base.then(self.trajectory.sample(0.0).odom_from_base.inverse());
        self
    }

    /// Takes `factor` times as long, along the same path; speeds fall by the factor, jerks by its cube.
    ///
    /// A factor that is no positive number is taken as 1.
    #[must_use]
    pub fn stretched(mut self, factor: f64) -> Placed<T> {
        if factor.is_finite() && factor > 0.0 {
            self.stretch *= factor;
        }
        self
    }
}

impl<T: Trajectory> Trajectory for Placed<T> {
    fn duration_s(&self) -> f64 {
        self.trajectory.duration_s() * self.stretch
    }

    fn sample(&self, time_s: f64) -> Setpoint {
        let own = self.trajectory.sample(time_s / self.stretch);
        let turn_rad = self.odom_from_start.heading_rad;
        let rate = 1.0 / self.stretch;
        Setpoint {
            odom_from_base: self.odom_from_start.then(own.odom_from_base),
            twist_in_odom: own.twist_in_odom.rotated(turn_rad).scaled(rate),
            acceleration_in_odom: own.acceleration_in_odom.rotated(turn_rad).scaled(rate * rate),
            jerk_in_odom: own.jerk_in_odom.rotated(turn_rad).scaled(rate * rate * rate),
        }
    }

    fn breaks_s(&self) -> Vec<f64> {
        self.trajectory.breaks_s().into_iter().map(|time_s| time_s * self.stretch).collect()
    }

    fn passes_s(&self) -> [Option<f64>; 2] {
        self.trajectory.passes_s().map(|time_s| Some(time_s? * self.stretch))
    }
}
