//! What is old on the page is grey, and begins nothing.

use super::browser::{Browser, LONGEST};
use super::line::{Line, LineMode};
use super::robot::{Robot, TOKEN};
use super::{HIT, Stick, browser, cycles_pass, drive, mend, opened, press};
use serde_json::json;
use std::time::{Duration, Instant};

const HOLDS: &str = "document.getElementById('phase').textContent === 'holding'";
const OLD: &str = "document.body.classList.contains('old')";
const SILENT: &str = "document.getElementById('link').classList.contains('lost')";
const FRESH: &str = "!document.body.classList.contains('old')";
/// What is shown of the robot and is not grey.
const COLOURED: &str = "[...document.querySelectorAll('.seen')].filter((e) => { const s = getComputedStyle(e); \
    return s.filter !== 'grayscale(1)' || Number(s.opacity) > 0.5; }).map((e) => e.id)";

fn holding(at: &str, page: &mut Browser) {
    page.tamper();
    page.open(&format!("{at}/?token={TOKEN}"));
    opened(page);
    press(page, "[data-do=enable]", HOLDS);
}

#[test]
fn what_is_old_is_grey_and_says_how_old_it_is() {
    let Some(mut page) = browser(1400, 900) else { return };
    let robot = Robot::start(&[]);
    let line = Line::to(&robot.at);
    holding(&line.at, &mut page);
    page.wait(FRESH);
    let all = page.value("document.querySelectorAll('.seen').length").as_u64().unwrap();
    let shown = ["phase", "commander", "view", "pose", "drives", "plots", "settings"];
    for id in shown {
        let is_seen = page.value(&format!("document.getElementById('{id}').classList.contains('seen')"));
        assert_eq!(is_seen, json!(true), "{id}");
    }
    page.wait(&format!("{COLOURED}.length === {all} && document.getElementById('age').hidden"));
    type Make<'a> = &'a dyn Fn(&mut Browser);
    let swallowed: Make = &|page| page.swallow();
    let standing: Make = &|page| {
        // Messages come, but the robot's clock stands.
        page.value("void (window.tamper = (seen) => 'phase' in seen ? (window.first ??= seen) : seen)");
    };
    let slow: Make = &|page| page.change("seen.delay_ms = 501");
    let silent: Make = &|_| line.set(LineMode::Silent);
    let cut: Make = &|_| line.set(LineMode::Cut);
    for (what, make) in
        [("swallowed", swallowed), ("standing", standing), ("slow", slow), ("silent", silent), ("cut", cut)]
    {
        make(&mut page);
        page.wait(OLD);
        assert_eq!(page.value(COLOURED), json!([]), "{what}");
        assert_eq!(page.value("document.getElementById('age').hidden"), json!(false), "{what}");
        page.wait("/[0-9.]+ s old$/.test(document.getElementById('age').textContent)");
        if what != "slow" {
            page.wait("parseFloat(document.getElementById('age').textContent) > 1");
        }
        line.set(LineMode::Open);
        page.value("void (window.tamper = (seen) => seen)");
        page.wait(&format!("{FRESH} && {COLOURED}.length === {all}"));
    }
    robot.end();
}

#[test]
fn a_page_that_draws_slowly_sees_what_is_new() {
    let Some(mut page) = browser(390, 844) else { return };
    let robot = Robot::start(&[]);
    page.open(&robot.url());
    opened(&mut page);
    // Far slower than the robot tells: each drawing of each canvas takes 100 ms.
    page.value(
        "(() => { const clear = CanvasRenderingContext2D.prototype.clearRect; \
         CanvasRenderingContext2D.prototype.clearRect = function (...area) { \
         const end = performance.now() + 100; while (performance.now() < end); clear.apply(this, area); }; })()",
    );
    cycles_pass(&robot, 10_000, |_| ());
    let shown_s =
        page.value("parseFloat(document.getElementById('pose').textContent.match(/time([0-9.]+)/)[1])");
    // Asked afterwards: an answer for which everything had to be drawn first is late, too.
    let behind_s = robot.read("now")["time_s"].as_f64().unwrap() - shown_s.as_f64().unwrap();
    assert!(behind_s < 5.0, "{behind_s} s behind after ten");
    // What it shows is fresh, not one of thousands that it has yet to draw.
    page.wait(FRESH);
    robot.end();
}

#[test]
fn the_delay_is_shown_and_warned_of() {
    let Some(mut page) = browser(390, 844) else { return };
    let robot = Robot::start(&[]);
    holding(&robot.at, &mut page);
    let delay = "document.getElementById('delay').textContent + '|' + document.getElementById('delay').className.trim()";
    for (delay_ms, shown, kind) in
        [(200, "delay 200 ms", "link"), (201, "delay 201 ms", "link slow"), (750, "delay 0.8 s", "link lost")]
    {
        page.change(&format!("seen.delay_ms = {delay_ms}"));
        page.wait(&format!("{delay} === '{shown}|{kind}'"));
        let refused = "document.getElementById('banner').innerText.includes('begins a motion is refused')";
        page.wait(&format!("{refused} === {}", delay_ms > 500));
    }
    robot.end();
}

#[test]
fn a_press_into_a_dead_line_is_refused_on_the_spot_and_never_arrives() {
    let Some(mut page) = browser(1400, 900) else { return };
    let robot = Robot::start(&[]);
    let line = Line::to(&robot.at);
    holding(&line.at, &mut page);
    for way in [LineMode::Silent, LineMode::Cut] {
        line.set(way);
        page.wait(SILENT);
        page.value("void (document.getElementById('said').textContent = '')");
        page.click("#go");
        let middle = page.middle("#view");
        for what in ["mousePressed", "mouseReleased"] {
            page.mouse(what, [middle[0] + 120.0, middle[1]]);
        }
        page.wait("document.getElementById('said').textContent.startsWith('not sent: ')");
        line.set(LineMode::Open);
        page.wait(FRESH);
        cycles_pass(&robot, 1000, |robot| {
            let now = robot.read("now");
            assert!(now["phase"] == "holding" && now["goal"].is_null(), "{way:?}: {now}");
        });
    }
    // The same press into a line that lives.
    let done = "document.getElementById('said').textContent === 'done'";
    while page.value(done) != json!(true) {
        page.value("void (document.getElementById('said').textContent = '')");
        page.click("#go");
        let middle = page.middle("#view");
        for what in ["mousePressed", "mouseReleased"] {
            page.mouse(what, [middle[0] + 120.0, middle[1]]);
        }
        // A press that a busy machine takes apart hits nothing, and is done again.
        page.is_true_within("document.getElementById('said').textContent !== ''", HIT);
    }
    robot.end();
}

#[test]
fn what_is_pressed_says_how_old_what_the_page_saw_is() {
    let Some(mut page) = browser(390, 844) else { return };
    let robot = Robot::start(&[]);
    page.tamper();
    page.open(&robot.url());
    opened(&mut page);
    // What comes looks new, but is what the robot said long ago: as on a line that is slow.
    page.change("delete seen.stamp; seen.delay_ms = null");
    cycles_pass(&robot, 2000, |_| ());
    let tells_age = "document.getElementById('said').textContent.includes('s ago, and counts for')";
    press(&mut page, "[data-do=enable]", tells_age);
    assert_eq!(robot.read("now")["phase"], "disabled");
    page.change("");
    page.wait(FRESH);
    // What it saw when it was pressed counts, not what came until a page that was busy sends it.
    page.wait("window.changed > 100");
    page.value("void (document.getElementById('said').textContent = '')");
    // Again where a busy machine let the page hear nothing for a while: then it says that.
    let old_press =
        "document.querySelector('[data-do=enable]').onclick({ timeStamp: performance.now() - 3000 })";
    let begin = Instant::now();
    while begin.elapsed() < LONGEST {
        page.value(old_press);
        if page.is_true_within(tells_age, Duration::from_secs(1)) {
            break;
        }
    }
    page.wait(tells_age);
    assert_eq!(robot.read("now")["phase"], "disabled");
    press(&mut page, "[data-do=enable]", HOLDS);
    robot.end();
}

#[test]
fn sticks_cannot_be_held_while_what_is_seen_is_old() {
    let Some(mut page) = browser(1400, 900) else { return };
    let robot = Robot::start(&[]);
    holding(&robot.at, &mut page);
    let stick = page.middle("#stick");
    let held = Stick {
        hold: &|page| {
            page.mouse("mousePressed", stick);
            page.mouse("mouseMoved", [stick[0], stick[1] - 60.0]);
        },
        let_go: &|page| page.mouse("mouseReleased", stick),
    };
    let stands = |robot: &Robot| robot.read("now")["phase"] == "holding" && robot.speed_m_s() < 1e-3;
    drive(&mut page, &robot, &held);
    page.swallow();
    page.wait("!document.getElementById('stick').classList.contains('held')");
    robot.wait("it stops", stands);
    // Still in hand when the robot is seen again, and moved: it must be taken hold of anew.
    page.change("");
    page.wait(FRESH);
    page.mouse("mouseMoved", [stick[0], stick[1] - 50.0]);
    cycles_pass(&robot, 500, |robot| assert!(stands(robot), "{}", robot.read("now")));
    page.mouse("mouseReleased", stick);
    mend(&mut page);
    drive(&mut page, &robot, &held);
    page.mouse("mouseReleased", stick);
    robot.wait("it stops", stands);
    // A gamepad whose button was held meanwhile must be let go of.
    page.value(
        "(() => { window.gamepad = { connected: true, id: 'a gamepad', axes: [0, -1, 0, 0], \
         buttons: Array.from({ length: 16 }, () => ({ pressed: false })) }; \
         navigator.getGamepads = () => [window.gamepad]; })()",
    );
    let held = Stick {
        hold: &|page| drop(page.value("void (window.gamepad.buttons[4].pressed = true)")),
        let_go: &|page| drop(page.value("void (window.gamepad.buttons[4].pressed = false)")),
    };
    drive(&mut page, &robot, &held);
    // On a line that is slow, what it says would still arrive.
    page.change("seen.delay_ms = 600");
    page.wait(OLD);
    robot.wait("it stops", stands);
    page.change("");
    page.wait(FRESH);
    cycles_pass(&robot, 500, |robot| assert!(stands(robot), "{}", robot.read("now")));
    (held.let_go)(&mut page);
    mend(&mut page);
    cycles_pass(&robot, 300, |_| ());
    drive(&mut page, &robot, &held);
    robot.end();
}

#[test]
fn a_fault_names_the_drive_what_it_says_and_what_to_do_and_what_comes_by_itself_is_told() {
    let Some(mut page) = browser(390, 844) else { return };
    let drives =
        "drive=[{name='wheel_1',position=0},{name='rear_left',position=1},{name='wheel_3',position=2}]";
    let robot = Robot::start(&["--set", drives]);
    page.tamper();
    page.open(&robot.url());
    opened(&mut page);
    let fault = "seen.phase = 'fault'; seen.stop_reason = 'a drive failed'; const d = seen.drives";
    for (how, says) in [
        (
            "seen.stop_drive = 1; d[0].state = 'quick stop'; d[1] = { state: 'fault', error: '0x8611 (following error)' }",
            "Fault: rear_left (sgdv): error 0x8611 (following error). Look what holds the wheel or drives it.",
        ),
        (
            "seen.stop_drive = 2; d[0] = { state: 'fault', error: '0x3220 (x)' }; d[2] = { state: 'fault', error: '' }",
            "Fault: wheel_3 (sgdv): a fault that it tells no code of. See the drive's display. \
             wheel_1 (sgdv): error 0x3220 (x). Check the drive's supply.",
        ),
        (
            "seen.stop_drive = 0; d[0].state = d[1].state = 'lost'",
            "Fault: wheel_1 (sgdv), rear_left (sgdv): lost. Check supply and bus cables.",
        ),
        (
            "seen.stop_drive = 1; seen.stop_reason = 'a wheel turned faster than its limit'",
            "Fault: rear_left (sgdv): a wheel turned faster than its limit.",
        ),
        (
            "seen.phase = 'holding'; seen.moves_again_in_s = 2.25",
            "It moves again by itself in 2.3 s: keep away from it, or stop it. No sound: touch this page once.",
        ),
        ("seen.stop_reason = 'a number wasn\\'t finite'", "Fault: a number wasn't finite."),
    ] {
        page.change(&format!("{fault}; {how}"));
        page.wait(&format!("document.getElementById('banner-is').textContent === {says:?}"));
        page.wait(&format!("document.getElementById('mend').hidden === {}", !says.starts_with("Fault")));
    }
    page.picture("fault");
    robot.end();
}
