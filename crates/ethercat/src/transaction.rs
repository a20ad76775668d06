//! The set-up's exchange: datagrams packed into frames, sent, matched, retried, their working counters checked.

use alloc::vec::Vec;
use core::time::Duration;

use crate::error::SetUpError;
pub use crate::found::Target;
use crate::found::{AccessError, Found};
use crate::procedure::{Answer, DatagramRequest, Next, Procedure};
use crate::wire::frame::{self, Datagram, Datagrams, FrameBuilder};
use crate::wire::{Address, Clock, Command, Link, LinkError};

/// Frames on their way at once; more would overrun small receive queues.
const WINDOW: usize = 16;
/// Frames that match nothing, after which an exchange gives up listening: a babbling neighbour must not hang it.
const STRAY_LIMIT: u32 = 4096;

/// How long and how often the set-up tries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TransactionOptions {
    /// The longest wait for a frame to come back.
    pub frame_timeout: Duration,
    /// Attempts after the first.
    pub retries: u32,
    /// Pause before an attempt is repeated.
    pub retry_pause: Duration,
}

impl Default for TransactionOptions {
    fn default() -> Self {
        TransactionOptions {
            frame_timeout: Duration::from_millis(20),
            retries: 3,
            retry_pause: Duration::from_millis(1),
        }
    }
}

/// What went over the cable during set-up, and what went wrong there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TransactionCounters {
    /// Frames sent.
    pub frames_sent: u64,
    /// Frames that came back and matched.
    pub frames_received: u64,
    /// Frames that did not come back in time.
    pub frames_lost: u64,
    /// Accesses repeated after a lost frame or a wrong working counter.
    pub retries: u64,
    /// Own frames that came back exactly as they were sent: no SubDevice saw them.
    pub reflected: u64,
    /// EtherCAT frames from another MainDevice.
    pub foreign: u64,
    /// Late, repeated or damaged frames, and frames of other protocols.
    pub unmatched: u64,
}

/// The working counter that an access must have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Expect {
    /// This one.
    Exactly(u16),
    /// This one or more: registers that only some controllers implement.
    AtLeast(u16),
    /// Whatever; only a lost frame is repeated.
    Any,
}

impl Expect {
    fn accepts(self, working_counter: u16) -> bool {
        match self {
            Expect::Exactly(expected) => working_counter == expected,
            Expect::AtLeast(expected) => working_counter >= expected,
            Expect::Any => true,
        }
    }

    fn value(self) -> u16 {
        match self {
            Expect::Exactly(expected) | Expect::AtLeast(expected) => expected,
            Expect::Any => 0,
        }
    }
}

/// One checked access to registers.
#[derive(Clone, Debug)]
pub struct Access {
    /// What is accessed, for messages.
    pub what: &'static str,
    /// The SubDevice; `None` for all.
    pub position: Option<u16>,
    /// Command and address.
    pub command: Command,
    /// Whom and where.
    pub address: Address,
    /// Data to send; after success the data that came back.
    pub data: Vec<u8>,
    /// The working counter that it must have.
    pub expect: Expect,
    /// What came back.
    pub found: Found,
}

impl Access {
    /// A write to all SubDevices.
    pub fn broadcast_write(what: &'static str, register: u16, data: &[u8], expect: Expect) -> Self {
        Access {
            what,
            position: None,
            command: Command::Bwr,
            address: Address::broadcast(register),
            data: data.to_vec(),
            expect,
            found: Found::Nothing,
        }
    }

    /// A read from all SubDevices, ORed together.
    pub fn broadcast_read(what: &'static str, register: u16, length: usize, expect: Expect) -> Self {
        let mut access = Self::broadcast_write(what, register, &[], expect);
        access.command = Command::Brd;
        access.data.resize(length, 0);
        access
    }

    /// A read by position, before there is a station address.
    pub fn read_at(what: &'static str, position: u16, register: u16, length: usize) -> Self {
        let mut access = Self::write_at(what, position, register, &[]);
        access.command = Command::Aprd;
        access.data.resize(length, 0);
        access
    }

    /// A write by position, before there is a station address.
    pub fn write_at(what: &'static str, position: u16, register: u16, data: &[u8]) -> Self {
        Access {
            what,
            position: Some(position),
            command: Command::Apwr,
            address: Address::position(position, register),
            data: data.to_vec(),
            expect: Expect::Exactly(1),
            found: Found::Nothing,
        }
    }

    /// A read by station address; `station` belongs to the SubDevice at `position`.
    pub fn read(what: &'static str, target: Target, register: u16, length: usize) -> Self {
        let mut access = Self::write(what, target, register, &[]);
        access.command = Command::Fprd;
        access.data.resize(length, 0);
        access
    }

    /// A write by station address.
    pub fn write(what: &'static str, target: Target, register: u16, data: &[u8]) -> Self {
        Access {
            what,
            position: Some(target.position),
            command: Command::Fpwr,
            address: Address::station(target.station, register),
            data: data.to_vec(),
            expect: Expect::Exactly(1),
            found: Found::Nothing,
        }
    }

    fn request(&self) -> DatagramRequest {
        DatagramRequest { command: self.command, address: self.address, length: self.data.len() }
    }

    fn succeeded(&self) -> bool {
        matches!(self.found, Found::WorkingCounter(found) if self.expect.accepts(found))
    }

    fn error(&self, attempts: u32) -> AccessError {
        AccessError {
            what: self.what,
            position: self.position,
            command: self.command,
            address: self.address,
            expected: self.expect.value(),
            found: self.found,
            attempts,
        }
    }
}

/// A frame on its way: the requests `first..end` of the batch.
struct InFlight {
    frame: FrameBuilder,
    first: usize,
    end: usize,
    answered: bool,
}

/// The link, the clock, and the exchange of datagrams over them.
#[derive(Debug)]
pub struct Transactor<L, C> {
    /// The link.
    pub link: L,
    /// The clock.
    pub clock: C,
    /// How long and how often it tries.
    pub options: TransactionOptions,
    /// What went over the cable so far.
    pub counters: TransactionCounters,
    next_index: u8,
}

impl<L: Link, C: Clock> Transactor<L, C> {
    /// An exchange over `link`, timed by `clock`.
    pub fn new(link: L, clock: C, options: TransactionOptions) -> Self {
        Transactor { link, clock, options, counters: TransactionCounters::default(), next_index: 0 }
    }

    /// Sends every request once, its data written by `fill(number, data)`; gives each answer to
    /// `answer(number, answer)`, in any order, lost ones last.
    pub fn exchange(
        &mut self,
        requests: &[DatagramRequest],
        fill: &mut dyn FnMut(usize, &mut [u8]),
        answer: &mut dyn FnMut(usize, Answer<'_>),
    ) -> Result<(), LinkError> {
        let mut next = 0;
        while next < requests.len() {
            let mut window = Vec::new();
            while next < requests.len() && window.len() < WINDOW {
                let mut in_flight =
                    InFlight { frame: FrameBuilder::new(), first: next, end: next, answered: false };
                let index = self.next_index;
                self.next_index = self.next_index.wrapping_add(1);
                while let Some(request) = requests.get(in_flight.end) {
                    let frame = &mut in_flight.frame;
                    let Ok(offset) =
                        frame.push_zeros(request.command, index, request.address, request.length)
                    else {
                        break;
                    };
                    let data_at = offset + frame::DATAGRAM_HEADER;
                    fill(in_flight.end, &mut frame.bytes_mut()[data_at..data_at + request.length]);
                    in_flight.end += 1;
                }
                if in_flight.end == in_flight.first {
                    // Larger than any frame: nobody can answer it.
                    answer(next, Answer::Lost);
                    next += 1;
                    continue;
                }
                next = in_flight.end;
                self.link.send(in_flight.frame.bytes())?;
                self.counters.frames_sent += 1;
                window.push(in_flight);
            }
            self.collect(&mut window, answer)?;
        }
        Ok(())
    }

    /// Receives until every frame of `window` was answered or the time is up.
    fn collect(
        &mut self,
        window: &mut [InFlight],
        answer: &mut dyn FnMut(usize, Answer<'_>),
    ) -> Result<(), LinkError> {
        let deadline = self.clock.now() + self.options.frame_timeout;
        let mut buffer = [0; frame::MAX_FRAME + 32];
        let mut strays = 0;
        while window.iter().any(|in_flight| !in_flight.answered) && strays < STRAY_LIMIT {
            let Some(length) = self.link.receive(&mut buffer, deadline)? else {
                // A link may be early; waits elsewhere count on time having passed.
                self.clock.sleep_until(deadline);
                break;
            };
            let received = &buffer[..length.min(buffer.len())];
            match matching(window, received) {
                Match::Answer(number) => {
                    let in_flight = &mut window[number];
                    in_flight.answered = true;
                    self.counters.frames_received += 1;
                    for (number, datagram) in (in_flight.first..).zip(read_all(received)) {
                        let (data, working_counter) = (datagram.data, datagram.working_counter);
                        answer(number, Answer::Returned { working_counter, data });
                    }
                }
                Match::Reflected => self.counters.reflected += 1,
                Match::Foreign => self.counters.foreign += 1,
                Match::Nothing => self.counters.unmatched += 1,
            }
            strays += 1;
        }
        for in_flight in window.iter().filter(|in_flight| !in_flight.answered) {
            self.counters.frames_lost += 1;
            for number in in_flight.first..in_flight.end {
                answer(number, Answer::Lost);
            }
        }
        Ok(())
    }

    /// Performs all accesses, repeating those that were lost or had a wrong working counter.
    pub fn perform(&mut self, accesses: &mut [Access]) -> Result<(), SetUpError> {
        let mut pending: Vec<usize> = (0..accesses.len()).collect();
        for attempt in 0..=self.options.retries {
            if attempt > 0 {
                self.counters.retries += pending.len() as u64;
                self.pause(self.options.retry_pause);
            }
            let requests: Vec<DatagramRequest> =
                pending.iter().map(|&number| accesses[number].request()).collect();
            let mut answers: Vec<(usize, u16, Vec<u8>)> = Vec::with_capacity(pending.len());
            self.exchange(
                &requests,
                &mut |number, data| data.copy_from_slice(&accesses[pending[number]].data),
                &mut |number, answer| {
                    if let Answer::Returned { working_counter, data } = answer {
                        answers.push((pending[number], working_counter, data.to_vec()));
                    }
                },
            )?;
            for (number, working_counter, data) in answers {
                let access = &mut accesses[number];
                access.found = Found::WorkingCounter(working_counter);
                if access.succeeded() {
                    access.data = data;
                }
            }
            pending.retain(|&number| !accesses[number].succeeded());
            if pending.is_empty() {
                return Ok(());
            }
        }
        Err(accesses[pending[0]].error(self.options.retries + 1).into())
    }

    /// Performs one access and gives the data that came back.
    pub fn perform_one(&mut self, access: Access) -> Result<Access, SetUpError> {
        let mut accesses = [access];
        self.perform(&mut accesses)?;
        let [access] = accesses;
        Ok(access)
    }

    /// Runs all procedures side by side, their datagrams sharing frames, until each is done; their outputs in
    /// the same order.
    pub fn drive<P: Procedure>(&mut self, procedures: &mut [P]) -> Result<Vec<P::Output>, LinkError> {
        let mut outputs: Vec<Option<P::Output>> = procedures.iter().map(|_| None).collect();
        loop {
            let now = self.clock.now();
            let mut requests = Vec::new();
            let mut asking = Vec::new();
            let mut earliest = None;
            for (number, procedure) in procedures.iter_mut().enumerate() {
                if outputs[number].is_some() {
                    continue;
                }
                match procedure.next(now) {
                    Next::Send(request) => {
                        requests.push(request);
                        asking.push(number);
                    }
                    Next::WaitUntil(instant) => {
                        earliest = Some(earliest.map_or(instant, |other| instant.min(other)));
                    }
                    Next::Done(output) => outputs[number] = Some(output),
                }
            }
            if requests.is_empty() {
                match earliest {
                    Some(instant) => self.clock.sleep_until(instant),
                    None => return Ok(outputs.into_iter().flatten().collect()),
                }
                continue;
            }
            let mut answers: Vec<Option<(u16, Vec<u8>)>> = requests.iter().map(|_| None).collect();
            self.exchange(
                &requests,
                &mut |number, data| procedures[asking[number]].fill(data),
                &mut |number, answer| {
                    if let Answer::Returned { working_counter, data } = answer {
                        answers[number] = Some((working_counter, data.to_vec()));
                    }
                },
            )?;
            let now = self.clock.now();
            for (&number, answer) in asking.iter().zip(&answers) {
                let answer = match answer {
                    Some((working_counter, data)) => {
                        Answer::Returned { working_counter: *working_counter, data }
                    }
                    None => Answer::Lost,
                };
                procedures[number].answer(answer, now);
            }
        }
    }

    /// Waits.
    pub fn pause(&mut self, duration: Duration) {
        let until = self.clock.now() + duration;
        self.clock.sleep_until(until);
    }
}

/// What a received frame is.
enum Match {
    /// The answer to this frame of the window.
    Answer(usize),
    /// An own frame, unchanged.
    Reflected,
    /// Another MainDevice's.
    Foreign,
    /// Late, repeated, damaged, or another protocol.
    Nothing,
}

/// The datagrams of a frame that was checked already.
fn read_all(bytes: &[u8]) -> impl Iterator<Item = Datagram<'_>> {
    Datagrams::new(bytes).into_iter().flatten().map_while(Result::ok)
}

fn matching(window: &[InFlight], received: &[u8]) -> Match {
    let Ok(mut datagrams) = Datagrams::new(received) else {
        return Match::Nothing;
    };
    let mut source = [0; 6];
    source.copy_from_slice(&received[6..12]);
    source[0] &= !frame::PROCESSED_BIT;
    if source != frame::MAIN_DEVICE_MAC {
        return Match::Foreign;
    }
    if datagrams.any(|datagram| datagram.is_err()) {
        return Match::Nothing;
    }
    for (number, in_flight) in window.iter().enumerate() {
        let sent = in_flight.frame.bytes();
        if !same_datagrams(sent, received) {
            continue;
        }
        if received.get(..sent.len()) == Some(sent) {
            return Match::Reflected;
        }
        return if in_flight.answered { Match::Nothing } else { Match::Answer(number) };
    }
    Match::Nothing
}

/// Whether both frames hold the same datagrams by index, command, address and length.
fn same_datagrams(sent: &[u8], received: &[u8]) -> bool {
    let (mut sent, mut received) = (read_all(sent), read_all(received));
    loop {
        match (sent.next(), received.next()) {
            (None, None) => return true,
            (Some(sent), Some(received)) if same_header(&sent, &received) => {}
            _ => return false,
        }
    }
}

fn same_header(sent: &Datagram<'_>, received: &Datagram<'_>) -> bool {
    let (sent, received) = (&sent.header, &received.header);
    // SubDevices count in the lower half of position and broadcast addresses; the register stays.
    let fixed = match sent.target() {
        Some(Address::Position { .. } | Address::Broadcast { .. }) => 0xFFFF_0000,
        _ => u32::MAX,
    };
    sent.command == received.command
        && sent.index == received.index
        && sent.length == received.length
        && sent.address & fixed == received.address & fixed
}

#[cfg(test)]
mod tests;
