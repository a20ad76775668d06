//! Inputs and outputs beside the drives, as people and programs see and set them.

use serde_json::json;

use super::robot::Robot;
use super::{browser, opened, press};

const WITH_TERMINALS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/bmm_io.toml");

#[test]
fn outputs_are_set_and_inputs_seen_by_command_and_call() {
    let robot = Robot::start_file(WITH_TERMINALS, &[]);
    let (code, text, _) = robot.command(&["get", "supply/voltage_v", "buttons/"]);
    assert_eq!(code, Some(0));
    assert!(text.contains("supply/voltage_v") && text.contains("buttons/released"), "{text}");
    assert!((robot.value("supply/voltage_v") - 24.0).abs() < 1e-2, "{}", robot.value("supply/voltage_v"));
    assert_eq!((robot.value("lamps/green"), robot.value("lamps/red")), (0.0, 1.0));
    let (code, text, said) = robot.command(&["call", "set_output", "name=lamps.green", "value=1"]);
    assert_eq!(code, Some(0), "{text}{said}");
    robot.wait("the lamp burns", |robot| robot.value("lamps/green") == 1.0);
    for (call, told) in [
        (
            json!({ "do": "set_output", "name": "lamps.gren", "value": 1 }),
            "no output is called `lamps.gren`; did you mean `lamps.green`?",
        ),
        (json!({ "do": "set_output", "name": "lamps.green", "value": 2 }), "expected 0 to 1, found 2"),
        (
            json!({ "do": "set_output", "name": "buttons.stop", "value": 0 }),
            "no output is called `buttons.stop`",
        ),
    ] {
        let (_, said) = robot.call(&call);
        assert!(said["text"].as_str().unwrap_or_default().contains(told), "{said}");
        assert_eq!(said["done"], false);
    }
    assert_eq!(robot.call(&json!({ "do": "enable" })).1["done"], true);
    robot.wait("it holds", |robot| robot.read("now")["phase"] == "holding");
    assert_eq!(robot.value("lamps/green"), 1.0);
    robot.call(&json!({ "do": "stop", "category": "category_1" }));
    robot.wait("the lamp is off", |robot| robot.value("lamps/green") == 0.0);
}

#[test]
fn outputs_are_set_on_the_page() {
    // One beside the lamps that isn't either on or off.
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("robot.toml");
    let valve = "{ name = \"horn\", object = \"7020.1\" },\n  { name = \"flow\", object = \"7100.1\", type = \"u16\", scale = 0.1, unit = \"l/s\" },";
    let text = std::fs::read_to_string(WITH_TERMINALS).unwrap();
    let text = text.replace("{ name = \"horn\", object = \"7020.1\" },", valve);
    let map = "{ pdo = \"0x1606\", map = \"7060.1:1\" }, { pdo = \"0x1607\", map = \"7070.1:1\" },";
    let text = text.replace(map, &format!("{map} {{ pdo = \"0x1608\", map = \"7100.1:16\" }},"));
    std::fs::write(&file, text).unwrap();
    let robot = Robot::start_file(file.to_str().unwrap(), &[]);
    let Some(mut page) = browser(1600, 1000) else { return };
    page.open(&robot.url());
    opened(&mut page);
    let pressed =
        |name: &str| format!("document.querySelector('[data-output=\"lamps.{name}\"]').ariaPressed");
    page.wait(&format!("{} === 'false' && {} === 'true'", pressed("green"), pressed("red")));
    // The outputs of a page that a busy machine holds up for long end with it: then it is pressed again.
    while robot.value("lamps/green") != 1.0 {
        press(&mut page, "[data-output='lamps.green']", &format!("{} === 'true'", pressed("green")));
    }
    press(&mut page, "[data-output='lamps.green']", &format!("{} === 'false'", pressed("green")));
    page.value("void (document.querySelector('[data-output=\"lamps.flow\"] input').value = '2.5')");
    let now = "document.querySelector('[data-output=\"lamps.flow\"] output').textContent";
    press(&mut page, "[data-output='lamps.flow'] button", &format!("{now} === '2.500'"));
    page.picture("outputs");
    assert!((robot.value("lamps/flow_l_s") - 2.5).abs() < 1e-6);
}
