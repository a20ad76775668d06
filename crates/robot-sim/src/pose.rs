//! Planar poses, twists and wrenches, as the simulation speaks of them.

/// Where `base_link` is in the fixed frame; the heading counts on over full turns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// Position along the fixed x axis.
    pub x_m: f64,
    /// Position along the fixed y axis.
    pub y_m: f64,
    /// Counter-clockwise angle from the fixed x axis to the body's x axis.
    pub heading_rad: f64,
}

/// How the body moves: the velocity of the origin of `base_link`, in the axes of `base_link`, and the yaw rate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Twist {
    /// Forward speed.
    pub vx_m_s: f64,
    /// Speed to the left.
    pub vy_m_s: f64,
    /// Yaw rate, counter-clockwise positive.
    pub w_rad_s: f64,
}

/// A push from outside on the centre of mass, in the axes of the fixed frame, and a moment about the vertical.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wrench {
    /// Force along the fixed x axis.
    pub fx_n: f64,
    /// Force along the fixed y axis.
    pub fy_n: f64,
    /// Moment about the vertical, counter-clockwise positive.
    pub moment_n_m: f64,
}
