//! The simulated body's table.

use super::*;

/// The problems of the shipped BMM with more lines under `[simulation]`, as they are shown.
fn shown(lines: &str) -> String {
    show(&problems(&format!("{BMM}\n{lines}\n")))
}

#[test]
fn damping_of_a_rigid_tread_is_refused() {
    let told = shown("tread_damping_ratio = 0.3");
    assert!(told.contains("simulation.tread_stiffness_n_m: must be given: tread_damping_ratio"), "{told}");
    assert!(check(&format!("{BMM}\ntread_stiffness_n_m = 2e5\ntread_damping_ratio = 0.3\n")).is_ok());
    let told = shown("tread_stiffness_n_m = 1.0");
    assert!(told.contains("simulation.tread_stiffness_n_m = 1.0") && told.contains("allowed"), "{told}");
}

#[test]
fn events_that_cannot_happen_are_refused_with_the_reason() {
    let told = shown(
        r#"
[[simulation.event]]
at_s = 2.0
kind = "pusch"
[[simulation.event]]
kind = "push"
force_n = [60.0, 0.0]
[[simulation.event]]
at_s = 1.0
kind = "push"
duration_s = 1.0
[[simulation.event]]
at_s = 1.0
kind = "sto"
drive = "weel_2"
[[simulation.event]]
at_s = 1.0
kind = "floor"
static_friction = 0.1
mass_kg = 1.0
[[simulation.event]]
at_s = -1.0
kind = "floor"
static_friction = 0.1
[[simulation.event]]
at_s = 1.0
kind = "floor"
static_friction = 0.1
sliding_friction = 0.2
"#,
    );
    for expected in [
        "simulation.event[0].kind = \"pusch\": nothing is registered by this name; did you mean `push`?",
        "simulation.event[1].at_s: must be given: it says when",
        "simulation.event[1].duration_s: must be given: `push` needs it",
        "simulation.event[2].force_n: must be given: a push has a force, a moment, or both",
        "simulation.event[3].drive = \"weel_2\": no drive has this name; did you mean `wheel_2`? (allowed: wheel_1,",
        "simulation.event[4].mass_kg = 1.0: the event `floor` doesn't read it (allowed: duration_s,",
        "simulation.event[5].at_s = -1.0: the value is outside its bounds (allowed: at least 0",
        "simulation.event[6].sliding_friction = 0.2: a wheel slides more easily than it breaks away",
    ] {
        assert!(told.contains(expected), "{expected}\n{told}");
    }
    assert_eq!(told.lines().count(), 8, "{told}");
    for force in ["[nan, 0.0]", "[inf, 0.0]", "[1e300, 0.0]", "[1.0]"] {
        let event = "[[simulation.event]]\nat_s = 1.0\nkind = \"push\"\nduration_s = 1.0\nforce_n = ";
        let told = shown(&format!("{event}{force}"));
        assert!(told.contains("simulation.event[0].force_n"), "{force}: {told}");
    }
}

#[test]
fn events_come_in_the_order_of_time_from_both_files() {
    let own = format!(
        "{BMM}\nevents_file = \"more.toml\"\n[[simulation.event]]\nat_s = 5.0\nkind = \"push\"\nmoment_nm = 3.0\n\
         duration_s = 2.0\n"
    );
    let with = |more: &'static str| {
        let read_file = move |name: &str| match name {
            "more.toml" => Ok(more.to_owned()),
            _ => Err(format!("no file {name}")),
        };
        RobotPlan::from_toml(&own, &Registry::with_built_in(), &read_file)
    };
    let plan = with("[[event]]\nat_s = 6.0\nkind = \"sto\"\ndrive = \"wheel_3\"\n").expect("both are sound");
    let push = |moment_nm| Happening::Push { force_n: [0.0; 2], moment_nm, frame: PushFrame::Odom };
    let sto = Happening::SafeTorqueOff { wheel: 2, is_off: true };
    let events: Vec<(u64, Happening)> =
        plan.events.iter().map(|event| (event.at_ns, event.happening)).collect();
    assert_eq!(events, [(5_000_000_000, push(3.0)), (6_000_000_000, sto), (7_000_000_000, push(0.0))]);
    let told =
        show(&with("[[event]]\nat_s = 6.0\nkind = \"sto\"\ndrive = \"\"\n").expect_err("no such drive"));
    assert!(told.starts_with("more.toml:4:1: event[0].drive = \"\": no drive has this name"), "{told}");
    let told = show(&with("[[events]]\nat_s = 6.0\n").expect_err("no such list"));
    assert!(
        told.contains("more.toml:1:3: events: no setting has this name; did you mean `event`?"),
        "{told}"
    );
    let told = shown("events_file = \"none.toml\"");
    assert!(told.contains("simulation.events_file = \"none.toml\": no file none.toml"), "{told}");
}

#[test]
fn patches_slopes_and_motors_are_refused_where_they_contradict_themselves() {
    for (lines, expected) in [
        (
            "torque_ratio = [1.0, 0.5]",
            "simulation.torque_ratio = 2 values: one for each wheel (allowed: 3 values)",
        ),
        (
            "clock_drift_ppm = [5.0]",
            "simulation.clock_drift_ppm = 1 values: one for each wheel (allowed: 3 values)",
        ),
        ("clock_drift_ppm = [0.0, 300.0, 0.0]", "simulation.clock_drift_ppm[1] = 300"),
        (
            "turned_drives = [\"wheel_4\"]",
            "simulation.turned_drives = \"wheel_4\": no drive has this name; did you mean `wheel_3`? (allowed: wheel_1, wheel_2, wheel_3)",
        ),
        (
            "swapped_drives = [\"wheel_1\", \"wheel_1\"]",
            "simulation.swapped_drives = wheel_1, wheel_1: two drives change places (allowed: two different names)",
        ),
        ("cogging_per_turn = 72", "simulation.cogging_nm: must be given"),
        ("torque_ripple_per_turn = 48", "simulation.torque_ripple: must be given"),
        ("slope_direction_rad = 1.0", "simulation.slope_rad: must be given: a level floor has no direction"),
        (
            "[[simulation.patch]]\nstatic_friction = 0.1",
            "simulation.patch[0].centre_m: must be given: a patch is a disc",
        ),
        (
            "[[simulation.patch]]\nrectangle_m = [0, 0, 1, 1]\nradius_m = 1\nstatic_friction = 0.1",
            "simulation.patch[0].rectangle_m: a patch is a rectangle or a disc, not both",
        ),
        (
            "[[simulation.patch]]\nrectangle_m = [0, 1, 1, 0]\nstatic_friction = 0.1",
            "simulation.patch[0].rectangle_m: there is nothing in it",
        ),
        (
            "[[simulation.patch]]\nrectangle_m = [0, 0, 1, 1]",
            "simulation.patch[0].static_friction: must be given: it says how slippery it is",
        ),
        (
            "[[simulation.patch]]\nrectangle_m = [0, 0, 1, 1]\nstatic_friction = 0.1\nsliding_friction = 0.2",
            "simulation.patch[0].sliding_friction = 0.2: a wheel slides more easily",
        ),
    ] {
        let told = shown(lines);
        assert!(told.contains(expected), "{lines}: {told}");
    }
}

#[test]
fn an_event_that_begins_when_another_ends_begins_after_that_end() {
    let push = |at_s: f64, force_n: f64| {
        format!(
            "[[simulation.event]]\nat_s = {at_s}\nkind = \"push\"\nduration_s = 1.0\nforce_n = [{force_n}, 0.0]\n"
        )
    };
    let plan = check(&format!("{BMM}\n{}{}", push(2.0, 20.0), push(1.0, 10.0))).unwrap();
    let forces = plan.events.iter().map(|event| match event.happening {
        Happening::Push { force_n: [x_n, _], .. } => (event.at_ns / 1_000_000_000, x_n),
        other => panic!("{other:?}"),
    });
    assert_eq!(forces.collect::<Vec<_>>(), [(1, 10.0), (2, 0.0), (2, 20.0), (3, 0.0)]);
    // One that is shorter than a nanosecond ends all the same.
    let short = push(1.0, 10.0).replace("duration_s = 1.0", "duration_s = 1e-12");
    let plan = check(&format!("{BMM}\n{short}")).unwrap();
    assert_eq!(plan.events.last().unwrap().at_ns, 1_000_000_001);
}
