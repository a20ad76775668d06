//! Robots built with the tolerances of their file and with sensors: how far they truly are from where they should be.

use omnibase_platform::wrap_angle_rad;
use omnibase_robot::config::Synchronisation;
use omnibase_robot::estimators::covariance_settings;
use omnibase_robot::{Phase, RequestKind, RobotPlan};

use crate::approaches::Random;
use crate::{Trial, builds, robots};

/// What tells of the platform's motion beside its wheels.
pub const SETS: [&str; 5] = ["wheels", "gyro", "gyro and mice", "gyro, mice and poses", "imu"];
/// The place of the set whose gyro tells accelerations, too.
const IMU_SET: usize = 4;
/// What it drives on, and with.
pub const FLOORS: [&str; 5] = ["0.5", "0.2", "patches", "slope of 1°", "40 kg off centre"];
/// Where to, within a minute at about 0.5 m/s.
pub const PATHS: [&str; 3] = ["square", "circle", "eight"];

/// It rests for so long before it drives, s: as the guide says of gyros.
const REST_S: u64 = 30;
/// A gyro at the middle, as the guide says which: 0.0036 °/s in the root of a hertz.
pub(crate) const GYRO: &str = "[[source]]\nname = \"imu\"\ninput = [{ name = \"turn\", unit = \"rad/s\" }]\n\n\
                    [[sensor]]\nname = \"gyro\"\nkind = \"gyro\"\nfrom = \"imu.turn\"\nsigma_rad_s = 0.002\n\n\
                    [[simulation.sensor]]\nname = \"gyro\"\nbias_rad_s = 0.01\nbias_walk_rad_s = 3e-6\nscale_error = 0.002\n\
                    quantum = 1e-4\n";

/// The same with accelerations, of a bias that a slope of 0.6° has, and a noise of 0.03 m/s² in each of 1000 readings a second.
const IMU: &str = "[[source]]\nname = \"imu\"\ninput = [{ name = \"turn\", unit = \"rad/s\" }, { name = \"acceleration_x\", \
                   unit = \"m/s²\" }, { name = \"acceleration_y\", unit = \"m/s²\" }]\n\n\
                   [[sensor]]\nname = \"imu\"\nkind = \"imu\"\nfrom = \"imu\"\nsigma_rad_s = 0.002\nsigma_m_s2 = 0.03\n\n\
                   [[simulation.sensor]]\nname = \"imu\"\nbias_rad_s = 0.01\nbias_walk_rad_s = 3e-6\nscale_error = 0.002\n\
                   quantum = 1e-4\nbias_m_s2 = [0.1, -0.05]\n";

/// One drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Case {
    /// Of [`SETS`].
    pub set: usize,
    /// Of [`FLOORS`].
    pub floor: usize,
    /// Of [`PATHS`].
    pub path: usize,
}

/// How it went.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sensed {
    /// RMS of the true distance from the wished place while it drove, m.
    pub driving_m: f64,
    /// The same at rest, a second after the end, for a second.
    pub resting_m: f64,
    /// RMS of the true distance from the believed place while it drove, m.
    pub believed_m: f64,
    /// True less believed heading at the end, rad.
    pub heading_rad: f64,
    /// It came to the end.
    pub finished: bool,
}

fn mouse(name: &str, [x_m, y_m]: [f64; 2], seed: u64) -> String {
    format!(
        "[[source]]\nname = \"{name}\"\ninput = [{{ name = \"x\", unit = \"m\" }}, {{ name = \"y\", unit = \"m\" }}]\n\n\
         [[sensor]]\nname = \"{name}\"\nkind = \"flow\"\nfrom = \"{name}\"\nposition_m = [{x_m}, {y_m}]\n\n\
         [[simulation.sensor]]\nname = \"{name}\"\nscale_error = 0.01\nheading_error_rad = 0.01\nquantum = 2e-5\nseed = {seed}\n\
         lift_off_share = 0.01\n"
    )
}

const POSES: &str = "[[source]]\nname = \"tracker\"\ncarries = \"pose\"\nmax_age_ms = 1000\n\n\
                     [[sensor]]\nname = \"mocap\"\nkind = \"pose\"\nfrom = \"tracker\"\nsigma_m = 0.001\nsigma_rad = 0.002\n\
                     delay_ms = 20\n\n\
                     [[simulation.sensor]]\nname = \"mocap\"\njitter_ms = 3.0\ndrop_share = 0.01\noutlier_share = 0.001\nseed = 9\n";

/// The tables of a set's sensors, of the robot and of its simulation.
pub fn sensors(set: usize) -> String {
    let all = [
        String::new(),
        GYRO.to_owned(),
        mouse("left", [0.0, 0.25], 2) + &mouse("right", [0.0, -0.25], 3),
        POSES.to_owned(),
    ];
    if set == IMU_SET { IMU.to_owned() } else { all[..=set].concat() }
}

impl Case {
    /// All of them, in the order of the table.
    pub fn all() -> impl Iterator<Item = Case> {
        let floors = (0..SETS.len()).flat_map(|set| (0..FLOORS.len()).map(move |floor| (set, floor)));
        floors.flat_map(|(set, floor)| (0..PATHS.len()).map(move |path| Case { set, floor, path }))
    }

    /// The robot's file.
    pub fn text(&self) -> String {
        let floor = match self.floor {
            0 => "static_friction = 0.5\n".to_owned(),
            1 => "static_friction = 0.2\nsliding_friction = 0.18\n".to_owned(),
            2 => {
                let patch = |x: f64, y: f64| {
                    format!(
                        "\n[[simulation.patch]]\ncentre_m = [{x}, {y}]\nradius_m = 0.25\nstatic_friction = 0.15\n"
                    )
                };
                [(0.8, 0.0), (0.0, 0.8), (2.0, 1.0), (-0.6, 0.4)].map(|(x, y)| patch(x, y)).concat()
            }
            3 => format!("slope_rad = {}\nslope_direction_rad = 0.6\n", 1.0_f64.to_radians()),
            _ => "payload_kg = 40.0\npayload_position_m = [0.15, -0.1]\n".to_owned(),
        };
        let reference = match self.path {
            0 => {
                let corners = [[2, 0], [2, 2], [0, 2], [0, 0]];
                let points = (0..8).map(|n| {
                    let [x, y] = corners[n % 4];
                    format!(", [{}, {x}, {y}, 0]", 7.5 * (n + 1) as f64)
                });
                format!(
                    "\n[reference]\nkind = \"path\"\npoints = [[0, 0, 0, 0]{}]\n",
                    points.collect::<String>()
                )
            }
            1 => "\n[reference]\nkind = \"circle\"\nradius_m = 0.8\nturns = 3.0\nduration_s = 60.0\n"
                .to_owned(),
            _ => robots::eight(robots::BMM, 30.0, 60.0),
        };
        let sensors = sensors(self.set);
        format!(
            "{}{floor}{reference}\n[estimator]\nkind = \"fused\"\n{}\n\n{sensors}",
            robots::BMM,
            builds::CREEP_TOLD
        )
    }
}

/// The robot of a seed, its drives powered.
///
/// # Panics
/// Where it can't be made.
pub fn make(case: &Case, seed: u64) -> Trial {
    let mut plan: RobotPlan = crate::plan_of(&case.text());
    // The trial's drives read their encoders a whole cycle before.
    plan.bus.synchronisation = Synchronisation::FreeRun;
    for sensor in &mut plan.simulation.sensor {
        sensor.seed = Some(sensor.seed.unwrap_or(1) + 1000 * seed);
    }
    let settings = covariance_settings(&plan.estimator);
    let mut random = Random::new(seed ^ 0xB111_D000_0000_0000);
    Trial::on_machine(plan, |machine| {
        for drive in &mut machine.wheels {
            builds::build(&mut drive.wheel, &settings.geometry, &mut random);
        }
    })
}

/// Drives the robot of a seed along its whole path.
///
/// # Panics
/// Where it can't be made or enabled.
pub fn drive(case: &Case, seed: u64) -> Sensed {
    let mut trial = make(case, seed);
    trial.run(1000 * REST_S);
    trial.enable();
    trial.step(Some(RequestKind::Track));
    let mut squares = [[0.0; 2]; 3];
    let mut add = |part: usize, one: f64| {
        squares[part][0] += one;
        squares[part][1] += 1.0;
    };
    while trial.robot.phase() == Phase::Tracking {
        let record = *trial.step(None);
        let truth = trial.measured_pose();
        add(0, truth.distance_m(record.setpoint.odom_from_body).powi(2));
        add(2, truth.distance_m(record.state.odom_from_body).powi(2));
    }
    let finished = trial.robot.record().stop_reason == Default::default();
    trial.run(1000);
    for _ in 0..1000 {
        let record = *trial.step(None);
        add(1, trial.measured_pose().distance_m(record.setpoint.odom_from_body).powi(2));
    }
    let record = trial.robot.record();
    let [driving_m, resting_m, believed_m] = squares.map(|[sum, count]: [f64; 2]| (sum / count).sqrt());
    Sensed {
        driving_m,
        resting_m,
        believed_m,
        heading_rad: wrap_angle_rad(
            trial.measured_pose().heading_rad - record.state.odom_from_body.heading_rad,
        ),
        finished,
    }
}
