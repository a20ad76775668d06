//! A recording computed again, cycle by cycle, and compared bit by bit.

use omnibase_record::run::{FILE_NUMBER, RecordedRun, SELECTION};
use omnibase_robot::config::Source;
use omnibase_robot::signals::{CycleRecord, NotARecord, Value};
use omnibase_robot::stages::Reference;
use omnibase_robot::{ImageBuffer, Problem, Registry, RequestKind, Robot, RobotPlan, StageError};

use crate::channels::{record, word};
use crate::describe::reference_key;
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

/// Computes a recording again until the first difference.
pub fn replay(run: &RecordedRun, registry: &Registry) -> Result<Replayed, ReplayError> {
    if let Some(words) = run.description.get(SELECTION) {
        return Err(ReplayError::Chosen { words: words.clone() });
    }
    if let Some(number) = run.description.get(FILE_NUMBER).filter(|number| *number != "1") {
        return Err(ReplayError::LaterFile { number: number.clone() });
    }
    let plan = from_description(&run.description, registry).map_err(ReplayError::Robot)?;
    let layout = plan.record_layout();
    let mut robot = Robot::build(&plan, registry)?;
    let mut image = ImageBuffer::new(&plan);
    let (mut recorded, mut computed) = (Vec::new(), Vec::new());
    let mut cycles = 0;
    for (row, raw) in run.raw.iter().enumerate() {
        let cycle = record(&layout, raw).map_err(|error| match error {
            NotARecord::Channels => ReplayError::Words { row, bytes: raw.len() },
            NotARecord::Code { channel, value } => ReplayError::Code {
                row,
                channel: CycleRecord::channels(&layout).swap_remove(channel).name,
                value: value.as_f64(),
            },
        })?;
        if row == 0 && cycle.time.index != 0 {
            return Err(ReplayError::Missing { index: cycle.time.index });
        }
        if let Some(RequestKind::UseReference { number }) = cycle.request.map(|request| request.kind) {
            robot.offer_reference(number, loaded(run, &plan, registry, number)?);
        }
        cycle.values(&mut recorded);
        robot.replay(&cycle, &mut image).values(&mut computed);
        cycles += 1;
        let differs = recorded.iter().zip(&computed).position(|(a, b)| word(*a) != word(*b));
        if let Some(number) = differs {
            let channel = CycleRecord::channels(&layout).swap_remove(number).name;
            let (recorded, computed) = (recorded[number], computed[number]);
            let difference = Difference { index: cycle.time.index, channel, recorded, computed };
            return Ok(Replayed { cycles, difference: Some(difference) });
        }
    }
    Ok(Replayed { cycles, difference: None })
}
