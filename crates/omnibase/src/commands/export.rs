//! `omnibase export`: a recorded run as a table for other programs, or for viewers.

mod viewer;

use crate::Outcome;
use crate::every::Every;
use crate::progress::{bar, warn};
use anyhow::{Context, ensure};
use omnibase_record::export::{self, TableFormat};
use omnibase_record::run::{Keep, RecordedRun, Selection};
use omnibase_robot::Registry;
use omnibase_run::robot_text::ROBOT_KEY;
use omnibase_run::view::DRAWN_FROM;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Writes a recorded run as a table: CSV, Parquet, or MATLAB's format; or as MCAP for viewers.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase export run.mcap --output run.csv
  omnibase export run.mcap --signals 'state.*' 'wheel_*.speed_rad_s' --every 10ms --output run.parquet
  omnibase export run-00001.mcap run-00002.mcap --output run.mat     a run in several files
  omnibase export run.mcap --every 10ms --output view.mcap           for Foxglove and Rerun: the robot drawn

Exit code 1 where a recording ends early; the file holds what is there.")]
pub struct Arguments {
    /// A recording, from `omnibase run --record`; or the files of one run, in their order.
    #[arg(required = true)]
    recording: Vec<PathBuf>,
    /// Signals by their names, as state.pose_x_m, where * stands for any characters; default: all.
    #[arg(long, value_name = "PATTERN", num_args = 1..)]
    signals: Vec<String>,
    /// Time from row to row, as 10ms or 10cycles; default: every recorded cycle.
    #[arg(long, value_name = "TIME")]
    every: Option<Every>,
    /// The file to write; its ending says what it is: .csv, .parquet, .mat, or .mcap for viewers.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

/// Runs the command.
pub fn run(arguments: &Arguments, registry: &Registry, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let path = &arguments.output;
    let format = match TableFormat::of(path) {
        None if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("mcap")) => None,
        Some(table) => Some(table),
        None => anyhow::bail!(
            "--output {}: expected a name that ends in .csv, .parquet, .mat or .mcap",
            path.display()
        ),
    };
    let (mut all, mut is_whole) = (RecordedRun::default(), true);
    for (number, recording) in arguments.recording.iter().enumerate() {
        ensure!(
            !is_same_file(recording, path),
            "`{}` would be written over what it is made of",
            path.display()
        );
        let name = recording.display();
        // What is drawn is made of these signals, whatever else is wished.
        let more: &[&str] = if format.is_none() { &DRAWN_FROM } else { &[] };
        let (next, every_ns) = read(recording, arguments, more)?;
        if let Some(why) = &next.truncated {
            warn(format_args!("`{name}` ends early ({why}); the file holds what is there"));
            is_whole = false;
        }
        if number == 0 {
            all = next;
            continue;
        }
        ensure!(next.schema == all.schema, "`{name}` holds other signals than the recording before it");
        ensure!(
            next.times_ns.first().is_none_or(|first| all.times_ns.last().is_none_or(|last| last < first)),
            "`{name}` begins before the end of the recording before it: expected the files of one run in their order"
        );
        // Each file begins with a row; the table had one of the same step already where the file ended within it.
        let step = |time_ns: &u64| every_ns.map(|every_ns| time_ns / every_ns);
        let (before, first) = (all.times_ns.last().and_then(step), next.times_ns.first().and_then(step));
        let surplus = usize::from(before.is_some() && before == first);
        all.times_ns.extend(&next.times_ns[surplus..]);
        all.values.extend(&next.values[surplus * all.schema.width()..]);
        all.events.extend(next.events);
    }
    let outcome = if is_whole { Outcome::Done } else { Outcome::Failed };
    let Some(format) = format else {
        viewer::write(&all, path, registry, output)?;
        return Ok(outcome);
    };
    let file = File::create(path).with_context(|| format!("writing `{}`", path.display()))?;
    export::write(&all, format, BufWriter::new(file))
        .with_context(|| format!("writing `{}`", path.display()))?;
    writeln!(output, "{}: {} rows of {} signals", path.display(), all.times_ns.len(), all.schema.width())?;
    Ok(outcome)
}

/// Whether two names are of one file that is there.
fn is_same_file(one: &Path, other: &Path) -> bool {
    let place = |path: &Path| path.canonicalize().ok();
    one == other || place(one).is_some_and(|place_of_one| place(other) == Some(place_of_one))
}

/// What is wanted of a recording, and the time from row to row, ns.
fn read(
    recording: &Path,
    arguments: &Arguments,
    more: &[&str],
) -> anyhow::Result<(RecordedRun, Option<u64>)> {
    let name = recording.display();
    let open = || File::open(recording).with_context(|| format!("reading `{name}`"));
    let mut selection = Selection { signals: arguments.signals.clone(), every_ns: None };
    if !selection.signals.is_empty() {
        selection.signals.extend(more.iter().map(|pattern| (*pattern).to_owned()));
    }
    if let Some(every) = arguments.every {
        let about = RecordedRun::read_from(open()?, Keep::Times).with_context(|| format!("`{name}`"))?;
        let cycle_ns =
            cycle_ns(&about).with_context(|| format!("`{name}` doesn't say how long a cycle is"))?;
        selection.every_ns = Some(every.of_cycle(cycle_ns)?);
    }
    let file = open()?;
    let bar = bar(file.metadata().map_or(0, |metadata| metadata.len()), "bytes");
    let run = RecordedRun::read_from(bar.wrap_read(file), Keep::Chosen(&selection));
    bar.finish_and_clear();
    let run = run.with_context(|| format!("`{name}`"))?;
    let names: Vec<String> = run.schema.names().collect();
    for pattern in &arguments.signals {
        let is_there = names.iter().any(|name| omnibase_record::run::fits(pattern, name));
        ensure!(is_there, "--signals {pattern}: `{name}` holds no signal of this name");
    }
    Ok((run, selection.every_ns))
}

/// The cycle of the recorded robot, ns.
fn cycle_ns(run: &RecordedRun) -> Option<u64> {
    let robot: toml::Table = run.description.get(ROBOT_KEY)?.parse().ok()?;
    let cycle_us = robot.get("bus")?.get("cycle_us")?.as_integer()?;
    u64::try_from(cycle_us).ok().map(|us| us * 1000).filter(|ns| *ns > 0)
}
