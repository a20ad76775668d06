//! The error is as great as the covariance says, and readings are off by as much as expected: NEES and NIS over many worlds.

use omnibase_fusion::{Filter, Reading, Sensor, Verdict};

use crate::world::{PERIOD_NS, World, camera, error, gyro, imu, mouse, nees, settings, tracker};

/// Milliseconds between looks at what readings are off.
const BETWEEN_MS: u64 = 40;

/// Means over worlds of some seconds.
struct Means {
    /// NEES over degrees of freedom at the end.
    nees: f64,
    /// NIS over degrees of freedom in all looks, sensor by sensor.
    nis: Vec<f64>,
    /// RMS of the position's error at the end, m.
    rms_m: f64,
}

fn mean(sensors: &[(Sensor, u64)], seeds: u64, seconds: u64) -> Means {
    let (mut sum, mut squares, mut nis) = (0.0, 0.0, vec![0.0; sensors.len()]);
    let looks = (seeds * seconds * 1000 / BETWEEN_MS) as f64;
    let all: Vec<Sensor> = sensors.iter().map(|(sensor, _)| *sensor).collect();
    for seed in 0..seeds {
        let mut world = World::new(seed, &all);
        let mut filter = Filter::new(settings(), &all);
        for cycle in 0..seconds * 1000 {
            let motion = world.step();
            filter.advance(world.now_ns, &motion);
            for (sensor, (_, every)) in sensors.iter().enumerate() {
                if (world.now_ns / PERIOD_NS).is_multiple_of(*every) {
                    let reading = world.read(sensor);
                    filter.hear(sensor, world.now_ns, &reading);
                }
                if cycle.is_multiple_of(BETWEEN_MS) {
                    nis[sensor] += filter.verdict(sensor).1 / looks;
                }
            }
        }
        sum += nees(&filter, world.truth);
        let [x, y, _] = error(&filter, world.truth);
        squares += x * x + y * y;
    }
    let of_worlds = |sum: f64| sum / seeds as f64;
    Means { nees: of_worlds(sum), nis, rms_m: of_worlds(squares).sqrt() }
}

#[test]
fn errors_are_as_great_as_their_covariance_says_with_each_set_of_sensors() {
    let [left, right] = [(mouse(0.2, 0.1), 8), (mouse(-0.2, 0.1), 8)];
    let [turn, felt, seen, placed] = [(gyro(), 1), (imu(), 1), (camera(), 20), (tracker(), 10)];
    let sets: [(&str, &[(Sensor, u64)]); 9] = [
        ("wheels", &[]),
        ("gyro", &[turn]),
        ("imu", &[felt]),
        ("twist", &[seen]),
        ("two mice", &[left, right]),
        ("gyro and mice", &[turn, left, right]),
        ("poses", &[placed]),
        ("imu, twist and poses", &[felt, seen, placed]),
        ("all", &[turn, left, right, placed]),
    ];
    let seeds = 120;
    // 95 % of the mean of chi² with three degrees of freedom each, over three: 1 ± 1.96·√(2/3/seeds).
    let band = 1.96 * (2.0 / 3.0 / seeds as f64).sqrt();
    for (name, sensors) in sets {
        let Means { nees, nis, rms_m } = mean(sensors, seeds, 8);
        println!("{name}: NEES {nees:.3}, NIS {nis:.3?}, RMS {:.2} mm", 1e3 * rms_m);
        assert!((nees - 1.0).abs() < band, "{name}: {nees}, expected 1 within {band}");
        assert!(nis.iter().all(|nis| (nis - 1.0).abs() < 0.03), "{name}: {nis:?}, expected 1 within 0.03");
    }
}

/// Slip that is drawn in each millisecond hangs together from one mean over an epoch to the next: what a gyro that is better
/// than that is expected to be off counts with it.
#[test]
fn what_a_gyro_is_off_is_as_great_as_expected_however_little_its_noise_is() {
    let (mut sum, mut count) = (0.0, 0.0);
    for sigma in [3e-3, 1.5e-3, 1e-3] {
        let sensors = [Sensor { sigma: [sigma, 0.0, 0.0], ..gyro() }];
        for seed in 0..20 {
            let mut world = World::new(seed, &sensors);
            let mut filter = Filter::new(settings(), &sensors);
            for cycle in 0..8000 {
                let motion = world.step();
                filter.advance(world.now_ns, &motion);
                // Once in each epoch of the second half, in which it moves.
                if cycle > 4000 && cycle % 5 == 0 {
                    sum += filter.verdict(0).1;
                    count += 1.0;
                }
                let reading = world.read(0);
                filter.hear(0, world.now_ns, &reading);
            }
        }
        let nis: f64 = sum / count;
        println!("{sigma}: NIS {nis:.3}");
        assert!((nis - 1.0).abs() < 0.035, "{sigma}: {nis}, of {count} expected 1 within 0.035");
        (sum, count) = (0.0, 0.0);
    }
}

/// One gyro in a thousand has a bias beyond what a gate lets pass. It was gated from its first reading on, and for ever.
#[test]
fn a_gyro_whose_bias_is_greater_than_was_said_is_believed_and_one_wrong_reading_at_the_beginning_is_not() {
    for (bias, wrong, expected) in
        [(0.045, 0.0, Verdict::Good), (0.0, 1.0, Verdict::Good), (0.5, 0.0, Verdict::Contradicts)]
    {
        let sensors = [gyro()];
        let mut world = World::new(2, &sensors);
        let mut filter = Filter::new(settings(), &sensors);
        for cycle in 0..8000 {
            let motion = world.step();
            filter.advance(world.now_ns, &motion);
            let Reading::Turn(turn) = world.read(0) else { panic!("a gyro") };
            let wrong = if cycle < 3 { wrong } else { 0.0 };
            filter.hear(0, world.now_ns, &Reading::Turn(turn + bias + wrong));
        }
        let [.., heading_rad] = error(&filter, world.truth);
        println!("bias {bias}, {wrong}: {:?}, heading off by {heading_rad}", filter.verdict(0));
        assert_eq!(
            filter.verdict(0).0,
            expected,
            "bias {bias} rad/s, said to be 0.01; first readings off by {wrong}"
        );
        assert!(heading_rad.abs() < 3.0 * filter.estimate().covariance[5].sqrt(), "{bias}: {heading_rad}");
    }
}

#[test]
fn what_is_not_passed_yet_is_in_the_covariance_too() {
    let mut world = World::new(1, &[]);
    let mut filter = Filter::new(settings(), &[]);
    let variance = |filter: &Filter| filter.estimate().covariance[0];
    for _ in 0..3000 {
        let motion = world.step();
        filter.advance(world.now_ns, &motion);
    }
    // On the way each cycle adds to it, within an epoch of five cycles as between two.
    for cycle in 0..20 {
        let before = variance(&filter);
        let motion = world.step();
        filter.advance(world.now_ns, &motion);
        assert!(variance(&filter) > before, "{cycle}: {before:e}, then {:e}", variance(&filter));
    }
}
