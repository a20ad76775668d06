//! `omnibase check`: all problems of a robot's file at once, else what it resolves to; and its motion, planned dry.

mod cycle;
mod dry;
pub(super) mod picture;
mod plan;
mod rows;

use super::run::reference::ReferenceChoice;
use crate::Outcome;
use crate::progress;
use crate::robot_file::{Changes, RobotSource, plural};
use anyhow::Context;
use omnibase_robot::config::ProblemKind;
use omnibase_robot::dry::DryRun;
use omnibase_robot::{Problem, Registry};
use omnibase_run::LoadedRobot;
use omnibase_run::room::{Room, RoomError};
use serde_json::{Value, json};
use std::io::{self, Write};
use std::path::PathBuf;

/// Checks a robot's file without any hardware: all problems at once with file, line and column, else the plan, and warnings of what
/// is allowed and probably not meant.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase check robots/bmm.toml
  omnibase check robots/bmm.toml --json
  omnibase check robots/bmm.toml --path robots/square.dat --timing fastest --picture square.svg     a motion, planned dry
  omnibase check --kinds                                 what may be chosen by name, and which keys it reads
  omnibase check --schema > robots/robot.schema.json     for editors

Exit code 1 where the file has a problem.")]
pub struct Arguments {
    /// Robot file (TOML).
    #[arg(required_unless_present_any = ["schema", "kinds"])]
    robot: Option<PathBuf>,
    #[command(flatten)]
    changes: Changes,
    #[arg(skip)]
    reference: ReferenceChoice,
    /// Draw the motion as an SVG: its way and its speed, in the colours of the limits that bind.
    #[arg(long, value_name = "FILE", value_parser = picture::svg_file)]
    picture: Option<PathBuf>,
    /// Print JSON: {"problems": [...]} or the plan; or the kinds.
    #[arg(long)]
    json: bool,
    /// Print the JSON schema of robot files.
    #[arg(long)]
    schema: bool,
    /// Print the controllers, references, estimators, devices and layouts with the keys that they read.
    #[arg(long, conflicts_with = "schema")]
    kinds: bool,
}

/// Runs the command.
pub fn run(arguments: &Arguments, registry: &Registry, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let Some(path) = arguments.robot.as_deref().filter(|_| !arguments.schema && !arguments.kinds) else {
        let kinds = registry.describe();
        if arguments.kinds && !arguments.json {
            print_kinds(&kinds, output)?;
        } else {
            let told = if arguments.kinds { kinds } else { registry.json_schema() };
            serde_json::to_writer_pretty(&mut *output, &told)?;
            writeln!(output)?;
        }
        return Ok(Outcome::Done);
    };
    let mut source = RobotSource::read(path, &arguments.changes)?;
    source.text.reference = arguments.reference.chosen(registry)?;
    let loaded = source.load(registry).and_then(|robot| {
        let room = Room::of(&robot.plan, &source.text.folder);
        Ok((room.map_err(|error| vec![of_room(&robot, &error)])?, robot))
    });
    match loaded {
        Ok((room, robot)) => {
            crate::correction_file::warn_of_anothers(&robot.plan, &source.text.folder, registry);
            let motion =
                progress::meanwhile("planning the motion dry", || arguments.motion(&robot, registry))?;
            let as_given_s = if motion.is_some() { dry::as_given_s(&robot, registry)? } else { None };
            if arguments.json {
                let mut plan = plan::json(&robot.plan);
                if let Some(motion) = &motion {
                    plan["motion"] = dry::json(motion, as_given_s);
                }
                serde_json::to_writer_pretty(&mut *output, &plan)?;
                writeln!(output)?;
            } else {
                plan::print(&robot.plan, &room, output)?;
                cycle::print(&robot.plan, output)?;
                if let Some(motion) = &motion {
                    dry::print(motion, as_given_s, output)?;
                }
                for doubt in robot.plan.doubts() {
                    writeln!(output, "\nWARNING: {doubt}")?;
                }
            }
            Ok(Outcome::Done)
        }
        Err(problems) => {
            if arguments.json {
                let list: Vec<Value> = problems.iter().map(problem_json).collect();
                serde_json::to_writer_pretty(&mut *output, &json!({ "problems": list }))?;
                writeln!(output)?;
            } else {
                for problem in &problems {
                    writeln!(output, "{}", source.explain(problem))?;
                }
                writeln!(output, "{} in {}", plural(problems.len()), path.display())?;
            }
            Ok(Outcome::Failed)
        }
    }
}

impl Arguments {
    /// The motion that the command line chose.
    pub fn choose_motion(&mut self, matches: &clap::ArgMatches) {
        self.reference = ReferenceChoice::of(matches);
    }

    /// The motion that is asked for, planned dry and drawn; `None` where only the file is checked.
    fn motion(&self, robot: &LoadedRobot, registry: &Registry) -> anyhow::Result<Option<DryRun>> {
        if !self.reference.is_chosen() && self.picture.is_none() {
            return Ok(None);
        }
        let motion = dry::plan(robot, registry)?;
        if let Some(file) = &self.picture {
            std::fs::write(file, picture::svg(&robot.plan, &motion))
                .with_context(|| format!("writing `{}`", file.display()))?;
        }
        Ok(Some(motion))
    }
}

/// What is wrong with the room, by its setting.
fn of_room(robot: &LoadedRobot, error: &RoomError) -> Problem {
    let file = robot.plan.map.as_ref().and_then(|map| map.file.clone());
    match error {
        RoomError::File { name, why } => Problem {
            value: file,
            ..Problem::new(ProblemKind::File, "map.file", format_args!("{name}: {why}"))
        },
        RoomError::Footprint(error) => Problem::refused("platform.footprint_m", error),
        error => Problem::refused("map", error),
    }
}

/// Each kind with its keys; those that must be given have a star.
fn print_kinds(sorts: &Value, output: &mut dyn Write) -> io::Result<()> {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    for sort in list(sorts) {
        let default = sort["default"].as_str().map_or(String::new(), |name| format!(", default: {name}"));
        writeln!(output, "[{}] {}{default}", text(&sort["table"]), text(&sort["key"]))?;
        for kind in list(&sort["kinds"]) {
            writeln!(output, "  {:<30} {}.", text(&kind["name"]), text(&kind["meaning"]))?;
            for key in list(&kind["keys"]) {
                let star = if key["needed"] == true { '*' } else { ' ' };
                let (meaning, allowed) = (text(&key["meaning"]), text(&key["allowed"]));
                let allowed = if allowed.is_empty() { allowed } else { format!(" Allowed: {allowed}.") };
                writeln!(output, "   {star} {:<28} {meaning}{allowed}", text(&key["name"]))?;
            }
        }
        writeln!(output)?;
    }
    writeln!(output, "* must be given")
}

fn problem_json(problem: &Problem) -> Value {
    let Problem { setting, value, limit, reason, place, .. } = problem;
    json!({
        "setting": setting, "value": value, "limit": limit, "reason": reason,
        "file": place.as_ref().and_then(|place| place.file.as_ref()),
        "line": place.as_ref().map(|place| place.line),
        "column": place.as_ref().map(|place| place.column),
    })
}
