//! `omnibase report` and `omnibase run --report` as a user runs them.

use crate::command_line::{Folder, omnibase, root, words};
use std::io::Write;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

impl Folder {
    /// Names of what is in it.
    fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.0).unwrap();
        let mut names: Vec<_> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

/// A short run: a circle of 0.2 m in 5 s.
fn circle(further: &[&str]) -> Output {
    omnibase(&[&["run", "robots/bmm.toml", "--circle", "radius_m=0.2,duration_s=5"], further].concat())
}

/// A run of some 30,000 cycles whose page something happens to once cycles are in its recording.
fn circle_disturbed(folder: &Folder, recording: &str, further: &[&str], disturb: impl FnOnce()) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_omnibase"));
    command.args(["run", "robots/bmm.toml", "--circle", "radius_m=0.2,duration_s=30", "--json"]);
    command
        .args(["--report", &folder.path("run.html")])
        .args(further)
        .current_dir(root())
        .stdin(Stdio::null());
    let mut run = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let began = Instant::now();
    while std::fs::metadata(recording).map_or(true, |file| file.len() < 100_000) {
        assert!(began.elapsed() < Duration::from_secs(60), "nothing is recorded");
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(run.try_wait().unwrap().is_none(), "it is under way");
    disturb();
    run.wait_with_output().unwrap()
}

/// What a run says whose page could not be written: its summary is there all the same.
fn told_without_page(output: &Output) -> (serde_json::Value, String) {
    let says = words(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{says}");
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(
        (&summary["records_dropped"], summary["records_written"] == summary["cycles"]),
        (&0.into(), true)
    );
    assert!(summary["final_error_m"]["true"].as_f64().unwrap() < 1e-3, "it went to its end: {summary}");
    (summary, says)
}

/// How many cycles of a recording are computed again to the same bits.
fn replayed(recording: &str) -> serde_json::Value {
    let output = omnibase(&["replay", recording, "--json"]);
    assert!(output.status.success(), "{}", words(&output.stderr));
    serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap()["cycles"].take()
}

/// The exact values in a row of the page's figures.
fn figures(page: &str, row: &str) -> Vec<f64> {
    let row = page.split(&format!("<th>{row}</th>")).nth(1).expect("the row").split("</tr>").next().unwrap();
    let values =
        row.split("<data value=\"").skip(1).map(|rest| rest.split('"').next().unwrap().parse().unwrap());
    values.collect()
}

#[test]
fn the_page_of_a_run_has_the_figures_of_its_summary() {
    let folder = Folder::new("report-figures");
    let (recording, page) = (folder.path("run.mcap"), folder.path("run.html"));
    let output = circle(&["--json", "--record", &recording, "--report", &page]);
    assert!(output.status.success(), "{}", words(&output.stderr));
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let html = std::fs::read_to_string(&page).unwrap();
    for (row, key) in [
        ("Final position", "final_error_m"),
        ("RMS position", "rms_error_m"),
        ("Greatest position", "max_error_m"),
    ] {
        let told = ["believed", "true"].map(|whose| summary[key][whose].as_f64().unwrap());
        for (shown, told) in figures(&html, row).into_iter().zip(told) {
            // The same sums in the same order, through a file that keeps every bit.
            assert!((shown - told).abs() <= 1e-15, "{row}: {shown} for {told}");
            assert!(told > 0.0);
        }
    }
    let heading = figures(&html, "Final heading")[1];
    // The JSON reader is off by a last bit at times.
    assert!((heading - summary["final_heading_error_rad"].as_f64().unwrap()).abs() <= 1e-15, "{heading}");

    let again = folder.path("again.html");
    let output = omnibase(&["report", &recording, "-o", &again]);
    assert!(output.status.success(), "{}", words(&output.stderr));
    assert_eq!(std::fs::read_to_string(&again).unwrap(), html, "one recording, one page");
}

/// The circle, seen by whoever says so on the standard input.
fn circle_measured(further: &[&str], said: &str) -> Output {
    let robot = root().join("robots/bmm.toml");
    let mut run = Command::new(env!("CARGO_BIN_EXE_omnibase"))
        .args(["run", robot.to_str().unwrap(), "--circle", "radius_m=0.3,duration_s=6"])
        .args(further)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    run.stdin.take().unwrap().write_all(said.as_bytes()).unwrap();
    run.wait_with_output().unwrap()
}

#[test]
fn what_was_measured_on_the_floor_stands_beside_what_was_wished_and_believed() {
    let folder = Folder::new("report-measured");
    let [page, again, recording] = ["run.html", "again.html", "run.mcap"].map(|name| folder.path(name));
    // A word that is no pose is asked for again.
    let output = circle_measured(
        &["--measured", "--json", "--report", &page, "--record", &recording],
        "here\n0.003 -0.004 90deg\n",
    );
    assert!(output.status.success(), "{}", words(&output.stderr));
    assert!(words(&output.stderr).contains("expected `x y heading`"), "{}", words(&output.stderr));
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let off = |whose: &str, key: &str| summary["measured"][whose][key].as_f64().unwrap();
    // The circle ends where it began.
    let wished = off("from_wished", "distance_m");
    assert!((wished - 5e-3).abs() < 1e-9, "{summary}");
    assert!((off("from_wished", "heading_rad").to_degrees() - 90.0).abs() < 1e-6, "{summary}");
    let believed = off("from_believed", "distance_m");
    assert!((believed - 5e-3).abs() < 1e-4 && believed != 5e-3, "{summary}");
    let html = std::fs::read_to_string(&page).unwrap();
    // The JSON reader is off by a last bit at times.
    assert!((figures(&html, "from the wished end")[2] - wished).abs() < 1e-15);
    assert!((figures(&html, "from the believed")[2] - believed).abs() < 1e-15);
    // And afterwards, of the recording: what was told last counts.
    let told = omnibase(&["report", &recording, "-o", &again, "--measured", "-0.3 0.4 0"]);
    assert!(told.status.success(), "{}", words(&told.stderr));
    let html = std::fs::read_to_string(&again).unwrap();
    assert!((figures(&html, "from the wished end")[2] - 0.5).abs() < 1e-9);
    // Nobody measured: nothing of it; a person without words: an empty line.
    assert!(!words(&circle_measured(&["--measured"], "\n").stdout).contains("measured"));
    let refused = omnibase(&["report", &recording, "-o", &again, "--measured", "0.1 0.2"]);
    assert!(words(&refused.stderr).contains("found `0.1 0.2`"), "{}", words(&refused.stderr));
}

#[test]
fn a_page_without_a_recording_leaves_none_behind() {
    let folder = Folder::new("report-alone");
    let page = folder.path("run.html");
    assert!(circle(&["--report", &page]).status.success());
    assert_eq!(folder.names(), ["run.html"]);
}

#[test]
fn a_run_that_never_began_leaves_nothing_behind_and_a_page_without_a_folder_is_refused_first() {
    let folder = Folder::new("report-never");
    let page = folder.path("run.html");
    let output = circle(&["--report", &page, "--interface", "no-such-nic"]);
    assert_eq!(output.status.code(), Some(1));
    assert_eq!(folder.names(), [""; 0]);
    let page = folder.path("missing/run.html");
    let output = circle(&["--report", &page]);
    let says = words(&output.stderr);
    assert!(output.status.code() == Some(1) && says.contains("there is no folder"), "{says}");
    assert!(output.stdout.is_empty(), "nothing ran");
}

#[test]
fn a_page_in_whose_place_a_folder_stands_is_refused_before_anything_moves() {
    let folder = Folder::new("report-folder");
    let page = folder.path("page");
    std::fs::create_dir(&page).unwrap();
    let output = circle(&["--report", &page]);
    let says = words(&output.stderr);
    assert!(output.status.code() == Some(1) && says.contains("expected a regular file"), "{says}");
    assert!(output.stdout.is_empty(), "nothing ran");
    assert_eq!(folder.names(), ["page"]);
}

#[test]
fn a_page_that_cannot_be_written_at_the_end_is_told_and_nothing_else_is_lost() {
    // A disk that is full, a folder in its place, and none to lie in.
    type Disturb = fn(&str);
    let disturbances: [(&str, Disturb, &str); 3] = [
        ("full", |page| std::os::unix::fs::symlink("/dev/full", page).unwrap(), "No space left on device"),
        ("replaced", |page| std::fs::create_dir(page).unwrap(), "Is a directory"),
        (
            "removed",
            |page| std::fs::remove_dir(Path::new(page).parent().unwrap()).unwrap(),
            "No such file or directory",
        ),
    ];
    for (name, disturb, why) in disturbances {
        let (folder, kept) = (Folder::new(&format!("end-{name}")), Folder::new(&format!("end-{name}-kept")));
        let (page, recording) = (folder.path("run.html"), kept.path("run.mcap"));
        let output = circle_disturbed(&folder, &recording, &["--record", &recording], || disturb(&page));
        let (summary, says) = told_without_page(&output);
        let stays = format!("error: the page can't be written, the recording stays in `{recording}`: ");
        assert!(says.contains(&format!("{stays}writing `{page}`: {why}")), "{says}");
        assert_eq!(replayed(&recording), summary["cycles"], "{name}");
    }
}

#[test]
fn the_recording_of_a_page_that_cannot_be_written_stays_where_it_was_not_asked_for() {
    let folder = Folder::new("report-end-spare");
    let (page, recording) = (folder.path("run.html"), folder.path("run.html.mcap"));
    let output = circle_disturbed(&folder, &recording, &[], || std::fs::create_dir(&page).unwrap());
    let (summary, says) = told_without_page(&output);
    assert!(says.contains(&format!("the recording stays in `{recording}`: writing `{page}`: ")), "{says}");
    assert_eq!(replayed(&recording), summary["cycles"]);
}

#[test]
fn where_recording_and_page_are_gone_both_are_told() {
    let folder = Folder::new("report-end-gone");
    let recording = folder.path("run.html.mcap");
    let output = circle_disturbed(&folder, &recording, &[], || std::fs::remove_dir_all(&folder.0).unwrap());
    let says = words(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{says}");
    let summary: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(summary["records_written"], 0, "none can be read again");
    let gone = format!("the recording was in `{recording}`: reading `{recording}`: No such file");
    let at = |words: &str| says.find(words).unwrap_or_else(|| panic!("{words}: {says}"));
    assert!(at("error: the recording ended early: ") < at(&gone), "{says}");
}

#[test]
fn a_recording_that_was_cut_off_is_shown_as_far_as_it_goes() {
    let folder = Folder::new("report-cut");
    let (recording, page) = (folder.path("run.mcap"), folder.path("run.html"));
    assert!(circle(&["--record", &recording]).status.success());
    let whole = std::fs::read(&recording).unwrap();
    std::fs::write(&recording, &whole[..whole.len() / 2]).unwrap();
    let output = omnibase(&["report", &recording, "-o", &page]);
    assert_eq!(output.status.code(), Some(1));
    assert!(words(&output.stderr).contains("warning: ") && words(&output.stderr).contains("ends early"));
    // Who wants errors alone isn't warned; the exit code says it.
    let output = omnibase(&["--log-level", "error", "report", &recording, "-o", &page]);
    assert_eq!((output.status.code(), words(&output.stderr).as_str()), (Some(1), ""));
    let html = std::fs::read_to_string(&page).unwrap();
    assert!(html.contains("The recording ends early") && html.contains("<h2>Wheels</h2>"));
}

#[test]
fn what_is_no_recording_is_refused_in_words() {
    let folder = Folder::new("report-wrong");
    let page = folder.path("run.html");
    std::fs::write(folder.path("text"), "no recording, but long enough to be looked at").unwrap();
    for (recording, why) in [
        (folder.path("none.mcap"), "No such file"),
        (folder.path("text"), "not MCAP: the file starts with 6e 6f"),
    ] {
        let output = omnibase(&["report", &recording, "-o", &page]);
        let says = words(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{says}");
        assert!(says.contains(&recording) && says.contains(why), "{says}");
        assert!(!Path::new(&page).exists());
    }
    let output = omnibase(&["report", &folder.path("text")]);
    assert_eq!(output.status.code(), Some(2), "the page has no default name");
}

#[test]
fn the_page_of_a_run_shows_what_binds_its_planned_motion() {
    let folder = Folder::new("report-planned");
    let page = folder.path("run.html");
    let ran = omnibase(&[
        "run",
        "robots/bmm.toml",
        "--circle",
        "radius_m=0.2",
        "--timing",
        "fastest",
        "--report",
        &page,
    ]);
    assert!(ran.status.success(), "{}", words(&ran.stderr));
    let html = std::fs::read_to_string(&page).unwrap();
    let (_, planned) = html.split_once("<section id=\"planned\">").expect("a section of the planned motion");
    let (planned, _) = planned.split_once("</section>").unwrap();
    // On a small circle the acceleration binds; its speed is drawn in that limit's colour.
    assert!(planned.contains(">acceleration</text>") && planned.contains("#c4501b"), "{planned}");
}
