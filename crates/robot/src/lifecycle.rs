//! Where a robot is in its life: which phase follows which, and why.

use omnibase_cia402::Wanted;

use crate::config::SafetyPlan;
use crate::signals::{
    Allowed, CycleTime, DriveMeasurement, DriveProgress, Exchange, Measurements, Phase, RequestAnswer,
    RequestKind, SafetyAction, SafetyReason, StopCategory,
};
use crate::stages::Readiness;

/// After a ramp without inputs drives that nobody hears get so long to stand, ns: ten times what they lag behind.
const UNHEARD_NS: u64 = 500_000_000;

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
    /// The ramp goes on without what is measured: drives were lost, or the pose.
    is_blind: bool,
    /// Since when the setpoint of a ramp rests, ns.
    rests_since_ns: Option<u64>,
}

/// What is known at the end of a cycle.
pub(crate) struct Outcome<'a> {
    pub(crate) time: &'a CycleTime,
    pub(crate) exchange: Exchange,
    pub(crate) measurements: &'a Measurements,
    pub(crate) allowed: &'a Allowed,
    /// The setpoint is at rest, and so is what the wheels are told where that isn't the same.
    pub(crate) setpoint_rests: bool,
    /// What moves beside the wheels.
    pub(crate) peripherals: Readiness,
    /// What was followed has come to its end.
    pub(crate) is_finished: bool,
    /// What was followed was paused, and fence or obstacles keep the platform from where it stands.
    pub(crate) is_held_off: bool,
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
            is_blind: false,
            rests_since_ns: None,
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

    /// Whether torque is being taken from the drives, or was by a fault.
    pub(crate) fn lets_go(&self) -> bool {
        match self.phase {
            Phase::Stopping => self.category != StopCategory::RampAndHold,
            Phase::QuickStopping | Phase::Fault => true,
            Phase::Disabled | Phase::Enabling | Phase::Holding | Phase::Tracking => false,
        }
    }

    /// Whether it ramps down without the inputs of lost drives, or the pose: nothing that is measured may lead the wheels
    /// then.
    pub(crate) fn is_blind(&self) -> bool {
        self.is_blind
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
            (
                RequestKind::Velocity { .. }
                | RequestKind::Track
                | RequestKind::GoTo { .. }
                | RequestKind::Resume,
                Phase::Holding | Phase::Tracking,
            ) => {
                self.reason = SafetyReason::None;
                if self.phase != Phase::Tracking {
                    self.enter(time, Phase::Tracking);
                }
                taken(Change::None)
            }
            (RequestKind::Stop(category), phase) => {
                // Drives on their way to operation have nothing to ramp down.
                let category = if phase == Phase::Enabling { StopCategory::RemoveTorque } else { *category };
                self.stop(time, SafetyAction::Stop(category), SafetyReason::Requested, 0);
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
        let now_ns = outcome.time.now_ns;
        let waited_ns = now_ns.saturating_sub(self.since_ns);
        let drives = outcome.measurements.present();
        let stands = stand(drives, outcome.exchange) && outcome.peripherals.stands;
        let rests = outcome.setpoint_rests && (outcome.peripherals.rests || outcome.peripherals.failed);
        let has_stopped = rests && self.has_stopped(now_ns, stands);
        match self.phase {
            Phase::Enabling
                if outcome.peripherals.is_ready
                    && drives.iter().all(|drive| drive.progress == DriveProgress::Running) =>
            {
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
            // It must not go there once nothing keeps it from there any more: nobody leads it then.
            Phase::Tracking if outcome.is_held_off => {
                (self.reason, self.category) = (outcome.finished_by, StopCategory::RampAndHold);
                self.enter(outcome.time, Phase::Stopping);
            }
            Phase::Stopping if has_stopped => {
                let next = match self.category {
                    StopCategory::RampAndHold => Phase::Holding,
                    _ if self.ends_in_fault() => Phase::Fault,
                    _ => Phase::Disabled,
                };
                self.enter(outcome.time, next);
            }
            Phase::Stopping if waited_ns > self.plan.stop_timeout_ns => {
                // What was lost remains the cause, for whoever waits for its return.
                if !self.is_blind {
                    self.reason = SafetyReason::StopTimeout;
                }
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

    /// Whether a ramp is over, its setpoint at rest.
    fn has_stopped(&mut self, now_ns: u64, stands: bool) -> bool {
        let since_ns = *self.rests_since_ns.get_or_insert(now_ns);
        let is_unheard = self.is_blind && now_ns.saturating_sub(since_ns) >= UNHEARD_NS;
        stands || is_unheard || self.category == StopCategory::RampAndHold
    }

    /// What safety decided.
    fn obey(&mut self, outcome: &Outcome<'_>) {
        let Allowed { action, reason, where_index, .. } = *outcome.allowed;
        let action = match (action, self.phase) {
            (SafetyAction::Pass, _) | (_, Phase::Fault) => return,
            // A robot without torque has nothing to brake; it isn't enabled any more without a word either.
            (SafetyAction::QuickStop, Phase::Disabled) => {
                (self.reason, self.where_index) = (reason, where_index);
                return self.enter(outcome.time, Phase::Fault);
            }
            // Drives on their way to operation have no ramp.
            (
                SafetyAction::Stop(StopCategory::RampThenRemove | StopCategory::RampAndHold),
                Phase::Enabling,
            ) => SafetyAction::QuickStop,
            (action, _) => action,
        };
        self.stop(outcome.time, action, reason, where_index);
        let is_lost = matches!(
            reason,
            SafetyReason::DeviceLost | SafetyReason::ExchangeLost | SafetyReason::PoseUnknown
        );
        self.is_blind |= is_lost && self.phase == Phase::Stopping;
    }

    /// The stop that is under way: what is harder takes over.
    fn present_stop(&self) -> SafetyAction {
        match self.phase {
            Phase::Enabling | Phase::Holding | Phase::Tracking => SafetyAction::Pass,
            Phase::Stopping => SafetyAction::Stop(self.category),
            Phase::QuickStopping => SafetyAction::QuickStop,
            Phase::Disabled | Phase::Fault => SafetyAction::Stop(StopCategory::RemoveTorque),
        }
    }

    /// Whether the stop that is under way ends in a fault, which a person has to acknowledge.
    fn ends_in_fault(&self) -> bool {
        match self.phase {
            Phase::Stopping => {
                self.category == StopCategory::RampThenRemove && self.reason != SafetyReason::Requested
            }
            Phase::QuickStopping | Phase::Fault => true,
            Phase::Disabled | Phase::Enabling | Phase::Holding | Phase::Tracking => false,
        }
    }

    /// A stop, in whatever phase: it takes over where it is harder than the present one, and never weakens it.
    fn stop(&mut self, time: &CycleTime, action: SafetyAction, reason: SafetyReason, where_index: u64) {
        let present = self.present_stop();
        let is_asked = reason == SafetyReason::Requested;
        let is_harder = action.severity() > present.severity();
        // As hard as what a person asked for, but a fault: it ends as one.
        let is_cause =
            action == present && self.phase == Phase::Stopping && self.reason == SafetyReason::Requested;
        // What a person asks for on top of a fault is no cause: it stays a fault.
        let stays_fault = is_asked && self.ends_in_fault();
        if (is_harder || is_cause) && !stays_fault {
            (self.reason, self.where_index) = (reason, where_index);
        }
        if !is_harder {
            return;
        }
        match action {
            SafetyAction::Pass => {}
            SafetyAction::QuickStop => self.enter(time, Phase::QuickStopping),
            SafetyAction::Stop(StopCategory::RemoveTorque) if is_asked && !stays_fault => {
                self.enter(time, Phase::Disabled);
            }
            SafetyAction::Stop(StopCategory::RemoveTorque) => self.enter(time, Phase::Fault),
            SafetyAction::Stop(category) => {
                self.category = category;
                if self.phase != Phase::Stopping {
                    self.enter(time, Phase::Stopping);
                }
            }
        }
    }

    fn enter(&mut self, time: &CycleTime, phase: Phase) {
        self.phase = phase;
        self.since_ns = time.now_ns;
        (self.is_blind, self.rests_since_ns) = (false, None);
    }
}

/// Whether all wheels stand that were heard in this cycle, and some were.
fn stand(drives: &[DriveMeasurement], exchange: Exchange) -> bool {
    let mut heard = drives.iter().enumerate().filter(|(wheel, _)| exchange.has_inputs_of(*wheel)).peekable();
    heard.peek().is_some() && heard.all(|(_, drive)| drive.stands())
}
