//! `omnibase watch`: signals of a running robot as lines of text, in every cycle or every so many.

use super::{Line, Which};
use crate::Outcome;
use crate::every::Every;
use crate::progress::note;
use anyhow::Context;
use omnibase_client::{States, Wanted};
use std::io::{self, ErrorKind, Write};
use std::time::Duration;

/// Looked for rows at least so often.
const LOOK: Duration = Duration::from_secs(1);

/// Writes signals of a running robot as CSV, with the instants at which they were so.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase watch 'state.*' --every 10ms            pose and speed, a hundred times a second
  omnibase watch 'wheel_*.torque*' --rows 1000     every cycle, a thousand of them
  omnibase watch state.pose_x_m | my_program

The first line names the columns; their units end the names. Cycles that this program or its line was too slow for are
counted on standard error.")]
pub struct Watch {
    /// Names of signals, where `*` stands for any characters; default: all.
    signals: Vec<String>,
    /// Time from row to row, as 10ms or 5cycles; default: every cycle.
    #[arg(long, value_name = "TIME")]
    every: Option<Every>,
    /// End after so many rows.
    #[arg(long, value_name = "N")]
    rows: Option<u64>,
    #[command(flatten)]
    which: Which,
}

/// Runs `omnibase watch`.
pub fn watch(arguments: &Watch, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let line = Line::new(&arguments.which)?;
    let every_ms = match arguments.every {
        None => None,
        Some(Every::Ns(ns)) => Some(ns as f64 / 1e6),
        Some(Every::Cycles(cycles)) => {
            let cycle_s = line.read("robot")?["cycle_s"].as_f64().context("the robot says no cycle")?;
            Some(cycles as f64 * cycle_s * 1e3)
        }
    };
    let wanted = Wanted { signals: arguments.signals.clone(), every_ms };
    let mut states = States::follow(&line.robot, &wanted)?;
    let (mut told, mut left) = (0, arguments.rows.unwrap_or(u64::MAX));
    match write(&mut states, &mut left, &mut told, output) {
        // Whoever read has enough.
        Err(error)
            if error.downcast_ref::<io::Error>().is_some_and(|e| e.kind() == ErrorKind::BrokenPipe) => {}
        written => written?,
    }
    Ok(Outcome::Done)
}

fn write(states: &mut States, left: &mut u64, told: &mut u64, output: &mut dyn Write) -> anyhow::Result<()> {
    writeln!(output, "instant_s,{}", states.names().join(","))?;
    while *left > 0 {
        for row in states.rows(LOOK)?.into_iter().take(usize::try_from(*left).unwrap_or(usize::MAX)) {
            *left -= 1;
            write!(output, "{:.9}", row.instant_ns as f64 * 1e-9)?;
            for value in row.values {
                // No number is an empty field.
                match value.is_nan() {
                    true => write!(output, ",")?,
                    false => write!(output, ",{value}")?,
                }
            }
            writeln!(output)?;
        }
        output.flush()?;
        if states.missing() > *told {
            note(format_args!("{} cycles are missing", states.missing()));
            *told = states.missing();
        }
    }
    Ok(())
}
