//! A coupler, buttons, lamps and a voltage beside the drives: an input stops the robot, calls set outputs.

use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat_sim::device::panel::IoPanel;
use omnibase_robot::RequestKind;
use omnibase_robot::config::AxisMode;
use omnibase_robot::signals::{AxisAsk, Phase, RequestAnswer, SafetyReason};
use omnibase_run::RobotText;
use omnibase_run::live::{Answer, Ask, Client, Refusal};

use crate::hands::{Hands, Played, played_by};

const TEXT: &str = include_str!("../../../../robots/bmm_io.toml");
const CIRCLE: &str = "\n[reference]\nkind = \"circle\"\nradius_m = 0.3\nduration_s = 8.0\n";
/// Places of the SubDevices in the robot's file.
const BUTTONS: usize = 1;
const LAMPS: usize = 2;
const SUPPLY: usize = 3;
const RELEASED: ObjectAddress = ObjectAddress::new(0x6000, 1);
const STOP: ObjectAddress = ObjectAddress::new(0x6010, 1);
const GREEN: ObjectAddress = ObjectAddress::new(0x7000, 1);
const RED: ObjectAddress = ObjectAddress::new(0x7010, 1);
const VOLTAGE: ObjectAddress = ObjectAddress::new(0x3101, 2);
const BY: Client = Client::Command;
const TAKEN: Answer = Answer::Robot(RequestAnswer::Taken);

fn robot(kind: RequestKind) -> Ask {
    Ask::Robot(kind)
}

fn set(index: u32, value: f64) -> Ask {
    robot(RequestKind::SetOutput { index, value })
}

fn played(until_s: f64, prepare: impl FnOnce(&mut Hands)) -> Played {
    let text = RobotText { text: format!("{TEXT}{CIRCLE}"), ..RobotText::default() };
    let played = played_by(text, until_s, prepare);
    assert!(played.replayed.difference.is_none(), "{:?}", played.replayed);
    played
}

/// A hand on a terminal.
fn press(hands: &mut Hands, time_s: f64, device: usize, object: ObjectAddress, value: u64) {
    let panel = hands.panels[device].clone();
    hands.at(time_s, move |_, _| assert!(panel.set_input(object, value)));
}

/// The lamps as they burn: green, red.
fn lamps(panel: &IoPanel) -> [u64; 2] {
    [GREEN, RED].map(|lamp| panel.output(lamp).expect("it is there"))
}

fn see_lamps(hands: &mut Hands, time_s: f64, expected: [u64; 2]) {
    let panel = hands.panels[LAMPS].clone();
    hands.at(time_s, move |_, _| assert_eq!(lamps(&panel), expected, "at {time_s} s"));
}

/// The lift of the other shipped robot, behind the wheels of this one.
fn with_lift() -> String {
    let lift = include_str!("../../../../robots/bmm_lift.toml");
    let (_, lift) = lift.split_once("[[device]]\nname = \"lift\"").unwrap();
    let (lift, _) = lift.split_once("[[drive]]").unwrap();
    format!("{TEXT}{CIRCLE}\n[[device]]\nname = \"lift\"{}", lift.replace("position = 4", "position = 7"))
}

#[test]
fn terminals_and_an_axis_beside_the_wheels_are_driven_set_stopped_and_replayed() {
    /// Its place among the SubDevices without a wheel.
    const LIFT: u32 = 4;
    let axis = |ask| robot(RequestKind::Axis { device: LIFT, ask });
    let text = RobotText { text: with_lift(), ..RobotText::default() };
    let run = played_by(text, 14.0, |hands| {
        hands.ask(0.5, BY, robot(RequestKind::Enable), TAKEN);
        hands.ask(1.0, BY, axis(AxisAsk::Home), TAKEN);
        hands.ask(1.1, BY, set(0, 1.0), TAKEN);
        hands.ask(1.2, BY, robot(RequestKind::Track), TAKEN);
        hands.at(5.0, |_, seen| assert_eq!(seen.phase, Phase::Tracking));
        see_lamps(hands, 5.0, [1, 1]);
        hands.ask(5.5, BY, axis(AxisAsk::Move { position: 0.4, mode: AxisMode::Csp }), TAKEN);
        press(hands, 7.0, BUTTONS, STOP, 1);
        hands.at(7.005, |_, seen| assert_eq!(seen.phase, Phase::Stopping));
        hands.at(10.0, |_, seen| {
            assert_eq!((seen.phase, seen.record.stop_reason), (Phase::Fault, SafetyReason::StopInput));
            assert!(seen.record.measurements.present().iter().all(|drive| drive.stands()));
        });
        see_lamps(hands, 10.0, [0, 1]);
    });
    assert!(run.replayed.difference.is_none(), "{:?}", run.replayed);
    let positions: Vec<f64> = run.recorded.column("/lift", "position_m").unwrap().collect();
    let (at_stop, at_end) = (positions[7000], positions[13_500]);
    println!(
        "the lift at {at_stop:.4} m when the input stops the robot, {at_end:.4} m at the end; {:?}",
        run.replayed
    );
    // Homed at 0, on its way up, and stopped with the wheels.
    assert!(at_stop > 0.1 && at_stop < 0.39, "{at_stop} m");
    assert!(at_end > at_stop && at_end < at_stop + 0.05, "{at_stop} m, then {at_end} m");
}

#[test]
fn an_input_stops_the_robot_and_a_person_goes_on_when_it_is_off() {
    let run = played(12.0, |hands| {
        hands.ask(0.5, BY, robot(RequestKind::Enable), TAKEN);
        hands.ask(1.0, BY, robot(RequestKind::Track), TAKEN);
        hands.at(3.0, |_, seen| assert_eq!(seen.phase, Phase::Tracking));
        press(hands, 3.0, BUTTONS, STOP, 1);
        hands.at(3.005, |_, seen| assert_eq!(seen.phase, Phase::Stopping));
        // A short press is enough.
        press(hands, 3.02, BUTTONS, STOP, 0);
        hands.at(5.0, |_, seen| {
            assert_eq!((seen.phase, seen.record.stop_reason), (Phase::Fault, SafetyReason::StopInput));
            assert!(seen.record.measurements.present().iter().all(|drive| drive.stands()));
        });
        // Nothing goes on without a person who saw it.
        hands.ask(5.0, BY, robot(RequestKind::Enable), Answer::Robot(RequestAnswer::WrongPhase));
        hands.ask(5.2, BY, robot(RequestKind::Acknowledge), TAKEN);
        press(hands, 5.4, BUTTONS, STOP, 1);
        hands.ask(5.5, BY, robot(RequestKind::Enable), Answer::Robot(RequestAnswer::StopInput));
        press(hands, 5.7, BUTTONS, STOP, 0);
        press(hands, 5.8, BUTTONS, RELEASED, 0);
        hands.ask(5.9, BY, robot(RequestKind::Enable), Answer::Robot(RequestAnswer::EnableInput));
        press(hands, 6.1, BUTTONS, RELEASED, 1);
        hands.ask(6.2, BY, robot(RequestKind::Enable), TAKEN);
        hands.at(6.9, |_, seen| assert_eq!(seen.phase, Phase::Holding));
        hands.ask(7.0, BY, robot(RequestKind::Resume), TAKEN);
        hands.at(8.0, |_, seen| assert_eq!(seen.phase, Phase::Tracking));
        // The wire of the contact that enables breaks.
        press(hands, 8.0, BUTTONS, RELEASED, 0);
        hands.at(8.01, |_, seen| assert_eq!(seen.phase, Phase::Stopping));
        hands.at(10.0, |_, seen| {
            assert_eq!((seen.phase, seen.record.stop_reason), (Phase::Fault, SafetyReason::EnableInput));
        });
    });
    assert!(run.ran.ended.is_err(), "the run tells that the robot stopped");
}

#[test]
fn outputs_are_set_by_calls_and_let_go_with_the_robot() {
    played(8.0, |hands| {
        see_lamps(hands, 0.3, [0, 1]);
        hands.ask(0.4, BY, set(0, 1.0), TAKEN);
        hands.ask(0.5, BY, set(1, 0.0), TAKEN);
        see_lamps(hands, 0.6, [1, 0]);
        for (index, value) in [(3, 1.0), (0, 2.0), (0, f64::NAN)] {
            hands.ask(0.7, BY, set(index, value), Answer::Robot(RequestAnswer::Refused));
        }
        hands.ask(1.0, BY, robot(RequestKind::Enable), TAKEN);
        hands.ask(1.5, BY, robot(RequestKind::Track), TAKEN);
        see_lamps(hands, 3.0, [1, 0]);
        press(hands, 3.0, BUTTONS, STOP, 1);
        // At a stop they are what the file says, and nobody sets them until the fault was seen.
        see_lamps(hands, 3.01, [0, 1]);
        hands.ask(3.1, BY, set(0, 1.0), Answer::Robot(RequestAnswer::WrongPhase));
        hands.ask(5.0, BY, robot(RequestKind::Acknowledge), TAKEN);
        see_lamps(hands, 5.5, [0, 1]);
        hands.ask(5.6, BY, set(0, 1.0), TAKEN);
        see_lamps(hands, 5.8, [1, 1]);
        hands.ask(6.0, BY, Ask::EmergencyStop, TAKEN);
        hands.ask(6.2, BY, set(0, 0.0), Answer::Refused(Refusal::EmergencyStop));
    });
}

#[test]
fn what_a_page_set_ends_with_the_page() {
    let page = Client::Page(3);
    played(5.0, |hands| {
        hands.send(0.4, page, Ask::Begun);
        hands.alive(0.4, 2.0, page);
        hands.ask(0.5, page, set(0, 1.0), TAKEN);
        hands.ask(0.6, BY, set(1, 0.0), TAKEN);
        see_lamps(hands, 1.9, [1, 0]);
        // The page is silent from 2 s on; what the command line set stays.
        see_lamps(hands, 2.8, [0, 0]);
        hands.send(3.0, page, Ask::Begun);
        hands.alive(3.0, 3.5, page);
        hands.ask(3.1, page, set(0, 1.0), TAKEN);
        see_lamps(hands, 3.3, [1, 0]);
        hands.send(3.4, page, Ask::Gone);
        see_lamps(hands, 3.45, [0, 0]);
    });
}

#[test]
fn signals_are_recorded_with_their_units() {
    let run = played(3.0, |hands| {
        press(hands, 1.0, SUPPLY, VOLTAGE, u64::from(0xFFFF_u16 - 655));
        press(hands, 2.0, BUTTONS, STOP, 1);
        hands.ask(1.5, BY, set(2, 1.0), TAKEN);
    });
    let column = |topic: &str, name: &str| {
        let topics = &run.recorded.schema.topics;
        let topic = topics.iter().find(|one| one.name == topic).unwrap_or_else(|| panic!("no {topic}"));
        topic.signals.iter().position(|signal| signal.name == name).unwrap_or_else(|| panic!("no {name}"));
    };
    for (topic, name) in [
        ("/supply", "voltage_v"),
        ("/supply", "age_s"),
        ("/buttons", "released"),
        ("/lamps", "horn"),
        ("/coupler", "age_s"),
        ("/device", "believed"),
        ("/device", "input_0"),
    ] {
        column(topic, name);
    }
    let signals = run.last.record.signals;
    assert_eq!(signals.shape.inputs, 3);
    assert_eq!(signals.inputs[..2], [1.0, 1.0]);
    assert!((signals.inputs[2] + 656.0 * 0.00152592547).abs() < 1e-9, "{} V", signals.inputs[2]);
    assert_eq!((signals.ages_s[SUPPLY], signals.believed), (0.0, 0b111));
    // The horn sounded until the stop at the run's end let it go.
    let names: Vec<_> = run.recorded.schema.names().collect();
    let horn = names.iter().position(|name| *name == "lamps.horn").expect("it is recorded");
    assert!(run.recorded.values.chunks(names.len()).any(|row| row[horn] == 1.0));
    assert_eq!(signals.outputs[..3], [0.0, 1.0, 0.0]);
}
