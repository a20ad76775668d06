//! Those who mean harm: what they send, and how they keep a server busy.
#![allow(dead_code, reason = "each test uses its part of it")]

use std::io::{Read, Write};
use std::net::{IpAddr, SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use serde_json::json;

/// Their connections.
pub const HOSTILE: usize = 128;
/// What is to be heard all the same.
pub const STOP: &str = r#"{"do":"stop","category":"category_2"}"#;

/// A request as it goes over the line.
pub fn request(method: &str, path: &str, token: Option<&str>, body: &str) -> String {
    let token = token.map_or(String::new(), |token| format!("Authorization: Bearer {token}\r\n"));
    let length = body.len();
    format!("{method} {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n{token}Content-Length: {length}\r\n\r\n{body}")
}

/// Those who mean harm, until they are dropped.
pub struct Hostile {
    ended: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Hostile {
    /// So many threads that do that again and again, each with its number.
    pub fn start(count: usize, act: impl Fn(usize) + Send + Sync + 'static) -> Hostile {
        let (ended, act) = (Arc::new(AtomicBool::new(false)), Arc::new(act));
        let threads = (0..count).map(|number| {
            let (ended, act) = (ended.clone(), act.clone());
            std::thread::spawn(move || {
                while !ended.load(Ordering::Relaxed) {
                    act(number);
                }
            })
        });
        Hostile { threads: threads.collect(), ended }
    }
}

impl Drop for Hostile {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        self.threads.drain(..).for_each(|thread| drop(thread.join()));
    }
}

/// A connection from one of this computer's own addresses.
pub fn connect(to: SocketAddr, number: usize) -> std::io::Result<TcpStream> {
    let from = IpAddr::from([127, 0, 0, 1 + (number % 3) as u8]);
    let socket =
        rustix::net::socket(rustix::net::AddressFamily::INET, rustix::net::SocketType::STREAM, None)?;
    rustix::net::bind(&socket, &SocketAddr::new(from, 0))?;
    rustix::net::connect(&socket, &to)?;
    Ok(TcpStream::from(socket))
}

/// Asks once, and reads what comes until the line is quiet or closed.
pub fn ask(to: SocketAddr, number: usize, requests: &str) {
    let Ok(mut line) = connect(to, number) else { return };
    let _ = line.set_read_timeout(Some(Duration::from_millis(200)));
    let _ = line.write_all(requests.as_bytes());
    let mut bytes = [0; 65_536];
    while line.read(&mut bytes).is_ok_and(|length| length > 0) {}
}

/// A path of 18,000 points in the longest body that is taken.
pub fn heaviest() -> String {
    let lines: Vec<String> = (0..18_000).map(|n| format!("{n} {} 0 0", [".1", ".2"][n / 2 % 2])).collect();
    json!({"do": "load_points", "text": lines.join("\n"), "stamp": 0}).to_string()
}

/// What only reads, 16 requests at once.
pub fn reads() -> String {
    ["planned", "now", "trace", "robot"]
        .map(|what| request("GET", &format!("/api/{what}"), None, "").repeat(4))
        .concat()
}

/// A request whose header or body never ends.
pub fn half(number: usize) -> String {
    let whole = request("POST", "/api/call", number.is_multiple_of(2).then_some("wrong"), STOP);
    whole[..whole.len() - 1 - 20 * (number % 3)].to_owned()
}
