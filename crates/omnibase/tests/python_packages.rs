//! What others' Python packages make of ours: recordings are read by `mcap` with its protobuf support and `numpy`; the API's
//! description is validated, and a client of it alone drives the robot; NatNet's frames are read by another's client.

#[path = "../../receive/tests/receivers/motive.rs"]
#[expect(dead_code, reason = "its talk is heard in the tests of omnibase-receive")]
mod motive;

use crate::python_tools::{python, successful};
use omnibase_receive::natnet::{Frame, Version, body_names};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};

/// The versions that the test was written with; of numpy any does, as the Python at hand takes it.
const PACKAGES: [&str; 4] = ["mcap==1.6.0", "mcap-protobuf-support==0.6.0", "protobuf==7.36.2", "numpy"];

/// What checks the API's description.
const API_PACKAGES: [&str; 2] = ["openapi-spec-validator==0.7.2", "jsonschema>=4"];

#[test]
fn every_message_and_every_column_is_read() {
    let Some(python) = python("python-mcap", &PACKAGES, "import mcap_protobuf, numpy") else { return };
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
    assert_eq!(topics["/robot"].as_u64(), Some(cycles));
    assert_eq!(read["counted"].as_u64(), topics.values().map(serde_json::Value::as_u64).sum::<Option<u64>>());
    let events: Vec<_> = summary["events"].as_array().unwrap().iter().map(|event| &event["text"]).collect();
    assert_eq!(read["events"].as_array().unwrap().iter().collect::<Vec<_>>(), events);
    // Every column of the text file has a name, as many rows as cycles, and the same bits as the MCAP file.
    assert_eq!(read["rows"].as_u64(), Some(cycles));
    assert_eq!(read["column_names"], read["names"]);
    assert_eq!(read["differing"], serde_json::json!([]));
}

#[test]
fn a_client_of_the_description_alone_drives_the_robot() {
    let Some(python) = python("python-api", &API_PACKAGES, "import jsonschema, openapi_spec_validator")
    else {
        return;
    };
    let token = "token-of-the-description";
    let folder = tempfile::tempdir().unwrap();
    let mut robot = Command::new(env!("CARGO_BIN_EXE_omnibase"))
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."))
        .args(["run", "robots/bmm.toml", "--dashboard=127.0.0.1:0", "--json"])
        .env("OMNIBASE_TOKEN", token)
        .env("XDG_RUNTIME_DIR", folder.path())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(robot.stderr.take().unwrap()).lines().map_while(Result::ok);
    let said = lines.by_ref().find_map(|line| line.strip_prefix("dashboard: http://").map(str::to_owned));
    let said = said.expect("it says where its page is");
    std::thread::spawn(move || lines.for_each(drop));
    let address = said.split('/').next().unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/api.py");
    let drove = successful(Command::new(python).arg(script).args([address, token]));
    let _ = robot.kill();
    let _ = robot.wait();
    let drove: serde_json::Value = serde_json::from_slice(&drove.unwrap()).unwrap();
    println!("{drove}");
    assert_eq!(drove["done"], serde_json::json!(["enable", "load", "track", "stop"]));
    assert_eq!((&drove["unknown"], &drove["api"]), (&400.into(), &"1.2.0".into()));
    assert_eq!(drove["on_page"], drove["calls"], "the page for people has them all");
    assert!(drove["calls"].as_array().unwrap().len() > 25, "{}", drove["calls"]);
}

/// Another's client of NatNet.
const NATNET_PACKAGES: [&str; 1] = ["natnet==0.3.0"];

#[test]
fn frames_of_natnet_are_read_as_by_another_client() {
    let Some(python) = python("python-natnet", &NATNET_PACKAGES, "import natnet") else { return };
    let body = |id, x, flags| motive::Sent {
        id,
        position: [x, 0.25, -1.5],
        rotation: [0.0, 0.6, 0.0, 0.8],
        error: 0.001,
        flags,
    };
    let bodies = [body(3, 1.0, 1), body(7, 2.0, 0)];
    let names = [("cart", 3), ("robot", 7)];
    let (mut lines, mut ours) = (String::new(), Vec::new());
    for version in [[3, 0], [3, 1], [4, 0], [4, 1], [4, 2]] {
        let own = Version { major: version[0], minor: version[1] };
        let frame = motive::frame(version, 41, &bodies, [1_000_000, 2_000_000]);
        let descriptions = motive::descriptions(version, &names);
        for bytes in [&frame, &descriptions] {
            let hex: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
            lines += &format!("{}\n", serde_json::json!({ "version": version, "bytes": hex }));
        }
        let read = Frame::from_bytes(&frame[4..], own).expect("a frame");
        let body = |body: &omnibase_receive::natnet::Body| {
            serde_json::json!({ "id": body.id, "position": body.position, "rotation": body.rotation, "error": body.error,
                "is_tracked": body.is_tracked })
        };
        ours.push(
            serde_json::json!({ "number": read.number, "exposed": read.exposed_ticks, "sent": read.sent_ticks,
            "bodies": read.bodies.iter().map(body).collect::<Vec<_>>() }),
        );
        ours.push(serde_json::json!(body_names(&descriptions[4..], own).expect("descriptions")));
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/natnet_frame.py");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("frames");
    std::fs::write(&file, lines).unwrap();
    let read =
        successful(Command::new(python).arg(script).stdin(std::fs::File::open(&file).unwrap())).unwrap();
    let theirs = String::from_utf8(read).unwrap();
    let theirs: Vec<serde_json::Value> =
        theirs.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(theirs, ours);
}
