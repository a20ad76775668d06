//! In which cycles each SubDevice's process data go: slow ones each n-th, spread so that few go in the same one.

use alloc::collections::BTreeMap;
use alloc::vec;
use alloc::vec::Vec;

use super::Member;
use crate::subdevice::Direction;

/// In which cycles a frame goes: in those whose number leaves `phase` when divided by `every`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Turn {
    /// From one to the next, cycles; at least 1.
    pub every: u16,
    /// Below `every`.
    pub phase: u16,
}

impl Default for Turn {
    fn default() -> Self {
        Turn::EACH_CYCLE
    }
}

impl Turn {
    /// In every cycle.
    pub const EACH_CYCLE: Turn = Turn { every: 1, phase: 0 };

    /// Whether it goes in the cycle of this number.
    #[inline]
    pub fn is_due(self, cycle: u64) -> bool {
        self.every == 1 || self.until_due(cycle) == 0
    }

    /// Cycles from the one of this number until it goes; 0 where it goes in it.
    pub fn until_due(self, cycle: u64) -> u64 {
        let every = u64::from(self.every.max(1));
        (u64::from(self.phase) + every - cycle % every) % every
    }

    /// Whether there is a cycle in which both go.
    pub fn meets(self, other: Turn) -> bool {
        let common = greatest_common_divisor(self.every, other.every);
        self.phase % common == other.phase % common
    }
}

fn greatest_common_divisor(a: u16, b: u16) -> u16 {
    if b == 0 { a.max(1) } else { greatest_common_divisor(b, a % b) }
}

/// The turn of each member, by position. One after the other takes the phase in whose cycles fewest bytes go already.
pub(super) fn spread(members: &[Member]) -> Vec<Turn> {
    let is_slow = |member: &&Member| member.every.cycles() > 1 && !member.areas.is_empty();
    let rates = members.iter().filter(is_slow).map(|member| member.every.cycles());
    // Bytes that go in the worst of all cycles that a phase of this rate has.
    let mut loads: BTreeMap<u16, Vec<u32>> =
        rates.map(|every| (every, vec![0; usize::from(every)])).collect();
    let mut turns = vec![Turn::EACH_CYCLE; members.len()];
    for (member, turn) in members.iter().zip(&mut turns).filter(|(member, _)| is_slow(member)) {
        let every = member.every.cycles();
        let least = loads.get(&every).and_then(|load| (0..every).zip(load).min_by_key(|(_, bytes)| **bytes));
        turn.every = every;
        turn.phase = least.map_or(0, |(phase, _)| phase);
        let bytes = 1 + member.byte_length(Direction::Outputs) + member.byte_length(Direction::Inputs);
        for (&every, load) in &mut loads {
            for (phase, load) in (0..every).zip(load) {
                *load += if turn.meets(Turn { every, phase }) { bytes } else { 0 };
            }
        }
    }
    turns
}
