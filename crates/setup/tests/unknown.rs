//! Robots that nobody knows are set up; more seeds by `cargo run --release -p omnibase-setup --example seeds`.

#[path = "../examples/seeds/unknown.rs"]
mod unknown;

use omnibase_setup::Step;
use unknown::{Unknown, differences, drive_square, set_up};

fn robot() -> Unknown {
    Unknown {
        positions: [2, 0, 1],
        backward: [true, false, true],
        counts: 10_000,
        gear: 5.0,
        turned_encoder: Some(1),
    }
}

#[test]
fn a_robot_wired_in_every_way_wrongly_gets_its_file_and_drives_its_square() {
    let robot = robot();
    // Left in the middle, and taken up again.
    let found = set_up(&robot, Some("way 1")).unwrap();
    assert_eq!(differences(&robot, &found.text), Vec::<String>::new(), "{}", found.text);
    assert_eq!(found.record.done, Step::ALL, "{:?}", found.asked);
    let said = found.record.findings.join("\n");
    for expected in [
        "SubDevice 0: its encoder counts against its motor",
        "counts per turn were seen",
        "wheel_1: its drive is at position 2, the file says 0",
        "wheel_1: it turns the other way than the file says",
    ] {
        assert!(said.contains(expected), "{expected}\n{said}");
    }
    assert!(!said.contains("didn't take its torque"), "{said}");
    let jogged: Vec<&String> = found.record.log.iter().filter(|line| line.contains("hold the key")).collect();
    assert!(
        jogged.len() >= 10 && jogged.iter().all(|line| line.ends_with(" 0 without a held key")),
        "{jogged:?}"
    );
    let rms_m = drive_square(&robot, &found.text).unwrap();
    assert!(rms_m < 5e-3, "{rms_m}");
}

#[test]
fn a_robot_of_a_seed_gets_its_file() {
    let robot = Unknown::of(2);
    let found = set_up(&robot, None).unwrap();
    assert_eq!(differences(&robot, &found.text), Vec::<String>::new(), "{robot:?}");
}
