//! Events in a file: one line of JSON that describes the device and its state at the start, then the kernel's
//! `struct input_event`s as they came.

use std::io::{self, Write};

use serde::{Deserialize, Serialize};

use crate::description::{Description, State};
use crate::device::Device;
use crate::event::{RawEvent, events_in};

/// What the first line begins with.
const FORMAT: &str = "omnibase evdev 1";
/// The longest first line.
const LONGEST_LINE: usize = 1 << 20;

#[derive(Serialize, Deserialize)]
struct Header {
    format: String,
    device: Description,
    state: State,
}

/// Why a file can't be played.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The first line is missing or too long.
    #[error("not a recording of events: it begins with no line of JSON")]
    NoHeader,
    /// The first line isn't what a recording begins with.
    #[error("not a recording of events: {0}")]
    Header(#[from] serde_json::Error),
    /// Another format.
    #[error("the format is {found:?}, not {FORMAT:?}")]
    Format {
        /// What stands there.
        found: String,
    },
}

/// A recording that is played as a device: each event at its time after the first one.
#[derive(Clone, Debug)]
pub struct Recorded {
    device: Description,
    state: State,
    events: Vec<RawEvent>,
    played: usize,
    start_ns: Option<u64>,
    left_over: usize,
}

impl Recorded {
    /// Reads a recording.
    ///
    /// # Errors
    /// The first line isn't that of a recording.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, RecordingError> {
        let line = bytes.iter().take(LONGEST_LINE).position(|byte| *byte == b'\n');
        let (line, rest) = bytes.split_at(line.ok_or(RecordingError::NoHeader)?);
        let Header { format, device, state } = serde_json::from_slice(line)?;
        if format != FORMAT {
            return Err(RecordingError::Format { found: format });
        }
        let (events, left_over) = events_in(&rest[1..]);
        Ok(Recorded { device, state, events, played: 0, start_ns: None, left_over })
    }

    /// Bytes at the end that are no whole event: the recording was cut off.
    pub fn left_over(&self) -> usize {
        self.left_over
    }

    /// All events.
    pub fn all(&self) -> &[RawEvent] {
        &self.events
    }

    /// When the event that is next is due, ns after the first one; `None` at the end. A time that runs backwards
    /// doesn't: what is late by that is due at once.
    pub fn next_ns(&self) -> Option<u64> {
        let first_us = self.events.first()?.time_us;
        Some(self.events.get(self.played)?.time_us.saturating_sub(first_us).saturating_mul(1000))
    }
}

impl Device for Recorded {
    fn description(&self) -> &Description {
        &self.device
    }

    fn state(&mut self) -> io::Result<State> {
        Ok(self.state.clone())
    }

    /// The end of the recording is that of the device.
    fn events(&mut self, now_ns: u64, events: &mut Vec<RawEvent>) -> io::Result<()> {
        let start_ns = *self.start_ns.get_or_insert(now_ns);
        if self.played == self.events.len() {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        while let Some(due_ns) = self.next_ns()
            && due_ns <= now_ns.saturating_sub(start_ns)
        {
            let event = self.events[self.played];
            self.state.take(event, &self.device);
            events.push(event);
            self.played += 1;
        }
        Ok(())
    }
}

/// Writes a recording.
pub struct Recorder {
    to: Box<dyn Write + Send>,
}

impl Recorder {
    /// Begins a recording of a device.
    ///
    /// # Errors
    /// It can't be written.
    pub fn start(mut to: Box<dyn Write + Send>, device: &Description, state: &State) -> io::Result<Self> {
        let header = Header { format: FORMAT.into(), device: device.clone(), state: state.clone() };
        serde_json::to_writer(&mut to, &header)?;
        to.write_all(b"\n")?;
        to.flush()?;
        Ok(Recorder { to })
    }

    /// Adds events; they are in the file when this returns.
    ///
    /// # Errors
    /// They can't be written.
    pub fn write(&mut self, events: &[RawEvent]) -> io::Result<()> {
        for event in events {
            self.to.write_all(&event.to_bytes())?;
        }
        self.to.flush()
    }
}
