//! A run read back from its MCAP file, record by record: a long file needs no more room than what is kept of it.

use super::mcap_file::{
    CYCLE_TOPIC, DATA_FIELD, EVENT_TOPIC, FIRST_TOPIC_FIELD, METADATA, REST_FIELD, TOPICS, WORDS,
};
use super::protobuf::{self, Described, Field};
use super::{Due, RunError, RunEvent, RunSchema, Selection, Signal, Topic, words};
use mcap::McapError;
use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::collections::BTreeMap;
use std::io::Read;
use std::ops::ControlFlow;

/// Bytes read at once.
const PIECE: usize = 1 << 20;
/// The longest record that is believed in: a chunk is some MiB.
const LONGEST_RECORD: usize = 1 << 28;
/// Bytes ahead of each record.
const OPCODE_AND_LENGTH: usize = 1 + 8;
/// Topic of what replays a cycle, in recordings of before that have a message for each topic.
const RAW_TOPIC: &str = "/raw";

/// A run read back.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordedRun {
    /// The columns.
    pub schema: RunSchema,
    /// Time of each row, ns.
    pub times_ns: Vec<u64>,
    /// All rows, one behind the other, each [`RunSchema::width`] values.
    pub values: Vec<f64>,
    /// The bytes that replay each row; nothing where only some signals were recorded or kept.
    pub raw: Vec<Vec<u8>>,
    /// What happened.
    pub events: Vec<RunEvent>,
    /// Descriptions of the run.
    pub description: BTreeMap<String, String>,
    /// The file ends early, in words; everything before is there.
    pub truncated: Option<String>,
}

/// A row of a recording while it is read.
#[derive(Clone, Copy, Debug)]
pub struct RecordedRow<'a> {
    /// Its time, ns.
    pub time_ns: u64,
    /// Its values, as many as the schema's signals.
    pub values: &'a [f64],
    /// The bytes that replay it; nothing where only some signals were recorded or are kept.
    pub raw: &'a [u8],
}

/// Who takes rows as they are read: with what is known of the run by then, without its rows. `Break` ends the reading.
type Taker<'a> = &'a mut dyn FnMut(&RecordedRun, RecordedRow<'_>) -> ControlFlow<()>;

/// What is kept of a recording.
#[derive(Clone, Copy, Debug)]
pub enum Keep<'a> {
    /// Everything.
    All,
    /// When each complete cycle was, and the events; values aren't looked at.
    Times,
    /// Signals for which this is so, by their topic, their name, and all names of the topic; and nothing for replay.
    Signals(fn(&str, &str, &[String]) -> bool),
    /// Signals and rows of a selection; and nothing for replay.
    Chosen(&'a Selection),
}

impl RecordedRun {
    /// Reads a whole file; a file that was cut off is read to its last complete cycle.
    pub fn read(bytes: &[u8]) -> Result<Self, RunError> {
        Self::read_from(bytes, Keep::All)
    }

    /// As [`RecordedRun::read`], piece by piece; `input` needs no buffer.
    pub fn read_from(input: impl Read, keep: Keep<'_>) -> Result<Self, RunError> {
        Self::read_with(input, Reading::new(keep))
    }

    /// Gives each row away as it is read, with what is known of the run by then, and keeps none: a run of any length needs the
    /// room of one chunk. What comes back has no rows.
    pub fn read_each(
        input: impl Read,
        keep: Keep<'_>,
        take: &mut dyn FnMut(&RecordedRun, RecordedRow<'_>) -> ControlFlow<()>,
    ) -> Result<Self, RunError> {
        Self::read_with(input, Reading { take: Some(take), ..Reading::new(keep) })
    }

    fn read_with(mut input: impl Read, mut reading: Reading<'_>) -> Result<Self, RunError> {
        let mut start = Vec::new();
        (&mut input).take(mcap::MAGIC.len() as u64).read_to_end(&mut start)?;
        if start != mcap::MAGIC {
            return Err(RunError::NotMcap { start });
        }
        let mut reader = LinearReader::new_with_options(options().with_emit_chunks(true));
        while let Some(event) = reader.next_event() {
            let taken = match event {
                Ok(LinearReadEvent::ReadRequest(_)) => {
                    let read = input.read(reader.insert(PIECE))?;
                    reader.notify_read(read);
                    continue;
                }
                Ok(LinearReadEvent::Record { opcode: op::DATA_END, .. }) => {
                    reading.is_whole = true;
                    break;
                }
                Ok(LinearReadEvent::Record { data, opcode: op::CHUNK }) => reading.chunk(data),
                Ok(LinearReadEvent::Record { data, opcode }) => reading.record(opcode, data),
                Err(error) => Err(error),
            };
            if let Err(error) = taken {
                reading.run.truncated = Some(why(&error));
                break;
            }
            if reading.is_enough {
                reading.is_whole = true;
                break;
            }
        }
        reading.finish()
    }

    /// The values of one signal over the run; `None` where there is no such signal.
    pub fn column(&self, topic: &str, signal: &str) -> Option<impl Iterator<Item = f64> + '_> {
        let column = self.schema.column(topic, signal)?;
        Some(self.values.chunks_exact(self.schema.width()).map(move |row| row[column]))
    }
}

/// How files are read, and chunks as if they were files: without a magic number at either end, for a run that was
/// killed lacks its end; and nothing of a chunk counts before its checksum was seen to be right.
fn options() -> LinearReaderOptions {
    LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(LONGEST_RECORD)
}

/// Whether uncompressed records fill their chunk: the reader counts below zero where the last one is longer.
fn fill_their_chunk(mut records: &[u8]) -> bool {
    while !records.is_empty() {
        let rest = records.split_at_checked(OPCODE_AND_LENGTH).and_then(|(head, rest)| {
            let length = u64::from_le_bytes(head.get(1..)?.try_into().ok()?);
            rest.get(usize::try_from(length).ok()?..)
        });
        match rest {
            Some(rest) => records = rest,
            None => return false,
        }
    }
    true
}

/// What broke off, as a person reads it.
fn why(error: &McapError) -> String {
    match error {
        // The length of a chunk is written last; until then it is the greatest number.
        McapError::UnexpectedEof
        | McapError::UnexpectedEoc
        | McapError::RecordTooLarge { len: u64::MAX, .. } => "it breaks off inside a record".to_owned(),
        other => other.to_string(),
    }
}

/// A run on its way out of its file.
struct Reading<'a> {
    run: RecordedRun,
    keep: Keep<'a>,
    /// Rows that are kept.
    due: Due,
    /// Schemas by their numbers.
    schemas: BTreeMap<u16, Vec<u8>>,
    /// What each channel holds, by its number.
    channels: BTreeMap<u16, Content>,
    /// There are bytes that replay: a cycle without them isn't complete.
    has_raw: bool,
    /// There are signals, whether they are kept or not.
    has_signals: bool,
    /// When the row is that isn't complete yet. Its values: a topic that isn't told again has those of the row before.
    row_ns: Option<u64>,
    values: Vec<f64>,
    /// The same as whole numbers, exact where they are counts.
    counts: Vec<u64>,
    /// Topics that weren't told yet, and whether anything of this row was told.
    untold: usize,
    is_told: bool,
    /// The bytes that replay it, where they came.
    raw: Vec<u8>,
    has_raw_of_row: bool,
    take: Option<Taker<'a>>,
    /// Who takes rows has enough.
    is_enough: bool,
    /// The file was closed in order.
    is_whole: bool,
}

/// What a channel holds.
enum Content {
    /// Cycles, whole: the signals of each topic.
    Cycles(Vec<Places>),
    /// Signals of a topic, as recordings of before have them.
    Signals { places: Places, is_told: bool },
    /// The bytes that replay a cycle, behind its signals.
    Raw,
    /// Words.
    Events,
}

/// Signals of a topic in a row.
struct Places {
    at: usize,
    width: usize,
    /// Which of them each field of the message is, and whether it is a count.
    fields: Vec<(Option<usize>, bool)>,
}

impl Places {
    /// Reads the topic's message into a row.
    fn read(&self, values: &mut [f64], counts: &mut [u64], message: &[u8]) {
        let place = self.at..self.at + self.width;
        let (values, counts) = (&mut values[place.clone()], &mut counts[place]);
        // proto3 leaves zeros out.
        values.fill(0.0);
        counts.fill(0);
        if self.width == 0 {
            return;
        }
        for field in protobuf::fields(message) {
            if let Field::Fixed(number, bits) = field
                && let Some((Some(place), is_count)) = self.fields.get((number as usize).wrapping_sub(1))
            {
                let value = f64::from_bits(bits);
                (values[*place], counts[*place]) =
                    if *is_count { (bits as f64, bits) } else { (value, value as u64) };
            }
        }
    }
}

impl<'a> Reading<'a> {
    fn new(keep: Keep<'a>) -> Self {
        let selection = Selection::default();
        let due = Due::new(match keep {
            Keep::Chosen(selection) => selection,
            Keep::All | Keep::Times | Keep::Signals(_) => &selection,
        });
        Reading {
            run: RecordedRun::default(),
            keep,
            due,
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            has_raw: false,
            has_signals: false,
            row_ns: None,
            values: Vec::new(),
            counts: Vec::new(),
            untold: 0,
            is_told: false,
            raw: Vec::new(),
            has_raw_of_row: false,
            take: None,
            is_enough: false,
            is_whole: false,
        }
    }

    /// Takes all records of a chunk.
    fn chunk(&mut self, bytes: &[u8]) -> Result<(), McapError> {
        let Record::Chunk { header, data } = mcap::parse_record(op::CHUNK, bytes)? else { return Ok(()) };
        if header.compression.is_empty() && !fill_their_chunk(&data) {
            return Err(McapError::UnexpectedEoc);
        }
        let mut reader = LinearReader::new_with_options(options());
        let file = reader.insert(OPCODE_AND_LENGTH + bytes.len());
        file[0] = op::CHUNK;
        file[1..OPCODE_AND_LENGTH].copy_from_slice(&(bytes.len() as u64).to_le_bytes());
        file[OPCODE_AND_LENGTH..].copy_from_slice(bytes);
        reader.notify_read(OPCODE_AND_LENGTH + bytes.len());
        while let Some(event) = reader.next_event() {
            match event? {
                LinearReadEvent::ReadRequest(_) => reader.notify_read(0),
                LinearReadEvent::Record { data, opcode } => self.record(opcode, data)?,
            }
        }
        Ok(())
    }

    /// Takes a record, where it is of those that a run is made of; others aren't looked into.
    fn record(&mut self, opcode: u8, data: &[u8]) -> Result<(), McapError> {
        if !matches!(opcode, op::METADATA | op::SCHEMA | op::CHANNEL | op::MESSAGE) {
            return Ok(());
        }
        match mcap::parse_record(opcode, data)? {
            Record::Metadata(metadata) if metadata.name == METADATA => {
                self.run.description.extend(metadata.metadata);
            }
            Record::Schema { header, data } => {
                self.schemas.insert(header.id, data.into_owned());
            }
            Record::Channel(channel) if !self.channels.contains_key(&channel.id) => {
                let content = match channel.topic.as_str() {
                    CYCLE_TOPIC if channel.metadata.contains_key(TOPICS) => {
                        self.cycles(&channel.metadata, channel.schema_id)
                    }
                    RAW_TOPIC => {
                        self.learn_words(&channel.metadata);
                        Content::Raw
                    }
                    EVENT_TOPIC => Content::Events,
                    _ => {
                        let fields = self.described(channel.schema_id, protobuf::described);
                        self.untold += 1;
                        self.has_signals = true;
                        Content::Signals { places: self.signals(&channel.topic, &fields), is_told: false }
                    }
                };
                self.channels.insert(channel.id, content);
            }
            Record::Message { header, data } => {
                let unknown = McapError::UnknownChannel(header.sequence, header.channel_id);
                // It is put back below: what it holds is read into the rest of this.
                let mut content = self.channels.remove(&header.channel_id).ok_or(unknown)?;
                self.message(&mut content, header.publish_time, &data);
                self.channels.insert(header.channel_id, content);
            }
            _ => {}
        }
        Ok(())
    }

    /// Takes what a channel holds.
    fn message(&mut self, content: &mut Content, time_ns: u64, data: &[u8]) {
        // All messages of a row have its time.
        if !matches!(content, Content::Events) && self.row_ns != Some(time_ns) {
            self.end_row();
            self.row_ns = Some(time_ns);
        }
        match content {
            Content::Cycles(topics) => {
                // A second one of the same time is another row.
                if self.is_told {
                    self.end_row();
                    self.row_ns = Some(time_ns);
                }
                (self.is_told, self.has_raw_of_row) = (true, true);
                if matches!(self.keep, Keep::Times) {
                    return;
                }
                let (mut all, mut rest) = (None, None);
                self.values.fill(0.0);
                self.counts.fill(0);
                for field in protobuf::fields(data) {
                    match field {
                        Field::Bytes(DATA_FIELD, bytes) => all = Some(bytes),
                        Field::Bytes(REST_FIELD, bytes) => rest = Some(bytes),
                        Field::Bytes(number, part) => {
                            let number = number.wrapping_sub(FIRST_TOPIC_FIELD);
                            if let Some(places) = topics.get(number as usize) {
                                places.read(&mut self.values, &mut self.counts, part);
                            }
                        }
                        _ => {}
                    }
                }
                self.keep_words(all, rest);
            }
            Content::Signals { places, is_told } => {
                if !std::mem::replace(is_told, true) {
                    self.untold -= 1;
                }
                self.is_told = true;
                if !matches!(self.keep, Keep::Times) {
                    places.read(&mut self.values, &mut self.counts, data);
                }
            }
            Content::Raw => {
                // Where nothing changed, these bytes alone tell that there is a row.
                (self.has_raw_of_row, self.is_told) = (true, true);
                self.keep_words(protobuf::inner(data, DATA_FIELD), protobuf::inner(data, REST_FIELD));
            }
            Content::Events => {
                let text = protobuf::inner(data, 1).unwrap_or_default();
                let text = String::from_utf8_lossy(text).into_owned();
                self.run.events.push(RunEvent { time_ns, text });
            }
        }
    }

    /// Keeps the bytes that replay a row: all of them, or what its values don't tell.
    fn keep_words(&mut self, all: Option<&[u8]>, rest: Option<&[u8]>) {
        if !matches!(self.keep, Keep::All) || !self.has_raw {
            return;
        }
        match all {
            Some(all) => {
                self.raw.clear();
                self.raw.extend_from_slice(all);
            }
            None => {
                let words = &self.run.schema.words;
                words::whole(&mut self.raw, words, &self.values, &self.counts, rest.unwrap_or_default());
            }
        }
    }

    /// Words that aren't understood replay nothing, and who replays says so.
    fn learn_words(&mut self, metadata: &BTreeMap<String, String>) {
        let line = metadata.get(WORDS).map_or("", String::as_str);
        self.run.schema.words = words::of_line(line).unwrap_or_default();
        self.has_raw = true;
    }

    /// What a schema tells of its fields; nothing where it isn't understood.
    fn described<T: Default>(&self, schema: u16, fields: fn(&[u8]) -> Option<T>) -> T {
        self.schemas.get(&schema).and_then(|data| fields(data)).unwrap_or_default()
    }

    /// Takes the topics of whole cycles into the schema.
    fn cycles(&mut self, metadata: &BTreeMap<String, String>, schema: u16) -> Content {
        if metadata.contains_key(WORDS) {
            self.learn_words(metadata);
        }
        self.has_signals = true;
        let topics = metadata.get(TOPICS).map_or("", String::as_str).split('\n');
        let parts = self.described(schema, protobuf::described_parts);
        Content::Cycles(topics.zip(&parts).map(|(topic, fields)| self.signals(topic, fields)).collect())
    }

    /// Takes a topic with its kept signals into the schema.
    fn signals(&mut self, topic: &str, described: &[Described]) -> Places {
        let names: Vec<String> = described.iter().map(|field| field.name.clone()).collect();
        let at = self.run.schema.width();
        let (mut signals, mut fields) = (Vec::new(), Vec::new());
        for (name, Described { is_count, .. }) in names.iter().zip(described) {
            let is_kept = match self.keep {
                Keep::All | Keep::Times => true,
                Keep::Signals(is_kept) => is_kept(topic, name, &names),
                Keep::Chosen(selection) => selection.holds(topic, name),
            };
            fields.push((is_kept.then_some(signals.len()), *is_count));
            if is_kept {
                signals.push(Signal { name: name.clone() });
            }
        }
        let width = signals.len();
        if width > 0 || matches!(self.keep, Keep::All | Keep::Times) {
            self.run.schema.topics.push(Topic { name: topic.to_owned(), signals });
        }
        self.values.resize(at + width, f64::NAN);
        self.counts.resize(at + width, 0);
        Places { at, width, fields }
    }

    /// Ends a row: it is complete, or it doesn't count.
    fn end_row(&mut self) {
        let is_told = std::mem::take(&mut self.is_told) && self.untold == 0;
        let has_raw = std::mem::take(&mut self.has_raw_of_row);
        let is_complete = is_told && (has_raw || !self.has_raw);
        if let Some(time_ns) = self.row_ns.take()
            && is_complete
            && !self.is_enough
            && self.due.take(time_ns)
        {
            if let Some(take) = &mut self.take {
                let row = RecordedRow { time_ns, values: &self.values, raw: &self.raw };
                self.is_enough = take(&self.run, row).is_break();
                return;
            }
            self.run.times_ns.push(time_ns);
            if !matches!(self.keep, Keep::Times) {
                self.run.values.extend_from_slice(&self.values);
            }
            if matches!(self.keep, Keep::All) && self.has_raw {
                self.run.raw.push(self.raw.clone());
            }
        }
    }

    fn finish(mut self) -> Result<RecordedRun, RunError> {
        self.end_row();
        if !self.is_whole && self.run.truncated.is_none() {
            self.run.truncated = Some("the file lacks its end".to_owned());
        }
        let is_choice = matches!(self.keep, Keep::Chosen(_)) && self.has_signals;
        if self.run.schema.topics.is_empty() && !is_choice {
            return Err(RunError::NotARun { missing: "a topic with signals" });
        }
        Ok(self.run)
    }
}
