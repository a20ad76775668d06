//! How long cycles took, as distributions, and what happened in the worst cycle of each.

use std::fmt;
use std::io::{self, Write};
use std::ops::Range;

use omnibase_robot::signals::{CycleTime, Exchange, Phase, SafetyReason};
use serde::Serialize;

use crate::events::{Event, phase_words};
use crate::quantiles::{Bin, Distribution, Quantiles, bars, microseconds};
use omnibase_ethercat::paced::Times;

/// Bins of a histogram at most.
const BINS: usize = 12;

/// One cycle, as far as its times need it.
#[derive(Clone, Debug)]
pub struct TimedCycle {
    /// Its number, and its time of the run.
    pub time: CycleTime,
    /// What became of its exchange.
    pub exchange: Exchange,
    /// When it began, and its exchange.
    pub times: Times,
    /// Time for computing, ns; `None` where frames go without a robot.
    pub compute_ns: Option<u64>,
    /// The robot in it, where there is one.
    pub robot: Option<TimedRobot>,
}

/// What a robot did in a cycle, as far as times need it.
#[derive(Clone, Debug)]
pub struct TimedRobot {
    /// The phase after it.
    pub phase: Phase,
    /// Why it stops or has stopped.
    pub stop_reason: SafetyReason,
    /// Whether somebody asked something of it.
    pub asked: bool,
    /// What happened, by the events' numbers.
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
    cycle: TimedCycle,
}

impl Measure {
    fn take(&mut self, value_ns: u64, cycle: &TimedCycle) {
        self.distribution.record(value_ns);
        self.coarse.record(value_ns);
        if self.worst.as_ref().is_some_and(|worst| worst.value_ns >= value_ns) {
            return;
        }
        let quantiles = self.seen.unwrap_or_default();
        self.seen = Some(MeasureSeen {
            max_ns: value_ns,
            worst_cycle: cycle.time.index,
            worst_time_s: cycle.time.now_ns as f64 * 1e-9,
            worst_phase: cycle.robot.as_ref().map(|robot| phase_words(robot.phase)),
            worst_exchange: exchange_words(cycle.exchange),
            ..quantiles
        });
        self.worst = Some(Worst { value_ns, cycle: cycle.clone() });
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
        let TimedCycle { time, exchange, times, compute_ns, ref robot } = self.cycle;
        let robot = robot.as_ref();
        let happened = robot.map_or(0..0, |robot| robot.events.clone());
        let range = happened.start.min(events.len())..happened.end.min(events.len());
        let reason = robot.map(|robot| robot.stop_reason).filter(|reason| *reason != SafetyReason::None);
        WorstCycle {
            cycle: time.index,
            time_s: time.now_ns as f64 * 1e-9,
            wake_up_ns: times.late_ns,
            round_trip_ns: times.round_trip_ns,
            compute_ns,
            dc_phase_ns: times.dc_phase_ns,
            left_out: times.periods.saturating_sub(1),
            exchange: exchange_words(exchange),
            phase: robot.map(|robot| phase_words(robot.phase)),
            stop_reason: reason.map(SafetyReason::text),
            asked: robot.is_some_and(|robot| robot.asked),
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
    pub fn take(&mut self, cycle: &TimedCycle) {
        self.wake_up.take(cycle.times.late_ns, cycle);
        self.round_trip.take(cycle.times.round_trip_ns, cycle);
        if let Some(compute_ns) = cycle.compute_ns {
            self.compute.take(compute_ns, cycle);
        }
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
    /// The phase after it; `None` without a robot.
    pub worst_phase: Option<&'static str>,
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

impl TimingFigures {
    /// Prints what was measured, each with its bars and its worst cycle; of what took no time, as on virtual time, one line.
    pub fn print(&self, output: &mut dyn Write) -> io::Result<()> {
        for (name, measured) in [
            ("wake-up late by", &self.wake_up_ns),
            ("round trip", &self.round_trip_ns),
            ("computing", &self.compute_ns),
            ("DC phase error", &self.dc_phase_ns),
        ] {
            if let Some(measured) = measured {
                measured.print(name, output)?;
            }
        }
        Ok(())
    }
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

impl Measured {
    fn print(&self, name: &str, output: &mut dyn Write) -> io::Result<()> {
        let Quantiles { p50, p99, p999, max, .. } = self.quantiles;
        let [p50, p99, p999, shown_max] = [p50, p99, p999, max].map(microseconds);
        writeln!(output, "{name:<23} p50 {p50}, p99 {p99}, p99.9 {p999}, max {shown_max}")?;
        if max == 0 {
            return Ok(());
        }
        for bar in bars(&self.histogram) {
            writeln!(output, "  {bar}")?;
        }
        writeln!(output, "  worst: {}", self.worst)
    }
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
    /// Its time for computing, ns; `None` without a robot.
    pub compute_ns: Option<u64>,
    /// How far its frame was behind (positive) or before its place in the DC cycle, ns.
    pub dc_phase_ns: Option<i64>,
    /// Cycles that were left out before it.
    pub left_out: u64,
    /// `complete`, `lost` or `incomplete`.
    pub exchange: &'static str,
    /// The phase after it; `None` without a robot.
    pub phase: Option<&'static str>,
    /// Why the robot stops or has stopped, where it does.
    pub stop_reason: Option<&'static str>,
    /// Whether somebody asked something of the robot in it.
    pub asked: bool,
    /// What happened in it.
    pub events: Vec<String>,
}

impl fmt::Display for WorstCycle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [late, round_trip] = [self.wake_up_ns, self.round_trip_ns].map(microseconds);
        let WorstCycle { cycle, time_s, exchange, .. } = self;
        write!(f, "cycle {cycle} at {time_s:.3} s: {late} late, round trip {round_trip} ({exchange})")?;
        if let Some(compute_ns) = self.compute_ns {
            write!(f, ", computed in {}", microseconds(compute_ns))?;
        }
        if let Some(phase_ns) = self.dc_phase_ns {
            let sign = if phase_ns < 0 { "-" } else { "+" };
            write!(f, ", DC phase {sign}{}", microseconds(phase_ns.unsigned_abs()))?;
        }
        if let Some(phase) = self.phase {
            write!(f, "; {phase}")?;
        }
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
        let (phase, stop_reason) = (Phase::Tracking, SafetyReason::None);
        timing.take(&TimedCycle {
            time: CycleTime { index, ..CycleTime::default() },
            exchange: if times.round_trip_ns > 500 { Exchange::Lost } else { Exchange::Complete },
            times,
            compute_ns: Some(7),
            robot: Some(TimedRobot { phase, stop_reason, asked: false, events }),
        });
    }

    #[test]
    fn frames_without_a_robot_are_printed_under_the_same_names_as_a_run() {
        let printed = |compute_ns, robot: Option<TimedRobot>| {
            let times = Times { late_ns: 40, round_trip_ns: 90, dc_phase_ns: Some(-30), ..Times::default() };
            let (time, exchange) = (CycleTime::default(), Exchange::Complete);
            let mut timing = Timing::default();
            timing.take(&TimedCycle { time, exchange, times, compute_ns, robot });
            let mut output = Vec::new();
            timing.figures(&[]).print(&mut output).unwrap();
            String::from_utf8(output).unwrap()
        };
        let (phase, stop_reason) = (Phase::Tracking, SafetyReason::None);
        let robot = TimedRobot { phase, stop_reason, asked: false, events: 0..0 };
        let (frames, run) = (printed(None, None), printed(Some(0), Some(robot)));
        let names = |text: &str| -> Vec<String> {
            let lines = text.lines().filter(|line| line.contains(" p50 "));
            lines.map(|line| line[..23].trim_end().to_owned()).collect()
        };
        assert_eq!(names(&frames), ["wake-up late by", "round trip", "DC phase error"]);
        assert_eq!(names(&run), ["wake-up late by", "round trip", "computing", "DC phase error"]);
        let worst = "  worst: cycle 0 at 0.000 s: 0.040 us late, round trip 0.090 us (complete), DC phase -0.030 us\n";
        assert_eq!(frames.matches(worst).count(), 3, "{frames}");
        // What took no time has no bars and no worst cycle.
        assert_eq!(run.matches("; tracking the reference\n").count(), 3, "{run}");
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
