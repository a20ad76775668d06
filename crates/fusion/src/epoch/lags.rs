//! Whose clock is off while the motion changes strongly: what such a sensor tells differs as that changes, and from nobody else's so.
//!
//! There a clock that is off looks like slip, and is gated or taken for it before its likelihood tells anything
//! ([`super::flaws`]). What a sensor is off from the wheels, slip or not, is held against the change of what is
//! expected, by a regression with an intercept over the last tenths of a second, so that a bias isn't taken for it.
//!
//! Wheels that begin to slip look alike: only where another sensor that would see the slip sees none, a clock
//! is named.

use super::rates::{Heard, Rates};
use super::{Fading, Knowledge, rates};
use crate::belief::SLIP;
use crate::sensor::{Sensor, SensorKind};
use crate::standing::Verdict;

/// It tells nothing before so much was heard, s.
const LEAST_S: f64 = 0.1;
/// Clocks that are off by less are never named, s.
const LEAST_OFF_S: f64 = 0.02;
/// So much of all that it is off is explained by that, as a share.
const EXPLAINED: f64 = 0.7;
/// What is explained is so many times as strong as an epoch's noise, as an energy.
const STRONG: f64 = 100.0;
/// Another sensor sees so much less of it, as a share.
const OTHERS: f64 = 0.4;
/// Nearer to the middle than this, m, a flow sensor tells nothing of turns.
const ARM_M: f64 = 0.05;

/// Weighted sums of one number: 1, change, off, change², change·off, off².
type Sums = [f64; 6];

/// What is remembered of a sensor's instants.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lag {
    sums: [Sums; 2],
}

/// What a regression found.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Off {
    /// How much too early its instants are, s; negative where they are too late.
    early_s: f64,
    is_sure: bool,
}

impl Lag {
    fn take(&mut self, fading: &Fading, change: [f64; 2], off: [f64; 2]) {
        for (sums, (x, y)) in self.sums.iter_mut().zip(change.into_iter().zip(off)) {
            for (sum, one) in sums.iter_mut().zip([1.0, x, y, x * x, x * y, y * y]) {
                *sum = *sum * fading.lags + one * fading.time_s;
            }
        }
    }

    /// What is known of it, where the noise of an epoch has a variance; `None` where nothing changed.
    fn off(&self, noise: f64, time_s: f64) -> Option<Off> {
        let [weight, ..] = self.sums[0];
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for [weight, x, y, x2, x_y, y2] in self.sums.iter().filter(|sums| sums[0] > 0.0) {
            xx += x2 - x * x / weight;
            xy += x_y - x * y / weight;
            yy += y2 - y * y / weight;
        }
        if weight < LEAST_S || xx <= 0.0 || yy <= 0.0 {
            return None;
        }
        let early_s = xy / xx;
        let explained = xy * xy / xx;
        let is_sure =
            early_s.abs() > LEAST_OFF_S && explained > EXPLAINED * yy && explained > STRONG * noise * time_s;
        Some(Off { early_s, is_sure })
    }
}

/// What a sensor sees of the platform's motion: translation, turn.
pub(super) fn sees(sensor: &Sensor) -> [bool; 2] {
    let mount = sensor.body_from_sensor;
    match sensor.kind {
        SensorKind::Turn | SensorKind::Inertial => [false, true],
        SensorKind::Flow => [true, mount.x_m.hypot(mount.y_m) > ARM_M],
        SensorKind::Twist => [true, true],
        SensorKind::Pose => [false, false],
    }
}

impl Rates<'_> {
    /// Takes in by how much a sensor's mean is off in its own axes, before it is taken in itself.
    pub(super) fn watch_lag(&self, rate: usize, place: usize, off: [f64; 3], known: &mut Knowledge) {
        let sensor = &self.sensors[place];
        let is_gyro = sensor.model.kind.is_gyro();
        // Against what the wheels say: what was taken for slip may be this very fault.
        let slip = sensor.tells([0, 1, 2].map(|axis| known.belief.error(SLIP + axis)));
        // Of a gyro the accelerations behind its turn are no part of it.
        let second = if is_gyro { 0.0 } else { off[1] - slip[1] };
        let change = sensor.tells(self.gain);
        known.lags[rate].take(self.fading, [change[0], change[1]], [off[0] - slip[0], second]);
    }

    /// Names those whose clocks are off.
    pub(super) fn judge_lags(&self, known: &mut Knowledge) {
        let found = |rate: usize, place: usize, known: &Knowledge| {
            let sigma = self.sensors[place].model.sigma[0];
            let count = f64::from(self.epoch.rates[rate].count.max(1));
            known.lags[rate].off(sigma * sigma / count, self.epoch.time_s)
        };
        for Heard { rate, sensor: place, .. } in self.heard() {
            let Some(off) = found(rate, place, known).filter(|off| off.is_sure) else { continue };
            let own = sees(&self.sensors[place].model);
            let is_refuted = rates(self.sensors).any(|(other, (other_place, _))| {
                let seen = sees(&self.sensors[other_place].model);
                other != rate
                    && known.standings[other_place].is_believed()
                    && (own[0] && seen[0] || !own[0] && seen[1])
                    && found(other, other_place, known)
                        .is_some_and(|other| other.early_s.abs() < OTHERS * off.early_s.abs())
            });
            if is_refuted {
                known.standings[place].name(self.epoch.end_ns, Verdict::Contradicts);
            }
        }
    }
}
