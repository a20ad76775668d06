//! A recorder that dies, is cut off, fills its files, and chooses among signals.

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
    // Room for two rows of six words.
    let (ring, consumer) = RingBuffer::new(14);
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
            mcap.write_row(0, &[7; 4]).unwrap();
            counted.written.fetch_add(1, Ordering::Relaxed);
            let _ = told_to.recv();
            panic!("out of luck");
        }
    });
    let due = Due::new(&Selection::default());
    let (count_in, entry) = (count.clone(), Vec::new());
    let mut sink = RunSink { ring, count: count_in, on_full: OnFull::Wait, due, chosen: None, entry };
    let kept = KeptFiles::default();
    kept.look().mcap = files.mcap.clone();
    let recorder = RunRecorder { thread, count: count.clone(), kept, describe };
    sink.push_row(0, &[7; 4]);
    sink.push_row(1, &[7; 4]);
    assert!(!sink.is_broken());
    // It dies while a row waits for room: there won't be any.
    let killer = std::thread::spawn(move || {
        while count.cycles.load(Ordering::Relaxed) < 3 {
            std::thread::yield_now();
        }
        drop(die);
    });
    sink.push_row(2, &[7; 4]);
    assert!(sink.is_broken());
    killer.join().unwrap();
    sink.push_row(3, &[7; 4]);
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
            let values = [1, 3, 5, 7].map(|odd| (row * odd).wrapping_mul(0x9E37_79B9_7F4A_7C15));
            sink.push_row(row, &values);
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
    let named = entries
        .map(|path| (path.file_name().unwrap().to_str().unwrap().to_owned(), std::fs::read(&path).unwrap()));
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
            let values = [1, 3, 5, 7].map(|odd| (row * odd).wrapping_mul(0x9E37_79B9_7F4A_7C15));
            sink.push_row(row * 1_000_000, &values);
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
    let refused = RunRecorder::start(&files, &schema(), OnFull::Wait).err().expect("too short").to_string();
    assert!(refused.contains("a file of 3000 bytes has no room for a cycle"), "{refused}");
    remove(&files);
}

#[test]
fn chosen_signals_are_read_back_without_the_bytes_that_replay() {
    let mut schema = schema();
    schema.words = vec![Word::Count(2), Word::Count(1)];
    let mut files = files("chosen");
    files.selection = Selection { signals: vec!["*.c".into(), "wheels.a".into()], every_ns: Some(10) };
    let (recorder, mut sink) = RunRecorder::start(&files, &schema, OnFull::Wait).unwrap();
    for time in 0..35 {
        sink.push_row(time, &[1.0_f64.to_bits(), 2, 3, (time as f64).to_bits()]);
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
