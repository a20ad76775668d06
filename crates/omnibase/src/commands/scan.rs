//! `omnibase scan`: what is there.

mod report;
mod table;

use crate::commands::at_robot;
use crate::dictionary::{self, OnBus};
use crate::progress::{note, warn};
use crate::target::{AnyBus, Manners, Port, Target};
use crate::{Outcome, commands};
use omnibase_ethercat::SetUpError;
use omnibase_ethercat::bus::Warning;
use omnibase_ethercat::modules::Modules;
use omnibase_ethercat::transaction::Access;
use omnibase_ethercat::trouble::Trouble;
use omnibase_ethercat::wire::bytes::u16_at;
use omnibase_ethercat::wire::{AlState, AlStatusCode, register, sii};
pub use report::Report;
use report::{CycleReport, ModulesReport, SubDeviceReport};
use std::io::Write;

/// Shows what is in a segment: identity, position, alias, ports, states, SyncManagers, FMMUs, PDOs.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase scan eth1                                   what hangs at this interface
  omnibase scan eth1 --dictionary                      with all objects and their values
  omnibase scan @robot                                 through the robot that runs on this machine
  omnibase scan sim:segments/three-sgdv.toml --json    a simulated segment, as JSON
  omnibase scan eth1 --toml > found.toml               tables for a robot's file, what must be measured marked

The segment is reset to INIT and brought to PRE-OP, where it stays; no object is written. Refused where
another program drives the segment. Exit code 1 where no SubDevice was found or one of them is
broken: it is named with the reason and left out.")]
pub struct Arguments {
    /// Network interface, @robot, or sim:<segment.toml>.
    #[arg(value_name = "INTERFACE")]
    target: Target,
    #[command(flatten)]
    manners: Manners,
    /// Read the whole object dictionary with its values (SDO Information).
    #[arg(long)]
    dictionary: bool,
    /// Print one JSON object: {"subdevices": [...], "cycle", "trouble", "notes", "warnings"}.
    #[arg(long)]
    json: bool,
    /// Print `[[drive]]` and `[[device]]` tables for a robot's file: identity, maps as found, what drives tell of
    /// encoder and torques; what must be measured or filled in is marked.
    #[arg(long, conflicts_with_all = ["json", "dictionary"])]
    toml: bool,
}

/// Runs the command.
pub fn run(arguments: &Arguments, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    if let Target::Running(address) = &arguments.target {
        anyhow::ensure!(!arguments.toml, "--toml: not of a robot that runs; it has its file");
        anyhow::ensure!(
            !arguments.dictionary,
            "--dictionary: not of a whole robot that runs; `omnibase sdo list @robot <position>` lists one SubDevice's objects"
        );
        at_robot::scan(*address, arguments.json, output)?;
        return Ok(Outcome::Done);
    }
    if arguments.toml {
        let mut bus = arguments.manners.enter(&arguments.target, Port::Socket)?.into_bus();
        commands::scan_bus(&mut bus, &arguments.target)?;
        let refusal = bus.configure_sound().err();
        commands::note_warnings(&bus);
        write!(output, "{}", table::of(&mut bus))?;
        return outcome(refusal, bus.subdevices().iter().any(|one| one.broken.is_some()));
    }
    let (report, refusal) = look(&arguments.target, arguments.manners, arguments.dictionary)?;
    report.warnings.iter().for_each(warn);
    if arguments.json {
        serde_json::to_writer_pretty(&mut *output, &report)?;
        writeln!(output)?;
    } else {
        report.print(output)?;
    }
    outcome(refusal, report.subdevices.iter().any(|one| one.broken.is_some()))
}

/// How it ended: who is broken was named and left out.
fn outcome(refusal: Option<SetUpError>, are_broken: bool) -> anyhow::Result<Outcome> {
    match refusal {
        Some(error) => Err(error.into()),
        None => Ok(if are_broken { Outcome::Failed } else { Outcome::Done }),
    }
}

/// What is there, where wished with its dictionaries; and why it can't be configured, where it can't.
pub fn look(
    target: &Target,
    manners: Manners,
    with_dictionary: bool,
) -> anyhow::Result<(Report, Option<SetUpError>)> {
    let mut bus = manners.enter(target, Port::Socket)?.into_bus();
    commands::scan_bus(&mut bus, target)?;
    // What was found is shown even where it can't be configured.
    let refusal = bus.configure_sound().err();
    let states = states(&mut bus);
    let (notes, trouble) = told(&bus.look_for_trouble()?);
    let left_out = bus.warnings().iter().filter(|warning| matches!(warning, Warning::LeftOut { .. }));
    let mut report = Report {
        subdevices: bus.subdevices().iter().map(SubDeviceReport::new).collect(),
        cycle: bus.cycle_fit().ok().map(CycleReport::from),
        trouble,
        notes,
        warnings: bus.warnings().iter().map(ToString::to_string).collect(),
        left_out: left_out.map(ToString::to_string).collect(),
    };
    for (one, state) in report.subdevices.iter_mut().zip(states) {
        one.state = state;
    }
    if refusal.is_none() {
        for one in &mut report.subdevices {
            if let Some(modules) = modules_of(&mut bus, one.position, &mut report.trouble)? {
                one.modules =
                    Some(ModulesReport { configured: modules.configured, detected: modules.detected });
            }
        }
    }
    if with_dictionary && refusal.is_none() {
        for one in &mut report.subdevices {
            one.dictionary = read_dictionary(&mut bus, one.position)?;
        }
    }
    Ok((report, refusal))
}

/// What is plugged into a modular device; `words` where that isn't what it is configured for.
fn modules_of(
    bus: &mut AnyBus,
    position: u16,
    words: &mut Vec<String>,
) -> Result<Option<Modules>, SetUpError> {
    if bus.subdevice(position)?.broken.is_some() {
        return Ok(None);
    }
    let modules = bus.read_modules(position)?;
    for slot in modules.iter().flat_map(Modules::differences) {
        words.push(format!("SubDevice {position}: {slot}"));
    }
    Ok(modules)
}

/// What may stay as it is, and what may not, in words.
fn told(all: &[Trouble]) -> (Vec<String>, Vec<String>) {
    let (notes, trouble): (Vec<&Trouble>, Vec<&Trouble>) = all.iter().partition(|one| one.is_remark());
    let words = |all: Vec<&Trouble>| all.into_iter().map(ToString::to_string).collect();
    (words(notes), words(trouble))
}

/// The dictionary; `None` where the SubDevice has none to show.
fn read_dictionary(bus: &mut AnyBus, position: u16) -> anyhow::Result<Option<Vec<dictionary::Object>>> {
    let one = bus.subdevice(position)?;
    let speaks_coe = one.mailbox.is_some_and(|mailbox| mailbox.speaks_coe());
    if !speaks_coe || one.coe_details & sii::COE_SDO_INFO == 0 {
        let lacks = if speaks_coe { "no SDO Information" } else { "no CoE mailbox" };
        note(format_args!("SubDevice {position} ({}): no dictionary to read: it has {lacks}", one.name));
        return Ok(None);
    }
    dictionary::read(&mut OnBus { bus, position }, &[], &mut |_| Ok(())).map(Some)
}

/// The state of each SubDevice in words.
fn states(bus: &mut AnyBus) -> Vec<String> {
    let mut accesses: Vec<Access> = bus
        .subdevices()
        .iter()
        .map(|one| Access::read("reading AL status", one.target(), register::AL_STATUS, 6))
        .collect();
    // An unreachable SubDevice shows in its own state.
    let all_answered = bus.transactor().perform(&mut accesses).is_ok();
    accesses
        .iter()
        .map(|access| match (&access.found, all_answered) {
            (omnibase_ethercat::error::Found::WorkingCounter(1), _) => state_words(&access.data),
            _ => "does not answer".to_owned(),
        })
        .collect()
}

fn state_words(bytes: &[u8]) -> String {
    if bytes.len() < 6 {
        return "does not answer".to_owned();
    }
    let status = u16_at(bytes, 0);
    let state = AlState::from_bits(status)
        .map_or_else(|| format!("unknown state 0x{:x}", status & 0x0F), |state| state.name().to_owned());
    if status & AlState::ERROR == 0 {
        return state;
    }
    format!("{state} + ERROR {}", AlStatusCode(u16_at(bytes, 4)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_come_in_words() {
        assert_eq!(state_words(&[2, 0, 0, 0, 0, 0]), "PRE-OP");
        assert_eq!(
            state_words(&[0x11, 0, 0, 0, 0x16, 0]),
            "INIT + ERROR 0x0016 invalid mailbox configuration"
        );
        assert_eq!(state_words(&[7, 0, 0, 0, 0, 0]), "unknown state 0x7");
        assert_eq!(state_words(&[]), "does not answer");
    }
}
