//! The simplest odometry that works: each cycle's motion at the heading of its middle.

use omnibase_platform::{Kinematics, PerWheel, Pose2};
use omnibase_robot::config::RobotPlan;
use omnibase_robot::registry::{Kind, Registry};
use omnibase_robot::signals::{Exchange, PlatformState};
use omnibase_robot::stages::{Estimator, Observation};

/// Registers it.
pub fn register(registry: &mut Registry) {
    let kind = Kind { name: "midpoint_odometry", meaning: "Odometry by the midpoint rule", keys: Vec::new() };
    registry.estimators.add(kind, Box::new(|plan| Ok(Box::new(MidpointOdometry::new(plan)))));
}

/// Odometry by the midpoint rule, without covariance, regimes or slip; speeds as the drives measured them.
#[derive(Clone, Debug)]
pub struct MidpointOdometry {
    kinematics: Kinematics,
    state: PlatformState,
}

impl MidpointOdometry {
    /// Odometry for a plan's wheels.
    pub fn new(plan: &RobotPlan) -> Self {
        MidpointOdometry { kinematics: plan.kinematics.clone(), state: PlatformState::default() }
    }
}

impl Estimator for MidpointOdometry {
    fn reset(&mut self, from: &PlatformState) {
        self.state = *from;
    }

    fn update(&mut self, observation: &Observation<'_>) -> PlatformState {
        if observation.exchange != Exchange::Complete {
            return self.state;
        }
        let drives = observation.measurements.present();
        // B is linear: what it makes of angles is a motion, as what it makes of speeds is a twist.
        let turned = PerWheel::from_fn(drives.len(), |wheel| drives[wheel].increment_rad);
        let moved = self.kinematics.twist(&turned).twist_in_base;
        let Pose2 { x_m, y_m, heading_rad } = self.state.odom_from_body;
        let moved_in_odom = moved.rotated(heading_rad + 0.5 * moved.w_rad_s);
        let speeds = PerWheel::from_fn(drives.len(), |wheel| drives[wheel].speed_rad_s);
        let measured = self.kinematics.twist(&speeds);
        self.state.odom_from_body = Pose2 {
            x_m: x_m + moved_in_odom.vx_m_s,
            y_m: y_m + moved_in_odom.vy_m_s,
            heading_rad: heading_rad + moved.w_rad_s,
        };
        self.state.twist_in_body = measured.twist_in_base;
        self.state
    }
}
