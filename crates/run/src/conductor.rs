//! What is asked of the robot when: enable, track to the end, hold, stop, and see the drives disabled.

mod since_stop;

use omnibase_cia402::ErrorCode;
use omnibase_robot::config::{ComebackEnd, ComebackPlan};
use omnibase_robot::signals::{
    CycleRecord, DriveMeasurement, DriveProgress, Exchange, Phase, RequestAnswer, RequestKind, SafetyReason,
    StopCategory,
};

use since_stop::{SinceStop, Spoilt};

/// How long the end of the reference is held before the drives are disabled, ns.
pub const SETTLE_NS: u64 = 1_000_000_000;
/// A plan waits for its pose for so long from the first cycle, ns; then it says that it has none.
const POSE_WITHIN_NS: u64 = 5_000_000_000;
/// How long drives may take to let go, ns.
const LET_GO_NS: u64 = 1_000_000_000;

/// Where a run is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    Start,
    Enabling,
    Tracking,
    /// A lost SubDevice is awaited.
    Awaiting {
        until_ns: u64,
        rest: Rest,
    },
    /// It is back: what was wrong is acknowledged.
    Acknowledged,
    EnablingAgain,
    /// It holds; the motion goes on when nobody objects until then.
    Warning {
        until_ns: u64,
    },
    /// It holds, and a person resumes.
    Held,
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
    leads: Leads,
    /// What comes by itself after a loss.
    comeback: Option<ComebackPlan>,
    since_stop: SinceStop,
    note: Option<&'static str>,
}

/// Who else is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Leads {
    /// Nobody could resume.
    Alone,
    /// People and programs ask for what they want.
    BesidePeople,
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

impl Conductor {
    /// Leads a robot from start to end, alone. Holding alone is of no use where nobody can resume: it ends then, too.
    pub fn new(comeback: Option<ComebackPlan>) -> Self {
        let moves = |plan: &ComebackPlan| matches!(plan.end, ComebackEnd::MoveAgain { .. });
        Conductor {
            part: Part::Start,
            finished: false,
            stopped_by: SafetyReason::None,
            leads: Leads::Alone,
            comeback: comeback.filter(moves),
            since_stop: SinceStop::default(),
            note: None,
        }
    }

    /// Leads a robot that follows its path already, as far as a loss and the way back from it.
    pub fn following(comeback: ComebackPlan) -> Self {
        Conductor {
            part: Part::Tracking,
            leads: Leads::BesidePeople,
            comeback: Some(comeback),
            ..Conductor::new(None)
        }
    }

    /// Whether a loss ended the path, and more is to come by itself.
    pub fn is_coming_back(&self) -> bool {
        matches!(
            self.part,
            Part::Awaiting { .. } | Part::Acknowledged | Part::EnablingAgain | Part::Warning { .. }
        )
    }

    /// In how many s the robot moves again by itself, at this moment; `None` where it doesn't.
    pub fn moves_again_in_s(&self, now_ns: u64) -> Option<f64> {
        match self.part {
            Part::Warning { until_ns } => Some(until_ns.saturating_sub(now_ns) as f64 * 1e-9),
            _ => None,
        }
    }

    /// A drive said by an emergency what is wrong with it.
    pub fn drive_said(&mut self, wheel: usize, error: ErrorCode) {
        self.since_stop.drive_said(wheel, error, self.comeback.as_ref());
    }

    /// What happened last, in words; it is told once.
    pub fn take_note(&mut self) -> Option<&'static str> {
        self.note.take()
    }

    /// Sees a cycle after which nothing can be asked.
    pub fn watch(&mut self, last: &CycleRecord, phase: Phase) {
        if self.part == Part::Tracking && !has_stopped(phase) {
            self.since_stop.begin(last);
        } else {
            self.since_stop.look(last, self.comeback.as_ref());
        }
    }

    /// What to ask in the coming cycle, from the last one and the phase after it.
    pub fn next(&mut self, last: &CycleRecord, phase: Phase, wish: Wish) -> Option<RequestKind> {
        let now_ns = last.time.now_ns;
        self.watch(last, phase);
        let is_stoppable = match self.part {
            Part::Start
            | Part::Enabling
            | Part::Tracking
            | Part::Acknowledged
            | Part::EnablingAgain
            | Part::Warning { .. }
            | Part::Settling { .. } => true,
            Part::Held => self.leads == Leads::Alone,
            Part::Awaiting { .. } | Part::Ending | Part::LettingGo { .. } | Part::Over => false,
        };
        if is_stoppable && (wish == Wish::Stop || self.part == Part::Held) {
            self.part = Part::Ending;
            return Some(RequestKind::Stop(StopCategory::RampThenRemove));
        }
        match self.part {
            Part::Awaiting { .. } if wish == Wish::Stop => self.part = Part::Ending,
            Part::Awaiting { .. } | Part::Acknowledged | Part::EnablingAgain | Part::Warning { .. } => {
                return self.come_back(last, phase);
            }
            // A sensor that tells the pose has a moment to do so.
            Part::Start
                if last.exchange == Exchange::Complete
                    && (last.state.pose_known || now_ns >= POSE_WITHIN_NS) =>
            {
                self.part = Part::Enabling;
                return Some(RequestKind::Enable);
            }
            Part::Enabling if phase == Phase::Holding => {
                self.part = Part::Tracking;
                return Some(RequestKind::Track);
            }
            Part::Tracking if phase == Phase::Holding => {
                // Who still held before the cycle was refused the way; what is refused on it was somebody else's.
                let held = last.phase == Phase::Holding;
                let refused = held && last.request.is_some() && last.answer != RequestAnswer::Taken;
                self.finished = last.stop_reason == SafetyReason::None && !refused;
                self.stopped_by = match last.answer {
                    RequestAnswer::Blocked if refused => SafetyReason::WayBlocked,
                    _ => last.stop_reason,
                };
                self.part = Part::Settling { until_ns: now_ns + SETTLE_NS };
            }
            Part::Settling { until_ns } if now_ns >= until_ns => {
                self.part = Part::Ending;
                return Some(RequestKind::Stop(StopCategory::RampThenRemove));
            }
            Part::Tracking if has_stopped(phase) && self.comeback.is_some() => self.await_the_lost(now_ns),
            Part::Enabling | Part::Tracking | Part::Settling { .. } | Part::Ending
                if matches!(phase, Phase::Disabled | Phase::Fault) =>
            {
                self.finished &= phase == Phase::Disabled;
                match last.answer {
                    RequestAnswer::StopInput => self.stopped_by = SafetyReason::StopInput,
                    RequestAnswer::EnableInput => self.stopped_by = SafetyReason::EnableInput,
                    _ => {}
                }
                self.part = Part::LettingGo { until_ns: now_ns + LET_GO_NS };
            }
            Part::LettingGo { until_ns } if now_ns >= until_ns || have_let_go(last) => self.part = Part::Over,
            _ => {}
        }
        None
    }

    /// The robot stopped: where it was by a loss alone, that is waited for.
    fn await_the_lost(&mut self, now_ns: u64) {
        let Some(plan) = self.comeback else { return };
        match self.since_stop.spoilt(&plan) {
            None => {
                let until_ns = now_ns.saturating_add(plan.within_ns);
                self.part = Part::Awaiting { until_ns, rest: Rest::default() };
            }
            Some(spoilt) => {
                self.comeback = None;
                // What stopped it else is told anyway.
                self.note = (spoilt != Spoilt::OtherStop).then_some(spoilt.text());
            }
        }
    }

    /// The way back from a loss, step by step; it ends where anything else happened since the stop.
    fn come_back(&mut self, last: &CycleRecord, phase: Phase) -> Option<RequestKind> {
        let plan = self.comeback?;
        let now_ns = last.time.now_ns;
        // A fault that isn't explained yet may be the loss's own, as long as nothing was acknowledged.
        let is_awaited = matches!(self.part, Part::Awaiting { .. });
        let unexplained = self.since_stop.unexplained().filter(|_| !is_awaited);
        if let Some(spoilt) = self.since_stop.spoilt(&plan).or(unexplained) {
            self.give_up(phase, spoilt.text());
            return None;
        }
        match self.part {
            Part::Awaiting { until_ns, .. } if now_ns >= until_ns => {
                self.give_up(phase, "what was lost isn't back in time: nothing goes on by itself");
            }
            Part::Awaiting { until_ns, mut rest } => {
                let rested_ns = rest.lasts_ns(last);
                self.part = Part::Awaiting { until_ns, rest };
                // The stop comes to its end first.
                if rested_ns < plan.steady_ns || !matches!(phase, Phase::Fault | Phase::Disabled) {
                    return None;
                }
                if let Some(spoilt) = self.since_stop.unexplained() {
                    self.give_up(phase, spoilt.text());
                    return None;
                }
                self.part = Part::Acknowledged;
                return (phase == Phase::Fault).then_some(RequestKind::Acknowledge);
            }
            Part::Acknowledged if phase == Phase::Disabled => {
                self.part = Part::EnablingAgain;
                return Some(RequestKind::Enable);
            }
            Part::EnablingAgain if phase == Phase::Holding => self.hold(&plan, last),
            Part::EnablingAgain if phase == Phase::Fault || is_forbidden(last) => {
                self.give_up(phase, NOT_ENABLED);
            }
            Part::Warning { .. } if phase != Phase::Holding || !is_at_rest(last) => {
                self.give_up(phase, "something happened while it warned: nothing goes on by itself");
            }
            Part::Warning { until_ns } if now_ns >= until_ns => {
                self.part = Part::Tracking;
                self.note = Some("nobody objected: the motion goes on without a person");
                return Some(RequestKind::Resume);
            }
            _ => {}
        }
        None
    }

    /// The drives are enabled again, and hold.
    fn hold(&mut self, plan: &ComebackPlan, last: &CycleRecord) {
        self.part = Part::Held;
        self.note = Some(match plan.end {
            ComebackEnd::Hold => "what was lost is back: the robot holds, and a person resumes",
            ComebackEnd::MoveAgain { .. } if !last.state.pose_known => {
                "what was lost is back, but the pose is unknown: a person sets it and resumes"
            }
            ComebackEnd::MoveAgain { warning_ns } => {
                let until_ns = last.time.now_ns.saturating_add(warning_ns);
                self.part = Part::Warning { until_ns };
                "WARNING: what was lost is back; the robot moves again without a person, unless somebody stops it"
            }
        });
    }

    /// Nothing more comes by itself.
    fn give_up(&mut self, phase: Phase, why: &'static str) {
        self.note = Some(why);
        self.part = match phase {
            Phase::Enabling | Phase::Holding | Phase::Tracking => Part::Held,
            Phase::Disabled | Phase::Stopping | Phase::QuickStopping | Phase::Fault => Part::Ending,
        };
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

const NOT_ENABLED: &str = "what was lost is back, but its drives can't be enabled: a person goes on";

/// Whether an input forbade what was just asked.
fn is_forbidden(last: &CycleRecord) -> bool {
    matches!(last.answer, RequestAnswer::StopInput | RequestAnswer::EnableInput)
}

/// For how long all exchanges were complete and all wheels stood.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Rest {
    since_ns: Option<u64>,
    last_ns: u64,
}

impl Rest {
    /// How long it lasts by now, ns. Cycles that were left out saw nothing: it begins anew behind them.
    fn lasts_ns(&mut self, last: &CycleRecord) -> u64 {
        let now_ns = last.time.now_ns;
        let is_seen = now_ns.saturating_sub(self.last_ns) <= 2 * last.time.period_ns.max(1_000_000);
        self.last_ns = now_ns;
        self.since_ns = match self.since_ns {
            _ if !is_at_rest(last) => None,
            Some(since_ns) if is_seen => Some(since_ns),
            _ => Some(now_ns),
        };
        self.since_ns.map_or(0, |since_ns| now_ns - since_ns)
    }
}

/// Whether the robot stops by itself, or did.
fn has_stopped(phase: Phase) -> bool {
    matches!(phase, Phase::Stopping | Phase::QuickStopping | Phase::Fault)
}

/// Whether every wheel is heard, and stands: without torque it may still roll.
fn is_at_rest(last: &CycleRecord) -> bool {
    last.exchange == Exchange::Complete && last.measurements.present().iter().all(DriveMeasurement::stands)
}

/// Whether no drive carries torque any more, by fresh inputs.
fn have_let_go(last: &CycleRecord) -> bool {
    let let_go = |progress| matches!(progress, DriveProgress::Idle | DriveProgress::Fault);
    last.exchange == Exchange::Complete
        && last.measurements.present().iter().all(|drive| let_go(drive.progress))
}
