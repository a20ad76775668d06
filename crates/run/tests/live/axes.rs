//! An axis under people's hands: moved beside a base that drives, ended by stops, by the emergency stop, and with the page
//! that moved it.

use omnibase_robot::RequestKind;
use omnibase_robot::config::AxisMode;
use omnibase_robot::signals::{AxisAsk, AxisState, Phase, RequestAnswer};
use omnibase_run::RobotText;
use omnibase_run::live::{Answer, Ask, Client, Refusal, Snapshot};

use crate::hands::{Hands, Played, played_by};

const TEXT: &str = include_str!("../../../../robots/bmm_lift.toml");
const CIRCLE: &str = "\n[reference]\nkind = \"circle\"\nradius_m = 0.3\nduration_s = 16.0\n";
/// Its place in the robot's file.
const LIFT: u32 = 1;
const BY: Client = Client::Command;
const TAKEN: Answer = Answer::Robot(RequestAnswer::Taken);

fn lift(ask: AxisAsk) -> Ask {
    Ask::Robot(RequestKind::Axis { device: LIFT, ask })
}

fn to(position: f64) -> Ask {
    lift(AxisAsk::Move { position, mode: AxisMode::Csp })
}

/// Its position, and what it does.
fn seen(snapshot: &Snapshot) -> (f64, AxisState) {
    let inputs = &snapshot.record.signals.inputs;
    (inputs[1], AxisState::from_code(inputs[5] as u64).expect("a state"))
}

fn played(until_s: f64, prepare: impl FnOnce(&mut Hands)) -> Played {
    let text = RobotText { text: format!("{TEXT}{CIRCLE}"), ..RobotText::default() };
    let played = played_by(text, until_s, |hands| {
        hands.ask(0.5, BY, Ask::Robot(RequestKind::Enable), TAKEN);
        hands.ask(1.5, BY, lift(AxisAsk::Home), TAKEN);
        hands.ask(1.7, BY, to(0.3), Answer::Robot(RequestAnswer::Homing));
        hands.ask(4.5, BY, to(0.1), TAKEN);
        prepare(hands);
    });
    assert!(played.replayed.difference.is_none(), "{:?}", played.replayed);
    played
}

#[test]
fn it_moves_beside_a_base_that_drives_and_stops_by_call() {
    let run = played(18.0, |hands| {
        hands.ask(5.5, BY, Ask::Robot(RequestKind::Track), TAKEN);
        hands.ask(6.0, BY, to(0.6), TAKEN);
        hands.at(8.0, |_, snapshot| {
            assert_eq!((snapshot.phase, seen(snapshot).1), (Phase::Tracking, AxisState::Moving));
        });
        hands.ask(8.0, BY, lift(AxisAsk::Stop), TAKEN);
        hands.at(9.0, |_, snapshot| {
            let (position, state) = seen(snapshot);
            assert_eq!((snapshot.phase, state), (Phase::Tracking, AxisState::Holding));
            assert!((0.3..0.5).contains(&position), "{position}");
        });
        hands.ask(9.0, BY, lift(AxisAsk::Move { position: 0.2, mode: AxisMode::Pp }), TAKEN);
        hands.at(13.0, |_, snapshot| {
            let (position, state) = seen(snapshot);
            assert!((position - 0.2).abs() < 2e-4 && state == AxisState::Holding, "{position}");
        });
    });
    assert!(run.ran.ended.is_ok(), "{:?}", run.ran.ended);
}

#[test]
fn the_emergency_stop_ends_it_and_keeps_it() {
    played(16.0, |hands| {
        hands.ask(6.0, BY, to(0.6), TAKEN);
        hands.ask(7.0, BY, Ask::EmergencyStop, TAKEN);
        hands.ask(8.0, BY, to(0.2), Answer::Refused(Refusal::EmergencyStop));
        hands.ask(8.2, BY, lift(AxisAsk::Home), Answer::Refused(Refusal::EmergencyStop));
        hands.at(9.0, |_, snapshot| {
            assert_eq!((snapshot.phase, seen(snapshot).1), (Phase::Disabled, AxisState::Off))
        });
        hands.ask(9.0, BY, Ask::ReleaseEmergencyStop, Answer::Done);
        hands.ask(9.2, BY, to(0.2), Answer::Robot(RequestAnswer::WrongPhase));
        hands.ask(9.4, BY, Ask::Robot(RequestKind::Enable), TAKEN);
        hands.at(11.0, |_, snapshot| {
            let (position, state) = seen(snapshot);
            assert_eq!((snapshot.phase, state), (Phase::Holding, AxisState::Holding));
            assert!((0.15..0.3).contains(&position), "it goes on to nowhere: {position}");
        });
        hands.ask(11.0, BY, to(0.2), TAKEN);
    });
}

#[test]
fn a_motion_ends_with_the_page_that_asked_for_it() {
    let page = Client::Page(3);
    played(12.0, |hands| {
        hands.ask(5.5, BY, Ask::Robot(RequestKind::Track), TAKEN);
        hands.send(5.9, page, Ask::Begun);
        hands.alive(5.9, 7.0, page);
        hands.ask(6.0, page, to(0.6), TAKEN);
        hands.at(7.0, |_, snapshot| assert_eq!(seen(snapshot).1, AxisState::Moving));
        // It is silent from 7 s on.
        hands.at(9.0, |_, snapshot| {
            let (position, state) = seen(snapshot);
            assert_eq!((snapshot.phase, state), (Phase::Tracking, AxisState::Holding));
            assert!((0.2..0.4).contains(&position), "{position}");
        });
    });
}

#[test]
fn what_is_wrong_with_an_axis_is_told_by_its_name_and_once() {
    let text = format!("{TEXT}{CIRCLE}").replace("following_error = 0.005", "following_error = 0.000_01");
    let text = RobotText { text, ..RobotText::default() };
    let run = played_by(text, 9.0, |hands| {
        hands.ask(0.5, BY, Ask::Robot(RequestKind::Enable), TAKEN);
        hands.ask(1.5, BY, lift(AxisAsk::Home), TAKEN);
        hands.ask(4.5, BY, to(0.3), TAKEN);
        hands.at(6.0, |_, snapshot| assert_eq!(snapshot.phase, Phase::Fault));
        hands.ask(6.5, BY, Ask::Robot(RequestKind::Acknowledge), TAKEN);
    });
    let events: Vec<&str> = run.ran.summary.events.iter().map(|event| &*event.text).collect();
    let told: Vec<_> = events.iter().filter(|text| text.starts_with("lift: ")).collect();
    assert!(told.len() == 1 && told[0].contains("from its set point"), "{events:?}");
}

#[test]
fn its_stop_is_heard_however_much_is_asked_and_nothing_that_was_asked_before_begins_after_it() {
    let pause = || Ask::Robot(RequestKind::Pause);
    played(11.0, |hands| {
        hands.ask(6.0, BY, to(0.6), TAKEN);
        hands.between(6.5, 7.5, move |live, _| while live.send(Client::Page(2), pause()).is_some() {});
        hands.at(7.0, |_, snapshot| assert_eq!(seen(snapshot).1, AxisState::Moving));
        hands.send(7.0, BY, lift(AxisAsk::Stop));
        hands.at(7.003, |_, snapshot| assert_eq!(seen(snapshot).1, AxisState::Stopping));
        hands.at(9.0, move |live, snapshot| {
            assert_eq!(seen(snapshot).1, AxisState::Holding);
            (0..20).for_each(|_| assert!(live.send(Client::Page(2), pause()).is_some()));
        });
        hands.ask(9.0, BY, to(0.1), Answer::Refused(Refusal::Stopped));
        hands.ask(9.0, BY, lift(AxisAsk::Stop), TAKEN);
        hands.between(9.001, 9.5, |_, snapshot| assert_eq!(seen(snapshot).1, AxisState::Holding));
    });
}
