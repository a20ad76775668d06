//! How well a run followed its reference.

use omnibase_platform::Pose2;
use omnibase_robot::signals::{CycleRecord, Phase};
use serde::Serialize;

use crate::truth::TruePlatform;

/// A figure by what the robot believes, and by the truth where that is known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct BelievedAndTrue {
    /// By the robot's own estimate.
    pub believed: Option<f64>,
    /// By the simulator's truth; `None` on hardware.
    #[serde(rename = "true")]
    pub truth: Option<f64>,
}

/// Errors of the pose, collected cycle by cycle; distances in m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tracking {
    cycles: u64,
    believed: Sums,
    truth: Option<Sums>,
    last: Errors,
    wished_end: Option<Pose2>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Sums {
    squares_m2: f64,
    greatest_m: f64,
}

/// Errors of one cycle: between the wished pose and the believed or true one of the instant of the cycle's inputs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Errors {
    /// Distance to the believed pose, m.
    pub believed_m: f64,
    /// Distance to the true pose, m.
    pub true_m: Option<f64>,
    /// Heading wished less true heading (believed where the truth isn't known), rad.
    pub heading_rad: f64,
}

impl Sums {
    fn add(&mut self, error_m: f64) {
        self.squares_m2 += error_m * error_m;
        self.greatest_m = self.greatest_m.max(error_m);
    }
}

impl Tracking {
    /// Takes a cycle in; errors count while the reference is tracked, the last one also while its end is held.
    pub fn take(&mut self, record: &CycleRecord, truth: Option<&TruePlatform>) -> Errors {
        let wished = record.wished.odom_from_body.then(record.correction.inverse());
        let errors = errors(wished, record.state.odom_from_body, truth);
        if record.phase == Phase::Tracking {
            self.cycles += 1;
            self.believed.add(errors.believed_m);
            if let Some(error_m) = errors.true_m {
                self.truth.get_or_insert_default().add(error_m);
            }
        }
        if self.cycles > 0 && matches!(record.phase, Phase::Tracking | Phase::Holding) {
            self.last = errors;
            self.wished_end = Some(wished);
        }
        errors
    }

    /// Root of the mean square error while tracking, m.
    pub fn rms_error_m(&self) -> BelievedAndTrue {
        self.figure(|sums| (sums.squares_m2 / self.cycles as f64).sqrt())
    }

    /// Greatest error while tracking, m.
    pub fn max_error_m(&self) -> BelievedAndTrue {
        self.figure(|sums| sums.greatest_m)
    }

    /// Error at the end, m.
    pub fn final_error_m(&self) -> BelievedAndTrue {
        let tracked = self.cycles > 0;
        BelievedAndTrue {
            believed: tracked.then_some(self.last.believed_m),
            truth: self.last.true_m.filter(|_| tracked),
        }
    }

    /// Where it should have ended; `None` where nothing was followed.
    pub fn wished_end(&self) -> Option<Pose2> {
        self.wished_end
    }

    /// Error of the heading at the end, rad: the true one, or the believed one where the truth isn't known.
    pub fn final_heading_error_rad(&self) -> Option<f64> {
        (self.cycles > 0).then_some(self.last.heading_rad)
    }

    fn figure(&self, of: impl Fn(&Sums) -> f64) -> BelievedAndTrue {
        let tracked = self.cycles > 0;
        BelievedAndTrue {
            believed: tracked.then(|| of(&self.believed)),
            truth: self.truth.as_ref().map(of).filter(|_| tracked),
        }
    }
}

fn errors(wished: Pose2, believed: Pose2, truth: Option<&TruePlatform>) -> Errors {
    let real = truth.map(|truth| truth.odom_from_body);
    Errors {
        believed_m: wished.distance_m(believed),
        true_m: real.map(|real| wished.distance_m(real)),
        heading_rad: wished.heading_rad - real.unwrap_or(believed).heading_rad,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use omnibase_robot::signals::Setpoint;

    fn record(phase: Phase, wished_m: f64, believed_m: f64) -> CycleRecord {
        let mut record = CycleRecord {
            phase,
            wished: Setpoint::at_rest(Pose2::new(wished_m, 0.0, 0.0)),
            ..Default::default()
        };
        record.state.odom_from_body.x_m = believed_m;
        record
    }

    #[test]
    fn only_tracking_counts_and_the_hold_decides_the_end() {
        let mut tracking = Tracking::default();
        tracking.take(&record(Phase::Holding, 9.0, 0.0), None);
        assert_eq!(tracking.final_error_m(), BelievedAndTrue::default());
        let truth = TruePlatform { odom_from_body: Pose2::new(1.0, 2.0, 0.25), ..Default::default() };
        tracking.take(&record(Phase::Tracking, 1.0, 4.0), Some(&truth));
        tracking.take(&record(Phase::Tracking, 1.0, -3.0), Some(&truth));
        tracking.take(&record(Phase::Holding, 1.0, 0.5), Some(&truth));
        tracking.take(&record(Phase::Disabled, 1.0, 7.0), Some(&truth));
        assert_eq!(tracking.rms_error_m().believed, Some((12.5_f64).sqrt()));
        assert_eq!(tracking.max_error_m(), BelievedAndTrue { believed: Some(4.0), truth: Some(2.0) });
        assert_eq!(tracking.final_error_m(), BelievedAndTrue { believed: Some(0.5), truth: Some(2.0) });
        assert_eq!(tracking.final_heading_error_rad(), Some(-0.25));
        assert_eq!(tracking.wished_end(), Some(Pose2::new(1.0, 0.0, 0.0)));
    }
}
