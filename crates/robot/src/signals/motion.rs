//! Where the platform is and where it shall be.

use omnibase_platform::{Pose2, Regime, Twist2};

use super::coded;

/// What is known about the platform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlatformState {
    /// Pose of base_link in odom.
    pub odom_from_body: Pose2,
    /// Speed, in base_link.
    pub twist_in_body: Twist2,
    /// By how much that speed lags behind the pose, s: what its filter costs.
    pub twist_age_s: f64,
    /// Covariance of x, y (m²) and heading (rad²), in odom: xx, xy, xψ, yy, yψ, ψψ.
    pub covariance: [f64; 6],
    /// How the pose was found.
    pub regime: Regime,
    /// Part of the wheels' speeds that no motion of a rigid body explains, m/s.
    pub slip_residual_m_s: f64,
    /// The pose is known as well as the covariance says; not where wheels rolled that nobody read, until somebody sets
    /// it or a sensor tells it.
    pub pose_known: bool,
}

impl Default for PlatformState {
    /// At rest at the origin of odom.
    fn default() -> Self {
        PlatformState {
            odom_from_body: Pose2::default(),
            twist_in_body: Twist2::default(),
            twist_age_s: 0.0,
            covariance: [0.0; 6],
            regime: Regime::Standstill,
            slip_residual_m_s: 0.0,
            pose_known: true,
        }
    }
}

impl PlatformState {
    /// Speed, in odom.
    pub fn twist_in_odom(&self) -> Twist2 {
        self.twist_in_body.rotated(self.odom_from_body.heading_rad)
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.odom_from_body.is_finite()
            && self.twist_in_body.is_finite()
            && self.twist_age_s.is_finite()
            && self.covariance.iter().all(|value| value.is_finite())
            && self.slip_residual_m_s.is_finite()
    }
}

/// Where the platform shall be, and how it shall move there. All in odom.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Setpoint {
    /// Pose.
    pub odom_from_body: Pose2,
    /// Speed.
    pub twist_in_odom: Twist2,
    /// Acceleration, m/s² and rad/s².
    pub acceleration_in_odom: Twist2,
    /// What the reference is doing.
    pub status: ReferenceStatus,
}

impl Setpoint {
    /// At rest in a place.
    pub fn at_rest(odom_from_body: Pose2) -> Self {
        Setpoint { odom_from_body, ..Default::default() }
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.odom_from_body.is_finite()
            && self.twist_in_odom.is_finite()
            && self.acceleration_in_odom.is_finite()
    }
}

/// What a reference is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ReferenceStatus {
    /// At rest, for as long as nothing else is wished.
    #[default]
    Resting,
    /// Under way.
    Moving,
    /// At its end, at rest.
    Finished,
}

/// What a tracking robot follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Course {
    /// Its reference.
    #[default]
    Reference,
    /// Velocity commands.
    Velocity,
    /// The way to a pose.
    Way,
    /// The way onto its reference, without a stop: at its beginning, or from where obstacles kept it.
    Onto,
}

coded!(Course { Reference = 0, Velocity = 1, Way = 2, Onto = 3 });

coded!(ReferenceStatus { Resting = 0, Moving = 1, Finished = 2 });
