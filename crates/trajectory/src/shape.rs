//! Geometric shapes, travelled once from rest to rest.
//!
//! Each shape is a curve p(φ) that begins at the origin in the direction of x. φ runs from 0 to its end by the
//! minimum-jerk law φ = φₑ·(10τ³ − 15τ⁴ + 6τ⁵), τ = t/T: speed and acceleration are zero at both ends.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

use crate::polynomial::{End, Polynomial, over_time};
use crate::trajectory::{LONGEST_S, Setpoint, Trajectory};

/// A curve in the plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// A circle to the left.
    Circle {
        /// Its radius, in m.
        radius_m: f64,
    },
    /// An ellipse to the left.
    Ellipse {
        /// The half axis along x, in m.
        half_length_m: f64,
        /// The half axis along y, in m.
        half_width_m: f64,
    },
    /// An Archimedes spiral outwards, to the left.
    Spiral {
        /// By how much the radius grows per turn, in m.
        step_m: f64,
    },
    /// A figure of eight (Gerono's lemniscate), which turns both ways and ends as it began.
    Eight {
        /// From its centre to an end, in m.
        half_length_m: f64,
    },
}

/// How the heading goes along the curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heading {
    /// It stays.
    Fixed,
    /// It follows the tangent: the holonomic trajectory.
    FollowsTangent,
}

/// A shape travelled in a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapeTrajectory {
    shape: Shape,
    heading: Heading,
    progress: Progress,
}

/// How far along the curve it is over time.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Progress {
    /// From rest to rest: φ over time.
    Once { phase: Polynomial, duration_s: f64 },
    /// From rest to a constant rate that never ends: φ, but of a spiral, which grows, the way in m.
    Endless { start: Polynomial, start_s: f64, rate: f64, turn_s: f64 },
}

/// Why a shape was refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ShapeError {
    /// A length, time or number of turns that is not positive.
    #[error("{setting} is {found}, expected a positive number")]
    Setting {
        /// Which setting.
        setting: &'static str,
        /// What was found.
        found: f64,
    },
    /// A motion beyond any use.
    #[error("it takes {found_s} s, expected at most {LONGEST_S} s")]
    TooLong {
        /// How long it takes.
        found_s: f64,
    },
}

/// A curve's point, or one of its derivatives by φ.
type Point = [f64; 2];

impl ShapeTrajectory {
    /// `shape`, `turns` times round (1 for once), in `duration_s`.
    pub fn new(
        shape: Shape,
        heading: Heading,
        turns: f64,
        duration_s: f64,
    ) -> Result<ShapeTrajectory, ShapeError> {
        let own = match shape {
            Shape::Circle { radius_m } => [("radius_m", radius_m), ("turns", turns)],
            Shape::Ellipse { half_length_m, half_width_m } => {
                [("half_length_m", half_length_m), ("half_width_m", half_width_m)]
            }
            Shape::Spiral { step_m } => [("step_m", step_m), ("turns", turns)],
            Shape::Eight { half_length_m } => [("half_length_m", half_length_m), ("turns", turns)],
        };
        for (setting, found) in own.into_iter().chain([("turns", turns), ("duration_s", duration_s)]) {
            if !(found.is_finite() && found > 0.0) {
                return Err(ShapeError::Setting { setting, found });
            }
        }
        if duration_s > LONGEST_S {
            return Err(ShapeError::TooLong { found_s: duration_s });
        }
        let end = End { position: TAU * turns, ..End::default() };
        let phase = Polynomial::quintic(End::default(), end, duration_s);
        Ok(ShapeTrajectory { shape, heading, progress: Progress::Once { phase, duration_s } })
    }

    /// `shape` without an end, each turn in `period_s` once it goes at its rate; a spiral's first turn takes so long, and
    /// it goes on at that speed.
    pub fn endless(shape: Shape, heading: Heading, period_s: f64) -> Result<ShapeTrajectory, ShapeError> {
        // One turn in this time is checked like any other.
        ShapeTrajectory::new(shape, heading, 1.0, period_s)?;
        let turn = match shape {
            Shape::Spiral { step_m } => spiral_way_m(step_m / TAU, TAU),
            _ => TAU,
        };
        let (rate, start_s) = (turn / period_s, 0.5 * period_s);
        // Half the time at half the rate on average.
        let end = End { position: 0.5 * rate * start_s, speed: rate, acceleration: 0.0 };
        let start = Polynomial::quintic(End::default(), end, start_s);
        let progress = Progress::Endless { start, start_s, rate, turn_s: period_s };
        Ok(ShapeTrajectory { shape, heading, progress })
    }

    /// φ and its first three derivatives by time.
    fn phase(&self, time_s: f64) -> [f64; 4] {
        match self.progress {
            Progress::Once { phase, .. } => phase.derivatives(time_s),
            Progress::Endless { start, start_s, rate, .. } => {
                let way = match time_s - start_s {
                    beyond_s if beyond_s > 0.0 => [rate * (0.5 * start_s + beyond_s), rate, 0.0, 0.0],
                    _ => start.derivatives(time_s),
                };
                match self.shape {
                    Shape::Spiral { step_m } => over_time(spiral_phase(step_m / TAU, way[0]), way),
                    _ => way,
                }
            }
        }
    }
}

/// The way along a spiral r = k·φ from its centre, in m: k/2·(φ·√(1+φ²) + asinh φ).
fn spiral_way_m(k: f64, phi: f64) -> f64 {
    0.5 * k * (phi * phi.hypot(1.0) + phi.asinh())
}

/// φ of a spiral r = k·φ where the way is so long, in m, and its first three derivatives by the way.
fn spiral_phase(k: f64, way_m: f64) -> [f64; 4] {
    // Newton's method from below both asymptotes: the way is convex in φ, so it converges from its second step on.
    let mut phi = (way_m / k).min((2.0 * way_m / k).sqrt());
    for _ in 0..8 {
        phi -= (spiral_way_m(k, phi) - way_m) / (k * phi.hypot(1.0));
    }
    let w = phi.hypot(1.0);
    [phi, 1.0 / (k * w), -phi / (k * k * w.powi(4)), (4.0 * phi * phi - w * w) / (k.powi(3) * w.powi(7))]
}

impl Trajectory for ShapeTrajectory {
    fn duration_s(&self) -> f64 {
        match self.progress {
            Progress::Once { duration_s, .. } => duration_s,
            Progress::Endless { .. } => f64::INFINITY,
        }
    }

    fn breaks_s(&self) -> Vec<f64> {
        match self.progress {
            Progress::Once { duration_s, .. } => vec![0.0, duration_s],
            // What follows repeats, and of a spiral it bends less and less.
            Progress::Endless { start_s, turn_s, .. } => vec![0.0, start_s, start_s + turn_s],
        }
    }

    fn sample(&self, time_s: f64) -> Setpoint {
        let duration_s = self.duration_s();
        let inside = (0.0..=duration_s).contains(&time_s);
        let time_s = if time_s > 0.0 { time_s.min(duration_s) } else { 0.0 };
        let phase = self.phase(time_s);
        let setpoint = Setpoint::from_axes(self.shape.axes(self.heading, phase));
        if inside { setpoint } else { Setpoint::at_rest(setpoint.odom_from_base) }
    }
}

impl Shape {
    /// x, y and heading, each with three derivatives by what φ and its derivatives are given by.
    pub(crate) fn axes(&self, heading: Heading, phase: [f64; 4]) -> [[f64; 4]; 3] {
        let curve = self.curve(phase[0]);
        let heading = match heading {
            Heading::Fixed => [0.0; 4],
            Heading::FollowsTangent => over_time(self.tangent(phase[0], &curve), phase),
        };
        let axis = |at: usize| over_time([curve[0][at], curve[1][at], curve[2][at], curve[3][at]], phase);
        [axis(0), axis(1), heading]
    }

    /// The point and its first four derivatives by φ.
    fn curve(&self, phi: f64) -> [Point; 5] {
        let (sin, cos) = phi.sin_cos();
        match *self {
            Shape::Circle { radius_m: r } => ellipse(r, r, sin, cos),
            Shape::Ellipse { half_length_m, half_width_m } => ellipse(half_length_m, half_width_m, sin, cos),
            Shape::Spiral { step_m } => {
                let k = step_m / TAU;
                // The n-th derivative of φ·e^{iφ} is iⁿ·(φ − i·n)·e^{iφ}.
                let turned = [[cos, sin], [-sin, cos], [-cos, -sin], [sin, -cos], [cos, sin], [-sin, cos]];
                std::array::from_fn(|n| {
                    let before = turned[(n + 3) % 4];
                    [0, 1].map(|at| k * (phi * turned[n][at] + n as f64 * before[at]))
                })
            }
            Shape::Eight { half_length_m: a } => {
                let (sin2, cos2) = (2.0 * phi).sin_cos();
                // (sin φ, sin 2φ / 2), turned by −45° so that it leaves along x.
                [[sin, sin2 / 2.0], [cos, cos2], [-sin, -2.0 * sin2], [-cos, -4.0 * cos2], [sin, 8.0 * sin2]]
                    .map(|[x, y]| [a * (x + y) * 0.5_f64.sqrt(), a * (y - x) * 0.5_f64.sqrt()])
            }
        }
    }

    /// The tangent's angle, continuous from 0, and its first three derivatives by φ.
    fn tangent(&self, phi: f64, curve: &[Point; 5]) -> [f64; 4] {
        let (sin, cos) = phi.sin_cos();
        let angle = match *self {
            Shape::Circle { .. } => phi,
            Shape::Ellipse { half_length_m: a, half_width_m: b } => {
                phi + ((b - a) * sin * cos).atan2(a * cos * cos + b * sin * sin)
            }
            Shape::Spiral { .. } => phi + phi.atan(),
            Shape::Eight { .. } => {
                let direction = (2.0 * phi).cos().atan2(cos);
                // The tangent goes round by the right, past −π; atan2 jumps there.
                let direction = if direction > FRAC_PI_2 { direction - TAU } else { direction };
                direction - FRAC_PI_4
            }
        };
        let [_, d1, d2, d3, d4] = *curve;
        let cross = |a: Point, b: Point| a[0] * b[1] - a[1] * b[0];
        let dot = |a: Point, b: Point| a[0] * b[0] + a[1] * b[1];
        // ψ' = c/q with c = p'×p'' and q = |p'|², then the quotient rule.
        let (c, c1, c2) = (cross(d1, d2), cross(d1, d3), cross(d2, d3) + cross(d1, d4));
        let (q, q1, q2) = (dot(d1, d1), 2.0 * dot(d1, d2), 2.0 * (dot(d2, d2) + dot(d1, d3)));
        [
            angle,
            c / q,
            (c1 * q - c * q1) / (q * q),
            c2 / q - (2.0 * c1 * q1 + c * q2) / (q * q) + 2.0 * c * q1 * q1 / (q * q * q),
        ]
    }
}

/// An ellipse that begins at the origin along x.
fn ellipse(a: f64, b: f64, sin: f64, cos: f64) -> [Point; 5] {
    [
        [a * sin, b * (1.0 - cos)],
        [a * cos, b * sin],
        [-a * sin, b * cos],
        [-a * cos, -b * sin],
        [a * sin, -b * cos],
    ]
}
