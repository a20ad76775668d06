//! `omnibase calibrate`: what a robot's wheels and sensors are really like, from what it drives and where it really is.

mod drive;
mod figure;
mod page;
mod recordings;
mod table;
pub(super) mod write;

use crate::Outcome;
use crate::progress::{note, warn};
use crate::robot_file::{Changes, RobotSource};
use anyhow::Context;
use drive::Driven;
use omnibase_calibrate::{
    Build, Dataset, Drift, MOST_DOUBTED, SensorMount, Solution, Tolerances, WORST_CHI_SQUARE, solve,
};
use omnibase_measure::measured::FloorPose;
use omnibase_platform::Wheel;
use omnibase_robot::config::{InputOwner, SensorName, SensorPlan};
use omnibase_robot::estimators::covariance_settings;
use omnibase_robot::{Registry, RobotPlan};
pub(crate) use recordings::one_recording;
use std::io::Write;
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::Arc;

/// Finds each wheel's radius, direction and place, creep, and the mounting of sensors: drives prescribed figures, or reads recorded
/// runs.
///
/// Where the platform really was is told by a program that sends poses (--truth source:NAME), or by a tape before and after each
/// drive, better with a gyro (--gyro). What nothing shows stays as it is in the file, and is named. Without an interface the figures
/// are rehearsed by a simulated robot that isn't quite what its file says, seen by sensors with stated noise.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  omnibase calibrate robots/bmm.toml --truth simulator                         rehearsed, seen by a motion capture
  omnibase calibrate robots/bmm.toml --gyro simulator                          rehearsed, with a gyro and a tape
  omnibase calibrate robots/bmm.toml --truth source:mocap --show               the figures, and what they would show
  omnibase calibrate bmm.toml --truth source:mocap --drive -- --interface eth1 --realtime      real drives: wheels move!
  omnibase calibrate bmm.toml --from run.mcap --truth source:mocap --write bmm-found.toml
  omnibase calibrate bmm.toml --from out.mcap --tape \"0 0 0\" --tape \"1.997 0.004 0.2deg\" --gyro gyro.turn

Exit code 1, and nothing is written, where the residuals are far beyond what the measurements are said to be (chi² above 4), or more
than a tenth of the poses is wild.")]
pub struct Arguments {
    /// Robot file (TOML): what is expected, and how well, by its table `estimator`.
    robot: PathBuf,
    #[command(flatten)]
    changes: Changes,
    /// Drive nothing: read a recording, from `omnibase run --record`, or a table of text, FILE.csv, with columns time_s, wheel_1_rad ...,
    /// gyro_rad_s, pose_x_m, pose_y_m, pose_heading_rad; may be given several times.
    #[arg(long, value_name = "FILE")]
    from: Vec<PathBuf>,
    /// Show the figures and what they are expected to show, and drive nothing.
    #[arg(long, conflicts_with = "from")]
    show: bool,
    /// Drive the figures by `omnibase run`, with its options behind `--`, as --interface.
    #[arg(long, conflicts_with_all = ["from", "show"])]
    drive: bool,
    /// Options of `omnibase run`.
    #[arg(last = true, requires = "drive", value_name = "OPTIONS")]
    run: Vec<String>,
    /// The figure, one of those that --show compares; default: full where poses are told, lines and turns where a tape measures.
    #[arg(long, value_name = "NAME", conflicts_with = "from")]
    figure: Option<String>,
    /// Side of the square about the platform that the figures take, m; default: 2.
    #[arg(long, value_name = "M", value_parser = metres, conflicts_with = "from")]
    side: Option<f64>,
    /// How many times the figures between which a tape measures are driven: ± go down with its root; default: 1.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=20), conflicts_with_all = ["from", "truth"])]
    rounds: Option<u8>,
    /// Where the recordings of --drive are kept.
    #[arg(long, value_name = "FOLDER", default_value = "calibration")]
    recordings: PathBuf,
    /// Poses: `source:NAME`, a [[source]] with carries = "pose"; or `simulator`, made up from its truth with noise (100 Hz, 1 mm,
    /// 3 mrad, 20 ms late).
    #[arg(long, value_name = "WHO")]
    truth: Option<Truth>,
    /// The gyro: an input by its name, as gyro.turn, rad/s to the left; or `simulator`. Default: safety.gyro_input of the robot file.
    #[arg(long, value_name = "WHO")]
    gyro: Option<Gyro>,
    /// Where the platform stood on the floor, "x y heading" in m, m and rad (or 90deg): before and after each recording, in order.
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    tape: Vec<FloorPose>,
    /// Standard deviations of a place by tape, mm and mrad.
    #[arg(long, value_name = "MM MRAD", default_value = "1 2", value_parser = pair)]
    tape_sigma: [f64; 2],
    /// Where the sensor of poses is mounted in base: "x y heading" in m, m and rad (or 90deg); default: as the robot file's [[sensor]] of
    /// these poses says, else 0 0 0.
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    sensor: Option<FloorPose>,
    /// How well that is known: standard deviations, mm and mrad.
    #[arg(long, value_name = "MM MRAD", default_value = "5 30", value_parser = pair)]
    sensor_sigma: [f64; 2],
    /// How late its poses are, ms, where that is known roughly; default: as that [[sensor]] says, else 0.
    #[arg(long, value_name = "MS")]
    delay_ms: Option<f64>,
    /// Seed of the robot of a rehearsal, and of the noise with which the simulator's truth is seen.
    #[arg(long, value_name = "NUMBER", default_value_t = 1)]
    seed: u64,
    /// Write a robot file with what was found: the wheels one by one, in its [[sensor]] the mounting and delay of the poses and the
    /// scale of the gyro, everything else as it is.
    #[arg(long, value_name = "FILE")]
    write: Option<PathBuf>,
    /// Write over that file where it is there already.
    #[arg(long, requires = "write")]
    overwrite: bool,
    /// Show what was found on this page of HTML, with dead reckoning and residuals over time.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Who tells poses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Truth {
    Source(String),
    Simulator,
}

/// Who tells turns.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Gyro {
    Input(String),
    Simulator,
}

impl FromStr for Truth {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match (text, text.strip_prefix("source:")) {
            ("simulator", _) => Ok(Truth::Simulator),
            (_, Some(name)) if !name.is_empty() => Ok(Truth::Source(name.to_owned())),
            _ => Err(format!("expected source:NAME or simulator, found `{text}`")),
        }
    }
}

impl FromStr for Gyro {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "simulator" => Ok(Gyro::Simulator),
            name if name.split('.').filter(|part| !part.is_empty()).count() == 2 => {
                Ok(Gyro::Input(name.to_owned()))
            }
            _ => Err(format!("expected an input as gyro.turn, or simulator, found `{text}`")),
        }
    }
}

/// A length for figures.
fn metres(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|value: &f64| (0.2..=50.0).contains(value));
    value.ok_or_else(|| format!("expected 0.2 to 50 m, found `{text}`"))
}

/// Two standard deviations.
fn pair(text: &str) -> Result<[f64; 2], String> {
    let words: Vec<&str> = text.split([' ', ',', ';']).filter(|word| !word.is_empty()).collect();
    let values: Vec<f64> = words.iter().filter_map(|word| word.parse().ok()).collect();
    match (values.as_slice(), words.len()) {
        (&[mm, mrad], 2) if [mm, mrad].iter().all(|value| value.is_finite() && *value > 0.0) => {
            Ok([1e-3 * mm, 1e-3 * mrad])
        }
        _ => Err(format!("expected two positive numbers, in mm and mrad, found `{text}`")),
    }
}

/// What is known beforehand, and how well.
pub(super) struct Known {
    pub(super) build: Build,
    pub(super) tolerances: Tolerances,
}

/// Runs the command.
pub fn run(
    arguments: &Arguments,
    registry: &Arc<Registry>,
    output: &mut dyn Write,
) -> anyhow::Result<Outcome> {
    let source = RobotSource::read(&arguments.robot, &arguments.changes)?;
    let plan = source.load_or_explain(registry)?.plan;
    let known = arguments.known(&plan);
    if let Some(path) = arguments.write.as_ref().filter(|path| !arguments.overwrite && path.exists()) {
        return Err(write::is_there(path));
    }
    let driven = if !arguments.from.is_empty() {
        Driven { dataset: recordings::read(arguments, &plan, registry)?, truth: None }
    } else {
        let figures = figure::chosen(arguments, &plan)?;
        let mut words = Vec::new();
        if arguments.show {
            figure::compare(arguments, &plan, &known, &mut words)?;
        }
        let announced = figure::announce(&figures, &plan, &mut words);
        if arguments.json {
            note(String::from_utf8_lossy(&words).trim_end())
        } else {
            output.write_all(&words)?
        }
        announced?;
        let heard = recordings::check_names(arguments, &plan);
        if arguments.show {
            if let Err(error) = heard {
                warn(format_args!("--drive needs another robot file: {error}"));
            }
            return Ok(Outcome::Done);
        }
        output.flush()?;
        if arguments.drive {
            heard?;
            drive::drive(arguments, &figures, &plan, registry, output)?
        } else {
            drive::rehearse(arguments, &source, &figures, &known, registry)?
        }
    };
    let Driven { dataset, truth } = driven;
    let solution = solve(&dataset, &known.build, &known.tolerances).context("nothing was found")?;
    let drifts = drifts(&dataset, &known, &solution)?;
    let errors = truth.map(|truth| table::errors(&truth, &known, &solution)).transpose()?;
    if arguments.json {
        let mut object = table::json(&dataset, &known, &solution, &drifts);
        object["rehearsed_errors"] =
            errors.map_or(serde_json::Value::Null, |errors| table::errors_json(&errors));
        serde_json::to_writer_pretty(&mut *output, &object)?;
        writeln!(output)?;
    } else {
        table::print(&dataset, &known, &solution, &drifts, output)?;
        if let Some(errors) = &errors {
            table::print_errors(errors, &known, output)?;
        }
    }
    output.flush()?;
    if let Some(path) = &arguments.report {
        let page = page::of(&plan.name, &dataset, &known, &solution, &drifts);
        std::fs::write(path, page.html()).with_context(|| format!("writing `{}`", path.display()))?;
    }
    if !solution.is_sound() {
        let unwritten = if arguments.write.is_some() { "; nothing is written" } else { "" };
        let (chi_square, doubted) = (solution.reduced_chi_square(), 100.0 * solution.doubted());
        warn(format_args!(
            "the runs don't fit what was said of them: chi² per freedom is {chi_square:.2}, expected at most {WORST_CHI_SQUARE}; \
             {doubted:.1} % of the poses are wild, expected at most {} %{unwritten}",
            100.0 * MOST_DOUBTED
        ));
    } else if let Some(path) = &arguments.write {
        let names = write::SensorNames {
            tracker: tracker(&plan, arguments.truth.as_ref()).map(|one| one.name.as_str()),
            gyro: recordings::gyro(&plan, arguments.gyro.as_ref()).map(|one| one.name.as_str()),
        };
        write::write(path, arguments.overwrite, &source.text.text, &known, &solution, names, registry)?;
        note(format_args!(
            "{}: compare it with {}, and keep it if it is better",
            path.display(),
            arguments.robot.display()
        ));
    }
    Ok(if solution.is_sound() { Outcome::Done } else { Outcome::Failed })
}

/// How far dead reckoning runs off in each run: by the file, and by what was found.
fn drifts(dataset: &Dataset, known: &Known, solution: &Solution) -> anyhow::Result<Vec<[Drift; 2]>> {
    let runs = dataset.runs.iter().zip(&solution.runs);
    runs.map(|(run, fit)| {
        let of = |build: &Build| Drift::of(run, fit, build).context("dead reckoning");
        Ok([of(&known.build)?, of(&solution.build)?])
    })
    .collect()
}

/// The robot file's sensor of poses: that of the source that tells them, of another's poses the first one.
pub(crate) fn tracker<'a>(plan: &'a RobotPlan, truth: Option<&Truth>) -> Option<&'a SensorPlan> {
    let mut trackers = plan.sensors.iter().filter(|one| one.kind == SensorName::Pose);
    match truth {
        Some(Truth::Source(name)) => trackers.find(|one| match one.from {
            InputOwner::Source(place) => plan.sources[place].name == *name,
            InputOwner::Device(_) => false,
        }),
        _ => trackers.next(),
    }
}

/// Where a sensor of poses is mounted and how late it is, as the robot file says.
pub(crate) fn mount_of(tracker: Option<&SensorPlan>) -> SensorMount {
    tracker.map_or(SensorMount::default(), |one| SensorMount {
        base_from_sensor: one.sensor.body_from_sensor,
        delay_s: one.delay_ns as f64 * 1e-9,
    })
}

impl Arguments {
    /// Where the sensor of poses is expected: as the command line says, or the file.
    fn mount(&self, plan: &RobotPlan) -> SensorMount {
        let of_file = mount_of(tracker(plan, self.truth.as_ref()));
        SensorMount {
            base_from_sensor: self.sensor.map_or(of_file.base_from_sensor, |told| told.0),
            delay_s: self.delay_ms.map_or(of_file.delay_s, |ms| 1e-3 * ms),
        }
    }

    /// What the file expects, and how well.
    fn known(&self, plan: &RobotPlan) -> Known {
        let wheels = plan.kinematics.wheels().iter().zip(&plan.drives);
        let named = wheels.map(|(wheel, drive)| Wheel { name: drive.name.clone(), ..wheel.clone() });
        let settings = covariance_settings(&plan.estimator);
        let [sensor_m, sensor_rad] = self.sensor_sigma;
        let sensor = self.mount(plan);
        let ready = Tolerances::default();
        Known {
            build: Build {
                wheels: named.collect(),
                creep: plan.estimator.creep.unwrap_or(0.0),
                roller_resistance: plan.estimator.roller_resistance.unwrap_or(0.03),
                sensor,
                gyro_scale: 0.0,
            },
            tolerances: Tolerances {
                wheel: settings.geometry,
                sensor_m,
                sensor_rad,
                way_m2_per_m: settings.position_per_m,
                way_m2_per_rad: settings.position_per_rad,
                turn_rad2_per_m: settings.heading_per_m,
                turn_rad2_per_rad: settings.heading_per_rad,
                ..ready
            },
        }
    }
}
