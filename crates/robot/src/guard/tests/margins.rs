//! The fence's margin, which grows with how badly the pose is known.

use super::*;

/// A covariance with standard deviations along two axes, the first turned by an angle, and of the heading.
fn covariance([along_m, across_m, heading_rad]: [f64; 3], angle: f64) -> [f64; 6] {
    let (sin, cos) = angle.sin_cos();
    let (a, b) = (along_m * along_m, across_m * across_m);
    [
        a * cos * cos + b * sin * sin,
        (a - b) * sin * cos,
        0.0,
        a * sin * sin + b * cos * cos,
        0.0,
        heading_rad * heading_rad,
    ]
}

#[test]
fn the_margin_grows_with_the_covariance_however_it_is_turned() {
    let radius_m = 0.4_f64.hypot(0.2);
    for (angle, sigmas) in [(0.0, 3.0), (0.5, 3.0), (1.6, 3.0), (0.5, 1.0), (0.5, 0.0)] {
        let mut bench = Bench::oblong(square(1.5).map(|fence| FencePlan { sigmas, ..fence }), &[]);
        bench.state.covariance = covariance([0.02, 0.005, 0.03], angle);
        let pose = bench.driven(Twist2::new(0.5, 0.0, 0.0), 8.0);
        let kept_m = 0.05 + sigmas * (0.02 + radius_m * 0.03);
        let room_m = bench.room_m(&pose);
        assert!((kept_m - 1e-9..kept_m + 0.05).contains(&room_m), "{angle} {sigmas}: {room_m} of {kept_m}");
        let report = bench.guard.report(&pose);
        assert!((report.fence_kept_m.expect("a fence") - kept_m).abs() < 1e-12);
        assert!((report.fence_margin_m.expect("a fence") - room_m).abs() < 1e-12);
    }
    // An obstacle likewise.
    let wall = Obstacle { centre_m: [1.5, 0.0], radius_m: 0.3, velocity_m_s: [0.0; 2] };
    let mut bench = Bench::oblong(None, &[wall]);
    bench.state.covariance = covariance([0.02, 0.005, 0.03], 0.5);
    let pose = bench.driven(Twist2::new(0.5, 0.0, 0.0), 8.0);
    let kept_m = 0.1 + 3.0 * (0.02 + radius_m * 0.03);
    let distance_m = bench.distances_m(&pose)[0];
    assert!((kept_m - 1e-9..kept_m + 0.05).contains(&distance_m), "{distance_m} of {kept_m}");
}

/// What the model of [`PoseGrowth`] adds at most in a period, from a state before it; the heading is wrong by so much.
fn grown(state: &PlatformState, growth: &PoseGrowth, [way_m, turn_rad]: [f64; 2]) -> [f64; 6] {
    let left = WayLeft { way_m, turn_rad, duration_s: 0.0 };
    let after = Spread::of(state).after(&left, growth);
    let [position_m, with_heading_m] = [after.at_m(0.0), after.at_m(1.0)];
    covariance([position_m, position_m, with_heading_m - position_m], 0.0)
}

#[test]
fn the_margin_that_grows_until_the_stop_stands_is_kept() {
    // Odometry as bad as can be: 20 mm after a metre, 1 % of radii; full speed at a wall, along it, and turning.
    let mut growth = PoseGrowth::default();
    growth.variances.position_per_m = 4e-4;
    growth.variances.heading_per_m = 1e-4;
    growth.variances.heading_per_rad = 1e-4;
    (growth.position_per_m, growth.heading_per_rad) = (0.01, 0.01);
    for (twist, seconds) in [
        (Twist2::new(0.8, 0.0, 0.0), 5.0),
        (Twist2::new(0.3, 0.8, 0.0), 8.0),
        (Twist2::new(0.8, 0.1, 1.5), 8.0),
        (Twist2::new(0.1, 0.1, -1.5), 12.0),
    ] {
        let mut bench = Bench::oblong(square(2.0), &[]);
        bench.guard.growth = growth;
        let (mut least_m, mut limited) = (f64::INFINITY, 0);
        for _ in 0..(seconds / PERIOD_S) as u32 {
            let setpoint = bench.stick(twist);
            let now = setpoint.twist_in_odom;
            let way = [now.speed_m_s() * PERIOD_S, now.w_rad_s.abs() * PERIOD_S];
            bench.state.covariance = grown(&bench.state, &growth, way);
            let state = PlatformState { odom_from_body: bench.pose(), ..bench.state };
            bench.guard.spread = Spread::of(&state);
            let left = bench.guard.room_left(&bench.pose());
            least_m = least_m.min(left.room_m - left.kept_m);
            limited += u32::from(bench.guard.limited_by() == LimitedBy::Fence);
        }
        assert!(least_m > -1e-4, "{twist:?}: {least_m}");
        assert!(limited > 100, "{twist:?}: it came to the fence");
    }
}

#[test]
fn a_margin_that_grows_over_a_standing_robot_moves_nothing_and_leaves_the_way_in() {
    let mut bench = Bench::oblong(square(1.5), &[]);
    let held = bench.driven(Twist2::new(0.5, 0.0, 0.0), 8.0);
    // Something else than motion made the pose uncertain: by 0.2 m.
    bench.state.covariance = covariance([0.06, 0.06, 0.0], 0.0);
    let stays = bench.driven(Twist2::default(), 4.0);
    let moved_m = stays.distance_m(held);
    assert!(moved_m < 1e-6 && bench.limiter.is_at_rest(), "nobody wishes anything: {moved_m}");
    for outwards in [Twist2::new(0.5, 0.0, 0.0), Twist2::new(0.0, 0.0, 0.5), Twist2::new(0.2, 0.4, 0.0)] {
        let before_m = bench.room_m(&bench.pose());
        let pose = bench.driven(outwards, 2.0);
        assert!(bench.room_m(&pose) >= before_m - 1e-9, "{outwards:?}: no further out");
    }
    let pose = bench.driven(Twist2::new(-0.3, 0.0, 0.0), 2.0);
    assert!(bench.guard.room_left(&pose).is_enough(), "{pose:?}");
}

#[test]
fn where_nothing_of_the_fence_is_left_only_what_leads_inwards_passes() {
    // More uncertain than the fence is wide: near its side, and in its middle.
    for x_m in [0.9, 0.0] {
        let mut bench = Bench::oblong(square(1.5), &[]);
        bench.put_at(Pose2::new(x_m, 0.0, 0.0));
        bench.state.covariance = covariance([1.0, 1.0, 0.5], 0.0);
        let first_m = bench.room_m(&bench.pose());
        for number in 0..16 {
            let angle = 0.4 * f64::from(number);
            let pose = bench.driven(Twist2::new(0.4 * angle.cos(), 0.4 * angle.sin(), 0.3), 1.0);
            assert!(bench.room_m(&pose) >= first_m - 1e-9, "{x_m} {angle}: {pose:?}");
        }
        assert!(!bench.guard.room_left(&Pose2::default()).is_enough(), "no goal is left");
    }
}
