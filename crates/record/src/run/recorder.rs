//! From the cyclic thread to the files: a ring without locks, and a thread that writes.

use super::columns::complete_rows;
use super::{ColumnError, ColumnWriter, Keep, McapRun, RecordedRun, RunError, RunEvent, RunSchema};
use crate::output::{WholeFile, create};
use crate::ring::take;
use rtrb::{Consumer, Producer, RingBuffer};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::Duration;

/// Words of the ring: 32 MiB, some 20 s of a robot with four wheels at 1 kHz.
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
    /// The thread that writes has died.
    #[error("the recorder's thread died: {0}")]
    Died(String),
}

/// The cyclic thread's end: never allocates; never waits, unless it was asked to.
pub struct RunSink {
    ring: Producer<u64>,
    count: Arc<Count>,
    on_full: OnFull,
}

/// What went in, and what came out.
#[derive(Debug, Default)]
struct Count {
    /// Cycles that were handed over.
    cycles: AtomicU64,
    /// Of them, those that were given to the files.
    written: AtomicU64,
    /// Events that found no room.
    events_dropped: AtomicU64,
}

impl RunSink {
    /// Hands over one cycle: its time, its values in the schema's order, and the bytes that replay it.
    pub fn push_row(&mut self, time_ns: u64, values: &[f64], raw: &[u8]) {
        let words = values.iter().map(|value| value.to_bits());
        self.push(ROW, time_ns, words.len(), words, raw);
    }

    /// Hands over an event.
    pub fn push_event(&mut self, time_ns: u64, text: &str) {
        self.push(EVENT, time_ns, 0, std::iter::empty(), text.as_bytes());
    }

    /// Whether nobody takes the records any more: the disk is full, or the writer died.
    pub fn is_broken(&self) -> bool {
        self.ring.is_abandoned()
    }

    fn push(
        &mut self,
        kind: u64,
        time_ns: u64,
        count: usize,
        words: impl Iterator<Item = u64>,
        bytes: &[u8],
    ) {
        if kind == ROW {
            self.count.cycles.fetch_add(1, Ordering::Relaxed);
        }
        let length = HEADER + count + bytes.len().div_ceil(8);
        let head = [kind | (count as u64) << 8 | (bytes.len() as u64) << 32, time_ns];
        if self.is_broken() {
            return self.drop(kind);
        }
        while self.ring.slots() < length {
            if self.on_full == OnFull::Drop || self.is_broken() {
                return self.drop(kind);
            }
            std::thread::yield_now();
        }
        let packed = bytes.chunks(8).map(|chunk| {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            u64::from_le_bytes(word)
        });
        if let Ok(chunk) = self.ring.write_chunk_uninit(length) {
            chunk.fill_from_iter(head.into_iter().chain(words).chain(packed));
        }
    }

    /// Cycles that come to nothing are seen by what came out.
    fn drop(&mut self, kind: u64) {
        if kind == EVENT {
            self.count.events_dropped.fetch_add(1, Ordering::Relaxed);
        }
    }
}

/// The thread that writes the files.
pub struct RunRecorder {
    thread: JoinHandle<Result<Writers, RecorderError>>,
    count: Arc<Count>,
    files: RunFiles,
    describe: mpsc::Sender<(String, String)>,
}

/// Adds to the description of a run that is being recorded; not for the cycle, for it allocates.
#[derive(Clone, Debug)]
pub struct RunDescriber(mpsc::Sender<(String, String)>);

impl RunDescriber {
    /// Adds a key and its text; a key that is there already is replaced. Nothing happens where the recording is over.
    pub fn describe(&self, key: String, text: String) {
        let _ = self.0.send((key, text));
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
}

type Output = BufWriter<WholeFile>;

struct Writers {
    mcap: Option<(PathBuf, McapRun<Output>)>,
    columns: Option<(PathBuf, ColumnWriter<Output>)>,
}

impl RunRecorder {
    /// Makes the files and starts the thread.
    pub fn start(
        files: &RunFiles,
        schema: &RunSchema,
        on_full: OnFull,
    ) -> Result<(RunRecorder, RunSink), RecorderError> {
        let create = |path: &Path| {
            let file = create(path).map(|file| BufWriter::new(WholeFile::new(file)));
            file.map_err(|source| RecorderError::File { path: path.to_owned(), source })
        };
        let mut writers = Writers { mcap: None, columns: None };
        if let Some(path) = &files.mcap {
            let mcap = McapRun::create(create(path)?, schema, &files.description)
                .map_err(|source| RecorderError::Mcap { path: path.clone(), source })?;
            writers.mcap = Some((path.clone(), mcap));
        }
        if let Some(path) = &files.columns {
            let columns = ColumnWriter::create(create(path)?, schema)
                .map_err(|source| RecorderError::File { path: path.clone(), source })?;
            writers.columns = Some((path.clone(), columns));
        }
        let (ring, consumer) = RingBuffer::new(RING);
        let (describe, described) = mpsc::channel();
        let count = Arc::new(Count::default());
        let counted = count.clone();
        let thread = std::thread::Builder::new()
            .name("recorder".to_owned())
            .spawn(move || drain(consumer, &described, writers, &counted.written))
            .map_err(|source| RecorderError::File { path: PathBuf::from("recorder thread"), source })?;
        let sink = RunSink { ring, count: count.clone(), on_full };
        Ok((RunRecorder { thread, count, files: files.clone(), describe }, sink))
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
        let recorded = |written: u64, failure| RunRecorded {
            written,
            dropped: cycles.saturating_sub(written) + events_dropped,
            failure,
        };
        let finished = ended.and_then(|mut writers| {
            for (key, text) in last_words(&recorded(written, None)) {
                writers.describe(&key, &text)?;
            }
            writers.finish()
        });
        match finished {
            Ok(()) => recorded(written, None),
            // What was given to a file need not have reached it.
            Err(failure) => recorded(readable(&self.files), Some(failure)),
        }
    }
}

/// Cycles that can be read from each of the files.
fn readable(files: &RunFiles) -> u64 {
    let mcap = files.mcap.as_ref().map(|path| {
        let run = File::open(path).map_err(RunError::from);
        run.and_then(|file| RecordedRun::read_from(file, Keep::Times))
            .map_or(0, |run| run.times_ns.len() as u64)
    });
    let columns = files.columns.as_ref().map(|path| {
        File::open(path).and_then(|file| complete_rows(BufReader::new(file))).unwrap_or_default()
    });
    mcap.into_iter().chain(columns).min().unwrap_or_default()
}

/// What a panic said.
fn words(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "a panic".to_owned())
}

/// Writes entries until the sink is gone and the ring is empty, and counts the cycles in `written`; the open files.
fn drain(
    mut ring: Consumer<u64>,
    described: &mpsc::Receiver<(String, String)>,
    mut writers: Writers,
    written: &AtomicU64,
) -> Result<Writers, RecorderError> {
    let mut words = Vec::new();
    let (mut values, mut bytes) = (Vec::new(), Vec::new());
    loop {
        // Asked first: what was pushed before the sink went is seen below.
        let ended = ring.is_abandoned();
        for (key, text) in described.try_iter() {
            writers.describe(&key, &text)?;
        }
        while take(&mut ring, HEADER, &mut words) {
            let (head, time_ns) = (words[0], words[1]);
            let (count, length) = ((head >> 8 & 0xFF_FFFF) as usize, (head >> 32) as usize);
            // Header and content were committed together.
            take(&mut ring, count + length.div_ceil(8), &mut words);
            values.clear();
            values.extend(words[..count].iter().map(|word| f64::from_bits(*word)));
            bytes.clear();
            bytes.extend(words[count..].iter().flat_map(|word| word.to_le_bytes()));
            bytes.truncate(length);
            if head & 0xFF == EVENT {
                writers.event(&RunEvent { time_ns, text: String::from_utf8_lossy(&bytes).into_owned() })?;
            } else {
                writers.row(time_ns, &values, &bytes)?;
                written.fetch_add(1, Ordering::Relaxed);
            }
        }
        if ended {
            return Ok(writers);
        }
        std::thread::sleep(REST);
    }
}

impl Writers {
    fn row(&mut self, time_ns: u64, values: &[f64], raw: &[u8]) -> Result<(), RecorderError> {
        if let Some((path, mcap)) = &mut self.mcap {
            mcap.write_row(time_ns, values, raw)
                .map_err(|source| RecorderError::Mcap { path: path.clone(), source })?;
        }
        if let Some((path, columns)) = &mut self.columns {
            columns
                .write_row(time_ns, values)
                .map_err(|source| RecorderError::Columns { path: path.clone(), source })?;
        }
        Ok(())
    }

    fn describe(&mut self, key: &str, text: &str) -> Result<(), RecorderError> {
        let Some((path, mcap)) = &mut self.mcap else { return Ok(()) };
        mcap.describe(key, text).map_err(|source| RecorderError::Mcap { path: path.clone(), source })
    }

    fn event(&mut self, event: &RunEvent) -> Result<(), RecorderError> {
        let Some((path, mcap)) = &mut self.mcap else { return Ok(()) };
        mcap.write_event(event).map_err(|source| RecorderError::Mcap { path: path.clone(), source })
    }

    fn finish(self) -> Result<(), RecorderError> {
        if let Some((path, mcap)) = self.mcap {
            let finished = mcap.finish().and_then(|output| Ok(ended(output)?));
            finished.map_err(|source| RecorderError::Mcap { path, source })?;
        }
        if let Some((path, columns)) = self.columns {
            columns.finish().and_then(ended).map_err(|source| RecorderError::File { path, source })?;
        }
        Ok(())
    }
}

/// Writes what is still held back, and looks whether all of the file is there.
fn ended(mut output: Output) -> io::Result<()> {
    output.flush()?;
    output.get_ref().check()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::OpenOptions;

    fn schema() -> RunSchema {
        let mut schema = RunSchema::default();
        schema.push("/wheels", ["a", "b", "c", "d"]);
        schema
    }

    fn files(name: &str) -> RunFiles {
        let folder = std::env::temp_dir().join(format!("omnibase-recorder-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let (mcap, columns) = (Some(folder.join("run.mcap")), Some(folder.join("run.txt")));
        RunFiles { mcap, columns, ..RunFiles::default() }
    }

    /// What a reader reads, counted in its own way.
    fn read(files: &RunFiles) -> [u64; 2] {
        let mcap = std::fs::read(files.mcap.as_ref().unwrap());
        let run = mcap.ok().and_then(|bytes| RecordedRun::read(&bytes).ok());
        let columns = std::fs::read_to_string(files.columns.as_ref().unwrap()).unwrap_or_default();
        let lines = columns.matches('\n').count().saturating_sub(1);
        [run.map_or(0, |run| run.raw.len() as u64), lines as u64]
    }

    fn words_of_all(error: &dyn std::error::Error) -> String {
        let further = error.source().map(words_of_all).unwrap_or_default();
        format!("{error}: {further}")
    }

    fn remove(files: &RunFiles) {
        std::fs::remove_dir_all(files.mcap.as_ref().unwrap().parent().unwrap()).unwrap();
    }

    #[test]
    fn a_dead_writer_is_seen_counted_and_told_of() {
        // Room for two rows of seven words.
        let (ring, consumer) = RingBuffer::new(16);
        let count = Arc::new(Count::default());
        let (describe, _described) = mpsc::channel();
        let (die, told_to) = mpsc::channel::<()>();
        let counted = count.clone();
        let files = files("dead");
        let thread = std::thread::spawn({
            let files = files.clone();
            move || -> Result<Writers, RecorderError> {
                let _ring = consumer;
                let output = BufWriter::new(WholeFile::new(create(files.mcap.as_ref().unwrap()).unwrap()));
                let mut mcap = McapRun::create(output, &schema(), &BTreeMap::new()).unwrap();
                mcap.write_row(0, &[0.5; 4], &[7; 8]).unwrap();
                counted.written.fetch_add(1, Ordering::Relaxed);
                let _ = told_to.recv();
                panic!("out of luck");
            }
        });
        let mut sink = RunSink { ring, count: count.clone(), on_full: OnFull::Wait };
        let written = RunFiles { columns: None, ..files.clone() };
        let recorder = RunRecorder { thread, count: count.clone(), files: written, describe };
        sink.push_row(0, &[0.5; 4], &[7; 8]);
        sink.push_row(1, &[0.5; 4], &[7; 8]);
        assert!(!sink.is_broken());
        // It dies while a row waits for room: there won't be any.
        let killer = std::thread::spawn(move || {
            while count.cycles.load(Ordering::Relaxed) < 3 {
                std::thread::yield_now();
            }
            drop(die);
        });
        sink.push_row(2, &[0.5; 4], &[7; 8]);
        assert!(sink.is_broken());
        killer.join().unwrap();
        sink.push_row(3, &[0.5; 4], &[7; 8]);
        // For this one there is room.
        sink.push_event(4, "");
        drop(sink);
        let recorded = recorder.finish();
        assert_eq!((recorded.written, recorded.dropped), (1, 4));
        assert_eq!(read(&files)[0], 1);
        let failure = recorded.failure.expect("it died");
        assert_eq!(failure.to_string(), "the recorder's thread died: out of luck");
        remove(&files);
    }

    #[test]
    fn what_is_said_to_be_written_is_what_can_be_read_of_a_file_that_was_cut_off() {
        for cut_at in [0, 10_000, 700_000] {
            let files = files(&format!("cut-{cut_at}"));
            let (recorder, mut sink) = RunRecorder::start(&files, &schema(), OnFull::Wait).unwrap();
            let path = files.mcap.as_ref().unwrap();
            // Some chunks of 1 MiB, of numbers that don't become smaller by compression.
            let rows = 60_000_u64;
            for row in 0..rows {
                let values = [1, 3, 5, 7].map(|odd| (row * odd).wrapping_mul(0x9E37_79B9_7F4A_7C15) as f64);
                sink.push_row(row, &values, &row.to_le_bytes());
                if row == rows / 2 {
                    // Half of it at least is on its way to the file: the ring has room for less.
                    while recorder.count.written.load(Ordering::Relaxed) < row {
                        std::thread::yield_now();
                    }
                    OpenOptions::new().write(true).open(path).unwrap().set_len(cut_at).unwrap();
                }
            }
            drop(sink);
            let recorded = recorder.finish();
            let failure = words_of_all(&recorded.failure.expect("it was cut off"));
            assert!(failure.contains(&format!("the file was cut off at {cut_at} of ")), "{failure}");
            let [mcap, columns] = read(&files);
            assert!(mcap < rows && columns < rows, "{mcap}, {columns}");
            assert_eq!(recorded.written, mcap.min(columns));
            assert_eq!(recorded.written + recorded.dropped, rows);
            assert!(cut_at < 700_000 || mcap > 0, "{mcap}");
            remove(&files);
        }
    }
}
