//! What known devices do: axes, slider, dead-man, frames, stop and enable.

use omnibase_joystick::{Block, Hold, JoystickCommand, JoystickFrame, JoystickMapError, Map, Presence};
use omnibase_robot::config::{
    AxisCode, AxisDirection, ButtonCode, DeadManRule, JoystickFrameName, JoystickTable, ReadyMapName,
};

use crate::devices::*;

/// Turns of 10 ms until a moment; the last command, with all requests since the one before.
fn at(port: &mut omnibase_joystick::Port<Plugs>, from_ms: u64, to_ms: u64) -> JoystickCommand {
    let mut last = JoystickCommand::default();
    let mut asked = last.requests;
    for ms in (from_ms..=to_ms).step_by(10) {
        last = port.turn(ms * MS).0;
        asked.stop |= last.requests.stop;
        asked.enable |= last.requests.enable;
        asked.reset_frame |= last.requests.reset_frame;
        asked.teach_point |= last.requests.teach_point;
    }
    JoystickCommand { requests: asked, ..last }
}

fn near(found: [f64; 3], wished: [f64; 3]) {
    let off = found.iter().zip(wished).map(|(found, wished)| (found - wished).abs()).fold(0.0, f64::max);
    assert!(off < 1e-9, "{found:?} in place of {wished:?}");
}

#[test]
fn a_t_flight_stick_drives_while_its_trigger_is_held() {
    // Forward is up, which counts down; the throttle at its front is the full speed.
    let stream = Stream::default()
        .axis(ABS_THROTTLE, 0)
        .axis(ABS_Y, 0)
        .report()
        .wait_ms(100)
        .press(BTN_TRIGGER)
        .report()
        .wait_ms(100)
        .axis(ABS_Y, 127)
        .axis(ABS_X, 0)
        .report()
        .wait_ms(100)
        .axis(ABS_X, 128)
        .axis(ABS_RZ, 255)
        .axis(ABS_THROTTLE, 255)
        .report()
        .wait_ms(5000)
        .release(BTN_TRIGGER)
        .report()
        .wait_ms(100)
        .report();
    let mut port = port(&JoystickTable::default(), &t_flight(), &stream);
    let free = at(&mut port, 0, 90);
    assert_eq!((free.hold, free.twist, free.presence), (Hold::Released, [0.0; 3], Presence::Present));
    let forward = at(&mut port, 100, 190);
    assert_eq!((forward.hold, forward.frame, forward.block), (Hold::Held, JoystickFrame::Platform, None));
    near(forward.twist, [1.0, 0.0, 0.0]);
    near(at(&mut port, 200, 290).twist, [0.0, 1.0, 0.0]);
    // To the right is clockwise; a tenth is left of the speed.
    near(at(&mut port, 300, 390).twist, [0.0, 0.0, -0.1]);
    // Five seconds without an event: a resting joystick isn't a lost one.
    let resting = at(&mut port, 400, 5290);
    assert_eq!((resting.hold, resting.age_ns), (Hold::Held, Some(0)));
    near(resting.twist, [0.0, 0.0, -0.1]);
    let free = at(&mut port, 5300, 5390);
    assert_eq!((free.hold, free.twist, free.block), (Hold::Released, [0.0; 3], None));
}

#[test]
fn pads_drive_by_their_left_stick_and_turn_by_their_right_one() {
    for (device, ends) in [(xbox(), [-32_768, 32_767, 1023]), (dual_sense(), [0, 255, 255])] {
        let [low, _, trigger] = ends;
        let stream = Stream::default()
            .press(BTN_TL)
            .axis(ABS_Y, low)
            .axis(ABS_RX, low)
            .axis(ABS_RZ, 0)
            .report()
            .wait_ms(100)
            .axis(ABS_RZ, trigger)
            .axis(ABS_X, low)
            .report()
            .wait_ms(100)
            .report();
        let mut port = port(&JoystickTable::default(), &device, &stream);
        // 40 % without the right trigger.
        near(at(&mut port, 0, 90).twist, [0.4, 0.0, 0.4]);
        // Both ways at once aren't faster than one.
        let half = 0.5_f64.sqrt();
        near(at(&mut port, 100, 190).twist, [half, half, 1.0]);
    }
}

#[test]
fn all_listed_ids_have_a_map_and_a_pads_other_devices_do_not_fit() {
    let table = JoystickTable::default();
    let ids = [
        (0x045E, 0x028E, ReadyMapName::Xbox),
        (0x045E, 0x02EA, ReadyMapName::Xbox),
        (0x045E, 0x0B12, ReadyMapName::Xbox),
        (0x054C, 0x05C4, ReadyMapName::Playstation),
        (0x054C, 0x09CC, ReadyMapName::Playstation),
        (0x054C, 0x0CE6, ReadyMapName::Playstation),
    ];
    for (vendor_id, product_id, ready) in ids {
        let gamepad = if ready == ReadyMapName::Xbox { xbox() } else { dual_sense() };
        let gamepad = omnibase_joystick::Description { vendor_id, product_id, ..gamepad };
        assert_eq!(
            Map::of(&table, &gamepad).expect("a map").ready,
            ready,
            "{vendor_id:04x}:{product_id:04x}"
        );
    }
    assert_eq!(Map::of(&table, &t_flight()).expect("a map").ready, ReadyMapName::TFlightStickX);
    let problems = Map::of(&table, &motion_sensors()).expect_err("no buttons");
    assert!(
        problems.iter().any(|problem| matches!(problem, JoystickMapError::NoButton { what: "dead_man", .. }))
    );
    let unknown = omnibase_joystick::Description { vendor_id: 1, ..xbox() };
    assert!(matches!(
        Map::of(&table, &unknown).unwrap_err()[..],
        [JoystickMapError::Unknown { vendor_id: 1, .. }]
    ));
    let named = JoystickTable { map: Some(ReadyMapName::Xbox), ..table };
    assert!(Map::of(&named, &unknown).is_ok());
}

#[test]
fn what_is_held_when_the_joystick_comes_must_be_let_go_first() {
    let device = t_flight();
    let mut state = at_rest(&device);
    state.axes.insert(ABS_Y, 0);
    state.pressed.insert(BTN_TRIGGER);
    let mut joystick = omnibase_joystick::Joystick::new(AGE_NS);
    joystick.plug(0, Map::of(&JoystickTable::default(), &device).expect("a map"), state);
    assert_eq!(joystick.command(1).hold, Hold::Released);
    let button = |value| omnibase_joystick::RawEvent::button(0, BTN_TRIGGER, value);
    let forward = |value| omnibase_joystick::RawEvent::axis(0, ABS_Y, value);
    for (event, held) in [
        // Let go, but pushed: whoever grasps it then moves nothing.
        (button(0), Hold::Released),
        (button(1), Hold::Released),
        // In the middle, but never let go there.
        (forward(127), Hold::Released),
        (forward(0), Hold::Released),
        (button(0), Hold::Released),
        (forward(127), Hold::Released),
        (button(1), Hold::Held),
        (forward(0), Hold::Held),
    ] {
        joystick.take(event);
        joystick.take(omnibase_joystick::RawEvent::report(0));
        assert_eq!(joystick.command(2).hold, held, "{event:?}");
    }
}

#[test]
fn frames_are_chosen_by_buttons_and_the_fixed_one_is_reset_once() {
    let tap = |stream: Stream, button| stream.press(button).report().release(button).report().wait_ms(100);
    let stream = [BTN_TOP, BTN_TOP2, BTN_THUMB2, 0x126, 0x126].into_iter().fold(Stream::default(), tap);
    let mut table = JoystickTable::default();
    table.buttons.toggle_frame = Some(ButtonCode(0x126));
    let mut port = port(&table, &t_flight(), &stream.report());
    assert_eq!(at(&mut port, 0, 90).frame, JoystickFrame::Fixed);
    let reset = at(&mut port, 100, 190);
    assert_eq!((reset.frame, reset.requests.reset_frame), (JoystickFrame::Fixed, true));
    assert!(!port.turn(191 * MS).0.requests.reset_frame);
    assert_eq!(at(&mut port, 200, 290).frame, JoystickFrame::Platform);
    assert_eq!(at(&mut port, 300, 390).frame, JoystickFrame::Fixed);
    assert_eq!(at(&mut port, 400, 490).frame, JoystickFrame::Platform);
    // A point is remembered once a press.
    let stream = tap(Stream::default(), 0x125).report();
    let mut port = self::port(&JoystickTable::default(), &t_flight(), &stream);
    assert!(at(&mut port, 0, 90).requests.teach_point);
    assert!(!port.turn(91 * MS).0.requests.teach_point);
    // The file may begin with the fixed one.
    let table = JoystickTable { frame: Some(JoystickFrameName::Fixed), ..JoystickTable::default() };
    assert_eq!(Map::of(&table, &t_flight()).expect("a map").frame, JoystickFrame::Fixed);
}

#[test]
fn stop_takes_the_command_away_until_the_joystick_is_enabled() {
    let stream = Stream::default()
        .axis(ABS_Y, 0)
        .press(BTN_TRIGGER)
        .report()
        .wait_ms(100)
        .press(BTN_THUMB)
        .report()
        .wait_ms(100)
        .release(BTN_THUMB)
        .release(BTN_TRIGGER)
        .report()
        .press(BTN_TRIGGER)
        .report()
        .wait_ms(100)
        .press(BTN_BASE6)
        .report()
        .wait_ms(100)
        .release(BTN_TRIGGER)
        .axis(ABS_Y, 127)
        .report()
        .press(BTN_TRIGGER)
        .axis(ABS_Y, 0)
        .report()
        .wait_ms(100)
        .press(BTN_THUMB)
        .press(BTN_BASE6)
        .report();
    let mut port = port(&JoystickTable::default(), &t_flight(), &stream);
    assert_eq!(at(&mut port, 0, 90).hold, Hold::Held);
    let stopped = at(&mut port, 100, 190);
    assert_eq!((stopped.hold, stopped.block), (Hold::Released, Some(Block::Stopped)));
    assert!(stopped.requests.stop);
    // The dead-man button alone doesn't give it back.
    let still = at(&mut port, 200, 290);
    assert_eq!((still.hold, still.block), (Hold::Released, Some(Block::Stopped)));
    // Enabled with the trigger held: it has to be let go, in the middle.
    let enabled = at(&mut port, 300, 390);
    assert_eq!((enabled.hold, enabled.block, enabled.requests.enable), (Hold::Released, None, true));
    assert_eq!(at(&mut port, 400, 490).hold, Hold::Held);
    // Stop and enable in one report: stop.
    let both = port.turn(510 * MS).0;
    assert_eq!((both.block, both.requests.stop), (Some(Block::Stopped), true));
}

#[test]
fn without_a_dead_man_only_a_deflected_joystick_commands() {
    let table = JoystickTable { dead_man: Some(DeadManRule::NotRequired), ..JoystickTable::default() };
    let device = t_flight();
    let mut state = at_rest(&device);
    state.axes.extend([(ABS_Y, 0), (ABS_THROTTLE, 0)]);
    let mut joystick = omnibase_joystick::Joystick::new(AGE_NS);
    joystick.plug(0, Map::of(&table, &device).expect("a map"), state);
    // Deflected when it came: it must rest once.
    let [deflected, resting] = [0, 127].map(|value| {
        joystick.take(omnibase_joystick::RawEvent::axis(0, ABS_Y, value));
        joystick.take(omnibase_joystick::RawEvent::report(0));
        joystick.command(1).hold
    });
    assert_eq!((deflected, resting), (Hold::Released, Hold::Released));
    joystick.take(omnibase_joystick::RawEvent::axis(0, ABS_Y, 255));
    joystick.take(omnibase_joystick::RawEvent::report(0));
    let back = joystick.command(2);
    assert_eq!(back.hold, Hold::Held);
    near(back.twist, [-1.0, 0.0, 0.0]);
}

#[test]
fn the_file_changes_single_things_of_a_ready_map() {
    let mut table = JoystickTable::default();
    table.forward.gain = Some(0.5);
    table.left.axis = Some(AxisCode(0x10));
    table.turn.direction = Some(AxisDirection::Normal);
    let stream = Stream::default()
        .press(BTN_TRIGGER)
        .axis(ABS_THROTTLE, 0)
        .axis(ABS_Y, 0)
        .axis(0x10, 1)
        .axis(ABS_RZ, 255)
        .report()
        .report();
    let mut port = port(&table, &t_flight(), &stream);
    let length = 0.5_f64.hypot(1.0);
    // An axis of one's own counts as it counts; forward keeps the ready map's direction.
    near(at(&mut port, 0, 10).twist, [0.5 / length, 1.0 / length, 1.0]);
}

#[test]
fn tasks_that_collide_with_a_ready_map_and_values_out_of_bounds_are_refused_together() {
    let mut table = JoystickTable::default();
    table.buttons.stop = Some(ButtonCode(BTN_TRIGGER));
    table.turn.axis = Some(AxisCode(ABS_Y));
    table.left.gain = Some(f64::NAN);
    table.left.axis = Some(AxisCode(0x08));
    table.buttons.reset_frame = Some(ButtonCode(BTN_EAST));
    let problems = Map::of(&table, &t_flight()).expect_err("broken");
    let text: Vec<String> = problems.iter().map(ToString::to_string).collect();
    assert_eq!(text.len(), 4, "{text:#?}");
    assert!(
        text[0].starts_with("joystick.left.axis = ABS_WHEEL: the device has no such axis (it has ABS_X,")
    );
    assert!(text[1].starts_with("ABS_Y would be both forward and turn"));
    assert!(text[2].starts_with("BTN_TRIGGER would be both dead_man and stop"));
    assert!(text[3].starts_with("joystick.buttons.reset_frame = BTN_EAST: the device has no such button"));
    table = JoystickTable::default();
    table.left.gain = Some(f64::NAN);
    table.forward.offset = Some(0.6);
    assert_eq!(Map::of(&table, &t_flight()).expect_err("out of bounds").len(), 2);
    let none = JoystickTable { map: Some(ReadyMapName::None), ..JoystickTable::default() };
    assert!(matches!(Map::of(&none, &t_flight()).unwrap_err()[..], [JoystickMapError::Missing { .. }, ..]));
}
