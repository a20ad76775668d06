//! A run that was recorded is read back to the same bits.

use omnibase_record::report;
use omnibase_record::run::{
    BEGUN, Keep, McapRun, OnFull, RecordedRun, RunError, RunEvent, RunFiles, RunRecorder, RunSchema, Word,
};
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::ops::ControlFlow;

fn schema() -> RunSchema {
    let mut schema = RunSchema::default();
    schema.push("/platform/believed", ["x_m", "y_m", "heading_rad"]);
    schema.push("/wheels", ["left_rad_s", "right_rad_s"]);
    schema.words = vec![Word::Bits(4), Word::Bits(1), Word::Bits(0)];
    schema
}

/// Values that decimal text or a careless codec would change: NaN with a payload, -0, subnormal, huge.
fn odd_rows() -> Vec<[f64; 5]> {
    let payload = f64::from_bits(0x7FF8_0000_0000_1234);
    (0..3000u32)
        .map(|n| [f64::from(n) * 0.1, -0.0, f64::MIN_POSITIVE / 8.0, payload, 1e300 / f64::from(n + 1)])
        .collect()
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

/// The bytes that replay a row, by the schema's words.
fn replayed(row: &[f64; 5]) -> Vec<u8> {
    [row[4], row[1], row[0]].iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn recorded(rows: &[[f64; 5]]) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let description = BTreeMap::from([("robot".to_owned(), "bmm".to_owned())]);
    let mut run = McapRun::create(&mut file, &schema(), &description).unwrap();
    for (number, row) in rows.iter().enumerate() {
        run.write_row(number as u64 * 1_000_000, &bits(row)).unwrap();
    }
    run.finish().unwrap();
    file.into_inner()
}

#[test]
fn every_bit_of_every_cycle_is_read_back() {
    let rows = odd_rows();
    let run = RecordedRun::read(&recorded(&rows)).unwrap();
    assert_eq!(run.schema, schema());
    assert_eq!(run.description["robot"], "bmm");
    assert_eq!((run.times_ns.len(), run.times_ns[7]), (rows.len(), 7_000_000));
    assert_eq!(bits(&run.values), bits(&rows.concat()));
    assert!(run.raw.iter().zip(&rows).all(|(raw, row)| *raw == replayed(row)));
    assert_eq!(run.truncated, None);
    let x: Vec<f64> = run.column("/platform/believed", "x_m").unwrap().collect();
    assert_eq!(x[10], 1.0);
    assert!(run.column("/platform/believed", "z_m").is_none());
}

#[test]
fn others_see_the_wall_clock_and_the_run_is_read_back_by_its_own_time() {
    let begun_unix_ns = 1_800_000_000_000_000_000;
    let description = BTreeMap::from([(BEGUN.to_owned(), begun_unix_ns.to_string())]);
    let mut file = Cursor::new(Vec::new());
    let mut run = McapRun::create(&mut file, &schema(), &description).unwrap();
    run.write_event(&RunEvent { time_ns: 5, text: "begun".to_owned() }).unwrap();
    for (number, row) in odd_rows()[..3].iter().enumerate() {
        run.write_row(number as u64 * 1_000_000, &bits(row)).unwrap();
    }
    run.finish().unwrap();
    let bytes = file.into_inner();
    let mut seen = 0;
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        assert_eq!(message.log_time, begun_unix_ns + message.publish_time);
        seen += 1;
    }
    let run = RecordedRun::read(&bytes).unwrap();
    assert_eq!(run.times_ns, [0, 1_000_000, 2_000_000]);
    assert_eq!(run.events[0].time_ns, 5);
    // Three rows and the event.
    assert_eq!(seen, 4);
}

#[test]
fn a_file_that_was_cut_off_is_read_to_its_last_whole_chunk() {
    let mut rows = Vec::new();
    for _ in 0..20 {
        rows.extend(odd_rows());
    }
    let bytes = recorded(&rows);
    let run = RecordedRun::read(&bytes[..bytes.len() * 2 / 3]).unwrap();
    let read = run.times_ns.len();
    assert!(read > rows.len() / 3 && read < rows.len(), "{read} of {}", rows.len());
    assert_eq!(bits(&run.values), bits(&rows[..read].concat()));
    assert!(run.truncated.is_some());
}

/// Also two at the same time.
#[test]
fn a_cycle_in_which_nothing_changed_is_a_cycle() {
    let mut file = Cursor::new(Vec::new());
    let mut run = McapRun::create(&mut file, &schema(), &BTreeMap::new()).unwrap();
    let row = [1.0, -0.0, f64::NAN, 0.0, 5.0];
    for number in 0..5_u8 {
        run.write_row(u64::from(number.min(3)), &bits(&row)).unwrap();
    }
    run.finish().unwrap();
    let run = RecordedRun::read(&file.into_inner()).unwrap();
    assert_eq!(run.times_ns, [0, 1, 2, 3, 3]);
    assert_eq!(run.raw, vec![replayed(&row); 5]);
    assert_eq!(bits(&run.values), bits(&row.repeat(5)));
}

/// A count above 2⁵³ and a value, of which the words are the bits.
#[test]
fn a_cycle_is_one_message_and_its_words_come_back() {
    let mut schema = schema();
    schema.words = vec![Word::Count(3), Word::Bits(0), Word::Count(1)];
    let mut file = Cursor::new(Vec::new());
    let mut run = McapRun::create(&mut file, &schema, &BTreeMap::new()).unwrap();
    let rows: Vec<([f64; 5], [u64; 3])> = (0..2500_u64)
        .map(|n| {
            let count = (1 << 60) + n / 1000;
            let values = [n as f64 * 0.1, (1 << 63 | n) as f64, 0.0, count as f64, (n / 100) as f64];
            (values, [count, values[0].to_bits(), 1 << 63 | n])
        })
        .collect();
    let raw = |words: &[u64; 3]| -> Vec<u8> { words.iter().flat_map(|word| word.to_le_bytes()).collect() };
    for (number, (values, words)) in rows.iter().enumerate() {
        let row = [words[1], words[2], values[2].to_bits(), words[0], values[4].to_bits()];
        run.write_row(number as u64 * 1_000_000, &row).unwrap();
    }
    run.finish().unwrap();
    let bytes = file.into_inner();
    let mut told = BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        *told.entry(message.unwrap().channel.topic.clone()).or_insert(0) += 1;
    }
    assert_eq!(told, BTreeMap::from([("/robot".to_owned(), 2500)]));
    let run = RecordedRun::read(&bytes).unwrap();
    assert_eq!(bits(&run.values), bits(&rows.iter().flat_map(|(values, _)| *values).collect::<Vec<_>>()));
    assert!(run.raw.iter().zip(&rows).all(|(read, (_, words))| *read == raw(words)));
    // Row by row, and until it is enough.
    for enough in [2500, 300] {
        let mut taken = 0;
        let about = RecordedRun::read_each(&bytes[..], Keep::All, &mut |about, row| {
            assert_eq!(about.schema, schema);
            assert_eq!((row.time_ns, bits(row.values)), (taken as u64 * 1_000_000, bits(&rows[taken].0)));
            assert_eq!(row.raw, raw(&rows[taken].1));
            taken += 1;
            if taken == enough { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        let about = about.unwrap();
        assert_eq!((taken, about.times_ns.len(), about.truncated), (enough, 0, None));
    }
}

/// A field of bytes, shorter than 128, as protobuf has it.
fn field(number: u8, data: &[u8]) -> Vec<u8> {
    [&[number << 3 | 2, u8::try_from(data.len()).unwrap()], data].concat()
}

/// A channel of a recording as they were, with a message for each topic.
fn old_channel(
    writer: &mut mcap::Writer<&mut Cursor<Vec<u8>>>,
    topic: &str,
    names: &[&str],
    words: &str,
) -> u16 {
    let fields: Vec<u8> = names.iter().flat_map(|name| field(2, &field(1, name.as_bytes()))).collect();
    let descriptor = field(1, &field(4, &fields));
    let schema = writer.add_schema(topic, "protobuf", &descriptor).unwrap();
    let metadata = BTreeMap::from([("words".to_owned(), words.to_owned())]);
    let metadata = if words.is_empty() { BTreeMap::new() } else { metadata };
    writer.add_channel(schema, topic, "protobuf", &metadata).unwrap()
}

/// A message for each cycle, in which counts are doubles: what they don't tell stands beside them, or all of the words does.
#[test]
fn recordings_of_counts_as_doubles_are_read_as_ever() {
    let mut file = Cursor::new(Vec::new());
    let options = mcap::WriteOptions::new().compression(Some(mcap::Compression::Zstd));
    let mut writer = mcap::Writer::with_options(&mut file, options).unwrap();
    let part = field(3, &["x_m", "count"].map(|name| field(2, &field(1, name.as_bytes()))).concat());
    let descriptor = writer.add_schema("robot", "protobuf", &field(1, &field(4, &part))).unwrap();
    let told = [("topics", "/place"), ("words", "c1 b0")];
    let metadata = told.map(|(key, text)| (key.to_owned(), text.to_owned())).into();
    let channel_id = writer.add_channel(descriptor, "/robot", "protobuf", &metadata).unwrap();
    let double = |number: u8, value: f64| [&[number << 3 | 1][..], &value.to_le_bytes()].concat();
    let place = field(3, &[double(1, 0.5), double(2, 4.0)].concat());
    let count = (1_u64 << 60) + 1;
    let rest = [&[0, 0][..], &count.to_le_bytes()].concat();
    for (time, beside) in [(0, field(1, b"all of them")), (1, field(2, &rest))] {
        let header =
            mcap::records::MessageHeader { channel_id, sequence: 0, log_time: time, publish_time: time };
        writer.write_to_known_channel(&header, &[beside, place.clone()].concat()).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    let run = RecordedRun::read(&file.into_inner()).unwrap();
    assert_eq!(run.values, [0.5, 4.0].repeat(2));
    let words = [count.to_le_bytes(), 0.5_f64.to_le_bytes()].concat();
    assert_eq!(run.raw, [b"all of them".to_vec(), words]);
}

#[test]
fn recordings_of_a_message_for_each_topic_that_changed_are_read_as_ever() {
    let mut file = Cursor::new(Vec::new());
    let options = mcap::WriteOptions::new().compression(Some(mcap::Compression::Lz4));
    let mut writer = mcap::Writer::with_options(&mut file, options).unwrap();
    let place = old_channel(&mut writer, "/place", &["x_m", "y_m"], "");
    let phase = old_channel(&mut writer, "/phase", &["phase"], "");
    let raw = old_channel(&mut writer, "/raw", &["data", "rest"], "b0 c1");
    let mut send = |channel_id: u16, time: u64, data: &[u8]| {
        let header =
            mcap::records::MessageHeader { channel_id, sequence: 0, log_time: time, publish_time: time };
        writer.write_to_known_channel(&header, data).unwrap();
    };
    let double = |number: u8, value: f64| [&[number << 3 | 1][..], &value.to_le_bytes()].concat();
    send(place, 0, &[double(1, 0.5), double(2, 4.0)].concat());
    // Of the first row a topic is missing: it isn't whole.
    send(raw, 0, &[]);
    send(place, 1, &[double(1, 0.5), double(2, 4.0)].concat());
    send(phase, 1, &double(1, 3.0));
    send(raw, 1, &[]);
    // x is 0, and y is no count but what the rest tells.
    send(place, 2, &double(2, 4.5));
    send(raw, 2, &field(2, &[1, 0, 9, 9, 9, 9, 9, 9, 9, 9]));
    // Nothing changed.
    send(raw, 3, &field(1, b"all of it"));
    // What lacks its end isn't whole.
    send(phase, 4, &double(1, 2.0));
    writer.finish().unwrap();
    drop(writer);
    let run = RecordedRun::read(&file.into_inner()).unwrap();
    assert_eq!(run.times_ns, [1, 2, 3]);
    assert_eq!(run.values, [0.5, 4.0, 3.0, 0.0, 4.5, 3.0, 0.0, 4.5, 3.0]);
    let words = |one: f64, other: [u8; 8]| [one.to_le_bytes(), other].concat();
    assert_eq!(run.raw, [words(0.5, 4_u64.to_le_bytes()), words(0.0, [9; 8]), b"all of it".to_vec()]);
    assert_eq!(run.schema.column("/phase", "phase"), Some(2));
}

#[test]
fn a_row_of_the_wrong_width_and_a_foreign_file_are_refused() {
    let mut run = McapRun::create(Cursor::new(Vec::new()), &schema(), &BTreeMap::new()).unwrap();
    let refused = run.write_row(0, &[1]);
    assert!(matches!(refused, Err(RunError::RowWidth { expected: 5, found: 1 })));
    for (bytes, why) in [
        (
            &b"not an MCAP file at all, but long enough"[..],
            "not MCAP: the file starts with 6e 6f 74 20 61 6e 20 4d",
        ),
        (b"", "not MCAP: the file starts with nothing: it is empty"),
    ] {
        assert_eq!(RecordedRun::read(bytes).unwrap_err().to_string(), why);
    }
}

#[test]
fn the_recorder_writes_both_files_and_counts() {
    let folder = std::env::temp_dir().join(format!("omnibase-run-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let files = RunFiles {
        mcap: Some(folder.join("run.mcap")),
        columns: Some(folder.join("run.txt")),
        description: BTreeMap::new(),
        ..RunFiles::default()
    };
    let (recorder, mut sink) = RunRecorder::start(&files, &schema(), OnFull::Wait).unwrap();
    let rows = odd_rows();
    for (number, row) in rows.iter().enumerate() {
        sink.push_row(number as u64 * 1_000_000, &bits(row));
        if number == 5 {
            sink.push_event(5_000_000, "tracking");
        }
    }
    drop(sink);
    let recorded = recorder.finish();
    assert!(recorded.failure.is_none(), "{:?}", recorded.failure);
    assert_eq!((recorded.written, recorded.dropped), (rows.len() as u64, 0));

    let run = RecordedRun::read(&std::fs::read(folder.join("run.mcap")).unwrap()).unwrap();
    assert_eq!(bits(&run.values), bits(&rows.concat()));
    assert_eq!(run.raw[2999], replayed(&rows[2999]));
    assert_eq!((run.events.len(), run.events[0].text.as_str()), (1, "tracking"));

    let text = std::fs::read_to_string(folder.join("run.txt")).unwrap();
    let mut lines = text.lines();
    let header = "time_s platform.believed.x_m platform.believed.y_m platform.believed.heading_rad \
                  wheels.left_rad_s wheels.right_rad_s";
    assert_eq!(lines.next(), Some(header));
    for (line, row) in lines.by_ref().zip(&rows) {
        let values: Vec<f64> = line.split(' ').skip(1).map(|word| word.parse().unwrap()).collect();
        assert_eq!(bits(&values[..3]), bits(&row[..3]));
        assert!(values[3].is_nan());
    }
    assert_eq!(text.lines().count(), rows.len() + 1);
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn some_signals_are_read_alone() {
    let rows = odd_rows();
    let keep = Keep::Signals(|topic, signal, _| topic == "/wheels" || signal == "y_m");
    let run = RecordedRun::read_from(recorded(&rows).as_slice(), keep).unwrap();
    let names: Vec<_> =
        run.schema.topics.iter().flat_map(|topic| &topic.signals).map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["y_m", "left_rad_s", "right_rad_s"]);
    let expected: Vec<f64> = rows.iter().flat_map(|row| [row[1], row[3], row[4]]).collect();
    assert_eq!(bits(&run.values), bits(&expected));
    assert!(run.raw.is_empty() && run.times_ns.len() == rows.len());
}

#[test]
fn a_file_that_ends_between_two_records_is_said_to_lack_its_end() {
    let bytes = recorded(&odd_rows());
    // The record DataEnd: its number, its length of 4, its checksum.
    let end =
        (0..bytes.len() - 13).rev().find(|&at| bytes[at..at + 9] == [0x0F, 4, 0, 0, 0, 0, 0, 0, 0]).unwrap();
    let run = RecordedRun::read(&bytes[..end]).unwrap();
    assert_eq!((run.times_ns.len(), run.truncated.as_deref()), (3000, Some("the file lacks its end")));
}

/// The same messages without compression and checksums: what is damaged in it isn't noticed by its wrapping.
fn unprotected(recording: &[u8]) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let options = mcap::WriteOptions::new()
        .compression(None)
        .calculate_chunk_crcs(false)
        .calculate_data_section_crc(false)
        .calculate_summary_section_crc(false);
    let mut writer = mcap::Writer::with_options(&mut file, options).unwrap();
    let metadata = BTreeMap::from([("wheels_m".to_owned(), "0.3 0 1.57 0.1; 0.1 0.2 0 0.1".to_owned())]);
    writer.write_metadata(&mcap::records::Metadata { name: "omnibase".into(), metadata }).unwrap();
    for message in mcap::MessageStream::new(recording).unwrap() {
        writer.write(&message.unwrap()).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    file.into_inner()
}

/// A recording of what a report shows.
fn shown() -> Vec<u8> {
    let mut schema = RunSchema::default();
    schema.push("/cycle", ["period_ns", "phase"]);
    for topic in ["/state", "/wished", "/truth"] {
        schema.push(topic, ["pose_x_m", "pose_y_m", "pose_heading_rad"]);
    }
    schema.push("/timing", ["round_trip_ns"]);
    schema.push("/wheel_1", ["speed_rad_s", "torque_nm"]);
    let mut file = Cursor::new(Vec::new());
    let mut run = McapRun::create(&mut file, &schema, &BTreeMap::new()).unwrap();
    for cycle in 0..40u32 {
        let row: Vec<u64> = (0..schema.width() as u32).map(|n| f64::from(cycle * n % 7).to_bits()).collect();
        run.write_row(u64::from(cycle) * 1_000_000, &row).unwrap();
    }
    run.write_event(&RunEvent { time_ns: 0, text: "begin".to_owned() }).unwrap();
    run.finish().unwrap();
    unprotected(file.get_ref())
}

#[test]
fn recordings_without_compression_and_checksums_are_read_too() {
    let rows = odd_rows();
    let run = RecordedRun::read(&unprotected(&recorded(&rows))).unwrap();
    assert_eq!((bits(&run.values), run.truncated), (bits(&rows.concat()), None));
    let run = RecordedRun::read(&shown()).unwrap();
    assert_eq!((run.times_ns.len(), run.events.len(), run.schema.width()), (40, 1, 14));
}

proptest! {
    #[test]
    fn whatever_a_damaged_recording_says_has_a_page(
        damages in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)
    ) {
        let mut bytes = shown();
        for (at, byte) in damages {
            // Not in the first bytes, by which the format is known.
            let place = 8 + at.index(bytes.len() - 8);
            bytes[place] = byte;
        }
        if let Ok(run) = RecordedRun::read(&bytes) {
            let page = report::html(&run);
            prop_assert!(page.ends_with("</html>\n") && page.len() < 1_000_000);
        }
    }

    #[test]
    fn damaged_files_are_read_as_far_as_they_go(at in any::<prop::sample::Index>(), flip in 1..=255u8, cut in any::<prop::sample::Index>()) {
        let rows = odd_rows();
        let mut bytes = recorded(&rows[..300]);
        let place = at.index(bytes.len());
        bytes[place] ^= flip;
        bytes.truncate(cut.index(bytes.len()) + 1);
        if let Ok(run) = RecordedRun::read(&bytes) {
            prop_assert!(run.times_ns.len() <= 300);
            prop_assert_eq!(run.values.len(), run.times_ns.len() * run.schema.width());
        }
    }
}
