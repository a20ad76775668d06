//! `omnibase estimate`: the filter on a recording and on a table of text, its errors as `evo` computes them, and what it says of
//! wrong input.

use crate::command_line::{Folder, omnibase, root, words};
use crate::python_tools::{python, successful};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// The version that the test was written with; of numpy any does, as the Python at hand takes it.
const EVO: [&str; 2] = ["evo==1.38.0", "numpy"];

#[test]
fn a_recording_is_estimated_with_and_without_poses() {
    let folder = Folder::new("estimate");
    let (run, tum) = (folder.path("run.mcap"), folder.path("tum"));
    let recorded = omnibase(&["run", "robots/bmm.toml", "--path", "robots/square.dat", "--record", &run]);
    assert!(recorded.status.success(), "{}", words(&recorded.stderr));
    let told = |more: &[&str]| -> Value {
        let of =
            ["estimate", "robots/bmm.toml", &run, "--truth", "simulator", "--gyro", "simulator", "--json"];
        let output = omnibase(&[&of, more].concat());
        assert!(output.status.success(), "{}", words(&output.stderr));
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let absolute_mm = |told: &Value, of: &str| 1e3 * told[of]["absolute_m"].as_f64().unwrap();
    let alone = told(&["--tum", &tum]);
    // The truth has no noise.
    assert!((7.95..8.05).contains(&alone["way_m"].as_f64().unwrap()) && alone["jumps"] == 0, "{alone}");
    assert!(alone["wheels"]["relative_rad"].as_f64().unwrap() < 1e-3, "{alone}");
    assert_eq!(alone["sensors"]["gyro"], "good");
    // Poses tell to a millimetre where it is, and are themselves what it is compared with.
    let with_poses = told(&["--poses", "5"]);
    assert_eq!(with_poses["sensors"]["poses"], "good");
    let (wheels, fused) = (absolute_mm(&with_poses, "wheels"), absolute_mm(&with_poses, "fused"));
    assert!(fused < 2.0 && fused <= wheels, "{fused} of {wheels}");
    for name in ["truth", "wheels", "fused"] {
        let text = std::fs::read_to_string(format!("{tum}/{name}.tum")).unwrap();
        assert!(text.lines().count() > 1000 && text.lines().all(|line| line.split(' ').count() == 8));
    }
}

/// Files of text hold nanometres; evo takes the mean of what it read.
#[test]
fn errors_are_those_that_evo_computes() {
    let Some(python) = python("python-evo", &EVO, "import evo.core.metrics") else { return };
    let folder = Folder::new("against-evo");
    let (run, tum) = (folder.path("run.mcap"), folder.path("tum"));
    let recorded =
        omnibase(&["run", "robots/bmm_tracked.toml", "--path", "robots/square.dat", "--record", &run]);
    assert!(recorded.status.success(), "{}", words(&recorded.stderr));
    let of = ["estimate", "robots/bmm_tracked.toml", &run, "--truth", "source:tracker", "--poses", "20"];
    let output = omnibase(&[&of[..], &["--json", "--tum", &tum]].concat());
    assert!(output.status.success(), "{}", words(&output.stderr));
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/trajectory_errors.py");
    // It keeps settings in its home.
    let evo = successful(Command::new(&python).env("HOME", folder.path("")).arg(script).arg(&tum));
    let evo: Value = serde_json::from_slice(&evo.unwrap()).unwrap();
    println!("{told}, evo {evo}");
    assert_eq!(told["poses"], evo["fused"]["poses"]);
    for trajectory in ["wheels", "fused"] {
        for error in ["absolute_m", "relative_m", "relative_rad"] {
            let [ours, theirs] = [&told, &evo].map(|all| all[trajectory][error].as_f64().expect("a number"));
            assert!((ours - theirs).abs() < 1e-8, "{trajectory}, {error}: {ours}, {theirs}");
            assert!(theirs > 1e-3, "{trajectory}, {error}: {theirs} is an error");
        }
    }
}

#[test]
fn a_table_of_anybody_is_taken_and_what_it_lacks_is_said() {
    let folder = Folder::new("estimate-table");
    let table = folder.path("run.csv");
    // Straight ahead at 0.5 m/s, by wheels that are 1 % too large, seen by a camera.
    let mut text =
        String::from("time_s,wheel_1_rad,wheel_2_rad,wheel_3_rad,pose_x_m,pose_y_m,pose_heading_rad\n");
    for n in 0..=500 {
        let (time_s, x_m) = (0.01 * f64::from(n), 0.005 * f64::from(n));
        let turned = 1.01 * x_m / 0.1 * 3.0_f64.sqrt() / 2.0;
        text += &format!("{time_s},0,{},{turned},{x_m},0,0\n", -turned);
    }
    std::fs::write(&table, &text).unwrap();
    let output = omnibase(&["estimate", "robots/bmm.toml", &table, "--poses", "1", "--json"]);
    assert!(output.status.success(), "{}", words(&output.stderr));
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(told["fused"]["absolute_m"].as_f64() < told["wheels"]["absolute_m"].as_f64(), "{told}");
    let relative_m = told["wheels"]["relative_m"].as_f64().unwrap();
    // Over a metre as it is believed, which is 1 % too long.
    assert!((relative_m - 0.01 / 1.01).abs() < 1e-4, "{told}");
    // Wheels that are read each 40 ms, seen 20 ms in between by a sensor that is 10 cm to the left.
    let robot = folder.path("robot.toml");
    let sensor = "\n[estimator]\nkind = \"fused\"\n[[source]]\nname = \"tracker\"\ncarries = \"pose\"\n[[sensor]]\nname = \"mocap\"\n\
                  kind = \"pose\"\nfrom = \"tracker\"\nposition_m = [0.0, 0.1]\ndelay_ms = 20\n";
    std::fs::write(&robot, std::fs::read_to_string(root().join("robots/bmm.toml")).unwrap() + sensor)
        .unwrap();
    let mut seldom =
        String::from("time_s,wheel_1_rad,wheel_2_rad,wheel_3_rad,pose_x_m,pose_y_m,pose_heading_rad\n");
    for n in 0..=200 {
        let time_s = 0.04 * f64::from(n);
        // Straight ahead, then round about itself.
        let (x_m, heading) = (0.5 * time_s.min(4.0), 0.5 * (time_s - 4.0).max(0.0));
        let (seen_x_m, seen_heading) =
            (0.5 * (time_s - 0.02).clamp(0.0, 4.0), 0.5 * (time_s - 4.02).max(0.0));
        let (ahead, turned) = (x_m / 0.1 * 3.0_f64.sqrt() / 2.0, -heading * 0.4 / 0.1);
        let (sin, cos) = seen_heading.sin_cos();
        seldom += &format!(
            "{time_s:.3},{},{},{},{},{},{seen_heading}\n",
            0.95 * turned,
            turned - ahead,
            turned + ahead,
            seen_x_m - 0.1 * sin,
            0.1 * cos
        );
    }
    std::fs::write(&table, &seldom).unwrap();
    let output = omnibase(&["estimate", &robot, &table, "--json"]);
    assert!(output.status.success(), "{}", words(&output.stderr));
    let told: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(told["wheels"]["absolute_m"].as_f64().unwrap() < 2e-3, "{told}");
    // One pose is a metre off; a wheel is wrapped.
    let estimated = |text: &str| {
        std::fs::write(&table, text).unwrap();
        let output = omnibase(&["estimate", "robots/bmm.toml", &table]);
        (words(&output.stdout), words(&output.stderr))
    };
    let (said, warned) = estimated(&text.replace(",1.5,0,0\n", ",2.5,0,0\n"));
    assert!(
        said.contains("501 poses over 2.52 m\n") && said.contains("1 of the poses jumps; without:"),
        "{said}"
    );
    assert!(said.contains("gyro: not read") && !warned.contains("turned at"), "{said}{warned}");
    let (_, warned) = estimated(&text.replace("\n3,0,", "\n3,6.3,"));
    assert!(warned.contains("line 302, wheel_1_rad: it turned at 630 rad/s"), "{warned}");
    for (wrong, told) in [
        // Time that runs back, time in ms, a pose beyond the Moon.
        (text.replace("\n3,", "\n2,"), "its instant 2 s isn't later than 2.99 s"),
        (text.replace("\n5,", "\n5000,"), "expected at most 60 s: instants are in s"),
        (text.replace(",1.5,0,0\n", ",1e300,0,0\n"), "expected a number of at most 1e12 in size"),
    ] {
        std::fs::write(&table, wrong).unwrap();
        let output = omnibase(&["estimate", "robots/bmm.toml", &table]);
        let said = words(&output.stderr);
        assert!(output.status.code() == Some(1) && said.contains(told), "{told}: {said}");
    }
    std::fs::write(&table, text.replace("pose_x_m,pose_y_m,pose_heading_rad", "a,b,c")).unwrap();
    let output = omnibase(&["estimate", "robots/bmm.toml", &table]);
    assert!(!output.status.success() && words(&output.stderr).contains("has no poses to compare with"));
    assert!(root().join("robots/bmm.toml").is_file());
}
