//! Layouts and kinematics, against numbers worked out apart from the code.

use omnibase_platform::layout::{bmm, mecanum4, omni, problems};
use omnibase_platform::{Kinematics, LayoutError, PerWheel, Twist2, Wheel, Wrench2};
use proptest::prelude::*;

fn close(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= tolerance, "{found} is not {expected} within {tolerance}");
    }
}

fn axes(twist: Twist2) -> [f64; 3] {
    [twist.vx_m_s, twist.vy_m_s, twist.w_rad_s]
}

fn wheel(name: &str, position_m: [f64; 2], direction: [f64; 2]) -> Wheel {
    let name = name.to_string();
    Wheel { name, position_m, rolling_direction: direction, force_direction: direction, radius_m: 0.1 }
}

const P1: f64 = 0.35;
const P: f64 = 0.30;
const R: f64 = 0.075;

#[test]
fn bmm_has_the_matrix_of_the_specification() {
    let kinematics = Kinematics::new(bmm(P1, P, R)).unwrap();
    let h = 3.0_f64.sqrt() / 2.0;
    let expected = [[0.0, 1.0, -P1], [-h, -0.5, -P], [h, -0.5, -P]];
    for (row, expected) in kinematics.matrix().iter().zip(expected) {
        close(row, &expected, 1e-15);
    }
    let turning = kinematics.twist(&PerWheel::from([1.0, 1.0, 1.0])).twist_in_base;
    assert!(turning.w_rad_s < 0.0, "equal positive speeds turn clockwise");
}

#[test]
fn bmm_inverse_is_the_corrected_formula_8_17_and_8_18() {
    let kinematics = Kinematics::new(bmm(P1, P, R)).unwrap();
    let angles = [0.3, -0.7, 1.1];
    let (step, residual) = kinematics.body_step(&PerWheel::from(angles));
    let [d1, d2, d3] = angles;
    let sum = P1 + 2.0 * P;
    close(
        &[step.x_m, step.y_m, step.angle_rad],
        &[
            R / 3.0_f64.sqrt() * (d3 - d2),
            R / sum * (2.0 * P * d1 - P1 * d2 - P1 * d3),
            -R / sum * (d1 + d2 + d3),
        ],
        1e-15,
    );
    assert_eq!(residual, 0.0);
}

#[test]
fn forces_are_the_transpose_of_speeds() {
    let kinematics = Kinematics::new(bmm(P1, P, R)).unwrap();
    let torques = [1.0, -2.0, 0.5];
    let wrench = kinematics.wrench(&PerWheel::from(torques));
    let h = 3.0_f64.sqrt() / 2.0;
    close(
        &[wrench.fx_n, wrench.fy_n, wrench.torque_nm],
        &[h * 2.5 / R, (1.0 + 1.0 - 0.25) / R, (-P1 * 1.0 + P * 2.0 - P * 0.5) / R],
        1e-12,
    );
    close(&kinematics.wheel_torques_nm(wrench), &torques, 1e-14);
}

#[test]
fn redundant_wheels_use_the_least_torque_and_show_slip() {
    let kinematics = Kinematics::new(omni(4, 0.4, 0.1, std::f64::consts::FRAC_PI_4)).unwrap();
    let torques = kinematics.wheel_torques_nm(Wrench2::new(10.0, -4.0, 2.0));
    let norm = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
    // The one direction that makes no wrench with four omni wheels: alternating torques.
    let other = PerWheel::from_fn(4, |at| torques[at] + if at % 2 == 0 { 0.1 } else { -0.1 });
    let (same, wrench) = (kinematics.wrench(&other), kinematics.wrench(&torques));
    close(&[same.fx_n, same.fy_n, same.torque_nm], &[10.0, -4.0, 2.0], 1e-12);
    close(&[wrench.fx_n, wrench.fy_n, wrench.torque_nm], &[10.0, -4.0, 2.0], 1e-12);
    assert!(norm(&torques) < norm(&other));

    let mut speeds = kinematics.wheel_speeds_rad_s(Twist2::new(0.5, 0.2, -0.3));
    assert!(kinematics.twist(&speeds).residual_m_s < 1e-15);
    speeds[2] += 1.0;
    // One wheel 0.1 m/s too fast: half of it is in the unexplained direction (1, -1, 1, -1)/2.
    assert!((kinematics.twist(&speeds).residual_m_s - 0.05).abs() < 1e-15);
}

#[test]
fn layouts_that_cannot_be_driven_are_refused_with_the_reason() {
    let reason = |wheels: Vec<Wheel>| Kinematics::new(wheels).unwrap_err().to_string();
    let three = || bmm(P1, P, R);
    assert!(reason(three()[..2].to_vec()).contains("2 wheels cannot"), "too few");
    assert!(reason(omni(9, 0.3, 0.1, 0.0)).contains("9 wheels: expected at most 8"));

    let mut wheels = three();
    wheels[1].radius_m = 0.0;
    assert_eq!(reason(wheels), "wheel wheel_2: radius_m is 0, expected a positive length");
    let mut wheels = three();
    wheels[2].position_m[1] = f64::NAN;
    assert_eq!(reason(wheels), "wheel wheel_3: position_m is not finite");
    let mut wheels = three();
    wheels[0].force_direction = [1.0, 0.0];
    assert!(reason(wheels).contains("a·u = 0.000"));
    let mut wheels = three();
    wheels[0].rolling_direction = [0.0, 0.0];
    assert!(reason(wheels).contains("rolling_direction is (0, 0)"));
    let mut wheels = three();
    wheels[0].name = "wheel_2".into();
    assert!(reason(wheels).contains("two wheels are called wheel_2"));

    // Three wheels whose axes meet in one point hold no rotation about it.
    let radial: Vec<Wheel> =
        [[1.0, 0.0], [-0.5, 0.8], [-0.5, -0.8]].map(|at: [f64; 2]| wheel(&format!("{at:?}"), at, at)).into();
    let Err(LayoutError::Rank { rank: 2, undriven }) = Kinematics::new(radial) else {
        panic!("a rank problem")
    };
    assert!(undriven[2].abs() > 0.9 && undriven[0].abs() < 1e-9 && undriven[1].abs() < 1e-9, "{undriven:?}");
    // All in parallel: no way sideways.
    let parallel: Vec<Wheel> = [[0.0, 1.0], [0.0, -1.0], [1.0, 0.0]]
        .map(|at: [f64; 2]| wheel(&format!("{at:?}"), at, [1.0, 0.0]))
        .into();
    assert!(reason(parallel).contains("drive only 2 of 3"));
    // All at the centre.
    let centred: Vec<Wheel> =
        [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(|u: [f64; 2]| wheel(&format!("{u:?}"), [0.0; 2], u)).into();
    assert!(reason(centred).contains("drive only 2 of 3"));
    // Mecanum rollers the wrong way round (a diamond) hold no rotation in a square base.
    let mut wheels = mecanum4(0.3, 0.3, 0.1);
    for wheel in &mut wheels {
        wheel.force_direction[1] *= -1.0;
    }
    assert!(reason(wheels).contains("drive only 2 of 3"));
    // Nearly so.
    let mut wheels = mecanum4(0.3, 0.301, 0.1);
    for wheel in &mut wheels {
        wheel.force_direction[1] *= -1.0;
    }
    assert!(reason(wheels).contains("condition number"));

    let mut wheels = three();
    wheels[0].radius_m = -1.0;
    wheels[1].radius_m = f64::INFINITY;
    assert_eq!(problems(&wheels).len(), 2, "all problems at once");
}

proptest! {
    /// Seeds are proptest's; 1e-12 relative to twists of up to 10.
    #[test]
    fn speeds_and_forces_go_there_and_back(
        vx in -10.0..10.0, vy in -10.0..10.0, w in -10.0..10.0, radius in 0.02..0.5, size in 0.1..1.0, kind in 0usize..4,
    ) {
        let mut wheels = match kind {
            0 => bmm(size, 0.8 * size, radius),
            1 => omni(3, size, radius, 0.0),
            2 => omni(4, size, radius, std::f64::consts::FRAC_PI_4),
            _ => mecanum4(size, 0.7 * size, radius),
        };
        wheels[1].radius_m *= 1.3;
        let kinematics = Kinematics::new(wheels).unwrap();
        let twist = Twist2::new(vx, vy, w);
        let measured = kinematics.twist(&kinematics.wheel_speeds_rad_s(twist));
        close(&axes(measured.twist_in_base), &axes(twist), 1e-12);
        prop_assert!(measured.residual_m_s < 1e-12);
        let wrench = Wrench2::new(vx, vy, w);
        let torques = kinematics.wheel_torques_nm(wrench);
        let back = kinematics.wrench(&torques);
        close(&[back.fx_n, back.fy_n, back.torque_nm], &[vx, vy, w], 1e-11);
        // Power is the same at the wheels and at the body.
        let speeds = kinematics.wheel_speeds_rad_s(twist);
        let wheel_power: f64 = speeds.iter().zip(torques.iter()).map(|(speed, torque)| speed * torque).sum();
        prop_assert!((wheel_power - (vx * vx + vy * vy + w * w)).abs() < 1e-9);
    }
}
