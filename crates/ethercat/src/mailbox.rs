//! The one owner of a SubDevice's mailbox: requests in, answers out, everything else sorted and counted.
//!
//! A [`Mailbox`] is a [`Procedure`]: the set-up drives it until it is done, the cycle drives it one datagram at a
//! time. It neither allocates nor grows once it is made: requests carry their buffers in and out.
//!
//! What arrives is told apart by mailbox protocol and CoE service, then by object, subindex and toggle bit.
//! Emergencies go into a ring and never end the request in hand; what fits nothing is dropped and counted. The
//! SubDevice's message counter serves for one thing only: to recognise an answer that was asked for twice.

mod emergency;
mod file;
mod info;
mod outcome;
mod receive;
mod request;
mod sdo;
mod short_text;
mod transfer;

#[cfg(test)]
mod tests;

use alloc::boxed::Box;
use alloc::vec;
use core::time::Duration;

use crate::procedure::{Answer, DatagramRequest, Next, Procedure};
use crate::process_data::MailboxConfig;
use crate::wire::coe::{self, AbortCode};
use crate::wire::foe;
use crate::wire::frame::MAX_DATA;
use crate::wire::mailbox::{self, Header, Protocol};
use crate::wire::{HostTime, register};

pub use emergency::{EmergencyRing, ReceivedEmergency};
pub use info::{EntryDescription, ObjectDescription, list_indices};
pub use request::{
    Completion, DEFAULT_TIMEOUT, FileAccess, MailboxError, MailboxRequest, ObjectList, Operation, SdoAccess,
    Waiting,
};
pub use short_text::ShortText;

use transfer::Transfer;

/// Status of SM0: bit 3 says that the SubDevice hasn't taken the last message yet.
const WRITE_STATUS: u16 = register::SM + 5;
/// Status of SM1: bit 3 says that a message waits for us.
const READ_STATUS: u16 = register::SM + register::SM_SIZE + 5;
/// Activation of SM1: bit 1 asks for the last message again when toggled.
const READ_ACTIVATE: u16 = register::SM + register::SM_SIZE + 6;
/// PDI control of SM1: bit 1 follows the toggle once the message stands there again.
const READ_PDI: u16 = register::SM + register::SM_SIZE + 7;
/// Both status registers in one read.
const BOTH_STATUS: usize = (READ_STATUS - WRITE_STATUS) as usize + 1;
/// Mailbox full.
const FULL: u8 = 1 << 3;
/// Repeat request and its acknowledge.
const REPEAT: u8 = 1 << 1;
/// Mailbox header, CoE header and eight bytes: no SDO is shorter.
const SHORTEST: usize = mailbox::HEADER + coe::HEADER + coe::SDO_HEADER;
/// Pause between two looks at a mailbox that had nothing.
const POLL_INTERVAL: Duration = Duration::from_micros(100);
/// Pause before a message is sent again to a SubDevice that said that it is busy.
const BUSY_PAUSE: Duration = Duration::from_millis(10);
/// How long a SubDevice gets to give a lost message again, and to take an abort.
const COURTESY: Duration = Duration::from_millis(100);
/// A request is given up where so many frames in a row didn't come back, for so long: that isn't the SubDevice's doing.
const LOST_FRAMES: u32 = 8;
const SILENCE: Duration = Duration::from_millis(500);

/// A mailbox's sizes can't be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a mailbox of {write} bytes out and {read} in can't be used: both must have {shortest} to {longest}")]
pub struct UnusableMailbox {
    /// Bytes from the MainDevice.
    pub write: u16,
    /// Bytes to the MainDevice.
    pub read: u16,
    /// The least that an SDO needs.
    pub shortest: usize,
    /// The most that one datagram carries.
    pub longest: usize,
}

/// What was seen on a mailbox beside the answers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MailboxCounters {
    /// Messages that fitted nothing.
    pub stray: u64,
    /// Messages that came twice.
    pub duplicate: u64,
    /// Times that a lost message was asked for again.
    pub repeats: u64,
}

/// Which datagram is next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Nothing is wanted.
    Idle,
    /// Is there anything in, is there room out?
    Look,
    /// Write the message.
    Write,
    /// Has the answer come?
    Poll,
    /// Read it.
    Read,
    /// Learn the present repeat bit.
    RepeatLook,
    /// Toggle it.
    RepeatAsk { value: u8 },
    /// Wait until the SubDevice follows.
    RepeatWait { value: u8 },
}

/// What the mailbox is busy with.
#[derive(Clone, Debug)]
enum Task {
    /// Nothing, or looking for emergencies.
    None,
    /// A request.
    Run { request: MailboxRequest, transfer: Transfer, deadline: HostTime },
    /// The request has failed, the SubDevice is being told.
    Abort { request: MailboxRequest, error: MailboxError, deadline: HostTime },
    /// Over; waits to be taken.
    Over(Completion),
}

/// One SubDevice's mailbox.
#[derive(Clone, Debug)]
pub struct Mailbox {
    station: u16,
    config: MailboxConfig,
    stage: Stage,
    task: Task,
    /// The whole area as it is written; zero behind the message.
    message: Box<[u8]>,
    /// The message still has to be written, or its writing isn't certain.
    to_write: bool,
    /// A write got lost: if the area is full now, it had arrived.
    write_uncertain: bool,
    counter: u8,
    last_received: u8,
    /// A repeat was asked for since the last new message, so the next may be one that is known.
    repeat_asked: bool,
    repeat_deadline: HostTime,
    next_look: HostTime,
    /// The last datagram was answered by no one.
    unanswered: bool,
    /// Datagrams in a row that didn't come back, and since when.
    silence: Option<(u32, HostTime)>,
    emergencies: EmergencyRing,
    counters: MailboxCounters,
}

impl Mailbox {
    /// The mailbox of the SubDevice at `station`, as its SyncManagers 0 and 1 are programmed.
    pub fn new(station: u16, config: MailboxConfig) -> Result<Self, UnusableMailbox> {
        let usable = |length: u16| (SHORTEST..=MAX_DATA).contains(&usize::from(length));
        if !usable(config.write.length) || !usable(config.read.length) {
            return Err(UnusableMailbox {
                write: config.write.length,
                read: config.read.length,
                shortest: SHORTEST,
                longest: MAX_DATA,
            });
        }
        Ok(Mailbox {
            station,
            config,
            stage: Stage::Idle,
            task: Task::None,
            message: vec![0; usize::from(config.write.length)].into_boxed_slice(),
            to_write: false,
            write_uncertain: false,
            counter: 0,
            last_received: 0,
            repeat_asked: false,
            repeat_deadline: HostTime(0),
            next_look: HostTime(0),
            unanswered: false,
            silence: None,
            emergencies: EmergencyRing::new(),
            counters: MailboxCounters::default(),
        })
    }

    /// The most bytes of data that one datagram of this mailbox carries.
    pub fn longest_datagram(&self) -> usize {
        usize::from(self.config.write.length.max(self.config.read.length))
    }

    /// Whether a request is in hand or its completion not yet taken.
    pub fn is_busy(&self) -> bool {
        !matches!(self.task, Task::None)
    }

    /// Takes a request on; gives it back while another is in hand.
    pub fn start(&mut self, mut request: MailboxRequest, now: HostTime) -> Result<(), MailboxRequest> {
        if self.is_busy() {
            return Err(request);
        }
        if let Err(error) = self.fits(&request) {
            self.task = Task::Over(Completion { request, result: Err(error) });
            return Ok(());
        }
        if !request.operation.is_write() {
            request.data.clear();
        }
        let longest_answer = usize::from(self.config.read.length) - mailbox::HEADER;
        let transfer = Transfer::new(request.operation, longest_answer);
        self.task = Task::Run { request, transfer, deadline: now };
        self.silence = None;
        self.send_next(now);
        Ok(())
    }

    fn fits(&self, request: &MailboxRequest) -> Result<(), MailboxError> {
        let (data, name) = (request.data.len(), request.file.name.len());
        if request.operation.is_write() && u32::try_from(data).is_err() {
            return Err(MailboxError::DataTooLong { found: data });
        }
        let room = usize::from(self.config.write.length).saturating_sub(mailbox::HEADER + foe::HEADER);
        if name > room { Err(MailboxError::NameTooLong { found: name, room }) } else { Ok(()) }
    }

    /// Looks once for a message that nobody asked for, where the mailbox has nothing else to do.
    pub fn look(&mut self) {
        if matches!(self.task, Task::None) && self.stage == Stage::Idle {
            self.stage = Stage::Poll;
        }
    }

    /// The SubDevice lost power or went to INIT: its mailbox begins anew, a request in hand fails.
    pub fn reset(&mut self) {
        (self.counter, self.last_received) = (0, 0);
        self.cancel();
    }

    /// How much of a file the request in hand has carried so far, bytes; `None` where it carries none.
    pub fn file_bytes(&self) -> Option<usize> {
        match &self.task {
            Task::Run { request, transfer: Transfer::File(file), .. } => Some(file.bytes(request)),
            _ => None,
        }
    }

    /// Gives up the request in hand. The message counter goes on, for a SubDevice drops what it takes for a repeat.
    pub fn cancel(&mut self) {
        self.stage = Stage::Idle;
        (self.to_write, self.write_uncertain) = (false, false);
        self.repeat_asked = false;
        match core::mem::replace(&mut self.task, Task::None) {
            Task::Run { request, .. } => self.finish(request, Err(MailboxError::Reset)),
            Task::Abort { request, error, .. } => self.finish(request, Err(error)),
            other => self.task = other,
        }
    }

    /// The request that is over, where there is one.
    pub fn take_completion(&mut self) -> Option<Completion> {
        match core::mem::replace(&mut self.task, Task::None) {
            Task::Over(completion) => Some(completion),
            other => {
                self.task = other;
                None
            }
        }
    }

    /// Emergencies that arrived.
    pub fn emergencies(&mut self) -> &mut EmergencyRing {
        &mut self.emergencies
    }

    /// What was seen beside answers.
    pub fn counters(&self) -> MailboxCounters {
        self.counters
    }

    fn finish(&mut self, request: MailboxRequest, result: Result<(), MailboxError>) {
        self.task = Task::Over(Completion { request, result });
        self.stage = Stage::Idle;
        (self.to_write, self.write_uncertain) = (false, false);
    }

    /// Puts the header before `length` bytes of service data and has the message sent.
    fn post(&mut self, protocol: Protocol, length: usize) {
        self.counter = mailbox::next_counter(self.counter);
        Header::new(protocol, self.counter, length as u16).write(&mut self.message);
        self.to_write = true;
        self.write_uncertain = false;
        self.stage = Stage::Look;
    }

    fn send_next(&mut self, now: HostTime) {
        let Task::Run { request, transfer, deadline } = &mut self.task else { return };
        self.message.fill(0);
        let length = transfer.write(&mut self.message[mailbox::HEADER..], request);
        *deadline = now + request.timeout.unwrap_or(self.config.answer_timeout);
        let protocol = transfer.protocol();
        self.next_look = now;
        self.post(protocol, length);
    }

    /// Ends the request in hand, telling the SubDevice where a code is given.
    fn fail(&mut self, error: MailboxError, code: Option<AbortCode>, now: HostTime) {
        let Task::Run { request, transfer, .. } = core::mem::replace(&mut self.task, Task::None) else {
            return;
        };
        let told = code.and_then(|code| {
            self.message.fill(0);
            transfer.write_abort(&mut self.message[mailbox::HEADER..], code)
        });
        match told {
            Some(length) => {
                self.task = Task::Abort { request, error, deadline: now + COURTESY };
                self.next_look = now;
                self.post(transfer.protocol(), length);
            }
            None => self.finish(request, Err(error)),
        }
    }

    /// The stage after a message was read or a repeat given up.
    fn resume(&mut self) {
        self.stage = match self.task {
            Task::Run { .. } | Task::Abort { .. } if self.to_write => Stage::Look,
            Task::Run { .. } => Stage::Poll,
            _ => Stage::Idle,
        };
    }

    fn check_deadline(&mut self, now: HostTime) {
        match &self.task {
            Task::Run { request, deadline, .. } if now >= *deadline => {
                let after = request.timeout.unwrap_or(self.config.answer_timeout);
                let waiting = match self.stage {
                    Stage::RepeatLook | Stage::RepeatAsk { .. } | Stage::RepeatWait { .. } => Waiting::Repeat,
                    _ if self.to_write => Waiting::MailboxEmpty,
                    _ => Waiting::Answer,
                };
                let silent = self.silence.map(|(_, since)| now - since).filter(|silent| *silent * 2 >= after);
                if let Some(after) = silent {
                    self.fail(MailboxError::Unheard { after }, None, now);
                } else if self.unanswered {
                    self.fail(MailboxError::Unreachable { after }, None, now);
                } else {
                    self.fail(MailboxError::Timeout { waiting, after }, Some(AbortCode::TIMEOUT), now);
                }
            }
            Task::Abort { deadline, .. } if now >= *deadline => self.end_abort(),
            _ => {}
        }
        let repeating =
            matches!(self.stage, Stage::RepeatLook | Stage::RepeatAsk { .. } | Stage::RepeatWait { .. });
        if repeating && now >= self.repeat_deadline {
            self.resume();
        }
    }

    fn end_abort(&mut self) {
        if let Task::Abort { request, error, .. } = core::mem::replace(&mut self.task, Task::None) {
            self.finish(request, Err(error));
        }
    }

    fn begin_repeat(&mut self, now: HostTime) {
        self.stage = Stage::RepeatLook;
        self.repeat_deadline = now + COURTESY;
    }

    /// The request that belongs to the present stage.
    fn datagram(&self) -> Option<DatagramRequest> {
        let station = self.station;
        Some(match self.stage {
            Stage::Idle => return None,
            Stage::Look => DatagramRequest::read(station, WRITE_STATUS, BOTH_STATUS),
            Stage::Write => DatagramRequest::write(station, self.config.write.start, self.message.len()),
            Stage::Poll => DatagramRequest::read(station, READ_STATUS, 1),
            Stage::Read => {
                DatagramRequest::read(station, self.config.read.start, usize::from(self.config.read.length))
            }
            Stage::RepeatLook => DatagramRequest::read(station, READ_ACTIVATE, 1),
            Stage::RepeatAsk { .. } => DatagramRequest::write(station, READ_ACTIVATE, 1),
            Stage::RepeatWait { .. } => DatagramRequest::read(station, READ_PDI, 1),
        })
    }

    fn lost(&mut self, now: HostTime) {
        let (before, since) = self.silence.unwrap_or((0, now));
        self.silence = Some((before + 1, since));
        if before + 1 >= LOST_FRAMES && now - since >= SILENCE {
            match self.task {
                Task::Run { .. } => {
                    return self.fail(MailboxError::Unheard { after: now - since }, None, now);
                }
                Task::Abort { .. } => return self.end_abort(),
                Task::None | Task::Over(_) => {}
            }
        }
        match self.stage {
            Stage::Write => {
                self.write_uncertain = true;
                self.stage = Stage::Look;
            }
            Stage::Read => self.begin_repeat(now),
            Stage::Poll if matches!(self.task, Task::None) => self.stage = Stage::Idle,
            // Reading a status again does no harm, nor does writing the same repeat bit.
            _ => {}
        }
    }

    fn returned(&mut self, data: &[u8], working_counter: u16, now: HostTime) {
        self.unanswered = working_counter == 0;
        self.silence = None;
        // Not one: nobody took part, or two SubDevices share an address and neither can be believed.
        if working_counter != 1 {
            match self.stage {
                // It was empty before: if the area is full now, or an answer comes, the message had arrived.
                Stage::Write => {
                    self.write_uncertain = true;
                    self.stage = Stage::Look;
                }
                Stage::Read => self.begin_repeat(now),
                Stage::Poll if matches!(self.task, Task::None) => self.stage = Stage::Idle,
                _ => {}
            }
            self.next_look = now + POLL_INTERVAL;
            return;
        }
        let first = data.first().copied().unwrap_or(0);
        match self.stage {
            Stage::Idle => {}
            Stage::Look => {
                let waiting = data.get(BOTH_STATUS - 1).is_some_and(|status| status & FULL != 0);
                let blocked = first & FULL != 0;
                if waiting {
                    // Whatever is in there, a SubDevice may refuse to take anything before it is out.
                    self.stage = Stage::Read;
                } else if blocked && self.write_uncertain {
                    self.written();
                } else if blocked && matches!(self.task, Task::Abort { .. }) {
                    self.end_abort();
                } else if blocked {
                    self.next_look = now + POLL_INTERVAL;
                } else {
                    self.stage = Stage::Write;
                }
            }
            Stage::Write => self.written(),
            Stage::Poll => {
                if first & FULL != 0 {
                    self.stage = Stage::Read;
                } else if matches!(self.task, Task::Run { .. }) {
                    self.next_look = now + POLL_INTERVAL;
                } else {
                    self.stage = Stage::Idle;
                }
            }
            Stage::Read => {
                self.receive(data, now);
            }
            Stage::RepeatLook => self.stage = Stage::RepeatAsk { value: first ^ REPEAT },
            Stage::RepeatAsk { value } => {
                self.counters.repeats += 1;
                self.repeat_asked = true;
                self.stage = Stage::RepeatWait { value };
            }
            Stage::RepeatWait { value } => {
                if (first ^ value) & REPEAT == 0 {
                    self.stage = Stage::Poll;
                }
                self.next_look = now + POLL_INTERVAL;
            }
        }
    }

    fn written(&mut self) {
        (self.to_write, self.write_uncertain) = (false, false);
        if matches!(self.task, Task::Abort { .. }) {
            self.end_abort();
        } else if matches!(&self.task, Task::Run { transfer, .. } if transfer.ends_with_message()) {
            if let Task::Run { request, .. } = core::mem::replace(&mut self.task, Task::None) {
                self.finish(request, Ok(()));
            }
        } else {
            self.stage = Stage::Poll;
        }
    }
}

impl Procedure for Mailbox {
    /// What ended; `None` while there is nothing to do.
    type Output = Option<Completion>;

    fn next(&mut self, now: HostTime) -> Next<Self::Output> {
        self.check_deadline(now);
        if let Some(completion) = self.take_completion() {
            return Next::Done(Some(completion));
        }
        match self.datagram() {
            None => Next::Done(None),
            Some(_) if now < self.next_look => Next::WaitUntil(self.next_look),
            Some(request) => Next::Send(request),
        }
    }

    fn fill(&self, data: &mut [u8]) {
        match self.stage {
            Stage::Write if data.len() == self.message.len() => data.copy_from_slice(&self.message),
            Stage::RepeatAsk { value } => data.fill(value),
            _ => {}
        }
    }

    fn answer(&mut self, answer: Answer<'_>, now: HostTime) {
        match answer {
            Answer::Lost => self.lost(now),
            Answer::Returned { working_counter, data } => self.returned(data, working_counter, now),
        }
    }
}
