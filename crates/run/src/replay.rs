//! A recording computed again, cycle by cycle, and compared bit by bit.

use std::io::Read;
use std::ops::ControlFlow;

use omnibase_record::run::{FILE_NUMBER, Keep, RecordedRun, RunError, SELECTION};
use omnibase_robot::config::Source;
use omnibase_robot::signals::{NotARecord, Value};
use omnibase_robot::stages::Reference;
use omnibase_robot::{ImageBuffer, Problem, Registry, RequestKind, Robot, RobotPlan, StageError};

use crate::channels::{RecordWords, reference_key, word};
use crate::robot_text::from_description;

/// Why a recording can't be computed again.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// Its robot can't be made.
    #[error("the recording's robot: {}", list(.0))]
    Robot(Vec<Problem>),
    /// A stage can't be made.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// Its words aren't those of this robot.
    #[error(
        "cycle {row} of the recording holds {bytes} bytes, which aren't a record of this robot by this version of \
         omnibase: a recording is computed again by the version that made it"
    )]
    Words {
        /// Number of the row, from 0.
        row: usize,
        /// What it holds.
        bytes: usize,
    },
    /// A value is one that its channel can't have.
    #[error(
        "cycle {row} of the recording holds {value} in `{channel}`, which this version of omnibase doesn't know: a \
         recording is computed again by the version that made it"
    )]
    Code {
        /// Number of the row, from 0.
        row: usize,
        /// The channel.
        channel: String,
        /// The value.
        value: f64,
    },
    /// A reference that was loaded while the robot ran isn't there.
    #[error("the recording lacks reference {number}, which was loaded while the robot ran")]
    Reference {
        /// Its number.
        number: u32,
    },
    /// It holds only some signals or cycles.
    #[error("the recording holds only {words}: a run is computed again from every signal of every cycle")]
    Chosen {
        /// What it holds.
        words: String,
    },
    /// It is a later file of a run in several.
    #[error(
        "the recording is file {number} of its run: a run is computed again from its first cycle on, which the first \
         file holds"
    )]
    LaterFile {
        /// Its number.
        number: String,
    },
    /// Cycles are missing, so that what follows can't be computed.
    #[error("the recording lacks cycles before {index}: they found no room when it was made")]
    Missing {
        /// The first cycle behind the gap.
        index: u64,
    },
}

/// The reference that was loaded by a number while the robot ran.
fn loaded(
    run: &RecordedRun,
    plan: &RobotPlan,
    registry: &Registry,
    number: u32,
) -> Result<Box<dyn Reference>, ReplayError> {
    let key = reference_key(number);
    let text = run.description.get(&key).ok_or(ReplayError::Reference { number })?;
    let source = Source::read_reference(text, &key);
    let no_files = |_: &str| Err("the recording doesn't hold it".to_owned());
    let checked = plan.check_reference(source, registry, &no_files);
    checked.map(|(_, made)| made).map_err(ReplayError::Robot)
}

fn list(problems: &[Problem]) -> String {
    problems.iter().map(|problem| format!("\n  {problem}")).collect()
}

/// What a replay showed.
#[derive(Clone, Debug, PartialEq)]
pub struct Replayed {
    /// Cycles that were computed and compared.
    pub cycles: u64,
    /// The first value that differs.
    pub difference: Option<Difference>,
}

/// A value that came out differently.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// The cycle.
    pub index: u64,
    /// The channel.
    pub channel: String,
    /// What was recorded.
    pub recorded: Value,
    /// What came out.
    pub computed: Value,
}

/// A robot that computes rows again, and what it found so far.
struct Replay<'a> {
    registry: &'a Registry,
    plan: RobotPlan,
    words: RecordWords,
    robot: Robot,
    image: ImageBuffer,
    computed: Vec<Value>,
    found: Replayed,
}

impl<'a> Replay<'a> {
    /// The robot of a recording, by what it says of itself.
    fn of(run: &RecordedRun, registry: &'a Registry) -> Result<Self, ReplayError> {
        if let Some(words) = run.description.get(SELECTION) {
            return Err(ReplayError::Chosen { words: words.clone() });
        }
        if let Some(number) = run.description.get(FILE_NUMBER).filter(|number| *number != "1") {
            return Err(ReplayError::LaterFile { number: number.clone() });
        }
        let plan = from_description(&run.description, registry).map_err(ReplayError::Robot)?;
        Ok(Replay {
            registry,
            words: RecordWords::new(plan.record_layout()),
            robot: Robot::build(&plan, registry)?,
            image: ImageBuffer::new(&plan),
            computed: Vec::new(),
            found: Replayed { cycles: 0, difference: None },
            plan,
        })
    }

    /// Computes a row again; `Break` where it comes out differently.
    fn row(&mut self, run: &RecordedRun, raw: &[u8]) -> Result<ControlFlow<()>, ReplayError> {
        let row = self.found.cycles as usize;
        let channel = |number: usize, words: &RecordWords| words.channels()[number].name.clone();
        let cycle = self.words.record(raw).map_err(|error| match error {
            NotARecord::Channels => ReplayError::Words { row, bytes: raw.len() },
            NotARecord::Code { channel: number, value } => {
                ReplayError::Code { row, channel: channel(number, &self.words), value: value.as_f64() }
            }
        })?;
        if row == 0 && cycle.time.index != 0 {
            return Err(ReplayError::Missing { index: cycle.time.index });
        }
        if let Some(RequestKind::UseReference { number }) = cycle.request.map(|request| request.kind) {
            self.robot.offer_reference(number, loaded(run, &self.plan, self.registry, number)?);
        }
        self.robot.replay(&cycle, &mut self.image).values(&mut self.computed);
        self.found.cycles += 1;
        let mut pairs = self.words.values().iter().zip(&self.computed);
        let Some(number) = pairs.position(|(a, b)| word(*a) != word(*b)) else {
            return Ok(ControlFlow::Continue(()));
        };
        self.found.difference = Some(Difference {
            index: cycle.time.index,
            channel: channel(number, &self.words),
            recorded: self.words.values()[number],
            computed: self.computed[number],
        });
        Ok(ControlFlow::Break(()))
    }
}

/// Computes a recording again until the first difference.
pub fn replay(run: &RecordedRun, registry: &Registry) -> Result<Replayed, ReplayError> {
    let mut replay = Replay::of(run, registry)?;
    for raw in &run.raw {
        if replay.row(run, raw)?.is_break() {
            break;
        }
    }
    Ok(replay.found)
}

/// A recording that was computed again while it was read.
#[derive(Clone, Debug)]
pub struct ReplayedFile {
    /// What came out.
    pub replayed: Replayed,
    /// The file ends early, in words.
    pub truncated: Option<String>,
    /// Time of the last row that was read, ns.
    pub until_ns: u64,
}

/// Why a file can't be computed again.
#[derive(Debug, thiserror::Error)]
pub enum ReplayFileError {
    /// It can't be read.
    #[error(transparent)]
    Read(#[from] RunError),
    /// It can't be computed.
    #[error(transparent)]
    Replay(#[from] ReplayError),
}

/// As [`replay`], row by row out of a file: a run of any length needs no more room than a short one. `input` needs no buffer.
pub fn replay_from(input: impl Read, registry: &Registry) -> Result<ReplayedFile, ReplayFileError> {
    let (mut replay, mut failure, mut until_ns) = (None, None, 0);
    let read = RecordedRun::read_each(input, Keep::All, &mut |run, row| {
        until_ns = row.time_ns;
        let computed = match &mut replay {
            Some(replay) => Replay::row(replay, run, row.raw),
            none => Replay::of(run, registry).and_then(|made| none.insert(made).row(run, row.raw)),
        };
        computed.unwrap_or_else(|error| {
            failure = Some(error);
            ControlFlow::Break(())
        })
    })?;
    let replayed = match (failure, replay) {
        (Some(error), _) => return Err(error.into()),
        (None, Some(replay)) => replay.found,
        // Without a row its robot must be one, too.
        (None, None) => Replay::of(&read, registry)?.found,
    };
    Ok(ReplayedFile { replayed, truncated: read.truncated, until_ns })
}
