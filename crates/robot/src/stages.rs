//! The stages of the cycle: small object-safe traits, each chosen by name from the robot's file.
//!
//! None of them may allocate, wait, log or panic in the methods that run in a cycle, and each must give the same
//! outputs for the same inputs: that is what makes a record replayable.

use omnibase_cia402::{Mode, Wanted};
use omnibase_platform::Pose2;

use crate::signals::{
    Allowed, Commands, CycleTime, DriveMeasurement, DriveProgress, Exchange, GuardReport, Measurements,
    Phase, PlatformState, Quantity, Request, Setpoint, WheelCommand,
};

/// What a device is told in one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveCommand {
    /// The state in which the drive shall be.
    pub wanted: Wanted,
    /// The mode in which it shall run.
    pub mode: Mode,
    /// What the wheel shall do, once the drive runs.
    pub command: WheelCommand,
}

/// One drive: between its process data and the wheel's units.
pub trait Device: Send {
    /// Reads the drive's process data of a complete exchange.
    fn read(&mut self, time: &CycleTime, inputs: &[u8]) -> DriveMeasurement;

    /// Writes the drive's process data for the next exchange, and says how far the drive is.
    fn write(&mut self, time: &CycleTime, command: &DriveCommand, outputs: &mut [u8]) -> DriveProgress;

    /// The drive lost its supply and is back: what it counts has a new origin, which the next reading gives.
    fn restarted(&mut self) {}

    /// Somebody saw what was wrong: faults may be reset.
    fn acknowledge(&mut self);

    /// What is wrong with the drive, in words, for reports; never called in a cycle.
    fn problem(&self) -> Option<String>;
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
    /// What was wished in the cycle before.
    pub wished: &'a Setpoint,
}

/// From measurements to the platform's state.
pub trait Estimator: Send {
    /// Begins anew from a state: the next measurements are the origin.
    fn reset(&mut self, from: &PlatformState);

    /// The platform's state now.
    fn update(&mut self, observation: &Observation<'_>) -> PlatformState;
}

/// A wished motion.
pub trait Reference: Send {
    /// Begins at a pose at rest; paths are laid from there.
    fn start(&mut self, from: &Setpoint);

    /// The setpoint at a time since the start, s; it rises by one period a cycle, or less while the motion is slowed.
    fn sample(&mut self, since_start_s: f64) -> Setpoint;

    /// The setpoint at a time since the start, s, without going there: what lies ahead, for the fence.
    ///
    /// `None` where that can't be known; then the platform stops where it gets to the fence.
    fn preview(&self, since_start_s: f64) -> Option<Setpoint> {
        let _ = since_start_s;
        None
    }

    /// Time of the whole motion, s; `None` where it has no end.
    fn duration_s(&self) -> Option<f64>;

    /// Where the platform must stand at the start, in odom; `None` where it begins wherever it stands.
    fn start_pose(&self) -> Option<Pose2> {
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
    /// What its commands are.
    fn quantity(&self) -> Quantity;

    /// Begins anew: forgets what it learnt.
    fn reset(&mut self);

    /// The wheels' commands now, scaled as a whole so that no wheel exceeds its limit.
    fn update(&mut self, time: &CycleTime, state: &PlatformState, setpoint: &Setpoint) -> Commands;

    /// Its gains, by their place; `None` beyond the last.
    fn gain(&self, index: usize) -> Option<Gain>;

    /// Sets a gain to a value within its bounds.
    fn set_gain(&mut self, index: usize, value: f64);

    /// What it estimates (mass kg, inertia kg·m², force N), 0 for what it doesn't.
    fn estimates(&self) -> [f64; 3] {
        [0.0; 3]
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
    /// What the drives said.
    pub measurements: &'a Measurements,
    /// What is known.
    pub state: &'a PlatformState,
    /// What is wished, before any limit.
    pub wished: &'a Setpoint,
    /// What the controller follows.
    pub setpoint: &'a Setpoint,
    /// The velocity command that counts, where one does.
    pub velocity: Option<&'a Request>,
    /// By how much the wished pose keeps off the fence more than its margin, m; below 0 where the plan leads out;
    /// infinite without a fence and while nothing is followed.
    pub wished_fence_room_m: f64,
    /// What held the motion back between fence and obstacles.
    pub guard: &'a GuardReport,
    /// What the controller wants to tell the wheels.
    pub commands: &'a Commands,
}

/// The last word on commands.
pub trait Safety: Send {
    /// Begins anew, after a person acknowledged.
    fn reset(&mut self);

    /// What of the commands is allowed, and why not more.
    fn apply(&mut self, view: &SafetyView<'_>) -> Allowed;
}
