//! Headway alone, along a straight line.

use super::*;
use crate::config::{AvoidanceKind, FootprintSource};

const CYCLE_S: f64 = 0.01;

fn headway() -> Headway {
    Headway::new(&GuardPlan {
        footprint_m: Vec::new(),
        footprint_source: FootprintSource::Given,
        fence: None,
        avoidance: AvoidanceKind::Guarded,
        distance_m: 0.1,
        circulate_1_s: 0.5,
        obstacle_sigmas: 3.0,
        give_up_s: 5.0,
        catch_up_factor: 1.2,
        obstacles: Vec::new(),
    })
}

/// A plan at 0.2 m/s whose time passes at a rate: its step and place after some of its time, and the platform's place.
fn cycle(headway: &mut Headway, rate: f64, [plan_s, here_m]: [f64; 2]) {
    let speed = SpeedBound { speed_m_s: 0.2, turn_speed_rad_s: 0.0 };
    let step = PlanStep { elapsed_s: CYCLE_S, passed_s: rate * CYCLE_S, rate: 1.0, speed };
    let at = |x_m| Setpoint::at_rest(Pose2::new(x_m, 0.0, 0.0));
    headway.note(&step, [&at(0.2 * plan_s), &at(here_m)]);
}

/// Seconds until it is given up; the plan's rate and the platform's place are those of a time.
fn given_up_after_s(of: impl Fn(f64) -> [f64; 2]) -> Option<f64> {
    let mut headway = headway();
    let mut plan_s = 0.0;
    (0..10_000).map(|number| f64::from(number) * CYCLE_S).find(|time_s| {
        let [rate, here_m] = of(*time_s);
        plan_s += rate * CYCLE_S;
        cycle(&mut headway, rate, [plan_s, here_m]);
        headway.is_blocked()
    })
}

#[test]
fn a_plan_that_stands_is_given_up_after_its_time_and_not_before() {
    // Two seconds at its rate, 0.4 m behind; then it stands.
    let after_s =
        given_up_after_s(|time_s| if time_s < 2.0 { [1.0, 0.0] } else { [0.0, 0.0] }).expect("it stands");
    assert!((after_s - 7.0).abs() < 2.5 * CYCLE_S, "{after_s}");
}

#[test]
fn a_plan_that_creeps_or_goes_on_for_moments_is_given_up_too() {
    // A twentieth of the rate: half of the time is headway; and a tenth of a second at the full rate in four seconds.
    let creeping_s = given_up_after_s(|_| [0.05, -1.0]).expect("it creeps");
    assert!((creeping_s - 10.0).abs() < 0.1, "{creeping_s}");
    let moments_s =
        given_up_after_s(|time_s| [if time_s % 4.0 < 0.1 { 1.0 } else { 0.0 }, -1.0]).expect("it creeps");
    assert!((5.0..9.0).contains(&moments_s), "{moments_s}");
    assert_eq!(given_up_after_s(|_| [0.2, -1.0]), None, "a fifth of the rate is headway");
}

#[test]
fn to_and_fro_is_no_headway_but_coming_nearer_is() {
    // Half a metre to and fro before a place that isn't reached.
    let pacing = |time_s: f64| [if time_s < 1.0 { 1.0 } else { 0.0 }, -1.0 + 0.5 * (time_s * 1.5).sin()];
    let after_s = given_up_after_s(pacing).expect("it paces");
    // It came nearer by a metre once, which is worth a moment.
    assert!((5.0..9.0).contains(&after_s), "{after_s}");
    // A long way around comes nearer at 3 cm/s.
    assert_eq!(given_up_after_s(|time_s| [0.0, -10.0 + 0.03 * time_s]), None);
}

#[test]
fn a_plan_that_shall_wait_is_never_given_up() {
    let mut headway = headway();
    let at = |x_m| Setpoint::at_rest(Pose2::new(x_m, 0.0, 0.0));
    for _ in 0..10_000 {
        headway.note(&PlanStep { elapsed_s: CYCLE_S, ..PlanStep::default() }, [&at(1.0), &at(0.0)]);
    }
    assert!(!headway.is_blocked());
}

#[test]
fn what_is_caught_up_with_is_the_paths_own_speed_where_it_was_left_and_a_little_more() {
    let mut headway = headway();
    let rests = SpeedBound::default();
    let at_least = headway.bound(&rests);
    assert_eq!(at_least, SpeedBound { speed_m_s: 0.05, turn_speed_rad_s: 0.1 });
    cycle(&mut headway, 1.0, [1.0, 0.0]);
    // The plan rests by now, but what was missed was driven at 0.2 m/s.
    assert!((headway.bound(&rests).speed_m_s - 0.24).abs() < 1e-12);
    // Caught up with: what was counts no more.
    let step = PlanStep { elapsed_s: CYCLE_S, passed_s: 0.0, rate: 1.0, speed: rests };
    let there = Setpoint::at_rest(Pose2::new(0.2, 0.0, 0.0));
    headway.note(&step, [&there, &there]);
    assert_eq!(headway.bound(&rests), at_least);
}
