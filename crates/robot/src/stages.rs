//! The stages of the cycle: small object-safe traits, each chosen by name from the robot's file.
//!
//! None of them may allocate, wait, log or panic in the methods that run in a cycle, and each must give the same
//! outputs for the same inputs: that is what makes a record replayable.

use std::fmt::Write;

use omnibase_cia402::{Mode, Wanted};
use omnibase_platform::{Pose2, PoseGrowth};

use crate::config::WheelLimits;
use crate::signals::{
    Allowed, AxisAsk, Commands, CycleTime, DriveMeasurement, DriveProgress, Dynamics, Exchange, FusionReport,
    GripReport, GuardReport, Inputs, MAX_WHEELS, Measurements, Outputs, Phase, PlatformState, Quantity,
    Request, RequestAnswer, Setpoint, Signals, WheelCommand,
};
use crate::torque_loop::TorqueDesign;

/// What a device is told in one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveCommand {
    /// The state in which the drive shall be.
    pub wanted: Wanted,
    /// The mode in which it shall run.
    pub mode: Mode,
    /// What the wheel shall do, once the drive runs.
    pub command: WheelCommand,
    /// The most that the drive may put on the wheel, N·m, whatever it is told to do.
    pub torque_limit_nm: f64,
}

/// One drive: between its process data and the wheel's units.
pub trait Device: Send {
    /// Reads the drive's process data of a complete exchange.
    fn read(&mut self, time: &CycleTime, inputs: &[u8]) -> DriveMeasurement;

    /// What comes in beside the drives, and what it tells other SubDevices; before each writing.
    fn signals(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) {
        let _ = (inputs, outputs);
    }

    /// Writes the drive's process data for the next exchange, and says how far the drive is.
    fn write(&mut self, time: &CycleTime, command: &DriveCommand, outputs: &mut [u8]) -> DriveProgress;

    /// The drive lost its supply and is back: what it counts has a new origin, which the next reading gives.
    fn restarted(&mut self) {}

    /// Where the encoder is absolute, so that it keeps its count without supply too: the angle of the wheel, rad, below
    /// which what it turned is told by the count. Such a drive isn't told that it [restarted](Device::restarted).
    fn count_range_rad(&self) -> Option<f64> {
        None
    }

    /// Somebody saw what was wrong: faults may be reset.
    fn acknowledge(&mut self) {}

    /// What is wrong with the drive, in words, for reports; never called in a cycle.
    fn problem(&self) -> Option<String> {
        None
    }
}

/// A SubDevice that drives no wheel: between its process data and its signals, in the order of its plan.
pub trait Peripheral: Send {
    /// Reads its process data of an exchange in which it took part; NaN for what it can't say now.
    fn read(&mut self, time: &CycleTime, bytes: &[u8], inputs: &mut [f64]) {
        let _ = (time, bytes);
        inputs.fill(f64::NAN);
    }

    /// What comes in beside the drives, and what it tells other SubDevices; before each writing.
    fn signals(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) {
        let _ = (inputs, outputs);
    }

    /// Writes its process data for the next exchange, which hold what it wrote last.
    fn write(&mut self, time: &CycleTime, outputs: &[f64], bytes: &mut [u8]) {
        let _ = (time, outputs, bytes);
    }

    /// Whether an output, by its place, can have a value.
    fn takes(&self, output: usize, value: f64) -> bool {
        let _ = output;
        value.is_finite()
    }

    /// What the robot lets it do; before each writing.
    fn lead(&mut self, time: &CycleTime, leave: &Leave) {
        let _ = (time, leave);
    }

    /// Somebody wants it to move; refused by what has nothing that moves.
    fn ask(&mut self, time: &CycleTime, ask: &AxisAsk) -> RequestAnswer {
        let _ = (time, ask);
        RequestAnswer::Refused
    }

    /// How far it is on its way, after what it read and wrote.
    fn readiness(&self) -> Readiness {
        Readiness::NOTHING_MOVES
    }

    /// It was left out of more exchanges in a row than are tolerated: what it does comes to rest.
    fn lost(&mut self) {}

    /// Somebody saw what was wrong: faults may be reset.
    fn acknowledge(&mut self) {}

    /// Says what is wrong with it, in words, and whether anything is; it is asked in the cycle too.
    fn tell_problem(&self, words: &mut dyn Write) -> bool {
        let _ = words;
        false
    }
}

/// What the robot lets a SubDevice without a wheel do in one cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Leave {
    /// The state in which a drive shall be, as those of the wheels.
    pub wanted: Wanted,
    /// Motion may begin and go on; else it comes to rest by its own ramp.
    pub may_move: bool,
}

impl Default for Leave {
    /// No torque.
    fn default() -> Self {
        Leave { wanted: Wanted::SwitchOnDisabled, may_move: false }
    }
}

/// How far a SubDevice without a wheel is on its way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Readiness {
    /// It follows its commands, or has none to follow: the robot may begin.
    pub is_ready: bool,
    /// It came to rest, and nothing waits to begin.
    pub rests: bool,
    /// It stands, whatever it was told.
    pub stands: bool,
    /// It failed: the robot stops.
    pub failed: bool,
}

impl Readiness {
    /// Of what has nothing that moves.
    pub const NOTHING_MOVES: Readiness =
        Readiness { is_ready: true, rests: true, stands: true, failed: false };
}

/// What an estimator works on.
#[derive(Clone, Copy, Debug)]
pub struct Observation<'a> {
    /// The moment.
    pub time: &'a CycleTime,
    /// What became of the exchange; only a complete one has new measurements.
    pub exchange: Exchange,
    /// What the drives said.
    pub measurements: &'a Measurements,
    /// What comes in beside the drives.
    pub inputs: Inputs<'a>,
    /// What was wished in the cycle before.
    pub wished: &'a Setpoint,
    /// By how much each wheel may have rolled, rad, without moving the platform as it says: while its drive was off and
    /// counted nothing (told in the cycle in which it counts again), or while it slips. What is believed is that much less certain.
    pub unread_rad: &'a [f64; MAX_WHEELS],
    /// How fast the wheel that slips most slips, as forces tell, m/s; 0 where all grip.
    pub slip_m_s: f64,
    /// No drive is enabled: nobody follows the pose, and it may jump.
    pub is_free: bool,
}

/// From measurements to the platform's state.
pub trait Estimator: Send {
    /// Begins anew from a state, its pose with its covariance, as somebody set it: the next measurements are the origin.
    fn reset(&mut self, from: &PlatformState);

    /// The platform's state now.
    fn update(&mut self, observation: &Observation<'_>) -> PlatformState;

    /// Whether sensors of the file tell it anything.
    fn hears_sensors(&self) -> bool {
        true
    }

    /// Whether it has a source beside the wheels, and says itself by [`PlatformState::pose_known`] when that told the
    /// pose again. Without one the pose is unknown from where wheels rolled unread until somebody sets it.
    fn sees_beyond_wheels(&self) -> bool {
        false
    }

    /// What sensors tell, for recordings and people.
    fn fusion(&self) -> FusionReport {
        FusionReport::default()
    }

    /// By how much motion may make its pose more uncertain, known beforehand: the fence counts with it until a stop
    /// stands.
    fn growth(&self) -> PoseGrowth {
        PoseGrowth::default()
    }
}

/// What a motion counts on whose every wheel grips and whose every motor bears it, as it was planned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannedFor {
    /// The floor's friction.
    pub friction: f64,
    /// The platform's mass, with the wheels, kg.
    pub mass_kg: f64,
    /// The root of the mean square of the warmest motor's torque over what it bears for ever, in the worst window of 30 s.
    pub heat: f64,
}

/// A wished motion.
pub trait Reference: Send {
    /// Begins at a pose at rest; paths are laid from there.
    fn start(&mut self, from: &Setpoint) {
        let _ = from;
    }

    /// What comes in beside the drives, and what it tells other SubDevices; before each sample.
    fn signals(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) {
        let _ = (inputs, outputs);
    }

    /// The setpoint at a time since the start, s; it rises by one period a cycle, or less while the motion is slowed.
    fn sample(&mut self, since_start_s: f64) -> Setpoint;

    /// The setpoint at a time since the start, s, without going there: what lies ahead, for the fence.
    ///
    /// `None` where that can't be known; then the platform stops where it gets to the fence.
    fn preview(&self, since_start_s: f64) -> Option<Setpoint> {
        let _ = since_start_s;
        None
    }

    /// How far the setpoint at a time since the start, s, is beside the motion that was asked for, in its axes.
    fn correction(&self, since_start_s: f64) -> Pose2 {
        let _ = since_start_s;
        Pose2::default()
    }

    /// Time of the whole motion, s; `None` where it has no end.
    fn duration_s(&self) -> Option<f64> {
        None
    }

    /// When it passes the start and the end of what was asked for with a speed, s; `None` where it rests there.
    fn passes_s(&self) -> [Option<f64>; 2] {
        [None; 2]
    }

    /// What it was planned for; `None` where it wasn't planned by what wheels, motors and floor bear.
    fn planned_for(&self) -> Option<PlannedFor> {
        None
    }

    /// Whether obstacles make the platform wait on its path, and never leave it.
    fn keeps_path(&self) -> bool {
        false
    }

    /// Where the platform must stand at the start, in odom; `None` where it begins wherever it stands.
    fn start_pose(&self) -> Option<Pose2> {
        None
    }

    /// Where it would end if it began at a pose; `None` where that isn't known.
    fn end_pose(&self, odom_from_body: &Pose2) -> Option<Pose2> {
        let _ = odom_from_body;
        None
    }
}

/// A value of a stage that can be read and set while the robot runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gain {
    /// Its name, with its unit.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Least allowed value.
    pub least: f64,
    /// Greatest allowed value.
    pub greatest: f64,
}

/// A control law: from state and setpoint to commands.
pub trait Controller: Send {
    /// What its commands are; commands of another quantity stop the robot.
    fn quantity(&self) -> Quantity {
        Quantity::Speed
    }

    /// Whether it swings the acceleration that it asks for, at 18 Hz: a wheel whose push doesn't follow slips then. By 0.04 of it, gentle
    /// ones by up to 0.1 m/s², as the built-in laws do: who swings by less than half of that tells nothing.
    fn asks_floor(&self) -> bool {
        false
    }

    /// Begins anew: forgets what it learnt.
    fn reset(&mut self) {}

    /// What the wheels may do from now on; never more than the robot's file says. Told before each update.
    ///
    /// Commands beyond it are scaled down later in any case; a law that learns must know that they were.
    fn limit_wheels(&mut self, limits: &WheelLimits) {
        let _ = limits;
    }

    /// A drive holds back what it was told by a limit of its own (bit 11 of its status word), some wheel slips, or some drive
    /// wasn't heard: how the platform moves says nothing of the machine then. Told before the update of each such cycle.
    fn limited_by_drives(&mut self) {}

    /// What the drives measured, in a cycle in which all were heard; before its update.
    fn feels(&mut self, measurements: &Measurements) {
        let _ = measurements;
    }

    /// What comes in beside the drives, and what it tells other SubDevices; before each update. An output that isn't set
    /// in a cycle goes back to what a call set, or to its value at a stop.
    fn signals(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) {
        let _ = (inputs, outputs);
    }

    /// The wheels' commands now, scaled as a whole so that no wheel exceeds its limit.
    fn update(&mut self, time: &CycleTime, state: &PlatformState, setpoint: &Setpoint) -> Commands;

    /// Its gains that people may change while the robot runs, by their place; `None` beyond the last.
    fn gain(&self, index: usize) -> Option<Gain> {
        let _ = index;
        None
    }

    /// Sets a gain to a value within its bounds.
    fn set_gain(&mut self, index: usize, value: f64) {
        let _ = (index, value);
    }

    /// Mass, inertia and friction as the wheels' torques tell them by now; before each update.
    fn knows(&mut self, dynamics: &Dynamics) {
        let _ = dynamics;
    }

    /// The force beside those of its model that it found, N.
    fn force_n(&self) -> f64 {
        0.0
    }

    /// Of a law of torque whose gains come from loops with margins: those loops, and what closes them. Never asked in a cycle.
    fn design(&self) -> Option<&TorqueDesign> {
        None
    }
}

/// What safety looks at.
#[derive(Clone, Copy, Debug)]
pub struct SafetyView<'a> {
    /// The moment.
    pub time: &'a CycleTime,
    /// What became of the exchange.
    pub exchange: Exchange,
    /// Where the robot is in its life.
    pub phase: Phase,
    /// It ramps down without what is measured: drives were lost, or the pose.
    pub is_ramp_blind: bool,
    /// What the drives said.
    pub measurements: &'a Measurements,
    /// What comes in beside the drives.
    pub signals: &'a Signals,
    /// The first SubDevice without a wheel that failed, by its place.
    pub failed_device: Option<usize>,
    /// What is known.
    pub state: &'a PlatformState,
    /// What is wished, before any limit.
    pub wished: &'a Setpoint,
    /// What the controller follows.
    pub setpoint: &'a Setpoint,
    /// The velocity command that counts, where one does.
    pub velocity: Option<&'a Request>,
    /// By how much the wished pose keeps off the fence more than it must, m: than the margin and what the pose's
    /// covariance asks for, or than the plan had already where it had less. Below 0 where the plan leads out; infinite
    /// without a fence and while nothing is followed.
    pub wished_fence_room_m: f64,
    /// Obstacles let a plan make no headway for too long.
    pub is_way_blocked: bool,
    /// What held the motion back between fence and obstacles.
    pub guard: &'a GuardReport,
    /// What the wheels' torques tell of platform and floor.
    pub grip: &'a GripReport,
    /// What the controller wants to tell the wheels.
    pub commands: &'a Commands,
    /// What the wheels may do now: at most what the robot's file says.
    pub wheel_limits: WheelLimits,
    /// Some drive takes torques now, whatever the control law commands.
    pub has_torque_drives: bool,
}

/// The last word on commands.
pub trait Safety: Send {
    /// Begins anew, after a person acknowledged.
    fn reset(&mut self);

    /// What of the commands is allowed, and why not more.
    fn apply(&mut self, view: &SafetyView<'_>) -> Allowed;
}
