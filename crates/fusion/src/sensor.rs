//! What a sensor says, where it is mounted and how well it knows.

use omnibase_platform::{Pose2, covariance_fault};

/// Sensors that a filter can have.
pub const MAX_SENSORS: usize = 6;
/// Those of them that tell speeds: each has two errors of its own that the filter learns.
pub const MAX_RATES: usize = 4;

/// What a sensor tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SensorKind {
    /// How fast the platform turns: a gyro. Its errors are a bias that wanders, and a scale.
    Turn,
    /// That, and how it is accelerated along its own axes, gravity's share on a slope included: a gyro with an accelerometer.
    Inertial,
    /// How fast the floor passes below it, along its own axes: a mouse. Its errors are a scale, and the direction in which
    /// it is mounted.
    Flow,
    /// Both of the above, along its own axes: visual odometry. Its errors are those of flow.
    Twist,
    /// Where it is in map.
    Pose,
}

impl SensorKind {
    /// Whether it tells how fast the platform turns by itself, whatever the floor does.
    pub fn is_gyro(self) -> bool {
        matches!(self, SensorKind::Turn | SensorKind::Inertial)
    }
}

/// A sensor as a filter knows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor {
    /// What it tells.
    pub kind: SensorKind,
    /// Where it is mounted.
    pub body_from_sensor: Pose2,
    /// Noise of a single reading, standard deviations: x, y and turn, in m/s, or m and rad; of a gyro the turn
    /// in rad/s, and of an inertial sensor behind it both accelerations in m/s². A pose that comes with
    /// a covariance of its own has that added.
    pub sigma: [f64; 3],
    /// Standard deviation of a gyro's bias at the start, rad/s.
    pub bias_sigma: f64,
    /// How that wanders, rad/s in the root of a second.
    pub bias_walk: f64,
    /// Standard deviation of the scale.
    pub scale_sigma: f64,
    /// Standard deviation of the direction in which flow and twist are mounted, rad.
    pub direction_sigma_rad: f64,
    /// It counts as silent when nothing was heard for so long, ns.
    pub silent_ns: u64,
}

impl Sensor {
    /// One of a kind, as it is where nobody says more: a MEMS gyro of the better sort, a gaming mouse's chip, a camera, motion
    /// capture; in the middle of the platform.
    pub fn of(kind: SensorKind) -> Sensor {
        let is_gyro = kind.is_gyro();
        Sensor {
            kind,
            body_from_sensor: Pose2::default(),
            sigma: match kind {
                SensorKind::Turn => [0.005, 0.0, 0.0],
                SensorKind::Inertial => [0.005, 0.05, 0.05],
                SensorKind::Flow => [0.02, 0.02, 0.0],
                SensorKind::Twist => [0.02, 0.02, 0.005],
                SensorKind::Pose => [0.002, 0.002, 0.004],
            },
            bias_sigma: if is_gyro { 0.02 } else { 0.0 },
            bias_walk: if is_gyro { 3e-6 } else { 0.0 },
            scale_sigma: if is_gyro { 0.005 } else { 0.02 },
            direction_sigma_rad: 0.02,
            silent_ns: 300_000_000,
        }
    }
}

/// What a sensor said at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reading {
    /// Of a gyro, rad/s.
    Turn(f64),
    /// Of an inertial sensor, rad/s and m/s² along its own axes.
    Inertial {
        /// How fast it turns.
        turn: f64,
        /// How it is accelerated.
        acceleration: [f64; 2],
    },
    /// Of a flow sensor, along its own axes, m/s.
    Flow([f64; 2]),
    /// Along its own axes, m/s and rad/s.
    Twist([f64; 3]),
    /// Of the sensor in map, with the covariance that came with it: xx, xy, xψ, yy, yψ, ψψ in m², m·rad and rad².
    Pose {
        /// The pose.
        map_from_sensor: Pose2,
        /// Its covariance; zeros where the sensor's own noise says all.
        covariance: [f64; 6],
    },
}

impl Reading {
    /// Whether it is of a kind, and every number one that can be: no further away than the Moon, and a covariance that is one.
    pub fn is_of(&self, kind: SensorKind) -> bool {
        match (self, kind) {
            (Reading::Turn(turn), SensorKind::Turn) => can_be(*turn),
            (Reading::Inertial { turn, acceleration: [x, y] }, SensorKind::Inertial) => {
                [*turn, *x, *y].into_iter().all(can_be)
            }
            (Reading::Flow(flow), SensorKind::Flow) => flow.iter().copied().all(can_be),
            (Reading::Twist(twist), SensorKind::Twist) => twist.iter().copied().all(can_be),
            (Reading::Pose { map_from_sensor, covariance }, SensorKind::Pose) => {
                let Pose2 { x_m, y_m, heading_rad } = *map_from_sensor;
                [x_m, y_m, heading_rad].into_iter().chain(*covariance).all(can_be)
                    && covariance_fault(covariance).is_none()
            }
            _ => false,
        }
    }
}

/// Numbers beyond it are no measurement, in any unit.
const GREATEST: f64 = 4e8;

fn can_be(value: f64) -> bool {
    value.abs() <= GREATEST
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_whose_covariance_is_none_is_no_reading() {
        let is_reading = |covariance| {
            let map_from_sensor = Pose2::new(0.5, 0.2, 0.1);
            Reading::Pose { map_from_sensor, covariance }.is_of(SensorKind::Pose)
        };
        assert!(is_reading([0.0; 6]) && is_reading([1e-6, 1e-7, 0.0, 1e-6, 0.0, 1e-5]));
        let one = [1e-6, 0.0, 0.0, 1e-6, 0.0, 1e-6];
        for (at, wrong) in [(1, 1.0), (2, -1e-5), (3, -1e-9), (4, f64::NAN), (5, f64::INFINITY)] {
            let mut covariance = one;
            covariance[at] = wrong;
            assert!(!is_reading(covariance), "{covariance:?}");
        }
        // Three pairs that can be, but not together.
        assert!(!is_reading([1.0, 0.9, 0.9, 1.0, -0.9, 1.0]));
    }
}
