//! Accelerations: nothing is lost where wheels grip, and a slip that a gyro doesn't see is seen.

use omnibase_fusion::{Filter, Sensor};

use crate::lively::Lively;
use crate::world::{error, imu, settings};

/// True from believed place, its greatest part of its standard deviation, and all that was believed, by its bits.
fn driven(sensor: Sensor, seed: u64, slip: Option<(f64, [f64; 2])>) -> (f64, f64, Vec<u64>) {
    let mut world = Lively::new(seed, slip);
    let mut filter = Filter::new(settings(), &[sensor]);
    let (mut bits, mut worst) = (Vec::new(), 0.0_f64);
    for _ in 0..9000 {
        let motion = world.step();
        filter.advance(world.now_ns, &motion);
        // The same noise for both: the imu's own is drawn behind.
        let reading = world.read(&sensor, 0);
        filter.hear(0, world.now_ns, &reading);
        let estimate = filter.estimate();
        bits.push(estimate.map_from_body.x_m.to_bits());
        let [x, y, _] = error(&filter, world.truth);
        worst = worst.max(x.hypot(y) / (estimate.covariance[0] + estimate.covariance[3]).sqrt());
    }
    let [x, y, _] = error(&filter, world.truth);
    (x.hypot(y), worst, bits)
}

#[test]
fn where_wheels_grip_an_imu_is_a_gyro_to_the_bit() {
    // Accelerations of half the noise that would count beside none at all.
    let (_, _, with) = driven(imu(), 5, None);
    let (_, _, without) = driven(Sensor { sigma: [3e-3, 1e6, 1e6], ..imu() }, 5, None);
    let differing = with.iter().zip(&without).filter(|(one, other)| one != other).count();
    assert_eq!((differing, with.len()), (0, 9000));
}

#[test]
fn a_slip_is_felt_and_the_place_is_no_better_known_than_it_says() {
    let mut worst = [0.0_f64; 2];
    let mut sums = [0.0; 2];
    for seed in 0..4 {
        for (share, from_s) in [(0.4, 1.0), (0.6, 1.0), (0.4, 1.9), (0.6, 2.8)] {
            let slip = Some((share, [from_s, from_s + 1.5]));
            let told =
                [Sensor { sigma: [3e-3, 1e6, 1e6], ..imu() }, imu()].map(|sensor| driven(sensor, seed, slip));
            for (n, (off_m, sigmas, _)) in told.iter().enumerate() {
                worst[n] = worst[n].max(*sigmas);
                sums[n] += off_m * off_m / 16.0;
            }
        }
    }
    let [turn_m, felt_m] = sums.map(f64::sqrt);
    println!(
        "RMS {:.1} mm with the turn alone, {:.1} with accelerations; worst {worst:.1?} sigma",
        1e3 * turn_m,
        1e3 * felt_m
    );
    assert!(felt_m < 1.05 * turn_m, "{felt_m} of {turn_m}: no worse");
    assert!(worst[1] < 0.25 * worst[0], "{worst:?}: and it is said how well");
}
