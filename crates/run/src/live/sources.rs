//! What other programs send on its way to the cycle: the latest of each, judged by its instant before it goes.

use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use omnibase_robot::Robot;
use omnibase_robot::config::SourcePlan;
use omnibase_robot::signals::{Between, Heard, MAX_SOURCES};
use triple_buffer::{Input, Output, triple_buffer};

/// Between two cycles the robot's clock stands, and a cycle may be late: instants may be ahead of it by so much, ns, and
/// count as the clock's then.
const AHEAD_NS: u64 = 10_000_000;

/// Why something that a program sent goes no further.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotHeard {
    /// The robot has no such source.
    Unknown,
    /// It is of a time that the robot's clock hasn't reached.
    Future {
        /// How far ahead it is, ns.
        ahead_ns: u64,
    },
    /// Something newer was heard before it.
    Overtaken {
        /// By how much, ns.
        by_ns: u64,
    },
    /// It is older than what is believed.
    TooOld {
        /// Its age, ns.
        age_ns: u64,
        /// The greatest that is believed, ns.
        most_ns: u64,
    },
}

impl fmt::Display for NotHeard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = |ns: u64| ns as f64 * 1e-6;
        match *self {
            NotHeard::Unknown => f.write_str("the robot has no such source"),
            NotHeard::Future { ahead_ns } => write!(
                f,
                "its instant is {:.1} ms ahead of the robot's clock: expected the last stamp plus the time since",
                ms(ahead_ns)
            ),
            NotHeard::Overtaken { by_ns } => {
                write!(f, "what was measured {:.3} ms later was heard before it", ms(by_ns))
            }
            NotHeard::TooOld { age_ns, most_ns } => {
                write!(f, "it is {:.1} ms old, and is believed for {:.1} ms", ms(age_ns), ms(most_ns))
            }
        }
    }
}

/// What became of all that a program sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SourceCounts {
    /// Taken.
    pub heard: u64,
    /// Too old when it came.
    pub late: u64,
    /// Overtaken by what was sent later, or of the future.
    pub out_of_order: u64,
}

/// The line from one program to the cycle.
struct SourceLine {
    to_cycle: Input<Heard>,
    /// What was said since the cycle took it.
    between: Arc<AtomicU64>,
    /// The instant of the latest as it was sent.
    latest_ns: Option<u64>,
    max_age_ns: u64,
    /// What was measured earlier than what was heard counts all the same.
    any_order: bool,
    counts: SourceCounts,
}

/// The lines of all programs; those who send wait for each other, never for the cycle.
#[derive(Clone, Default)]
pub struct SourceLines(Arc<[Mutex<SourceLine>]>);

impl SourceLines {
    /// Sends what was so at an instant of the robot's clock, which shows `clock_ns` now.
    pub(super) fn send(&self, source: usize, heard: &Heard, clock_ns: u64) -> Result<(), NotHeard> {
        let way = self.0.get(source).ok_or(NotHeard::Unknown)?;
        let mut way = way.lock().unwrap_or_else(PoisonError::into_inner);
        let instant_ns = heard.instant_ns;
        let ahead_ns = instant_ns.saturating_sub(clock_ns);
        let age_ns = clock_ns.saturating_sub(instant_ns);
        let by_ns =
            way.latest_ns.and_then(|latest_ns| latest_ns.checked_sub(instant_ns)).filter(|by_ns| *by_ns > 0);
        let refused = match by_ns {
            _ if ahead_ns > AHEAD_NS => Some(NotHeard::Future { ahead_ns }),
            _ if age_ns > way.max_age_ns => Some(NotHeard::TooOld { age_ns, most_ns: way.max_age_ns }),
            Some(by_ns) if !way.any_order => Some(NotHeard::Overtaken { by_ns }),
            _ => None,
        };
        match refused {
            Some(NotHeard::TooOld { .. }) => way.counts.late += 1,
            Some(_) => way.counts.out_of_order += 1,
            None => {
                way.counts.heard += 1;
                way.latest_ns = way.latest_ns.max(Some(instant_ns));
                way.between.fetch_or(Between::of(heard).word(), Ordering::Relaxed);
                way.to_cycle.write(Heard { instant_ns: instant_ns.min(clock_ns), ..*heard });
            }
        }
        refused.map_or(Ok(()), Err)
    }

    /// What became of all that each program sent.
    pub fn counts(&self) -> Vec<SourceCounts> {
        self.0.iter().map(|way| way.lock().unwrap_or_else(PoisonError::into_inner).counts).collect()
    }
}

/// The cycle's end of these ways.
#[derive(Default)]
pub(super) struct SourceEnds(Vec<(Output<Heard>, Arc<AtomicU64>)>);

impl SourceEnds {
    /// Gives the robot what came since the last cycle: the latest of each, and what was said in between.
    pub(super) fn hear(&mut self, robot: &mut Robot) {
        for (source, (end, between)) in self.0.iter_mut().enumerate() {
            robot.hear_between(source, Between::from_word(between.swap(0, Ordering::Relaxed)));
            if end.update() {
                robot.hear(source, end.output_buffer());
            }
        }
    }
}

/// Both ends of the ways of a plan's programs.
pub(super) fn source_lines(plans: &[SourcePlan]) -> (SourceLines, SourceEnds) {
    let (mut ways, mut ends) = (Vec::new(), Vec::new());
    for plan in plans.iter().take(MAX_SOURCES) {
        let (to_cycle, from_program) = triple_buffer(&Heard::NOTHING);
        let between = Arc::new(AtomicU64::new(0));
        let way = SourceLine {
            to_cycle,
            between: between.clone(),
            latest_ns: None,
            max_age_ns: plan.max_age_ns,
            any_order: plan.any_order,
            counts: SourceCounts::default(),
        };
        ways.push(Mutex::new(way));
        ends.push((from_program, between));
    }
    (SourceLines(ways.into()), SourceEnds(ends))
}
