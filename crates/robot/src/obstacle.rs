//! What a robot keeps away from.

/// Nothing on the floor is larger, faster or further away, m and m/s.
pub(crate) const GREATEST: f64 = 1e6;
/// Most obstacles at a time.
pub const MAX_OBSTACLES: usize = 16;

/// A circle on the floor that moves straight on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Obstacle {
    /// Its centre in odom, m.
    pub centre_m: [f64; 2],
    /// Its radius, m.
    pub radius_m: f64,
    /// Its speed in odom, m/s.
    pub velocity_m_s: [f64; 2],
}

impl Obstacle {
    /// Whether its numbers are finite and not absurd, and its radius isn't negative.
    pub fn is_possible(&self) -> bool {
        let mut numbers = self.centre_m.iter().chain(&self.velocity_m_s);
        numbers.all(|value| value.abs() <= GREATEST) && (0.0..=GREATEST).contains(&self.radius_m)
    }

    /// Where its centre is after a time, s, in odom, m.
    pub fn centre_after_m(&self, time_s: f64) -> [f64; 2] {
        [0, 1].map(|axis| self.centre_m[axis] + self.velocity_m_s[axis] * time_s)
    }
}
