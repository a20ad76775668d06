//! How far the platform was from where it should have been.

use super::signals::{Poses, Signals};
use super::totals::{Squares, Totals};
use crate::run::RecordedRun;

/// The phases in which the platform is kept at its reference, or at the end of it: holding, tracking.
const LED: [f64; 2] = [2.0, 3.0];
/// The phase in which it follows its reference.
const TRACKING: f64 = 3.0;
/// Below this planned speed there is no direction of motion, m/s.
const STANDING_M_S: f64 = 1e-3;

/// The same figure as the robot believes it, and as it truly was.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BelievedAndTrue {
    /// By the robot's own odometry.
    pub believed: Option<f64>,
    /// By the simulation's ground truth; `None` on hardware.
    pub truth: Option<f64>,
}

/// How well a run followed its plan. Errors are distances from the setpoint of the same cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TrackingFigures {
    /// Position error in the last cycle in which the platform was led by its reference, m.
    pub final_error_m: BelievedAndTrue,
    /// Root of the mean square of the position error while tracking, m.
    pub rms_error_m: BelievedAndTrue,
    /// Greatest position error while tracking, m.
    pub max_error_m: BelievedAndTrue,
    /// Planned less actual heading where the final error is taken, rad; whole turns count.
    pub final_heading_error_rad: BelievedAndTrue,
}

impl TrackingFigures {
    /// The figures of a run; `None` for what its signals don't tell.
    ///
    /// Tracking are the cycles in that phase; all cycles where the run has no phases.
    pub fn of(run: &RecordedRun) -> Self {
        let signals = Signals::new(run);
        let tracking = Tracking::new(&signals);
        let totals = Totals::of(&signals, &tracking);
        tracking.figures(&totals)
    }
}

/// One pose against the planned one, over time; NaN where nothing keeps the platform at its plan.
pub(super) struct Error {
    /// Distance, m.
    pub(super) distance: Vec<f64>,
    /// Along the planned direction of motion, m: positive where the platform is ahead; NaN at rest.
    pub(super) along: Vec<f64>,
    /// Across it, m: positive where the platform is to the left; NaN at rest.
    pub(super) across: Vec<f64>,
    /// Of the heading: planned less actual, rad; whole turns count.
    pub(super) heading: Vec<f64>,
}

/// Where the platform should have been, was believed to be, and was.
pub(super) struct Tracking {
    /// The setpoint.
    pub(super) planned: Option<Poses>,
    /// By odometry.
    pub(super) believed: Option<Poses>,
    /// By the simulation.
    pub(super) truth: Option<Poses>,
    /// Phases by their codes.
    pub(super) phase: Option<Vec<f64>>,
    /// Of the believed pose.
    pub(super) believed_error: Option<Error>,
    /// Of the true pose.
    pub(super) true_error: Option<Error>,
}

/// The poses that were asked for: those that were followed, without what repeats taught.
fn asked(followed: Option<Poses>, correction: Option<Poses>) -> Option<Poses> {
    let mut asked = followed?;
    let Some(correction) = correction else { return Some(asked) };
    for row in 0..asked.x.len() {
        asked.heading[row] -= correction.heading[row];
        let (sin, cos) = asked.heading[row].sin_cos();
        asked.x[row] -= cos * correction.x[row] - sin * correction.y[row];
        asked.y[row] -= sin * correction.x[row] + cos * correction.y[row];
    }
    Some(asked)
}

impl Tracking {
    pub(super) fn new(signals: &Signals<'_>) -> Self {
        let planned =
            asked(signals.poses(&["wished_pose", "setpoint_pose"]), signals.poses(&["reference_correction"]));
        let believed = signals.poses(&["state_pose"]);
        let truth = signals.poses(&["truth_pose"]);
        let twists = signals.twists(&["wished_twist", "setpoint_twist"]);
        let phase = signals.column(&["cycle_phase"]);
        let against = |poses: &Option<Poses>| {
            let (planned, poses) = (planned.as_ref()?, poses.as_ref()?);
            let mut error = Error::new(planned, poses, twists.as_ref());
            error.leave_out(|row| phase.as_ref().is_some_and(|phase| !LED.contains(&phase[row])));
            Some(error)
        };
        let (believed_error, true_error) = (against(&believed), against(&truth));
        Tracking { planned, believed, truth, phase, believed_error, true_error }
    }

    /// Whether the platform follows its reference; always where phases aren't known.
    pub(super) fn is_tracking(&self, row: usize) -> bool {
        self.is_in(row, &[TRACKING])
    }

    /// Whether the platform is in one of the phases; always where phases aren't known.
    fn is_in(&self, row: usize, phases: &[f64]) -> bool {
        self.phase.as_ref().is_none_or(|phase| phase.get(row).is_some_and(|now| phases.contains(now)))
    }

    /// Where it should have ended, and where it believed to stand at last: x m, y m, heading rad.
    pub(super) fn ends(&self) -> [Option<[f64; 3]>; 2] {
        let at = |poses: &Poses, row: usize| {
            Some([*poses.x.get(row)?, *poses.y.get(row)?, *poses.heading.get(row)?])
        };
        let planned = self.planned.as_ref();
        let wished = planned.and_then(|poses| at(poses, self.last_led(poses.x.len())?));
        let believed = self.believed.as_ref().and_then(|poses| at(poses, poses.x.len().checked_sub(1)?));
        [wished, believed]
    }

    /// The last row in which the reference was tracked or its end was held.
    fn last_led(&self, rows: usize) -> Option<usize> {
        // What was held before the reference began is not its end.
        let first = (0..rows).find(|&row| self.is_tracking(row))?;
        (first..rows).rev().find(|&row| self.is_in(row, &LED))
    }

    /// The figures, by the totals of the same run.
    pub(super) fn figures(&self, totals: &Totals) -> TrackingFigures {
        let errors = [&self.believed_error, &self.true_error];
        let each = |figure: &dyn Fn(&Error) -> Option<f64>| {
            let [believed, truth] = errors.map(|error| error.as_ref().and_then(figure));
            BelievedAndTrue { believed, truth }
        };
        let rows = errors.iter().find_map(|error| Some(error.as_ref()?.distance.len())).unwrap_or(0);
        let last = self.last_led(rows);
        let at_end = |values: &[f64]| values.get(last?).copied().filter(|value| value.is_finite());
        let during = |figure: fn(&Squares) -> Option<f64>| {
            let [believed, truth] = totals.errors.map(|error| error.as_ref().and_then(figure));
            BelievedAndTrue { believed, truth }
        };
        TrackingFigures {
            final_error_m: each(&|error| at_end(&error.distance)),
            rms_error_m: during(Squares::root_mean_square),
            max_error_m: during(Squares::greatest),
            final_heading_error_rad: each(&|error| at_end(&error.heading)),
        }
    }
}

impl Error {
    fn leave_out(&mut self, is_out: impl Fn(usize) -> bool) {
        for values in [&mut self.distance, &mut self.along, &mut self.across, &mut self.heading] {
            for (row, value) in values.iter_mut().enumerate() {
                if is_out(row) {
                    *value = f64::NAN;
                }
            }
        }
    }

    fn new(planned: &Poses, poses: &Poses, twists: Option<&[Vec<f64>; 3]>) -> Self {
        let rows = planned.x.len();
        let mut error = Error {
            distance: Vec::with_capacity(rows),
            along: Vec::with_capacity(rows),
            across: Vec::with_capacity(rows),
            heading: Vec::with_capacity(rows),
        };
        for row in 0..rows {
            let (dx, dy) = (poses.x[row] - planned.x[row], poses.y[row] - planned.y[row]);
            let [vx, vy] = twists.map_or([0.0; 2], |twists| [twists[0][row], twists[1][row]]);
            let speed = vx.hypot(vy);
            let (tx, ty) =
                if speed >= STANDING_M_S { (vx / speed, vy / speed) } else { (f64::NAN, f64::NAN) };
            error.distance.push(dx.hypot(dy));
            error.along.push(dx * tx + dy * ty);
            error.across.push(dy * tx - dx * ty);
            error.heading.push(planned.heading[row] - poses.heading[row]);
        }
        error
    }
}
