//! What is asked of a running robot: at most one request a cycle, recorded with it.

use omnibase_platform::{Pose2, Twist2};

use super::{AxisAsk, StopCategory, coded};
use crate::config::{AxisMode, DriveMode};
use crate::obstacle::Obstacle;

/// The frame of a velocity command.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Frame {
    /// base_link: x is forward.
    #[default]
    Body,
    /// odom.
    Odom,
}

coded!(Frame { Body = 0, Odom = 1 });

/// What is asked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RequestKind {
    /// Bring the drives to operation and hold.
    Enable,
    /// Follow the reference from its start; while moving it is joined further on.
    Track,
    /// Stop.
    Stop(StopCategory),
    /// Somebody saw the fault and wants to go on.
    Acknowledge,
    /// Move at a speed; counts until the request's validity ends.
    Velocity {
        /// Speed.
        twist: Twist2,
        /// The frame of that speed.
        frame: Frame,
    },
    /// Go on with another controller of the plan, while moving too.
    SwitchController {
        /// Its place in [`RobotPlan::controllers`](crate::RobotPlan::controllers).
        index: u32,
    },
    /// Command one drive by speeds or by torques from now on, while moving too.
    SetDriveMode {
        /// Its wheel.
        wheel: u32,
        /// How; `None`: by what the control law commands.
        mode: Option<DriveMode>,
    },
    /// Change a setting.
    Set {
        /// Its place in [`Robot::settings`](crate::Robot::settings).
        index: u32,
        /// Its new value.
        value: f64,
        /// With which others.
        batch: Batch,
    },
    /// Let the reference come to a halt on its path.
    Pause,
    /// Go on with a reference that was left: first the way back to where it was left. One that is being paused goes on at once.
    Resume,
    /// Go to a pose in odom in the shortest time, from rest or from the motion that is under way; from rest the way is straight.
    GoTo {
        /// The pose; its heading isn't wrapped.
        odom_from_body: Pose2,
    },
    /// Take the reference that was [offered](crate::Robot::offer_reference) in place of the present one: at once, or where that is followed, with
    /// [`RequestKind::Track`] or at its end.
    UseReference {
        /// The number by which it was offered.
        number: u32,
    },
    /// Put an obstacle on the floor, or move the one that is there.
    SetObstacle {
        /// Its place, below [`MAX_OBSTACLES`](crate::guard::MAX_OBSTACLES).
        index: u32,
        /// Where it is now, and how it moves on by itself from now on.
        obstacle: Obstacle,
    },
    /// Take an obstacle away.
    RemoveObstacle {
        /// Its place.
        index: u32,
    },
    /// Put a corner of another fence, in odom, m; the fence takes the old one's place with the last corner of its batch, only while the
    /// platform stands, and inside it.
    SetFence {
        /// The corner; its place is that in the batch.
        corner_m: [f64; 2],
        /// With which others.
        batch: Batch,
    },
    /// Say where the platform stands; only while it stands.
    SetPose {
        /// The pose, its heading in any turn.
        odom_from_body: Pose2,
        /// Standard deviation of x and of y, m.
        sigma_m: f64,
        /// Standard deviation of the heading, rad.
        sigma_rad: f64,
    },
    /// Set an output beside the drives; it stays so until the robot stops.
    SetOutput {
        /// Its place in [`RobotPlan::signals`](crate::RobotPlan::signals).
        index: u32,
        /// Its value, in its unit.
        value: f64,
    },
    /// Whoever set an output is gone: it has its value at a stop again.
    ResetOutput {
        /// Its place.
        index: u32,
    },
    /// Something about an axis.
    Axis {
        /// Its place in [`RobotPlan::devices`](crate::RobotPlan::devices).
        device: u32,
        /// What it shall do.
        ask: AxisAsk,
    },
}

/// What sort of thing is asked, as recordings tell it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "each is the request of its name, or what an axis is asked")]
pub enum RequestSort {
    Nothing,
    Enable,
    Track,
    Stop,
    Acknowledge,
    Velocity,
    Set,
    SwitchController,
    Pause,
    Resume,
    GoTo,
    UseReference,
    SetObstacle,
    RemoveObstacle,
    SetPose,
    SetOutput,
    ResetOutput,
    HomeAxis,
    MoveAxis,
    StopAxis,
    RunAxis,
    SetDriveMode,
    SetFence,
}

coded!(RequestSort {
    Nothing = 0,
    Enable = 1,
    Track = 2,
    Stop = 3,
    Acknowledge = 4,
    Velocity = 5,
    Set = 6,
    SwitchController = 7,
    Pause = 8,
    Resume = 9,
    GoTo = 10,
    UseReference = 11,
    SetObstacle = 12,
    RemoveObstacle = 13,
    SetPose = 14,
    SetOutput = 15,
    ResetOutput = 16,
    HomeAxis = 17,
    MoveAxis = 18,
    StopAxis = 19,
    RunAxis = 20,
    SetDriveMode = 21,
    SetFence = 22,
});

/// Which changes of settings belong together: they act in the cycle of the last one, all of them or none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Batch {
    number: u16,
    /// Below `size`.
    place: u8,
    size: u8,
}

impl Batch {
    /// A single change.
    pub const ALONE: Batch = Batch { number: 0, place: 0, size: 1 };

    /// The first of so many changes; batches that may meet have different numbers. `None` for a batch of none.
    pub fn new(number: u16, size: u8) -> Option<Self> {
        (size > 0).then_some(Batch { number, place: 0, size })
    }

    /// The next change of it; `None` after the last one.
    pub fn next(self) -> Option<Self> {
        let place = self.place + 1;
        (place < self.size).then_some(Batch { place, ..self })
    }

    /// Which of its changes this is, from 0.
    pub fn place(self) -> u8 {
        self.place
    }

    /// How many changes there are.
    pub fn size(self) -> u8 {
        self.size
    }

    /// Number, place and size, as recordings hold them.
    fn codes(self) -> [f64; 3] {
        [f64::from(self.number), f64::from(self.place), f64::from(self.size)]
    }

    fn from_codes([number, place, size]: [f64; 3]) -> Option<Self> {
        // What is no whole number, or too large, is another one after the way there and back.
        let batch = Batch { number: number as u16, place: place as u8, size: size as u8 };
        (batch.codes() == [number, place, size] && batch.place < batch.size).then_some(batch)
    }
}

/// A request and how long it counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Request {
    /// What is asked.
    pub kind: RequestKind,
    /// The moment, on the clock of [`CycleTime`](super::CycleTime), from which it no longer counts, ns.
    pub valid_until_ns: u64,
}

impl Request {
    /// A request that counts whenever it arrives.
    pub fn lasting(kind: RequestKind) -> Self {
        Request { kind, valid_until_ns: u64::MAX }
    }

    /// The numbers by which recordings hold a request: sort, argument, validity, and six values.
    pub fn codes(request: Option<Request>) -> ([u64; 3], [f64; 6]) {
        let Some(Request { kind, valid_until_ns }) = request else { return ([0; 3], [0.0; 6]) };
        let (sort, argument, values) = match kind {
            RequestKind::Enable => (RequestSort::Enable, 0, [0.0; 6]),
            RequestKind::Track => (RequestSort::Track, 0, [0.0; 6]),
            RequestKind::Stop(category) => (RequestSort::Stop, category.code(), [0.0; 6]),
            RequestKind::Acknowledge => (RequestSort::Acknowledge, 0, [0.0; 6]),
            RequestKind::Velocity { twist, frame } => (
                RequestSort::Velocity,
                frame.code(),
                [twist.vx_m_s, twist.vy_m_s, twist.w_rad_s, 0.0, 0.0, 0.0],
            ),
            RequestKind::Set { index, value, batch } => {
                let [number, place, size] = batch.codes();
                (RequestSort::Set, index.into(), [value, number, place, size, 0.0, 0.0])
            }
            RequestKind::SwitchController { index } => {
                (RequestSort::SwitchController, index.into(), [0.0; 6])
            }
            RequestKind::Pause => (RequestSort::Pause, 0, [0.0; 6]),
            RequestKind::Resume => (RequestSort::Resume, 0, [0.0; 6]),
            RequestKind::GoTo { odom_from_body: Pose2 { x_m, y_m, heading_rad } } => {
                (RequestSort::GoTo, 0, [x_m, y_m, heading_rad, 0.0, 0.0, 0.0])
            }
            RequestKind::UseReference { number } => (RequestSort::UseReference, number.into(), [0.0; 6]),
            RequestKind::SetObstacle { index, obstacle } => {
                let Obstacle { centre_m: [x, y], radius_m, velocity_m_s: [vx, vy] } = obstacle;
                (RequestSort::SetObstacle, index.into(), [x, y, radius_m, vx, vy, 0.0])
            }
            RequestKind::SetFence { corner_m: [x, y], batch } => {
                let [number, place, size] = batch.codes();
                (RequestSort::SetFence, 0, [x, y, number, place, size, 0.0])
            }
            RequestKind::RemoveObstacle { index } => (RequestSort::RemoveObstacle, index.into(), [0.0; 6]),
            RequestKind::SetPose { odom_from_body: Pose2 { x_m, y_m, heading_rad }, sigma_m, sigma_rad } => {
                (RequestSort::SetPose, 0, [x_m, y_m, heading_rad, sigma_m, sigma_rad, 0.0])
            }
            RequestKind::SetOutput { index, value } => {
                (RequestSort::SetOutput, index.into(), [value, 0.0, 0.0, 0.0, 0.0, 0.0])
            }
            RequestKind::ResetOutput { index } => (RequestSort::ResetOutput, index.into(), [0.0; 6]),
            RequestKind::Axis { device, ask: AxisAsk::Home } => {
                (RequestSort::HomeAxis, device.into(), [0.0; 6])
            }
            RequestKind::Axis { device, ask: AxisAsk::Move { position, mode } } => (
                RequestSort::MoveAxis,
                device.into(),
                [position, mode.mode().code().into(), 0.0, 0.0, 0.0, 0.0],
            ),
            RequestKind::Axis { device, ask: AxisAsk::Stop } => {
                (RequestSort::StopAxis, device.into(), [0.0; 6])
            }
            RequestKind::Axis { device, ask: AxisAsk::Run { speed } } => {
                (RequestSort::RunAxis, device.into(), [speed, 0.0, 0.0, 0.0, 0.0, 0.0])
            }
            RequestKind::SetDriveMode { wheel, mode } => {
                (RequestSort::SetDriveMode, wheel.into(), [code_of_drive_mode(mode), 0.0, 0.0, 0.0, 0.0, 0.0])
            }
        };
        ([sort.code(), argument, valid_until_ns], values)
    }

    /// The request of such numbers: `None` where no request has them, `Some(None)` where there was none.
    pub fn from_codes(
        [sort, argument, valid_until_ns]: [u64; 3],
        values: [f64; 6],
    ) -> Option<Option<Request>> {
        let axis = |ask| Some(RequestKind::Axis { device: argument.try_into().ok()?, ask });
        let kind = match RequestSort::from_code(sort)? {
            RequestSort::Nothing => return Some(None),
            RequestSort::Enable => RequestKind::Enable,
            RequestSort::Track => RequestKind::Track,
            RequestSort::Stop => RequestKind::Stop(StopCategory::from_code(argument)?),
            RequestSort::Acknowledge => RequestKind::Acknowledge,
            RequestSort::Velocity => {
                let [vx_m_s, vy_m_s, w_rad_s, ..] = values;
                RequestKind::Velocity {
                    twist: Twist2 { vx_m_s, vy_m_s, w_rad_s },
                    frame: Frame::from_code(argument)?,
                }
            }
            RequestSort::Set => RequestKind::Set {
                index: argument.try_into().ok()?,
                value: values[0],
                batch: Batch::from_codes([values[1], values[2], values[3]])?,
            },
            RequestSort::SwitchController => {
                RequestKind::SwitchController { index: argument.try_into().ok()? }
            }
            RequestSort::Pause => RequestKind::Pause,
            RequestSort::Resume => RequestKind::Resume,
            RequestSort::GoTo => {
                let [x_m, y_m, heading_rad, ..] = values;
                RequestKind::GoTo { odom_from_body: Pose2 { x_m, y_m, heading_rad } }
            }
            RequestSort::UseReference => RequestKind::UseReference { number: argument.try_into().ok()? },
            RequestSort::SetObstacle => {
                let [x, y, radius_m, vx, vy, _] = values;
                RequestKind::SetObstacle {
                    index: argument.try_into().ok()?,
                    obstacle: Obstacle { centre_m: [x, y], radius_m, velocity_m_s: [vx, vy] },
                }
            }
            RequestSort::SetFence => RequestKind::SetFence {
                corner_m: [values[0], values[1]],
                batch: Batch::from_codes([values[2], values[3], values[4]])?,
            },
            RequestSort::RemoveObstacle => RequestKind::RemoveObstacle { index: argument.try_into().ok()? },
            RequestSort::SetPose => {
                let [x_m, y_m, heading_rad, sigma_m, sigma_rad, _] = values;
                RequestKind::SetPose { odom_from_body: Pose2 { x_m, y_m, heading_rad }, sigma_m, sigma_rad }
            }
            RequestSort::SetOutput => {
                RequestKind::SetOutput { index: argument.try_into().ok()?, value: values[0] }
            }
            RequestSort::ResetOutput => RequestKind::ResetOutput { index: argument.try_into().ok()? },
            RequestSort::HomeAxis => axis(AxisAsk::Home)?,
            RequestSort::MoveAxis => {
                axis(AxisAsk::Move { position: values[0], mode: mode_of_code(values[1])? })?
            }
            RequestSort::StopAxis => axis(AxisAsk::Stop)?,
            RequestSort::RunAxis => axis(AxisAsk::Run { speed: values[0] })?,
            RequestSort::SetDriveMode => RequestKind::SetDriveMode {
                wheel: argument.try_into().ok()?,
                mode: drive_mode_of_code(values[0])?,
            },
        };
        Some(Some(Request { kind, valid_until_ns }))
    }
}

/// The number by which a recording holds what a drive is commanded by.
fn code_of_drive_mode(mode: Option<DriveMode>) -> f64 {
    match mode {
        None => 0.0,
        Some(DriveMode::Speed) => 1.0,
        Some(DriveMode::Torque) => 2.0,
    }
}

fn drive_mode_of_code(code: f64) -> Option<Option<DriveMode>> {
    let modes = [None, Some(DriveMode::Speed), Some(DriveMode::Torque)];
    modes.into_iter().find(|mode| code_of_drive_mode(*mode) == code)
}

/// The mode of a number that a recording holds.
fn mode_of_code(code: f64) -> Option<AxisMode> {
    [AxisMode::Csp, AxisMode::Pp, AxisMode::Pv].into_iter().find(|mode| f64::from(mode.mode().code()) == code)
}

/// What became of a cycle's request.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RequestAnswer {
    /// There was none.
    #[default]
    None,
    /// It is carried out.
    Taken,
    /// It came after its validity.
    TooOld,
    /// It doesn't fit the phase in which the robot is.
    WrongPhase,
    /// Its value isn't finite, or outside what is allowed, or there is nothing that it could be about.
    Refused,
    /// The platform stands too far from the reference's start.
    TooFar,
    /// Nobody knows where the platform stands.
    PoseUnknown,
    /// A drive takes its torque limit at start-up only.
    AtStartUpOnly,
    /// An obstacle stands where the motion would begin, away from where the platform stands, or end.
    Blocked,
    /// The input that stops is set, or isn't heard.
    StopInput,
    /// The input that enables is off, or isn't heard.
    EnableInput,
    /// The axis was never homed, or not since its drive was lost.
    NotHomed,
    /// The axis looks for its home.
    Homing,
    /// The drive can't follow every control law of the robot so.
    DriveMode,
    /// The platform wouldn't fit inside the fence there, or on the way there from the motion that is under way.
    OutsideFence,
    /// The platform moves so that nothing leads onto the reference's beginning.
    Moving,
}

coded!(RequestAnswer {
    None = 0,
    Taken = 1,
    TooOld = 2,
    WrongPhase = 3,
    Refused = 4,
    TooFar = 5,
    PoseUnknown = 6,
    Blocked = 7,
    AtStartUpOnly = 8,
    StopInput = 9,
    EnableInput = 10,
    NotHomed = 11,
    Homing = 12,
    DriveMode = 13,
    OutsideFence = 14,
    Moving = 15,
});
