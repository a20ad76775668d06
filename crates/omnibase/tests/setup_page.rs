//! A person before the page sets a robot up: the real program, its page in headless Chromium, a button that is held.
//!
//! Nothing here depends on how fast the machine is: what must not happen is looked for in the program's own record, and what must
//! happen is waited for.

mod broken_off;
mod relay;
#[path = "../../setup/examples/seeds/unknown/mod.rs"]
#[allow(dead_code, reason = "the set-up's own tests have the other half")]
mod unknown;

use crate::dashboard::browser::{Browser, LONGEST};
use omnibase_host::Namespace;
use relay::{Line, Relay};
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use unknown::{Unknown, differences, drive_square};

const TOKEN: &str = "token-of-the-test";
const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
const BMM: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/bmm.toml");
/// Whoever says nothing for so long is stuck.
const STUCK: Duration = Duration::from_secs(300);

/// Questions and motions of a set-up on the slowest machine; one that keeps up has some 60.
const LOOKS: u32 = 400;

/// A program that ends with the test.
struct Ends(Child);

impl Drop for Ends {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Starts a program and waits for a line of its errors that begins so; what stands behind.
fn started(arguments: &[&str], word: &str) -> (Ends, String) {
    let mut process = Command::new(env!("CARGO_BIN_EXE_omnibase"))
        .args(arguments)
        .env("OMNIBASE_TOKEN", TOKEN)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(process.stderr.take().unwrap()).lines();
    let mut said = Vec::new();
    let found = lines.by_ref().map_while(Result::ok).find_map(|line| {
        said.push(line.clone());
        Some(line.split_once(word)?.1.to_owned())
    });
    let found = found.unwrap_or_else(|| panic!("{arguments:?} never said {word:?}: {said:#?}"));
    std::thread::spawn(move || lines.for_each(drop));
    (Ends(process), found)
}

/// A robot behind the far end of the cable, ready to answer; `faults` are the simulator's. To be called inside the namespace.
fn simulated(file: &Path, faults: &[&str]) -> Ends {
    let mut process = Command::new(env!("CARGO_BIN_EXE_omnibase"))
        .args(["simulate", file.to_str().unwrap(), "--interface", Namespace::FAR, "--realtime"])
        .args(faults)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(process.stdout.take().unwrap()).lines();
    lines.next().unwrap().unwrap();
    std::thread::spawn(move || lines.for_each(drop));
    Ends(process)
}

/// The set-up of a segment, and where its page is: address and port.
fn set_up(base: &Path, target: &str, output: &Path, more: &[&str]) -> (Ends, String) {
    let (base, output) = (base.to_str().unwrap(), output.to_str().unwrap());
    let all = [&["setup", target, "--robot", base, "-o", output, "--dashboard=127.0.0.1:0"], more].concat();
    let (process, url) = started(&all, "dashboard: http://");
    (process, url.split('/').next().unwrap().to_owned())
}

fn open(page: &mut Browser, at: &str) {
    page.open(&format!("http://{at}/?token={TOKEN}"));
    page.wait("document.getElementById('link')?.textContent === 'connected'");
    assert_eq!(page.value("location.search"), "", "the token leaves the address");
}

/// What the page shows.
fn seen(page: &mut Browser) -> Value {
    page.value(
        "(() => { const at = (id) => document.getElementById(id), question = at('question'); return { \
         over: at('over').hidden ? null : at('over').textContent, \
         asked: question.hidden ? null : question.dataset.id, number: question.dataset.number, \
         hold: at('holding').hidden ? null : at('what').textContent, \
         travel: Number(at('moves').dataset.travel ?? 0), enabled: at('moves').dataset.enabled === 'true', \
         unheard: at('hold').classList.contains('unheard'), late: Number(at('moves').dataset.late ?? 0) }; })()",
    )
}

/// Waits until the page shows something of the kind.
fn until(page: &mut Browser, what: &str, is: impl Fn(&Value) -> bool) -> Value {
    let begun = Instant::now();
    loop {
        let seen = seen(page);
        if is(&seen) {
            return seen;
        }
        assert!(begun.elapsed() < LONGEST, "never: {what}: {seen}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Answers what is asked, and waits until the answer is taken.
fn answer(page: &mut Browser, said: &str) {
    let asked = say(page, said);
    until(page, "the answer is taken", |seen| seen["asked"].is_null() || seen["number"] != asked);
}

/// Says an answer by a button or in words; the number of what is asked.
fn say(page: &mut Browser, said: &str) -> Value {
    let asked = seen(page)["number"].clone();
    let button = format!("[data-choice=\"{said}\"]");
    if page.value(&format!("Boolean(document.querySelector({button:?}))")) == true {
        // Whatever the mouse still presses.
        page.value(&format!("document.querySelector({button:?}).click()"));
    } else {
        page.value(&format!("void (document.getElementById('value').value = {said:?})"));
        page.value("document.querySelector('#free button').click()");
    }
    asked
}

/// Holds the button until something is seen, or until the motion is over; how far it went, where it was enabled.
fn hold(page: &mut Browser, until: impl Fn(&Value) -> bool) -> Option<f64> {
    let begun = Instant::now();
    let what = seen(page)["hold"].clone();
    let place = page.middle("#hold");
    page.mouse("mousePressed", place);
    let mut travel = None;
    loop {
        let now = seen(page);
        // Over, or another motion waits by now.
        if now["hold"] != what {
            break;
        }
        if now["enabled"] == true {
            travel = now["travel"].as_f64();
        }
        // A machine that is too slow for a page holds nothing: let go, and again.
        if until(&now) || now["unheard"] == true || begun.elapsed() > STUCK {
            break;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    page.mouse("mouseReleased", place);
    travel
}

/// Each motion of the record: how it ended, cycles enabled, cycles without a held key.
fn motions(output: &Path) -> Vec<(String, u64, u64)> {
    let Ok(text) = std::fs::read_to_string(output.with_extension("state.json")) else { return Vec::new() };
    let state: Value = serde_json::from_str(&text).unwrap();
    let log: Vec<String> = serde_json::from_value(state["log"].clone()).unwrap();
    let number = |line: &str, before: &str| {
        let head = line.split_once(before).map_or("0", |(head, _)| head);
        head.rsplit(' ').next().unwrap().parse().unwrap()
    };
    let motions = log.into_iter().filter(|line| line.contains("without a held key"));
    motions
        .map(|line| {
            let (enabled, unheld) = (number(&line, " cycles, "), number(&line, " without a held key"));
            (line, enabled, unheld)
        })
        .collect()
}

fn browser(width: u32, height: u32) -> Option<Browser> {
    let browser = Browser::start(width, height);
    if browser.is_none() {
        eprintln!("SKIPPED: Chromium isn't installed: the set-up's page was not tried");
    }
    browser
}

/// A robot whose wiring nobody knows, behind a cable: set up on the page, left and taken up again, driven its first metre. The
/// file is right, and drives its square.
#[test]
fn an_unknown_robot_behind_a_cable_is_set_up_on_the_page() {
    let Some(namespace) = Namespace::for_test("an_unknown_robot_behind_a_cable_is_set_up_on_the_page") else {
        return;
    };
    namespace.run(|| {
        let Some(mut page) = browser(1300, 900) else { return };
        let robot = Unknown {
            positions: [2, 0, 1],
            backward: [true, false, true],
            counts: 10_000,
            gear: 5.0,
            turned_encoder: None,
            brakes: [0; 3],
        };
        let folder = tempfile::tempdir().unwrap();
        let place = |on_blocks: bool| {
            let file = folder.path().join("real.toml");
            std::fs::write(&file, robot.placed(on_blocks)).unwrap();
            simulated(&file, &[])
        };
        let mut simulator = Some(place(true));
        let output = folder.path().join("mine.toml");
        // What a machine that does much else keeps up with.
        let base = folder.path().join("base.toml");
        std::fs::write(&base, unknown::BASE.replace("cycle_us = 1000", "cycle_us = 4000")).unwrap();
        let begin = || set_up(&base, Namespace::NEAR, &output, &["--wheel-speed-rad-s", "3", "--realtime"]);
        let (mut process, at) = begin();
        open(&mut page, &at);
        let (mut travel, mut has_left, mut pauses, mut pictures) = (0.0, false, 0, Vec::new());
        let mut picture = |page: &mut Browser, name: &'static str| {
            if !pictures.contains(&name) {
                pictures.push(name);
                page.picture(name);
            }
        };
        let mut looks = 0;
        loop {
            looks += 1;
            assert!(looks < LOOKS, "{}\n{:#?}", seen(&mut page), motions(&output));
            let now = until(&mut page, "something is asked", |seen| {
                ["asked", "hold", "over"].iter().any(|key| !seen[*key].is_null())
            });
            if let Some(over) = now["over"].as_str() {
                if over.contains("is written") {
                    break;
                }
                // A machine that pauses for several cycles: what is done is done, and it is taken up again.
                pauses += 1;
                assert!(pauses < 30, "{over}");
                assert_eq!(process.0.wait().unwrap().code(), Some(1), "{over}");
                let at;
                (process, at) = begin();
                open(&mut page, &at);
                continue;
            }
            if let Some(what) = now["hold"].as_str() {
                let turn = f64::from(robot.counts) * robot.gear;
                let is_jog = what.contains("turns; let go");
                picture(&mut page, if is_jog { "setup-jog" } else { "setup-hold" });
                let went = hold(&mut page, |seen| {
                    let is_far = seen["travel"].as_f64().is_some_and(|travel| travel.abs() >= 0.5 * turn);
                    seen["enabled"] == true && (is_jog && is_far || what.contains("emergency stop"))
                });
                travel = went.unwrap_or(travel);
                // Where nothing moved it still waits.
                page.is_true_within("document.getElementById('holding').hidden", Duration::from_secs(3));
                continue;
            }
            let id = now["asked"].as_str().unwrap().to_owned();
            let (word, position) = id.split_once(' ').unwrap_or((&id, ""));
            let wheel = robot.positions.iter().position(|of| of.to_string() == position).unwrap_or(0);
            let turn = f64::from(robot.counts) * robot.gear;
            let said = match word {
                // What the eyes see of the wheel that this drive really turns; a motion too short is none.
                "wheel" if travel.abs() < 0.1 * turn => "again".to_owned(),
                "wheel" => {
                    picture(&mut page, "setup-wheel");
                    format!("wheel_{}", wheel + 1)
                }
                "way" => {
                    if (travel > 0.0) == robot.backward[wheel] { "backward" } else { "forward" }.to_owned()
                }
                "turns" => format!("{:.2}", travel.abs() / turn),
                "gear" => robot.gear.to_string(),
                "counts" => robot.counts.to_string(),
                "again" => "again".to_owned(),
                "name" if !has_left => {
                    // Left, and taken up again on another page.
                    has_left = true;
                    page.click("#leave");
                    until(&mut page, "it is left", |seen| !seen["over"].is_null());
                    assert_eq!(process.0.wait().unwrap().code(), Some(1));
                    let at;
                    (process, at) = begin();
                    open(&mut page, &at);
                    continue;
                }
                "name" => "position".to_owned(),
                "enable" => "again".to_owned(),
                "brake" => "no".to_owned(),
                "stop" => "go on".to_owned(),
                "stopped" => "no".to_owned(),
                "release" => "done".to_owned(),
                "parameters" => {
                    picture(&mut page, "setup-parameters");
                    "store".to_owned()
                }
                "floor" => {
                    // Put down.
                    drop(simulator.take());
                    simulator = Some(place(false));
                    "drive".to_owned()
                }
                "drive" => "again".to_owned(),
                "went" => "ahead".to_owned(),
                "tape" => {
                    picture(&mut page, "setup-tape");
                    match position {
                        "x ahead" => "1.01",
                        _ => "0",
                    }
                    .to_owned()
                }
                "calibrate" => "go on".to_owned(),
                other => panic!("asked {other}: {now}"),
            };
            answer(&mut page, &said);
        }
        picture(&mut page, "setup-over");
        assert_eq!(process.0.wait().unwrap().code(), Some(0));
        let text = std::fs::read_to_string(&output).unwrap();
        assert_eq!(differences(&robot, &text), Vec::<String>::new(), "{text}");
        let motions = motions(&output);
        assert!(motions.len() >= 10 && motions.iter().all(|(_, _, unheld)| *unheld == 0), "{motions:#?}");
        assert!(motions.iter().any(|(line, ..)| line.starts_with("ahead: driven")), "{motions:#?}");
        let rms_m = drive_square(&robot, &text).unwrap();
        assert!(rms_m < 5e-3, "{rms_m}");
    });
}

/// A drive that kept a fault: the page says so beside its button, which goes on being held, and the drive turns then.
#[test]
fn a_drive_that_kept_a_fault_is_acknowledged_by_the_held_button() {
    let name = "a_drive_that_kept_a_fault_is_acknowledged_by_the_held_button";
    let Some(namespace) = Namespace::for_test(name) else { return };
    namespace.run(|| {
        let Some(mut page) = browser(1000, 800) else { return };
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("mine.toml");
        let base = folder.path().join("base.toml");
        std::fs::write(&base, unknown::BASE.replace("cycle_us = 1000", "cycle_us = 4000")).unwrap();
        let segment = format!("{ROOT}/segments/three-servos.toml");
        let _simulator = simulated(Path::new(&segment), &["--fault", "drive-fault@0:0:0x7300"]);
        let (_process, at) = set_up(&base, Namespace::NEAR, &output, &["--realtime"]);
        open(&mut page, &at);
        let told = "document.body.textContent.includes('whoever holds the button acknowledges that')";
        let turned = (0..LOOKS).any(|_| {
            let now = until(&mut page, "something is asked", |seen| {
                ["asked", "hold", "over"].iter().any(|key| !seen[*key].is_null())
            });
            assert!(now["over"].is_null(), "{now}");
            if now["hold"].is_null() {
                // A machine that pauses ended it.
                answer(&mut page, "again");
                return false;
            }
            assert!(page.is_true_within(told, LONGEST), "{}", seen(&mut page));
            assert_eq!(seen(&mut page)["hold"], now["hold"], "the button stays");
            hold(&mut page, |seen| {
                seen["enabled"] == true && seen["travel"].as_f64().is_some_and(|went| went.abs() > 0.0)
            })
            .is_some_and(|went| went.abs() > 0.0)
        });
        assert!(turned, "{:#?}", motions(&output));
        assert!(page.value(told) == true);
        assert!(motions(&output).iter().all(|(_, _, unheld)| *unheld == 0), "{:#?}", motions(&output));
    });
}

/// However the page falls silent with its button held, the drive loses its torque, and nothing begins anew by itself.
#[test]
fn a_page_that_falls_silent_takes_the_torque_off() {
    let Some(mut page) = browser(1000, 800) else { return };
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("mine.toml");
    let segment = format!("sim:{ROOT}/segments/three-servos.toml");
    let (_process, at) = set_up(Path::new(BMM), &segment, &output, &[]);
    let relay = Relay::start(&at);
    open(&mut page, &relay.at);
    type Loss<'a> = &'a dyn Fn(&mut Browser);
    let lost: [(&str, Loss<'_>); 6] = [
        ("let go", &|page| {
            let place = page.middle("#hold");
            page.mouse("mouseReleased", place);
        }),
        ("the connection is dead", &|_| relay.set(Line::Dead)),
        ("the page hangs", &|page| {
            page.value("void (() => { const begun = performance.now(); while (performance.now() < begun + 3000); })()");
        }),
        ("another window is before it", &|page| {
            page.value("void dispatchEvent(new Event('blur'))");
        }),
        ("the pointer slips off the button", &|page| page.mouse("mouseMoved", [2.0, 2.0])),
        ("the page is loaded again", &|page| open(page, &relay.at)),
    ];
    for (why, lose) in lost {
        let before = motions(&output).len();
        let mut is_lost = false;
        while !is_lost {
            until(&mut page, "a drive waits for its button", |seen| !seen["hold"].is_null());
            let place = page.middle("#hold");
            page.mouse("mousePressed", place);
            // Where the machine is too slow for a page the motion is over before it began.
            let begun = Instant::now();
            let moved = loop {
                let now = seen(&mut page);
                if now["hold"].is_null() || now["unheard"] == true || begun.elapsed() > LONGEST {
                    break false;
                }
                if now["enabled"] == true && now["travel"].as_f64().is_some_and(|travel| travel.abs() > 0.0) {
                    break true;
                }
                std::thread::sleep(Duration::from_millis(20));
            };
            if moved {
                lose(&mut page);
                is_lost = true;
            } else {
                page.mouse("mouseReleased", place);
                until(&mut page, "it is over", |seen| !seen["asked"].is_null());
                answer(&mut page, "again");
            }
        }
        // The record says that it ended, while the connection is still dead and the button still pressed.
        let begun = Instant::now();
        while motions(&output).len() <= before {
            assert!(begun.elapsed() < LONGEST, "{why}: it goes on");
            std::thread::sleep(Duration::from_millis(20));
        }
        let (line, enabled, unheld) = motions(&output).pop().unwrap();
        assert!(line.contains("let go") && enabled > 0 && unheld == 0, "{why}: {line}");
        // A minute would have been the longest.
        assert!(enabled < 30_000, "{why}: {line}");
        relay.set(Line::Passes);
        page.wait("document.getElementById('link').textContent === 'connected'");
        until(&mut page, "what was seen is asked", |seen| !seen["asked"].is_null());
        answer(&mut page, "again");
        // The button is pressed still, as far as the mouse is concerned: it isn't this motion's.
        until(&mut page, "the next one waits", |seen| !seen["hold"].is_null());
        std::thread::sleep(Duration::from_millis(500));
        assert_eq!(seen(&mut page)["enabled"], false, "{why}");
        page.mouse("mouseReleased", [2.0, 2.0]);
    }
    page.picture("setup-waits");
    // What was answered into a line that took nothing is taken once there is one.
    // Pressed for so short that nobody heard of it, the button would be waited for on, for a minute.
    let is_asked = (0..LOOKS).any(|_| {
        hold(&mut page, |seen| seen["enabled"] == true);
        page.is_true_within("document.getElementById('holding').hidden", Duration::from_secs(3));
        !seen(&mut page)["asked"].is_null()
    });
    assert!(is_asked, "{}", seen(&mut page));
    page.value("void (window.send = WebSocket.prototype.send, WebSocket.prototype.send = () => {})");
    let asked = say(&mut page, "again");
    page.value("void (WebSocket.prototype.send = window.send)");
    until(&mut page, "the answer is taken", |seen| seen["asked"].is_null() || seen["number"] != asked);
}

/// A connection on which everything comes late, though nothing is lost, holds no drive: the page says so.
#[test]
fn a_connection_that_is_late_moves_nothing() {
    let Some(mut page) = browser(1000, 800) else { return };
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("mine.toml");
    let segment = format!("sim:{ROOT}/segments/three-servos.toml");
    let (mut process, at) = set_up(Path::new(BMM), &segment, &output, &[]);
    let relay = Relay::start(&at);
    relay.set(Line::Late(Duration::from_millis(300)));
    open(&mut page, &relay.at);
    until(&mut page, "a drive waits for its button", |seen| !seen["hold"].is_null());
    let place = page.middle("#hold");
    page.mouse("mousePressed", place);
    until(&mut page, "late beats are counted", |seen| seen["late"].as_u64() > Some(20));
    page.wait("document.getElementById('held').textContent.includes('ms late): nothing moves')");
    page.picture("setup-late");
    assert_eq!(seen(&mut page)["enabled"], false);
    page.mouse("mouseReleased", place);
    // It would wait for its button for a minute. Who leaves into a line that takes nothing is heard once there is one.
    page.value("void (window.send = WebSocket.prototype.send, WebSocket.prototype.send = () => {})");
    page.click("#leave");
    page.value("void (WebSocket.prototype.send = window.send)");
    until(&mut page, "it is left", |seen| !seen["over"].is_null());
    assert_eq!(process.0.wait().unwrap().code(), Some(1));
    let motions = motions(&output);
    assert!(
        !motions.is_empty() && motions.iter().all(|(_, enabled, unheld)| (*enabled, *unheld) == (0, 0)),
        "{motions:#?}"
    );
}

/// Without the token nobody sees the state of a set-up from elsewhere, holds a button or answers.
#[test]
fn who_has_no_token_holds_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("mine.toml");
    let segment = format!("sim:{ROOT}/segments/three-servos.toml");
    let (_process, at) = set_up(Path::new(BMM), &segment, &output, &[]);
    let refused = |headers: &[(&str, &str)]| {
        let mut request = tungstenite::http::Request::builder()
            .uri(format!("ws://{at}/api/setup/live"))
            .header("Connection", "Upgrade")
            .header("Upgrade", "websocket")
            .header("Sec-WebSocket-Version", "13")
            .header("Sec-WebSocket-Key", tungstenite::handshake::client::generate_key())
            .header("Host", &at);
        for (name, value) in headers {
            request = request.header(*name, *value);
        }
        match tungstenite::connect(request.body(()).unwrap()) {
            Ok(_) => None,
            Err(tungstenite::Error::Http(response)) => Some(response.status().as_u16()),
            Err(error) => panic!("{error}"),
        }
    };
    let bearer = format!("Bearer {TOKEN}");
    assert_eq!(refused(&[]), Some(403));
    assert_eq!(refused(&[("Authorization", "Bearer token-of-somebody-else")]), Some(403));
    assert_eq!(refused(&[("Authorization", &bearer), ("Origin", "http://evil.example")]), Some(403));
    assert_eq!(refused(&[("Authorization", &bearer)]), None);
}
