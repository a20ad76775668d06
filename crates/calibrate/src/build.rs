//! What a platform is like, as a file says or as it was found, and how well that is known.

use omnibase_platform::{GeometrySigmas, Pose2, Wheel};

/// A platform as it is built.
#[derive(Clone, Debug, PartialEq)]
pub struct Build {
    /// Its wheels, in order.
    pub wheels: Vec<Wheel>,
    /// Slip ratio of the treads over the ratio of force to load; 0: none.
    pub creep: f64,
    /// Force against the turning of a wheel's rollers over its load, for that creep: taken as known.
    pub roller_resistance: f64,
    /// Where its sensor of poses is.
    pub sensor: SensorMount,
    /// What its gyro shows too much, as a share.
    pub gyro_scale: f64,
}

/// Where a sensor of poses is, and how late it is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorMount {
    /// Its place and heading in base.
    pub base_from_sensor: Pose2,
    /// How much later than the truth its instants are, s.
    pub delay_s: f64,
}

/// How well a platform is known before it is measured, and how well it keeps to its wheels: standard deviations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerances {
    /// Of each wheel.
    pub wheel: GeometrySigmas,
    /// Of the creep; 0: it isn't solved for.
    pub creep: f64,
    /// Of each coordinate of the sensor's place, m.
    pub sensor_m: f64,
    /// Of its heading, rad.
    pub sensor_rad: f64,
    /// Of its delay, s.
    pub delay_s: f64,
    /// Of the gyro's scale.
    pub gyro_scale: f64,
    /// Of the gyro's bias, rad/s.
    pub gyro_bias_rad_s: f64,
    /// Of the gyro's rate, as a density, rad/s/√Hz.
    pub gyro_density: f64,
    /// Of the way on an uneven floor, m²/m.
    pub way_m2_per_m: f64,
    /// Likewise of a turn in place, m²/rad.
    pub way_m2_per_rad: f64,
    /// Of the heading, rad²/m.
    pub turn_rad2_per_m: f64,
    /// Of the heading, rad²/rad.
    pub turn_rad2_per_rad: f64,
}

impl Default for Tolerances {
    /// A robot as a workshop builds it ([`GeometrySigmas`]), a sensor mounted by eye, a gyro of a telephone.
    fn default() -> Self {
        let way = omnibase_platform::CovarianceSettings::default();
        Tolerances {
            wheel: way.geometry,
            creep: 0.02,
            sensor_m: 5e-3,
            sensor_rad: 0.03,
            delay_s: 0.03,
            gyro_scale: 0.01,
            gyro_bias_rad_s: 0.01,
            gyro_density: 2e-4,
            way_m2_per_m: way.position_per_m,
            way_m2_per_rad: way.position_per_rad,
            turn_rad2_per_m: way.heading_per_m,
            turn_rad2_per_rad: way.heading_per_rad,
        }
    }
}
