//! One drive to Operation Enabled and back: without a jump, without a way out of a stop by itself.
//!
//! # Rules
//! 1. A target that the drive does not follow equals the actual value, in every cycle. So the drive is enabled,
//!    and changes its mode, with setpoints that already are where it stands. (A torque target is 0 while the
//!    drive carries no torque: the noise of a current sensor is no command.)
//! 2. The owner's setpoint takes over from there: a cyclic position keeps a fixed distance to the owner's
//!    ([`Enabling::position_origin_counts`]), so that the owner counts from wherever it likes; the difference of a velocity or
//!    torque fades out over [`Settings::fade_ns`].
//! 3. A fault, a quick stop, a drive that left operation by itself and a step that took too long are a
//!    [`EnablingError`]: kept until a person calls [`Enabling::acknowledge`].

mod error;

use crate::error_code::ErrorCode;
use crate::mode::{Mode, Quantity, SupportedModes};
use crate::state::{ControlWord, DriveState, StatusWord, Wanted, next_control_word};

pub use error::EnablingError;

/// What does not change while the machine runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// How long one step (a change of state or of mode) may take, in ns.
    pub step_timeout_ns: u64,
    /// Over what time the owner's velocity or torque takes over from the actual one, in ns; 0: at once.
    pub fade_ns: u64,
    /// The drive's 0x6502, where it was read.
    pub supported: Option<SupportedModes>,
}

impl Default for Settings {
    /// Two seconds a step (a drive charging its DC link takes one), 20 ms to take over.
    fn default() -> Self {
        Settings { step_timeout_ns: 2_000_000_000, fade_ns: 20_000_000, supported: None }
    }
}

/// The three values that a drive follows, in its own units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Targets {
    /// Position (0x607A, 0x6064), in counts; wraps.
    pub position_counts: i32,
    /// Velocity (0x60FF, 0x606C), in the drive's velocity unit.
    pub velocity_units: i32,
    /// Torque (0x6071, 0x6077), in per mille of rated.
    pub torque_per_mille: i16,
}

/// What the drive said in this cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feedback {
    /// 0x6041.
    pub status: StatusWord,
    /// The code in 0x6061; `None` where it is not mapped.
    pub mode_code: Option<i8>,
    /// The actual values.
    pub actual: Targets,
    /// 0x603F; `None` where it is not mapped.
    pub error: Option<ErrorCode>,
}

/// What the owner wants in this cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveRequest {
    /// The state in which the drive shall be.
    pub wanted: Wanted,
    /// The mode in which it shall run.
    pub mode: Mode,
    /// The setpoints; the mode decides which one counts.
    pub targets: Targets,
}

/// What the drive is told in this cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Output {
    /// 0x6040.
    pub control: ControlWord,
    /// 0x6060.
    pub mode: Mode,
    /// 0x607A, 0x60FF and 0x6071.
    pub targets: Targets,
    /// Where the drive is on its way.
    pub progress: Progress,
}

/// Where a drive is on its way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Progress {
    /// Under way to a state.
    Stepping {
        /// The state in which the drive is.
        from: DriveState,
        /// The state in which it is wanted.
        to: Wanted,
    },
    /// In operation, waiting for 0x6061 to show the mode.
    SwitchingMode {
        /// The mode asked for.
        to: Mode,
    },
    /// In operation; the drive follows the owner's setpoint.
    Running,
    /// In the wanted state, which is not operation.
    Holding(DriveState),
    /// Stopped until a person acknowledges.
    Stopped(EnablingError),
}

/// What is being waited for, and since when.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    State(DriveState, Wanted),
    Mode(Mode),
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Reset {
    None,
    /// The reset bit is low for one cycle, so that a rising edge follows.
    Low,
    High,
}

/// The machine that runs one drive; one call of [`Enabling::advance`] per cycle.
#[derive(Clone, Debug)]
pub struct Enabling {
    settings: Settings,
    problem: Option<EnablingError>,
    step: Option<(Step, u64)>,
    reset: Reset,
    leaving_quick_stop: bool,
    quick_stop_failed: bool,
    /// The drive was in operation, and is wanted there.
    operating: bool,
    /// The mode in which the owner's setpoint counts, and when it took over.
    running: Option<(Mode, u64)>,
    state: DriveState,
    sent: Targets,
    position_step_counts: i32,
    position_origin_counts: i32,
    velocity_gap: i64,
    torque_gap: i32,
    announced_counts: Option<i32>,
    announcing: bool,
}

impl Enabling {
    /// A machine for a drive of which nothing is known yet.
    pub fn new(settings: Settings) -> Enabling {
        Enabling {
            settings,
            problem: None,
            step: None,
            reset: Reset::None,
            leaving_quick_stop: false,
            quick_stop_failed: false,
            operating: false,
            running: None,
            state: DriveState::NotReadyToSwitchOn,
            sent: Targets::default(),
            position_step_counts: 0,
            position_origin_counts: 0,
            velocity_gap: 0,
            torque_gap: 0,
            announced_counts: None,
            announcing: false,
        }
    }

    /// The drive's last known state.
    pub fn state(&self) -> DriveState {
        self.state
    }

    /// Why the drive is stopped, until acknowledged.
    pub fn problem(&self) -> Option<EnablingError> {
        self.problem
    }

    /// By how much the position sent lies ahead of the owner's, in counts; chosen anew at each take-over.
    pub fn position_origin_counts(&self) -> i32 {
        self.position_origin_counts
    }

    /// In profile position mode: whether the drive acknowledged this set point.
    pub fn is_acknowledged(&self, position_counts: i32) -> bool {
        !self.announcing && self.announced_counts == Some(position_counts)
    }

    /// A person saw the problem: resets a fault, leaves a quick stop, and goes where the requests want.
    ///
    /// If the cause is still there, the next cycles stop the drive again.
    pub fn acknowledge(&mut self) {
        if self.problem.take().is_none() {
            return;
        }
        self.step = None;
        self.operating = false;
        self.quick_stop_failed = false;
        match self.state {
            DriveState::Fault | DriveState::FaultReactionActive => self.reset = Reset::Low,
            DriveState::QuickStopActive | DriveState::OperationEnabled => self.leaving_quick_stop = true,
            _ => {}
        }
    }

    /// One cycle: what the drive is told, from what it said and what is wanted. `now_ns` must not run backwards.
    pub fn advance(&mut self, now_ns: u64, feedback: &Feedback, request: &DriveRequest) -> Output {
        // A pattern without a meaning changes nothing; the step's timeout bounds how long it may last.
        let state = feedback.status.state().unwrap_or(self.state);
        self.state = state;
        if self.leaving_quick_stop
            && !matches!(state, DriveState::QuickStopActive | DriveState::OperationEnabled)
        {
            self.leaving_quick_stop = false;
        }
        self.find_problem(feedback, request);
        let wanted = self.effective(request.wanted);
        self.operating = state == DriveState::OperationEnabled && wanted == Wanted::OperationEnabled;
        let mode = self.mode(feedback, request);
        let mode_shown = feedback.mode_code.is_none_or(|code| code == mode.code());

        let waiting = if self.reset != Reset::None || !wanted.is_reached(state) {
            Some(Step::State(state, wanted))
        } else if self.operating && !mode_shown {
            Some(Step::Mode(mode))
        } else {
            None
        };
        self.time(now_ns, waiting, feedback);
        // The clock may just have found a problem: it counts in this cycle already.
        let wanted = self.effective(request.wanted);
        self.operating &= wanted == Wanted::OperationEnabled;

        let mut control = next_control_word(state, wanted);
        control = self.reset_edge(control);
        let targets = self.targets(now_ns, feedback, request, mode_shown.then_some(mode));
        if self.operating && mode_shown && self.running.is_some() {
            control = control.with(self.mode_bits(mode, feedback.status));
        }
        let progress = match &self.problem {
            Some(problem) => Progress::Stopped(*problem),
            None if self.operating && mode_shown && self.running.is_some() => Progress::Running,
            None if self.operating => Progress::SwitchingMode { to: mode },
            None if wanted.is_reached(state) => Progress::Holding(state),
            None => Progress::Stepping { from: state, to: wanted },
        };
        Output { control, mode, targets, progress }
    }

    fn find_problem(&mut self, feedback: &Feedback, request: &DriveRequest) {
        if self.reset != Reset::None {
            if self.state == DriveState::Fault || self.state == DriveState::FaultReactionActive {
                return;
            }
            self.reset = Reset::None;
        }
        let found = match self.state {
            DriveState::Fault | DriveState::FaultReactionActive => match self.problem {
                // The code may arrive some cycles after the state; after that the first one stays.
                Some(EnablingError::FaultPersists(_)) => None,
                Some(EnablingError::Fault(Some(code))) if code != ErrorCode::NONE => None,
                _ => Some(EnablingError::Fault(feedback.error)),
            },
            _ if self.problem.is_some() => None,
            _ if request.wanted == Wanted::QuickStop => Some(EnablingError::QuickStop),
            DriveState::QuickStopActive if !self.leaving_quick_stop => Some(EnablingError::QuickStopByDrive),
            found
                if self.operating
                    && found != DriveState::OperationEnabled
                    && request.wanted == Wanted::OperationEnabled =>
            {
                Some(EnablingError::LeftOperation { found, status: feedback.status })
            }
            _ => match self.settings.supported {
                Some(supported)
                    if request.wanted == Wanted::OperationEnabled && !supported.supports(request.mode) =>
                {
                    Some(EnablingError::UnsupportedMode { wanted: request.mode, supported })
                }
                _ => None,
            },
        };
        if found.is_some() {
            self.problem = found;
        }
    }

    /// What is wanted after problems had their say.
    fn effective(&self, wanted: Wanted) -> Wanted {
        match (&self.problem, self.state) {
            (None, _) if self.leaving_quick_stop => Wanted::SwitchOnDisabled,
            (None, _) => wanted,
            (Some(_), _) if self.quick_stop_failed || wanted == Wanted::SwitchOnDisabled => {
                Wanted::SwitchOnDisabled
            }
            // A moving drive is braked, and held as its quick stop option says.
            (Some(_), DriveState::OperationEnabled | DriveState::QuickStopActive) => Wanted::QuickStop,
            (Some(_), _) => Wanted::SwitchOnDisabled,
        }
    }

    /// The mode to ask for: a mode that the drive lacks is never asked for.
    fn mode(&self, feedback: &Feedback, request: &DriveRequest) -> Mode {
        match (&self.problem, self.running) {
            // While stopping nothing is switched.
            (Some(_), Some((mode, _))) => mode,
            (Some(EnablingError::UnsupportedMode { .. }), None) => {
                feedback.mode_code.and_then(Mode::from_code).unwrap_or(request.mode)
            }
            _ => request.mode,
        }
    }

    fn time(&mut self, now_ns: u64, waiting: Option<Step>, feedback: &Feedback) {
        let Some(step) = waiting else {
            self.step = None;
            return;
        };
        let since_ns = match self.step {
            Some((same, since_ns)) if same == step => since_ns,
            _ => now_ns,
        };
        self.step = Some((step, since_ns));
        let waited_ns = now_ns.saturating_sub(since_ns);
        if waited_ns <= self.settings.step_timeout_ns {
            return;
        }
        let problem = match step {
            _ if self.reset != Reset::None => EnablingError::FaultPersists(feedback.error),
            Step::State(from, to) => {
                EnablingError::StateTimeout { from, to, status: feedback.status, waited_ns }
            }
            Step::Mode(to) => {
                EnablingError::ModeTimeout { to, found: feedback.mode_code.unwrap_or(0), waited_ns }
            }
        };
        if matches!(step, Step::State(_, Wanted::QuickStop)) {
            // It does not brake: take the torque away (IEC 60204-1, category 0).
            self.quick_stop_failed = true;
        }
        self.reset = Reset::None;
        self.leaving_quick_stop = false;
        // The first problem is the cause; what follows from it isn't.
        self.problem = self.problem.or(Some(problem));
    }

    /// Bit 7: one cycle low, then high until the drive leaves the fault.
    fn reset_edge(&mut self, control: ControlWord) -> ControlWord {
        match self.reset {
            Reset::None => control,
            // An edge while the drive still reacts to the fault would be lost.
            Reset::Low if self.state == DriveState::FaultReactionActive => control,
            Reset::Low => {
                self.reset = Reset::High;
                control.without(ControlWord::FAULT_RESET)
            }
            Reset::High => control.with(ControlWord::FAULT_RESET),
        }
    }

    fn targets(
        &mut self,
        now_ns: u64,
        feedback: &Feedback,
        request: &DriveRequest,
        shown: Option<Mode>,
    ) -> Targets {
        let mut targets = feedback.actual;
        if self.state != DriveState::OperationEnabled {
            targets.torque_per_mille = 0;
        }
        if !self.operating {
            self.running = None;
            self.announced_counts = None;
            self.announcing = false;
        } else if let Some(mode) = shown {
            let since_ns = match self.running {
                Some((same, since_ns)) if same == mode => since_ns,
                _ => self.take_over(now_ns, mode, &feedback.actual, &request.targets),
            };
            self.follow(&mut targets, &request.targets, mode, now_ns.saturating_sub(since_ns));
        } else if let Some((old, _)) = self.running {
            // Until 0x6061 shows the new mode the drive follows the old target: it goes on as it was.
            match old.quantity() {
                Quantity::Position => {
                    targets.position_counts =
                        self.sent.position_counts.wrapping_add(self.position_step_counts);
                }
                Quantity::Velocity => targets.velocity_units = self.sent.velocity_units,
                Quantity::Torque => targets.torque_per_mille = self.sent.torque_per_mille,
                Quantity::Nothing => {}
            }
        }
        self.position_step_counts = match self.running {
            Some((Mode::CyclicSynchronousPosition | Mode::InterpolatedPosition, _)) => {
                targets.position_counts.wrapping_sub(self.sent.position_counts)
            }
            _ => 0,
        };
        self.sent = targets;
        targets
    }

    /// The owner's setpoint takes over from the actual values: notes the distances between the two.
    fn take_over(&mut self, now_ns: u64, mode: Mode, actual: &Targets, wished: &Targets) -> u64 {
        self.running = Some((mode, now_ns));
        // pp is a move to a place, planned by the drive: it may be far, and means the place itself.
        self.position_origin_counts = match mode {
            Mode::ProfilePosition => 0,
            _ => actual.position_counts.wrapping_sub(wished.position_counts),
        };
        self.velocity_gap = i64::from(actual.velocity_units) - i64::from(wished.velocity_units);
        self.torque_gap = i32::from(actual.torque_per_mille) - i32::from(wished.torque_per_mille);
        self.announced_counts = None;
        self.announcing = false;
        self.sent = *actual;
        now_ns
    }

    fn follow(&self, targets: &mut Targets, wished: &Targets, mode: Mode, elapsed_ns: u64) {
        let fade = self.settings.fade_ns;
        let left_ns = fade.saturating_sub(elapsed_ns);
        // 128 bits: a gap of 2^32 times a fade of hours stays exact.
        let part = |gap: i64| match left_ns {
            0 => 0,
            _ => (i128::from(gap) * i128::from(left_ns) / i128::from(fade.max(1))) as i64,
        };
        match mode.quantity() {
            Quantity::Position => {
                targets.position_counts = wished.position_counts.wrapping_add(self.position_origin_counts);
            }
            Quantity::Velocity => {
                let velocity = i64::from(wished.velocity_units) + part(self.velocity_gap);
                targets.velocity_units = velocity.clamp(i32::MIN.into(), i32::MAX.into()) as i32;
            }
            Quantity::Torque => {
                let torque = i64::from(wished.torque_per_mille) + part(self.torque_gap.into());
                targets.torque_per_mille = torque.clamp(i16::MIN.into(), i16::MAX.into()) as i16;
            }
            Quantity::Nothing => {}
        }
    }

    /// Bits 4 to 6, whose meaning depends on the mode.
    fn mode_bits(&mut self, mode: Mode, status: StatusWord) -> ControlWord {
        match mode {
            Mode::Homing | Mode::InterpolatedPosition => ControlWord::START,
            Mode::Velocity => ControlWord::VELOCITY_RAMP,
            Mode::ProfilePosition => {
                // Hand-shake: bit 4 rises with a new target, and falls when the drive acknowledged it.
                let acknowledged = status.contains(StatusWord::SETPOINT_ACKNOWLEDGED);
                let is_new = self.announced_counts != Some(self.sent.position_counts);
                if acknowledged {
                    self.announcing = false;
                    if is_new {
                        // The last one is over: it is new again should it come back.
                        self.announced_counts = None;
                    }
                } else if is_new && !self.announcing {
                    self.announced_counts = Some(self.sent.position_counts);
                    self.announcing = true;
                }
                match self.announcing {
                    true => ControlWord::NEW_SETPOINT.with(ControlWord::CHANGE_IMMEDIATELY),
                    false => ControlWord::CHANGE_IMMEDIATELY,
                }
            }
            _ => ControlWord::default(),
        }
    }
}
