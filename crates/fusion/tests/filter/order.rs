//! What comes late and in any order ends where it would have in its order.

use omnibase_fusion::{Filter, Reading, Verdict};
use omnibase_platform::Pose2;

use crate::world::{Chance, PERIOD_NS, World, gyro, mouse, settings, tracker};

/// A message on its way: when it arrives, of which sensor, its instant, what it says.
type Message = (u64, usize, u64, Reading);

fn drive(seed: u64, delay_ns: &dyn Fn(&mut Chance, usize) -> u64, cycles: u64) -> (Filter, Filter) {
    let sensors = [gyro(), mouse(0.2, 0.1), tracker(), mouse(-0.2, 0.1)];
    let mut world = World::new(seed, &sensors);
    let mut chance = Chance::new(seed + 77);
    let (mut in_order, mut late) = (Filter::new(settings(), &sensors), Filter::new(settings(), &sensors));
    let mut under_way: Vec<Message> = Vec::new();
    let last_ns = world.now_ns + cycles * PERIOD_NS;
    while world.now_ns < last_ns + 1_500_000_000 {
        let motion = world.step();
        in_order.advance(world.now_ns, &motion);
        late.advance(world.now_ns, &motion);
        if world.now_ns < last_ns {
            for (sensor, every) in [(0, 1), (1, 8), (2, 10), (3, 8)] {
                if (world.now_ns / PERIOD_NS).is_multiple_of(every) {
                    let reading = world.read(sensor);
                    assert!(in_order.hear(sensor, world.now_ns, &reading));
                    let at_ns = world.now_ns + delay_ns(&mut chance, sensor);
                    under_way.push((at_ns, sensor, world.now_ns, reading));
                }
            }
        }
        // Within a cycle, too, in any order.
        let mut index = 0;
        while index < under_way.len() {
            if under_way[index].0 <= world.now_ns {
                let (_, sensor, instant_ns, reading) = under_way.swap_remove(index);
                assert!(late.hear(sensor, instant_ns, &reading));
            } else {
                index += 1;
            }
        }
    }
    (in_order, late)
}

fn difference(one: &Filter, other: &Filter) -> f64 {
    let (a, b) = (one.estimate(), other.estimate());
    let pose = a.map_from_body.distance_m(b.map_from_body)
        + (a.map_from_body.heading_rad - b.map_from_body.heading_rad).abs();
    a.covariance.iter().zip(b.covariance).fold(pose, |sum, (a, b)| sum + (a - b).abs())
}

#[test]
fn a_pose_that_is_200_ms_late_gives_the_state_of_the_filter_in_order() {
    let late = |_: &mut Chance, sensor: usize| if sensor == 2 { 200_000_000 } else { 0 };
    let (in_order, late) = drive(1, &late, 2000);
    assert!(in_order.is_settled() && late.is_settled());
    assert_eq!(difference(&in_order, &late), 0.0, "to the bit");
}

#[test]
fn random_arrivals_up_to_a_second_late_end_where_the_order_does() {
    let mut greatest = 0.0_f64;
    for seed in 0..12 {
        let random = |chance: &mut Chance, _: usize| (chance.unit() * 1e9) as u64;
        let (in_order, late) = drive(seed, &random, 1500);
        assert!(late.is_settled());
        greatest = greatest.max(difference(&in_order, &late));
    }
    assert!(greatest < 1e-9, "{greatest:e}");
}

#[test]
fn what_is_older_than_all_that_is_kept_is_left_out_and_counted() {
    let mut world = World::new(3, &[tracker()]);
    let mut filter = Filter::new(settings(), &[tracker()]);
    for _ in 0..3000 {
        let motion = world.step();
        filter.advance(world.now_ns, &motion);
    }
    let reading = world.read(0);
    assert!(!filter.hear(0, world.now_ns - 1_300_000_000, &reading));
    assert!(!filter.hear(0, world.now_ns, &Reading::Turn(1.0)), "another kind");
    assert!(!filter.hear(0, world.now_ns, &Reading::Turn(f64::NAN)));
    assert_eq!(filter.left_out(), 1);
    assert!(filter.hear(0, world.now_ns - 1_100_000_000, &reading));
}

#[test]
fn what_is_no_number_ends_in_numbers() {
    let sensors = [gyro(), tracker()];
    let mut world = World::new(5, &sensors);
    let mut filter = Filter::new(settings(), &sensors);
    let pose = |x_m: f64, variance: f64, xy: f64| Reading::Pose {
        map_from_sensor: Pose2::new(x_m, 0.0, 0.0),
        covariance: [variance, xy, 0.0, variance, 0.0, variance],
    };
    for cycle in 0..3000 {
        let mut motion = world.step();
        if cycle == 1000 {
            motion.body_from_next.x_m = f64::NAN;
        }
        filter.advance(world.now_ns, &motion);
        let reading = world.read(1);
        filter.hear(1, world.now_ns, &reading);
        for (sensor, wrong) in [
            (0, Reading::Turn(f64::INFINITY)),
            (0, Reading::Turn(3e8)),
            (1, pose(f64::NAN, 0.0, 0.0)),
            (1, pose(1e300, 0.0, 0.0)),
            (1, pose(0.0, -1.0, 0.0)),
            (1, pose(0.0, 1e-6, 1.0)),
        ] {
            filter.hear(sensor, world.now_ns, &wrong);
        }
        let estimate = filter.estimate();
        assert!(estimate.map_from_body.is_finite() && filter.belief().0.is_finite(), "{cycle}");
    }
    assert_eq!(filter.verdict(0).0, Verdict::Contradicts, "3e8 rad/s");
}
