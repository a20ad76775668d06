//! `omnibase calibrate` as a user runs it.

use crate::command_line::{Folder, omnibase, root, words};
use serde_json::Value;
use std::io::Write;
use std::process::{Command, Stdio};

const BMM: &str = "robots/bmm.toml";

fn said(arguments: &[&str]) -> String {
    let output = omnibase(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", words(&output.stderr));
    words(&output.stdout)
}

fn object(arguments: &[&str]) -> Value {
    serde_json::from_str(&said(&[arguments, &["--json"]].concat())).unwrap()
}

#[test]
fn a_recording_with_its_truth_says_what_the_robot_is_like() {
    let folder = Folder::new("calibrate-from");
    let (run, new, page) = (folder.path("run.mcap"), folder.path("found.toml"), folder.path("found.html"));
    // Wheels of 101 mm in a file that says 100 mm: the recording is of the one, the calibration begins from the other.
    let built = ["--set", "platform.wheel_radius_m=0.101", "--record", &run];
    said(&[&["run", BMM, "--path", "robots/square.dat"], &built[..]].concat());
    let from =
        ["calibrate", BMM, "--from", &run, "--truth", "simulator", "--set", "estimator.radius_share=0.01"];
    let told = object(&from);
    for wheel in told["wheels"].as_array().unwrap() {
        let radius_m = wheel["radius_m"].as_f64().unwrap();
        assert!((radius_m - 0.101).abs() < 1e-4, "{wheel}");
    }
    let rms = |which: &str| told["runs"][0][which]["rms_m"].as_f64().unwrap();
    assert!(rms("by_file") > 5e-3 && rms("by_found") < 1e-3, "{}", told["runs"][0]);
    // A square without turns doesn't show the lever arms, and says so.
    let dark = told["not_observed"].as_array().unwrap();
    assert!(dark.contains(&Value::from("wheel_1 place across its force")), "{dark:?}");

    let table = said(&[&from[..], &["--write", &new, "--report", &page]].concat());
    assert!(table.contains("1 run over 21.0 s: 2102 poses"), "{table}");
    assert!(table.contains("wheel_2 place along its force: no motion shows it"), "{table}");
    let html = std::fs::read_to_string(&page).unwrap();
    assert!(html.contains("wheel_1 radius") && html.matches("<svg").count() >= 3, "{}", html.len());
    let text = std::fs::read_to_string(&new).unwrap();
    assert!(
        text.contains("# NOT in the thesis, so measure yours") && text.contains("layout = \"wheels\""),
        "{text}"
    );
    said(&["check", &new]);
    // Once it is there, it is left alone.
    let again = omnibase(&[&from[..], &["--write", &new]].concat());
    assert!(
        words(&again.stderr).contains("is there already: give another name, or --overwrite"),
        "{again:?}"
    );
    assert!(!again.status.success());
    said(&[&from[..], &["--write", &new, "--overwrite"]].concat());
    // The new file begins where the old one was found to be.
    let truer = object(&["calibrate", &new, "--from", &run, "--truth", "simulator", "--seed", "2"]);
    assert!(truer["runs"][0]["by_file"]["rms_m"].as_f64().unwrap() < 2e-3, "{}", truer["runs"][0]);
}

/// A tracker that is elsewhere than its file says and sends no covariance, and a gyro that tells 0.2 % too much.
#[test]
fn what_was_found_of_sensors_stands_in_their_tables_afterwards() {
    let folder = Folder::new("calibrate-sensors");
    let (robot, kept, new) = (folder.path("robot.toml"), folder.path("kept"), folder.path("found.toml"));
    let text = std::fs::read_to_string(crate::command_line::root().join("robots/bmm_tracked.toml")).unwrap();
    let elsewhere = "jitter_ms = 3.0\nposition_error_m = [0.004, -0.003]\nheading_error_rad = 0.02\n";
    std::fs::write(&robot, text.replace("jitter_ms = 3.0", elsewhere)).unwrap();
    let by = ["--truth", "source:tracker", "--gyro", "imu.turn"];
    let drive = ["calibrate", &robot, "--drive", "--recordings", &kept, "--figure", "square", "--side", "1"];
    said(&[&drive[..], &by, &["--write", &new]].concat());
    let text = std::fs::read_to_string(&new).unwrap();
    let file: toml_edit::DocumentMut = text.parse().unwrap();
    let sensors = file["sensor"].as_array_of_tables().unwrap();
    let found = |place: usize, key: &str| sensors.get(place).unwrap()[key].as_float().unwrap();
    assert!((found(0, "scale") - 1.0 / 1.002).abs() < 3e-4, "{text}");
    assert!((found(1, "heading_rad") - 0.02).abs() < 2e-3, "{text}");
    assert!((found(1, "delay_ms") - 20.0).abs() < 1.0, "{text}");
    let position: Vec<f64> = sensors.get(1).unwrap()["position_m"]
        .as_array()
        .unwrap()
        .iter()
        .filter_map(|coordinate| coordinate.as_float())
        .collect();
    assert!((position[0] - 0.104).hypot(position[1] + 0.053) < 1e-3, "{text}");
    // From there on the same recording is as expected: nothing of the sensors is found anew.
    let recording = format!("{kept}/1-square.mcap");
    let again = object(&[&["calibrate", &new, "--from", &recording], &by[..]].concat());
    for unknown in again["unknowns"].as_array().unwrap() {
        let (name, change) = (unknown["name"].as_str().unwrap(), unknown["change"].as_f64().unwrap());
        let bound = if name == "gyro scale" || name == "sensor delay" { 1e-4 } else { 2e-4 };
        assert!(!(name.contains("sensor") || name == "gyro scale") || change.abs() < bound, "{unknown}");
    }
}

#[test]
fn more_rounds_with_a_tape_are_expected_to_show_more() {
    let shown = said(&["calibrate", BMM, "--rounds", "2", "--show"]);
    assert_eq!(shown.matches("turning-left:").count(), 2, "{shown}");
    let direction = |rounds: &str| -> f64 {
        let line = shown.lines().find(|line| line.starts_with(rounds)).unwrap();
        line.split_whitespace().nth(4).unwrap().parse().unwrap()
    };
    let ratio = direction("--rounds 1") / direction("--rounds 4");
    assert!((1.6..2.1).contains(&ratio), "{ratio}: {shown}");
}

#[test]
fn figures_are_shown_before_anything_turns_and_kept_inside_the_fence() {
    let shown = said(&["calibrate", BMM, "--truth", "source:mocap", "--show"]);
    assert!(shown.contains("full: a star") && shown.contains("x from -1.00 to 1.00 m"), "{shown}");
    assert!(shown.contains("not observed") && shown.lines().count() >= 9, "{shown}");
    let folder = Folder::new("calibrate-fence");
    let path = folder.path("fenced.toml");
    let text = std::fs::read_to_string(crate::command_line::root().join(BMM)).unwrap();
    let fence = "\n[fence]\npolygon_m = [[-2, -2], [2, -2], [2, 2], [-2, 2]]\nmargin_m = 0.1\n";
    std::fs::write(&path, text + fence).unwrap();
    let shown = said(&["calibrate", &path, "--truth", "simulator", "--show"]);
    assert!(shown.contains("m to the fence at least"), "{shown}");
    let refused = omnibase(&["calibrate", &path, "--truth", "simulator", "--side", "3.5"]);
    let why = words(&refused.stderr);
    assert!(
        why.contains("m from the fence, expected at least 0.1") && why.contains("give a smaller --side"),
        "{why}"
    );
    assert_eq!(refused.status.code(), Some(1), "{why}");
}

#[test]
fn a_rehearsal_finds_the_robot_that_it_drew() {
    let told = said(&["calibrate", BMM, "--truth", "simulator", "--figure", "square", "--side", "1"]);
    let rows: Vec<&str> =
        told.lines().skip_while(|line| !line.starts_with("the rehearsed robot")).skip(2).collect();
    assert_eq!(rows.len(), 3, "{told}");
    for row in rows {
        let radius: f64 = row.split_whitespace().nth(1).unwrap().parse().unwrap();
        assert!(radius.abs() < 0.1, "{row}");
    }
}

#[test]
fn a_table_of_another_robots_run_is_read() {
    let folder = Folder::new("calibrate-table");
    let (run, exported, table) = (folder.path("run.mcap"), folder.path("run.csv"), folder.path("table.csv"));
    said(&[
        "run",
        BMM,
        "--path",
        "robots/square.dat",
        "--set",
        "platform.wheel_radius_m=0.101",
        "--record",
        &run,
    ]);
    let signals = ["--signals", "wheel_*.increment_rad", "truth.pose_*"];
    said(&[&["export", &run], &signals[..], &["--output", &exported]].concat());
    // Increments are added up to angles; every tenth row has a pose.
    let text = std::fs::read_to_string(&exported).unwrap();
    let names: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let column =
        |part: &str| names.iter().position(|name| name.contains(part)).unwrap_or_else(|| panic!("{names:?}"));
    let (time, wheels) = (column("time"), [1, 2, 3].map(|wheel| column(&format!("wheel_{wheel}"))));
    let pose = ["x_m", "y_m", "heading_rad"].map(|axis| column(&format!("pose_{axis}")));
    let mut angles = [0.0; 3];
    let mut rows =
        "time_s,wheel_1_rad,wheel_2_rad,wheel_3_rad,pose_x_m,pose_y_m,pose_heading_rad\n".to_owned();
    for (number, line) in text.lines().skip(1).enumerate() {
        let cells: Vec<&str> = line.split(',').collect();
        for (angle, column) in angles.iter_mut().zip(wheels) {
            *angle += cells[column].parse::<f64>().unwrap();
        }
        let pose = pose.map(|column| if number % 10 == 0 { cells[column] } else { "" }).join(",");
        rows += &format!("{},{},{},{},{pose}\n", cells[time], angles[0], angles[1], angles[2]);
    }
    std::fs::write(&table, rows).unwrap();
    let told = object(&["calibrate", BMM, "--from", &table, "--set", "estimator.radius_share=0.01"]);
    for wheel in told["wheels"].as_array().unwrap() {
        let radius_m = wheel["radius_m"].as_f64().unwrap();
        assert!((radius_m - 0.101).abs() < 5e-5, "{wheel}");
    }
    std::fs::write(&table, "time_s,wheel_1_rad\n0,0\n").unwrap();
    let wrong = omnibase(&["calibrate", BMM, "--from", &table]);
    assert!(
        words(&wrong.stderr).contains("line 1: no column `wheel_2_rad`, expected the angle of each wheel"),
        "{wrong:?}"
    );
}

#[test]
fn figures_are_driven_as_runs_with_recordings_and_references_that_stay() {
    let folder = Folder::new("calibrate-drive");
    let kept = folder.path("kept");
    let drive = ["calibrate", BMM, "--truth", "simulator", "--figure", "line", "--side", "0.5", "--drive"];
    let told = object(&[&drive[..], &["--recordings", &kept]].concat());
    assert_eq!(told["rehearsed_errors"], Value::Null);
    let radius = &told["unknowns"][4];
    assert!(
        radius["name"] == "wheel_2 radius" && radius["change"].as_f64().unwrap().abs() < 2e-3,
        "{radius}"
    );
    assert!(std::path::Path::new(&kept).join("1-line.mcap").exists());
    // The reference is one that `omnibase run` takes as well, and what is behind `--` is its own.
    let reference = folder.path("kept/1-line.toml");
    said(&["run", BMM, "--reference", &reference]);
    let wrong = omnibase(&[&drive[..], &["--recordings", &kept, "--", "--interfaces", "eth1"]].concat());
    let why = words(&wrong.stderr);
    assert!(why.contains("behind `--`") && why.contains("--interfaces"), "{why}");
    assert_eq!(wrong.status.code(), Some(2), "{why}");
}

/// An empty answer is asked again, and what was measured is told even where nobody answers any more.
#[test]
fn a_tape_is_asked_for_until_it_is_told_and_no_measure_is_lost() {
    let folder = Folder::new("calibrate-tape");
    let kept = folder.path("kept");
    let mut robot = Command::new(env!("CARGO_BIN_EXE_omnibase"))
        .current_dir(root())
        .args(["calibrate", BMM, "--side", "0.5", "--drive", "--recordings", &kept])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let answers = b"\n0 0 0\n\n0.5 0.001 0.1deg\n";
    robot.stdin.take().unwrap().write_all(answers).unwrap();
    let output = robot.wait_with_output().unwrap();
    let said = words(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    let line = "kept/1-out-1.mcap --tape \"0 0 0\" --tape \"0.5 0.001 0.001745";
    assert_eq!(said.matches(line).count(), 2, "once measured, and with the reason why it ends: {said}");
    assert!(said.contains("nobody says where it stands"), "{said}");
}

#[test]
fn mistakes_are_told_with_what_was_expected() {
    let folder = Folder::new("calibrate-wrong");
    let (run, text) = (folder.path("run.mcap"), folder.path("run.txt"));
    said(&["run", BMM, "--circle", "radius_m=0.2,duration_s=5", "--record", &run]);
    std::fs::write(&text, "no recording").unwrap();
    let from = ["calibrate", BMM, "--from", &run];
    for (more, code, why) in [
        (vec!["--truth", "mocap"], 2, "expected source:NAME or simulator, found `mocap`"),
        (
            vec!["--truth", "source:mocap"],
            1,
            "`mocap`: expected a `[[source]]` with carries = \"pose\", found no source",
        ),
        (vec!["--gyro", "imu.turn"], 1, "`imu.turn`: expected an input of a `[[source]]` or a SubDevice"),
        (vec![], 1, "nothing tells where it really was"),
        (
            vec!["--tape", "0 0 0"],
            2,
            "--tape was given 1 times for 1 recordings: expected twice each, before and after",
        ),
        (vec!["--tape", "0 0"], 2, "expected `x y heading` in m, m and rad (or 90deg), found `0 0`"),
        (
            vec!["--truth", "simulator", "--tape-sigma", "1"],
            2,
            "expected two positive numbers, in mm and mrad, found `1`",
        ),
        (vec!["--truth", "simulator", "--set", "platform.layout=omni3"], 1, "platform.centre_distance_m"),
        (vec!["--truth", "simulator", "--from", &text], 1, "run.txt"),
        (vec!["--truth", "simulator", "--side", "2"], 2, "--side"),
    ] {
        let output = omnibase(&[&from[..], &more].concat());
        let said = words(&output.stderr);
        assert!(said.contains(why), "{more:?}: {said}");
        assert_eq!(output.status.code(), Some(code), "{more:?}: {said}");
    }
    // What can be known before a wheel turns is told before.
    let kept = folder.path("kept");
    std::fs::write(folder.path("there.toml"), "").unwrap();
    let there = folder.path("there.toml");
    let line = ["calibrate", BMM, "--figure", "line", "--side", "0.5", "--drive", "--recordings", &kept];
    for (more, why) in [
        (["--truth", "source:mocap"], "`mocap`: expected a `[[source]]`"),
        (["--gyro", "imu.turn"], "`imu.turn`: expected an input"),
        (["--write", &there], "is there already"),
    ] {
        let output = omnibase(&[&line[..], &more].concat());
        let said = words(&output.stderr);
        assert!(output.status.code() == Some(1) && said.contains(why), "{more:?}: {said}");
        assert!(!std::path::Path::new(&kept).exists(), "{more:?}: it was driven");
    }
    let shown = omnibase(&["calibrate", BMM, "--truth", "source:mocap", "--show"]);
    assert!(words(&shown.stderr).contains("--drive needs another robot file: `mocap`"), "{shown:?}");
    // Nobody measured: the reason is said, whether something is written or not.
    let tape = ["--tape", "0 0 0", "--tape", "2 1 1"];
    let unsound = omnibase(&[&from[..], &tape].concat());
    let said = words(&unsound.stderr);
    assert!(
        unsound.status.code() == Some(1) && said.contains("the runs don't fit what was said of them"),
        "{said}"
    );
    let other = omnibase(&["calibrate", "robots/mecanum.toml", "--from", &run, "--truth", "simulator"]);
    assert!(words(&other.stderr).contains("it is of a robot with 3 wheels, expected 4"), "{other:?}");
    let figure = omnibase(&["calibrate", BMM, "--truth", "simulator", "--figure", "circle"]);
    assert!(
        words(&figure.stderr).contains("--figure circle: expected one of line, turns, star, square, full")
    );
}
