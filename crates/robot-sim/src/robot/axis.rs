//! One machine for several servos.

use crate::body::{BodyError, Payload};
use crate::machine::{Machine, Truth};
use omnibase_ethercat_sim::device::axis::{Axis, AxisState, Outside};
use omnibase_ethercat_wire::HostTime;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The machine behind the drives, for whoever wants to know the truth or to change it. Clones share it.
///
/// In a run on virtual time nobody else holds the lock, so that it never waits.
#[derive(Clone, Debug)]
pub struct SharedMachine(Arc<Mutex<Machine>>);

impl SharedMachine {
    /// Shares a machine.
    pub fn new(machine: Machine) -> Self {
        Self(Arc::new(Mutex::new(machine)))
    }

    /// The machine itself, until the guard is dropped; drives wait meanwhile.
    pub fn lock(&self) -> MutexGuard<'_, Machine> {
        // A panic elsewhere can't leave a machine half moved: it has no invariant that spans calls.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The truth at the instant at which the drives read their encoders last.
    ///
    /// Drives without current don't look; [`Machine::advance`] brings the machine up to any instant.
    pub fn truth(&self) -> Truth {
        self.lock().truth()
    }

    /// The motor of a wheel, for its servo; one that never moves for an index without a wheel.
    pub fn axis(&self, wheel: usize) -> Box<dyn Axis> {
        Box::new(WheelAxis { machine: self.clone(), wheel })
    }

    /// Changes the payload.
    pub fn set_payload(&self, payload: Payload) -> Result<(), BodyError> {
        self.lock().set_payload(payload)
    }
}

/// One motor of a shared machine, as its servo knows it.
#[derive(Debug)]
struct WheelAxis {
    machine: SharedMachine,
    wheel: usize,
}

impl Axis for WheelAxis {
    fn advance(&mut self, now: HostTime) -> AxisState {
        let mut machine = self.machine.lock();
        machine.advance(now.0);
        let shaft = machine.shaft(self.wheel);
        AxisState {
            position_rad: shaft.angle_rad,
            speed_rad_s: shaft.speed_rad_s,
            torque_n_m: shaft.torque_n_m,
            ..AxisState::default()
        }
    }

    fn apply(&mut self, torque_n_m: f64) {
        self.machine.lock().ask(self.wheel, torque_n_m);
    }

    fn outside(&mut self, outside: Outside) -> bool {
        let mut machine = self.machine.lock();
        machine.brake(self.wheel, outside.brake_n_m);
        machine.push(self.wheel, outside.push_n_m);
        true
    }

    fn nominal_inertia_kg_m2(&self) -> f64 {
        self.machine.lock().nominal_inertia_kg_m2(self.wheel)
    }

    fn greatest_speed_gain_n_m_s(&self, loop_s: f64) -> f64 {
        self.machine.lock().greatest_speed_gain_n_m_s(self.wheel, loop_s)
    }
}
