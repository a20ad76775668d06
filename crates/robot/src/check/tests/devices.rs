//! SubDevices without a wheel: what is wrong in their tables is told with its place, value and what was expected.

use super::*;
use crate::signals::StopCategory;

const IO: &str = include_str!("../../../../../robots/bmm_io.toml");

/// The value and what was expected, of the one problem of a setting.
fn told(from: &str, to: &str, setting: &str) -> (Option<String>, Option<String>) {
    let text = IO.replace(from, to);
    assert_ne!(text, IO, "{from}");
    let problems = problems(&text);
    let (problem, ..) = found(&problems, setting);
    (problem.value.clone(), problem.limit.clone())
}

#[test]
fn the_shipped_robot_with_terminals_resolves() {
    let plan = check(IO).unwrap_or_else(|problems| panic!("{}", show(&problems)));
    let signals = plan.signals();
    let names: Vec<&str> = signals.inputs.iter().map(|signal| signal.name.as_str()).collect();
    assert_eq!(names, ["buttons.released", "buttons.stop", "supply.voltage"]);
    assert_eq!((plan.safety.enable_input, plan.safety.stop_input), (Some(0), Some(1)));
    assert_eq!(plan.safety.input_stop, StopCategory::RampThenRemove);
    assert_eq!((signals.input_bytes, signals.output_bytes), (1 + 6, 1));
}

#[test]
fn every_mistake_is_refused_with_its_value_and_what_was_expected() {
    let some = |text: &str| Some(text.to_owned());
    for (from, to, setting, value, expected) in [
        ("kind = \"ignore\"", "kind = \"ignroe\"", "device[0].kind", "\"ignroe\"", "ignore, io, axis"),
        ("\"coupler\"", "\"state\"", "device[0].name", "\"state\"", "another name"),
        (
            "\"coupler\"",
            "\"Coupler 1\"",
            "device[0].name",
            "\"Coupler 1\"",
            "1 to 24 small letters, digits and underscores",
        ),
        (
            "name = \"voltage\", object = \"3101.2\"",
            "name = \"voltage\", object = \"3105.2\"",
            "device[3].input[0].object",
            "\"3105.2\"",
            "3101.1:8 3101.2:16 3102.1:8 3102.2:16",
        ),
        ("type = \"i16\"", "type = \"i8\"", "device[3].input[0].type", "8 bits", "a type of 16 bits"),
        ("type = \"i16\"", "bit = 16", "device[3].input[0].bit", "16", "0 to 15"),
        (
            "scale = 0.00152592547",
            "scale = 0",
            "device[3].input[0].scale",
            "0",
            "a finite number, the scale not 0",
        ),
        ("on_stop = 1", "on_stop = 2", "device[2].output[1].on_stop", "2", "0 to 1"),
        (
            "vendor_id = \"0x2\"",
            "vendor_id = \"x\"",
            "device[1].vendor_id",
            "\"x\"",
            "such as \"0x539\" or \"1337\"",
        ),
        (
            "stop_input = \"buttons.stop\"",
            "stop_input = \"buttons.stpo\"",
            "safety.stop_input",
            "\"buttons.stpo\"",
            "buttons.released, buttons.stop, supply.voltage",
        ),
        (
            "[safety]",
            "[safety]\ninput_stop = \"category_2\"",
            "safety.input_stop",
            "\"category_2\"",
            "category_0, category_1",
        ),
    ] {
        assert_eq!(told(from, to, setting), (some(value), some(expected)), "{to}");
    }
    // What has no value.
    for (from, to, setting) in [
        ("kind = \"ignore\"", "", "device[0].kind"),
        ("name = \"coupler\"\nposition = 0", "name = \"coupler\"", "device[0].position"),
        ("type = \"i16\", ", "", "device[3].input[0].type"),
        ("kind = \"ignore\"", "kind = \"ignore\"\ninput = [{ name = \"x\" }]", "device[0].input"),
        ("name = \"stop\"", "name = \"age\"", "device[1].input[1].name"),
        ("name = \"stop\"", "name = \"released\"", "device[1].input[1].name"),
        ("name = \"stop\"", "name = \"age_s\"", "device[1].input[1].name"),
        (
            "input = [\n  { name = \"voltage\",",
            "input = [\n { name = \"x_m\", unit = \"s\", object = \"3101.1\", type = \"u8\" },\n\
             { name = \"x\", unit = \"m/s\", object = \"3101.1\", type = \"u8\" },\n{ name = \"voltage\",",
            "device[3].input[1].name",
        ),
        ("position = 4", "position = 1", "device[1].position"),
    ] {
        told(from, to, setting);
    }
}

#[test]
fn what_a_cycle_cant_hold_is_refused() {
    let inputs: String = (0..63).map(|n| format!("{{ name = \"n{n}\", object = \"6000.1\" }},")).collect();
    let (value, limit) = told("  { name = \"stop\"", &format!("{inputs}{{ name = \"stop\""), "device");
    assert_eq!(value.as_deref(), Some("66 inputs"));
    assert_eq!(limit.as_deref(), Some("at most 64 of all SubDevices and programs together"));
}

#[test]
fn what_may_not_be_slow_is_refused_by_name() {
    let some = |text: &str| Some(text.to_owned());
    let with = |name: &str, n: u32| (format!("name = \"{name}\""), format!("name = \"{name}\"\nevery = {n}"));
    // The terminal with the buttons by which the robot stops.
    let (from, to) = with("buttons", 2);
    assert_eq!(told(&from, &to, "device[1].every"), (some("2"), some("1")));
    // One that is written to: 100 ms of watchdog, cycles of 1 ms.
    let (from, to) = with("lamps", 50);
    assert_eq!(told(&from, &to, "device[2].every"), (some("50"), some("1 to 49")));
    let (from, to) = with("supply", 501);
    assert_eq!(told(&from, &to, "device[3].every"), (some("501"), some("1 to 500")));
    let (from, to) = with("supply", 0);
    told(&from, &to, "device[3].every");
    for (name, n) in [("lamps", 49), ("supply", 500), ("buttons", 1)] {
        let (from, to) = with(name, n);
        let plan = check(&IO.replace(&from, &to)).unwrap_or_else(|problems| panic!("{}", show(&problems)));
        let device = plan.devices.iter().find(|device| device.name == name).unwrap();
        assert_eq!(u32::from(device.subdevice_config(&plan.bus).every.cycles()), n);
    }
    let lift = include_str!("../../../../../robots/bmm_lift.toml")
        .replace("name = \"lift\"", "name = \"lift\"\nevery = 2");
    let problems = problems(&lift);
    let (problem, ..) = found(&problems, "device[1].every");
    assert_eq!((problem.kind, problem.limit.as_deref()), (ProblemKind::Contradiction, Some("1")));
}
