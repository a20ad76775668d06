//! A robot whose wiring nobody knows is set up on the page from its first jog to its first metre.

use super::unknown::{self, Unknown, differences, drive_square};
use super::{LOOKS, answer, browser, hold, motions, open, seen, set_up, simulated, until};
use crate::dashboard::browser::Browser;
use omnibase_host::Namespace;
use std::time::Duration;

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
                hold(&mut page, |seen| {
                    let is_far = seen["travel"].as_f64().is_some_and(|travel| travel.abs() >= 0.5 * turn);
                    seen["enabled"] == true && (is_jog && is_far || what.contains("emergency stop"))
                });
                // Where nothing moved it still waits.
                let is_over = format!("holding.hidden || what.textContent !== {what:?}");
                page.is_true_within(&is_over, Duration::from_secs(3));
                continue;
            }
            // It rolls on when the key is let go.
            travel = now["travel"].as_f64().unwrap_or(travel);
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
                "differs" => "another gear or encoder".to_owned(),
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
        // Taken up again, what was gone on without is offered, and all else is shown as it is.
        let (mut again, at) = begin();
        open(&mut page, &at);
        until(&mut page, "the stop is offered", |seen| seen["asked"] == "passed stop");
        let steps = "[...document.querySelectorAll('#steps li')].map((step) => step.className).join(' ')";
        assert_eq!(page.value(steps), "done done done done done now done done done passed");
        page.click("#leave");
        until(&mut page, "it is left", |seen| !seen["over"].is_null());
        assert_eq!(again.0.wait().unwrap().code(), Some(1));
        let text = std::fs::read_to_string(&output).unwrap();
        assert_eq!(differences(&robot, &text), Vec::<String>::new(), "{text}");
        let motions = motions(&output);
        assert!(motions.len() >= 10 && motions.iter().all(|(_, _, unheld)| *unheld == 0), "{motions:#?}");
        assert!(motions.iter().any(|(line, ..)| line.starts_with("ahead: driven")), "{motions:#?}");
        let rms_m = drive_square(&robot, &text).unwrap();
        assert!(rms_m < 5e-3, "{rms_m}");
    });
}
