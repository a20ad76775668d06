//! What other programs send: named values, poses and velocities, each with its instant.

use omnibase_platform::{Pose2, Twist2};

use super::{Frame, Inputs};

/// Programs that send inputs.
pub const MAX_SOURCES: usize = 8;
/// Values of one of them.
pub const MAX_SOURCE_VALUES: usize = 32;

/// What a source sends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Carries {
    /// Values by name.
    #[default]
    Values,
    /// A pose in odom, with its covariance.
    Pose,
    /// A velocity in this frame.
    Velocity(Frame),
}

impl Carries {
    /// Names and units of its values, where it has some of its own.
    pub fn values(self) -> &'static [(&'static str, &'static str)] {
        match self {
            Carries::Values => &[],
            Carries::Pose => &[
                ("x", "m"),
                ("y", "m"),
                ("heading", "rad"),
                ("covariance_xx", "m²"),
                ("covariance_xy", "m²"),
                ("covariance_xh", "m·rad"),
                ("covariance_yy", "m²"),
                ("covariance_yh", "m·rad"),
                ("covariance_hh", "rad²"),
            ],
            Carries::Velocity(_) => &[("x", "m/s"), ("y", "m/s"), ("heading", "rad/s")],
        }
    }
}

/// A source by its name.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SourceName {
    /// Its name.
    pub name: String,
    /// What it sends.
    pub carries: Carries,
}

/// What a source sent at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Heard {
    /// When that was so, on the robot's clock, ns.
    pub instant_ns: u64,
    /// Its values in the order of the source's; what lies beyond them is ignored.
    pub values: [f64; MAX_SOURCE_VALUES],
}

impl Heard {
    /// Nothing.
    pub const NOTHING: Heard = Heard { instant_ns: 0, values: [f64::NAN; MAX_SOURCE_VALUES] };
}

impl Default for Heard {
    fn default() -> Self {
        Heard::NOTHING
    }
}

/// What values of a source were at some instant since the cycle before, however short that was: bit n for its value n.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Between {
    /// 0, or no number.
    pub zero: u32,
    /// Anything but 0.
    pub nonzero: u32,
}

impl Between {
    /// What one message says.
    pub fn of(heard: &Heard) -> Self {
        let mut between = Between::default();
        for (place, value) in heard.values.iter().enumerate() {
            between.zero |= u32::from(*value == 0.0 || value.is_nan()) << place;
            between.nonzero |= u32::from(*value != 0.0) << place;
        }
        between
    }

    /// Both as one word.
    pub fn word(self) -> u64 {
        u64::from(self.zero) | u64::from(self.nonzero) << 32
    }

    /// Of such a word.
    pub fn from_word(word: u64) -> Self {
        Between { zero: word as u32, nonzero: (word >> 32) as u32 }
    }
}

/// A pose that another program measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseMeasurement {
    /// The pose, then.
    pub odom_from_body: Pose2,
    /// Covariance of x, y and heading: xx, xy, xh, yy, yh, hh in m², m·rad and rad².
    pub covariance: [f64; 6],
    /// How long ago that was, s.
    pub age_s: f64,
}

/// A velocity that another program measured or wishes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VelocityMeasurement {
    /// The velocity, then.
    pub twist: Twist2,
    /// Its frame.
    pub frame: Frame,
    /// How long ago that was, s.
    pub age_s: f64,
}

/// Least that a determinant may be, over the product of what stands on the diagonal: rounding.
const ROUNDING: f64 = -1e-9;

/// Whether variances aren't negative in any direction (Sylvester's criterion for semidefinite matrices).
fn is_covariance([xx, xy, xh, yy, yh, hh]: [f64; 6]) -> bool {
    let minors = [(xx, xy, yy), (xx, xh, hh), (yy, yh, hh)];
    let determinant = xx * (yy * hh - yh * yh) - xy * (xy * hh - yh * xh) + xh * (xy * yh - yy * xh);
    [xx, yy, hh].iter().all(|variance| *variance >= 0.0)
        && minors.iter().all(|(a, b, c)| a * c - b * b >= ROUNDING * a * c)
        && determinant >= ROUNDING * xx * yy * hh
}

impl Inputs<'_> {
    /// The pose of a source; `None` where it is old, isn't whole, has no covariance that can be one, or isn't there.
    pub fn pose(&self, source: &str) -> Option<PoseMeasurement> {
        let (name, age_s) = self.source(source)?;
        if name.carries != Carries::Pose {
            return None;
        }
        let [x_m, y_m, heading_rad, covariance @ ..] = self.values_of::<9>(source)?;
        let odom_from_body = Pose2 { x_m, y_m, heading_rad };
        is_covariance(covariance).then_some(PoseMeasurement { odom_from_body, covariance, age_s })
    }

    /// The velocity of a source; `None` where it is old, isn't whole, or isn't there.
    pub fn velocity(&self, source: &str) -> Option<VelocityMeasurement> {
        let (name, age_s) = self.source(source)?;
        let Carries::Velocity(frame) = name.carries else { return None };
        let [vx_m_s, vy_m_s, w_rad_s] = self.values_of::<3>(source)?;
        Some(VelocityMeasurement { twist: Twist2::new(vx_m_s, vy_m_s, w_rad_s), frame, age_s })
    }

    /// The source's first values, where all of them are believed.
    fn values_of<const N: usize>(&self, source: &str) -> Option<[f64; N]> {
        let first = self.names().position(|name| is_of(name, source))?;
        let mut values = [0.0; N];
        for (n, value) in values.iter_mut().enumerate() {
            *value = self.believed(first + n)?;
        }
        Some(values)
    }
}

/// Whether a signal's full name begins by this one.
fn is_of(full: &str, name: &str) -> bool {
    full.strip_prefix(name).is_some_and(|rest| rest.starts_with('.'))
}

#[cfg(test)]
mod tests {
    use super::is_covariance;

    #[test]
    fn a_covariance_has_no_negative_variance_in_any_direction() {
        assert!(is_covariance([0.0; 6]));
        assert!(is_covariance([4.0, 2.0, 0.0, 1.0, 0.0, 0.0]), "x and y go together");
        assert!(!is_covariance([4.0, 2.1, 0.0, 1.0, 0.0, 0.0]), "more than together");
        assert!(!is_covariance([-1e-6, 0.0, 0.0, 1.0, 0.0, 1.0]));
        assert!(is_covariance([1.0, 0.5, 0.5, 1.0, 0.5, 1.0]));
        assert!(!is_covariance([1.0, 0.9, -0.9, 1.0, 0.9, 1.0]), "each pair may be, all three can't");
        assert!(!is_covariance([f64::NAN, 0.0, 0.0, 1.0, 0.0, 1.0]));
    }
}
