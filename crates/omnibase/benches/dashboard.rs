//! What a robot's page costs: CPU of its thread and of the cycle, without pages, with two, and with one that floods.
//!
//! `cargo bench -p omnibase --bench dashboard`

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use tungstenite::Message;

#[path = "../tests/dashboard/socket.rs"]
mod socket;

const TOKEN: &str = "token-of-the-bench";
const MEASURED: Duration = Duration::from_secs(8);
const ROBOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/bmm.toml");

/// CPU time of a thread of a process, s.
fn cpu_s(process: u32, thread: &str) -> f64 {
    let tasks = std::fs::read_dir(format!("/proc/{process}/task")).unwrap();
    let of = |task: std::fs::DirEntry| {
        let name = std::fs::read_to_string(task.path().join("comm")).ok()?;
        let spent = std::fs::read_to_string(task.path().join("schedstat")).ok()?;
        let ns: f64 = spent.split_whitespace().next()?.parse().ok()?;
        (name.trim() == thread).then_some(ns * 1e-9)
    };
    tasks.flatten().filter_map(of).sum()
}

fn value(address: &str, name: &str, place: usize) -> u64 {
    let mut answer = ureq::get(&format!("http://{address}/api/now")).call().unwrap();
    let text = answer.body_mut().read_to_string().unwrap();
    serde_json::from_str::<serde_json::Value>(&text).unwrap()[name][place].as_u64().unwrap_or(0)
}

fn call(address: &str, text: &str) {
    let post = ureq::post(&format!("http://{address}/api/call"));
    post.header("Authorization", format!("Bearer {TOKEN}")).send(text).unwrap();
}

struct Ended(Child);

impl Drop for Ended {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn main() {
    let mut process = Command::new(env!("CARGO_BIN_EXE_omnibase"))
        .args(["run", ROBOT, "--circle", "radius_m=0.5,duration_s=60"])
        .args(["--dashboard=127.0.0.1:0", "--paths"])
        .env("OMNIBASE_TOKEN", TOKEN)
        .arg(std::env::temp_dir())
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(process.stderr.take().unwrap()).lines().map_while(Result::ok);
    let address = lines
        .find_map(|line| Some(line.strip_prefix("dashboard: http://")?.split_once('/')?.0.to_owned()))
        .unwrap();
    let robot = Ended(process);
    let id = robot.0.id();
    std::thread::sleep(Duration::from_millis(500));
    call(&address, r#"{"do":"enable"}"#);
    std::thread::sleep(Duration::from_millis(500));
    call(&address, r#"{"do":"track"}"#);
    println!(
        "{:24} {:>12} {:>12} {:>12} {:>14} {:>9}",
        "", "page's CPU", "cycle's CPU", "cycles/s", "messages/s", "dropped"
    );
    for (name, pages, floods) in
        [("no page", 0, false), ("two pages", 2, false), ("two pages and a flood", 2, true)]
    {
        let ended = Arc::new(AtomicBool::new(false));
        let messages = Arc::new(AtomicU64::new(0));
        let mut threads = Vec::new();
        for _ in 0..pages {
            let (mut socket, ended, messages) =
                (socket::connect(&address, TOKEN), ended.clone(), messages.clone());
            threads.push(std::thread::spawn(move || {
                while !ended.load(Ordering::Relaxed) {
                    if socket.read().is_ok_and(|message| message.is_text()) {
                        messages.fetch_add(1, Ordering::Relaxed);
                    }
                }
            }));
        }
        if floods {
            let (address, ended) = (address.clone(), ended.clone());
            threads.push(std::thread::spawn(move || {
                // It comes again whenever it is cut off.
                while !ended.load(Ordering::Relaxed) {
                    let mut socket = socket::connect(&address, TOKEN);
                    while !ended.load(Ordering::Relaxed)
                        && socket.send(Message::text(r#"{"do":"alive"}"#)).is_ok()
                    {}
                }
            }));
        }
        let (begin, page_s, cycle_s) = (Instant::now(), cpu_s(id, "dashboard"), cpu_s(id, "omnibase"));
        let (cycles, dropped) = (value(&address, "counts", 0), value(&address, "server", 4));
        messages.store(0, Ordering::Relaxed);
        std::thread::sleep(MEASURED);
        let counted = messages.load(Ordering::Relaxed);
        let cycles = value(&address, "counts", 0) - cycles;
        let seconds = begin.elapsed().as_secs_f64();
        println!(
            "{name:24} {:>10.2} % {:>10.2} % {:>12.1} {:>14.1} {:>9}",
            100.0 * (cpu_s(id, "dashboard") - page_s) / seconds,
            100.0 * (cpu_s(id, "omnibase") - cycle_s) / seconds,
            cycles as f64 / seconds,
            counted as f64 / seconds,
            value(&address, "server", 4) - dropped,
        );
        ended.store(true, Ordering::Relaxed);
        threads.into_iter().for_each(|thread| drop(thread.join()));
    }
}
