//! The latest of everything, for whoever looks at a running robot.

use omnibase_platform::Pose2;
use omnibase_robot::guard::{MAX_FENCE_CORNERS, MAX_OBSTACLES, Obstacle};
use omnibase_robot::signals::{CycleRecord, Phase, Setpoint};
use omnibase_robot::stages::Gain;
use omnibase_robot::{JoystickShape, MOST_SETTINGS};

use crate::channels::CycleExtras;
use crate::drive_errors::DriveErrors;
use omnibase_measure::timing::TimingSeen;
use omnibase_session::Words;

/// The latest of everything.
#[derive(Clone, Copy, Debug)]
pub struct Snapshot {
    /// The cycle.
    pub record: CycleRecord,
    /// Where the robot is in its life after it.
    pub phase: Phase,
    /// What stands beside it: times, errors, truth, who has the say.
    pub extras: CycleExtras,
    /// Which errors the drives have.
    pub drive_errors: DriveErrors,
    /// What is wrong with the axis about which the robot stopped, with its name; no words where it is about none.
    pub axis_problem: Words,
    /// What may be set, each at its index.
    pub settings: [Option<Gain>; MOST_SETTINGS],
    /// How its joystick is shaped.
    pub joystick: JoystickShape,
    /// Obstacles that are there, where they are now.
    pub obstacles: [Option<Obstacle>; MAX_OBSTACLES],
    /// The fence.
    pub fence: FenceSeen,
    /// The number of the reference that is followed; 0 for the robot file's own.
    pub reference: u32,
    /// Whether that one, and the one that is begun next, was planned for what was in the way then: who looks after it alone begins it.
    pub is_looked_after: [bool; 2],
    /// Where that began when it was last started.
    pub reference_start: Option<Setpoint>,
    /// Where it was told to go last.
    pub goal: Option<Pose2>,
    /// Cycle times so far.
    pub timing: TimingSeen,
    /// Cycles in OP.
    pub cycles: u64,
    /// Frames that weren't back at their deadline.
    pub lost_frames: u64,
    /// Cycles left out.
    pub overruns: u64,
}

/// The corners of a fence, of which there may be none.
#[derive(Clone, Copy, Debug, Default)]
pub struct FenceSeen {
    corners_m: [[f64; 2]; MAX_FENCE_CORNERS],
    count: usize,
}

impl FenceSeen {
    /// Of its corners in odom, m.
    pub fn of(corners_m: &[[f64; 2]]) -> Self {
        let mut seen = FenceSeen { count: corners_m.len().min(MAX_FENCE_CORNERS), ..FenceSeen::default() };
        seen.corners_m.iter_mut().zip(corners_m).for_each(|(kept, corner)| *kept = *corner);
        seen
    }

    /// Its corners in odom, m.
    pub fn corners_m(&self) -> &[[f64; 2]] {
        &self.corners_m[..self.count]
    }
}

impl Snapshot {
    /// A setting by its name, with the index by which it is set.
    pub fn setting(&self, name: &str) -> Option<(u32, Gain)> {
        let mut settings = (0..).zip(&self.settings).filter_map(|(index, gain)| Some((index, (*gain)?)));
        settings.find(|(_, gain)| gain.name == name)
    }
}

impl Default for Snapshot {
    fn default() -> Self {
        Snapshot {
            record: CycleRecord::default(),
            phase: Phase::default(),
            extras: CycleExtras::default(),
            drive_errors: DriveErrors::default(),
            axis_problem: Words::default(),
            settings: [None; MOST_SETTINGS],
            joystick: JoystickShape::default(),
            obstacles: Default::default(),
            fence: FenceSeen::default(),
            reference: 0,
            is_looked_after: [false; 2],
            reference_start: None,
            goal: None,
            timing: TimingSeen::default(),
            cycles: 0,
            lost_frames: 0,
            overruns: 0,
        }
    }
}
