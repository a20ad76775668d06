//! A run as an MCAP file: a protobuf message for each cycle, with a part for each group of signals and what replay needs beside
//! them; events as text.

use super::protobuf::{self, Kind};
use super::{RunEvent, RunSchema, SELECTION, words};
use mcap::records::{MessageHeader, Metadata};
use std::collections::BTreeMap;
use std::io::{self, Seek, SeekFrom, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Topic of the cycles.
pub(super) const CYCLE_TOPIC: &str = "/robot";
/// Topic of the events.
pub(super) const EVENT_TOPIC: &str = "/events";
/// In the metadata of their channel: the names of the topics, each a part of the message, one a line.
pub(super) const TOPICS: &str = "topics";
/// In the same: the words; where there is none, cycles can't be replayed.
pub(super) const WORDS: &str = "words";
/// Fields of a cycle: the first one that is a topic; in recordings of before the bytes that replay it where they aren't its
/// words, and what its counts don't tell of those.
pub(super) const DATA_FIELD: u32 = 1;
pub(super) const REST_FIELD: u32 = 2;
pub(super) const FIRST_TOPIC_FIELD: u32 = 3;
/// Name of the metadata record that describes the run.
pub(super) const METADATA: &str = "omnibase";

/// Key of the wall clock at the run's time 0, ns since 1970, in the description of a recording.
pub const BEGUN: &str = "begun_unix_ns";

/// Level 1 saves 1.6 % and takes a third longer. (The writer wants it without a sign, and hands its bits on.)
const ZSTD_LEVEL: i32 = -1;
/// Bytes of records after which a chunk ends: zstd's window at this level with a block. Of what is longer it looks at two pieces, which
/// takes half as long again.
const CHUNK_BYTES: u64 = 640 * 1024;
/// Time of the run after which a chunk ends, ns: what is lost where the process is killed.
const CHUNK_NS: u64 = 1_000_000_000;
/// Bytes of records that are compressed to see whether others still have room.
const WORTH_COMPRESSING: u64 = 64 * 1024;
/// Bytes of a message's record beside its content, and of its place in the chunk's index.
const MESSAGE_BYTES: u64 = 1 + 8 + 22 + 16;

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
    writer: mcap::Writer<Measured<W>>,
    /// Signals of each topic.
    topics: Vec<usize>,
    cycles: u16,
    events: u16,
    width: usize,
    message: Vec<u8>,
    /// A topic's part of it.
    part: Vec<u8>,
    size: Size,
    /// The wall clock at the run's time 0, ns since 1970; 0 where nobody told it.
    begun_unix_ns: u64,
}

/// What a file takes, and will take at most when it is finished.
struct Size {
    /// Bytes of the file.
    length: Arc<AtomicU64>,
    /// Bytes of the records in the chunk that is open, and of its index.
    open: u64,
    /// Time of its first record, ns.
    open_since_ns: u64,
    /// Channels, chunks and metadata records so far.
    channels: u64,
    chunks: u64,
    metadata: u64,
    /// Bytes of all schemas and channels, which the end of the file repeats.
    schemas: u64,
}

impl Size {
    /// Bytes of the finished file, at most, where so many are written before.
    fn at_most(&self, more: u64) -> u64 {
        let chunk = self.open + more;
        // The worst of the compression, its frame, the chunk's header, and the heads of its index.
        let chunk = chunk + chunk / 128 + 1024 + 32 * self.channels;
        let of_chunks = (self.chunks + 1) * (128 + 10 * self.channels);
        let end = self.schemas + of_chunks + 64 * (self.metadata + 1) + 16 * self.channels + 1024;
        self.length.load(Ordering::Relaxed) + chunk + end
    }
}

impl<W: Write + Seek> McapRun<W> {
    /// Starts a file with `schema` and descriptions of the run (robot, reference, version ...).
    pub fn create(
        output: W,
        schema: &RunSchema,
        description: &BTreeMap<String, String>,
    ) -> Result<Self, RunError> {
        let options = mcap::WriteOptions::new()
            .library("omnibase")
            .compression(Some(mcap::Compression::Zstd))
            .compression_level(ZSTD_LEVEL.cast_unsigned())
            .compression_threads(0)
            // Chunks end where a row does.
            .chunk_size(None);
        let length = Arc::new(AtomicU64::new(0));
        let output = Measured { output, position: 0, length: length.clone() };
        let mut size =
            Size { length, open: 0, open_since_ns: 0, channels: 0, chunks: 0, metadata: 0, schemas: 0 };
        let mut writer = mcap::Writer::with_options(output, options)?;
        writer.write_metadata(&Metadata { name: METADATA.into(), metadata: description.clone() })?;
        size.metadata += 1;
        let names: Vec<&str> = schema.topics.iter().map(|topic| topic.name.as_str()).collect();
        let mut of_cycles = BTreeMap::from([(TOPICS.to_owned(), names.join("\n"))]);
        // Where only some signals are recorded they replay nothing.
        if !description.contains_key(SELECTION) {
            of_cycles.insert(WORDS.to_owned(), words::line(&schema.words));
        }
        let mut channel = |topic: &str, descriptor: &[u8], metadata: &BTreeMap<String, String>| {
            let name = message_name(topic);
            size.channels += 1;
            let told: usize = metadata.iter().map(|(key, text)| key.len() + text.len() + 8).sum();
            size.schemas += (descriptor.len() + name.len() + topic.len() + told + 128) as u64;
            let schema = writer.add_schema(&format!("omnibase.{name}"), "protobuf", descriptor)?;
            writer.add_channel(schema, topic, "protobuf", metadata)
        };
        let cycles = channel(CYCLE_TOPIC, &cycle_descriptor(schema), &of_cycles)?;
        let text = protobuf::descriptor(&message_name(EVENT_TOPIC), &[("text", Kind::Text)]);
        let events = channel(EVENT_TOPIC, &text, &BTreeMap::new())?;
        let begun_unix_ns = description.get(BEGUN).and_then(|ns| ns.parse().ok()).unwrap_or(0);
        let mut run = McapRun {
            writer,
            topics: schema.topics.iter().map(|topic| topic.signals.len()).collect(),
            cycles,
            events,
            width: schema.width(),
            message: Vec::new(),
            part: Vec::new(),
            size,
            begun_unix_ns,
        };
        run.end_chunk()?;
        Ok(run)
    }

    /// Writes one cycle: its time, and its words in the schema's order, each a count or the bits of a number.
    pub fn write_row(&mut self, time_ns: u64, row: &[u64]) -> Result<(), RunError> {
        if row.len() != self.width {
            return Err(RunError::RowWidth { expected: self.width, found: row.len() });
        }
        self.message.clear();
        let mut rest = row;
        for (number, signals) in (FIRST_TOPIC_FIELD..).zip(&self.topics) {
            let (topic, others) = rest.split_at(*signals);
            rest = others;
            self.part.clear();
            protobuf::push_words(&mut self.part, topic);
            protobuf::push_bytes(&mut self.message, number, &self.part);
        }
        self.send(self.cycles, time_ns)?;
        let is_long = time_ns.saturating_sub(self.size.open_since_ns) >= CHUNK_NS;
        if self.size.open >= CHUNK_BYTES || is_long { self.end_chunk() } else { Ok(()) }
    }

    /// Bytes of the finished file, at most, where a row is written before.
    pub fn length_with_row(&self) -> u64 {
        // A field's number takes up to two bytes, a count up to ten; a part's number and length up to six.
        let row = 12 * self.width as u64 + 6 * self.topics.len() as u64 + MESSAGE_BYTES;
        self.size.at_most(row + 16)
    }

    /// As [`McapRun::length_with_row`], where so many bytes of words are written before.
    pub fn length_with_words(&self, bytes: usize) -> u64 {
        self.size.at_most(bytes as u64 + MESSAGE_BYTES + 64)
    }

    /// Writes more about the run, known only now.
    pub fn describe(&mut self, key: &str, text: &str) -> Result<(), RunError> {
        self.end_chunk()?;
        let metadata = BTreeMap::from([(key.to_owned(), text.to_owned())]);
        self.size.metadata += 1;
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
        Ok(self.writer.into_inner().output)
    }

    /// Ends the chunk where compressing it may save much; whether it did.
    pub fn compress(&mut self) -> Result<bool, RunError> {
        let is_worth_it = self.size.open >= WORTH_COMPRESSING;
        if is_worth_it {
            self.end_chunk()?;
        }
        Ok(is_worth_it)
    }

    fn end_chunk(&mut self) -> Result<(), RunError> {
        self.writer.flush()?;
        self.size.chunks += 1;
        self.size.open = 0;
        Ok(())
    }

    fn send(&mut self, channel_id: u16, time_ns: u64) -> Result<(), RunError> {
        // Programs of others show the log time; the run's own is what is read back.
        let log_time = self.begun_unix_ns.saturating_add(time_ns);
        // Cycles have their own number among their signals; a second one takes 4 bytes.
        let header = MessageHeader { channel_id, sequence: 0, log_time, publish_time: time_ns };
        if self.size.open == 0 {
            self.size.open_since_ns = time_ns;
        }
        self.size.open += self.message.len() as u64 + MESSAGE_BYTES;
        Ok(self.writer.write_to_known_channel(&header, &self.message)?)
    }
}

/// An output that tells how long it has become.
struct Measured<W> {
    output: W,
    position: u64,
    length: Arc<AtomicU64>,
}

impl<W: Write> Write for Measured<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.output.write(bytes)?;
        self.position += written as u64;
        self.length.fetch_max(self.position, Ordering::Relaxed);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.output.flush()
    }
}

impl<W: Seek> Seek for Measured<W> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.position = self.output.seek(to)?;
        Ok(self.position)
    }
}

/// What explains a cycle's message to a reader.
fn cycle_descriptor(schema: &RunSchema) -> Vec<u8> {
    let counts = schema.counts().into_iter();
    let mut kinds = counts.map(|is_count| if is_count { Kind::Count } else { Kind::Double });
    let mut parts: Vec<(String, String, Vec<u8>)> = Vec::new();
    for topic in &schema.topics {
        let words = topic.name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
        let (mut name, mut kind) = (words.collect::<Vec<_>>().join("_"), message_name(&topic.name));
        // Names that differ in what protobuf doesn't know stay apart.
        while parts.iter().any(|(known, other, _)| *known == name || *other == kind) {
            name.push('_');
            kind.push('_');
        }
        let names = topic.signals.iter().map(|signal| signal.name.clone());
        let fields: Vec<_> = names.zip(kinds.by_ref()).collect();
        let message = protobuf::message_with(&kind, &fields, &[]);
        parts.push((name, kind, message));
    }
    let own = message_name(CYCLE_TOPIC);
    let of_topics = (FIRST_TOPIC_FIELD..).zip(&parts).map(|(number, (name, kind, _))| {
        protobuf::field(name, number, &Kind::Part(format!(".omnibase.{own}.{kind}")))
    });
    let fields: Vec<_> = of_topics.collect();
    let nested: Vec<_> = parts.iter().map(|(.., message)| message.clone()).collect();
    protobuf::file(&own, &protobuf::message(&own, &fields, &nested, &[]))
}

/// `/platform/believed` becomes `PlatformBelieved`.
pub(crate) fn message_name(topic: &str) -> String {
    let words = topic.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    words.map(|word| word[..1].to_ascii_uppercase() + &word[1..]).collect()
}
