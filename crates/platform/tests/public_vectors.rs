//! Numbers of public test suites, from a file outside the repository, in this crate's conventions.
//!
//! - `omni_odometry`, `omni_inverse`: their wheels turn the other way round (a counter-clockwise turn of the
//!   body needs negative speeds), so speeds are negated; their `wheel_offset` is our first angle.
//! - `mecanum`: k is the sum of half length and half width, of which any split gives the same numbers; their
//!   wheels are called FL, FR, RR, RL, ours front_left, front_right, rear_left, rear_right.
//! - `fk_base_frame_offset` of it: the pose carries that code's own Euler error and is not ours to meet.
//! - `ramp` of it: one axis with four different limits, which our limits (one per quantity, of a vector) do not have.
//! - `diff_arc`: two wheels are no layout of ours; the twist they stand for is an arc with vy = 0.
//! - `kdl_trapezoid`, `jtc_splines` belong to `omnibase-trajectory`, `cia402` to `omnibase-cia402`.

use omnibase_platform::layout::{mecanum4, omni};
use omnibase_platform::{BodyStep, Kinematics, Odometry, OdometrySettings, PerWheel, Pose2, Twist2};
use serde_json::Value;

const PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/vectors/public-test-vectors.json");

fn group(id: &str) -> Option<Vec<Value>> {
    let Ok(text) = std::fs::read_to_string(PATH) else {
        eprintln!("SKIPPED: {PATH} is missing");
        return None;
    };
    let vectors: Value = serde_json::from_str(&text).unwrap();
    let group = vectors["groups"].as_array().unwrap().iter().find(|group| group["id"] == id).unwrap();
    Some(group["cases"].as_array().unwrap().clone())
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

#[track_caller]
fn close(found: &[f64], expected: &[f64], case: &Value) {
    let tolerance = number(&case["tol"]);
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= tolerance, "{}: {found} is not {expected}", case["name"]);
    }
}

fn omni_of(input: &Value) -> Kinematics {
    let count = input["n"].as_u64().unwrap() as usize;
    let [distance, radius, offset] =
        ["robot_radius", "wheel_radius", "wheel_offset"].map(|name| number(&input[name]));
    Kinematics::new(omni(count, distance, radius, offset)).unwrap()
}

fn axes(twist: Twist2) -> [f64; 3] {
    [twist.vx_m_s, twist.vy_m_s, twist.w_rad_s]
}

fn coordinates(pose: Pose2) -> [f64; 3] {
    [pose.x_m, pose.y_m, pose.heading_rad]
}

#[test]
fn omni_odometry() {
    let Some(cases) = group("omni_odometry") else { return };
    assert_eq!(cases.len(), 5);
    for case in &cases {
        let (input, expected) = (&case["input"], &case["expected"]);
        let kinematics = omni_of(input);
        let speeds = numbers(&input["wheel_velocity"]);
        let speeds = PerWheel::from_fn(speeds.len(), |at| -speeds[at]);
        let period_s = number(&input["dt"]);
        let settings = OdometrySettings::direct_drive(kinematics.wheel_count(), 1_048_576);
        let mut odometry = Odometry::new(kinematics.clone(), settings).unwrap();
        let outcome = odometry
            .advance(&speeds.map(|speed| speed * period_s), period_s, None)
            .map(|state| state.odom_from_base);
        if expected["accepted"] == false {
            assert!(outcome.is_err(), "{}", case["name"]);
            assert_eq!(odometry.state().odom_from_base, Pose2::default());
            continue;
        }
        close(&coordinates(outcome.unwrap()), &numbers(&expected["pose"]), case);
        close(&axes(kinematics.twist(&speeds).twist_in_base), &numbers(&expected["twist"]), case);
    }
}

#[test]
fn omni_inverse() {
    let Some(cases) = group("omni_inverse") else { return };
    assert_eq!(cases.len(), 5);
    for case in &cases {
        let twist = numbers(&case["input"]["twist"]);
        let speeds = omni_of(&case["input"]).wheel_speeds_rad_s(Twist2::new(twist[0], twist[1], twist[2]));
        let negated: Vec<f64> = speeds.iter().map(|speed| -speed).collect();
        let expected = numbers(&case["expected"]["wheel_velocity"]);
        assert_eq!(negated.len(), expected.len());
        close(&negated, &expected, case);
    }
}

#[test]
fn mecanum() {
    let Some(cases) = group("mecanum") else { return };
    let mut applied = 0;
    for case in cases.iter().filter(|case| !case["name"].as_str().unwrap().starts_with("ramp")) {
        let (input, expected) = (&case["input"], &case["expected"]);
        let (k, radius) = (number(&input["k"]), number(&input["wheels_radius"]));
        let kinematics = Kinematics::new(mecanum4(0.6 * k, 0.4 * k, radius)).unwrap();
        let order = ["FL", "FR", "RL", "RR"];
        if let Some(twist) = input["twist"].as_array() {
            let [vx, vy, w] = [0, 1, 2].map(|at| number(&twist[at]));
            let speeds = kinematics.wheel_speeds_rad_s(Twist2::new(vx, vy, w));
            let wished = match expected["wheel_velocity"].as_str() {
                Some(all) => [all.strip_prefix("all ").unwrap().parse().unwrap(); 4],
                None => order.map(|name| number(&expected["wheel_velocity"][name])),
            };
            close(&speeds, &wished, case);
        } else {
            let speeds = PerWheel::from(order.map(|name| number(&input["wheel_velocity"][name])));
            let mut twist = kinematics.twist(&speeds).twist_in_base;
            if let Some(offset) = input["base_frame_offset"].as_array() {
                twist = twist.at(Pose2::new(number(&offset[0]), number(&offset[1]), number(&offset[2])));
            }
            close(&axes(twist), &numbers(&expected["twist"]), case);
        }
        applied += 1;
    }
    assert_eq!(applied, 5);
}

#[test]
fn arcs_of_two_wheels() {
    let Some(cases) = group("diff_arc") else { return };
    assert_eq!(cases.len(), 3);
    for case in &cases {
        let input = &case["input"];
        let period_s = number(&input["dt"]);
        let (v, w) = match input["left"].as_f64() {
            Some(left) => {
                let (right, radius, apart) =
                    (number(&input["right"]), number(&input["r"]), number(&input["sep"]));
                (radius * (left + right) / 2.0, radius * (right - left) / apart)
            }
            None => (number(&input["v"]), number(&input["w"])),
        };
        let end = BodyStep::new(v * period_s, 0.0, w * period_s).exp();
        close(&coordinates(end), &numbers(&case["expected"]["pose"]), case);
    }
}
