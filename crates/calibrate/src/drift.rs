//! How far dead reckoning by a build runs from where the platform was.

use omnibase_platform::{Kinematics, LayoutError, Pose2, wrap_angle_rad};

use crate::build::Build;
use crate::creep;
use crate::dataset::Run;
use crate::solve::RunFit;
use crate::way::Steps;

/// Dead reckoning against the poses of a fit, from its first one on; where only places on the floor were measured, against these.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drift {
    /// When, s.
    pub instants_s: Vec<f64>,
    /// Reckoned less true: x and y m in the fit's world, heading rad.
    pub errors: Vec<[f64; 3]>,
}

impl Drift {
    /// Reckons a run's wheels by a build.
    pub fn of(run: &Run, fit: &RunFit, build: &Build) -> Result<Drift, LayoutError> {
        let kinematics = Kinematics::new(build.wheels.clone())?;
        let treads = creep::treads(run, &kinematics, build.roller_resistance);
        let ways = Steps::new(build, build, &[])?.ways(run, &treads, &fit.instants_s);
        let mut reckoned = fit.world_from_base.first().copied().unwrap_or_default();
        let mut drift = Drift::default();
        for (number, (instant_s, truth)) in fit.instants_s.iter().zip(&fit.world_from_base).enumerate() {
            if let Some(way) = number.checked_sub(1).and_then(|at| ways.get(at)) {
                reckoned = reckoned.then(way.moved);
            }
            let measured = run.places.iter().find(|place| (place.instant_s - instant_s).abs() < 1e-6);
            let truth = match measured {
                Some(place) => place.floor_from_base,
                None if run.places.is_empty() => *truth,
                // In between nobody looked.
                None => continue,
            };
            drift.instants_s.push(*instant_s);
            drift.errors.push(difference(reckoned, truth));
        }
        Ok(drift)
    }

    /// Root of the mean square of the distance, m.
    pub fn rms_m(&self) -> f64 {
        let squares: f64 = self.errors.iter().map(|[x, y, _]| x * x + y * y).sum();
        (squares / self.errors.len().max(1) as f64).sqrt()
    }

    /// The greatest distance, m.
    pub fn greatest_m(&self) -> f64 {
        self.errors.iter().map(|[x, y, _]| x.hypot(*y)).fold(0.0, f64::max)
    }
}

fn difference(reckoned: Pose2, truth: Pose2) -> [f64; 3] {
    let heading = wrap_angle_rad(reckoned.heading_rad - truth.heading_rad);
    [reckoned.x_m - truth.x_m, reckoned.y_m - truth.y_m, heading]
}
