//! Holonomic segments: motions in which wheel angles alone give the pose.
//!
//! While the body's twist keeps its direction in se(2), or while it does not turn, the pose is a function of
//! the wheel angles since the segment began. Three such motions are recognised (thesis, 8.3.2): translation,
//! rotation, and rotation at the tangent rate of the path. For the last the thesis asks that heading and path
//! turn equally fast, which is a fixed direction of travel in base; that the angles determine the *position*
//! too needs a constant curvature in addition (a straight metre and then a bend ends elsewhere than the bend and
//! then the metre, with the same wheel angles), so a change of curvature begins a new segment.

use crate::se2::{Twist2, wrap_angle_rad};

/// How the platform moves, and so how its pose is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Regime {
    /// Neither reference nor wheels move.
    Standstill,
    /// Moving without turning: closed form.
    Translation,
    /// Turning on the spot: closed form.
    Rotation,
    /// Turning as the path turns, with constant curvature: closed form.
    Tangent,
    /// Any other motion, or one without a reference to confirm it: integrated step by step.
    Integrated,
}

impl Regime {
    /// A short name for signals and reports.
    pub const fn name(self) -> &'static str {
        match self {
            Regime::Standstill => "standstill",
            Regime::Translation => "translation",
            Regime::Rotation => "rotation",
            Regime::Tangent => "tangent",
            Regime::Integrated => "integrated",
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
    /// By how much closed form and integration may disagree before the closed form is given up, in m.
    ///
    /// This bounds what the other tolerances can cost.
    pub agreement_m: f64,
}

impl Default for RegimeTolerances {
    /// Above the noise of 20-bit encoders at 1 kHz behind a 50 rad/s filter.
    fn default() -> Self {
        RegimeTolerances {
            still_m_s: 1e-3,
            still_rad_s: 2e-3,
            direction_rad: 0.02,
            curvature_per_m: 0.02,
            agreement_m: 1e-5,
        }
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

/// What the recogniser says of one step.
pub(super) struct Recognised {
    pub(super) regime: Regime,
    /// Whether this step continues the segment of the step before.
    pub(super) continues: bool,
}

/// Recognises segments from reference and measured twist, both in base.
#[derive(Clone, Debug)]
pub(super) struct Recogniser {
    pub(super) tolerances: RegimeTolerances,
    regime: Regime,
    /// The bends of reference and measurement at the beginning of a tangent segment.
    bends: Option<(Bend, Bend)>,
}

impl Recogniser {
    pub(super) fn new(tolerances: RegimeTolerances) -> Recogniser {
        Recogniser { tolerances, regime: Regime::Standstill, bends: None }
    }

    pub(super) fn step(&mut self, reference_in_base: Option<Twist2>, measured_in_base: Twist2) -> Recognised {
        let before = self.regime;
        let regime = match reference_in_base {
            Some(reference) => self.recognise(reference, measured_in_base),
            None => Regime::Integrated,
        };
        if regime != Regime::Tangent && regime != Regime::Integrated {
            self.bends = None;
        }
        self.regime = regime;
        Recognised { regime, continues: regime == before }
    }

    /// The closed form was found wrong: the present segment ends.
    pub(super) fn give_up(&mut self) {
        self.regime = Regime::Integrated;
        self.bends = None;
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
                    Regime::Integrated
                }
            }
            _ => Regime::Integrated,
        }
    }
}
