//! `omnibase report`: a recorded run as one page of HTML.

use super::check::picture;
use crate::Outcome;
use crate::progress::{bar, note, warn};
use anyhow::Context;
use omnibase_measure::measured::FloorPose;
use omnibase_record::report::{self, Digest};
use omnibase_record::run::{FILE_NUMBER, SELECTION};
use omnibase_robot::dry::DryRun;
use omnibase_robot::{Ability, Registry};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Shows a recorded run on one page of HTML: path, what binds the planned motion, errors, wheels, timing, events.
///
/// The page holds everything it needs: it opens without a network, and prints.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase report run.mcap -o run.html
  omnibase report run.mcap -o run.html --measured \"0.012 -0.003 0.5deg\"       beside where it stood on the floor
  omnibase run robots/bmm.toml --path robots/square.dat --report run.html      without a recording that stays

Exit code 1 where the recording ends early; the page shows what is there.")]
pub struct Arguments {
    /// A recording, from `omnibase run --record`.
    recording: PathBuf,
    /// The page to write.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Compare with where the platform stood on the floor after the run, measured in odom: "x y heading" in m, m and rad (or 90deg).
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    measured: Option<FloorPose>,
}

/// Runs the command.
pub fn run(arguments: &Arguments, registry: &Registry, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let digest = write(&arguments.recording, &arguments.output, registry, arguments.measured)?;
    let cycles = digest.cycles();
    writeln!(
        output,
        "{}: {cycles} cycles of `{}`",
        arguments.output.display(),
        arguments.recording.display()
    )?;
    Ok(if digest.run.truncated.is_none() { Outcome::Done } else { Outcome::Failed })
}

/// Writes the page of a recording; says so where the recording ends early.
pub fn write(
    recording: &Path,
    page: &Path,
    registry: &Registry,
    measured: Option<FloorPose>,
) -> anyhow::Result<Digest> {
    let name = recording.display();
    let open = || File::open(recording);
    let file = open().with_context(|| format!("reading `{name}`"))?;
    let length = file.metadata().map_or(0, |metadata| metadata.len());
    // It is read twice.
    let bar = bar(2 * length, "bytes");
    let digest = Digest::read(|| Ok(bar.wrap_read(open()?)));
    bar.finish_and_clear();
    let mut digest = digest.with_context(|| format!("`{name}`"))?;
    digest.planned = planned(&digest.run.description, registry);
    let run = &mut digest.run;
    run.description.extend(measured.map(|pose| (report::MEASURED.to_owned(), pose.to_string())));
    if let Some(reason) = &run.truncated {
        warn(format_args!("`{name}` ends early ({reason}); the page shows what is there"));
    }
    if let Some(words) = run.description.get(SELECTION) {
        note(format_args!("`{name}` holds only {words}; the page shows what is there"));
    }
    if let Some(number) = run.description.get(FILE_NUMBER) {
        note(format_args!("`{name}` is file {number} of its run; the page shows its part alone"));
    }
    std::fs::write(page, digest.html()).with_context(|| format!("writing `{}`", page.display()))?;
    Ok(digest)
}

/// The motion that a recording's robot was asked for by its file and the command line, planned dry again, as a picture; `None` where
/// there is none with an end.
fn planned(description: &BTreeMap<String, String>, registry: &Registry) -> Option<String> {
    let plan = omnibase_run::robot_text::from_description(description, registry).ok()?;
    let mut reference = registry.make_reference(&plan.reference, &Ability::of(&plan)).ok()?;
    let motion = DryRun::of(&plan, &mut *reference).ok()?;
    (motion.way_m > 0.0).then(|| picture::svg(&plan, &motion))
}
