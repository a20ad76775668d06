//! What a shell and `man` know of this program, made from the command line itself.

use crate::Outcome;
use crate::cli::Cli;
use anyhow::Context;
use clap_complete::Shell;
use omnibase_robot::Registry;
use std::io::Write;
use std::path::PathBuf;

/// Prints what makes a shell complete this program's commands and options.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase completions bash > ~/.local/share/bash-completion/completions/omnibase
  omnibase completions zsh > ~/.zfunc/_omnibase
  omnibase completions fish > ~/.config/fish/completions/omnibase.fish")]
pub struct Arguments {
    /// Which shell.
    shell: Shell,
}

/// Writes this program's manual pages: one for itself, one for each command.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  omnibase manual ~/.local/share/man/man1 && man omnibase-run")]
pub struct Manual {
    /// The folder, which is made where it isn't there.
    folder: PathBuf,
}

/// Runs `omnibase completions`.
pub fn run(arguments: &Arguments, registry: &Registry, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    // It writes to memory: what it makes of a closed pipe is a panic.
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut Cli::command_with(registry), "omnibase", &mut script);
    output.write_all(&script)?;
    Ok(Outcome::Done)
}

/// Runs `omnibase manual`.
pub fn manual(arguments: &Manual, registry: &Registry, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let folder = &arguments.folder;
    let named = || format!("writing manual pages to `{}`", folder.display());
    std::fs::create_dir_all(folder).with_context(named)?;
    clap_mangen::generate_to(Cli::command_with(registry), folder).with_context(named)?;
    writeln!(output, "{}: man {}", folder.display(), folder.join("omnibase.1").display())?;
    Ok(Outcome::Done)
}
