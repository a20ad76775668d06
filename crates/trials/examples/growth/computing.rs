//! A robot's computing and its simulation, without frames, by its wheels and by what is around it.

use omnibase_robot::config::FencePlan;
use omnibase_robot::guard::Obstacle;
use omnibase_robot::{Phase, RequestKind};
use omnibase_trials::{Trial, plan_of, robots};
use std::fmt::Write;

use super::{Growth, median_us};

const OMNI4: &str = include_str!("../../../../robots/omni4.toml");
/// Cycles that are looked at, a little less than the circle takes.
const CYCLES: usize = 9000;

/// So many omni wheels on a circle, and a circle that they drive.
fn on_wheels(count: u32) -> String {
    let (head, rest) = OMNI4.split_once("[[drive]]").expect("drives");
    let (_, tail) = rest.split_once("[platform]").expect("a platform");
    let is_of_layout =
        |line: &&str| !line.starts_with("centre_distance_m") && !line.starts_with("first_wheel");
    let tail: Vec<&str> = tail.lines().filter(is_of_layout).collect();
    let tail = tail.join("\n").replace("layout = \"omni4\"", "layout = \"wheels\"");
    let mut text = head.to_owned();
    for position in 0..count {
        let _ = writeln!(text, "[[drive]]\nname = \"wheel_{}\"\nposition = {position}", position + 1);
    }
    let _ = writeln!(text, "[platform]{tail}");
    for wheel in 0..count {
        let angle = std::f64::consts::TAU * f64::from(wheel) / f64::from(count);
        let ([x, y], rolls) = ([0.28 * angle.cos(), 0.28 * angle.sin()], angle + std::f64::consts::FRAC_PI_2);
        let _ =
            writeln!(text, "[[platform.wheel]]\nposition_m = [{x:?}, {y:?}]\nrolling_angle_rad = {rolls:?}");
    }
    text + robots::CIRCLE
}

/// Medians of computing and of the simulation, us a cycle, while the reference is tracked.
fn measured(trial: &mut Trial) -> [f64; 2] {
    let mut simulation = Vec::with_capacity(CYCLES);
    let computing = {
        let trial = &mut *trial;
        let mut one = || {
            let simulated = median_us(1, || trial.exchange());
            simulation.push(simulated);
            median_us(1, || {
                trial.compute(None);
            })
        };
        let mut all: Vec<f64> = (0..CYCLES).map(|_| one()).collect();
        all.sort_by(f64::total_cmp);
        all[CYCLES / 2]
    };
    assert_eq!(trial.robot.phase(), Phase::Tracking, "{:?}", trial.robot.record().stop_reason);
    simulation.sort_by(f64::total_cmp);
    [computing, simulation[CYCLES / 2]]
}

/// By wheels.
pub(super) fn wheels() -> Growth {
    let rows = (3..=8).map(|count| {
        let mut trial = Trial::new(plan_of(&on_wheels(count)));
        trial.enable();
        trial.step(Some(RequestKind::Track));
        (f64::from(count), measured(&mut trial).into())
    });
    Growth {
        title: "A cycle of a robot on omni wheels",
        across: "wheels",
        curves: vec!["computing, us", "its simulation without frames, us"],
        rows: rows.collect(),
    }
}

/// By obstacles on a circle around the one that is driven, 0.4 m from what the footprint sweeps, in a fence.
pub(super) fn obstacles() -> Growth {
    let mut plan = plan_of(&format!("{}{}", robots::BMM, robots::CIRCLE));
    let footprint_m = plan.guard.footprint_m.iter().map(|[x, y]| x.hypot(*y)).fold(0.0, f64::max);
    let corners_m = vec![[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]];
    plan.guard.fence = Some(FencePlan { corners_m, margin_m: 0.05, sigmas: 3.0 });
    let centre_m = centre_of(Trial::new(plan.clone()));
    let rows = [0, 1, 2, 4, 8, 16].map(|count| {
        let mut trial = Trial::new(plan.clone());
        for index in 0..count {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(index) / 16.0).sin_cos();
            let away_m = 0.5 + footprint_m + 0.4;
            let obstacle = Obstacle {
                centre_m: [centre_m[0] + away_m * cos, centre_m[1] + away_m * sin],
                radius_m: 0.02,
                velocity_m_s: [0.0; 2],
            };
            trial.step(Some(RequestKind::SetObstacle { index, obstacle }));
        }
        trial.enable();
        trial.step(Some(RequestKind::Track));
        (f64::from(count), vec![measured(&mut trial)[0]])
    });
    Growth {
        title: "A cycle of a robot with three wheels in a fence, obstacles around its circle",
        across: "obstacles",
        curves: vec!["computing, us"],
        rows: rows.into(),
    }
}

/// The middle of the circle that is driven.
fn centre_of(mut trial: Trial) -> [f64; 2] {
    trial.enable();
    trial.step(Some(RequestKind::Track));
    let places: Vec<[f64; 2]> = (0..CYCLES)
        .map(|_| {
            let pose = trial.step(None).setpoint.odom_from_body;
            [pose.x_m, pose.y_m]
        })
        .collect();
    [0, 1].map(|axis| {
        let all = || places.iter().map(|place| place[axis]);
        0.5 * (all().fold(f64::INFINITY, f64::min) + all().fold(f64::NEG_INFINITY, f64::max))
    })
}
