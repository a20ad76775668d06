//! The bridge between a simulated robot and real ROS 2: rclpy with Fast DDS, of two distributions.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use omnibase_client::robots::Endpoint;
use omnibase_client::{Found, Seat};
use serde_json::{Value, json};

const LONGEST: Duration = Duration::from_secs(60);

/// Python with real ROS 2 in it, as `.ci/ros2` makes it; says loudly where it is missing.
fn pythons() -> Vec<(&'static str, PathBuf)> {
    let target = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target");
    let places = ["jazzy", "kilted"].map(|name| (name, target.join(format!("ros2-{name}/bin/python"))));
    let there: Vec<_> = places.into_iter().filter(|(_, python)| python.is_file()).collect();
    if there.len() < 2 {
        assert!(
            std::env::var_os("OMNIBASE_WITNESSES").is_none(),
            "ROS 2 of both distributions is missing: .ci/ros2"
        );
        println!("SKIPPED: ROS 2 of both distributions isn't there: .ci/ros2 makes it");
        return Vec::new();
    }
    there
}

/// A simulated robot with its bridge, in a domain of its own.
struct Robot {
    process: Child,
    found: Found,
    domain: String,
    folder: tempfile::TempDir,
}

impl Robot {
    /// Starts it, with these arguments of its bridge.
    fn start(arguments: &[&str]) -> Robot {
        let bridge = Path::new(env!("CARGO_BIN_EXE_omnibase-bridge-ros2"));
        let omnibase = bridge.with_file_name("omnibase");
        assert!(omnibase.is_file(), "{} is missing: cargo build --workspace", omnibase.display());
        let folder = tempfile::tempdir().unwrap();
        let usual = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/bmm.toml");
        let arguments: Vec<String> = arguments.iter().map(|argument| format!("{argument:?}")).collect();
        let more = format!(
            "\n[safety]\ncommand_age_ms = 500\n\n[[source]]\nname = \"mocap\"\ncarries = \"pose\"\n\n[bridge.ros2]\narguments = [{}]\n",
            arguments.join(", ")
        );
        let file = folder.path().join("robot.toml");
        std::fs::write(&file, std::fs::read_to_string(usual).unwrap() + &more).unwrap();
        // Domains above 101 take ports that the kernel gives to others.
        static STARTED: AtomicU32 = AtomicU32::new(0);
        let number = 3 * std::process::id() + STARTED.fetch_add(1, Ordering::Relaxed);
        let domain = (1 + number % 100).to_string();
        let said = File::create(folder.path().join("said.txt")).unwrap();
        let process = Command::new(omnibase)
            .args(["run", file.to_str().unwrap(), "--json", "--dashboard=127.0.0.1:0", "--paths"])
            .arg(folder.path())
            .env("XDG_RUNTIME_DIR", folder.path())
            .env("ROS_DOMAIN_ID", &domain)
            .env("OMNIBASE_TOKEN", "token-of-the-test")
            .stdout(Stdio::null())
            .stderr(said)
            .spawn()
            .unwrap();
        let place = Endpoint::Address(([127, 0, 0, 1], 0).into());
        let found = Found { robot: String::new(), place, token: "token-of-the-test".to_owned() };
        let mut robot = Robot { process, found, domain, folder };
        let address = robot.wait("it says where its page is", |robot| {
            let said = robot.said();
            let line = said.lines().find_map(|line| line.strip_prefix("dashboard: http://"))?;
            line.split('/').next().map(str::to_owned)
        });
        robot.found.place = Endpoint::Address(address.parse().unwrap());
        robot.bridge(1);
        robot
    }

    /// What it and its bridge said so far.
    fn said(&self) -> String {
        let mut said = String::new();
        let file = File::open(self.folder.path().join("said.txt"));
        file.unwrap().read_to_string(&mut said).unwrap();
        said
    }

    /// Waits until something is there.
    fn wait<T>(&self, what: &str, mut look: impl FnMut(&Robot) -> Option<T>) -> T {
        let begun = Instant::now();
        loop {
            if let Some(found) = look(self) {
                return found;
            }
            assert!(begun.elapsed() < LONGEST, "never: {what}; said:\n{}", self.said());
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Waits until the bridge came into the graph so many times; its process.
    fn bridge(&self, times: usize) -> u32 {
        self.wait("the bridge is there", |robot| {
            (robot.said().matches("in ROS 2's graph").count() >= times).then_some(())
        });
        // Below the run is who keeps it.
        let child = |of: u32| {
            let tasks = std::fs::read_dir(format!("/proc/{of}/task")).ok()?;
            let all =
                tasks.flatten().filter_map(|task| std::fs::read_to_string(task.path().join("children")).ok());
            all.flat_map(|line| line.split_whitespace().map(str::to_owned).collect::<Vec<_>>())
                .find_map(|pid| pid.parse().ok())
        };
        self.wait("the bridge's process", |robot| child(robot.process.id()).and_then(child))
    }

    fn speed_m_s(&self) -> f64 {
        let now = self.found.read("now").unwrap();
        let value = |name: &str| now["values"][name].as_f64().unwrap_or(f64::NAN);
        value("state/twist_in_body_x_m_s").hypot(value("state/twist_in_body_y_m_s"))
    }

    /// It stands though somebody publishes; the bridge said so often why.
    fn drives_nothing(&self, times: usize) {
        self.wait("it says why", |robot| {
            (robot.said().matches("cmd_vel moves nothing").count() >= times).then_some(())
        });
        self.wait("it rests", |robot| (robot.speed_m_s() < 5e-3).then_some(()));
        let seen = self.now()["counts"][0].as_u64().unwrap();
        while self.now()["counts"][0].as_u64().unwrap() < seen + 1000 {
            assert!(self.speed_m_s() < 5e-3, "{} m/s", self.speed_m_s());
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    fn now(&self) -> Value {
        self.found.read("now").unwrap()
    }

    fn witness(&self, python: &Path, checks: &[&str]) -> Witness {
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/witness.py");
        let started = Command::new(python)
            .arg(script)
            .args(checks)
            .env("ROS_DOMAIN_ID", &self.domain)
            .env("ROS_LOG_DIR", self.folder.path())
            .env("PYTHONDONTWRITEBYTECODE", "1")
            .env("LD_LIBRARY_PATH", python.parent().unwrap().with_file_name("lib"))
            .spawn()
            .unwrap();
        Witness(started)
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        if std::thread::panicking() {
            println!("the robot said:\n{}", self.said());
        }
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// A node of real ROS 2, which ends with its test.
struct Witness(Child);

impl Drop for Witness {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn signal(name: &str, pid: u32) {
    assert!(Command::new("kill").args([name, &pid.to_string()]).status().unwrap().success());
}

#[test]
fn jazzy_sees_it_drives_it_and_cannot_make_it_move_wrongly() {
    witnessed_by("jazzy");
}

#[test]
fn kilted_sees_it_drives_it_and_cannot_make_it_move_wrongly() {
    witnessed_by("kilted");
}

fn witnessed_by(distribution: &str) {
    let Some((_, python)) = pythons().into_iter().find(|(name, _)| *name == distribution) else { return };
    let robot = Robot::start(&["--pose-source", "mocap"]);
    let status = robot.witness(&python, &[]).0.wait().unwrap();
    assert!(status.success(), "{distribution}; said:\n{}", robot.said());
}

fn stop(person: &mut Seat) {
    let number = person.ask(json!({ "do": "stop", "category": "category_2" }), Instant::now()).unwrap();
    assert!(person.answer(number, LONGEST).unwrap().done);
}

#[test]
fn a_bridge_that_is_killed_or_suspended_stops_the_robot_and_comes_back() {
    let Some((_, python)) = pythons().into_iter().next() else { return };
    let robot = Robot::start(&[]);
    let driver = robot.witness(&python, &["drive_on"]);
    let drives = |robot: &Robot| (robot.speed_m_s() > 0.1).then_some(());
    let rests = |robot: &Robot| (robot.speed_m_s() < 5e-3).then_some(());
    let said = |robot: &Robot| robot.said().matches("cmd_vel moves nothing").count();
    robot.wait("it drives", drives);
    for (times, signals) in [(2, &["-KILL"][..]), (3, &["-STOP", "-CONT"])] {
        let bridge = robot.bridge(times - 1);
        for (at, name) in signals.iter().enumerate() {
            if at > 0 {
                // Suspended: nobody drives, whatever is published.
                robot.wait("it rests", rests);
            }
            signal(name, bridge);
        }
        // Started again by the run, which never ended; it drives by what is published again.
        assert_ne!(robot.bridge(times), bridge);
        robot.wait("it drives again", drives);
    }
    assert_eq!(robot.now()["phase"], "tracking");
    // A person stops it, and then the bridge is killed: the next one drives nothing, whatever is published on.
    let mut person = Seat::take(&robot.found).unwrap();
    person.recover().unwrap();
    stop(&mut person);
    robot.drives_nothing(1);
    signal("-KILL", robot.bridge(3));
    let bridge = robot.bridge(4);
    robot.drives_nothing(said(&robot) + 1);
    robot.wait("it is enabled", |_| {
        // It heard nothing for long: its clock must be told anew.
        while person.hear(Duration::from_millis(50)).unwrap().is_none() {}
        while person.hear(Duration::ZERO).unwrap().is_some() {}
        let number = person.enable_stick().unwrap();
        person.answer(number, LONGEST).unwrap().done.then_some(())
    });
    robot.wait("it drives again", drives);
    // It is killed, and a person stops the robot before the next one is there.
    signal("-KILL", bridge);
    stop(&mut person);
    let bridge = robot.bridge(5);
    robot.drives_nothing(said(&robot) + 1);
    drop(driver);
    // The run is killed: its bridge doesn't outlive it.
    signal("-KILL", robot.process.id());
    robot.wait("the bridge is gone", |_| {
        let state = std::fs::read_to_string(format!("/proc/{bridge}/stat")).unwrap_or_default();
        (state.is_empty() || state.contains(") Z ")).then_some(())
    });
}
