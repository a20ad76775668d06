//! The same robots through all of it: bring-up, frames, chips, firmware, and the run of the command line.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use omnibase_ethercat_sim::in_process;
use omnibase_record::run::{OnFull, RunFiles, RunRecorded, RunRecorder, RunSink};
use omnibase_robot::{Registry, Robot};
use omnibase_robot_sim::SharedMachine;
use omnibase_run::channels::{Known, Rows};
use omnibase_run::simulated::Script;
use omnibase_run::{LoadedRobot, Progress, Ran, RobotText, RunError, Setup, run, simulated};

use crate::laws::{ALL, CLOSED, is_of_torque};
use crate::robots;

/// A robot, a path, a control law and what it is told of the mass: a row of `docs/accuracy.md`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Case {
    /// The robot: `bmm` or `mecanum`.
    pub robot: &'static str,
    /// The path: `circle`, `square` or `eight`.
    pub path: &'static str,
    /// The control law.
    pub law: &'static str,
    /// First estimate of mass and inertia over the truth.
    pub estimate: f64,
    /// What the law of torque is told of the treads.
    pub treads: Treads,
    /// Whether odometry makes up for creep.
    pub creep: Creep,
}

/// What the law of torque is told of the treads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Treads {
    /// Nothing: it is designed for all that treads are known to have.
    Unknown,
    /// That they are stiff: [`robots::STIFF_TREADS`].
    Stiff,
}

/// Whether odometry makes up for creep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Creep {
    /// As shipped.
    Ignored,
    /// With the creep that the simulated treads have.
    MadeUpFor,
}

impl Treads {
    /// For a table; the laws of speed count with none.
    pub fn text(self, law: &str) -> &'static str {
        match self {
            _ if !is_of_torque(law) => "-",
            Treads::Unknown => "unknown",
            Treads::Stiff => "stiff",
        }
    }

    /// Laws with what each of them can be told of the treads.
    pub fn by_law(laws: &[&'static str]) -> impl Iterator<Item = (&'static str, Treads)> {
        laws.iter().flat_map(|&law| {
            let told: &[Treads] =
                if is_of_torque(law) { &[Treads::Unknown, Treads::Stiff] } else { &[Treads::Unknown] };
            told.iter().map(move |&treads| (law, treads))
        })
    }
}

/// Time of a figure of eight, s: a little more than the limit on turning asks for.
pub(crate) const EIGHT_S: f64 = 25.0;

/// All rows, in the table's order.
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for robot in ["bmm", "mecanum"] {
        for path in ["circle", "square"] {
            for (laws, creep) in [(&ALL, Creep::Ignored), (&CLOSED, Creep::MadeUpFor)] {
                for (law, treads) in Treads::by_law(laws) {
                    if creep == Creep::MadeUpFor && is_of_torque(law) && treads == Treads::Unknown {
                        continue;
                    }
                    let estimates: &[f64] = if is_of_torque(law) { &[0.5, 1.5] } else { &[1.0] };
                    let case = |&estimate| Case { robot, path, law, estimate, treads, creep };
                    cases.extend(estimates.iter().map(case));
                }
            }
        }
        for creep in [Creep::Ignored, Creep::MadeUpFor] {
            let (law, treads) = ("closed_loop_speed", Treads::Unknown);
            cases.push(Case { robot, path: "eight", law, estimate: 1.0, treads, creep });
        }
    }
    cases
}

impl Case {
    /// Runs it.
    ///
    /// # Panics
    /// Where the robot can't be made or brought up; an end before the reference's is in what comes back.
    pub fn run(&self) -> Ran {
        let text = if self.robot == "bmm" { robots::BMM } else { robots::MECANUM };
        let reference = match self.path {
            "circle" => robots::CIRCLE.to_owned(),
            "eight" => robots::eight(text, EIGHT_S, EIGHT_S),
            _ => robots::SQUARE.to_owned(),
        };
        let mut text = robots::loaded(text, self.law, self.estimate, &reference);
        if self.treads == Treads::Stiff {
            text = robots::on_stiff_treads(&text);
        }
        if self.creep == Creep::MadeUpFor {
            let creep = omnibase_robot_sim::Contact::default().creep;
            text.push_str(&format!("\n[estimator]\ncreep = {creep:?}\n"));
        }
        track(&text)
    }

    /// A row of the table.
    pub fn row(&self, ran: &Ran) -> String {
        let millimetres = |metres: Option<f64>| metres.map_or(f64::NAN, |metres| 1e3 * metres);
        let summary = &ran.summary;
        let [believed, truly] = [summary.rms_error_m.believed, summary.rms_error_m.truth].map(millimetres);
        let end = millimetres(summary.final_error_m.truth);
        let mass = match is_of_torque(self.law) {
            true => format!("{:.0} % | {:.0} kg", 100.0 * self.estimate, ran.last.estimates()[0]),
            false => "- | -".to_owned(),
        };
        let creep = if self.creep == Creep::MadeUpFor { "made up for" } else { "-" };
        let treads = self.treads.text(self.law);
        let kept = match () {
            () if !ran.finished => "not finished",
            () if end <= 1.0 => "bound and aim",
            () if end <= 3.0 => "bound",
            () => "neither",
        };
        format!(
            "| {} | {} | {} | {treads} | {creep} | {mass} | {believed:.3} | {truly:.3} | {end:.3} | {kept} |",
            self.robot, self.path, self.law
        )
    }
}

/// Runs a robot's file once, as `omnibase run` does.
///
/// # Panics
/// Where the robot can't be made or brought up.
pub fn track(text: &str) -> Ran {
    track_and_look(text).ran
}

/// A run, and the machine that it moved.
pub struct Tracked {
    /// What the run came to.
    pub ran: Ran,
    /// The machine, as the run left it.
    pub machine: SharedMachine,
}

/// Runs a robot's file once, as `omnibase run` does, and keeps the truth.
///
/// # Panics
/// Where the robot can't be made or brought up.
pub fn track_and_look(text: &str) -> Tracked {
    bring_up(text).unwrap_or_else(|error| panic!("{error}"))
}

/// Runs a robot's file once; an error where its bus can't be brought up.
///
/// # Panics
/// Where the robot can't be made.
pub fn bring_up(text: &str) -> Result<Tracked, RunError> {
    run_of(&loaded(text), None)
}

/// Runs a robot's file once and records it, as `omnibase run --record` does.
///
/// # Panics
/// Where the robot can't be made or brought up, or the file can't be made.
pub fn record(text: &str, file: &Path) -> (Ran, RunRecorded) {
    let robot = loaded(text);
    let rows = Rows::new(&robot.plan.record_layout(), Known::Truth);
    let description = omnibase_run::describe::description(&robot, &Registry::with_built_in());
    let files = RunFiles { mcap: Some(file.to_owned()), description, ..RunFiles::default() };
    let started = RunRecorder::start(&files, rows.schema(), OnFull::Wait);
    let (recorder, sink) = started.unwrap_or_else(|error| panic!("{error}"));
    let tracked = run_of(&robot, Some((rows, sink))).unwrap_or_else(|error| panic!("{error}"));
    (tracked.ran, recorder.finish())
}

fn loaded(text: &str) -> LoadedRobot {
    let robot = RobotText { text: text.to_owned(), ..RobotText::default() }.load(&Registry::with_built_in());
    robot.unwrap_or_else(|problems| panic!("{problems:#?}"))
}

fn run_of(robot: &LoadedRobot, recording: Option<(Rows, RunSink)>) -> Result<Tracked, RunError> {
    let registry = Registry::with_built_in();
    let (mut segment, machine) = simulated::segment(&robot.plan).unwrap_or_else(|error| panic!("{error}"));
    let script = Script::new(&robot.plan, &mut segment, &machine);
    let (link, clock) = in_process(segment);
    let setup = Setup {
        plan: &robot.plan,
        robot: Robot::build(&robot.plan, &registry).unwrap_or_else(|error| panic!("{error}")),
        machine: Some(machine.clone()),
        script,
        recording,
        live: None,
        stop: &AtomicBool::new(false),
        progress: &Progress::default(),
    };
    let ran = run(link, clock, setup, &mut |_| {})?;
    Ok(Tracked { ran, machine })
}
