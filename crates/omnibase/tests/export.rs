//! What `omnibase export` writes is read by pandas, pyarrow and scipy.io, with every bit of the recording.

use crate::python_tools::{python, successful};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Of each any version does, as the Python at hand takes it.
const PACKAGES: [&str; 3] = ["pandas", "pyarrow", "scipy"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn omnibase(arguments: &[&str]) -> Result<String, String> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_omnibase"));
    let said = successful(command.args(arguments).current_dir(root()).stdin(Stdio::null()))?;
    Ok(String::from_utf8(said).unwrap())
}

/// A run in the folder, recorded as these arguments say.
fn recorded(folder: &Path, arguments: &[&str]) -> String {
    let path = folder.join("run.mcap").to_str().unwrap().to_owned();
    let run = ["run", "robots/bmm.toml", "--circle", "radius_m=0.2,duration_s=5", "--record", &path];
    omnibase(&[&run[..], arguments].concat()).unwrap();
    path
}

#[test]
fn tables_are_read_by_pandas_pyarrow_and_scipy_with_every_bit() {
    let folder = tempfile::tempdir().unwrap();
    let run = recorded(folder.path(), &[]);
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let tables = [path("run.csv"), path("run.parquet"), path("run.mat")];
    for table in &tables {
        let chosen =
            ["export", &run, "--signals", "state.*", "wheel_2.speed*", "truth.pose_x_m", "--every", "10ms"];
        let said = omnibase(&[&chosen[..], &["--output", table]].concat()).unwrap();
        assert!(said.ends_with("602 rows of 18 signals\n"), "{said}");
    }
    let Some(python) = python("python-tables", &PACKAGES, "import pandas, pyarrow, scipy.io") else { return };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/read_tables.py");
    let read = successful(Command::new(python).arg(script).args(&tables)).unwrap();
    let read: serde_json::Value = serde_json::from_slice(&read).unwrap();
    println!("{read}");
    assert_eq!(read["differing"], serde_json::json!([]));
    assert_eq!(read["names"], read["parquet_names"]);
    assert_eq!(read["names"].as_array().unwrap().len(), 19);
    assert_eq!(read["variables"][1], "state_pose_x_m");
    for rows in ["rows", "parquet_rows", "pandas_parquet_rows"] {
        assert_eq!(read[rows], 602, "{rows}");
    }
    assert_eq!(read["last_time_s"], 6.01);
    // The circle ends where it begins.
    assert!(read["x_m"].as_f64().unwrap().abs() < 1e-3, "{}", read["x_m"]);
}

#[test]
fn files_of_one_run_become_one_table() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole");
    std::fs::create_dir(&whole).unwrap();
    let whole = recorded(&whole, &[]);
    recorded(folder.path(), &["--limit-mb", "1"]);
    let mut files: Vec<String> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().path().to_str().unwrap().to_owned())
        .filter(|path| path.ends_with(".mcap"))
        .collect();
    files.sort();
    assert!(files.len() > 2, "{files:?}");
    let table = folder.path().join("run.csv");
    let table = table.to_str().unwrap();
    let export = |recordings: &[String], every: &str| {
        let recordings: Vec<&str> = recordings.iter().map(String::as_str).collect();
        // What differs from run to run, and between files: nothing of these.
        let to = ["--output", table, "--every", every, "--signals", "state.*", "cycle.*"];
        omnibase(&[&["export"][..], &recordings, &to].concat())
            .map(|_| std::fs::read_to_string(table).unwrap())
    };
    let whole = [whole];
    for every in ["1cycle", "30ms"] {
        let (joined, one) = (export(&files, every).unwrap(), export(&whole, every).unwrap());
        assert!(joined == one, "{every}: {} lines of {}", joined.lines().count(), one.lines().count());
    }
    files.reverse();
    let refused = export(&files, "1cycle").unwrap_err();
    assert!(refused.contains("expected the files of one run in their order"), "{refused}");
}

#[test]
fn what_cannot_be_a_table_is_refused_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let run = recorded(folder.path(), &["--every", "10ms"]);
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    for (arguments, expected) in [
        (vec!["--output", "run.xlsx"], "expected a name that ends in .csv, .parquet, .mat or .mcap"),
        (vec!["--output", &path("a.csv"), "--signals", "stat.*"], "holds no signal of this name"),
        (
            vec!["--output", &path("a.csv"), "--every", "2.5ms"],
            "expected a whole multiple of the cycle of 1 ms",
        ),
        (vec!["--output", &path("none/a.csv")], "none/a.csv"),
        // The recording itself by another name.
        (vec!["--output", &path("./run.mcap")], "would be written over what it is made of"),
    ] {
        let refused = omnibase(&[&["export", &run][..], &arguments].concat()).unwrap_err();
        assert!(refused.contains(expected), "{refused}");
    }
}
