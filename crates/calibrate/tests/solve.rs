//! Builds that are known are found again, as well as the solution says, and what can't be seen is named.

use std::f64::consts::PI;

use omnibase_calibrate::figures::{self, Figure, Pace};
use omnibase_calibrate::observed::unseen;
use omnibase_calibrate::rehearsal::{GyroSensor, PoseSensor, Random, Tape, drawn_wheel};
use omnibase_calibrate::{
    Build, Dataset, Drift, Run, SensorMount, Solution, Step, Tolerances, Unknown, solve,
};
use omnibase_platform::{GeometrySigmas, Kinematics, Pose2, Wheel, layout};

const PACE: Pace =
    Pace { speed_m_s: 0.4, acceleration_m_s2: 0.4, turn_speed_rad_s: 0.8, turn_acceleration_rad_s2: 0.8 };
const SIGMAS: GeometrySigmas =
    GeometrySigmas { radius_share: 3e-3, direction_rad: 0.3 * PI / 180.0, position_m: 2e-3 };

fn expected(wheels: Vec<Wheel>) -> (Build, Tolerances) {
    let build =
        Build { wheels, creep: 0.0, roller_resistance: 0.0, sensor: SensorMount::default(), gyro_scale: 0.0 };
    // A floor that is as even as this simulation's.
    let tolerances = Tolerances {
        wheel: SIGMAS,
        creep: 0.01,
        sensor_m: 3e-3,
        sensor_rad: PI / 180.0,
        way_m2_per_m: 1e-10,
        way_m2_per_rad: 1e-10,
        turn_rad2_per_m: 1e-10,
        turn_rad2_per_rad: 1e-10,
        ..Tolerances::default()
    };
    (build, tolerances)
}

/// A platform of these wheels, driven by wheel speeds that nominal wheels would need for a figure.
fn driven(nominal: &[Wheel], truth: &[Wheel], figure: &Figure) -> (Run, Vec<(f64, Pose2)>) {
    let [nominal, truth] = [nominal, truth].map(|wheels| Kinematics::new(wheels.to_vec()).unwrap());
    let period_s = 0.01;
    let mut run = Run { name: figure.name.to_owned(), ..Run::default() };
    let mut pose = Pose2::default();
    let mut poses = vec![(0.0, pose)];
    for number in 1..=(figure.duration_s() / period_s) as usize {
        let twist = figure.at((number as f64 - 0.5) * period_s).1;
        let turned_rad = nominal.wheel_speeds_rad_s(twist).map(|speed| speed * period_s);
        pose = pose.moved_by(truth.body_step(&turned_rad).0);
        let end_s = number as f64 * period_s;
        run.steps.push(Step { end_s, turned_rad });
        poses.push((end_s, pose));
    }
    (run, poses)
}

fn by_name(name: &str) -> Figure {
    figures::all(2.0, PACE, &layout::bmm(0.38, 0.4, 0.1))
        .into_iter()
        .find(|figure| figure.name == name)
        .unwrap()
}

/// The build of a seed, seen by a sensor of poses in a figure, and what was found.
fn found(wheels: Vec<Wheel>, figure: &str, seed: u64) -> (Vec<Wheel>, SensorMount, Solution, Dataset, Build) {
    let (build, tolerances) = expected(wheels);
    let mut random = Random::new(seed);
    let truth: Vec<Wheel> =
        build.wheels.iter().map(|wheel| drawn_wheel(wheel, &SIGMAS, &mut random)).collect();
    let mount = SensorMount {
        base_from_sensor: Pose2::new(
            3e-3 * random.normal(),
            3e-3 * random.normal(),
            PI / 180.0 * random.normal(),
        ),
        delay_s: 0.02,
    };
    let (mut run, poses) = driven(&build.wheels, &truth, &by_name(figure));
    run.poses = PoseSensor { mount, every_s: 0.05, ..PoseSensor::default() }.poses(&poses, &mut random);
    let dataset = Dataset { runs: vec![run] };
    let solution = solve(&dataset, &build, &tolerances).unwrap();
    (truth, mount, solution, dataset, build)
}

#[test]
fn drawn_builds_are_found_within_what_is_said_of_them() {
    // 12 builds of three and four wheels; errors of what is held to the sensor, over their standard deviations: their mean
    // square is 1. Radius, direction and lever arm of three wheels, 27 figures a robot of which 9 are free.
    let mut squares = 0.0;
    let mut count = 0;
    for seed in 1..=6 {
        let (truth, mount, solution, dataset, build) = found(layout::bmm(0.38, 0.4, 0.1), "full", seed);
        let chi = solution.reduced_chi_square();
        assert!((0.95..1.05).contains(&chi), "seed {seed}: {chi}");
        let delay = solution.of(Unknown::Delay).unwrap();
        assert!((delay.amount - 0.02).abs() < 4.0 * delay.sigma_held, "{delay:?}");
        let frame = mount.base_from_sensor.then(solution.build.sensor.base_from_sensor.inverse());
        for (at, (found, truth)) in solution.build.wheels.iter().zip(&truth).enumerate() {
            let angle = |wheel: &Wheel| wheel.force_direction[1].atan2(wheel.force_direction[0]);
            let sigma = |unknown| solution.of(unknown).unwrap().sigma_held;
            let direction = angle(found) + frame.heading_rad - angle(truth);
            let radius = found.radius_m / truth.radius_m - 1.0;
            squares += (direction / sigma(Unknown::Direction(at))).powi(2);
            squares += (radius / sigma(Unknown::Radius(at))).powi(2);
            count += 2;
            assert!(direction.abs() < 4e-4 && radius.abs() < 6e-4, "seed {seed}: {direction} {radius}");
        }
        let [before, after] = [&build, &solution.build]
            .map(|build| Drift::of(&dataset.runs[0], &solution.runs[0], build).unwrap().rms_m());
        assert!(before > 5.0 * after && after < 2e-3, "seed {seed}: {before} {after}");
    }
    let mean = squares / f64::from(count);
    assert!((0.5..1.6).contains(&mean), "{mean}");
}

#[test]
fn what_no_motion_shows_is_named_and_stays() {
    let (.., solution, _, build) = found(layout::bmm(0.38, 0.4, 0.1), "full", 1);
    let words: Vec<String> = unseen(&solution, &build).into_iter().map(|one| one.words).collect();
    assert_eq!(
        words,
        [
            "wheel_1 place along its force: no motion shows it",
            "wheel_2 place along its force: no motion shows it",
            "wheel_3 place along its force: no motion shows it",
            "where base is along x: wheels and sensor moved together",
            "where base is along y: wheels and sensor moved together",
            "which way base looks: wheels and sensor turned together",
        ]
    );
    // Of the sensor's place the tolerances of three wheels say hardly more than its own does; of its heading they do.
    let dark = |unknown| matches!(unknown, Unknown::Along(_) | Unknown::SensorX | Unknown::SensorY);
    for found in &solution.found {
        assert_eq!(found.is_observed(), !dark(found.unknown), "{found:?}");
    }
    // Four wheels have three numbers more, by which they only contradict each other: seen where their hubs go at different
    // speeds, and not where all go alike.
    let (.., solution, _, build) = found(layout::mecanum4(0.24, 0.21, 0.076), "full", 1);
    let words: Vec<String> = unseen(&solution, &build).into_iter().map(|one| one.words).collect();
    assert_eq!(words.len(), 4 + 3, "{words:#?}");
    let (build, tolerances) = expected(layout::mecanum4(0.24, 0.21, 0.076));
    let witness = figures::Witness::Poses(PoseSensor::default());
    let solution = figures::foreseen(&[by_name("line")], &build, &tolerances, witness).unwrap();
    let words: Vec<String> = unseen(&solution, &build).into_iter().map(|one| one.words).collect();
    assert!(
        words.iter().any(|words| words.starts_with("what wheels contradict each other by")),
        "{words:#?}"
    );
}

#[test]
fn a_line_shows_less_than_a_star_with_turns() {
    let (build, tolerances) = expected(layout::bmm(0.38, 0.4, 0.1));
    let witness = figures::Witness::Poses(PoseSensor::default());
    let dark = |name: &str| {
        let solution = figures::foreseen(&[by_name(name)], &build, &tolerances, witness).unwrap();
        unseen(&solution, &build).len()
    };
    let counts = ["line", "turns", "star", "full"].map(dark);
    assert!(counts[0] > counts[2] && counts[1] > counts[3] && counts[2] > counts[3], "{counts:?}");
    assert_eq!(counts[3], 6);
}

#[test]
fn tapes_and_a_gyro_find_what_they_can() {
    let (build, tolerances) = expected(layout::bmm(0.38, 0.4, 0.1));
    let mut random = Random::new(5);
    let truth: Vec<Wheel> =
        build.wheels.iter().map(|wheel| drawn_wheel(wheel, &SIGMAS, &mut random)).collect();
    let mut dataset = Dataset::default();
    for figure in figures::between_tapes(2.0, PACE, &build.wheels) {
        let (mut run, poses) = driven(&build.wheels, &truth, &figure);
        let rates = poses.windows(2).map(|pair| {
            let period_s = pair[1].0 - pair[0].0;
            (0.5 * (pair[0].0 + pair[1].0), (pair[1].1.heading_rad - pair[0].1.heading_rad) / period_s)
        });
        run.turns = GyroSensor::default().turns(&rates.collect::<Vec<_>>(), &mut random);
        let ends = [poses[0], poses[poses.len() - 1]];
        run.places =
            ends.map(|(instant_s, pose)| Tape::default().place(instant_s, pose, &mut random)).to_vec();
        dataset.runs.push(run);
    }
    let solution = solve(&dataset, &build, &tolerances).unwrap();
    for (at, (found, truth)) in solution.build.wheels.iter().zip(&truth).enumerate() {
        let radius = found.radius_m / truth.radius_m - 1.0;
        let sigma = solution.of(Unknown::Radius(at)).unwrap().sigma;
        assert!(radius.abs() < 4.0 * sigma && sigma < 1e-3, "wheel {at}: {radius} ± {sigma}");
    }
    let gyro = solution.of(Unknown::GyroScale).unwrap();
    assert!((gyro.amount - 5e-3).abs() < 4.0 * gyro.sigma && gyro.is_observed(), "{gyro:?}");
    let bias = solution.runs[0].gyro_bias_rad_s.unwrap();
    assert!((bias - 3.5e-3).abs() < 2e-4, "{bias}");
}

#[test]
fn wild_poses_count_for_little() {
    let (build, tolerances) = expected(layout::bmm(0.38, 0.4, 0.1));
    let (mut run, poses) = driven(&build.wheels, &build.wheels, &by_name("star"));
    run.poses = PoseSensor::default().poses(&poses, &mut Random::new(3));
    for pose in run.poses.iter_mut().skip(100).step_by(100) {
        pose.world_from_sensor.x_m += 0.5;
    }
    let wild = run.poses.iter().skip(100).step_by(100).count();
    let solution = solve(&Dataset { runs: vec![run] }, &build, &tolerances).unwrap();
    assert!((wild..wild + 12).contains(&solution.runs[0].doubted), "{} of {wild}", solution.runs[0].doubted);
    let chi = solution.reduced_chi_square();
    assert!((0.5..1.5).contains(&chi) && solution.is_sound(), "{chi}");
    for wheel in 0..3 {
        let radius = solution.of(Unknown::Radius(wheel)).unwrap();
        assert!(radius.amount.abs() < 4e-4, "{radius:?}");
    }
}

#[test]
fn poses_that_are_wild_again_and_again_are_no_chance() {
    let (build, tolerances) = expected(layout::bmm(0.38, 0.4, 0.1));
    let (mut run, poses) = driven(&build.wheels, &build.wheels, &by_name("star"));
    run.poses = PoseSensor::default().poses(&poses, &mut Random::new(3));
    for pose in run.poses.iter_mut().step_by(6) {
        pose.world_from_sensor.x_m += 0.5;
    }
    let solution = solve(&Dataset { runs: vec![run] }, &build, &tolerances).unwrap();
    assert!(!solution.is_sound() && solution.reduced_chi_square() < 4.0, "{}", solution.reduced_chi_square());
}
