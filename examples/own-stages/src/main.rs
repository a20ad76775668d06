//! Runs the robot of `robot.toml`, or of the file that is given, on the simulated robot, and says how well it went.

use anyhow::Context;
use omnibase_robot::signals::RequestKind;
use omnibase_robot::{Phase, Registry, RobotPlan};
use own_stages::simulated::SimulatedRobot;
use std::path::Path;

/// The robot file beside this crate.
const ROBOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/robot.toml");

fn main() -> anyhow::Result<()> {
    let path = std::env::args().nth(1).unwrap_or_else(|| ROBOT.into());
    let text = std::fs::read_to_string(&path).with_context(|| format!("reading {path}"))?;
    let mut registry = Registry::with_built_in();
    own_stages::register(&mut registry);
    let folder = Path::new(&path).parent().unwrap_or(Path::new("."));
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).map_err(|error| error.to_string());
    let plan = RobotPlan::from_toml(&text, &registry, &read).map_err(|problems| {
        let lines: Vec<String> = problems.iter().map(|problem| format!("{path}:{problem}")).collect();
        anyhow::Error::msg(lines.join("\n"))
    })?;

    let mut simulated = SimulatedRobot::bring_up(&plan, &registry)?;
    simulated.until(RequestKind::Enable, 10_000, |_, robot| robot.phase() == Phase::Holding)?;
    let duration_s = simulated.robot.reference_duration_s().context("the reference has no end")?;
    println!("{}: {} for {duration_s} s", plan.name, plan.reference.kind.as_deref().unwrap_or("hold"));

    let most = (1.5 * duration_s * 1e9) as u64 / plan.bus.cycle_ns + 1000;
    let ended = simulated.until(RequestKind::Track, most, |_, robot| robot.phase() != Phase::Tracking)?;
    anyhow::ensure!(
        simulated.robot.phase() == Phase::Holding,
        "stopped: {} at {}",
        ended.stop_reason.text(),
        ended.stop_where
    );
    // A second at rest, so that nothing swings any more.
    for _ in 0..1_000_000_000 / plan.bus.cycle_ns {
        simulated.cycle(None)?;
    }

    let (wished, believed) = (simulated.robot.record().wished, simulated.robot.record().state);
    let truth = simulated.truth().pose;
    let [wished, believed] = [wished.odom_from_body, believed.odom_from_body];
    let error_mm = |x_m: f64, y_m: f64| 1e3 * (x_m - wished.x_m).hypot(y_m - wished.y_m);
    println!("final error, believed: {:.3} mm", error_mm(believed.x_m, believed.y_m));
    println!("final error, true:     {:.3} mm", error_mm(truth.x_m, truth.y_m));
    Ok(())
}
