//! Ways without times: where the platform goes, and how its heading turns on the way.

use omnibase_platform::Pose2;

use crate::polynomial::{End, Polynomial};
use crate::shape::{Heading, Shape};

/// A way over a parameter σ from 0 to its length: continuous, and with a continuous direction but for corners.
pub trait GeometricPath {
    /// The greatest σ.
    fn length(&self) -> f64;

    /// x, y (m) and heading (rad, not wrapped) at σ, each with its first three derivatives by σ.
    ///
    /// `side` says which of two pieces counts at their joint: below 0 the one before it.
    fn sample(&self, sigma: f64, side: f64) -> [[f64; 4]; 3];

    /// The same, looked for first in a piece and the one behind it; which one it was is kept for the next.
    fn sample_near(&self, sigma: f64, side: f64, _piece: &mut usize) -> [[f64; 4]; 3] {
        self.sample(sigma, side)
    }

    /// The joints of its pieces with beginning and end, rising: only there may derivatives jump.
    fn breaks(&self) -> Vec<f64>;

    /// How fast σ may rise at a place at most, whatever else the limits allow, 1/s.
    fn most_rate(&self, _sigma: f64) -> f64 {
        f64::INFINITY
    }
}

impl<T: GeometricPath + ?Sized> GeometricPath for &T {
    fn length(&self) -> f64 {
        (**self).length()
    }

    fn sample(&self, sigma: f64, side: f64) -> [[f64; 4]; 3] {
        (**self).sample(sigma, side)
    }

    fn sample_near(&self, sigma: f64, side: f64, piece: &mut usize) -> [[f64; 4]; 3] {
        (**self).sample_near(sigma, side, piece)
    }

    fn breaks(&self) -> Vec<f64> {
        (**self).breaks()
    }

    fn most_rate(&self, sigma: f64) -> f64 {
        (**self).most_rate(sigma)
    }
}

impl<T: GeometricPath + ?Sized> GeometricPath for Box<T> {
    fn length(&self) -> f64 {
        (**self).length()
    }

    fn sample(&self, sigma: f64, side: f64) -> [[f64; 4]; 3] {
        (**self).sample(sigma, side)
    }

    fn sample_near(&self, sigma: f64, side: f64, piece: &mut usize) -> [[f64; 4]; 3] {
        (**self).sample_near(sigma, side, piece)
    }

    fn breaks(&self) -> Vec<f64> {
        (**self).breaks()
    }

    fn most_rate(&self, sigma: f64) -> f64 {
        (**self).most_rate(sigma)
    }
}

/// A way of polynomial pieces.
#[derive(Clone, Debug, PartialEq)]
pub struct PiecewisePath {
    breaks: Vec<f64>,
    pieces: Vec<[Polynomial; 3]>,
}

/// How points become a way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joining {
    /// What a turn by one radian counts, in m of way.
    pub radius_m: f64,
    /// Where the way turns by more than this at a point, the point is a corner, rad; elsewhere it is smooth.
    pub corner_rad: f64,
    /// How far the way may cut a corner, m; 0: it leads through it, and the platform stops there.
    pub tolerance_m: f64,
}

/// A blend takes at most this part of the ways beside it.
const MOST_OF_LEG: f64 = 0.45;
/// Points that are nearer than this are one, m: what lies between them is rounding, and has no direction.
const SAME_M: f64 = 1e-9;
/// A blend's length over the ways that it replaces, by which a right angle is passed soonest.
const BLEND_LENGTH: f64 = 0.9;

impl PiecewisePath {
    /// The way through points: C2 cubic splines over the chords, with corners cut by quintics that keep direction and curvature
    /// continuous. Points that repeat, but for rounding, count once; `None` where fewer than two are left.
    pub fn through(poses: &[Pose2], joining: Joining) -> Option<PiecewisePath> {
        let mut points: Vec<[f64; 3]> = Vec::with_capacity(poses.len());
        for pose in poses {
            let point = [pose.x_m, pose.y_m, pose.heading_rad];
            if points.last().is_none_or(|last| distance(last, &point, joining.radius_m) > SAME_M) {
                points.push(point);
            }
        }
        let chords: Vec<f64> =
            points.windows(2).map(|pair| distance(&pair[0], &pair[1], joining.radius_m)).collect();
        if chords.is_empty() {
            return None;
        }
        let mut path = PiecewisePath { breaks: vec![0.0], pieces: Vec::new() };
        let mut from = 0;
        for to in 1..points.len() {
            if to + 1 < points.len() && !is_corner(&points[to - 1..=to + 1], &chords[to - 1..=to], joining) {
                continue;
            }
            let pieces = spline(&points[from..=to], &chords[from..to]);
            path.append(pieces, &chords[from..to], joining);
            from = to;
        }
        Some(path)
    }

    /// Control points of its pieces as Bézier curves of degree 3, in x, y and heading; a cut corner is none, and comes near.
    pub fn beziers(&self) -> impl Iterator<Item = [[f64; 3]; 4]> {
        self.pieces.iter().zip(self.breaks.windows(2)).map(|(piece, ends)| {
            let length = ends[1] - ends[0];
            let third = |at: f64, sign: f64| {
                let [at, rate] = [value(piece, at, 0), value(piece, at, 1)];
                std::array::from_fn(|axis| at[axis] + sign * rate[axis] * length / 3.0)
            };
            [third(0.0, 0.0), third(0.0, 1.0), third(length, -1.0), third(length, 0.0)]
        })
    }

    /// Puts smooth pieces behind the others; the corner between them is cut.
    fn append(&mut self, mut pieces: Vec<[Polynomial; 3]>, chords: &[f64], joining: Joining) {
        let end = self.breaks[self.breaks.len() - 1];
        let mut breaks: Vec<f64> = vec![0.0];
        for chord in chords {
            breaks.push(breaks[breaks.len() - 1] + chord);
        }
        if self.pieces.is_empty() || joining.tolerance_m <= 0.0 {
            self.breaks.extend(breaks[1..].iter().map(|at| end + at));
            self.pieces.append(&mut pieces);
            return;
        }
        let last = self.pieces.len() - 1;
        let (before, after) = (end - self.breaks[last], chords[0]);
        let corner = value(&pieces[0], 0.0, 0);
        let mut leg = MOST_OF_LEG * before.min(after);
        // A blend's distance from its corner is all but proportional to its legs.
        let blend = loop {
            let ends = [(self.pieces[last], before - leg), (pieces[0], leg)];
            let blend = quintic(ends, 2.0 * BLEND_LENGTH * leg);
            let middle = value(&blend, BLEND_LENGTH * leg, 0);
            let off_m = (middle[0] - corner[0]).hypot(middle[1] - corner[1]);
            if off_m <= joining.tolerance_m * (1.0 + 1e-9) {
                break blend;
            }
            leg *= (joining.tolerance_m / off_m).min(0.999);
        };
        self.breaks[last + 1] = end - leg;
        let blend_end = end - leg + 2.0 * BLEND_LENGTH * leg;
        self.breaks.push(blend_end);
        self.pieces.push(blend);
        pieces[0] = pieces[0].map(|polynomial| polynomial.shifted(leg));
        self.breaks.extend(breaks[1..].iter().map(|at| blend_end + at - leg));
        self.pieces.append(&mut pieces);
    }
}

impl GeometricPath for PiecewisePath {
    fn length(&self) -> f64 {
        self.breaks[self.breaks.len() - 1]
    }

    fn sample(&self, sigma: f64, side: f64) -> [[f64; 4]; 3] {
        self.sample_near(sigma, side, &mut 0)
    }

    fn sample_near(&self, sigma: f64, side: f64, piece: &mut usize) -> [[f64; 4]; 3] {
        let begun = |begin: &f64| if side < 0.0 { *begin < sigma } else { *begin <= sigma };
        let last = self.pieces.len() - 1;
        let is_in = |piece: usize| {
            piece <= last && begun(&self.breaks[piece]) && (piece == last || !begun(&self.breaks[piece + 1]))
        };
        if !is_in(*piece) {
            let next = *piece + 1;
            let found = || self.breaks.partition_point(begun).clamp(1, last + 1) - 1;
            *piece = if is_in(next) { next } else { found() };
        }
        let since = sigma - self.breaks[*piece];
        self.pieces[*piece].each_ref().map(|polynomial| polynomial.derivatives(since))
    }

    fn breaks(&self) -> Vec<f64> {
        self.breaks.clone()
    }
}

/// Parts of a shape's turn between joints, although it is smooth there.
const PARTS_OF_TURN: f64 = 8.0;

/// A shape, over its angle φ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShapePath {
    /// Which one.
    pub shape: Shape,
    /// How the heading goes along it.
    pub heading: Heading,
    /// How often it is gone round, positive.
    pub turns: f64,
}

impl GeometricPath for ShapePath {
    fn length(&self) -> f64 {
        std::f64::consts::TAU * self.turns
    }

    fn sample(&self, sigma: f64, _: f64) -> [[f64; 4]; 3] {
        self.shape.axes(self.heading, [sigma, 1.0, 0.0, 0.0])
    }

    fn breaks(&self) -> Vec<f64> {
        // Where a turn ends it looks as where it began: whoever looks at the ends of larger parts alone sees nothing of it.
        let parts = (PARTS_OF_TURN * self.turns).ceil().max(1.0) as usize;
        let part = self.length() / parts as f64;
        (0..parts).map(|at| part * at as f64).chain([self.length()]).collect()
    }
}

fn distance(from: &[f64; 3], to: &[f64; 3], radius_m: f64) -> f64 {
    (to[0] - from[0]).hypot(to[1] - from[1]).hypot(radius_m * (to[2] - from[2]))
}

/// Whether three points turn by more than a corner does, with the heading's part of the way counted too.
fn is_corner(points: &[[f64; 3]], chords: &[f64], joining: Joining) -> bool {
    let scale = [1.0, 1.0, joining.radius_m];
    let direction =
        |at: usize, axis: usize| scale[axis] * (points[at + 1][axis] - points[at][axis]) / chords[at];
    let cosine: f64 = (0..3).map(|axis| direction(0, axis) * direction(1, axis)).sum();
    cosine < joining.corner_rad.cos()
}

/// A derivative of all three axes.
fn value(piece: &[Polynomial; 3], at: f64, order: usize) -> [f64; 3] {
    piece.each_ref().map(|polynomial| polynomial.derivatives(at)[order])
}

/// The quintics from a place on one piece to a place on another.
fn quintic(ends: [([Polynomial; 3], f64); 2], length: f64) -> [Polynomial; 3] {
    let end = |(piece, at): &([Polynomial; 3], f64), axis: usize| {
        let [position, speed, acceleration, _] = piece[axis].derivatives(*at);
        End { position, speed, acceleration }
    };
    std::array::from_fn(|axis| Polynomial::quintic(end(&ends[0], axis), end(&ends[1], axis), length))
}

/// The C2 cubic spline through points, with a constant second derivative in its first and last piece.
fn spline(points: &[[f64; 3]], chords: &[f64]) -> Vec<[Polynomial; 3]> {
    let speeds: [Vec<f64>; 3] = std::array::from_fn(|axis| {
        let values: Vec<f64> = points.iter().map(|point| point[axis]).collect();
        spline_speeds(&values, chords)
    });
    let cubic = |piece: usize, axis: usize| {
        let end = |at: usize| End { position: points[at][axis], speed: speeds[axis][at], acceleration: 0.0 };
        Polynomial::cubic(end(piece), end(piece + 1), chords[piece])
    };
    (0..chords.len()).map(|piece| std::array::from_fn(|axis| cubic(piece, axis))).collect()
}

/// The slopes at the points: a tridiagonal system, solved by elimination.
pub(crate) fn spline_speeds(values: &[f64], lengths: &[f64]) -> Vec<f64> {
    let last = lengths.len();
    let slope = |piece: usize| (values[piece + 1] - values[piece]) / lengths[piece];
    if last == 1 {
        return vec![slope(0); 2];
    }
    // Rows lower·v₋ + diagonal·v + upper·v₊ = right.
    let row = |at: usize| -> [f64; 4] {
        if at == 0 {
            [0.0, 1.0, 1.0, 2.0 * slope(0)]
        } else if at == last {
            [1.0, 1.0, 0.0, 2.0 * slope(last - 1)]
        } else {
            let (h, g) = (lengths[at - 1], lengths[at]);
            [1.0 / h, 2.0 * (1.0 / h + 1.0 / g), 1.0 / g, 3.0 * (slope(at - 1) / h + slope(at) / g)]
        }
    };
    let mut speeds = vec![0.0; last + 1];
    let mut uppers = vec![0.0; last + 1];
    for at in 0..=last {
        let [lower, diagonal, upper, right] = row(at);
        let (upper_before, speed_before) =
            if at == 0 { (0.0, 0.0) } else { (uppers[at - 1], speeds[at - 1]) };
        let pivot = diagonal - lower * upper_before;
        uppers[at] = upper / pivot;
        speeds[at] = (right - lower * speed_before) / pivot;
    }
    for at in (0..last).rev() {
        speeds[at] -= uppers[at] * speeds[at + 1];
    }
    speeds
}
