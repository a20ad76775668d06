//! The page draws and writes what changed: who drives by a weak computer needs its time for the stick.

use super::robot::Robot;
use super::{browser, opened};
use serde_json::json;

/// Counts pictures of the view, and remembers who was given the text that it had.
const WATCH: &str = "(() => { const view = document.getElementById('view').getContext('2d'), clear = view.clearRect; \
    window.pictures = 0; window.again = []; window.since_ms = performance.now(); \
    view.clearRect = (...area) => { window.pictures += 1; clear.apply(view, area); }; \
    const text = (nodes) => [...nodes].map((node) => node.textContent).join(''); \
    new MutationObserver((all) => { for (const { target, addedNodes, removedNodes } of all) \
      if (removedNodes.length && text(addedNodes) === text(removedNodes)) window.again.push(target.id || target.className); \
    }).observe(document.body, { subtree: true, childList: true }); })()";

#[test]
fn what_stands_still_is_neither_drawn_with_every_message_nor_written_again() {
    let Some(mut page) = browser(1400, 1000) else { return };
    let robot = Robot::start(&[]);
    page.tamper();
    page.open(&robot.url());
    opened(&mut page);
    page.value(WATCH);
    page.change("");
    page.wait("window.changed > 100");
    let seen = page.value("[window.pictures, (performance.now() - window.since_ms) / 100, window.again]");
    // Ten times a second at most, by the page's own clock; the robot said thirty times what it sees.
    let [drawn, most] = [0, 1].map(|n| seen[n].as_f64().unwrap());
    assert!((1.0..most + 2.0).contains(&drawn), "{seen}");
    assert_eq!(seen[2], json!([]), "written again");
    robot.end();
}
