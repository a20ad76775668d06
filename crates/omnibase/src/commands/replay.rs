//! `omnibase replay`: a recorded run computed again.

use crate::Outcome;
use anyhow::Context;
use omnibase_robot::Registry;
use omnibase_run::{ReplayFileError, ReplayedFile};
use std::fs::File;
use std::io::Write;
use std::path::PathBuf;

/// Computes every cycle of a recording again and compares bit by bit; needs nothing but the recording.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Exit code 1 where a cycle comes out differently (the first difference is named), and where the recording \
ends early."
)]
pub struct Arguments {
    /// A recording, from `omnibase run --record`.
    recording: PathBuf,
    /// Be content with a recording that ends early: its cycles up to there decide.
    #[arg(long)]
    partial: bool,
    /// Print one JSON object: {"cycles", "same", "difference": null or {"cycle", "channel", "recorded", "computed"},
    /// "ends_early": null or {"why", "until_s"}}.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: &Arguments, registry: &Registry, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let path = arguments.recording.display();
    let file = File::open(&arguments.recording).with_context(|| format!("reading `{path}`"))?;
    let computed = omnibase_run::replay_from(file, registry).map_err(|error| match error {
        ReplayFileError::Read(error) => anyhow::Error::new(error).context(format!("`{path}`")),
        ReplayFileError::Replay(error) => error.into(),
    });
    let ReplayedFile { replayed, truncated, until_ns } = computed?;
    let until_s = until_ns as f64 * 1e-9;
    if let Some(why) = &truncated {
        let way_out = if arguments.partial { "" } else { "; give --partial to be content with that" };
        crate::progress::warn(format_args!(
            "`{path}` ends early ({why}): there are {} cycles, up to {until_s:.3} s{way_out}",
            replayed.cycles
        ));
    }
    let difference = replayed.difference.as_ref();
    if arguments.json {
        let found = difference.map(|found| {
            serde_json::json!({ "cycle": found.index, "channel": found.channel,
                "recorded": format!("{:?}", found.recorded), "computed": format!("{:?}", found.computed) })
        });
        let ends_early = truncated.as_ref().map(|why| serde_json::json!({ "why": why, "until_s": until_s }));
        let all = serde_json::json!({ "cycles": replayed.cycles, "same": found.is_none(), "difference": found,
            "ends_early": ends_early });
        writeln!(output, "{}", serde_json::to_string_pretty(&all)?)?;
    } else {
        match difference {
            None => writeln!(output, "{} cycles computed again, the same to the bit", replayed.cycles)?,
            Some(found) => writeln!(
                output,
                "cycle {}: {} was {:?} and is now {:?}",
                found.index, found.channel, found.recorded, found.computed
            )?,
        }
    }
    let is_enough = truncated.is_none() || arguments.partial;
    Ok(if difference.is_none() && is_enough { Outcome::Done } else { Outcome::Failed })
}
