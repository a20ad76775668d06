//! A run as an MCAP file: a protobuf topic for each group of signals, raw cycles for replay, events as text.

use super::protobuf::{self, Kind};
use super::{RunEvent, RunSchema};
use mcap::records::{MessageHeader, Metadata};
use std::collections::BTreeMap;
use std::io::{self, Seek, Write};

/// Topic of the raw cycles.
pub(super) const RAW_TOPIC: &str = "/raw";
/// Topic of the events.
pub(super) const EVENT_TOPIC: &str = "/events";
/// Name of the metadata record that describes the run.
pub(super) const METADATA: &str = "omnibase";

/// Why a run can't be written or read.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The file isn't MCAP, or writing failed.
    #[error("MCAP: {0}")]
    Mcap(#[from] mcap::McapError),
    /// The file can't be read on.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// A row has another number of values than the schema has signals.
    #[error("a row of {found} values, the schema has {expected} signals")]
    RowWidth {
        /// Signals of the schema.
        expected: usize,
        /// Values given.
        found: usize,
    },
    /// The file is of another format.
    #[error("not MCAP: the file starts with {}", starts_with(.start))]
    NotMcap {
        /// Its first bytes, eight at most.
        start: Vec<u8>,
    },
    /// The file holds no recording of a run.
    #[error("no recording of a run: {missing} is missing")]
    NotARun {
        /// What was looked for.
        missing: &'static str,
    },
}

fn starts_with(bytes: &[u8]) -> String {
    if bytes.is_empty() {
        return "nothing: it is empty".to_owned();
    }
    bytes.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().join(" ")
}

/// Writes a run to an MCAP file.
pub struct McapRun<W: Write + Seek> {
    writer: mcap::Writer<W>,
    topics: Vec<(u16, usize)>,
    raw: u16,
    events: u16,
    width: usize,
    row: u32,
    message: Vec<u8>,
}

impl<W: Write + Seek> McapRun<W> {
    /// Starts a file with `schema` and descriptions of the run (robot, reference, version ...).
    pub fn create(
        output: W,
        schema: &RunSchema,
        description: &BTreeMap<String, String>,
    ) -> Result<Self, RunError> {
        let options = mcap::WriteOptions::new().library("omnibase").compression(Some(mcap::Compression::Lz4));
        let mut writer = mcap::Writer::with_options(output, options)?;
        writer.write_metadata(&Metadata { name: METADATA.into(), metadata: description.clone() })?;
        let mut channel = |topic: &str, fields: &[(&str, Kind)]| {
            let name = message_name(topic);
            let descriptor = protobuf::descriptor(&name, fields);
            let schema = writer.add_schema(&format!("omnibase.{name}"), "protobuf", &descriptor)?;
            writer.add_channel(schema, topic, "protobuf", &BTreeMap::new())
        };
        let mut topics = Vec::with_capacity(schema.topics.len());
        for topic in &schema.topics {
            let fields: Vec<_> =
                topic.signals.iter().map(|signal| (signal.name.as_str(), Kind::Double)).collect();
            topics.push((channel(&topic.name, &fields)?, topic.signals.len()));
        }
        let raw = channel(RAW_TOPIC, &[("data", Kind::Bytes)])?;
        let events = channel(EVENT_TOPIC, &[("text", Kind::Text)])?;
        Ok(McapRun { writer, topics, raw, events, width: schema.width(), row: 0, message: Vec::new() })
    }

    /// Writes one cycle: its time, its values in the schema's order, and the bytes that replay it.
    pub fn write_row(&mut self, time_ns: u64, values: &[f64], raw: &[u8]) -> Result<(), RunError> {
        if values.len() != self.width {
            return Err(RunError::RowWidth { expected: self.width, found: values.len() });
        }
        let mut at = 0;
        for number in 0..self.topics.len() {
            let (channel, width) = self.topics[number];
            self.message.clear();
            for (field, value) in (1..).zip(&values[at..at + width]) {
                protobuf::push_double(&mut self.message, field, *value);
            }
            at += width;
            self.send(channel, time_ns)?;
        }
        self.message.clear();
        protobuf::push_bytes(&mut self.message, 1, raw);
        self.send(self.raw, time_ns)?;
        self.row = self.row.wrapping_add(1);
        Ok(())
    }

    /// Writes more about the run, known only now.
    pub fn describe(&mut self, key: &str, text: &str) -> Result<(), RunError> {
        let metadata = BTreeMap::from([(key.to_owned(), text.to_owned())]);
        Ok(self.writer.write_metadata(&Metadata { name: METADATA.into(), metadata })?)
    }

    /// Writes an event.
    pub fn write_event(&mut self, event: &RunEvent) -> Result<(), RunError> {
        self.message.clear();
        protobuf::push_bytes(&mut self.message, 1, event.text.as_bytes());
        self.send(self.events, event.time_ns)
    }

    /// Writes index and end, and gives the output back; without it the file is still read to its last whole chunk.
    pub fn finish(mut self) -> Result<W, RunError> {
        self.writer.finish()?;
        Ok(self.writer.into_inner())
    }

    fn send(&mut self, channel_id: u16, time_ns: u64) -> Result<(), RunError> {
        let header =
            MessageHeader { channel_id, sequence: self.row, log_time: time_ns, publish_time: time_ns };
        Ok(self.writer.write_to_known_channel(&header, &self.message)?)
    }
}

/// `/platform/believed` becomes `PlatformBelieved`.
fn message_name(topic: &str) -> String {
    let words = topic.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    words.map(|word| word[..1].to_ascii_uppercase() + &word[1..]).collect()
}
