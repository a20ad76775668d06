//! STOP is heard whatever else is asked: measured in cycles of the robot, each of which is 1 ms on its own clock.
//!
//! That clock goes on as the server's thread computes, and stands while it doesn't: a cycle is 1 ms of its
//! processor time. So a busy machine, on which that thread gets no time, makes nothing late here; what the
//! thread does before it hears a stop does, whoever asked for it.
//!
//! Nor does a cycle that comes late: it runs on the server's processor, so the server doesn't go on meanwhile.
//!
//! What it would wait for without computing never ends in these tests: it is a file that never gives a byte.

mod bench;
mod hostile;

use std::io::Write;
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};

use bench::{Bench, Page, TOKEN};
use hostile::{HOSTILE, Hostile, STOP, ask, connect, half, heaviest, reads, request};
use omnibase_robot::RequestKind;
use omnibase_robot::signals::{CycleRecord, Phase, StopCategory};
use rustix::thread::{CpuSet, Pid, sched_getaffinity, sched_getcpu, sched_setaffinity};
use serde_json::json;

const CYCLE_NS: u64 = 1_000_000;
/// A stop is taken within so many cycles.
const MOST: u64 = 50;
/// Stops of each kind under each attack.
const STOPS: usize = 10;

/// The thread of the one server of this process.
struct Server(std::path::PathBuf);

impl Server {
    fn find() -> Option<Server> {
        let threads = std::fs::read_dir("/proc/self/task").unwrap().map(|thread| thread.unwrap().path());
        let is_it = |thread: &std::path::PathBuf| {
            std::fs::read_to_string(thread.join("comm")).is_ok_and(|name| name.trim() == "dashboard")
        };
        let mut found: Vec<_> = threads.filter(is_it).collect();
        assert!(found.len() < 2, "{found:?}");
        found.pop().map(Server)
    }

    fn stays_on(&self, processors: &CpuSet) {
        let name = self.0.file_name().unwrap().to_str().unwrap();
        sched_setaffinity(Pid::from_raw(name.parse().unwrap()), processors).unwrap();
    }

    /// How long it has computed.
    fn computed_ns(&self) -> u64 {
        let text = std::fs::read_to_string(self.0.join("schedstat")).unwrap();
        text.split_whitespace().next().unwrap().parse().unwrap()
    }
}

/// A robot that is turned as its server computes.
struct Robot {
    bench: Bench,
    server: Server,
    /// Where the server runs, and the cycle.
    processor: CpuSet,
}

impl Robot {
    fn new() -> Robot {
        let bench = Bench::new();
        // Its thread names itself when it begins.
        let begin = Instant::now();
        let server = loop {
            match Server::find() {
                Some(server) => break server,
                None => assert!(begin.elapsed() < Duration::from_secs(60), "it never begins"),
            }
            std::thread::yield_now();
        };
        let mut processor = CpuSet::new();
        processor.set(sched_getcpu());
        server.stays_on(&processor);
        Robot { bench, server, processor }
    }

    fn address(&self) -> SocketAddr {
        self.bench.dashboard.address
    }

    /// One cycle now; whether it took a stop.
    fn turn(&mut self) -> bool {
        let now_ns = self.server.computed_ns();
        let turn = self.bench.end.turn(now_ns, &CycleRecord::default(), Phase::Holding);
        turn.request.is_some_and(|request| request.kind == RequestKind::Stop(StopCategory::RampAndHold))
    }

    /// Cycles from where a stop is sent to the one that takes it.
    fn cycles(&mut self, what: &str, send: impl FnOnce()) -> u64 {
        while self.turn() {}
        send();
        let anywhere = sched_getaffinity(None).unwrap();
        sched_setaffinity(None, &self.processor).unwrap();
        let sent_ns = self.server.computed_ns();
        let begin = Instant::now();
        loop {
            // It comes after this moment, or at once.
            let not_yet_ns = self.server.computed_ns();
            if self.turn() {
                sched_setaffinity(None, &anywhere).unwrap();
                return not_yet_ns.saturating_sub(sent_ns) / CYCLE_NS;
            }
            assert!(begin.elapsed() < Duration::from_secs(60), "{what}: the stop was never taken");
            std::thread::sleep(Duration::from_micros(100));
        }
    }

    /// Each way to stop, under an attack; the cycles of all of them.
    fn stops(&mut self, attack: &str, page: &mut Page, looker: &mut Page) -> Vec<u64> {
        let address = self.address();
        let mut all = Vec::new();
        for _ in 0..STOPS {
            for (token, how) in [(Some(TOKEN), "with the token"), (None, "without it")] {
                let mut lines = Vec::new();
                all.push(self.cycles(&format!("{attack}, {how}"), || {
                    let mut line = TcpStream::connect(address).unwrap();
                    line.write_all(request("POST", "/api/call", token, STOP).as_bytes()).unwrap();
                    lines.push(line);
                }));
            }
            for (page, who) in [(&mut *page, "a page"), (&mut *looker, "a page that looks on")] {
                all.push(self.cycles(&format!("{attack}, by {who}"), || {
                    page.send(&json!({"do": "stop", "category": "category_2"}))
                }));
            }
        }
        all.sort_unstable();
        println!("{attack}: cycles p50 {}, max {}", all[all.len() / 2], all[all.len() - 1]);
        assert!(all[all.len() - 1] <= MOST, "{attack}: {all:?}");
        all
    }
}

#[test]
fn a_stop_is_taken_within_fifty_cycles_whatever_else_is_asked() {
    let mut robot = Robot::new();
    let address = robot.address();
    let (mut page, mut looker) = (robot.bench.page(), Page::looking(address));
    page.hear("may");
    looker.hear("may");
    robot.stops("nothing else", &mut page, &mut looker);

    // What takes longest of what is accepted.
    let body = heaviest();
    assert!((230_000..262_144).contains(&body.len()), "{}", body.len());
    let upload = request("POST", "/api/call", Some(TOKEN), &body);
    let uploading = Hostile::start(2, move |number| ask(address, number, &upload));
    robot.stops("uploads of 18,000 points", &mut page, &mut looker);
    drop(uploading);

    // Another one, for that one computes for a while.
    drop(robot);
    let mut robot = Robot::new();
    let address = robot.address();
    let (mut page, mut looker) = (robot.bench.page(), Page::looking(address));
    page.hear("may");
    looker.hear("may");

    // Computing that never ends: a saved path that is no file, as often as there are places for it, and once more.
    for name in ["toml", "dat"] {
        let path = robot.bench.folder.path().join(format!("endless.{name}"));
        rustix::fs::mknodat(
            rustix::fs::CWD,
            &path,
            rustix::fs::FileType::Fifo,
            rustix::fs::Mode::from_raw_mode(0o600),
            0,
        )
        .unwrap();
    }
    let endless = request("POST", "/api/call", Some(TOKEN), r#"{"do":"load_saved","name":"endless"}"#);
    let computing: Vec<TcpStream> = (0..3)
        .map(|number| {
            let mut line = connect(address, number).unwrap();
            line.write_all(endless.as_bytes()).unwrap();
            line
        })
        .collect();
    page.send(&json!({"do": "load_saved", "name": "endless"}));
    robot.stops("computing that never ends", &mut page, &mut looker);
    let waiting = Hostile::start(8, move |number| ask(address, number, &endless));
    robot.stops("more of that", &mut page, &mut looker);
    drop(waiting);

    // Pages with the token that send as fast as the line takes it, and come again when they are cut off.
    let flooding = Hostile::start(24, move |number| {
        let mut page = bench::Page::at(address);
        let text = [r#"{"do":"pause"}"#, "{", r#"{"do":"load_saved","name":"endless"}"#][number % 3];
        for _ in 0..10_000 {
            if page.0.send(tungstenite::Message::text(text)).is_err() {
                break;
            }
        }
    });
    robot.stops("24 pages with the token that flood", &mut page, &mut looker);
    drop(flooding);

    // Requests without a token, 16 at once over each connection.
    let reads = reads();
    let reading = Hostile::start(40, move |number| ask(address, number, &reads));
    robot.stops("40 that read without a token", &mut page, &mut looker);
    drop(reading);

    // Wrong tokens, each another one.
    let guessing = Hostile::start(16, move |number| {
        let guess =
            format!("guess-{number}-{:?}", Instant::now()).replace(|c: char| !c.is_alphanumeric(), "-");
        ask(address, number, &request("GET", "/api/now", Some(&guess), ""));
    });
    robot.stops("16 that guess the token", &mut page, &mut looker);
    drop(guessing);

    // Connections that only hold their places, half a header or half a body each, and ever new ones.
    let held: Vec<TcpStream> = (0..HOSTILE)
        .map(|number| {
            let mut line = connect(address, number).unwrap();
            line.write_all(half(number).as_bytes()).unwrap();
            line
        })
        .collect();
    robot.stops("128 connections that only hold their places", &mut page, &mut looker);
    let coming = Hostile::start(8, move |number| {
        let lines: Vec<_> = (0..HOSTILE / 8).filter_map(|n| connect(address, number + n).ok()).collect();
        for (n, mut line) in lines.iter().enumerate() {
            let _ = line.write_all(half(n).as_bytes());
        }
    });
    robot.stops("128 that come again and again", &mut page, &mut looker);
    drop((held, coming, computing));
}
