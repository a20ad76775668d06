//! Trajectories through path points.

use omnibase_platform::Pose2;

use crate::path_points::PathPoints;
use crate::polynomial::{End, Polynomial};
use crate::trajectory::{Setpoint, Trajectory};

/// How the speed at a point follows from the slopes of the segments before and after it.
///
/// Either way it is zero at the ends and where the slope changes its sign (or is zero on one side), so that a
/// coordinate never overshoots its points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpeedRule {
    /// The slope of the segment before (thesis, 8.7).
    PreviousSlope,
    /// The mean of both slopes.
    MeanSlope,
}

/// How points become a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// Cubics whose acceleration is continuous where the points lie smoothly, at rest at both ends; at corners, and where the speed
    /// changes much from one segment to the next, the speed of [`SpeedRule::PreviousSlope`], so that right angles are stops.
    Smooth,
    /// A cubic per segment; speed is continuous, acceleration jumps at the points.
    Cubic(SpeedRule),
    /// A quintic per segment with rest at every point; acceleration is continuous.
    Quintic,
    /// Cubics whose acceleration is continuous at inner points (C2), at rest at both ends; it may overshoot.
    Spline,
    /// A cubic B-spline with the points as control points: C2 with rest at both ends, inside the points' hull, but
    /// past inner points, not through them.
    BSpline,
}

/// A trajectory of path points; its time begins at the first one.
#[derive(Clone, Debug, PartialEq)]
pub struct PointTrajectory {
    /// The times at which pieces begin, and the end of the last one.
    breaks_s: Vec<f64>,
    /// x, y and heading over each piece.
    pieces: Vec<[Polynomial; 3]>,
}

impl PointTrajectory {
    /// The motion along points.
    pub fn new(points: &PathPoints, interpolation: Interpolation) -> PointTrajectory {
        let start_s = points.as_slice()[0].time_s;
        let times_s: Vec<f64> = points.as_slice().iter().map(|point| point.time_s - start_s).collect();
        let axis = |of: fn(&Pose2) -> f64| -> Vec<f64> {
            points.as_slice().iter().map(|point| of(&point.odom_from_base)).collect()
        };
        let axes = [axis(|pose| pose.x_m), axis(|pose| pose.y_m), axis(|pose| pose.heading_rad)];
        if interpolation == Interpolation::BSpline {
            return b_spline(&times_s, &axes);
        }
        let durations_s: Vec<f64> = times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let fixed = match interpolation {
            Interpolation::Smooth => rough_points(&axes, &durations_s),
            _ => Vec::new(),
        };
        let speeds = axes.each_ref().map(|values| match interpolation {
            Interpolation::Smooth => smooth_speeds(values, &durations_s, &fixed),
            Interpolation::Cubic(rule) => speeds_by_rule(values, &durations_s, rule),
            Interpolation::Spline => clamped_spline_speeds(values, &durations_s),
            Interpolation::Quintic | Interpolation::BSpline => vec![0.0; values.len()],
        });
        let pieces = (0..durations_s.len())
            .map(|at| {
                std::array::from_fn(|axis| {
                    let end = |at: usize| End {
                        position: axes[axis][at],
                        speed: speeds[axis][at],
                        acceleration: 0.0,
                    };
                    match interpolation {
                        Interpolation::Quintic => Polynomial::quintic(end(at), end(at + 1), durations_s[at]),
                        _ => Polynomial::cubic(end(at), end(at + 1), durations_s[at]),
                    }
                })
            })
            .collect();
        PointTrajectory { breaks_s: times_s, pieces }
    }
}

impl PointTrajectory {
    /// Its pieces, and the times at which they begin, with the end of the last one.
    pub(crate) fn pieces(&self) -> (&[[Polynomial; 3]], &[f64]) {
        (&self.pieces, &self.breaks_s)
    }
}

impl Trajectory for PointTrajectory {
    fn duration_s(&self) -> f64 {
        self.breaks_s[self.breaks_s.len() - 1]
    }

    fn sample(&self, time_s: f64) -> Setpoint {
        let inside = (0.0..=self.duration_s()).contains(&time_s);
        // NaN is before the beginning: it must not move anything.
        let time_s = if time_s > 0.0 { time_s.min(self.duration_s()) } else { 0.0 };
        let piece =
            self.breaks_s.partition_point(|begin_s| *begin_s <= time_s).clamp(1, self.pieces.len()) - 1;
        let within_s = time_s - self.breaks_s[piece];
        let setpoint = Setpoint::from_axes(
            self.pieces[piece].each_ref().map(|polynomial| polynomial.derivatives(within_s)),
        );
        if inside { setpoint } else { Setpoint::at_rest(setpoint.odom_from_base) }
    }

    fn breaks_s(&self) -> Vec<f64> {
        self.breaks_s.clone()
    }
}

/// The speed at each point by a rule of [`SpeedRule`].
fn speeds_by_rule(values: &[f64], durations_s: &[f64], rule: SpeedRule) -> Vec<f64> {
    let slopes: Vec<f64> = values
        .windows(2)
        .zip(durations_s)
        .map(|(pair, duration_s)| (pair[1] - pair[0]) / duration_s)
        .collect();
    let mut speeds = vec![0.0; values.len()];
    for (at, pair) in slopes.windows(2).enumerate() {
        speeds[at + 1] = match rule {
            _ if pair[0] * pair[1] <= 0.0 => 0.0,
            SpeedRule::PreviousSlope => pair[0],
            SpeedRule::MeanSlope => (pair[0] + pair[1]) / 2.0,
        };
    }
    speeds
}

/// What a turn by one radian counts, in m, where points are compared.
const RADIUS_M: f64 = 0.5;
/// Where the way turns by more than this at a point it is a corner, cos 30°.
const CORNER_COSINE: f64 = 0.866_025_403_784_438_6;
/// Where the speed becomes more than so many times as great, or as small, a spline might overshoot: up to 5 a cubic between the mean
/// of both and the smaller one keeps its direction (F. N. Fritsch and R. E. Carlson, *Monotone Piecewise Cubic Interpolation*, 1980).
const MOST_CHANGE: f64 = 4.0;

/// Where splines end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rough {
    /// The first and the last point, and corners: the thesis's rule counts.
    Corner(usize),
    /// The speed changes much: the smaller one of both counts, so that nothing overshoots.
    Change(usize),
}

impl Rough {
    fn at(self) -> usize {
        let (Rough::Corner(at) | Rough::Change(at)) = self;
        at
    }
}

/// The first and the last point, and between them those at which the way has a corner or changes its speed much.
fn rough_points(axes: &[Vec<f64>; 3], durations_s: &[f64]) -> Vec<Rough> {
    let scale = [1.0, 1.0, RADIUS_M];
    let slope = |at: usize| -> [f64; 3] {
        std::array::from_fn(|axis| scale[axis] * (axes[axis][at + 1] - axes[axis][at]) / durations_s[at])
    };
    let dot = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let last = durations_s.len();
    let rough = |at: usize| {
        let (before, after) = (slope(at - 1), slope(at));
        let [square, other] = [dot(&before, &before), dot(&after, &after)];
        if dot(&before, &after) < CORNER_COSINE * (square * other).sqrt() {
            Some(Rough::Corner(at))
        } else {
            let changes = square.max(other) > MOST_CHANGE * MOST_CHANGE * square.min(other);
            changes.then_some(Rough::Change(at))
        }
    };
    let ends = [0, last].map(Rough::Corner);
    [ends[0]].into_iter().chain((1..last).filter_map(rough)).chain([ends[1]]).collect()
}

/// The speeds of a spline between points at which the rule's count; at rest at the ends.
fn smooth_speeds(values: &[f64], durations_s: &[f64], fixed: &[Rough]) -> Vec<f64> {
    let mut speeds = speeds_by_rule(values, durations_s, SpeedRule::PreviousSlope);
    for rough in fixed {
        if let Rough::Change(at) = rough {
            let slope = |at: usize| (values[at + 1] - values[at]) / durations_s[at];
            let (before, after) = (slope(at - 1), slope(*at));
            speeds[*at] =
                if before * after <= 0.0 { 0.0 } else { before.abs().min(after.abs()).copysign(before) };
        }
    }
    for pair in fixed.windows(2) {
        let [from, to] = [pair[0], pair[1]].map(Rough::at);
        let ends = [speeds[from], speeds[to]];
        let between = spline_speeds_between(&values[from..=to], &durations_s[from..to], ends);
        speeds[from..=to].copy_from_slice(&between);
    }
    speeds
}

/// The speeds that make accelerations continuous at inner points, with zero speed at both ends.
///
/// For segments h, g before and after a point: v₋/h + 2v(1/h + 1/g) + v₊/g = 3(Δ₋/h² + Δ₊/g²), a tridiagonal
/// system with a dominant diagonal, solved by elimination without pivots.
pub fn clamped_spline_speeds(values: &[f64], durations_s: &[f64]) -> Vec<f64> {
    spline_speeds_between(values, durations_s, [0.0, 0.0])
}

/// The same with any speeds at both ends.
fn spline_speeds_between(values: &[f64], durations_s: &[f64], [first, last]: [f64; 2]) -> Vec<f64> {
    let count = values.len();
    let mut speeds = vec![0.0; count];
    let mut upper = vec![0.0; count];
    (speeds[0], speeds[count - 1]) = (first, last);
    for at in 1..count.saturating_sub(1) {
        let (h, g) = (durations_s[at - 1], durations_s[at]);
        let right = 3.0 * ((values[at] - values[at - 1]) / (h * h) + (values[at + 1] - values[at]) / (g * g));
        let diagonal = 2.0 * (1.0 / h + 1.0 / g) - upper[at - 1] / h;
        upper[at] = 1.0 / g / diagonal;
        speeds[at] = (right - speeds[at - 1] / h) / diagonal;
    }
    for at in (1..count.saturating_sub(1)).rev() {
        speeds[at] -= upper[at] * speeds[at + 1];
    }
    speeds
}

/// The clamped cubic B-spline, its end points counted three times so that it begins and ends at rest.
fn b_spline(times_s: &[f64], axes: &[Vec<f64>; 3]) -> PointTrajectory {
    let last = times_s.len() - 1;
    let spans = last + 2;
    // Knots at equal steps of the points' index: where points are close in time, so are knots.
    let breaks_s: Vec<f64> = (0..=spans)
        .map(|at| {
            let index = at as f64 * last as f64 / spans as f64;
            let before = (index as usize).min(last - 1);
            times_s[before] + (times_s[before + 1] - times_s[before]) * (index - before as f64)
        })
        .collect();
    let knot = |at: usize| breaks_s[at.saturating_sub(3).min(spans)];
    let control = |axis: usize, at: usize| axes[axis][at.saturating_sub(2).min(last)];
    // Span s lies between knots s+3 and s+4 and has the controls s to s+3.
    let value = |axis: usize, span: usize, time_s: f64, order: usize| {
        let mut points: [f64; 4] = std::array::from_fn(|at| control(axis, span + at));
        for level in 1..=3 {
            for at in (level..4).rev() {
                let (from, to) = (knot(span + at), knot(span + at + 4 - level));
                points[at] = if level <= order {
                    (points[at] - points[at - 1]) * (4 - level) as f64 / (to - from)
                } else {
                    let part = (time_s - from) / (to - from);
                    points[at - 1] + (points[at] - points[at - 1]) * part
                };
            }
        }
        points[3]
    };
    let pieces = (0..spans)
        .map(|span| {
            std::array::from_fn(|axis| {
                let end = |time_s: f64| End {
                    position: value(axis, span, time_s, 0),
                    speed: value(axis, span, time_s, 1),
                    acceleration: 0.0,
                };
                let (from_s, to_s) = (breaks_s[span], breaks_s[span + 1]);
                // A cubic is known by its ends and their speeds.
                Polynomial::cubic(end(from_s), end(to_s), to_s - from_s)
            })
        })
        .collect();
    PointTrajectory { breaks_s, pieces }
}
