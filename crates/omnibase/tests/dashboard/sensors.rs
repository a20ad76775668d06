//! Sensors beside the wheels, as the page shows them: believed or why not, and how far their last readings were off of their gates.

use super::robot::Robot;
use super::{browser, opened};

const TRACKED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/bmm_tracked.toml");

/// What the page says of something, in its list of the pose.
fn said(name: &str) -> String {
    format!(
        "[...document.querySelectorAll('#pose dt')].find((one) => one.textContent === '{name}')?.nextSibling.textContent"
    )
}

#[test]
fn each_sensor_is_shown_with_its_verdict_and_its_gate() {
    let robot = Robot::start_file(TRACKED, &[]);
    let Some(mut page) = browser(1600, 1000) else { return };
    page.tamper();
    page.open(&robot.url());
    opened(&mut page);
    let matches = |name: &str, pattern: &str| format!("/{pattern}/.test({})", said(name));
    // The gate of one number is chi² 10.83, that of three 16.27.
    page.wait(&matches("gyro", "^good, \\d\\.\\d of 3\\.3 σ$"));
    page.wait(&matches("mocap", "^good, \\d\\.\\d of 2\\.3 σ$"));
    page.wait(&matches("3 σ", "^\\d+\\.\\d mm, "));
    let columns = robot.read("robot")["columns"].as_array().unwrap().clone();
    let at = |what: &str| columns.iter().position(|name| *name == format!("sensor/gyro_{what}")).unwrap();
    // What the robot says of its sensors is changed on its way to the page.
    for (verdict, nis, shown) in [
        (1, 64.0, "good, left out, 8.0 of 3.3 σ"),
        (1, 10.8, "good, 3.3 of 3.3 σ"),
        (4, 64.0, "contradicts, 8.0 of 3.3 σ"),
        (2, 0.0, "silent, 0.0 of 3.3 σ"),
    ] {
        page.change(&format!(
            "seen.values[{}] = {verdict}; seen.values[{}] = {nis}",
            at("verdict"),
            at("nis")
        ));
        page.wait(&format!("{} === '{shown}'", said("gyro")));
    }
}
