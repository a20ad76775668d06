//! Robots built with tolerances, calibrated by what they drive, and driven again.
//!
//! The build, its sensor's mounting and all noise are drawn by a seed. Truth is the simulator's; what the calibration is told of it
//! is what a sensor with stated noise sees.

use std::f64::consts::PI;

use omnibase_calibrate::figures::{self, Figure, Pace};
use omnibase_calibrate::rehearsal::{GyroSensor, PoseSensor, Random, Tape, drawn_wheel};
use omnibase_calibrate::{Build, Dataset, Run, SensorMount, Solution, Step, Tolerances, solve};
use omnibase_calibrate::{Unknown, WheelErrors};
use omnibase_platform::{GeometrySigmas, Kinematics, PerWheel, Pose2, Wheel, wrap_angle_rad};
use omnibase_robot::config::{InterpolationName, PathFrame, ReferenceTable};
use omnibase_robot::{Phase, RequestKind, RobotPlan};
use omnibase_robot_sim::MachineParameters;

use crate::trial::Trial;

/// The tolerances of the builds: radius 0.3 %, direction 0.3°, each coordinate of a place 2 mm.
pub const BUILT: GeometrySigmas =
    GeometrySigmas { radius_share: 3e-3, direction_rad: 0.3 * PI / 180.0, position_m: 2e-3 };
/// The tolerances of the sensor's mounting: each coordinate 3 mm, heading 1°.
pub const MOUNTED: [f64; 2] = [3e-3, PI / 180.0];

/// A robot that isn't quite what its file says.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// Its wheels.
    pub wheels: Vec<Wheel>,
    /// Where its sensor is; the plan says in the origin of base.
    pub sensor: SensorMount,
    random: Random,
}

impl Drawn {
    /// The robot of a seed.
    pub fn new(plan: &RobotPlan, seed: u64) -> Drawn {
        let mut random = Random::new(seed ^ 0xCA11_B8A7_0000_0000);
        let wheels = plan.kinematics.wheels();
        let wheels = wheels.iter().map(|wheel| drawn_wheel(wheel, &BUILT, &mut random)).collect();
        let [x_m, y_m, heading] = [(); 3].map(|()| random.normal());
        let base_from_sensor = Pose2::new(MOUNTED[0] * x_m, MOUNTED[0] * y_m, MOUNTED[1] * heading);
        Drawn { wheels, sensor: SensorMount { base_from_sensor, delay_s: 0.02 }, random }
    }

    fn put_into(&self, machine: &mut MachineParameters) {
        for (drive, wheel) in machine.wheels.iter_mut().zip(&self.wheels) {
            drive.wheel.position_m = wheel.position_m;
            drive.wheel.rolling_direction = wheel.rolling_direction;
            drive.wheel.force_direction = wheel.force_direction;
            drive.wheel.radius_m = wheel.radius_m;
        }
    }
}

/// Who tells where the robot is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Told {
    /// Motion capture: 100 Hz, 1 mm, 3 mrad, 20 ms late.
    Poses,
    /// A gyro, and a tape before and after each figure.
    GyroAndTape,
    /// A tape alone.
    Tape,
}

/// How a robot is calibrated.
#[derive(Clone, Copy, Debug)]
pub struct Manner {
    /// By whom.
    pub told: Told,
    /// How often all figures are driven.
    pub rounds: usize,
    /// The square that they take, m.
    pub side_m: f64,
    /// How well a person measures places.
    pub tape: Tape,
}

impl From<Told> for Manner {
    /// Once, on the usual square.
    fn from(told: Told) -> Self {
        Manner { told, rounds: 1, side_m: SIDE_M, tape: Tape::default() }
    }
}

/// What the file expects, and how well.
pub fn expected(plan: &RobotPlan) -> (Build, Tolerances) {
    let build = Build {
        wheels: plan.kinematics.wheels().to_vec(),
        creep: 0.0,
        roller_resistance: plan.estimator.roller_resistance.unwrap_or(0.03),
        // The delay is told roughly.
        sensor: SensorMount { base_from_sensor: Pose2::default(), delay_s: 0.0 },
        gyro_scale: 0.0,
    };
    let gyro = GyroSensor::default();
    let tolerances = Tolerances {
        wheel: BUILT,
        sensor_m: MOUNTED[0],
        sensor_rad: MOUNTED[1],
        gyro_density: gyro.density,
        ..Tolerances::default()
    };
    (build, tolerances)
}

/// How fast calibration figures are driven.
pub const PACE: Pace =
    Pace { speed_m_s: 0.4, acceleration_m_s2: 0.4, turn_speed_rad_s: 0.8, turn_acceleration_rad_s2: 0.8 };
/// The square that they usually take, m.
pub const SIDE_M: f64 = 2.0;

/// A robot that was calibrated.
pub struct Calibrated {
    /// What was found.
    pub solution: Solution,
    /// What is still wrong with each wheel as far as it moves the platform, where base is held to the sensor: where it is in the
    /// body is nobody's truth.
    pub errors: Vec<WheelErrors>,
    /// True RMS on the 2 m square before and after, m.
    pub square_m: [f64; 2],
}

impl Calibrated {
    /// The greatest error of a wheel: radius as a share, direction rad, place across its force m.
    pub fn greatest(&self) -> [f64; 3] {
        let most =
            |of: fn(&WheelErrors) -> f64| self.errors.iter().map(|error| of(error).abs()).fold(0.0, f64::max);
        [most(|error| error.radius_share), most(|error| error.direction_rad), most(|error| error.across_m)]
    }
}

impl Calibrated {
    /// Of each wheel's radius, direction and place across its force: the error, and the standard deviation that was said of it.
    pub fn said(&self) -> [Vec<[f64; 2]>; 3] {
        let has_sensor = self.solution.of(Unknown::SensorX).is_some();
        let sigma = |unknown| {
            let found = self.solution.of(unknown);
            found.map_or(f64::NAN, |found| if has_sensor { found.sigma_held } else { found.sigma })
        };
        let all = |unknown: fn(usize) -> Unknown, error: fn(&WheelErrors) -> f64| {
            let wheels = self.errors.iter().enumerate();
            wheels.map(|(wheel, errors)| [error(errors), sigma(unknown(wheel))]).collect()
        };
        [
            all(Unknown::Radius, |error| error.radius_share),
            all(Unknown::Direction, |error| error.direction_rad),
            all(Unknown::Across, |error| error.across_m),
        ]
    }
}

/// Calibrates the robot of a seed and drives the square before and after.
///
/// # Panics
/// Where a drive doesn't come to its end, or nothing is found.
pub fn calibrate(plan: &RobotPlan, manner: &Manner, seed: u64) -> Calibrated {
    let mut drawn = Drawn::new(plan, seed);
    let (build, tolerances) = expected(plan);
    let dataset = measured(plan, &mut drawn, manner);
    let solution =
        solve(&dataset, &build, &tolerances).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
    let true_from_found = match manner.told {
        Told::Poses => drawn.sensor.base_from_sensor.then(solution.build.sensor.base_from_sensor.inverse()),
        Told::GyroAndTape | Told::Tape => Pose2::default(),
    };
    let errors = WheelErrors::of(&solution.build.wheels, &drawn.wheels, true_from_found);
    let errors = WheelErrors::that_move(&errors, &build.wheels, &tolerances)
        .unwrap_or_else(|error| panic!("seed {seed}: {error}"));
    let after = calibrated_plan(plan, &solution.build);
    let square_m = [(plan, Pose2::default()), (&after, true_from_found)]
        .map(|(plan, frame)| square_rms_m(plan, &drawn, frame, seed));
    Calibrated { solution, errors, square_m }
}

/// The plan with what was found in it.
pub fn calibrated_plan(plan: &RobotPlan, build: &Build) -> RobotPlan {
    let mut plan = plan.clone();
    match Kinematics::new(build.wheels.clone()) {
        Ok(kinematics) => plan.kinematics = kinematics,
        Err(error) => panic!("{error}"),
    }
    plan.estimator.creep = Some(build.creep.max(0.0)).filter(|creep| *creep > 0.0);
    plan
}

/// Drives the figures, and what is told of them.
fn measured(plan: &RobotPlan, drawn: &mut Drawn, manner: &Manner) -> Dataset {
    let &Manner { told, rounds, side_m, tape } = manner;
    let once: Vec<Figure> = match told {
        Told::Poses => figures::all(side_m, PACE, plan.kinematics.wheels())
            .into_iter()
            .filter(|figure| figure.name == "full")
            .collect(),
        Told::GyroAndTape | Told::Tape => figures::between_tapes(side_m, PACE, plan.kinematics.wheels()),
    };
    let runs = vec![once; rounds].concat().into_iter().map(|figure| {
        let drive = drive_figure(plan, drawn, &figure);
        let mut run = drive.run;
        let random = &mut drawn.random;
        match told {
            Told::Poses => {
                let sensor = PoseSensor { mount: drawn.sensor, ..PoseSensor::default() };
                run.poses = sensor.poses(&drive.truth, random);
            }
            Told::GyroAndTape | Told::Tape => {
                let ends = [drive.truth.first(), drive.truth.last()];
                let place = |(instant_s, pose): &(f64, Pose2)| tape.place(*instant_s, *pose, random);
                run.places = ends.into_iter().flatten().map(place).collect();
                if told == Told::GyroAndTape {
                    run.turns = GyroSensor::default().turns(&drive.turns, random);
                }
            }
        }
        run
    });
    Dataset { runs: runs.collect() }
}

/// A drive, and the truth of it.
struct Drive {
    run: Run,
    truth: Vec<(f64, Pose2)>,
    turns: Vec<(f64, f64)>,
}

fn drive_figure(plan: &RobotPlan, drawn: &Drawn, figure: &Figure) -> Drive {
    let mut plan = plan.clone();
    plan.reference = ReferenceTable {
        interpolation: Some(InterpolationName::Quintic),
        frame: Some(PathFrame::Start),
        ..ReferenceTable::path(figure.points.clone())
    };
    let mut trial = Trial::on_machine(plan, |machine| drawn.put_into(machine));
    trial.enable();
    let now_s = |trial: &Trial| trial.time().now_ns as f64 * 1e-9;
    let mut drive = Drive {
        run: Run { name: figure.name.to_owned(), begin_s: now_s(&trial), ..Run::default() },
        truth: vec![(now_s(&trial), trial.measured_pose())],
        turns: Vec::new(),
    };
    trial.step(Some(RequestKind::Track));
    let mut rest = 1000;
    loop {
        let instant_s = now_s(&trial);
        let drives = trial.robot.record().measurements.present();
        let turned_rad = PerWheel::from_fn(drives.len(), |wheel| drives[wheel].increment_rad);
        drive.run.steps.push(Step { end_s: instant_s, turned_rad });
        let pose = trial.measured_pose();
        let before = drive.truth.last().map_or(pose, |(_, before)| *before);
        let period_s = trial.plan.bus.cycle_ns as f64 * 1e-9;
        let rate_rad_s = wrap_angle_rad(pose.heading_rad - before.heading_rad) / period_s;
        drive.turns.push((instant_s - 0.5 * period_s, rate_rad_s));
        drive.truth.push((instant_s, pose));
        if trial.robot.phase() != Phase::Tracking {
            rest -= 1;
            if rest == 0 {
                break;
            }
        }
        trial.step(None);
    }
    assert_eq!(trial.robot.record().stop_reason, Default::default(), "{}", figure.name);
    drive.run = drive.run.in_steps_of(4e-3);
    drive
}

/// Root of the mean square between the square that was wished and where the robot truly was; its base is where `frame` says in
/// the true one.
fn square_rms_m(plan: &RobotPlan, drawn: &Drawn, frame: Pose2, seed: u64) -> f64 {
    let mut plan = plan.clone();
    plan.reference = ReferenceTable::path(vec![
        [0.0; 4],
        [5.0, 2.0, 0.0, 0.0],
        [10.0, 2.0, 2.0, 0.0],
        [15.0, 0.0, 2.0, 0.0],
        [20.0, 0.0, 0.0, 0.0],
    ]);
    let mut trial = Trial::on_machine(plan, |machine| drawn.put_into(machine));
    trial.enable();
    let odom = trial.robot.record().setpoint.odom_from_body;
    let world_from_odom = trial.measured_pose().then(frame).then(odom.inverse());
    trial.step(Some(RequestKind::Track));
    let (mut squares, mut count) = (0.0, 0_u32);
    while trial.robot.phase() == Phase::Tracking {
        let wished = trial.step(None).wished.odom_from_body;
        let truth = trial.measured_pose().then(frame);
        squares += world_from_odom.then(wished).distance_m(truth).powi(2);
        count += 1;
    }
    assert_eq!(trial.robot.record().stop_reason, Default::default(), "seed {seed}");
    (squares / f64::from(count.max(1))).sqrt()
}
