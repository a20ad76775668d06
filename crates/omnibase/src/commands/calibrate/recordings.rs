//! Recordings as one dataset.

use super::{Arguments, Gyro, Truth};
use crate::WrongUsage;
use crate::progress::warn;
use anyhow::Context;
use omnibase_calibrate::rehearsal::{GyroSensor, PoseSensor};
use omnibase_calibrate::{Dataset, PlaceSample, Run, SensorMount};
use omnibase_fusion::SensorKind;
use omnibase_measure::measured::FloorPose;
use omnibase_record::run::RecordedRun;
use omnibase_robot::{Registry, RobotPlan};
use omnibase_run::dataset::table::run_of_table;
use omnibase_run::dataset::{GyroFrom, PosesFrom, Witnesses, run_of};
use omnibase_run::robot_text::from_description;
use std::path::{Path, PathBuf};

/// Wheels are joined to steps of this length, s: arcs over it are exact to far below what is measured.
pub(super) const STEP_S: f64 = 4e-3;

/// Reads the recordings of the command line.
pub(super) fn read(arguments: &Arguments, plan: &RobotPlan, registry: &Registry) -> anyhow::Result<Dataset> {
    let (runs, tapes) = (arguments.from.len(), arguments.tape.len());
    if tapes != 0 && tapes != 2 * runs {
        let words = format!(
            "--tape was given {tapes} times for {runs} recordings: expected twice each, before and after"
        );
        return Err(WrongUsage(anyhow::Error::msg(words)).into());
    }
    read_all(arguments, (&arguments.from, &arguments.tape), plan, registry)
}

/// Reads recordings, with two places on the floor for each where there are any.
pub(super) fn read_all(
    arguments: &Arguments,
    (paths, tapes): (&[PathBuf], &[FloorPose]),
    plan: &RobotPlan,
    registry: &Registry,
) -> anyhow::Result<Dataset> {
    let mut dataset = Dataset::default();
    for (number, path) in paths.iter().enumerate() {
        let witnesses = witnesses(arguments, plan, number);
        let mut run =
            read_one(path, plan, registry, &witnesses).with_context(|| format!("`{}`", path.display()))?;
        run = run.without_repeats();
        if let Some(&[before, after]) = tapes.get(2 * number..2 * number + 2) {
            let [sigma_m, sigma_rad] = arguments.tape_sigma;
            let place = |instant_s: f64, FloorPose(floor_from_base): FloorPose| PlaceSample {
                instant_s,
                floor_from_base,
                sigma_m,
                sigma_rad,
            };
            run.places = vec![place(run.begin_s, before), place(run.end_s(), after)];
        }
        dataset.runs.push(run);
    }
    Ok(dataset)
}

fn witnesses(arguments: &Arguments, plan: &RobotPlan, number: usize) -> Witnesses {
    let told = (arguments.truth.as_ref(), arguments.gyro.as_ref());
    let mount = SensorMount { base_from_sensor: arguments.sensor.0, ..PoseSensor::default().mount };
    witnesses_of(told, mount, plan, arguments.seed.wrapping_add(number as u64))
}

/// A recording by itself, its poses at their true instants; whose poses and turns is told.
pub(crate) fn one_recording(
    path: &Path,
    plan: &RobotPlan,
    registry: &Registry,
    told: (Option<&Truth>, Option<&Gyro>),
) -> anyhow::Result<Run> {
    let tracker = plan.sensors.iter().find(|one| one.sensor.kind == SensorKind::Pose);
    let mount = tracker.map_or(SensorMount::default(), |one| SensorMount {
        base_from_sensor: one.sensor.body_from_sensor,
        delay_s: one.delay_ns as f64 * 1e-9,
    });
    let mut run = read_one(path, plan, registry, &witnesses_of(told, mount, plan, 1))?;
    run.poses.iter_mut().for_each(|pose| pose.instant_s -= mount.delay_s);
    Ok(run)
}

fn witnesses_of(
    (truth, gyro): (Option<&Truth>, Option<&Gyro>),
    mount: SensorMount,
    plan: &RobotPlan,
    seed: u64,
) -> Witnesses {
    let poses = truth.map(|truth| match truth {
        Truth::Source(name) => PosesFrom::Source(name.clone()),
        Truth::Simulator => PosesFrom::Simulator(PoseSensor { mount, ..PoseSensor::default() }),
    });
    let of_file = plan.safety.gyro_input.and_then(|input| plan.signals().inputs.into_iter().nth(input));
    let gyro = match (gyro, of_file) {
        (Some(Gyro::Input(name)), _) => Some(GyroFrom::Input(name.clone())),
        (Some(Gyro::Simulator), _) => Some(GyroFrom::Simulator(GyroSensor::default())),
        (None, of_file) => of_file.map(|input| GyroFrom::Input(input.name)),
    };
    Witnesses { poses, gyro, seed }
}

fn read_one(
    path: &Path,
    plan: &RobotPlan,
    registry: &Registry,
    witnesses: &Witnesses,
) -> anyhow::Result<Run> {
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv")) {
        let text = std::fs::read_to_string(path).context("reading it")?;
        let run = run_of_table(&text, plan.drives.len(), &path.display().to_string())?;
        return Ok(run.in_steps_of(STEP_S));
    }
    let file = std::fs::File::open(path).context("opening it")?;
    let recorded = RecordedRun::read_from(file, omnibase_run::dataset::READ)?;
    if let Some(why) = &recorded.truncated {
        warn(format_args!("`{}` ends early ({why}): what is there counts", path.display()));
    }
    // Sources and cycle are those that it was recorded with; its wheels are expected as the file says now.
    let its_plan = from_description(&recorded.description, registry).map_err(|problems| {
        let words: Vec<String> = problems.iter().map(ToString::to_string).collect();
        anyhow::anyhow!("its robot: {}", words.join("; "))
    })?;
    let (found, expected) = (its_plan.drives.len(), plan.drives.len());
    anyhow::ensure!(
        found == expected,
        "it is of a robot with {found} wheels, expected {expected} as in the robot file"
    );
    let run = run_of(&recorded, &its_plan, &path.display().to_string(), witnesses)?;
    Ok(run.in_steps_of(STEP_S))
}
