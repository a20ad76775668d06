//! The command line as clap reads it.

use crate::commands::run::reference::ReferenceChoice;
use crate::commands::{
    bridge, calibrate, check, completions, decode, description, doctor, eeprom, esi, estimate, exchange,
    export, foe, joystick, kinematics, learn, live, margins, new, plan, replay, report, run, scan, sdo,
    setup, sii, simulate,
};
use crate::progress::LogLevel;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use omnibase_measure::measured::FloorPose;
use omnibase_robot::Registry;
use std::ffi::OsString;

/// Real-time control of omnidirectional robots over EtherCAT.
///
/// Exit codes: 0 done, 1 failed, 2 wrong usage. Data go to the standard output, progress and errors to the
/// standard error.
#[derive(Debug, Parser)]
#[command(name = "omnibase", version, max_term_width = 110)]
pub struct Cli {
    /// What is printed on the standard error: this and what is graver.
    #[arg(long, global = true, value_name = "LEVEL", default_value = "info")]
    pub log_level: LogLevel,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// One command each.
#[derive(Debug, Subcommand)]
pub enum Command {
    Run(Box<run::Arguments>),
    Check(check::Arguments),
    Calibrate(calibrate::Arguments),
    Learn(learn::Arguments),
    Estimate(estimate::Arguments),
    Kinematics(kinematics::Arguments),
    Margins(margins::Arguments),
    Plan(plan::Arguments),
    Replay(replay::Arguments),
    Report(report::Arguments),
    Export(export::Arguments),
    Urdf(description::Urdf),
    Mjcf(description::Mjcf),
    Get(live::Get),
    Set(live::Set),
    Call(live::Call),
    Send(live::Send),
    Drive(live::Drive),
    Watch(live::Watch),
    Top(live::Top),
    Bridge(bridge::Arguments),
    Joystick(joystick::Arguments),
    Doctor(doctor::Arguments),
    Esi(esi::Arguments),
    Scan(scan::Arguments),
    Sdo(sdo::Arguments),
    Eeprom(eeprom::Arguments),
    Foe(foe::Arguments),
    Setup(setup::Arguments),
    Exchange(exchange::Arguments),
    Simulate(simulate::Arguments),
    Decode(decode::Arguments),
    Sii(sii::Arguments),
    New(new::Arguments),
    Completions(completions::Arguments),
    Manual(completions::Manual),
}

impl Cli {
    /// The command line with an option for each registered motion.
    pub fn command_with(registry: &Registry) -> clap::Command {
        let with_motions = |command| ReferenceChoice::options(command, registry);
        Cli::command()
            .mut_subcommand("run", |run| ReferenceChoice::with_correction(with_motions(run)))
            .mut_subcommand("check", with_motions)
            .mut_subcommand("learn", with_motions)
    }

    /// What a matched command line says.
    pub fn from_matches(matches: &clap::ArgMatches) -> Result<Self, clap::Error> {
        let mut cli = Cli::from_arg_matches(matches)?;
        let Some((_, own)) = matches.subcommand() else { return Ok(cli) };
        match &mut cli.command {
            Command::Run(arguments) => arguments.choose_motion(own),
            Command::Check(arguments) => arguments.choose_motion(own),
            Command::Learn(arguments) => arguments.choose_motion(own),
            _ => {}
        }
        Ok(cli)
    }

    /// The program's own; ends the program where it is wrong or asks for help.
    pub fn read(registry: &Registry) -> Self {
        let mut command = Cli::command_with(registry);
        let matches = command
            .try_get_matches_from_mut(joined(std::env::args_os()))
            .unwrap_or_else(|error| error.exit());
        Cli::from_matches(&matches).unwrap_or_else(|error| error.format(&mut command).exit())
    }
}

/// `--measured POSE` as `--measured=POSE`: its value may be left out, and what follows is one where it is a pose, be it negative.
pub fn joined(words: impl Iterator<Item = OsString>) -> Vec<OsString> {
    let mut all: Vec<OsString> = Vec::new();
    for word in words {
        let is_pose = word.to_str().is_some_and(|word| word.parse::<FloorPose>().is_ok());
        match all.last_mut() {
            Some(last) if is_pose && *last == "--measured" => {
                last.push("=");
                last.push(word);
            }
            _ => all.push(word),
        }
    }
    all
}

#[cfg(test)]
mod tests;
