//! Pausing, resuming and reversing on the path.

use omnibase_platform::{Pose2, Twist2};
use omnibase_trajectory::{
    Heading, Limits, Playback, PlaybackError, Setpoint, Shape, ShapeTrajectory, Trajectory,
};

const LIMITS: Limits = Limits {
    speed_m_s: 0.6,
    acceleration_m_s2: 0.8,
    jerk_m_s3: 5.0,
    rate_rad_s: 1.5,
    angular_acceleration_rad_s2: 1.0,
    angular_jerk_rad_s3: 8.0,
};

fn circle() -> ShapeTrajectory {
    ShapeTrajectory::new(Shape::Circle { radius_m: 0.5 }, Heading::FollowsTangent, 1.0, 12.0).unwrap()
}

#[test]
fn at_full_rate_the_trajectory_is_played_as_it_is() {
    let mut playback = Playback::new(circle(), &LIMITS, 1e-3).unwrap();
    let mut last = Setpoint::default();
    let mut cycles = 0u32;
    while playback.position_s() < 12.0 {
        last = playback.step(1.0);
        cycles += 1;
        let expected = circle().sample(f64::from(cycles) * 1e-3);
        assert!(last.odom_from_base.distance_m(expected.odom_from_base) < 1e-11, "cycle {cycles}");
        assert!((last.twist_in_odom.vx_m_s - expected.twist_in_odom.vx_m_s).abs() < 1e-11, "cycle {cycles}");
        assert!(cycles <= 12_001);
    }
    assert!(playback.is_at_an_end());
    assert!(last.odom_from_base.distance_m(Pose2::default()) < 1e-12);
    assert_eq!(playback.step(1.0).twist_in_odom, Twist2::default());
}

#[test]
fn random_pauses_reversals_and_resumes_keep_limits_and_path() {
    let period_s = 1e-3;
    let mut playback = Playback::new(circle(), &LIMITS, period_s).unwrap();
    let mut state = 0x0123_4567_89AB_CDEFu64;
    let (mut wish, mut before) = (1.0, Setpoint::default());
    let mut peaks = [0.0_f64; 6];
    for cycle in 0..1_000_000u32 {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        if cycle % 400 == 0 {
            wish = [1.0, -1.0, 0.0, 0.3, -0.6, 1.0, 2.0][(state >> 33) as usize % 7];
        }
        let now = playback.step(wish);
        let pose = now.odom_from_base;
        assert!((pose.distance_m(Pose2::new(0.0, 0.5, 0.0)) - 0.5).abs() < 1e-12, "off the circle");
        if !playback.is_at_an_end() {
            let found = [now.twist_in_odom, now.acceleration_in_odom, now.jerk_in_odom];
            let limits = [
                (LIMITS.speed_m_s, LIMITS.rate_rad_s),
                (LIMITS.acceleration_m_s2, LIMITS.angular_acceleration_rad_s2),
                (LIMITS.jerk_m_s3, LIMITS.angular_jerk_rad_s3),
            ];
            for (at, (found, (along, turning))) in found.into_iter().zip(limits).enumerate() {
                peaks[at] = peaks[at].max(found.speed_m_s() / along);
                peaks[at + 3] = peaks[at + 3].max(found.w_rad_s.abs() / turning);
            }
            // The twist is the rate of the pose: over a cycle they agree to the acceleration's share.
            let way = before.odom_from_base.distance_m(pose);
            assert!((way - now.twist_in_odom.speed_m_s() * period_s).abs() < 0.9 * period_s * period_s);
        }
        before = now;
    }
    println!("shares of the limits used: {peaks:?}");
    assert!(peaks.iter().all(|peak| *peak <= 1.0 + 1e-9), "{peaks:?}");
    assert!(peaks[0] > 0.7 && peaks[1] > 0.6, "{peaks:?}");
}

#[test]
fn a_trajectory_at_its_limits_leaves_nothing_for_pausing() {
    let limits = Limits { acceleration_m_s2: 0.35, ..LIMITS };
    let error = Playback::new(circle(), &limits, 1e-3).unwrap_err();
    assert!(matches!(error, PlaybackError::NothingLeft { .. }), "{error}");
    assert_eq!(Playback::new(circle(), &LIMITS, 0.0).unwrap_err(), PlaybackError::Period(0.0));
}
