//! The guard alone, with a platform that is where it shall be.

mod margins;
mod shapes;

use super::shape::Point;
use super::*;
use crate::config::FootprintSource;

const PERIOD_S: f64 = 0.004;

fn limits() -> Limits {
    Limits {
        speed_m_s: 0.8,
        acceleration_m_s2: 1.5,
        jerk_m_s3: 20.0,
        turn_speed_rad_s: 1.5,
        turn_acceleration_rad_s2: 4.0,
        turn_jerk_rad_s3: 60.0,
        wheel_speed_rad_s: 1e3,
        wheel_torque_nm: 30.0,
    }
}

fn plan_around(footprint: &[Point]) -> GuardPlan {
    GuardPlan {
        footprint_m: shape::hull(footprint),
        footprint_source: FootprintSource::Given,
        fence: None,
        avoidance: AvoidanceKind::Guarded,
        distance_m: 0.1,
        circulate_1_s: 0.5,
        obstacle_sigmas: 3.0,
        give_up_s: 5.0,
        catch_up_factor: 1.2,
        obstacles: Vec::new(),
    }
}

const OBLONG: [Point; 4] = [[0.4, 0.2], [-0.4, 0.2], [-0.4, -0.2], [0.4, -0.2]];

/// A guard and the limiter behind it.
struct Bench {
    guard: Guard,
    limiter: Limiter,
    cycle: u64,
    /// What is believed beside the pose.
    state: PlatformState,
}

impl Bench {
    fn new(plan: &GuardPlan) -> Self {
        let limits = limits();
        Bench {
            guard: Guard::new(plan, &limits, PERIOD_S, &PoseGrowth::default()),
            limiter: Limiter::new(&limits, PERIOD_S).expect("limits"),
            cycle: 0,
            state: PlatformState::default(),
        }
    }

    fn oblong(fence: Option<FencePlan>, obstacles: &[Obstacle]) -> Self {
        Bench::new(&GuardPlan { fence, obstacles: obstacles.to_vec(), ..plan_around(&OBLONG) })
    }

    fn pose(&self) -> Pose2 {
        self.limiter.setpoint().odom_from_body
    }

    fn put_at(&mut self, pose: Pose2) {
        self.limiter.reset(pose);
    }

    /// One period with a stick.
    fn stick(&mut self, twist: Twist2) -> Setpoint {
        self.cycle += 1;
        let state = PlatformState { odom_from_body: self.pose(), ..self.state };
        self.guard.advance(&CycleTime::on_grid(self.cycle, (PERIOD_S * 1e9) as u64), &state);
        self.guard.step(&mut self.limiter, Drive::Toward(twist), &state)
    }

    /// Where it is after some seconds with a stick.
    fn driven(&mut self, twist: Twist2, seconds: f64) -> Pose2 {
        for _ in 0..(seconds / PERIOD_S) as u32 {
            self.stick(twist);
        }
        self.pose()
    }

    /// To every obstacle from a pose, m; infinite where there is none.
    fn distances_m(&self, pose: &Pose2) -> [f64; MAX_OBSTACLES] {
        let body = self.guard.outline.placed(pose);
        self.guard.obstacles.map(|slot| slot.map_or(f64::INFINITY, |obstacle| distance_m(&body, &obstacle)))
    }

    fn room_m(&self, pose: &Pose2) -> f64 {
        let (_, fence) = self.guard.fence.as_ref().expect("a fence");
        fence.room_m(&self.guard.outline.placed(pose))
    }
}

/// Numbers that look random, the same for the same seed (SplitMix64).
struct Random(u64);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        low + (high - low) * ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn chance(&mut self, part: f64) -> bool {
        self.between(0.0, 1.0) < part
    }

    fn direction(&mut self, size: f64) -> Point {
        let angle = self.between(-3.2, 3.2);
        [size * angle.cos(), size * angle.sin()]
    }
}

/// Seeds 1 to 1000: obstacles too near, or in the footprint, standing or driving on; half of the robots in a narrow
/// fence, too. No cycle of the robot's own brings anything nearer that is too near already; 1e-7 m
/// is what the last step of a stop in cycles may give back.
#[test]
fn what_is_too_near_is_never_brought_nearer() {
    let (mut held, mut moved) = (0_u32, 0_u32);
    for seed in 1..=1000 {
        let mut r = Random(seed);
        let footprint: Vec<Point> = (0..3 + seed % 5)
            .map(|number| {
                let angle = std::f64::consts::TAU * number as f64 / (3 + seed % 5) as f64;
                [r.between(0.2, 0.5) * angle.cos(), r.between(0.2, 0.5) * angle.sin()]
            })
            .collect();
        let mut plan = plan_around(&footprint);
        for _ in 0..1 + seed % 3 {
            let reach_m = r.between(0.1, 0.8);
            let speed_m_s = if r.chance(0.4) { 0.0 } else { r.between(0.0, 0.6) };
            let centre_m = r.direction(reach_m);
            let obstacle =
                Obstacle { centre_m, radius_m: r.between(0.0, 0.3), velocity_m_s: r.direction(speed_m_s) };
            plan.obstacles.push(obstacle);
        }
        if r.chance(0.5) {
            let far = r.between(0.52, 0.7);
            let corners_m = vec![[-far, -far], [far, -far], [far, far], [-far, far]];
            plan.fence = Some(FencePlan { corners_m, margin_m: 0.02, sigmas: 3.0 });
        }
        let mut bench = Bench::new(&plan);
        let mut wish = Twist2::default();
        for cycle in 0..240 {
            if cycle % 60 == 0 {
                let [vx, vy] = r.direction(0.8);
                let turn = if r.chance(0.7) { r.between(-1.5, 1.5) } else { 0.0 };
                wish = if r.chance(0.2) { Twist2::new(0.0, 0.0, turn) } else { Twist2::new(vx, vy, turn) };
            }
            let before = bench.pose();
            let after = bench.stick(wish).odom_from_body;
            let pairs = bench.distances_m(&before).into_iter().zip(bench.distances_m(&after));
            for (number, (was_m, is_m)) in pairs.enumerate() {
                if was_m < plan.distance_m - INSIDE_M {
                    assert!(is_m >= was_m - 1e-7, "seed {seed}, cycle {cycle}, {number}: {was_m} to {is_m}");
                }
            }
            if plan.fence.is_some() {
                assert!(bench.room_m(&after) > 0.02 - 1e-8, "seed {seed}, cycle {cycle}");
            }
            held += u32::from(after == before);
            moved += u32::from(after != before);
        }
    }
    // Both happens: it stays where it must, and gets away where it can.
    assert!(held > 15_000 && moved > 15_000, "{held} {moved}");
}

/// The pose after half a second with a stick, and whether it moved by more than a millimetre or milliradian.
fn gets_away(bench: &mut Bench, twist: Twist2) -> (Pose2, bool) {
    let before = bench.pose();
    let after = bench.driven(twist, 0.5);
    (after, before.distance_m(after) > 1e-3 || (after.heading_rad - before.heading_rad).abs() > 1e-3)
}

#[test]
fn from_what_is_too_near_every_straight_way_out_stays_open() {
    // Before the front side, at a corner, in the footprint, under its centre; points and large ones.
    let places = [[0.45, 0.05], [0.43, 0.23], [0.3, 0.0], [0.0, 0.0], [0.0, 0.2]];
    for centre_m in places {
        for radius_m in [0.0, 0.04, 3.0] {
            let obstacle = Obstacle { centre_m, radius_m, velocity_m_s: [0.0; 2] };
            let normal = Outline::new(&OBLONG).placed(&Pose2::default()).sight(centre_m).normal;
            for number in 0..16 {
                let angle = 0.4 * f64::from(number);
                let twist = Twist2::new(0.3 * angle.cos(), 0.3 * angle.sin(), 0.0);
                let mut bench = Bench::oblong(None, &[obstacle]);
                let (after, moved) = gets_away(&mut bench, twist);
                let along = shape::dot([twist.vx_m_s, twist.vy_m_s], normal);
                let place = format!("{centre_m:?} {radius_m} {angle}: {after:?}");
                if along < -1e-3 {
                    assert!(moved, "{place}");
                }
                let first_m = Bench::oblong(None, &[obstacle]).distances_m(&Pose2::default())[0];
                assert!(bench.distances_m(&after)[0] >= first_m - 1e-9, "{place}");
            }
        }
    }
}

#[test]
fn a_corner_that_would_come_nearer_forbids_the_turn_and_no_other() {
    // Beside the long side, ahead of its middle: turning to the left brings the side nearer, to the right not.
    let beside = Obstacle { centre_m: [0.3, 0.25], radius_m: 0.02, velocity_m_s: [0.0; 2] };
    let (_, left) = gets_away(&mut Bench::oblong(None, &[beside]), Twist2::new(0.0, 0.0, 0.5));
    let (_, right) = gets_away(&mut Bench::oblong(None, &[beside]), Twist2::new(0.0, 0.0, -0.5));
    assert_eq!((left, right), (false, true));
    // Where the turn is forbidden, the way out beside it is not.
    let (after, _) = gets_away(&mut Bench::oblong(None, &[beside]), Twist2::new(0.0, -0.3, 0.5));
    assert!(after.y_m < -0.05, "{after:?}");
    // Hemmed in by two, to each side one: neither turn, but along them.
    let other = Obstacle { centre_m: [-0.3, 0.25], ..beside };
    for turn in [0.5, -0.5] {
        let (after, moved) =
            gets_away(&mut Bench::oblong(None, &[beside, other]), Twist2::new(0.0, 0.0, turn));
        assert!(!moved, "{after:?}");
    }
    let (_, moved) = gets_away(&mut Bench::oblong(None, &[beside, other]), Twist2::new(0.2, 0.0, 0.0));
    assert!(moved);
}

#[test]
fn an_obstacle_that_drives_through_the_footprint_is_brought_nearer_by_none_of_its_sides() {
    let triangle = [0.0_f64, 2.0, 4.0].map(|third| {
        let angle = third * std::f64::consts::FRAC_PI_3;
        [1.2 * angle.cos(), 1.2 * angle.sin()]
    });
    let mut moved = 0_u32;
    for number in 0..200 {
        // In at the rear, out at the right, past the middle, where it is nearest to the left for a few cycles: that is where the robot is sent.
        let beside_m = 0.001 * f64::from(number);
        let obstacle = Obstacle {
            centre_m: [beside_m - 1.0, beside_m + 1.0],
            radius_m: 0.05,
            velocity_m_s: [2.0, -2.0],
        };
        let mut bench = Bench::new(&GuardPlan { obstacles: vec![obstacle], ..plan_around(&triangle) });
        for cycle in 0..250 {
            let before = bench.pose();
            let after = bench.stick(Twist2::new(0.3, 0.3, 0.0)).odom_from_body;
            let [was_m, is_m] = [&before, &after].map(|pose| bench.distances_m(pose)[0]);
            assert!(was_m > 0.0 || is_m >= was_m - 1e-9, "{number}, cycle {cycle}: {was_m} to {is_m}");
            moved += u32::from(was_m < 0.0 && after != before);
        }
    }
    assert!(moved > 1000, "{moved}");
}

#[test]
fn what_a_turn_away_gained_is_not_given_back() {
    let beside = Obstacle { centre_m: [0.3, 0.25], radius_m: 0.02, velocity_m_s: [0.0; 2] };
    let mut moved = 0_u32;
    for number in 0..40 {
        // A turn that is taken back at its own rate is followed with the acceleration of a stop, which may lead past rest.
        let rate_rad_s2 = 0.2 * f64::from(number);
        let mut bench = Bench::oblong(None, &[beside]);
        for cycle in 0..300 {
            let slower = rate_rad_s2 * PERIOD_S * f64::from(u32::saturating_sub(cycle, 20));
            let before = bench.pose();
            let after = bench.stick(Twist2::new(0.0, 0.0, (slower - 0.8).min(0.0))).odom_from_body;
            let [was_m, is_m] = [&before, &after].map(|pose| bench.distances_m(pose)[0]);
            let too_near = was_m < bench.guard.distance_m - INSIDE_M;
            assert!(!too_near || is_m >= was_m - 1e-7, "{number}, cycle {cycle}: {was_m} to {is_m}");
            moved += u32::from(after != before);
        }
    }
    assert!(moved > 1000, "{moved}");
}

#[test]
fn an_obstacle_that_appears_while_it_goes_round_at_full_speed_makes_it_no_faster() {
    // So soft that what speeds it up ends late.
    let limits = Limits { jerk_m_s3: 2.0, ..limits() };
    let mut fastest = 0.0_f64;
    for number in 0..20 {
        let mut bench = Bench::oblong(None, &[]);
        bench.guard.keep_to(&limits, &limits);
        for cycle in 0..1500 {
            let angle = 0.1 * f64::from(number) + 0.6 * PERIOD_S * f64::from(cycle);
            if cycle == 1000 + number {
                let here = bench.pose();
                let [x, y] = [2.0 + 0.1 * f64::from(number), 0.0];
                let centre_m = [here.x_m + x, here.y_m + y];
                let obstacle = Obstacle { centre_m, radius_m: 0.1, velocity_m_s: [0.0; 2] };
                bench.guard.set(0, Some(obstacle)).unwrap();
            }
            let speed_m_s =
                bench.stick(Twist2::new(0.8 * angle.cos(), 0.8 * angle.sin(), 0.0)).twist_in_odom.speed_m_s();
            assert!(speed_m_s <= 0.8 * SPEED_ROUNDING, "{number}, cycle {cycle}: {speed_m_s}");
            fastest = fastest.max(if cycle < 1000 { speed_m_s } else { 0.0 });
        }
    }
    assert!(fastest > 0.799, "{fastest}");
}

#[test]
fn between_fence_and_obstacle_only_what_leaves_both_passes() {
    let corners_m = vec![[-3.0, -0.27], [3.0, -0.27], [3.0, 3.0], [-3.0, 3.0]];
    let fence = Some(FencePlan { corners_m, margin_m: 0.05, sigmas: 3.0 });
    let above = Obstacle { centre_m: [0.0, 0.3], radius_m: 0.05, velocity_m_s: [0.0; 2] };
    for (twist, passes) in [
        (Twist2::new(0.0, 0.3, 0.0), false),
        (Twist2::new(0.0, 0.0, 0.6), false),
        (Twist2::new(0.0, 0.0, -0.6), false),
        (Twist2::new(0.3, 0.0, 0.0), true),
        (Twist2::new(-0.3, 0.0, 0.0), true),
    ] {
        let mut bench = Bench::oblong(fence.clone(), &[above]);
        let (after, moved) = gets_away(&mut bench, twist);
        assert_eq!(moved, passes, "{twist:?} {after:?}");
        assert!(bench.room_m(&after) >= 0.05 - 1e-9);
        assert!(bench.distances_m(&after)[0] >= 0.05 - 1e-9);
    }
    // An obstacle that presses on: both keep, and the robot stands.
    let pressing = Obstacle { velocity_m_s: [0.0, -0.05], ..above };
    let mut bench = Bench::oblong(fence, &[pressing]);
    let (after, moved) = gets_away(&mut bench, Twist2::new(0.1, -0.3, 0.6));
    assert!(bench.room_m(&after) >= 0.05 - 1e-9, "{after:?} {moved}");
}

#[test]
fn a_robot_outside_of_its_fence_comes_in_and_goes_no_further_out() {
    // An L whose inner corner is at the origin.
    let corners_m = vec![[-3.0, -3.0], [3.0, -3.0], [3.0, 0.0], [0.0, 0.0], [0.0, 3.0], [-3.0, 3.0]];
    let turned: Vec<Point> = corners_m.iter().rev().copied().collect();
    for corners_m in [corners_m, turned] {
        let fence = FencePlan { corners_m, margin_m: 0.05, sigmas: 3.0 };
        // Over the right side, in the notch, wholly outside, over an outer corner, with the inner corner in the body.
        for (x_m, y_m, heading_rad) in
            [(2.8, -1.5, 0.3), (1.5, 0.1, 0.0), (4.0, -1.5, 0.2), (2.9, -2.9, 0.8), (-0.1, -0.1, 0.7)]
        {
            let begin = Pose2::new(x_m, y_m, heading_rad);
            let mut least_m = f64::INFINITY;
            for number in 0..16 {
                let angle = 0.4 * f64::from(number);
                for turn in [0.0, 0.7, -0.7] {
                    let mut bench = Bench::oblong(Some(fence.clone()), &[]);
                    bench.put_at(begin);
                    let first_m = bench.room_m(&begin);
                    let after = bench.driven(Twist2::new(0.4 * angle.cos(), 0.4 * angle.sin(), turn), 1.0);
                    let room_m = bench.room_m(&after);
                    assert!(room_m >= first_m - 1e-9, "{begin:?} {angle} {turn}: {first_m} to {room_m}");
                    least_m = least_m.min(first_m - room_m);
                }
            }
            assert!(least_m < -0.05, "no way in from {begin:?}: {least_m}");
        }
    }
}

#[test]
fn along_a_corner_that_points_inwards_the_margin_holds() {
    // A wedge points into the room from above; the robot is driven past it while it turns.
    let corners_m = vec![[-3.0, -3.0], [3.0, -3.0], [3.0, 2.0], [0.0, 0.35], [-3.0, 2.0]];
    let fence = FencePlan { corners_m, margin_m: 0.05, sigmas: 3.0 };
    for turn in [0.0, 0.8, -0.8] {
        let mut bench = Bench::oblong(Some(fence.clone()), &[]);
        bench.put_at(Pose2::new(-1.2, 0.0, 0.0));
        let mut least_m = f64::INFINITY;
        for _ in 0..2000 {
            let pose = bench.stick(Twist2::new(0.5, 0.3, turn)).odom_from_body;
            least_m = least_m.min(bench.room_m(&pose));
        }
        assert!((0.05 - 1e-9..0.1).contains(&least_m), "{turn}: {least_m}");
    }
}

#[test]
fn numbers_that_are_none_end_in_the_stop_that_was_let_through() {
    let wall = Obstacle { centre_m: [1.2, 0.0], radius_m: 0.3, velocity_m_s: [0.0; 2] };
    let nan = f64::NAN;
    for case in 0..4 {
        let mut bench = Bench::oblong(None, &[wall]);
        bench.driven(Twist2::new(0.8, 0.0, 0.0), 0.8);
        assert!(bench.limiter.setpoint().twist_in_odom.vx_m_s > 0.2);
        for _ in 0..500 {
            let mut state = PlatformState { odom_from_body: bench.pose(), ..Default::default() };
            let mut wished = Setpoint::at_rest(Pose2::new(5.0, 0.0, 0.0));
            let most = SpeedBound { speed_m_s: 1.0, turn_speed_rad_s: 1.0 };
            let mut followed = Followed { wished, most, on_path: None };
            let drive = match case {
                0 => Drive::Toward(Twist2::new(nan, 0.0, 0.0)),
                1 => Drive::Toward(Twist2::new(0.8, 0.0, f64::INFINITY)),
                2 => {
                    state.odom_from_body.heading_rad = nan;
                    Drive::Toward(Twist2::new(0.8, 0.0, 0.0))
                }
                _ => {
                    wished.odom_from_body.x_m = nan;
                    followed.wished = wished;
                    Drive::Follow(&followed)
                }
            };
            bench.guard.step(&mut bench.limiter, drive, &state);
            assert!(bench.distances_m(&bench.pose())[0] >= 0.1 - 1e-9, "case {case}");
        }
        assert!(bench.limiter.is_at_rest(), "case {case}");
    }
}

#[test]
fn a_wish_beyond_all_measure_keeps_limits_and_fence() {
    let corners_m = vec![[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let fence = FencePlan { corners_m, margin_m: 0.05, sigmas: 3.0 };
    for size in [1e6, 1e150, f64::MAX] {
        for wish in [Twist2::new(size, -size, size), Twist2::new(-size, size, -size)] {
            let mut bench = Bench::oblong(Some(fence.clone()), &[]);
            for _ in 0..1000 {
                let setpoint = bench.stick(wish);
                assert!(setpoint.twist_in_odom.speed_m_s() <= 0.8 + 1e-9 && setpoint.is_finite());
                assert!(bench.room_m(&setpoint.odom_from_body) >= 0.05 - 1e-9);
            }
        }
    }
}

#[test]
fn obstacles_that_cannot_be_are_refused_and_change_nothing() {
    let good = Obstacle { centre_m: [2.0, 0.0], radius_m: 0.2, velocity_m_s: [0.1, 0.0] };
    let mut guard = Guard::new(&plan_around(&OBLONG), &limits(), PERIOD_S, &PoseGrowth::default());
    assert_eq!(guard.set(3, Some(good)), Ok(()));
    for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -2e6, 2e6] {
        for broken in [
            Obstacle { centre_m: [wrong, 0.0], ..good },
            Obstacle { centre_m: [0.0, wrong], ..good },
            Obstacle { radius_m: wrong, ..good },
            Obstacle { velocity_m_s: [wrong, 0.0], ..good },
            Obstacle { velocity_m_s: [0.0, wrong], ..good },
        ] {
            assert_eq!(guard.set(3, Some(broken)), Err(()), "{broken:?}");
        }
    }
    assert_eq!(guard.set(3, Some(Obstacle { radius_m: -1e-9, ..good })), Err(()));
    assert_eq!(guard.obstacles()[3], Some(good));
    // A point, and the greatest one, are obstacles.
    assert_eq!(guard.set(3, Some(Obstacle { radius_m: 0.0, ..good })), Ok(()));
    assert_eq!(guard.set(3, Some(Obstacle { radius_m: crate::obstacle::GREATEST, ..good })), Ok(()));
    // There is a last place, and no other; the taking away of nothing is no error.
    let last = MAX_OBSTACLES as u32 - 1;
    assert_eq!((guard.set(last, Some(good)), guard.set(last + 1, Some(good))), (Ok(()), Err(())));
    assert_eq!((guard.set(u32::MAX, None), guard.set(7, None)), (Err(()), Ok(())));
}

#[test]
fn a_ring_of_as_many_obstacles_as_there_may_be_is_kept_off() {
    let ring: Vec<Obstacle> = (0..MAX_OBSTACLES)
        .map(|number| {
            let angle = std::f64::consts::TAU * number as f64 / MAX_OBSTACLES as f64;
            let centre_m = [1.3 * angle.cos(), 1.3 * angle.sin()];
            Obstacle { centre_m, radius_m: 0.2, velocity_m_s: [0.0; 2] }
        })
        .collect();
    let mut bench = Bench::oblong(None, &ring);
    let mut nearest_m = f64::INFINITY;
    for number in 0..3000 {
        let angle = 0.002 * f64::from(number);
        let twist = Twist2::new(0.8 * angle.cos(), 0.8 * angle.sin(), 1.0);
        let pose = bench.stick(twist).odom_from_body;
        nearest_m = bench.distances_m(&pose).into_iter().fold(nearest_m, f64::min);
    }
    assert!((0.1 - 1e-9..0.2).contains(&nearest_m), "{nearest_m}");
}

#[test]
fn a_concave_footprint_counts_as_its_hull() {
    // A U that is open to the front; an obstacle stands in its opening, and is in the way all the same.
    let u = [
        [0.4, 0.3],
        [-0.4, 0.3],
        [-0.4, -0.3],
        [0.4, -0.3],
        [0.4, -0.1],
        [-0.2, -0.1],
        [-0.2, 0.1],
        [0.4, 0.1],
    ];
    let plan = plan_around(&u);
    assert_eq!(plan.footprint_m.len(), 4);
    let inside = Obstacle { centre_m: [0.2, 0.0], radius_m: 0.02, velocity_m_s: [0.0; 2] };
    let mut bench = Bench::new(&GuardPlan { obstacles: vec![inside], ..plan });
    assert!(bench.distances_m(&Pose2::default())[0] < 0.0);
    // It gives way to the rear, even if it is sent to the front.
    for speed_m_s in [0.3, -0.3] {
        let (after, moved) = gets_away(&mut bench, Twist2::new(speed_m_s, 0.0, 0.0));
        assert!(moved && after.x_m < 0.0, "{speed_m_s}: {after:?}");
    }
}

/// A square fence of so many metres to each side.
fn square(half_m: f64) -> Option<FencePlan> {
    let corners_m = vec![[-half_m, -half_m], [half_m, -half_m], [half_m, half_m], [-half_m, half_m]];
    Some(FencePlan { corners_m, margin_m: 0.05, sigmas: 3.0 })
}

#[test]
fn on_a_floor_that_carries_less_the_stop_is_longer_and_the_margin_holds() {
    let softer = Limits { acceleration_m_s2: 0.3, turn_acceleration_rad_s2: 0.8, ..limits() };
    // Known from the start, and found out at full speed, near to the fence or far from it.
    for found_after_s in [0.0, 0.8, 1.4, 1.6, 1.8] {
        let mut bench = Bench::oblong(square(1.5), &[]);
        let (mut least_m, mut hardest, mut fastest) = (f64::INFINITY, 0.0_f64, 0.0_f64);
        for cycle in 0..3000 {
            if f64::from(cycle) * PERIOD_S >= found_after_s {
                bench.guard.keep_to(&softer, &softer);
            }
            let setpoint = bench.stick(Twist2::new(0.8, 0.0, 0.3));
            least_m = least_m.min(bench.room_m(&setpoint.odom_from_body));
            hardest = hardest.max(setpoint.acceleration_in_odom.speed_m_s());
            fastest = fastest.max(setpoint.twist_in_odom.speed_m_s());
        }
        assert!(least_m >= 0.05 - 1e-9, "{found_after_s}: {least_m}");
        assert!(fastest > 0.4, "{found_after_s}: {fastest}");
        assert!(found_after_s > 0.0 || hardest <= 0.3 + 1e-9, "{hardest}");
    }
}
