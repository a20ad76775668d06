//! A share of the seeded approaches to fences and obstacles; the example of the same name runs all of them.

use omnibase_robot::Registry;
use omnibase_robot::config::AvoidanceKind;
use omnibase_robot::signals::SafetyReason;
use omnibase_trials::approaches::{register_kinematic, run};
use omnibase_trials::replans::{self, Replans};
use omnibase_trials::{plan_of, robots};

/// Less than this isn't nearer, m: rounding.
const ROUNDING_M: f64 = 1e-9;

/// Seeds 1 to 2000, two that are known to be hard, and three in which an obstacle drives through a robot past the middle between its sides; the body follows the setpoint one cycle late, which the margins hold, and its odometry drifts, which `sigmas` do.
#[test]
fn no_footprint_crosses_a_fence_or_meets_an_obstacle_by_its_own_motion() {
    let mut registry = Registry::with_built_in();
    register_kinematic(&mut registry);
    let bases = [plan_of(robots::BMM), plan_of(robots::MECANUM)];
    let (mut limited, mut fenced, mut fast, mut off, mut given_up) = (0, 0, 0, 0, 0);
    for seed in (1..=2000).chain([76_270, 78_885, 16_002_034, 26_027_183, 26_087_088]) {
        let result = run(&bases[(seed % 2) as usize], &registry, seed, AvoidanceKind::Guarded);
        assert!(result.fence_m > 0.0, "seed {seed}: {result:?}");
        assert!(result.true_fence_m > 0.0, "seed {seed}: {result:?}");
        assert!(result.standing_m > 0.0, "seed {seed}: {result:?}");
        assert!(result.own_step_m < ROUNDING_M, "seed {seed}: {result:?}");
        assert!(result.shares.iter().all(|share| *share <= 1.0 + 1e-6), "seed {seed}: {result:?}");
        limited += u32::from(result.limited > 0);
        fenced += u32::from(result.fence_m < 0.1);
        fast += u32::from(result.shares[0] > 0.9);
        off += u32::from(result.error_m > 0.01);
        given_up += u32::from(result.given_up || result.refused);
    }
    // They are approaches: many were held back, came near, and were fast.
    assert!(limited > 500 && fenced > 100 && fast > 200, "{limited} {fenced} {fast}");
    // Odometry drifts, and ways are blocked.
    assert!(off > 100 && given_up > 50, "{off} {given_up}");
}

/// Seeds 1 to 100; one in which a platform that was paused beside a fence held before it stood; and some in which it was stopped for slip
/// or for being too far off, where nothing slips and a plan that is held back leads it.
#[test]
fn motions_that_are_replaced_under_way_keep_every_limit_and_stay_stopped_once_they_are() {
    let mut registry = Registry::with_built_in();
    register_kinematic(&mut registry);
    let bases = [plan_of(robots::BMM), plan_of(robots::MECANUM)];
    let mut all = Replans { fence_m: f64::INFINITY, ..Default::default() };
    for seed in (1..=100).chain([304_552, 101_048, 102_738, 106_792, 107_928, 109_106]) {
        let result = replans::run(&bases[(seed % 2) as usize], &registry, seed, 40);
        let wrong = [result.beyond, result.steps, result.outside, result.moved];
        assert_eq!(wrong, [0; 4], "seed {seed}: beyond a limit, steps, outside, moved by nobody");
        let is_wrong = |(reason, _): &&(SafetyReason, u64)| {
            matches!(reason, SafetyReason::WheelSlip | SafetyReason::TrackingError)
        };
        assert_eq!(result.by_itself.iter().find(is_wrong), None, "seed {seed}");
        all.add(&result);
    }
    let taken_while_moving = all.counts.map(|[_, _, moving]| moving);
    assert!(taken_while_moving[..2].iter().all(|times| *times > 100), "{taken_while_moving:?}");
    assert!(all.joined > 50 && all.stops > 100, "{} {}", all.joined, all.stops);
}
