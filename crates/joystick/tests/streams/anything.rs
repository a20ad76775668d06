//! Bytes, streams, devices and tables of any kind: no panic, nothing beyond −1..1.

use omnibase_joystick::event::{EVENT_BYTES, events_in};
use omnibase_joystick::{
    AxisRange, Description, Hold, Joystick, Map, Presence, RawEvent, Recorded, Shaping, State,
};
use omnibase_robot::AxisShape;
use omnibase_robot::config::JoystickTable;
use proptest::prelude::*;

use crate::devices::*;

/// Events that mostly mean something.
fn event() -> impl Strategy<Value = RawEvent> {
    let kind = prop_oneof![4 => Just(0), 8 => Just(1), 8 => Just(3), 1 => any::<u16>()];
    let code = prop_oneof![
        6 => prop_oneof![Just(0u16), Just(1), Just(3), Just(5), Just(6)],
        6 => 0x120u16..0x140,
        1 => any::<u16>()
    ];
    let value = prop_oneof![4 => 0i32..2, 4 => -40_000i32..40_000, 1 => any::<i32>()];
    (any::<u64>(), kind, code, value).prop_map(|(time_us, kind, code, value)| RawEvent {
        time_us,
        kind,
        code,
        value,
    })
}

fn shaping() -> impl Strategy<Value = Shaping> {
    (prop_oneof![Just(1.0), Just(-1.0)], -0.5..=0.5, 0.0..=0.9, 0.001..=1.0, 0.0..=1.0).prop_map(
        |(sign, offset, dead_zone, gain, expo)| Shaping {
            sign,
            shape: AxisShape { offset, dead_zone, gain, expo },
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, ..ProptestConfig::default() })]

    #[test]
    fn any_bytes_are_events(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        let (events, left_over) = events_in(&bytes);
        prop_assert_eq!(events.len() * EVENT_BYTES + left_over, bytes.len());
        prop_assert!(left_over < EVENT_BYTES);
        let _ = Recorded::from_bytes(&bytes);
    }

    #[test]
    fn events_are_what_their_bytes_say(event in event()) {
        // Times that 64 bits of seconds hold.
        prop_assert_eq!(RawEvent::from_bytes(&event.to_bytes()), event);
    }

    #[test]
    fn any_recording_of_a_known_device_is_played(
        tail in proptest::collection::vec(any::<u8>(), 0..500),
    ) {
        let device = xbox();
        let header = serde_json::json!({
            "format": "omnibase evdev 1", "device": &device, "state": &at_rest(&device),
        });
        let mut bytes = serde_json::to_vec(&header).expect("JSON");
        bytes.push(b'\n');
        bytes.extend(tail);
        let recorded = Recorded::from_bytes(&bytes).expect("a recording");
        let mut port = omnibase_joystick::Port::new(
            Plugs(JoystickTable::default(), vec![recorded]),
            Joystick::new(AGE_NS),
        );
        for turn in 0..50u64 {
            let twist = port.turn(turn * 20 * MS).0.twist;
            prop_assert!(twist.iter().all(|part| (-1.0..=1.0).contains(part)));
        }
    }

    #[test]
    fn whatever_comes_the_wish_is_within_its_bounds_and_nobody_moves_unheld(
        events in proptest::collection::vec((event(), 0u64..300), 0..200),
        which in 0usize..3,
    ) {
        let device = [t_flight(), xbox(), dual_sense()][which].clone();
        let map = Map::of(&JoystickTable::default(), &device).expect("a map");
        let dead_man = map.dead_man.expect("required").0;
        let mut joystick = Joystick::new(AGE_NS);
        joystick.plug(0, map, at_rest(&device));
        let mut now_ns = 0;
        for (event, wait_ms) in events {
            now_ns += wait_ms * MS;
            joystick.heard(now_ns);
            joystick.take(event);
            let command = joystick.command(now_ns);
            prop_assert!(command.twist.iter().all(|part| (-1.0..=1.0).contains(part)));
            prop_assert!(command.twist[0].hypot(command.twist[1]) <= 1.0 + 1e-12);
            if command.hold == Hold::Held {
                prop_assert_eq!((command.presence, command.block), (Presence::Present, None));
                prop_assert!(joystick.state().is_some_and(|state| state.pressed.contains(&dead_man)));
            } else {
                prop_assert_eq!(command.twist, [0.0; 3]);
            }
        }
    }

    #[test]
    fn devices_with_absurd_axes_give_no_absurd_wish(
        ranges in proptest::array::uniform4(any::<[i32; 4]>()),
        values in proptest::array::uniform4(any::<i32>()),
    ) {
        let mut device = t_flight();
        let mut state = State::default();
        for ((code, [minimum, maximum, flat, fuzz]), value) in
            [ABS_X, ABS_Y, ABS_RZ, ABS_THROTTLE].into_iter().zip(ranges).zip(values)
        {
            device.axes.insert(code, AxisRange { minimum, maximum, flat, fuzz });
            state.axes.insert(code, value);
        }
        let map = Map::of(&JoystickTable::default(), &device).expect("a map");
        prop_assert!(map.twist(&state).iter().all(|part| (-1.0..=1.0).contains(part)));
        prop_assert_eq!(map.twist(&State::default()), [0.0; 3]);
    }

    #[test]
    fn shaping_rises_is_continuous_and_ends_at_its_gain(shaping in shaping()) {
        let shape = shaping.shape;
        let at = |normalised: f64| shaping.sign * shaping.curve(normalised);
        let steps = 4000;
        // Slope: 3 at most by expo, 1/(1 − d) by the dead zone, 1/(1 − |o|) by the offset.
        let steepest = 3.0 / (1.0 - shape.dead_zone) / (1.0 - shape.offset.abs());
        let mut last = at(-1.0);
        prop_assert!((last.abs() - shape.gain).abs() < 1e-12);
        for step in 1..=steps {
            let now = at(-1.0 + 2.0 * f64::from(step) / f64::from(steps));
            prop_assert!(now >= last, "falls");
            prop_assert!(now - last <= steepest * 2.0 / f64::from(steps) + 1e-12, "jumps by {}", now - last);
            last = now;
        }
        prop_assert!((last - shape.gain).abs() < 1e-12);
        // Rest is exactly 0, and the dead zone's edge is where motion begins.
        let rest = shaping.sign * shape.offset;
        prop_assert_eq!(shaping.curve(rest), 0.0);
        let edge = shaping.sign * (shape.offset + shape.dead_zone * (1.0 - shape.offset));
        prop_assert!(shaping.curve(edge).abs() < 1e-9);
        let beyond = shaping.sign * (shape.offset + (shape.dead_zone + 0.02) * (1.0 - shape.offset));
        if shape.expo < 0.99 {
            prop_assert!(shaping.curve(beyond) > 0.0);
        }
    }
}

#[test]
fn an_axis_without_a_range_rests() {
    let shaping =
        Shaping { sign: 1.0, shape: AxisShape { offset: 0.0, dead_zone: 0.0, gain: 1.0, expo: 0.0 } };
    for range in [
        AxisRange::default(),
        AxisRange { minimum: 5, maximum: -5, flat: 0, fuzz: 0 },
        AxisRange { minimum: i32::MAX, maximum: i32::MIN, flat: i32::MIN, fuzz: 0 },
    ] {
        assert_eq!(shaping.shape(i32::MAX, range), 0.0);
    }
    // 8 bits have no middle: both values beside it rest by the default dead zone.
    let map = Map::of(&JoystickTable::default(), &t_flight()).expect("a map");
    for raw in [127, 128] {
        assert_eq!(map.axes[0].expect("forward").shaping.shape(raw, t_flight().axes[&ABS_Y]), 0.0);
    }
    let description = Description { axes: [].into(), ..t_flight() };
    assert!(Map::of(&JoystickTable::default(), &description).is_err());
}
