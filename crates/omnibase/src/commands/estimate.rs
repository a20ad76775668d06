//! `omnibase estimate`: the filter of `fused` on what a robot recorded, ours or anybody's, against where it really was.

mod errors;

use crate::Outcome;
use crate::commands::calibrate::{Gyro, Truth, one_recording};
use crate::robot_file::{Changes, RobotSource};
use anyhow::Context;
use errors::{Stamped, TrajectoryErrors, without_jumps};
use omnibase_calibrate::{Run, Step};
use omnibase_fusion::{Filter, FilterSettings, Motion, Reading, Sensor, SensorKind};
use omnibase_platform::{PerWheel, Pose2};
use omnibase_robot::estimators::covariance_settings;
use omnibase_robot::{Registry, RobotPlan};
use serde_json::json;
use std::fmt::Write as _;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Where a recorded robot was, as the estimator `fused` believes, against poses that were measured: absolute and relative
/// trajectory errors.
///
/// Reads a recording of `omnibase run --record`, or a table of text, FILE.csv, with columns time_s, wheel_1_rad ..., gyro_rad_s,
/// pose_x_m, pose_y_m, pose_heading_rad. Wheels and gyro are believed; of the poses every Nth with --poses. All of them are
/// what it is compared with.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase estimate robots/bmm.toml run.mcap --truth simulator --gyro simulator
  omnibase estimate robots/bmm_tracked.toml run.mcap --truth source:tracker --poses 10
  omnibase estimate youbot.toml track.csv --tum out      and then: evo_ape tum out/truth.tum out/fused.tum --align

Absolute error: RMS of the distance after the best rigid alignment, as evo_ape's with --align. Relative error: over each metre of the
believed way, as evo_rpe's with --delta 1 --delta_unit m --all_pairs. A true pose that repeats the one before to the bit was not
measured, and is left out. Where poses jump, by ten times what half of them are off by, the figures without them stand below. A
table's times count from its first row.")]
pub struct Arguments {
    /// Robot file (TOML): wheels, and by its tables `estimator` and `sensor` how well they are known.
    robot: PathBuf,
    #[command(flatten)]
    changes: Changes,
    /// The recording.
    recording: PathBuf,
    /// Whose poses a recording is compared with: `source:NAME`, or `simulator`, its truth without noise; a table of text has its own.
    #[arg(long, value_name = "WHO")]
    truth: Option<Truth>,
    /// Whose turn is believed: an input's name, or `simulator`; default: the robot file's gyro, where the recording has it.
    #[arg(long, value_name = "INPUT")]
    gyro: Option<Gyro>,
    /// Believe every Nth pose; default: none.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    poses: Option<u32>,
    /// Write truth.tum, wheels.tum and fused.tum (time x y z qx qy qz qw) into this folder, which is made.
    #[arg(long, value_name = "FOLDER")]
    tum: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Instants of a recording count from here, ns: none is before the clock.
const BEGIN_NS: u64 = 10_000_000_000;

/// Wheels that are read more seldom count as turning evenly in between: poses find their instants, s.
const EVENLY_S: f64 = 5e-3;

/// Where the platform was, as wheels alone and as all together say.
struct Believed {
    wheels: Vec<Stamped>,
    fused: Vec<Stamped>,
    verdicts: Vec<(&'static str, String)>,
}

pub fn run(
    arguments: &Arguments,
    registry: &Arc<Registry>,
    output: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    let source = RobotSource::read(&arguments.robot, &arguments.changes)?;
    let robot = source.load(registry).map_err(|problems| {
        let words: Vec<String> = problems.iter().map(|problem| source.explain(problem)).collect();
        anyhow::Error::msg(words.join("\n"))
    })?;
    let plan = robot.plan;
    let run = one_recording(
        &arguments.recording,
        &plan,
        registry,
        arguments.truth.as_ref(),
        arguments.gyro.as_ref(),
    )
    .with_context(|| format!("`{}`", arguments.recording.display()))?;
    anyhow::ensure!(
        !run.poses.is_empty(),
        "`{}` has no poses to compare with: expected --truth source:NAME or simulator, or columns pose_x_m, pose_y_m, pose_heading_rad",
        arguments.recording.display()
    );
    run.check(plan.drives.len())?;
    let believed = estimate(&plan, &run, arguments.poses);
    let truth: Vec<Stamped> = run
        .without_repeats()
        .poses
        .iter()
        .map(|pose| Stamped { time_s: pose.instant_s, pose: pose.world_from_sensor })
        .collect();
    let errors = |truth: &[Stamped], believed: &[Stamped]| {
        TrajectoryErrors::of(truth, believed)
            .context("fewer than three poses lie within the time of the wheels: expected the same clock")
    };
    let (wheels, fused) = (errors(&truth, &believed.wheels)?, errors(&truth, &believed.fused)?);
    let steady = without_jumps(&truth, &believed.fused);
    let steady = (errors(&steady, &believed.wheels)?, errors(&steady, &believed.fused)?);
    let jumps = fused.poses.saturating_sub(steady.1.poses);
    if let Some(folder) = &arguments.tum {
        write_tum(folder, &[("truth", &truth), ("wheels", &believed.wheels), ("fused", &believed.fused)])?;
    }
    if arguments.json {
        let told = |errors: &TrajectoryErrors| json!({ "absolute_m": errors.absolute_m, "relative_m": errors.relative_m, "relative_rad": errors.relative_rad });
        let verdicts: serde_json::Map<String, serde_json::Value> = believed
            .verdicts
            .iter()
            .map(|(name, verdict)| ((*name).to_owned(), verdict.as_str().into()))
            .collect();
        let told = json!({
            "poses": fused.poses,
            "way_m": fused.way_m,
            "wheels": told(&wheels),
            "fused": told(&fused),
            "sensors": verdicts,
            "jumps": jumps,
            "without_jumps": { "wheels": told(&steady.0), "fused": told(&steady.1) },
        });
        serde_json::to_writer_pretty(&mut *output, &told)?;
        writeln!(output)?;
        return Ok(Outcome::Done);
    }
    writeln!(output, "{} poses over {:.2} m", fused.poses, fused.way_m)?;
    writeln!(
        output,
        "{:<10} {:>14} {:>18} {:>18}",
        "", "absolute mm", "over a metre mm", "over a metre mrad"
    )?;
    print_errors(&wheels, &fused, output)?;
    if jumps > 0 {
        writeln!(output, "{jumps} of the poses {}; without:", if jumps == 1 { "jumps" } else { "jump" })?;
        print_errors(&steady.0, &steady.1, output)?;
    }
    for (name, verdict) in &believed.verdicts {
        writeln!(output, "{name}: {verdict}")?;
    }
    Ok(Outcome::Done)
}

fn print_errors(
    wheels: &TrajectoryErrors,
    fused: &TrajectoryErrors,
    output: &mut dyn Write,
) -> anyhow::Result<()> {
    for (name, errors) in [("wheels", wheels), ("fused", fused)] {
        let TrajectoryErrors { absolute_m, relative_m, relative_rad, .. } = errors;
        let relative =
            |value: &Option<f64>| value.map_or("–".to_owned(), |value| format!("{:.3}", 1e3 * value));
        writeln!(
            output,
            "{name:<10} {:>14.3} {:>18} {:>18}",
            1e3 * absolute_m,
            relative(relative_m),
            relative(relative_rad)
        )?;
    }
    Ok(())
}

/// Wheels and gyro in the order of time, with every so many poses.
fn estimate(plan: &RobotPlan, run: &Run, every_pose: Option<u32>) -> Believed {
    let known = |kind: SensorKind| plan.sensors.iter().map(|one| one.sensor).find(|one| one.kind == kind);
    let gyro = known(SensorKind::Turn).unwrap_or(Sensor::of(SensorKind::Turn));
    let tracker =
        Sensor { sigma: [0.0; 3], ..known(SensorKind::Pose).unwrap_or(Sensor::of(SensorKind::Pose)) };
    let steps = even_steps(run);
    let step_ns = steps.first().map_or(1e6, |step| 1e9 * (step.end_s - run.begin_s)) as u64;
    let settings = FilterSettings::new(&plan.kinematics, covariance_settings(&plan.estimator), step_ns);
    let sensors = if every_pose.is_some() { vec![gyro, tracker] } else { vec![gyro] };
    let mut filter = Filter::new(settings, &sensors);
    let ns = |time_s: f64| BEGIN_NS + (1e9 * (time_s - run.begin_s)).max(0.0) as u64;
    let mut turns = run.turns.iter().peekable();
    let mut poses = run.poses.iter().step_by(every_pose.unwrap_or(1) as usize).peekable();
    let mut believed = Believed { wheels: Vec::new(), fused: Vec::new(), verdicts: Vec::new() };
    let mut odom_from_body = Pose2::default();
    for step in &steps {
        let (way, _) = plan.kinematics.body_step(&step.turned_rad);
        odom_from_body = odom_from_body.moved_by(way);
        // Nobody follows the pose.
        let motion = Motion { body_from_next: way.exp(), is_heard: true, is_free: true, ..Motion::default() };
        filter.advance(ns(step.end_s), &motion);
        while let Some(turn) = turns.next_if(|turn| turn.instant_s <= step.end_s) {
            filter.hear(0, ns(turn.instant_s), &Reading::Turn(turn.rate_rad_s));
        }
        while let Some(pose) = poses.next_if(|pose| pose.instant_s <= step.end_s) {
            let [m2, rad2] = [pose.sigma_m, pose.sigma_rad.min(1.0)].map(|sigma| sigma * sigma);
            let reading = Reading::Pose {
                map_from_sensor: pose.world_from_sensor,
                covariance: [m2, 0.0, 0.0, m2, 0.0, rad2],
            };
            if every_pose.is_some() {
                filter.hear(1, ns(pose.instant_s), &reading);
            }
        }
        believed.wheels.push(Stamped { time_s: step.end_s, pose: odom_from_body });
        believed.fused.push(Stamped { time_s: step.end_s, pose: filter.estimate().map_from_body });
    }
    // What is compared is where the sensor of poses is.
    for one in believed.wheels.iter_mut().chain(&mut believed.fused) {
        one.pose = one.pose.then(tracker.body_from_sensor);
    }
    let names = ["gyro", "poses"].into_iter().take(sensors.len()).enumerate();
    let verdict = |(place, name)| match (name, run.turns.is_empty()) {
        ("gyro", true) => (name, "not read".to_owned()),
        _ => (name, format!("{:?}", filter.verdict(place).0).to_lowercase()),
    };
    believed.verdicts = names.map(verdict).collect();
    believed
}

/// The wheels' steps, none longer than [`EVENLY_S`].
fn even_steps(run: &Run) -> Vec<Step> {
    let mut steps = Vec::new();
    let mut from_s = run.begin_s;
    for step in &run.steps {
        let time_s = step.end_s - from_s;
        let parts = (time_s / EVENLY_S - 1e-3).ceil().max(1.0) as u32;
        let turned_rad = PerWheel::from_fn(step.turned_rad.len(), |n| step.turned_rad[n] / f64::from(parts));
        let end_s = |part: u32| from_s + time_s * f64::from(part) / f64::from(parts);
        steps.extend((1..parts).map(|part| Step { end_s: end_s(part), turned_rad }));
        steps.push(Step { end_s: step.end_s, turned_rad });
        from_s = step.end_s;
    }
    steps
}

/// As SLAM's programs read trajectories.
fn write_tum(folder: &Path, trajectories: &[(&str, &[Stamped])]) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("making `{}`", folder.display()))?;
    for (name, trajectory) in trajectories {
        let path = folder.join(format!("{name}.tum"));
        let mut text = String::new();
        for Stamped { time_s, pose } in *trajectory {
            let (sin, cos) = (0.5 * pose.heading_rad).sin_cos();
            let _ = writeln!(text, "{time_s:.6} {:.9} {:.9} 0 0 0 {sin:.12} {cos:.12}", pose.x_m, pose.y_m);
        }
        std::fs::write(&path, text).with_context(|| format!("writing `{}`", path.display()))?;
    }
    Ok(())
}
