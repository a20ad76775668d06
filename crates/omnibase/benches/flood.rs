//! What a client that floods the page does to a cycle in real time: two processes over a virtual cable, both with
//! `--realtime`, without and with the flood, in turn.
//!
//! `cargo bench --profile release -p omnibase --bench flood`

#[path = "../tests/dashboard/socket.rs"]
mod socket;

use omnibase_host::Namespace;
use serde_json::Value;
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, ChildStderr, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tungstenite::Message;

const TOKEN: &str = "token-of-the-bench";
const ROBOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/bmm.toml");
/// Of each kind; one may be hit by something else on this machine.
const ROUNDS: usize = 5;
const MEASURED: Duration = Duration::from_secs(10);
/// Two clients that flood, and as much patience as a host without real-time rights needs to get through.
const FLOODERS: usize = 2;
const PATIENT: [&str; 4] = [
    "--set",
    "drive_defaults.parameters=[{object = \"0x10F1.2\", type = \"u16\", value = 15}]",
    "--set",
    "safety.lost_exchanges_tolerated=5",
];

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
    post.header("Authorization", format!("Bearer {TOKEN}")).send(format!(r#"{{"do":"{what}"}}"#)).unwrap();
}

/// Messages as fast as the line takes them, again and again from a new connection.
fn flood(address: &str, ended: &AtomicBool) {
    while !ended.load(Ordering::Relaxed) {
        let mut socket = socket::connect(address, TOKEN);
        while !ended.load(Ordering::Relaxed) && socket.send(Message::text(r#"{"do":"pause"}"#)).is_ok() {}
    }
}

/// One run; its report, and how many messages were dropped.
fn measured(is_flooded: bool) -> (Value, u64) {
    let mut simulated = Program::start(&["simulate", ROBOT, "--interface", Namespace::FAR]);
    simulated.wait(|line| line.contains("SCHED_FIFO").then_some(()));
    let mut robot = Program::start(&[
        "run",
        ROBOT,
        "--circle",
        "radius=0.5,period=60",
        "--interface",
        Namespace::NEAR,
        "--dashboard=127.0.0.1:0",
        "--token",
        TOKEN,
    ]);
    let address =
        robot.wait(|line| Some(line.strip_prefix("dashboard: http://")?.split_once('/')?.0.to_owned()));
    let begin = Instant::now();
    while now(&address)["counts"][0].as_u64() < Some(100) && begin.elapsed() < Duration::from_secs(30) {
        std::thread::sleep(Duration::from_millis(50));
    }
    call(&address, "enable");
    std::thread::sleep(Duration::from_millis(500));
    let ended = Arc::new(AtomicBool::new(false));
    let flooders: Vec<_> = (0..if is_flooded { FLOODERS } else { 0 })
        .map(|_| {
            let (address, ended) = (address.clone(), ended.clone());
            std::thread::spawn(move || flood(&address, &ended))
        })
        .collect();
    call(&address, "track");
    std::thread::sleep(MEASURED);
    ended.store(true, Ordering::Relaxed);
    flooders.into_iter().for_each(|flooder| drop(flooder.join()));
    let dropped = now(&address)["server"][4].as_u64().unwrap_or(0);
    (robot.end(), dropped)
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
    let mut rounds: [Vec<(Value, u64)>; 2] = Default::default();
    for _ in 0..ROUNDS {
        for (number, is_flooded) in [false, true].into_iter().enumerate() {
            rounds[number].push(namespace.run(|| measured(is_flooded)));
        }
    }
    println!("medians of {ROUNDS} runs of {} s each, in turn", MEASURED.as_secs());
    println!("{:28} {:>12} {:>14} {:>8}", "", "without", "with a flood", "ratio");
    let print = |name: &str, value: &dyn Fn(&(Value, u64)) -> f64| {
        let [without, with] = [0, 1].map(|kind| median(rounds[kind].iter().map(value).collect()));
        let ratio = if without > 0.0 { format!("{:.2}", with / without) } else { "-".to_owned() };
        println!("{name:28} {without:>12.1} {with:>14.1} {ratio:>8}");
    };
    for (name, key) in
        [("wake-up late by", "wake_up_ns"), ("round trip", "round_trip_ns"), ("computing", "compute_ns")]
    {
        for quantile in ["p50", "p99", "p999", "max"] {
            let us = |(report, _): &(Value, u64)| {
                report["timing"][key][quantile].as_f64().unwrap_or(f64::NAN) * 1e-3
            };
            print(&format!("{name}, {quantile}, us"), &us);
        }
    }
    for (name, key) in [("cycles", "cycles"), ("left out", "overruns"), ("lost frames", "lost_frames")] {
        print(name, &|(report, _)| report[key].as_f64().unwrap_or(f64::NAN));
    }
    print("messages dropped", &|(_, dropped)| *dropped as f64);
}
