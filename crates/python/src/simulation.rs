//! A simulated robot, cycle by cycle.

use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard};

use omnibase_platform::{Pose2, Twist2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::array;
use crate::failure::Failure;
use crate::law::{self, Law};
use crate::robot_file::Wanted;
use crate::simulated::{Manner, REGISTRY, Simulated, frame};

/// Cycles between two looks whether somebody pressed Ctrl-C.
const PIECE: usize = 5_000;

/// The same where cycles wait for the host's clock.
const PACED_PIECE: usize = 50;

/// A simulated robot on virtual time: it goes on only where it is stepped.
#[pyclass(frozen, module = "omnibase")]
pub struct Simulation(Mutex<Simulated>);

impl Simulation {
    /// Nobody waits for the robot with Python held.
    fn robot(&self) -> MutexGuard<'_, Simulated> {
        self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
    }

    fn with<T: Send>(&self, py: Python<'_>, work: impl FnOnce(&mut Simulated) -> T + Send) -> T {
        py.detach(|| work(&mut self.robot()))
    }
}

#[pymethods]
impl Simulation {
    #[new]
    #[pyo3(signature = (robot, *, path=None, reference=None, settings=None, controller=None, realtime=false))]
    fn new(
        py: Python<'_>,
        robot: PathBuf,
        path: Option<PathBuf>,
        reference: Option<&Bound<'_, PyDict>>,
        settings: Option<&Bound<'_, PyDict>>,
        controller: Option<Py<PyAny>>,
        realtime: bool,
    ) -> PyResult<Self> {
        let mut wanted = Wanted::new(robot, path, reference, settings)?;
        let law = controller.map(Law::new);
        if law.is_some() {
            wanted.controlled_by(law::KIND)?;
        }
        let begun = py.detach(|| {
            let own = law.as_ref().map(Law::registry);
            let (plan, leader) = wanted.load(own.as_ref().unwrap_or(&REGISTRY))?;
            Simulated::begin(plan, Manner { leader, realtime, law })
        });
        Ok(Simulation(Mutex::new(begun?)))
    }

    fn reset(&self, py: Python<'_>) -> PyResult<()> {
        Ok(self.with(py, Simulated::begin_again)?)
    }

    #[pyo3(signature = (cycles=1))]
    fn step(&self, py: Python<'_>, cycles: usize) -> PyResult<()> {
        self.step_and(py, cycles, |_| ())
    }

    /// So many cycles, and these signals after each of them.
    #[pyo3(signature = (cycles, signals))]
    fn trace<'py>(
        &self,
        py: Python<'py>,
        cycles: usize,
        signals: Vec<String>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let columns = self.with(py, |robot| robot.columns(&signals))?;
        let mut values = Vec::new();
        self.step_and(py, cycles, |robot| robot.values(&columns, &mut values))?;
        array(py, &values, &[cycles, columns.len()])
    }

    fn enable(&self, py: Python<'_>) -> PyResult<()> {
        Ok(self.with(py, Simulated::enable)?)
    }

    #[pyo3(signature = (vx_m_s, vy_m_s, turn_rad_s, frame="body"))]
    fn drive(&self, py: Python<'_>, vx_m_s: f64, vy_m_s: f64, turn_rad_s: f64, frame: &str) -> PyResult<()> {
        let frame = self::frame(frame)?;
        self.with(py, |robot| robot.drive([vx_m_s, vy_m_s, turn_rad_s], frame));
        Ok(())
    }

    fn go_to(&self, py: Python<'_>, x_m: f64, y_m: f64, heading_rad: f64) -> PyResult<()> {
        Ok(self.with(py, |robot| robot.go_to([x_m, y_m, heading_rad]))?)
    }

    #[pyo3(signature = (category="category_2"))]
    fn stop(&self, py: Python<'_>, category: &str) -> PyResult<()> {
        Ok(self.with(py, |robot| robot.stop(category))?)
    }

    #[getter]
    fn signals(&self, py: Python<'_>) -> Vec<String> {
        self.with(py, |robot| robot.stepped().schema().names().collect())
    }

    fn __getitem__(&self, py: Python<'_>, signal: &str) -> PyResult<f64> {
        let value = self.with(py, |robot| {
            let (column, mut value) = (robot.columns(&[signal.to_owned()])?, Vec::new());
            robot.values(&column, &mut value);
            match value[..] {
                [value] => Ok(value),
                _ => Err(Failure::Broken(format!("`{signal}`: expected one signal, found {}", value.len()))),
            }
        });
        Ok(value?)
    }

    #[getter]
    fn cycle_s(&self, py: Python<'_>) -> f64 {
        self.with(py, |robot| robot.cycle_s())
    }

    #[getter]
    fn time_s(&self, py: Python<'_>) -> f64 {
        self.with(py, |robot| robot.stepped().record().time.now_ns as f64 * 1e-9)
    }

    #[getter]
    fn phase(&self, py: Python<'_>) -> &'static str {
        self.with(py, |robot| robot.phase().name())
    }

    #[getter]
    fn stop_reason(&self, py: Python<'_>) -> Option<&'static str> {
        self.with(py, |robot| robot.stop_reason())
    }

    #[getter]
    fn is_over(&self, py: Python<'_>) -> bool {
        self.with(py, |robot| robot.stepped().is_over())
    }

    #[getter]
    fn has_finished(&self, py: Python<'_>) -> bool {
        self.with(py, |robot| robot.stepped().has_finished())
    }

    #[getter]
    fn pose(&self, py: Python<'_>) -> (f64, f64, f64) {
        pose(self.with(py, |robot| robot.stepped().record().state.odom_from_body))
    }

    #[getter]
    fn twist(&self, py: Python<'_>) -> (f64, f64, f64) {
        twist(self.with(py, |robot| robot.stepped().record().state.twist_in_body))
    }

    #[getter]
    fn true_pose(&self, py: Python<'_>) -> (f64, f64, f64) {
        pose(self.with(py, |robot| robot.stepped().truth().odom_from_body))
    }

    #[getter]
    fn true_twist(&self, py: Python<'_>) -> (f64, f64, f64) {
        twist(self.with(py, |robot| robot.stepped().truth().twist_in_body))
    }

    #[getter]
    fn wheel_speeds_rad_s(&self, py: Python<'_>) -> Vec<f64> {
        self.with(py, |robot| {
            robot.stepped().record().measurements.present().iter().map(|drive| drive.speed_rad_s).collect()
        })
    }

    #[getter]
    fn wheel_torques_nm(&self, py: Python<'_>) -> Vec<f64> {
        self.with(py, |robot| {
            robot.stepped().record().measurements.present().iter().map(|drive| drive.torque_nm).collect()
        })
    }
}

impl Simulation {
    fn step_and(
        &self,
        py: Python<'_>,
        cycles: usize,
        mut look: impl FnMut(&mut Simulated) + Send,
    ) -> PyResult<()> {
        let mut left = cycles;
        let most = if self.with(py, |robot| robot.keeps_pace()) { PACED_PIECE } else { PIECE };
        while left > 0 {
            let piece = left.min(most);
            self.with(py, |robot| {
                for _ in 0..piece {
                    robot.step()?;
                    look(robot);
                }
                Ok::<(), Failure>(())
            })?;
            left -= piece;
            py.check_signals()?;
        }
        Ok(())
    }
}

fn pose(Pose2 { x_m, y_m, heading_rad }: Pose2) -> (f64, f64, f64) {
    (x_m, y_m, heading_rad)
}

fn twist(Twist2 { vx_m_s, vy_m_s, w_rad_s }: Twist2) -> (f64, f64, f64) {
    (vx_m_s, vy_m_s, w_rad_s)
}
