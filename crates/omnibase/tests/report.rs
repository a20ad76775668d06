//! `omnibase report` and `omnibase run --report` as a user runs them.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// A folder of the test's own that vanishes with it.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path =
            Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("report-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    fn path(&self, name: &str) -> String {
        self.0.join(name).to_str().unwrap().to_owned()
    }

    fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.0).unwrap();
        let mut names: Vec<_> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn omnibase(arguments: &[&str]) -> Output {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut command = Command::new(env!("CARGO_BIN_EXE_omnibase"));
    command.args(arguments).current_dir(root).stdin(Stdio::null()).output().unwrap()
}

/// A short run: a circle of 0.2 m in 5 s.
fn circle(further: &[&str]) -> Output {
    omnibase(&[&["run", "robots/bmm.toml", "--circle", "radius=0.2,period=5"], further].concat())
}

fn words(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
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
    let folder = Folder::new("figures");
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

#[test]
fn a_page_without_a_recording_leaves_none_behind() {
    let folder = Folder::new("alone");
    let page = folder.path("run.html");
    assert!(circle(&["--report", &page]).status.success());
    assert_eq!(folder.names(), ["run.html"]);
}

#[test]
fn a_run_that_never_began_leaves_nothing_behind_and_a_page_without_a_folder_is_refused_first() {
    let folder = Folder::new("never");
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
    let folder = Folder::new("folder");
    let page = folder.path("page");
    std::fs::create_dir(&page).unwrap();
    let output = circle(&["--report", &page]);
    let says = words(&output.stderr);
    assert!(output.status.code() == Some(1) && says.contains("expected a regular file"), "{says}");
    assert!(output.stdout.is_empty(), "nothing ran");
    assert_eq!(folder.names(), ["page"]);
}

#[test]
fn a_recording_that_was_cut_off_is_shown_as_far_as_it_goes() {
    let folder = Folder::new("cut");
    let (recording, page) = (folder.path("run.mcap"), folder.path("run.html"));
    assert!(circle(&["--record", &recording]).status.success());
    let whole = std::fs::read(&recording).unwrap();
    std::fs::write(&recording, &whole[..whole.len() / 2]).unwrap();
    let output = omnibase(&["report", &recording, "-o", &page]);
    assert_eq!(output.status.code(), Some(1));
    assert!(words(&output.stderr).contains("ends early"), "{}", words(&output.stderr));
    let html = std::fs::read_to_string(&page).unwrap();
    assert!(html.contains("The recording ends early") && html.contains("<h2>Wheels</h2>"));
}

#[test]
fn what_is_no_recording_is_refused_in_words() {
    let folder = Folder::new("wrong");
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
