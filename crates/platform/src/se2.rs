//! Poses, twists and wrenches in the plane (the group SE(2)).

use std::f64::consts::{PI, TAU};

/// An angle brought into (−π, π].
pub fn wrap_angle_rad(angle_rad: f64) -> f64 {
    if angle_rad > -PI && angle_rad <= PI {
        return angle_rad;
    }
    let wrapped = angle_rad.rem_euclid(TAU);
    if wrapped > PI { wrapped - TAU } else { wrapped }
}

/// The length of a vector, in its unit: √(x² + y²), to within a rounding or two, without `hypot`'s cost; far beyond and below what
/// anything measures, where squares over- or underflow, by it.
#[inline]
pub fn length([x, y]: [f64; 2]) -> f64 {
    let square = x * x + y * y;
    if square > 1e-280 && square < 1e280 { square.sqrt() } else { length_beyond_squares([x, y]) }
}

#[cold]
fn length_beyond_squares([x, y]: [f64; 2]) -> f64 {
    if x == 0.0 && y == 0.0 { 0.0 } else { x.hypot(y) }
}

/// Where a frame stands in another one: `odom_from_base` takes points of base to odom.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose2 {
    /// Along x, in m.
    pub x_m: f64,
    /// Along y, in m.
    pub y_m: f64,
    /// Counter-clockwise, in rad.
    pub heading_rad: f64,
}

impl Pose2 {
    /// A pose from its three numbers.
    pub const fn new(x_m: f64, y_m: f64, heading_rad: f64) -> Pose2 {
        Pose2 { x_m, y_m, heading_rad }
    }

    /// `a_from_b.then(b_from_c)` is `a_from_c`; the heading is not wrapped.
    #[must_use]
    pub fn then(self, other: Pose2) -> Pose2 {
        let (sin, cos) = self.heading_rad.sin_cos();
        Pose2 {
            x_m: self.x_m + cos * other.x_m - sin * other.y_m,
            y_m: self.y_m + sin * other.x_m + cos * other.y_m,
            heading_rad: self.heading_rad + other.heading_rad,
        }
    }

    /// The way back: `a_from_b.inverse()` is `b_from_a`.
    #[must_use]
    pub fn inverse(self) -> Pose2 {
        let (sin, cos) = self.heading_rad.sin_cos();
        Pose2 {
            x_m: -(cos * self.x_m + sin * self.y_m),
            y_m: sin * self.x_m - cos * self.y_m,
            heading_rad: -self.heading_rad,
        }
    }

    /// This pose after the body moved by `step` at a constant twist: the exact arc; the heading is not wrapped.
    #[must_use]
    pub fn moved_by(self, step: BodyStep) -> Pose2 {
        self.then(step.exp())
    }

    /// The step at a constant twist that leads here from the origin: the logarithm of SE(2), for less than half a turn.
    ///
    /// With h = θ/2: x = h·cot(h)·x' + h·y' and y = −h·x' + h·cot(h)·y'.
    pub fn log(self) -> BodyStep {
        let half = 0.5 * self.heading_rad;
        // The first term left out is h⁶·2/945, 3e-17.
        let along = if half.abs() < 5e-3 {
            let square = half * half;
            1.0 - square / 3.0 * (1.0 + square / 15.0)
        } else {
            half / half.tan()
        };
        BodyStep {
            x_m: along * self.x_m + half * self.y_m,
            y_m: along * self.y_m - half * self.x_m,
            angle_rad: self.heading_rad,
        }
    }

    /// The distance between the two origins, in m.
    pub fn distance_m(self, other: Pose2) -> f64 {
        length([self.x_m - other.x_m, self.y_m - other.y_m])
    }

    /// This pose with its heading brought into (−π, π].
    #[must_use]
    pub fn wrapped(self) -> Pose2 {
        Pose2 { heading_rad: wrap_angle_rad(self.heading_rad), ..self }
    }

    /// Whether every number is finite.
    pub fn is_finite(self) -> bool {
        self.x_m.is_finite() && self.y_m.is_finite() && self.heading_rad.is_finite()
    }
}

/// A speed of the platform; its variable's name says in which frame (`twist_in_base`, `twist_in_odom`).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist2 {
    /// Along x, in m/s.
    pub vx_m_s: f64,
    /// Along y, in m/s.
    pub vy_m_s: f64,
    /// Counter-clockwise, in rad/s.
    pub w_rad_s: f64,
}

impl Twist2 {
    /// A twist from its three numbers.
    pub const fn new(vx_m_s: f64, vy_m_s: f64, w_rad_s: f64) -> Twist2 {
        Twist2 { vx_m_s, vy_m_s, w_rad_s }
    }

    /// This velocity with axes turned: `twist_in_base.rotated(heading)` is `twist_in_odom`; the point stays.
    #[must_use]
    pub fn rotated(self, angle_rad: f64) -> Twist2 {
        let (sin, cos) = angle_rad.sin_cos();
        Twist2 {
            vx_m_s: cos * self.vx_m_s - sin * self.vy_m_s,
            vy_m_s: sin * self.vx_m_s + cos * self.vy_m_s,
            w_rad_s: self.w_rad_s,
        }
    }

    /// This body's twist at the origin and in the axes of another frame fixed to it (a sensor, a tool).
    #[must_use]
    pub fn at(self, base_from_frame: Pose2) -> Twist2 {
        Twist2 {
            vx_m_s: self.vx_m_s - self.w_rad_s * base_from_frame.y_m,
            vy_m_s: self.vy_m_s + self.w_rad_s * base_from_frame.x_m,
            w_rad_s: self.w_rad_s,
        }
        .rotated(-base_from_frame.heading_rad)
    }

    /// The speed along the ground, in m/s.
    pub fn speed_m_s(self) -> f64 {
        length([self.vx_m_s, self.vy_m_s])
    }

    /// This twist times a factor.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Twist2 {
        Twist2::new(self.vx_m_s * factor, self.vy_m_s * factor, self.w_rad_s * factor)
    }

    /// The way of a body that keeps this twist (in base) for a time.
    pub fn over(self, time_s: f64) -> BodyStep {
        BodyStep { x_m: self.vx_m_s * time_s, y_m: self.vy_m_s * time_s, angle_rad: self.w_rad_s * time_s }
    }

    /// Whether every number is finite.
    pub fn is_finite(self) -> bool {
        self.vx_m_s.is_finite() && self.vy_m_s.is_finite() && self.w_rad_s.is_finite()
    }
}

/// Force and torque on the platform; its variable's name says in which frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench2 {
    /// Along x, in N.
    pub fx_n: f64,
    /// Along y, in N.
    pub fy_n: f64,
    /// Counter-clockwise, in N·m.
    pub torque_nm: f64,
}

impl Wrench2 {
    /// A wrench from its three numbers.
    pub const fn new(fx_n: f64, fy_n: f64, torque_nm: f64) -> Wrench2 {
        Wrench2 { fx_n, fy_n, torque_nm }
    }

    /// This wrench with axes turned: `wrench_in_odom.rotated(-heading)` is `wrench_in_base`.
    #[must_use]
    pub fn rotated(self, angle_rad: f64) -> Wrench2 {
        let (sin, cos) = angle_rad.sin_cos();
        Wrench2 {
            fx_n: cos * self.fx_n - sin * self.fy_n,
            fy_n: sin * self.fx_n + cos * self.fy_n,
            torque_nm: self.torque_nm,
        }
    }
}

/// A small way of the body in its own axes: a twist times a time (the algebra se(2)).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BodyStep {
    /// Along the body's x, in m.
    pub x_m: f64,
    /// Along the body's y, in m.
    pub y_m: f64,
    /// Counter-clockwise, in rad.
    pub angle_rad: f64,
}

impl BodyStep {
    /// A step from its three numbers.
    pub const fn new(x_m: f64, y_m: f64, angle_rad: f64) -> BodyStep {
        BodyStep { x_m, y_m, angle_rad }
    }

    /// Where the body ends if its twist is constant during the step: the exponential of SE(2).
    ///
    /// With θ the angle: x' = x·sinθ/θ − y·(1−cosθ)/θ and y' = x·(1−cosθ)/θ + y·sinθ/θ. Below 0.01 rad by
    /// series: the first term left out is θ⁶/5040, 2e-16.
    pub fn exp(self) -> Pose2 {
        let angle = self.angle_rad;
        let (along, across) = if angle.abs() < 1e-2 {
            let square = angle * angle;
            (
                1.0 - square / 6.0 * (1.0 - square / 20.0),
                angle / 2.0 * (1.0 - square / 12.0 * (1.0 - square / 30.0)),
            )
        } else {
            let half_sin = (angle / 2.0).sin();
            (angle.sin() / angle, 2.0 * half_sin * half_sin / angle)
        };
        Pose2 {
            x_m: along * self.x_m - across * self.y_m,
            y_m: across * self.x_m + along * self.y_m,
            heading_rad: angle,
        }
    }

    /// The length of the way, in m.
    pub fn distance_m(self) -> f64 {
        length([self.x_m, self.y_m])
    }
}

/// Setpoint minus pose, in odom, (m, m, rad); the angle the short way round.
pub fn pose_error(wished: &Pose2, found: &Pose2) -> [f64; 3] {
    [wished.x_m - found.x_m, wished.y_m - found.y_m, wrap_angle_rad(wished.heading_rad - found.heading_rad)]
}

/// A twist's numbers, (m/s, m/s, rad/s).
pub fn axes(twist: &Twist2) -> [f64; 3] {
    [twist.vx_m_s, twist.vy_m_s, twist.w_rad_s]
}

/// What rounding makes of a covariance that knows nothing in some direction, as a part of its variances' product.
const OF_ROUNDING: f64 = 1e-9;

/// Why xx, xy, xψ, yy, yψ, ψψ are no pose's covariance, which has finite numbers and no variance below 0 in any direction: what is
/// wrong, and its value. `None` where they are one.
pub fn covariance_fault(all: &[f64; 6]) -> Option<(&'static str, f64)> {
    let [xx, xy, xh, yy, yh, hh] = *all;
    if let Some(found) = all.iter().find(|number| !number.is_finite()) {
        return Some(("covariance", *found));
    }
    if let Some(found) = [xx, yy, hh].into_iter().find(|variance| *variance < 0.0) {
        return Some(("a variance", found));
    }
    let pairs = [(xy, xx * yy), (xh, xx * hh), (yh, yy * hh)];
    if let Some((found, _)) = pairs.into_iter().find(|(both, most)| both * both > *most) {
        return Some(("a covariance beside its variances", found));
    }
    // Three pairs that can be need not be possible together.
    let determinant = xx * (yy * hh - yh * yh) - xy * (xy * hh - yh * xh) + xh * (xy * yh - yy * xh);
    (determinant < -OF_ROUNDING * xx * yy * hh).then_some(("a covariance's determinant", determinant))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_wrap_into_the_half_open_turn() {
        for (angle, expected) in [
            (0.0, 0.0),
            (PI, PI),
            (-PI, PI),
            (3.0 * PI, PI),
            (-0.5 * PI, -0.5 * PI),
            (1.5 * PI, -0.5 * PI),
            (100.0 * TAU + 1.0, 1.0),
        ] {
            assert!((wrap_angle_rad(angle) - expected).abs() < 1e-12, "{angle}");
        }
        assert!(wrap_angle_rad(f64::NAN).is_nan());
    }

    #[test]
    fn a_quarter_arc_ends_where_geometry_says() {
        let end = BodyStep::new(PI / 2.0, 0.0, PI / 2.0).exp();
        assert!((end.x_m - 1.0).abs() < 1e-15 && (end.y_m - 1.0).abs() < 1e-15);
    }

    #[test]
    fn the_series_meets_the_closed_form() {
        for angle in [0.0099999, -0.0099999] {
            let series = BodyStep::new(1.0, 2.0, angle).exp();
            let along = f64::sin(angle) / angle;
            let across = 2.0 * f64::sin(angle / 2.0).powi(2) / angle;
            assert!((series.x_m - (along - 2.0 * across)).abs() < 1e-15, "{angle}");
            assert!((series.y_m - (across + 2.0 * along)).abs() < 1e-15, "{angle}");
        }
    }

    #[test]
    fn a_step_comes_back_from_where_it_leads() {
        for angle in [0.0, 1e-9, -0.0099999, 0.0100001, 0.5, -3.1] {
            let back = BodyStep::new(1.0, -2.0, angle).exp().log();
            let off = (back.x_m - 1.0).abs() + (back.y_m + 2.0).abs() + (back.angle_rad - angle).abs();
            assert!(off < 1e-14, "{angle}: {back:?}");
        }
    }

    #[test]
    fn a_pose_and_its_inverse_cancel() {
        let pose = Pose2::new(1.0, -2.0, 2.5);
        let nothing = pose.then(pose.inverse());
        assert!(nothing.distance_m(Pose2::default()) < 1e-15 && nothing.heading_rad.abs() < 1e-15);
    }
}
