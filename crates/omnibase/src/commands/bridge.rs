//! `omnibase bridge`: a bridge to another system, beside a robot that runs.

use crate::bridges::Bridge;
use crate::{Outcome, WrongUsage};
use omnibase_host::stop_on_signals;
use std::path::PathBuf;

/// Starts a bridge from a running robot to another system, and starts it again where it ends.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase bridge ros2                                     ROS 2's side of the robot that runs here
  omnibase bridge ros2 --namespace /robot_1 --cmd-vel twist
  omnibase bridge ros2 --help                              what that bridge can be told

The bridge NAME is the program `omnibase-bridge-NAME`, beside `omnibase` or in PATH: yours too. In the robot's file a table
[bridge.NAME] starts it with the run. It finds its robot in the environment (OMNIBASE_ROBOT), or as `omnibase get` does.")]
pub struct Arguments {
    /// Which program it is; default: `omnibase-bridge-NAME`.
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,
    /// Which bridge.
    name: String,
    /// What the bridge is told.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARGUMENTS")]
    arguments: Vec<String>,
}

/// Runs the command, until the bridge has done what it was asked for, or Ctrl-C.
pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let (name, words) = (&arguments.name, arguments.arguments.clone());
    let bridge = match &arguments.program {
        None => Bridge::find(name, words)?,
        Some(program) => {
            anyhow::ensure!(program.is_file(), "--program: there is no {}", program.display());
            Bridge::at(name, program.clone(), words)
        }
    };
    match bridge.supervise(None, stop_on_signals()?) {
        true => Ok(Outcome::Done),
        false => {
            Err(WrongUsage(anyhow::anyhow!("bridge {name}: its arguments are wrong: it isn't started again"))
                .into())
        }
    }
}
