//! Robots that aren't as their file says are named before they are far; those that are never are.

use omnibase_robot::signals::SafetyReason;
use omnibase_trials::laws::ALL;
use omnibase_trials::wiring::{Case, Fault, Named, PATHS};

/// Robots as their files say.
const ROBOTS: u64 = 60;
/// So many of eighty wheels that are wired backwards, four by five paths by four laws, are named at least; of the observer's twenty
/// ten, for five stop for their slip and five are named within a metre.
const LEAST_OF_80: u32 = 61;
/// A robot that is named later went astray, m.
const FAR_M: f64 = 1.0;

/// Those of a robot's faults that are named within half a metre of some law and path, out of how many.
fn named(
    robot: &'static str,
    law: &'static str,
    gyro: Option<f64>,
    is_it: impl Fn(&Fault) -> bool,
) -> Vec<(Fault, &'static str, Named)> {
    let wheels = if robot == "bmm" { 3 } else { 4 };
    let faults: Vec<Fault> = Fault::all(wheels).into_iter().filter(is_it).collect();
    let ways = PATHS.into_iter().flat_map(|path| faults.iter().map(move |fault| (path, *fault)));
    let ride = |path, fault| Case { gyro, ..Case::plain(robot, law, path, fault) }.ride(FAR_M);
    ways.map(|(path, fault)| (fault, path, ride(path, fault))).collect()
}

#[test]
fn an_encoder_against_its_motor_is_named_before_the_robot_moves_a_hand() {
    for robot in ["bmm", "mecanum"] {
        for &law in ALL.iter() {
            for (fault, path, named) in named(robot, law, None, |fault| matches!(fault, Fault::Encoder(_))) {
                let Fault::Encoder(wheel) = fault else { continue };
                // The BMM's first wheel stands while it drives along x.
                if (robot, path, wheel) == ("bmm", "square", 0) {
                    continue;
                }
                let is_right = (named.reason, named.wheel) == (SafetyReason::EncoderDirection, wheel as u64);
                assert!(is_right, "{robot} {law} {path} {fault:?}: {named:?}");
            }
        }
    }
}

#[test]
fn a_wheel_of_four_that_is_wired_backwards_is_named() {
    let (mut told, mut right, mut near, mut all) = (0, 0, 0, 0);
    for &law in ALL.iter() {
        for (fault, path, named) in named("mecanum", law, None, |fault| matches!(fault, Fault::Turned(_))) {
            let Fault::Turned(wheel) = fault else { continue };
            println!("{law} {path} {fault:?}: {named:?}");
            let is_named = named.reason == SafetyReason::Wiring;
            told += u32::from(is_named);
            right += u32::from(is_named && named.wheel == wheel as u64);
            near += u32::from(is_named && named.way_m <= 0.5);
            all += 1;
        }
    }
    println!("{told} of {all} named within a metre, {near} within half of one, {right} by the right wheel");
    assert!(told >= LEAST_OF_80 && near >= LEAST_OF_80 && right == told, "{told}, {near}, {right} of {all}");
}

#[test]
fn a_gyro_names_a_wheel_of_three_that_is_wired_backwards() {
    for law in ["closed_loop_speed", "adaptive_torque"] {
        let mut near = 0;
        for (fault, path, named) in named("bmm", law, Some(1.0), |fault| matches!(fault, Fault::Turned(_))) {
            println!("{law} {path} {fault:?}: {named:?}");
            let Fault::Turned(wheel) = fault else { continue };
            // The first wheel stands while it drives along x.
            let stands = (path, wheel) == ("square", 0);
            let right = (SafetyReason::Wiring, wheel as u64);
            let slips = (SafetyReason::WheelSlip, wheel as u64);
            let found = (named.reason, named.wheel);
            assert!(stands || found == right || found == slips, "{law} {path} {fault:?}: {named:?}");
            assert!(named.astray_m < 0.1, "{law} {path} {fault:?}: {named:?}");
            near += u32::from(found == right && named.way_m <= 0.5);
        }
        assert!(near >= 10, "{law}: {near} of 15 are named within half a metre");
    }
}

#[test]
fn a_gyro_names_two_wheels_of_four_that_are_swapped_where_that_leads_astray() {
    let swaps = named("mecanum", "closed_loop_speed", Some(1.0), |fault| matches!(fault, Fault::Swapped(..)));
    for (fault, path, named) in &swaps {
        println!("{path} {fault:?}: {named:?}");
        let is_stopped = matches!(named.reason, SafetyReason::Wiring | SafetyReason::WheelSlip);
        assert!(is_stopped || named.astray_m < 0.01, "{path} {fault:?}: {named:?}");
    }
    let told = swaps.iter().filter(|(.., named)| named.reason == SafetyReason::Wiring).count();
    assert!(told >= 7, "{told} of {}", swaps.len());
}

#[test]
fn a_gyro_that_is_wrong_itself_names_no_wheel() {
    for (robot, law) in [("bmm", "closed_loop_speed"), ("mecanum", "adaptive_torque")] {
        for path in PATHS {
            for tells in [0.0, -1.0] {
                let case = Case { gyro: Some(tells), ..Case::plain(robot, law, path, Fault::None) };
                let named = case.ride(FAR_M);
                println!("{robot} {path} {tells}: {named:?}");
                assert_ne!(named.reason, SafetyReason::Wiring, "{robot} {path} {tells}: {named:?}");
            }
        }
    }
}

#[test]
fn no_robot_that_is_as_its_file_says_is_named() {
    let mut wrong = 0;
    for seed in 1..=ROBOTS {
        let case = Case { gyro: (seed % 2 == 0).then_some(1.0), ..Case::seeded(seed) };
        let named = case.ride(f64::INFINITY);
        if named.is_named() {
            wrong += 1;
            println!("{seed}: {named:?} {case:?}");
        }
    }
    assert_eq!(wrong, 0);
}
