//! The mailbox server: requests in through SM0, answers and emergencies out through SM1, with repeat.

use super::coe::{self, MailboxFault, Served};
use super::foe::{self, FileStore, Room};
use crate::pdi::Pdi;
use omnibase_ethercat_wire::AlState;
use omnibase_ethercat_wire::bytes::put_u16;
use omnibase_ethercat_wire::coe::{Emergency, HEADER as COE_HEADER, Service, write_header};
use omnibase_ethercat_wire::mailbox::{self, HEADER, Header, Protocol, next_counter};
use omnibase_ethercat_wire::register::{SM, SM_SIZE};
use omnibase_ethercat_wire::sii::MailboxArea;
use std::collections::VecDeque;

/// SM1's status: the mailbox is full (bit 3).
const FULL: u8 = 1 << 3;
/// SM1's activation and PDI control: repeat request and its acknowledge (bit 1).
const REPEAT: u8 = 1 << 1;
/// SM1's PDI control: switched off by the application (bit 0).
const OFF: u8 = 1 << 0;
const SM1_STATUS: u16 = SM + SM_SIZE + 5;
const SM1_ACTIVATION: u16 = SM + SM_SIZE + 6;
const SM1_PDI_CONTROL: u16 = SM + SM_SIZE + 7;
/// Answers that may wait; while there are so many, requests stay in SM0.
const WAITING_LIMIT: usize = 4;
/// Emergencies that may wait; later ones are dropped.
const EMERGENCY_LIMIT: usize = 16;

/// Which protocols answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MailboxProtocols {
    /// CoE.
    Coe,
    /// A mailbox that refuses everything.
    Nothing,
}

/// Mailbox state between messages.
#[derive(Debug)]
pub(crate) struct MailboxServer {
    area: MailboxArea,
    protocols: MailboxProtocols,
    coe: coe::Server,
    /// Where the device takes files.
    foe: Option<foe::Server>,
    /// Counter of our messages.
    sent_counter: u8,
    /// Counter of the last request: the same again is the same request again.
    received_counter: u8,
    /// Service data with their protocol, waiting for SM1.
    waiting: VecDeque<(Protocol, Vec<u8>)>,
    emergencies: VecDeque<Emergency>,
    /// The message in SM1, or the last one that was there.
    current: Option<Vec<u8>>,
    /// The one before, which the MainDevice may have lost.
    previous: Option<Vec<u8>>,
    /// Put back by a repeat: goes out again next.
    again: Option<Vec<u8>>,
    acknowledged: u8,
    request: Vec<u8>,
}

impl MailboxServer {
    pub fn new(area: MailboxArea, protocols: MailboxProtocols) -> Self {
        MailboxServer {
            area,
            protocols,
            coe: coe::Server::default(),
            foe: None,
            sent_counter: 0,
            received_counter: 0,
            waiting: VecDeque::new(),
            emergencies: VecDeque::new(),
            current: None,
            previous: None,
            again: None,
            acknowledged: 0,
            request: vec![0; usize::from(area.receive_size)],
        }
    }

    pub fn area(&self) -> MailboxArea {
        self.area
    }

    /// Files, taken in BOOT.
    pub fn serve_files(&mut self, store: FileStore) {
        self.foe = Some(foe::Server::new(store));
    }

    /// Whether a file was begun and not completed: there is no valid firmware.
    pub fn lacks_firmware(&self) -> bool {
        self.foe.as_ref().is_some_and(|foe| foe.store().lock().incomplete)
    }

    /// Forgets every message, for the mailbox was switched off; from now on it is in this place.
    pub fn reset_at(&mut self, area: MailboxArea) {
        let mut foe = self.foe.take();
        if let Some(foe) = &mut foe {
            foe.reset();
        }
        *self = MailboxServer {
            acknowledged: self.acknowledged,
            foe,
            ..MailboxServer::new(area, self.protocols)
        };
    }

    /// Service data that an answer can hold, bytes.
    pub fn room(&self) -> usize {
        usize::from(self.area.send_size).saturating_sub(HEADER)
    }

    /// Whether another request may be taken.
    pub fn accepts(&self) -> bool {
        self.waiting.len() < WAITING_LIMIT
    }

    /// Queues an emergency; drops it where too many wait.
    pub fn push_emergency(&mut self, emergency: Emergency) {
        if self.protocols == MailboxProtocols::Coe && self.emergencies.len() < EMERGENCY_LIMIT {
            self.emergencies.push_back(emergency);
        }
    }

    /// Empties SM0: the request in it, or `None` where it is a repetition.
    pub fn receive(&mut self, pdi: &mut dyn Pdi) -> Option<()> {
        pdi.read(self.area.receive_offset, &mut self.request);
        let counter = self.request.get(HEADER - 1).map_or(0, |byte| byte >> 4 & 7);
        if counter != 0 && counter == self.received_counter {
            return None;
        }
        self.received_counter = counter;
        Some(())
    }

    /// Answers the request that was received last.
    pub fn answer(&mut self, served: &mut Served) {
        let files =
            Room { receive: usize::from(self.area.receive_size).saturating_sub(HEADER), send: self.room() };
        let in_boot = served.state == AlState::Bootstrap;
        let result = match mailbox::read(&self.request) {
            Err(_) => Err(MailboxFault::Syntax),
            Ok((Header { length: 0, .. }, _)) => Err(MailboxFault::TooShort),
            Ok((header, data)) => match (Protocol::from_code(header.protocol), self.protocols, &mut self.foe)
            {
                (Some(Protocol::Coe), MailboxProtocols::Coe, _) if !in_boot => {
                    self.coe.answer(data, served).map(|answers| (Protocol::Coe, answers))
                }
                (Some(Protocol::Foe), _, Some(foe)) => foe
                    .answer(data, served.state, files)
                    .map(|answer| (Protocol::Foe, answer.into_iter().collect())),
                _ => Err(MailboxFault::UnsupportedProtocol),
            },
        };
        match result {
            Ok((protocol, answers)) => {
                self.waiting.extend(answers.into_iter().map(|data| (protocol, data)));
            }
            Err(fault) => {
                let mut data = vec![0; 4];
                put_u16(&mut data, 0, 1);
                put_u16(&mut data, 2, fault as u16);
                self.waiting.push_back((Protocol::Error, data));
            }
        }
    }

    /// Whether a message waits for SM1.
    pub fn has_messages(&self) -> bool {
        !self.waiting.is_empty() || !self.emergencies.is_empty() || self.again.is_some()
    }

    /// Fills SM1 with the next message where it is empty.
    pub fn send(&mut self, pdi: &mut dyn Pdi) {
        if is_full(pdi) {
            return;
        }
        let message = match self.again.take() {
            Some(message) => message,
            None => {
                let Some((protocol, data)) = self.next_message() else { return };
                self.sent_counter = next_counter(self.sent_counter);
                let mut message = vec![0; HEADER];
                Header::new(protocol, self.sent_counter, data.len() as u16).write(&mut message);
                message.extend_from_slice(&data);
                message.resize(usize::from(self.area.send_size), 0);
                message
            }
        };
        pdi.write(self.area.send_offset, &message);
        self.previous = self.current.replace(message);
    }

    fn next_message(&mut self) -> Option<(Protocol, Vec<u8>)> {
        if let Some(emergency) = self.emergencies.pop_front() {
            let mut data = vec![0; COE_HEADER + Emergency::LENGTH];
            write_header(&mut data, Service::Emergency);
            emergency.write(&mut data[COE_HEADER..]);
            return Some((Protocol::Coe, data));
        }
        self.waiting.pop_front()
    }

    /// The activation register of a SyncManager changed: perhaps a repeat request.
    pub fn check_repeat(&mut self, pdi: &mut dyn Pdi) {
        let mut activation = [0];
        pdi.read(SM1_ACTIVATION, &mut activation);
        let requested = activation[0] & REPEAT;
        if requested == self.acknowledged {
            return;
        }
        self.acknowledged = requested;
        let is_full = is_full(pdi);
        if is_full && self.again.is_some() {
            // What was asked for lies in SM1 already: it is its reading that was lost once more.
            pdi.write(SM1_PDI_CONTROL, &[requested]);
            return;
        }
        let lost = if is_full {
            // The lost message was read; what lies in SM1 now goes out again behind it.
            pdi.write(SM1_PDI_CONTROL, &[OFF | requested]);
            self.again = self.current.take();
            self.previous.take()
        } else {
            self.current.take()
        };
        pdi.write(SM1_PDI_CONTROL, &[requested]);
        if let Some(message) = lost.or_else(|| self.again.take()) {
            pdi.write(self.area.send_offset, &message);
            self.current = Some(message);
        }
    }

    /// After power-on or INIT: the MainDevice's repeat bit as it is counts as answered.
    pub fn synchronize_repeat(&mut self, pdi: &mut dyn Pdi) {
        let mut activation = [0];
        pdi.read(SM1_ACTIVATION, &mut activation);
        self.acknowledged = activation[0] & REPEAT;
        pdi.write(SM1_PDI_CONTROL, &[self.acknowledged]);
    }
}

fn is_full(pdi: &mut dyn Pdi) -> bool {
    let mut status = [0];
    pdi.read(SM1_STATUS, &mut status);
    status[0] & FULL != 0
}
