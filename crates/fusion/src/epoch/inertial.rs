//! Accelerations of an epoch: whether the floor carries what the wheels say.
//!
//! An accelerometer knows no speed: a slope of one degree looks like 0.17 m/s². What it does know is how fast
//! the speed changes within a few tenths of a second, and that is where wheels lie.
//!
//! So what it tells beside the wheels is taken for its bias as long as it is small or lasts; what begins
//! suddenly, against the wheels' own acceleration, is slip, and its integral says how fast that may be: the
//! slip becomes as uncertain.
//!
//! Its value isn't taken from it: added up over wheels that slip and a platform that catches up it was further
//! from the truth than nothing (tests/filter/inertial.rs).

use omnibase_platform::BodyStep;

use super::{Epoch, Knowledge, Mounted, Sum, rates};
use crate::sensor::{Sensor, SensorKind};

/// Less than this is never slip, m/s²: what elastic wheels, jerk and a rough floor make of an acceleration.
const LEAST_M_S2: f64 = 0.35;
/// Beyond so many standard deviations of the noise it isn't noise.
const BEYOND_SIGMAS: f64 = 4.0;
/// What the smoothing leaves of the noise of an epoch's mean is at most half of it.
const SMOOTHED: f64 = 0.5;
/// Vibration is smoothed by this, s.
const SMOOTH_S: f64 = 0.015;
/// The bias is the mean of so long, s.
const BIAS_S: f64 = 2.0;
/// Before so much of it was heard nothing is told from it, s.
const KNOWN_S: f64 = 0.3;
/// What goes on for longer and is no slip is a slope, s; it is learnt as fast.
const SLOPE_S: f64 = 0.05;
/// Cosine of the angle within which two directions count as one; what slip takes away is at most so much of what wheels tell.
const ALONG: f64 = 0.7;
const MOST_OF: f64 = 1.2;
/// Wheels that slip for longer than this aren't followed by what was added up of it, s; nor is what is left below this, m/s.
const SLIPS_AT_MOST_S: f64 = 1.5;
const LEFT_M_S: f64 = 0.02;

/// What is remembered of an accelerometer, in body axes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inertia {
    /// What it tells at rest, m/s².
    bias: [f64; 2],
    /// What it told beside wheels and bias, smoothed, m/s².
    beside: [f64; 2],
    /// Its mean of the epoch before, m/s².
    before: Option<[f64; 2]>,
    heard_s: f64,
    /// How long something lasts that is no slip, s.
    lasts_s: f64,
    /// How fast wheels slip, m/s: added up since they began to.
    slip_m_s: [f64; 2],
    slipped_s: f64,
}

impl Inertia {
    /// Whether what is felt beside the wheels is that of wheels that begin to slip, or of a platform that catches up: the one
    /// lies against what wheels are accelerated by, and is no more than that; the other along the slip there is.
    fn is_slip(&self, by_wheels: [f64; 2], least_m_s2: f64) -> bool {
        let size = |[x, y]: [f64; 2]| x.hypot(y);
        let along = |one: [f64; 2], other: [f64; 2]| one[0] * other[0] + one[1] * other[1];
        let (beside, wheels) = (size(self.beside), size(by_wheels));
        if beside <= least_m_s2 {
            return false;
        }
        let begins = along(self.beside, by_wheels) < -ALONG * beside * wheels && beside < MOST_OF * wheels;
        let slip = size(self.slip_m_s);
        let catches_up = along(self.beside, self.slip_m_s) > ALONG * beside * slip && slip > 0.0;
        begins || catches_up
    }

    /// What was added up is over when nothing more comes, and little is left, or it took too long.
    fn settle(&mut self, time_s: f64, grown: Option<[f64; 2]>) {
        if self.slip_m_s == [0.0; 2] {
            return;
        }
        self.slipped_s += time_s;
        let [x, y] = self.slip_m_s;
        if self.slipped_s > SLIPS_AT_MOST_S || (grown.is_none() && x.hypot(y) < LEFT_M_S) {
            (self.slip_m_s, self.slipped_s) = ([0.0; 2], 0.0);
        }
    }
}

impl Epoch {
    /// What accelerations tell of slip, before the step is taken: its least variances. `gain`: by how much the twist grows in a second,
    /// as wheels tell.
    pub(super) fn feel(
        &self,
        sensors: &[Mounted],
        step: BodyStep,
        gain: [f64; 3],
        known: &mut Knowledge,
    ) -> [f64; 3] {
        let mut least = [0.0_f64; 3];
        for (rate, (sensor, kind)) in rates(sensors) {
            if kind != SensorKind::Inertial {
                continue;
            }
            let is_believed = known.standings[sensor].is_believed();
            let sum = &self.rates[rate];
            if sum.count == 0 || self.has_gap || !is_believed {
                known.inertia[rate].before = None;
                continue;
            }
            let grown = self.slip(&sensors[sensor].model, sum, step, gain, &mut known.inertia[rate]);
            let mut own = known.inertia[rate];
            let was_m_s = own.slip_m_s;
            for (axis, grown_m_s) in grown.unwrap_or_default().into_iter().enumerate() {
                own.slip_m_s[axis] += grown_m_s;
                // Who has caught up doesn't overtake.
                if was_m_s[axis] * own.slip_m_s[axis] < 0.0 {
                    own.slip_m_s[axis] = 0.0;
                }
                least[axis] = least[axis].max(own.slip_m_s[axis].powi(2));
            }
            own.settle(self.time_s, grown);
            known.inertia[rate] = own;
        }
        least
    }

    /// By how much wheels slip more than before, m/s; `None` where they grip.
    fn slip(
        &self,
        sensor: &Sensor,
        sum: &Sum,
        step: BodyStep,
        gain: [f64; 3],
        known: &mut Inertia,
    ) -> Option<[f64; 2]> {
        let count = f64::from(sum.count);
        let mount = sensor.body_from_sensor;
        let (sin, cos) = mount.heading_rad.sin_cos();
        let [_, x, y] = sum.values.map(|value| value / count);
        let now = [cos * x - sin * y, sin * x + cos * y];
        let before = known.before.replace(now)?;
        // Wheels tell a change between the middles of two epochs: that is the mean of both.
        let felt: [f64; 2] = std::array::from_fn(|n| 0.5 * (before[n] + now[n]));
        let [vx, vy, w] = [step.x_m, step.y_m, step.angle_rad].map(|way| way / self.time_s);
        let by_wheels = [
            gain[0] - w * vy - gain[2] * mount.y_m - w * w * mount.x_m,
            gain[1] + w * vx + gain[2] * mount.x_m - w * w * mount.y_m,
        ];
        let beside: [f64; 2] = std::array::from_fn(|n| felt[n] - by_wheels[n] - known.bias[n]);
        let share = self.time_s / (self.time_s + SMOOTH_S);
        for (smooth, beside) in known.beside.iter_mut().zip(beside) {
            *smooth += share * (beside - *smooth);
        }
        let noise_m_s2 = SMOOTHED * sensor.sigma[1].max(sensor.sigma[2]) / count.sqrt();
        let least_m_s2 = LEAST_M_S2.max(BEYOND_SIGMAS * noise_m_s2);
        if known.heard_s >= KNOWN_S && known.is_slip(by_wheels, least_m_s2) {
            known.lasts_s = 0.0;
            return Some(beside.map(|beside| -beside * self.time_s));
        }
        // What goes on though wheels aren't accelerated, nor the platform catches up, is a slope.
        let is_large = known.beside[0].hypot(known.beside[1]) > least_m_s2;
        known.lasts_s = if is_large { known.lasts_s + self.time_s } else { 0.0 };
        if known.lasts_s > SLOPE_S {
            known.slip_m_s = [0.0; 2];
        }
        known.heard_s += self.time_s;
        let over_s = if is_large { SLOPE_S } else { BIAS_S.min(known.heard_s) };
        if !is_large || known.lasts_s > SLOPE_S || known.heard_s < KNOWN_S {
            for (bias, beside) in known.bias.iter_mut().zip(beside) {
                *bias += beside * (self.time_s / over_s).min(1.0);
            }
        }
        None
    }
}
