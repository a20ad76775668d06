//! Robots built with tolerances are found by what they drive, and drive truly afterwards.

use omnibase_calibrate::Unknown;
use omnibase_trials::calibration::{Told, calibrate};
use omnibase_trials::{plan_of, robots};

/// What must be reached with motion capture: radius as a share, direction rad, place across the force m, and m RMS on the square.
const BOUNDS: [f64; 3] = [1e-3, 0.02 * std::f64::consts::PI / 180.0, 2e-4];
const SQUARE_M: f64 = 2e-3;

#[test]
fn builds_seen_by_motion_capture_are_found_and_drive_the_square_truly() {
    // They are far off before: 33, 42 and 26 mm. The four wheels contradict each other, which their treads share out by creeping.
    for (robot, seed) in [(robots::BMM, 3), (robots::BMM, 6), (robots::MECANUM, 3)] {
        let calibrated = calibrate(&plan_of(robot), &Told::Poses.into(), seed);
        let [before, after] = calibrated.square_m;
        assert!(before > 0.02 && after < 0.5 * SQUARE_M, "seed {seed}: {before} {after}");
        for (found, bound) in calibrated.greatest().into_iter().zip(BOUNDS) {
            assert!(found < 0.5 * bound, "seed {seed}: {:?}", calibrated.errors);
        }
        // The treads' creep is the simulator's, 0.025, and the delay 20 ms.
        let creep = calibrated.solution.of(Unknown::Creep).unwrap();
        assert!((creep.amount - 0.025).abs() < 4.0 * creep.sigma_held, "{creep:?}");
        let delay = calibrated.solution.of(Unknown::Delay).unwrap();
        assert!((delay.amount - 0.02).abs() < 5e-4, "{delay:?}");
        let chi = calibrated.solution.reduced_chi_square();
        assert!((0.9..1.1).contains(&chi), "{chi}");
    }
}

#[test]
fn a_gyro_and_a_tape_find_less_and_say_so() {
    let calibrated = calibrate(&plan_of(robots::BMM), &Told::GyroAndTape.into(), 3);
    let [before, after] = calibrated.square_m;
    assert!(after < 0.2 * before && after < 4e-3, "{before} {after}");
    for (wheel, error) in calibrated.errors.iter().enumerate() {
        for (error, unknown) in [
            (error.radius_share, Unknown::Radius(wheel)),
            (error.direction_rad, Unknown::Direction(wheel)),
            (error.across_m, Unknown::Across(wheel)),
        ] {
            let sigma = calibrated.solution.of(unknown).unwrap().sigma;
            assert!(error.abs() < 3.5 * sigma, "{unknown:?}: {error} ± {sigma}");
        }
    }
}
