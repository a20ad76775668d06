//! What floods do to a cycle in real time: clients that flood the page, and frames of another MainDevice at several
//! rates. Two processes over a virtual cable, both with `--realtime`, without and with each flood, in turn.
//!
//! `cargo bench --profile release -p omnibase --bench flood`

#[path = "../tests/dashboard/socket.rs"]
mod socket;

use omnibase_ethercat_wire::Link;
use omnibase_host::{Namespace, PacketSocket};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, ChildStderr, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tungstenite::Message;

const TOKEN: &str = "token-of-the-bench";
const ROBOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/bmm.toml");
/// Of each kind; one may be hit by something else on this machine.
const ROUNDS: usize = 5;
/// What floods, in turn.
const FLOODS: [Flood; 6] = [
    Flood::Nothing,
    Flood::Page,
    Flood::Frames { per_s: 10_000 },
    Flood::Frames { per_s: 30_000 },
    Flood::Frames { per_s: 100_000 },
    Flood::Frames { per_s: 300_000 },
];
/// Between two bursts of frames.
const BURST: Duration = Duration::from_millis(1);
const MEASURED: Duration = Duration::from_secs(10);
/// Two clients that flood, and as much patience as a host without real-time rights needs to get through.
const FLOODERS: usize = 2;
const PATIENT: [&str; 4] = [
    "--set",
    "drive_defaults.parameters=[{object = \"0x10F1.2\", type = \"u16\", value = 15}]",
    "--set",
    "safety.lost_exchanges_tolerated=5",
];

#[derive(Clone, Copy, PartialEq)]
enum Flood {
    Nothing,
    /// Messages to the page.
    Page,
    /// Frames of another MainDevice, which come in from the cable.
    Frames {
        per_s: u32,
    },
}

impl Flood {
    fn name(self) -> String {
        match self {
            Flood::Nothing => "nothing".to_owned(),
            Flood::Page => "page".to_owned(),
            Flood::Frames { per_s } => format!("{per_s}/s"),
        }
    }
}

/// Sends frames as another MainDevice does, at a rate, in bursts; how many it sent.
fn flood_frames(per_s: u32, ended: &AtomicBool) -> u64 {
    let mut port = PacketSocket::open(Namespace::FAR).unwrap();
    // To all, from somebody else, EtherCAT, one BRD of the AL status.
    let mut frame = [0; 60];
    frame[..6].fill(0xFF);
    frame[6..12].copy_from_slice(&[0x12, 0x34, 0x56, 0x78, 0x9A, 0xBC]);
    frame[12..28].copy_from_slice(&[0x88, 0xA4, 14, 0x10, 7, 0x42, 0, 0, 0x30, 0x01, 2, 0, 0, 0, 0, 0]);
    let (begin, mut sent) = (Instant::now(), 0);
    while !ended.load(Ordering::Relaxed) {
        let due = (begin.elapsed().as_secs_f64() * f64::from(per_s)) as u64;
        while sent < due && port.send(&frame).is_ok() {
            sent += 1;
        }
        std::thread::sleep(BURST);
    }
    sent
}

/// A program that is killed with the value.
struct Program {
    child: Child,
    lines: std::io::Lines<BufReader<ChildStderr>>,
}

impl Program {
    fn start(arguments: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_omnibase"))
            .args(arguments)
            .args(["--realtime", "--json"])
            .args(PATIENT)
            .env("OMNIBASE_TOKEN", TOKEN)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(child.stderr.take().unwrap()).lines();
        Program { child, lines }
    }

    /// Waits for the first line from which something can be had.
    fn wait<T>(&mut self, had: impl Fn(&str) -> Option<T>) -> T {
        self.lines.by_ref().map_while(Result::ok).find_map(|line| had(&line)).expect("it says so")
    }

    /// Ends it as Ctrl-C does; what it says at its end.
    fn end(mut self) -> Value {
        let pid = self.child.id().to_string();
        assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
        let mut text = String::new();
        self.child.stdout.take().unwrap().read_to_string(&mut text).unwrap();
        serde_json::from_str(&text).unwrap()
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn now(address: &str) -> Value {
    let mut answer = ureq::get(&format!("http://{address}/api/now")).call().unwrap();
    serde_json::from_str(&answer.body_mut().read_to_string().unwrap()).unwrap()
}

fn call(address: &str, what: &str) {
    let agent: ureq::Agent = ureq::Agent::config_builder().http_status_as_error(false).build().into();
    let post = agent.post(&format!("http://{address}/api/call"));
    let stamp = &now(address)["stamp"];
    let call = format!(r#"{{"do":"{what}","stamp":{stamp}}}"#);
    post.header("Authorization", format!("Bearer {TOKEN}")).send(call).unwrap();
}

/// Messages as fast as the line takes them, again and again from a new connection.
fn flood_page(address: &str, ended: &AtomicBool) {
    while !ended.load(Ordering::Relaxed) {
        let mut socket = socket::connect(address, TOKEN);
        while !ended.load(Ordering::Relaxed) && socket.send(Message::text(r#"{"do":"pause"}"#)).is_ok() {}
    }
}

/// What one run came to.
struct Measured {
    report: Value,
    /// Messages that the page dropped.
    dropped: u64,
    /// Frames that were sent, a second.
    frames_per_s: f64,
    is_tracking: bool,
}

fn measured(flood: Flood) -> Measured {
    let mut simulated = Program::start(&["simulate", ROBOT, "--interface", Namespace::FAR]);
    simulated.wait(|line| line.contains("SCHED_FIFO").then_some(()));
    let mut robot = Program::start(&[
        "run",
        ROBOT,
        "--circle",
        "radius_m=0.5,duration_s=60",
        "--interface",
        Namespace::NEAR,
        "--dashboard=127.0.0.1:0",
    ]);
    let address =
        robot.wait(|line| Some(line.strip_prefix("dashboard: http://")?.split_once('/')?.0.to_owned()));
    let begin = Instant::now();
    while now(&address)["counts"][0].as_u64() < Some(100) && begin.elapsed() < Duration::from_secs(30) {
        std::thread::sleep(Duration::from_millis(50));
    }
    call(&address, "enable");
    std::thread::sleep(Duration::from_millis(500));
    call(&address, "track");
    std::thread::sleep(Duration::from_millis(100));
    let ended = AtomicBool::new(false);
    let sent = std::thread::scope(|scope| {
        let flooders = if flood == Flood::Page { FLOODERS } else { 0 };
        let pages: Vec<_> = (0..flooders).map(|_| scope.spawn(|| flood_page(&address, &ended))).collect();
        let ended = &ended;
        let frames = match flood {
            Flood::Frames { per_s } => Some(scope.spawn(move || flood_frames(per_s, ended))),
            _ => None,
        };
        std::thread::sleep(MEASURED);
        ended.store(true, Ordering::Relaxed);
        pages.into_iter().for_each(|page| drop(page.join()));
        frames.map_or(0, |frames| frames.join().unwrap())
    });
    let seen = now(&address);
    Measured {
        dropped: seen["server"][4].as_u64().unwrap_or(0),
        is_tracking: seen["phase"] == "tracking",
        frames_per_s: sent as f64 / MEASURED.as_secs_f64(),
        report: robot.end(),
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() {
    let namespace = match Namespace::new() {
        Ok(namespace) => namespace,
        Err(error) => {
            eprintln!("SKIPPED: {error}");
            return;
        }
    };
    let mut rounds: [Vec<Measured>; FLOODS.len()] = Default::default();
    for _ in 0..ROUNDS {
        for (round, flood) in rounds.iter_mut().zip(FLOODS) {
            round.push(namespace.run(|| measured(flood)));
        }
    }
    println!(
        "medians of {ROUNDS} runs of {} s each, in turn; frames: of another MainDevice",
        MEASURED.as_secs()
    );
    let row = |name: &str, words: [String; FLOODS.len()]| {
        println!("{name:28}{}", words.map(|words| format!(" {words:>12}")).concat());
    };
    row("flooded by", FLOODS.map(Flood::name));
    let print = |name: &str, value: &dyn Fn(&Measured) -> f64| {
        row(
            name,
            std::array::from_fn(|flood| format!("{:.1}", median(rounds[flood].iter().map(value).collect()))),
        );
    };
    for (name, key) in
        [("wake-up late by", "wake_up_ns"), ("round trip", "round_trip_ns"), ("computing", "compute_ns")]
    {
        for quantile in ["p50", "p99", "p999", "max"] {
            print(&format!("{name}, {quantile}, us"), &|measured| {
                measured.report["timing"][key][quantile].as_f64().unwrap_or(f64::NAN) * 1e-3
            });
        }
    }
    for (name, key) in [("cycles", "cycles"), ("left out", "overruns"), ("lost frames", "lost_frames")] {
        print(name, &|measured| measured.report[key].as_f64().unwrap_or(f64::NAN));
    }
    print("foreign frames seen", &|measured| {
        measured.report["bus"]["frames_foreign"].as_f64().unwrap_or(f64::NAN)
    });
    print("foreign frames sent, 1/s", &|measured| measured.frames_per_s);
    print("messages dropped", &|measured| measured.dropped as f64);
    let stopped = |flood: usize| rounds[flood].iter().filter(|measured| !measured.is_tracking).count();
    row("runs that were stopped", std::array::from_fn(|flood| stopped(flood).to_string()));
}
