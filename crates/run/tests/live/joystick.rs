//! Recorded events of a joystick drive the simulated robot in virtual time, frames and all.

use std::collections::BTreeMap;

use crate::hands::{Hands, plan, played};
use omnibase_joystick::{
    AxisRange, Description, Device, Finder, Joystick, Map, Port, RawEvent, Recorded, Recorder, State,
};
use omnibase_robot::RequestKind;
use omnibase_robot::config::JoystickTable;
use omnibase_robot::signals::{Frame, Phase};
use omnibase_run::live::{
    Answer, Ask, Client, Commander, JoystickDriver, JoystickState, Live, Refusal, Snapshot,
};

const MS: u64 = 1_000_000;
const ABS_Y: u16 = 1;
const ABS_RZ: u16 = 5;
const ABS_THROTTLE: u16 = 6;
const TRIGGER: u16 = 0x120;
const STOP: u16 = 0x121;
const FIXED: u16 = 0x123;
const RESET: u16 = 0x124;
const ENABLE: u16 = 0x12B;

/// The joystick of the thesis.
fn t_flight() -> Description {
    let range = AxisRange { minimum: 0, maximum: 255, flat: 15, fuzz: 0 };
    Description {
        name: "Thrustmaster T.Flight Stick X".into(),
        vendor_id: 0x044F,
        product_id: 0xB106,
        axes: [0, ABS_Y, ABS_RZ, ABS_THROTTLE].map(|axis| (axis, range)).into(),
        buttons: (0x120..=0x12B).collect(),
    }
}

/// One change of the joystick: when, ms after it was plugged in; axis or button; value.
type Change = (u64, u16, i32);

/// The recording of these changes, each with its report; the joystick is there until `until_ms`.
fn recording(changes: &[Change], until_ms: u64) -> Recorded {
    let device = t_flight();
    let mut axes: BTreeMap<u16, i32> = device.axes.keys().map(|axis| (*axis, 128)).collect();
    // The throttle at its fast end.
    axes.insert(ABS_THROTTLE, 0);
    let path = std::env::temp_dir().join(format!("omnibase-joystick-{:?}", std::thread::current().id()));
    let file = std::fs::File::create(&path).expect("a file");
    let state = State { axes, pressed: [].into() };
    let mut recorder = Recorder::start(Box::new(file), &device, &state).expect("a recording");
    recorder.write(&[RawEvent::report(0)]).expect("written");
    for &(ms, code, value) in changes {
        let time_us = ms * 1000;
        let event = if code < 0x100 {
            RawEvent::axis(time_us, code, value)
        } else {
            RawEvent::button(time_us, code, value)
        };
        recorder.write(&[event, RawEvent::report(time_us)]).expect("written");
    }
    recorder.write(&[RawEvent::report(until_ms * 1000)]).expect("written");
    let bytes = std::fs::read(&path).expect("the file");
    let _ = std::fs::remove_file(&path);
    Recorded::from_bytes(&bytes).expect("a recording")
}

/// What is there at each search, one after the other.
struct Plugs(std::vec::IntoIter<Option<Recorded>>);

impl Finder for Plugs {
    fn find(&mut self) -> Option<(Box<dyn Device>, Map)> {
        let device = self.0.next()??;
        let map = Map::of(&JoystickTable::default(), device.description()).expect("the map fits");
        Some((Box::new(device), map))
    }
}

/// Gives the joystick's port a turn every 10 ms from `from_s` on.
fn drive(hands: &mut Hands, from_s: f64, found: Vec<Option<Recorded>>) {
    let mut port = Port::new(Plugs(found.into_iter()), Joystick::new(200 * MS));
    let mut driver = JoystickDriver::new(&plan());
    hands.between(from_s, f64::INFINITY, move |live, seen| {
        let now_ns = seen.record.time.now_ns;
        if !now_ns.is_multiple_of(10 * MS) {
            return;
        }
        driver.agree(port.joystick_mut(), seen);
        let (command, _) = port.turn(now_ns);
        let changes = driver.changes();
        if !changes.is_empty() {
            live.set(Client::Joystick, &changes).expect("there is room");
        }
        for ask in driver.asks(&command, seen) {
            live.send(Client::Joystick, ask).expect("there is room");
        }
    });
}

fn stands(seen: &Snapshot) {
    let twist = seen.record.state.twist_in_body;
    assert!(twist.speed_m_s() < 0.005 && twist.w_rad_s.abs() < 0.01, "{twist:?}");
    assert_eq!(seen.extras.authority.commander, Commander::Nobody);
}

#[test]
fn a_moved_joystick_moves_the_robot_and_a_released_dead_man_stops_it() {
    let changes = [
        // Drives on, by a person at the joystick.
        (100, ENABLE, 1),
        (200, ENABLE, 0),
        // Without the dead-man button nothing moves.
        (1500, ABS_Y, 0),
        (2500, TRIGGER, 1),
        (4500, TRIGGER, 0),
    ];
    let recorded = recording(&changes, 60_000);
    let run = played(6.5, |hands| {
        drive(hands, 0.1, vec![Some(recorded)]);
        hands.at(2.4, |_, seen| {
            assert_eq!(seen.phase, Phase::Holding);
            stands(seen);
        });
        hands.at(4.5, |_, seen| {
            assert_eq!(seen.extras.authority.commander, Commander::Stick(Client::Joystick));
            // The whole joystick is the whole speed of the robot's file.
            assert!((seen.record.state.twist_in_body.vx_m_s - 1.0).abs() < 0.02);
        });
        hands.at(6.0, |_, seen| {
            assert_eq!((seen.phase, seen.extras.authority.blocked_sticks), (Phase::Holding, 0));
            stands(seen);
        });
    });
    let x_m = run.last.record.state.odom_from_body.x_m;
    assert!((1.8..2.4).contains(&x_m), "{x_m} m");
    // Told once, however often the joystick says so while the robot comes to rest.
    let events = run.live.events_after(0);
    let told = events.iter().filter(|event| event.text.starts_with("let go of the stick")).count();
    assert_eq!(told, 1, "{events:?}");
    assert!(run.ran.ended.is_ok(), "{:?}", run.ran.ended);
    assert!(run.replayed.difference.is_none(), "{:?}", run.replayed);
}

#[test]
fn an_unplugged_joystick_stops_the_robot_and_is_blocked_until_a_person_enables_it() {
    let first = recording(&[(100, ENABLE, 1), (1500, ABS_Y, 0), (1500, TRIGGER, 1)], 2500);
    // Plugged in again, with the trigger held and let go; enabled at 3 s of its own time.
    let second = recording(
        &[
            (100, ABS_Y, 0),
            (200, TRIGGER, 1),
            (1000, TRIGGER, 0),
            (1100, TRIGGER, 1),
            (2500, ENABLE, 1),
            (3000, TRIGGER, 0),
            (3000, ABS_Y, 128),
            (3100, TRIGGER, 1),
            (3200, ABS_Y, 0),
        ],
        60_000,
    );
    let run = played(9.5, |hands| {
        drive(hands, 0.1, vec![Some(first), Some(second)]);
        hands.at(2.5, |_, seen| assert!(seen.record.state.twist_in_body.vx_m_s > 0.9));
        // There again at once, but blocked, whatever is held.
        hands.at(4.9, |_, seen| {
            assert_eq!((seen.phase, seen.extras.authority.blocked_sticks), (Phase::Holding, 1));
            stands(seen);
        });
        hands.at(9.0, |_, seen| {
            assert_eq!(seen.extras.authority.blocked_sticks, 0);
            assert!(seen.record.state.twist_in_body.vx_m_s > 0.9);
        });
    });
    let events = run.live.events_after(0);
    let texts: Vec<&str> = events.iter().map(|event| &*event.text).collect();
    assert!(texts.iter().any(|text| text.starts_with("the stick is gone")), "{texts:?}");
}

#[test]
fn a_joystick_that_was_lost_is_enabled_by_a_page_but_not_before_it_is_back_and_drives_only_once_let_go() {
    let first = recording(&[(100, ENABLE, 1), (1500, ABS_Y, 0), (1500, TRIGGER, 1)], 2500);
    // Plugged in again 1 s later: its trigger is held, and it is pushed, while a page enables it at 4.5 s.
    let second = recording(
        &[
            (100, ABS_Y, 0),
            (200, TRIGGER, 1),
            // Let go, grasped again while it is pushed: not yet. Then from the middle.
            (2500, TRIGGER, 0),
            (2600, TRIGGER, 1),
            (3500, TRIGGER, 0),
            (3500, ABS_Y, 128),
            (3600, TRIGGER, 1),
            (3700, ABS_Y, 0),
        ],
        60_000,
    );
    let page = Client::Page(2);
    let enable = || Ask::EnableStick(Client::Joystick);
    let state = |seen: &Snapshot| seen.extras.authority.joystick;
    let run = played(9.0, |hands| {
        drive(hands, 0.1, vec![Some(first), None, Some(second)]);
        hands.at(0.05, move |_, seen| assert_eq!(state(seen), JoystickState::Absent));
        hands.at(2.5, move |_, seen| assert_eq!(state(seen), JoystickState::Present));
        hands.at(2.7, move |_, seen| assert_eq!(state(seen), JoystickState::Lost));
        hands.ask(2.7, page, enable(), Answer::Refused(Refusal::NoStick));
        hands.at(4.4, move |_, seen| assert_eq!(state(seen), JoystickState::Blocked));
        hands.ask(4.5, page, enable(), Answer::Done);
        // Enabled, but still held and pushed as when it was plugged in: nothing moves until it was let go.
        hands.between(4.7, 7.0, move |_, seen| {
            assert_eq!((state(seen), seen.extras.authority.blocked_sticks), (JoystickState::Present, 0));
            stands(seen);
        });
        hands.at(8.9, |_, seen| assert!(seen.record.state.twist_in_body.vx_m_s > 0.9));
    });
    let events = run.live.events_after(0);
    let by_page: Vec<&str> =
        events.iter().filter(|event| event.client == Some(page)).map(|event| &*event.text).collect();
    assert_eq!(by_page, ["enabled the joystick again"]);
}

#[test]
fn a_joystick_that_nobody_holds_is_missed_too() {
    let recorded = recording(&[(100, ENABLE, 1)], 1500);
    let run = played(3.0, |hands| {
        drive(hands, 0.1, vec![Some(recorded)]);
        hands.at(1.5, |_, seen| assert_eq!(seen.extras.authority.joystick, JoystickState::Present));
        hands.at(2.0, |_, seen| {
            assert_eq!((seen.phase, seen.extras.authority.joystick), (Phase::Holding, JoystickState::Lost));
        });
    });
    let told =
        run.live.events_after(0).iter().filter(|event| event.text.starts_with("the stick is gone")).count();
    assert_eq!(told, 1);
}

#[test]
fn the_stop_button_stops_and_gives_the_command_back() {
    let changes = [
        (100, ENABLE, 1),
        (200, ENABLE, 0),
        (1500, ABS_Y, 0),
        (1500, TRIGGER, 1),
        (3000, STOP, 1),
        (3100, STOP, 0),
        (3200, TRIGGER, 0),
        (3300, TRIGGER, 1),
        (5500, ENABLE, 1),
        // Let go, but not in the middle: that isn't enough.
        (5600, TRIGGER, 0),
        (5700, TRIGGER, 1),
        (6500, TRIGGER, 0),
        (6500, ABS_Y, 128),
        (6600, TRIGGER, 1),
        (6700, ABS_Y, 0),
    ];
    let recorded = recording(&changes, 60_000);
    let run = played(9.0, |hands| {
        drive(hands, 0.1, vec![Some(recorded)]);
        hands.at(6.5, |_, seen| {
            assert_eq!((seen.phase, seen.extras.authority.blocked_sticks), (Phase::Holding, 0));
            stands(seen);
        });
        hands.at(5.0, |_, seen| {
            assert_eq!((seen.phase, seen.extras.authority.blocked_sticks), (Phase::Holding, 1));
            stands(seen);
        });
        hands.at(8.9, |_, seen| {
            assert_eq!(seen.extras.authority.blocked_sticks, 0);
            assert!(seen.record.state.twist_in_body.vx_m_s > 0.9);
        });
    });
    let events = run.live.events_after(0);
    let texts: Vec<&str> = events.iter().map(|event| &*event.text).collect();
    assert!(texts.iter().any(|text| text.starts_with("stopped at the stick")), "{texts:?}");
}

#[test]
fn the_fixed_frame_keeps_its_forward_while_the_platform_turns() {
    let changes = [
        (100, ENABLE, 1),
        // Turned to the left for a while.
        (1500, TRIGGER, 1),
        (1500, ABS_RZ, 64),
        (3000, ABS_RZ, 128),
        // Forward is what it was at the start.
        (4500, FIXED, 1),
        (4500, ABS_Y, 64),
        (5500, ABS_Y, 128),
        // Forward is what it is now.
        (7000, RESET, 1),
        (7000, ABS_Y, 64),
    ];
    let recorded = recording(&changes, 60_000);
    played(8.5, |hands| {
        drive(hands, 0.1, vec![Some(recorded)]);
        hands.at(5.4, |_, seen| {
            let heading_rad = seen.record.state.odom_from_body.heading_rad;
            assert!(heading_rad > 0.3, "{heading_rad}");
            let RequestKind::Velocity { twist, frame } = seen.record.request.expect("asked").kind else {
                panic!("no velocity")
            };
            assert_eq!((frame, twist.vy_m_s.abs() < 1e-12, twist.vx_m_s > 0.2), (Frame::Odom, true, true));
            let in_odom = seen.record.state.twist_in_body.rotated(heading_rad);
            assert!(in_odom.vx_m_s > 0.2 && in_odom.vy_m_s.abs() < 0.02, "{in_odom:?}");
        });
        hands.at(8.4, |_, seen| {
            let in_body = seen.record.state.twist_in_body;
            assert!(in_body.vx_m_s > 0.2 && in_body.vy_m_s.abs() < 0.02, "{in_body:?}");
        });
    });
}

#[test]
fn the_shape_of_a_joystick_is_set_while_it_drives_as_a_whole_and_the_device_follows() {
    let changes = [(100, ENABLE, 1), (1400, ABS_Y, 64), (1500, TRIGGER, 1)];
    let recorded = recording(&changes, 60_000);
    let vx_m_s = |seen: &Snapshot| seen.record.state.twist_in_body.vx_m_s;
    let place = |seen: &Snapshot, name: &str| {
        seen.setting(name).unwrap_or_else(|| panic!("no setting `{name}`")).0 as usize
    };
    let set = move |live: &Live, seen: &Snapshot, client: Client, values: &[(&str, f64)]| {
        let values: Vec<(u32, f64)> =
            values.iter().map(|&(name, value)| (place(seen, name) as u32, value)).collect();
        live.set(client, &values).expect("there is room");
    };
    // Half of the way, less the device's own dead zone of 15 of 127.5.
    let beyond = |dead_zone: f64, raw: f64| ((raw / 127.5) - dead_zone) / (1.0 - dead_zone);
    let curve = |expo: f64, part: f64| (1.0 - expo) * part + expo * part.powi(3);
    let run = played(8.0, |hands| {
        drive(hands, 0.1, vec![Some(recorded)]);
        hands.at(0.05, |_, seen| assert_eq!(seen.joystick.axes[0].dead_zone, 0.05));
        hands.at(3.0, move |live, seen| {
            // The device asked for more than the file's default, and the robot knows.
            assert!((seen.joystick.axes[0].dead_zone - 15.0 / 127.5).abs() < 1e-12, "{:?}", seen.joystick);
            let expected = curve(0.3, beyond(15.0 / 127.5, 63.5));
            assert!((vx_m_s(seen) - expected).abs() < 0.01, "{} for {expected}", vx_m_s(seen));
            let values = [
                ("joystick.forward.dead_zone", 0.2),
                ("joystick.forward.expo", 0.0),
                ("joystick.forward.gain", 0.5),
            ];
            set(live, seen, Client::Page(1), &values);
        });
        hands.at(5.0, move |live, seen| {
            let expected = 0.5 * beyond(0.2, 63.5);
            assert!((vx_m_s(seen) - expected).abs() < 0.01, "{} for {expected}", vx_m_s(seen));
            // One that is outside of its range takes the other with it.
            let values = [("joystick.forward.gain", 1.0), ("joystick.forward.expo", 1.5)];
            set(live, seen, Client::Command, &values);
        });
        hands.at(6.0, move |live, seen| {
            assert_eq!((seen.joystick.axes[0].gain, seen.joystick.axes[0].expo), (0.5, 0.0));
            set(live, seen, Client::Command, &[("joystick.forward.gain", f64::NAN)]);
        });
        hands.at(7.9, move |_, seen| {
            assert_eq!(seen.joystick.axes[0].gain, 0.5);
            assert!((vx_m_s(seen) - 0.5 * beyond(0.2, 63.5)).abs() < 0.01);
        });
    });
    assert!(run.replayed.difference.is_none(), "{:?}", run.replayed);
}
