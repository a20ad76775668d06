//! Curves with control points: B-splines of any degree, with weights (NURBS), and chains of them, as close points of a way.
//!
//! Points and directions come by C. de Boor's recurrence (L. Piegl and W. Tiller, *The NURBS Book*, 1997, sections 2.3 and 4.2).

use omnibase_platform::{Pose2, wrap_angle_rad};

/// A B-spline with weights.
#[derive(Clone, Debug, PartialEq)]
pub struct Nurbs {
    degree: usize,
    knots: Vec<f64>,
    /// x and y in m, heading in rad, and 1, each times the weight.
    controls: Vec<[f64; 4]>,
}

/// Why a curve was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NurbsError {
    /// A degree without enough control points, or none.
    #[error("degree is {degree}, expected from 1 to {most}, one less than there are control points")]
    Degree {
        /// What was found.
        degree: usize,
        /// The greatest one.
        most: usize,
    },
    /// Not as many as belong to degree and control points.
    #[error("{found} {what}, expected {expected}")]
    Count {
        /// Of what.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there must be.
        expected: usize,
    },
    /// A number that isn't one, falling knots, or a weight that isn't positive.
    #[error("{what}[{at}] is {found}, expected {expected}")]
    Number {
        /// Of what.
        what: &'static str,
        /// Which one, from 0.
        at: usize,
        /// What was found.
        found: f64,
        /// What is allowed.
        expected: &'static str,
    },
    /// Knots between which there is no curve.
    #[error("the curve's first and last knot are the same, {0}")]
    NoLength(f64),
}

/// How the heading goes along a curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurveHeading {
    /// As the control points have it.
    Given,
    /// It follows the tangent.
    Tangent,
}

/// Between neighbouring points of a way the tangent turns by less, rad; its spline is off by some 1e-6 of the radius then.
const TURN_RAD: f64 = 0.1;
/// A distance between points is at most so many times that beside it, so that the spline keeps straight beside a bend.
const MOST_GROWTH: f64 = 2.0;
/// Places that are closer are one, m.
const SAME_PLACE_M: f64 = 1e-7;
/// Given headings that are closer are one, rad.
const SAME_HEADING_RAD: f64 = 1e-7;
/// So often a span is halved at most.
const HALVINGS: usize = 12;

impl Nurbs {
    /// A curve of control points (x, y in m, heading in rad).
    ///
    /// Without weights all are 1; without knots they are equally spaced, and the curve begins and ends in its first and last
    /// control point. There are as many weights as control points, and `degree` + 1 knots more.
    pub fn new(
        controls: &[[f64; 3]],
        degree: usize,
        weights: Option<&[f64]>,
        knots: Option<&[f64]>,
    ) -> Result<Nurbs, NurbsError> {
        let most = controls.len().saturating_sub(1);
        if degree < 1 || degree > most {
            return Err(NurbsError::Degree { degree, most });
        }
        let ones = vec![1.0; controls.len()];
        let weights = weights.unwrap_or(&ones);
        let spans = controls.len() - degree;
        let even: Vec<f64> = (0..=spans + 2 * degree)
            .map(|at| at.clamp(degree, spans + degree) as f64 - degree as f64)
            .collect();
        let knots = knots.unwrap_or(&even);
        for (what, found, expected) in
            [("weights", weights.len(), controls.len()), ("knots", knots.len(), controls.len() + degree + 1)]
        {
            if found != expected {
                return Err(NurbsError::Count { what, found, expected });
            }
        }
        let number = |what, at, found, expected| Err(NurbsError::Number { what, at, found, expected });
        for (at, control) in controls.iter().enumerate() {
            if let Some(found) = control.iter().find(|part| !part.is_finite()) {
                return number("controls", at, *found, "finite numbers");
            }
        }
        if let Some(at) = weights.iter().position(|weight| !(weight.is_finite() && *weight > 0.0)) {
            return number("weights", at, weights[at], "a positive number");
        }
        for (at, knot) in knots.iter().enumerate() {
            if !knot.is_finite() || (at > 0 && *knot < knots[at - 1]) {
                return number("knots", at, *knot, "finite numbers that don't fall");
            }
        }
        if knots[degree] >= knots[controls.len()] {
            return Err(NurbsError::NoLength(knots[degree]));
        }
        let within = degree + 1..controls.len();
        if let Some(at) =
            within.clone().find(|at| at + degree < within.end && knots[*at] == knots[at + degree])
        {
            return number("knots", at, knots[at], "no more equal ones than its degree: it jumps there");
        }
        let weighted =
            |([x, y, turn], weight): (&[f64; 3], &f64)| [x * weight, y * weight, turn * weight, *weight];
        let controls = controls.iter().zip(weights).map(weighted).collect();
        Ok(Nurbs { degree, knots: knots.to_vec(), controls })
    }

    /// x, y and heading at a parameter between two knots, and their rates over it; `span` is the knot before it.
    fn at(&self, span: usize, u: f64) -> [[f64; 2]; 3] {
        let degree = self.degree;
        let mut points: Vec<[[f64; 2]; 4]> =
            (span - degree..=span).map(|at| self.controls[at].map(|part| [part, 0.0])).collect();
        for level in 1..=degree {
            for at in (level..=degree).rev() {
                let [from, to] = [span + at - degree, span + at + 1 - level].map(|knot| self.knots[knot]);
                let (part, rate) = ((u - from) / (to - from), 1.0 / (to - from));
                points[at] = std::array::from_fn(|axis| {
                    let [before, after] = [points[at - 1][axis], points[at][axis]];
                    let mean = |order: usize| before[order] + part * (after[order] - before[order]);
                    [mean(0), mean(1) + rate * (after[0] - before[0])]
                });
            }
        }
        let [x, y, turn, [weight, weight_rate]] = points[degree];
        [x, y, turn].map(|[value, rate]| {
            let value = value / weight;
            [value, (rate - value * weight_rate) / weight]
        })
    }

    /// Parameters with the knots before them, close enough that the tangent turns little from each to the next.
    fn parameters(&self) -> Vec<(usize, f64)> {
        let mut found = Vec::new();
        for span in self.degree..self.controls.len() {
            let ends = [self.knots[span], self.knots[span + 1]];
            if ends[0] < ends[1] {
                found.push((span, ends[0]));
                self.halve(span, ends, HALVINGS, &mut found);
                found.push((span, ends[1]));
            }
        }
        found
    }

    /// Puts parameters between two.
    fn halve(&self, span: usize, [from, to]: [f64; 2], halvings: usize, found: &mut Vec<(usize, f64)>) {
        let middle = 0.5 * (from + to);
        let way = [from, middle, to].map(|u| self.at(span, u));
        let turn = |a: usize, b: usize| match [a, b].map(|at| direction_rad(&way[at])) {
            [Some(a), Some(b)] => wrap_angle_rad(b - a).abs(),
            // It turns on the spot: only where it turns back does that count.
            [None, None] if way[a][2][1] * way[b][2][1] > 0.0 => 0.0,
            _ => f64::INFINITY,
        };
        let distance = |a: usize, b: usize| (way[b][0][0] - way[a][0][0]).hypot(way[b][1][0] - way[a][1][0]);
        let (first, second) = (distance(0, 1), distance(1, 2));
        let is_even = first <= MOST_GROWTH * second && second <= MOST_GROWTH * first;
        let is_close = turn(0, 1).max(turn(1, 2)) < 0.5 * TURN_RAD;
        if halvings == 0 || (is_close && is_even && halvings < HALVINGS) {
            return;
        }
        self.halve(span, [from, middle], halvings - 1, found);
        found.push((span, middle));
        self.halve(span, [middle, to], halvings - 1, found);
    }
}

/// The tangent's direction at a place of a curve, rad; `None` where it has none.
fn direction_rad([[_, x], [_, y], _]: &[[f64; 2]; 3]) -> Option<f64> {
    (x.hypot(*y) > 0.0).then(|| y.atan2(*x))
}

/// The poses of a way along curves that follow one another, as close as a spline through them needs: the way by them is off by at
/// most some 1e-3 of the radius with which a curve bends.
///
/// A tangent that follows turns by less than half a turn from pose to pose, on the spot where it jumps by more than `corner_rad`,
/// and stays where a curve has none.
pub fn poses(curves: &[Nurbs], heading: CurveHeading, corner_rad: f64) -> Vec<Pose2> {
    // A given heading counts on the spot, too.
    let least_rad = if heading == CurveHeading::Given { SAME_HEADING_RAD } else { corner_rad };
    let mut poses: Vec<Pose2> = Vec::new();
    for (curve, (span, u)) in
        curves.iter().flat_map(|curve| curve.parameters().into_iter().map(move |at| (curve, at)))
    {
        let at = curve.at(span, u);
        let [x_m, y_m, given_rad] = at.map(|axis| axis[0]);
        let last = poses.last().copied();
        let heading_rad = match (heading, direction_rad(&at)) {
            (CurveHeading::Given, _) => given_rad,
            (CurveHeading::Tangent, direction) => {
                let last_rad = last.map_or_else(|| direction.unwrap_or_default(), |last| last.heading_rad);
                last_rad + direction.map_or(0.0, |direction| wrap_angle_rad(direction - last_rad))
            }
        };
        let pose = Pose2::new(x_m, y_m, heading_rad);
        match last {
            Some(last) if (x_m - last.x_m).hypot(y_m - last.y_m) < SAME_PLACE_M => {
                let turn_rad = heading_rad - last.heading_rad;
                if turn_rad.abs() > least_rad {
                    poses.push(pose);
                } else if let Some(last) = poses.last_mut() {
                    last.heading_rad += 0.5 * turn_rad;
                }
            }
            _ => poses.push(pose),
        }
    }
    graded(&poses)
}

/// Puts poses between those that are far apart beside ones that are close.
fn graded(poses: &[Pose2]) -> Vec<Pose2> {
    let way = |pair: &[Pose2]| (pair[1].x_m - pair[0].x_m).hypot(pair[1].y_m - pair[0].y_m);
    let lengths: Vec<f64> = poses.windows(2).map(way).collect();
    let mut found = Vec::with_capacity(poses.len());
    let near = |at: Option<usize>| at.and_then(|at| lengths.get(at)).copied().filter(|length| *length > 0.0);
    for (at, pair) in poses.windows(2).enumerate() {
        let length = lengths[at];
        found.push(pair[0]);
        // From both ends on each part is so many times as long as the one before it, up to the middle.
        let side = |beside: Option<f64>| {
            let mut step = MOST_GROWTH * beside.unwrap_or(length);
            let mut at = 0.0;
            std::iter::from_fn(move || {
                at += step;
                step *= MOST_GROWTH;
                (at < 0.5 * length).then_some(at / length)
            })
        };
        let after: Vec<f64> = side(near(Some(at + 1))).map(|part| 1.0 - part).collect();
        let before = side(near(at.checked_sub(1)));
        found.extend(before.chain(after.into_iter().rev()).map(|part| between(pair, part)));
    }
    found.extend(poses.last());
    found
}

fn between(pair: &[Pose2], part: f64) -> Pose2 {
    let mean = |of: fn(&Pose2) -> f64| of(&pair[0]) + part * (of(&pair[1]) - of(&pair[0]));
    Pose2::new(mean(|pose| pose.x_m), mean(|pose| pose.y_m), mean(|pose| pose.heading_rad))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{GeometricPath, Joining, PiecewisePath};

    const CORNER_RAD: f64 = 0.5;
    const JOINING: Joining = Joining { radius_m: 0.5, corner_rad: CORNER_RAD, tolerance_m: 0.0 };

    /// A circle of radius 1 as textbooks have it: squares of control points, with weights of cos 45° at the corners.
    fn circle() -> Nurbs {
        let w = 0.5_f64.sqrt();
        let controls = [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]];
        let controls: Vec<[f64; 3]> =
            controls.iter().map(|[x, y]| [f64::from(*x), f64::from(*y), 0.0]).collect();
        let weights = [1.0, w, 1.0, w, 1.0, w, 1.0, w, 1.0];
        let knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4].map(f64::from);
        Nurbs::new(&controls, 2, Some(&weights), Some(&knots)).unwrap()
    }

    #[test]
    fn a_circle_with_weights_is_round_and_its_way_too() {
        let poses = poses(&[circle()], CurveHeading::Tangent, CORNER_RAD);
        for pose in &poses {
            assert!((pose.x_m.hypot(pose.y_m) - 1.0).abs() < 1e-12, "{pose:?}");
        }
        let turn_rad = poses[poses.len() - 1].heading_rad - poses[0].heading_rad;
        assert!((turn_rad - std::f64::consts::TAU).abs() < 1e-9, "{turn_rad}");
        let way = PiecewisePath::through(&poses, JOINING).unwrap();
        for at in 0..=5000 {
            let [x, y, turn] = way.sample(way.length() * f64::from(at) / 5000.0, 1.0);
            assert!((x[0].hypot(y[0]) - 1.0).abs() < 1e-4, "{}", x[0].hypot(y[0]));
            let tangent_rad = wrap_angle_rad(y[1].atan2(x[1]) - turn[0]);
            assert!(tangent_rad.abs() < 0.01, "{tangent_rad}");
        }
        assert_eq!(way.breaks().len(), poses.len(), "no corner is cut");
    }

    #[test]
    fn splines_are_what_polynomials_are() {
        // Degree 3 with 4 control points: Bernstein's polynomials.
        let controls = [[0.0, 0.0, 0.0], [1.0, 2.0, 0.3], [3.0, -1.0, 0.6], [4.0, 1.0, 0.2]];
        let curve = Nurbs::new(&controls, 3, None, None).unwrap();
        for at in 0..=10 {
            let t = f64::from(at) / 10.0;
            let basis = [(1.0 - t).powi(3), 3.0 * t * (1.0 - t).powi(2), 3.0 * t * t * (1.0 - t), t.powi(3)];
            for (axis, found) in curve.at(3, t).iter().enumerate() {
                let expected: f64 =
                    basis.iter().zip(&controls).map(|(part, control)| part * control[axis]).sum();
                assert!((found[0] - expected).abs() < 1e-12);
                let beside = [t - 1e-6, t + 1e-6].map(|t| curve.at(3, t)[axis][0]);
                assert!((found[1] - (beside[1] - beside[0]) / 2e-6).abs() < 1e-6);
            }
        }
        let given = poses(&[curve], CurveHeading::Given, CORNER_RAD);
        assert_eq!((given[0], given[given.len() - 1]), (Pose2::default(), Pose2::new(4.0, 1.0, 0.2)));
    }

    #[test]
    fn straight_stays_straight_beside_a_bend_and_corners_turn_on_the_spot() {
        let line = |from: [f64; 3], to: [f64; 3]| Nurbs::new(&[from, to], 1, None, None).unwrap();
        let w = 0.5_f64.sqrt();
        let corner = [[2.0, 0.0, 0.0], [2.2, 0.0, 0.0], [2.2, 0.2, 0.0]];
        let curves = [
            line([0.0; 3], [2.0, 0.0, 0.0]),
            Nurbs::new(&corner, 2, Some(&[1.0, w, 1.0]), None).unwrap(),
            line([2.2, 0.2, 0.0], [2.2, 2.0, 0.0]),
            line([2.2, 2.0, 0.0], [0.0, 2.0, 0.0]),
        ];
        let poses = poses(&curves, CurveHeading::Tangent, CORNER_RAD);
        let way = PiecewisePath::through(&poses, JOINING).unwrap();
        let mut most_m: f64 = 0.0;
        for at in 0..=20_000 {
            let [[x, ..], [y, ..], _] = way.sample(way.length() * f64::from(at) / 20_000.0, 1.0);
            let off_m = if x <= 2.0 && y < 1.0 {
                y
            } else if y < 0.2 {
                (x - 2.0).hypot(y - 0.2) - 0.2
            } else {
                (x - 2.2).abs().min((y - 2.0).abs())
            };
            most_m = most_m.max(off_m.abs());
        }
        assert!(most_m < 2e-4, "{most_m}");
        let turned = poses.windows(2).filter(|pair| pair[0].x_m == pair[1].x_m && pair[0].y_m == pair[1].y_m);
        assert_eq!(turned.count(), 1, "only at the corner");
    }

    #[test]
    fn what_is_no_curve_is_refused_by_name() {
        let controls = [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 1.0, 0.0]];
        let said = |degree, weights: Option<&[f64]>, knots: Option<&[f64]>| {
            Nurbs::new(&controls, degree, weights, knots).unwrap_err().to_string()
        };
        for (found, expected) in [
            (
                said(3, None, None),
                "degree is 3, expected from 1 to 2, one less than there are control points",
            ),
            (
                said(0, None, None),
                "degree is 0, expected from 1 to 2, one less than there are control points",
            ),
            (said(2, Some(&[1.0]), None), "1 weights, expected 3"),
            (said(2, Some(&[1.0, 0.0, 1.0]), None), "weights[1] is 0, expected a positive number"),
            (said(1, None, Some(&[0.0; 4])), "4 knots, expected 5"),
            (
                said(1, None, Some(&[0.0, 1.0, 0.5, 2.0, 3.0])),
                "knots[2] is 0.5, expected finite numbers that don't fall",
            ),
            (
                said(1, None, Some(&[0.0, 1.0, 1.0, 1.0, 2.0])),
                "the curve's first and last knot are the same, 1",
            ),
        ] {
            assert_eq!(found, expected);
        }
        assert!(Nurbs::new(&[[0.0; 3], [f64::NAN, 0.0, 0.0]], 1, None, None).is_err());
        let six = [[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0; 3], [1.0, 0.0, 0.0]];
        let jumps = Nurbs::new(&six, 2, None, Some(&[0.0, 0.0, 0.0, 0.5, 0.5, 0.5, 1.0, 1.0, 1.0]));
        let words = "knots[3] is 0.5, expected no more equal ones than its degree: it jumps there";
        assert_eq!(jumps.unwrap_err().to_string(), words);
    }
}
