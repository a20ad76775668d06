//! What a program knows, on its way to a running robot.

use std::time::{Duration, Instant};

use serde_json::{Map, Value, json};
use tungstenite::Message;

use crate::Error;
use crate::clock::RobotClock;
use crate::connection::Connection;
use crate::robots::Found;

/// By so much the clock may seem to go back where the best is forgotten, ms; measurements stay in their order.
const JITTER_MS: f64 = 10.0;
/// The longest wait for what became of all that was sent.
const LONGEST: Duration = Duration::from_secs(5);

/// Values of a `[[source]]` of the robot's file, sent as they are measured.
pub struct Inputs {
    connection: Connection,
    clock: RobotClock,
    /// The last instant that was sent, ms of the robot's clock.
    sent_ms: f64,
    sent: u64,
    heard: u64,
    refused: u64,
    why: String,
}

impl Inputs {
    /// Begins to send to a robot that lets this program command.
    pub fn open(robot: &Found) -> Result<Self, Error> {
        let (connection, first) = Connection::open(robot, "inputs")?;
        let mut inputs = Inputs {
            connection,
            clock: RobotClock::unknown(Instant::now()),
            sent_ms: f64::NEG_INFINITY,
            sent: 0,
            heard: 0,
            refused: 0,
            why: String::new(),
        };
        // Before the first message nobody knows the robot's clock.
        inputs.take(&first)?;
        Ok(inputs)
    }

    /// Sends all values of a source, in their units, as they were measured at an instant; null for what isn't known.
    pub fn send(
        &mut self,
        source: &str,
        values: &Map<String, Value>,
        measured: Instant,
    ) -> Result<(), Error> {
        let mut instant_ms = self.clock.at_ms(measured);
        if (self.sent_ms - JITTER_MS..=self.sent_ms).contains(&instant_ms) {
            instant_ms = self.sent_ms + 1e-3;
        }
        self.sent_ms = instant_ms;
        self.sent += 1;
        self.connection
            .say(json!({ "source": source, "values": values, "instant_ms": instant_ms }).to_string())
    }

    /// Takes in what the robot says; waits so long for it at most.
    pub fn look(&mut self, longest: Duration) -> Result<(), Error> {
        let mut wait = longest;
        while let Some(message) = self.connection.hear(wait)? {
            self.take(&message)?;
            wait = Duration::ZERO;
        }
        Ok(())
    }

    /// Messages that were taken, those that weren't, and why the last of those wasn't.
    pub fn told(&self) -> (u64, u64, &str) {
        (self.heard, self.refused, &self.why)
    }

    /// Waits until the robot told what became of all that was sent; how many it says nothing of.
    pub fn finish(&mut self) -> Result<u64, Error> {
        let until = Instant::now() + LONGEST;
        loop {
            let untold = self.sent.saturating_sub(self.heard + self.refused);
            let left = until.saturating_duration_since(Instant::now());
            if untold == 0 || left.is_zero() {
                return Ok(untold);
            }
            self.look(left)?;
        }
    }

    fn take(&mut self, message: &Message) -> Result<(), Error> {
        let Message::Text(text) = message else { return Ok(()) };
        let words = |what: &dyn std::fmt::Display| Error::Words(what.to_string());
        let said: Value = serde_json::from_str(text).map_err(|error| words(&error))?;
        let clock_ms = said["clock_ms"].as_f64().ok_or_else(|| words(&"no clock in its news of inputs"))?;
        self.clock.told(clock_ms, Instant::now());
        self.heard = said["heard"].as_u64().unwrap_or(0);
        self.refused = said["refused"].as_u64().unwrap_or(0);
        said["why"].as_str().unwrap_or_default().clone_into(&mut self.why);
        Ok(())
    }
}
