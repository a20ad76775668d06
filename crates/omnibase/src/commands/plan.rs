//! `omnibase plan`: a way through a known room, with its times.

mod picture;

use super::check::picture::svg_file;
use crate::Outcome;
use crate::progress::{meanwhile, note};
use crate::robot_file::{Changes, RobotSource};
use anyhow::{Context, bail};
use omnibase_plan::{PlanError, Until};
use omnibase_platform::Pose2;
use omnibase_robot::config::{BestWay, UnknownCells};
use omnibase_robot::{Ability, Registry, RobotPlan};
use omnibase_run::room::{Room, RoomError, TimedWay, WayRequest, read_map};
use picture::Driven;
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Samples of a way's motion, for figures and pictures.
const SAMPLES: u32 = 1000;

/// Plans a way through a known room: the shortest one that the robot's footprint can take, turned where it is narrow, in the shortest
/// time that its limits allow.
///
/// The room is the [map] table of the robot's file, or a map of ROS's map_server by --map, with the file's fence and obstacles.
/// Nothing moves.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase plan robots/bmm.toml --map office.yaml --from \"1 1 0\" --to \"7.5 4 1.57\"
  omnibase plan robots/bmm.toml --map office.yaml --to \"7.5 4\" --best ridge --picture way.svg
  omnibase plan robots/bmm.toml --map office.yaml --to \"7.5 4 0\" --write way.dat
  omnibase run robots/bmm.toml --path way.dat --timing fastest

Exit code 1 where there is no way; the reason is said.")]
pub struct Arguments {
    /// Robot file (TOML).
    robot: PathBuf,
    #[command(flatten)]
    changes: Changes,
    /// A map of ROS's map_server (YAML with PGM or PNG), in place of the one of the robot's file.
    #[arg(long, value_name = "FILE")]
    map: Option<PathBuf>,
    /// Where the robot stands: x m, y m, heading rad in the room's frame, which is odom.
    #[arg(long, value_name = "X Y HEADING", default_value = "0 0 0", allow_hyphen_values = true)]
    from: String,
    /// Where it shall stand; without a heading it keeps the one it has.
    #[arg(long, value_name = "X Y HEADING", allow_hyphen_values = true)]
    to: String,
    /// Which way is the best: `shortest`, or `ridge`, which keeps to the middle between walls; default: the robot file's.
    #[arg(long, value_name = "WHICH", value_parser = ["shortest", "ridge"])]
    best: Option<String>,
    /// What the footprint keeps from walls, m; default: the robot file's, 0.05.
    #[arg(long, value_name = "M")]
    clearance: Option<f64>,
    /// How long a way is looked for, s of a processor; nothing is found after it.
    #[arg(long, value_name = "S", default_value = "1", value_parser = seconds)]
    within: Duration,
    /// Write the way's points, as `omnibase run --path` reads them.
    #[arg(long, value_name = "FILE")]
    write: Option<PathBuf>,
    /// Draw it: an SVG file, or a page where the name ends in .html.
    #[arg(long, value_name = "FILE", value_parser = picture_file)]
    picture: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: &Arguments, registry: &Registry, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    let source = RobotSource::read(&arguments.robot, &arguments.changes)?;
    let robot = source.load_or_explain(registry)?.plan;
    let from = pose(&arguments.from, "--from", 0.0)?;
    let to = pose(&arguments.to, "--to", from.heading_rad)?;
    let room = room(arguments, &robot, &source.text.folder)?;
    let best = match arguments.best.as_deref() {
        Some("ridge") => BestWay::Ridge,
        Some(_) => BestWay::Shortest,
        None => room.way,
    };
    let fence_m = robot.guard.fence.as_ref().map_or(&[][..], |fence| &fence.corners_m);
    let obstacles = &robot.guard.obstacles;
    let since = computed();
    let is_over = || computed().saturating_sub(since) >= arguments.within;
    let until = Until::over(&is_over);
    let way =
        WayRequest { from, lead: &[], to, obstacles, spread_m: 0.0, fence_m, walls_m: &[], best, until };
    let begun = Instant::now();
    let looked = meanwhile("looking for a way", || room.timed(&way, &Ability::of(&robot), registry));
    let mut timed = match looked {
        Ok(timed) => timed,
        Err(error @ RoomError::Plan(PlanError::Ended)) => {
            let why = format!("{error}: {} s, --within", arguments.within.as_secs_f64());
            return refused(arguments, &why, output);
        }
        Err(error) => return refused(arguments, &error.to_string(), output),
    };
    let took_ms = begun.elapsed().as_secs_f64() * 1e3;
    let driven = Driven::of(&mut timed, SAMPLES);
    if let Some(path) = &arguments.write {
        let text = points(&timed, arguments);
        std::fs::write(path, text).with_context(|| format!("writing `{}`", path.display()))?;
        note(format_args!("wrote {} points to `{}`", timed.plan.poses.len(), path.display()));
    }
    if let Some(path) = &arguments.picture {
        let space = room.space(&way)?;
        let text = picture::draw(&robot.name, &space, room.footprint(), &timed.plan, &driven);
        let text =
            if path.extension().is_some_and(|ending| ending == "html") { picture::page(&text) } else { text };
        std::fs::write(path, text).with_context(|| format!("writing `{}`", path.display()))?;
        note(format_args!("drew it in `{}`", path.display()));
    }
    tell(arguments, &timed, &driven, took_ms, output)?;
    Ok(Outcome::Done)
}

/// What this thread has had of a processor.
fn computed() -> Duration {
    let used = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Duration::try_from(used).unwrap_or_default()
}

fn picture_file(text: &str) -> Result<PathBuf, String> {
    let is_page = Path::new(text).extension().is_some_and(|ending| ending == "html");
    if is_page { Ok(text.into()) } else { svg_file(text).map_err(|error| format!("{error}; or .html")) }
}

fn seconds(text: &str) -> Result<Duration, String> {
    let bad = |_| "expected seconds, 0 or more".to_owned();
    text.parse()
        .map_err(|_| "expected seconds, 0 or more".to_owned())
        .and_then(|s| Duration::try_from_secs_f64(s).map_err(bad))
}

fn room(arguments: &Arguments, robot: &RobotPlan, folder: &Path) -> anyhow::Result<Room> {
    let room = match &arguments.map {
        Some(path) => {
            let unknown = robot.map.as_ref().and_then(|map| map.unknown).unwrap_or(UnknownCells::Blocked);
            Room::with_map(robot, Some(read_map(path, unknown)?))?
        }
        None => Room::of(robot, folder)?,
    };
    Ok(match arguments.clearance {
        Some(clearance_m) => room.keeping(clearance_m),
        None => room,
    })
}

/// x, y and, where it is given, the heading.
fn pose(text: &str, option: &str, heading_rad: f64) -> anyhow::Result<Pose2> {
    let words: Vec<&str> = text.split([' ', ',', '\t']).filter(|word| !word.is_empty()).collect();
    let values: Vec<f64> =
        words.iter().filter_map(|word| word.parse().ok()).filter(|value: &f64| value.is_finite()).collect();
    match values[..] {
        [x_m, y_m] if words.len() == 2 => Ok(Pose2::new(x_m, y_m, heading_rad)),
        [x_m, y_m, heading_rad] if words.len() == 3 => Ok(Pose2::new(x_m, y_m, heading_rad)),
        _ => {
            let what = format!(
                "{option} \"{text}\": expected x m, y m and, if it matters, heading rad, as \"1.5 0 1.57\""
            );
            bail!(crate::WrongUsage(anyhow::Error::msg(what)))
        }
    }
}

/// Says why there is no way.
fn refused(arguments: &Arguments, why: &str, output: &mut dyn Write) -> anyhow::Result<Outcome> {
    if !arguments.json {
        bail!("{why}");
    }
    writeln!(output, "{}", serde_json::to_string_pretty(&json!({ "found": false, "why": why }))?)?;
    Ok(Outcome::Failed)
}

/// The way as lines of a file of path points.
fn points(timed: &TimedWay, arguments: &Arguments) -> String {
    let mut text = format!(
        "# from {} to {}: {:.3} m\n# omnibase run {} --path FILE --timing fastest\n",
        arguments.from,
        arguments.to,
        timed.plan.length_m,
        arguments.robot.display()
    );
    for [time_s, x_m, y_m, heading_rad] in timed.table.points.iter().flatten() {
        text += &format!("{time_s:.4} {x_m:.6} {y_m:.6} {heading_rad:.6}\n");
    }
    text
}

fn tell(
    arguments: &Arguments,
    timed: &TimedWay,
    driven: &Driven,
    took_ms: f64,
    output: &mut dyn Write,
) -> anyhow::Result<()> {
    let plan = &timed.plan;
    let by = match plan.by {
        omnibase_plan::plan::By::Straight => "straight",
        omnibase_plan::plan::By::Disc => "whatever the heading",
        omnibase_plan::plan::By::Turning => "turning where it is narrow",
    };
    let least_m = plan.room_m.iter().copied().fold(f64::INFINITY, f64::min);
    if arguments.json {
        let poses: Vec<[f64; 3]> =
            plan.poses.iter().map(|pose| [pose.x_m, pose.y_m, pose.heading_rad]).collect();
        let found = json!({
            "found": true, "length_m": plan.length_m, "duration_s": timed.duration_s, "by": by,
            "clearance_m": plan.clearance_m, "least_room_m": least_m, "greatest_speed_m_s": driven.greatest_m_s,
            "planned_in_ms": took_ms, "poses": poses, "room_m": plan.room_m,
        });
        writeln!(output, "{}", serde_json::to_string_pretty(&found)?)?;
        return Ok(());
    }
    writeln!(output, "way        {:>9.3} m   {by}", plan.length_m)?;
    writeln!(
        output,
        "time       {:>9.3} s   as fast as the limits allow, at most {:.2} m/s",
        timed.duration_s, driven.greatest_m_s
    )?;
    writeln!(
        output,
        "clearance  {:>9.3} m   kept by the footprint; base_link's least room is {least_m:.2} m",
        plan.clearance_m
    )?;
    writeln!(output, "planned in {took_ms:>9.1} ms")?;
    Ok(())
}
