//! What is allowed and probably not meant.

use super::*;

#[test]
fn what_is_probably_not_meant_is_warned_of() {
    let doubts = |from: &str, to: &str| {
        let text = BMM.replace(from, to);
        assert_ne!(text, BMM, "{from}");
        check(&text).unwrap().doubts()
    };
    assert_eq!(check(BMM).unwrap().doubts(), Vec::<String>::new());
    assert_eq!(check(MECANUM).unwrap().doubts(), Vec::<String>::new());
    for (from, to, setting) in [
        ("wheel_radius_m = 0.10", "wheel_radius_m = 100.0", "platform.wheel_radius_m = 100 m"),
        ("p_m = 0.40", "p_m = 400.0", "platform: the outermost wheel's distance from the centre = 400 m"),
        ("speed_m_s = 1.0", "speed_m_s = 100.0", "limits.speed_m_s = 100 m/s: usual are 0.01 to 10 m/s"),
        (
            "speed_m_s = 1.0",
            "speed_m_s = 1.6",
            "limits.speed_m_s = 1.6 m/s: wheels of limits.wheel_speed_rad_s = 15 rad/s reach 1.5",
        ),
        (
            "mass_kg = 70.0            # w",
            "mass_kg = 80.0 # w",
            "controller.mass_kg = 70 kg: less than the robot",
        ),
        (
            "device = \"sgdv\"",
            "device = \"sgdv\"\ncounts_per_revolution = 40_000",
            "counts_per_revolution: a count is 15.7 um of a rim",
        ),
    ] {
        let found = doubts(from, to);
        assert!(found.iter().any(|doubt| doubt.starts_with(setting)), "{to}: {found:?}");
    }
}

/// Of drives that don't say which cycles they take, unusual ones are doubted; those of one that does are refused.
#[test]
fn cycles_are_those_that_the_devices_take() {
    let of = |text: &str, cycle_us: u32| {
        check(&text.replace("cycle_us = 1000", &format!("cycle_us = {cycle_us}")))
    };
    let found = of(MECANUM, 1100).unwrap().doubts();
    assert!(found[0].starts_with("bus.cycle_us = 1100: few drives take it"), "{found:?}");
    for cycle_us in [125, 250, 1000, 4000] {
        assert!(of(BMM, cycle_us).is_ok(), "{cycle_us}");
    }
    for cycle_us in [100, 300, 1100, 4125, 10_000] {
        let problems = of(BMM, cycle_us).unwrap_err();
        let text = show(&problems);
        assert_eq!(problems.len(), 1, "told once: {text}");
        for expected in ["bus.cycle_us", "device `sgdv`", "0x0035", "multiples of 125 us up to 4000 us"] {
            assert!(text.contains(expected), "{expected}: {text}");
        }
    }
    // From one SYNC0 to the next it is half of the cycle, or there is none.
    let halved = BMM.replace("device = \"sgdv\"", "device = \"sgdv\"\ndc = { sync0_per_cycle = 2 }");
    assert!(of(&halved, 8000).is_ok() && of(&halved, 4125).is_err());
    let free =
        BMM.replace("synchronisation = \"sync0\"", "synchronisation = \"free_run\"\nclock_source = \"host\"");
    assert!(of(&free, 10_000).is_ok());
}

#[test]
fn counts_are_not_said_to_be_coarse_where_little_is_asked_for() {
    for (from, to) in
        [("acceleration_m_s2 = 1.5", "acceleration_m_s2 = 0.1"), ("jerk_m_s3 = 40.0", "jerk_m_s3 = 1.0")]
    {
        let text = BMM.replace(from, to);
        assert_ne!(text, BMM, "{from}");
        let found = check(&text).unwrap().doubts();
        assert!(!found.iter().any(|doubt| doubt.contains("counts_per_revolution")), "{to}: {found:?}");
    }
}
