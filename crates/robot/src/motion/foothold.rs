//! At which part of its rate a reference may go so that its own accelerations keep to what the floor carries.
//!
//! At the rate r all accelerations of a path are r² of its own. What lies ahead counts as well: a rate falls slowly.

use crate::config::Limits;
use crate::signals::Setpoint;
use crate::stages::Reference;

/// Between two looks on the path, s of the reference's time, and how many are kept.
const STEP_S: f64 = 0.05;
const LOOKS: u64 = 40;
/// Part of what the floor carries that the path's own acceleration may take; the rest slows it down and catches up.
const SHARE_OF_PATH: f64 = 0.9;
/// No reference goes slower than that.
const LEAST_RATE: f64 = 0.05;

/// What lies ahead.
#[derive(Clone, Copy, Debug)]
pub(super) struct Foothold {
    /// The accelerations at full rate, over the limits.
    needs: [f64; LOOKS as usize],
    /// Number of the first look that isn't done; `None` before any.
    next: Option<u64>,
}

impl Foothold {
    pub(super) const NEW: Foothold = Foothold { needs: [0.0; LOOKS as usize], next: None };

    /// The greatest rate from a time of the reference on; `share` of the limits' accelerations is carried.
    pub(super) fn rate(
        &mut self,
        reference: &dyn Reference,
        time_s: f64,
        (limits, share): (&Limits, f64),
    ) -> f64 {
        if share >= 1.0 {
            // Nothing needs to be known of the path.
            *self = Foothold::NEW;
            return 1.0;
        }
        let first = (time_s / STEP_S) as u64;
        let end = first.saturating_add(LOOKS);
        for look in self.next.unwrap_or(first).max(first)..end {
            let ahead = reference.preview(look as f64 * STEP_S);
            self.needs[(look % LOOKS) as usize] = ahead.map_or(0.0, |at| need(&at, limits));
        }
        self.next = Some(end);
        let worst = self.needs.iter().copied().fold(0.0, f64::max);
        rate(worst, share)
    }
}

/// The rate at which a path's greatest acceleration, over the limits, is carried.
pub(super) fn rate(need: f64, share: f64) -> f64 {
    if share >= 1.0 || need <= 0.0 {
        1.0
    } else {
        (SHARE_OF_PATH * share / need).sqrt().clamp(LEAST_RATE, 1.0)
    }
}

fn need(at: &Setpoint, limits: &Limits) -> f64 {
    let acceleration = &at.acceleration_in_odom;
    (acceleration.speed_m_s() / limits.acceleration_m_s2)
        .max(acceleration.w_rad_s.abs() / limits.turn_acceleration_rad_s2)
}
