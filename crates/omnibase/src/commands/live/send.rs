//! `omnibase send`: what a program outside knows, on its way to a running robot.

use super::{Line, Which};
use crate::Outcome;
use crate::every::Every;
use crate::progress::note;
use crate::running::{self, Endpoint};
use anyhow::Context;
use serde_json::{Map, Value, json};
use std::io::{self, BufRead, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::os::unix::net::UnixStream;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::time::{Duration, Instant};
use tungstenite::client::IntoClientRequest;
use tungstenite::protocol::WebSocket;
use tungstenite::{Error, Message};

/// How long nothing may come from the robot before it counts as gone.
const SILENCE: Duration = Duration::from_secs(2);
/// Looked for news of the robot at least so often.
const LOOK: Duration = Duration::from_millis(5);
/// Of what the robot told of its clock in so long, the best counts: later its clock, or this one, may have been set.
const CLOCK_KEPT: Duration = Duration::from_secs(1);
/// By so much the clock may seem to go back where the best is forgotten, ms; measurements stay in their order.
const JITTER_MS: f64 = 10.0;
/// So often at most it is told what was refused.
const TELL: Duration = Duration::from_secs(1);
/// Lines that wait to be sent.
const WAITING: usize = 64;

/// Sends inputs to a running robot, as a `[[source]]` of its file.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase send gate open=1                      once
  omnibase send gate open=1 --every 50ms         again and again, until Ctrl-C
  my_tracker | omnibase send mocap               a line for each measurement: x=1.2 y=0.4 heading=0.1 ..., or one JSON
                                                 object

Each line counts as measured when it is read here; what takes longer than the source's max_age_ms to the robot is not
believed there.")]
pub struct Send {
    /// The source's name.
    source: String,
    /// Its values; without any, lines of standard input are sent.
    #[arg(value_name = "NAME=VALUE", value_parser = parse_value)]
    values: Vec<(String, Option<f64>)>,
    /// Send the values again and again, as 50ms.
    #[arg(long, value_name = "TIME", requires = "values")]
    every: Option<Every>,
    #[command(flatten)]
    which: Which,
}

type Values = Map<String, Value>;

fn parse_value(text: &str) -> Result<(String, Option<f64>), String> {
    let (name, value) = text.split_once('=').ok_or("expected NAME=VALUE, as open=1")?;
    let number: f64 = value.trim().parse().map_err(|_| format!("expected a number, found `{value}`"))?;
    // JSON, in which it is sent, has no other numbers; what isn't known is null there.
    Ok((name.trim().to_owned(), Some(number).filter(|number| number.is_finite())))
}

/// A line of standard input: `x=1 y=2`, or one JSON object.
fn parse_line(line: &str) -> Result<Values, String> {
    if line.trim_start().starts_with('{') {
        return serde_json::from_str(line).map_err(|error| error.to_string());
    }
    line.split_whitespace().map(|part| parse_value(part).map(|(name, value)| (name, json!(value)))).collect()
}

/// A connection to the robot's computer, or on it.
enum Stream {
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

/// The robot's clock as it was told lately, carried on by this computer's own.
#[derive(Clone, Copy, Debug)]
struct RobotClock {
    began: Instant,
    /// How far it is ahead of the time since then, ms, at least: of the present second, and of the one before.
    ahead_ms: [f64; 2],
    since: Instant,
}

impl RobotClock {
    /// Not told yet.
    fn unknown(now: Instant) -> Self {
        RobotClock { began: now, ahead_ms: [f64::NEG_INFINITY; 2], since: now }
    }

    /// Below 0 before the beginning.
    fn elapsed_ms(&self, now: Instant) -> f64 {
        let since_ms = now.saturating_duration_since(self.began).as_secs_f64() * 1e3;
        since_ms - self.began.saturating_duration_since(now).as_secs_f64() * 1e3
    }

    /// What it shows at an instant, ms; what it told took its time to come, so that it may show a little more.
    fn at_ms(&self, instant: Instant) -> f64 {
        self.elapsed_ms(instant) + self.ahead_ms[0].max(self.ahead_ms[1])
    }

    /// Told anew: what came by a quicker way says more.
    fn told(&mut self, told_ms: f64, now: Instant) {
        if now.saturating_duration_since(self.since) > CLOCK_KEPT {
            (self.ahead_ms, self.since) = ([f64::NEG_INFINITY, self.ahead_ms[0]], now);
        }
        self.ahead_ms[0] = self.ahead_ms[0].max(told_ms - self.elapsed_ms(now));
    }
}

/// What the robot said last of this connection.
#[derive(Clone, Debug, Default)]
struct News {
    heard: u64,
    refused: u64,
    why: String,
}

struct Connection {
    socket: WebSocket<Stream>,
    clock: RobotClock,
    /// The last instant that was sent, ms of the robot's clock.
    sent_ms: f64,
    news: News,
    news_at: Instant,
    /// How many refusals the user was told of, and when.
    told: (u64, Instant),
}

impl Connection {
    fn open(line: &Line) -> anyhow::Result<Self> {
        let (stream, host) = match &line.robot.place {
            Endpoint::Address(address) => {
                let stream = TcpStream::connect_timeout(address, super::LONGEST)?;
                stream.set_nodelay(true)?;
                stream.set_read_timeout(Some(super::LONGEST))?;
                (Stream::Tcp(stream), address.to_string())
            }
            Endpoint::Socket(path) => {
                let stream = running::connect(path, super::LONGEST)?;
                stream.set_read_timeout(Some(super::LONGEST))?;
                (Stream::Unix(stream), "localhost".to_owned())
            }
        };
        let mut request = format!("ws://{host}/api/inputs").into_client_request()?;
        if !line.robot.token.is_empty() {
            let token = format!("Bearer {}", line.robot.token).parse()?;
            request.headers_mut().insert("Authorization", token);
        }
        let (socket, _) = tungstenite::client(request, stream)
            .map_err(|error| anyhow::anyhow!("{}: {error}", line.nobody()))?;
        let now = Instant::now();
        let mut connection = Connection {
            socket,
            clock: RobotClock::unknown(now),
            sent_ms: f64::NEG_INFINITY,
            news: News::default(),
            news_at: now,
            told: (0, now),
        };
        // Before the first message nobody knows the robot's clock.
        let first = connection.socket.read()?;
        connection.take(&first)?;
        match connection.socket.get_ref() {
            Stream::Tcp(stream) => stream.set_nonblocking(true)?,
            Stream::Unix(stream) => stream.set_nonblocking(true)?,
        }
        Ok(connection)
    }

    fn take(&mut self, message: &Message) -> anyhow::Result<()> {
        let now = Instant::now();
        match message {
            Message::Text(text) => {
                let said: Value = serde_json::from_str(text)?;
                self.clock.told(said["clock_ms"].as_f64().context("the robot told no clock")?, now);
                self.news.heard = said["heard"].as_u64().unwrap_or(0);
                self.news.refused = said["refused"].as_u64().unwrap_or(0);
                said["why"].as_str().unwrap_or_default().clone_into(&mut self.news.why);
                self.news_at = now;
                Ok(())
            }
            Message::Close(_) => anyhow::bail!("the robot ended the connection"),
            _ => Ok(()),
        }
    }

    /// Everything that came from the robot; an error where it is silent.
    fn look(&mut self) -> anyhow::Result<()> {
        loop {
            match self.socket.read() {
                Ok(message) => self.take(&message)?,
                Err(Error::Io(error)) if error.kind() == ErrorKind::WouldBlock => {
                    anyhow::ensure!(self.news_at.elapsed() < SILENCE, "the robot is silent");
                    return Ok(());
                }
                Err(error) => return Err(error).context("the robot ended the connection"),
            }
        }
    }

    fn send(&mut self, source: &str, values: &Values, measured: Instant) -> anyhow::Result<()> {
        let mut instant_ms = self.clock.at_ms(measured);
        if (self.sent_ms - JITTER_MS..=self.sent_ms).contains(&instant_ms) {
            instant_ms = self.sent_ms + 1e-3;
        }
        self.sent_ms = instant_ms;
        let message = json!({ "source": source, "values": values, "instant_ms": instant_ms });
        match self.socket.send(Message::text(message.to_string())) {
            // It goes with the next one.
            Err(Error::Io(error)) if error.kind() == ErrorKind::WouldBlock => Ok(()),
            sent => sent.context("sending to the robot"),
        }
    }

    /// Tells the user what is refused, once a second.
    fn tell_refused(&mut self) {
        let (told, at) = self.told;
        let News { heard, refused, why } = &self.news;
        if *refused > told && (told == 0 || at.elapsed() > TELL) {
            note(format_args!("{heard} heard, {refused} refused; the last: {why}"));
            self.told = (*refused, Instant::now());
        }
    }

    /// What became of so many messages, once the robot told of all.
    fn await_news(&mut self, sent: u64) -> anyhow::Result<()> {
        let until = Instant::now() + super::LONGEST;
        while self.news.heard + self.news.refused < sent && Instant::now() < until {
            std::thread::sleep(LOOK);
            self.look()?;
        }
        Ok(())
    }
}

/// Runs `omnibase send`.
pub fn send(arguments: &Send, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    // Lines are read, and grow old, while the robot is reached.
    let lines = arguments.values.is_empty().then(lines);
    let mut connection = Connection::open(&Line::new(&arguments.which)?)?;
    let source = &arguments.source;
    let mut sent = 0;
    if let Some(lines) = lines {
        loop {
            match lines.recv_timeout(LOOK) {
                Ok((measured, line)) => {
                    let line = line?;
                    let values = parse_line(&line).map_err(|why| anyhow::anyhow!("`{line}`: {why}"))?;
                    connection.send(source, &values, measured)?;
                    sent += 1;
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            connection.look()?;
            connection.tell_refused();
        }
    } else {
        let values: Values =
            arguments.values.iter().map(|(name, value)| (name.clone(), json!(value))).collect();
        let period = match arguments.every {
            None => None,
            Some(Every::Ns(ns)) => Some(Duration::from_nanos(ns)),
            Some(Every::Cycles(_)) => anyhow::bail!("--every: expected a time, as 50ms"),
        };
        loop {
            connection.send(source, &values, Instant::now())?;
            sent += 1;
            let Some(period) = period else { break };
            std::thread::sleep(period);
            connection.look()?;
            connection.tell_refused();
        }
    }
    connection.await_news(sent)?;
    let News { heard, refused, why } = &connection.news;
    anyhow::ensure!(heard + refused == sent, "the robot says nothing of {} messages", sent - heard - refused);
    anyhow::ensure!(*refused == 0, "{heard} of {sent} heard; refused: {why}");
    writeln!(output, "{heard} heard")?;
    Ok(Outcome::Done)
}

/// Lines of standard input, with the instants at which they came.
fn lines() -> Receiver<(Instant, io::Result<String>)> {
    let (sender, receiver) = sync_channel(WAITING);
    std::thread::spawn(move || {
        for line in io::stdin().lock().lines() {
            if sender.send((Instant::now(), line)).is_err() {
                return;
            }
        }
    });
    receiver
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_pairs_or_json() {
        let both = ["x=1 y=-2.5 heading=nan", r#"{"x": 1.0, "y": -2.5, "heading": null}"#];
        let [pairs, object] = both.map(|line| Value::Object(parse_line(line).unwrap()));
        assert_eq!(pairs, object);
        for wrong in ["x", "x=one", "{", "[1]"] {
            assert!(parse_line(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn the_robots_clock_is_the_best_that_was_told_lately() {
        let began = Instant::now();
        let after = |ms: u64| began + Duration::from_millis(ms);
        let mut clock = RobotClock::unknown(began);
        clock.told(1000.0, began);
        assert!((clock.at_ms(after(100)) - 1100.0).abs() < 1e-9);
        // What took 30 ms to come says less than what is known; what took no time more.
        clock.told(1070.0, after(100));
        assert!((clock.at_ms(after(100)) - 1100.0).abs() < 1e-9);
        clock.told(1105.0, after(100));
        assert!((clock.at_ms(after(100)) - 1105.0).abs() < 1e-9);
        // It stood for 150 ms: that is found within two seconds.
        (110..2300).step_by(20).for_each(|ms| clock.told(ms as f64 + 855.0, after(ms)));
        assert!((clock.at_ms(after(2300)) - 3155.0).abs() < 1e-9);
    }
}
