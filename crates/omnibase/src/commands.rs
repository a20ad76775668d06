//! One file per command.

pub mod decode;
pub mod sii;

use crate::Outcome;
use crate::cli::Command;
use std::io::Write;

/// Runs a command; data go to `output`.
pub fn run(command: &Command, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    match command {
        Command::Decode(arguments) => decode::run(arguments, output),
        Command::Sii(arguments) => sii::run(arguments, output),
    }
}
