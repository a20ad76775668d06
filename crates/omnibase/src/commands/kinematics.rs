//! `omnibase kinematics`: from the platform's motion to its wheels and back.

use crate::Outcome;
use crate::robot_file::{Changes, RobotSource};
use crate::terminal::fixed;
use omnibase_platform::{PerWheel, Twist2};
use omnibase_robot::Registry;
use serde_json::{Map, Value, json};
use std::io::Write;
use std::path::PathBuf;

/// Wheel speeds of a platform's motion, or the motion of wheel speeds.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("what").required(true), after_help = "Examples:
  omnibase kinematics robots/bmm.toml --twist \"0.5 0 0.2\"      vx m/s, vy m/s (left), w rad/s (counter-clockwise)
  omnibase kinematics robots/bmm.toml --wheels \"1 1 1\" --json   rad/s, in the order of the drives")]
pub struct Arguments {
    /// Robot file (TOML).
    robot: PathBuf,
    #[command(flatten)]
    changes: Changes,
    /// Motion of the platform in its own frame: vx vy w, in m/s and rad/s.
    #[arg(long, group = "what", value_name = "VX VY W", allow_hyphen_values = true)]
    twist: Option<String>,
    /// Speeds of the wheels, rad/s.
    #[arg(long, group = "what", value_name = "W1 W2 W3", allow_hyphen_values = true)]
    wheels: Option<String>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: &Arguments, registry: &Registry, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let source = RobotSource::read(&arguments.robot, &arguments.changes)?;
    let plan = source.load_or_explain(registry)?.plan;
    let names: Vec<&str> = plan.drives.iter().map(|drive| drive.name.as_str()).collect();
    if let Some(text) = &arguments.twist {
        let [vx, vy, w] = numbers(text, "--twist", 3)?[..] else { unreachable!("three were asked for") };
        let speeds = plan.kinematics.wheel_speeds_rad_s(Twist2::new(vx, vy, w));
        if arguments.json {
            let speeds: Map<String, Value> = names
                .iter()
                .zip(speeds.iter())
                .map(|(name, speed)| ((*name).to_owned(), json!(speed)))
                .collect();
            writeln!(output, "{}", serde_json::to_string_pretty(&json!({ "wheel_speeds_rad_s": speeds }))?)?;
        } else {
            for (name, speed) in names.iter().zip(speeds.iter()) {
                writeln!(output, "{name:<16} {:>12} rad/s", fixed(*speed, 6))?;
            }
        }
        return Ok(Outcome::Done);
    }
    let speeds = numbers(arguments.wheels.as_deref().unwrap_or_default(), "--wheels", names.len())?;
    let measured = plan.kinematics.twist(&PerWheel::from_fn(speeds.len(), |wheel| speeds[wheel]));
    let Twist2 { vx_m_s, vy_m_s, w_rad_s } = measured.twist_in_base;
    let residual_m_s = measured.residual_m_s;
    if arguments.json {
        let twist = json!({ "vx_m_s": vx_m_s, "vy_m_s": vy_m_s, "w_rad_s": w_rad_s });
        let all = json!({ "twist": twist, "residual_m_s": residual_m_s });
        writeln!(output, "{}", serde_json::to_string_pretty(&all)?)?;
    } else {
        writeln!(output, "vx       {:>12} m/s\nvy       {:>12} m/s", fixed(vx_m_s, 6), fixed(vy_m_s, 6))?;
        writeln!(
            output,
            "w        {:>12} rad/s\nresidual {:>12} m/s",
            fixed(w_rad_s, 6),
            fixed(residual_m_s, 6)
        )?;
    }
    Ok(Outcome::Done)
}

/// So many finite numbers, separated by blanks or commas.
fn numbers(text: &str, option: &str, count: usize) -> anyhow::Result<Vec<f64>> {
    let words = text.split([' ', ',', '\t']).filter(|word| !word.is_empty());
    let values: Vec<Option<f64>> =
        words.map(|word| word.parse().ok().filter(|value: &f64| value.is_finite())).collect();
    let found = values.len();
    let values: Option<Vec<f64>> = values.into_iter().collect();
    values.filter(|values| values.len() == count).ok_or_else(|| {
        let what = format!("{option} \"{text}\": expected {count} finite numbers, found {found} words");
        crate::WrongUsage(anyhow::Error::msg(what)).into()
    })
}
