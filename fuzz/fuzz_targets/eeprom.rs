//! An EEPROM interface that says anything: reading and writing end, and no order of writes makes half an image look whole.
#![no_main]

use libfuzzer_sys::fuzz_target;
use omnibase_ethercat::eeprom::{SiiExtent, SiiReader, SiiWriter, plan, with_checksum};
use omnibase_ethercat::transaction::Target;
use omnibase_ethercat::wire::HostTime;
use omnibase_ethercat::wire::bytes::put_u16;
use omnibase_ethercat::wire::sii::checksum;
use omnibase_ethercat::{Answer, Next, Procedure};
use std::time::Duration;

const TARGET: Target = Target { position: 0, station: 0x1001 };
/// More steps than an honest interface takes for 64 KiB, with its busy time.
const MOST_STEPS: usize = 4_000_000;

/// Drives a procedure with answers from `script`, then with silence.
fn drive<P: Procedure>(mut procedure: P, mut script: &[u8]) {
    let mut now = HostTime(0);
    let mut buffer = [0; 64];
    for step in 0.. {
        assert!(step < MOST_STEPS, "still busy at {now:?}");
        match procedure.next(now) {
            Next::Done(_) => return,
            Next::WaitUntil(instant) => now = instant.max(now + Duration::from_micros(1)),
            Next::Send(request) => {
                let data = &mut buffer[..request.length];
                data.fill(0);
                procedure.fill(data);
                now = now + Duration::from_micros(50);
                let Some((&kind, rest)) = script.split_first() else {
                    procedure.answer(Answer::Lost, now);
                    continue;
                };
                let take = rest.len().min(data.len()).min(usize::from(kind >> 2));
                data[..take].copy_from_slice(&rest[..take]);
                script = &rest[take..];
                procedure.answer(Answer::Returned { working_counter: u16::from(kind & 3), data }, now);
            }
        }
    }
}

fuzz_target!(|bytes: &[u8]| {
    let Some((&first, rest)) = bytes.split_first() else { return };
    let (images, script) = rest.split_at(rest.len().min(usize::from(first)));
    let half = images.len() / 4 * 2;
    let (before, after) = (&images[..half], with_checksum(images[half..2 * half].to_vec()));
    let steps = plan(before, &after);
    let mut chip = vec![0xFF; after.len().max(before.len()).max(16)];
    chip[..before.len()].copy_from_slice(before);
    for (number, step) in steps.iter().enumerate() {
        put_u16(&mut chip, step.word as usize * 2, step.value);
        let is_right = chip.first_chunk().is_some_and(|first| chip[14] == checksum(first));
        // A prefix of the fixed part alone has no checksum to set.
        assert!(number + 1 == steps.len() || !is_right, "{number} of {steps:?}");
    }
    drive(SiiWriter::new(TARGET, steps), script);
    drive(SiiReader::new(TARGET, SiiExtent::Needed), script);
    drive(SiiReader::new(TARGET, SiiExtent::First(usize::from(first) * 8)), script);
});
