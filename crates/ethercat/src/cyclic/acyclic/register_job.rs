//! A register access beside the cycle.

use alloc::vec::Vec;
use core::time::Duration;

use super::request::{AcyclicCompletion, AcyclicError, AcyclicWork, RegisterAccess};
use crate::found::Found;
use crate::procedure::{Answer, DatagramRequest};
use crate::wire::{Address, Command, HostTime};

/// How long it is repeated.
pub(super) const TIMEOUT: Duration = Duration::from_millis(500);

/// A register access in work.
#[derive(Clone, Debug)]
pub(super) struct RegisterJob {
    pub(super) tag: u64,
    pub(super) position: u16,
    pub(super) way: RegisterAccess,
    pub(super) register: u16,
    pub(super) data: Vec<u8>,
    pub(super) deadline: HostTime,
    pub(super) found: Found,
    pub(super) done: bool,
}

impl RegisterJob {
    pub(super) fn datagram(&self, station: u16) -> DatagramRequest {
        match self.way {
            RegisterAccess::Read => DatagramRequest::read(station, self.register, self.data.len()),
            RegisterAccess::Write => DatagramRequest::write(station, self.register, self.data.len()),
            RegisterAccess::ReadAll => self.to_all(Command::Brd),
            RegisterAccess::WriteAll => self.to_all(Command::Bwr),
        }
    }

    fn to_all(&self, command: Command) -> DatagramRequest {
        DatagramRequest { command, address: Address::broadcast(self.register), length: self.data.len() }
    }

    pub(super) fn fill(&self, out: &mut [u8]) {
        let writes = matches!(self.way, RegisterAccess::Write | RegisterAccess::WriteAll);
        if writes && self.data.len() == out.len() {
            out.copy_from_slice(&self.data);
        }
    }

    pub(super) fn answer(&mut self, answer: Answer<'_>) {
        let Answer::Returned { working_counter, data } = answer else { return };
        self.found = Found::WorkingCounter(working_counter);
        let (reads, is_taken) = match self.way {
            RegisterAccess::Read => (true, working_counter == 1),
            RegisterAccess::Write => (false, working_counter == 1),
            // How many answer is for others to judge.
            RegisterAccess::ReadAll => (true, working_counter > 0),
            RegisterAccess::WriteAll => (false, working_counter > 0),
        };
        if !is_taken {
            return;
        }
        self.done = true;
        if reads && self.data.len() == data.len() {
            self.data.copy_from_slice(data);
        }
    }

    pub(super) fn complete(self) -> AcyclicCompletion {
        let RegisterJob { tag, position, way, register, data, found, .. } = self;
        let result =
            if self.done { Ok(()) } else { Err(AcyclicError::Register { register, found, after: TIMEOUT }) };
        AcyclicCompletion { tag, position, work: AcyclicWork::Registers { way, register, data }, result }
    }
}
