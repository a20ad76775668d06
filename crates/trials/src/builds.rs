//! Robots built with the tolerances of their file: how far they truly are from where they believe to be, against what
//! their covariance says.
//!
//! A build draws wheel radii, mountings and places, where the robot stands at its start, and how uneven its floor is, by the
//! standard deviations in the file's `[estimator]`. Wheels and their slip are the simulator's. Of uneven floors the
//! simulator knows nothing: they shift and turn the body a little in each cycle, as [`CovarianceSettings`] says.

use omnibase_fusion::{Sensor, SensorKind};
use omnibase_platform::{CovarianceSettings, GeometrySigmas, Pose2, wrap_angle_rad};
use omnibase_robot::config::Synchronisation;
use omnibase_robot::estimators::covariance_settings;
use omnibase_robot::signals::PlatformState;
use omnibase_robot::{Phase, RequestKind, RobotPlan};
use omnibase_robot_sim::WheelParameters;

use crate::approaches::{Matrix, Random, Vector, root, sigmas};
use crate::framed::EIGHT_S;
use crate::{Trial, robots};

/// A robot on a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Case {
    /// The robot: `bmm` or `mecanum`.
    pub robot: &'static str,
    /// The path: `circle`, `eight` or `square`.
    pub path: &'static str,
}

/// What wheels a robot has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wheels {
    /// As drawn by the tolerances of its file.
    Drawn,
    /// Those of its file.
    Exact,
}

/// The creep that the simulated treads have ([`omnibase_robot_sim::Contact`]), as a line of `[estimator]`.
pub const CREEP_TOLD: &str = "creep = 0.025";

/// Places of a path at which robot and truth are compared: after each quarter of its time, the last a second later.
pub const PLACES: usize = 4;

/// Where a robot truly was, and where it believed to be.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PoseError {
    /// True less believed: x and y in m, heading in rad.
    pub error: Vector,
    /// Standard deviations of the three.
    pub sigmas: Vector,
    /// Square of the error's length in standard deviations, over all directions (normalised estimation error squared):
    /// 3 on average where the covariance is right.
    pub nees: f64,
}

impl PoseError {
    pub(crate) fn new(state: &PlatformState, truth: Pose2) -> PoseError {
        let believed = state.odom_from_body;
        let error = [
            truth.x_m - believed.x_m,
            truth.y_m - believed.y_m,
            wrap_angle_rad(truth.heading_rad - believed.heading_rad),
        ];
        let [xx, xy, xh, yy, yh, hh] = state.covariance;
        let covariance: Matrix = [[xx, xy, xh], [xy, yy, yh], [xh, yh, hh]];
        let nees = sigmas(&root(&covariance), &error).powi(2);
        PoseError { error, sigmas: [xx, yy, hh].map(f64::sqrt), nees }
    }

    /// How far away it is, m.
    pub fn distance_m(&self) -> f64 {
        self.error[0].hypot(self.error[1])
    }

    /// The most that x, y or heading are off by, in standard deviations.
    pub fn most_sigmas(&self) -> f64 {
        self.error.iter().zip(self.sigmas).fold(0.0, |most, (error, sigma)| most.max(error.abs() / sigma))
    }

    /// Which of x, y and heading are off by more than three standard deviations; chance does so with 0.27 % of each.
    pub fn outside(&self) -> [bool; 3] {
        std::array::from_fn(|axis| self.error[axis].abs() > 3.0 * self.sigmas[axis])
    }
}

/// One drive, in two worlds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Driven {
    /// Start and floor as the file says.
    pub drawn: [PoseError; PLACES],
    /// From exactly its start, on the simulator's even floor: of the file's tolerances only the wheels' count.
    pub even: [PoseError; PLACES],
}

impl Case {
    /// All robots on all paths.
    pub fn all() -> Vec<Case> {
        let paths = ["circle", "eight", "square"];
        ["bmm", "mecanum"].iter().flat_map(|robot| paths.map(|path| Case { robot, path })).collect()
    }

    /// The robot's plan, with these lines of `[estimator]` in its file.
    pub fn plan(&self, estimator: &str) -> RobotPlan {
        let robot = if self.robot == "bmm" { robots::BMM } else { robots::MECANUM };
        let reference = match self.path {
            "circle" => robots::CIRCLE.to_owned(),
            "eight" => robots::eight(robot, EIGHT_S, EIGHT_S),
            _ => robots::SQUARE.to_owned(),
        };
        crate::plan_of(&format!("{robot}{reference}\n[estimator]\n{estimator}\n"))
    }
}

/// Drives a plan's whole path with the robot of a seed.
///
/// # Panics
/// Where the robot can't be made or enabled, or doesn't come to the end of its path.
pub fn drive(mut plan: RobotPlan, wheels: Wheels, seed: u64) -> Driven {
    let settings = covariance_settings(&plan.estimator);
    let mut random = Random::new(seed ^ 0xB111_D000_0000_0000);
    if wheels == Wheels::Drawn {
        draw_sensors(&mut plan, seed);
    }
    let mut trial = Trial::on_machine(plan, |machine| {
        if wheels == Wheels::Drawn {
            for drive in &mut machine.wheels {
                build(&mut drive.wheel, &settings.geometry, &mut random);
            }
        }
    });
    trial.enable();
    let cycle_s = trial.plan.bus.cycle_ns as f64 * 1e-9;
    let cycles = (trial.robot.reference_duration_s().unwrap_or_default() / cycle_s) as u64;
    let mut floor = Floor::new(&trial, settings, random);
    trial.step(Some(RequestKind::Track));
    let mut driven = Driven::default();
    let mut number = 0;
    while trial.robot.phase() == Phase::Tracking {
        trial.step(None);
        floor.go_on(&trial);
        number += 1;
        let quarter = (number * PLACES as u64 / cycles.max(1)) as usize;
        if number * PLACES as u64 % cycles.max(1) < PLACES as u64 && (1..PLACES).contains(&quarter) {
            floor.look(&trial, &mut driven, quarter - 1);
        }
    }
    assert_eq!(trial.robot.record().stop_reason, Default::default(), "seed {seed}");
    for _ in 0..1000 {
        trial.step(None);
        floor.go_on(&trial);
    }
    floor.look(&trial, &mut driven, PLACES - 1);
    driven
}

/// Simulated sensors err as their own tables say that they may.
fn draw_sensors(plan: &mut RobotPlan, seed: u64) {
    let mut random = Random::new(seed ^ 0x5E45_0125_0000_0000);
    // The trial's drives read their encoders a whole cycle before.
    if !plan.sensors.is_empty() {
        plan.bus.synchronisation = Synchronisation::FreeRun;
    }
    for table in &mut plan.simulation.sensor {
        let known = plan.sensors.iter().find(|sensor| table.name.as_ref() == Some(&sensor.name));
        let Some(Sensor { kind, bias_sigma, bias_walk, scale_sigma, direction_sigma_rad, .. }) =
            known.map(|known| known.sensor)
        else {
            continue;
        };
        table.seed = Some(table.seed.unwrap_or(1).wrapping_add(1000 * seed));
        table.bias_rad_s = Some(bias_sigma * random.normal());
        table.bias_walk_rad_s = Some(bias_walk);
        table.scale_error = Some(scale_sigma * random.normal());
        // Of those that tell speeds: where poses are taken has to be known.
        table.heading_error_rad =
            Some(direction_sigma_rad * random.normal()).filter(|_| kind != SensorKind::Pose);
    }
}

/// Another wheel than the file says.
pub(crate) fn build(wheel: &mut WheelParameters, sigmas: &GeometrySigmas, random: &mut Random) {
    wheel.radius_m *= 1.0 + sigmas.radius_share * random.normal();
    let (sin, cos) = (sigmas.direction_rad * random.normal()).sin_cos();
    let turned = |[x, y]: [f64; 2]| [cos * x - sin * y, sin * x + cos * y];
    wheel.rolling_direction = turned(wheel.rolling_direction);
    wheel.force_direction = turned(wheel.force_direction);
    for coordinate in &mut wheel.position_m {
        *coordinate += sigmas.position_m * random.normal();
    }
}

/// Start and floor as drawn: where the body truly is in them.
struct Floor {
    settings: CovarianceSettings,
    random: Random,
    /// As the simulator has it, at the present measurements.
    even: Pose2,
    truth: Pose2,
}

impl Floor {
    fn new(trial: &Trial, settings: CovarianceSettings, mut random: Random) -> Floor {
        let even = trial.measured_pose();
        let truth = shifted(even, [settings.initial_m2, settings.initial_rad2], &mut random);
        Floor { settings, random, even, truth }
    }

    /// The body's next step, and by how much the floor shifts it.
    fn go_on(&mut self, trial: &Trial) {
        let now = trial.measured_pose();
        let step = self.even.inverse().then(now);
        let (way_m, turn_rad) = (step.x_m.hypot(step.y_m), wrap_angle_rad(step.heading_rad).abs());
        let CovarianceSettings { position_per_m, position_per_rad, heading_per_m, heading_per_rad, .. } =
            self.settings;
        let position_m2 = position_per_m * way_m + position_per_rad * turn_rad;
        let heading_rad2 = heading_per_m * way_m + heading_per_rad * turn_rad;
        self.truth = shifted(self.truth.then(step), [position_m2, heading_rad2], &mut self.random);
        self.even = now;
    }

    fn look(&self, trial: &Trial, driven: &mut Driven, place: usize) {
        let state = &trial.robot.record().state;
        driven.drawn[place] = PoseError::new(state, self.truth);
        driven.even[place] = PoseError::new(state, self.even);
    }
}

/// A pose off by chance, with these variances of each coordinate, m², and of the heading, rad².
fn shifted(pose: Pose2, [position_m2, heading_rad2]: [f64; 2], random: &mut Random) -> Pose2 {
    Pose2 {
        x_m: pose.x_m + position_m2.sqrt() * random.normal(),
        y_m: pose.y_m + position_m2.sqrt() * random.normal(),
        heading_rad: pose.heading_rad + heading_rad2.sqrt() * random.normal(),
    }
}

/// The bounds between which the mean of so many robots' NEES lies 19 times out of 20: χ² of three each, its quantiles by
/// Wilson and Hilferty's cube (*Proc. Nat. Acad. Sci.* 17, 1931).
pub fn nees_band(robots: usize) -> [f64; 2] {
    let degrees = 3.0 * robots as f64;
    let spread = 2.0 / (9.0 * degrees);
    [-1.959_964, 1.959_964].map(|sigma: f64| 3.0 * (1.0 - spread + sigma * spread.sqrt()).powi(3))
}

/// What so many robots came to at one place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// Mean of the NEES.
    pub nees: f64,
    /// Robots whose true x, y and heading were outside of three standard deviations.
    pub outside: [usize; 3],
    /// Median of the distance between truth and belief, m.
    pub median_m: f64,
    /// Mean of the square of each error over its standard deviation: 1 where the covariance is right.
    pub squares: Vector,
}

impl Summary {
    /// Of the same place of all robots.
    pub fn of(places: &[PoseError]) -> Summary {
        let count = places.len().max(1) as f64;
        let mut distances: Vec<f64> = places.iter().map(PoseError::distance_m).collect();
        distances.sort_by(f64::total_cmp);
        Summary {
            nees: places.iter().map(|place| place.nees).sum::<f64>() / count,
            outside: std::array::from_fn(|axis| places.iter().filter(|place| place.outside()[axis]).count()),
            median_m: distances.get(places.len() / 2).copied().unwrap_or_default(),
            squares: std::array::from_fn(|axis| {
                places.iter().map(|place| (place.error[axis] / place.sigmas[axis]).powi(2)).sum::<f64>()
                    / count
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::nees_band;

    #[test]
    fn the_band_is_that_of_the_tables() {
        // χ² of 3, 30 and 180 degrees at 2.5 % and 97.5 %, from tables; the cube is within 1 % from 30 on.
        for (robots, low, high) in [(10, 16.791, 46.979), (60, 144.741, 219.044)] {
            let [found_low, found_high] = nees_band(robots).map(|mean| mean * robots as f64);
            assert!(
                (found_low / low - 1.0).abs() < 2e-3 && (found_high / high - 1.0).abs() < 2e-3,
                "{robots}"
            );
        }
    }
}
