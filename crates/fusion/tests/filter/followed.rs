//! A control law that follows a way by the pose that is believed, whatever that is.

use omnibase_fusion::Filter;
use omnibase_platform::{Pose2, Twist2, wrap_angle_rad};

/// So fast it goes back to its way, 1/s.
const GAIN_1_S: f64 = 5.0;
/// It rests so long at first, and begins to drive within so long, s.
const REST_S: f64 = 2.0;
const BEGINS_S: f64 = 2.0;
/// Pose unknown, it stands: as `unknown_sigma_m` and `unknown_sigma_rad` of a robot's file have it, m and rad.
const UNKNOWN_SIGMA: [f64; 2] = [0.1, 0.1];

/// What wheels are told by a law that wants a pose, and how fast that goes, along map's axes.
pub fn wheels(filter: &Filter, to: Pose2, [vx_m_s, vy_m_s, w_rad_s]: [f64; 3]) -> Twist2 {
    let believed = filter.estimate().map_from_body;
    let to_go = [to.x_m - believed.x_m, to.y_m - believed.y_m];
    let turn_rad = wrap_angle_rad(to.heading_rad - believed.heading_rad);
    let twist = Twist2::new(
        vx_m_s + GAIN_1_S * to_go[0],
        vy_m_s + GAIN_1_S * to_go[1],
        w_rad_s + GAIN_1_S * turn_rad,
    );
    twist.rotated(-believed.heading_rad)
}

/// Where it is to be on an eight of 1.6 m, and how fast that goes: at up to 0.6 m/s, turning to and fro by 0.4 rad.
pub fn eight(time_s: f64) -> (Pose2, [f64; 3]) {
    let since_s = (time_s - REST_S).max(0.0);
    // From rest to its speed.
    let (phase_s, rate) = match since_s < BEGINS_S {
        true => (0.5 * since_s * since_s / BEGINS_S, since_s / BEGINS_S),
        false => (since_s - 0.5 * BEGINS_S, 1.0),
    };
    let waves = [(0.8, 0.6), (0.4, 1.2), (0.4, 0.5)];
    let [x_m, y_m, heading_rad] = waves.map(|(size, rad_s)| size * f64::sin(rad_s * phase_s));
    let speed = waves.map(|(size, rad_s)| rate * size * rad_s * f64::cos(rad_s * phase_s));
    (Pose2::new(x_m, y_m, heading_rad), speed)
}

/// Whether a robot would stand for not knowing where it is.
pub fn is_lost(filter: &Filter) -> bool {
    let [xx, _, _, yy, _, hh] = filter.estimate().covariance;
    xx.max(yy).sqrt() > UNKNOWN_SIGMA[0] || hh.sqrt() > UNKNOWN_SIGMA[1]
}
