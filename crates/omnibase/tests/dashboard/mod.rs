//! A running robot's page, as a person uses it: in headless Chromium, and as those try who shouldn't.

mod axes;
pub mod browser;
mod chromium;
mod drawing;
mod inputs;
mod line;
mod objects;
mod old;
mod reach;
mod robot;
mod screen;
mod seat;
mod sensors;
mod shapes;
mod socket;
mod sources;
mod stop;
mod teaching;
mod warning;
mod ways;

use crate::joystick_recording::recording;
use browser::{Browser, LONGEST};
use robot::{Robot, TOKEN};
use screen::Screen;
use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// A press that brought nothing by then hit nothing.
const HIT: Duration = Duration::from_secs(10);
/// What was asked last was done.
const DONE: &str = "document.getElementById('said').textContent === 'done'";
/// The joystick's stop button.
const STOP: u16 = 0x121;
const SQUARE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/square.dat");

fn browser(width: u32, height: u32) -> Option<Browser> {
    told(Browser::start(width, height))
}

/// Says it where there is none.
fn told(browser: Option<Browser>) -> Option<Browser> {
    if browser.is_none() {
        omnibase_host::skipped("Chromium isn't installed: the page was not tried");
    }
    browser
}

/// The page knows who it is, and has drawn what it saw: from now on nothing moves away under the mouse.
fn opened(page: &mut Browser) {
    page.wait("document.getElementById('link')?.textContent.startsWith('you are page')");
    page.wait("document.getElementById('view').dataset.obstacles !== undefined");
    page.wait("document.querySelectorAll('.plot').length > 3");
}

/// Presses a button until what it shall bring about is true: what a busy machine makes late is refused, as it shall be,
/// and a button that is drawn elsewhere between its press and its release isn't hit.
fn press(page: &mut Browser, selector: &str, brings: &str) {
    let (refused, brings) =
        ("document.getElementById('said').classList.contains('no')", format!("Boolean({brings})"));
    until(page, &brings, |page| {
        page.value(
            "void Object.assign(document.getElementById('said'), { className: 'said', textContent: '' })",
        );
        page.click(selector);
        page.is_true_within(&format!("{brings} || {refused}"), HIT);
        page.value(&brings) == json!(true)
    });
}

/// Does something again until it says that it was done.
fn until(page: &mut Browser, what: &str, mut done: impl FnMut(&mut Browser) -> bool) {
    let begin = Instant::now();
    while !done(page) {
        assert!(begin.elapsed() < LONGEST, "never came true: {what}");
    }
}

/// Lets the robot's cycle turn so often.
fn cycles_pass(robot: &Robot, count: u64, meanwhile: impl Fn(&Robot)) {
    let cycles = || robot.read("now")["counts"][0].as_u64().unwrap();
    let then = cycles();
    robot.wait("its cycles go on", |robot| {
        meanwhile(robot);
        cycles() > then + count
    });
}

/// A stick as a test moves it.
struct Stick<'a> {
    hold: &'a dyn Fn(&mut Browser),
    let_go: &'a dyn Fn(&mut Browser),
}

/// Holds a stick until the robot drives.
fn drive(page: &mut Browser, robot: &Robot, stick: &Stick<'_>) {
    drive_until(page, robot, stick, |robot| robot.speed_m_s() > 0.2);
}

/// Holds a stick until something is true. A browser that gets no time meanwhile loses its stick, as it shall: then it is
/// let go, enabled, and held again.
fn drive_until(page: &mut Browser, robot: &Robot, stick: &Stick<'_>, is: impl Fn(&Robot) -> bool) {
    for _ in 0..100 {
        (stick.hold)(page);
        for _ in 0..50 {
            if is(robot) {
                return;
            }
            cycles_pass(robot, 20, |_| ());
        }
        (stick.let_go)(page);
        mend(page);
        cycles_pass(robot, 100, |_| ());
    }
    panic!("it never drives: {}", robot.read("now"));
}

/// Presses whatever the banner offers until it has nothing more to say.
fn mend(page: &mut Browser) {
    page.wait(
        "(() => { const banner = document.getElementById('banner'); \
         banner.querySelector('button:not([hidden])')?.click(); return banner.hidden; })()",
    );
}

#[test]
fn a_person_drives_stops_and_is_stopped_by_the_loss_of_the_page() {
    let Some(mut page) = told(Browser::alone(1400, 1000)) else { return };
    let robot = Robot::start(&[]);
    page.open(&robot.url());
    opened(&mut page);
    assert_eq!(page.value("location.search"), json!(""), "the token leaves the address");
    press(&mut page, "[data-do=enable]", "document.getElementById('phase').textContent === 'holding'");

    // The stick forward: the robot moves, and it is said who drives.
    let stick = page.middle("#stick");
    let held = Stick {
        hold: &|page| {
            page.mouse("mousePressed", stick);
            page.mouse("mouseMoved", [stick[0], stick[1] - 60.0]);
        },
        let_go: &|page| page.mouse("mouseReleased", stick),
    };
    drive(&mut page, &robot, &held);
    page.wait("document.getElementById('commander').textContent.includes('you (page 1) commands, by hand')");
    page.picture("driving");

    // The big stop, by its key, with the stick still held.
    page.ask("Input.dispatchKeyEvent", json!({"type": "keyDown", "code": "Space", "key": " "}));
    robot.wait("it stops", |robot| robot.read("now")["phase"] == "disabled" && robot.speed_m_s() < 1e-3);
    page.wait("!document.getElementById('banner').hidden");
    page.picture("stopped");
    page.mouse("mouseReleased", stick);
    mend(&mut page);
    press(&mut page, "[data-do=enable]", "document.getElementById('phase').textContent === 'holding'");

    // Driving again, and the browser is killed.
    let stick = page.middle("#stick");
    let held = Stick {
        hold: &|page| {
            page.mouse("mousePressed", stick);
            page.mouse("mouseMoved", [stick[0] - 60.0, stick[1]]);
        },
        let_go: &|page| page.mouse("mouseReleased", stick),
    };
    drive(&mut page, &robot, &held);
    drop(page);
    robot.wait("it stops", |robot| robot.read("now")["phase"] == "holding" && robot.speed_m_s() < 1e-3);
    let summary = robot.end();
    let events = summary["events"].to_string();
    assert!(events.contains("ramping down"), "{events}");
}

#[test]
fn a_gamepad_at_the_browser_drives_and_its_loss_stops_and_blocks() {
    let Some(mut page) = browser(844, 390) else { return };
    let robot = Robot::start(&[]);
    page.open(&robot.url());
    opened(&mut page);
    // What the browser would show of a gamepad: left stick forward, its shoulder button as the test says.
    page.value(
        "(() => { window.gamepad = { connected: true, id: 'a gamepad', axes: [0, -1, 0, 0], \
         buttons: Array.from({ length: 16 }, () => ({ pressed: false })) }; \
         navigator.getGamepads = () => [window.gamepad]; })()",
    );
    press(&mut page, "[data-do=enable]", "document.getElementById('phase').textContent === 'holding'");
    page.picture("phone-across");
    page.value("document.querySelector('.drive').scrollIntoView()");
    page.picture("phone-across-stick");
    let held = Stick {
        hold: &|page| drop(page.value("void (window.gamepad.buttons[4].pressed = true)")),
        let_go: &|page| drop(page.value("void (window.gamepad.buttons[4].pressed = false)")),
    };
    drive(&mut page, &robot, &held);
    assert_eq!(robot.read("now")["by_stick"], true);
    page.value("void (navigator.getGamepads = () => [])");
    robot.wait("it stops", |robot| robot.read("now")["phase"] == "holding" && robot.speed_m_s() < 1e-3);
    page.wait("document.getElementById('banner').textContent.includes('The stick was lost')");
    // Back with its button held: not before it is enabled, and then not before it was let go.
    page.value("void (navigator.getGamepads = () => [window.gamepad])");
    press(&mut page, "#enable-stick", "document.getElementById('banner').hidden");
    let cycles = || robot.read("now")["counts"][0].as_u64().unwrap();
    let then = cycles();
    robot.wait("it stands", |robot| {
        assert_eq!(robot.read("now")["by_stick"], false);
        cycles() > then + 300
    });
    page.value("void (window.gamepad.buttons[4].pressed = false)");
    let then = cycles();
    robot.wait("the page tells that", |_| cycles() > then + 300);
    drive(&mut page, &robot, &held);
    // In its corner the stick reaches 1.41; half of the speed was chosen, and the robot's file says 1 m/s.
    page.value("void (window.gamepad.axes = [-1, -1, 0, 0])");
    drive_until(&mut page, &robot, &held, |robot| robot.value("setpoint/twist_y_m_s") > 0.34);
    let then = cycles();
    robot.wait("it goes on", |robot| {
        let speed = ["setpoint/twist_x_m_s", "setpoint/twist_y_m_s"].map(|name| robot.value(name));
        assert!(speed[0].hypot(speed[1]) < 0.505, "{speed:?}");
        cycles() > then + 500
    });
    robot.end();
}

#[test]
fn an_obstacle_that_is_dragged_into_the_way_bends_it() {
    let Some(mut page) = browser(1400, 1000) else { return };
    let fence = "fence.rectangle_m=[-1.2, -1.6, 3.2, 1.6]";
    let robot = Robot::start(&["--set", "avoidance.kind=guarded", "--set", fence]);
    page.open(&robot.url());
    opened(&mut page);
    press(&mut page, "[data-do=enable]", "document.getElementById('phase').textContent === 'holding'");
    let screen = Screen::of(&mut page, &robot);
    until(&mut page, "the obstacle is there", |page| {
        if page.value("document.getElementById('obstacle').ariaPressed") != json!("true") {
            page.click("#obstacle");
        }
        screen.click(page, [1.0, 1.0]);
        page.is_true_within("document.getElementById('view').dataset.obstacles === '1'", HIT)
    });
    let y_m = |robot: &Robot| robot.read("now")["obstacles"][0]["y"].as_f64().unwrap();
    assert!(y_m(&robot) > 0.9, "{}", y_m(&robot));
    until(&mut page, "the obstacle was dragged", |page| {
        let [from, half, to] = [y_m(&robot), 0.6, 0.1].map(|y_m| screen.place(page, [1.0, y_m]));
        page.mouse("mousePressed", from);
        page.mouse("mouseMoved", half);
        page.mouse("mouseMoved", to);
        page.mouse("mouseReleased", to);
        robot.is_true_within(|robot| y_m(robot) < 0.2, HIT)
    });
    // Tapped, it can be changed; the page may see a moment later than the robot where it was dropped.
    until(&mut page, "the obstacle is chosen", |page| {
        screen.click(page, [1.0, 0.1]);
        page.is_true_within("!document.getElementById('obstacle-bar').hidden", HIT)
    });
    page.picture("obstacle");
    page.value(
        "(() => { const bar = document.getElementById('obstacle-bar'), { radius } = bar.elements; \
         radius.value = 0.25; radius.dispatchEvent(new Event('change', { bubbles: true })); })()",
    );
    robot.wait("it is larger", |robot| robot.read("now")["obstacles"][0]["radius"] == json!(0.25));
    assert_eq!(robot.call(&json!({"do": "go_to", "pose": [2.0, 0.0, 0.0]})).0, 200);
    robot.wait("its goal is seen", |robot| robot.read("now")["goal"] == json!([2.0, 0.0, 0.0]));
    page.wait("document.getElementById('commander').textContent.includes('going somewhere')");
    page.picture("going");
    robot.wait("it is past the obstacle", |robot| {
        assert!(robot.value("guard/obstacle_distance_m") > 0.0, "{}", robot.read("now"));
        robot.value("state/pose_x_m") > 1.95
    });
    page.picture("bent");
    page.whole_picture("bent-whole");
    let trace = robot.read("trace");
    let aside_m = |point: &Value| point[1][1].as_f64().unwrap().abs();
    let bent_m = trace.as_array().unwrap().iter().map(aside_m).fold(0.0, f64::max);
    assert!(bent_m > 0.3, "{bent_m} m, {}", robot.read("now")["obstacles"]);
    press(&mut page, "#obstacle-bar [name=remove]", "document.getElementById('obstacle-bar').hidden");
    robot.wait("it is gone", |robot| robot.read("now")["obstacles"] == json!([]));
    page.wait("document.getElementById('obstacle-bar').hidden");
    robot.end();
}

#[test]
fn without_the_token_and_from_elsewhere_nothing_is_commanded() {
    let robot = Robot::start(&["--path", SQUARE]);
    let agent: ureq::Agent = ureq::Agent::config_builder().http_status_as_error(false).build().into();
    let call = format!("{}/api/call", robot.at);
    let status = |headers: &[(&str, &str)], body: &str| {
        let request =
            headers.iter().fold(agent.post(&call), |request, (name, value)| request.header(*name, *value));
        // Whoever sends too much may find the line closed before the answer.
        request.send(body).map_or(413, |answer| answer.status().as_u16())
    };
    let bearer = ("Authorization", "Bearer token-of-the-test");
    let enable = r#"{"do":"enable"}"#;
    assert_eq!(status(&[], enable), 403);
    assert_eq!(status(&[("Authorization", "Bearer wrong-token")], enable), 403);
    assert_eq!(status(&[bearer, ("Origin", "http://evil.example")], enable), 403);
    assert_eq!(status(&[bearer, ("Host", "evil.example")], enable), 403);
    // Malformed and oversized bodies are refused and counted; sticks need a session.
    assert_eq!(status(&[bearer], "{\"do\":\"fly\"}"), 400);
    assert_eq!(status(&[bearer], &"x".repeat(300 * 1024)), 413);
    assert_eq!(status(&[bearer], r#"{"do":"stick","x":1,"y":0,"turn":0}"#), 409);
    assert_eq!(robot.read("now")["phase"], "disabled");
    // Nor is what begins something without saying how old it is; a stop is, by whoever may look.
    assert_eq!(status(&[bearer], enable), 409);
    assert_eq!(robot.read("now")["phase"], "disabled");
    assert_eq!(robot.call(&json!({"do": "enable"})).0, 200);
    robot.wait("it holds", |robot| robot.read("now")["phase"] == "holding");
    assert_eq!(status(&[], r#"{"do":"stop","category":"category_1"}"#), 200);
    robot.wait("it is stopped", |robot| robot.read("now")["phase"] == "disabled");
    assert_eq!(status(&[], r#"{"do":"release"}"#), 403);
    assert_eq!(status(&[bearer, ("Sec-Fetch-Site", "cross-site")], r#"{"do":"emergency_stop"}"#), 403);
    // To let a joystick drive again is a command like any other.
    assert_eq!(status(&[], r#"{"do":"enable_joystick"}"#), 403);
    let (code, said) = robot.call(&json!({"do": "set", "values": {"speed_m_s": 0.5, "speed": 1.0}}));
    assert!(code == 409 && said["text"].as_str().unwrap().contains("no setting is called `speed`"), "{said}");
    let (code, said) =
        robot.call(&json!({"do": "load", "reference": {"kind": "path", "points_file": "/etc/passwd"}}));
    assert!(code == 409 && said["text"].as_str().unwrap().contains("points_file"), "{said}");
    let (code, said) = robot.call(&json!({"do": "load_saved", "name": "../../etc/passwd"}));
    assert!(code == 409 && said["text"].as_str().unwrap().contains("letters"), "{said}");
    let counts = robot.read("now")["server"].clone();
    assert!(counts[1].as_u64() >= Some(4) && counts[2].as_u64() >= Some(1), "{counts}");
    assert_eq!(counts[3], 1, "{counts}");
    robot.end();
}

#[test]
fn a_client_that_floods_is_cut_off_and_the_robot_goes_on() {
    let robot = Robot::start(&["--path", SQUARE]);
    assert_eq!(robot.call(&json!({"do": "enable"})).0, 200);
    robot.wait("it holds", |robot| robot.read("now")["phase"] == "holding");
    assert_eq!(robot.call(&json!({"do": "track"})).0, 200);
    let address = robot.at.strip_prefix("http://").unwrap();
    let mut socket = socket::connect(address, TOKEN);
    let mut sent = 0u32;
    // Until the server has enough of it.
    while sent < 2_000_000 {
        let text = if sent.is_multiple_of(3) { "{" } else { r#"{"do":"pause"}"# };
        if socket.send(tungstenite::Message::text(text)).is_err() {
            break;
        }
        sent += 1;
    }
    assert!(sent < 2_000_000, "the flood was never cut off");
    robot.wait("the flood was counted", |robot| robot.read("now")["server"][4].as_u64() > Some(1000));
    let summary = robot.end();
    assert_eq!(summary["lost_frames"], 0);
}

#[test]
fn the_command_line_reads_sets_and_calls_a_running_robot() {
    let robot = Robot::start(&["--path", SQUARE]);
    let omnibase = |arguments: &[&str]| robot.command(arguments);
    assert_eq!(omnibase(&["call", "enable"]).0, Some(0));
    robot.wait("it holds", |robot| robot.read("now")["phase"] == "holding");
    assert_eq!(omnibase(&["set", "speed_factor=0.5", "kp_x_1_s=10"]).0, Some(0));
    let settings: Value = serde_json::from_str(&omnibase(&["get", "settings", "--json"]).1).unwrap();
    assert_eq!(
        (&settings["settings/speed_factor"], &settings["settings/kp_x_1_s"]),
        (&json!(0.5), &json!(10.0))
    );
    // One that is wrong changes none.
    let (code, _, error) = omnibase(&["set", "speed_factor=0.9", "kp_x_1_s=-1"]);
    assert!(code == Some(1) && error.contains("kp_x_1_s: expected 0 to 1000, found -1"), "{error}");
    let (_, text, _) = omnibase(&["get", "settings/speed_factor"]);
    assert!(text.contains("0.5   0.01 to 1.0"), "{text}");
    let (code, _, error) = omnibase(&["call", "fly"]);
    assert!(code == Some(1) && error.contains("no call is called `fly`"), "{error}");
    let (code, _, error) = omnibase(&["call", "enabel"]);
    assert!(code == Some(1) && error.contains("did you mean `enable`?"), "{error}");
    let (code, _, error) = omnibase(&["call", "pause"]);
    assert!(code == Some(1) && error.contains("the robot holds its place already"), "{error}");
    let (code, _, error) = omnibase(&["set", "speed_facto=0.5"]);
    assert!(code == Some(1) && error.contains("did you mean `speed_factor`?"), "{error}");
    let (code, text, _) = omnibase(&["set", "speed_factor=7", "--json"]);
    let refused: Value = serde_json::from_str(&text).unwrap();
    assert!(code == Some(1) && refused["done"] == false, "{text}");
    let (code, text, _) = omnibase(&["call", "go_to", "pose=[0.1,0,0]", "--json"]);
    assert_eq!(
        (code, serde_json::from_str::<Value>(&text).unwrap()),
        (Some(0), json!({"done": true, "text": "done"}))
    );
    robot.wait("it is there", |robot| {
        robot.read("now")["phase"] == "holding" && robot.value("state/pose_x_m") > 0.09
    });
    let view = omnibase(&["top", "--once"]).1;
    for word in [
        "HOLDING",
        "wheel_3",
        "running",
        "cycles",
        "speed",
        "no slip yet",
        "wake-up late",
        "99 %",
        "round trip",
    ] {
        assert!(view.contains(word), "{word} in\n{view}");
    }
    assert_eq!(omnibase(&["call", "emergency_stop"]).0, Some(0));
    robot.wait("it is disabled", |robot| robot.read("now")["phase"] == "disabled");
    let (code, _, error) = omnibase(&["call", "enable"]);
    assert!(code == Some(1) && error.contains("the emergency stop is set"), "{error}");
    robot.end();
}

#[test]
fn a_joystick_that_was_stopped_or_lost_is_shown_and_enabled_by_a_page_or_the_command_line() {
    let folder = tempfile::tempdir().unwrap();
    // Stopped by its own button, and there for longer than any machine takes.
    let stick = recording(folder.path(), &[(1000, STOP, 1), (1100, STOP, 0), (1_000_000, STOP, 0)]);
    let page = browser(390, 844);
    let robot = Robot::start(&["--joystick", stick.to_str().unwrap()]);
    let became = |robot: &Robot, state: &'static str| {
        robot.wait(state, move |robot| robot.read("now")["joystick"] == state);
    };
    became(&robot, "blocked");
    let view = robot.command(&["top", "--once"]).1;
    assert!(view.contains("joystick: blocked; `omnibase call enable_joystick`"), "{view}");
    let who = if let Some(mut page) = page {
        page.open(&robot.url());
        opened(&mut page);
        page.wait(
            "document.getElementById('banner').textContent.includes('joystick at the robot is blocked')",
        );
        let enabled = "document.getElementById('joystick-is').textContent.includes('comes before this page')";
        press(&mut page, "#enable-joystick", enabled);
        // Its gains are settings like any others.
        page.wait("document.getElementById('set-joystick.forward.gain')?.value === '1'");
        page.click("#settings summary");
        page.whole_picture("phone-joystick");
        "page 1"
    } else {
        assert_eq!(robot.command(&["call", "enable_joystick"]).0, Some(0));
        "command line"
    };
    became(&robot, "present");
    let events = robot.read("events").to_string();
    assert!(events.contains(&format!("enabled the joystick again ({who})")), "{events}");
    robot.end();
    // What isn't there can't be enabled.
    let gone = recording(folder.path(), &[(1000, STOP, 1), (1100, STOP, 0)]);
    let robot = Robot::start(&["--joystick", gone.to_str().unwrap()]);
    became(&robot, "lost");
    let (code, _, error) = robot.command(&["call", "enable_joystick"]);
    assert!(code == Some(1) && error.contains("the stick isn't there"), "{error}");
    let view = robot.command(&["top", "--once"]).1;
    assert!(view.contains("joystick: lost; plug it in again"), "{view}");
    assert_eq!(
        robot.command(&["set", "joystick.turn.gain=0.5", "joystick.forward.dead_zone=0.2"]).0,
        Some(0)
    );
    assert_eq!(robot.command(&["get", "settings/joystick.turn.gain", "--json"]).1.matches("0.5").count(), 1);
    let (code, _, error) = robot.command(&["set", "joystick.turn.gain=1.5"]);
    assert!(code == Some(1) && error.contains("joystick.turn.gain: expected 0 to 1, found 1.5"), "{error}");
    robot.end();
}

#[test]
fn plotjuggler_gets_every_value_by_udp() {
    let socket = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    let target = format!("--plotjuggler={}", socket.local_addr().unwrap());
    let robot = Robot::start(&[&target]);
    let mut bytes = [0; 65_536];
    let mut next = || {
        let length = socket.recv(&mut bytes).unwrap();
        serde_json::from_slice::<Value>(&bytes[..length]).unwrap()
    };
    let (first, second) = (next(), next());
    assert!(second["timestamp"].as_f64() > first["timestamp"].as_f64(), "{first} {second}");
    assert!(
        second["state"]["pose_x_m"].is_number() && second["wheel_3"]["torque_nm"].is_number(),
        "{second}"
    );
    robot.end();
}
