//! Control laws.

mod adaptive_torque;
mod disturbance_observer;
mod speed;
mod torque_design;
mod torque_law;

use omnibase_platform::{PerWheel, Wrench2};

use crate::config::Limits;
use crate::registry::{Kind, Registry, optional};
use crate::signals::{Commands, Quantity};

pub use adaptive_torque::AdaptiveTorque;
pub use disturbance_observer::DisturbanceObserver;
pub use speed::{ClosedLoopSpeed, OpenLoop, WheelSpeeds};
pub use torque_design::SlowForce;

/// From the instant that was measured to the middle of the time for which the command stands, in periods: one until
/// the measurement is read, one until the command arrives, half of the period in which it holds.
const LEAD_PERIODS: f64 = 2.5;

/// Registers the built-in controllers.
pub fn register(registry: &mut Registry) {
    let controllers = &mut registry.controllers;
    controllers.add(
        Kind {
            name: "open_loop",
            meaning: "Wheel speeds by the reference alone; the pose is never looked at",
            keys: Vec::new(),
        },
        OpenLoop::new,
    );
    controllers.add(
        Kind {
            name: "closed_loop_speed",
            meaning: "Wheel speeds by the reference and the pose error",
            keys: vec![optional("kp_1_s")],
        },
        ClosedLoopSpeed::new,
    );
    controllers.add(adaptive_torque::kind(), AdaptiveTorque::new);
    controllers.add(disturbance_observer::kind(), DisturbanceObserver::new);
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

/// A speed in odom within the platform's limits, its direction kept, and whether it was there already: a correction
/// never drives the platform past its own limits, however large the error.
fn within_speed(speed: [f64; 3], limits: &Limits) -> ([f64; 3], Correction) {
    let [x, y, turn] = speed;
    let factor = (limits.speed_m_s / x.hypot(y)).min(1.0);
    let within = [factor * x, factor * y, turn.clamp(-limits.turn_speed_rad_s, limits.turn_speed_rad_s)];
    (within, if within == speed { Correction::Whole } else { Correction::Cut })
}

/// Whether a correction stands as the law asks for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Correction {
    Whole,
    Cut,
}

fn wrench(axes: [f64; 3]) -> Wrench2 {
    Wrench2::new(axes[0], axes[1], axes[2])
}
