//! How the platform moves, recognised from what it was told and what was measured (thesis, 8.3.2): a signal for people
//! and reports.
//!
//! Rotation at the tangent rate of the path is a fixed direction of travel in base, with a constant curvature.

use crate::se2::{Twist2, wrap_angle_rad};

/// How the platform moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Regime {
    /// Neither reference nor wheels move.
    Standstill,
    /// Moving without turning.
    Translation,
    /// Turning on the spot.
    Rotation,
    /// Turning as the path turns, with constant curvature.
    Tangent,
    /// Any other motion, or one without a reference to confirm it.
    Other,
}

impl Regime {
    /// A short name for signals and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Regime::Standstill => "standstill",
            Regime::Translation => "translation",
            Regime::Rotation => "rotation",
            Regime::Tangent => "tangent",
            Regime::Other => "other",
        }
    }
}

/// When two motions count as the same.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegimeTolerances {
    /// Slower than this is no translation, in m/s.
    pub still_m_s: f64,
    /// Slower than this is no rotation, in rad/s.
    pub still_rad_s: f64,
    /// By how much the direction of travel in base may change within a tangent segment, in rad.
    pub direction_rad: f64,
    /// By how much the curvature may change within a tangent segment, in 1/m.
    pub curvature_per_m: f64,
}

impl Default for RegimeTolerances {
    /// Above the noise of 20-bit encoders at 1 kHz behind a 50 rad/s filter.
    fn default() -> Self {
        RegimeTolerances { still_m_s: 1e-3, still_rad_s: 2e-3, direction_rad: 0.02, curvature_per_m: 0.02 }
    }
}

/// The direction of travel in base and the curvature of the path: constant in a tangent segment.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bend {
    direction_rad: f64,
    curvature_per_m: f64,
}

impl Bend {
    fn of(twist: Twist2) -> Bend {
        Bend {
            direction_rad: twist.vy_m_s.atan2(twist.vx_m_s),
            curvature_per_m: twist.w_rad_s / twist.speed_m_s(),
        }
    }

    fn agrees(&self, other: &Bend, tolerances: &RegimeTolerances) -> bool {
        wrap_angle_rad(self.direction_rad - other.direction_rad).abs() <= tolerances.direction_rad
            && (self.curvature_per_m - other.curvature_per_m).abs() <= tolerances.curvature_per_m
    }
}

/// Recognises regimes from reference and measured twist, both in base.
#[derive(Clone, Debug)]
pub(super) struct Recogniser {
    tolerances: RegimeTolerances,
    /// The bends of reference and measurement at the beginning of a tangent segment.
    bends: Option<(Bend, Bend)>,
}

impl Recogniser {
    pub(super) fn new(tolerances: RegimeTolerances) -> Recogniser {
        Recogniser { tolerances, bends: None }
    }

    pub(super) fn step(&mut self, reference_in_base: Option<Twist2>, measured_in_base: Twist2) -> Regime {
        let regime = match reference_in_base {
            Some(reference) => self.recognise(reference, measured_in_base),
            None => Regime::Other,
        };
        if regime != Regime::Tangent && regime != Regime::Other {
            self.bends = None;
        }
        regime
    }

    fn recognise(&mut self, reference: Twist2, measured: Twist2) -> Regime {
        let kind = |twist: Twist2| {
            (twist.speed_m_s() > self.tolerances.still_m_s, twist.w_rad_s.abs() > self.tolerances.still_rad_s)
        };
        match (kind(reference), kind(measured)) {
            ((false, false), (false, false)) => Regime::Standstill,
            ((true, false), (true, false)) => Regime::Translation,
            ((false, true), (false, true)) => Regime::Rotation,
            ((true, true), (true, true)) => {
                let now = (Bend::of(reference), Bend::of(measured));
                let same = self.bends.is_some_and(|(reference, measured)| {
                    reference.agrees(&now.0, &self.tolerances) && measured.agrees(&now.1, &self.tolerances)
                });
                if same {
                    Regime::Tangent
                } else {
                    // Two steps make a segment: this one is where it may begin.
                    self.bends = Some(now);
                    Regime::Other
                }
            }
            _ => Regime::Other,
        }
    }
}
