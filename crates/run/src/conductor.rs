//! What is asked of the robot when: enable, track to the end, hold, stop, and see the drives disabled.

use omnibase_robot::signals::{
    CycleRecord, DriveProgress, Exchange, Phase, RequestKind, SafetyReason, StopCategory,
};

/// How long the end of the reference is held before the drives are disabled, ns.
pub const SETTLE_NS: u64 = 1_000_000_000;
/// How long drives may take to let go, ns.
const LET_GO_NS: u64 = 1_000_000_000;

/// Where a run is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Start,
    Enabling,
    Tracking,
    Settling { until_ns: u64 },
    Ending,
    LettingGo { until_ns: u64 },
    Over,
}

/// Leads a robot through one run.
#[derive(Clone, Debug)]
pub struct Conductor {
    part: Part,
    finished: bool,
}

impl Default for Conductor {
    fn default() -> Self {
        Conductor { part: Part::Start, finished: false }
    }
}

/// What is wished from outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    /// Go on.
    GoOn,
    /// Ramp down and end.
    Stop,
}

impl Conductor {
    /// What to ask in the coming cycle, from the last one and the phase after it.
    pub fn next(&mut self, last: &CycleRecord, phase: Phase, wish: Wish) -> Option<RequestKind> {
        let now_ns = last.time.now_ns;
        if wish == Wish::Stop
            && matches!(self.part, Part::Start | Part::Enabling | Part::Tracking | Part::Settling { .. })
        {
            self.part = Part::Ending;
            return Some(RequestKind::Stop(StopCategory::RampThenRemove));
        }
        match self.part {
            Part::Start if last.exchange == Exchange::Complete => {
                self.part = Part::Enabling;
                return Some(RequestKind::Enable);
            }
            Part::Enabling if phase == Phase::Holding => {
                self.part = Part::Tracking;
                return Some(RequestKind::Track);
            }
            Part::Tracking if phase == Phase::Holding => {
                self.finished = last.stop_reason == SafetyReason::None;
                self.part = Part::Settling { until_ns: now_ns + SETTLE_NS };
            }
            Part::Settling { until_ns } if now_ns >= until_ns => {
                self.part = Part::Ending;
                return Some(RequestKind::Stop(StopCategory::RampThenRemove));
            }
            Part::Enabling | Part::Tracking | Part::Settling { .. } | Part::Ending
                if matches!(phase, Phase::Disabled | Phase::Fault) =>
            {
                self.finished &= phase == Phase::Disabled;
                self.part = Part::LettingGo { until_ns: now_ns + LET_GO_NS };
            }
            Part::LettingGo { until_ns } if now_ns >= until_ns || have_let_go(last) => self.part = Part::Over,
            _ => {}
        }
        None
    }

    /// Whether nothing more is to come.
    pub fn is_over(&self) -> bool {
        self.part == Part::Over
    }

    /// Whether the reference was followed to its end and nothing stopped the robot.
    pub fn has_finished(&self) -> bool {
        self.finished
    }
}

/// Whether no drive carries torque any more, by fresh inputs.
fn have_let_go(last: &CycleRecord) -> bool {
    let let_go = |progress| matches!(progress, DriveProgress::Idle | DriveProgress::Fault);
    last.exchange == Exchange::Complete
        && last.measurements.present().iter().all(|drive| let_go(drive.progress))
}
