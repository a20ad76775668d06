//! The last word on commands: limits, finite check and stops in one place.

mod astray;
mod oscillation;
mod overspeed;
mod runaway;
mod shortfall;
mod torque_watch;
mod wiring;

use crate::config::{Limits, RobotPlan, SafetyPlan, WheelLimits};
use crate::signals::{
    Allowed, Commands, DriveProgress, Exchange, Frame, LimitedBy, MAX_WHEELS, Phase, Quantity, RequestKind,
    SafetyAction, SafetyReason, Signals, Stage, StopCategory,
};
use crate::stages::{Safety, SafetyView};
use astray::AstrayWatch;
use oscillation::OscillationWatch;
use overspeed::OverspeedWatch;
use runaway::RunawayWatch;
use shortfall::ShortfallWatch;
use torque_watch::TorqueWatch;
use wiring::WiringWatch;

/// How far a measured wheel speed may lie above its limit before it stops: commands are held to the limit itself.
const WHEEL_SPEED_MARGIN: f64 = 1.1;
/// How far a wished speed may lie above its limit: rounding.
const REFERENCE_MARGIN: f64 = 1.0 + 1e-6;

/// The built-in chain: of all checks that object the one decides that asks for the hardest stop, and of equals the first.
#[derive(Clone, Debug)]
pub struct SafetyChain {
    limits: Limits,
    plan: SafetyPlan,
    wheels: usize,
    lost_in_a_row: u32,
    torques: TorqueWatch,
    oscillation: OscillationWatch,
    runaway: RunawayWatch,
    shortfall: ShortfallWatch,
    wiring: WiringWatch,
    overspeed: OverspeedWatch,
    astray: AstrayWatch,
    /// The platform gave way to an obstacle or the fence, and isn't back where the plan is.
    gives_way: bool,
}

/// Nearer than this to the plan a platform that gave way has caught up with it, m.
const CAUGHT_UP_M: f64 = 1e-3;
/// While other wires may be why wheels slip, they may slip so many times as far: the watch of wires takes 0.15 s to be sure.
const SLIP_BY_WIRES: f64 = 6.0;
/// The same while a gyro's turn begins to show other wires.
const SLIP_BY_TURN: f64 = 3.0;

/// What a check objects to: what to do, why, and about which wheel or stage.
type Objection = Option<(SafetyAction, SafetyReason, u64)>;
/// One of the chain's checks.
type Check = fn(&SafetyChain, &SafetyView<'_>) -> Objection;

impl SafetyChain {
    /// The chain of a robot.
    pub fn new(plan: &RobotPlan) -> Self {
        SafetyChain {
            limits: plan.limits,
            plan: plan.safety,
            wheels: plan.drives.len(),
            lost_in_a_row: 0,
            torques: TorqueWatch::new(plan),
            oscillation: OscillationWatch::new(plan),
            runaway: RunawayWatch::new(plan),
            shortfall: ShortfallWatch::new(plan),
            wiring: WiringWatch::new(plan),
            overspeed: OverspeedWatch::new(plan),
            astray: AstrayWatch::new(plan),
            gives_way: false,
        }
    }

    /// Nothing was measured yet.
    fn forget_motion(&mut self) {
        self.torques.reset();
        self.oscillation.reset();
        self.runaway.reset();
        self.shortfall.reset();
        self.wiring.reset();
        self.overspeed.reset();
        self.astray.reset();
    }

    /// There is no ramp by torques without knowing the speeds: a torque goes on pushing whatever happens.
    fn is_by_torque(&self, view: &SafetyView<'_>) -> bool {
        view.commands.quantity == Quantity::Torque || view.has_torque_drives
    }

    fn exchange(&self, view: &SafetyView<'_>) -> Objection {
        let chosen = self.plan.lost_device_stop;
        let at_least_quick = harder(SafetyAction::QuickStop, chosen);
        let is_too_much = self.lost_in_a_row > self.plan.lost_exchanges_tolerated;
        match view.exchange {
            // However many lost exchanges are tolerated: nothing is enabled again without a word.
            Exchange::Restarted { wheels } => Some((at_least_quick, SafetyReason::DeviceLost, first(wheels))),
            _ if !is_too_much => None,
            // A ramp that nobody hears is none.
            Exchange::Lost | Exchange::Complete => Some((at_least_quick, SafetyReason::ExchangeLost, 0)),
            Exchange::ShortCount { .. } | Exchange::Without { .. } => {
                let action = if self.is_by_torque(view) { at_least_quick } else { chosen };
                let wheel = match view.exchange {
                    Exchange::Without { wheels: 0, devices } if devices != 0 => {
                        MAX_WHEELS as u64 + first(devices)
                    }
                    Exchange::Without { wheels, .. } => first(wheels),
                    _ => 0,
                };
                Some((action, SafetyReason::DeviceLost, wheel))
            }
        }
    }

    fn finite(&self, view: &SafetyView<'_>) -> Objection {
        let stage = if !view.measurements.present().iter().all(|drive| drive.is_finite()) {
            Stage::Device
        } else if !view.state.is_finite() {
            Stage::Estimator
        } else if !(view.wished.is_finite() && view.setpoint.is_finite()) {
            Stage::Reference
        } else if !view.commands.is_finite() {
            Stage::Controller
        } else {
            return None;
        };
        Some((SafetyAction::QuickStop, SafetyReason::NotFinite, stage.code()))
    }

    /// With one drive gone the others can't steer: all brake.
    fn drives(&self, view: &SafetyView<'_>) -> Objection {
        if view.phase == Phase::QuickStopping {
            return None;
        }
        let moving = view.phase != Phase::Enabling;
        let failed = view.measurements.present().iter().position(|drive| match drive.progress {
            DriveProgress::Fault | DriveProgress::Failed | DriveProgress::QuickStop => true,
            DriveProgress::Unknown | DriveProgress::UnderWay | DriveProgress::Idle => moving,
            DriveProgress::Running | DriveProgress::SwitchingMode => false,
        });
        failed.map(|wheel| (SafetyAction::QuickStop, SafetyReason::Drive, wheel as u64))
    }

    /// The axis itself brakes by its drive; the wheels are well, and ramp down.
    fn axes(&self, view: &SafetyView<'_>) -> Objection {
        let counts = view.phase != Phase::QuickStopping;
        let failed = view.failed_device.filter(|_| counts)?;
        let stop = SafetyAction::Stop(StopCategory::RampThenRemove);
        Some((stop, SafetyReason::Axis, (MAX_WHEELS + failed) as u64))
    }

    fn wheel_speed(&self, view: &SafetyView<'_>) -> Objection {
        let stop = SafetyAction::Stop(self.plan.wheel_speed_stop);
        // Who drives it on heeds no ramp.
        if let Some(wheel) = self.overspeed.driven() {
            return Some((harder(SafetyAction::QuickStop, stop), SafetyReason::WheelSpeed, wheel as u64));
        }
        let limit = WHEEL_SPEED_MARGIN * view.wheel_limits.speed_rad_s;
        let drives = view.measurements.present();
        let fast = drives.iter().position(|drive| drive.speed_rad_s.abs() > limit);
        fast.map(|wheel| (stop, SafetyReason::WheelSpeed, wheel as u64))
    }

    /// A law that doesn't follow the ramp of a stop gets no other chance.
    fn ramp(&self, _: &SafetyView<'_>) -> Objection {
        self.astray.is_astray().then_some((SafetyAction::QuickStop, SafetyReason::TrackingError, 0))
    }

    /// A drive that gives more torque than it was allowed: it doesn't obey, or its torques are scaled wrongly.
    fn wheel_torque(&self, _: &SafetyView<'_>) -> Objection {
        let wheel = self.torques.above()?;
        Some((SafetyAction::Stop(self.plan.wheel_torque_stop), SafetyReason::WheelTorque, wheel as u64))
    }

    /// Whatever commands would be part of the loop that rings: the drives brake by themselves.
    fn oscillation(&self, _: &SafetyView<'_>) -> Objection {
        let wheel = self.oscillation.swings()?;
        Some((SafetyAction::QuickStop, SafetyReason::Oscillation, wheel as u64))
    }

    /// Any loop that its drive closes would go on to run away, its quick stop too.
    fn encoder(&self, _: &SafetyView<'_>) -> Objection {
        let wheel = self.runaway.away()?;
        let stop = SafetyAction::Stop(StopCategory::RemoveTorque);
        Some((stop, SafetyReason::EncoderDirection, wheel as u64))
    }

    /// Nobody knows which way the platform truly goes; each wheel by itself comes to rest.
    fn wires(&self, _: &SafetyView<'_>) -> Objection {
        let wheel = self.wiring.suspect()?;
        Some((SafetyAction::QuickStop, SafetyReason::Wiring, wheel as u64))
    }

    fn weak_motor(&self, _: &SafetyView<'_>) -> Objection {
        let wheel = self.shortfall.short()?;
        let stop = SafetyAction::Stop(StopCategory::RampThenRemove);
        Some((stop, SafetyReason::WeakMotor, wheel as u64))
    }

    /// What a slipping wheel counts is no way of the platform: it isn't where it is believed to be.
    fn slip(&self, view: &SafetyView<'_>) -> Objection {
        // By speed a wheel that is wired backwards slips as well, or makes others slip: that it is wired so says more.
        let times = if !self.is_by_torque(view) && self.wiring.may_explain() {
            SLIP_BY_WIRES
        } else if self.wiring.may_turn() {
            SLIP_BY_TURN
        } else {
            1.0
        };
        let most_m = self.plan.slip_m * times;
        let wheel = view.grip.slipped_m.iter().position(|way_m| *way_m > most_m)?;
        Some((SafetyAction::Stop(self.plan.slip_stop), SafetyReason::WheelSlip, wheel as u64))
    }

    fn reference_speed(&self, view: &SafetyView<'_>) -> Objection {
        let twist = &view.wished.twist_in_odom;
        let fast = twist.speed_m_s() > REFERENCE_MARGIN * self.limits.speed_m_s
            || twist.w_rad_s.abs() > REFERENCE_MARGIN * self.limits.turn_speed_rad_s;
        fast.then_some((SafetyAction::Stop(self.plan.reference_speed_stop), SafetyReason::ReferenceSpeed, 0))
    }

    fn tracking(&self, view: &SafetyView<'_>) -> Objection {
        // Who gives way is where he shall be if he is where the way around leads.
        let shall = if self.gives_way { view.setpoint } else { view.wished };
        let distance_m = shall.odom_from_body.distance_m(view.state.odom_from_body);
        let far = distance_m > self.plan.tracking_error_m;
        far.then_some((SafetyAction::Stop(self.plan.tracking_error_stop), SafetyReason::TrackingError, 0))
    }

    /// A plan that leads out of the fence stops; a speed is only held back, in the stage before.
    fn fence(&self, view: &SafetyView<'_>) -> Objection {
        let stays_inside = view.velocity.is_some() || view.wished_fence_room_m >= 0.0;
        (!stays_inside).then_some((SafetyAction::Stop(self.plan.fence_stop), SafetyReason::Fence, 0))
    }

    fn way(&self, view: &SafetyView<'_>) -> Objection {
        let stop = SafetyAction::Stop(StopCategory::RampAndHold);
        view.is_way_blocked.then_some((stop, SafetyReason::WayBlocked, 0))
    }

    /// What stands in odom leads nowhere where nobody knows the platform's place; a person's stick in its own frame does.
    /// The ramp goes by its speeds alone, and torque goes with it: a pose that nobody knows, or that is told later, must
    /// not have it corrected.
    fn place(&self, view: &SafetyView<'_>) -> Objection {
        let is_led = view
            .velocity
            .is_some_and(|request| matches!(request.kind, RequestKind::Velocity { frame: Frame::Body, .. }));
        let stop = match self.is_by_torque(view) {
            true => SafetyAction::QuickStop,
            false => SafetyAction::Stop(StopCategory::RampThenRemove),
        };
        (!view.state.pose_known && !is_led).then_some((stop, SafetyReason::PoseUnknown, 0))
    }

    fn inputs(&self, view: &SafetyView<'_>) -> Objection {
        let (reason, input) = input_forbids(&self.plan, view.signals)?;
        Some((SafetyAction::Stop(self.plan.input_stop), reason, input))
    }

    fn command_age(&self, view: &SafetyView<'_>) -> Objection {
        let old = view.velocity.is_some_and(|request| view.time.now_ns >= request.valid_until_ns);
        old.then_some((SafetyAction::Stop(StopCategory::RampAndHold), SafetyReason::CommandAge, 0))
    }
}

/// Which of the inputs that enable and stop forbids that drives are enabled, by its place. One that isn't heard, or is
/// no number, enables nothing, and stops; so does one that said so at some instant since the cycle before.
pub(crate) fn input_forbids(plan: &SafetyPlan, signals: &Signals) -> Option<(SafetyReason, u64)> {
    let stops =
        plan.stop_input.filter(|input| signals.believed(*input) != Some(0.0) || signals.was_raised(*input));
    let enables = |input: &usize| {
        signals.believed(*input).is_some_and(|value| value != 0.0) && !signals.was_zeroed(*input)
    };
    let lacks = plan.enable_input.filter(|input| !enables(input));
    stops
        .map(|input| (SafetyReason::StopInput, input as u64))
        .or(lacks.map(|input| (SafetyReason::EnableInput, input as u64)))
}

/// Whether drives carry torque, or soon will.
fn is_powered(phase: Phase) -> bool {
    !matches!(phase, Phase::Disabled | Phase::Fault)
}

/// The harder of two stops.
fn harder(one: SafetyAction, other: SafetyAction) -> SafetyAction {
    if other.severity() > one.severity() { other } else { one }
}

/// The first of a set by bits; 0 where it is empty.
fn first(wheels: u16) -> u64 {
    if wheels == 0 { 0 } else { wheels.trailing_zeros().into() }
}

impl Safety for SafetyChain {
    fn reset(&mut self) {
        self.lost_in_a_row = 0;
        self.forget_motion();
        self.gives_way = false;
    }

    fn apply(&mut self, view: &SafetyView<'_>) -> Allowed {
        self.lost_in_a_row = match view.exchange {
            Exchange::Complete => 0,
            Exchange::Lost
            | Exchange::ShortCount { .. }
            | Exchange::Without { .. }
            | Exchange::Restarted { .. } => self.lost_in_a_row.saturating_add(1),
        };
        let behind_m = view.setpoint.odom_from_body.distance_m(view.wished.odom_from_body);
        self.gives_way =
            view.guard.limited_by != LimitedBy::Nothing || self.gives_way && behind_m > CAUGHT_UP_M;
        let is_powered = is_powered(view.phase);
        // The drives' own quick stop is theirs, and its torque too: many have an emergency torque of their own.
        let torque_counts = is_powered && view.phase != Phase::QuickStopping;
        match torque_counts {
            true => {
                self.torques.look(view);
                self.oscillation.look(view);
                self.runaway.look(view);
                self.shortfall.look(view);
                self.wiring.look(view);
                self.overspeed.look(view);
                self.astray.look(view);
            }
            false => self.forget_motion(),
        }
        let is_tracking = view.phase == Phase::Tracking;
        let is_held = is_tracking || view.phase == Phase::Holding;
        let mut hardest: Objection = None;
        // Of equals the first.
        let mut check = |counts: bool, check: Check| {
            let found = if counts { check(self, view) } else { None };
            if found.is_some_and(|(action, ..)| {
                hardest.is_none_or(|(hardest, ..)| action.severity() > hardest.severity())
            }) {
                hardest = found;
            }
        };
        check(is_powered, Self::exchange);
        check(is_powered, Self::inputs);
        check(true, Self::finite);
        check(is_powered, Self::drives);
        check(is_powered, Self::axes);
        check(is_powered, Self::wheel_speed);
        check(torque_counts, Self::ramp);
        check(torque_counts, Self::wheel_torque);
        check(torque_counts, Self::oscillation);
        check(torque_counts, Self::encoder);
        check(is_held, Self::wires);
        check(is_held, Self::weak_motor);
        check(is_held, Self::slip);
        check(is_tracking, Self::reference_speed);
        check(is_held, Self::tracking);
        check(is_tracking, Self::fence);
        check(is_tracking, Self::way);
        check(is_tracking, Self::place);
        check(is_tracking, Self::command_age);
        let allowed = match hardest {
            Some((action, reason, where_index))
                if action.severity() >= SafetyAction::QuickStop.severity() =>
            {
                // Nothing that was computed is needed, or trusted.
                Allowed { commands: Commands::default(), action, reason, where_index }
            }
            Some((action, reason, where_index)) => {
                let commands = within(view.commands, &view.wheel_limits, self.wheels);
                Allowed { commands, action, reason, where_index }
            }
            None => {
                let commands = within(view.commands, &view.wheel_limits, self.wheels);
                let scaled = commands.saturation < view.commands.saturation;
                let reason = if scaled && commands.quantity == Quantity::Torque {
                    SafetyReason::Torque
                } else {
                    SafetyReason::None
                };
                Allowed { commands, action: SafetyAction::Pass, reason, where_index: 0 }
            }
        };
        self.shortfall.allowed(allowed.commands);
        allowed
    }
}

/// Commands within the wheels' limits, scaled as a whole: a controller of a user's may not have done it.
fn within(commands: &Commands, limits: &WheelLimits, wheels: usize) -> Commands {
    let limit = match commands.quantity {
        Quantity::Nothing => return *commands,
        Quantity::Speed => limits.speed_rad_s,
        Quantity::Torque => limits.torque_nm,
    };
    let greatest =
        commands.values.iter().take(wheels).fold(0.0_f64, |greatest, value| greatest.max(value.abs()));
    // What stands at the limit after a controller's own scaling may lie a rounding above it.
    if greatest <= limit * (1.0 + 1e-12) {
        return *commands;
    }
    let factor = limit / greatest;
    let mut scaled = *commands;
    scaled.values.iter_mut().for_each(|value| *value *= factor);
    scaled.saturation *= factor;
    scaled
}
