//! The product as a library: [`cli`] is the whole command line, for a program with stages of its own.
//!
//! ```no_run
//! use omnibase::prelude::*;
//!
//! fn main() -> std::process::ExitCode {
//!     omnibase::cli(|registry| {
//!         // registry.add_controller(mine::kind(), mine::Mine::new);
//!         let _ = registry;
//!     })
//! }
//! ```
//!
//! [`prelude`] has what stages are written with; [`robot`], [`platform`] and [`run`] have the rest. `omnibase new` makes such a
//! crate. [`simulate`] drives a robot once, for tests; [`bus`] looks at a segment.
#![forbid(unsafe_code)]

mod bridges;
pub mod bus;
mod cli;
mod commands;
mod correction_file;
mod decode;
mod dictionary;
mod every;
mod hex;
mod joystick;
mod new_file;
pub mod prelude;
mod progress;
mod real_time;
mod robot_file;
mod robot_table;
mod running;
mod segment;
mod sii_json;
mod small_file;
mod target;
mod terminal;
mod to_the_end;
mod token;
mod value;

pub use omnibase_platform as platform;
pub use omnibase_robot as robot;
pub use omnibase_run as run;

use omnibase_ethercat_sim::in_process;
use omnibase_robot::{Registry, Robot};
use omnibase_run::simulated::Script;
use omnibase_run::{Progress, Ran, Setup, simulated};
use robot_file::{Changes, RobotSource};
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

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

/// Drives the robot of a file along its `[reference]` once, from bring-up to the drives' end: on its simulated robot and on
/// virtual time, with the kinds that `register` adds to the built-in ones.
///
/// An error lists every problem of the file, or says that its motion has no end; how the run itself ended is in [`Ran`].
pub fn simulate(robot: &Path, register: impl FnOnce(&mut Registry)) -> anyhow::Result<Ran> {
    let mut registry = Registry::with_built_in();
    register(&mut registry);
    let robot = RobotSource::read(robot, &Changes::default())?.load_or_explain(&registry)?;
    let (mut segment, machine) = simulated::segment(&robot.plan)?;
    let script = Script::new(&robot.plan, &mut segment, &machine);
    let (link, clock) = in_process(segment);
    let stages = Robot::build(&robot.plan, &registry)?;
    anyhow::ensure!(
        stages.reference_duration_s().is_some(),
        "the [reference] has no end, and nobody stops it"
    );
    let setup = Setup {
        plan: &robot.plan,
        robot: stages,
        machine: Some(machine),
        script,
        recording: None,
        live: None,
        stop: &AtomicBool::new(false),
        progress: &Progress::default(),
    };
    Ok(omnibase_run::run(link, clock, setup, &mut |text| progress::warn(text))?)
}

/// The whole program: the command line of omnibase, with the kinds that `register` adds to the built-in ones.
///
/// Reads the program's arguments; the exit code is 0 for done, 1 for failed, 2 for wrong usage.
pub fn cli(register: impl FnOnce(&mut Registry)) -> ExitCode {
    let mut registry = Registry::with_built_in();
    register(&mut registry);
    let cli = cli::Cli::read(&registry);
    progress::show(cli.log_level);
    omnibase_host::real_time::exact_timers();
    let mut output = terminal::Shown::new(BufWriter::new(io::stdout().lock()));
    let result = commands::run(&cli.command, &Arc::new(registry), &mut output).and_then(|outcome| {
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
            progress::error(words(&error));
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
