//! What a platform may do along a way, and how far it does.

use std::collections::VecDeque;

use crate::limits::{Limits, Quantity};
use crate::reach::{AccelerationBounds, Bend, Interval, Plane, resisting};
use crate::trajectory::{Setpoint, Trajectory};
use omnibase_platform::Twist2;

/// A limit that a motion can meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// One of the platform's own.
    Platform(Quantity),
    /// The speed of a wheel.
    WheelSpeed,
    /// The torque of a wheel.
    WheelTorque,
    /// What the floor gives a wheel.
    Grip,
    /// The heat of a wheel's motor.
    Heat,
}

/// How much the direction may change along an interval of the grid, over itself.
const TURN_OF_WAY: f64 = 0.2;
/// And how much the acceleration may, over what it may be.
const TURN: f64 = 0.11;
/// The shortest window over which a motion is smoothed, s.
const SHORTEST_WINDOW_S: f64 = 1e-6;

/// What motors bear: the root of the mean square of their torques over a window of time; before the motion they rested.
#[derive(Clone, Debug, PartialEq)]
pub struct Heat {
    /// The window, s.
    pub window_s: f64,
    /// Rows over the acceleration in base, one a motor: its torque over what it bears for ever.
    pub torques: Vec<[f64; 3]>,
}

/// The platform's limits, and those of its wheels.
#[derive(Clone, Debug, PartialEq)]
pub struct PlatformBounds {
    /// Those of the platform.
    pub limits: Limits,
    /// Rows over the twist in base: each product is at most 1 in size.
    pub wheel_speeds: Vec<[f64; 3]>,
    /// Limits on the acceleration in base.
    pub planes: Vec<(Limit, Plane)>,
    /// What resists a motion, as [`AccelerationBounds`] has it.
    pub resistance: Vec<[f64; 3]>,
    /// What motors bear; `None`: anything.
    pub heat: Option<Heat>,
}

impl PlatformBounds {
    /// Without wheels.
    pub fn new(limits: Limits) -> PlatformBounds {
        PlatformBounds {
            limits,
            wheel_speeds: Vec::new(),
            planes: Vec::new(),
            resistance: Vec::new(),
            heat: None,
        }
    }

    /// All limits on the acceleration.
    pub(super) fn acceleration(&self) -> AccelerationBounds {
        let most = self.limits.angular_acceleration_rad_s2;
        let turning = [1.0, -1.0].map(|sign| Plane { normal: [0.0, 0.0, sign], most, ..Plane::default() });
        AccelerationBounds {
            length: Some(self.limits.acceleration_m_s2),
            planes: turning.into_iter().chain(self.planes.iter().map(|(_, plane)| *plane)).collect(),
            resistance: self.resistance.clone(),
        }
    }

    /// A place on the way in the platform's axes, and the greatest σ̇² there by limits on speed, and by the jerk that the bend
    /// alone makes.
    pub(super) fn look(&self, axes: &[[f64; 4]; 3]) -> (Bend, f64) {
        let (sin, cos) = axes[2][0].sin_cos();
        let turned = |order: usize| {
            let [x, y, turn] = axes.map(|axis| axis[order]);
            [cos * x + sin * y, cos * y - sin * x, turn]
        };
        let (bend, third) = (Bend { rate: turned(1), curve: turned(2) }, turned(3));
        let Limits { jerk_m_s3, angular_jerk_rad_s3, .. } = self.limits;
        let rate = self.speed_share(&bend.rate);
        let cube = (third[0].hypot(third[1]) / jerk_m_s3).max(third[2].abs() / angular_jerk_rad_s3).cbrt();
        (bend, rate.max(cube).powi(-2))
    }

    /// Tells each limit with what a motion takes of it at a moment, and what it may.
    pub fn loads(&self, setpoint: &Setpoint, mut take: impl FnMut(Limit, f64, f64)) {
        for quantity in Quantity::ALL {
            take(Limit::Platform(quantity), quantity.of(setpoint), self.limits.of(quantity));
        }
        if self.wheel_speeds.is_empty() && self.planes.is_empty() {
            return;
        }
        let [twist, acceleration] =
            in_base(setpoint, [setpoint.twist_in_odom, setpoint.acceleration_in_odom]);
        for row in &self.wheel_speeds {
            take(Limit::WheelSpeed, dot(row, &twist).abs(), 1.0);
        }
        self.planes_at(&twist, |limit, plane, left| take(limit, dot(&plane.normal, &acceleration), left));
    }

    /// Velocity, acceleration and jerk of a moment, in its base's axes.
    pub(super) fn derivatives_in_base(&self, setpoint: &Setpoint) -> [[f64; 3]; 3] {
        in_base(setpoint, [setpoint.twist_in_odom, setpoint.acceleration_in_odom, setpoint.jerk_in_odom])
    }

    /// What part of the limits on speed a twist in base takes.
    pub(super) fn speed_share(&self, twist: &[f64; 3]) -> f64 {
        let Limits { speed_m_s, rate_rad_s, .. } = self.limits;
        let along = twist[0].hypot(twist[1]) / speed_m_s;
        let rates = self.wheel_speeds.iter().map(|row| dot(row, twist).abs());
        rates.fold(along.max(twist[2].abs() / rate_rad_s), f64::max)
    }

    /// Tells each plane's normal with what it leaves of the acceleration where the platform moves with a twist in base.
    pub(super) fn planes_at(&self, twist: &[f64; 3], mut take: impl FnMut(Limit, &Plane, f64)) {
        let is_resisted = !self.resistance.is_empty();
        let resistance = if is_resisted { resisting(&self.resistance, twist) } else { [0.0; 3] };
        for (limit, plane) in &self.planes {
            take(*limit, plane, if is_resisted { plane.left(&resistance) } else { plane.most });
        }
    }

    /// How many times as long the motion must take at a moment to keep every limit, at least 1.
    pub(super) fn pace(&self, setpoint: &Setpoint) -> f64 {
        let mut most: f64 = 1.0;
        // Most moments are within all limits: only what exceeds one is worth a quotient and a root.
        if !self.is_within(setpoint) {
            self.loads(setpoint, |limit, found, may| {
                if found > may {
                    most = most.max(limit.stretch(found / may));
                }
            });
        }
        most
    }

    /// The same by limits on jerk alone.
    pub(super) fn pace_of_jerk(&self, setpoint: &Setpoint) -> f64 {
        let Limits { jerk_m_s3, angular_jerk_rad_s3, .. } = self.limits;
        if is_below(&setpoint.jerk_in_odom, jerk_m_s3, angular_jerk_rad_s3) {
            return 1.0;
        }
        let paces = [Quantity::Jerk, Quantity::AngularJerk]
            .map(|quantity| quantity.stretch(quantity.of(setpoint) / self.limits.of(quantity)));
        paces.into_iter().fold(1.0, f64::max)
    }

    /// Whether a moment is within all limits.
    fn is_within(&self, setpoint: &Setpoint) -> bool {
        let limits = &self.limits;
        let is_below = is_below(&setpoint.twist_in_odom, limits.speed_m_s, limits.rate_rad_s)
            && is_below(
                &setpoint.acceleration_in_odom,
                limits.acceleration_m_s2,
                limits.angular_acceleration_rad_s2,
            )
            && is_below(&setpoint.jerk_in_odom, limits.jerk_m_s3, limits.angular_jerk_rad_s3);
        if !is_below || (self.wheel_speeds.is_empty() && self.planes.is_empty()) {
            return is_below;
        }
        let [twist, acceleration] =
            in_base(setpoint, [setpoint.twist_in_odom, setpoint.acceleration_in_odom]);
        let mut is_within = self.wheel_speeds.iter().all(|row| dot(row, &twist).abs() <= 1.0);
        self.planes_at(&twist, |_, plane, left| is_within &= dot(&plane.normal, &acceleration) <= left);
        is_within
    }

    /// By how many times what it may the way turns along an interval, or the acceleration on it does, from x at its beginning to
    /// that at its end.
    pub(super) fn turn(&self, interval: &Interval, x: [f64; 2]) -> f64 {
        let Limits { acceleration_m_s2, angular_acceleration_rad_s2, .. } = self.limits;
        let size = |[x, y, turn]: [f64; 3]| {
            (x.hypot(y) / acceleration_m_s2).max(turn.abs() / angular_acceleration_rad_s2)
        };
        let [first, second] = &interval.ends;
        let change = |along: &dyn Fn(&Bend, f64, usize) -> f64| {
            [0, 1, 2].map(|axis| along(second, x[1], axis) - along(first, x[0], axis))
        };
        let way = size(change(&|bend, _, axis| bend.rate[axis])) / size(first.rate).min(size(second.rate));
        let u = (x[1] - x[0]) / (2.0 * interval.length);
        let change = change(&|bend, x, axis| bend.rate[axis] * u + bend.curve[axis] * x);
        let planes = self.planes.iter().map(|(_, plane)| dot(&plane.normal, &change).abs() / plane.most);
        (way / TURN_OF_WAY).max(planes.fold(size(change), f64::max) / TURN)
    }

    /// A window whose mean keeps the jerk where a motion speeds up from rest or turns from speeding up to braking, s.
    pub(super) fn first_window_s(&self, intervals: &[Interval], x: &[f64]) -> f64 {
        let Limits { jerk_m_s3, angular_jerk_rad_s3, .. } = self.limits;
        let mut before = 0.0;
        let mut most_s: f64 = 0.0;
        for (interval, pair) in intervals.iter().zip(x.windows(2)) {
            let u = (pair[1] - pair[0]) / (2.0 * interval.length);
            // At rest it waits.
            if pair[0] <= 0.0 {
                before = 0.0;
            }
            for change in [u - before, u] {
                let step = interval.ends[0].rate.map(|rate| rate * change);
                most_s =
                    most_s.max(step[0].hypot(step[1]) / jerk_m_s3).max(step[2].abs() / angular_jerk_rad_s3);
            }
            before = u;
        }
        // Without a limit there is none; a shorter one than any cycle sees would be lost in rounding.
        if most_s > 0.0 { most_s.max(SHORTEST_WINDOW_S) } else { 0.0 }
    }
}

/// How warm a motion makes motors: the mean squares of their torques, window by window.
pub(super) struct Warming {
    window_s: f64,
    /// Times, and the integral of the square of each motor's torque until then.
    times_s: Vec<f64>,
    sums: Vec<Vec<f64>>,
}

impl Heat {
    /// The root of the mean square of the warmest motor's torque in the worst window of a motion that begins cold.
    pub fn most(&self, motion: &impl Trajectory) -> f64 {
        self.warming(motion.breaks_s(), |time_s| motion.sample(time_s))
            .windows()
            .map(|(_, load)| load)
            .fold(0.0, f64::max)
    }

    /// That of a motion whose acceleration is all but linear between times, by its setpoints.
    pub(super) fn warming(&self, times_s: Vec<f64>, mut setpoint: impl FnMut(f64) -> Setpoint) -> Warming {
        let mut sums = vec![Vec::with_capacity(times_s.len()); self.torques.len()];
        let mut totals = vec![0.0; self.torques.len()];
        for (at, time_s) in times_s.iter().enumerate() {
            if at > 0 {
                let width_s = time_s - times_s[at - 1];
                // Gauss and Legendre's rule of two points: exact where an acceleration is linear in time.
                for part in [0.211_324_865_405_187_1, 0.788_675_134_594_812_9] {
                    let setpoint = setpoint(times_s[at - 1] + part * width_s);
                    let [acceleration] = in_base(&setpoint, [setpoint.acceleration_in_odom]);
                    for (total, row) in totals.iter_mut().zip(&self.torques) {
                        *total += 0.5 * width_s * dot(row, &acceleration).powi(2);
                    }
                }
            }
            sums.iter_mut().zip(&totals).for_each(|(sum, total)| sum.push(*total));
        }
        Warming { window_s: self.window_s, times_s, sums }
    }
}

impl Warming {
    /// The windows that end at its times, s, and the root of the mean square of the warmest motor's torque in each.
    pub(super) fn windows(&self) -> impl Iterator<Item = ([f64; 2], f64)> {
        self.spans().map(|[from, to]| {
            let warmest =
                (0..self.sums.len()).map(|motor| self.square(motor, [from, to])).fold(0.0, f64::max);
            ([(self.times_s[to] - self.window_s).max(0.0), self.times_s[to]], warmest.sqrt())
        })
    }

    /// Of each motor, piece by piece, the greatest mean square of its torque in any window that holds the piece.
    pub(super) fn squares(&self) -> Vec<Vec<f64>> {
        let of_motor = |motor: usize| {
            let mut coming = self.spans().map(|span| (span, self.square(motor, span))).peekable();
            // Those behind which a greater one ends later never count again.
            let mut greatest: VecDeque<(usize, f64)> = VecDeque::new();
            let square = |piece: usize| {
                while let Some(([_, to], square)) = coming.next_if(|([from, _], _)| *from <= piece) {
                    while greatest.back().is_some_and(|(_, last)| *last <= square) {
                        greatest.pop_back();
                    }
                    greatest.push_back((to, square));
                }
                while greatest.front().is_some_and(|(to, _)| *to <= piece) {
                    greatest.pop_front();
                }
                greatest.front().map_or(0.0, |(_, square)| *square)
            };
            (0..self.times_s.len() - 1).map(square).collect()
        };
        (0..self.sums.len()).map(of_motor).collect()
    }

    /// Between which of its times the windows lie that end at each of them.
    fn spans(&self) -> impl Iterator<Item = [usize; 2]> {
        let mut from = 0;
        (0..self.times_s.len()).map(move |to| {
            while from + 1 < to && self.times_s[from + 1] <= self.times_s[to] - self.window_s {
                from += 1;
            }
            [from, to]
        })
    }

    /// The mean square of a motor's torque in a window.
    fn square(&self, motor: usize, [from, to]: [usize; 2]) -> f64 {
        (self.sums[motor][to] - self.sums[motor][from]) / self.window_s
    }
}

impl Limit {
    /// How many times as long a motion must take for a load to become 1.
    fn stretch(self, load: f64) -> f64 {
        match self {
            Limit::Platform(quantity) => quantity.stretch(load),
            Limit::WheelSpeed => load,
            Limit::WheelTorque | Limit::Grip | Limit::Heat => load.max(0.0).sqrt(),
        }
    }
}

/// Twists of a setpoint in the axes of its base.
fn in_base<const N: usize>(setpoint: &Setpoint, twists_in_odom: [Twist2; N]) -> [[f64; 3]; N] {
    let (sin, cos) = setpoint.odom_from_base.heading_rad.sin_cos();
    twists_in_odom.map(|Twist2 { vx_m_s, vy_m_s, w_rad_s }| {
        [cos * vx_m_s + sin * vy_m_s, cos * vy_m_s - sin * vx_m_s, w_rad_s]
    })
}

/// Whether a twist, or a rate of it, is within two limits, told without a root.
fn is_below(twist: &Twist2, along: f64, turn: f64) -> bool {
    twist.vx_m_s.powi(2) + twist.vy_m_s.powi(2) <= along.powi(2) && twist.w_rad_s.abs() <= turn
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
