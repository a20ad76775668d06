//! Figures driven: by a simulated robot that isn't quite what its file says, or by the real one as `omnibase run` does it.

use super::figure::{self, reference};
use super::recordings::{self, STEP_S};
use super::{Arguments, Known};
use crate::Outcome;
use crate::commands::run::{Told, ask_for_pose, recorded_run};
use crate::progress::{note, warn};
use crate::robot_file::RobotSource;
use anyhow::{Context, bail, ensure};
use omnibase_calibrate::figures::{Figure, Witness};
use omnibase_calibrate::rehearsal::{Random, drawn_wheel};
use omnibase_calibrate::{Build, Dataset, Run, SensorMount, Step};
use omnibase_measure::measured::FloorPose;
use omnibase_platform::{Kinematics, PerWheel, Pose2};
use omnibase_robot::{Registry, RobotPlan};
use omnibase_run::stepped::{Leader, Stepped};
use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;

/// What was driven, and what the robot truly is where that is known.
pub(super) struct Driven {
    pub(super) dataset: Dataset,
    pub(super) truth: Option<Build>,
}

/// Rehearses figures on a simulated robot that is drawn by the file's tolerances.
pub(super) fn rehearse(
    arguments: &Arguments,
    source: &RobotSource,
    figures: &[Figure],
    known: &Known,
    registry: &Registry,
) -> anyhow::Result<Driven> {
    let mut random = Random::new(arguments.seed);
    let truth = drawn(known, &mut random);
    let mut dataset = Dataset::default();
    let mut floor_from_base = Pose2::default();
    for figure in figures {
        let mut source = source.text.clone();
        source.reference = Some(reference(figure).into());
        let robot = source.load(registry).map_err(|problems| problems_of(figure, &problems))?;
        let plan = &robot.plan;
        let mut drive = simulated(plan.clone(), &truth, figure, registry)?;
        for (_, pose) in &mut drive.poses {
            *pose = floor_from_base.then(*pose);
        }
        floor_from_base = drive.poses.last().map_or(floor_from_base, |(_, pose)| *pose);
        let mut run = drive.run;
        match figure::witness(arguments, plan) {
            Witness::Poses(sensor) => {
                let sensor = omnibase_calibrate::rehearsal::PoseSensor { mount: truth.sensor, ..sensor };
                run.poses = sensor.poses(&drive.poses, &mut random);
            }
            Witness::GyroAndTape(_, tape) | Witness::Tape(tape) => {
                let ends = [drive.poses.first(), drive.poses.last()].into_iter().flatten();
                run.places =
                    ends.map(|(instant_s, pose)| tape.place(*instant_s, *pose, &mut random)).collect();
            }
        }
        if figure::has_gyro(arguments, plan) {
            let gyro =
                omnibase_calibrate::rehearsal::GyroSensor { scale: truth.gyro_scale, ..Default::default() };
            run.turns = gyro.turns(&drive.turns, &mut random);
        }
        dataset.runs.push(run.in_steps_of(STEP_S));
    }
    Ok(Driven { dataset, truth: Some(truth) })
}

/// A robot as it might have been built.
fn drawn(known: &Known, random: &mut Random) -> Build {
    let Known { build, tolerances } = known;
    let wheels = build.wheels.iter().map(|wheel| drawn_wheel(wheel, &tolerances.wheel, random)).collect();
    let mount = build.sensor.base_from_sensor;
    let [x, y, heading] = [(); 3].map(|()| random.normal());
    let base_from_sensor = Pose2 {
        x_m: mount.x_m + tolerances.sensor_m * x,
        y_m: mount.y_m + tolerances.sensor_m * y,
        heading_rad: mount.heading_rad + tolerances.sensor_rad * heading,
    };
    let sensor = SensorMount { base_from_sensor, delay_s: 0.02 };
    Build { wheels, sensor, gyro_scale: 0.5 * tolerances.gyro_scale, ..build.clone() }
}

/// A drive, and the truth of it.
struct Drive {
    run: Run,
    poses: Vec<(f64, Pose2)>,
    turns: Vec<(f64, f64)>,
}

fn simulated(plan: RobotPlan, truth: &Build, figure: &Figure, registry: &Registry) -> anyhow::Result<Drive> {
    let built = RobotPlan { kinematics: Kinematics::new(truth.wheels.clone())?, ..plan.clone() };
    let age_s = plan.input_age_ns() as f64 * 1e-9;
    let mut robot = Stepped::begin_on(&built, plan, registry, Leader::Plan, &mut |text| warn(text))?;
    let mut drive = Drive {
        run: Run { name: figure.name.to_owned(), ..Run::default() },
        poses: Vec::new(),
        turns: Vec::new(),
    };
    while !robot.is_over() {
        let record = *robot.step(None).context("the simulated bus")?;
        let instant_s = record.time.now_ns as f64 * 1e-9 - age_s;
        let drives = record.measurements.present();
        let turned_rad = PerWheel::from_fn(drives.len(), |wheel| drives[wheel].increment_rad);
        if drive.poses.is_empty() {
            drive.run.begin_s = instant_s;
        } else {
            drive.run.steps.push(Step { end_s: instant_s, turned_rad });
        }
        let truth = robot.truth();
        drive.poses.push((instant_s, truth.odom_from_body));
        drive.turns.push((instant_s, truth.twist_in_body.w_rad_s));
    }
    ensure!(
        robot.has_finished(),
        "{}: the simulated robot stopped on its way: {}",
        figure.name,
        robot.record().stop_reason.text()
    );
    Ok(drive)
}

fn problems_of(figure: &Figure, problems: &[omnibase_robot::Problem]) -> anyhow::Error {
    let words: Vec<String> = problems.iter().map(ToString::to_string).collect();
    anyhow::anyhow!("the figure {}: {}", figure.name, words.join("; "))
}

/// Drives figures with the real robot, each by `omnibase run` with a recording of its own, and reads these back.
pub(super) fn drive(
    arguments: &Arguments,
    figures: &[Figure],
    plan: &RobotPlan,
    registry: &Arc<Registry>,
    output: &mut dyn Write,
) -> anyhow::Result<Driven> {
    let folder = &arguments.recordings;
    std::fs::create_dir_all(folder).with_context(|| format!("creating `{}`", folder.display()))?;
    let by_tape = arguments.truth.is_none();
    let (mut recordings, mut tapes) = (Vec::new(), Vec::new());
    for (number, figure) in figures.iter().enumerate() {
        let so_far = || goes_on(arguments, &recordings, &tapes);
        let name = format!("{}-{}", number + 1, figure.name);
        let (path, recording) = (folder.join(format!("{name}.toml")), folder.join(format!("{name}.mcap")));
        let table = toml::to_string(&reference(figure)).context("the figure as a reference")?;
        std::fs::write(&path, table).with_context(|| format!("writing `{}`", path.display()))?;
        let before = if by_tape { Some(asked().with_context(so_far)?) } else { None };
        note(format_args!("{}: {}", figure.name, figure.meaning));
        // Where one object is asked for, there is one.
        let mut silent = std::io::sink();
        let output: &mut dyn Write = if arguments.json { &mut silent } else { output };
        let Arguments { robot, changes, run, .. } = arguments;
        let driven =
            recorded_run(robot, changes, run, &path, &recording, registry, output).and_then(|driven| {
                ensure!(driven == Outcome::Done, "the figure was not driven to its end");
                Ok(())
            });
        driven.with_context(so_far)?;
        if let Some(before) = before {
            let after = asked().with_context(so_far)?;
            tapes.extend([before, after]);
        }
        recordings.push(recording);
        if by_tape {
            note(goes_on(arguments, &recordings, &tapes));
        }
    }
    let dataset = recordings::read_all(arguments, &recordings, &tapes, plan, registry)?;
    Ok(Driven { dataset, truth: None })
}

/// How to go on with what was driven and measured so far.
fn goes_on(arguments: &Arguments, recordings: &[PathBuf], tapes: &[FloorPose]) -> String {
    let robot = arguments.robot.display();
    let from: Vec<String> =
        recordings.iter().map(|recording| format!(" --from {}", recording.display())).collect();
    let tapes: Vec<String> = tapes.iter().map(|pose| format!(" --tape \"{pose}\"")).collect();
    match recordings {
        [] => "nothing is driven and measured so far".to_owned(),
        _ => format!("so far: omnibase calibrate {robot}{}{}", from.concat(), tapes.concat()),
    }
}

/// Where the platform stands; asked until it is told.
fn asked() -> anyhow::Result<FloorPose> {
    loop {
        match ask_for_pose("where it stands on the floor, x y heading [m m rad, or 90deg; Ctrl-C ends it]")? {
            Told::Pose(pose) => return Ok(pose),
            Told::Nothing => warn("without this place the figure can't be calibrated by"),
            Told::End => bail!("nobody says where it stands: the input ended"),
        }
    }
}
