//! A page that falls silent, and a connection that is late: nothing moves.

use super::relay::{Line, Relay};
use super::{
    BMM, LOOKS, ROOT, answer, browser, go_on_with_servos, hold, motions, open, say, seen, set_up, until,
};
use crate::dashboard::browser::{Browser, LONGEST};
use std::path::Path;
use std::time::{Duration, Instant};

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
    go_on_with_servos(&mut page);
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
    open(&mut page, &relay.at);
    go_on_with_servos(&mut page);
    relay.set(Line::Late(Duration::from_millis(300)));
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
