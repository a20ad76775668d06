//! How soon STOP is answered whatever else is asked: in real time, from the press to the robot's answer.
//!
//! `cargo bench --profile release -p omnibase --bench stop`; another build of the program is measured beside it where
//! `OMNIBASE_OTHER` names it.

#[path = "../../dashboard/tests/hostile/mod.rs"]
mod hostile;
#[path = "../tests/dashboard/socket.rs"]
mod socket;

use hostile::{HOSTILE, Hostile, STOP, ask, connect, half, heaviest, reads, request};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tungstenite::Message;

const ROBOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/bmm.toml");
/// Stops of each kind under each attack.
const STOPS: usize = 50;
/// A stop that isn't answered by then is none.
const LONGEST: Duration = Duration::from_secs(10);
/// Stops of a kind after which no more are tried where none is answered.
const MOST_UNHEARD: usize = 3;
/// What is tried against it.
const ATTACKS: [&str; 6] = [
    "nothing",
    "uploads of 18,000 points",
    "40 that read without a token",
    "16 that guess the token",
    "128 that only hold their places",
    "128 that come again and again",
];

/// A simulated robot with its page.
struct Robot {
    process: Child,
    address: SocketAddr,
    token: String,
    _folder: tempfile::TempDir,
}

impl Robot {
    fn start(program: &str) -> Robot {
        let folder = tempfile::tempdir().unwrap();
        let mut process = Command::new(program)
            .args(["run", ROBOT, "--dashboard=127.0.0.1:0", "--json", "--paths"])
            .arg(folder.path())
            .env("XDG_RUNTIME_DIR", folder.path())
            .env_remove("OMNIBASE_TOKEN")
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(process.stderr.take().unwrap()).lines().map_while(Result::ok);
        let said = lines.by_ref().find_map(|line| {
            let (address, token) = line.strip_prefix("dashboard: http://")?.split_once("/?token=")?;
            Some((address.parse().ok()?, token.to_owned()))
        });
        std::thread::spawn(move || lines.for_each(drop));
        let (address, token) = said.expect("it says where its page is");
        Robot { process, address, token, _folder: folder }
    }

    /// A stop by a request of its own; `None` where it isn't done.
    fn post(&self, token: Option<&str>) -> Option<Duration> {
        let begin = Instant::now();
        let mut line = TcpStream::connect_timeout(&self.address, LONGEST).ok()?;
        line.set_read_timeout(Some(LONGEST)).ok()?;
        line.write_all(request("POST", "/api/call", token, STOP).as_bytes()).ok()?;
        let mut answer = [0; 12];
        line.read_exact(&mut answer).ok()?;
        (&answer == b"HTTP/1.1 200").then(|| begin.elapsed())
    }

    /// Those who mean harm in one of these ways.
    fn attacked(&self, attack: &str) -> (Vec<TcpStream>, Option<Hostile>) {
        let address = self.address;
        let held = |count: usize| {
            let line = |number| {
                let mut line = connect(address, number).ok()?;
                line.write_all(half(number).as_bytes()).ok()?;
                Some(line)
            };
            (0..count).filter_map(line).collect()
        };
        let hostile = match attack {
            "uploads of 18,000 points" => {
                let upload = request("POST", "/api/call", Some(&self.token), &heaviest());
                Some(Hostile::start(2, move |number| ask(address, number, &upload)))
            }
            "40 that read without a token" => {
                Some(Hostile::start(40, move |number| ask(address, number, &reads())))
            }
            "16 that guess the token" => Some(Hostile::start(16, move |number| {
                let guess =
                    format!("{number}-{:?}", Instant::now()).replace(|c: char| !c.is_alphanumeric(), "-");
                ask(address, number, &request("GET", "/api/now", Some(&guess), ""));
            })),
            "128 that only hold their places" => return (held(HOSTILE), None),
            "128 that come again and again" => Some(Hostile::start(8, move |number| {
                let lines: Vec<_> =
                    (0..HOSTILE / 8).filter_map(|n| connect(address, number + n).ok()).collect();
                for (n, mut line) in lines.iter().enumerate() {
                    let _ = line.write_all(half(n).as_bytes());
                }
            })),
            _ => None,
        };
        (Vec::new(), hostile)
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Stops like that, ms; `None` for one that isn't answered.
fn stops(mut stop: impl FnMut() -> Option<Duration>) -> Vec<Option<f64>> {
    let mut all: Vec<Option<f64>> = Vec::new();
    while all.len() < STOPS && !(all.len() >= MOST_UNHEARD && all.iter().all(Option::is_none)) {
        all.push(stop().map(|time| time.as_secs_f64() * 1e3));
        // Not in step with what is done against it.
        std::thread::sleep(Duration::from_millis(13 + 7 * (all.len() as u64 % 5)));
    }
    all
}

fn print(program: &str, attack: &str, how: &str, all: &[Option<f64>]) {
    let mut heard: Vec<f64> = all.iter().flatten().copied().collect();
    heard.sort_by(f64::total_cmp);
    let quantile = |share: f64| match heard.last() {
        Some(_) => format!("{:.1}", heard[((heard.len() - 1) as f64 * share).round() as usize]),
        None => "-".to_owned(),
    };
    let [p50, p99, max] = [0.5, 0.99, 1.0].map(quantile);
    let unheard = all.len() - heard.len();
    println!("{program:6} {attack:32} {how:22} {p50:>9} {p99:>9} {max:>9} {unheard:>4} of {}", all.len());
}

fn main() {
    let other = std::env::var("OMNIBASE_OTHER").ok();
    let programs =
        [Some(("this", env!("CARGO_BIN_EXE_omnibase"))), other.as_deref().map(|path| ("other", path))];
    println!(
        "{:6} {:32} {:22} {:>9} {:>9} {:>9} unheard",
        "build", "against it", "stop, ms", "p50", "p99", "max"
    );
    for (program, path) in programs.into_iter().flatten() {
        for attack in ATTACKS {
            let robot = Robot::start(path);
            std::thread::sleep(Duration::from_millis(500));
            let mut page = socket::connect(&robot.address.to_string(), &robot.token);
            if let tungstenite::stream::MaybeTlsStream::Plain(line) = page.get_ref() {
                line.set_read_timeout(Some(LONGEST)).unwrap();
            }
            let hostile = robot.attacked(attack);
            std::thread::sleep(Duration::from_millis(500));
            print(program, attack, "request, with token", &stops(|| robot.post(Some(&robot.token))));
            print(program, attack, "request, without", &stops(|| robot.post(None)));
            let mut number = 0;
            let by_page = stops(|| {
                number += 1;
                let begin = Instant::now();
                let text = format!(r#"{{"number":{number},"do":"stop","category":"category_2"}}"#);
                page.send(Message::text(text)).ok()?;
                loop {
                    let Message::Text(text) = page.read().ok()? else { continue };
                    if text.starts_with(&format!(r#"{{"answer":{number},"#)) {
                        return Some(begin.elapsed());
                    }
                }
            });
            print(program, attack, "page", &by_page);
            drop(hostile);
        }
    }
}
