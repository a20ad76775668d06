//! What is asked of a running robot: at most one request a cycle, recorded with it.

use omnibase_platform::{Pose2, Twist2};

use super::{StopCategory, coded};
use crate::guard::Obstacle;

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
    /// Follow the reference from its start.
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
    /// Change a setting.
    Set {
        /// Its place in [`Robot::settings`](crate::Robot::settings).
        index: u32,
        /// Its new value.
        value: f64,
        /// With which others.
        apply: Apply,
    },
    /// Let the reference come to a halt on its path.
    Pause,
    /// Go on with a reference that was left: first the straight way back to where it was left.
    Resume,
    /// Go the straight way to a pose in odom, from rest to rest.
    GoTo {
        /// The pose; its heading isn't wrapped.
        odom_from_body: Pose2,
    },
    /// Take the reference that was [offered](crate::Robot::offer_reference) in place of the present one.
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
}

/// When a changed setting acts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Apply {
    /// In this cycle, with all that waited for it: all of them, or none where one of them is refused.
    #[default]
    Now,
    /// With the next one that acts.
    WithNext,
}

coded!(Apply { Now = 0, WithNext = 1 });

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
            RequestKind::Enable => (1, 0, [0.0; 6]),
            RequestKind::Track => (2, 0, [0.0; 6]),
            RequestKind::Stop(category) => (3, category.code(), [0.0; 6]),
            RequestKind::Acknowledge => (4, 0, [0.0; 6]),
            RequestKind::Velocity { twist, frame } => {
                (5, frame.code(), [twist.vx_m_s, twist.vy_m_s, twist.w_rad_s, 0.0, 0.0, 0.0])
            }
            RequestKind::Set { index, value, apply } => {
                (6, u64::from(index) | apply.code() << 32, [value, 0.0, 0.0, 0.0, 0.0, 0.0])
            }
            RequestKind::SwitchController { index } => (7, index.into(), [0.0; 6]),
            RequestKind::Pause => (8, 0, [0.0; 6]),
            RequestKind::Resume => (9, 0, [0.0; 6]),
            RequestKind::GoTo { odom_from_body: Pose2 { x_m, y_m, heading_rad } } => {
                (10, 0, [x_m, y_m, heading_rad, 0.0, 0.0, 0.0])
            }
            RequestKind::UseReference { number } => (11, number.into(), [0.0; 6]),
            RequestKind::SetObstacle { index, obstacle } => {
                let Obstacle { centre_m: [x, y], radius_m, velocity_m_s: [vx, vy] } = obstacle;
                (12, index.into(), [x, y, radius_m, vx, vy, 0.0])
            }
            RequestKind::RemoveObstacle { index } => (13, index.into(), [0.0; 6]),
        };
        ([sort, argument, valid_until_ns], values)
    }

    /// The request of such numbers: `None` where no request has them, `Some(None)` where there was none.
    pub fn from_codes(
        [sort, argument, valid_until_ns]: [u64; 3],
        values: [f64; 6],
    ) -> Option<Option<Request>> {
        let kind = match sort {
            0 => return Some(None),
            1 => RequestKind::Enable,
            2 => RequestKind::Track,
            3 => RequestKind::Stop(StopCategory::from_code(argument)?),
            4 => RequestKind::Acknowledge,
            5 => {
                let [vx_m_s, vy_m_s, w_rad_s, ..] = values;
                RequestKind::Velocity {
                    twist: Twist2 { vx_m_s, vy_m_s, w_rad_s },
                    frame: Frame::from_code(argument)?,
                }
            }
            6 => RequestKind::Set {
                index: argument as u32,
                value: values[0],
                apply: Apply::from_code(argument >> 32)?,
            },
            7 => RequestKind::SwitchController { index: argument.try_into().ok()? },
            8 => RequestKind::Pause,
            9 => RequestKind::Resume,
            10 => {
                let [x_m, y_m, heading_rad, ..] = values;
                RequestKind::GoTo { odom_from_body: Pose2 { x_m, y_m, heading_rad } }
            }
            11 => RequestKind::UseReference { number: argument.try_into().ok()? },
            12 => {
                let [x, y, radius_m, vx, vy, _] = values;
                RequestKind::SetObstacle {
                    index: argument.try_into().ok()?,
                    obstacle: Obstacle { centre_m: [x, y], radius_m, velocity_m_s: [vx, vy] },
                }
            }
            13 => RequestKind::RemoveObstacle { index: argument.try_into().ok()? },
            _ => return None,
        };
        Some(Some(Request { kind, valid_until_ns }))
    }
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
}

coded!(RequestAnswer { None = 0, Taken = 1, TooOld = 2, WrongPhase = 3, Refused = 4, TooFar = 5 });
