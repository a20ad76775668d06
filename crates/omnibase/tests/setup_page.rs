//! A person before the page sets a robot up: the real program, its page in headless Chromium, a button that is held.
//!
//! Nothing here depends on how fast the machine is: what must not happen is looked for in the program's own record, and what must
//! happen is waited for.

mod access;
mod another_program;
mod broken_off;
mod kept_fault;
mod relay;
mod silence;
#[path = "../../setup/examples/seeds/unknown/mod.rs"]
#[allow(dead_code, reason = "the set-up's own tests have the other half")]
mod unknown;
mod unknown_robot;

use crate::dashboard::browser::{Browser, LONGEST};
use omnibase_host::Namespace;
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

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

/// Goes on with servos that are another product than the file has; the next motion waits then.
fn go_on_with_servos(page: &mut Browser) {
    until(page, "the products are asked", |seen| seen["asked"] == "products");
    answer(page, "go on");
    until(page, "a drive waits for its button", |seen| !seen["hold"].is_null());
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
        omnibase_host::skipped("Chromium isn't installed: the set-up's page was not tried");
    }
    browser
}
