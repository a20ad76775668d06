//! Any bytes as a capture file: read as far as possible, and every frame read is inside the file's bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;
use omnibase_record::{Capture, Direction, PcapngWriter};

fuzz_target!(|bytes: &[u8]| {
    let Ok(capture) = Capture::read(bytes) else { return };
    let total: usize = capture.frames.iter().map(|frame| frame.data.len()).sum();
    assert!(total <= bytes.len(), "{total} bytes of frames out of {}", bytes.len());

    // What was read can be written, and reads the same.
    let mut file = Vec::new();
    let mut writer = PcapngWriter::new(&mut file, "fuzz").unwrap();
    for frame in &capture.frames {
        let direction = frame.direction.unwrap_or(Direction::Inbound);
        writer.write(frame.unix_ns, direction, &frame.data).unwrap();
    }
    writer.finish().unwrap();
    let again = Capture::read(&file).expect("our own file");
    assert_eq!(again.frames.len(), capture.frames.len());
    for (ours, theirs) in again.frames.iter().zip(&capture.frames) {
        assert_eq!((ours.unix_ns, &ours.data), (theirs.unix_ns, &theirs.data));
    }
});
