//! What the codes in a robot's recordings are called.

use omnibase_cia402::Mode;
use omnibase_record::viewer::Named;
use omnibase_robot::RobotPlan;
use omnibase_robot::signals::{AxisState, CycleRecord};

use crate::channels::place;
use crate::live::command::{Client, Commander, JoystickState, MAX_SESSIONS};

/// The signals of a robot that are codes of choices, with the names of these.
pub fn named(plan: &RobotPlan) -> Vec<Named> {
    let mut all = Vec::new();
    let mut push = |topic: &str, signal: &str, names: Vec<(u64, String)>| {
        // In protobuf values of all enums of a message need names of their own.
        let prefix = signal.to_ascii_uppercase();
        let mut names: Vec<_> = names
            .into_iter()
            .filter_map(|(code, name)| {
                Some((i32::try_from(code).ok()?, format!("{prefix}_{}", capitals(&name))))
            })
            .collect();
        if names.iter().all(|(code, _)| *code != 0) {
            names.push((0, format!("{prefix}_NONE")));
        }
        names.sort_unstable();
        all.push(Named { topic: topic.to_owned(), signal: signal.to_owned(), names });
    };
    for (channel, names) in CycleRecord::choices(&plan.record_layout()) {
        let (topic, signal) = place(&channel);
        push(&topic, &signal, names);
    }
    push("/command", "controller", controllers(plan));
    push("/operator", "commander", commanders());
    let joysticks =
        [JoystickState::Absent, JoystickState::Present, JoystickState::Lost, JoystickState::Blocked];
    push("/operator", "joystick", joysticks.map(|state| (state.code(), format!("{state:?}"))).into());
    let modes = || {
        let named = |mode: Mode| Some((u64::try_from(mode.code()).ok()?, mode.abbreviation().to_owned()));
        Mode::ALL.into_iter().filter_map(named).collect()
    };
    for wheel in 1..=plan.drives.len() {
        push(&format!("/wheel_{wheel}"), "mode", modes());
    }
    for device in plan.devices.iter().filter(|device| device.axis.is_some()) {
        let topic = format!("/{}", device.name);
        let states = (0..).map_while(|code| Some((code, format!("{:?}", AxisState::from_code(code)?))));
        push(&topic, "state", states.collect());
        push(&topic, "mode", modes());
    }
    all
}

/// The places of the controllers in the robot's file; where two are of one kind, with the place.
fn controllers(plan: &RobotPlan) -> Vec<(u64, String)> {
    let mut names: Vec<(u64, String)> = Vec::new();
    for (place, kind) in (0..).zip(plan.controllers()) {
        let is_again = names.iter().any(|(_, name)| name == kind);
        names.push((place, if is_again { format!("{kind} {place}") } else { kind.to_owned() }));
    }
    names
}

/// Nobody, and whoever drives or lets a reference be followed.
fn commanders() -> Vec<(u64, String)> {
    let pages = (0..MAX_SESSIONS).filter_map(|number| Some(Client::Page(u8::try_from(number).ok()?)));
    let clients = [Client::Joystick, Client::Command].into_iter().chain(pages);
    let mut names = vec![(Commander::Nobody.code(), "Nobody".to_owned())];
    for client in clients {
        names.push((Commander::Stick(client).code(), format!("stick of {client}")));
        names.push((Commander::Reference(client).code(), format!("reference of {client}")));
    }
    names
}

/// A choice or words as a name of protobuf: `Stop(RampThenRemove)` is `STOP_RAMP_THEN_REMOVE`, and fields are left out.
fn capitals(text: &str) -> String {
    let mut name = String::new();
    for letter in text.split(" {").next().unwrap_or_default().chars() {
        let begins_word = letter.is_ascii_uppercase() || !letter.is_ascii_alphanumeric();
        if begins_word && !name.is_empty() && !name.ends_with('_') {
            name.push('_');
        }
        if letter.is_ascii_alphanumeric() {
            name.push(letter.to_ascii_uppercase());
        }
    }
    name.trim_end_matches('_').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RobotText;
    use crate::channels::{Known, Rows};
    use omnibase_robot::Registry;
    use omnibase_robot::signals::ValueKind;

    fn plan(robot: &str) -> RobotPlan {
        let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots");
        let text = std::fs::read_to_string(folder.join(robot)).unwrap();
        RobotText { text, folder, ..RobotText::default() }.load(&Registry::with_built_in()).unwrap().plan
    }

    #[test]
    fn every_code_has_names_and_what_has_none_counts_something() {
        // Counts, bits, times, process data, places in lists: whatever else is a whole number is a code, and has names.
        let counts = [
            "index",
            "time_ns",
            "period_ns",
            "expected",
            "received",
            "argument",
            "valid_until_ns",
            "stop_where",
            "where",
            "pose_known",
            "begun",
            "number",
            "next",
            "obstacle",
            "status_word",
            "error",
            "believed",
            "heard",
            "zeroed",
            "raised",
            "instant_ns",
        ];
        for robot in ["bmm.toml", "bmm_io.toml", "bmm_lift.toml"] {
            let plan = plan(robot);
            let named = named(&plan);
            for channel in CycleRecord::channels(&plan.record_layout()) {
                let (topic, signal) = place(&channel);
                let is_count = counts.contains(&signal.as_str())
                    || signal.starts_with("input_")
                    || signal.starts_with("output_");
                let has_names = named.iter().any(|code| code.topic == topic && code.signal == signal);
                if channel.kind == ValueKind::U64 {
                    assert_ne!(has_names, is_count, "{robot}: {topic} {signal}");
                }
            }
            // None of them is of a signal that isn't there.
            let rows = Rows::new(&plan.record_layout(), Known::Truth);
            for Named { topic, signal, names } in &named {
                assert!(rows.schema().column(topic, signal).is_some(), "{robot}: {topic} {signal}");
                assert_eq!(names[0].0, 0, "{topic} {signal}: {names:?}");
                let mut all: Vec<_> = names.iter().map(|(_, name)| name).collect();
                all.sort_unstable();
                all.dedup();
                assert_eq!(all.len(), names.len(), "{topic} {signal}: {names:?}");
            }
        }
    }

    #[test]
    fn names_are_those_of_the_choices() {
        let named = named(&plan("bmm_lift.toml"));
        for (topic, signal, code, expected) in [
            ("/cycle", "phase", 5, "PHASE_QUICK_STOPPING"),
            ("/cycle", "stop_reason", 10, "STOP_REASON_DRIVE"),
            ("/allowed", "action", 3, "ACTION_STOP_RAMP_THEN_REMOVE"),
            ("/exchange", "result", 2, "RESULT_SHORT_COUNT"),
            ("/request", "kind", 19, "KIND_STOP_AXIS"),
            ("/state", "regime", 3, "REGIME_TANGENT"),
            ("/operator", "commander", 116, "COMMANDER_STICK_OF_PAGE_1"),
            ("/operator", "commander", 202, "COMMANDER_REFERENCE_OF_COMMAND_LINE"),
            ("/operator", "joystick", 2, "JOYSTICK_LOST"),
            ("/wheel_1", "mode", 0, "MODE_NONE"),
            ("/wheel_3", "mode", 9, "MODE_CSV"),
            ("/lift", "state", 5, "STATE_HOMING_FAILED"),
        ] {
            let code_of = named.iter().find(|code| code.topic == topic && code.signal == signal);
            let name = code_of.unwrap_or_else(|| panic!("{topic} {signal}")).names.iter();
            let name = name.clone().find(|(of, _)| *of == code).map(|(_, name)| name.as_str());
            assert_eq!(name, Some(expected), "{topic} {signal}");
        }
    }
}
