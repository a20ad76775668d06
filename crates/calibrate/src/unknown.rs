//! What is solved for.

use nalgebra::DVector;
use omnibase_platform::{Pose2, Wheel};

use crate::build::{Build, Tolerances};

/// One unknown number. Wheels and runs count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Unknown {
    /// A wheel's radius, as a share of the expected one.
    Radius(usize),
    /// The direction in which a wheel is mounted, counter-clockwise, rad.
    Direction(usize),
    /// Its place across its force, to the right: the lever arm, m.
    Across(usize),
    /// Its place along its force, m: no motion shows it.
    Along(usize),
    /// Creep of the treads.
    Creep,
    /// The sensor's place along x of base, m.
    SensorX,
    /// The sensor's place along y of base, m.
    SensorY,
    /// The sensor's heading in base, rad.
    SensorHeading,
    /// The sensor's delay, s.
    Delay,
    /// What the gyro shows too much, as a share.
    GyroScale,
    /// What the gyro shows at rest in a run, rad/s.
    GyroBias(usize),
}

/// Which of them a dataset is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Asked {
    pub(crate) wheels: usize,
    pub(crate) runs: usize,
    pub(crate) has_poses: bool,
    pub(crate) has_gyro: bool,
    pub(crate) has_creep: bool,
}

impl Asked {
    /// All of them, in the order in which they stand in vectors.
    pub(crate) fn unknowns(self) -> Vec<Unknown> {
        let mut all = Vec::new();
        for wheel in 0..self.wheels {
            all.extend([
                Unknown::Radius(wheel),
                Unknown::Direction(wheel),
                Unknown::Across(wheel),
                Unknown::Along(wheel),
            ]);
        }
        if self.has_creep {
            all.push(Unknown::Creep);
        }
        if self.has_poses {
            all.extend([Unknown::SensorX, Unknown::SensorY, Unknown::SensorHeading, Unknown::Delay]);
        }
        if self.has_gyro {
            all.push(Unknown::GyroScale);
            all.extend((0..self.runs).map(Unknown::GyroBias));
        }
        all
    }
}

impl Unknown {
    /// What it is, in words; the wheels' names are the caller's.
    pub fn words(self, wheel_names: &[String]) -> String {
        let of = |wheel: usize, what: &str| {
            let name = wheel_names.get(wheel).map_or("?", String::as_str);
            format!("{name} {what}")
        };
        match self {
            Unknown::Radius(wheel) => of(wheel, "radius"),
            Unknown::Direction(wheel) => of(wheel, "direction"),
            Unknown::Across(wheel) => of(wheel, "place across its force"),
            Unknown::Along(wheel) => of(wheel, "place along its force"),
            Unknown::Creep => "creep".to_owned(),
            Unknown::SensorX => "sensor x".to_owned(),
            Unknown::SensorY => "sensor y".to_owned(),
            Unknown::SensorHeading => "sensor heading".to_owned(),
            Unknown::Delay => "sensor delay".to_owned(),
            Unknown::GyroScale => "gyro scale".to_owned(),
            Unknown::GyroBias(run) => format!("gyro bias, run {}", run + 1),
        }
    }

    /// How well it is known beforehand.
    pub fn sigma(self, tolerances: &Tolerances) -> f64 {
        match self {
            Unknown::Radius(_) => tolerances.wheel.radius_share,
            Unknown::Direction(_) => tolerances.wheel.direction_rad,
            Unknown::Across(_) | Unknown::Along(_) => tolerances.wheel.position_m,
            Unknown::Creep => tolerances.creep,
            Unknown::SensorX | Unknown::SensorY => tolerances.sensor_m,
            Unknown::SensorHeading => tolerances.sensor_rad,
            Unknown::Delay => tolerances.delay_s,
            Unknown::GyroScale => tolerances.gyro_scale,
            Unknown::GyroBias(_) => tolerances.gyro_bias_rad_s,
        }
    }

    /// Adds an amount of it to a build.
    pub fn add_to(self, build: &mut Build, expected: &Build, amount: f64) {
        match self {
            Unknown::Radius(wheel) => {
                build.wheels[wheel].radius_m += amount * expected.wheels[wheel].radius_m;
            }
            Unknown::Direction(wheel) => turn(&mut build.wheels[wheel], amount),
            Unknown::Across(wheel) => {
                let [x, y] = along(&expected.wheels[wheel]);
                shift(&mut build.wheels[wheel], [amount * y, -amount * x]);
            }
            Unknown::Along(wheel) => {
                let [x, y] = along(&expected.wheels[wheel]);
                shift(&mut build.wheels[wheel], [amount * x, amount * y]);
            }
            Unknown::Creep => build.creep += amount,
            Unknown::SensorX => build.sensor.base_from_sensor.x_m += amount,
            Unknown::SensorY => build.sensor.base_from_sensor.y_m += amount,
            Unknown::SensorHeading => build.sensor.base_from_sensor.heading_rad += amount,
            Unknown::Delay => build.sensor.delay_s += amount,
            Unknown::GyroScale => build.gyro_scale += amount,
            // It is the run's, not the robot's.
            Unknown::GyroBias(_) => {}
        }
    }
}

/// The unit vector of a wheel's force.
pub(crate) fn along(wheel: &Wheel) -> [f64; 2] {
    let [x, y] = wheel.force_direction;
    let length = x.hypot(y);
    [x / length, y / length]
}

fn turn(wheel: &mut Wheel, angle_rad: f64) {
    let (sin, cos) = angle_rad.sin_cos();
    let turned = |[x, y]: [f64; 2]| [cos * x - sin * y, sin * x + cos * y];
    wheel.rolling_direction = turned(wheel.rolling_direction);
    wheel.force_direction = turned(wheel.force_direction);
}

fn shift(wheel: &mut Wheel, by_m: [f64; 2]) {
    wheel.position_m[0] += by_m[0];
    wheel.position_m[1] += by_m[1];
}

/// The expected build with amounts of unknowns added to it.
pub(crate) fn build_at(expected: &Build, unknowns: &[Unknown], amounts: &DVector<f64>) -> Build {
    let mut build = expected.clone();
    for (unknown, amount) in unknowns.iter().zip(amounts.iter()) {
        unknown.add_to(&mut build, expected, *amount);
    }
    build
}

/// Where a base frame is that another one calls `base_from_new`: what each unknown changes by, to first order, when the whole
/// body is described in the new frame. Used for what no motion shows.
pub(crate) fn moved_frame(expected: &Build, unknowns: &[Unknown], base_from_new: Pose2) -> DVector<f64> {
    let Pose2 { x_m, y_m, heading_rad } = base_from_new;
    let velocity = |[x, y]: [f64; 2]| [-x_m + heading_rad * y, -y_m - heading_rad * x];
    let amount = |unknown: &Unknown| match *unknown {
        Unknown::Direction(_) | Unknown::SensorHeading => -heading_rad,
        Unknown::Across(wheel) | Unknown::Along(wheel) => {
            let wheel = &expected.wheels[wheel];
            let ([ax, ay], [vx, vy]) = (along(wheel), velocity(wheel.position_m));
            match unknown {
                Unknown::Across(_) => vx * ay - vy * ax,
                _ => vx * ax + vy * ay,
            }
        }
        Unknown::SensorX | Unknown::SensorY => {
            let place = expected.sensor.base_from_sensor;
            let v = velocity([place.x_m, place.y_m]);
            if *unknown == Unknown::SensorX { v[0] } else { v[1] }
        }
        _ => 0.0,
    };
    DVector::from_iterator(unknowns.len(), unknowns.iter().map(amount))
}
