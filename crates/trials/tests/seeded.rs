//! Robots of the thousands of `--example seeded` that once did what none may, each the plainest of its kind.

use omnibase_trials::seeded::{Seeded, Wrong};

/// Drives the robots of these seeds; none of them may be wrong in this way.
fn none_is(wrong: Wrong, seeds: &[u64]) {
    for seed in seeds {
        let seeded = Seeded::new(*seed);
        let outcome = seeded.ride();
        println!("{}: {}", seeded.row(), outcome.row());
        assert!(!outcome.is(wrong), "{}: {}: {}", wrong.text(), seeded.row(), outcome.row());
    }
}

#[test]
fn a_drive_with_a_fast_current_loop_holds_a_heavy_platforms_wheels_still() {
    none_is(Wrong::LimitCycle, &[22, 118, 363, 3023]);
}

#[test]
fn a_law_that_was_told_its_treads_becomes_soft_where_they_slip() {
    none_is(Wrong::LimitCycle, &[1428, 5941, 7697, 502]);
}

#[test]
fn a_wheel_that_slips_is_not_named_as_wired_wrongly() {
    // Both laws, floors of 0.16 to 0.33.
    none_is(Wrong::Misnamed, &[203, 238, 330, 715, 822, 897, 916, 1224]);
}

#[test]
fn a_path_that_waits_for_the_traction_makes_no_torque_swing() {
    none_is(Wrong::LimitCycle, &[1738, 1854, 2428]);
}

#[test]
fn a_setpoint_that_lags_on_a_slippery_floor_makes_no_torque_swing() {
    none_is(Wrong::LimitCycle, &[2269, 62861]);
}

#[test]
fn an_observers_robot_on_a_slippery_floor_is_where_it_believes_to_be_or_is_stopped() {
    // Floors of 0.12 to 0.16: 60 to 88 mm off, without a word.
    for seed in [20, 78, 144, 158] {
        let seeded = Seeded::by(seed, "disturbance_observer");
        let outcome = seeded.ride();
        println!("{}: {}", seeded.row(), outcome.row());
        assert!(!outcome.is(Wrong::Lost), "{}: {}", seeded.row(), outcome.row());
    }
}

#[test]
fn four_rims_that_agree_are_not_said_to_slip_for_a_force_that_nobody_knows() {
    // All four were stopped for slip.
    none_is(Wrong::FalseSlip, &[4327, 5293, 7200, 8479]);
}

#[test]
fn a_wheel_that_rings_as_a_motion_begins_is_not_said_to_turn_alone() {
    none_is(Wrong::FalseSlip, &[4138, 7009]);
}

#[test]
fn a_soft_tread_that_lets_go_where_a_motion_turns_around_is_no_slip() {
    none_is(Wrong::FalseSlip, &[1345, 6800, 12368]);
}

#[test]
fn a_light_wheel_that_the_platform_carries_along_is_not_said_to_turn_alone() {
    none_is(Wrong::FalseSlip, &[2222, 3211, 12911, 17052, 23603]);
}

#[test]
fn by_speed_the_floor_is_asked_harder_where_encoders_count_coarsely() {
    // 51,000 to 88,000 counts a turn, 53 to 106 mm off without a word where gentle motions swing by 0.1 m/s² at most.
    for seed in [30003, 30231, 30252, 30575] {
        let seeded = Seeded::new(seed).with_coarse_encoders();
        let outcome = seeded.ride();
        println!("{}: {}", seeded.row(), outcome.row());
        assert!(
            ![Wrong::Lost, Wrong::Unsure, Wrong::FalseSlip].iter().any(|wrong| outcome.is(*wrong)),
            "{seed}: {outcome:?}"
        );
    }
}
