//! `omnibase replay`: a recorded run computed again.

use crate::Outcome;
use anyhow::Context;
use omnibase_record::run::RecordedRun;
use omnibase_robot::Registry;
use std::io::Write;
use std::path::PathBuf;

/// Computes every cycle of a recording again and compares bit by bit; needs nothing but the recording.
#[derive(Debug, clap::Args)]
#[command(after_help = "Exit code 1 where a cycle comes out differently; the first difference is named.")]
pub struct Arguments {
    /// A recording, from `omnibase run --record`.
    recording: PathBuf,
    /// Print one JSON object: {"cycles", "same", "difference": null or {"cycle", "channel", "recorded", "computed"}}.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: &Arguments, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let path = arguments.recording.display();
    let bytes = std::fs::read(&arguments.recording).with_context(|| format!("reading `{path}`"))?;
    let run = RecordedRun::read(&bytes).with_context(|| format!("`{path}`"))?;
    if let Some(reason) = &run.truncated {
        crate::progress::note(format_args!(
            "warning: `{path}` ends early ({reason}); what is there is computed"
        ));
    }
    let replayed = omnibase_run::replay(&run, &Registry::with_built_in())?;
    let difference = replayed.difference.as_ref();
    if arguments.json {
        let found = difference.map(|found| {
            serde_json::json!({ "cycle": found.index, "channel": found.channel,
                "recorded": format!("{:?}", found.recorded), "computed": format!("{:?}", found.computed) })
        });
        let all =
            serde_json::json!({ "cycles": replayed.cycles, "same": found.is_none(), "difference": found });
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
    Ok(if difference.is_none() { Outcome::Done } else { Outcome::Failed })
}
