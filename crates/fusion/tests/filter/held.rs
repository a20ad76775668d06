//! A gyro that tells nothing of the turn, while the control law holds the heading that is believed.

use omnibase_fusion::{Filter, Reading, Sensor, Verdict};
use omnibase_platform::{Pose2, Twist2};

use crate::faulty::{THREE_SIGMA, every};
use crate::followed::wheels;
use crate::world::{World, error, gyro, mouse, nees, settings};

/// What came of it.
#[derive(Debug)]
struct Held {
    /// When the first one was named, s, and which.
    named: Option<(f64, usize)>,
    /// When the gyro was believed again.
    again_s: Option<f64>,
    /// The share of the time in which the truth was outside of the ellipsoid, and how far the position was off at most, m.
    outside: f64,
    off_m: f64,
}

/// When it begins to turn, s.
const TURNS_S: f64 = 32.0;
/// It rests so long at first, s.
const REST_S: f64 = 2.0;
const SIDE_M: f64 = 2.0;
const SIDE_S: f64 = 5.0;

/// Round and round a square, forth along x first, without turning at first.
fn wanted(time_s: f64) -> (Pose2, [f64; 2]) {
    let corners = [[0.0, 0.0], [SIDE_M, 0.0], [SIDE_M, SIDE_M], [0.0, SIDE_M]];
    let turning_s = (time_s - TURNS_S).max(0.0);
    let time_s = time_s - REST_S;
    let side = (time_s / SIDE_S) as usize;
    let (from, to) = (corners[side % 4], corners[(side + 1) % 4]);
    let share = time_s / SIDE_S - side as f64;
    // Smooth, and at rest in the corners.
    let (way, speed) = (share * share * (3.0 - 2.0 * share), 6.0 * share * (1.0 - share) / SIDE_S);
    let at = [0, 1].map(|n| from[n] + way * (to[n] - from[n]));
    let heading_rad = 0.3 * (1.0 - (1.5 * turning_s).cos());
    (Pose2::new(at[0], at[1], heading_rad), [0, 1].map(|n| speed * (to[n] - from[n])))
}

/// For a time, with a gyro that tells such a share of the turn.
fn hold(sensors: &[Sensor], share: f64, time_s: f64, seed: u64) -> Held {
    let mut world = World::new(seed, sensors);
    let mut filter = Filter::new(settings(), sensors);
    let mut held = Held { named: None, again_s: None, outside: 0.0, off_m: 0.0 };
    let cycles = (1000.0 * time_s) as u64;
    for cycle in 0..cycles {
        let now_s = 1e-3 * cycle as f64;
        let twist = match now_s > REST_S {
            true => {
                let (to, [x, y]) = wanted(now_s);
                wheels(&filter, to, [x, y, 0.0])
            }
            false => Twist2::default(),
        };
        let motion = world.drive(twist);
        filter.advance(world.now_ns, &motion);
        for (place, sensor) in sensors.iter().enumerate() {
            if !cycle.is_multiple_of(every(sensor)) {
                continue;
            }
            let reading = match world.read(place) {
                Reading::Turn(turn) => Reading::Turn(turn - (1.0 - share) * world.twist.w_rad_s),
                reading => reading,
            };
            filter.hear(place, world.now_ns, &reading);
        }
        for place in 0..sensors.len() {
            match filter.verdict(place).0 {
                Verdict::Contradicts | Verdict::Frozen => {
                    held.named.get_or_insert((now_s, place));
                }
                Verdict::Good if place == 0 && held.named.is_some() => {
                    held.again_s.get_or_insert(now_s);
                }
                _ => {}
            }
        }
        let [x, y, _] = error(&filter, world.truth);
        held.off_m = held.off_m.max(x.hypot(y));
        held.outside += f64::from(u8::from(3.0 * nees(&filter, world.truth) > THREE_SIGMA)) / cycles as f64;
    }
    held
}

#[test]
fn a_gyro_that_tells_nothing_of_the_turn_never_makes_the_pose_surer_than_it_is_though_its_heading_is_held() {
    let [left, right] = [mouse(0.2, 0.1), mouse(-0.2, 0.1)];
    for sensors in [&[gyro(), left, right][..], &[gyro(), left], &[gyro()]] {
        for share in [1.0, 0.0, -1.0] {
            for seed in 0..4 {
                let held = hold(sensors, share, 40.0, seed);
                println!("{} sensors, {share}: {held:?}", sensors.len());
                assert!(held.outside < 0.01, "{share}: {held:?}");
                assert_eq!(held.again_s, None, "{share}: it was never shown right");
                // Who goes straight knows nothing of it; who turns does.
                match held.named {
                    None => assert_eq!(share, 1.0, "unnamed"),
                    Some((at_s, place)) => {
                        assert!(share < 1.0 && place == 0 && at_s < TURNS_S + 1.0, "{held:?}")
                    }
                }
            }
        }
    }
}
