//! The command line of omnibase: looks at EtherCAT segments, simulates them, and exchanges data with them.
#![forbid(unsafe_code)]

mod cli;
mod commands;
mod decode;
mod dictionary;
mod hex;
mod progress;
mod real_time;
mod robot_file;
mod running;
mod segment;
mod sii_json;
mod stick;
mod target;
mod terminal;
mod token;
mod value;

use clap::Parser;
use std::io::{self, BufWriter, Write};
use std::process::ExitCode;

/// How a command ended without an error of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    /// It did what was asked.
    Done,
    /// It printed what it could, but the answer to the question is "no" or "only in part".
    Failed,
}

/// Arguments that can't mean anything, found behind what the parser of the command line sees.
#[derive(Debug)]
struct WrongUsage(anyhow::Error);

impl std::fmt::Display for WrongUsage {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{:#}", self.0)
    }
}

impl std::error::Error for WrongUsage {}

fn main() -> ExitCode {
    let cli = cli::Cli::parse();
    omnibase_host::real_time::exact_timers();
    let mut output = terminal::Shown::new(BufWriter::new(io::stdout().lock()));
    let result = commands::run(&cli.command, &mut output).and_then(|outcome| {
        output.flush()?;
        Ok(outcome)
    });
    match result {
        Ok(Outcome::Done) => ExitCode::SUCCESS,
        Ok(Outcome::Failed) => ExitCode::FAILURE,
        // Whoever read our output has seen enough (`omnibase decode ... | head`).
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            // What was printed before the error belongs above it.
            let _ = output.flush();
            progress::note(format_args!("error: {}", words(&error)));
            if error.is::<WrongUsage>() { ExitCode::from(2) } else { ExitCode::FAILURE }
        }
    }
}

/// An error and its causes; a cause that the words before it end with is not said twice.
fn words(error: &anyhow::Error) -> String {
    error.chain().map(ToString::to_string).fold(String::new(), |said, cause| match said.as_str() {
        "" => cause,
        before if before.ends_with(&cause) => said,
        before => format!("{before}: {cause}"),
    })
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| {
        let kind = match cause.downcast_ref::<io::Error>() {
            Some(error) => Some(error.kind()),
            None => cause.downcast_ref::<serde_json::Error>().and_then(|error| error.io_error_kind()),
        };
        kind == Some(io::ErrorKind::BrokenPipe)
    })
}
