//! A robot that will move again by itself is seen and heard.

use super::browser::Browser;
use super::robot::Robot;
use super::{browser, cycles_pass, opened};
use serde_json::json;

const IS: &str = "document.getElementById('banner-is').textContent";
const TONES: &str = "window.tones.length";
/// Counts contexts, and hears tones with the state of theirs, and when each begins by what the page was last told of the time.
const HEAR: &str = "void (() => { window.contexts = 0; const Real = AudioContext; \
    window.AudioContext = class extends Real { constructor() { super(); window.contexts += 1; } }; \
    const real = performance.now.bind(performance); let now_ms = 0; performance.now = () => now_ms = real(); \
    window.tones = []; const start = OscillatorNode.prototype.start; \
    OscillatorNode.prototype.start = function (...at) { \
    window.tones.push({ state: this.context.state, at_ms: now_ms }); start.apply(this, at); }; })()";

/// A page that hears its tones, and that nobody touched yet.
fn untouched(robot: &Robot) -> Option<Browser> {
    let mut page = browser(390, 844)?;
    page.tamper();
    page.open(&robot.url());
    opened(&mut page);
    page.value(HEAR);
    Some(page)
}

fn touch(page: &mut Browser) {
    let name = page.middle("#name");
    page.mouse("mousePressed", name);
    page.mouse("mouseReleased", name);
}

#[test]
fn a_tone_a_second_warns_until_the_robot_moves_and_where_there_is_none_it_is_said() {
    let robot = Robot::start(&[]);
    let Some(mut page) = untouched(&robot) else { return };
    page.change("seen.moves_again_in_s = 2.25");
    let says = "It moves again by itself in 2.3 s: keep away from it, or stop it.";
    page.wait(&format!("{IS} === '{says} No sound: touch this page once.'"));
    assert_eq!(page.value(TONES), json!(0));
    touch(&mut page);
    page.wait(&format!("{IS} === '{says}'"));
    page.wait(&format!("{TONES} >= 4"));
    let heard = page.value("window.tones.every((tone) => tone.state === 'running')");
    assert_eq!(heard, json!(true));
    let pauses = page.value("window.tones.slice(1).map((tone, n) => tone.at_ms - window.tones[n].at_ms)");
    // A page that gets no time is late, and never too early.
    assert!(pauses.as_array().unwrap().iter().all(|ms| ms.as_f64().unwrap() > 999.0), "{pauses}");
    // Somebody ended it.
    page.change("seen.moves_again_in_s = null");
    let tones = page.value(TONES);
    cycles_pass(&robot, 2500, |_| ());
    assert_eq!(page.value(TONES), tones);
    robot.end();
}

#[test]
fn a_line_that_is_lost_ends_no_warning_before_the_robot_moves() {
    let robot = Robot::start(&[]);
    let Some(mut page) = untouched(&robot) else { return };
    touch(&mut page);
    // Some browsers let nobody begin with sounds but who is just touched.
    page.wait("window.contexts === 1");
    page.change("seen.moves_again_in_s = 4");
    page.wait(&format!("{TONES} > 0"));
    page.value("void (window.last_ms = performance.now())");
    page.swallow();
    page.wait("document.getElementById('link').classList.contains('lost')");
    page.wait(&format!("{IS}.includes('It said that it moves again by itself: keep away from it.')"));
    let after = |seconds: u32| format!("performance.now() > window.last_ms + {seconds}000");
    page.wait(&after(7));
    let rang_s = "Math.max(...window.tones.map((tone) => tone.at_ms - window.last_ms)) / 1000";
    let rang_s = page.value(rang_s).as_f64().unwrap();
    assert!((2.0..5.0).contains(&rang_s), "{rang_s}");
    assert_eq!(page.value("window.contexts"), json!(1));
    robot.end();
}
