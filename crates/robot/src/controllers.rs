//! Control laws.

mod adaptive_model_free;
mod adaptive_torque;
mod friction;
mod speed;

use omnibase_platform::{PerWheel, Pose2, Twist2, Wrench2, wrap_angle_rad};

use crate::registry::Registry;
use crate::signals::{Commands, Quantity};

pub use adaptive_model_free::AdaptiveModelFree;
pub use adaptive_torque::AdaptiveTorque;
pub use speed::{ClosedLoopSpeed, OpenLoop};

/// Registers the built-in controllers.
pub fn register(registry: &mut Registry) {
    registry.controller("open_loop", |plan| Ok(Box::new(OpenLoop::new(plan))));
    registry.controller("closed_loop_speed", |plan| Ok(Box::new(ClosedLoopSpeed::new(plan))));
    registry.controller("adaptive_torque", |plan| Ok(Box::new(AdaptiveTorque::new(plan)?)));
    registry.controller("adaptive_model_free", |plan| Ok(Box::new(AdaptiveModelFree::new(plan))));
}

/// Commands whose wheels all keep one limit, scaled as a whole so that the direction of motion is kept.
pub fn saturated(quantity: Quantity, wished: &PerWheel, limit: f64) -> Commands {
    let (values, saturation) = wished.saturated(&wished.map(|_| limit));
    let mut commands = Commands { quantity, saturation, ..Commands::default() };
    for (slot, value) in commands.values.iter_mut().zip(values.iter()) {
        *slot = *value;
    }
    commands
}

/// Setpoint minus pose, in odom; the angle the short way round.
fn pose_error(wished: &Pose2, found: &Pose2) -> [f64; 3] {
    [wished.x_m - found.x_m, wished.y_m - found.y_m, wrap_angle_rad(wished.heading_rad - found.heading_rad)]
}

fn axes(twist: &Twist2) -> [f64; 3] {
    [twist.vx_m_s, twist.vy_m_s, twist.w_rad_s]
}

fn wrench(axes: [f64; 3]) -> Wrench2 {
    Wrench2::new(axes[0], axes[1], axes[2])
}
