//! How far the platform may truly be from where it is believed to be: now, and once a stop stands.
//!
//! With P the covariance, λ the greater eigenvalue of its part for x and y and r the footprint's reach, a true pose
//! within k standard deviations has no corner further from the believed one than k·(√λ + r·σψ), whatever the direction.
//!
//! Along a way of w metres and t radians, √λ grows to no more than √(λ + q) + w·σψ' + b: q is what chance adds, σψ' the
//! heading's at the end, for a wrong heading turns the way, and b what wrong radii add (sums of errors are no greater
//! than the sum of their standard deviations).

use omnibase_platform::PoseGrowth;

use super::shape::{Point, length};
use crate::signals::PlatformState;

/// How far a place of a footprint, its corners in m, may truly be from where it is believed to be, at one standard deviation, m.
pub fn spread_m(state: &PlatformState, footprint_m: &[Point]) -> f64 {
    let reach_m = footprint_m.iter().map(|corner| length(*corner)).fold(0.0, f64::max);
    Spread::of(state).at_m(reach_m)
}

/// A way that is still to be driven until the platform stands.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct WayLeft {
    pub(super) way_m: f64,
    pub(super) turn_rad: f64,
    pub(super) duration_s: f64,
}

/// Standard deviations of the believed pose.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spread {
    /// In the direction in which it is greatest, m.
    position_m: f64,
    heading_rad: f64,
    /// How fast the wheels slip, m/s: they may go on so.
    slip_m_s: f64,
}

impl Spread {
    /// What an estimator says of its pose.
    pub(super) fn of(state: &PlatformState) -> Self {
        let [xx, xy, _, yy, _, hh] = state.covariance;
        let greatest = 0.5 * (xx + yy) + length([0.5 * (xx - yy), xy]);
        Spread {
            position_m: greatest.max(0.0).sqrt(),
            heading_rad: hh.max(0.0).sqrt(),
            slip_m_s: state.slip_residual_m_s.abs(),
        }
    }

    /// What it may have come to at the end of a way.
    pub(super) fn after(&self, left: &WayLeft, growth: &PoseGrowth) -> Self {
        let WayLeft { way_m, turn_rad, duration_s } = *left;
        let (added, slip_m) = (&growth.variances, self.slip_m_s * duration_s);
        let position_m2 = added.position_per_m * way_m
            + added.position_per_rad * turn_rad
            + added.position_per_slip * slip_m;
        let heading_rad2 =
            added.heading_per_m * way_m + added.heading_per_rad * turn_rad + added.heading_per_slip * slip_m;
        let heading_rad = (self.heading_rad * self.heading_rad + heading_rad2).sqrt()
            + growth.heading_per_m * way_m
            + growth.heading_per_rad * turn_rad;
        let position_m = (self.position_m * self.position_m + position_m2).sqrt()
            + way_m * heading_rad
            + growth.position_per_m * way_m
            + growth.position_per_rad * turn_rad;
        Spread { position_m, heading_rad, ..*self }
    }

    /// How far a place of the body at a radius may be off at one standard deviation, m.
    pub(super) fn at_m(&self, radius_m: f64) -> f64 {
        self.position_m + radius_m * self.heading_rad
    }
}
