//! A robot that runs in a process of its own: a program's seat at it, and its signals.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use omnibase_client::robots::{Endpoint, latest};
use omnibase_client::{Error as ClientError, Found, Frame, Heard, Seat, States, Wanted};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::Value;

use crate::arrays::array;
use crate::failure::Failure;
use crate::robot_file::object;

/// How long an answer is awaited.
const ANSWER: Duration = Duration::from_secs(5);

impl From<ClientError> for Failure {
    fn from(error: ClientError) -> Self {
        match error {
            ClientError::Refused(_) | ClientError::Stopped(_) => Failure::Refused(error.to_string()),
            _ => Failure::of(error),
        }
    }
}

/// The robot at an address, or the one of this machine that was started last.
fn found(address: Option<&str>, token: Option<String>) -> Result<Found, Failure> {
    let Some(address) = address else { return Ok(latest()?) };
    let expected = |_| Failure::Broken(format!("address: expected <address>:<port>, found `{address}`"));
    let place = Endpoint::Address(address.parse().map_err(expected)?);
    Ok(Found { robot: String::new(), place, token: token.unwrap_or_default() })
}

/// What JSON says, as Python has it.
fn python<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (value.to_string(),))
}

fn duration(seconds: f64) -> Result<Duration, Failure> {
    let wrong = |_| Failure::Broken(format!("timeout_s: expected a time, found {seconds}"));
    Duration::try_from_secs_f64(seconds).map_err(wrong)
}

/// A seat at a running robot.
#[pyclass(frozen, module = "omnibase")]
pub struct Robot(Mutex<Seat>);

impl Robot {
    fn with<T: Send>(&self, py: Python<'_>, work: impl FnOnce(&mut Seat) -> T + Send) -> T {
        py.detach(|| work(&mut self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner())))
    }

    /// Hears all that was said meanwhile.
    fn hear_all(seat: &mut Seat) -> Result<(), Failure> {
        while seat.hear(Duration::ZERO)?.is_some() {}
        Ok(())
    }

    fn answered(seat: &mut Seat, number: u64) -> Result<Value, Failure> {
        let answer = seat.answer(number, ANSWER)?;
        if answer.done { Ok(answer.data) } else { Err(Failure::Refused(answer.text)) }
    }
}

#[pymethods]
impl Robot {
    #[new]
    #[pyo3(signature = (address=None, token=None))]
    fn new(py: Python<'_>, address: Option<&str>, token: Option<String>) -> PyResult<Self> {
        let seat = py.detach(|| Ok::<_, Failure>(Seat::take(&found(address, token)?)?));
        Ok(Robot(Mutex::new(seat?)))
    }

    /// Holds a twist as it is meant now.
    #[pyo3(signature = (vx_m_s, vy_m_s, turn_rad_s, frame="body"))]
    fn drive(&self, py: Python<'_>, vx_m_s: f64, vy_m_s: f64, turn_rad_s: f64, frame: &str) -> PyResult<()> {
        let meant = Instant::now();
        let frame = match crate::simulated::frame(frame)? {
            omnibase_robot::signals::Frame::Body => Frame::Body,
            omnibase_robot::signals::Frame::Odom => Frame::Odom,
        };
        self.with(py, |seat| {
            Robot::hear_all(seat)?;
            Ok::<_, Failure>(seat.drive([vx_m_s, vy_m_s, turn_rad_s], frame, meant)?)
        })?;
        Ok(())
    }

    fn let_go(&self, py: Python<'_>) -> PyResult<()> {
        Ok(self.with(py, |seat| seat.let_go().map_err(Failure::from))?)
    }

    /// The stick that was lost may drive again.
    fn enable_stick(&self, py: Python<'_>) -> PyResult<()> {
        self.with(py, |seat| {
            let number = seat.enable_stick()?;
            Robot::answered(seat, number)
        })?;
        Ok(())
    }

    /// Asks for something, and waits for its answer.
    #[pyo3(signature = (what, **keys))]
    fn call<'py>(
        &self,
        py: Python<'py>,
        what: &str,
        keys: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let meant = Instant::now();
        let mut call = keys.map_or_else(|| Ok(serde_json::Map::new()), |keys| object(what, keys))?;
        call.insert("do".to_owned(), what.into());
        let answer = self.with(py, |seat| {
            let number = seat.ask(Value::Object(call), meant)?;
            Robot::answered(seat, number)
        })?;
        python(py, &answer)
    }

    /// What the robot does now, as it says thirty times a second.
    #[pyo3(signature = (timeout_s=1.0))]
    fn status<'py>(&self, py: Python<'py>, timeout_s: f64) -> PyResult<Bound<'py, PyAny>> {
        let until = Instant::now() + duration(timeout_s)?;
        let status = self.with(py, |seat| {
            Robot::hear_all(seat)?;
            seat.live()?;
            loop {
                match seat.hear(until.saturating_duration_since(Instant::now()))? {
                    Some(Heard::Status(status)) => return Ok(status),
                    Some(Heard::Answer(_)) => {}
                    None if Instant::now() >= until => return Err(Failure::from(ClientError::Silent)),
                    None => {}
                }
            }
        })?;
        python(py, &status)
    }

    /// Whether the robot follows this program, as it said last.
    #[getter]
    fn drives(&self, py: Python<'_>) -> bool {
        self.with(py, |seat| seat.drives())
    }
}

/// Signals of a running robot, cycle by cycle.
#[pyclass(frozen, module = "omnibase")]
pub struct Signals(Mutex<States>);

impl Signals {
    fn with<T: Send>(&self, py: Python<'_>, work: impl FnOnce(&mut States) -> T + Send) -> T {
        py.detach(|| work(&mut self.0.lock().unwrap_or_else(|poisoned| poisoned.into_inner())))
    }
}

#[pymethods]
impl Signals {
    #[new]
    #[pyo3(signature = (signals=None, every_ms=None, *, address=None, token=None))]
    fn new(
        py: Python<'_>,
        signals: Option<Vec<String>>,
        every_ms: Option<f64>,
        address: Option<&str>,
        token: Option<String>,
    ) -> PyResult<Self> {
        let wanted = Wanted { signals: signals.unwrap_or_default(), every_ms };
        let states = py.detach(|| Ok::<_, Failure>(States::follow(&found(address, token)?, &wanted)?));
        Ok(Signals(Mutex::new(states?)))
    }

    #[getter]
    fn names(&self, py: Python<'_>) -> Vec<String> {
        self.with(py, |states| states.names().to_vec())
    }

    #[getter]
    fn cycle_ms(&self, py: Python<'_>) -> f64 {
        self.with(py, |states| states.cycle_ms())
    }

    #[getter]
    fn missing(&self, py: Python<'_>) -> u64 {
        self.with(py, |states| states.missing())
    }

    /// The rows that came: their instants in s on the robot's clock, and their values.
    #[pyo3(signature = (timeout_s=1.0))]
    fn rows<'py>(&self, py: Python<'py>, timeout_s: f64) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let longest = duration(timeout_s)?;
        let (rows, width) = self.with(py, |states| {
            let mut rows = states.rows(longest)?;
            let mut more = rows.len();
            while more > 0 {
                let next = states.rows(Duration::ZERO)?;
                more = next.len();
                rows.extend(next);
            }
            Ok::<_, Failure>((rows, states.names().len()))
        })?;
        let times: Vec<f64> = rows.iter().map(|row| row.instant_ns as f64 * 1e-9).collect();
        let values: Vec<f64> = rows.into_iter().flat_map(|row| row.values).collect();
        Ok((array(py, &times, &[times.len()])?, array(py, &values, &[times.len(), width])?))
    }
}
