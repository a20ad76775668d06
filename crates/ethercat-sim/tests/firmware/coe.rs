//! CoE: every form of SDO, SDO Information, and any bytes at all.

use crate::rig::{FIRST, Rig, SERVO};
use omnibase_ethercat_sim::device::drive::DriveKind;
use proptest::prelude::*;

const SDO: u16 = 2;
const ANSWER: u16 = 3;
const INFO: u16 = 8;

fn rig() -> Rig {
    let mut rig = Rig::drive(DriveKind::Generic);
    rig.bring_to_pre_op(FIRST);
    rig
}

fn sdo(command: u8, index: u16, subindex: u8, value: u32) -> [u8; 8] {
    let ([low, high], [a, b, c, d]) = (index.to_le_bytes(), value.to_le_bytes());
    [command, low, high, subindex, a, b, c, d]
}

/// The abort code of an answer.
fn abort(answer: (u16, Vec<u8>)) -> u32 {
    let (service, data) = answer;
    assert_eq!((service, data[0]), (SDO, 0x80), "{data:02X?}");
    u32::from_le_bytes([data[4], data[5], data[6], data[7]])
}

/// A whole upload in as many messages as it takes; complete access with command 0x50.
fn upload(rig: &mut Rig, command: u8, index: u16, subindex: u8) -> Result<Vec<u8>, u32> {
    let answer = rig.coe(FIRST, SDO, &sdo(command, index, subindex, 0));
    let (service, data) = &answer;
    if data[0] == 0x80 {
        return Err(abort(answer));
    }
    assert_eq!((*service, data[0] & 0xE0, data[0] & 0x10), (ANSWER, 0x40, command & 0x10));
    if data[0] & 2 != 0 {
        return Ok(data[4..8 - usize::from(data[0] >> 2 & 3)].to_vec());
    }
    let size = u32::from_le_bytes([data[4], data[5], data[6], data[7]]) as usize;
    let mut value = data[8..].to_vec();
    let mut toggle = 0;
    while value.len() < size {
        let (service, data) = rig.coe(FIRST, SDO, &sdo(0x60 | toggle, 0, 0, 0));
        assert_eq!((service, data[0] & 0xE0, data[0] & 0x10), (ANSWER, 0, toggle));
        let unused = if data.len() == 8 { usize::from(data[0] >> 1 & 7) } else { 0 };
        value.extend_from_slice(&data[1..data.len() - unused]);
        assert_eq!(data[0] & 1 != 0, value.len() == size, "the last segment says so");
        toggle ^= 0x10;
    }
    assert_eq!(value.len(), size);
    Ok(value)
}

/// A whole download, its first message with as much as fits where `first` says so.
fn download(rig: &mut Rig, command: u8, object: (u16, u8), value: &[u8], first: usize) -> Result<(), u32> {
    let mut body = sdo(command, object.0, object.1, value.len() as u32).to_vec();
    let (now, mut later) = value.split_at(first.min(value.len()));
    body.extend_from_slice(now);
    let answer = rig.coe(FIRST, SDO, &body);
    if answer.1[0] == 0x80 {
        return Err(abort(answer));
    }
    assert_eq!((answer.0, answer.1[0] & 0xE0, answer.1[0] & 0x10), (ANSWER, 0x60, command & 0x10));
    let mut toggle = 0;
    while !later.is_empty() {
        let (segment, rest) = later.split_at(later.len().min(240));
        let mut body = vec![toggle | u8::from(rest.is_empty())];
        if segment.len() < 7 {
            body[0] |= (7 - segment.len() as u8) << 1;
        }
        body.extend_from_slice(segment);
        body.resize(body.len().max(8), 0);
        let answer = rig.coe(FIRST, SDO, &body);
        if answer.1[0] == 0x80 {
            return Err(abort(answer));
        }
        assert_eq!((answer.0, answer.1[0]), (ANSWER, 0x20 | toggle));
        toggle ^= 0x10;
        later = rest;
    }
    Ok(())
}

#[test]
fn uploads_are_expedited_normal_or_segmented_by_length() {
    let mut rig = rig();
    assert_eq!(upload(&mut rig, 0x40, 0x1000, 0), Ok(vec![0x92, 0x01, 0x02, 0x00]));
    assert_eq!(upload(&mut rig, 0x40, 0x6061, 0), Ok(vec![0]));
    assert_eq!(upload(&mut rig, 0x40, 0x1008, 0), Ok(b"CiA402-Servo".to_vec()));
    assert_eq!(upload(&mut rig, 0x40, 0x2F02, 0), Ok(vec![1, 2, 3, 4, 5]));
    assert_eq!(upload(&mut rig, 0x40, 0x2F03, 0), Ok(vec![0; 8]));
    let expected: Vec<u8> = (0..4096u32).map(|byte| (byte * 7 + byte / 256) as u8).collect();
    assert_eq!(upload(&mut rig, 0x40, 0x2F00, 0), Ok(expected));
    assert_eq!(upload(&mut rig, 0x40, 0x2F01, 0), Ok(Vec::new()), "an empty text");
}

#[test]
fn downloads_are_expedited_normal_or_segmented() {
    let mut rig = rig();
    rig.download(FIRST, (0x2F04, 1), &[0x34, 0x12]).unwrap();
    assert_eq!(upload(&mut rig, 0x40, 0x2F04, 1), Ok(vec![0x34, 0x12]));
    // Size not indicated: the object knows it.
    let answer = rig.coe(FIRST, SDO, &sdo(0x22, 0x2F04, 2, 0xBEEF)).1;
    assert_eq!(answer[0], 0x60);
    assert_eq!(upload(&mut rig, 0x40, 0x2F04, 2), Ok(vec![0xEF, 0xBE]));
    for length in [1, 4, 5, 12, 64] {
        let text: Vec<u8> = (0..length).map(|n| b'a' + n % 26).collect();
        download(&mut rig, 0x21, (0x2F01, 0), &text, 300).unwrap();
        assert_eq!(upload(&mut rig, 0x40, 0x2F01, 0), Ok(text.clone()), "normal, {length}");
        download(&mut rig, 0x21, (0x2F01, 0), &text, 0).unwrap();
        assert_eq!(upload(&mut rig, 0x40, 0x2F01, 0), Ok(text), "segmented, {length}");
    }
    for length in [241, 1000, 4096] {
        let data: Vec<u8> = (0..length).map(|n: u32| (n ^ n >> 8) as u8).collect();
        download(&mut rig, 0x21, (0x2F00, 0), &data, 240).unwrap();
        assert_eq!(upload(&mut rig, 0x40, 0x2F00, 0), Ok(data), "{length}");
    }
}

#[test]
fn complete_access_reads_and_writes_whole_objects() {
    let mut rig = rig();
    let words = upload(&mut rig, 0x50, 0x2F04, 0).unwrap();
    assert_eq!((words.len(), &words[..6]), (34, &[16, 0, 1, 0, 2, 0][..]));
    assert_eq!(upload(&mut rig, 0x50, 0x2F04, 1).unwrap(), words[2..]);
    let new: Vec<u8> = (0..32).collect();
    download(&mut rig, 0x31, (0x2F04, 1), &new, 300).unwrap();
    assert_eq!(upload(&mut rig, 0x50, 0x2F04, 1), Ok(new));
    let identity = upload(&mut rig, 0x50, 0x1018, 0).unwrap();
    assert_eq!((identity.len(), identity[0]), (18, 4));
    assert_eq!(upload(&mut rig, 0x50, 0x6040, 0), Err(0x0601_0000), "a variable isn't complete");
    assert_eq!(upload(&mut rig, 0x50, 0x2F04, 2), Err(0x0601_0000), "complete from subindex 2 on");
    assert_eq!(upload(&mut rig, 0x50, 0x5555, 0), Err(0x0602_0000));
    let whole = download(&mut rig, 0x31, (0x1018, 1), &[0; 16], 300);
    assert_eq!(whole, Err(0x0601_0002), "read only");
}

#[test]
fn an_assignment_is_written_whole_or_not_at_all() {
    let mut rig = rig();
    let mapping = [2, 0, 0x10, 0, 0x40, 0x60, 0x20, 0, 0x7A, 0x60];
    download(&mut rig, 0x31, (0x1600, 0), &mapping, 300).unwrap();
    assert_eq!(upload(&mut rig, 0x50, 0x1600, 0), Ok(mapping.to_vec()));
    let wrong = [2, 0, 0x10, 0, 0x40, 0x60, 0x20, 0, 0x41, 0x60];
    assert_eq!(download(&mut rig, 0x31, (0x1600, 0), &wrong, 300), Err(0x0604_0041));
    assert_eq!(upload(&mut rig, 0x50, 0x1600, 0), Ok(mapping.to_vec()), "as it was");
    download(&mut rig, 0x31, (0x1C12, 0), &[1, 0, 0, 0x16], 300).unwrap();
    assert_eq!(upload(&mut rig, 0x40, 0x1C12, 1), Ok(vec![0, 0x16]));
}

#[test]
fn a_mapping_is_written_entry_by_entry_while_it_is_empty() {
    let mut rig = rig();
    let object = |index: u32, bits: u32| (index << 16 | bits).to_le_bytes();
    assert_eq!(rig.download(FIRST, (0x1A00, 1), &object(0x606C, 32)), Err(0x0601_0003));
    rig.download(FIRST, (0x1A00, 0), &[0]).unwrap();
    rig.download(FIRST, (0x1A00, 1), &object(0x6041, 16)).unwrap();
    rig.download(FIRST, (0x1A00, 2), &object(0x606C, 32)).unwrap();
    assert_eq!(rig.download(FIRST, (0x1A00, 3), &object(0x6040, 16)), Err(0x0604_0041), "not an input");
    assert_eq!(rig.download(FIRST, (0x1A00, 3), &object(0x606C, 16)), Err(0x0604_0041), "wrong length");
    assert_eq!(rig.download(FIRST, (0x1A00, 3), &object(0x7777, 16)), Err(0x0602_0000));
    rig.download(FIRST, (0x1A00, 0), &[2]).unwrap();
    rig.process_data_on(FIRST, crate::rig::Lengths { outputs: 16, inputs: 6 });
    assert_eq!(rig.request(FIRST, 4), (4, 0));
    assert_eq!(rig.download(FIRST, (0x1A00, 0), &[0]), Err(0x0800_0022), "in PRE-OP only");
}

#[test]
fn misuse_has_its_abort_code() {
    let mut rig = rig();
    assert_eq!(rig.upload(FIRST, (0x5000, 0)), Err(0x0602_0000));
    assert_eq!(rig.upload(FIRST, (0x6040, 1)), Err(0x0609_0011));
    assert_eq!(rig.upload(FIRST, (0x2F05, 0)), Err(0x0601_0001));
    assert_eq!(rig.download(FIRST, (0x6041, 0), &[0, 0]), Err(0x0601_0002));
    assert_eq!(rig.download(FIRST, (0x6040, 0), &[0]), Err(0x0607_0013));
    assert_eq!(rig.download(FIRST, (0x6040, 0), &[0; 4]), Err(0x0607_0012));
    assert_eq!(rig.download(FIRST, (0x605B, 0), &[2, 0]), Err(0x0609_0031));
    assert_eq!(rig.download(FIRST, (0x605B, 0), &[0xFF, 0xFF]), Err(0x0609_0032));
    assert_eq!(rig.download(FIRST, (0x6060, 0), &[7]), Err(0x0609_0030), "no interpolation here");
    assert_eq!(download(&mut rig, 0x21, (0x2F01, 0), &[0; 65], 300), Err(0x0607_0012));
    assert_eq!(download(&mut rig, 0x21, (0x2F00, 0), &[0; 4097], 100), Err(0x0607_0012));
    assert_eq!(abort(rig.coe(FIRST, SDO, &sdo(0xE0, 0x1000, 0, 0))), 0x0504_0001, "no such command");
    assert_eq!(abort(rig.coe(FIRST, SDO, &sdo(0x60, 0, 0, 0))), 0x0504_0001, "a segment of nothing");
    assert_eq!(abort(rig.coe(FIRST, SDO, &sdo(0x00, 0, 0, 0))), 0x0504_0001);
}

#[test]
fn segments_that_break_the_rules_end_the_transfer() {
    let mut rig = rig();
    let start = |rig: &mut Rig| {
        assert_eq!(rig.coe(FIRST, SDO, &sdo(0x40, 0x2F00, 0, 0)).1[0] & 0xE0, 0x40);
    };
    start(&mut rig);
    assert_eq!(abort(rig.coe(FIRST, SDO, &sdo(0x70, 0, 0, 0))), 0x0503_0000, "toggle");
    assert_eq!(abort(rig.coe(FIRST, SDO, &sdo(0x60, 0, 0, 0))), 0x0504_0001, "it is over");
    start(&mut rig);
    rig.post(FIRST, 3, &[0, 0x20, 0x80, 0, 0x2F, 0, 0, 0, 0, 0]);
    assert_eq!(rig.fetch(FIRST), None, "an abort isn't answered");
    assert_eq!(abort(rig.coe(FIRST, SDO, &sdo(0x60, 0, 0, 0))), 0x0504_0001);
    let announce = |rig: &mut Rig, size| {
        assert_eq!(rig.coe(FIRST, SDO, &sdo(0x21, 0x2F01, 0, size)).1[0], 0x60);
    };
    announce(&mut rig, 20);
    assert_eq!(abort(rig.coe(FIRST, SDO, &[0x10, 0, 0, 0, 0, 0, 0, 0])), 0x0503_0000, "toggle");
    announce(&mut rig, 5);
    assert_eq!(abort(rig.coe(FIRST, SDO, &[0x01, 0, 0, 0, 0, 0, 0, 0])), 0x0607_0012, "more than announced");
    announce(&mut rig, 20);
    assert_eq!(abort(rig.coe(FIRST, SDO, &[0x01, 0, 0, 0, 0, 0, 0, 0])), 0x0607_0013, "less than announced");
}

/// All fragments of an SDO Information answer, joined.
fn info(rig: &mut Rig, opcode: u8, data: &[u8]) -> (u8, Vec<u8>, usize) {
    let mut body = vec![opcode, 0, 0, 0];
    body.extend_from_slice(data);
    let (mut service, mut answer) = rig.coe(FIRST, INFO, &body);
    let mut content = Vec::new();
    let mut fragments = 1;
    loop {
        assert_eq!(service, INFO);
        content.extend_from_slice(&answer[4..]);
        let left = u16::from_le_bytes([answer[2], answer[3]]);
        assert_eq!(answer[0] & 0x80 != 0, left > 0);
        if left == 0 {
            return (answer[0] & 0x7F, content, fragments);
        }
        (service, answer) = rig.answer(FIRST);
        fragments += 1;
    }
}

fn words(bytes: &[u8]) -> Vec<u16> {
    bytes.chunks_exact(2).map(|word| u16::from_le_bytes([word[0], word[1]])).collect()
}

#[test]
fn lists_have_the_lengths_that_they_announce() {
    let mut rig = rig();
    let (opcode, lengths, _) = info(&mut rig, 1, &[0, 0]);
    assert_eq!(opcode, 2);
    let lengths = words(&lengths)[1..].to_vec();
    assert_eq!(lengths.len(), 5);
    for (kind, length) in (1..).zip(&lengths) {
        let (opcode, content, fragments) = info(&mut rig, 1, &[kind, 0]);
        let content = words(&content);
        assert_eq!((opcode, content[0]), (2, u16::from(kind)));
        assert_eq!(content.len() - 1, usize::from(*length), "list {kind}");
        assert!(content[1..].is_sorted(), "list {kind}");
        match kind {
            1 => assert!(fragments == 1 && content.contains(&0x6040) && content.contains(&0x6041)),
            2 => assert!(content.contains(&0x6040) && !content.contains(&0x6041)),
            3 => assert!(!content.contains(&0x6040) && content.contains(&0x6041)),
            _ => assert!(content.contains(&0x6085) && !content.contains(&0x6041)),
        }
    }
    let (opcode, content, _) = info(&mut rig, 1, &[6, 0]);
    assert_eq!((opcode, content), (7, 0x0601_0000u32.to_le_bytes().to_vec()));
}

#[test]
fn objects_and_entries_describe_themselves() {
    let mut rig = rig();
    let (opcode, content, _) = info(&mut rig, 3, &0x1018u16.to_le_bytes());
    assert_eq!((opcode, &content[..6]), (4, &[0x18, 0x10, 0x23, 0, 4, 9][..]));
    assert_eq!(&content[6..], b"Identity");
    let (opcode, content, _) = info(&mut rig, 5, &[0x40, 0x60, 0, 0]);
    assert_eq!((opcode, &content[..10]), (6, &[0x40, 0x60, 0, 0, 6, 0, 16, 0, 0x7F, 0][..]));
    assert_eq!(&content[10..], b"Controlword");
    // Everything that can be asked for: default, smallest and largest value.
    let (_, content, _) = info(&mut rig, 5, &[0x5B, 0x60, 0, 0x78]);
    assert_eq!(content[3], 0x70, "no unit is known");
    assert_eq!(&content[10..16], &[0, 0, 0, 0, 1, 0]);
    assert_eq!(&content[16..], b"Shutdown option code");
    let (_, content, _) = info(&mut rig, 5, &[0x00, 0x2F, 0, 0x10]);
    assert_eq!((content[3], words(&content[6..8])[0]), (0, 32768), "4 KiB, no default");
    let refused = |answer: (u8, Vec<u8>, usize)| {
        assert_eq!(answer.0, 7);
        u32::from_le_bytes([answer.1[0], answer.1[1], answer.1[2], answer.1[3]])
    };
    assert_eq!(refused(info(&mut rig, 3, &[0, 0x50])), 0x0602_0000);
    assert_eq!(refused(info(&mut rig, 5, &[0, 0x50, 0, 0])), 0x0602_0000);
    assert_eq!(refused(info(&mut rig, 5, &[0x40, 0x60, 1, 0])), 0x0609_0011);
    assert_eq!(refused(info(&mut rig, 9, &[0; 4])), 0x0504_0001);
}

#[test]
fn every_object_in_the_list_can_be_described_and_read() {
    let mut rig = rig();
    let (_, list, _) = info(&mut rig, 1, &[1, 0]);
    let mut entries = 0;
    for index in words(&list)[1..].iter().copied() {
        let (opcode, object, _) = info(&mut rig, 3, &index.to_le_bytes());
        assert_eq!(opcode, 4, "0x{index:04X}");
        for subindex in 0..=object[4] {
            let [low, high] = index.to_le_bytes();
            let (opcode, entry, _) = info(&mut rig, 5, &[low, high, subindex, 0x78]);
            if opcode == 7 {
                assert_eq!(index & 0xFFF0, 0x1C30, "only 0x1C32 and 0x1C33 have gaps");
                continue;
            }
            entries += 1;
            let bits = usize::from(words(&entry[6..8])[0]);
            match upload(&mut rig, 0x40, index, subindex) {
                Ok(value) => assert!(value.len() <= bits.div_ceil(8), "0x{index:04X}:{subindex}"),
                Err(code) => assert_eq!((index, code), (0x2F05, 0x0601_0001)),
            }
        }
    }
    assert!(entries > 150, "{entries} entries");
}

#[test]
fn sdos_work_in_op_and_show_present_values() {
    let mut rig = Rig::drive(DriveKind::Generic);
    rig.bring_to_op(FIRST, SERVO);
    for _ in 0..20 {
        rig.outputs(FIRST, &[0; 16]);
        rig.wait_us(1000);
    }
    assert_eq!(rig.upload(FIRST, (0x6041, 0)), Ok(0x0250), "switch on disabled, voltage, remote");
    assert_eq!(rig.upload(FIRST, (0x1C32, 1)), Ok(1));
    rig.download(FIRST, (0x6085, 0), &1000u32.to_le_bytes()).unwrap();
    assert_eq!(rig.upload(FIRST, (0x6085, 0)), Ok(1000));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    /// Whatever comes, the next right request is answered rightly.
    #[test]
    fn any_bytes_leave_the_server_able_to_answer(
        messages in proptest::collection::vec(
            (proptest::collection::vec(any::<u8>(), 0..40), 0u8..3, prop::sample::select(vec![0x1000u16, 0x1600, 0x1C12, 0x2F00, 0x2F01, 0x2F04, 0x6060])),
            1..12,
        )
    ) {
        let mut rig = rig();
        for (bytes, shape, index) in messages {
            let mut area = vec![0; 256];
            match shape {
                // Anything at all.
                0 => area[..bytes.len()].copy_from_slice(&bytes),
                // A CoE message of anything.
                1 => {
                    area[0] = bytes.len() as u8;
                    area[5] = 3;
                    area[6..6 + bytes.len()].copy_from_slice(&bytes);
                    area[7] = 0x20 | (bytes.len() as u8 & 1) << 7;
                }
                // An SDO to an object that is there.
                _ => {
                    area[0] = bytes.len() as u8;
                    area[5] = 3;
                    area[6..6 + bytes.len()].copy_from_slice(&bytes);
                    area[7] = 0x20;
                    area[9..11].copy_from_slice(&index.to_le_bytes());
                }
            }
            area[5] &= 0x0F;
            rig.post_area(FIRST, &area);
            rig.wait_us(10);
            while rig.read(FIRST, 0x080D, 1)[0] & 8 != 0 {
                rig.read(FIRST, 0x1400, 256);
                rig.wait_us(10);
            }
        }
        prop_assert_eq!(rig.upload(FIRST, (0x1000, 0)), Ok(0x0002_0192));
        prop_assert_eq!(rig.upload(FIRST, (0x1018, 2)), Ok(0x0000_0402));
    }
}
