//! From where a robot was driven by hand to a path that it repeats.

use omnibase_platform::Pose2;
use omnibase_robot::config::motion_limits;
use omnibase_robot::config::{InterpolationName, Limits, PathFrame, ReferenceTable};
use omnibase_trajectory::limits::Retiming;
use omnibase_trajectory::path_points::nearest_turn_rad;
use omnibase_trajectory::{
    Interpolation, PathPoint, PathPoints, PathPointsError, PointTrajectory, Trajectory, limits,
};

use crate::live::TracePoint;

/// Where nothing moves faster than this a trace is at rest: m, and rad, between two of its points.
const REST: f64 = 1e-6;
/// A heading's error counts as the way of a point so far from the centre, m.
const ARM_M: f64 = 0.5;
/// Points of a path at most.
const MOST_POINTS: usize = 2000;
/// Half the width of the smoothing window, in points that were remembered.
const SMOOTHED: usize = 2;

/// When a point is remembered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sampling {
    /// Every so many seconds.
    Period {
        /// Seconds.
        period_s: f64,
    },
    /// After a change of the pose by so much.
    Change {
        /// Metres.
        distance_m: f64,
        /// Radians.
        angle_rad: f64,
    },
}

/// Why no path came of it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TeachError {
    /// Nothing moved.
    #[error("the robot didn't move while it was taught")]
    NoMotion,
    /// What was asked makes no sense.
    #[error("{what}: expected {expected}, found {found}")]
    Value {
        /// Which value.
        what: &'static str,
        /// What would do.
        expected: &'static str,
        /// What was given.
        found: f64,
    },
    /// The points make no path.
    #[error(transparent)]
    Points(#[from] PathPointsError),
    /// The path would be farther from where the robot was.
    #[error(
        "no path of {MOST_POINTS} points stays within {tolerance_m} m of where the robot was: expected a shorter drive, or a wider tolerance; found {found_m} m"
    )]
    TooFar {
        /// What was allowed.
        tolerance_m: f64,
        /// What was reached.
        found_m: f64,
    },
}

/// A path that was taught.
#[derive(Clone, Debug, PartialEq)]
pub struct Taught {
    /// The reference: points in odom, joined by a C2 spline, or by straight ways.
    pub reference: ReferenceTable,
    /// Points of the trace that were remembered, before thinning.
    pub remembered: usize,
    /// The greatest distance between path and remembered points, m; a heading's error counts with an arm of 0.5 m.
    pub deviation_m: f64,
}

/// Makes a path of a trace: at rest at both ends, smoothed and thinned within `tolerance_m`, and where the limits
/// ask for it slower than it was driven.
pub fn taught(
    trace: &[TracePoint],
    sampling: Sampling,
    tolerance_m: f64,
    limits: &Limits,
) -> Result<Taught, TeachError> {
    if !(tolerance_m > 0.0 && tolerance_m.is_finite()) {
        return Err(TeachError::Value { what: "tolerance_m", expected: "more than 0", found: tolerance_m });
    }
    let remembered = remembered(moving(trace), sampling)?;
    if remembered.len() < 2 {
        return Err(TeachError::NoMotion);
    }
    let smooth = smoothed(&remembered, 0.5 * tolerance_m);
    let (points, deviation_m) = thinned(&smooth, &remembered, tolerance_m)?;
    let points = limits::retimed(&points, Interpolation::Spline, &motion_limits(limits), Retiming::SlowDown);
    let reference = reference(&points, InterpolationName::Spline);
    Ok(Taught { reference, remembered: remembered.len(), deviation_m })
}

/// Makes a path of single poses: straight from one to the next, at rest at each, as fast as the limits allow.
pub fn joined(poses: &[Pose2], limits: &Limits) -> Result<Taught, TeachError> {
    let mut heading_rad = poses.first().map_or(0.0, |pose| pose.heading_rad);
    let point = |(number, pose): (usize, &Pose2)| {
        // The shorter turn, though it was turned further by hand.
        heading_rad = nearest_turn_rad(pose.heading_rad, heading_rad);
        PathPoint { time_s: number as f64, odom_from_base: Pose2 { heading_rad, ..*pose } }
    };
    let points = PathPoints::new(poses.iter().enumerate().map(point).collect())?;
    let points = limits::retimed(&points, Interpolation::Quintic, &motion_limits(limits), Retiming::Fastest);
    let reference = reference(&points, InterpolationName::Quintic);
    Ok(Taught { reference, remembered: poses.len(), deviation_m: 0.0 })
}

/// A path's reference.
fn reference(points: &PathPoints, interpolation: InterpolationName) -> ReferenceTable {
    ReferenceTable {
        frame: Some(PathFrame::Odom),
        interpolation: Some(interpolation),
        ..ReferenceTable::through(points)
    }
}

/// The part of a trace between its first and its last motion.
fn moving(trace: &[TracePoint]) -> &[TracePoint] {
    let moves = |pair: &[TracePoint]| distance(pose(&pair[0]), pose(&pair[1])) > REST;
    let first = trace.windows(2).position(moves);
    let last = trace.windows(2).rposition(moves);
    match (first, last) {
        (Some(first), Some(last)) => &trace[first..=last + 1],
        _ => &[],
    }
}

fn pose(point: &TracePoint) -> Pose2 {
    let [x_m, y_m, heading_rad] = point.believed;
    Pose2 { x_m, y_m, heading_rad }
}

/// How far two poses are from each other, m.
fn distance(a: Pose2, b: Pose2) -> f64 {
    (a.x_m - b.x_m).hypot(a.y_m - b.y_m) + ARM_M * (a.heading_rad - b.heading_rad).abs()
}

fn remembered(trace: &[TracePoint], sampling: Sampling) -> Result<Vec<PathPoint>, TeachError> {
    let positive = |what, found: f64| {
        let fits = found > 0.0 && found.is_finite();
        if fits { Ok(()) } else { Err(TeachError::Value { what, expected: "more than 0", found }) }
    };
    match sampling {
        Sampling::Period { period_s } => positive("period_s", period_s)?,
        Sampling::Change { distance_m, angle_rad } => {
            positive("distance_m", distance_m)?;
            positive("angle_rad", angle_rad)?;
        }
    }
    let mut kept: Vec<PathPoint> = Vec::new();
    let Some(begin) = trace.first() else { return Ok(kept) };
    for (at, point) in trace.iter().enumerate() {
        let point = PathPoint { time_s: point.time_s - begin.time_s, odom_from_base: pose(point) };
        let is_due = kept.last().is_none_or(|last| match sampling {
            // Half a point of the trace early is on time.
            Sampling::Period { period_s } => point.time_s - last.time_s > period_s - 0.005,
            Sampling::Change { distance_m, angle_rad } => {
                let (a, b) = (last.odom_from_base, point.odom_from_base);
                (a.x_m - b.x_m).hypot(a.y_m - b.y_m) >= distance_m
                    || (a.heading_rad - b.heading_rad).abs() >= angle_rad
            }
        });
        let is_last = at + 1 == trace.len();
        if is_due {
            kept.push(point);
        } else if is_last {
            // The end stands in place of a neighbour that is too near.
            match kept.last_mut() {
                Some(last) if kept_is_near(last, &point, sampling) && at > 1 => *last = point,
                _ => kept.push(point),
            }
        }
    }
    Ok(kept)
}

/// Whether the end is so near to the point before it that both would make a jerk.
fn kept_is_near(last: &PathPoint, end: &PathPoint, sampling: Sampling) -> bool {
    match sampling {
        Sampling::Period { period_s } => last.time_s > 0.0 && end.time_s - last.time_s < 0.5 * period_s,
        Sampling::Change { .. } => last.time_s > 0.0 && end.time_s - last.time_s < 0.02,
    }
}

/// Each inner point on the line that fits its neighbours best, but never farther from where it was than `most_m`.
fn smoothed(points: &[PathPoint], most_m: f64) -> Vec<PathPoint> {
    let smooth = |at: usize| {
        let half = SMOOTHED.min(at).min(points.len() - 1 - at);
        let near = &points[at - half..=at + half];
        let point = points[at];
        let fitted = |of: fn(&Pose2) -> f64| {
            let samples = near.iter().map(|near| (near.time_s - point.time_s, of(&near.odom_from_base)));
            line_at_zero(samples.clone()).unwrap_or_else(|| of(&point.odom_from_base))
        };
        let odom_from_base = Pose2 {
            x_m: fitted(|pose| pose.x_m),
            y_m: fitted(|pose| pose.y_m),
            heading_rad: fitted(|pose| pose.heading_rad),
        };
        if distance(point.odom_from_base, odom_from_base) <= most_m {
            PathPoint { odom_from_base, ..point }
        } else {
            point
        }
    };
    (0..points.len()).map(smooth).collect()
}

/// The value at 0 of the line of least squares through `(x, y)`; `None` where they give no line.
fn line_at_zero(samples: impl Iterator<Item = (f64, f64)> + Clone) -> Option<f64> {
    let count = samples.clone().count() as f64;
    let mean_x = samples.clone().map(|(x, _)| x).sum::<f64>() / count;
    let mean_y = samples.clone().map(|(_, y)| y).sum::<f64>() / count;
    let spread: f64 = samples.clone().map(|(x, _)| (x - mean_x).powi(2)).sum();
    let together: f64 = samples.map(|(x, y)| (x - mean_x) * (y - mean_y)).sum();
    (spread > 0.0).then(|| mean_y - mean_x * together / spread)
}

/// As few of the points as keep the spline within the tolerance of what was remembered: begins with the ends, and adds
/// the farthest one of each piece until all are near.
fn thinned(
    smooth: &[PathPoint],
    remembered: &[PathPoint],
    tolerance_m: f64,
) -> Result<(PathPoints, f64), TeachError> {
    let last = smooth.len() - 1;
    let mut chosen = vec![0, last];
    loop {
        let points = PathPoints::new(chosen.iter().map(|&at| smooth[at]).collect())?;
        let spline = PointTrajectory::new(&points, Interpolation::Spline);
        let off =
            |point: &PathPoint| distance(spline.sample(point.time_s).odom_from_base, point.odom_from_base);
        let deviation_m = remembered.iter().map(off).fold(0.0, f64::max);
        if deviation_m <= tolerance_m {
            return Ok((points, deviation_m));
        }
        let too_far = |pair: &[usize]| {
            let inner = pair[0] + 1..pair[1];
            let worst = inner.max_by(|&a, &b| off(&smooth[a]).total_cmp(&off(&smooth[b])))?;
            (off(&smooth[worst]) > 0.5 * tolerance_m).then_some(worst)
        };
        let mut more: Vec<usize> = chosen.windows(2).filter_map(too_far).collect();
        if more.is_empty() {
            // Every piece is near at its points, but not near enough between them: halve the longest.
            more = chosen
                .windows(2)
                .filter(|pair| pair[1] - pair[0] > 1)
                .map(|pair| (pair[0] + pair[1]) / 2)
                .collect();
        }
        if more.is_empty() || chosen.len() + more.len() > MOST_POINTS {
            return Err(TeachError::TooFar { tolerance_m, found_m: deviation_m });
        }
        chosen.extend(more);
        chosen.sort_unstable();
    }
}

/// Points as lines of a path file, below a comment.
pub fn lines(comment: &str, points: &[[f64; 4]]) -> String {
    let row = |[t, x, y, heading]: &[f64; 4]| format!("({t}, {x}, {y}, {heading})\n");
    let mut text = format!("# {comment}\n");
    text.extend(points.iter().map(row));
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use omnibase_robot::{Registry, RobotPlan};

    fn limits() -> Limits {
        let text = include_str!("../../../robots/bmm.toml");
        RobotPlan::from_toml(text, &Registry::with_built_in(), &|_| Err(String::new())).unwrap().limits
    }

    /// A drive with both ends at rest: a bow with a turn, every 10 ms for 6 s, after a second of rest.
    fn drive(noise_m: f64) -> Vec<TracePoint> {
        let at = |n: i32| {
            let share = (f64::from(n - 100) / 600.0).clamp(0.0, 1.0);
            let way = share.powi(3) * (10.0 - 15.0 * share + 6.0 * share * share);
            let noise = if (0.0..1.0).contains(&share) && share > 0.0 {
                noise_m * f64::from(n * 7919 % 13 - 6) / 6.0
            } else {
                0.0
            };
            let believed = [2.0 * way, (3.0 * way).sin() * 0.4 + noise, 1.2 * way];
            TracePoint { time_s: 5.0 + f64::from(n) * 0.01, believed, ..TracePoint::default() }
        };
        (0..=800).map(at).collect()
    }

    fn greatest_m(taught: &Taught, trace: &[TracePoint], begin_s: f64) -> f64 {
        let points = taught.reference.points.as_ref().unwrap();
        let points = points.iter().map(|&[time_s, x_m, y_m, heading_rad]| PathPoint {
            time_s,
            odom_from_base: Pose2 { x_m, y_m, heading_rad },
        });
        let spline = PointTrajectory::new(&PathPoints::new(points.collect()).unwrap(), Interpolation::Spline);
        trace
            .iter()
            .map(|point| distance(spline.sample(point.time_s - begin_s).odom_from_base, pose(point)))
            .fold(0.0, f64::max)
    }

    #[test]
    fn a_drive_becomes_few_points_within_the_tolerance() {
        let trace = drive(0.0);
        for sampling in
            [Sampling::Period { period_s: 0.05 }, Sampling::Change { distance_m: 0.02, angle_rad: 0.02 }]
        {
            let taught = taught(&trace, sampling, 0.001, &limits()).unwrap();
            let points = taught.reference.points.as_ref().unwrap();
            assert!(points.len() < 30 && points.len() < taught.remembered, "{} points", points.len());
            assert!(taught.deviation_m <= 0.001);
            // The seconds of rest before and after it are not part of the path.
            assert!((points.last().unwrap()[0] - 6.0).abs() < 0.3, "{points:?}");
            let off_m = greatest_m(&taught, &trace, moving(&trace)[0].time_s);
            assert!(off_m < 0.003, "{sampling:?}: {off_m}");
        }
    }

    #[test]
    fn noise_is_smoothed_within_the_tolerance() {
        let taught = taught(&drive(0.0005), Sampling::Period { period_s: 0.05 }, 0.002, &limits()).unwrap();
        assert!(taught.deviation_m <= 0.002);
        assert!(taught.reference.points.unwrap().len() < 30);
    }

    #[test]
    fn what_is_no_drive_is_refused_with_the_reason() {
        let still = vec![TracePoint::default(); 100];
        let period = Sampling::Period { period_s: 0.05 };
        assert_eq!(taught(&still, period, 0.001, &limits()), Err(TeachError::NoMotion));
        assert_eq!(taught(&[], period, 0.001, &limits()), Err(TeachError::NoMotion));
        for (sampling, tolerance_m) in [
            (Sampling::Period { period_s: f64::NAN }, 0.001),
            (Sampling::Period { period_s: 0.0 }, 0.001),
            (Sampling::Change { distance_m: -1.0, angle_rad: 1.0 }, 0.001),
            (period, f64::NAN),
            (period, 0.0),
        ] {
            let refused = taught(&drive(0.0), sampling, tolerance_m, &limits());
            assert!(
                matches!(refused, Err(TeachError::Value { .. })),
                "{sampling:?} {tolerance_m}: {refused:?}"
            );
        }
    }
}
