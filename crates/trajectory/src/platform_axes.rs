//! A motion in the platform's own axes: where a trajectory goes along x, the platform goes forward, however it has turned.

use omnibase_platform::{Pose2, Twist2};

use crate::trajectory::{Setpoint, Trajectory};

/// The greatest width of a step of the integration, in s.
const STEP_S: f64 = 0.02;
/// The longest motion, in s: beyond it the steps would take too much memory.
pub const LONGEST_TURNED_S: f64 = 2000.0;
/// Nodes and weights of Gauss and Legendre's rule of three points on [0, 1].
const GAUSS: [(f64, f64); 3] =
    [(0.112_701_665_379_258_3, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];

/// A trajectory whose velocity is in the platform's axes: p' = Rot(ψ)·v, with v and ψ those of the trajectory itself.
#[derive(Clone, Debug)]
pub struct InPlatformAxes<T> {
    trajectory: T,
    step_s: f64,
    /// Where it is at the beginning of each step, m.
    places: Vec<[f64; 2]>,
}

impl<T: Trajectory> InPlatformAxes<T> {
    /// The motion; `None` for one without an end, or longer than [`LONGEST_TURNED_S`].
    pub fn new(trajectory: T) -> Option<Self> {
        let duration_s = trajectory.duration_s();
        if duration_s.is_nan() || duration_s > LONGEST_TURNED_S {
            return None;
        }
        let steps = (duration_s / STEP_S).ceil().max(1.0);
        let first = trajectory.sample(0.0).odom_from_base;
        let mut motion =
            InPlatformAxes { trajectory, step_s: duration_s / steps, places: vec![[first.x_m, first.y_m]] };
        for step in 1..=steps as usize {
            let place = motion.place(motion.step_s * step as f64, step - 1);
            motion.places.push(place);
        }
        Some(motion)
    }

    /// Where it is at a time inside a step, m.
    fn place(&self, time_s: f64, step: usize) -> [f64; 2] {
        let from_s = self.step_s * step as f64;
        let way_s = time_s - from_s;
        let mut place = self.places[step];
        for (node, weight) in GAUSS {
            let velocity = turned(&self.trajectory.sample(from_s + node * way_s)).twist_in_odom;
            place[0] += weight * way_s * velocity.vx_m_s;
            place[1] += weight * way_s * velocity.vy_m_s;
        }
        place
    }
}

impl<T: Trajectory> Trajectory for InPlatformAxes<T> {
    fn duration_s(&self) -> f64 {
        self.trajectory.duration_s()
    }

    fn sample(&self, time_s: f64) -> Setpoint {
        let setpoint = turned(&self.trajectory.sample(time_s));
        let inside_s = if time_s > 0.0 { time_s.min(self.duration_s()) } else { 0.0 };
        let step = ((inside_s / self.step_s) as usize).min(self.places.len() - 1);
        let [x_m, y_m] = self.place(inside_s, step);
        Setpoint { odom_from_base: Pose2 { x_m, y_m, ..setpoint.odom_from_base }, ..setpoint }
    }

    fn breaks_s(&self) -> Vec<f64> {
        self.trajectory.breaks_s()
    }
}

/// A setpoint whose derivatives were in the platform's axes, in odom; its place is left as it is.
fn turned(own: &Setpoint) -> Setpoint {
    let [v, a, j] = [own.twist_in_odom, own.acceleration_in_odom, own.jerk_in_odom];
    let [w, dw] = [v.w_rad_s, a.w_rad_s];
    let heading_rad = own.odom_from_base.heading_rad;
    // d/dt Rot(ψ)·u = Rot(ψ)·(u' + ω×u), once for the acceleration and twice for the jerk.
    let acceleration = Twist2::new(a.vx_m_s - w * v.vy_m_s, a.vy_m_s + w * v.vx_m_s, dw);
    let jerk = Twist2::new(
        j.vx_m_s - 2.0 * w * a.vy_m_s - dw * v.vy_m_s - w * w * v.vx_m_s,
        j.vy_m_s + 2.0 * w * a.vx_m_s + dw * v.vx_m_s - w * w * v.vy_m_s,
        j.w_rad_s,
    );
    Setpoint {
        twist_in_odom: v.rotated(heading_rad),
        acceleration_in_odom: acceleration.rotated(heading_rad),
        jerk_in_odom: jerk.rotated(heading_rad),
        ..*own
    }
}
