//! From the cyclic thread to the files: a ring without locks, and a thread that writes.

use super::columns::complete_rows;
use super::writers::{KeptFiles, Writers};
use super::{
    ColumnError, Due, Keep, RecordedRun, Rotation, RunError, RunEvent, RunSchema, SELECTION, Selection, Word,
};
use crate::ring::take;
use rtrb::{Consumer, Producer, RingBuffer};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::Duration;

/// Words of the ring: 32 MiB, some 17 s of a robot with four wheels at 1 kHz.
const RING: usize = 4 * 1024 * 1024;
/// How long the writer rests when the ring is empty.
const REST: Duration = Duration::from_millis(2);
/// Words ahead of each entry: its kind and length, and its time.
const HEADER: usize = 2;
const ROW: u64 = 0;
const EVENT: u64 = 1;

/// What the cyclic thread does when the writer doesn't keep up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OnFull {
    /// Drop the record and count it: in real time, the cycle never waits.
    Drop,
    /// Wait for room: on virtual time nothing is in a hurry and nothing is lost.
    Wait,
}

/// What became of a recording.
#[derive(Debug, Default)]
pub struct RunRecorded {
    /// Cycles that can be read again, from each of the files.
    pub written: u64,
    /// Cycles that can't, and events that found the ring full, or no writer any more.
    pub dropped: u64,
    /// Cycles of files that made room for later ones, as [`Rotation::files`] says.
    pub removed: u64,
    /// Why the files end early, where they do; they can be read to their last complete record.
    pub failure: Option<RecorderError>,
}

/// Why a recording failed.
#[derive(Debug, thiserror::Error)]
pub enum RecorderError {
    /// A file couldn't be made or written.
    #[error("{path}: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The MCAP file.
    #[error("{path}: {source}")]
    Mcap {
        /// The file.
        path: PathBuf,
        /// Why.
        source: RunError,
    },
    /// The column file.
    #[error("{path}: {source}")]
    Columns {
        /// The file.
        path: PathBuf,
        /// Why.
        source: ColumnError,
    },
    /// A file may not become as long as its first cycle needs.
    #[error(
        "{path}: a file of {file_bytes} bytes has no room for a cycle with what describes the run: {needed} bytes"
    )]
    TooShort {
        /// The file.
        path: PathBuf,
        /// Bytes that it may have.
        file_bytes: u64,
        /// Bytes that it needs.
        needed: u64,
    },
    /// The thread that writes has died.
    #[error("the recorder's thread died: {0}")]
    Died(String),
}

/// The cyclic thread's end: never allocates; never waits, unless it was asked to.
pub struct RunSink {
    ring: Producer<u64>,
    count: Arc<Count>,
    on_full: OnFull,
    due: Due,
    /// The recorded signals of a row; `None`: all of them, as they are.
    chosen: Option<Vec<Word>>,
    /// A row on its way into the ring, behind its header.
    entry: Vec<u64>,
}

/// What went in, and what came out.
#[derive(Debug, Default)]
struct Count {
    /// Cycles that were handed over and due.
    cycles: AtomicU64,
    /// Of them, those that were given to the files.
    written: AtomicU64,
    /// Events that found no room.
    events_dropped: AtomicU64,
}

impl RunSink {
    /// Hands over one cycle: its time, and its words in the schema's order, each a count or the bits of a number.
    pub fn push_row(&mut self, time_ns: u64, row: &[u64]) {
        if !self.due.take(time_ns) {
            return;
        }
        self.count.cycles.fetch_add(1, Ordering::Relaxed);
        self.entry.clear();
        self.entry.extend([0, time_ns]);
        match &self.chosen {
            None => self.entry.extend_from_slice(row),
            // They replay nothing, and stand there as numbers.
            Some(chosen) => self.entry.extend(chosen.iter().map(|word| match *word {
                Word::Bits(place) => row.get(place).copied().unwrap_or(0),
                Word::Count(place) => row.get(place).map_or(0, |count| (*count as f64).to_bits()),
            })),
        }
        self.entry[0] = ROW | ((self.entry.len() - HEADER) as u64) << 8;
        if self.has_room(self.entry.len()) {
            // There is room.
            let _ = self.ring.push_entire_slice(&self.entry);
        }
    }

    /// Hands over an event.
    pub fn push_event(&mut self, time_ns: u64, text: &str) {
        let (whole, last) = text.as_bytes().as_chunks::<8>();
        let mut rest = [0; 8];
        rest[..last.len()].copy_from_slice(last);
        let rest = (!last.is_empty()).then_some(&rest);
        let words = whole.iter().chain(rest).map(|word| u64::from_le_bytes(*word));
        let length = HEADER + text.len().div_ceil(8);
        if !self.has_room(length) {
            self.count.events_dropped.fetch_add(1, Ordering::Relaxed);
        } else if let Ok(chunk) = self.ring.write_chunk_uninit(length) {
            chunk.fill_from_iter([EVENT | (text.len() as u64) << 8, time_ns].into_iter().chain(words));
        }
    }

    /// Whether nobody takes the records any more: the disk is full, or the writer died.
    pub fn is_broken(&self) -> bool {
        self.ring.is_abandoned()
    }

    /// Whether there is room for an entry of so many words; waits for it where it may.
    fn has_room(&self, length: usize) -> bool {
        while !self.is_broken() {
            if self.ring.slots() >= length {
                return true;
            }
            if self.on_full == OnFull::Drop {
                return false;
            }
            std::thread::yield_now();
        }
        false
    }
}

/// The thread that writes the files.
pub struct RunRecorder {
    thread: JoinHandle<Result<Writers, RecorderError>>,
    count: Arc<Count>,
    kept: KeptFiles,
    describe: mpsc::Sender<Described>,
}

/// What becomes known of a run while it is recorded.
#[derive(Clone, Debug)]
enum Described {
    /// A key and its text.
    Key(String, String),
    /// From this time of the run on, ns, nothing needs a key any more.
    Over(String, u64),
}

/// Adds to the description of a run that is being recorded; not for the cycle, for it allocates.
#[derive(Clone, Debug)]
pub struct RunDescriber(mpsc::Sender<Described>);

impl RunDescriber {
    /// Adds a key and its text; a key that is there already is replaced. Nothing happens where the recording is over.
    pub fn describe(&self, key: String, text: String) {
        let _ = self.0.send(Described::Key(key, text));
    }

    /// From this time of the run on nothing needs a key any more: files that begin later don't carry it.
    pub fn forget(&self, key: String, since_ns: u64) {
        let _ = self.0.send(Described::Over(key, since_ns));
    }
}

/// Which files to write, and what to say about the run in them.
#[derive(Clone, Debug, Default)]
pub struct RunFiles {
    /// The MCAP file.
    pub mcap: Option<PathBuf>,
    /// The column file.
    pub columns: Option<PathBuf>,
    /// Descriptions of the run for the MCAP file.
    pub description: BTreeMap<String, String>,
    /// Which signals, and how often.
    pub selection: Selection,
    /// How long a file may become; `None`: there is one, as long as it becomes.
    pub rotation: Option<Rotation>,
}

impl RunRecorder {
    /// Makes the files and starts the thread.
    pub fn start(
        files: &RunFiles,
        schema: &RunSchema,
        on_full: OnFull,
    ) -> Result<(RunRecorder, RunSink), RecorderError> {
        let mut files = files.clone();
        let mut chosen = None;
        let mut recorded = schema.clone();
        if let Some(words) = files.selection.words(schema) {
            files.description.insert(SELECTION.to_owned(), words);
            let (columns, counts) = (files.selection.columns(schema), schema.counts());
            recorded = schema.only(&columns);
            let word = |place: usize| if counts[place] { Word::Count(place) } else { Word::Bits(place) };
            chosen = Some(columns.into_iter().map(word).collect());
        }
        let due = Due::new(&files.selection);
        let kept = KeptFiles::default();
        let writers = Writers::create(files, recorded, kept.clone())?;
        let (ring, consumer) = RingBuffer::new(RING);
        let (describe, described) = mpsc::channel();
        let count = Arc::new(Count::default());
        let counted = count.clone();
        let thread = std::thread::Builder::new()
            .name("recorder".to_owned())
            .spawn(move || drain(consumer, &described, writers, &counted.written))
            .map_err(|source| RecorderError::File { path: PathBuf::from("recorder thread"), source })?;
        let entry = Vec::with_capacity(HEADER + schema.width());
        let sink = RunSink { ring, count: count.clone(), on_full, due, chosen, entry };
        Ok((RunRecorder { thread, count, kept, describe }, sink))
    }

    /// A way to add to the description while the run goes on.
    pub fn describer(&self) -> RunDescriber {
        RunDescriber(self.describe.clone())
    }

    /// Waits until everything is written; call it after the sink is dropped, for it waits for that too.
    pub fn finish(self) -> RunRecorded {
        self.finish_with(|_| BTreeMap::new())
    }

    /// As [`RunRecorder::finish`], with last descriptions: what is known of a run only after it.
    pub fn finish_with(
        self,
        last_words: impl FnOnce(&RunRecorded) -> BTreeMap<String, String>,
    ) -> RunRecorded {
        let ended = match self.thread.join() {
            Ok(ended) => ended,
            Err(panic) => Err(RecorderError::Died(words(panic.as_ref()))),
        };
        let [cycles, written, events_dropped] =
            [&self.count.cycles, &self.count.written, &self.count.events_dropped]
                .map(|count| count.load(Ordering::Relaxed));
        let kept = self.kept;
        let recorded = |readable: u64, failure| {
            let removed = kept.look().removed;
            let dropped = cycles.saturating_sub(readable + removed) + events_dropped;
            RunRecorded { written: readable, dropped, removed, failure }
        };
        let whole = || written - kept.look().removed;
        let finished = ended.and_then(|mut writers| {
            for (key, text) in last_words(&recorded(whole(), None)) {
                writers.describe(&key, &text)?;
            }
            writers.finish()
        });
        match finished {
            Ok(()) => recorded(whole(), None),
            // What was given to a file need not have reached it.
            Err(failure) => recorded(readable(&kept), Some(failure)),
        }
    }
}

/// Cycles that can be read: those of closed files, and those that are found in each of the others.
fn readable(kept: &KeptFiles) -> u64 {
    let kept = kept.look();
    let mcap = kept.mcap.as_ref().map(|path| {
        let run = File::open(path).map_err(RunError::from);
        run.and_then(|file| RecordedRun::read_from(file, Keep::Times))
            .map_or(0, |run| run.times_ns.len() as u64)
    });
    let columns = kept.columns.as_ref().map(|path| {
        File::open(path).and_then(|file| complete_rows(BufReader::new(file))).unwrap_or_default()
    });
    kept.closed.iter().sum::<u64>() + mcap.into_iter().chain(columns).min().unwrap_or_default()
}

/// What a panic said.
fn words(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "a panic".to_owned())
}

/// Tells the files what became known.
fn tell(described: &mpsc::Receiver<Described>, writers: &mut Writers) -> Result<(), RecorderError> {
    for told in described.try_iter() {
        match told {
            Described::Key(key, text) => writers.describe(&key, &text)?,
            Described::Over(key, since_ns) => writers.forget(key, since_ns),
        }
    }
    Ok(())
}

/// Writes entries until the sink is gone and the ring is empty, and counts the cycles in `written`; the open files.
fn drain(
    mut ring: Consumer<u64>,
    described: &mpsc::Receiver<Described>,
    mut writers: Writers,
    written: &AtomicU64,
) -> Result<Writers, RecorderError> {
    let mut words = Vec::new();
    loop {
        // Asked first: what was pushed before the sink went is seen below.
        let ended = ring.is_abandoned();
        tell(described, &mut writers)?;
        while take(&mut ring, HEADER, &mut words) {
            // What was described before a cycle stands in its file, however many of them wait here.
            tell(described, &mut writers)?;
            let (kind, length, time_ns) = (words[0] & 0xFF, (words[0] >> 8) as usize, words[1]);
            // Header and content were committed together.
            if kind == EVENT {
                take(&mut ring, length.div_ceil(8), &mut words);
                let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).take(length).collect();
                writers.event(&RunEvent { time_ns, text: String::from_utf8_lossy(&bytes).into_owned() })?;
            } else {
                take(&mut ring, length, &mut words);
                writers.row(time_ns, &words)?;
                written.fetch_add(1, Ordering::Relaxed);
            }
        }
        if ended {
            return Ok(writers);
        }
        std::thread::sleep(REST);
    }
}

#[cfg(test)]
mod tests;
