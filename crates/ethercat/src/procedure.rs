//! A protocol step that takes several datagrams, written without a link or a clock in it.
//!
//! The set-up drives many procedures at once and packs their datagrams into few frames; the cycle drives one in
//! its spare datagram. Neither knows what a procedure is about.

use crate::found::Found;
use crate::wire::{Address, Command, HostTime};

/// One datagram that a procedure wants sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DatagramRequest {
    /// What is asked.
    pub command: Command,
    /// Of whom.
    pub address: Address,
    /// Bytes of data.
    pub length: usize,
}

impl DatagramRequest {
    /// A read of `length` bytes at `register` of a SubDevice by its station address.
    pub fn read(station: u16, register: u16, length: usize) -> Self {
        DatagramRequest { command: Command::Fprd, address: Address::station(station, register), length }
    }

    /// A write of `length` bytes at `register` of a SubDevice by its station address.
    pub fn write(station: u16, register: u16, length: usize) -> Self {
        DatagramRequest { command: Command::Fpwr, address: Address::station(station, register), length }
    }
}

/// What a procedure wants next.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Next<T> {
    /// Send this datagram, then give its answer. Asking again before that gives the same request.
    Send(DatagramRequest),
    /// Nothing before this instant.
    WaitUntil(HostTime),
    /// It is over.
    Done(T),
}

/// What became of a datagram.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer<'a> {
    /// The frame did not come back in time; nobody knows whether the SubDevice saw it.
    Lost,
    /// The frame came back.
    Returned {
        /// Working counter; 0 means that no SubDevice took part.
        working_counter: u16,
        /// The datagram's data.
        data: &'a [u8],
    },
}

impl<'a> Answer<'a> {
    /// The data, where the working counter is `expected`; else what came instead.
    pub fn data(self, expected: u16) -> Result<&'a [u8], Found> {
        match self {
            Answer::Returned { working_counter, data } if working_counter == expected => Ok(data),
            Answer::Returned { working_counter, .. } => Err(Found::WorkingCounter(working_counter)),
            Answer::Lost => Err(Found::Nothing),
        }
    }
}

/// A protocol as a state machine: asked for datagrams, given their answers, never waiting itself.
pub trait Procedure {
    /// What it ends with, usually a `Result`.
    type Output;

    /// What to do at `now`. Every wait in here has a deadline, so that this reaches [`Next::Done`] whatever the
    /// answers are.
    fn next(&mut self, now: HostTime) -> Next<Self::Output>;

    /// Writes the data of the request that [`Procedure::next`] asked for; `data` has its length and is zero.
    fn fill(&self, data: &mut [u8]);

    /// Takes the answer to the request that [`Procedure::next`] asked for last.
    fn answer(&mut self, answer: Answer<'_>, now: HostTime);
}
