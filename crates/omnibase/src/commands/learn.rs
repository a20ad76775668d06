//! `omnibase learn`: a motion is repeated, and driven truer each time.

use super::run::recorded_run;
use super::run::reference::ReferenceChoice;
use crate::Outcome;
use crate::correction_file::{self, Motion};
use crate::progress::{note, warn};
use crate::robot_file::{Changes, RobotSource};
use anyhow::{Context, bail, ensure};
use omnibase_calibrate::rehearsal::{Random, drawn_wheel};
use omnibase_platform::Kinematics;
use omnibase_record::run::{Keep, RecordedRun};
use omnibase_robot::config::ReferenceTable;
use omnibase_robot::estimators::covariance_settings;
use omnibase_robot::{Ability, Registry, RobotPlan};
use omnibase_run::channels;
use omnibase_run::learn::rehearsal;
use omnibase_run::learn::{Learner, Learnt, Repeat};
use omnibase_run::robot_text::from_description;
use omnibase_run::teach::lines;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Repeats a motion, and learns from where a sensor of poses saw the platform: each time it is told to go where it then gets to where
/// it should.
///
/// What comes of it is a correction of some millimetres over the motion's time, for `omnibase run --correction`; it is kept only where
/// it drove truer than none, and it helps without the sensor, too. The robot's file needs a [[sensor]] of kind "pose" and the estimator
/// "fused". Without --drive the repeats are rehearsed by the simulated robot.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase learn robots/bmm_tracked.toml --circle radius_m=0.5,duration_s=10 --seed 1         rehearsed
  omnibase learn robots/bmm_tracked.toml --path robots/square.dat --write square-learnt.dat
  omnibase run robots/bmm_tracked.toml --path robots/square.dat --correction square-learnt.dat
  omnibase learn bmm.toml --path square.dat --drive --write square-learnt.dat -- --interface eth1      real drives: wheels move!
  omnibase learn bmm.toml --from first.mcap --from second.mcap --write next.dat     from repeats that were driven already

Exit code 1 where a repeat taught nothing.")]
pub struct Arguments {
    /// Robot file (TOML).
    robot: PathBuf,
    #[arg(skip)]
    reference: ReferenceChoice,
    #[command(flatten)]
    changes: Changes,
    /// Drive nothing: learn from recordings of `omnibase run --record`, in the order in which they were driven; what is written is what
    /// to drive next.
    #[arg(long, value_name = "FILE")]
    from: Vec<PathBuf>,
    /// Drive the repeats by `omnibase run`, with its options behind `--`, as --interface.
    #[arg(long, conflicts_with = "from")]
    drive: bool,
    /// Options of `omnibase run`.
    #[arg(last = true, requires = "drive", value_name = "OPTIONS")]
    run: Vec<String>,
    /// So many repeats at most.
    #[arg(long, value_name = "NUMBER", default_value_t = 6, value_parser = clap::value_parser!(u32).range(2..=100), conflicts_with = "from")]
    repeats: u32,
    /// Where the recordings of --drive are kept.
    #[arg(long, value_name = "FOLDER", default_value = "learning")]
    recordings: PathBuf,
    /// Rehearse with a robot whose wheels are as a workshop leaves them, drawn with this seed, and with other noise on its sensors;
    /// default: the simulated robot of the file.
    #[arg(long, value_name = "NUMBER", conflicts_with_all = ["from", "drive"])]
    seed: Option<u64>,
    /// Write the correction.
    #[arg(long, value_name = "FILE")]
    write: Option<PathBuf>,
    /// Write over that file where it is there already.
    #[arg(long, requires = "write")]
    overwrite: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// One repeat, as it is told.
#[derive(Debug, serde::Serialize)]
struct Row {
    rms_mm: f64,
    is_best: bool,
    /// In a rehearsal.
    true_rms_mm: Option<f64>,
    true_end_mm: Option<f64>,
}

impl From<Learnt> for Row {
    fn from(learnt: Learnt) -> Row {
        Row { rms_mm: 1e3 * learnt.rms_m, is_best: learnt.is_best, true_rms_mm: None, true_end_mm: None }
    }
}

impl Arguments {
    /// The motion that the command line chose.
    pub fn choose_motion(&mut self, matches: &clap::ArgMatches) {
        self.reference = ReferenceChoice::of(matches);
    }
}

/// Runs the command.
pub fn run(
    arguments: &Arguments,
    registry: &Arc<Registry>,
    output: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    if let Some(path) = arguments.write.as_ref().filter(|path| path.exists() && !arguments.overwrite) {
        bail!("`{}` is there already: give --overwrite, or another name", path.display());
    }
    let mut source = RobotSource::read(&arguments.robot, &arguments.changes)?;
    source.text.reference = arguments.reference.chosen(registry)?;
    let is_chosen = source.text.reference.is_some();
    let mut plan = source.load_or_explain(registry)?.plan;
    // Repeats begin without one: whether it helps is measured.
    plan.reference.correction = None;
    plan.reference.correction_file = None;
    let rows = &mut Vec::new();
    let learner = if arguments.from.is_empty() {
        repeated(arguments, &plan, registry, rows, output)?
    } else {
        let motion = is_chosen.then(|| Motion::of(&plan, registry)).transpose()?;
        recorded(arguments, &plan, motion, registry, rows, output)?
    };
    let correction = if arguments.from.is_empty() { learner.best() } else { Some(learner.next()) };
    if arguments.json {
        serde_json::to_writer_pretty(
            &mut *output,
            &serde_json::json!({ "repeats": rows, "correction": correction }),
        )?;
        writeln!(output)?;
    }
    let Some(correction) = correction else {
        warn("no correction drove truer than none: nothing is written");
        return Ok(Outcome::Failed);
    };
    if let Some(path) = &arguments.write {
        let mut head = "Learnt: t s, x m, y m, heading rad, in the platform's axes".to_owned();
        if is_chosen || arguments.from.is_empty() {
            head += &correction_file::head(&plan, registry)?;
        }
        std::fs::write(path, lines(&head, &correction))
            .with_context(|| format!("writing `{}`", path.display()))?;
        note(format_args!("{}: drive with it by --correction, or reference.correction_file", path.display()));
    }
    Ok(Outcome::Done)
}

/// Tells of a repeat as soon as it is known.
fn tell(row: Row, rows: &mut Vec<Row>, json: bool, output: &mut dyn Write) -> anyhow::Result<()> {
    if !json {
        let truth = match (row.true_rms_mm, row.true_end_mm) {
            (Some(rms_mm), Some(end_mm)) => format!("; truly {rms_mm:.2} mm, at the end {end_mm:.2} mm"),
            _ => String::new(),
        };
        let best = if row.is_best { "" } else { "; not better: back to the best one" };
        let number = rows.len() + 1;
        writeln!(output, "repeat {number}: {:.2} mm RMS beside the motion{truth}{best}", row.rms_mm)?;
        output.flush()?;
    }
    rows.push(row);
    Ok(())
}

/// Drives the repeats, or rehearses them.
fn repeated(
    arguments: &Arguments,
    plan: &RobotPlan,
    registry: &Arc<Registry>,
    rows: &mut Vec<Row>,
    output: &mut dyn Write,
) -> anyhow::Result<Learner> {
    let motion = registry.make_reference(&plan.reference, &Ability::of(plan))?;
    let duration_s = motion.duration_s().with_context(|| {
        let robot = arguments.robot.display();
        format!("nothing to repeat: give --path, --reference or a shape such as --circle, with an end; or a [reference] in {robot}")
    })?;
    Repeat::new(plan, duration_s)?;
    let mut learner = Learner::new(duration_s);
    let built = arguments.seed.map_or_else(|| Ok(plan.clone()), |seed| drawn(plan, seed))?;
    for number in 0..arguments.repeats {
        let row = if arguments.drive {
            let path = driven(arguments, plan, number, &learner, registry, output)?;
            let (recorded, its_plan) = recording(&path, registry)?;
            learner.learn(&repeat_of(&recorded, &its_plan, registry)?)?.into()
        } else {
            let seed = arguments.seed.unwrap_or(1).wrapping_mul(1000).wrapping_add(u64::from(number));
            let one = rehearsal::drive(&built, plan, Some(learner.next()), registry, seed)?;
            let learnt = learner.learn(&one.repeat)?;
            let (true_rms_mm, true_end_mm) = (Some(1e3 * one.true_rms_m), Some(1e3 * one.true_end_m));
            Row { true_rms_mm, true_end_mm, ..learnt.into() }
        };
        tell(row, rows, arguments.json, output)?;
        if learner.is_settled() {
            break;
        }
    }
    Ok(learner)
}

/// The robot of a rehearsal: its wheels as a workshop leaves them.
fn drawn(plan: &RobotPlan, seed: u64) -> anyhow::Result<RobotPlan> {
    let tolerances = covariance_settings(&plan.estimator).geometry;
    let mut random = Random::new(seed);
    let wheels = plan.kinematics.wheels().iter().map(|wheel| drawn_wheel(wheel, &tolerances, &mut random));
    Ok(RobotPlan { kinematics: Kinematics::new(wheels.collect())?, ..plan.clone() })
}

/// One repeat by `omnibase run`, with a recording.
fn driven(
    arguments: &Arguments,
    plan: &RobotPlan,
    number: u32,
    learner: &Learner,
    registry: &Arc<Registry>,
    output: &mut dyn Write,
) -> anyhow::Result<PathBuf> {
    let folder = &arguments.recordings;
    std::fs::create_dir_all(folder).with_context(|| format!("creating `{}`", folder.display()))?;
    let name = |ending: &str| folder.join(format!("repeat-{}.{ending}", number + 1));
    let (path, recording) = (name("toml"), name("mcap"));
    // What files said is in the plan.
    let table = registry.with_files(plan.reference.clone(), |_| None);
    let table = ReferenceTable { correction: Some(learner.next()), ..table };
    let text = toml::to_string(&table).context("the motion as a reference")?;
    std::fs::write(&path, text).with_context(|| format!("writing `{}`", path.display()))?;
    note(format_args!("repeat {}", number + 1));
    // Where one object is asked for, there is one.
    let mut silent = std::io::sink();
    let output: &mut dyn Write = if arguments.json { &mut silent } else { output };
    let Arguments { robot, changes, run, .. } = arguments;
    let outcome = recorded_run(robot, changes, run, &path, &recording, registry, output)?;
    ensure!(outcome == Outcome::Done, "the motion was not driven to its end");
    Ok(recording)
}

/// Learns from recordings, one after the other: of one robot, and of one motion, that of the first one where none is told.
fn recorded(
    arguments: &Arguments,
    plan: &RobotPlan,
    mut motion: Option<Motion>,
    registry: &Registry,
    rows: &mut Vec<Row>,
    output: &mut dyn Write,
) -> anyhow::Result<Learner> {
    let mut learner = None;
    for path in &arguments.from {
        let name = || format!("`{}`", path.display());
        let (recorded, its_plan) = recording(path, registry).with_context(name)?;
        let repeat = repeat_of(&recorded, &its_plan, registry).with_context(name)?;
        let [found, expected] = [&its_plan, plan].map(|plan| (&plan.name, plan.drives.len()));
        ensure!(
            found == expected,
            "{}: it is of `{}` with {} wheels, expected `{}` with {}",
            name(),
            found.0,
            found.1,
            expected.0,
            expected.1
        );
        let its_motion = Motion::of(&its_plan, registry).with_context(name)?;
        motion.get_or_insert_with(|| its_motion.clone()).check(&its_motion).with_context(name)?;
        let learner = learner.get_or_insert_with(|| Learner::new(repeat.duration_s()));
        let learnt = learner.learn(&repeat).with_context(name)?;
        tell(learnt.into(), rows, arguments.json, output)?;
    }
    learner.context("expected a recording")
}

/// A recorded run, and the robot that it was recorded with.
fn recording(path: &Path, registry: &Registry) -> anyhow::Result<(RecordedRun, RobotPlan)> {
    let file = std::fs::File::open(path).context("opening it")?;
    let recorded = RecordedRun::read_from(file, Keep::All)?;
    ensure!(!recorded.raw.is_empty(), "only some of its signals are recorded: expected all of them");
    let plan = from_description(&recorded.description, registry).map_err(|problems| {
        let words: Vec<String> = problems.iter().map(ToString::to_string).collect();
        anyhow::anyhow!("its robot: {}", words.join("; "))
    })?;
    Ok((recorded, plan))
}

/// A recorded run as a repeat.
fn repeat_of(recorded: &RecordedRun, plan: &RobotPlan, registry: &Registry) -> anyhow::Result<Repeat> {
    let motion = registry.make_reference(&plan.reference, &Ability::of(plan))?;
    let mut repeat = Repeat::new(plan, motion.duration_s().unwrap_or(f64::INFINITY))?;
    let mut words = channels::RecordWords::new(plan.record_layout());
    for raw in &recorded.raw {
        let cycle = words.record(raw);
        let cycle = cycle.ok().context("expected a recording of this version, found other signals")?;
        repeat.take(&cycle);
    }
    Ok(repeat)
}
