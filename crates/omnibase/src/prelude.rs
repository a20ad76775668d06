//! What stages are written with: their traits, the signals that flow between them, and how a kind is registered.

pub use omnibase_platform::{Kinematics, PerWheel, Pose2, Twist2, Wrench2, axes, pose_error, wrap_angle_rad};
pub use omnibase_robot::Ability;
pub use omnibase_robot::RobotPlan;
pub use omnibase_robot::config::{DrivePlan, Limits, Problem, ReferenceTable};
pub use omnibase_robot::controllers::{WheelSpeeds, saturated};
pub use omnibase_robot::devices::Cia402Device;
pub use omnibase_robot::registry::{DeviceDefaults, Kind, Made, Registry, needed, optional};
pub use omnibase_robot::signals::{
    Commands, CycleTime, DriveMeasurement, DriveProgress, Exchange, PlatformState, Quantity, ReferenceStatus,
    Setpoint,
};
pub use omnibase_robot::stages::{Controller, Device, DriveCommand, Estimator, Gain, Observation, Reference};
