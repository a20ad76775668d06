//! Motion of a platform over time: planned, checked against limits, and limited in every cycle.
//!
//! - [`trajectory`]: [`Trajectory`] and its [`Setpoint`]: pose, twist, acceleration and jerk at a time.
//! - [`path_points`]: files of `(t, x, y, θ)`, with errors by line and column.
//! - [`interpolation`]: cubic, quintic, C2 spline and B-spline through [`PathPoints`]; [`polynomial`] below it.
//! - [`shape`]: circle, ellipse, Archimedes spiral and figure of eight, from rest to rest or without an end.
//! - [`platform_axes`]: a motion whose velocity is in the platform's own axes.
//! - [`corrected`]: [`Corrected`], a motion with what repeats taught added to it.
//! - [`geometry`]: ways without times ([`GeometricPath`]): smooth through points, corners cut within a tolerance.
//! - [`curve`]: B-splines of any degree with weights ([`Nurbs`]), as points of a way.
//! - [`fastest`]: a way in the shortest time ([`FastestTrajectory`]), with a free heading too, and passing its ends with speeds; [`reach`] below it.
//! - [`point_to_point`]: [`PointToPoint`], from any state to any in the shortest time.
//! - [`limits`]: [`Limits`], what a trajectory needs ([`Peaks`]), refusal beforehand, and retiming.
//! - [`limiter`]: [`TwistLimiter`] holds speed, acceleration and jerk in every cycle, whatever is commanded.
//! - [`playback`]: [`Playback`] pauses, resumes and reverses a trajectory without leaving its path or its limits.
//!
//! Units are SI; poses are in odom, translation is limited as a vector. Planning allocates; sampling, limiting and
//! playing do not.
#![forbid(unsafe_code)]

pub mod corrected;
pub mod curve;
pub mod fastest;
pub mod geometry;
pub mod interpolation;
pub mod limiter;
pub mod limits;
pub mod path_points;
pub mod platform_axes;
pub mod playback;
pub mod point_to_point;
pub mod polynomial;
pub mod reach;
pub mod shape;
pub mod trajectory;

pub use corrected::{Corrected, Correction, CorrectionError};
pub use curve::{CurveHeading, Nurbs, NurbsError};
pub use fastest::{FastestError, FastestTrajectory, Passing, PlatformBounds, Turned};
pub use geometry::{GeometricPath, Joining, PiecewisePath, ShapePath};
pub use interpolation::{Interpolation, PointTrajectory, SpeedRule};
pub use limiter::{LimitedTwist, TwistLimiter};
pub use limits::{Limits, LimitsError, Peaks, Refusal};
pub use path_points::{PathPoint, PathPoints, PathPointsError};
pub use platform_axes::InPlatformAxes;
pub use playback::{Playback, PlaybackError};
pub use point_to_point::{NoMotion, PointToPoint};
pub use shape::{Heading, Shape, ShapeError, ShapeTrajectory};
pub use trajectory::{LONGEST_S, Placed, Setpoint, Trajectory};
