//! Estimators: from what the drives say to what is known about the platform.

mod creep;
mod fused;

use omnibase_platform::odometry::MAX_PERIOD_S;
use omnibase_platform::{
    CovarianceSettings, GeometrySigmas, Kinematics, Odometry, OdometrySettings, OdometryState, PerWheel,
    Pose2, PoseGrowth, Twist2,
};

use crate::config::{EstimatorTable, Problem, RobotPlan};
use crate::decay::Decay;
use crate::registry::{Kind, Made, Registry, optional};
use crate::signals::{Exchange, PlatformState, ReferenceStatus};
use crate::stages::{Estimator, Observation};
use creep::Creep;
use fused::Fused;

/// Registers the built-in estimator.
pub fn register(registry: &mut Registry) {
    let keys = [
        "speed_filter_1_s",
        "creep",
        "roller_resistance",
        "radius_share",
        "wheel_direction_sigma_rad",
        "wheel_position_sigma_m",
        "start_sigma_m",
        "start_sigma_rad",
        "way_sigma_m",
        "way_sigma_rad",
        "turn_sigma_rad",
    ];
    registry.estimators.add(
        Kind {
            name: "wheel_odometry",
            meaning: "Odometry of the wheels with covariance; creep made up for where asked",
            keys: keys.map(optional).to_vec(),
        },
        WheelOdometry::new,
    );
    let own = ["task_frame", "unknown_sigma_m", "unknown_sigma_rad"];
    registry.estimators.add(
        Kind {
            name: "fused",
            meaning: "Odometry of the wheels with gyro, flow, twists and poses; with the wheels alone as `wheel_odometry`",
            keys: keys.into_iter().chain(own).map(optional).collect(),
        },
        Fused::new,
    );
}

/// Odometry of the wheels: increments as exact arcs, holonomic regimes, covariance; creep made up for where asked.
#[derive(Clone, Debug)]
pub struct WheelOdometry {
    odometry: Odometry,
    creep: Option<Creep>,
    /// Periods since the last complete exchange: its increments span them all.
    periods: u32,
    /// That of the speed.
    filter: Decay,
    state: PlatformState,
}

/// How uncertainty begins and grows, as a robot's file says.
pub fn covariance_settings(table: &EstimatorTable) -> CovarianceSettings {
    let ready = CovarianceSettings::default();
    let variance = |sigma: Option<f64>, ready: f64| sigma.map_or(ready, |sigma| sigma * sigma);
    CovarianceSettings {
        initial_m2: variance(table.start_sigma_m, ready.initial_m2),
        initial_rad2: variance(table.start_sigma_rad, ready.initial_rad2),
        position_per_m: variance(table.way_sigma_m, ready.position_per_m),
        heading_per_m: variance(table.way_sigma_rad, ready.heading_per_m),
        heading_per_rad: variance(table.turn_sigma_rad, ready.heading_per_rad),
        geometry: GeometrySigmas {
            radius_share: table.radius_share.unwrap_or(ready.geometry.radius_share),
            direction_rad: table.wheel_direction_sigma_rad.unwrap_or(ready.geometry.direction_rad),
            position_m: table.wheel_position_sigma_m.unwrap_or(ready.geometry.position_m),
        },
        ..ready
    }
}

/// α of the filtered derivative, rad/s: its lag (2.5 ms) is short against the controllers' time constants.
pub(crate) const SPEED_FILTER_RAD_S: f64 = 400.0;

impl WheelOdometry {
    /// Odometry as a plan says.
    pub fn new(plan: &RobotPlan) -> Made<Self> {
        let kinematics: Kinematics = plan.kinematics.clone();
        let speed_filter_rad_s = plan.estimator.speed_filter_1_s.unwrap_or(SPEED_FILTER_RAD_S);
        let settings = OdometrySettings {
            speed_filter_rad_s,
            covariance: covariance_settings(&plan.estimator),
            // The devices give angles already; raw counts aren't read here.
            ..OdometrySettings::direct_drive(kinematics.wheel_count(), 1)
        };
        let creep = Creep::new(&plan.estimator, &kinematics, plan.grip.told_height_m.unwrap_or(0.0));
        let odometry = Odometry::new(kinematics, settings).map_err(|error| Problem::refused("", error))?;
        let state = platform_state(odometry.state(), 0.0);
        Ok(WheelOdometry { odometry, creep, periods: 0, filter: Decay::new(speed_filter_rad_s), state })
    }
}

impl WheelOdometry {
    /// The pose after the last cycle.
    fn pose(&self) -> Pose2 {
        self.state.odom_from_body
    }

    /// What isn't known of a gap: how the wheels shared their way with its turns (it was taken for one arc: half a turn
    /// times the way, at most), and what of it nobody counted.
    fn widen(&mut self, before: Pose2, observation: &Observation<'_>) {
        let after = self.state.odom_from_body;
        let (way_m, turn_rad) = (before.distance_m(after), after.heading_rad - before.heading_rad);
        let arc_m = 0.5 * way_m * turn_rad;
        self.odometry.widen([arc_m * arc_m, 0.0]);
        let wheels = observation.measurements.present().len();
        let unread_rad = PerWheel::from_fn(wheels, |wheel| observation.unread_rad[wheel]);
        self.odometry.add_unread(&unread_rad, way_m);
        self.state.covariance = covariance(self.odometry.state());
    }
}

impl Estimator for WheelOdometry {
    fn hears_sensors(&self) -> bool {
        false
    }

    fn reset(&mut self, from: &PlatformState) {
        let Pose2 { x_m, y_m, heading_rad } = from.odom_from_body;
        self.odometry.resync();
        self.creep.iter_mut().for_each(Creep::reset);
        let [xx, _, _, yy, _, hh] = from.covariance;
        let sigmas = [xx.max(yy), hh].map(|variance| variance.max(0.0).sqrt());
        self.odometry.set_pose_within(Pose2::new(x_m, y_m, heading_rad), sigmas);
        self.periods = 0;
        self.state = platform_state(self.odometry.state(), 0.0);
    }

    fn update(&mut self, observation: &Observation<'_>) -> PlatformState {
        self.periods = self.periods.saturating_add(1);
        if observation.exchange != Exchange::Complete {
            return self.state;
        }
        let drives = observation.measurements.present();
        // After a long silence what was counted is as true as ever; only the speed in between is a mean.
        let period_s = (f64::from(self.periods) * observation.time.period_s()).min(MAX_PERIOD_S);
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
        let periods = std::mem::take(&mut self.periods);
        let before = self.state.odom_from_body;
        self.state = match self.odometry.advance(&increments_rad, period_s, Some(reference_in_body)) {
            Ok(state) => platform_state(state, filter_lag_s(&mut self.filter, period_s)),
            // What can't be used must not look like knowledge: safety stops on a state that isn't finite.
            Err(_) => PlatformState { slip_residual_m_s: f64::NAN, ..self.state },
        };
        let is_unread = observation.unread_rad.iter().any(|unread| *unread != 0.0);
        if periods > 1 || is_unread {
            self.widen(before, observation);
        }
        self.state
    }

    fn growth(&self) -> PoseGrowth {
        self.odometry.growth()
    }
}

/// How far the filtered derivative v = c·v + (1−c)·Δ/T lags behind: T/2 of the difference, T·c/(1−c) of the filter.
fn filter_lag_s(filter: &mut Decay, period_s: f64) -> f64 {
    let keep = filter.kept(period_s);
    period_s * (0.5 + keep / (1.0 - keep))
}

/// The upper half of the covariance: xx, xy, xψ, yy, yψ, ψψ.
fn covariance(state: &OdometryState) -> [f64; 6] {
    let [[xx, xy, xh], [_, yy, yh], [_, _, hh]] = state.covariance;
    [xx, xy, xh, yy, yh, hh]
}

fn platform_state(state: &OdometryState, twist_age_s: f64) -> PlatformState {
    PlatformState {
        // Whole turns count: a reference may turn on and on.
        odom_from_body: Pose2 { heading_rad: state.turned_rad, ..state.odom_from_base },
        twist_in_body: state.twist_in_base,
        twist_age_s,
        covariance: covariance(state),
        regime: state.regime,
        slip_residual_m_s: state.slip_residual_m_s,
        // Whether it is known the robot tells, who knows what was read.
        pose_known: true,
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
            let known_s = filter_lag_s(&mut crate::decay::Decay::new(filter_rad_s), period_s);
            assert!((lag_s - known_s).abs() < 1e-9, "{filter_rad_s}: {lag_s}");
        }
    }
}
