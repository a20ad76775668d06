//! Robots built with the tolerances of their file are as far from where they believe to be as their covariance says.

use std::ops::Range;

use omnibase_trials::builds::{
    CREEP_TOLD, Case, Driven, PLACES, PoseError, Summary, Wheels, drive, nees_band,
};

const ROBOTS: usize = 60;

fn summaries(driven: &[Driven], places: fn(&Driven) -> [PoseError; PLACES]) -> Vec<Summary> {
    let at = |place: usize| driven.iter().map(|driven| places(driven)[place]).collect::<Vec<_>>();
    (0..PLACES).map(|place| Summary::of(&at(place))).collect()
}

/// Sixty robots of a case, whose median error at the end lies within these bounds, m.
fn are_where_their_covariance_says(case: Case, median_m: Range<f64>) {
    let [low, high] = nees_band(ROBOTS);
    let plan = case.plan(CREEP_TOLD);
    let driven: Vec<Driven> =
        (1..=ROBOTS as u64).map(|seed| drive(plan.clone(), Wheels::Drawn, seed)).collect();
    for (place, summary) in summaries(&driven, |driven| driven.drawn).iter().enumerate() {
        let shown = format!("{case:?} at {place}: {summary:?}");
        assert!((low..high).contains(&summary.nees), "{shown}");
        // 0.16 are to be expected of 60; three are less likely than one in a thousand.
        assert!(summary.outside.iter().all(|outside| *outside <= 2), "{shown}");
    }
    let end = &summaries(&driven, |driven| driven.drawn)[PLACES - 1];
    assert!(median_m.contains(&end.median_m), "{case:?}: {end:?}");
    // Without what start and floor add the covariance is never too small.
    for summary in summaries(&driven, |driven| driven.even) {
        assert!(summary.nees < high, "{case:?}: {summary:?}");
    }
}

// A test a case, for they run beside each other.
#[test]
fn sixty_robots_on_a_circle_are_where_their_covariance_says() {
    are_where_their_covariance_says(Case { robot: "bmm", path: "circle" }, 4e-3..8e-3);
}

#[test]
fn sixty_mecanum_robots_on_a_circle_are_where_their_covariance_says() {
    are_where_their_covariance_says(Case { robot: "mecanum", path: "circle" }, 4e-3..9e-3);
}

#[test]
fn sixty_robots_on_a_square_are_where_their_covariance_says() {
    are_where_their_covariance_says(Case { robot: "bmm", path: "square" }, 18e-3..36e-3);
}

#[test]
fn what_slip_alone_leaves_lies_within_the_covariance() {
    // One robot is enough: nothing is drawn. A third of a standard deviation with the creep told, one without.
    for case in Case::all() {
        for (estimator, most) in [(CREEP_TOLD, 0.11), ("", 1.0)] {
            let driven = drive(case.plan(estimator), Wheels::Exact, 1);
            for place in driven.even {
                assert!(place.nees < most, "{case:?} {estimator}: {place:?}");
            }
        }
    }
}

#[test]
fn rollers_that_stand_hold_a_robot_straight_and_no_slip_is_told() {
    // Wheels that contradict each other turn the platform while it drives straight ahead, and their rollers hold it.
    let plan = Case { robot: "mecanum", path: "eight" }.plan(CREEP_TOLD);
    for seed in [1001, 1013] {
        // It doesn't stop on its way.
        drive(plan.clone(), Wheels::Drawn, seed);
    }
}
