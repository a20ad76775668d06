//! Same frames, same bits.

use crate::rig::{FIRST, Rig, SERVO};
use omnibase_ethercat_sim::SegmentFile;
use std::path::Path;

/// Everything that three servos answer while they start, enable and move.
fn run() -> Vec<u8> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../segments/three-servos.toml");
    let file = SegmentFile::parse(&std::fs::read_to_string(path).unwrap()).unwrap();
    let mut rig = Rig::new(file.build(Path::new(".")).unwrap());
    let stations = [FIRST, FIRST + 1, FIRST + 2];
    for station in stations {
        rig.bring_to_op(station, SERVO);
    }
    let mut answers = Vec::new();
    for cycle in 0..600u32 {
        for (number, station) in (0u32..).zip(stations) {
            let control = match cycle {
                0..20 => 0x06,
                20..40 => 0x07,
                _ => 0x0F,
            };
            let mut outputs = [0; 16];
            outputs[0] = control;
            outputs[6..10].copy_from_slice(&((number + 1) * 500_000).to_le_bytes());
            outputs[12..14].copy_from_slice(&3000u16.to_le_bytes());
            outputs[14] = 9;
            rig.outputs(station, &outputs);
            answers.extend(rig.inputs(station, 16));
        }
        rig.wait_us(500);
    }
    answers
}

#[test]
fn two_runs_are_equal_to_the_bit_and_the_servos_turn() {
    let (one, other) = (run(), run());
    assert_eq!(one, other);
    let last = &one[one.len() - 48..];
    for number in 0..3usize {
        let inputs = &last[16 * number..];
        assert_eq!(inputs[0] & 0x6F, 0x27);
        let speed = i32::from_le_bytes([inputs[6], inputs[7], inputs[8], inputs[9]]);
        let wished = 500_000 * (number as i32 + 1);
        assert!((speed - wished).abs() < wished / 100, "servo {number} turns at {speed}");
    }
}
