//! Kinematics, odometry and trajectories as functions.

use std::path::PathBuf;
use std::sync::Mutex;

use omnibase_platform::{PerWheel, Pose2, Twist2, Wrench2};
use omnibase_trajectory::{
    Interpolation, PathPoint, PathPoints, PointTrajectory, Setpoint, SpeedRule, Trajectory,
};
use pyo3::prelude::*;

use crate::arrays::{array, rows};
use crate::failure::Failure;
use crate::robot_file::Wanted;
use crate::simulated::REGISTRY;

type Three = (f64, f64, f64);

/// The wheels of a robot's file.
#[pyclass(frozen, module = "omnibase")]
pub struct Kinematics(omnibase_platform::Kinematics);

impl Kinematics {
    fn per_wheel(&self, name: &str, values: &[f64]) -> Result<PerWheel, Failure> {
        let expected = self.0.wheel_count();
        PerWheel::from_slice(values).filter(|values| values.len() == expected).ok_or_else(|| {
            Failure::Broken(format!("{name}: expected {expected} values, found {}", values.len()))
        })
    }
}

#[pymethods]
impl Kinematics {
    #[new]
    fn new(robot: PathBuf) -> PyResult<Self> {
        let (plan, _) = Wanted::new(robot, None, None, None)?.load(&REGISTRY)?;
        Ok(Kinematics(plan.kinematics))
    }

    #[getter]
    fn wheels(&self) -> Vec<String> {
        self.0.wheels().iter().map(|wheel| wheel.name.clone()).collect()
    }

    #[getter]
    fn matrix<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array(py, &self.0.matrix().concat(), &[self.0.wheel_count(), 3])
    }

    fn wheel_speeds_rad_s(&self, twist: Three) -> Vec<f64> {
        let (vx_m_s, vy_m_s, turn_rad_s) = twist;
        self.0.wheel_speeds_rad_s(Twist2::new(vx_m_s, vy_m_s, turn_rad_s)).to_vec()
    }

    fn twist(&self, wheel_speeds_rad_s: Vec<f64>) -> PyResult<(Three, f64)> {
        let measured = self.0.twist(&self.per_wheel("wheel_speeds_rad_s", &wheel_speeds_rad_s)?);
        let Twist2 { vx_m_s, vy_m_s, w_rad_s } = measured.twist_in_base;
        Ok(((vx_m_s, vy_m_s, w_rad_s), measured.residual_m_s))
    }

    fn wheel_torques_nm(&self, wrench: Three) -> Vec<f64> {
        let (fx_n, fy_n, torque_nm) = wrench;
        self.0.wheel_torques_nm(Wrench2::new(fx_n, fy_n, torque_nm)).to_vec()
    }

    fn wrench(&self, wheel_torques_nm: Vec<f64>) -> PyResult<Three> {
        let Wrench2 { fx_n, fy_n, torque_nm } =
            self.0.wrench(&self.per_wheel("wheel_torques_nm", &wheel_torques_nm)?);
        Ok((fx_n, fy_n, torque_nm))
    }
}

/// Odometry of wheels that turned by angles.
#[pyclass(frozen, module = "omnibase")]
pub struct Odometry(Mutex<omnibase_platform::Odometry>);

impl Odometry {
    fn with<T>(&self, work: impl FnOnce(&mut omnibase_platform::Odometry) -> T) -> T {
        work(&mut self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner()))
    }
}

#[pymethods]
impl Odometry {
    #[new]
    fn new(kinematics: &Kinematics) -> PyResult<Self> {
        let settings = omnibase_platform::OdometrySettings::direct_drive(kinematics.0.wheel_count(), 1);
        let odometry = omnibase_platform::Odometry::new(kinematics.0.clone(), settings);
        Ok(Odometry(Mutex::new(odometry.map_err(Failure::of)?)))
    }

    /// The pose after the wheels turned by these angles in this time.
    fn advance(&self, increments_rad: Vec<f64>, period_s: f64) -> PyResult<Three> {
        let many = || Failure::Broken(format!("increments_rad: found {} values", increments_rad.len()));
        let increments = PerWheel::from_slice(&increments_rad).ok_or_else(many)?;
        self.with(|odometry| odometry.advance(&increments, period_s, None).map(|_| ()).map_err(Failure::of))?;
        Ok(self.pose())
    }

    #[getter]
    fn pose(&self) -> Three {
        let Pose2 { x_m, y_m, heading_rad } = self.with(|odometry| odometry.state().odom_from_base);
        (x_m, y_m, heading_rad)
    }

    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        array(py, &self.with(|odometry| odometry.state().covariance).concat(), &[3, 3])
    }

    fn set_pose(&self, pose: Three) {
        let (x_m, y_m, heading_rad) = pose;
        self.with(|odometry| odometry.set_pose(Pose2::new(x_m, y_m, heading_rad)));
    }
}

/// The motion along points of time and pose, sampled every so many s: times, poses, twists and accelerations in odom.
#[pyfunction]
#[pyo3(signature = (points, period_s, interpolation="spline"))]
pub fn trajectory<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    period_s: f64,
    interpolation: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let interpolation = match interpolation {
        "smooth" => Interpolation::Smooth,
        "cubic" => Interpolation::Cubic(SpeedRule::MeanSlope),
        "quintic" => Interpolation::Quintic,
        "spline" => Interpolation::Spline,
        "b_spline" => Interpolation::BSpline,
        _ => {
            let words = format!(
                "interpolation: expected smooth, cubic, quintic, spline or b_spline, found `{interpolation}`"
            );
            return Err(Failure::Broken(words).into());
        }
    };
    let point = |[time_s, x_m, y_m, heading_rad]: [f64; 4]| PathPoint {
        time_s,
        odom_from_base: Pose2::new(x_m, y_m, heading_rad),
    };
    let count = points.len()?;
    let points = rows::<4>(points, "points", count)?.into_iter().map(point).collect();
    let motion = PointTrajectory::new(&PathPoints::new(points).map_err(Failure::of)?, interpolation);
    let samples = motion.duration_s() / period_s;
    if !(0.0..=1e7).contains(&samples) {
        let words = format!(
            "period_s: expected a positive time, of which {} s have ten million at most, found {period_s}",
            motion.duration_s()
        );
        return Err(Failure::Broken(words).into());
    }
    let times = (0..=samples.floor() as usize).map(|at| at as f64 * period_s);
    let values: Vec<f64> = times.flat_map(|time_s| sampled(time_s, &motion.sample(time_s))).collect();
    array(py, &values, &[values.len() / 10, 10])
}

fn sampled(time_s: f64, setpoint: &Setpoint) -> [f64; 10] {
    let Setpoint { odom_from_base: pose, twist_in_odom: twist, acceleration_in_odom: acceleration, .. } =
        setpoint;
    [
        time_s,
        pose.x_m,
        pose.y_m,
        pose.heading_rad,
        twist.vx_m_s,
        twist.vy_m_s,
        twist.w_rad_s,
        acceleration.vx_m_s,
        acceleration.vy_m_s,
        acceleration.w_rad_s,
    ]
}
