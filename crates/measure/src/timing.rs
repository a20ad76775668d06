//! How long cycles took, as distributions, and what happened in the worst cycle of each.

use std::fmt;
use std::ops::Range;

use omnibase_robot::signals::{CycleRecord, Exchange, Phase, SafetyReason};
use serde::Serialize;

use crate::events::{Event, phase_words};
use crate::quantiles::{Bin, Distribution, Quantiles, microseconds};
use omnibase_ethercat::paced::Times;

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

/// Every so many cycles one quantile is looked at anew, for whoever watches: that takes about a microsecond.
const LOOK_CYCLES: u64 = 16;

/// Collects cycle by cycle; no allocation after its making.
#[derive(Debug)]
pub struct Timing {
    cycles: u64,
    wake_up: Measure,
    round_trip: Measure,
    compute: Measure,
    dc_phase: Measure,
}

impl Default for Timing {
    fn default() -> Self {
        let measure = || Measure {
            distribution: Distribution::new(),
            coarse: Distribution::coarse(),
            worst: None,
            seen: None,
        };
        Timing {
            cycles: 0,
            wake_up: measure(),
            round_trip: measure(),
            compute: measure(),
            dc_phase: measure(),
        }
    }
}

#[derive(Debug)]
struct Measure {
    distribution: Distribution,
    /// The same, in fewer steps.
    coarse: Distribution,
    worst: Option<Worst>,
    seen: Option<MeasureSeen>,
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
        self.coarse.record(value_ns);
        if self.worst.as_ref().is_some_and(|worst| worst.value_ns >= value_ns) {
            return;
        }
        let record = cycle.record;
        let quantiles = self.seen.unwrap_or_default();
        self.seen = Some(MeasureSeen {
            max_ns: value_ns,
            worst_cycle: record.time.index,
            worst_time_s: record.time.now_ns as f64 * 1e-9,
            worst_phase: phase_words(cycle.phase),
            worst_exchange: exchange_words(record.exchange),
            ..quantiles
        });
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

    /// Looks at one of the quantiles again.
    fn look(&mut self, which: u64) {
        if let Some(seen) = &mut self.seen {
            match which {
                0 => seen.p50_ns = self.coarse.at(0.5).min(seen.max_ns),
                _ => seen.p99_ns = self.coarse.at(0.99).min(seen.max_ns),
            }
        }
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
            exchange: exchange_words(self.exchange),
            phase: phase_words(self.phase),
            stop_reason: (self.stop_reason != SafetyReason::None).then(|| self.stop_reason.text()),
            asked: self.asked,
            events: events[range].iter().map(|event| event.text.clone()).collect(),
        }
    }
}

fn exchange_words(exchange: Exchange) -> &'static str {
    match exchange {
        Exchange::Complete => "complete",
        Exchange::Lost => "lost",
        _ => "incomplete",
    }
}

impl Timing {
    /// What is known so far, for whoever watches; quantiles are as old as 128 cycles.
    pub fn seen(&self) -> TimingSeen {
        TimingSeen {
            wake_up: self.wake_up.seen,
            round_trip: self.round_trip.seen,
            compute: self.compute.seen,
            dc_phase: self.dc_phase.seen,
        }
    }

    /// Takes a cycle in.
    pub fn take(&mut self, cycle: &TimedCycle<'_>) {
        self.wake_up.take(cycle.times.late_ns, cycle);
        self.round_trip.take(cycle.times.round_trip_ns, cycle);
        self.compute.take(cycle.compute_ns, cycle);
        if let Some(phase_ns) = cycle.times.dc_phase_ns {
            self.dc_phase.take(phase_ns.unsigned_abs(), cycle);
        }
        if self.cycles.is_multiple_of(LOOK_CYCLES) {
            let turn = self.cycles / LOOK_CYCLES;
            let measures = [&mut self.wake_up, &mut self.round_trip, &mut self.compute, &mut self.dc_phase];
            let [which, measure] = [turn % 2, turn / 2 % 4];
            measures.into_iter().nth(measure as usize).into_iter().for_each(|measure| measure.look(which));
        }
        self.cycles += 1;
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

/// Cycle times of a run that goes on; `None` for what isn't measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct TimingSeen {
    /// How late cycles began.
    pub wake_up: Option<MeasureSeen>,
    /// From the send until all frames were back or given up.
    pub round_trip: Option<MeasureSeen>,
    /// From inputs to outputs.
    pub compute: Option<MeasureSeen>,
    /// How far frames were from their place in the DC cycle, without sign.
    pub dc_phase: Option<MeasureSeen>,
}

/// One measure of a run that goes on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MeasureSeen {
    /// Half of the values are at most this, within 1 %, ns.
    pub p50_ns: u64,
    /// 99 of 100 are at most this, within 1 %, ns.
    pub p99_ns: u64,
    /// The largest, ns.
    pub max_ns: u64,
    /// The cycle that had it, by its number on the robot's time grid.
    pub worst_cycle: u64,
    /// When that was, in time of the run, s.
    pub worst_time_s: f64,
    /// The phase after it.
    pub worst_phase: &'static str,
    /// `complete`, `lost` or `incomplete`.
    pub worst_exchange: &'static str,
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
    fn whoever_watches_sees_quantiles_and_the_worst_cycle_while_it_runs() {
        let mut timing = Timing::default();
        assert_eq!(timing.seen(), TimingSeen::default());
        for index in 0..2000 {
            let late_ns = if index == 700 { 90_000 } else { 10_000 + index };
            let times = Times { periods: 1, late_ns, round_trip_ns: 40_000, ..Times::default() };
            take(&mut timing, index, times, 0..0);
        }
        let TimingSeen { wake_up, round_trip, compute, dc_phase } = timing.seen();
        let late = wake_up.unwrap();
        // Of 2000 values from 10 to 12 us, within 1 %, and as they were up to 128 cycles before.
        assert!((late.p50_ns as f64 / 11_000.0 - 1.0).abs() < 0.02, "{late:?}");
        assert!((late.p99_ns as f64 / 11_980.0 - 1.0).abs() < 0.02, "{late:?}");
        assert_eq!((late.max_ns, late.worst_cycle, late.worst_exchange), (90_000, 700, "lost"));
        let round_trip = round_trip.unwrap();
        assert_eq!((round_trip.p50_ns, round_trip.p99_ns, round_trip.max_ns), (40_000, 40_000, 40_000));
        assert_eq!(compute.map(|compute| compute.p99_ns), Some(7));
        assert_eq!(dc_phase, None);
    }

    #[test]
    fn events_beyond_those_that_a_run_keeps_are_left_out() {
        let mut timing = Timing::default();
        take(&mut timing, 0, Times { late_ns: 1, ..Times::default() }, 1000..1001);
        assert!(timing.figures(&[]).wake_up_ns.unwrap().worst.events.is_empty());
        assert_eq!(Timing::default().figures(&[]), TimingFigures::default());
    }
}
