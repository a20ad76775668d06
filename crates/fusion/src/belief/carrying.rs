//! What a step makes of the pose's covariance, and what goes on meanwhile.

use omnibase_platform::{BodyStep, Pose2};

use super::{Along, FLAWS, GEOMETRY, SLIP, STATES, WHEELS};

/// What goes on while a step is made.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Meanwhile {
    /// How long it takes, s.
    pub(crate) time_s: f64,
    /// The share of slip that is left, standard deviations of what comes, and the least variance of what was, of m/s and rad/s.
    pub(crate) slip_kept: f64,
    pub(crate) slip_sigma: [f64; 3],
    pub(crate) slip_least: [f64; 3],
    /// The share of each flaw that is left of what it made, and by how much one of each of the wheels' makes the step longer.
    pub(crate) flaws_kept: [f64; FLAWS],
    pub(crate) longer: [[f64; 3]; 2],
}

impl Meanwhile {
    /// Variances by which slip changes.
    pub(crate) fn slip_drive(&self) -> [f64; 3] {
        self.slip_sigma.map(|sigma| sigma * sigma * (1.0 - self.slip_kept * self.slip_kept))
    }
}

/// How the error of a pose after a step depends on all errors before it.
pub(super) struct Carrying {
    /// What an error of the step makes of the place, and what one of the heading does.
    turned: [[f64; 3]; 2],
    swept: [f64; 2],
    u: [f64; 3],
    time_s: f64,
}

impl Carrying {
    pub(super) fn new(from: Pose2, to: Pose2, step: BodyStep, time_s: f64) -> Carrying {
        let (dx, dy) = (to.x_m - from.x_m, to.y_m - from.y_m);
        let (sin, cos) = (0.5 * (from.heading_rad + to.heading_rad)).sin_cos();
        Carrying {
            turned: [[cos, -sin, -0.5 * dy], [sin, cos, 0.5 * dx]],
            swept: [-dy, dx],
            u: [step.x_m, step.y_m, step.angle_rad],
            time_s,
        }
    }

    /// What is wrong with the step's component of such a number, from what is wrong with E and slip.
    #[inline]
    fn wrong(&self, p: impl Fn(usize) -> f64, i: usize) -> f64 {
        let u = &self.u;
        u[0] * p(GEOMETRY + 3 * i) + u[1] * p(GEOMETRY + 3 * i + 1) + u[2] * p(GEOMETRY + 3 * i + 2)
            - self.time_s * p(SLIP + i)
    }

    /// A number of the pose after the step, of what it and the heading were before, and what is wrong with the step's.
    #[inline]
    fn after(&self, number: usize, [before, heading]: [f64; 2], step: impl Fn(usize) -> f64) -> f64 {
        if number == 2 {
            return before + step(2);
        }
        let [along, across, by_turn] = self.turned[number];
        before + self.swept[number] * heading + along * step(0) + across * step(1) + by_turn * step(2)
    }

    /// The first `N` columns of the pose's rows after the step. One of each flaw of wheels makes it longer by so much.
    pub(super) fn rows<const N: usize>(&self, p: &[Along; STATES], longer: &[[f64; 3]; 2]) -> [[f64; N]; 3] {
        let mut steps = [[0.0; N]; 3];
        for (i, step) in steps.iter_mut().enumerate() {
            for (column, value) in step.iter_mut().enumerate() {
                *value = self.wrong(|place| p[place][column], i);
            }
            for (flaw, longer) in WHEELS.into_iter().zip(longer) {
                step.iter_mut().skip(STATES + flaw).take(1).for_each(|step| *step += longer[i]);
            }
        }
        let mut rows = [[0.0; N]; 3];
        for (r, row) in rows.iter_mut().enumerate() {
            for (column, value) in row.iter_mut().enumerate() {
                *value = self.after(r, [p[r][column], p[2][column]], |i| steps[i][column]);
            }
        }
        rows
    }

    /// The covariance of the pose after the step.
    pub(super) fn block<const N: usize>(&self, rows: &[[f64; N]; 3]) -> [[f64; 3]; 3] {
        let mut block = [[0.0; 3]; 3];
        for (row, values) in rows.iter().zip(&mut block) {
            let wrong = |i| self.wrong(|place| row[place], i);
            let wrong = [wrong(0), wrong(1), wrong(2)];
            for (q, value) in values.iter_mut().enumerate() {
                *value = self.after(q, [row[q], row[2]], |i| wrong[i]);
            }
        }
        for (r, q) in [(0, 1), (0, 2), (1, 2)] {
            let mean = 0.5 * (block[r][q] + block[q][r]);
            (block[r][q], block[q][r]) = (mean, mean);
        }
        block
    }
}
