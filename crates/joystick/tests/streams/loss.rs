//! Lost joysticks and lost events.

use omnibase_joystick::port::{Happened, SEARCH_NS};
use omnibase_joystick::{Block, Hold, Joystick, Port, Presence, RawEvent};
use omnibase_robot::config::JoystickTable;

use crate::devices::*;

fn held() -> Stream {
    Stream::default().axis(ABS_Y, 0).press(BTN_TRIGGER).report().wait_ms(100)
}

#[test]
fn an_unplugged_joystick_is_found_again_and_stays_blocked_until_a_person_enables_it() {
    let device = t_flight();
    let again = Stream::default()
        .press(BTN_TRIGGER)
        .axis(ABS_Y, 0)
        .report()
        .wait_ms(500)
        .press(BTN_BASE6)
        .report()
        .wait_ms(100)
        .release(BTN_TRIGGER)
        .axis(ABS_Y, 127)
        .report()
        .wait_ms(100)
        .press(BTN_TRIGGER)
        .report()
        .wait_ms(100)
        .report();
    let recordings = vec![held().report().recorded(&device), again.recorded(&device)];
    let mut port = Port::new(Plugs(JoystickTable::default(), recordings), Joystick::new(AGE_NS));
    let mut happened = Vec::new();
    for ms in (0..=2000).step_by(10) {
        let (command, what) = port.turn(ms * MS);
        match what {
            Some(Happened::Plugged(..)) => happened.push((ms, "plugged")),
            Some(Happened::Unplugged) => happened.push((ms, "unplugged")),
            _ => {}
        }
        let (presence, block, hold) = match ms {
            0 => (Presence::Present, None, Hold::Released),
            10..=110 => (Presence::Present, None, Hold::Held),
            // Looked for at most once a second: at 0, 1 s, 2 s.
            120..1000 => (Presence::Absent, Some(Block::Lost), Hold::Released),
            1000..1510 => (Presence::Present, Some(Block::Lost), Hold::Released),
            // Enabled with the trigger held; then let go; then held.
            1510..1710 => (Presence::Present, None, Hold::Released),
            1710..=1810 => (Presence::Present, None, Hold::Held),
            _ => (Presence::Absent, Some(Block::Lost), Hold::Released),
        };
        assert_eq!((command.presence, command.block, command.hold), (presence, block, hold), "{ms} ms");
        if command.hold == Hold::Released {
            assert_eq!(command.twist, [0.0; 3], "{ms} ms");
        }
    }
    assert_eq!(happened, [(0, "plugged"), (120, "unplugged"), (1000, "plugged"), (1820, "unplugged")]);
    assert_eq!(SEARCH_NS, 1000 * MS);
}

#[test]
fn a_reader_that_falls_silent_for_longer_than_the_age_loses_the_joystick() {
    let mut port = port(&JoystickTable::default(), &t_flight(), &held().wait_ms(10_000).report());
    port.turn(0);
    assert_eq!(port.turn(10 * MS).0.hold, Hold::Held);
    // As long as the age: still there.
    assert_eq!(port.turn(10 * MS + AGE_NS).0.hold, Hold::Held);
    // Who asks without reading sees the age rise, and the loss.
    let now_ns = 10 * MS + AGE_NS;
    let joystick = port.joystick_mut();
    assert_eq!(joystick.command(now_ns + 1).age_ns, Some(1));
    let lost = joystick.command(now_ns + AGE_NS + 1);
    assert_eq!((lost.presence, lost.block), (Presence::Absent, Some(Block::Lost)));
    // It is read again: there, but blocked.
    let back = port.turn(now_ns + AGE_NS + MS).0;
    assert_eq!(
        (back.presence, back.block, back.hold),
        (Presence::Present, Some(Block::Lost), Hold::Released)
    );
}

#[test]
fn a_gap_between_two_readings_counts_though_nobody_asked_in_it() {
    let mut port = port(&JoystickTable::default(), &t_flight(), &held().wait_ms(10_000).report());
    port.turn(0);
    assert_eq!(port.turn(10 * MS).0.hold, Hold::Held);
    let after = port.turn(11 * MS + AGE_NS).0;
    assert_eq!(
        (after.presence, after.block, after.hold),
        (Presence::Present, Some(Block::Lost), Hold::Released)
    );
}

#[test]
fn a_joystick_that_is_not_there_cannot_be_enabled() {
    let mut port = port(&JoystickTable::default(), &t_flight(), &held());
    port.turn(0);
    port.turn(100 * MS);
    assert_eq!(port.turn(200 * MS).0.block, Some(Block::Lost));
    port.joystick_mut().enable();
    assert_eq!(port.turn(210 * MS).0.block, Some(Block::Lost));
}

#[test]
fn after_lost_events_the_device_is_asked_for_its_state() {
    // The buffer ran over while the trigger was let go and the joystick went back: none of that arrives whole.
    let stream = held()
        .axis(ABS_X, 255)
        .dropped()
        .axis(ABS_Y, 127)
        .release(BTN_TRIGGER)
        .report()
        .wait_ms(100)
        .report();
    let device = t_flight();
    let mut port = port(&JoystickTable::default(), &device, &stream);
    port.turn(0);
    assert_eq!(port.turn(10 * MS).0.hold, Hold::Held);
    let (command, happened) = port.turn(110 * MS);
    assert_eq!((command.hold, command.block), (Hold::Released, None));
    // The state that was read stands at the end, so that a recording holds it.
    let Some(Happened::Events(events)) = happened else { panic!("{happened:?}") };
    assert_eq!(events.last().map(|event| (event.kind, event.code)), Some((0, 0)));
    assert!(events.len() > device.axes.len() + device.buttons.len());
}

#[test]
fn a_state_that_was_read_after_lost_events_presses_buttons_too() {
    let device = t_flight();
    let map = omnibase_joystick::Map::of(&JoystickTable::default(), &device).expect("a map");
    let mut joystick = Joystick::new(AGE_NS);
    joystick.plug(0, map, at_rest(&device));
    let mut state = at_rest(&device);
    state.pressed.insert(BTN_THUMB);
    joystick.reread(state);
    assert!(joystick.command(1).requests.stop);
}

#[test]
fn half_a_report_is_none() {
    let device = t_flight();
    let map = omnibase_joystick::Map::of(&JoystickTable::default(), &device).expect("a map");
    let mut joystick = Joystick::new(AGE_NS);
    joystick.plug(0, map, at_rest(&device));
    joystick.command(0);
    joystick.take(RawEvent::button(0, BTN_TRIGGER, 1));
    joystick.take(RawEvent::axis(0, ABS_Y, 0));
    assert_eq!(joystick.command(1).hold, Hold::Released);
    joystick.take(RawEvent::report(0));
    assert_eq!(joystick.command(2).hold, Hold::Held);
}
