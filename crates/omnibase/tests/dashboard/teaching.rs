//! Paths that are taught in the page, and repeated.

use super::robot::Robot;
use super::{DONE, Stick, browser, cycles_pass, drive, opened, press};

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
    press(&mut page, "#teach", "document.getElementById('said').textContent.startsWith('taught')");
    // Away from its start the path is refused, with a word.
    press(
        &mut page,
        "[data-do=track]",
        "document.getElementById('said').textContent.includes('too far from the path')",
    );
    press(&mut page, "[data-do=go_to_start]", DONE);
    robot.wait("it is back", |robot| {
        robot.read("now")["phase"] == "holding" && robot.value("state/pose_x_m").abs() < 0.01
    });
    press(&mut page, "[data-do=track]", DONE);
    robot.wait("it repeats", |robot| {
        robot.read("now")["phase"] == "holding" && (robot.value("state/pose_x_m") - end_m).abs() < 0.002
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
    press(&mut page, "[data-do=go_to_start]", DONE);
    robot.wait("it is back", |robot| {
        robot.read("now")["phase"] == "holding" && robot.value("state/pose_x_m").abs() < 0.01
    });
    press(
        &mut page,
        "#teach-point",
        "document.getElementById('teach').textContent === 'End and save (2 points)'",
    );
    press(&mut page, "#teach", "document.getElementById('said').textContent.startsWith('taught 2 points')");
    page.wait("document.getElementById('teach-point').hidden");
    robot.end();
}
