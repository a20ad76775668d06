//! Runs the robot of `robot.toml`, or of the file that is given, on the simulated robot, and says how well it went.

use anyhow::Context;
use omnibase_robot::Registry;
use omnibase_run::RobotText;
use std::path::Path;

/// The robot file beside this crate.
const ROBOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/robot.toml");

fn main() -> anyhow::Result<()> {
    let path = std::env::args().nth(1).unwrap_or_else(|| ROBOT.into());
    let text = std::fs::read_to_string(&path).with_context(|| format!("reading {path}"))?;
    let folder = Path::new(&path).parent().unwrap_or(Path::new(".")).to_owned();
    let mut registry = Registry::with_built_in();
    own_stages::register(&mut registry);
    let robot = RobotText { text, folder, ..RobotText::default() }.load(&registry).map_err(|problems| {
        let lines: Vec<String> = problems.iter().map(|problem| format!("{path}:{problem}")).collect();
        anyhow::Error::msg(lines.join("\n"))
    })?;

    let ran = own_stages::simulate(&robot.plan, &registry)?;
    let summary = &ran.summary;
    let millimetres = |metres: Option<f64>| 1e3 * metres.unwrap_or(f64::NAN);
    println!("{}: {} cycles", robot.plan.name, summary.cycles);
    println!("final error, believed: {:.3} mm", millimetres(summary.final_error_m.believed));
    println!("final error, true:     {:.3} mm", millimetres(summary.final_error_m.truth));
    ran.ended?;
    Ok(())
}
