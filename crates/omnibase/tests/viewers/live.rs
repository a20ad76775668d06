//! A running robot as the Foxglove app sees it: by its protocol, decoded by Foxglove's own classes.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};

use serde_json::{Value, json};

use super::{python, read};
use crate::command_line::{Folder, root};

/// A simulated robot that drives on a circle without end, with its page and its server for viewers.
struct Robot {
    process: Child,
    page: String,
    viewers: String,
    _folder: Folder,
}

const TOKEN: &str = "0123456789abcdef0123456789abcdef";

impl Robot {
    fn start() -> Robot {
        let folder = Folder::new("viewers-live");
        let mut process = Command::new(env!("CARGO_BIN_EXE_omnibase"))
            .args(["run", "robots/bmm.toml", "--circle", "radius_m=0.5,turns=endless,period_s=20"])
            .args(["--dashboard=127.0.0.1:0", "--foxglove=127.0.0.1:0"])
            .args(["--set", "fence.rectangle_m=[-3.0, -3.0, 3.0, 3.0]"])
            .env("OMNIBASE_TOKEN", TOKEN)
            .env("XDG_RUNTIME_DIR", &folder.0)
            .current_dir(root())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(process.stderr.take().unwrap()).lines().map_while(Result::ok);
        let mut said = |before: &str| {
            let line = lines.by_ref().find_map(|line| line.strip_prefix(before).map(str::to_owned));
            line.unwrap_or_else(|| panic!("it never said `{before}`"))
        };
        let page = said("dashboard: http://").split('/').next().unwrap().to_owned();
        let viewers = said("foxglove: ");
        // To the end: a robot whose words nobody takes would wait.
        std::thread::spawn(move || lines.for_each(drop));
        Robot { process, page, viewers, _folder: folder }
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[test]
fn a_running_robot_is_drawn_live_by_foxgloves_own_messages_and_fits_the_layout_that_is_shipped() {
    let Some(python) = python() else { return };
    let robot = Robot::start();
    let seen = read(&python, "live.py", &[&robot.viewers, &robot.page, TOKEN]);
    println!("{}", json!([seen["counts"], seen["log"], seen["phases"], seen["off_m"], seen["late_s"]]));
    assert_eq!(seen["protocol"], "foxglove.sdk.v1");
    assert_eq!(seen["server"], json!({"op": "serverInfo", "name": "bmm", "capabilities": []}));
    // Whoever speaks another protocol isn't let in.
    assert_eq!(seen["refused"], json!([400, 400]));
    assert_eq!(seen["differing"], json!([]));
    let schemas = &seen["schemas"];
    for (topic, message) in omnibase_record::viewer::TOPICS {
        assert_eq!(schemas[topic], message);
        assert!(seen["counts"][topic].as_u64().unwrap() > 0, "{topic}: {}", seen["counts"]);
    }
    let frames = json!({ "base_link": "odom", "wheel_1_link": "base_link", "wheel_2_link": "base_link", "wheel_3_link": "base_link" });
    assert_eq!(seen["frames"], frames);
    // Drawn of the very signals that are sent with it, and of today.
    assert_eq!(seen["off_m"], 0.0);
    assert!(seen["late_s"].as_f64().unwrap() < 60.0, "{}", seen["late_s"]);
    for (name, frame) in [
        ("footprint", "base_link"),
        ("wheel_2", "wheel_2_link"),
        ("fence", "odom"),
        ("path", "odom"),
        ("obstacle_3", "odom"),
    ] {
        assert_eq!(seen["entities"][name]["frame"], frame, "{name}: {}", seen["entities"]);
    }
    // A circle of 0.5 m about a point 0.5 m from its begin.
    let path = seen["entities"]["path"]["points"].as_array().unwrap();
    let far = path.iter().map(|at| at[0].as_f64().unwrap().hypot(at[1].as_f64().unwrap()));
    assert!((far.fold(0.0, f64::max) - 1.0).abs() < 1e-2, "{path:?}");
    assert!(seen["log"].as_array().unwrap().iter().any(|line| line[1] == "WARNING"), "{}", seen["log"]);
    assert!(seen["phases"].as_array().unwrap().contains(&"PHASE_STOPPING".into()), "{}", seen["phases"]);
    assert_eq!(seen["status"][0]["message"], "there is no channel 999");
    assert_eq!(seen["after_unsubscribing"], 0);

    let layout = std::fs::read_to_string(root().join("viewers/foxglove-layout.json")).unwrap();
    let layout: Value = serde_json::from_str(&layout).unwrap();
    let named = panels(&layout["layout"]);
    let configured: Vec<&String> = layout["configById"].as_object().unwrap().keys().collect();
    assert_eq!(named.len(), configured.len());
    assert!(configured.iter().all(|panel| named.contains(&panel.as_str())), "{named:?} {configured:?}");
    let mut paths = Vec::new();
    for (panel, settings) in layout["configById"].as_object().unwrap() {
        shown(settings, panel, &mut paths);
    }
    assert!(paths.len() >= 12, "{paths:?}");
    for (panel, path) in paths {
        let (topic, field) = path.split_once('.').unwrap_or((&path, ""));
        let fields = seen["fields"][topic].as_array().unwrap_or_else(|| panic!("{panel}: no topic {path}"));
        assert!(
            field.is_empty() || fields.contains(&field.into()),
            "{panel}: {topic} has no `{field}`: {fields:?}"
        );
    }
}

/// The panels that a layout shows.
fn panels(layout: &Value) -> Vec<&str> {
    match layout {
        Value::String(panel) => vec![panel],
        split => [&split["first"], &split["second"]].into_iter().flat_map(panels).collect(),
    }
}

/// The topics, and signals within them, that a panel's settings name.
fn shown(settings: &Value, panel: &str, paths: &mut Vec<(String, String)>) {
    let is_path = |text: &str| text.starts_with('/');
    match settings {
        Value::Object(all) => {
            paths.extend(all.keys().filter(|key| is_path(key)).map(|key| (panel.to_owned(), key.clone())));
            all.values().for_each(|one| shown(one, panel, paths));
        }
        Value::Array(all) => all.iter().for_each(|one| shown(one, panel, paths)),
        Value::String(text) if is_path(text) => paths.push((panel.to_owned(), text.clone())),
        _ => {}
    }
}
