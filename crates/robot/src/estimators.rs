//! Estimators: from what the drives say to what is known about the platform.

mod creep;

use omnibase_platform::{
    Kinematics, Odometry, OdometryError, OdometrySettings, OdometryState, PerWheel, Pose2, Twist2,
};

use crate::config::RobotPlan;
use crate::registry::{Registry, StageError};
use crate::signals::{Exchange, PlatformState, ReferenceStatus};
use crate::stages::{Estimator, Observation};
use creep::Creep;

/// Registers the built-in estimator, `wheel_odometry`.
pub fn register(registry: &mut Registry) {
    registry.estimator("wheel_odometry", |plan| Ok(Box::new(WheelOdometry::new(plan)?)));
}

/// Odometry of the wheels: increments as exact arcs, holonomic regimes, covariance; creep made up for where asked.
#[derive(Clone, Debug)]
pub struct WheelOdometry {
    odometry: Odometry,
    creep: Option<Creep>,
    /// Periods since the last complete exchange: its increments span them all.
    periods: u32,
    speed_filter_rad_s: f64,
    state: PlatformState,
}

/// α of the filtered derivative, rad/s: its lag (2.5 ms) is short against the controllers' time constants.
const SPEED_FILTER_RAD_S: f64 = 400.0;

impl WheelOdometry {
    /// Odometry as a plan says.
    pub fn new(plan: &RobotPlan) -> Result<Self, StageError> {
        let kinematics: Kinematics = plan.kinematics.clone();
        let speed_filter_rad_s = plan.estimator.speed_filter_1_s.unwrap_or(SPEED_FILTER_RAD_S);
        let settings = OdometrySettings {
            speed_filter_rad_s,
            // The devices give angles already; raw counts aren't read here.
            ..OdometrySettings::direct_drive(kinematics.wheel_count(), 1)
        };
        let creep = Creep::new(&plan.estimator, &kinematics);
        let odometry = Odometry::new(kinematics, settings).map_err(|error| StageError::Refused {
            setting: "estimator".into(),
            reason: error.to_string(),
        })?;
        let state = platform_state(odometry.state(), 0.0);
        Ok(WheelOdometry { odometry, creep, periods: 0, speed_filter_rad_s, state })
    }
}

impl Estimator for WheelOdometry {
    fn reset(&mut self, from: &PlatformState) {
        let Pose2 { x_m, y_m, heading_rad } = from.odom_from_body;
        self.odometry.resync();
        self.creep.iter_mut().for_each(Creep::reset);
        self.odometry.set_pose(Pose2::new(x_m, y_m, heading_rad));
        self.periods = 0;
        self.state = platform_state(self.odometry.state(), 0.0);
    }

    fn update(&mut self, observation: &Observation<'_>) -> PlatformState {
        self.periods = self.periods.saturating_add(1);
        if observation.exchange != Exchange::Complete {
            return self.state;
        }
        let drives = observation.measurements.present();
        let period_s = f64::from(self.periods) * observation.time.period_s();
        let counted_rad = PerWheel::from_fn(drives.len(), |wheel| drives[wheel].increment_rad);
        let increments_rad = match &mut self.creep {
            Some(creep) => creep.corrected(&counted_rad, &self.state, period_s),
            None => counted_rad,
        };
        let wished = observation.wished;
        let reference_in_body = match wished.status {
            ReferenceStatus::Moving => wished.twist_in_odom.rotated(-wished.odom_from_body.heading_rad),
            ReferenceStatus::Resting | ReferenceStatus::Finished => Twist2::default(),
        };
        self.periods = 0;
        self.state = match self.odometry.advance(&increments_rad, period_s, Some(reference_in_body)) {
            Ok(state) => platform_state(state, filter_lag_s(self.speed_filter_rad_s, period_s)),
            // Too long a silence: what moved meanwhile isn't known, but from here on all is well.
            Err(OdometryError::Period { .. }) => {
                self.odometry.resync();
                self.creep.iter_mut().for_each(Creep::reset);
                platform_state(self.odometry.state(), 0.0)
            }
            // What can't be used must not look like knowledge: safety stops on a state that isn't finite.
            Err(_) => PlatformState { slip_residual_m_s: f64::NAN, ..self.state },
        };
        self.state
    }
}

/// How far the filtered derivative v = c·v + (1−c)·Δ/T lags behind: T/2 of the difference, T·c/(1−c) of the filter.
fn filter_lag_s(filter_rad_s: f64, period_s: f64) -> f64 {
    let keep = (-filter_rad_s * period_s).exp();
    period_s * (0.5 + keep / (1.0 - keep))
}

fn platform_state(state: &OdometryState, twist_age_s: f64) -> PlatformState {
    let [[xx, xy, xh], [_, yy, yh], [_, _, hh]] = state.covariance;
    PlatformState {
        // Whole turns count: a reference may turn on and on.
        odom_from_body: Pose2 { heading_rad: state.turned_rad, ..state.odom_from_base },
        twist_in_body: state.twist_in_base,
        twist_age_s,
        covariance: [xx, xy, xh, yy, yh, hh],
        regime: state.regime,
        slip_residual_m_s: state.slip_residual_m_s,
    }
}

#[cfg(test)]
mod tests {
    use super::filter_lag_s;

    #[test]
    fn the_filter_lags_by_half_a_period_and_its_own_time() {
        // A ramp with slope 1 through the filter itself, after all transients: seed-free, 1e-9 s.
        for (filter_rad_s, period_s) in [(400.0, 1e-3), (50.0, 1e-3), (200.0, 250e-6)] {
            let keep = f64::exp(-filter_rad_s * period_s);
            let (mut filtered, mut speed) = (0.0, 0.0);
            for _ in 0..100_000 {
                // The position of a speed that rises by one per second, differentiated over one period.
                let before = speed;
                speed += period_s;
                filtered = keep * filtered + (1.0 - keep) * 0.5 * (before + speed);
            }
            let lag_s: f64 = speed - filtered;
            assert!((lag_s - filter_lag_s(filter_rad_s, period_s)).abs() < 1e-9, "{filter_rad_s}: {lag_s}");
        }
    }
}
