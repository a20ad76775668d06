//! `omnibase bridge`: a bridge to another system, beside a robot that runs.

use crate::Outcome;
use crate::bridges::Bridge;
use omnibase_host::stop_on_signals;

/// Starts a bridge from a running robot to another system, and starts it again where it ends.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase bridge ros2                                     ROS 2's side of the robot that runs here
  omnibase bridge ros2 --namespace /robot_1 --cmd-vel twist
  omnibase bridge ros2 --help                              what that bridge can be told

The bridge NAME is the program `omnibase-bridge-NAME`, beside `omnibase` or in PATH: yours too. In the robot's file a table
[bridge.NAME] starts it with the run. It finds its robot in the environment (OMNIBASE_ROBOT), or as `omnibase get` does.")]
pub struct Arguments {
    /// Which bridge.
    name: String,
    /// What the bridge is told.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "ARGUMENTS")]
    arguments: Vec<String>,
}

/// Runs the command, until the bridge has done what it was asked for, or Ctrl-C.
pub fn run(arguments: &Arguments) -> anyhow::Result<Outcome> {
    let bridge = Bridge::find(&arguments.name, arguments.arguments.clone())?;
    let done = bridge.supervise(None, stop_on_signals()?);
    Ok(if done { Outcome::Done } else { Outcome::Failed })
}
