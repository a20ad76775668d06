//! One file per command, and what several of them do alike.

pub mod at_robot;
pub mod bridge;
pub mod calibrate;
pub mod check;
pub mod completions;
pub mod decode;
pub mod description;
pub mod doctor;
pub mod eeprom;
pub mod esi;
pub mod estimate;
pub mod exchange;
pub mod export;
pub mod foe;
pub mod joystick;
pub mod kinematics;
pub mod learn;
pub mod live;
pub mod margins;
pub mod new;
pub mod plan;
pub mod replay;
pub mod report;
pub mod run;
pub mod scan;
pub mod sdo;
pub mod setup;
pub mod sii;
pub mod simulate;

use crate::Outcome;
use crate::cli::Command;
use crate::progress::warn;
use crate::target::{AnyBus, Target};
use anyhow::Context;
use omnibase_robot::Registry;
use std::io::Write;
use std::sync::Arc;

/// Runs a command; data go to `output`.
pub fn run(command: &Command, registry: &Arc<Registry>, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    match command {
        Command::Run(arguments) => run::run(arguments, registry, output),
        Command::Check(arguments) => check::run(arguments, registry, output),
        Command::Calibrate(arguments) => calibrate::run(arguments, registry, output),
        Command::Learn(arguments) => learn::run(arguments, registry, output),
        Command::Estimate(arguments) => estimate::run(arguments, registry, output),
        Command::Kinematics(arguments) => kinematics::run(arguments, registry, output),
        Command::Margins(arguments) => margins::run(arguments, registry, output),
        Command::Plan(arguments) => plan::run(arguments, registry, output),
        Command::Replay(arguments) => replay::run(arguments, registry, output),
        Command::Report(arguments) => report::run(arguments, registry, output),
        Command::Export(arguments) => export::run(arguments, registry, output),
        Command::Urdf(arguments) => description::urdf(arguments, registry, output),
        Command::Mjcf(arguments) => description::mjcf(arguments, registry, output),
        Command::Get(arguments) => live::get(arguments, output),
        Command::Set(arguments) => live::set(arguments, output),
        Command::Call(arguments) => live::call(arguments, output),
        Command::Send(arguments) => live::send(arguments, output),
        Command::Drive(arguments) => live::drive(arguments, output),
        Command::Watch(arguments) => live::watch(arguments, output),
        Command::Top(arguments) => live::top(arguments, output),
        Command::Bridge(arguments) => bridge::run(arguments),
        Command::Doctor(arguments) => doctor::run(arguments, output),
        Command::Esi(arguments) => esi::run(arguments, output),
        Command::Joystick(arguments) => joystick::run(arguments, registry, output),
        Command::Scan(arguments) => scan::run(arguments, output),
        Command::Sdo(arguments) => sdo::run(arguments, output),
        Command::Eeprom(arguments) => eeprom::run(arguments, output),
        Command::Foe(arguments) => foe::run(arguments, output),
        Command::Setup(arguments) => setup::run(arguments, output),
        Command::Exchange(arguments) => exchange::run(arguments, output),
        Command::Simulate(arguments) => simulate::run(arguments, registry, output),
        Command::Decode(arguments) => decode::run(arguments, output),
        Command::Sii(arguments) => sii::run(arguments, output),
        Command::New(arguments) => new::run(arguments, output),
        Command::Completions(arguments) => completions::run(arguments, registry, output),
        Command::Manual(arguments) => completions::manual(arguments, registry, output),
    }
}

/// Where a page is served unless something else is said.
const DASHBOARD: &str = "127.0.0.1:8400";

/// Finds the SubDevices behind `target`; an error says where it looked.
fn scan_bus(bus: &mut AnyBus, target: &Target) -> anyhow::Result<()> {
    bus.scan().with_context(|| target.to_string())?;
    Ok(())
}

/// Tells what a person should know of the segment.
fn note_warnings(bus: &AnyBus) {
    for warning in bus.warnings() {
        warn(format_args!("{warning}"));
    }
}
