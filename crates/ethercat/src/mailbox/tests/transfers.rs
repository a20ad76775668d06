//! SDOs and SDO Information, up and down.

use super::*;

#[test]
fn sdos_of_all_lengths_go_up_and_down() {
    let (mut mailbox, mut server) = (mailbox(), Server::new());
    for length in (0..=16).chain([47, 48, 49, 54, 55, 56, 57, 102, 103, 104, 105, 255, 256, 1000]) {
        let down = run(&mut mailbox, &mut server, MailboxRequest::download(object(0x2000), value(length)));
        assert_eq!(down.result, Ok(()), "down {length}");
        assert_eq!(server.objects[&0x2000], value(length), "down {length}");
        let up = run(&mut mailbox, &mut server, upload(0x2000, 1000));
        assert_eq!((up.result, up.request.data), (Ok(()), value(length)), "up {length}");
    }
    assert_eq!(mailbox.counters(), MailboxCounters::default());
}

#[test]
fn complete_access_is_asked_for_and_is_never_expedited() {
    let (mut mailbox, mut server) = (mailbox(), Server::new());
    let operation = Operation::Download { object: object(0x1C12), access: SdoAccess::Complete };
    let done = run(&mut mailbox, &mut server, MailboxRequest::new(operation, vec![1, 0, 0, 0x16]));
    assert_eq!(done.result, Ok(()));
    assert_eq!(server.received[0][2], 0x31);
    let operation = Operation::Upload { object: object(0x1C12), access: SdoAccess::Complete };
    run(&mut mailbox, &mut server, MailboxRequest::new(operation, Vec::with_capacity(8)));
    assert_eq!(server.received[1][2], 0x50);
}

#[test]
fn aborts_and_error_replies_are_named() {
    let (mut mailbox, mut server) = (mailbox(), Server::new());
    let up = run(&mut mailbox, &mut server, upload(0x5000, 4));
    let expected = MailboxError::Aborted { object: object(0x5000), code: AbortCode::NO_SUCH_OBJECT };
    assert_eq!(up.result, Err(expected));
    assert_eq!(
        expected.to_string(),
        "5000:00 aborted: 0x06020000 the object does not exist in the object dictionary"
    );
    server.silent = true;
    let now = HostTime(0);
    mailbox.start(upload(0x5000, 4), now).unwrap();
    // Written, then an error reply comes.
    let mut refused = None;
    let mut replied = false;
    for step in 0..20 {
        let now = HostTime(step * 1_000_000);
        match mailbox.next(now) {
            Next::Done(done) => {
                refused = done;
                break;
            }
            Next::WaitUntil(_) => {}
            Next::Send(request) => {
                let mut data = vec![0; request.length];
                mailbox.fill(&mut data);
                let working_counter = server.datagram(request, &mut data);
                mailbox.answer(Answer::Returned { working_counter, data: &data }, now);
                if request.command == Command::Fpwr && !replied {
                    replied = true;
                    server.send(0, &[1, 0, 2, 0]);
                }
            }
        }
    }
    assert_eq!(refused.unwrap().result, Err(MailboxError::Refused { detail: 2 }));
}

#[test]
fn a_wrong_toggle_or_size_ends_with_an_abort_from_the_client() {
    type Change = fn(Vec<u8>) -> Vec<u8>;
    let cases: [(Change, u32); 3] = [
        (
            |mut data| {
                data[2] ^= 0x10;
                data
            },
            0x0503_0000,
        ),
        (
            |mut data| {
                data[2] |= 1;
                data
            },
            0x0607_0010,
        ),
        (|_| vec![0x00, 0x30, 0x0E, 0, 0, 0, 0, 0, 0, 0], 0x0800_0000),
    ];
    for (change, code) in cases {
        let (mut mailbox, mut server) = (mailbox(), Server::new());
        server.objects.insert(0x2000, value(200));
        server.mangle = Box::new(move |number, data| Some(if number == 1 { change(data) } else { data }));
        let up = run(&mut mailbox, &mut server, upload(0x2000, 200));
        assert!(up.result.is_err());
        let abort = server.received.last().unwrap();
        assert_eq!((abort[1], abort[2]), (0x20, 0x80));
        assert_eq!(abort[6..10], code.to_le_bytes(), "{:?}", up.result);
        // The next request is served as if nothing had been.
        server.mangle = Box::new(|_, data| Some(data));
        assert_eq!(run(&mut mailbox, &mut server, upload(0x2000, 200)).result, Ok(()));
    }
}

#[test]
fn an_answer_longer_than_the_buffer_is_refused_without_growing_it() {
    let (mut mailbox, mut server) = (mailbox(), Server::new());
    server.objects.insert(0x2000, value(200));
    let up = run(&mut mailbox, &mut server, upload(0x2000, 100));
    assert_eq!(up.result, Err(MailboxError::TooLong { needed: 200, limit: 100 }));
    assert_eq!(up.request.data.capacity(), 100);
    assert_eq!(server.received.last().unwrap()[2], 0x80);
    let list = MailboxRequest::new(Operation::List(ObjectList::All), Vec::with_capacity(20));
    let list = run(&mut mailbox, &mut server, list);
    assert!(matches!(list.result, Err(MailboxError::TooLong { limit: 20, .. })));
}

#[test]
fn dictionary_lists_and_descriptions_come_in_fragments() {
    let (mut mailbox, mut server) = (mailbox(), Server::new());
    let buffer = || Vec::with_capacity(400);
    let lengths = run(&mut mailbox, &mut server, MailboxRequest::new(Operation::ListLengths, buffer()));
    assert_eq!(list_indices(&lengths.request.data).collect::<Vec<_>>(), [3, 1, 2, 0, 0]);
    for list in [
        ObjectList::All,
        ObjectList::RxMappable,
        ObjectList::TxMappable,
        ObjectList::Backup,
        ObjectList::Settings,
    ] {
        let done = run(&mut mailbox, &mut server, MailboxRequest::new(Operation::List(list), buffer()));
        assert!(list_indices(&done.request.data).eq(0x2000..0x2064), "{list:?}");
    }
    let describe = Operation::DescribeObject { index: 0x1018 };
    let done = run(&mut mailbox, &mut server, MailboxRequest::new(describe, buffer()));
    let read = ObjectDescription::read(&done.request.data).unwrap();
    assert_eq!((read.index, read.data_type, read.max_subindex, read.object_code), (0x1018, 7, 2, 9));
    assert_eq!(read.name, b"Identity");
    let describe = Operation::DescribeEntry {
        object: ObjectAddress::new(0x6072, 0),
        value_info: EntryDescription::MAXIMUM,
    };
    let done = run(&mut mailbox, &mut server, MailboxRequest::new(describe, buffer()));
    let read = EntryDescription::read(&done.request.data).unwrap();
    assert_eq!((read.data_type, read.bit_length, read.access), (6, 16, 0x3F));
    assert_eq!((read.maximum, read.default, read.name), (Some(&[0x34, 0x12][..]), None, &b"Limit"[..]));
}

#[test]
fn a_missing_fragment_is_named() {
    let (mut mailbox, mut server) = (mailbox(), Server::new());
    server.mangle = Box::new(|number, data| (number != 1).then_some(data));
    let list = MailboxRequest::new(Operation::List(ObjectList::All), Vec::with_capacity(400));
    let done = run(&mut mailbox, &mut server, list);
    assert_eq!(done.result, Err(MailboxError::FragmentLost { expected: 2, found: 1 }));
}

#[test]
fn sizes_that_no_datagram_carries_are_refused() {
    for length in [0, 15, 1487, 0xFFFF] {
        let mut config = config();
        config.read.length = length;
        assert_eq!(Mailbox::new(STATION, config).unwrap_err().read, length);
    }
}
