//! `omnibase learn` as a user runs it.

use crate::command_line::{Folder, omnibase, words};
use serde_json::Value;

const TRACKED: &str = "robots/bmm_tracked.toml";
const SAME: &str = "estimator.task_frame=odom";
const CIRCLE: [&str; 2] = ["--circle", "radius_m=0.4,duration_s=7"];

fn said(arguments: &[&str]) -> String {
    let output = omnibase(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", words(&output.stderr));
    words(&output.stdout)
}

fn object(arguments: &[&str]) -> Value {
    serde_json::from_str(&said(&[arguments, &["--json"]].concat())).unwrap()
}

fn refused(arguments: &[&str]) -> String {
    let output = omnibase(arguments);
    assert!(!output.status.success(), "{arguments:?}: {}", words(&output.stdout));
    words(&output.stderr)
}

#[test]
fn what_is_learnt_drives_truer_and_is_for_its_motion_alone() {
    let folder = Folder::new("learn-rehearsed");
    let learnt = folder.path("learnt.dat");
    // Down a slope wheels give way, in a task that no sensor leads.
    let wrong = ["--set", "estimator.task_frame=odom", "--set", "simulation.slope_rad=0.03"];
    let motion = [&[TRACKED][..], &CIRCLE, &wrong].concat();
    let told = object(&[&["learn"][..], &motion, &["--repeats", "4", "--write", &learnt]].concat());
    let repeats = told["repeats"].as_array().unwrap();
    assert_eq!(repeats.len(), 4, "{told}");
    let true_mm = |run: &Value| run["rms_error_m"]["true"].as_f64().unwrap() * 1e3;
    let run = |more: &[&str]| object(&[&["run"][..], &motion, more].concat());
    let end_mm = |run: &Value| run["final_error_m"]["true"].as_f64().unwrap() * 1e3;
    let (without, with) = (run(&[]), run(&["--correction", &learnt]));
    assert!(end_mm(&with) < 0.5 * end_mm(&without), "{} {}", end_mm(&with), end_mm(&without));
    assert!(true_mm(&with) < 0.2 * true_mm(&without), "{} {}", true_mm(&with), true_mm(&without));
    // The page tells the same errors, against the motion that was asked for.
    let (recording, page) = (folder.path("run.mcap"), folder.path("run.html"));
    let recorded = run(&["--correction", &learnt, "--record", &recording]);
    said(&["report", &recording, "-o", &page]);
    let html = std::fs::read_to_string(&page).unwrap();
    let shown = format!("{:.3} mm", true_mm(&recorded));
    assert!(html.contains(&shown), "{shown} isn't on the page");
    // Of another motion that takes as long, or of another robot, it helps nobody.
    let run_of = |radius: &str, name: &str| {
        let circle = format!("radius_m={radius},duration_s=7");
        let set = ["--set", name, "--correction", &learnt];
        let output = omnibase(&[&["run", TRACKED, "--circle", &circle][..], &wrong, &set].concat());
        words(&output.stderr)
    };
    for (radius, name, is_own) in
        [("0.4", SAME, true), ("0.3", SAME, false), ("0.4", "name=\"other\"", false)]
    {
        let said = run_of(radius, name);
        assert_eq!(said.contains("was learnt for"), !is_own, "{radius}, {name}: {said}");
    }
    // What is there isn't written over.
    let again = refused(&[&["learn"][..], &motion, &["--write", &learnt]].concat());
    assert!(again.contains("is there already: give --overwrite"), "{again}");
    let longer = [TRACKED, "--circle", "radius_m=0.4,duration_s=8", "--correction", &learnt];
    let words = refused(&[&["run"][..], &longer].concat());
    assert!(words.contains("reference.correction_file"), "{words}");
    assert!(words.contains("it was learnt for a motion of 7 s, this one takes 8 s"), "{words}");
}

#[test]
fn repeats_that_were_driven_are_learnt_from() {
    let folder = Folder::new("learn-driven");
    let recordings = folder.path("repeats");
    let drive = ["learn", TRACKED, "--drive", "--repeats", "2", "--recordings", &recordings];
    let driven = object(&[&drive[..], &CIRCLE, &["--set", "estimator.task_frame=odom"]].concat());
    let rms_mm = |told: &Value, at: usize| told["repeats"][at]["rms_mm"].as_f64().unwrap();
    let names = [1, 2].map(|number| format!("{recordings}/repeat-{number}.mcap"));
    let next = folder.path("next.dat");
    let read = object(&["learn", TRACKED, "--from", &names[0], "--from", &names[1], "--write", &next]);
    for at in 0..2 {
        assert_eq!(rms_mm(&read, at), rms_mm(&driven, at), "{read}");
    }
    let lines = std::fs::read_to_string(&next).unwrap();
    assert!(lines.starts_with("# Learnt: t s") && lines.lines().count() == 71, "{lines}");
    // A motion of another robot's recording can't be read as this one's repeat.
    let circle = folder.path("bmm.mcap");
    said(&[&["run", "robots/bmm.toml", "--record", &circle][..], &CIRCLE].concat());
    let words = refused(&["learn", TRACKED, "--from", &circle]);
    assert!(words.contains("bmm.mcap") && words.contains("nothing tells this robot"), "{words}");
    // Nor one of another motion, whether the command line says which or the first recording; nor another robot's.
    let longer = ["--circle", "radius_m=0.4,duration_s=8", "--from", &names[0]];
    let words = refused(&[&["learn", TRACKED][..], &longer].concat());
    assert!(
        words.contains("repeat-1.mcap") && words.contains("of another motion: of 7 s, expected 8 s"),
        "{words}"
    );
    let square = folder.path("square.mcap");
    said(&["run", TRACKED, "--path", "robots/square.dat", "--record", &square]);
    let words = refused(&["learn", TRACKED, "--from", &names[0], "--from", &square]);
    assert!(
        words.contains("square.mcap") && words.contains("of another motion: of 20 s, expected 7 s"),
        "{words}"
    );
    let words = refused(&["learn", "robots/mecanum.toml", "--from", &names[0]]);
    assert!(words.contains("with 3 wheels, expected") && words.contains("with 4"), "{words}");
}

#[test]
fn what_can_t_be_learnt_is_refused_in_words() {
    let words = refused(&[&["learn", "robots/bmm.toml"][..], &CIRCLE].concat());
    assert!(words.contains("expected a `[[sensor]]` of kind \"pose\""), "{words}");
    let words = refused(&["learn", TRACKED]);
    assert!(words.contains("nothing to repeat: give --path"), "{words}");
    let words = refused(&["learn", TRACKED, "--circle", "radius_m=0.4,period_s=7,turns=endless"]);
    assert!(words.contains("nothing to repeat"), "{words}");
    let words = refused(&["run", TRACKED, "--correction", "nothing.dat"]);
    assert!(words.contains("--correction") && words.contains("required"), "{words}");
}
