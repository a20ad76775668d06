//! An axis: a drive of the profile CiA 402 that turns no wheel.
//!
//! It holds in csp. A move in csp follows a way that the cycle plans; pp, pv and homing are the drive's own, and lead back to csp.
//! What doesn't fit a motion that is under way waits until the axis rests.

mod fields;
mod profile;
mod watch;

use std::fmt::Write;

use omnibase_cia402::{
    ControlWord, DriveRequest, Enabling, ErrorCode, Feedback, Mode, Progress, Settings, StatusWord, Targets,
    Wanted,
};

use crate::config::{AxisMode, AxisPlan, DevicePlan, EncoderName};
use crate::devices::{Field, nearest};
use crate::registry::{Made, given};
use crate::signals::{AxisAsk, AxisState, CycleTime, RequestAnswer};
use crate::stages::{Leave, Peripheral, Readiness};
use fields::Fields;
pub(super) use fields::defaults;
use profile::Profile;
use watch::{Watch, Wrong};

/// How long a drive may take to acknowledge a set point, ns.
const ACKNOWLEDGE_NS: u64 = 1_000_000_000;
/// How much longer than its ramp a halt of the drive's own may take, ns.
const HALT_NS: u64 = 1_000_000_000;
/// Cycles until a drive that is told to halt slows down, at most.
const HALT_CYCLES: f64 = 10.0;
/// An axis stands that was slower than this share of its greatest speed for so many cycles.
const STANDING_SHARE: f64 = 0.01;
const STANDING_CYCLES: u32 = 5;

/// What an axis does.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Task {
    /// In csp: it holds, or comes to rest.
    Rest,
    /// In csp, on the way to a position.
    Stream { to: f64 },
    /// In pp, on the way to a position.
    Plan { to: f64, since_ns: u64 },
    /// In pv, at a speed.
    Run { speed: f64 },
    /// In hm. `was_attained`: the drive showed a home before it was asked to look for one.
    Home { since_ns: u64, was_attained: Option<bool> },
    /// In pp, pv or hm: the drive shall stop, then it holds in csp.
    Halt { in_mode: Mode, since_ns: u64 },
}

impl Task {
    fn mode(self) -> Mode {
        match self {
            Task::Rest | Task::Stream { .. } => Mode::CyclicSynchronousPosition,
            Task::Plan { .. } => Mode::ProfilePosition,
            Task::Run { .. } => Mode::ProfileVelocity,
            Task::Home { .. } => Mode::Homing,
            Task::Halt { in_mode, .. } => in_mode,
        }
    }
}

/// A drive of the profile CiA 402 that turns no wheel.
#[derive(Clone, Debug)]
pub struct Axis {
    plan: AxisPlan,
    fields: Fields,
    enabling: Enabling,
    feedback: Feedback,
    profile: Profile,
    watch: Watch,
    task: Task,
    /// What it does once it rests.
    next: Option<Task>,
    /// The drive is in operation.
    is_on: bool,
    /// It follows the task's commands: it isn't on its way to the task's mode.
    is_running: bool,
    /// The drive was told to halt in a mode of its own, and hasn't left it yet: without that it would go on.
    is_halted: bool,
    /// Nobody knows where it is: what was measured last is too old.
    is_lost: bool,
    is_homed: bool,
    has_no_home: bool,
    leave: Leave,
    /// Cycles in which it stood.
    stood: u32,
}

impl Axis {
    /// An axis as its plan says; refused where an object is missing that it can't do without.
    pub fn new(device: &DevicePlan) -> Made<Self> {
        let plan = given(device.axis.clone(), "axis")?;
        if plan.modes.contains(&AxisMode::Pv) {
            Field::needed(&device.outputs, 0x60FF, "the target speed, for pv,")?;
        }
        let profile = Profile::new(plan.limits, plan.period_s);
        Ok(Axis {
            fields: Fields::new(&device.inputs, &device.outputs)?,
            enabling: Enabling::new(Settings::default()),
            feedback: Feedback {
                status: StatusWord::default(),
                mode_code: Some(0),
                actual: Targets::default(),
                error: None,
            },
            profile,
            watch: Watch::default(),
            task: Task::Rest,
            next: None,
            is_on: false,
            is_running: false,
            is_halted: false,
            is_lost: false,
            is_homed: plan.encoder == EncoderName::Absolute,
            has_no_home: false,
            leave: Leave::default(),
            stood: 0,
            plan,
        })
    }

    fn position(&self) -> f64 {
        self.plan.scale.position(self.feedback.actual.position_counts)
    }

    fn speed(&self) -> f64 {
        f64::from(self.feedback.actual.velocity_units) / self.plan.scale.speed_units_per_unit_s
    }

    fn torque_nm(&self) -> f64 {
        self.plan.scale.torque_nm(self.feedback.actual.torque_per_mille)
    }

    /// Where it shall be, as far as the cycle knows.
    fn set_point(&self) -> f64 {
        match self.task {
            Task::Plan { to, .. } => to,
            Task::Rest | Task::Stream { .. } if self.is_running => self.profile.set_point(),
            Task::Rest | Task::Stream { .. } | Task::Run { .. } | Task::Home { .. } | Task::Halt { .. } => {
                self.position()
            }
        }
    }

    fn stands(&self) -> bool {
        self.stood >= STANDING_CYCLES
    }

    fn state(&self) -> AxisState {
        if self.watch.wrong().is_some() || self.enabling.problem().is_some() {
            return AxisState::Failed;
        }
        match self.task {
            _ if !self.is_on => AxisState::Off,
            Task::Halt { .. } => AxisState::Stopping,
            Task::Home { .. } => AxisState::Homing,
            Task::Stream { .. } | Task::Plan { .. } | Task::Run { .. } => AxisState::Moving,
            // Also on its way back from pp or homing to csp.
            Task::Rest if !self.is_running || !self.profile.rests() => AxisState::Stopping,
            Task::Rest if self.has_no_home => AxisState::HomingFailed,
            Task::Rest => AxisState::Holding,
        }
    }

    /// It comes to rest, and begins nothing by itself.
    fn stop(&mut self, now_ns: u64) {
        self.next = None;
        match self.task {
            Task::Rest | Task::Halt { .. } => {}
            Task::Stream { .. } => {
                self.profile.stop();
                self.task = Task::Rest;
            }
            Task::Plan { .. } | Task::Run { .. } | Task::Home { .. } => {
                self.task = Task::Halt { in_mode: self.task.mode(), since_ns: now_ns };
            }
        }
    }

    /// Another task, as soon as it rests; a motion of the same mode goes on to the new position.
    fn begin(&mut self, now_ns: u64, task: Task) {
        self.has_no_home = false;
        match (self.task, task) {
            (Task::Stream { .. } | Task::Rest, Task::Stream { to }) if self.is_running => {
                self.profile.lead_to(to);
                (self.task, self.next) = (task, None);
            }
            // The drive is told nothing new: it acknowledges nothing anew.
            (Task::Plan { to, .. }, Task::Plan { to: again, .. })
                if self.plan.scale.counts(to) == self.plan.scale.counts(again) =>
            {
                self.next = None;
            }
            (Task::Plan { .. }, Task::Plan { .. }) | (Task::Run { .. }, Task::Run { .. }) => {
                (self.task, self.next) = (task, None)
            }
            _ => {
                self.stop(now_ns);
                self.next = Some(task);
            }
        }
    }

    /// Where its task is after what the drive said.
    fn advance(&mut self, now_ns: u64) {
        if self.is_lost {
            if let Task::Halt { since_ns, .. } = &mut self.task {
                *since_ns = now_ns;
            }
            return;
        }
        let (status, here) = (self.feedback.status, self.position());
        let shows = self.feedback.mode_code == Some(self.task.mode().code());
        match &mut self.task {
            Task::Rest => {
                if self.is_running && self.profile.rests() && self.leave.may_move {
                    self.start(now_ns);
                }
            }
            Task::Stream { .. } => {
                if self.profile.rests() {
                    self.task = Task::Rest;
                }
            }
            Task::Plan { to, since_ns } => {
                let is_there = (here - *to).abs() <= self.plan.limits.following_error;
                let acknowledges = shows && status.contains(StatusWord::SETPOINT_ACKNOWLEDGED);
                // Not the one before it.
                let is_acknowledged = self.enabling.is_acknowledged(self.plan.scale.counts(*to));
                let is_reached = is_there && status.contains(StatusWord::TARGET_REACHED);
                if is_acknowledged && !acknowledges && is_reached {
                    self.rest();
                } else if !is_acknowledged && now_ns.saturating_sub(*since_ns) > ACKNOWLEDGE_NS {
                    self.watch.fail(Wrong::NotAcknowledged);
                }
            }
            Task::Run { speed } => {
                let (wished, measured) = (*speed, self.speed());
                // Where it was told to turn round it goes on as it went until it has slowed down.
                if self.leaves_limits(if self.stood == 0 { measured } else { wished }) {
                    self.stop(now_ns);
                }
            }
            Task::Home { since_ns, was_attained } => {
                let is_late = self
                    .plan
                    .homing
                    .is_none_or(|homing| now_ns.saturating_sub(*since_ns) > homing.timeout_ns);
                if shows {
                    let attained = status.contains(StatusWord::HOMING_ATTAINED);
                    let is_old = was_attained.get_or_insert(attained);
                    // A home of before is none.
                    *is_old &= attained;
                    let is_done = attained && !*is_old && status.contains(StatusWord::TARGET_REACHED);
                    if is_done {
                        self.is_homed = true;
                        return self.rest();
                    }
                }
                if is_late || shows && status.contains(StatusWord::FOLLOWING_ERROR) {
                    self.has_no_home = true;
                    self.task = Task::Halt { in_mode: Mode::Homing, since_ns: now_ns };
                }
            }
            Task::Halt { since_ns, .. } => {
                let ramp_s = 2.0 * self.plan.limits.speed / self.plan.limits.stop_deceleration;
                let most_ns = HALT_NS + (ramp_s * 1e9) as u64;
                let is_late = now_ns.saturating_sub(*since_ns) > most_ns;
                if self.stands() {
                    self.rest();
                } else if is_late {
                    self.watch.fail(Wrong::DoesntHalt);
                }
            }
        }
    }

    /// Whether a halt that began now would end outside of its limits, or nearly, on the way to that side.
    fn leaves_limits(&self, outwards: f64) -> bool {
        let limits = &self.plan.limits;
        let speed = self.speed().abs();
        let halt =
            speed * speed / (2.0 * limits.stop_deceleration) + speed * HALT_CYCLES * self.plan.period_s;
        let [least, greatest] = limits.position;
        let left = if outwards > 0.0 { greatest - self.position() } else { self.position() - least };
        left <= halt
    }

    /// It holds where it is.
    fn rest(&mut self) {
        self.task = Task::Rest;
        self.is_running = false;
        self.profile.reset(self.position());
    }

    /// What waited begins.
    fn start(&mut self, now_ns: u64) {
        let Some(next) = self.next.take() else { return };
        self.task = match next {
            Task::Plan { to, .. } => Task::Plan { to, since_ns: now_ns },
            Task::Home { .. } => {
                self.is_homed = false;
                Task::Home { since_ns: now_ns, was_attained: None }
            }
            Task::Stream { to } => {
                self.profile.lead_to(to);
                next
            }
            other => other,
        };
    }

    /// The state in which its drive shall be: one that failed brakes, but where torque is taken it is taken of it too.
    fn wanted(&self) -> Wanted {
        match self.leave.wanted {
            Wanted::OperationEnabled if self.watch.wrong().is_some() => Wanted::QuickStop,
            wanted => wanted,
        }
    }

    fn lets_move(&self) -> bool {
        self.leave.may_move && self.leave.wanted == Wanted::OperationEnabled
    }
}

impl Peripheral for Axis {
    fn read(&mut self, time: &CycleTime, bytes: &[u8], inputs: &mut [f64]) {
        self.is_lost = false;
        let get = |field: Field| field.read(bytes);
        self.feedback = Feedback {
            status: StatusWord(get(self.fields.status) as u16),
            mode_code: Some(get(self.fields.shown_mode) as i8),
            actual: Targets {
                position_counts: get(self.fields.position),
                velocity_units: get(self.fields.speed),
                torque_per_mille: self.fields.torque.map_or(0, get) as i16,
            },
            error: self.fields.error.map(|field| ErrorCode(get(field) as u16)),
        };
        let stands = self.speed().abs() <= STANDING_SHARE * self.plan.limits.speed;
        self.stood = if stands { self.stood.saturating_add(1) } else { 0 };
        if self.is_running {
            let streams = matches!(self.task, Task::Rest | Task::Stream { .. });
            let seen = watch::AxisMeasurement {
                position: (self.is_homed && !matches!(self.task, Task::Home { .. })).then(|| self.position()),
                lag: if streams { self.position() - self.profile.set_point() } else { 0.0 },
                speed: self.speed(),
                torque_nm: self.torque_nm(),
            };
            self.watch.look(time, &self.plan, &seen);
        }
        let values = [
            self.position(),
            self.speed(),
            self.torque_nm(),
            self.set_point(),
            self.state().code() as f64,
            f64::from(u8::from(self.is_homed)),
            f64::from(self.feedback.mode_code.unwrap_or(0)),
        ];
        inputs.iter_mut().zip(values).for_each(|(input, value)| *input = value);
    }

    fn lead(&mut self, time: &CycleTime, leave: &Leave) {
        self.leave = *leave;
        if self.is_lost || !self.lets_move() {
            self.stop(time.now_ns);
        }
    }

    fn write(&mut self, time: &CycleTime, _: &[f64], bytes: &mut [u8]) {
        self.advance(time.now_ns);
        if self.is_running && matches!(self.task, Task::Rest | Task::Stream { .. }) {
            self.profile.step();
        } else {
            self.profile.reset(self.position());
        }
        let scale = &self.plan.scale;
        let position_counts = match self.task {
            Task::Plan { to, .. } => scale.counts(to),
            Task::Rest | Task::Stream { .. } if self.is_running => scale.counts(self.profile.set_point()),
            _ => self.feedback.actual.position_counts,
        };
        let velocity_units = match self.task {
            Task::Run { speed } => nearest(speed * scale.speed_units_per_unit_s, 32),
            _ => self.feedback.actual.velocity_units,
        };
        let request = DriveRequest {
            wanted: self.wanted(),
            mode: self.task.mode(),
            targets: Targets { position_counts, velocity_units, ..self.feedback.actual },
        };
        let output = self.enabling.advance(time.now_ns, &self.feedback, &request);
        self.is_running = output.progress == Progress::Running;
        self.is_on = matches!(output.progress, Progress::Running | Progress::SwitchingMode { .. });
        if !self.is_on {
            // What it did is over, and nothing that waited begins when it is back.
            (self.task, self.next) = (Task::Rest, None);
        }
        let halts = matches!(self.task, Task::Halt { .. });
        self.is_halted = halts || self.is_halted && self.is_on && !self.is_running;
        let control = if self.is_halted { output.control.with(ControlWord::HALT) } else { output.control };
        self.fields.control.write(bytes, control.0.into());
        self.fields.mode.write(bytes, output.mode.code().into());
        self.fields.target_position.write(bytes, output.targets.position_counts);
        if let Some(field) = self.fields.target_speed {
            field.write(bytes, output.targets.velocity_units);
        }
        if let Some(field) = self.fields.torque_limit {
            let per_mille = self.plan.limits.torque_nm / self.plan.scale.rated_torque_nm * 1000.0;
            field.write(bytes, nearest(per_mille.floor(), 16));
        }
    }

    fn takes(&self, _: usize, _: f64) -> bool {
        false
    }

    fn ask(&mut self, time: &CycleTime, ask: &AxisAsk) -> RequestAnswer {
        let is_homing = |task: Task| matches!(task, Task::Home { .. });
        let now_ns = time.now_ns;
        let task = match *ask {
            AxisAsk::Stop => {
                self.stop(now_ns);
                return RequestAnswer::Taken;
            }
            _ if !self.lets_move() => return RequestAnswer::WrongPhase,
            AxisAsk::Home if self.plan.homing.is_none() => return RequestAnswer::Refused,
            AxisAsk::Home if is_homing(self.task) => return RequestAnswer::Taken,
            AxisAsk::Home => Task::Home { since_ns: now_ns, was_attained: None },
            _ if is_homing(self.task) || self.next.is_some_and(is_homing) => return RequestAnswer::Homing,
            _ if !self.is_homed => return RequestAnswer::NotHomed,
            AxisAsk::Run { speed } => {
                let is_allowed = speed.abs() <= self.plan.limits.speed;
                if !is_allowed || !self.plan.modes.contains(&AxisMode::Pv) {
                    return RequestAnswer::Refused;
                }
                if speed == 0.0 {
                    self.stop(now_ns);
                    return RequestAnswer::Taken;
                }
                Task::Run { speed }
            }
            AxisAsk::Move { position, mode } => {
                let [least, greatest] = self.plan.limits.position;
                if !(least..=greatest).contains(&position) || !self.plan.modes.contains(&mode) {
                    return RequestAnswer::Refused;
                }
                match mode {
                    AxisMode::Csp => Task::Stream { to: position },
                    AxisMode::Pp => Task::Plan { to: position, since_ns: now_ns },
                    // No mode of positions.
                    AxisMode::Pv => return RequestAnswer::Refused,
                }
            }
        };
        self.begin(now_ns, task);
        RequestAnswer::Taken
    }

    fn readiness(&self) -> Readiness {
        let failed = self.watch.wrong().is_some() || self.enabling.problem().is_some();
        let rests = self.task == Task::Rest && self.next.is_none() && self.profile.rests();
        let is_ready = self.is_running && !self.is_lost;
        Readiness { is_ready, rests: rests && self.stands(), stands: self.stands(), failed }
    }

    fn lost(&mut self) {
        self.is_lost = true;
        if self.task != Task::Rest || !self.profile.rests() {
            // It may have begun to move since it was heard to stand.
            self.stood = 0;
        }
        // It may have lost its supply, and its count with it.
        self.is_homed &= self.plan.encoder == EncoderName::Absolute;
    }

    fn acknowledge(&mut self) {
        self.watch.reset();
        self.enabling.acknowledge();
    }

    fn tell_problem(&self, words: &mut dyn Write) -> bool {
        // What is too long for its room is cut.
        let _ = match (self.watch.wrong(), self.enabling.problem()) {
            (Some(wrong), _) => wrong.tell(&self.plan, words),
            (None, Some(problem)) => write!(words, "{problem}"),
            (None, None) => return false,
        };
        true
    }
}
