//! A control law of the user's own: a function of Python that says the wheels' torques, asked in every cycle.

use std::sync::{Arc, Mutex, PoisonError};

use omnibase_platform::{Pose2, Twist2};
use omnibase_robot::registry::Kind;
use omnibase_robot::signals::{Commands, CycleTime, MAX_WHEELS, PlatformState, Quantity, Setpoint};
use omnibase_robot::stages::Controller;
use omnibase_robot::{Registry, RobotPlan};
use pyo3::prelude::*;

use crate::failure::Failure;

/// Under this name the robot knows it.
pub const KIND: &str = "program";

type Triple = (f64, f64, f64);

/// What a law is told of a cycle.
#[pyclass(frozen, get_all, module = "omnibase")]
pub struct Moment {
    time_s: f64,
    period_s: f64,
    pose: Triple,
    twist: Triple,
    wished_pose: Triple,
    wished_twist: Triple,
    wished_acceleration: Triple,
}

impl Moment {
    fn new(time: &CycleTime, state: &PlatformState, setpoint: &Setpoint) -> Self {
        let pose = |Pose2 { x_m, y_m, heading_rad }| (x_m, y_m, heading_rad);
        let twist = |Twist2 { vx_m_s, vy_m_s, w_rad_s }| (vx_m_s, vy_m_s, w_rad_s);
        Moment {
            time_s: time.now_ns as f64 * 1e-9,
            period_s: time.period_s(),
            pose: pose(state.odom_from_body),
            twist: twist(state.twist_in_body.rotated(state.odom_from_body.heading_rad)),
            wished_pose: pose(setpoint.odom_from_body),
            wished_twist: twist(setpoint.twist_in_odom),
            wished_acceleration: twist(setpoint.acceleration_in_odom),
        }
    }
}

/// A function of the user's, and what it raised.
#[derive(Clone)]
pub struct Law {
    function: Arc<Py<PyAny>>,
    raised: Arc<Mutex<Option<PyErr>>>,
}

impl Law {
    /// The function.
    pub fn new(function: Py<PyAny>) -> Self {
        Law { function: Arc::new(function), raised: Arc::default() }
    }

    /// The kinds that are built in, and this one.
    pub fn registry(&self) -> Registry {
        let mut registry = Registry::with_built_in();
        let meaning = "A function of the program that simulates the robot: torques";
        let kind = Kind { name: KIND, meaning, keys: Vec::new() };
        let law = self.clone();
        registry.controllers.add(kind, move |plan: &RobotPlan| {
            Ok(Stage { law: law.clone(), wheels: plan.drives.len(), has_failed: false })
        });
        registry
    }

    /// What it raised since it was looked at last.
    pub fn raised(&self) -> Option<PyErr> {
        self.raised.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    fn ask(&self, moment: Moment, wheels: usize) -> PyResult<Vec<f64>> {
        let torques_nm: Vec<f64> = Python::attach(|py| self.function.call1(py, (moment,))?.extract(py))?;
        if torques_nm.len() != wheels {
            let found = torques_nm.len();
            let words = format!("controller: expected a torque for each of {wheels} wheels, found {found}");
            return Err(Failure::Broken(words).into());
        }
        Ok(torques_nm)
    }
}

/// It as a stage of the cycle.
struct Stage {
    law: Law,
    wheels: usize,
    /// It is asked no more before it begins anew.
    has_failed: bool,
}

impl Controller for Stage {
    fn quantity(&self) -> Quantity {
        Quantity::Torque
    }

    fn reset(&mut self) {
        self.has_failed = false;
    }

    fn update(&mut self, time: &CycleTime, state: &PlatformState, setpoint: &Setpoint) -> Commands {
        // No number: the robot stops, as by any law that fails.
        let mut commands =
            Commands { quantity: Quantity::Torque, values: [0.0; MAX_WHEELS], saturation: 1.0 };
        commands.values[..self.wheels].fill(f64::NAN);
        if self.has_failed {
            return commands;
        }
        match self.law.ask(Moment::new(time, state, setpoint), self.wheels) {
            Ok(torques_nm) => commands.values[..self.wheels].copy_from_slice(&torques_nm),
            Err(error) => {
                self.has_failed = true;
                *self.law.raised.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
            }
        }
        commands
    }
}
