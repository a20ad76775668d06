//! From the cyclic thread to the files: a ring without locks, and a thread that writes.

use super::columns::complete_rows;
use super::writers::{KeptFiles, Writers};
use super::{
    ColumnError, Due, Keep, RecordedRun, Rotation, RunError, RunEvent, RunSchema, SELECTION, Selection,
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
    /// Places of the recorded signals in a row; `None`: all, and the bytes that replay it.
    columns: Option<Vec<usize>>,
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
    /// Hands over one cycle: its time, its values in the schema's order, and the bytes that replay it.
    pub fn push_row(&mut self, time_ns: u64, values: &[f64], raw: &[u8]) {
        if !self.due.take(time_ns) {
            return;
        }
        let Some(columns) = self.columns.take() else {
            let words = values.iter().map(|value| value.to_bits());
            return self.push(ROW, time_ns, words.len(), words, raw);
        };
        let words = columns.iter().map(|&column| values.get(column).map_or(0, |value| value.to_bits()));
        self.push(ROW, time_ns, words.len(), words, &[]);
        self.columns = Some(columns);
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
        let mut columns = None;
        let mut recorded = schema.clone();
        if let Some(words) = files.selection.words(schema) {
            files.description.insert(SELECTION.to_owned(), words);
            let chosen = files.selection.columns(schema);
            recorded = schema.only(&chosen);
            columns = Some(chosen);
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
        let sink = RunSink { ring, count: count.clone(), on_full, due, columns };
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
    let (mut values, mut bytes) = (Vec::new(), Vec::new());
    loop {
        // Asked first: what was pushed before the sink went is seen below.
        let ended = ring.is_abandoned();
        tell(described, &mut writers)?;
        while take(&mut ring, HEADER, &mut words) {
            // What was described before a cycle stands in its file, however many of them wait here.
            tell(described, &mut writers)?;
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

#[cfg(test)]
mod tests {
    use super::super::McapRun;
    use super::*;
    use crate::output::create;
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
                let output = create(files.mcap.as_ref().unwrap()).unwrap();
                let mut mcap = McapRun::create(output, &schema(), &BTreeMap::new()).unwrap();
                mcap.write_row(0, &[0.5; 4], &[7; 8]).unwrap();
                counted.written.fetch_add(1, Ordering::Relaxed);
                let _ = told_to.recv();
                panic!("out of luck");
            }
        });
        let due = Due::new(&Selection::default());
        let mut sink = RunSink { ring, count: count.clone(), on_full: OnFull::Wait, due, columns: None };
        let kept = KeptFiles::default();
        kept.look().mcap = files.mcap.clone();
        let recorder = RunRecorder { thread, count: count.clone(), kept, describe };
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

    /// The files of a folder, by name, with what they say.
    fn all_files(files: &RunFiles) -> Vec<(String, Vec<u8>)> {
        let folder = files.mcap.as_ref().unwrap().parent().unwrap();
        let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let named = entries.map(|path| {
            (path.file_name().unwrap().to_str().unwrap().to_owned(), std::fs::read(&path).unwrap())
        });
        let mut all: Vec<_> = named.collect();
        all.sort();
        all
    }

    #[test]
    fn files_of_a_series_keep_their_length_are_read_alone_and_lose_no_cycle() {
        const MOST: u64 = 100_000;
        for kept in [None, Some(3)] {
            let mut files = files(&format!("series-{kept:?}"));
            files.rotation = Some(Rotation { file_bytes: MOST, files: kept });
            files.description.insert("robot".to_owned(), "made up".to_owned());
            // What a run before left.
            let left = files.mcap.as_ref().unwrap().with_file_name("run-00099.mcap");
            std::fs::write(left, "of the run before").unwrap();
            let (recorder, mut sink) = RunRecorder::start(&files, &schema(), OnFull::Wait).unwrap();
            let describer = recorder.describer();
            let rows = 20_000_u64;
            for row in 0..rows {
                let values = [1, 3, 5, 7].map(|odd| (row * odd).wrapping_mul(0x9E37_79B9_7F4A_7C15) as f64);
                sink.push_row(row * 1_000_000, &values, &row.to_le_bytes());
                if row % 100 == 0 {
                    sink.push_event(row * 1_000_000, "a hundred more");
                }
                if row == rows / 2 {
                    while recorder.count.written.load(Ordering::Relaxed) < row {
                        std::thread::yield_now();
                    }
                    describer.describe("reference/1".to_owned(), "kind = \"circle\"".to_owned());
                }
            }
            drop(sink);
            let recorded = recorder.finish_with(|_| BTreeMap::from([("cycles".into(), "20000".into())]));
            assert!(recorded.failure.is_none(), "{:?}", recorded.failure);
            let all = all_files(&files);
            let (mut times, mut lines, mut numbers) = (Vec::new(), 0, Vec::new());
            for (name, bytes) in &all {
                assert!(bytes.len() as u64 <= MOST, "{name}: {}", bytes.len());
                if name.ends_with("txt") {
                    let text = String::from_utf8(bytes.clone()).unwrap();
                    assert!(text.starts_with("time_s wheels.a") && text.ends_with('\n'), "{name}");
                    lines += text.matches('\n').count() as u64 - 1;
                    continue;
                }
                let run = RecordedRun::read(bytes).unwrap();
                assert_eq!(run.truncated, None, "{name}");
                assert_eq!(
                    (run.raw.len(), &*run.description["robot"]),
                    (run.times_ns.len(), "made up"),
                    "{name}"
                );
                numbers.push(run.description[crate::run::FILE_NUMBER].parse::<u64>().unwrap());
                let is_late = run.times_ns.first().is_some_and(|time| *time > rows / 2 * 1_000_000);
                assert!(!is_late || run.description.contains_key("reference/1"), "{name}");
                times.extend(run.times_ns);
            }
            assert_eq!(recorded.dropped, 0);
            assert_eq!((recorded.written, recorded.written + recorded.removed), (times.len() as u64, rows));
            assert_eq!(lines, recorded.written);
            // No gap, up to the last cycle.
            let first = rows - recorded.written;
            assert!(times.iter().copied().eq((first..rows).map(|row| row * 1_000_000)), "{kept:?}");
            let of_kind = all.len() / 2;
            assert_eq!(kept.is_none(), recorded.removed == 0);
            assert!(kept.map_or(of_kind > 10, |kept| of_kind == kept as usize), "{of_kind} files");
            assert!(numbers.windows(2).all(|pair| pair[1] == pair[0] + 1), "{numbers:?}");
            remove(&files);
        }
    }

    #[test]
    fn a_file_that_has_no_room_for_a_cycle_is_refused_at_the_start() {
        let mut files = files("short");
        files.rotation = Some(Rotation { file_bytes: 3000, files: None });
        let refused =
            RunRecorder::start(&files, &schema(), OnFull::Wait).err().expect("too short").to_string();
        assert!(refused.contains("a file of 3000 bytes has no room for a cycle"), "{refused}");
        remove(&files);
    }

    #[test]
    fn chosen_signals_are_read_back_without_the_bytes_that_replay() {
        let mut files = files("chosen");
        files.selection = Selection { signals: vec!["*.c".into(), "wheels.a".into()], every_ns: Some(10) };
        let (recorder, mut sink) = RunRecorder::start(&files, &schema(), OnFull::Wait).unwrap();
        for time in 0..35 {
            sink.push_row(time, &[1.0, 2.0, 3.0, time as f64], &[7; 8]);
        }
        sink.push_event(12, "happened");
        drop(sink);
        let recorded = recorder.finish();
        assert_eq!((recorded.written, recorded.dropped), (4, 0));
        let run = RecordedRun::read(&std::fs::read(files.mcap.as_ref().unwrap()).unwrap()).unwrap();
        assert_eq!(run.schema.names().collect::<Vec<_>>(), ["wheels.a", "wheels.c"]);
        assert_eq!(run.times_ns, [0, 10, 20, 30]);
        assert_eq!(run.values, [1.0, 3.0].repeat(4));
        assert!(run.raw.is_empty() && run.events.len() == 1);
        assert_eq!(run.description[SELECTION], "2 of 4 signals, every 0.00001 ms");
        let text = std::fs::read_to_string(files.columns.as_ref().unwrap()).unwrap();
        assert!(text.starts_with("time_s wheels.a wheels.c\n0.000000000 1e0 3e0\n"), "{text}");
        remove(&files);
    }
}
