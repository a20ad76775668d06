//! Recordings as one dataset.

use super::{Arguments, Gyro, Truth, mount_of, tracker};
use crate::WrongUsage;
use crate::progress::warn;
use anyhow::Context;
use omnibase_calibrate::rehearsal::{GyroSensor, PoseSensor};
use omnibase_calibrate::{Dataset, PlaceSample, Run, SensorMount};
use omnibase_measure::measured::FloorPose;
use omnibase_record::run::RecordedRun;
use omnibase_robot::config::{SensorName, SensorPlan};
use omnibase_robot::{Registry, RobotPlan};
use omnibase_run::dataset::table::{run_of_table, too_fast};
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
    read_all(arguments, &arguments.from, &arguments.tape, plan, registry)
}

/// Reads recordings, with two places on the floor for each where there are any.
pub(super) fn read_all(
    arguments: &Arguments,
    paths: &[PathBuf],
    tapes: &[FloorPose],
    plan: &RobotPlan,
    registry: &Registry,
) -> anyhow::Result<Dataset> {
    let mut dataset = Dataset::default();
    for (number, path) in paths.iter().enumerate() {
        let witnesses = witnesses(arguments, plan, number);
        let mut run = read_one(path, plan, registry, &witnesses, true)
            .with_context(|| format!("`{}`", path.display()))?;
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

/// Whether the robot has all that is to be heard of its recordings.
pub(super) fn check_names(arguments: &Arguments, plan: &RobotPlan) -> anyhow::Result<()> {
    Ok(omnibase_run::dataset::check_names(plan, &witnesses(arguments, plan, 0))?)
}

fn witnesses(arguments: &Arguments, plan: &RobotPlan, number: usize) -> Witnesses {
    let mount = SensorMount {
        base_from_sensor: arguments.mount(plan).base_from_sensor,
        ..PoseSensor::default().mount
    };
    let seed = arguments.seed.wrapping_add(number as u64);
    witnesses_of(arguments.truth.as_ref(), arguments.gyro.as_ref(), mount, plan, seed)
}

/// A recording by itself, its poses at their true instants, the simulator's without noise. Whose poses and turns is told; without that the
/// file's gyro counts where the recording has it.
pub(crate) fn one_recording(
    path: &Path,
    plan: &RobotPlan,
    registry: &Registry,
    truth: Option<&Truth>,
    gyro: Option<&Gyro>,
) -> anyhow::Result<Run> {
    let mount = mount_of(tracker(plan, truth));
    let of_file = if gyro.is_none() { gyro_of_file(plan) } else { None };
    let mut witnesses = witnesses_of(truth, gyro.or(of_file.as_ref()), mount, plan, 1);
    if let Some(PosesFrom::Simulator(sensor)) = witnesses.poses {
        witnesses.poses = Some(PosesFrom::Truth(sensor));
    }
    let needs_gyro = of_file.is_none();
    let mut run = read_one(path, plan, registry, &witnesses, needs_gyro)?;
    if !matches!(witnesses.poses, Some(PosesFrom::Truth(_))) {
        run.poses.iter_mut().for_each(|pose| pose.instant_s -= mount.delay_s);
    }
    Ok(run)
}

/// The input of the file's gyro.
fn gyro_of_file(plan: &RobotPlan) -> Option<Gyro> {
    let gyro = plan.sensors.iter().find(|one| one.kind == SensorName::Gyro)?;
    let place = *gyro.inputs.first()?;
    plan.signals().inputs.into_iter().nth(place).map(|input| Gyro::Input(input.name))
}

fn witnesses_of(
    truth: Option<&Truth>,
    gyro: Option<&Gyro>,
    mount: SensorMount,
    plan: &RobotPlan,
    seed: u64,
) -> Witnesses {
    let poses = truth.map(|truth| match truth {
        Truth::Source(name) => {
            let sigma =
                tracker(plan, Some(truth)).map_or([0.0; 2], |one| [one.sensor.sigma[0], one.sensor.sigma[2]]);
            PosesFrom::Source { name: name.clone(), sigma }
        }
        Truth::Simulator => PosesFrom::Simulator(PoseSensor { mount, ..PoseSensor::default() }),
    });
    let gyro = match gyro {
        Some(Gyro::Simulator) => Some(GyroFrom::Simulator(GyroSensor::default())),
        told => gyro_input(plan, told).map(GyroFrom::Input),
    };
    Witnesses { poses, gyro, seed }
}

/// The input that tells turns: as the command line says, or the robot file's `safety.gyro_input`.
fn gyro_input(plan: &RobotPlan, told: Option<&Gyro>) -> Option<String> {
    match told {
        Some(Gyro::Input(name)) => Some(name.clone()),
        Some(Gyro::Simulator) => None,
        None => plan.signals().inputs.into_iter().nth(plan.safety.gyro_input?).map(|input| input.name),
    }
}

/// The robot file's gyro that reads that input.
pub(super) fn gyro<'a>(plan: &'a RobotPlan, told: Option<&Gyro>) -> Option<&'a SensorPlan> {
    let place = plan.signals().input(&gyro_input(plan, told)?)?;
    plan.sensors.iter().find(|one| one.kind == SensorName::Gyro && one.inputs == [place])
}

fn read_one(
    path: &Path,
    plan: &RobotPlan,
    registry: &Registry,
    witnesses: &Witnesses,
    needs_gyro: bool,
) -> anyhow::Result<Run> {
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("csv")) {
        let text = omnibase_run::small_file::text(path).context("reading it")?;
        let (wheels, most_rad_s) = (plan.drives.len(), plan.limits.wheel_speed_rad_s);
        let run = run_of_table(&text, wheels, &path.display().to_string())?;
        if let Some(words) = too_fast(&text, wheels, most_rad_s)? {
            warn(format_args!("`{}`: {words}", path.display()));
        }
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
    let name = path.display().to_string();
    let mut run = match run_of(&recorded, &its_plan, &name, witnesses) {
        Err(_) if !needs_gyro => {
            run_of(&recorded, &its_plan, &name, &Witnesses { gyro: None, ..witnesses.clone() })?
        }
        read => read?,
    };
    let gyro = match &witnesses.gyro {
        Some(GyroFrom::Input(name)) => gyro(plan, Some(&Gyro::Input(name.clone()))),
        _ => None,
    };
    if let Some(gyro) = gyro {
        for turn in &mut run.turns {
            turn.rate_rad_s *= gyro.scale;
            turn.instant_s -= gyro.delay_ns as f64 * 1e-9;
        }
    }
    Ok(run.in_steps_of(STEP_S))
}
