//! The types against those of real ROS 2.

use super::definition::definition;
use super::*;
use std::path::{Path as FilePath, PathBuf};
use std::process::Command;

/// One type with a message of it.
fn one<T: Defined + Field + Serialize>() -> Value {
    let value = T::sample(&mut 0);
    let mut cdr = Vec::new();
    rustdds::serialization::to_writer_with_rep_id(
        &mut cdr,
        &value,
        rustdds::RepresentationIdentifier::CDR_LE,
    )
    .unwrap();
    let cdr: String = [0, 1, 0, 0].iter().chain(&cdr).map(|byte| format!("{byte:02x}")).collect();
    json!({ "name": T::NAME, "definition": definition::<T>(), "value": value, "cdr": cdr })
}

fn all() -> Vec<Value> {
    vec![
        one::<Time>(),
        one::<Duration>(),
        one::<Header>(),
        one::<Text>(),
        one::<Empty>(),
        one::<Clock>(),
        one::<Twist>(),
        one::<TwistStamped>(),
        one::<PoseStamped>(),
        one::<PoseWithCovarianceStamped>(),
        one::<PolygonStamped>(),
        one::<TransformStamped>(),
        one::<Transforms>(),
        one::<Odometry>(),
        one::<Path>(),
        one::<JointState>(),
        one::<DiagnosticArray>(),
        one::<TriggerRequest>(),
        one::<TriggerResponse>(),
        one::<SetBoolRequest>(),
        one::<SetBoolResponse>(),
        one::<JointTrajectory>(),
        one::<MultiDofTrajectory>(),
    ]
}

/// Python with real ROS 2 in it, as `.ci/ros2` makes it.
fn pythons() -> Vec<PathBuf> {
    let target = FilePath::new(env!("CARGO_MANIFEST_DIR")).join("../../target");
    let places = ["jazzy", "kilted"].map(|name| target.join(format!("ros2-{name}/bin/python")));
    places.into_iter().filter(|python| python.is_file()).collect()
}

#[test]
fn types_and_bytes_are_those_of_real_ros_2() {
    let pythons = pythons();
    if pythons.len() < 2 {
        return omnibase_host::skipped("ROS 2 of both distributions isn't there: .ci/ros2 makes it");
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("types.json");
    std::fs::write(&file, serde_json::to_string(&all()).unwrap()).unwrap();
    for python in pythons {
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/types.py");
        let output = Command::new(&python).arg(script).arg(&file).output().unwrap();
        let (said, errors) =
            (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert!(output.status.success(), "{}: {errors}", python.display());
        let said: Value = serde_json::from_str(&said).unwrap();
        // The type of transforms is built from a file of these tests: rosbags knows the real one.
        assert_eq!(
            said,
            json!({ "compared": 23, "by_bags": ["tf2_msgs/msg/TFMessage"] }),
            "{}",
            python.display()
        );
    }
}
