//! What is recorded of a run: by the table of the robot's file, and by what the command line says in place of it.

use super::calendar::Moment;
use crate::every::Every;
use anyhow::Context;
use omnibase_record::run::{Rotation, RunFiles, RunSchema, Selection};
use omnibase_robot::config::{RecordingFormat, RecordingPlan, TIME_IN_NAME};
use omnibase_run::{LoadedRobot, channels};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// What is recorded.
#[derive(Clone, Debug, clap::Args)]
pub struct RecordingChoice {
    /// Record into this MCAP file: every signal of every cycle, or what --signals and --every or the robot file's
    /// `recording` table choose.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Record into this text file of columns, as Kst and numpy read it.
    #[arg(long, value_name = "FILE")]
    columns: Option<PathBuf>,
    /// Signals to record by their names, as state.pose_x_m, where * stands for any characters; such a recording can't be
    /// replayed.
    #[arg(long, value_name = "PATTERN", num_args = 1..)]
    signals: Vec<String>,
    /// Time from one recorded cycle to the next, as 10ms or 10cycles.
    #[arg(long, value_name = "TIME")]
    every: Option<Every>,
    /// The most that a file takes, MB; the run goes on in the next one.
    #[arg(long, value_name = "MB", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    limit_mb: Option<u32>,
    /// How many such files are kept, the one being written among them.
    #[arg(long, value_name = "NUMBER", requires = "limit_mb", value_parser = clap::value_parser!(u32).range(2..=99_999))]
    files: Option<u32>,
    /// Record nothing, whatever the robot's file says.
    #[arg(long, conflicts_with_all = ["record", "columns", "signals", "every", "limit_mb"])]
    no_recording: bool,
}

impl RecordingChoice {
    /// Leaves the robot's file's own recording alone.
    pub fn leave_file(&mut self) {
        self.no_recording |= self.record.is_none() && self.columns.is_none();
    }

    /// The files to write, without descriptions; `None`: none. Those of the robot's file are in `folder`.
    pub fn files(&self, robot: &LoadedRobot, folder: &Path) -> anyhow::Result<Option<RunFiles>> {
        let table = robot.plan.recording.as_ref().filter(|_| !self.no_recording);
        let (mcap, columns) = match table {
            _ if self.record.is_some() || self.columns.is_some() => {
                (self.record.clone(), self.columns.clone())
            }
            Some(table) => {
                let file = folder.join(named(&table.file, SystemTime::now()));
                if let Some(parent) = file.parent() {
                    std::fs::create_dir_all(parent)
                        .with_context(|| format!("[recording] file `{}`", table.file))?;
                }
                match table.format {
                    RecordingFormat::Mcap => (Some(file), None),
                    RecordingFormat::Columns => (None, Some(file)),
                }
            }
            None => {
                let is_idle = self.signals.is_empty() && self.every.is_none() && self.limit_mb.is_none();
                anyhow::ensure!(
                    is_idle,
                    "nothing is recorded: give --record FILE, or [recording] in the robot's file"
                );
                return Ok(None);
            }
        };
        let (selection, rotation) = (self.selection(robot, table)?, self.rotation(table));
        Ok(Some(RunFiles { mcap, columns, selection, rotation, ..RunFiles::default() }))
    }

    fn selection(&self, robot: &LoadedRobot, table: Option<&RecordingPlan>) -> anyhow::Result<Selection> {
        let cycle_ns = robot.plan.bus.cycle_ns;
        let every_ns = match self.every {
            Some(every) => Some(every.of_cycle(cycle_ns)?),
            None => table.and_then(|table| table.every_ns),
        };
        for pattern in &self.signals {
            channels::known(pattern, &robot.plan)
                .map_err(|why| anyhow::anyhow!("--signals {pattern}: {why}"))?;
        }
        let signals = match table {
            Some(table) if self.signals.is_empty() => table.signals.clone(),
            _ => self.signals.clone(),
        };
        Ok(Selection { signals, every_ns: every_ns.filter(|ns| *ns > cycle_ns) })
    }

    fn rotation(&self, table: Option<&RecordingPlan>) -> Option<Rotation> {
        let limit = self.limit_mb.map(|mb| u64::from(mb) * 1_000_000);
        let file_bytes = limit.or_else(|| table?.limit_bytes)?;
        Some(Rotation { file_bytes, files: self.files.or_else(|| table?.files) })
    }
}

/// Says what of a run isn't recorded, where it isn't everything.
pub fn words(files: &RunFiles, schema: &RunSchema) -> Option<String> {
    let words = files.selection.words(schema)?;
    Some(format!("recording {words}: it can't be replayed"))
}

/// A file's name with the time in it.
fn named(file: &str, now: SystemTime) -> String {
    let Moment { year, month, day, hour, minute, second } = Moment::of(now);
    let time = format!("{year:04}-{month:02}-{day:02}T{hour:02}-{minute:02}-{second:02}Z");
    file.replace(TIME_IN_NAME, &time)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn the_time_stands_in_a_name_in_an_order_that_sorts() {
        let now = SystemTime::UNIX_EPOCH + Duration::from_secs(951_782_399);
        assert_eq!(named("runs/bmm-{time}.mcap", now), "runs/bmm-2000-02-28T23-59-59Z.mcap");
        assert_eq!(named("run.mcap", now), "run.mcap");
    }
}
