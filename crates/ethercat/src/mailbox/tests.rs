//! Against a small mailbox server that can be made to misbehave; written from the standard, not from the client.

use super::*;
use crate::start_up::SdoAccess;
use crate::subdevice::MemoryArea;
use crate::wire::coe::ObjectAddress;
use crate::wire::{Address, Command};
use std::collections::{BTreeMap, VecDeque};

const STATION: u16 = 0x1001;
const SIZE: u16 = 64;
const WRITE: u16 = 0x1000;
const READ: u16 = 0x1400;

fn config() -> MailboxConfig {
    MailboxConfig {
        write: MemoryArea { start: WRITE, length: SIZE },
        read: MemoryArea { start: READ, length: SIZE },
        protocols: 4,
    }
}

fn mailbox() -> Mailbox {
    Mailbox::new(STATION, config()).unwrap()
}

/// What happens to one datagram.
#[derive(Clone, Copy, PartialEq)]
enum Fate {
    Arrives,
    /// Lost on the way to the SubDevice.
    LostBefore,
    /// Lost on the way back.
    LostAfter,
    /// Not taken: working counter 0.
    Refused,
}

type Mangle = Box<dyn FnMut(usize, Vec<u8>) -> Option<Vec<u8>>>;

/// The SubDevice's side: two mailbox areas and a CoE server.
struct Server {
    objects: BTreeMap<u16, Vec<u8>>,
    outbox: VecDeque<Vec<u8>>,
    full: bool,
    last_sent: Vec<u8>,
    last_read: Vec<u8>,
    last_counter: u8,
    counter: u8,
    activate: u8,
    pdi: u8,
    silent: bool,
    gone: bool,
    /// Changes the service data of the nth answer (from 0), or `None` to swallow it.
    mangle: Mangle,
    answers: usize,
    transfer: Option<(u16, usize, u8)>,
    received: Vec<Vec<u8>>,
}

impl Server {
    fn new() -> Self {
        Server {
            objects: BTreeMap::new(),
            outbox: VecDeque::new(),
            full: false,
            last_sent: Vec::new(),
            last_read: Vec::new(),
            last_counter: 0,
            counter: 0,
            activate: 1,
            pdi: 0,
            silent: false,
            gone: false,
            mangle: Box::new(|_, data| Some(data)),
            answers: 0,
            transfer: None,
            received: Vec::new(),
        }
    }

    fn send(&mut self, protocol: u8, data: &[u8]) {
        self.counter = self.counter % 7 + 1;
        let mut area = vec![0; usize::from(SIZE)];
        area[..2].copy_from_slice(&(data.len() as u16).to_le_bytes());
        area[5] = protocol | self.counter << 4;
        area[6..6 + data.len()].copy_from_slice(data);
        self.outbox.push_back(area);
    }

    fn answer(&mut self, data: Vec<u8>) {
        let number = self.answers;
        self.answers += 1;
        if let Some(data) = (self.mangle)(number, data) {
            self.send(3, &data);
        }
    }

    fn message(&mut self, area: &[u8]) {
        let counter = area[5] >> 4 & 7;
        if counter == self.last_counter || self.silent {
            return;
        }
        self.last_counter = counter;
        let data = area[6..6 + usize::from(area[0])].to_vec();
        self.received.push(data.clone());
        match data[1] >> 4 {
            2 => self.sdo(&data[2..]),
            8 => self.info(&data[2..]),
            _ => {}
        }
    }

    fn sdo(&mut self, body: &[u8]) {
        let index = u16::from_le_bytes([body[1], body[2]]);
        let head = |command: u8| {
            let mut answer = vec![0x00, 0x30, command];
            answer.extend_from_slice(&body[1..4]);
            answer
        };
        match body[0] >> 5 {
            // Upload.
            2 => match self.objects.get(&index) {
                None => {
                    let mut answer = head(0x80);
                    answer.extend_from_slice(&0x0602_0000u32.to_le_bytes());
                    self.answer(answer);
                }
                Some(value) if (1..=4).contains(&value.len()) => {
                    let mut answer = head(0x43 | ((4 - value.len()) as u8) << 2);
                    answer.extend_from_slice(value);
                    answer.resize(10, 0);
                    self.answer(answer);
                }
                Some(value) => {
                    let mut answer = head(0x41);
                    answer.extend_from_slice(&(value.len() as u32).to_le_bytes());
                    let first = value.len().min(usize::from(SIZE) - 16);
                    answer.extend_from_slice(&value[..first]);
                    self.transfer = Some((index, first, 0));
                    self.answer(answer);
                }
            },
            3 => {
                let Some((index, at, toggle)) = self.transfer else { return };
                assert_eq!(body[0] & 0x10, toggle, "the client must toggle");
                let value = &self.objects[&index];
                let end = value.len().min(at + usize::from(SIZE) - 9);
                let mut answer = vec![0x00, 0x30, toggle];
                answer.extend_from_slice(&value[at..end]);
                if end == value.len() {
                    answer[2] |= 1;
                }
                if end - at < 7 {
                    answer[2] |= ((7 - (end - at)) as u8) << 1;
                    answer.resize(10, 0);
                }
                self.transfer = Some((index, end, toggle ^ 0x10));
                self.answer(answer);
            }
            // Download.
            1 => {
                let mut answer = head(0x60);
                answer.resize(10, 0);
                if body[0] & 2 != 0 {
                    let length = 4 - usize::from(body[0] >> 2 & 3);
                    self.objects.insert(index, body[4..4 + length].to_vec());
                } else {
                    self.objects.insert(index, body[8..].to_vec());
                    self.transfer =
                        Some((index, u32::from_le_bytes(body[4..8].try_into().unwrap()) as usize, 0));
                }
                self.answer(answer);
            }
            0 => {
                let Some((index, total, toggle)) = self.transfer else { return };
                assert_eq!(body[0] & 0x10, toggle, "the client must toggle");
                let mut data = &body[1..];
                if data.len() == 7 {
                    data = &data[..7 - usize::from(body[0] >> 1 & 7)];
                }
                let value = self.objects.get_mut(&index).unwrap();
                value.extend_from_slice(data);
                assert_eq!(value.len() == total, body[0] & 1 != 0, "last segment");
                self.transfer = Some((index, total, toggle ^ 0x10));
                self.answer(vec![0x00, 0x30, 0x20 | toggle, 0, 0, 0, 0, 0, 0, 0]);
            }
            _ => {}
        }
    }

    fn info(&mut self, body: &[u8]) {
        let payload: Vec<u8> = match body[0] {
            1 if body[4] == 0 => [0u16, 3, 1, 2, 0, 0].iter().flat_map(|v| v.to_le_bytes()).collect(),
            1 => core::iter::once(u16::from(body[4]))
                .chain((0..100).map(|n| 0x2000 + n))
                .flat_map(u16::to_le_bytes)
                .collect(),
            3 => [&body[4..6], &[7, 0, 2, 9], b"Identity"].concat(),
            5 => [&body[4..8], &[6, 0, 16, 0, 0x3F, 0], &[0x34, 0x12], b"Limit"].concat(),
            _ => return,
        };
        let room = usize::from(SIZE) - 12;
        let fragments: Vec<&[u8]> = payload.chunks(room).collect();
        for (number, fragment) in fragments.iter().enumerate() {
            let left = (fragments.len() - 1 - number) as u16;
            let mut answer = vec![0x00, 0x80, (body[0] + 1) | if left > 0 { 0x80 } else { 0 }, 0];
            answer.extend_from_slice(&left.to_le_bytes());
            answer.extend_from_slice(fragment);
            self.answer(answer);
        }
    }

    /// One datagram at the SubDevice; the working counter, and the data as they leave.
    fn datagram(&mut self, request: Request, data: &mut [u8]) -> u16 {
        let Address::Station { station, register } = request.address else { panic!("{request:?}") };
        assert_eq!(station, STATION);
        if self.gone {
            return 0;
        }
        if !self.full
            && let Some(area) = self.outbox.pop_front()
        {
            self.last_sent = area;
            self.full = true;
        }
        match (request.command, register) {
            (Command::Fprd, 0x0805) => {
                data[0] = 0;
                data[8] = if self.full { 8 } else { 0 };
            }
            (Command::Fprd, 0x080D) => data[0] = if self.full { 8 } else { 0 },
            (Command::Fprd, 0x080E) => data[0] = self.activate,
            (Command::Fprd, 0x080F) => data[0] = self.pdi,
            (Command::Fpwr, 0x080E) => {
                if (self.activate ^ data[0]) & 2 != 0 {
                    // The last message that was read stands there again, before the one that is waiting.
                    if !self.last_read.is_empty() {
                        if self.full {
                            self.outbox.push_front(core::mem::take(&mut self.last_sent));
                        }
                        self.last_sent = self.last_read.clone();
                        self.full = true;
                    }
                    self.pdi = self.pdi & !2 | data[0] & 2;
                }
                self.activate = data[0];
            }
            (Command::Fpwr, WRITE) => {
                assert_eq!(data.len(), usize::from(SIZE), "the whole area is written");
                self.message(data);
            }
            (Command::Fprd, READ) => {
                assert_eq!(data.len(), usize::from(SIZE), "the whole area is read");
                if !self.full {
                    return 0;
                }
                data.copy_from_slice(&self.last_sent);
                self.last_read = self.last_sent.clone();
                self.full = false;
            }
            other => panic!("unexpected access {other:?}"),
        }
        1
    }
}

/// Drives a request to its end; `fate` decides about each datagram by its number.
fn run_with(
    mailbox: &mut Mailbox,
    server: &mut Server,
    request: MailboxRequest,
    mut fate: impl FnMut(usize) -> Fate,
) -> (Completion, usize) {
    let mut now = HostTime(0);
    mailbox.start(request, now).unwrap();
    for number in 0..2_000_000 {
        now = now + Duration::from_micros(20);
        match mailbox.next(now) {
            Next::Done(completion) => return (completion.expect("a completion"), number),
            Next::WaitUntil(instant) => now = now.max(instant),
            Next::Send(request) => {
                let mut data = vec![0; request.length];
                mailbox.fill(&mut data);
                let fate = fate(number);
                let working_counter = match fate {
                    Fate::Arrives | Fate::LostAfter => server.datagram(request, &mut data),
                    Fate::LostBefore | Fate::Refused => 0,
                };
                match fate {
                    Fate::Arrives | Fate::Refused => {
                        mailbox.answer(Answer::Returned { working_counter, data: &data }, now)
                    }
                    Fate::LostBefore | Fate::LostAfter => mailbox.answer(Answer::Lost, now),
                }
            }
        }
    }
    panic!("the request never ended");
}

fn run(mailbox: &mut Mailbox, server: &mut Server, request: MailboxRequest) -> Completion {
    run_with(mailbox, server, request, |_| Fate::Arrives).0
}

fn value(length: usize) -> Vec<u8> {
    (0..length).map(|n| (n * 7 + 3) as u8).collect()
}

fn object(index: u16) -> ObjectAddress {
    ObjectAddress::new(index, 0)
}

fn upload(index: u16, limit: usize) -> MailboxRequest {
    MailboxRequest::upload(object(index), Vec::with_capacity(limit))
}

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
fn any_one_datagram_lost_or_refused_leaves_the_right_result() {
    for fate in [Fate::LostBefore, Fate::LostAfter, Fate::Refused] {
        for bad in 0..40 {
            let (mut mailbox, mut server) = (mailbox(), Server::new());
            let mut unlucky = |number| if number == bad { fate } else { Fate::Arrives };
            let request = MailboxRequest::download(object(0x2000), value(150));
            let (down, _) = run_with(&mut mailbox, &mut server, request, &mut unlucky);
            assert_eq!(
                (down.result, &server.objects[&0x2000]),
                (Ok(()), &value(150)),
                "down, datagram {bad}"
            );
            let (up, _) = run_with(&mut mailbox, &mut server, upload(0x2000, 150), &mut unlucky);
            assert_eq!((up.result, up.request.data), (Ok(()), value(150)), "up, datagram {bad}");
            let list = MailboxRequest::new(Operation::List(ObjectList::All), Vec::with_capacity(400));
            let (list, _) = run_with(&mut mailbox, &mut server, list, &mut unlucky);
            assert_eq!((list.result, list.request.data.len()), (Ok(()), 200), "list, datagram {bad}");
        }
    }
}

#[test]
fn a_lost_answer_is_asked_for_again_and_a_repeat_is_recognised() {
    let (mut mailbox, mut server) = (mailbox(), Server::new());
    server.objects.insert(0x2000, value(100));
    // Datagrams: look, write, poll, read. The read is lost behind the SubDevice.
    let (up, _) = run_with(&mut mailbox, &mut server, upload(0x2000, 100), |number| {
        if number == 3 { Fate::LostAfter } else { Fate::Arrives }
    });
    assert_eq!((up.result, up.request.data), (Ok(()), value(100)));
    assert_eq!(mailbox.counters().repeats, 1);
    // The second read is lost before the SubDevice: it gives the answer before that again, which is known.
    let (up, _) = run_with(&mut mailbox, &mut server, upload(0x2000, 100), |number| {
        if number == 3 { Fate::LostBefore } else { Fate::Arrives }
    });
    assert_eq!((up.result, up.request.data), (Ok(()), value(100)));
    assert_eq!((mailbox.counters().repeats, mailbox.counters().duplicate), (2, 1));
}

#[test]
fn emergencies_strays_and_other_protocols_do_not_disturb_a_transfer() {
    let (mut mailbox, mut server) = (mailbox(), Server::new());
    server.objects.insert(0x2000, value(100));
    // An emergency, an answer for another object, one of another service, EoE, and a header that lies.
    server.send(3, &[0x00, 0x10, 0x20, 0xFF, 0x01, 1, 2, 3, 4, 5]);
    server.send(3, &[0x00, 0x30, 0x43, 0x01, 0x20, 0x00, 9, 9, 9, 9]);
    server.send(3, &[0x00, 0x80, 0x02, 0, 0, 0, 1, 0]);
    server.send(2, &[1, 2, 3]);
    server.outbox.push_back([vec![0xFF; 6], vec![0; 58]].concat());
    let up = run(&mut mailbox, &mut server, upload(0x2000, 100));
    assert_eq!((up.result, up.request.data), (Ok(()), value(100)));
    assert_eq!(mailbox.counters().stray, 4);
    let emergency = mailbox.emergencies().take().unwrap().emergency;
    assert_eq!((emergency.code, emergency.register, emergency.data), (0xFF20, 1, [1, 2, 3, 4, 5]));
}

#[test]
fn an_emergency_between_request_and_answer_does_not_end_the_request() {
    let (mut mailbox, mut server) = (mailbox(), Server::new());
    server.objects.insert(0x2000, vec![1, 2]);
    server.mangle = Box::new(|number, data| {
        if number == 0 { Some(vec![0x00, 0x10, 0x20, 0xFF, 0x01, 1, 2, 3, 4, 5]) } else { Some(data) }
    });
    let mut request = upload(0x2000, 4);
    request.timeout = Duration::from_millis(5);
    let up = run(&mut mailbox, &mut server, request);
    assert!(matches!(up.result, Err(MailboxError::Timeout { waiting: Waiting::Answer, .. })));
    assert_eq!(mailbox.emergencies().len(), 1);
}

#[test]
fn the_emergency_ring_counts_what_it_drops() {
    let (mut mailbox, mut server) = (mailbox(), Server::new());
    for n in 0..20 {
        server.send(3, &[0x00, 0x10, n, 0xFF, 0x01, 0, 0, 0, 0, 0]);
    }
    server.objects.insert(0x2000, vec![1]);
    run(&mut mailbox, &mut server, upload(0x2000, 4));
    assert_eq!((mailbox.emergencies().len(), mailbox.emergencies().dropped()), (16, 4));
    assert_eq!(mailbox.emergencies().take().unwrap().emergency.code, 0xFF04);
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
fn a_subdevice_that_vanishes_between_segments_times_out() {
    let (mut mailbox, mut server) = (mailbox(), Server::new());
    server.objects.insert(0x2000, value(1000));
    mailbox.start(upload(0x2000, 1000).with_timeout(Duration::from_millis(50)), HostTime(0)).unwrap();
    let mut now = HostTime(0);
    let done = loop {
        now = now + Duration::from_micros(50);
        assert!(now < HostTime(200_000_000), "still busy after 200 ms");
        match mailbox.next(now) {
            Next::Done(done) => break done.unwrap(),
            Next::WaitUntil(_) => {}
            Next::Send(request) => {
                server.gone = server.answers >= 2;
                let mut data = vec![0; request.length];
                mailbox.fill(&mut data);
                let working_counter = server.datagram(request, &mut data);
                mailbox.answer(Answer::Returned { working_counter, data: &data }, now);
            }
        }
    };
    assert_eq!(done.result, Err(MailboxError::Unreachable { after: Duration::from_millis(50) }));
}

#[test]
fn a_silent_server_times_out_and_is_told() {
    let (mut mailbox, mut server) = (mailbox(), Server::new());
    server.objects.insert(0x2000, value(2));
    server.mangle = Box::new(|_, _| None);
    let up = run(&mut mailbox, &mut server, upload(0x2000, 4).with_timeout(Duration::from_millis(20)));
    let after = Duration::from_millis(20);
    assert_eq!(up.result, Err(MailboxError::Timeout { waiting: Waiting::Answer, after }));
    assert_eq!(server.received.last().unwrap()[6..10], 0x0504_0000u32.to_le_bytes());
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
fn any_bytes_end_in_a_result_without_growing_the_buffer() {
    // xorshift64*, seed 1: answers of random length and content, some of them close to right ones.
    let mut state = 1u64;
    let mut random = move || {
        state ^= state >> 12;
        state ^= state << 25;
        state ^= state >> 27;
        (state.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 32) as u32
    };
    for round in 0..3000 {
        let (mut mailbox, mut server) = (mailbox(), Server::new());
        server.objects.insert(0x2000, value(120));
        let flips = random() % 4;
        let mut seeds: Vec<u32> = (0..64).map(|_| random()).collect();
        server.mangle = Box::new(move |_, mut data| {
            for _ in 0..flips {
                let seed = seeds.pop().unwrap_or(0);
                let at = seed as usize % data.len();
                data[at] = (seed >> 16) as u8;
            }
            Some(data)
        });
        let operation = match round % 4 {
            0 => Operation::Upload { object: object(0x2000), access: SdoAccess::Entry },
            1 => Operation::Download { object: object(0x2000), access: SdoAccess::Entry },
            2 => Operation::List(ObjectList::All),
            _ => Operation::DescribeEntry { object: object(0x2000), value_info: 0x78 },
        };
        let buffer = if round % 4 == 1 { value(120) } else { Vec::with_capacity(120) };
        let request = MailboxRequest::new(operation, buffer).with_timeout(Duration::from_millis(3));
        let done = run(&mut mailbox, &mut server, request);
        assert!(done.request.data.capacity() <= 120);
        let _ = EntryDescription::read(&done.request.data);
    }
}

#[test]
fn sizes_that_no_datagram_carries_are_refused() {
    for length in [0, 15, 1487, 0xFFFF] {
        let mut config = config();
        config.read.length = length;
        assert_eq!(Mailbox::new(STATION, config).unwrap_err().read, length);
    }
}

#[test]
fn a_reset_ends_the_request_in_hand_and_the_counter_begins_anew() {
    let (mut mailbox, mut server) = (mailbox(), Server::new());
    server.objects.insert(0x2000, vec![1]);
    run(&mut mailbox, &mut server, upload(0x2000, 4));
    mailbox.start(upload(0x2000, 4), HostTime(0)).unwrap();
    assert!(mailbox.start(upload(0x2000, 4), HostTime(0)).is_err());
    mailbox.reset();
    let Next::Done(Some(done)) = mailbox.next(HostTime(0)) else { panic!("not over") };
    assert_eq!(done.result, Err(MailboxError::Reset));
    assert_eq!(mailbox.next(HostTime(0)), Next::Done(None));
    let mut fresh = Server::new();
    fresh.objects.insert(0x2000, vec![1]);
    assert_eq!(run(&mut mailbox, &mut fresh, upload(0x2000, 4)).result, Ok(()));
}

#[test]
fn a_cancelled_request_leaves_the_message_counter_so_that_the_next_is_no_repeat() {
    let (mut mailbox, mut server) = (mailbox(), Server::new());
    server.objects.insert(0x2000, vec![1]);
    run(&mut mailbox, &mut server, upload(0x2000, 4));
    mailbox.start(upload(0x2000, 4), HostTime(0)).unwrap();
    mailbox.cancel();
    let Next::Done(Some(done)) = mailbox.next(HostTime(0)) else { panic!("not over") };
    assert_eq!(done.result, Err(MailboxError::Reset));
    assert_eq!(run(&mut mailbox, &mut server, upload(0x2000, 4)).result, Ok(()));
}
