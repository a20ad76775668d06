//! The floor: its friction with a wheel's tread, places where that is another one, and its slope.

use crate::tread::Tread;

/// Standard gravity (ISO 80000-3).
pub const GRAVITY_M_S2: f64 = 9.806_65;

/// What happens where a wheel touches the floor; dimensionless figures, each a ratio to the normal load.
///
/// Along its force direction a contact sticks until the force reaches `static_friction` times the load, then slides
/// with `sliding_friction` times the load against the slip (Coulomb). Across it the rollers turn, against
/// `roller_resistance` times the load. The wheel as a whole rolls against `rolling_resistance` times load times radius.
///
/// Elastic treads creep before they slide: the slip speed is `creep` times travelling speed times the ratio of force to
/// load (Carter's law for small ratios, K. L. Johnson, *Contact Mechanics*, 1985, chapter 8: `creep = a/(2R)` with
/// the half-width `a` of the contact and the radius `R`). A standing contact doesn't creep.
///
/// # Where the default figures come from
/// They describe cast polyurethane rollers on a dry, hard floor, and were taken from the literature as they stand there:
///
/// | figure | default | source |
/// |---|---|---|
/// | `static_friction` | 0.50 | tables of elastomer friction range from 0.20 (hard cast polyurethane, 82 Shore A) to 0.69 (rubber, 60 Shore A) at 20 °C, and 0.75 for tyres on dry concrete (Noon 1994); the middle is taken |
/// | `sliding_friction` | 0.45 | nine tenths of the static figure: elastomers fall little when sliding begins |
/// | `rolling_resistance` | 0.009 | Duda et al., *Sensors* 2025, 25(16), 5026, doi:10.3390/s25165026, omni wheel on industrial concrete: smallest mean resistance 1.04 N under 117.7 N |
/// | `roller_resistance` | 0.030 | same work: mean resistance up to 10.34 N under 215.8 N (0.048) when rolling askew; between that and the straight figure |
/// | `creep` | 0.025 | Carter with Hertz's half-width: 350 N on a 25 mm wide tread of 0.1 m radius and 50 MPa (92 Shore A) gives a = 5.2 mm |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Largest force along the force direction while sticking, over normal load.
    pub static_friction: f64,
    /// Force along the force direction while sliding, over normal load; at most `static_friction`.
    pub sliding_friction: f64,
    /// Moment against the wheel's rolling, over normal load times radius.
    pub rolling_resistance: f64,
    /// Force against the rollers' turning, over normal load; at most `sliding_friction`.
    pub roller_resistance: f64,
    /// Slip ratio over ratio of force to load, for forces well below sliding; 0 is a tread that doesn't creep.
    pub creep: f64,
    /// How the tread gives way; `None` is a rigid one.
    pub tread: Option<Tread>,
}

impl Default for Contact {
    fn default() -> Self {
        Self {
            static_friction: 0.50,
            sliding_friction: 0.45,
            rolling_resistance: 0.009,
            roller_resistance: 0.030,
            creep: 0.025,
            tread: None,
        }
    }
}

impl Contact {
    /// A rigid tread that rolls without any loss: what kinematics textbooks assume, up to the friction limit.
    pub fn ideal(friction: f64) -> Self {
        Self {
            static_friction: friction,
            sliding_friction: friction,
            rolling_resistance: 0.0,
            roller_resistance: 0.0,
            creep: 0.0,
            tread: None,
        }
    }
}

/// A floor as the robot finds it; level and alike everywhere by default.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Floor {
    /// How it slopes.
    pub slope: Slope,
    /// Places with a friction of their own; the first one that holds a contact counts.
    pub patches: Vec<Patch>,
}

/// How a floor slopes, the same everywhere.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Slope {
    /// Angle against the horizontal.
    pub angle_rad: f64,
    /// Which way it goes down, from x in the fixed frame.
    pub downhill_rad: f64,
}

/// A place on the floor with a friction of its own: oil, a wet spot, or (without friction) a gap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// Where it is.
    pub place: Region,
    /// What it is like.
    pub surface: Surface,
}

/// A part of the floor, in the fixed frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Region {
    /// Along the axes.
    Rectangle {
        /// Least x and y.
        from_m: [f64; 2],
        /// Greatest x and y.
        to_m: [f64; 2],
    },
    /// A disc.
    Disc {
        /// Its middle.
        centre_m: [f64; 2],
        /// Its radius.
        radius_m: f64,
    },
}

/// Friction in place of a contact's own; rollers resist with no more than that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// As [`Contact::static_friction`].
    pub static_friction: f64,
    /// As [`Contact::sliding_friction`].
    pub sliding_friction: f64,
}

impl Region {
    /// Whether a point lies in it, its edge included.
    pub fn holds(&self, point_m: [f64; 2]) -> bool {
        let [x, y] = point_m;
        match self {
            Region::Rectangle { from_m, to_m } => {
                (from_m[0]..=to_m[0]).contains(&x) && (from_m[1]..=to_m[1]).contains(&y)
            }
            Region::Disc { centre_m, radius_m } => {
                let (dx, dy) = (x - centre_m[0], y - centre_m[1]);
                dx * dx + dy * dy <= radius_m * radius_m
            }
        }
    }
}

/// Greatest forces of a contact over its load.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Holds {
    /// Along the force direction, while sticking and while sliding.
    pub(crate) along: [f64; 2],
    /// Against the rollers.
    pub(crate) roller: f64,
}

impl Surface {
    /// What holds on this surface a contact whose rollers resist with `roller`. What they take across is missing along: the
    /// circle of friction.
    pub(crate) fn holds(&self, roller: f64) -> Holds {
        let roller = roller.min(self.sliding_friction);
        let along = |friction: f64| (friction * friction - roller * roller).max(0.0).sqrt();
        Holds { along: [along(self.static_friction), along(self.sliding_friction)], roller }
    }
}
