//! Work beside the cycle: mailbox requests and register accesses, one datagram a cycle.

mod register_job;
mod request;
mod safe_op_writer;

use alloc::collections::VecDeque;
use alloc::vec::Vec;
use core::time::Duration;

use crate::found::Found;
use crate::image::Turn;
use crate::mailbox::{Mailbox, MailboxError, ReceivedEmergency};
use crate::procedure::{Answer, DatagramRequest, Next, Procedure};
use crate::start_up::StartUpError;
use crate::subdevice::SubDevice;
use crate::wire::HostTime;

pub use request::{AcyclicCompletion, AcyclicError, AcyclicRequest, AcyclicWork, RegisterAccess};

use super::recovery::{Comeback, Observed, Recovery, RecoveryError, Surroundings};
use register_job::RegisterJob;
use safe_op_writer::SafeOpWriter;

/// Requests that may be queued, in work, or waiting to be taken, together.
pub const CAPACITY: usize = 64;
/// Time between two looks at mailboxes for messages that nobody asked for.
const LOOK_INTERVAL: Duration = Duration::from_millis(10);
/// The same while somebody is on its way back, whose way takes nearly all spare datagrams.
const LOOK_INTERVAL_BESIDE: Duration = Duration::from_millis(40);
/// What a SubDevice's share of the spare datagrams goes to.
#[derive(Debug)]
struct Lane {
    position: u16,
    station: u16,
    mailbox: Option<Mailbox>,
    /// Tag of the mailbox request in hand.
    tag: Option<u64>,
    register: Option<RegisterJob>,
    /// Its SDOs for SAFE-OP; has the mailbox while they are written.
    writer: Option<SafeOpWriter>,
    /// Its way back, where one was prepared; has the mailbox while it is under way.
    recovery: Option<Recovery>,
    /// Where it hangs, as far as that is known.
    parent: Option<u16>,
}

impl Lane {
    fn is_busy(&self) -> bool {
        self.tag.is_some() || self.register.is_some() || self.is_recovering() || self.has_to_write()
    }

    /// Whether SDOs for SAFE-OP are waiting or on their way.
    fn has_to_write(&self) -> bool {
        self.writer.as_ref().is_some_and(SafeOpWriter::is_due)
    }

    /// Its SDOs for SAFE-OP, while they are written.
    fn writing(&mut self) -> Option<&mut SafeOpWriter> {
        self.writer.as_mut().filter(|writer| writer.is_writing())
    }

    fn is_recovering(&self) -> bool {
        self.recovery.as_ref().is_some_and(Recovery::is_under_way)
    }

    /// Its way back, while it is under way.
    fn way_back(&mut self) -> Option<&mut Recovery> {
        self.recovery.as_mut().filter(|recovery| recovery.is_under_way())
    }
}

/// The queue, the work in hand, and what has ended.
#[derive(Debug)]
pub(super) struct Acyclic {
    lanes: Vec<Lane>,
    queue: VecDeque<AcyclicRequest>,
    finished: VecDeque<AcyclicCompletion>,
    recovered: VecDeque<(u16, Result<Comeback, RecoveryError>)>,
    /// The first SDO for SAFE-OP that couldn't be written.
    unwritten: Option<StartUpError>,
    /// Positions with work in hand, served in turn.
    active: VecDeque<u16>,
    /// Position whose datagram is in this cycle's frame.
    in_flight: Option<u16>,
    longest: usize,
    next_look: HostTime,
    next_look_at: usize,
}

impl Acyclic {
    pub fn new(stations: impl Iterator<Item = (u16, Option<Mailbox>)>, longest: usize) -> Self {
        let lanes: Vec<Lane> = stations
            .enumerate()
            .map(|(position, (station, mailbox))| Lane {
                position: position as u16,
                station,
                mailbox,
                tag: None,
                register: None,
                writer: None,
                recovery: None,
                parent: None,
            })
            .collect();
        Acyclic {
            active: VecDeque::with_capacity(lanes.len()),
            queue: VecDeque::with_capacity(CAPACITY),
            finished: VecDeque::with_capacity(CAPACITY),
            recovered: VecDeque::with_capacity(lanes.len()),
            unwritten: None,
            lanes,
            in_flight: None,
            longest,
            next_look: HostTime(0),
            next_look_at: 0,
        }
    }

    fn working(&self) -> usize {
        self.lanes_in_work() + self.queue.len() + self.finished.len()
    }

    fn lanes_in_work(&self) -> usize {
        self.active.iter().filter(|position| self.lanes[usize::from(**position)].is_busy()).count()
    }

    pub fn submit(&mut self, request: AcyclicRequest) -> Result<(), AcyclicRequest> {
        if self.working() >= CAPACITY {
            return Err(request);
        }
        self.queue.push_back(request);
        Ok(())
    }

    /// Makes ready what is done for one SubDevice alone.
    pub fn prepare(&mut self, subdevice: &SubDevice, turn: Turn) {
        if let Some(lane) = self.lanes.get_mut(usize::from(subdevice.position)) {
            lane.writer = SafeOpWriter::new(subdevice);
            lane.recovery = Some(Recovery::new(subdevice, turn));
            lane.parent = subdevice.parent.map(|parent| parent.position);
        }
    }

    /// Has the SDOs for SAFE-OP written, one SubDevice after the other: side by side they would wait for one another's
    /// datagrams, for longer than an answer may take where there are many.
    pub fn begin_writing(&mut self) {
        self.unwritten = None;
        self.lanes.iter_mut().filter_map(|lane| lane.writer.as_mut()).for_each(SafeOpWriter::ask);
        self.serve_next_writer();
    }

    fn serve_next_writer(&mut self) {
        if let Some(lane) = self.lanes.iter().find(|lane| lane.has_to_write())
            && !self.active.contains(&lane.position)
        {
            self.active.push_back(lane.position);
        }
    }

    /// What became of the SDOs for SAFE-OP; `None` while they are on their way.
    pub fn written(&mut self) -> Option<Result<(), StartUpError>> {
        if let Some(error) = self.unwritten.take() {
            self.end_writing();
            return Some(Err(error));
        }
        (!self.lanes.iter().any(Lane::has_to_write)).then_some(Ok(()))
    }

    /// No more SDOs for SAFE-OP are written: one that is on its way is given up.
    pub fn end_writing(&mut self) {
        for lane in &mut self.lanes {
            let Some(writer) = lane.writer.as_mut().filter(|writer| writer.is_due()) else { continue };
            // One that only waits has no mailbox to give back.
            lane.mailbox = writer.end().or(lane.mailbox.take());
        }
    }

    /// Begins the way back of a SubDevice; what its mailbox was doing ends as reset.
    pub fn recover(&mut self, position: u16) -> bool {
        // The ends of ways have their room from the start.
        let is_full = self.recovered.len() == self.lanes.len();
        let place = self.place(position);
        let Some(lane) = self.lanes.get_mut(usize::from(position)) else { return false };
        let is_free = !is_full && !lane.has_to_write();
        let Some(recovery) = lane.recovery.as_mut().filter(|one| is_free && !one.is_under_way()) else {
            return false;
        };
        let mut mailbox = lane.mailbox.take();
        if let Some(mailbox) = &mut mailbox {
            // Its counter goes on: the SubDevice may be in OP and answering.
            mailbox.cancel();
            if let (Some(tag), Some(done)) = (lane.tag.take(), mailbox.take_completion()) {
                let work = AcyclicWork::Mailbox(done.request);
                let result = done.result.map_err(AcyclicError::Mailbox);
                self.finished.push_back(AcyclicCompletion { tag, position, work, result });
            }
        }
        if let Some(job) = lane.register.take() {
            self.finished.push_back(job.complete());
        }
        recovery.begin(mailbox, place);
        // What waits for its mailbox was asked of the SubDevice as it was: nothing of that happens later by itself.
        for _ in 0..self.queue.len() {
            match self.queue.pop_front() {
                Some(request)
                    if request.position == position && matches!(request.work, AcyclicWork::Mailbox(_)) =>
                {
                    self.refuse(request, AcyclicError::Mailbox(MailboxError::Reset));
                }
                Some(request) => self.queue.push_back(request),
                None => {}
            }
        }
        if !self.active.contains(&position) {
            self.active.push_back(position);
        }
        true
    }

    /// Whether everybody up to `position` hangs in one line.
    fn place(&self, position: u16) -> Surroundings {
        let mut line = self.lanes.iter().take(usize::from(position) + 1).skip(1);
        let is_line = line.all(|lane| lane.parent.is_some_and(|parent| parent + 1 == lane.position));
        if is_line { Surroundings::InLine } else { Surroundings::Branched }
    }

    /// Ends the way back of a SubDevice that has changed nothing yet.
    pub fn call_off(&mut self, position: u16) -> bool {
        let Some(lane) = self.lanes.get_mut(usize::from(position)) else { return false };
        let Some(recovery) = lane.way_back() else { return false };
        let is_called_off = recovery.call_off();
        if is_called_off {
            lane.mailbox = recovery.take_mailbox();
        }
        is_called_off
    }

    /// Whether the clock of a SubDevice was set on the way back that it is on.
    pub fn has_time(&self, position: u16) -> bool {
        let lane = self.lanes.get(usize::from(position)).filter(|lane| lane.is_recovering());
        lane.and_then(|lane| lane.recovery.as_ref()).is_some_and(Recovery::has_time)
    }

    pub fn is_recovering(&self, position: u16) -> bool {
        self.lanes.get(usize::from(position)).is_some_and(Lane::is_recovering)
    }

    /// Who is just being set to the reference's time.
    pub fn setting_clock(&self) -> Option<u16> {
        let mut lanes = self.active.iter().map(|position| &self.lanes[usize::from(*position)]);
        lanes
            .find(|lane| lane.recovery.as_ref().is_some_and(|recovery| recovery.is_setting_clock()))
            .map(|lane| lane.position)
    }

    pub fn poll_recovered(&mut self) -> Option<(u16, Result<Comeback, RecoveryError>)> {
        self.recovered.pop_front()
    }

    pub fn poll(&mut self) -> Option<AcyclicCompletion> {
        self.finished.pop_front()
    }

    pub fn take_emergency(&mut self) -> Option<(u16, ReceivedEmergency)> {
        self.lanes.iter_mut().find_map(|lane| {
            let emergency = lane.mailbox.as_mut()?.emergencies().take()?;
            Some((lane.position, emergency))
        })
    }

    pub fn mailbox(&self, position: u16) -> Option<&Mailbox> {
        self.lanes.get(usize::from(position))?.mailbox.as_ref()
    }

    /// Gives the mailboxes back, each with its message counter.
    pub fn into_mailboxes(self) -> impl Iterator<Item = Option<Mailbox>> {
        let mailbox = |mut lane: Lane| {
            let on_the_way = lane.recovery.as_mut().and_then(Recovery::take_mailbox);
            lane.mailbox.or(on_the_way).or_else(|| lane.writer.as_mut()?.end())
        };
        self.lanes.into_iter().map(mailbox)
    }

    fn refuse(&mut self, request: AcyclicRequest, error: AcyclicError) {
        let AcyclicRequest { tag, position, work } = request;
        self.finished.push_back(AcyclicCompletion { tag, position, work, result: Err(error) });
    }

    /// Starts what is queued and whose SubDevice is free, in the order of the queue.
    #[cold]
    fn start_queued(&mut self, now: HostTime) {
        for _ in 0..self.queue.len() {
            let Some(request) = self.queue.pop_front() else { return };
            let position = request.position;
            let Some(lane) = self.lanes.get_mut(usize::from(position)) else {
                self.refuse(request, AcyclicError::NoSubDevice { position });
                continue;
            };
            if lane.is_busy() || lane.mailbox.as_ref().is_some_and(Mailbox::is_busy) {
                self.queue.push_back(request);
                continue;
            }
            let known = self.active.contains(&position);
            match request.work {
                AcyclicWork::Mailbox(work) => {
                    let Some(mailbox) = &mut lane.mailbox else {
                        let request = AcyclicRequest { work: AcyclicWork::Mailbox(work), ..request };
                        self.refuse(request, AcyclicError::NoMailbox { position });
                        continue;
                    };
                    if let Err(work) = mailbox.start(work, now) {
                        let request = AcyclicRequest { work: AcyclicWork::Mailbox(work), ..request };
                        self.queue.push_back(request);
                        continue;
                    }
                    lane.tag = Some(request.tag);
                }
                AcyclicWork::Registers { way, register, data } => {
                    let (found, limit) = (data.len(), self.longest);
                    if found > limit {
                        let work = AcyclicWork::Registers { way, register, data };
                        let request = AcyclicRequest { work, ..request };
                        self.refuse(request, AcyclicError::TooLong { found, limit });
                        continue;
                    }
                    lane.register = Some(RegisterJob {
                        tag: request.tag,
                        position,
                        way,
                        register,
                        data,
                        deadline: now + register_job::TIMEOUT,
                        found: Found::Nothing,
                        done: false,
                    });
                }
            }
            if !known {
                self.active.push_back(position);
            }
        }
    }

    fn look_around(&mut self, now: HostTime) {
        let is_beside = self.active.iter().any(|position| self.lanes[usize::from(*position)].is_recovering());
        self.next_look = now + if is_beside { LOOK_INTERVAL_BESIDE } else { LOOK_INTERVAL };
        for _ in 0..self.lanes.len() {
            let at = self.next_look_at;
            self.next_look_at = (at + 1) % self.lanes.len();
            let lane = &mut self.lanes[at];
            let busy = lane.is_busy();
            let Some(mailbox) = &mut lane.mailbox else { continue };
            if !busy && !mailbox.is_busy() {
                mailbox.look();
                if !self.active.contains(&lane.position) {
                    self.active.push_back(lane.position);
                }
                return;
            }
        }
    }

    /// The datagram that goes into this cycle's frame.
    #[inline]
    pub fn next(&mut self, now: HostTime) -> Option<DatagramRequest> {
        if self.queue.is_empty() && self.active.is_empty() && now < self.next_look {
            return None;
        }
        self.choose(now)
    }

    #[cold]
    fn choose(&mut self, now: HostTime) -> Option<DatagramRequest> {
        if !self.queue.is_empty() {
            self.start_queued(now);
        }
        if now >= self.next_look {
            self.look_around(now);
        }
        for _ in 0..self.active.len() {
            let position = self.active.pop_front()?;
            let (request, keep) = self.serve(position, now);
            if keep {
                self.active.push_back(position);
            }
            if request.is_some() {
                self.in_flight = Some(position);
                return request;
            }
        }
        None
    }

    /// What the SubDevice at `position` wants now, and whether it has work left.
    fn serve(&mut self, position: u16, now: HostTime) -> (Option<DatagramRequest>, bool) {
        let lane = &mut self.lanes[usize::from(position)];
        if let Some(recovery) = lane.way_back() {
            match recovery.next(now) {
                Next::Send(request) => return (Some(request), true),
                Next::WaitUntil(_) => return (None, true),
                Next::Done(result) => {
                    lane.mailbox = recovery.take_mailbox();
                    self.recovered.push_back((position, result));
                    return (None, lane.has_to_write());
                }
            }
        }
        if let Some(writer) = &mut lane.writer {
            // What its mailbox has in hand comes first.
            let is_free = lane.tag.is_none() && lane.register.is_none();
            if is_free && writer.is_due() && !writer.is_writing() {
                writer.begin(lane.mailbox.take());
            }
            if writer.is_writing() {
                match writer.next(now) {
                    Next::Send(request) => return (Some(request), true),
                    Next::WaitUntil(_) => return (None, true),
                    Next::Done(result) => {
                        lane.mailbox = writer.end();
                        self.unwritten = self.unwritten.take().or(result.err());
                        self.serve_next_writer();
                        return (None, false);
                    }
                }
            }
        }
        if let Some(job) = &lane.register {
            if !job.done && now < job.deadline {
                return (Some(job.datagram(lane.station)), true);
            }
            if let Some(job) = lane.register.take() {
                self.finished.push_back(job.complete());
            }
        }
        let lane = &mut self.lanes[usize::from(position)];
        let has_to_write = lane.has_to_write();
        let Some(mailbox) = &mut lane.mailbox else { return (None, has_to_write) };
        match mailbox.next(now) {
            Next::Send(request) => (Some(request), true),
            Next::WaitUntil(_) => (None, true),
            Next::Done(None) => (None, has_to_write),
            Next::Done(Some(completion)) => {
                let completion = AcyclicCompletion {
                    tag: lane.tag.take().unwrap_or_default(),
                    position,
                    work: AcyclicWork::Mailbox(completion.request),
                    result: completion.result.map_err(AcyclicError::Mailbox),
                };
                self.finished.push_back(completion);
                (None, has_to_write)
            }
        }
    }

    /// Whether a datagram is in this cycle's frame.
    pub fn is_waiting(&self) -> bool {
        self.in_flight.is_some()
    }

    /// Writes the data of the datagram that [`Acyclic::next`] asked for.
    pub fn fill(&self, data: &mut [u8]) {
        let Some(lane) = self.in_flight.and_then(|position| self.lanes.get(usize::from(position))) else {
            return;
        };
        if let Some(recovery) = lane.recovery.as_ref().filter(|recovery| recovery.is_under_way()) {
            return recovery.fill(data);
        }
        if let Some(writer) = lane.writer.as_ref().filter(|writer| writer.is_writing()) {
            return writer.fill(data);
        }
        match (&lane.register, &lane.mailbox) {
            (Some(job), _) => job.fill(data),
            (None, Some(mailbox)) => mailbox.fill(data),
            (None, None) => {}
        }
    }

    /// Takes the answer to the datagram that was in this cycle's frame.
    pub fn answer(&mut self, answer: Answer<'_>, seen: Observed, now: HostTime) {
        let Some(lane) = self.in_flight.take().and_then(|position| self.lanes.get_mut(usize::from(position)))
        else {
            return;
        };
        if let Some(recovery) = lane.way_back() {
            recovery.set_seen(seen);
            return recovery.answer(answer, now);
        }
        if let Some(writer) = lane.writing() {
            return writer.answer(answer, now);
        }
        match (&mut lane.register, &mut lane.mailbox) {
            (Some(job), _) => job.answer(answer),
            (None, Some(mailbox)) => mailbox.answer(answer, now),
            (None, None) => {}
        }
    }
}
