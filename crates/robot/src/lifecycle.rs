//! Where a robot is in its life: which phase follows which, and why.

use omnibase_cia402::Wanted;

use crate::config::SafetyPlan;
use crate::signals::{
    Allowed, CycleTime, DriveProgress, Exchange, Measurements, Phase, RequestAnswer, RequestKind,
    SafetyAction, SafetyReason, StopCategory,
};

/// Slower than this a wheel stands, rad/s.
const STANDING_RAD_S: f64 = 0.02;

/// What the cycle has to do because the phase changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Change {
    /// Nothing.
    None,
    /// All stages begin anew.
    Begin,
    /// Faults are acknowledged.
    Acknowledge,
}

/// The phase, and what it remembers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lifecycle {
    plan: SafetyPlan,
    phase: Phase,
    since_ns: u64,
    category: StopCategory,
    reason: SafetyReason,
    where_index: u64,
}

/// What is known at the end of a cycle.
pub(crate) struct Outcome<'a> {
    pub(crate) time: &'a CycleTime,
    pub(crate) exchange: Exchange,
    pub(crate) measurements: &'a Measurements,
    pub(crate) allowed: &'a Allowed,
    /// The setpoint is at rest.
    pub(crate) setpoint_rests: bool,
    /// What was followed has come to its end.
    pub(crate) is_finished: bool,
    /// What brought it there before its end.
    pub(crate) finished_by: SafetyReason,
}

impl Lifecycle {
    pub(crate) fn new(plan: SafetyPlan) -> Self {
        Lifecycle {
            plan,
            phase: Phase::Disabled,
            since_ns: 0,
            category: StopCategory::RampThenRemove,
            reason: SafetyReason::None,
            where_index: 0,
        }
    }

    pub(crate) fn phase(&self) -> Phase {
        self.phase
    }

    pub(crate) fn reason(&self) -> SafetyReason {
        self.reason
    }

    /// Which wheel or stage the reason is about.
    pub(crate) fn where_index(&self) -> u64 {
        self.where_index
    }

    /// The state in which the drives shall be.
    pub(crate) fn wanted(&self) -> Wanted {
        match self.phase {
            Phase::Disabled | Phase::Fault => Wanted::SwitchOnDisabled,
            Phase::Enabling | Phase::Holding | Phase::Tracking | Phase::Stopping => Wanted::OperationEnabled,
            Phase::QuickStopping => Wanted::QuickStop,
        }
    }

    /// A request that isn't about settings.
    pub(crate) fn request(&mut self, time: &CycleTime, kind: &RequestKind) -> (RequestAnswer, Change) {
        let taken = |change| (RequestAnswer::Taken, change);
        match (kind, self.phase) {
            (RequestKind::Enable, Phase::Disabled) => {
                self.reason = SafetyReason::None;
                self.enter(time, Phase::Enabling);
                taken(Change::Begin)
            }
            (RequestKind::Track, Phase::Holding) => {
                self.reason = SafetyReason::None;
                self.enter(time, Phase::Tracking);
                taken(Change::None)
            }
            (RequestKind::Velocity { .. }, Phase::Holding | Phase::Tracking)
            | (RequestKind::GoTo { .. } | RequestKind::Resume, Phase::Holding) => {
                self.reason = SafetyReason::None;
                if self.phase != Phase::Tracking {
                    self.enter(time, Phase::Tracking);
                }
                taken(Change::None)
            }
            (RequestKind::Stop(category), Phase::Holding | Phase::Tracking | Phase::Stopping) => {
                self.stop(time, *category, SafetyReason::Requested);
                taken(Change::None)
            }
            (RequestKind::Stop(_), Phase::Enabling) => {
                self.reason = SafetyReason::Requested;
                self.enter(time, Phase::Disabled);
                taken(Change::None)
            }
            (RequestKind::Stop(_), Phase::Disabled | Phase::QuickStopping | Phase::Fault) => {
                taken(Change::None)
            }
            (RequestKind::Acknowledge, Phase::Fault) => {
                self.reason = SafetyReason::None;
                self.enter(time, Phase::Disabled);
                taken(Change::Acknowledge)
            }
            _ => (RequestAnswer::WrongPhase, Change::None),
        }
    }

    /// The phase after a cycle.
    pub(crate) fn advance(&mut self, outcome: &Outcome<'_>) {
        self.obey(outcome);
        let waited_ns = outcome.time.now_ns.saturating_sub(self.since_ns);
        let drives = outcome.measurements.present();
        let is_fresh = outcome.exchange == Exchange::Complete;
        let stands = is_fresh && drives.iter().all(|drive| drive.speed_rad_s.abs() < STANDING_RAD_S);
        match self.phase {
            Phase::Enabling if drives.iter().all(|drive| drive.progress == DriveProgress::Running) => {
                self.enter(outcome.time, Phase::Holding);
            }
            Phase::Enabling if waited_ns > self.plan.enabling_timeout_ns => {
                self.reason = SafetyReason::EnablingTimeout;
                self.enter(outcome.time, Phase::Fault);
            }
            Phase::Tracking if outcome.is_finished => {
                self.reason = outcome.finished_by;
                self.enter(outcome.time, Phase::Holding);
            }
            Phase::Stopping
                if outcome.setpoint_rests && (stands || self.category == StopCategory::RampAndHold) =>
            {
                let next = match (self.category, self.reason) {
                    (StopCategory::RampAndHold, _) => Phase::Holding,
                    (_, SafetyReason::Requested) => Phase::Disabled,
                    _ => Phase::Fault,
                };
                self.enter(outcome.time, next);
            }
            Phase::Stopping if waited_ns > self.plan.stop_timeout_ns => {
                self.reason = SafetyReason::StopTimeout;
                self.enter(outcome.time, Phase::QuickStopping);
            }
            // The quick stop is the drives' own; it ends when they stand, or when nothing is heard for too long.
            Phase::QuickStopping
                if (stands && waited_ns > outcome.time.period_ns)
                    || waited_ns > self.plan.stop_timeout_ns =>
            {
                self.enter(outcome.time, Phase::Fault);
            }
            _ => {}
        }
    }

    /// What safety decided. A stop is never replaced by a gentler one.
    fn obey(&mut self, outcome: &Outcome<'_>) {
        let Allowed { action, reason, where_index, .. } = *outcome.allowed;
        let reason_before = self.reason;
        match (action, self.phase) {
            (
                SafetyAction::QuickStop,
                Phase::Enabling | Phase::Holding | Phase::Tracking | Phase::Stopping,
            ) => {
                self.reason = reason;
                self.enter(outcome.time, Phase::QuickStopping);
            }
            (SafetyAction::QuickStop, Phase::Disabled) => {
                self.reason = reason;
                self.enter(outcome.time, Phase::Fault);
            }
            (SafetyAction::Stop(category), Phase::Holding | Phase::Tracking) => {
                self.stop(outcome.time, category, reason);
            }
            _ => return,
        }
        if self.reason != reason_before {
            self.where_index = where_index;
        }
    }

    fn stop(&mut self, time: &CycleTime, category: StopCategory, reason: SafetyReason) {
        if self.phase == Phase::Stopping {
            if category.severity() > self.category.severity() {
                self.category = category;
            }
        } else {
            self.category = category;
            self.reason = reason;
        }
        if category == StopCategory::RemoveTorque {
            self.reason = reason;
            let asked = reason == SafetyReason::Requested;
            self.enter(time, if asked { Phase::Disabled } else { Phase::Fault });
        } else if self.phase != Phase::Stopping {
            self.enter(time, Phase::Stopping);
        }
    }

    fn enter(&mut self, time: &CycleTime, phase: Phase) {
        self.phase = phase;
        self.since_ns = time.now_ns;
    }
}
