//! Each sensor dead, frozen, jumping, biased, reversed, with its clock off: named, and the pose as good as it says.

use omnibase_fusion::{Filter, Reading, Verdict};
use omnibase_platform::Pose2;

use crate::world::{PERIOD_NS, World, error, gyro, mouse, settings, tracker};

#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    Dead,
    Frozen,
    Jumping,
    Biased,
    Reversed,
    Late,
}

/// What becomes of a reading.
fn broken(fault: Fault, reading: Reading, said: Reading) -> Reading {
    match (fault, reading) {
        (Fault::Frozen, _) => said,
        (Fault::Jumping, Reading::Pose { map_from_sensor, covariance }) => {
            let map_from_sensor = Pose2 { x_m: map_from_sensor.x_m + 1.0, ..map_from_sensor };
            Reading::Pose { map_from_sensor, covariance }
        }
        (Fault::Biased, Reading::Pose { map_from_sensor, covariance }) => {
            let map_from_sensor = Pose2 { x_m: map_from_sensor.x_m + 0.05, ..map_from_sensor };
            Reading::Pose { map_from_sensor, covariance }
        }
        (Fault::Jumping | Fault::Biased, Reading::Turn(turn)) => Reading::Turn(turn + 0.1),
        (Fault::Jumping | Fault::Biased, Reading::Flow([x, y])) => Reading::Flow([x + 0.1, y]),
        (Fault::Reversed, Reading::Turn(turn)) => Reading::Turn(-turn),
        (Fault::Reversed, Reading::Flow([x, y])) => Reading::Flow([-x, -y]),
        (Fault::Reversed, Reading::Pose { map_from_sensor, covariance }) => {
            let Pose2 { x_m, y_m, heading_rad } = map_from_sensor;
            Reading::Pose { map_from_sensor: Pose2::new(-x_m, -y_m, -heading_rad), covariance }
        }
        (_, reading) => reading,
    }
}

#[test]
fn each_fault_of_each_sensor_is_named_and_the_truth_stays_within_three_sigmas() {
    let sensors = [gyro(), mouse(0.2, 0.1), mouse(-0.2, 0.1), tracker()];
    let faults = [Fault::Dead, Fault::Frozen, Fault::Jumping, Fault::Biased, Fault::Reversed, Fault::Late];
    for broken_one in 0..4 {
        for fault in faults {
            // A clock that is off is seen where what it tells changes: of poses.
            if fault == Fault::Late && broken_one != 3 {
                continue;
            }
            let mut world = World::new(7, &sensors);
            let mut filter = Filter::new(settings(), &sensors);
            let mut said = [Reading::Turn(0.0); 4];
            let mut named_after_s = None;
            let (begin_ns, mut worst) = (world.now_ns + 4_000_000_000, 0.0_f64);
            for _ in 0..7000 {
                let motion = world.step();
                filter.advance(world.now_ns, &motion);
                let is_broken = world.now_ns >= begin_ns;
                for (sensor, every) in [(0, 1), (1, 8), (2, 8), (3, 10)] {
                    if !(world.now_ns / PERIOD_NS).is_multiple_of(every) {
                        continue;
                    }
                    let mut reading = world.read(sensor);
                    let mut instant_ns = world.now_ns;
                    if is_broken && sensor == broken_one {
                        match fault {
                            Fault::Dead => continue,
                            Fault::Late => instant_ns -= 50_000_000,
                            _ => {}
                        }
                        reading = broken(fault, reading, said[sensor]);
                    } else {
                        said[sensor] = reading;
                    }
                    filter.hear(sensor, instant_ns, &reading);
                }
                let since_s = (world.now_ns as f64 - begin_ns as f64) * 1e-9;
                let verdict = filter.verdict(broken_one).0;
                if is_broken && !matches!(verdict, Verdict::Good) {
                    named_after_s.get_or_insert((since_s, verdict));
                }
                if !is_broken && world.now_ns > begin_ns - 3_000_000_000 {
                    for sensor in 0..4 {
                        assert_eq!(filter.verdict(sensor).0, Verdict::Good, "{sensor} at {since_s} s");
                    }
                }
                let covariance = filter.estimate().covariance;
                let off = error(&filter, world.truth);
                for (off, variance) in off.iter().zip([covariance[0], covariance[3], covariance[5]]) {
                    worst = worst.max(off.abs() / variance.sqrt());
                }
            }
            println!("{broken_one} {fault:?}: named after {named_after_s:?}, truth within {worst:.2} sigma");
            let (after_s, verdict) = named_after_s.expect("named");
            assert!(after_s <= 0.5, "{broken_one} {fault:?}: after {after_s} s");
            match fault {
                Fault::Dead => assert_eq!(verdict, Verdict::Silent),
                Fault::Frozen => assert_eq!(verdict, Verdict::Frozen, "{broken_one}"),
                _ => assert_eq!(verdict, Verdict::Contradicts, "{broken_one} {fault:?}"),
            }
            for sensor in (0..4).filter(|sensor| *sensor != broken_one) {
                assert_eq!(filter.verdict(sensor).0, Verdict::Good, "{sensor} while {broken_one} {fault:?}");
            }
        }
    }
}
