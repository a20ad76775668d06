//! Limits of the platform, what a trajectory needs of them, and retiming.

mod inside;

use crate::interpolation::{Interpolation, PointTrajectory};
use crate::path_points::PathPoints;
use crate::trajectory::{Setpoint, Trajectory};
use inside::Inside;

/// The most that a platform may do. Translation counts as a vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Speed, in m/s.
    pub speed_m_s: f64,
    /// Acceleration, in m/s².
    pub acceleration_m_s2: f64,
    /// Jerk, in m/s³.
    pub jerk_m_s3: f64,
    /// Rate of turning, in rad/s.
    pub rate_rad_s: f64,
    /// Angular acceleration, in rad/s².
    pub angular_acceleration_rad_s2: f64,
    /// Angular jerk, in rad/s³.
    pub angular_jerk_rad_s3: f64,
}

/// Why limits were refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LimitsError {
    /// A limit that is no positive number.
    #[error("{setting} is {found}, expected a positive number")]
    Setting {
        /// Which setting.
        setting: &'static str,
        /// What was found.
        found: f64,
    },
}

/// One of the six quantities that have a limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Translation: speed.
    Speed,
    /// Translation: acceleration.
    Acceleration,
    /// Translation: jerk.
    Jerk,
    /// Rotation: rate.
    Rate,
    /// Rotation: angular acceleration.
    AngularAcceleration,
    /// Rotation: angular jerk.
    AngularJerk,
}

impl Quantity {
    /// All of them, in the order of [`Limits`].
    pub const ALL: [Quantity; 6] = [
        Quantity::Speed,
        Quantity::Acceleration,
        Quantity::Jerk,
        Quantity::Rate,
        Quantity::AngularAcceleration,
        Quantity::AngularJerk,
    ];

    /// Its name and unit, for messages.
    pub const fn name_and_unit(self) -> (&'static str, &'static str) {
        match self {
            Quantity::Speed => ("speed", "m/s"),
            Quantity::Acceleration => ("acceleration", "m/s²"),
            Quantity::Jerk => ("jerk", "m/s³"),
            Quantity::Rate => ("rate of turning", "rad/s"),
            Quantity::AngularAcceleration => ("angular acceleration", "rad/s²"),
            Quantity::AngularJerk => ("angular jerk", "rad/s³"),
        }
    }

    /// The derivative of the way that it is: stretching time by k divides it by k to this power.
    const fn order(self) -> i32 {
        match self {
            Quantity::Speed | Quantity::Rate => 1,
            Quantity::Acceleration | Quantity::AngularAcceleration => 2,
            Quantity::Jerk | Quantity::AngularJerk => 3,
        }
    }

    /// How many times as long a motion must take for a value of so many times the limit to come down to it.
    pub(crate) fn stretch(self, load: f64) -> f64 {
        match self.order() {
            1 => load,
            2 => load.sqrt(),
            _ => load.cbrt(),
        }
    }

    pub(crate) fn of(self, setpoint: &Setpoint) -> f64 {
        match self {
            Quantity::Speed => setpoint.twist_in_odom.speed_m_s(),
            Quantity::Acceleration => setpoint.acceleration_in_odom.speed_m_s(),
            Quantity::Jerk => setpoint.jerk_in_odom.speed_m_s(),
            Quantity::Rate => setpoint.twist_in_odom.w_rad_s.abs(),
            Quantity::AngularAcceleration => setpoint.acceleration_in_odom.w_rad_s.abs(),
            Quantity::AngularJerk => setpoint.jerk_in_odom.w_rad_s.abs(),
        }
    }
}

impl Limits {
    /// The limit of a quantity.
    pub fn of(&self, quantity: Quantity) -> f64 {
        match quantity {
            Quantity::Speed => self.speed_m_s,
            Quantity::Acceleration => self.acceleration_m_s2,
            Quantity::Jerk => self.jerk_m_s3,
            Quantity::Rate => self.rate_rad_s,
            Quantity::AngularAcceleration => self.angular_acceleration_rad_s2,
            Quantity::AngularJerk => self.angular_jerk_rad_s3,
        }
    }

    /// Refuses limits that are no positive numbers.
    pub fn check(&self) -> Result<(), LimitsError> {
        for (setting, found) in [
            ("speed_m_s", self.speed_m_s),
            ("acceleration_m_s2", self.acceleration_m_s2),
            ("jerk_m_s3", self.jerk_m_s3),
            ("rate_rad_s", self.rate_rad_s),
            ("angular_acceleration_rad_s2", self.angular_acceleration_rad_s2),
            ("angular_jerk_rad_s3", self.angular_jerk_rad_s3),
        ] {
            if !(found.is_finite() && found > 0.0) {
                return Err(LimitsError::Setting { setting, found });
            }
        }
        Ok(())
    }
}

/// The largest value of a quantity, and when.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Peak {
    /// The value, in the quantity's unit.
    pub value: f64,
    /// The time, in s.
    pub time_s: f64,
}

/// What a trajectory, or a part of it, needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peaks {
    peaks: [Peak; 6],
    /// The largest jump of the acceleration, in m/s²; cubics through points have some.
    ///
    /// There the jerk is without bound for an instant. [`crate::TwistLimiter`] rounds such a jump off, which takes
    /// jump/jerk of time.
    pub acceleration_jump_m_s2: f64,
    /// The same of the angular acceleration, in rad/s².
    pub angular_jump_rad_s2: f64,
}

/// Samples per piece before the refinement: each piece is one polynomial or one smooth curve.
const SAMPLES: usize = 200;
/// Golden sections: the time of a peak is known to 1e-9 of a sample's width; its value far better.
const SECTIONS: usize = 45;
/// What search and rounding may add before it counts as exceeding a limit.
const TOLERANCE: f64 = 1e-9;

impl Peaks {
    /// The peaks of a whole trajectory.
    pub fn of<T: Trajectory + ?Sized>(trajectory: &T) -> Peaks {
        let breaks_s = trajectory.breaks_s();
        let mut peaks =
            Peaks { peaks: [Peak::default(); 6], acceleration_jump_m_s2: 0.0, angular_jump_rad_s2: 0.0 };
        for pair in breaks_s.windows(2) {
            let piece = Peaks::between(trajectory, pair[0], pair[1]);
            for (mine, other) in peaks.peaks.iter_mut().zip(piece.peaks) {
                if other.value > mine.value {
                    *mine = other;
                }
            }
        }
        // Just beside each break; what a derivative changes over this distance is far below the tolerance.
        let beside_s = breaks_s.last().copied().unwrap_or_default() * 1e-10;
        for time_s in breaks_s {
            let (before, after) =
                (trajectory.sample(time_s - beside_s), trajectory.sample(time_s + beside_s));
            let (a, b) = (before.acceleration_in_odom, after.acceleration_in_odom);
            let jump = (a.vx_m_s - b.vx_m_s).hypot(a.vy_m_s - b.vy_m_s);
            peaks.acceleration_jump_m_s2 = peaks.acceleration_jump_m_s2.max(jump);
            peaks.angular_jump_rad_s2 = peaks.angular_jump_rad_s2.max((a.w_rad_s - b.w_rad_s).abs());
        }
        peaks
    }

    /// The peaks inside one piece, in which derivatives do not jump.
    fn between<T: Trajectory + ?Sized>(trajectory: &T, from_s: f64, to_s: f64) -> Peaks {
        let width_s = (to_s - from_s) / SAMPLES as f64;
        let mut peaks = [Peak::default(); 6];
        // Ends are taken from inside, for beyond them lies another piece.
        let (first_s, last_s) = (from_s + width_s * 1e-9, to_s - width_s * 1e-9);
        for at in 0..=SAMPLES {
            let time_s = (from_s + width_s * at as f64).clamp(first_s, last_s);
            let setpoint = trajectory.sample(time_s);
            for (peak, quantity) in peaks.iter_mut().zip(Quantity::ALL) {
                let value = quantity.of(&setpoint);
                if value > peak.value {
                    *peak = Peak { value, time_s };
                }
            }
        }
        for (peak, quantity) in peaks.iter_mut().zip(Quantity::ALL) {
            let (mut low_s, mut high_s) =
                ((peak.time_s - width_s).max(first_s), (peak.time_s + width_s).min(last_s));
            let golden = (5.0_f64.sqrt() - 1.0) / 2.0;
            for _ in 0..SECTIONS {
                let inner = [high_s - golden * (high_s - low_s), low_s + golden * (high_s - low_s)];
                let values = inner.map(|time_s| quantity.of(&trajectory.sample(time_s)));
                for (time_s, value) in inner.into_iter().zip(values) {
                    if value > peak.value {
                        *peak = Peak { value, time_s };
                    }
                }
                if values[0] > values[1] { high_s = inner[1] } else { low_s = inner[0] }
            }
        }
        Peaks { peaks, acceleration_jump_m_s2: 0.0, angular_jump_rad_s2: 0.0 }
    }

    /// The peak of a quantity.
    pub fn peak(&self, quantity: Quantity) -> Peak {
        self.peaks[quantity as usize]
    }

    /// How many times as long the motion must take to stay within limits, and the quantity that asks for it.
    ///
    /// Below 1 the motion could be faster by that factor.
    pub fn stretch(&self, limits: &Limits) -> (f64, Quantity) {
        let mut most = (0.0, Quantity::Speed);
        for quantity in Quantity::ALL {
            let ratio = self.peak(quantity).value / limits.of(quantity);
            let factor = ratio.powf(1.0 / f64::from(quantity.order()));
            if factor > most.0 {
                most = (factor, quantity);
            }
        }
        most
    }

    fn refusal(&self, limits: &Limits, part: Part) -> Option<Refusal> {
        let (factor, quantity) = self.stretch(limits);
        (factor > 1.0 + TOLERANCE).then(|| {
            let peak = self.peak(quantity);
            let (limit, needed_s) = (limits.of(quantity), part.given_s * factor);
            Refusal { quantity, found: peak.value, limit, time_s: peak.time_s, needed_s, part }
        })
    }
}

/// Which part of a motion is meant, and how long it is given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// The point that it leads to, counted from 0; `None` for a whole trajectory.
    pub point: Option<usize>,
    /// The point's line in its file, if it has one.
    pub line: Option<usize>,
    /// The time it is given, in s.
    pub given_s: f64,
}

/// A motion that the limits do not allow in its time.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "{part} cannot be reached in {:.3} s: {} would be {found:.4} {} at t = {time_s:.3} s, the limit is {limit} {}; it \
     needs {needed_s:.3} s", .part.given_s, .quantity.name_and_unit().0, .quantity.name_and_unit().1, .quantity.name_and_unit().1
)]
pub struct Refusal {
    /// What exceeds its limit most.
    pub quantity: Quantity,
    /// The largest value.
    pub found: f64,
    /// Its limit.
    pub limit: f64,
    /// When, in s since the trajectory's beginning.
    pub time_s: f64,
    /// The time that the part needs, in s.
    pub needed_s: f64,
    /// Which part.
    pub part: Part,
}

impl std::fmt::Display for Part {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match (self.point, self.line) {
            (Some(point), Some(line)) => write!(f, "point {} (line {line})", point + 1),
            (Some(point), None) => write!(f, "point {}", point + 1),
            (None, _) => write!(f, "the trajectory's end"),
        }
    }
}

/// Refuses a trajectory that exceeds limits anywhere, with the time that it would need.
///
/// Jumps of the acceleration do not count here; see [`Peaks::acceleration_jump_m_s2`].
///
/// `given_s` is the time that was asked for, of the whole or of one turn; a refusal says how long it must be.
pub fn check<T: Trajectory + ?Sized>(
    trajectory: &T,
    given_s: f64,
    limits: &Limits,
) -> Result<Peaks, Refusal> {
    let peaks = Peaks::of(trajectory);
    let part = Part { point: None, line: None, given_s };
    match peaks.refusal(limits, part) {
        Some(refusal) => Err(refusal),
        None => Ok(peaks),
    }
}

/// The motion through points, or every point that the limits do not let it reach in time.
pub fn plan(
    points: &PathPoints,
    interpolation: Interpolation,
    limits: &Limits,
) -> Result<PointTrajectory, Vec<Refusal>> {
    let trajectory = PointTrajectory::new(points, interpolation);
    let start_s = points.as_slice()[0].time_s;
    let breaks_s = trajectory.breaks_s();
    let mut inside = Inside::new(&trajectory, limits);
    let refusals: Vec<Refusal> = points
        .as_slice()
        .windows(2)
        .enumerate()
        .filter_map(|(at, pair)| {
            let ends_s = [pair[0].time_s - start_s, pair[1].time_s - start_s];
            // Most segments of most paths are far inside, which costs little to see.
            if inside.is_sure(ends_s) {
                return None;
            }
            let part =
                Part { point: Some(at + 1), line: points.line(at + 1), given_s: ends_s[1] - ends_s[0] };
            segment(&trajectory, &breaks_s, ends_s).refusal(limits, part)
        })
        .collect();
    if refusals.is_empty() { Ok(trajectory) } else { Err(refusals) }
}

/// The peaks between each point and the next.
fn segments(points: &PathPoints, trajectory: &PointTrajectory) -> Vec<Peaks> {
    let start_s = points.as_slice()[0].time_s;
    let breaks_s = trajectory.breaks_s();
    points
        .as_slice()
        .windows(2)
        .map(|pair| segment(trajectory, &breaks_s, [pair[0].time_s - start_s, pair[1].time_s - start_s]))
        .collect()
}

/// The peaks between two times.
fn segment(trajectory: &PointTrajectory, breaks_s: &[f64], [from_s, to_s]: [f64; 2]) -> Peaks {
    // A B-spline has breaks inside.
    let [first, end] = [from_s, to_s].map(|bound_s| breaks_s.partition_point(|time_s| *time_s <= bound_s));
    let inner = breaks_s[first..end].iter().copied().filter(|time_s| *time_s < to_s);
    let times: Vec<f64> = std::iter::once(from_s).chain(inner).chain([to_s]).collect();
    times
        .windows(2)
        .map(|pair| Peaks::between(trajectory, pair[0], pair[1]))
        .reduce(|mut all, piece| {
            for (mine, other) in all.peaks.iter_mut().zip(piece.peaks) {
                if other.value > mine.value {
                    *mine = other;
                }
            }
            all
        })
        .unwrap_or_else(|| Peaks::between(trajectory, from_s, to_s))
}

/// What retiming may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Retiming {
    /// Only segments that are too fast become slower.
    SlowDown,
    /// Every segment becomes as fast as the limits allow.
    Fastest,
}

/// Rounds of retiming, for speeds at points couple segments; the rest is done by stretching the whole.
const ROUNDS: usize = 100;

/// The same places at other times, so that their motion stays within limits.
///
/// Segment by segment, in rounds (a segment's speed at its ends depends on its neighbours); a last stretch of the
/// whole takes away what remains.
pub fn retimed(
    points: &PathPoints,
    interpolation: Interpolation,
    limits: &Limits,
    retiming: Retiming,
) -> PathPoints {
    let mut retimed = points.clone();
    let least = match retiming {
        Retiming::SlowDown => 1.0,
        // A segment without any motion has no time of its own.
        Retiming::Fastest => 1e-3,
    };
    for _ in 0..ROUNDS {
        let trajectory = PointTrajectory::new(&retimed, interpolation);
        let factors: Vec<f64> =
            segments(&retimed, &trajectory).iter().map(|peaks| peaks.stretch(limits).0.max(least)).collect();
        if factors.iter().all(|factor| (factor - 1.0).abs() <= TOLERANCE) {
            return retimed;
        }
        retimed = retimed.stretched(&factors);
    }
    let (factor, _) = Peaks::of(&PointTrajectory::new(&retimed, interpolation)).stretch(limits);
    let factors = vec![
        if retiming == Retiming::SlowDown { factor.max(1.0) } else { factor };
        points.durations_s().len()
    ];
    retimed.stretched(&factors)
}
