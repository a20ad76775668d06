//! Whose pauses cost cycles: this program's, or those of whoever answers.
//!
//! A cycle that begins late, or that comes back long behind its deadline, was held up on this side: the thread that keeps
//! the times got no CPU. One that began in time and whose frames didn't come back by its deadline was held up, or lost, on
//! the other side: a simulator that got no CPU, a cable, a SubDevice.

use std::io::{self, Write};
use std::time::Duration;

use omnibase_ethercat::paced::Times;
use omnibase_ethercat::wire::spoken;
use serde::Serialize;

/// One side's pauses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Side {
    /// How many.
    pub pauses: u64,
    /// The longest, ns.
    pub longest_ns: u64,
}

impl Side {
    fn take(&mut self, length_ns: u64) {
        self.pauses += 1;
        self.longest_ns = self.longest_ns.max(length_ns);
    }
}

/// Collects pauses cycle by cycle; no allocation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Pauses {
    #[serde(skip)]
    cycle_ns: u64,
    #[serde(skip)]
    timeout_ns: u64,
    /// This program's.
    pub own: Side,
    /// Those of the other side, while this program was in time.
    pub other: Side,
    /// How long nothing has come back by now, ns.
    #[serde(skip)]
    silent_ns: u64,
}

impl Pauses {
    /// Nothing seen yet, of cycles of this length whose frames are awaited so long.
    pub fn new(cycle: Duration, timeout: Duration) -> Self {
        let ns = |duration: Duration| duration.as_nanos() as u64;
        Pauses {
            cycle_ns: ns(cycle),
            timeout_ns: ns(timeout),
            own: Side::default(),
            other: Side::default(),
            silent_ns: 0,
        }
    }

    /// Takes a cycle; `is_lost`: frames of it weren't back at its deadline.
    pub fn take(&mut self, times: &Times, is_lost: bool) {
        // What a deadline is overrun by is this side's own.
        let overrun_ns = times.round_trip_ns.saturating_sub(self.timeout_ns);
        let own_ns = times.late_ns.max(overrun_ns);
        if own_ns > self.cycle_ns / 2 {
            self.own.take(own_ns);
        }
        if is_lost && own_ns <= self.cycle_ns / 2 {
            self.silent_ns += self.cycle_ns * times.periods.max(1);
        } else if self.silent_ns > 0 {
            // A silence without an end is no pause.
            self.other.take(std::mem::take(&mut self.silent_ns));
        }
    }

    /// Whose they were and what to do, a line each; none where there were none.
    pub fn words(&self) -> Vec<String> {
        let cycle_us = self.cycle_ns / 1000;
        let mut lines = Vec::new();
        if self.own.pauses > 0 {
            lines.push(format!(
                "this program was paused {} times, up to {}: it got no CPU. Ask for real time (--realtime) where \
                 that isn't done yet, and let `omnibase doctor` measure this machine's pauses",
                self.own.pauses,
                spoken(Duration::from_nanos(self.own.longest_ns))
            ));
        }
        if self.other.pauses > 0 {
            let needed = self.other.longest_ns.div_ceil(self.cycle_ns.max(1));
            lines.push(format!(
                "the other side was silent {} times, up to {}, while this program was in time: frames were lost, or who \
                 answers was paused, as a simulator on a virtual machine is (its own summary says how long). Where the \
                 machine can't do better, take a longer cycle than {cycle_us} us, or tolerate {needed} lost exchanges \
                 ([safety] lost_exchanges_tolerated)",
                self.other.pauses,
                spoken(Duration::from_nanos(self.other.longest_ns))
            ));
        }
        lines
    }

    /// The lines of [`Pauses::words`] below a summary.
    pub fn print(&self, output: &mut dyn Write) -> io::Result<()> {
        self.words().iter().try_for_each(|line| writeln!(output, "pauses                  {line}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(late_us: u64, round_trip_us: u64) -> Times {
        Times { periods: 1, late_ns: late_us * 1000, round_trip_ns: round_trip_us * 1000, ..Times::default() }
    }

    #[test]
    fn a_pause_is_told_of_the_side_that_had_it() {
        let mut pauses = Pauses::new(Duration::from_millis(1), Duration::from_micros(900));
        pauses.take(&times(20, 100), false);
        assert_eq!(pauses.words(), Vec::<String>::new());
        // In time, and five cycles of silence.
        (0..5).for_each(|_| pauses.take(&times(20, 900), true));
        pauses.take(&times(20, 100), false);
        assert_eq!((pauses.own, pauses.other), (Side::default(), Side { pauses: 1, longest_ns: 5_000_000 }));
        let words = &pauses.words()[0];
        assert!(
            words.starts_with("the other side was silent 1 times, up to 5 ms,")
                && words.contains("tolerate 5")
        );
        // Late itself, and once held up while it waited: the loss is its own.
        pauses.take(&times(4_000, 100), false);
        pauses.take(&times(20, 7_900), true);
        assert_eq!(pauses.own, Side { pauses: 2, longest_ns: 7_000_000 });
        assert_eq!(pauses.other.pauses, 1);
        // Who answered has died: that is no pause to be borne.
        (0..500).for_each(|_| pauses.take(&times(20, 900), true));
        assert_eq!(pauses.other, Side { pauses: 1, longest_ns: 5_000_000 });
    }
}
