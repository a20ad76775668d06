//! The simplest odometry that works: each cycle's motion at the heading of its middle, without covariance or slip.
use omnibase::prelude::*;

/// Its name; it reads no keys.
pub fn kind() -> Kind {
    Kind { name: "midpoint_odometry", meaning: "Odometry by the midpoint rule", keys: Vec::new() }
}

/// The odometry; speeds as the drives measured them.
pub struct MidpointOdometry {
    kinematics: Kinematics,
    state: PlatformState,
}

/// For the wheels of a plan.
pub fn make(plan: &RobotPlan) -> Made<MidpointOdometry> {
    Ok(MidpointOdometry { kinematics: plan.kinematics.clone(), state: PlatformState::default() })
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
        self.state.twist_in_body = self.kinematics.twist(&speeds).twist_in_base;
        self.state.odom_from_body = Pose2 {
            x_m: x_m + moved_in_odom.vx_m_s,
            y_m: y_m + moved_in_odom.vy_m_s,
            heading_rad: heading_rad + moved.w_rad_s,
        };
        self.state
    }
}
