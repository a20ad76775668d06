//! From encoder counts to the platform's pose, twist and covariance.
//!
//! Every step is an exact arc, which is right in every motion; how the platform moves ([`regime`]) is told beside it and
//! changes nothing.

mod covariance;
mod encoder;
mod geometry;
pub mod regime;

use nalgebra::{Matrix3, SMatrix};

use crate::kinematics::Kinematics;
use crate::se2::{Pose2, Twist2};
use crate::wheel::PerWheel;
pub use covariance::{CovarianceSettings, PoseGrowth};
use encoder::Encoders;
use geometry::GeometryErrors;
pub use geometry::GeometrySigmas;
use regime::Recogniser;
pub use regime::{Regime, RegimeTolerances};

/// What odometry is told once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OdometrySettings {
    /// The angle of each wheel per encoder count, in rad; negative for a motor mounted the other way round.
    pub rad_per_count: PerWheel,
    /// α of the filtered derivative c = exp(−αT), in rad/s.
    pub speed_filter_rad_s: f64,
    /// When a motion counts as holonomic.
    pub regimes: RegimeTolerances,
    /// How uncertainty grows.
    pub covariance: CovarianceSettings,
}

impl OdometrySettings {
    /// Settings for wheels driven directly, with encoders of so many counts per revolution.
    pub fn direct_drive(wheel_count: usize, counts_per_revolution: u32) -> OdometrySettings {
        let rad_per_count = std::f64::consts::TAU / f64::from(counts_per_revolution);
        OdometrySettings {
            rad_per_count: PerWheel::from_fn(wheel_count, |_| rad_per_count),
            speed_filter_rad_s: 50.0,
            regimes: RegimeTolerances::default(),
            covariance: CovarianceSettings::default(),
        }
    }
}

/// What odometry knows after a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OdometryState {
    /// The pose; its heading in (−π, π].
    pub odom_from_base: Pose2,
    /// The heading with whole turns counted, in rad.
    pub turned_rad: f64,
    /// The filtered twist in base.
    pub twist_in_base: Twist2,
    /// The filtered twist in odom.
    pub twist_in_odom: Twist2,
    /// The filtered speed of each wheel, in rad/s.
    pub wheel_speeds_rad_s: PerWheel,
    /// How far each wheel turned since start, in rad.
    pub wheel_angles_rad: PerWheel,
    /// The surface speed that no twist explains, in m/s; see [`crate::MeasuredTwist`].
    pub slip_residual_m_s: f64,
    /// How the platform moves.
    pub regime: Regime,
    /// The covariance of (x, y, heading) in odom, in m², m·rad and rad².
    pub covariance: [[f64; 3]; 3],
}

/// Why settings or a sample were refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum OdometryError {
    /// Not one value per wheel.
    #[error("{setting}: {found} values for {expected} wheels")]
    WheelCount {
        /// Which argument.
        setting: &'static str,
        /// How many wheels there are.
        expected: usize,
        /// How many values came.
        found: usize,
    },
    /// A setting that must be positive (or at least not negative) and finite is not.
    #[error("{setting} is {found}, expected a positive number")]
    Setting {
        /// Which setting.
        setting: &'static str,
        /// What was found.
        found: f64,
    },
    /// The time between two samples is no sensible period.
    #[error("{found_s} s between two samples, expected {MIN_PERIOD_S} s to {MAX_PERIOD_S} s")]
    Period {
        /// The time found.
        found_s: f64,
    },
    /// A wheel angle is not finite.
    #[error("the increment of wheel {wheel} is not finite")]
    NotFinite {
        /// Which wheel, from 0.
        wheel: usize,
    },
}

/// A shorter period would make noise of the derivative, in s.
pub const MIN_PERIOD_S: f64 = 1e-6;
/// After a longer silence the path in between is a guess, in s: call [`Odometry::resync`].
pub const MAX_PERIOD_S: f64 = 10.0;

/// A residual counts as slip as far as it is greater than so many standard deviations of what wrong wheels make.
const EXPLAINED_SIGMAS: f64 = 3.0;

/// Odometry of one platform: one call per cycle.
#[derive(Clone, Debug)]
pub struct Odometry {
    kinematics: Kinematics,
    settings: OdometrySettings,
    encoders: Encoders,
    recogniser: Recogniser,
    /// What is added at each step; what stays is in `geometry_errors`.
    covariance: Matrix3<f64>,
    geometry_errors: GeometryErrors,
    state: OdometryState,
    /// What the filter of speeds keeps over a period, s.
    kept: (f64, f64),
}

impl Kinematics {
    /// Covariance of the constant 3 × 3 matrix, row by row, by which wheels that aren't quite as they are said to be make
    /// each step of the body wrong.
    pub fn step_covariance(&self, sigmas: &GeometrySigmas) -> SMatrix<f64, 9, 9> {
        GeometryErrors::new(self, sigmas).step_covariance()
    }
}

impl Odometry {
    /// Odometry that begins at the origin of odom.
    pub fn new(kinematics: Kinematics, settings: OdometrySettings) -> Result<Odometry, OdometryError> {
        check(&kinematics, &settings)?;
        let zero = PerWheel::from_fn(kinematics.wheel_count(), |_| 0.0);
        let covariance = settings.covariance.initial();
        let start = Pose2::default();
        Ok(Odometry {
            encoders: Encoders::new(settings.rad_per_count),
            recogniser: Recogniser::new(settings.regimes),
            covariance,
            geometry_errors: GeometryErrors::new(&kinematics, &settings.covariance.geometry),
            state: OdometryState {
                odom_from_base: start,
                turned_rad: 0.0,
                twist_in_base: Twist2::default(),
                twist_in_odom: Twist2::default(),
                wheel_speeds_rad_s: zero,
                wheel_angles_rad: zero,
                slip_residual_m_s: 0.0,
                regime: Regime::Standstill,
                covariance: array(&covariance),
            },
            kinematics,
            settings,
            kept: (0.0, 1.0),
        })
    }

    /// What is known after the last sample.
    pub fn state(&self) -> &OdometryState {
        &self.state
    }

    /// By how much motion may make its pose more uncertain.
    pub fn growth(&self) -> PoseGrowth {
        self.geometry_errors.growth(&self.settings.covariance)
    }

    /// The next sample is an origin again: after a loss of samples, or a drive that was switched off.
    ///
    /// The pose stays; motion in between is not known.
    pub fn resync(&mut self) {
        self.encoders.resync();
        let zero = self.state.wheel_speeds_rad_s.map(|_| 0.0);
        self.state.wheel_speeds_rad_s = zero;
        self.state.twist_in_base = Twist2::default();
        self.state.twist_in_odom = Twist2::default();
    }

    /// Puts the platform elsewhere (a person reset the fixed frame, a camera saw it); uncertainty starts anew.
    pub fn set_pose(&mut self, odom_from_base: Pose2) {
        self.covariance = self.settings.covariance.initial();
        self.geometry_errors.reset();
        self.tell_covariance();
        self.state.odom_from_base = odom_from_base.wrapped();
        self.state.turned_rad = odom_from_base.heading_rad;
        self.state.twist_in_odom = self.state.twist_in_base.rotated(odom_from_base.heading_rad);
    }

    /// As [`Odometry::set_pose`], with standard deviations in m and rad; none is smaller than at start.
    pub fn set_pose_within(&mut self, odom_from_base: Pose2, [sigma_m, sigma_rad]: [f64; 2]) {
        self.set_pose(odom_from_base);
        self.widen([sigma_m * sigma_m, sigma_rad * sigma_rad]);
    }

    /// Wheels may have turned by so much more than was counted, in rad: the pose is that much less certain.
    ///
    /// Each is taken as evenly spread over both ways (a standard deviation of 1/√3 of it), in any direction of the
    /// platform; a heading that is wrong turned the way of `way_m` with it.
    pub fn add_unread(&mut self, unread_rad: &PerWheel, way_m: f64) {
        let mut variances = [0.0; 2];
        for (wheel, unread) in unread_rad.iter().enumerate() {
            let alone = PerWheel::from_fn(unread_rad.len(), |at| if at == wheel { *unread } else { 0.0 });
            let (step, _) = self.kinematics.body_step(&alone);
            let (distance_m, turn_rad) = (step.distance_m(), step.angle_rad);
            variances[0] += (distance_m * distance_m + way_m * way_m * turn_rad * turn_rad) / 3.0;
            variances[1] += turn_rad * turn_rad / 3.0;
        }
        self.widen(variances);
    }

    /// Adds to the variances of x and y, m², and of the heading, rad².
    pub fn widen(&mut self, [position_m2, heading_rad2]: [f64; 2]) {
        for (at, variance) in [position_m2, position_m2, heading_rad2].into_iter().enumerate() {
            self.covariance[(at, at)] += variance;
        }
        self.tell_covariance();
    }

    fn tell_covariance(&mut self) {
        self.state.covariance = array(&(self.covariance + self.geometry_errors.covariance()));
    }

    /// Takes one sample of raw encoder counts, `period_s` after the one before.
    ///
    /// The first sample after start or [`Odometry::resync`] is the origin. `reference_in_base` is the twist that
    /// the platform was told; without it no regime is recognised. A refused sample changes nothing:
    /// its increment comes with the next one.
    pub fn update(
        &mut self,
        counts: &PerWheel<i32>,
        period_s: f64,
        reference_in_base: Option<Twist2>,
    ) -> Result<&OdometryState, OdometryError> {
        self.count_matches("counts", counts.len())?;
        check_period(period_s)?;
        let increments_rad = self.encoders.increments_rad(counts);
        self.advance(&increments_rad, period_s, reference_in_base)
    }

    /// Takes the angles, in rad, by which the wheels turned during `period_s`; [`Odometry::update`] without counts.
    pub fn advance(
        &mut self,
        increments_rad: &PerWheel,
        period_s: f64,
        reference_in_base: Option<Twist2>,
    ) -> Result<&OdometryState, OdometryError> {
        self.count_matches("increments", increments_rad.len())?;
        check_period(period_s)?;
        if let Some(wheel) = increments_rad.iter().position(|angle| !angle.is_finite()) {
            return Err(OdometryError::NotFinite { wheel });
        }
        let (step, residual_m) = self.kinematics.body_step(increments_rad);
        if period_s != self.kept.0 {
            self.kept = (period_s, (-self.settings.speed_filter_rad_s * period_s).exp());
        }
        let keep = self.kept.1;
        let state = &mut self.state;
        state.wheel_speeds_rad_s = PerWheel::from_fn(increments_rad.len(), |at| {
            keep * state.wheel_speeds_rad_s[at] + (1.0 - keep) * increments_rad[at] / period_s
        });
        for (angle, increment) in state.wheel_angles_rad.iter_mut().zip(increments_rad.iter()) {
            *angle += increment;
        }
        let twist_in_base = self.kinematics.twist(&state.wheel_speeds_rad_s).twist_in_base;
        state.twist_in_base = twist_in_base;
        state.slip_residual_m_s = residual_m / period_s;

        self.state.regime = self.recogniser.step(reference_in_base, twist_in_base);
        let before = Pose2 { heading_rad: self.state.turned_rad, ..self.state.odom_from_base };
        let pose = before.moved_by(step);

        // Wheels that aren't quite as the layout says contradict each other without any slip.
        let explained_m = EXPLAINED_SIGMAS * self.geometry_errors.advance(step, before, pose);
        let slip_m = (residual_m - explained_m).max(0.0);
        self.covariance = self.settings.covariance.grown(&self.covariance, before, pose, step, slip_m);
        self.tell_covariance();
        self.state.turned_rad = pose.heading_rad;
        self.state.odom_from_base = pose.wrapped();
        self.state.twist_in_odom = twist_in_base.rotated(pose.heading_rad);
        Ok(&self.state)
    }

    fn count_matches(&self, setting: &'static str, found: usize) -> Result<(), OdometryError> {
        let expected = self.kinematics.wheel_count();
        if found == expected { Ok(()) } else { Err(OdometryError::WheelCount { setting, expected, found }) }
    }
}

fn check_period(period_s: f64) -> Result<(), OdometryError> {
    if (MIN_PERIOD_S..=MAX_PERIOD_S).contains(&period_s) {
        Ok(())
    } else {
        Err(OdometryError::Period { found_s: period_s })
    }
}

fn check(kinematics: &Kinematics, settings: &OdometrySettings) -> Result<(), OdometryError> {
    let (expected, found) = (kinematics.wheel_count(), settings.rad_per_count.len());
    if found != expected {
        return Err(OdometryError::WheelCount { setting: "rad_per_count", expected, found });
    }
    let scales = settings.rad_per_count.iter().map(|scale| ("rad_per_count", scale.abs()));
    let regimes = &settings.regimes;
    let tolerances = [
        ("speed_filter_rad_s", settings.speed_filter_rad_s),
        ("still_m_s", regimes.still_m_s),
        ("still_rad_s", regimes.still_rad_s),
        ("direction_rad", regimes.direction_rad),
        ("curvature_per_m", regimes.curvature_per_m),
    ];
    // A covariance that does not grow, or starts at zero, would claim certainty that no wheel has.
    for (setting, found) in scales.chain(tolerances).chain(settings.covariance.named()) {
        if !(found.is_finite() && found > 0.0) {
            return Err(OdometryError::Setting { setting, found });
        }
    }
    Ok(())
}

fn array(matrix: &Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
}
