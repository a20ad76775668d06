//! The command line as clap reads it.

use crate::commands::{
    check, decode, doctor, exchange, joystick, kinematics, live, replay, report, run, scan, sdo, sii,
    simulate,
};
use clap::{Parser, Subcommand};

/// Real-time control of omnidirectional robots over EtherCAT.
///
/// Exit codes: 0 done, 1 failed, 2 wrong usage. Data go to the standard output, progress and errors to the
/// standard error.
#[derive(Debug, Parser)]
#[command(name = "omnibase", version, max_term_width = 110)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// One command each.
#[derive(Debug, Subcommand)]
pub enum Command {
    Run(Box<run::Arguments>),
    Check(check::Arguments),
    Kinematics(kinematics::Arguments),
    Replay(replay::Arguments),
    Report(report::Arguments),
    Get(live::Get),
    Set(live::Set),
    Call(live::Call),
    Top(live::Top),
    Joystick(joystick::Arguments),
    Doctor(doctor::Arguments),
    Scan(scan::Arguments),
    Sdo(sdo::Arguments),
    Exchange(exchange::Arguments),
    Simulate(simulate::Arguments),
    Decode(decode::Arguments),
    Sii(sii::Arguments),
}

#[cfg(test)]
mod tests;
