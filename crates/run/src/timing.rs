//! How long cycles took, as distributions, and what happened in the worst cycle of each.

use std::fmt;
use std::ops::Range;

use omnibase_robot::signals::{CycleRecord, Exchange, Phase, SafetyReason};
use serde::Serialize;

use crate::events::{Event, phase_words};
use crate::quantiles::{Bin, Distribution, Quantiles, microseconds};
use crate::session::Times;

/// Bins of a histogram at most.
const BINS: usize = 12;

/// One cycle, as far as its times need it.
#[derive(Clone, Debug)]
pub struct TimedCycle<'a> {
    /// What it saw and did.
    pub record: &'a CycleRecord,
    /// The phase after it.
    pub phase: Phase,
    /// When it began, and its exchange.
    pub times: Times,
    /// Time for computing, ns.
    pub compute_ns: u64,
    /// What happened in it, by the events' numbers.
    pub events: Range<usize>,
}

/// Collects cycle by cycle; no allocation after its making.
#[derive(Debug)]
pub struct Timing {
    wake_up: Measure,
    round_trip: Measure,
    compute: Measure,
    dc_phase: Measure,
}

impl Default for Timing {
    fn default() -> Self {
        let measure = || Measure { distribution: Distribution::new(), worst: None };
        Timing { wake_up: measure(), round_trip: measure(), compute: measure(), dc_phase: measure() }
    }
}

#[derive(Debug)]
struct Measure {
    distribution: Distribution,
    worst: Option<Worst>,
}

/// A cycle in which something took longest.
#[derive(Clone, Debug)]
struct Worst {
    value_ns: u64,
    index: u64,
    time_ns: u64,
    times: Times,
    compute_ns: u64,
    exchange: Exchange,
    phase: Phase,
    stop_reason: SafetyReason,
    asked: bool,
    events: Range<usize>,
}

impl Measure {
    fn take(&mut self, value_ns: u64, cycle: &TimedCycle<'_>) {
        self.distribution.record(value_ns);
        if self.worst.as_ref().is_some_and(|worst| worst.value_ns >= value_ns) {
            return;
        }
        let record = cycle.record;
        self.worst = Some(Worst {
            value_ns,
            index: record.time.index,
            time_ns: record.time.now_ns,
            times: cycle.times,
            compute_ns: cycle.compute_ns,
            exchange: record.exchange,
            phase: cycle.phase,
            stop_reason: record.stop_reason,
            asked: record.request.is_some(),
            events: cycle.events.clone(),
        });
    }

    fn figures(&self, events: &[Event]) -> Option<Measured> {
        let worst = self.worst.as_ref()?;
        let (quantiles, histogram) = (self.distribution.quantiles()?, self.distribution.bins(BINS));
        Some(Measured { quantiles, histogram, worst: worst.told(events) })
    }
}

impl Worst {
    fn told(&self, events: &[Event]) -> WorstCycle {
        let range = self.events.start.min(events.len())..self.events.end.min(events.len());
        WorstCycle {
            cycle: self.index,
            time_s: self.time_ns as f64 * 1e-9,
            wake_up_ns: self.times.late_ns,
            round_trip_ns: self.times.round_trip_ns,
            compute_ns: self.compute_ns,
            dc_phase_ns: self.times.dc_phase_ns,
            left_out: self.times.periods.saturating_sub(1),
            exchange: match self.exchange {
                Exchange::Complete => "complete",
                Exchange::Lost => "lost",
                _ => "incomplete",
            },
            phase: phase_words(self.phase),
            stop_reason: (self.stop_reason != SafetyReason::None).then(|| self.stop_reason.text()),
            asked: self.asked,
            events: events[range].iter().map(|event| event.text.clone()).collect(),
        }
    }
}

impl Timing {
    /// Takes a cycle in.
    pub fn take(&mut self, cycle: &TimedCycle<'_>) {
        self.wake_up.take(cycle.times.late_ns, cycle);
        self.round_trip.take(cycle.times.round_trip_ns, cycle);
        self.compute.take(cycle.compute_ns, cycle);
        if let Some(phase_ns) = cycle.times.dc_phase_ns {
            self.dc_phase.take(phase_ns.unsigned_abs(), cycle);
        }
    }

    /// The figures; `events` are all of the run, in the order of the numbers that cycles came with.
    pub fn figures(&self, events: &[Event]) -> TimingFigures {
        TimingFigures {
            wake_up_ns: self.wake_up.figures(events),
            round_trip_ns: self.round_trip.figures(events),
            compute_ns: self.compute.figures(events),
            dc_phase_ns: self.dc_phase.figures(events),
        }
    }
}

/// Distributions of a run's cycle times; `None` for what wasn't measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TimingFigures {
    /// How late cycles began.
    pub wake_up_ns: Option<Measured>,
    /// From the send until all frames were back or given up.
    pub round_trip_ns: Option<Measured>,
    /// From inputs to outputs. On virtual time no time passes meanwhile.
    pub compute_ns: Option<Measured>,
    /// How far frames were from their place in the DC cycle, without sign.
    pub dc_phase_ns: Option<Measured>,
}

/// One distribution with its worst cycle.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Measured {
    /// Its numbers.
    #[serde(flatten)]
    pub quantiles: Quantiles,
    /// How many values lie where.
    pub histogram: Vec<Bin>,
    /// What happened in the cycle with the largest value.
    pub worst: WorstCycle,
}

/// What happened in a cycle that took longest.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct WorstCycle {
    /// Its number on the robot's time grid.
    pub cycle: u64,
    /// Its time of the run, s.
    pub time_s: f64,
    /// How late it began, ns.
    pub wake_up_ns: u64,
    /// From its send until all frames were back or given up, ns.
    pub round_trip_ns: u64,
    /// Its time for computing, ns.
    pub compute_ns: u64,
    /// How far its frame was behind (positive) or before its place in the DC cycle, ns.
    pub dc_phase_ns: Option<i64>,
    /// Cycles that were left out before it.
    pub left_out: u64,
    /// `complete`, `lost` or `incomplete`.
    pub exchange: &'static str,
    /// The phase after it.
    pub phase: &'static str,
    /// Why the robot stops or has stopped, where it does.
    pub stop_reason: Option<&'static str>,
    /// Whether somebody asked something of the robot in it.
    pub asked: bool,
    /// What happened in it.
    pub events: Vec<String>,
}

impl fmt::Display for WorstCycle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [late, round_trip, compute] =
            [self.wake_up_ns, self.round_trip_ns, self.compute_ns].map(microseconds);
        write!(
            f,
            "cycle {} at {:.3} s: {late} late, round trip {round_trip} ({}), computed in {compute}",
            self.cycle, self.time_s, self.exchange
        )?;
        if let Some(phase_ns) = self.dc_phase_ns {
            let sign = if phase_ns < 0 { "-" } else { "+" };
            write!(f, ", DC phase {sign}{}", microseconds(phase_ns.unsigned_abs()))?;
        }
        write!(f, "; {}", self.phase)?;
        match self.left_out {
            0 => {}
            1 => write!(f, "; 1 cycle left out before it")?,
            more => write!(f, "; {more} cycles left out before it")?,
        }
        if let Some(reason) = self.stop_reason {
            write!(f, "; stop: {reason}")?;
        }
        if self.asked {
            write!(f, "; something was asked")?;
        }
        for event in &self.events {
            write!(f, "; {event}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn take(timing: &mut Timing, index: u64, times: Times, events: Range<usize>) {
        let mut record = CycleRecord::default();
        record.time.index = index;
        record.exchange = if times.round_trip_ns > 500 { Exchange::Lost } else { Exchange::Complete };
        let cycle = TimedCycle { record: &record, phase: Phase::Tracking, times, compute_ns: 7, events };
        timing.take(&cycle);
    }

    #[test]
    fn the_worst_cycle_of_each_measure_is_kept_with_what_happened_in_it() {
        let mut timing = Timing::default();
        let usual = Times { periods: 1, late_ns: 10, round_trip_ns: 100, ..Times::default() };
        take(&mut timing, 0, usual, 0..0);
        take(&mut timing, 1, Times { late_ns: 90, dc_phase_ns: Some(-30), ..usual }, 0..1);
        take(&mut timing, 4, Times { periods: 3, round_trip_ns: 900, dc_phase_ns: Some(20), ..usual }, 1..3);
        take(&mut timing, 5, usual, 3..3);
        let events = ["begun", "lost", "stopped"].map(|text| Event { time_s: 0.0, text: text.to_owned() });
        let figures = timing.figures(&events);
        let late = figures.wake_up_ns.unwrap();
        assert_eq!((late.quantiles.max, late.worst.cycle, late.worst.left_out), (90, 1, 0));
        assert_eq!(late.worst.events, ["begun"]);
        let lost = figures.round_trip_ns.unwrap();
        assert_eq!((lost.worst.cycle, lost.worst.left_out, lost.worst.exchange), (4, 2, "lost"));
        assert_eq!(lost.worst.events, ["lost", "stopped"]);
        assert_eq!(lost.histogram.iter().map(|bin| bin.count).sum::<u64>(), 4);
        let phase = figures.dc_phase_ns.unwrap();
        assert_eq!((phase.quantiles.max, phase.worst.dc_phase_ns), (30, Some(-30)));
        // Equal values: the first one is kept.
        assert_eq!(figures.compute_ns.unwrap().worst.cycle, 0);
        let words = lost.worst.to_string();
        assert!(words.contains("cycle 4 at") && words.contains("(lost)"), "{words}");
        assert!(words.ends_with("; 2 cycles left out before it; lost; stopped"), "{words}");
    }

    #[test]
    fn events_beyond_those_that_a_run_keeps_are_left_out() {
        let mut timing = Timing::default();
        take(&mut timing, 0, Times { late_ns: 1, ..Times::default() }, 1000..1001);
        assert!(timing.figures(&[]).wake_up_ns.unwrap().worst.events.is_empty());
        assert_eq!(Timing::default().figures(&[]), TimingFigures::default());
    }
}
