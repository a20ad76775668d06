//! What a servo moves: torque in, position and speed out.

use omnibase_ethercat_wire::HostTime;

/// Where an axis is and how fast it turns, at the motor's shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisState {
    /// Angle since power-on of the simulation, rad; grows without wrapping.
    pub position_rad: f64,
    /// Speed, rad/s.
    pub speed_rad_s: f64,
    /// Torque that the motor really gives, N·m: less than was applied where the motor has limits of its own.
    pub torque_n_m: f64,
    /// What stands at the ends of its travel.
    pub switches: LimitSwitches,
}

/// The limit switches of an axis, as its drive sees them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LimitSwitches {
    /// The axis is at the end of negative counts.
    pub negative: bool,
    /// The axis is at the end of positive counts.
    pub positive: bool,
}

/// A motor's load: an axis of its own, or one wheel of a body that several motors share.
///
/// The servo asks for the state at an instant, then applies the torque that holds from there on. Where several
/// servos share a body, each of their axes moves the whole body on to the latest instant that any of them asked
/// for; an axis that is asked for an earlier instant answers with the present state.
///
/// Everything is reckoned from the instants alone, so that the same run gives the same bits.
pub trait Axis: Send {
    /// Moves on to `now` under the torque that was applied last, and says where the axis is.
    fn advance(&mut self, now: HostTime) -> AxisState;

    /// The torque from now on, N·m at the shaft.
    fn apply(&mut self, torque_n_m: f64);

    /// What else acts on the shaft from now on; `false` where nothing else can.
    fn outside(&mut self, _: Outside) -> bool {
        false
    }

    /// What the servo's speed loop takes for the inertia that it moves, kg·m².
    fn nominal_inertia_kg_m2(&self) -> f64;

    /// The most that whoever tunes the servo's speed loop may give it for its gain, N·m·s/rad, where it runs once in so many s.
    fn greatest_speed_gain_n_m_s(&self, loop_s: f64) -> f64 {
        let _ = loop_s;
        f64::INFINITY
    }
}

/// What acts on a shaft beside its motor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outside {
    /// The most that a closed brake holds, N·m at the shaft; 0 where it is open or there is none.
    pub brake_n_m: f64,
    /// What somebody turns the shaft by, N·m.
    pub push_n_m: f64,
}

/// A rigid load with viscous and Coulomb friction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// Rotor and load, kg·m².
    pub inertia_kg_m2: f64,
    /// Torque per speed, N·m·s/rad.
    pub viscous_n_m_s: f64,
    /// Torque that friction opposes to any motion, N·m.
    pub coulomb_n_m: f64,
}

impl Default for Load {
    fn default() -> Self {
        Load { inertia_kg_m2: 0.02, viscous_n_m_s: 0.01, coulomb_n_m: 0.1 }
    }
}

/// The longest step of the integration; longer ones would blur a stop by friction.
const LONGEST_STEP_NS: u64 = 1_000_000;

/// An axis of its own.
#[derive(Clone, Debug)]
pub struct SingleAxis {
    load: Load,
    state: AxisState,
    torque_n_m: f64,
    outside: Outside,
    time: HostTime,
}

impl SingleAxis {
    /// An axis with this load, at rest.
    pub fn new(load: Load) -> Self {
        SingleAxis {
            load,
            state: AxisState::default(),
            torque_n_m: 0.0,
            outside: Outside::default(),
            time: HostTime(0),
        }
    }

    /// Motor and hand together.
    fn turning_n_m(&self) -> f64 {
        self.torque_n_m + self.outside.push_n_m
    }

    /// Implicit Euler: stable with any friction and step.
    fn step(&mut self, step_s: f64) {
        let Load { inertia_kg_m2, viscous_n_m_s, coulomb_n_m } = self.load;
        let speed = self.state.speed_rad_s;
        let driven = speed + step_s * self.turning_n_m() / inertia_kg_m2;
        let friction = step_s * (coulomb_n_m + self.outside.brake_n_m) / inertia_kg_m2;
        // Friction takes speed away but never turns it round: within `friction` the axis sticks.
        let sliding = driven - driven.clamp(-friction, friction);
        let next = sliding / (1.0 + step_s * viscous_n_m_s / inertia_kg_m2);
        self.state.position_rad += step_s * 0.5 * (speed + next);
        self.state.speed_rad_s = next;
    }
}

impl Axis for SingleAxis {
    fn advance(&mut self, now: HostTime) -> AxisState {
        let mut left_ns = now.0.saturating_sub(self.time.0);
        self.time = self.time.max(now);
        let held_n_m = self.load.coulomb_n_m + self.outside.brake_n_m;
        if self.state.speed_rad_s == 0.0 && self.turning_n_m().abs() <= held_n_m {
            return self.state;
        }
        while left_ns > 0 {
            let step_ns = left_ns.min(LONGEST_STEP_NS);
            self.step(step_ns as f64 * 1e-9);
            left_ns -= step_ns;
        }
        self.state
    }

    fn apply(&mut self, torque_n_m: f64) {
        self.torque_n_m = torque_n_m;
        self.state.torque_n_m = torque_n_m;
    }

    fn outside(&mut self, outside: Outside) -> bool {
        self.outside = outside;
        true
    }

    fn nominal_inertia_kg_m2(&self) -> f64 {
        self.load.inertia_kg_m2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn torque_above_friction_accelerates_by_newtons_law() {
        let mut axis = SingleAxis::new(Load { inertia_kg_m2: 0.5, viscous_n_m_s: 0.0, coulomb_n_m: 1.0 });
        axis.apply(2.0);
        let state = axis.advance(HostTime(1_000_000_000));
        // (2 - 1) N·m / 0.5 kg·m² = 2 rad/s²; the steps are of constant acceleration, so the result is exact.
        assert!((state.speed_rad_s - 2.0).abs() < 1e-9, "{state:?}");
        assert!((state.position_rad - 1.0).abs() < 1e-9, "{state:?}");
    }

    #[test]
    fn friction_holds_and_stops_but_never_reverses() {
        let mut axis = SingleAxis::new(Load { inertia_kg_m2: 0.5, viscous_n_m_s: 0.1, coulomb_n_m: 1.0 });
        axis.apply(0.9);
        assert_eq!(axis.advance(HostTime(10_000_000)), AxisState { torque_n_m: 0.9, ..AxisState::default() });
        axis.apply(5.0);
        assert!(axis.advance(HostTime(100_000_000)).speed_rad_s > 0.5);
        axis.apply(0.0);
        assert_eq!(axis.advance(HostTime(5_000_000_000)).speed_rad_s, 0.0);
    }

    #[test]
    fn an_earlier_instant_changes_nothing() {
        let mut axis = SingleAxis::new(Load::default());
        axis.apply(1.0);
        let state = axis.advance(HostTime(1_000_000));
        assert_eq!(axis.advance(HostTime(500_000)), state);
    }
}
