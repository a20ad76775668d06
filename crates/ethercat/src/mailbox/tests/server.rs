//! A small mailbox server that can be made to misbehave, and a client's requests to it.

use super::*;
use std::collections::{BTreeMap, VecDeque};

pub const STATION: u16 = 0x1001;
pub const SIZE: u16 = 64;
pub const WRITE: u16 = 0x1000;
pub const READ: u16 = 0x1400;

pub fn config() -> MailboxConfig {
    MailboxConfig {
        write: MemoryArea { start: WRITE, length: SIZE },
        read: MemoryArea { start: READ, length: SIZE },
        protocols: 4,
        answer_timeout: DEFAULT_TIMEOUT,
    }
}

pub fn mailbox() -> Mailbox {
    Mailbox::new(STATION, config()).unwrap()
}

/// What happens to one datagram.
#[derive(Clone, Copy, PartialEq)]
pub enum Fate {
    Arrives,
    /// Lost on the way to the SubDevice.
    LostBefore,
    /// Lost on the way back.
    LostAfter,
    /// Not taken: working counter 0.
    Refused,
}

pub type Mangle = Box<dyn FnMut(usize, Vec<u8>) -> Option<Vec<u8>>>;

/// The SubDevice's side: two mailbox areas and a CoE server.
pub struct Server {
    pub objects: BTreeMap<u16, Vec<u8>>,
    pub outbox: VecDeque<Vec<u8>>,
    pub full: bool,
    pub last_sent: Vec<u8>,
    pub last_read: Vec<u8>,
    pub last_counter: u8,
    pub counter: u8,
    pub activate: u8,
    pub pdi: u8,
    pub silent: bool,
    pub gone: bool,
    /// Changes the service data of the nth answer (from 0), or `None` to swallow it.
    pub mangle: Mangle,
    pub answers: usize,
    pub transfer: Option<(u16, usize, u8)>,
    pub received: Vec<Vec<u8>>,
}

impl Server {
    pub fn new() -> Self {
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

    pub fn send(&mut self, protocol: u8, data: &[u8]) {
        self.counter = self.counter % 7 + 1;
        let mut area = vec![0; usize::from(SIZE)];
        area[..2].copy_from_slice(&(data.len() as u16).to_le_bytes());
        area[5] = protocol | self.counter << 4;
        area[6..6 + data.len()].copy_from_slice(data);
        self.outbox.push_back(area);
    }

    pub fn answer(&mut self, data: Vec<u8>) {
        let number = self.answers;
        self.answers += 1;
        if let Some(data) = (self.mangle)(number, data) {
            self.send(3, &data);
        }
    }

    pub fn message(&mut self, area: &[u8]) {
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

    pub fn sdo(&mut self, body: &[u8]) {
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

    pub fn info(&mut self, body: &[u8]) {
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
    pub fn datagram(&mut self, request: DatagramRequest, data: &mut [u8]) -> u16 {
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
pub fn run_with(
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

pub fn run(mailbox: &mut Mailbox, server: &mut Server, request: MailboxRequest) -> Completion {
    run_with(mailbox, server, request, |_| Fate::Arrives).0
}

pub fn value(length: usize) -> Vec<u8> {
    (0..length).map(|n| (n * 7 + 3) as u8).collect()
}

pub fn object(index: u16) -> ObjectAddress {
    ObjectAddress::new(index, 0)
}

pub fn upload(index: u16, limit: usize) -> MailboxRequest {
    MailboxRequest::upload(object(index), Vec::with_capacity(limit))
}
