//! A recorded run as the calibration reads it: what the wheels turned, and what tells where the platform really was.

pub mod table;

use omnibase_calibrate::rehearsal::{GyroSensor, PoseSensor, Random};
use omnibase_calibrate::{PoseSample, Run, Step, TurnSample};
use omnibase_platform::{PerWheel, Pose2};
use omnibase_record::run::{FILE_NUMBER, Keep, RecordedRun};
use omnibase_robot::RobotPlan;
use omnibase_robot::signals::{Carries, Exchange, column_name};

/// What is kept of a recording while it is read: wheels, truth, and what comes from beside the drives.
pub const READ: Keep<'static> = Keep::Signals(is_read);

fn is_read(topic: &str, signal: &str, of_topic: &[String]) -> bool {
    match topic {
        "/cycle" => matches!(signal, "index" | "time_ns"),
        "/exchange" => signal == "result",
        "/timing" => signal == "left_out_cycles",
        "/truth" | "/source" => true,
        wheel if wheel.starts_with("/wheel_") => signal == "increment_rad",
        // Who isn't a drive has an age.
        _ => of_topic.iter().any(|name| name == "age_s"),
    }
}

/// What tells where the platform really was.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Witnesses {
    /// Poses: whose.
    pub poses: Option<PosesFrom>,
    /// The turn, rad/s.
    pub gyro: Option<GyroFrom>,
    /// The seed of what is made up.
    pub seed: u64,
}

/// Whose poses.
#[derive(Clone, Debug, PartialEq)]
pub enum PosesFrom {
    /// A `[[source]]` that carries poses.
    Source {
        /// Its name.
        name: String,
        /// Noise of its sensor, m and rad, which is added to covariances that are sent.
        sigma: [f64; 2],
    },
    /// The simulator's truth, as such a sensor would have seen it.
    Simulator(PoseSensor),
    /// The simulator's truth itself, of where such a sensor is.
    Truth(PoseSensor),
}

/// Whose turn.
#[derive(Clone, Debug, PartialEq)]
pub enum GyroFrom {
    /// An input by its name, `source.value` or `device.value`.
    Input(String),
    /// The simulator's truth, as such a gyro would have seen it.
    Simulator(GyroSensor),
}

/// Why a recording is no dataset.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DatasetReadError {
    /// A signal isn't in it.
    #[error("the recording has no `{signal}`: {why}")]
    Missing {
        /// The signal.
        signal: String,
        /// What it is needed for.
        why: &'static str,
    },
    /// Cycles are missing.
    #[error("the recording lacks cycles before {index}: what the wheels turned in them isn't known")]
    Gap {
        /// The first cycle behind the gap.
        index: u64,
    },
    /// A later file of a run in several.
    #[error("the recording is file {number} of its run: expected the first one, or a run in one file")]
    LaterFile {
        /// Its number.
        number: String,
    },
    /// A source by a name that isn't one.
    #[error("`{name}`: expected a `[[source]]` with carries = \"pose\", found {found}")]
    NotPoses {
        /// The name.
        name: String,
        /// What the robot's file has.
        found: String,
    },
    /// An input by a name that isn't one.
    #[error(
        "`{name}`: expected an input of a `[[source]]` or a SubDevice, as gyro.turn; the robot's file has {found}"
    )]
    NoInput {
        /// The name.
        name: String,
        /// What the robot's file has.
        found: String,
    },
    /// Nothing came.
    #[error("`{name}` said nothing in this run")]
    Silent {
        /// Who.
        name: String,
    },
    /// A variance that is none.
    #[error(
        "`{name}`, {at_s:.3} s: {signal} is {found}, expected a variance above 0, or a `[[sensor]]` of these poses: it says how far a pose is believed"
    )]
    Variance {
        /// Whose.
        name: String,
        /// When.
        at_s: f64,
        /// Which value.
        signal: &'static str,
        /// What was found.
        found: f64,
    },
}

/// Reads a recorded run of a robot.
pub fn run_of(
    recorded: &RecordedRun,
    plan: &RobotPlan,
    name: &str,
    witnesses: &Witnesses,
) -> Result<Run, DatasetReadError> {
    if let Some(number) = recorded.description.get(FILE_NUMBER).filter(|number| *number != "1") {
        return Err(DatasetReadError::LaterFile { number: number.clone() });
    }
    let reader = Reader { recorded, plan };
    let mut run = reader.wheels(name)?;
    let mut random = Random::new(witnesses.seed);
    match &witnesses.poses {
        Some(PosesFrom::Source { name, sigma }) => run.poses = reader.poses(name, *sigma)?,
        Some(PosesFrom::Simulator(sensor)) => run.poses = sensor.poses(&reader.truth()?, &mut random),
        Some(PosesFrom::Truth(sensor)) => run.poses = sensor.true_poses(&reader.truth()?),
        None => {}
    }
    match &witnesses.gyro {
        Some(GyroFrom::Input(input)) => run.turns = reader.turns(input)?,
        Some(GyroFrom::Simulator(gyro)) => run.turns = gyro.turns(&reader.true_turns()?, &mut random),
        None => {}
    }
    Ok(run)
}

/// Whether a robot has the source and the input that are named.
pub fn check_names(plan: &RobotPlan, witnesses: &Witnesses) -> Result<(), DatasetReadError> {
    if let Some(PosesFrom::Source { name, .. }) = &witnesses.poses {
        check_source(plan, name)?;
    }
    if let Some(GyroFrom::Input(name)) = &witnesses.gyro {
        input_of(plan, name)?;
    }
    Ok(())
}

fn check_source(plan: &RobotPlan, name: &str) -> Result<(), DatasetReadError> {
    let found = match plan.sources.iter().find(|source| source.name == name) {
        Some(source) if source.carries == Carries::Pose => return Ok(()),
        Some(_) => "one that carries something else".to_owned(),
        None => listed(plan.sources.iter().map(|source| source.name.clone()), "no source"),
    };
    Err(DatasetReadError::NotPoses { name: name.to_owned(), found })
}

/// An input by its name: whose it is, its own name and unit, and whether it is sent.
fn input_of<'p>(
    plan: &'p RobotPlan,
    input: &str,
) -> Result<(&'p str, &'p str, &'p str, bool), DatasetReadError> {
    let sent = plan.sources.iter().flat_map(|source| {
        source.input.iter().map(|sent| (source.name.as_str(), sent.name.as_str(), sent.unit.as_str(), true))
    });
    let read = plan.devices.iter().flat_map(|device| {
        let inputs = device.input.iter();
        inputs.map(|input| (device.name.as_str(), input.name.as_str(), input.unit.as_str(), false))
    });
    let all: Vec<(&str, &str, &str, bool)> = sent.chain(read).collect();
    let found = all.iter().find(|(owner, name, ..)| format!("{owner}.{name}") == input);
    found.copied().ok_or_else(|| {
        let names = all.iter().map(|(owner, name, ..)| format!("{owner}.{name}"));
        DatasetReadError::NoInput { name: input.to_owned(), found: listed(names, "none") }
    })
}

struct Reader<'a> {
    recorded: &'a RecordedRun,
    plan: &'a RobotPlan,
}

impl<'a> Reader<'a> {
    fn column(&self, topic: &str, signal: &str, why: &'static str) -> Result<Vec<f64>, DatasetReadError> {
        let column = self.recorded.column(topic, signal).map(Iterator::collect);
        column.ok_or_else(|| DatasetReadError::Missing {
            signal: format!("{}.{signal}", topic.trim_start_matches('/')),
            why,
        })
    }

    /// When the encoders of each row were read, s.
    fn instants_s(&self) -> Result<Vec<f64>, DatasetReadError> {
        let age_s = self.plan.input_age_ns() as f64 * 1e-9;
        let times = self.column("/cycle", "time_ns", "a cycle's moment")?;
        Ok(times.into_iter().map(|time_ns| time_ns * 1e-9 - age_s).collect())
    }

    fn wheels(&self, name: &str) -> Result<Run, DatasetReadError> {
        let why = "increments of the wheels are what is calibrated";
        let indices = self.column("/cycle", "index", "gaps are seen by it")?;
        if let Some(pair) = indices.windows(2).find(|pair| pair[1] - pair[0] > 1.0) {
            // A cycle that was left out by an overrun was never computed: the next increment spans it.
            let left_out = self.recorded.column("/timing", "left_out_cycles");
            let row = indices.iter().position(|index| *index == pair[1]).unwrap_or_default();
            let known = left_out.and_then(|mut column| column.nth(row)).unwrap_or(0.0);
            if pair[1] - pair[0] - 1.0 > known {
                return Err(DatasetReadError::Gap { index: pair[1] as u64 });
            }
        }
        let results = self.column("/exchange", "result", "lost frames bring no increments")?;
        let count = self.plan.drives.len();
        let wheels: Vec<Vec<f64>> = (1..=count)
            .map(|wheel| self.column(&format!("/wheel_{wheel}"), "increment_rad", why))
            .collect::<Result<_, _>>()?;
        let instants_s = self.instants_s()?;
        let complete = Exchange::Complete.codes()[0] as f64;
        let mut run = Run { name: name.to_owned(), ..Run::default() };
        let Some(first_s) = instants_s.first() else { return Ok(run) };
        run.begin_s = *first_s;
        for (row, instant_s) in instants_s.iter().enumerate().skip(1) {
            if results[row] == complete {
                let turned_rad = PerWheel::from_fn(count, |wheel| wheels[wheel][row]);
                run.steps.push(Step { end_s: *instant_s, turned_rad });
            }
        }
        Ok(run)
    }

    fn truth(&self) -> Result<Vec<(f64, Pose2)>, DatasetReadError> {
        let why = "only simulated runs know the truth";
        let [x, y, heading] =
            ["pose_x_m", "pose_y_m", "pose_heading_rad"].map(|s| self.column("/truth", s, why));
        let (x, y, heading, instants_s) = (x?, y?, heading?, self.instants_s()?);
        let pose = |(row, instant_s): (usize, f64)| (instant_s, Pose2::new(x[row], y[row], heading[row]));
        Ok(instants_s.into_iter().enumerate().map(pose).collect())
    }

    fn true_turns(&self) -> Result<Vec<(f64, f64)>, DatasetReadError> {
        let turns = self.column("/truth", "twist_heading_rad_s", "only simulated runs know the truth")?;
        Ok(self.instants_s()?.into_iter().zip(turns).collect())
    }

    /// Rows in which a source was heard, each with the instant that it states, s.
    fn heard(&self, name: &str) -> Result<Vec<(usize, f64)>, DatasetReadError> {
        let place = self.plan.sources.iter().position(|source| source.name == name).unwrap_or_default();
        let heard = self.column("/source", "heard", "it says when a source was heard")?;
        let instants_ns = self.column(&format!("/{name}"), "instant_ns", "a value has an instant")?;
        let mut before_ns = f64::NEG_INFINITY;
        let mut rows = Vec::new();
        for (row, (heard, instant_ns)) in heard.into_iter().zip(instants_ns).enumerate() {
            if heard as u64 >> place & 1 == 1 && instant_ns > before_ns {
                before_ns = instant_ns;
                rows.push((row, instant_ns * 1e-9));
            }
        }
        Ok(rows)
    }

    fn poses(&self, name: &str, sigma: [f64; 2]) -> Result<Vec<PoseSample>, DatasetReadError> {
        check_source(self.plan, name)?;
        let topic = format!("/{name}");
        let of = |signal: &str| self.column(&topic, signal, "a pose consists of it");
        let (x, y, heading) = (of("x_m")?, of("y_m")?, of("heading_rad")?);
        let (xx, yy, hh) = (of("covariance_xx_m2")?, of("covariance_yy_m2")?, of("covariance_hh_rad2")?);
        let own = sigma.map(|sigma| sigma * sigma);
        let mut poses = Vec::new();
        for (row, instant_s) in self.heard(name)? {
            if ![x[row], y[row]].iter().all(|value| value.is_finite()) {
                continue;
            }
            let variance = |signal, found: f64, own: f64| {
                if found.is_finite() && found >= 0.0 && found + own > 0.0 {
                    return Ok(found + own);
                }
                Err(DatasetReadError::Variance { name: name.to_owned(), at_s: instant_s, signal, found })
            };
            let position_m2 = 0.5
                * (variance("covariance_xx", xx[row], own[0])? + variance("covariance_yy", yy[row], own[0])?);
            let has_heading = heading[row].is_finite();
            let sigma_rad =
                if has_heading { variance("covariance_hh", hh[row], own[1])?.sqrt() } else { f64::INFINITY };
            let world_from_sensor = Pose2::new(x[row], y[row], if has_heading { heading[row] } else { 0.0 });
            poses.push(PoseSample { instant_s, world_from_sensor, sigma_m: position_m2.sqrt(), sigma_rad });
        }
        if poses.is_empty() { Err(DatasetReadError::Silent { name: name.to_owned() }) } else { Ok(poses) }
    }

    fn turns(&self, input: &str) -> Result<Vec<TurnSample>, DatasetReadError> {
        let (owner, name, unit, is_sent) = input_of(self.plan, input)?;
        let rates =
            self.column(&format!("/{owner}"), &column_name(name, unit), "it is what the gyro measures")?;
        let rows: Vec<(usize, f64)> =
            if is_sent { self.heard(owner)? } else { self.instants_s()?.into_iter().enumerate().collect() };
        let turn = |(row, instant_s): (usize, f64)| {
            rates[row].is_finite().then_some(TurnSample { instant_s, rate_rad_s: rates[row] })
        };
        let turns: Vec<TurnSample> = rows.into_iter().filter_map(turn).collect();
        if turns.is_empty() { Err(DatasetReadError::Silent { name: input.to_owned() }) } else { Ok(turns) }
    }
}

/// Names in a row, or what to say where there are none.
fn listed(names: impl Iterator<Item = String>, none: &str) -> String {
    let names: Vec<String> = names.collect();
    if names.is_empty() { none.to_owned() } else { names.join(", ") }
}

#[cfg(test)]
mod tests;
