//! Robots built with the tolerances of their file that learn from repeats: how true they then drive.

use omnibase_calibrate::rehearsal::{Random, drawn_wheel};
use omnibase_platform::Kinematics;
use omnibase_robot::estimators::covariance_settings;
use omnibase_robot::{Ability, Registry, RobotPlan};
use omnibase_run::learn::{Learner, rehearsal};

/// What is driven: its name, and its table.
pub const PATHS: [(&str, &str); 3] = [
    ("circle", "kind = \"circle\"\nradius_m = 0.6\nduration_s = 12.0\n"),
    ("eight", "kind = \"eight\"\nhalf_length_m = 0.8\nduration_s = 14.0\n"),
    (
        "square",
        "kind = \"path\"\npoints = [[0, 0, 0, 0], [4, 1.2, 0, 0], [8, 1.2, 1.2, 0], [12, 0, 1.2, 0], [16, 0, 0, 0]]\n",
    ),
];
/// By which law.
pub const LAWS: [&str; 2] = ["closed_loop_speed", "adaptive_torque"];
/// In which frame the task lies.
pub const FRAMES: [&str; 2] = ["map", "odom"];
/// Repeats of each.
const REPEATS: u64 = 6;

/// True distances from the wished motion, m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct True {
    /// RMS while it drove.
    pub rms_m: f64,
    /// At its end.
    pub end_m: f64,
}

/// One robot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Learned {
    /// Driven as its file says.
    pub without: True,
    /// Driven with what it learnt.
    pub with: True,
}

/// Lets the robot of a seed learn a path by a law in a frame, and drives both ways with the same new noise.
///
/// # Panics
/// Where it can't be made or driven.
pub fn learn(path: &str, law: &str, frame: &str, seed: u64, registry: &Registry) -> Learned {
    let text = include_str!("../../../robots/bmm_tracked.toml")
        .replace("closed_loop_speed", law)
        .replace("kind = \"fused\"", &format!("kind = \"fused\"\ntask_frame = \"{frame}\""));
    let plan: RobotPlan = crate::plan_of(&format!("{text}\n[reference]\n{path}"));
    let tolerances = covariance_settings(&plan.estimator).geometry;
    let mut random = Random::new(seed);
    let wheels = plan.kinematics.wheels().iter().map(|wheel| drawn_wheel(wheel, &tolerances, &mut random));
    let kinematics = Kinematics::new(wheels.collect()).expect("wheels nearly as in the file");
    let built = RobotPlan { kinematics, ..plan.clone() };
    let drive = |correction, noise: u64| {
        rehearsal::drive(&built, &plan, correction, registry, 100 * seed + noise).expect("a drive")
    };
    let motion = registry.make_reference(&plan.reference, &Ability::of(&plan)).expect("the motion");
    let mut learner = Learner::new(motion.duration_s().expect("a motion with an end"));
    for repeat in 0..REPEATS {
        learner.learn(&drive(Some(learner.next()), repeat).repeat).expect("a repeat to learn from");
    }
    let seen = |correction| {
        let one = drive(correction, REPEATS);
        True { rms_m: one.true_rms_m, end_m: one.true_end_m }
    };
    Learned { without: seen(None), with: seen(learner.best()) }
}
