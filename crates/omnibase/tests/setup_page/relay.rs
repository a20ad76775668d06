//! A line between page and program that can be late, or dead without a word.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

const LOOK: Duration = Duration::from_millis(5);

/// How the line is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line {
    /// All passes at once.
    Passes,
    /// All passes, so much later, each way.
    Late(Duration),
    /// Nothing passes, and neither side is told.
    Dead,
}

/// The line.
pub struct Relay {
    /// Address and port.
    pub at: String,
    line: Arc<Mutex<Line>>,
    to: Arc<Mutex<String>>,
}

impl Relay {
    /// A line to this address and port, through which all passes at first.
    pub fn start(to: &str) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let at = listener.local_addr().unwrap().to_string();
        let line = Arc::new(Mutex::new(Line::Passes));
        let to = Arc::new(Mutex::new(to.to_owned()));
        let (far_end, of) = (Arc::clone(&to), Arc::clone(&line));
        std::thread::spawn(move || {
            for near in listener.incoming().map_while(Result::ok) {
                let Ok(far) = TcpStream::connect(&*far_end.lock().unwrap()) else { continue };
                for stream in [&near, &far] {
                    stream.set_nodelay(true).unwrap();
                }
                pass(near.try_clone().unwrap(), far.try_clone().unwrap(), Arc::clone(&of));
                pass(far, near, Arc::clone(&of));
            }
        });
        Relay { at, line, to }
    }

    /// From the next connection on it leads to this address and port.
    pub fn lead(&self, to: &str) {
        *self.to.lock().unwrap() = to.to_owned();
    }

    pub fn set(&self, line: Line) {
        *self.line.lock().unwrap() = line;
    }
}

/// One way of one connection.
fn pass(mut from: TcpStream, mut to: TcpStream, line: Arc<Mutex<Line>>) {
    let (sender, receiver) = channel::<(Instant, Vec<u8>)>();
    std::thread::spawn(move || {
        let mut bytes = [0; 4096];
        while let Ok(length @ 1..) = from.read(&mut bytes) {
            if sender.send((Instant::now(), bytes[..length].to_vec())).is_err() {
                return;
            }
        }
    });
    std::thread::spawn(move || {
        while let Ok((came, bytes)) = receiver.recv() {
            loop {
                let due = match *line.lock().unwrap() {
                    Line::Passes => Some(came),
                    Line::Late(by) => Some(came + by),
                    Line::Dead => None,
                };
                match due {
                    Some(due) if Instant::now() >= due => break,
                    _ => std::thread::sleep(LOOK),
                }
            }
            if to.write_all(&bytes).is_err() {
                return;
            }
        }
        let _ = to.shutdown(std::net::Shutdown::Both);
    });
}
