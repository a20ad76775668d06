//! Signals of a running robot, cycle by cycle.

use std::time::Duration;

use serde::Deserialize;
use tungstenite::Message;

use crate::connection::Connection;
use crate::robots::Found;
use crate::{Error, VERSION};

/// Which signals, and how often; by default all of them, in every cycle.
#[derive(Clone, Debug, Default)]
pub struct Wanted {
    /// Names as `state.pose_x_m`, where `*` stands for any characters.
    pub signals: Vec<String>,
    /// Time from row to row, ms: a whole multiple of the cycle.
    pub every_ms: Option<f64>,
}

/// The values of one cycle.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// When they were so, on the robot's clock, ns.
    pub instant_ns: u64,
    /// In the order of [`States::names`], in the units that end these; no number where there is none.
    pub values: Vec<f64>,
}

/// What the robot says first.
#[derive(Deserialize)]
struct Begin {
    version: String,
    robot: String,
    cycle_ms: f64,
    signals: Vec<String>,
}

/// A robot's signals, as they come.
pub struct States {
    connection: Connection,
    begin: Begin,
    missing: u64,
}

impl States {
    /// Follows a robot.
    pub fn follow(robot: &Found, wanted: &Wanted) -> Result<States, Error> {
        let mut what = format!("states?signals={}", encoded(&wanted.signals.join(",")));
        if let Some(every_ms) = wanted.every_ms {
            what += &format!("&every_ms={every_ms}");
        }
        let (connection, first) = Connection::open(robot, &what)?;
        let text = first.to_text().map_err(|error| Error::Words(error.to_string()))?;
        let begin: Begin = serde_json::from_str(text).map_err(|error| Error::Words(error.to_string()))?;
        if begin.version.split('.').next().and_then(|first| first.parse().ok()) != Some(VERSION) {
            return Err(Error::Version { found: begin.version });
        }
        Ok(States { connection, begin, missing: 0 })
    }

    /// The robot's name.
    pub fn robot(&self) -> &str {
        &self.begin.robot
    }

    /// The robot's cycle, ms.
    pub fn cycle_ms(&self) -> f64 {
        self.begin.cycle_ms
    }

    /// Names of a row's values; their units end them.
    pub fn names(&self) -> &[String] {
        &self.begin.signals
    }

    /// Cycles that never came, because this program or its line was too slow for them.
    pub fn missing(&self) -> u64 {
        self.missing
    }

    /// The rows that came; none where none comes in that time.
    pub fn rows(&mut self, longest: Duration) -> Result<Vec<Row>, Error> {
        match self.connection.hear(longest)? {
            Some(Message::Binary(bytes)) => self.read(&bytes),
            _ => Ok(Vec::new()),
        }
    }

    fn read(&mut self, bytes: &[u8]) -> Result<Vec<Row>, Error> {
        let words: Vec<u64> = bytes.chunks_exact(8).map(word).collect();
        let width = 1 + self.begin.signals.len();
        let Some((missing, rows)) = words.split_first().filter(|_| bytes.len().is_multiple_of(8)) else {
            return Err(Error::Words(format!("{} bytes of signals", bytes.len())));
        };
        if rows.len() % width != 0 {
            return Err(Error::Words(format!("{} words of signals in rows of {width}", rows.len())));
        }
        self.missing = *missing;
        let row = |words: &[u64]| Row {
            instant_ns: words[0],
            values: words[1..].iter().map(|word| f64::from_bits(*word)).collect(),
        };
        Ok(rows.chunks_exact(width).map(row).collect())
    }
}

fn word(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte))
}

/// A text as an address may hold it (RFC 3986, section 2.1).
fn encoded(text: &str) -> String {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || b"-._~,*".contains(&byte);
    let one = |byte| if plain(byte) { char::from(byte).to_string() } else { format!("%{byte:02X}") };
    text.bytes().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stand_in_an_address() {
        assert_eq!(encoded("state.*,wheel_1.speed"), "state.*,wheel_1.speed");
        assert_eq!(encoded("a b&c=d/ü"), "a%20b%26c%3Dd%2F%C3%BC");
    }

    #[test]
    fn words_are_little_endian() {
        assert_eq!(word(&[1, 2, 0, 0, 0, 0, 0, 0x80]), 0x8000_0000_0000_0201);
    }
}
