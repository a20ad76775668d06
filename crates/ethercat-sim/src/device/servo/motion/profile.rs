//! Profile position: set points by handshake, and the trapezoid that leads to them.

use super::{Motion, Reference, towards};
use crate::device::servo::objects::Fields;
use crate::dictionary::Dictionary;

/// Controlword bits of pp: new set point, change at once, relative.
const NEW_SET_POINT: u16 = 1 << 4;
const AT_ONCE: u16 = 1 << 5;
const RELATIVE: u16 = 1 << 6;

impl Motion {
    /// A trapezoid, one step: the speed that still stops at the target is v²/2a.
    pub(super) fn run_profile(
        &mut self,
        to: f64,
        velocity: f64,
        acceleration: f64,
        deceleration: f64,
        step_s: f64,
    ) {
        let distance = to - self.position_demand;
        let stopping = (2.0 * deceleration.max(1.0) * distance.abs()).sqrt();
        let wished = distance.signum() * velocity.min(stopping);
        let rate =
            if wished.abs() < self.speed_demand.abs() { deceleration.max(1.0) * 1.5 } else { acceleration };
        self.speed_demand = towards(self.speed_demand, wished, rate.max(1.0) * step_s);
        let step = self.speed_demand * step_s;
        if step.abs() >= distance.abs() && self.speed_demand.abs() <= deceleration.max(1.0) * step_s * 4.0 {
            self.position_demand = to;
            self.speed_demand = 0.0;
        } else {
            self.position_demand += step;
        }
    }

    pub(super) fn command_profile_position(
        &mut self,
        dictionary: &Dictionary,
        fields: &Fields,
        control: u16,
    ) {
        let get = |field| f64::from(dictionary.get(field));
        let asked = control & NEW_SET_POINT != 0;
        let window = get(fields.position_window).max(1.0);
        let target = match self.reference {
            Reference::Profile { to, .. } | Reference::Position { to, .. } => to,
            _ => self.position_demand,
        };
        let arrived = self.position_demand == target && (self.counts() - target).abs() <= window;
        let mut to = target;
        if asked && !self.set_point_acknowledged {
            let wished = dictionary.get(fields.target_position);
            let wished =
                if control & RELATIVE != 0 { target + f64::from(wished) } else { self.unwrap(wished) };
            if arrived || control & AT_ONCE != 0 {
                to = wished;
                self.set_point_acknowledged = true;
            } else if self.next_target.is_none() {
                self.next_target = Some(wished);
                self.set_point_acknowledged = true;
            }
        } else if !asked {
            self.set_point_acknowledged = false;
        }
        if arrived && let Some(next) = self.next_target.take() {
            to = next;
        }
        self.reached = arrived && to == target;
        let velocity = if self.halted {
            0.0
        } else {
            get(fields.profile_velocity).min(get(fields.max_profile_velocity))
        };
        let acceleration = get(fields.profile_acceleration);
        let deceleration =
            if self.halted { halt_rate(dictionary, fields) } else { get(fields.profile_deceleration) };
        self.reference = Reference::Profile { to, velocity, acceleration, deceleration };
    }
}

/// How fast a halt slows down (0x605D), counts/s²: the profile's ramp, the quick stop's, or at once.
pub(super) fn halt_rate(dictionary: &Dictionary, fields: &Fields) -> f64 {
    match dictionary.get(fields.halt_option) {
        1 => f64::from(dictionary.get(fields.profile_deceleration)),
        2 => f64::from(dictionary.get(fields.quick_stop_deceleration)),
        _ => f64::INFINITY,
    }
}
