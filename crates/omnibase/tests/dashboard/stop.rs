//! STOP on the page: where it is, and what it says, whatever else happens.

use super::browser::Browser;
use super::line::{Line, LineMode};
use super::robot::{Robot, TOKEN};
use super::{browser, cycles_pass, opened, press};
use serde_json::{Value, json};

/// Windows: a desk, a phone across, a phone, a small phone.
const WINDOWS: [(u32, u32); 4] = [(1400, 900), (844, 390), (390, 844), (320, 568)];
/// Where STOP is, whether it is whole in the window, and whether it is on top there; and how wide the page is.
const PLACE: &str = "(() => { const e = document.getElementById('stop'), r = e.getBoundingClientRect(); \
    const corners = [[r.left + 8, r.top + 8], [r.right - 8, r.top + 8], [r.left + 8, r.bottom - 8], \
    [r.right - 8, r.bottom - 8], [r.left + r.width / 2, r.top + r.height / 2]]; \
    const isFree = corners.every(([x, y]) => e.contains(document.elementFromPoint(x, y))); \
    return { rect: [r.left, r.top, r.width, r.height], isFree, isOn: !e.disabled, \
    inside: e.scrollWidth <= e.clientWidth && e.scrollHeight <= e.clientHeight, \
    fits: document.scrollingElement.scrollWidth <= innerWidth }; })()";

#[test]
fn stop_has_one_place_and_one_size_whatever_happens() {
    let Some(mut page) = browser(1400, 900) else { return };
    let robot = Robot::start(&[]);
    let line = Line::to(&robot.at);
    page.tamper();
    for (width, height) in WINDOWS {
        let metrics =
            json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 1000});
        page.ask("Emulation.setDeviceMetricsOverride", metrics);
        let mut places: Vec<(&str, &str, Value)> = Vec::new();
        let mut look = |page: &mut Browser, state: &'static str| {
            for scheme in ["light", "dark"] {
                let features = json!([{"name": "prefers-color-scheme", "value": scheme}]);
                page.ask("Emulation.setEmulatedMedia", json!({"features": features}));
                page.picture(&format!("{width}-{scheme}-{state}"));
                places.push((state, scheme, page.value(PLACE)));
            }
        };
        line.set(LineMode::WithoutLive);
        page.open("about:blank");
        page.open(&format!("{}/?token={TOKEN}", line.at));
        page.wait("document.readyState === 'complete' && document.getElementById('link')?.textContent.includes('connect')");
        look(&mut page, "connecting");
        line.set(LineMode::Open);
        opened(&mut page);
        look(&mut page, "normal");
        for (state, how) in [
            ("emergency", "seen.emergency_stop = true"),
            (
                "fault",
                "seen.phase = 'fault'; seen.stop_reason = 'a drive failed'; seen.stop_drive = 1; \
              seen.drives[1] = { state: 'fault', error: '0x8611 (following error)' }",
            ),
            (
                "drives-lost",
                "seen.phase = 'fault'; seen.stop_reason = 'a SubDevice was lost'; \
              for (const drive of seen.drives) drive.state = 'lost'",
            ),
            ("stick-lost", "seen.joystick = 'lost'"),
            ("slow", "seen.delay_ms = 12345"),
            (
                "long",
                "seen.commander = 'a page with a very long name '.repeat(9); seen.phase = 'quick stopping'; \
              document.getElementById('name').textContent = 'a robot with a very long name '.repeat(9)",
            ),
        ] {
            page.change(how);
            look(&mut page, state);
        }
        page.change("");
        page.value(
            "(() => { for (const e of document.querySelectorAll('#settings details')) e.open = true; \
             document.getElementById('settings').scrollIntoView(); })()",
        );
        look(&mut page, "settings");
        page.value("window.scrollTo(0, 0)");
        page.swallow();
        page.wait("document.getElementById('link').classList.contains('lost')");
        look(&mut page, "silent");
        line.set(LineMode::Cut);
        page.wait("document.getElementById('link').classList.contains('lost')");
        look(&mut page, "lost");
        page.click("#stop");
        page.wait("document.getElementById('stop').textContent.includes('no connection')");
        look(&mut page, "not-sent");
        line.set(LineMode::Open);
        page.wait("document.getElementById('stop').textContent.includes('STOPPED')");
        look(&mut page, "stopped");
        assert_eq!(robot.call(&json!({"do": "release"})).0, 200);
        let fine = json!([places[2].2["rect"], true, true, true, true]);
        for (state, scheme, at) in &places {
            let found = json!([at["rect"], at["isFree"], at["isOn"], at["inside"], at["fits"]]);
            assert_eq!(found, fine, "{width} pixels, {scheme}, {state}: {places:#?}");
        }
    }
    robot.end();
}

/// The page on which STOP is pressed, enabled and holding, at the end of a line.
fn holding(line: &Line, robot: &Robot, page: &mut Browser) {
    page.open(&format!("{}/?token={TOKEN}", line.at));
    opened(page);
    press(page, "[data-do=enable]", "document.getElementById('phase').textContent === 'holding'");
    assert_eq!(robot.read("now")["emergency_stop"], false);
}

fn is_stopped(robot: &Robot) {
    robot.wait("STOP is heard", |robot| robot.read("now")["emergency_stop"] == true);
}

const SAYS_STOPPED: &str = "document.getElementById('stop').textContent.startsWith('STOPPED')";
const SAYS_UNHEARD: &str = "/NOT SENT.*no connection.*use the emergency stop on the machine/\
    .test(document.getElementById('stop').textContent)";

#[test]
fn stop_without_a_live_connection_is_heard_by_a_request_of_its_own() {
    let Some(mut page) = browser(390, 844) else { return };
    let robot = Robot::start(&[]);
    let line = Line::to(&robot.at);
    holding(&line, &robot, &mut page);
    line.set(LineMode::WithoutLive);
    page.wait("document.getElementById('link').classList.contains('lost')");
    page.click("#stop");
    is_stopped(&robot);
    page.wait(SAYS_STOPPED);
    assert_eq!(page.value("document.body.classList.contains('old')"), json!(true), "it is still without");
    robot.end();
}

#[test]
fn stop_into_a_dead_line_says_that_nobody_heard_it_and_is_tried_until_somebody_does() {
    let Some(mut page) = browser(390, 844) else { return };
    let robot = Robot::start(&[]);
    let line = Line::to(&robot.at);
    holding(&line, &robot, &mut page);
    for way in [LineMode::Cut, LineMode::Silent] {
        line.set(way);
        page.wait("document.getElementById('link').classList.contains('lost')");
        page.click("#stop");
        page.wait(SAYS_UNHEARD);
        assert_eq!(robot.read("now")["emergency_stop"], false, "{way:?}");
        line.set(LineMode::Open);
        is_stopped(&robot);
        page.wait(SAYS_STOPPED);
        page.wait("!document.body.classList.contains('old')");
        // What stuck in the line may arrive after the release, and stops again: then it is released again.
        page.wait(
            "(() => { document.querySelector('#banner button:not([hidden])')?.click(); \
             return document.getElementById('stop').textContent === 'STOP'; })()",
        );
    }
    robot.end();
}

#[test]
fn stop_that_was_given_up_is_not_sent_later() {
    let Some(mut page) = browser(390, 844) else { return };
    let robot = Robot::start(&[]);
    let line = Line::to(&robot.at);
    holding(&line, &robot, &mut page);
    line.set(LineMode::Cut);
    page.wait("document.getElementById('link').classList.contains('lost')");
    page.click("#stop");
    page.wait(SAYS_UNHEARD);
    // It may still move away under the mouse.
    while page.value("document.getElementById('stop').textContent") != "STOPno connection" {
        page.click("#give-up");
    }
    line.set(LineMode::Open);
    page.wait("!document.body.classList.contains('old')");
    cycles_pass(&robot, 3000, |robot| assert_eq!(robot.read("now")["emergency_stop"], false));
    robot.end();
}

#[test]
fn who_may_only_look_stops_the_robot_and_releases_nothing() {
    let Some(mut page) = browser(390, 844) else { return };
    let robot = Robot::start(&[]);
    let line = Line::to(&robot.at);
    page.open(&line.at);
    page.wait("document.getElementById('link')?.textContent === 'you may look, and stop'");
    page.wait("!document.body.classList.contains('old')");
    page.picture("looking");
    for way in [LineMode::Open, LineMode::WithoutLive] {
        line.set(way);
        page.wait(&format!("document.body.classList.contains('old') === {}", way == LineMode::WithoutLive));
        page.click("#stop");
        is_stopped(&robot);
        page.wait(SAYS_STOPPED);
        line.set(LineMode::Open);
        page.wait("document.getElementById('banner').textContent.includes('Emergency stop is set')");
        page.picture("looking-stopped");
        assert_eq!(page.value("document.getElementById('release').hidden"), json!(true));
        assert_eq!(robot.call(&json!({"do": "release"})).0, 200);
        page.wait("document.getElementById('banner').hidden");
    }
    robot.end();
}
