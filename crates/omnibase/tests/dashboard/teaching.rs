//! Paths that are taught in the page, and repeated.

use super::browser::Browser;
use super::robot::Robot;
use super::{DONE, Stick, browser, cycles_pass, drive, opened, press, until};

/// No teaching is under way: another press would begin the next one.
const ENDED: &str = "!document.getElementById('teach').textContent.startsWith('End')";

/// Whether a motion that is asked for ends at this x: one whose page got no time for a while is stopped, as it shall be.
fn goes(page: &mut Browser, robot: &Robot, how: &str, [x_m, within_m]: [f64; 2]) -> bool {
    press(page, how, DONE);
    cycles_pass(robot, 100, |_| ());
    robot.wait("it rests", |robot| robot.read("now")["phase"] == "holding");
    (robot.value("state/pose_x_m") - x_m).abs() < within_m
}

fn go_back(page: &mut Browser, robot: &Robot) {
    until(page, "it is back", |page| goes(page, robot, "[data-do=go_to_start]", [0.0, 0.01]));
}

#[test]
fn a_path_is_driven_by_hand_taught_and_repeated_in_the_page() {
    let Some(mut page) = browser(390, 844) else { return };
    let robot = Robot::start(&[]);
    page.open(&robot.url());
    opened(&mut page);
    press(&mut page, "[data-do=enable]", "document.getElementById('phase').textContent === 'holding'");
    page.picture("phone");
    press(&mut page, "#teach", "document.getElementById('teach').textContent.startsWith('End')");
    let stick = page.middle("#stick");
    let held = Stick {
        hold: &|page| {
            page.mouse("mousePressed", stick);
            page.mouse("mouseMoved", [stick[0] - 30.0, stick[1] - 50.0]);
        },
        let_go: &|page| page.mouse("mouseReleased", stick),
    };
    while robot.value("state/pose_x_m") < 0.3 {
        if robot.speed_m_s() < 0.2 {
            drive(&mut page, &robot, &held);
        }
        cycles_pass(&robot, 20, |_| ());
    }
    page.picture("phone-driving");
    page.mouse("mouseReleased", stick);
    robot.wait("it rests", |robot| robot.read("now")["phase"] == "holding" && robot.speed_m_s() < 1e-3);
    let end_m = robot.value("state/pose_x_m");
    press(&mut page, "#teach", ENDED);
    // Away from its start the path is refused, with a word.
    press(
        &mut page,
        "[data-do=track]",
        "document.getElementById('said').textContent.includes('too far from the path')",
    );
    go_back(&mut page, &robot);
    until(&mut page, "it repeats", |page| {
        let repeats = goes(page, &robot, "[data-do=track]", [end_m, 0.002]);
        if !repeats {
            go_back(page, &robot);
        }
        repeats
    });
    page.picture("phone-repeated");
    assert!(
        robot.folder.path().join("path-1.toml").is_file() && robot.folder.path().join("path-1.dat").is_file()
    );
    // Single points: here, and back where it began.
    page.value("void (document.getElementById('teach-by').value = 'points')");
    press(&mut page, "#teach", "!document.getElementById('teach-point').hidden");
    press(
        &mut page,
        "#teach-point",
        "document.getElementById('teach').textContent === 'End and save (1 point)'",
    );
    page.picture("phone-points");
    go_back(&mut page, &robot);
    press(
        &mut page,
        "#teach-point",
        "document.getElementById('teach').textContent === 'End and save (2 points)'",
    );
    press(&mut page, "#teach", ENDED);
    page.wait("document.getElementById('teach-point').hidden");
    robot.wait("two points are saved", |robot| {
        let points = std::fs::read_to_string(robot.folder.path().join("path-1.dat")).unwrap();
        points.lines().filter(|line| !line.starts_with('#')).count() == 2
    });
    robot.end();
}
