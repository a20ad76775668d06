//! Gains of the law of torque: designed, or given and refused where they leave no margins.

use super::*;
use crate::controllers::TorqueDesign;

fn with(keys: &str) -> String {
    BMM.replace("kind = \"closed_loop_speed\"\n", &format!("kind = \"adaptive_torque\"\n{keys}\n"))
}

fn designed(keys: &str) -> TorqueDesign {
    let plan = RobotPlan::from_toml(&with(keys), &Registry::with_built_in(), &no_files);
    TorqueDesign::new(&plan.unwrap_or_else(|problems| panic!("{}", show(&problems))))
        .expect("a plan's design")
}

#[test]
fn a_stiffer_tread_a_heavier_wheel_and_a_faster_drive_allow_more_gain() {
    let stiffly = |design: &TorqueDesign| design.gains.map(|gains| gains.damping * gains.kp_1_s);
    let unknown = stiffly(&designed(""));
    for keys in [
        "tread_stiffness_n_m = [1e6, 4e6]",
        "tread_damping_ratio = 0.3",
        "wheel_inertia_kg_m2 = 0.08",
        "mass_bounds_kg = [60, 110]\ninertia_bounds_kg_m2 = [5, 11]",
    ] {
        let known = stiffly(&designed(keys));
        assert!(
            known.iter().zip(unknown).all(|(known, unknown)| *known > 1.05 * unknown),
            "{keys}: {known:?} {unknown:?}"
        );
    }
    let slower = stiffly(&designed("torque_lag_us = 20000"));
    assert!(slower.iter().zip(unknown).all(|(slower, unknown)| *slower < unknown), "{slower:?} {unknown:?}");
}

#[test]
fn gains_without_margins_are_refused_with_what_they_leave() {
    for (keys, setting, told) in [
        ("damping_n_s_m = 4000", "controller.damping_n_s_m", "which is 6 dB and 30°; K = "),
        ("turn_damping_n_m_s_rad = 800", "controller.turn_damping_n_m_s_rad", "which is 6 dB and 30°; K = "),
        ("torque_kp_1_s = [15, 15, 15]", "controller.torque_kp_1_s", "K must be at least the greatest mass"),
        ("torque_filter_1_s = 400", "controller.torque_filter_1_s", "which is 6 dB and 30°; K = "),
        ("tread_stiffness_n_m = [4e6, 1e5]", "controller.tread_stiffness_n_m", "in this order"),
    ] {
        let problems = problems(&with(keys));
        let (problem, ..) = found(&problems, setting);
        assert!(problem.reason.contains(told), "{keys}: {}", show(&problems));
    }
}

#[test]
fn gains_that_leave_margins_are_taken_as_they_are() {
    let design = designed(
        "damping_n_s_m = 400\nturn_damping_n_m_s_rad = 60\ntorque_kp_1_s = [1.0, 1.0, 1.0]\ntorque_filter_1_s = 30",
    );
    let [x, ..] = design.gains;
    assert_eq!((x.damping, x.kp_1_s, x.filter_1_s), (400.0, 1.0, 30.0));
    for (axis, gains) in design.loops.iter().zip(design.gains) {
        let worst = axis.worst(&gains);
        assert!(worst.suffice() && worst.gain_db >= 6.0 && worst.phase_deg >= 30.0, "{worst:?}");
    }
}

#[test]
fn a_light_robots_wheels_are_taken_to_be_light() {
    let plan = |mass_kg: &str| {
        let text = with("").replace("mass_kg = 70.0            #", &format!("mass_kg = {mass_kg} #"));
        RobotPlan::from_toml(&text, &Registry::with_built_in(), &no_files).expect("a plan")
    };
    let wheel_kg = |mass_kg| TorqueDesign::new(&plan(mass_kg)).expect("a design").loops[0].wheel_kg;
    assert_eq!((wheel_kg("35.0"), wheel_kg("140.0")), (1.0, 2.0));
}
