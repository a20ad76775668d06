//! The joystick's table and its maps.

use super::*;

#[test]
fn a_joystick_is_read_by_the_names_of_evdev() {
    let text = format!(
        "{BMM}\n[joystick]\nmap = \"xbox\"\nforward = {{ axis = \"ABS_RY\", gain = 0.5 }}\n\
         buttons = {{ dead_man = \"BTN_A\", platform_frame = \"BTN_TL\" }}\n"
    );
    let plan = check(&text).unwrap_or_else(|problems| panic!("{}", show(&problems)));
    let joystick = &plan.joystick;
    assert_eq!(joystick.forward.axis, Some(AxisCode(4)));
    assert_eq!((joystick.forward.gain, joystick.left.axis), (Some(0.5), None));
    // BTN_A is another name of BTN_SOUTH.
    assert_eq!(joystick.buttons.dead_man.map(|button| button.name()), Some("BTN_SOUTH".into()));
    assert_eq!(joystick.buttons.platform_frame, Some(ButtonCode(0x136)));
    assert_eq!(check(BMM).unwrap().joystick, JoystickTable::default());
}

#[test]
fn wrong_settings_of_a_joystick_come_with_their_places() {
    let joystick = "[joystick]\nmap = \"none\"\nage_ms = 5\n[joystick.forward]\naxis = \"ABS_W\"\ngain = 1.5\n\
                 [joystick.left]\naxis = \"ABS_X\"\ndead_zone = 0.95\n[joystick.turn]\naxis = \"ABS_X\"\n\
                 expo = -0.1\n[joystick.buttons]\nstop = \"BTN_THUMB\"\nenable = \"BTN_THUMB\"\n";
    let first = BMM.lines().count() + 1;
    let problems = problems(&format!("{BMM}{joystick}"));
    let expected = [
        ("joystick.age_ms", ProblemKind::OutOfRange, 2),
        ("joystick.forward.axis", ProblemKind::UnknownName, 4),
        ("joystick.forward.gain", ProblemKind::OutOfRange, 5),
        ("joystick.left.dead_zone", ProblemKind::OutOfRange, 8),
        ("joystick.turn.axis", ProblemKind::Duplicate, 10),
        ("joystick.turn.expo", ProblemKind::OutOfRange, 11),
        ("joystick.buttons.enable", ProblemKind::Duplicate, 14),
        ("joystick.buttons.dead_man", ProblemKind::Missing, 12),
    ];
    for (setting, kind, line) in expected {
        let (_, found, at, _) = found(&problems, setting);
        assert_eq!((found, at), (kind, first + line), "{setting}");
    }
    assert_eq!(problems.len(), expected.len(), "{}", show(&problems));
    assert!(show(&problems).contains("ABS_THROTTLE"), "{}", show(&problems));
}

/// The settings, lines and reasons of what is wrong with a joystick's table behind the robot's file.
fn joystick_problems(table: &str) -> Vec<(String, ProblemKind, usize, String)> {
    let first = BMM.lines().count();
    let told = |problem: Problem| {
        let line = problem.place.as_ref().expect("a place").line - first;
        (problem.setting, problem.kind, line, problem.reason)
    };
    match check(&format!("{BMM}{table}")) {
        Ok(_) => Vec::new(),
        Err(problems) => problems.into_iter().map(told).collect(),
    }
}

#[test]
fn a_task_that_the_ready_map_gave_to_another_button_is_a_problem_with_its_place() {
    let table = "[joystick]\nmap = \"t_flight_stick_x\"\n[joystick.forward]\naxis = \"ABS_RZ\"\n\
                 [joystick.buttons]\nstop = \"BTN_BASE6\"\nreset_frame = \"BTN_SOUTH\"\n\
                 toggle_frame = \"BTN_BASE\"\n";
    let problems = joystick_problems(table);
    let told: Vec<_> =
        problems.iter().map(|(setting, kind, line, _)| (setting.as_str(), *kind, *line)).collect();
    assert_eq!(
        told,
        [
            ("joystick.forward.axis", ProblemKind::Duplicate, 4),
            ("joystick.buttons.stop", ProblemKind::Duplicate, 6),
            ("joystick.buttons.reset_frame", ProblemKind::UnknownName, 7),
        ]
    );
    let reason = &problems[1].3;
    assert_eq!(
        reason,
        "the ready map `t_flight_stick_x` has \"BTN_BASE6\" for joystick.buttons.enable: give \
         joystick.buttons.enable another button too"
    );
    assert!(problems[2].3.contains("have no button \"BTN_SOUTH\""), "{problems:?}");
    // With another button for what it displaces, or without a dead-man button, all is well.
    let swapped = "[joystick]\nmap = \"t_flight_stick_x\"\n[joystick.buttons]\nstop = \"BTN_BASE6\"\n\
                   enable = \"BTN_THUMB\"\n";
    let free =
        "[joystick]\nmap = \"xbox\"\ndead_man = \"not_required\"\n[joystick.buttons]\nstop = \"BTN_TL\"\n";
    for table in [swapped, free] {
        assert_eq!(joystick_problems(table), []);
    }
}

#[test]
fn where_no_map_is_named_one_of_the_ready_maps_must_fit() {
    let buttons = |lines: &str| joystick_problems(&format!("[joystick.buttons]\n{lines}\n"));
    // Free on the T-Flight Stick X; on gamepads alone.
    assert_eq!(buttons("toggle_frame = \"BTN_BASE\""), []);
    assert_eq!(buttons("toggle_frame = \"BTN_MODE\""), []);
    let problems = buttons("stop = \"BTN_START\"");
    assert_eq!(problems.len(), 1, "{problems:?}");
    let (setting, kind, line, reason) = &problems[0];
    assert_eq!((setting.as_str(), *line), ("joystick.buttons.stop", 2));
    assert_eq!(*kind, ProblemKind::UnknownName);
    for part in ["fits no ready map", "`t_flight_stick_x` have no button", "`xbox` has", "`playstation` has"]
    {
        assert!(reason.contains(part), "{part} in {reason}");
    }
    // Each fits another device: together they fit none.
    let problems = buttons("toggle_frame = \"BTN_BASE\"\nreset_frame = \"BTN_MODE\"");
    assert_eq!(problems.iter().map(|(.., line, _)| *line).collect::<Vec<_>>(), [2, 3]);
}
