//! Reading captures: of real devices, of our own writer, cut off, damaged, and of any bytes.

use omnibase_record::{Capture, CaptureError, Direction, PcapngWriter};
use proptest::prelude::*;

const CAPTURES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/captures");

fn real(name: &str) -> Option<Vec<u8>> {
    let file = std::fs::read(format!("{CAPTURES}/{name}")).ok();
    if file.is_none() {
        eprintln!("SKIPPED: {CAPTURES}/{name} is not there");
    }
    file
}

/// Three frames of 60, 61 and 1514 bytes.
fn written() -> Vec<u8> {
    let mut writer = PcapngWriter::new(Vec::new(), "eth0").unwrap();
    writer.write(1_000_000_007, Direction::Outbound, &[1; 60]).unwrap();
    writer.write(1_000_000_009, Direction::Inbound, &[2; 61]).unwrap();
    writer.write(u64::MAX, Direction::Outbound, &[3; 1514]).unwrap();
    writer.finish().unwrap()
}

#[test]
fn what_was_written_is_read_back() {
    let file = written();
    let capture = Capture::read(&file).unwrap();
    assert_eq!(capture.warnings, []);
    let read: Vec<_> =
        capture.frames.iter().map(|f| (f.number, f.unix_ns, f.direction, f.data.len())).collect();
    let (out, into) = (Some(Direction::Outbound), Some(Direction::Inbound));
    assert_eq!(read, [(1, 1_000_000_007, out, 60), (2, 1_000_000_009, into, 61), (3, u64::MAX, out, 1514)]);
    assert_eq!(capture.frames[1].data, [2; 61]);
    assert_eq!(capture.frames[1].original_length, 61);
}

#[test]
fn real_captures_are_read_whole() {
    let Some(file) = real("replay-dc.pcapng") else { return };
    let capture = Capture::read(&file).unwrap();
    assert_eq!((capture.frames.len(), capture.warnings.len()), (3604, 0));
    // First and last time as capinfos prints them.
    assert_eq!(capture.frames[0].unix_ns, 1_773_540_979_389_182_856);
    assert_eq!(capture.frames[3603].unix_ns, 1_773_540_981_151_997_409);
    assert!(capture.frames.windows(2).all(|pair| pair[0].unix_ns < pair[1].unix_ns));
}

#[test]
fn a_file_cut_off_anywhere_is_read_to_its_last_complete_record() {
    let file = written();
    // Each packet: 44 bytes before and behind the data, which is padded to 4.
    let ends = [file.len() - 1560 - 108 - 104, file.len() - 1560 - 108, file.len() - 1560, file.len()];
    for cut in 0..file.len() {
        match Capture::read(&file[..cut]) {
            Ok(capture) => {
                let complete = ends[1..].iter().filter(|end| **end <= cut).count();
                assert_eq!(capture.frames.len(), complete, "cut at {cut}");
                let at_a_boundary = ends.contains(&cut) || cut == 44;
                assert_eq!(
                    capture.warnings.is_empty(),
                    at_a_boundary,
                    "cut at {cut}: {:?}",
                    capture.warnings
                );
            }
            Err(error) => assert!(cut < 12, "cut at {cut}: {error}"),
        }
    }
}

#[test]
fn a_damaged_block_costs_only_itself() {
    let mut file = written();
    let second = file.len() - 1560 - 108;
    // The captured length of the second packet lies.
    file[second + 20..second + 24].copy_from_slice(&5000u32.to_le_bytes());
    let capture = Capture::read(&file).unwrap();
    let numbers: Vec<u64> = capture.frames.iter().map(|frame| frame.number).collect();
    assert_eq!(numbers, [1, 3]);
    assert_eq!(capture.warnings.len(), 1);
    assert_eq!(
        capture.warnings[0].to_string(),
        format!("byte {second}: a block of type 6 and 108 bytes is damaged: skipped")
    );
}

#[test]
fn other_files_are_refused_with_what_was_found() {
    let error = Capture::read(b"MZ\x90\0 and so on").unwrap_err();
    assert_eq!(
        error.to_string(),
        "not a capture: the file starts with 4d 5a 90 00, expected pcapng (0a 0d 0d 0a) or pcap (d4 c3 b2 a1)"
    );
    assert_eq!(Capture::read(&[]), Err(CaptureError::NotACapture { found: "nothing".to_owned() }));
}

/// A pcap file with one record of `data`.
fn pcap(magic: [u8; 4], data: &[u8]) -> Vec<u8> {
    let big = magic[0] == 0xA1;
    let word = |value: u32| if big { value.to_be_bytes() } else { value.to_le_bytes() };
    let version = if big { [0, 2, 0, 4] } else { [2, 0, 4, 0] };
    let mut file = magic.to_vec();
    file.extend(version);
    for value in [0, 0, 65535, 1, 3, 500, data.len() as u32, data.len() as u32 + 7] {
        file.extend(word(value));
    }
    file.extend(data);
    file
}

#[test]
fn pcap_is_read_in_both_byte_orders_and_both_resolutions() {
    let cases = [
        ([0xd4, 0xc3, 0xb2, 0xa1], 500_000),
        ([0xa1, 0xb2, 0xc3, 0xd4], 500_000),
        ([0x4d, 0x3c, 0xb2, 0xa1], 500),
        ([0xa1, 0xb2, 0x3c, 0x4d], 500),
    ];
    for (magic, fraction_ns) in cases {
        let file = pcap(magic, &[9; 21]);
        let capture = Capture::read(&file).unwrap();
        assert_eq!(capture.warnings, [], "{magic:x?}");
        let frame = capture.frames[0];
        assert_eq!(frame.unix_ns, 3_000_000_000 + fraction_ns, "{magic:x?}");
        assert_eq!((frame.number, frame.data, frame.original_length), (1, &[9; 21][..], 28));

        let cut = Capture::read(&file[..file.len() - 1]).unwrap();
        assert_eq!((cut.frames.len(), cut.warnings.len()), (0, 1));
    }
}

#[test]
fn big_endian_pcapng_with_offset_and_binary_resolution() {
    let mut file = Vec::new();
    let mut block = |kind: u32, body: &[u8]| {
        let length = (body.len() as u32 + 12).to_be_bytes();
        file.extend(kind.to_be_bytes());
        file.extend(length);
        file.extend(body);
        file.extend(length);
    };
    let section = [0x1a, 0x2b, 0x3c, 0x4d, 0, 1, 0, 0, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff];
    block(0x0A0D_0D0A, &section);
    // Ethernet, resolution 2^-10 s, offset 100 s.
    let interface = [
        0, 1, 0, 0, 0, 0, 0, 0, 0, 9, 0, 1, 0x8a, 0, 0, 0, 0, 14, 0, 8, 0, 0, 0, 0, 0, 0, 0, 100, 0, 0, 0, 0,
    ];
    block(1, &interface);
    // 512 units of 1/1024 s, 2 bytes, inbound.
    let packet = [
        0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 2, 0xaa, 0xbb, 0, 0, 0, 2, 0, 4, 0, 0, 0, 1,
        0, 0, 0, 0,
    ];
    block(6, &packet);
    let capture = Capture::read(&file).unwrap();
    assert_eq!(capture.warnings, []);
    let frame = capture.frames[0];
    assert_eq!(frame.unix_ns, 100_500_000_000);
    assert_eq!((frame.direction, frame.data), (Some(Direction::Inbound), &[0xaa, 0xbb][..]));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]

    #[test]
    fn frames_survive_writing_and_reading(
        frames in prop::collection::vec((any::<u64>(), any::<bool>(), prop::collection::vec(any::<u8>(), 0..200)), 0..20)
    ) {
        let direction = |outbound| if outbound { Direction::Outbound } else { Direction::Inbound };
        let mut writer = PcapngWriter::new(Vec::new(), "any").unwrap();
        for (time, outbound, data) in &frames {
            writer.write(*time, direction(*outbound), data).unwrap();
        }
        let file = writer.finish().unwrap();
        let capture = Capture::read(&file).unwrap();
        prop_assert!(capture.warnings.is_empty());
        prop_assert_eq!(capture.frames.len(), frames.len());
        for (read, (time, outbound, data)) in capture.frames.iter().zip(&frames) {
            prop_assert_eq!((read.unix_ns, read.direction, read.data), (*time, Some(direction(*outbound)), &data[..]));
        }
    }

    #[test]
    fn no_bytes_make_it_panic(bytes in prop::collection::vec(any::<u8>(), 0..400), format in 0..6usize) {
        let starts: [&[u8]; 6] = [
            &[],
            &[0x0a, 0x0d, 0x0d, 0x0a, 28, 0, 0, 0, 0x4d, 0x3c, 0x2b, 0x1a],
            &[0x0a, 0x0d, 0x0d, 0x0a, 0, 0, 0, 28, 0x1a, 0x2b, 0x3c, 0x4d],
            &[0xd4, 0xc3, 0xb2, 0xa1],
            &[0xa1, 0xb2, 0xc3, 0xd4],
            &[0x34, 0xcd, 0xb2, 0xa1],
        ];
        let file = [starts[format], &bytes].concat();
        let _ = Capture::read(&file);
    }

    #[test]
    fn changed_bytes_never_make_it_panic(changes in prop::collection::vec((0..1900usize, any::<u8>()), 1..12)) {
        let mut file = written();
        for (at, value) in changes {
            if let Some(byte) = file.get_mut(at) {
                *byte = value;
            }
        }
        let _ = Capture::read(&file);
    }
}
