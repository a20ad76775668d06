//! Omnidirectional platforms: wheels, kinematics, odometry and the body's dynamics.
//!
//! - [`se2`]: [`Pose2`], [`Twist2`], [`Wrench2`] and [`BodyStep`]: motion in the plane, with exact arcs.
//! - [`wheel`]: [`Wheel`], and [`PerWheel`], the values of all wheels on the stack.
//! - [`layout`]: named layouts, and why a layout cannot be driven.
//! - [`kinematics`]: [`Kinematics`], between the body and its wheels, for speeds and for forces.
//! - [`tread`]: [`Treads`], how much each wheel resists, by which wheels that contradict each other share it out.
//! - [`odometry`]: [`Odometry`], from raw encoder counts to a pose with its covariance.
//! - [`dynamics`]: [`DynamicsModel`], what a controller believes of mass, inertia and friction.
//!
//! Frames are those of REP-103 and REP-105: `base` (base_link) has x forward, y left, yaw counter-clockwise;
//! `odom` is fixed, its origin the pose at start. Units are SI. Only set-up allocates; what runs in each cycle
//! works on the stack and cannot fail on numbers that are finite.
#![forbid(unsafe_code)]

pub mod dynamics;
pub mod kinematics;
pub mod layout;
pub mod odometry;
pub mod se2;
pub mod tread;
pub mod wheel;

pub use dynamics::{DynamicsError, DynamicsModel, Friction};
pub use kinematics::{Kinematics, MeasuredTwist};
pub use layout::LayoutError;
pub use odometry::{
    CovarianceSettings, GeometrySigmas, Odometry, OdometryError, OdometrySettings, OdometryState, PoseGrowth,
    Regime,
};
pub use se2::{BodyStep, Pose2, Twist2, Wrench2, axes, covariance_fault, length, pose_error, wrap_angle_rad};
pub use tread::Treads;
pub use wheel::{MAX_WHEELS, PerWheel, Wheel};
