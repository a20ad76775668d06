//! Body, wheels and floor of another make: what another program says of them takes the place of [`crate::body`]'s own.

use crate::pose::{Pose, Twist};

/// How everything moves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    /// Pose of `base_link` in the fixed frame.
    pub pose: Pose,
    /// Twist in `base_link`.
    pub twist_in_body: Twist,
    /// Angle turned since the start, rad, and speed, rad/s, of each wheel.
    pub wheels: Vec<[f64; 2]>,
}

/// Mechanics that something else computes. Motors and drives stay the machine's own.
pub trait Mechanics: std::fmt::Debug + Send {
    /// Moves on by the machine's step with these torques of the motors at their wheels, N·m, and says how everything moves
    /// then.
    fn step(&mut self, torques_n_m: &[f64]) -> &Motion;
}
