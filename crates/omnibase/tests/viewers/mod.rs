//! What other people's programs see of a robot and of its recordings: yourdfpy, pinocchio and MuJoCo read URDF and MJCF.

mod live;
mod rerun;

use crate::command_line::{Folder, omnibase, root, words};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A Python with the readers in it, as `.ci/viewers` makes it.
fn python() -> Option<PathBuf> {
    let python = root().join("target/viewers/bin/python");
    if !python.is_file() {
        omnibase_host::skipped(
            "readers of URDF, MJCF and viewers' files aren't there: .ci/viewers makes them",
        );
        return None;
    }
    Some(python)
}

/// What a script prints as JSON.
fn read(python: &Path, script: &str, files: &[&str]) -> Value {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/viewers").join(script);
    let output = Command::new(python).arg(script).args(files).env("MUJOCO_GL", "disable").output().unwrap();
    assert!(output.status.success(), "{}", words(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// What a command prints, where it succeeds.
fn prints(arguments: &[&str]) -> String {
    let output = omnibase(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", words(&output.stderr));
    words(&output.stdout)
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

/// Equal to ten digits.
fn same(found: &Value, expected: f64) {
    let found = found.as_f64().unwrap_or_else(|| panic!("{found} is no number"));
    assert!((found - expected).abs() < 1e-10 * expected.abs().max(1.0), "{found} instead of {expected}");
}

#[test]
fn urdf_and_mjcf_are_the_robot_that_check_tells() {
    let Some(python) = python() else { return };
    let folder = Folder::new("viewers-robot");
    let (urdf, mjcf) = (folder.path("robot.urdf"), folder.path("robot.xml"));
    for robot in ["robots/bmm.toml", "robots/mecanum.toml", "robots/omni4.toml"] {
        // A load off the middle, and a motor behind a gear.
        let of = [robot, "--payload-kg", "12", "--set", "simulation.payload_position_m=[0.1, -0.05]"];
        prints(&[&["urdf"], &of[..], &["--output", &urdf]].concat());
        prints(&[&["mjcf"], &of[..], &["--output", &mjcf]].concat());
        let told: Value = serde_json::from_str(&prints(&[&["check", "--json"], &of[..]].concat())).unwrap();
        let seen = read(&python, "robot.py", &[&urdf, &mjcf]);
        println!("{robot}: {seen}");

        let wheels = told["wheels"].as_array().unwrap();
        let joints: Vec<String> =
            wheels.iter().map(|wheel| format!("{}_joint", wheel["name"].as_str().unwrap())).collect();
        let body = &told["body"];
        let (mass_kg, centre_m) = (body["mass_kg"].as_f64().unwrap(), numbers(&body["centre_m"]));
        let off_m2 = centre_m[0].powi(2) + centre_m[1].powi(2);
        let at_base_kg_m2 = body["inertia_kg_m2"].as_f64().unwrap() + mass_kg * off_m2;
        assert!(off_m2 > 1e-6, "the payload stands off the middle");
        same(&seen["yourdfpy"]["mass_kg"], mass_kg);
        for reader in ["pinocchio", "mujoco"] {
            let seen = &seen[reader];
            assert_eq!(seen["names"], Value::from(joints.clone()), "{reader}");
            same(&seen["mass_kg"], mass_kg);
            same(&seen["planar_kg"], mass_kg);
            same(&seen["inertia_at_base_kg_m2"], at_base_kg_m2);
            for (axis, centre) in centre_m.iter().enumerate() {
                same(&seen["centre_m"][axis], *centre);
            }
        }
        assert_eq!(seen["yourdfpy"]["base"], "base_link");
        assert_eq!(seen["mujoco"]["motors"], wheels.len());
        for (n, (wheel, joint)) in wheels.iter().zip(&joints).enumerate() {
            let of_urdf = &seen["yourdfpy"]["joints"][joint];
            assert_eq!((&of_urdf["type"], &of_urdf["parent"]), (&"continuous".into(), &"base_link".into()));
            let (at, rolling) = (numbers(&wheel["position_m"]), numbers(&wheel["rolling_direction"]));
            let place = [at[0], at[1], wheel["radius_m"].as_f64().unwrap()];
            for (axis, place) in place.into_iter().enumerate() {
                same(&of_urdf["position"][axis], place);
            }
            same(&of_urdf["velocity"], told["limits"]["wheel_speed"]["value"].as_f64().unwrap());
            let torque_nm = told["limits"]["wheel_torque"]["value"].as_f64().unwrap();
            same(&of_urdf["effort"], torque_nm);
            same(&seen["mujoco"]["torque_nm"][n], torque_nm);
            // It rolls to where `check` says; the rim's way is one of a small angle.
            let rolls = numbers(&seen["yourdfpy"]["rolls"][joint]);
            let length = rolling[0].hypot(rolling[1]);
            for (rolls, rolling) in rolls.iter().zip(&rolling) {
                assert!((rolls - rolling / length).abs() < 1e-6, "{joint}: {rolls} instead of {rolling}");
            }
            for (axis, part) in numbers(&of_urdf["axis"]).into_iter().enumerate() {
                same(&seen["mujoco"]["axes"][n][axis], part);
            }
            let inertia_kg_m2 = wheel["inertia_kg_m2"].as_f64().unwrap();
            let with_rotor_kg_m2 = inertia_kg_m2 + wheel["rotor_inertia_kg_m2"].as_f64().unwrap();
            same(&seen["pinocchio"]["wheels_kg_m2"][n], inertia_kg_m2);
            same(&seen["mujoco"]["wheels_kg_m2"][n], with_rotor_kg_m2);
        }
        let first = &wheels[0];
        let with_rotor = ["inertia_kg_m2", "rotor_inertia_kg_m2"].map(|key| first[key].as_f64().unwrap());
        let speed = seen["mujoco"]["speed_rad_s"].as_f64().unwrap() * with_rotor.iter().sum::<f64>();
        assert!((speed - 1.0).abs() < 1e-6, "1 N·m for 1 s gave {speed} N·m·s");
    }
}

#[test]
fn names_are_those_of_ros_2_with_a_prefix() {
    let text = prints(&["urdf", "robots/bmm.toml", "--prefix", "r1/"]);
    for name in
        ["link name=\"r1/base_link\"", "joint name=\"r1/wheel_1_joint\"", "child link=\"r1/wheel_3_link\""]
    {
        assert_eq!(text.matches(name).count(), 1, "{name}: {text}");
    }
}

#[test]
fn a_recording_for_viewers_is_drawn_by_foxgloves_own_messages() {
    let Some(python) = python() else { return };
    let folder = Folder::new("viewers-recording");
    let robot = std::fs::read_to_string(root().join("robots/bmm.toml")).unwrap()
        + "\n[fence]\nrectangle_m = [-3, -3, 3, 3]\n\n[[obstacle]]\ncentre_m = [1.5, 1.5]\nradius_m = 0.2\nvelocity_m_s = [0.1, 0]\n";
    let (file, run, view) = (folder.path("robot.toml"), folder.path("run.mcap"), folder.path("view.mcap"));
    std::fs::write(&file, robot).unwrap();
    let before_ns = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().as_nanos();
    let told = prints(&["run", &file, "--circle", "radius_m=0.2,duration_s=5", "--record", &run, "--json"]);
    let told: Value = serde_json::from_str(&told).unwrap();
    let cycles = told["cycles"].as_u64().unwrap();
    let said = prints(&["export", &run, "--signals", "wheel_1.speed*", "--every", "10ms", "--output", &view]);
    assert!(said.contains(" drawings\n"), "{said}");
    let seen = read(&python, "recording.py", &[&view]);
    println!("{}", serde_json::json!([seen["counts"], seen["log"], seen["phases"], seen["off"]]));

    // Foxglove's own descriptors of every message, field by field, and of those within.
    assert_eq!(seen["differing"], serde_json::json!([]));
    let schemas = &seen["schemas"];
    assert_eq!(schemas["/tf"], "foxglove.FrameTransforms");
    assert_eq!(
        (&schemas["/pose"], &schemas["/wished_pose"]),
        (&"foxglove.PoseInFrame".into(), &"foxglove.PoseInFrame".into())
    );
    assert_eq!(
        (&schemas["/scene"], &schemas["/log"]),
        (&"foxglove.SceneUpdate".into(), &"foxglove.Log".into())
    );
    let frames = serde_json::json!({ "base_link": "odom", "wheel_1_link": "base_link", "wheel_2_link": "base_link", "wheel_3_link": "base_link" });
    assert_eq!(seen["frames"], frames);
    // Every tenth cycle, and thirty drawings a second.
    let count = |topic: &str| seen["counts"][topic].as_u64().unwrap();
    let rows = cycles.div_ceil(10);
    assert_eq!((count("/state"), count("/wheel_1"), count("/cycle")), (rows, rows, rows));
    let drawings = cycles * 3 / 100;
    for topic in ["/tf", "/pose", "/wished_pose", "/scene"] {
        assert!(count(topic).abs_diff(drawings) <= 1, "{topic}: {} of {drawings}", count(topic));
    }
    assert_eq!(seen["whole_scenes"].as_u64().unwrap(), cycles.div_ceil(1000));
    let all: u64 = seen["counts"].as_object().unwrap().values().map(|count| count.as_u64().unwrap()).sum();
    assert_eq!(seen["counted"], all);
    // Where the robot believed to be, to the bit but for the quaternion's.
    assert!(seen["off"].as_f64().unwrap() < 1e-12, "{}", seen["off"]);
    let phases = ["DISABLED", "ENABLING", "HOLDING", "TRACKING", "HOLDING", "STOPPING", "DISABLED"];
    let phases: Vec<String> = phases.iter().map(|phase| format!("PHASE_{phase}")).collect();
    let seen_phases: Vec<&str> =
        seen["phases"].as_array().unwrap().iter().map(|phase| phase.as_str().unwrap()).collect();
    // What lasts a cycle is between two rows.
    let mut expected = phases.iter();
    assert!(seen_phases.iter().all(|phase| expected.any(|one| one == phase)), "{seen_phases:?}");
    assert!(seen_phases.contains(&"PHASE_TRACKING"), "{seen_phases:?}");
    let log = seen["log"].as_array().unwrap();
    let events = told["events"].as_array().unwrap();
    assert_eq!(log.len(), events.len());
    assert!(log.iter().zip(events).all(|(line, event)| line[0] == event["text"]), "{log:?}");

    let entities = &seen["entities"];
    let kinds = |name: &str| entities[name]["kinds"].clone();
    for (name, frame) in
        [("footprint", "base_link"), ("wheel_2", "wheel_2_link"), ("fence", "odom"), ("path", "odom")]
    {
        assert_eq!(entities[name]["frame"], frame, "{name}: {entities}");
    }
    assert_eq!(kinds("wheel_2"), serde_json::json!({ "lines": 1, "cylinders": 1 }));
    assert_eq!(entities["fence"]["points"].as_array().unwrap().len(), 4);
    let path = entities["path"]["points"].as_array().unwrap();
    assert!((100..=201).contains(&path.len()), "{}", path.len());
    // A circle of 0.2 m about a point 0.2 m from its begin.
    let around: Vec<[f64; 2]> =
        path.iter().map(|at| [at[0].as_f64().unwrap(), at[1].as_f64().unwrap()]).collect();
    let widest = around.iter().map(|[x, y]| x.hypot(*y)).fold(0.0, f64::max);
    assert!((widest - 0.4).abs() < 1e-3, "{widest}");
    // It moved on until the last drawing.
    let obstacle = numbers(&entities["obstacle_1"]["at"][0]);
    let moved_m = 0.1 * (cycles as f64 * 1e-3);
    assert!((obstacle[0] - 1.5 - moved_m).abs() < 0.1 * 0.04, "{obstacle:?} after {moved_m} m");
    assert_eq!(obstacle[1..], [1.5, 0.2]);
    // The wall clock, and no place of this machine among the keys.
    let begun_ns = seen["begun_ns"].as_u64().map(u128::from).unwrap();
    assert!((before_ns..before_ns + 60_000_000_000).contains(&begun_ns), "{begun_ns}");
    assert_eq!(seen["ordered"], true);
    let keys = seen["keys"].as_array().unwrap();
    assert!(keys.iter().all(|key| !key.as_str().unwrap().contains("//")), "{keys:?}");
}
