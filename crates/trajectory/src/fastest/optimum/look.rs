//! What limits ask at one moment of a step.
//!
//! All is told in x, u and w of that moment, where the step's length counts 1: what they are at the step's beginning comes in by the part of the
//! step that has passed, once for all limits of the moment.

use std::ops::Range;

use super::State;

/// Coefficients of x, u and w; and of x and u alone.
pub(super) type Row = [f64; 3];
pub(super) type Line = [f64; 2];

/// Axes whose limit is one on their length: x and y, and the turn.
const BALLS: [Range<usize>; 2] = [0..2, 2..3];

/// Limits at a moment of a step, each over itself.
pub(super) struct Look {
    /// What part of the step has passed.
    pub(super) part: f64,
    /// What part of the step's time is counted there.
    pub(super) weight: f64,
    /// What speed takes of x.
    pub(super) speed: f64,
    /// The acceleration along x, y and the turn; and the jerk, over √x.
    pub(super) acceleration: [Row; 3],
    pub(super) jerk: [Row; 3],
    pub(super) planes: Range<usize>,
    /// Another look at the same moment asks for speed and acceleration, which jump nowhere: here only the jerk counts.
    pub(super) is_for_jerk: bool,
    /// Each of its limits has one.
    pub(super) bars: Range<usize>,
}

/// A quadratic form over a state: its slope, and its curvature, from the first row's three to the last one's one.
#[derive(Default)]
pub(super) struct Form {
    pub(super) slope: [f64; 3],
    pub(super) curve: [f64; 6],
}

impl Form {
    pub(super) fn add(&mut self, row: &Row, slope: f64, curve: f64) {
        self.slope.iter_mut().zip(row).for_each(|(sum, part)| *sum += slope * part);
        self.add_square(row, curve);
    }

    pub(super) fn add_square(&mut self, row: &Row, curve: f64) {
        let [x, u, w] = *row;
        let [cx, cu, cw] = scaled(row, curve);
        let products = [cx * x, cx * u, cx * w, cu * u, cu * w, cw * w];
        self.curve.iter_mut().zip(products).for_each(|(sum, product)| *sum += product);
    }

    pub(super) fn add_line(&mut self, [x, u]: &Line, slope: f64, curve: f64) {
        let [xx, xu, _, uu, ..] = &mut self.curve;
        *xx += curve * x * x;
        *xu += curve * x * u;
        *uu += curve * u * u;
        self.slope[0] += slope * x;
        self.slope[1] += slope * u;
    }

    /// The same over the state so much of a step before: x = x + 2pu + p²w, u = u + pw.
    pub(super) fn before(&self, part: f64) -> Form {
        let ([x, u, w], [xx, xu, xw, uu, uw, ww]) = (self.slope, self.curve);
        let then = |x: f64, u: f64, w: f64| [x, 2.0 * part * x + u, part * (part * x + u) + w];
        // Of each row what it is over the state before; and then of each column.
        let rows = [then(xx, xu, xw), then(xu, uu, uw), then(xw, uw, ww)];
        let [first, second, third] = [0, 1, 2].map(|at| then(rows[0][at], rows[1][at], rows[2][at]));
        Form { slope: then(x, u, w), curve: [first[0], second[0], third[0], second[1], third[1], third[2]] }
    }

    pub(super) fn add_form(&mut self, other: &Form) {
        self.slope.iter_mut().zip(other.slope).for_each(|(sum, part)| *sum += part);
        self.curve.iter_mut().zip(other.curve).for_each(|(sum, part)| *sum += part);
    }
}

pub(super) fn dot(a: &Row, b: &State) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn scaled([x, u, w]: &Row, by: f64) -> Row {
    [by * x, by * u, by * w]
}

impl Look {
    /// The state there, of that at the beginning of its step; of moves too.
    pub(super) fn at(&self, [x, u, w]: &State) -> State {
        let by = self.part * w;
        [x + self.part * (2.0 * u + by), u + by, *w]
    }

    /// Tells of each limit on a length what is left to it, how fast that falls, and the rows whose squares make it fall.
    pub(super) fn balls(&self, at: &State, mut take: impl FnMut(f64, Row, &[Row])) {
        // The squares of the radii: 1/x for the jerk, 1 for the acceleration.
        let per_x = 1.0 / at[0];
        let accelerations = if self.is_for_jerk { None } else { Some((&self.acceleration, 1.0, 0.0)) };
        for (rows, square, fall) in [(&self.jerk, per_x, per_x * per_x)].into_iter().chain(accelerations) {
            for ball in BALLS {
                let rows = &rows[ball];
                let (mut left, mut falls) = (square, [fall, 0.0, 0.0]);
                for row in rows {
                    let y = dot(row, at);
                    left -= y * y;
                    let [a, b, c] = scaled(row, 2.0 * y);
                    falls = [falls[0] + a, falls[1] + b, falls[2] + c];
                }
                take(left, falls, rows);
            }
        }
    }

    /// Tells of each other limit what is left to it, and how fast that falls.
    pub(super) fn lines(&self, planes: &[Line], [x, u, _]: &State, mut take: impl FnMut(f64, &Line)) {
        if self.is_for_jerk {
            return;
        }
        take(1.0 - self.speed * x, &[self.speed, 0.0]);
        for line in &planes[self.planes.clone()] {
            take(1.0 - line[0] * x - line[1] * u, line);
        }
    }

    /// The greatest x of an even motion within its limits is one over this.
    pub(super) fn even(&self, planes: &[Line]) -> f64 {
        let size = |rows: &[Row]| rows.iter().map(|row| row[0].powi(2)).sum::<f64>().sqrt();
        let planes = planes[self.planes.clone()].iter().map(|line| line[0]);
        let balls = BALLS
            .map(|ball| size(&self.acceleration[ball.clone()]).max(size(&self.jerk[ball]).powf(2.0 / 3.0)));
        planes.chain(balls).fold(self.speed, f64::max)
    }

    pub(super) fn limit_count(&self) -> usize {
        if self.is_for_jerk { BALLS.len() } else { 1 + 2 * BALLS.len() + self.planes.len() }
    }
}
