//! The line between a page and its robot, in the hand of a test: it passes, falls silent, or is cut.

use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::Duration;

/// How often a connection looks whether the line has changed.
const LOOK: Duration = Duration::from_millis(5);
/// How a page asks for the connection by which it sees and commands.
const LIVE: &[u8] = b"GET /api/live";

/// What the line does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineMode {
    /// Everything passes.
    Open = 0,
    /// Connections stay, and what is sent waits until the line is open again: a cable that is out, as TCP sees it.
    Silent = 1,
    /// Connections are closed, and so are new ones.
    Cut = 2,
    /// As cut for the page's live connection; single requests pass.
    WithoutLive = 3,
}

/// A port that leads to a robot's page.
pub struct Line {
    /// `http://address:port`.
    pub at: String,
    way: Arc<AtomicU8>,
}

impl Line {
    /// A line to `http://address:port`.
    pub fn to(robot: &str) -> Line {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let at = format!("http://{}", listener.local_addr().unwrap());
        let line = Line { at, way: Arc::new(AtomicU8::new(LineMode::Open as u8)) };
        let (way, robot) = (line.way.clone(), robot.strip_prefix("http://").unwrap().to_owned());
        std::thread::spawn(move || {
            for page in listener.incoming().map_while(Result::ok) {
                let (way, robot) = (way.clone(), robot.clone());
                std::thread::spawn(move || carry(&page, &robot, &way));
            }
        });
        line
    }

    /// From now on it does that.
    pub fn set(&self, way: LineMode) {
        self.way.store(way as u8, Ordering::SeqCst);
    }
}

fn is(way: &AtomicU8, what: LineMode) -> bool {
    way.load(Ordering::SeqCst) == what as u8
}

/// One connection, until one of its ends or the line closes it.
fn carry(mut page: &TcpStream, robot: &str, way: &Arc<AtomicU8>) {
    let mut first = [0; 4096];
    while is(way, LineMode::Silent) {
        std::thread::sleep(LOOK);
    }
    if is(way, LineMode::Cut) {
        return;
    }
    let Ok(length) = page.read(&mut first) else { return };
    let is_live = first[..length].starts_with(LIVE);
    let Ok(mut there) = TcpStream::connect(robot) else { return };
    let _ = (page.set_nodelay(true), there.set_nodelay(true));
    while is(way, LineMode::Silent) {
        std::thread::sleep(LOOK);
    }
    if is(way, LineMode::WithoutLive) && is_live || there.write_all(&first[..length]).is_err() {
        return;
    }
    std::thread::scope(|scope| {
        scope.spawn(|| pass(&there, page, way, is_live));
        pass(page, &there, way, is_live);
    });
}

fn pass(mut from: &TcpStream, mut to: &TcpStream, way: &AtomicU8, is_live: bool) {
    let mut bytes = [0; 16 * 1024];
    let _ = from.set_read_timeout(Some(LOOK));
    loop {
        if is(way, LineMode::Cut) || is(way, LineMode::WithoutLive) && is_live {
            break;
        }
        if is(way, LineMode::Silent) {
            std::thread::sleep(LOOK);
            continue;
        }
        let length = match from.read(&mut bytes) {
            Ok(0) => break,
            Ok(length) => length,
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => continue,
            Err(_) => break,
        };
        // Read while the line fell silent: it waits as what comes behind it.
        while is(way, LineMode::Silent) {
            std::thread::sleep(LOOK);
        }
        if is(way, LineMode::Cut) || to.write_all(&bytes[..length]).is_err() {
            break;
        }
    }
    let _ = (from.shutdown(Shutdown::Both), to.shutdown(Shutdown::Both));
}
