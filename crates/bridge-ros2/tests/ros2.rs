//! The bridge between a simulated robot and real ROS 2: rclpy with Fast DDS, of two distributions.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use omnibase_client::robots::Endpoint;
use omnibase_client::{Found, Seat};
use omnibase_host::Namespace;
use serde_json::{Value, json};

const LONGEST: Duration = Duration::from_secs(60);
/// Robots of which one must be heard by its bridge all the time.
const ATTEMPTS: u32 = 5;
/// For how long the robot believes a command.
const COMMAND_AGE_MS: u32 = 500;

/// Python with real ROS 2 in it, as `.ci/ros2` makes it.
fn pythons() -> Vec<(&'static str, PathBuf)> {
    let target = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target");
    let places = ["jazzy", "kilted"].map(|name| (name, target.join(format!("ros2-{name}/bin/python"))));
    let there: Vec<_> = places.into_iter().filter(|(_, python)| python.is_file()).collect();
    if there.len() < 2 {
        omnibase_host::skipped("ROS 2 of both distributions isn't there: .ci/ros2 makes it");
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

/// A graph of its own.
fn domain() -> String {
    // Domains above 101 take ports that the kernel gives to others.
    static STARTED: AtomicU32 = AtomicU32::new(0);
    let number = 3 * std::process::id() + STARTED.fetch_add(1, Ordering::Relaxed);
    (1 + number % 100).to_string()
}

/// The program of the command line, which is built beside the bridge.
fn omnibase() -> PathBuf {
    let omnibase = Path::new(env!("CARGO_BIN_EXE_omnibase-bridge-ros2")).with_file_name("omnibase");
    assert!(omnibase.is_file(), "{} is missing: cargo build --workspace", omnibase.display());
    omnibase
}

/// A bridge that the run keeps.
#[derive(Clone, Copy)]
struct Bridge {
    process: u32,
    /// How many bridges came into the graph until then.
    entered: usize,
}

impl Robot {
    /// Starts it, with these arguments of its bridge.
    fn start(arguments: &[&str]) -> Robot {
        Robot::start_in(&domain(), arguments)
    }

    /// As [`Robot::start`], in a graph that others may be in.
    fn start_in(domain: &str, arguments: &[&str]) -> Robot {
        let arguments: Vec<String> = arguments.iter().map(|argument| format!("{argument:?}")).collect();
        let bridge = format!("[bridge.ros2]\narguments = [{}]\n", arguments.join(", "));
        let robot = Robot::alone("127.0.0.1:0", domain, &bridge, &[]);
        robot.bridge(None);
        robot
    }

    /// Starts it with its page there, with more in its file and in its command.
    fn alone(page: &str, domain: &str, more: &str, asked: &[&str]) -> Robot {
        let folder = tempfile::tempdir().unwrap();
        let usual = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/bmm.toml");
        let more = format!(
            "\n[safety]\ncommand_age_ms = {COMMAND_AGE_MS}\n\n[[source]]\nname = \"mocap\"\ncarries = \"pose\"\n\n{more}"
        );
        let file = folder.path().join("robot.toml");
        // Wheels stand alike at any time where all drives' clocks are right.
        let usual = std::fs::read_to_string(usual).unwrap();
        let usual = usual.replacen("[simulation]\n", "[simulation]\nclock_drift_ppm = [0, 0, 0]\n", 1);
        std::fs::write(&file, usual + &more).unwrap();
        let said = File::create(folder.path().join("said.txt")).unwrap();
        let process = Command::new(omnibase())
            .args(["run", file.to_str().unwrap(), "--json", &format!("--dashboard={page}"), "--paths"])
            .arg(folder.path())
            .args(asked)
            .env("XDG_RUNTIME_DIR", folder.path())
            .env("ROS_DOMAIN_ID", domain)
            .env("OMNIBASE_TOKEN", "token-of-the-test")
            .stdout(Stdio::null())
            .stderr(said)
            .spawn()
            .unwrap();
        let place = Endpoint::Address(([127, 0, 0, 1], 0).into());
        let found = Found { robot: String::new(), place, token: "token-of-the-test".to_owned() };
        let mut robot = Robot { process, found, domain: domain.to_owned(), folder };
        let address = robot.wait("it says where its page is", |robot| {
            let said = robot.said();
            let line = said.lines().find_map(|line| line.strip_prefix("dashboard: http://"))?;
            line.split('/').next().map(str::to_owned)
        });
        robot.found.place = Endpoint::Address(address.parse().unwrap());
        robot
    }

    /// A bridge that is started by hand.
    fn bridge_by_hand(&self) -> Program {
        let said = File::options().append(true).open(self.folder.path().join("said.txt")).unwrap();
        let started = Command::new(omnibase())
            .args(["bridge", "ros2", "--at", &self.found.place.to_string()])
            .env("ROS_DOMAIN_ID", &self.domain)
            .env("OMNIBASE_TOKEN", &self.found.token)
            .stderr(said)
            .spawn();
        Program(started.unwrap())
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

    /// Waits until a bridge is in the graph, another one than `gone`.
    fn bridge(&self, gone: Option<Bridge>) -> Bridge {
        // A slow machine may have had more bridges than a test ended.
        let entered = |robot: &Robot| robot.said().matches("in ROS 2's graph").count();
        let before = gone.map_or(0, |bridge| bridge.entered);
        self.wait("the bridge is there", |robot| (entered(robot) > before).then_some(()));
        // Below the run is who keeps it.
        let child = |of: u32| {
            let tasks = std::fs::read_dir(format!("/proc/{of}/task")).ok()?;
            let all =
                tasks.flatten().filter_map(|task| std::fs::read_to_string(task.path().join("children")).ok());
            all.flat_map(|line| line.split_whitespace().map(str::to_owned).collect::<Vec<_>>())
                .find_map(|pid| pid.parse().ok())
        };
        let process = self.wait("the bridge's process", |robot| {
            child(robot.process.id())
                .and_then(child)
                .filter(|&process| gone.is_none_or(|bridge| bridge.process != process))
        });
        Bridge { process, entered: entered(self) }
    }

    fn length(&self, x: &str, y: &str) -> f64 {
        let now = self.now();
        let value = |name: &str| now["values"][name].as_f64().unwrap_or(f64::NAN);
        value(x).hypot(value(y))
    }

    fn speed_m_s(&self) -> f64 {
        self.length("state/twist_in_body_x_m_s", "state/twist_in_body_y_m_s")
    }

    /// How far from where it began.
    fn distance_m(&self) -> f64 {
        self.length("state/pose_x_m", "state/pose_y_m")
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

    fn witness(&self, python: &Path, checks: &[&str]) -> Program {
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
        Program(started)
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

/// A node of real ROS 2, or a bridge: it ends with its test.
struct Program(Child);

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn signal(name: &str, pid: u32) {
    assert!(Command::new("kill").args([name, &pid.to_string()]).status().unwrap().success());
}

/// A test for each group of the witness's checks, in either distribution.
macro_rules! witnessed {
    ($($distribution:ident: $($group:ident)*),*) => {$(
        mod $distribution {
            $(#[test]
            fn $group() {
                super::witnessed_by(stringify!($distribution), stringify!($group));
            })*
        }
    )*};
}

witnessed!(jazzy: tells commands publishers actions, kilted: tells commands publishers actions);

/// It sees the robot, drives it, and can't make it move wrongly.
fn witnessed_by(distribution: &str, group: &str) {
    let Some((_, python)) = pythons().into_iter().find(|(name, _)| *name == distribution) else { return };
    for _ in 0..ATTEMPTS {
        let robot = Robot::start(&["--pose-source", "mocap"]);
        let status = robot.witness(&python, &[group]).0.wait().unwrap();
        if status.success() {
            return;
        }
        // Bridges that lost a robot whom the machine gave no time, and what was asked of them, show nothing.
        let said = robot.said();
        assert!(said.contains("the robot is silent"), "{distribution}, {group}; said:\n{said}");
    }
    panic!("{distribution}, {group}: this machine let none of {ATTEMPTS} robots talk to its bridge");
}

#[test]
fn two_robots_live_in_one_graph() {
    let Some((_, python)) = pythons().into_iter().next_back() else { return };
    let one = Robot::start(&["--namespace", "/one", "--frame-prefix", "one/", "--sim-time"]);
    let two = ["--namespace", "/two", "--frame-prefix", "two/", "--cmd-vel", "twist", "--tf-topic", "tf"];
    let two = Robot::start_in(&one.domain, &two);
    let status = one.witness(&python, &["two_robots_in_one_graph"]).0.wait().unwrap();
    assert!(status.success(), "said:\n{}\n{}", one.said(), two.said());
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
    let mut bridge = robot.bridge(None);
    for signals in [&["-KILL"][..], &["-STOP", "-CONT"]] {
        for (at, name) in signals.iter().enumerate() {
            if at > 0 {
                // Suspended: nobody drives, whatever is published.
                robot.wait("it rests", rests);
            }
            signal(name, bridge.process);
        }
        // Started again by the run, which never ended; it drives by what is published again.
        bridge = robot.bridge(Some(bridge));
        robot.wait("it drives again", drives);
    }
    assert_eq!(robot.now()["phase"], "tracking");
    // A person stops it, and then the bridge is killed: the next one drives nothing, whatever is published on.
    let mut person = Seat::take(&robot.found).unwrap();
    person.recover().unwrap();
    stop(&mut person);
    robot.drives_nothing(1);
    signal("-KILL", bridge.process);
    let bridge = robot.bridge(Some(bridge));
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
    signal("-KILL", bridge.process);
    stop(&mut person);
    let bridge = robot.bridge(Some(bridge));
    robot.drives_nothing(said(&robot) + 1);
    drop(driver);
    // The run is killed: its bridge doesn't outlive it.
    signal("-KILL", robot.process.id());
    robot.wait("the bridge is gone", |_| {
        let state = std::fs::read_to_string(format!("/proc/{}/stat", bridge.process)).unwrap_or_default();
        (state.is_empty() || state.contains(") Z ")).then_some(())
    });
}

/// Two machines, each with a network of its own, and a cable between them.
struct Machines {
    robots: Namespace,
    other: Namespace,
    /// Holds the other one's end of the cable.
    _holder: Program,
}

impl Machines {
    fn new(test: &str) -> Option<Machines> {
        let robots = Namespace::for_test(test)?;
        let other = Namespace::new().unwrap();
        let holder = other.run(|| Command::new("cat").stdin(Stdio::piped()).spawn().unwrap());
        robots.ip(&format!("link add cable type veth peer name cable netns {}", holder.id())).unwrap();
        for (machine, address) in [(&robots, "10.77.0.1/24"), (&other, "10.77.0.2/24")] {
            machine.ip(&format!("address add {address} dev cable")).unwrap();
            machine.ip("link set cable up").unwrap();
            // Without it a multicast has nowhere to go.
            machine.ip("route add 224.0.0.0/4 dev cable").unwrap();
        }
        // Its programs reach each other without the cable, too.
        other.ip(&format!("address add 10.78.0.1/24 dev {}", Namespace::NEAR)).unwrap();
        Some(Machines { robots, other, _holder: Program(holder) })
    }
}

#[test]
fn a_cable_that_is_pulled_between_robot_and_bridge_stops_the_robot_until_it_is_there_again() {
    a_pulled_cable_stops_the_robot("robot | bridge", |machines, robot| {
        machines.other.run(|| robot.bridge_by_hand())
    });
}

#[test]
fn a_cable_that_is_pulled_between_bridge_and_ros_stops_the_robot_until_it_is_there_again() {
    a_pulled_cable_stops_the_robot("bridge | ROS 2", |_, robot| robot.bridge_by_hand());
}

fn a_pulled_cable_stops_the_robot(where_it_is: &str, bridge: impl Fn(&Machines, &Robot) -> Program + Sync) {
    let Some((_, python)) = pythons().into_iter().next() else { return };
    let Some(machines) = Machines::new(where_it_is) else { return };
    machines.robots.run(|| {
        let robot = Robot::alone("10.77.0.1:0", &domain(), "", &[]);
        let _bridge = bridge(&machines, &robot);
        let _driver = machines.other.run(|| robot.witness(&python, &["drive_on"]));
        for _ in 0..2 {
            robot.wait("it drives", |robot| (robot.speed_m_s() > 0.1).then_some(()));
            machines.other.ip("link set cable down").unwrap();
            let pulled = robot.distance_m();
            robot.wait("it rests", |robot| (robot.speed_m_s() < 5e-3).then_some(()));
            let stood = robot.distance_m();
            // 0.25 m/s for as long as a command is believed, and the ramp: 0.6 m/s².
            let farthest_m = 0.25 * f64::from(COMMAND_AGE_MS) / 1e3 + 0.25 * 0.25 / (2.0 * 0.6);
            assert!(stood - pulled < farthest_m, "{} m, {farthest_m} at most", stood - pulled);
            // Nobody is heard: it goes on to rest.
            let seen = robot.now()["counts"][0].as_u64().unwrap();
            robot.wait("a second", |robot| {
                assert!(robot.speed_m_s() < 5e-3, "{} m/s", robot.speed_m_s());
                (robot.now()["counts"][0].as_u64().unwrap() > seen + 1000).then_some(())
            });
            machines.other.ip("link set cable up").unwrap();
        }
        robot.wait("it drives again", |robot| (robot.speed_m_s() > 0.1).then_some(()));
    });
}

/// The signals of so many cycles in which a circle is driven, by their names.
fn of_a_circle(more: &str, cycles: usize) -> Vec<(String, Vec<String>)> {
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("run.mcap");
    let asked = ["--circle", "radius_m=0.3,duration_s=6", "--record", recording.to_str().unwrap()];
    let mut robot = Robot::alone("127.0.0.1:0", &domain(), more, &asked);
    if !more.is_empty() {
        robot.bridge(None);
    }
    for (call, phase) in [("enable", "holding"), ("track", "tracking")] {
        // Of a command line, which may go while the robot drives.
        let asked = Command::new(omnibase())
            .args(["call", call, "--at", &robot.found.place.to_string()])
            .env("OMNIBASE_TOKEN", &robot.found.token)
            .status();
        assert!(asked.unwrap().success());
        robot.wait(phase, |robot| (robot.now()["phase"] == phase).then_some(()));
    }
    robot.wait("it is round", |robot| (robot.now()["phase"] == "holding").then_some(()));
    signal("-INT", robot.process.id());
    robot.process.wait().unwrap();
    let table = folder.path().join("run.csv");
    let export = Command::new(omnibase()).arg("export").arg(&recording).arg("--output").arg(&table).output();
    assert!(export.unwrap().status.success());
    let text = std::fs::read_to_string(table).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    let phase = rows[0].iter().position(|name| *name == "cycle.phase").unwrap();
    let phases: Vec<&str> = rows.iter().skip(1).map(|row| row[phase]).collect();
    // The drives are disabled, enabled, hold, and then it drives.
    let tracks = phases.chunk_by(|a, b| a == b).nth(3).unwrap();
    let begun = rows.len() - phases[phases.iter().position(|phase| *phase == tracks[0]).unwrap()..].len();
    let column = |at: usize| rows[begun..begun + cycles].iter().map(|row| row[at].to_owned()).collect();
    rows[0].iter().enumerate().map(|(at, name)| ((*name).to_owned(), column(at))).collect()
}

#[test]
fn the_robot_drives_to_the_bit_as_without_a_bridge() {
    if pythons().is_empty() {
        return;
    }
    let every_cycle = "[bridge.ros2]\narguments = [\"--odom-hz\", \"0\"]\n";
    let (with, without) = std::thread::scope(|scope| {
        let with = scope.spawn(|| of_a_circle(every_cycle, 6000));
        let without = of_a_circle("", 6000);
        (with.join().unwrap(), without)
    });
    let differ: Vec<&str> = with
        .iter()
        .zip(&without)
        .filter(|(with, without)| with != without)
        .map(|((name, _), _)| name.as_str())
        // When it began, and how the wheels had stood until then, to the last bit.
        .filter(|name| {
            !["time", "timing.", "cycle.index", "cycle.time", "bus.dc_phase_ns", "truth.", "error."]
                .iter()
                .any(|own| name.starts_with(own))
        })
        .collect();
    println!("{} signals, {} of them differ", with.len(), differ.len());
    assert_eq!(differ, [""; 0]);
}
