//! How far wheels may have rolled while nobody read them.

use crate::signals::{CycleTime, Exchange, MAX_WHEELS, Measurements};

/// No wheel gets faster, while nobody drives it, than so many times the fastest of all: a platform whose translation
/// became a rotation altogether (a disc on wheels at its rim: √2, over cos 30° for the wheel that shows it least: 1.63).
const FASTER: f64 = 2.0;
/// A wheel that counts as standing may turn by that, rad/s.
const STANDING_RAD_S: f64 = 0.02;

/// What was heard of each wheel last.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Unread {
    heard_ns: [u64; MAX_WHEELS],
    /// The fastest of all wheels since then, rad/s.
    fastest_rad_s: [f64; MAX_WHEELS],
}

impl Unread {
    /// How far a wheel may have rolled since it was heard last, rad.
    pub(crate) fn bound_rad(&self, wheel: usize, time: &CycleTime) -> f64 {
        let away_s = time.now_ns.saturating_sub(self.heard_ns[wheel]) as f64 * 1e-9;
        (FASTER * self.fastest_rad_s[wheel] + STANDING_RAD_S) * away_s
    }

    /// A cycle's measurements; the count of some wheels (by bits) was no number.
    pub(crate) fn take(
        &mut self,
        time: &CycleTime,
        exchange: Exchange,
        measurements: &Measurements,
        uncounted: u16,
    ) {
        let drives = measurements.present();
        let heard = |wheel: &usize| exchange.has_inputs_of(*wheel) && uncounted >> wheel & 1 == 0;
        let speeds = (0..drives.len()).filter(heard).map(|wheel| drives[wheel].speed_rad_s.abs());
        let fastest_rad_s = speeds.filter(|speed| speed.is_finite()).fold(0.0, f64::max);
        for wheel in 0..drives.len() {
            if heard(&wheel) {
                (self.heard_ns[wheel], self.fastest_rad_s[wheel]) = (time.now_ns, fastest_rad_s);
            } else {
                self.fastest_rad_s[wheel] = self.fastest_rad_s[wheel].max(fastest_rad_s);
            }
        }
    }
}
