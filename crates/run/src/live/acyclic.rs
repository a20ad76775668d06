//! SDOs and registers of SubDevices beside a running cycle: what others ask, and what the bus said.
//!
//! One at a time goes through the mailbox in the cycle's spare datagrams. Buffers are the asker's own: the cycle neither
//! takes memory for them nor gives any back. Nothing waits for a SubDevice that is away: it is refused at once, as is what waited
//! so long behind others that whoever asked is gone: nothing asked of the machine as it was happens to it later.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock};
use std::time::Instant;

use omnibase_ethercat::cyclic::{AcyclicError, AcyclicRequest, AcyclicWork};
use omnibase_ethercat::mailbox::{MailboxRequest, Operation};
use omnibase_ethercat::subdevice::SubDevice;
use omnibase_ethercat::wire::{Clock, Link};
use omnibase_robot::signals::Phase;
use rtrb::{Consumer, Producer, PushError, RingBuffer};

use omnibase_session::Words;
use omnibase_session::session::Session;
use omnibase_session::supervision::OTHERS;

/// Questions on their way.
const MOST: usize = 8;

/// When the cycle may pass a question on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Permission {
    /// In every phase.
    Always,
    /// While no drive is enabled.
    WhileDisabled,
}

/// Why nothing came of a question.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AcyclicRefusal {
    /// The drives are enabled.
    #[error(
        "the drives are enabled: this object is written while they are not, or where `[bus] sdo_write_while_enabled` \
         of the robot's file names it"
    )]
    Enabled,
    /// The SubDevice is lost or on its way back.
    #[error("SubDevice {0} is away")]
    Away(u16),
    /// Too much is asked beside the cycle.
    #[error("too much was asked at once")]
    Full,
    /// Its turn came when nobody waited for it any more.
    #[error("it waited too long behind other questions: nothing was done")]
    TooLate,
    /// The bus's own error.
    #[error(transparent)]
    Failed(#[from] AcyclicError),
}

impl AcyclicRefusal {
    /// Whether the SubDevice itself said no.
    pub(super) fn is_its_own(&self) -> bool {
        matches!(self, AcyclicRefusal::Failed(AcyclicError::Mailbox(error)) if error.is_refusal())
    }
}

/// What the bus said.
#[derive(Debug)]
pub struct Told {
    ticket: u64,
    /// The work with its buffer; on success its data are the result.
    pub work: AcyclicWork,
    /// How it ended.
    pub result: Result<(), AcyclicRefusal>,
}

struct Asked {
    ticket: u64,
    position: u16,
    work: AcyclicWork,
    permission: Permission,
    /// From then on nobody waits for it.
    until: Instant,
}

/// What is known of a SubDevice since the start.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SubDeviceFacts {
    /// Place in the order of frames, from 0.
    pub position: u16,
    /// Its drive's name in the robot's file; empty where it has none.
    pub drive: String,
    /// Its name by its SII.
    pub name: String,
    /// Vendor, product, revision, serial.
    pub identity: omnibase_ethercat::wire::sii::Identity,
    /// Alias; `None` where it has none.
    pub alias: Option<u16>,
    /// Station address.
    pub station_address: u16,
}

impl SubDeviceFacts {
    pub(crate) fn of(one: &SubDevice) -> Self {
        SubDeviceFacts {
            position: one.position,
            drive: one.config.name.clone().unwrap_or_default(),
            name: one.name.clone(),
            identity: one.identity,
            alias: one.alias,
            station_address: one.station_address,
        }
    }
}

/// What doesn't change while a robot runs, by what was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Lasting {
    /// The bytes of an object, by position, index and subindex.
    Value(u16, u16, u8),
    /// The indices of all objects of the SubDevice at this position.
    List(u16),
    /// What an object is, by position and index.
    Object(u16, u16),
    /// What an entry is, by position, index and subindex.
    Entry(u16, u16, u8),
}

/// What was told of it.
type Remembered = BTreeMap<Lasting, Vec<u8>>;

/// So much is remembered: the dictionaries of many devices.
const MOST_REMEMBERED: usize = 1 << 16;

/// Everybody else's end; clones talk to the same robot, and none of them waits for the cycle.
#[derive(Clone)]
pub struct AcyclicLine {
    shared: Arc<Mutex<Asker>>,
    /// Descriptions, and what units are told by: asked for once.
    remembered: Arc<Mutex<Remembered>>,
    facts: Arc<OnceLock<Vec<SubDeviceFacts>>>,
}

struct Asker {
    to_cycle: Producer<Asked>,
    from_cycle: Consumer<Told>,
    told: VecDeque<Told>,
    next_ticket: u64,
}

/// The cycle's end.
pub struct AcyclicEnd {
    inbox: Consumer<Asked>,
    back: Producer<Told>,
    under_way: Option<(u64, Permission)>,
    facts: Arc<OnceLock<Vec<SubDeviceFacts>>>,
}

/// Both ends.
pub(super) fn acyclic() -> (AcyclicLine, AcyclicEnd) {
    let (to_cycle, inbox) = RingBuffer::new(MOST);
    let (back, from_cycle) = RingBuffer::new(MOST);
    let facts = Arc::new(OnceLock::new());
    let asker = Asker { to_cycle, from_cycle, told: VecDeque::new(), next_ticket: 0 };
    let shared = Arc::new(Mutex::new(asker));
    let line = AcyclicLine { shared, remembered: Arc::default(), facts: facts.clone() };
    (line, AcyclicEnd { inbox, back, under_way: None, facts })
}

impl AcyclicLine {
    /// The SubDevices by position; empty before the bus is set up.
    pub fn subdevices(&self) -> &[SubDeviceFacts] {
        self.facts.get().map_or(&[], Vec::as_slice)
    }

    /// Asks what nobody waits for any more from `until` on: it isn't done then. The ticket by which [`AcyclicLine::told`] finds what
    /// came of it; the work itself where too much is asked.
    pub fn ask(
        &self,
        position: u16,
        work: AcyclicWork,
        permission: Permission,
        until: Instant,
    ) -> Result<u64, AcyclicWork> {
        let mut asker = self.asker();
        let ticket = asker.next_ticket;
        asker.next_ticket = ticket.wrapping_add(1) & !OTHERS;
        let pushed = asker.to_cycle.push(Asked { ticket, position, work, permission, until });
        pushed.map(|()| ticket).map_err(|PushError::Full(asked)| asked.work)
    }

    /// What came of a question, once.
    pub fn told(&self, ticket: u64) -> Option<Told> {
        let mut asker = self.asker();
        let at = asker.told.iter().position(|told| told.ticket == ticket)?;
        asker.told.remove(at)
    }

    /// What was read once; nobody's reading waits for another one's.
    pub(super) fn remembered<E>(
        &self,
        what: Lasting,
        read: impl FnOnce() -> Result<Vec<u8>, E>,
    ) -> Result<Vec<u8>, E> {
        if let Some(found) = self.known().get(&what) {
            return Ok(found.clone());
        }
        let found = read()?;
        let mut known = self.known();
        if known.len() < MOST_REMEMBERED {
            known.insert(what, found.clone());
        }
        Ok(found)
    }

    /// The first SubDevice whose descriptions are this one's: of the same product and revision, with the same list of objects, for
    /// modules change it. Itself before its list is known.
    pub(super) fn like(&self, position: u16) -> u16 {
        let product = |facts: &SubDeviceFacts| {
            (facts.identity.vendor_id, facts.identity.product_code, facts.identity.revision)
        };
        let known = self.known();
        let list = |position| known.get(&Lasting::List(position));
        let Some(own) = self.subdevices().get(usize::from(position)) else { return position };
        let Some(own_list) = list(position) else { return position };
        let is_like =
            |one: &&SubDeviceFacts| product(one) == product(own) && list(one.position) == Some(own_list);
        self.subdevices().iter().find(is_like).map_or(position, |one| one.position)
    }

    fn known(&self) -> MutexGuard<'_, Remembered> {
        self.remembered.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    fn asker(&self) -> MutexGuard<'_, Asker> {
        let mut asker = self.shared.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        while let Ok(told) = asker.from_cycle.pop() {
            // Whoever asked and went doesn't fetch it.
            if asker.told.len() == MOST {
                asker.told.pop_front();
            }
            asker.told.push_back(told);
        }
        asker
    }
}

impl AcyclicEnd {
    /// Says who is there, before the cycle begins.
    pub(crate) fn introduce(&self, subdevices: Vec<SubDeviceFacts>) {
        let _ = self.facts.set(subdevices);
    }

    /// Whether something is being written that must not be while drives are enabled: nobody enables them meanwhile.
    pub(crate) fn keeps_disabled(&self) -> bool {
        matches!(self.under_way, Some((_, Permission::WhileDisabled)))
    }

    /// One step after an exchange, in this phase of the robot; what was written, for people to read.
    #[inline]
    pub(crate) fn step<L: Link, C: Clock>(
        &mut self,
        session: &mut Session<L, C>,
        phase: Phase,
    ) -> Option<Words> {
        if self.under_way.is_none() && self.inbox.is_empty() {
            return None;
        }
        self.work(session, phase)
    }

    #[cold]
    fn work<L: Link, C: Clock>(&mut self, session: &mut Session<L, C>, phase: Phase) -> Option<Words> {
        let mut written = None;
        if let Some((ticket, _)) = self.under_way
            && let Some(done) = session.take_acyclic(ticket | OTHERS)
        {
            self.under_way = None;
            if let (
                Ok(()),
                AcyclicWork::Mailbox(MailboxRequest {
                    operation: Operation::Download { object, .. }, ..
                }),
            ) = (&done.result, &done.work)
            {
                written = Some(Words::new(format_args!(
                    "SDO: {object} of SubDevice {} was written",
                    done.position
                )));
            }
            self.tell(Told { ticket, work: done.work, result: done.result.map_err(AcyclicRefusal::Failed) });
        }
        // Where nobody fetches answers no more is done: dropping them would free memory.
        if self.under_way.is_some() || self.back.slots() == 0 || self.inbox.is_empty() {
            return written;
        }
        let now = Instant::now();
        let Some(asked) = self.taken(phase, |position| session.is_away(position), now) else {
            return written;
        };
        let Asked { ticket, position, work, permission, .. } = asked;
        match session.submit_acyclic(AcyclicRequest { tag: ticket | OTHERS, position, work }) {
            Ok(()) => self.under_way = Some((ticket, permission)),
            Err(AcyclicRequest { work, .. }) => {
                self.tell(Told { ticket, work, result: Err(AcyclicRefusal::Full) });
            }
        }
        written
    }

    /// The next question, where it may be passed on; whoever asked is told why where it mayn't.
    fn taken(&mut self, phase: Phase, is_away: impl Fn(u16) -> bool, now: Instant) -> Option<Asked> {
        let asked = self.inbox.pop().ok()?;
        let is_disabled = matches!(phase, Phase::Disabled | Phase::Fault);
        let refusal = match asked.permission {
            _ if now >= asked.until => AcyclicRefusal::TooLate,
            Permission::WhileDisabled if !is_disabled => AcyclicRefusal::Enabled,
            _ if is_away(asked.position) => AcyclicRefusal::Away(asked.position),
            _ => return Some(asked),
        };
        self.tell(Told { ticket: asked.ticket, work: asked.work, result: Err(refusal) });
        None
    }

    fn tell(&mut self, told: Told) {
        if let Err(PushError::Full(told)) = self.back.push(told) {
            // Never: there was room before it began. Its memory is kept, for the cycle frees none.
            std::mem::forget(told);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use omnibase_ethercat::mailbox::MailboxError;
    use omnibase_ethercat::wire::coe::{AbortCode, ObjectAddress};

    use super::*;

    const OBJECT: ObjectAddress = ObjectAddress::new(0x6083, 0);

    fn write() -> AcyclicWork {
        AcyclicWork::Mailbox(MailboxRequest::download(OBJECT, vec![1]))
    }

    /// A writing whose asker was told that no answer came isn't done seconds later.
    #[test]
    fn what_nobody_waits_for_any_more_is_not_done() {
        let (line, mut end) = acyclic();
        let now = Instant::now();
        let until = now + Duration::from_secs(3);
        let ticket = line.ask(0, write(), Permission::WhileDisabled, until).unwrap();
        assert!(end.taken(Phase::Disabled, |_| false, until).is_none());
        assert_eq!(line.told(ticket).unwrap().result, Err(AcyclicRefusal::TooLate));
        line.ask(0, write(), Permission::WhileDisabled, until).unwrap();
        assert!(end.taken(Phase::Disabled, |_| false, now).is_some());
    }

    /// Whoever asks beside many others waits for room; a refusal is the SubDevice's own where that said it.
    #[test]
    fn many_who_ask_are_all_heard_and_told_whose_no_it_is() {
        let (line, mut end) = acyclic();
        let identity = omnibase_ethercat::wire::sii::Identity::default();
        let (drive, name) = (String::new(), String::new());
        let facts = SubDeviceFacts { position: 0, drive, name, identity, alias: None, station_address: 1 };
        end.introduce(vec![facts]);
        let later = Instant::now() + Duration::from_secs(1000);
        let aborted = MailboxError::Aborted { object: OBJECT, code: AbortCode(0x0602_0000) };
        for (refusal, is_its_own) in [
            (AcyclicRefusal::Failed(AcyclicError::Mailbox(aborted)), true),
            (AcyclicRefusal::Failed(AcyclicError::NoMailbox { position: 0 }), false),
            (AcyclicRefusal::Away(0), false),
            (AcyclicRefusal::Full, false),
        ] {
            let others = (0..MOST).map(|_| line.ask(0, write(), Permission::Always, later).unwrap());
            let others: Vec<u64> = others.collect();
            assert_eq!(line.ask(0, write(), Permission::Always, later), Err(write()));
            let asking = line.clone();
            let asking = std::thread::spawn(move || asking.wait_until(0, write(), Permission::Always, later));
            std::thread::sleep(Duration::from_millis(50));
            assert!(!asking.is_finished(), "it waits for room");
            while !asking.is_finished() {
                let Some(Asked { ticket, work, .. }) = end.taken(Phase::Disabled, |_| false, Instant::now())
                else {
                    continue;
                };
                if !others.contains(&ticket) {
                    end.tell(Told { ticket, work, result: Err(refusal) });
                }
            }
            let error = asking.join().unwrap().unwrap_err();
            assert_eq!(error.is_refusal(), is_its_own, "{error}");
            assert_eq!(error.to_string(), refusal.to_string());
        }
    }
}
