//! What happens to the simulated robot by time: it comes when it should, does what it should, and is told.

use omnibase_run::simulated;
use omnibase_trials::framed::{Tracked, track_and_look};
use omnibase_trials::{plan_of, robots};

/// The BMM on the spot, or on a path, with events.
fn run(reference: &str, events: &str) -> Tracked {
    track_and_look(&format!("{}\n{events}\n{reference}", robots::BMM))
}

fn event(at_s: f64, kind: &str, keys: &str) -> String {
    format!("[[simulation.event]]\nat_s = {at_s:?}\nkind = \"{kind}\"\n{keys}\n")
}

fn told(tracked: &Tracked) -> Vec<(f64, String)> {
    let simulated = tracked.ran.summary.events.iter().filter(|event| event.text.starts_with("simulated: "));
    simulated.map(|event| (event.time_s, event.text["simulated: ".len()..].to_owned())).collect()
}

#[test]
fn each_thing_happens_at_its_time_and_is_told() {
    let events = [
        event(2.0, "push", "force_n = [60.0, 0.0]\nduration_s = 0.2"),
        event(3.0, "payload", "mass_kg = 60.0\nposition_m = [0.1, 0.0]\nduration_s = 1.0"),
        event(6.0, "floor", "static_friction = 0.4\nduration_s = 1.0"),
        event(8.0, "weak_motor", "drive = \"wheel_2\"\ntorque_ratio = 0.6\nduration_s = 0.5"),
        event(9.0, "push", "moment_nm = 5.0\nframe = \"platform\"\nduration_s = 0.1"),
    ];
    let tracked = run(robots::CIRCLE, &events.concat());
    let expected = [
        (2.0, "a push of 60 N, 0 N in the axes of odom, and 0 N·m"),
        (2.2, "the push ends"),
        (3.0, "a payload of 60 kg at 0.1 m, 0 m"),
        (4.0, "the payload is as before"),
        (6.0, "the floor's friction is 0.400 sticking, 0.360 sliding"),
        (7.0, "the floor is as before"),
        (8.0, "the motor of wheel_2 gives 0.6 of its torque"),
        (8.5, "the motor of wheel_2 is as before"),
        (9.0, "a push of 0 N, 0 N in the axes of the platform, and 5 N·m"),
        (9.1, "the push ends"),
    ];
    let told = told(&tracked);
    assert_eq!(told.len(), expected.len(), "{told:?}");
    for ((at_s, text), (expected_s, expected)) in told.iter().zip(expected) {
        assert!((at_s - expected_s).abs() < 1e-9 && text == expected, "{at_s} {text}: {expected}");
    }
    assert!(tracked.ran.finished);
    // The same again, to the bit; and without them another way.
    let again = run(robots::CIRCLE, &events.concat());
    assert_eq!(tracked.machine.truth(), again.machine.truth());
    assert_ne!(tracked.machine.truth(), run(robots::CIRCLE, "").machine.truth());
}

#[test]
fn what_lasts_lasts() {
    let events = [
        event(1.0, "payload", "mass_kg = 50.0"),
        event(2.0, "weak_motor", "drive = \"wheel_1\"\ntorque_ratio = 0.8"),
    ];
    let tracked = run(robots::CIRCLE, &events.concat());
    let machine = tracked.machine.lock();
    assert_eq!((machine.body().mass_kg(), machine.motors()[0].parameters().torque_ratio), (120.0, 0.8));
    assert_eq!(machine.motors()[1].parameters().torque_ratio, 1.0);
}

#[test]
fn what_would_tip_it_over_is_told_and_left() {
    let tracked = run(robots::CIRCLE, &event(1.0, "payload", "mass_kg = 300.0\nposition_m = [1.0, 0.0]"));
    let told = told(&tracked);
    assert!(told[0].1.contains("is not possible: wheel 1 would carry"), "{told:?}");
    assert_eq!(tracked.machine.lock().body().mass_kg(), 70.0);
}

#[test]
fn a_drive_that_fails_loses_torque_or_supply_stops_the_robot() {
    for (kind, keys, words) in [
        ("drive_fault", "error_code = 0x7500", "wheel_3 fails with error 0x7500"),
        ("sto", "duration_s = 0.5", "STO takes the torque of wheel_3"),
        ("lose_power", "duration_s = 0.5", "wheel_3 loses its supply"),
    ] {
        let tracked = run(robots::CIRCLE, &event(3.0, kind, &format!("drive = \"wheel_3\"\n{keys}")));
        let told = told(&tracked);
        assert_eq!(told[0], (3.0, words.to_owned()));
        let why = format!("{:?} {:?}", tracked.ran.ended, tracked.ran.summary.events);
        assert!(!tracked.ran.finished && tracked.ran.ended.is_err(), "{kind}");
        // The one that was meant, and no other.
        let is_named =
            ["wheel_3: the drive", "`wheel_3` (SubDevice 2): lost"].iter().any(|words| why.contains(words));
        assert!(is_named, "{kind}: {why}");
        let quick = tracked.ran.summary.events.iter().find(|event| event.text == "quick stop");
        let quick_s = quick.map(|event| event.time_s).expect("it stops");
        assert!((3.0..3.02).contains(&quick_s), "{kind}: {quick_s} s");
        // Without its supply a motor turns freely.
        let twist = tracked.machine.truth().twist_in_body;
        assert!(kind == "lose_power" || twist.vx_m_s.hypot(twist.vy_m_s) < 1e-3, "{kind}: {twist:?}");
    }
}

#[test]
fn patches_slopes_and_weak_motors_of_the_file_reach_the_machine() {
    let file = "slope_rad = 0.02\nslope_direction_rad = 1.0\ntorque_ratio = [1.0, 0.9, 1.0]\ncogging_nm = 0.1\n\
                torque_ripple = 0.02\ntread_stiffness_n_m = 4e6\n[[simulation.patch]]\nrectangle_m = [-1, -1, 1, 1]\n\
                static_friction = 0.4\n[[simulation.patch]]\ncentre_m = [3, 0]\nradius_m = 1\nstatic_friction = 0.0\n";
    let tracked = run(robots::CIRCLE, file);
    assert!(tracked.ran.finished);
    let machine = tracked.machine.lock();
    let floor = machine.body().floor();
    assert_eq!((floor.slope.angle_rad, floor.slope.downhill_rad, floor.patches.len()), (0.02, 1.0, 2));
    assert!((floor.patches[0].surface.sliding_friction - 0.36).abs() < 1e-12);
    let motor = machine.motors()[1].parameters();
    assert_eq!((motor.torque_ratio, motor.waves.cogging_n_m, motor.waves.cogging_per_turn), (0.9, 0.1, 72.0));
    assert_eq!((motor.waves.ripple, motor.waves.ripple_per_turn), (0.02, 48.0));
    assert!(machine.body().wheels().iter().any(|wheel| wheel.deflection_m[0] != 0.0));
    let clocks = format!("{}\nclock_drift_ppm = [0.0, 5.0, -3.0]\n", robots::BMM);
    let stations = simulated::description(&plan_of(&clocks)).drives;
    assert_eq!(stations.iter().map(|one| one.piece.dc_drift_ppm).collect::<Vec<_>>(), [0.0, 5.0, -3.0]);
    // Held on the slope by its motors.
    assert!(machine.greatest_torques_n_m().iter().all(|torque| *torque > 0.1));
}
