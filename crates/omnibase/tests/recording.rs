//! What the table `recording` and its options make of a run, as a user runs it.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn omnibase(arguments: &[&str]) -> (Option<i32>, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_omnibase"));
    let output = command.args(arguments).current_dir(root()).stdin(Stdio::null()).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

fn done(arguments: &[&str]) -> String {
    let (code, said, error) = omnibase(arguments);
    assert_eq!(code, Some(0), "{arguments:?}: {error}");
    said + &error
}

/// The file of the shipped robot with more in it, in a folder of the test's own.
fn robot(folder: &Path, more: &str) -> String {
    let text = std::fs::read_to_string(root().join("robots/bmm.toml")).unwrap();
    let path = folder.join("robot.toml");
    std::fs::write(&path, format!("{text}\n{more}\n")).unwrap();
    path.to_str().unwrap().to_owned()
}

/// Names and lengths of the files in a folder.
fn files(folder: &Path) -> Vec<(String, u64)> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    let of = |entry: std::fs::DirEntry| {
        (entry.file_name().into_string().unwrap(), entry.metadata().unwrap().len())
    };
    let mut files: Vec<_> = entries.map(of).collect();
    files.sort();
    files
}

const CIRCLE: [&str; 2] = ["--circle", "radius_m=0.2,duration_s=5"];

#[test]
fn chosen_signals_every_10_ms_take_a_twentieth_at_most_and_say_that_they_replay_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let table = "[recording]\nfile = \"runs/bmm-{time}.mcap\"\nevery_ms = 10\n\
                 signals = [\"state.*\", \"wished.*\", \"wheel_*.speed_rad_s\", \"error.*\", \"timing.*\"]";
    let robot = robot(folder.path(), table);
    done(&[&["run", &robot], &CIRCLE[..]].concat());
    let full = folder.path().join("full.mcap");
    let full = full.to_str().unwrap();
    let said = done(&[&["run", "robots/bmm.toml", "--record", full], &CIRCLE[..]].concat());
    assert!(!said.contains("can't be replayed"), "{said}");
    let runs = folder.path().join("runs");
    let [(name, bytes)] = &files(&runs)[..] else { panic!("{:?}", files(&runs)) };
    assert!(name.starts_with("bmm-20") && name.ends_with("Z.mcap"), "{name}");
    let of_full = std::fs::metadata(full).unwrap().len();
    println!("{bytes} of {of_full} bytes: a {:.1}th", of_full as f64 / *bytes as f64);
    assert!(bytes * 20 <= of_full, "{bytes} of {of_full} bytes");
    let chosen = runs.join(name);
    let chosen = chosen.to_str().unwrap();
    let (code, _, error) = omnibase(&["replay", chosen]);
    assert!(code == Some(1) && error.contains("holds only 37 of 212 signals, every 10 ms"), "{error}");
    let page = folder.path().join("run.html");
    let said = done(&["report", chosen, "-o", page.to_str().unwrap()]);
    assert!(said.contains("602 cycles") && said.contains("holds only 37 of 212 signals"), "{said}");
    // Options have the last word.
    let columns = folder.path().join("run.txt");
    let columns = columns.to_str().unwrap();
    let options = ["--columns", columns, "--signals", "state.pose_x_m", "--every", "100cycles"];
    done(&[&["run", &robot], &CIRCLE[..], &options[..]].concat());
    let text = std::fs::read_to_string(columns).unwrap();
    assert_eq!((text.lines().next(), text.lines().count()), (Some("time_s state.pose_x_m"), 62));
    assert_eq!(files(&runs).len(), 1);
    // Everything in every cycle is replayed, however it was asked for.
    let whole = ["--record", full, "--signals", "*", "--every", "1cycle"];
    done(&[&["run", &robot], &CIRCLE[..], &whole[..]].concat());
    assert!(done(&["replay", full]).contains("the same to the bit"));
    done(&[&["run", &robot, "--no-recording"], &CIRCLE[..]].concat());
    assert_eq!(files(&runs).len(), 1);
}

#[test]
fn a_run_in_several_files_keeps_the_latest_each_read_alone() {
    let folder = tempfile::tempdir().unwrap();
    let robot = robot(folder.path(), "[recording]\nfile = \"runs/run.mcap\"\nlimit_mb = 1\nfiles = 2");
    for _ in 0..2 {
        let said = done(&[&["run", &robot, "--json"], &CIRCLE[..]].concat());
        assert!(said.contains("cycles went with the oldest files"), "{said}");
    }
    let runs = folder.path().join("runs");
    let found = files(&runs);
    assert!(found.len() == 2 && found.iter().all(|(_, bytes)| *bytes <= 1_000_000), "{found:?}");
    let page = folder.path().join("run.html");
    let page = page.to_str().unwrap();
    for (name, _) in &found {
        let file = runs.join(name);
        let file = file.to_str().unwrap();
        assert!(done(&["report", file, "-o", page]).contains("the page shows its part alone"));
        let (code, _, error) = omnibase(&["replay", file]);
        assert!(
            code == Some(1) && error.contains("of its run: a run is computed again from its first"),
            "{error}"
        );
    }
    let (code, _, error) = omnibase(&[&["run", &robot, "--report", page], &CIRCLE[..]].concat());
    assert!(code == Some(1) && error.contains("--report shows a run in one file"), "{error}");
    // With all files kept the first one can be computed again.
    let many = folder.path().join("many.mcap");
    done(
        &[&["run", "robots/bmm.toml", "--limit-mb", "2", "--record", many.to_str().unwrap()], &CIRCLE[..]]
            .concat(),
    );
    let first = folder.path().join("many-00001.mcap");
    assert!(done(&["replay", first.to_str().unwrap()]).contains("the same to the bit"));
}

#[test]
fn what_is_wrong_in_the_table_is_said_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    for (table, expected) in [
        (
            "file = \"a/{date}.mcap\"",
            "recording.file = \"a/{date}.mcap\": this is no file's name (allowed: a file, with",
        ),
        ("file = \"\"", "recording.file = \"\": this is no file's name"),
        ("every_ms = 10", "recording.file: must be given: the recording has to be somewhere"),
        (
            "file = \"a\"\nevery_ms = 2.5",
            "recording.every_ms = 2.5: it isn't a whole multiple of the cycle (allowed: 2 or 3)",
        ),
        (
            "file = \"a\"\nevery_ms = 2\nevery_cycles = 2",
            "recording.every_cycles: give `every_ms` or `every_cycles`",
        ),
        ("file = \"a\"\nfiles = 3", "recording.limit_mb: must be given"),
        (
            "file = \"a\"\nsignals = [\"state.*\", \"stat.*\"]",
            "recording.signals[1] = \"stat.*\": no signal has this name; there are",
        ),
        (
            "file = \"a\"\nsignals = [\"state.x\"]",
            "no signal has this name; of this topic there are state.pose_x_m",
        ),
        ("file = \"a\"\nsignals = []", "recording.signals = []: nothing would be recorded"),
        ("file = \"a\"\nformat = \"csv\"", "recording.format = \"csv\": no choice has this name"),
    ] {
        let robot = robot(folder.path(), &format!("[recording]\n{table}"));
        let (code, said, _) = omnibase(&["check", &robot]);
        assert!(code == Some(1) && said.contains(expected), "{table}: {said}");
        assert!(said.contains("robot.toml:5"), "without a place: {said}");
    }
}
