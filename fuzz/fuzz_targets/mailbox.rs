//! Any bytes as answers of a SubDevice's mailbox: the client ends each request within its deadlines, whatever comes.
#![no_main]

use libfuzzer_sys::fuzz_target;
use omnibase_ethercat::mailbox::{
    DEFAULT_TIMEOUT, FileAccess, Mailbox, MailboxRequest, ObjectList, Operation,
};
use omnibase_ethercat::start_up::SdoAccess;
use omnibase_ethercat::subdevice::{MailboxConfig, MemoryArea};
use omnibase_ethercat::wire::coe::ObjectAddress;
use omnibase_ethercat::wire::{HostTime, sii};
use omnibase_ethercat::{Answer, Next, Procedure};
use std::time::Duration;

/// More steps than any request of this target can take with honest answers.
const MOST_STEPS: usize = 2_000_000;

fuzz_target!(|bytes: &[u8]| {
    let Some((&[operation, capacity, tick, ..], mut script)) =
        bytes.split_first_chunk::<4>().map(|(h, t)| (h, t))
    else {
        return;
    };
    let config = MailboxConfig {
        write: MemoryArea { start: 0x1000, length: 64 },
        read: MemoryArea { start: 0x1080, length: 64 },
        protocols: sii::PROTOCOL_COE,
        answer_timeout: DEFAULT_TIMEOUT,
    };
    let mut mailbox = Mailbox::new(0x1001, config).expect("64 bytes are enough");
    let object = ObjectAddress::new(0x6041, 0);
    let access = if operation & 0x80 == 0 { SdoAccess::Entry } else { SdoAccess::Complete };
    let (operation, data) = match operation % 8 {
        0 => (Operation::Upload { object, access }, Vec::with_capacity(usize::from(capacity) * 4)),
        1 => (Operation::Download { object, access }, vec![capacity; usize::from(capacity)]),
        2 => (Operation::ListLengths, Vec::with_capacity(usize::from(capacity))),
        3 => (Operation::List(ObjectList::All), Vec::with_capacity(usize::from(capacity) * 4)),
        6 => (Operation::ReadFile, Vec::with_capacity(usize::from(capacity) * 4)),
        7 => (Operation::WriteFile, vec![capacity; usize::from(capacity)]),
        4 => (Operation::DescribeObject { index: 0x6041 }, Vec::with_capacity(usize::from(capacity))),
        _ => {
            (Operation::DescribeEntry { object, value_info: 0xFF }, Vec::with_capacity(usize::from(capacity)))
        }
    };
    let granted = data.capacity();
    let mut now = HostTime(0);
    // Of no meaning where it is about no file.
    let file = FileAccess { name: "firmware.bin".to_owned(), password: 7 };
    let request = MailboxRequest { file, ..MailboxRequest::new(operation, data) };
    let request = request.with_timeout(Duration::from_millis(20));
    mailbox.start(request, now).expect("it is idle");
    let mut buffer = [0; 256];
    for step in 0.. {
        assert!(step < MOST_STEPS, "still busy at {now:?}");
        match mailbox.next(now) {
            Next::Done(completion) => {
                let Some(completion) = completion else { break };
                assert!(completion.request.data.len() <= granted.max(256), "more than the buffer held");
                break;
            }
            Next::WaitUntil(instant) => now = instant.max(now + Duration::from_micros(1)),
            Next::Send(request) => {
                let data = &mut buffer[..request.length];
                data.fill(0);
                mailbox.fill(data);
                now = now + Duration::from_micros(10 + u64::from(tick) * 100);
                let Some((&kind, rest)) = script.split_first() else {
                    // The script is over: silence.
                    mailbox.answer(Answer::Lost, now);
                    continue;
                };
                let take = rest.len().min(request.length).min(usize::from(kind >> 2) * 2);
                // Most answers that are no bytes at all say "full" or "empty" as an honest mailbox would.
                data.fill(if kind & 2 == 0 { 8 } else { 0 });
                data[..take].copy_from_slice(&rest[..take]);
                script = &rest[take..];
                let working_counter = u16::from(kind & 1);
                mailbox.answer(Answer::Returned { working_counter, data }, now);
            }
        }
    }
    while mailbox.emergencies().take().is_some() {}
});
