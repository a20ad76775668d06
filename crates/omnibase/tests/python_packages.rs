//! What `omnibase run` records is read by the official Python packages: `mcap` with its protobuf support, and `numpy`.

use std::path::{Path, PathBuf};
use std::process::Command;

/// The versions that the test was written with; of numpy any does, as the Python at hand takes it.
const PACKAGES: [&str; 4] = ["mcap==1.6.0", "mcap-protobuf-support==0.6.0", "protobuf==7.36.2", "numpy"];

/// A Python with the packages, in an environment made once; `Err` says why there is none.
fn python() -> Result<PathBuf, String> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("python-mcap");
    let python = folder.join("bin/python");
    let has_packages = || {
        let mut command = Command::new(&python);
        command
            .args(["-c", "import mcap_protobuf, numpy"])
            .output()
            .is_ok_and(|output| output.status.success())
    };
    if !has_packages() {
        successful(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&folder))?;
        successful(Command::new(&python).args(["-m", "pip", "install", "--quiet"]).args(PACKAGES))?;
    }
    Ok(python)
}

/// The standard output of a command; `Err` is what it says where it fails.
fn successful(command: &mut Command) -> Result<Vec<u8>, String> {
    let output = command.output().map_err(|error| format!("{command:?}: {error}"))?;
    let says = String::from_utf8_lossy(&output.stderr).trim().to_owned();
    if output.status.success() { Ok(output.stdout) } else { Err(format!("{command:?}: {says}")) }
}

#[test]
fn every_message_and_every_column_is_read() {
    let python = match python() {
        Ok(python) => python,
        Err(why) => return eprintln!("SKIPPED: no Python with mcap and numpy: {why}"),
    };
    let folder =
        Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("python-packages-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let (mcap, columns) = (folder.join("run.mcap"), folder.join("run.txt"));
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let run = successful(
        Command::new(env!("CARGO_BIN_EXE_omnibase"))
            .current_dir(&root)
            .args([
                "run",
                "robots/mecanum.toml",
                "--circle",
                "radius_m=0.2,duration_s=5",
                "--json",
                "--record",
            ])
            .arg(&mcap)
            .arg("--columns")
            .arg(&columns),
    );
    let summary: serde_json::Value = serde_json::from_slice(&run.unwrap()).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/read_run.py");
    let read = successful(Command::new(python).arg(script).arg(&mcap).arg(&columns)).unwrap();
    let read: serde_json::Value = serde_json::from_slice(&read).unwrap();
    std::fs::remove_dir_all(&folder).unwrap();

    let cycles = summary["cycles"].as_u64().unwrap();
    assert!(cycles > 5000);
    assert_eq!(read["robot"], "mecanum");
    let topics = read["messages"].as_object().unwrap();
    for topic in ["/state", "/wished", "/wheel_4", "/timing", "/truth", "/raw"] {
        assert!(topics.contains_key(topic), "{topic} is missing in {topics:?}");
    }
    for (topic, count) in topics.iter().filter(|(topic, _)| *topic != "/events") {
        assert_eq!(count.as_u64(), Some(cycles), "{topic}");
    }
    assert_eq!(read["counted"].as_u64(), topics.values().map(serde_json::Value::as_u64).sum::<Option<u64>>());
    let events: Vec<_> = summary["events"].as_array().unwrap().iter().map(|event| &event["text"]).collect();
    assert_eq!(read["events"].as_array().unwrap().iter().collect::<Vec<_>>(), events);
    // Every column of the text file has a name, as many rows as cycles, and the same bits as the MCAP file.
    assert_eq!(read["rows"].as_u64(), Some(cycles));
    assert_eq!(read["column_names"], read["names"]);
    assert_eq!(read["differing"], serde_json::json!([]));
}
