//! Gains of the law of torque: designed, or given and refused where they leave no margins.

use super::*;
use crate::controllers::SlowForce;
use crate::torque_loop::{LoopGains, TorqueDesign};

fn with(keys: &str) -> String {
    BMM.replace("kind = \"closed_loop_speed\"\n", &format!("kind = \"adaptive_torque\"\n{keys}\n"))
}

fn designed(keys: &str) -> TorqueDesign {
    let plan = RobotPlan::from_toml(&with(keys), &Registry::with_built_in(), &no_files);
    let plan = plan.unwrap_or_else(|problems| panic!("{}", show(&problems)));
    TorqueDesign::new(&plan, SlowForce::Integral).expect("a plan's design")
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
    let wheel_kg =
        |mass_kg| TorqueDesign::new(&plan(mass_kg), SlowForce::Integral).expect("a design").loops[0].wheel_kg;
    assert_eq!((wheel_kg("35.0"), wheel_kg("140.0")), (1.0, 2.0));
}

#[test]
fn an_observer_is_designed_given_or_refused() {
    let with = |keys: &str| with(keys).replace("adaptive_torque", "disturbance_observer");
    let designed = |keys: &str| {
        let plan = RobotPlan::from_toml(&with(keys), &Registry::with_built_in(), &no_files);
        let plan = plan.unwrap_or_else(|problems| panic!("{}", show(&problems)));
        TorqueDesign::new(&plan, SlowForce::Observer).expect("a plan's design")
    };
    let [x, ..] = designed("").gains;
    let [adaptive, ..] = super::torque_gains::designed("").gains;
    assert!(x.observer_1_s > 0.0 && x.stiffness() > 1.3 * adaptive.stiffness(), "{x:?} {adaptive:?}");
    let softly = "damping_n_s_m = 400\nturn_damping_n_m_s_rad = 60\ntorque_kp_1_s = [1.0, 1.0, 1.0]\ntorque_filter_1_s = 30";
    let [given, ..] = designed(&format!("{softly}\nobserver_1_s = 0.5")).gains;
    let told = LoopGains { damping: 400.0, kp_1_s: 1.0, filter_1_s: 30.0, observer_1_s: 0.5 };
    assert_eq!(given, told);
    let problems = problems(&with("observer_1_s = 50"));
    let (problem, ..) = found(&problems, "controller.observer_1_s");
    assert!(problem.reason.contains("an observer of 50 1/s"), "{}", show(&problems));
    let inputs = "device = \"sgdv\"\ninputs = [{ pdo = \"0x1A00\", map = \"6041:16 6061:8 pad:8 6064:32 606C:32\" }]\n";
    let unmeasured = with("").replace("device = \"sgdv\"\n", inputs);
    let problems = self::problems(&unmeasured);
    let (problem, ..) = found(&problems, "controller.kind");
    assert!(problem.reason.contains("wheel_1 must map its own (0x6077)"), "{}", show(&problems));
}
