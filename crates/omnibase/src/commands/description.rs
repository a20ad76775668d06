//! `omnibase urdf` and `omnibase mjcf`: a robot's file as other programs draw it and compute with it.

use crate::Outcome;
use crate::robot_file::{Changes, RobotSource};
use anyhow::Context;
use omnibase_description::{Description, Names};
use omnibase_robot::Registry;
use std::io::Write;
use std::path::PathBuf;

/// Prints the robot as URDF: base_link and a continuous joint for each wheel, with masses, inertias and limits.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase urdf robots/bmm.toml > bmm.urdf
  omnibase urdf robots/bmm.toml --prefix robot_1/ --output robot_1.urdf

Links and joints are called as in ROS 2's joint_states: wheel_1_link, wheel_1_joint. What it weighs is what `omnibase check` prints.
Rollers don't exist in URDF.")]
pub struct Urdf {
    #[command(flatten)]
    of: Of,
    /// Stands before the name of every link and joint.
    #[arg(long, value_name = "TEXT", default_value = "")]
    prefix: String,
}

/// Prints the robot as MJCF for MuJoCo: a base that slides and turns on the floor, wheels with motors.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  omnibase mjcf robots/mecanum.toml --output mecanum.xml

What it weighs is what `omnibase check` prints. Nothing touches the floor: rollers and their grip aren't in the model.")]
pub struct Mjcf {
    #[command(flatten)]
    of: Of,
}

/// Which robot, and where it is written.
#[derive(Debug, clap::Args)]
struct Of {
    /// Robot file (TOML).
    robot: PathBuf,
    #[command(flatten)]
    changes: Changes,
    /// The file to write; default: the standard output.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

impl Of {
    fn description(&self, registry: &Registry) -> anyhow::Result<Description> {
        let source = RobotSource::read(&self.robot, &self.changes)?;
        Ok(omnibase_run::mechanics::description(&source.load_or_explain(registry)?.plan))
    }

    fn write(&self, text: &str, output: &mut dyn Write) -> anyhow::Result<Outcome> {
        match &self.output {
            Some(path) => {
                std::fs::write(path, text).with_context(|| format!("writing `{}`", path.display()))?;
            }
            None => output.write_all(text.as_bytes())?,
        }
        Ok(Outcome::Done)
    }
}

/// Runs `omnibase urdf`.
pub fn urdf(arguments: &Urdf, registry: &Registry, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let Urdf { of, prefix } = arguments;
    let base = format!("{prefix}base_link");
    let names = Names { prefix, base: &base };
    of.write(&omnibase_description::urdf(&of.description(registry)?, names), output)
}

/// Runs `omnibase mjcf`.
pub fn mjcf(arguments: &Mjcf, registry: &Registry, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    arguments.of.write(&omnibase_description::mjcf(&arguments.of.description(registry)?), output)
}
