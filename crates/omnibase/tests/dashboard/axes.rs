//! An axis, as people and programs see and move it.

use serde_json::json;

use super::robot::Robot;
use super::{HIT, browser, opened, press, until};

const WITH_LIFT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/bmm_lift.toml");

#[test]
fn an_axis_is_homed_moved_and_seen_by_command_and_call() {
    let robot = Robot::start_file(WITH_LIFT, &[]);
    let (code, text, _) = robot.command(&["get", "lift/"]);
    assert_eq!(code, Some(0));
    for name in ["lift/position_m", "lift/speed_m_s", "lift/set_point_m", "lift/state", "lift/homed"] {
        assert!(text.contains(name), "{name}: {text}");
    }
    assert_eq!(robot.call(&json!({ "do": "enable" })).1["done"], true);
    robot.wait("it holds", |robot| robot.read("now")["phase"] == "holding");
    let told = |call: serde_json::Value, words: &str| {
        let (_, said) = robot.call(&call);
        assert!(said["text"].as_str().unwrap_or_default().contains(words), "{said}");
        assert_eq!(said["done"], false);
    };
    told(json!({ "do": "move_axis", "name": "lift", "position": 0.3 }), "home it first (home_axis)");
    let (code, text, said) = robot.command(&["call", "home_axis", "name=lift"]);
    assert_eq!(code, Some(0), "{text}{said}");
    robot.wait("it is homed", |robot| robot.value("lift/homed") == 1.0 && robot.value("lift/state") == 1.0);
    let (code, text, said) = robot.command(&["call", "move_axis", "name=lift", "position=0.1", "mode=pp"]);
    assert_eq!(code, Some(0), "{text}{said}");
    robot.wait("it is there", |robot| (robot.value("lift/position_m") - 0.1).abs() < 1e-3);
    told(
        json!({ "do": "move_axis", "name": "left", "position": 0.3 }),
        "no axis is called `left`; did you mean `lift`?",
    );
    told(json!({ "do": "move_axis", "name": "lift", "position": 3.0 }), "expected 0.01 to 0.6 m, found 3");
    let (_, said) = robot.call(&json!({ "do": "move_axis", "name": "lift", "position": 0.6 }));
    assert_eq!(said["done"], true, "{said}");
    let (code, ..) = robot.command(&["call", "stop_axis", "name=lift"]);
    assert_eq!(code, Some(0));
    robot.wait("it rests", |robot| robot.value("lift/state") == 1.0);
    assert!(robot.value("lift/position_m") < 0.59);
}

#[test]
fn an_axis_is_homed_moved_and_stopped_and_its_failure_told_on_the_page() {
    let robot = Robot::start_file(WITH_LIFT, &[]);
    let Some(mut page) = browser(1600, 1000) else { return };
    page.tamper();
    page.open(&robot.url());
    opened(&mut page);
    let state = "document.querySelector('[data-axis=lift] .state').textContent";
    let place = "document.querySelector('[data-axis=lift] output').textContent";
    page.wait(&format!("{state} === 'off' && {place} === 'not homed'"));
    press(&mut page, "[data-do=enable]", "document.getElementById('phase').textContent === 'holding'");
    let button = |words: &str| {
        let all = "[...document.querySelectorAll('[data-axis=lift] button')]";
        format!("void ({all}.find((one) => one.textContent === '{words}').id = 'axis-{words}')")
    };
    ["Home", "Move", "Stop"].iter().for_each(|words| drop(page.value(&button(words))));
    let to =
        |metres: f64| format!("void (document.querySelector('[data-axis=lift] input').value = '{metres}')");
    // Refused in words.
    page.value(&to(0.3));
    press(&mut page, "#axis-Move", "document.getElementById('said').textContent.includes('home it first')");
    // On a busy machine the page may be silent for so long that what it began is stopped, as it shall be.
    let at =
        |place_m: f64| format!("{state} === 'holding' && Math.abs(parseFloat({place}) - {place_m}) < 1e-3");
    until(&mut page, "it is at home", |page| {
        // Where it is at home already the word may be gone before a busy page shows it.
        page.click("#axis-Home");
        page.is_true_within(&format!("{state} === 'homing'"), HIT);
        page.wait(&format!("{state} !== 'homing'"));
        page.is_true_within(&at(0.0), HIT)
    });
    page.picture("axis");
    until(&mut page, "it is at 0.3 m", |page| {
        page.click("#axis-Move");
        page.is_true_within(&format!("{state} === 'moving'"), HIT);
        page.wait(&format!("{state} !== 'moving'"));
        page.is_true_within(&at(0.3), HIT)
    });
    page.value(&to(0.6));
    press(&mut page, "#axis-Move", &format!("{state} === 'moving'"));
    press(&mut page, "#axis-Stop", &format!("{state} === 'holding'"));
    assert!((0.3..0.6).contains(&robot.value("lift/position_m")));
    // Out of its limits.
    page.value(&to(0.7));
    page.click("#axis-Move");
    assert_eq!(page.value("document.querySelector('[data-axis=lift] input').validity.rangeOverflow"), true);
    page.change(
        "seen.phase = 'fault'; seen.stop_reason = 'an axis failed'; seen.stop_device = 1; \
         seen.axis_problem = 'lift: its torque was 3.500 N·m, at most 3 N·m'",
    );
    let banner = "document.getElementById('banner-is').textContent";
    page.wait(&format!("{banner} === 'Fault: lift: its torque was 3.500 N·m, at most 3 N·m.'"));
    page.change(
        "seen.phase = 'fault'; seen.stop_reason = 'a SubDevice was lost'; seen.stop_device = 0; seen.axis_problem = ''",
    );
    page.wait(&format!("{banner} === 'Fault: buttons: a SubDevice was lost.'"));
}

#[test]
fn who_looks_on_without_the_token_may_stop_an_axis_and_no_more() {
    let robot = Robot::start_file(WITH_LIFT, &[]);
    let Some(mut page) = browser(390, 844) else { return };
    page.open(&robot.at);
    page.wait("document.querySelectorAll('[data-axis=lift] button').length === 3");
    page.wait("document.getElementById('link').textContent.startsWith('you may look')");
    let enabled = page.value(
        "[...document.querySelectorAll('#beside :is(button, input)')].filter((one) => !one.disabled) \
         .map((one) => one.textContent)",
    );
    assert_eq!(enabled, json!(["Stop"]));
    for call in [json!({ "do": "enable" }), json!({ "do": "home_axis", "name": "lift" })] {
        robot.wait("it is done", |robot| robot.call(&call).1["done"] == true);
    }
    robot.wait("it looks for its home", |robot| robot.value("lift/state") == 3.0);
    page.click("[data-stops-axis=lift]");
    robot.wait("it stops", |robot| robot.value("lift/state") != 3.0);
}
