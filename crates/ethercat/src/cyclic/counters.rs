//! What the cycle counts.

use crate::wire::Command;

/// A set of commands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CommandSet(u16);

impl CommandSet {
    /// Adds a command.
    pub fn add(&mut self, command: Command) {
        self.0 |= 1 << command.code();
    }

    /// Both sets together.
    pub fn union(self, other: CommandSet) -> CommandSet {
        CommandSet(self.0 | other.0)
    }

    /// Whether `command` is in it.
    pub fn contains(self, command: Command) -> bool {
        self.0 & 1 << command.code() != 0
    }

    /// The commands, by rising code.
    pub fn iter(self) -> impl Iterator<Item = Command> {
        Command::ALL.into_iter().filter(move |command| self.contains(*command))
    }
}

/// One datagram of process data, and how often its working counter was wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DatagramCount {
    /// Frame of the cycle, from 0.
    pub frame: u16,
    /// Datagram in that frame, from 0.
    pub datagram: u16,
    /// Its command.
    pub command: Command,
    /// Working counter that it should have.
    pub expected: u16,
    /// Exchanges in which it came back with another.
    pub short_counts: u64,
}

/// Figures of all cycles so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CycleCounters {
    /// Exchanges.
    pub cycles: u64,
    /// Frames sent.
    pub frames_sent: u64,
    /// Frames that weren't back at their deadline.
    pub frames_lost: u64,
    /// Frames of an earlier cycle that came after their deadline; dropped.
    pub late: u64,
    /// Frames that came back shorter than they were sent; dropped.
    pub short: u64,
    /// Frames that came twice; dropped.
    pub duplicate: u64,
    /// Frames that this bus never sent, or that no SubDevice processed; dropped.
    pub foreign: u64,
    /// Cycles in which a working counter of process data wasn't the expected one.
    pub working_counter_errors: u64,
}
