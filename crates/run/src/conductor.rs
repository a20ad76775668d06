//! What is asked of the robot when: enable, track to the end, hold, stop, and see the drives disabled.

use omnibase_robot::signals::{
    CycleRecord, DriveMeasurement, DriveProgress, Exchange, Phase, RequestAnswer, RequestKind, SafetyReason,
    StopCategory,
};

/// How long the end of the reference is held before the drives are disabled, ns.
pub const SETTLE_NS: u64 = 1_000_000_000;
/// How long drives may take to let go, ns.
const LET_GO_NS: u64 = 1_000_000_000;

/// Where a run is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Start,
    /// A lost SubDevice is awaited.
    Awaiting {
        until_ns: u64,
        complete: u32,
    },
    /// It is back: what was wrong is acknowledged.
    Acknowledged,
    Enabling,
    Tracking,
    Settling {
        until_ns: u64,
    },
    Ending,
    LettingGo {
        until_ns: u64,
    },
    Over,
}

/// Leads a robot through one run.
#[derive(Clone, Debug)]
pub struct Conductor {
    part: Part,
    finished: bool,
    stopped_by: SafetyReason,
    /// How long a lost SubDevice is awaited, to go on when it is back.
    resume_within_ns: Option<u64>,
    /// The path was begun.
    begun: bool,
}

impl Default for Conductor {
    fn default() -> Self {
        Conductor::new(None)
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

/// Complete exchanges in a row, with wheels that stand, before a robot whose SubDevice is back goes on.
const STEADY_CYCLES: u32 = 100;

impl Conductor {
    /// Leads a robot that goes on by itself when a lost SubDevice is back within so many ns; `None`: it ends.
    pub fn new(resume_within_ns: Option<u64>) -> Self {
        Conductor {
            part: Part::Start,
            finished: false,
            stopped_by: SafetyReason::None,
            resume_within_ns,
            begun: false,
        }
    }

    /// Leads a robot that follows its path already, as far as a loss and the way back from it.
    pub fn following(resume_within_ns: u64) -> Self {
        Conductor { part: Part::Tracking, begun: true, ..Conductor::new(Some(resume_within_ns)) }
    }

    /// Whether a loss ended the path, and it is to go on.
    pub fn is_coming_back(&self) -> bool {
        matches!(self.part, Part::Awaiting { .. } | Part::Acknowledged | Part::Enabling)
    }

    /// What to ask in the coming cycle, from the last one and the phase after it.
    pub fn next(&mut self, last: &CycleRecord, phase: Phase, wish: Wish) -> Option<RequestKind> {
        let now_ns = last.time.now_ns;
        if wish == Wish::Stop
            && matches!(
                self.part,
                Part::Start | Part::Acknowledged | Part::Enabling | Part::Tracking | Part::Settling { .. }
            )
        {
            self.part = Part::Ending;
            return Some(RequestKind::Stop(StopCategory::RampThenRemove));
        }
        match self.part {
            Part::Awaiting { until_ns, .. } if wish == Wish::Stop || now_ns >= until_ns => {
                self.part = Part::Ending;
            }
            Part::Awaiting { until_ns, complete } => {
                // Without torque it may still roll: drives that are enabled then brake as hard as they can.
                let is_steady = last.exchange == Exchange::Complete && stands(last);
                let complete = if is_steady { complete + 1 } else { 0 };
                self.part = Part::Awaiting { until_ns, complete };
                // The stop comes to its end first.
                if complete >= STEADY_CYCLES && matches!(phase, Phase::Fault | Phase::Disabled) {
                    self.part = Part::Acknowledged;
                    return (phase == Phase::Fault).then_some(RequestKind::Acknowledge);
                }
            }
            Part::Acknowledged if phase == Phase::Disabled => {
                self.part = Part::Enabling;
                return Some(RequestKind::Enable);
            }
            Part::Start if last.exchange == Exchange::Complete => {
                self.part = Part::Enabling;
                return Some(RequestKind::Enable);
            }
            Part::Enabling if phase == Phase::Holding => {
                self.part = Part::Tracking;
                // What was begun goes on where it was left.
                let again = std::mem::replace(&mut self.begun, true);
                return Some(if again { RequestKind::Resume } else { RequestKind::Track });
            }
            Part::Tracking if phase == Phase::Holding => {
                let refused = last.request.is_some() && last.answer != RequestAnswer::Taken;
                self.finished = last.stop_reason == SafetyReason::None && !refused;
                self.stopped_by = last.stop_reason;
                self.part = Part::Settling { until_ns: now_ns + SETTLE_NS };
            }
            Part::Settling { until_ns } if now_ns >= until_ns => {
                self.part = Part::Ending;
                return Some(RequestKind::Stop(StopCategory::RampThenRemove));
            }
            Part::Enabling | Part::Tracking
                if has_stopped(phase) && is_lost(last) && self.resume_within_ns.is_some() =>
            {
                let until_ns = now_ns.saturating_add(self.resume_within_ns.unwrap_or_default());
                self.part = Part::Awaiting { until_ns, complete: 0 };
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

    /// What ended the tracking before the reference did; whatever is asked afterwards doesn't hide it.
    pub fn stopped_by(&self) -> SafetyReason {
        self.stopped_by
    }
}

/// Whether the robot stops by itself, or did.
fn has_stopped(phase: Phase) -> bool {
    matches!(phase, Phase::Stopping | Phase::QuickStopping | Phase::Fault)
}

/// Whether the robot stopped because it lost SubDevices, all or some.
fn is_lost(last: &CycleRecord) -> bool {
    matches!(last.stop_reason, SafetyReason::DeviceLost | SafetyReason::ExchangeLost)
}

/// Whether all wheels stand.
fn stands(last: &CycleRecord) -> bool {
    last.measurements.present().iter().all(DriveMeasurement::stands)
}

/// Whether no drive carries torque any more, by fresh inputs.
fn have_let_go(last: &CycleRecord) -> bool {
    let let_go = |progress| matches!(progress, DriveProgress::Idle | DriveProgress::Fault);
    last.exchange == Exchange::Complete
        && last.measurements.present().iter().all(|drive| let_go(drive.progress))
}
