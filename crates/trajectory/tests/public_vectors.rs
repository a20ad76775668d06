//! Numbers of public test suites, from a file outside the repository, in this crate's conventions.
//!
//! - `jtc_splines`: all cases. Their `[p, v, a]` are value, rate and rate of rate since the segment began.
//! - `kdl_trapezoid`: no profile of ours has unbounded jerk, so none applies.
//! - `mecanum` `ramp_*`: one axis with four limits (up and down, forwards and backwards); ours has one limit each.
//! - The others belong to `omnibase-platform` and `omnibase-cia402`.

use omnibase_trajectory::interpolation::clamped_spline_speeds;
use omnibase_trajectory::path_points::nearest_turn_rad;
use omnibase_trajectory::polynomial::{End, Polynomial};
use omnibase_trajectory::{Interpolation, PathPoints, PointTrajectory, Trajectory};
use serde_json::Value;

const PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/vectors/public-test-vectors.json");

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

#[test]
fn cubic_quintic_and_clamped_spline() {
    let Ok(text) = std::fs::read_to_string(PATH) else {
        eprintln!("SKIPPED: {PATH} is missing");
        return;
    };
    let vectors: Value = serde_json::from_str(&text).unwrap();
    let group =
        vectors["groups"].as_array().unwrap().iter().find(|group| group["id"] == "jtc_splines").unwrap();
    let mut applied = 0;
    for case in group["cases"].as_array().unwrap() {
        let (input, expected, tolerance) = (&case["input"], &case["expected"], number(&case["tol"]));
        match case["name"].as_str().unwrap() {
            name @ ("cubic" | "quintic") => {
                let end = |at: usize| End {
                    position: number(&input["p"][at]),
                    speed: number(&input["v"][at]),
                    acceleration: input["a"][at].as_f64().unwrap_or(0.0),
                };
                let duration_s = number(&input["T"]);
                let polynomial = match name {
                    "cubic" => Polynomial::cubic(end(0), end(1), duration_s),
                    _ => Polynomial::quintic(end(0), end(1), duration_s),
                };
                for (time, wished) in expected["at"].as_object().unwrap() {
                    let time_s = if time == "sqrt2" { 2.0_f64.sqrt() } else { time.parse().unwrap() };
                    let found = polynomial.derivatives(time_s);
                    for (found, wished) in found.iter().zip(wished.as_array().unwrap()) {
                        assert!((found - number(wished)).abs() <= tolerance, "{name} at {time}: {found}");
                    }
                }
            }
            "clamped_cubic_spline_v1" => {
                let values: Vec<f64> = input["points"].as_array().unwrap().iter().map(number).collect();
                let duration_s = number(&input["h"]);
                let speeds = clamped_spline_speeds(&values, &vec![duration_s; values.len() - 1]);
                let text: String = values
                    .iter()
                    .enumerate()
                    .map(|(at, x)| format!("{} {x} 0 0\n", at as f64 * duration_s))
                    .collect();
                let trajectory =
                    PointTrajectory::new(&PathPoints::parse(&text).unwrap(), Interpolation::Spline);
                for (at, wished) in expected["v"].as_array().unwrap().iter().enumerate() {
                    assert!((speeds[at] - number(wished)).abs() <= tolerance);
                    let found = trajectory.sample(trajectory.breaks_s()[at]).twist_in_odom.vx_m_s;
                    assert!((found - number(wished)).abs() <= tolerance);
                }
            }
            "reject_zero_duration_segment" => {
                let points = input["points"].as_array().unwrap();
                let text: String =
                    points.iter().map(|x| format!("{} {x} 0 0\n", number(&input["h"]))).collect();
                assert!(PathPoints::parse(&text).is_err());
            }
            "angle_wrap_current_towards_next" => {
                let found = nearest_turn_rad(number(&input["current"]), number(&input["next"]));
                assert!((found - number(&expected["current"])).abs() <= tolerance);
            }
            other => panic!("a case that nobody has looked at: {other}"),
        }
        applied += 1;
    }
    assert_eq!(applied, 5);
}
