//! An axis of its own beside the wheels: a motor's load with ends of travel, limit switches, and what may hold it.

use omnibase_ethercat_sim::device::axis::{Axis, AxisState, LimitSwitches, Load};
use omnibase_ethercat_wire::HostTime;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The longest step of the integration, s.
const LONGEST_STEP_S: f64 = 2.5e-4;

/// A load and its travel; angles at the motor's shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlideParameters {
    /// Inertia and friction.
    pub load: Load,
    /// Where it stands at first, rad.
    pub start_rad: f64,
    /// Where the limit switches stand, rad: the negative one, the positive one.
    pub switches_rad: [f64; 2],
    /// How far behind its switches it comes to its mechanical ends, rad.
    pub overtravel_rad: f64,
}

/// The axis itself.
#[derive(Clone, Debug)]
struct Slide {
    parameters: SlideParameters,
    state: AxisState,
    torque_n_m: f64,
    time: HostTime,
    is_jammed: bool,
}

impl Slide {
    /// Implicit in friction: it takes speed away and never turns it round.
    fn step(&mut self, step_s: f64) {
        let Load { inertia_kg_m2, viscous_n_m_s, coulomb_n_m } = self.parameters.load;
        let speed = self.state.speed_rad_s;
        let driven = speed + step_s * self.torque_n_m / inertia_kg_m2;
        let friction = step_s * coulomb_n_m / inertia_kg_m2;
        let sliding = driven - driven.clamp(-friction, friction);
        let next = sliding / (1.0 + step_s * viscous_n_m_s / inertia_kg_m2);
        let [negative, positive] = self.parameters.switches_rad;
        let over = self.parameters.overtravel_rad;
        let wished = self.state.position_rad + step_s * 0.5 * (speed + next);
        let reached = wished.clamp(negative - over, positive + over);
        let is_held = self.is_jammed || reached != wished;
        (self.state.position_rad, self.state.speed_rad_s) = match is_held {
            true if self.is_jammed => (self.state.position_rad, 0.0),
            true => (reached, 0.0),
            false => (reached, next),
        };
    }

    fn advance(&mut self, now: HostTime) -> AxisState {
        let left_s = (now - self.time).as_nanos() as f64 * 1e-9;
        self.time = self.time.max(now);
        let steps = (left_s / LONGEST_STEP_S).ceil();
        for _ in 0..steps as u64 {
            self.step(left_s / steps);
        }
        let [negative, positive] = self.parameters.switches_rad;
        let at = self.state.position_rad;
        self.state.switches = LimitSwitches { negative: at <= negative, positive: at >= positive };
        self.state
    }
}

/// An axis behind its drive, for whoever wants to know the truth or to hold it. Clones share it.
#[derive(Clone, Debug)]
pub struct SharedSlide(Arc<Mutex<Slide>>);

impl SharedSlide {
    /// An axis at rest.
    pub fn new(parameters: SlideParameters) -> Self {
        let state = AxisState { position_rad: parameters.start_rad, ..AxisState::default() };
        let time = HostTime(0);
        let slide = Slide { parameters, state, torque_n_m: 0.0, time, is_jammed: false };
        SharedSlide(Arc::new(Mutex::new(slide)))
    }

    fn lock(&self) -> MutexGuard<'_, Slide> {
        // It has no invariant that spans calls.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Where it is and how fast, as its drive asked last.
    pub fn state(&self) -> AxisState {
        self.lock().state
    }

    /// From now on something holds it, or no longer.
    pub fn jam(&self, is_jammed: bool) {
        self.lock().is_jammed = is_jammed;
    }
}

impl Axis for SharedSlide {
    fn advance(&mut self, now: HostTime) -> AxisState {
        self.lock().advance(now)
    }

    fn apply(&mut self, torque_n_m: f64) {
        let mut slide = self.lock();
        slide.torque_n_m = torque_n_m;
        slide.state.torque_n_m = torque_n_m;
    }

    fn nominal_inertia_kg_m2(&self) -> f64 {
        self.lock().parameters.load.inertia_kg_m2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slide() -> SharedSlide {
        SharedSlide::new(SlideParameters {
            load: Load { inertia_kg_m2: 0.5, viscous_n_m_s: 0.0, coulomb_n_m: 1.0 },
            start_rad: 0.5,
            switches_rad: [0.0, 2.0],
            overtravel_rad: 0.25,
        })
    }

    #[test]
    fn it_moves_by_newtons_law_meets_its_switch_and_then_its_end() {
        let mut axis = slide();
        axis.apply(2.0);
        let state = axis.advance(HostTime(1_000_000_000));
        // (2 - 1) N·m / 0.5 kg·m² = 2 rad/s² for 1 s.
        assert!(
            (state.position_rad - 1.5).abs() < 1e-9 && (state.speed_rad_s - 2.0).abs() < 1e-9,
            "{state:?}"
        );
        assert_eq!(state.switches, LimitSwitches::default());
        let state = axis.advance(HostTime(3_000_000_000));
        assert_eq!((state.position_rad, state.speed_rad_s), (2.25, 0.0));
        assert_eq!(state.switches, LimitSwitches { negative: false, positive: true });
    }

    #[test]
    fn what_holds_it_holds_it_against_any_torque() {
        let mut axis = slide();
        axis.jam(true);
        axis.apply(-100.0);
        assert_eq!(axis.advance(HostTime(1_000_000_000)).position_rad, 0.5);
        axis.jam(false);
        assert!(axis.advance(HostTime(1_200_000_000)).switches.negative);
    }
}
