//! What can't be worked with is refused: where, what was expected, what was found.

use omnibase_calibrate::{
    Build, Dataset, PlaceSample, PoseSample, Run, SensorMount, Step, Tolerances, TurnSample, solve,
};
use omnibase_platform::{PerWheel, Pose2, layout};

fn pose(instant_s: f64) -> PoseSample {
    PoseSample { instant_s, world_from_sensor: Pose2::default(), sigma_m: 1e-3, sigma_rad: 1e-3 }
}

fn sound() -> Run {
    let step = |number: usize| Step { end_s: number as f64, turned_rad: PerWheel::from([0.1, 0.1, 0.1]) };
    Run {
        name: "run".to_owned(),
        steps: (1..=3).map(step).collect(),
        poses: vec![pose(0.5), pose(1.5)],
        ..Run::default()
    }
}

fn words(change: impl FnOnce(&mut Run)) -> String {
    let mut run = sound();
    change(&mut run);
    refused(&Dataset { runs: vec![run] }, &Tolerances::default())
}

fn refused(dataset: &Dataset, tolerances: &Tolerances) -> String {
    let expected = Build {
        wheels: layout::bmm(0.38, 0.4, 0.1),
        creep: 0.0,
        roller_resistance: 0.03,
        sensor: SensorMount::default(),
        gyro_scale: 0.0,
    };
    solve(dataset, &expected, tolerances).map(|_| String::new()).unwrap_or_else(|error| error.to_string())
}

#[test]
fn each_mistake_is_told_with_its_place() {
    assert_eq!(words(|_| {}), "");
    let place = |instant_s| PlaceSample {
        instant_s,
        floor_from_base: Pose2::default(),
        sigma_m: 1e-3,
        sigma_rad: 1e-3,
    };
    for (found, expected) in [
        (words(|run| run.steps.clear()), "run: no wheel turned in it: expected the increments of 3 wheels"),
        (
            words(|run| run.steps[1].turned_rad = PerWheel::from([0.1, 0.1])),
            "run, step 1: 2 wheels, expected 3",
        ),
        (
            words(|run| run.steps[2].end_s = 1.5),
            "run, step 2: its instant 1.5 s isn't later than 2 s, that of the one before",
        ),
        (
            words(|run| run.steps[0].turned_rad[2] = f64::NAN),
            "run, step 0: turned_rad is NaN, expected a number of at most 1e12 in size",
        ),
        (
            words(|run| run.steps[2].end_s = 1e6),
            "run, step 2: it lasts 999998 s, expected at most 60 s: instants are in s, and wheels are read all the time",
        ),
        (
            words(|run| run.poses[0].world_from_sensor.x_m = 1e300),
            "run, pose 0: x_m is 1e300, expected a number of at most 1e12 in size",
        ),
        (
            words(|run| run.poses[1].sigma_m = 0.0),
            "run, pose 1: sigma_m is 0.0, expected a number of at most 1e12 in size above 0",
        ),
        (
            words(|run| run.poses[0].world_from_sensor.heading_rad = f64::INFINITY),
            "run, pose 0: heading_rad is inf, expected a number of at most 1e12 in size",
        ),
        (
            words(|run| run.poses.clear()),
            "run: nothing tells where it really was: expected poses of a sensor, a gyro's turns, or two places on the floor",
        ),
        (
            words(|run| run.places = vec![place(0.5), place(1.0)]),
            "run: poses of a sensor and places on the floor are in two worlds: expected one of them",
        ),
        (
            words(|run| {
                run.poses.clear();
                run.places = vec![place(0.5), place(9.0)];
            }),
            "run: place 1 is of 9 s, expected within 0 s to 3 s, when wheels were counted",
        ),
        (
            words(|run| run.turns = vec![TurnSample { instant_s: 1.0, rate_rad_s: f64::NAN }]),
            "run, turn 0: rate_rad_s is NaN, expected a number of at most 1e12 in size",
        ),
        (refused(&Dataset::default(), &Tolerances::default()), "no run: expected at least one"),
        (
            refused(&Dataset { runs: vec![sound()] }, &Tolerances { sensor_m: 0.0, ..Tolerances::default() }),
            "the tolerance of sensor x is 0, expected a positive number",
        ),
    ] {
        assert_eq!(found, expected);
    }
}
