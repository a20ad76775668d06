//! How long this machine pauses a program: measured, for no file tells it.

use super::{Finding, How};
use crate::MonotonicClock;
use omnibase_ethercat_wire::{Clock, HostTime, spoken};
use std::time::Duration;

/// A cycle of a millisecond bears this.
const GOOD: Duration = Duration::from_micros(500);
/// Longer ones stop a robot that tolerates two lost exchanges.
const BEARABLE: Duration = Duration::from_millis(2);
/// Nobody sets a cycle or a tolerance by a pause like this.
const HOPELESS: Duration = Duration::from_millis(20);
const CHECK: &str = "pauses";
const WHY: &str = "whoever keeps the cycle, or simulates drives, loses every cycle that falls into a pause";

/// Looks at the clock without a break for so long, and says which gaps there were. Between two looks nothing happens: what passes
/// beyond that was taken from this program.
///
/// A CPU that is wanted by others too pauses this as it pauses a run without real time.
pub fn pauses(duration: Duration) -> Finding {
    if duration.is_zero() {
        return Finding::unknown(CHECK, WHY, "not measured (--pauses-s 0)");
    }
    let clock = MonotonicClock;
    let (mut last, mut gaps) = (clock.now(), Gaps::default());
    let end = last + duration;
    while last < end {
        let now = clock.now();
        gaps.take(last, now);
        last = now;
    }
    verdict(&gaps, duration)
}

/// Gaps of at least [`GOOD`], and the longest of all.
#[derive(Clone, Copy, Debug, Default)]
struct Gaps {
    long: u32,
    longest: Duration,
}

impl Gaps {
    fn take(&mut self, from: HostTime, to: HostTime) {
        let gap = to - from;
        self.longest = self.longest.max(gap);
        self.long += u32::from(gap >= GOOD);
    }
}

fn verdict(gaps: &Gaps, duration: Duration) -> Finding {
    let found = format!(
        "{} pauses of {} and more in {}, the longest {}",
        gaps.long,
        spoken(GOOD),
        spoken(duration),
        spoken(gaps.longest)
    );
    let needed_us = (gaps.longest.as_micros() as u64).div_ceil(1000) * 1000;
    let remedy = format!(
        "--realtime with a CPU of its own (isolcpus); on a virtual machine, whose host takes the CPU away, [bus] cycle_us = {} or [safety] \
         lost_exchanges_tolerated = {}",
        needed_us.max(2000),
        needed_us / 1000 + 1
    );
    let by_hand = How::ByHand("it is a decision what the robot bears");
    // No robot waits so long: that is a machine with too much to do.
    let remedy = if gaps.longest > HOPELESS {
        "end what else runs on this machine, then measure again".into()
    } else {
        remedy
    };
    match gaps.longest {
        longest if longest < GOOD => Finding::good(CHECK, WHY, found),
        longest if longest < BEARABLE => Finding::degraded(CHECK, WHY, found).mended(remedy, by_hand),
        _ => Finding::degraded(CHECK, WHY, format!("{found}: too long for a cycle of 1 ms"))
            .mended(remedy, by_hand),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Verdict;

    #[test]
    fn the_longest_gap_decides_and_names_what_to_set() {
        let mut gaps = Gaps::default();
        gaps.take(HostTime(1_000), HostTime(2_000));
        let second = Duration::from_secs(1);
        assert_eq!(verdict(&gaps, second).verdict, Verdict::Good);
        gaps.take(HostTime(2_000), HostTime(7_502_000));
        let finding = verdict(&gaps, second);
        assert_eq!(finding.verdict, Verdict::Degraded);
        assert_eq!(
            finding.found,
            "1 pauses of 500 us and more in 1 s, the longest 7.5 ms: too long for a cycle of 1 ms"
        );
        let command = finding.remedy.unwrap().command;
        assert!(
            command.contains("cycle_us = 8000") && command.contains("lost_exchanges_tolerated = 9"),
            "{command}"
        );
    }
}
