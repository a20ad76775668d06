//! What `exchange` measured, as JSON and as text.

use omnibase_measure::pauses::Pauses;
use omnibase_measure::quantiles::{Quantiles, microseconds};
use omnibase_measure::timing::{Measured, TimingFigures};
use serde::Serialize;
use std::io::{self, Write};
use std::time::Duration;

/// What a run showed.
pub struct Report {
    /// OP was reached and kept by everyone.
    pub operational: bool,
    /// Cycle time.
    pub cycle: Duration,
    /// Cycles in OP.
    pub cycles: u64,
    /// Cycles that began late by a whole cycle or more.
    pub overruns: u64,
    /// Frames that weren't back at their deadline.
    pub lost_frames: u64,
    /// Cycles with a wrong working counter.
    pub working_counter_errors: u64,
    /// Frames that came after their deadline.
    pub late_frames: u64,
    /// Frames of others.
    pub foreign_frames: u64,
    /// Frames with process data in each cycle.
    pub frames_per_cycle: usize,
    /// SubDevices.
    pub subdevices: usize,
    /// Commands in all frames since PRE-OP.
    pub commands_used: Vec<&'static str>,
    /// SubDevices that aren't operational, and what they have.
    pub not_operational: Vec<String>,
    /// Where frames were damaged, links lost and firmware silent.
    pub damage: Vec<String>,
    /// How many more SubDevices answered in the end than were set up.
    pub surplus: usize,
    /// Whose pauses cost cycles.
    pub pauses: Pauses,
    /// How long cycles took, as in the summary of a run.
    pub timing: TimingFigures,
}

/// The report's JSON form.
#[derive(Serialize)]
pub struct ReportJson<'a> {
    operational: bool,
    cycles: u64,
    lost_frames: u64,
    working_counter_errors: u64,
    frames_per_cycle: usize,
    round_trip_ns: Option<Quantiles>,
    wakeup_ns: Option<Quantiles>,
    dc_phase_ns: Option<Quantiles>,
    not_operational: &'a [String],
    damage: &'a [String],
    surplus: usize,
    pauses: &'a Pauses,
    timing: &'a TimingFigures,
    commands_used: &'a [&'static str],
}

impl Report {
    /// As JSON; what wasn't measured is null.
    pub fn json(&self) -> ReportJson<'_> {
        let quantiles = |measured: &Option<Measured>| measured.as_ref().map(|measured| measured.quantiles);
        ReportJson {
            operational: self.operational,
            cycles: self.cycles,
            lost_frames: self.lost_frames,
            working_counter_errors: self.working_counter_errors,
            frames_per_cycle: self.frames_per_cycle,
            round_trip_ns: quantiles(&self.timing.round_trip_ns),
            wakeup_ns: quantiles(&self.timing.wake_up_ns),
            dc_phase_ns: quantiles(&self.timing.dc_phase_ns),
            not_operational: &self.not_operational,
            damage: &self.damage,
            surplus: self.surplus,
            pauses: &self.pauses,
            timing: &self.timing,
            commands_used: &self.commands_used,
        }
    }

    /// As text.
    pub fn print(&self, output: &mut dyn Write) -> io::Result<()> {
        writeln!(output, "operational             {}", if self.operational { "yes" } else { "NO" })?;
        writeln!(
            output,
            "cycles                  {} of {}, {} SubDevices, {} frames each",
            self.cycles,
            microseconds(self.cycle.as_nanos() as u64),
            self.subdevices,
            self.frames_per_cycle
        )?;
        writeln!(output, "lost frames             {}", self.lost_frames)?;
        writeln!(output, "working counter errors  {}", self.working_counter_errors)?;
        writeln!(
            output,
            "late, foreign, overrun  {}, {}, {}",
            self.late_frames, self.foreign_frames, self.overruns
        )?;
        writeln!(output, "commands used           {}", self.commands_used.join(", "))?;
        for not_operational in &self.not_operational {
            writeln!(output, "not operational         {not_operational}")?;
        }
        for damage in &self.damage {
            writeln!(output, "damage                  {damage}")?;
        }
        if self.surplus > 0 {
            writeln!(
                output,
                "plugged in meanwhile    {} more answer than were set up: left alone; start again to take them in",
                self.surplus
            )?;
        }
        self.timing.print(output)?;
        self.pauses.print(output)
    }
}
