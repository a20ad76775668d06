//! A WebSocket of a robot's API, over a network or this machine's own socket.

use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, Timespec};
use tungstenite::client::IntoClientRequest;
use tungstenite::handshake::HandshakeError;
use tungstenite::protocol::WebSocket;
use tungstenite::{Error as SocketError, Message};

use crate::Error;
use crate::robots::{Endpoint, Found, connect};

/// The longest wait for a connection, and for the first that a robot says.
const LONGEST: Duration = Duration::from_secs(5);
/// How long nothing may come from the robot before it counts as gone.
const SILENCE: Duration = Duration::from_secs(2);

/// A connection to the robot's computer, or on it.
pub(crate) enum Stream {
    Tcp(TcpStream),
    Unix(UnixStream),
}

impl Read for Stream {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        match self {
            Stream::Tcp(stream) => stream.read(bytes),
            Stream::Unix(stream) => stream.read(bytes),
        }
    }
}

impl Write for Stream {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Stream::Tcp(stream) => stream.write(bytes),
            Stream::Unix(stream) => stream.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Stream::Tcp(stream) => stream.flush(),
            Stream::Unix(stream) => stream.flush(),
        }
    }
}

impl AsFd for Stream {
    fn as_fd(&self) -> BorrowedFd<'_> {
        match self {
            Stream::Tcp(stream) => stream.as_fd(),
            Stream::Unix(stream) => stream.as_fd(),
        }
    }
}

/// Reaches a robot; how it is called in a request.
pub(crate) fn reach(robot: &Found) -> io::Result<(Stream, String)> {
    Ok(match &robot.place {
        Endpoint::Address(address) => {
            let stream = TcpStream::connect_timeout(address, LONGEST)?;
            stream.set_nodelay(true)?;
            stream.set_read_timeout(Some(LONGEST))?;
            (Stream::Tcp(stream), address.to_string())
        }
        Endpoint::Socket(path) => {
            let stream = connect(path, LONGEST)?;
            stream.set_read_timeout(Some(LONGEST))?;
            (Stream::Unix(stream), "localhost".to_owned())
        }
    })
}

/// What a robot says on a connection, and what it is told; nothing of it waits but where a time is given.
pub(crate) struct Connection {
    socket: WebSocket<Stream>,
    heard: Instant,
}

impl Connection {
    /// Opens an address of the API, as `states?every_ms=10`, and hears the first message.
    pub(crate) fn open(robot: &Found, what: &str) -> Result<(Self, Message), Error> {
        let no_answer = |error: &dyn std::fmt::Display| Error::NoAnswer(format!("{}: {error}", robot.place));
        let (stream, host) = reach(robot).map_err(|error| no_answer(&error))?;
        let request = format!("ws://{host}/api/{what}").into_client_request();
        let mut request = request.map_err(|error| Error::Refused(error.to_string()))?;
        if !robot.token.is_empty() {
            let token = format!("Bearer {}", robot.token).parse();
            let token = token.map_err(|_| Error::Refused("the token has characters that none has".into()))?;
            request.headers_mut().insert("Authorization", token);
        }
        let (mut socket, _) = tungstenite::client(request, stream).map_err(|error| match error {
            HandshakeError::Failure(SocketError::Http(answer)) => Error::Refused(refusal(&answer)),
            HandshakeError::Failure(error) => no_answer(&error),
            HandshakeError::Interrupted(_) => Error::Silent,
        })?;
        let first = socket.read().map_err(ended)?;
        match socket.get_ref() {
            Stream::Tcp(stream) => stream.set_nonblocking(true),
            Stream::Unix(stream) => stream.set_nonblocking(true),
        }
        .map_err(|error| no_answer(&error))?;
        Ok((Connection { socket, heard: Instant::now() }, first))
    }

    /// The next message, where one comes in that time; an error where the robot is silent for long.
    pub(crate) fn hear(&mut self, longest: Duration) -> Result<Option<Message>, Error> {
        let until = Instant::now() + longest;
        loop {
            match self.socket.read() {
                Ok(Message::Close(_)) => return Err(Error::Ended("as it was told".to_owned())),
                Ok(message) => {
                    self.heard = Instant::now();
                    if matches!(message, Message::Text(_) | Message::Binary(_)) {
                        return Ok(Some(message));
                    }
                }
                Err(SocketError::Io(error)) if error.kind() == ErrorKind::WouldBlock => {
                    if self.heard.elapsed() > SILENCE {
                        return Err(Error::Silent);
                    }
                    let left = until.saturating_duration_since(Instant::now());
                    if left.is_zero() {
                        return Ok(None);
                    }
                    self.await_bytes(left)?;
                }
                Err(error) => return Err(ended(error)),
            }
        }
    }

    fn await_bytes(&self, longest: Duration) -> Result<(), Error> {
        let longest = Timespec::try_from(longest.min(SILENCE)).map_err(|_| Error::Silent)?;
        let mut polled = [PollFd::new(self.socket.get_ref(), PollFlags::IN)];
        match rustix::event::poll(&mut polled, Some(&longest)) {
            // A signal came: what is to be done then is the program's to know.
            Ok(_) | Err(rustix::io::Errno::INTR) => Ok(()),
            Err(error) => Err(Error::Ended(error.to_string())),
        }
    }

    /// Says something; what the line doesn't take at once goes with what follows.
    pub(crate) fn say(&mut self, text: String) -> Result<(), Error> {
        match self.socket.send(Message::text(text)) {
            Err(SocketError::Io(error)) if error.kind() == ErrorKind::WouldBlock => Ok(()),
            said => said.map_err(ended),
        }
    }
}

/// Why a robot opened no WebSocket, in its own words.
fn refusal(answer: &tungstenite::http::Response<Option<Vec<u8>>>) -> String {
    let body = answer.body().as_deref().map(String::from_utf8_lossy).unwrap_or_default();
    let said: Option<serde_json::Value> = serde_json::from_str(&body).ok();
    let words = said.as_ref().and_then(|said| said["text"].as_str()).unwrap_or(&body);
    let words = words.strip_prefix("refused: ").unwrap_or(words).trim();
    if words.is_empty() { answer.status().to_string() } else { words.to_owned() }
}

fn ended(error: SocketError) -> Error {
    match error {
        SocketError::Io(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
            Error::Silent
        }
        error => Error::Ended(error.to_string()),
    }
}
