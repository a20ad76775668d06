//! What a SubDevice's mailbox says: an answer, an emergency, or nothing that was asked for.

use crate::wire::HostTime;
use crate::wire::bytes::u16_at;
use crate::wire::coe::{self, Emergency, Service};
use crate::wire::mailbox::{self, Header, Protocol};

use super::emergency::ReceivedEmergency;
use super::outcome::Outcome;
use super::request::MailboxError;
use super::{BUSY_PAUSE, Mailbox, Stage, Task};

impl Mailbox {
    /// Sorts one message.
    pub(super) fn receive(&mut self, area: &[u8], now: HostTime) {
        let Ok((header, data)) = mailbox::read(area) else {
            self.counters.stray += 1;
            return self.resume();
        };
        let repeated = self.repeat_asked && header.counter != 0 && header.counter == self.last_received;
        self.last_received = header.counter;
        self.repeat_asked = false;
        if repeated {
            self.counters.duplicate += 1;
            return self.resume();
        }
        match self.sort(header, data, now) {
            Outcome::Stray => {
                self.counters.stray += 1;
                self.resume();
            }
            Outcome::More => {
                if let Task::Run { request, deadline, .. } = &mut self.task {
                    *deadline = now + request.timeout.unwrap_or(self.config.answer_timeout);
                }
                (self.to_write, self.write_uncertain) = (false, false);
                self.stage = Stage::Poll;
            }
            Outcome::Kept => self.resume(),
            Outcome::Send => self.send_next(now),
            Outcome::SendLater => {
                self.send_next(now);
                self.next_look = now + BUSY_PAUSE;
            }
            Outcome::Done => {
                if let Task::Run { request, .. } = core::mem::replace(&mut self.task, Task::None) {
                    self.finish(request, Ok(()));
                }
            }
            Outcome::Failed(error, code) => self.fail(error, code, now),
        }
    }

    fn sort(&mut self, header: Header, data: &[u8], now: HostTime) -> Outcome {
        // Before the request is out, nothing can be its answer.
        let unsent = self.to_write && !self.write_uncertain;
        match Protocol::from_code(header.protocol) {
            Some(Protocol::Coe) if coe::service_code(data) == Some(Service::Emergency as u8) => {
                let Some(emergency) = Emergency::read(&data[coe::HEADER..]) else { return Outcome::Stray };
                self.emergencies.push(ReceivedEmergency { time: now, emergency });
                Outcome::Kept
            }
            Some(protocol @ (Protocol::Coe | Protocol::Foe)) if !unsent => match &mut self.task {
                Task::Run { request, transfer, .. } if transfer.protocol() == protocol => {
                    transfer.read(data, request)
                }
                _ => Outcome::Stray,
            },
            Some(Protocol::Error) if !unsent && data.len() >= 4 && matches!(self.task, Task::Run { .. }) => {
                Outcome::Failed(MailboxError::Refused { detail: u16_at(data, 2) }, None)
            }
            _ => Outcome::Stray,
        }
    }
}
