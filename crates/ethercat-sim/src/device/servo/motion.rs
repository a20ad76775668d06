//! Modes of operation and inner loops.
//!
//! Position loop: proportional, with the reference's speed fed forward. Speed loop: proportional and integral,
//! scaled by the inertia. Current loop: a first-order lag with a limit. All in rad, rad/s and N·m; counts stand at
//! the edge only.

mod homing;
mod profile;
mod shown;

use super::objects::{Fields, SUPPORTED_MODES};
use super::{Encoder, ServoConfig};
use crate::device::Moment;
use crate::device::axis::{Axis, AxisState};
use crate::dictionary::Dictionary;
use core::f64::consts::TAU;
use core::time::Duration;
use homing::Homing;
use omnibase_ethercat_wire::HostTime;
use profile::halt_rate;

/// Controlword: halt.
const HALT: u16 = 1 << 8;
/// The speed loop's integral is slower than its proportional part by this factor.
const INTEGRAL_RATIO: f64 = 0.2;

/// Modes of operation (0x6060).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    None = 0,
    ProfilePosition = 1,
    ProfileVelocity = 3,
    ProfileTorque = 4,
    Homing = 6,
    CyclicPosition = 8,
    CyclicVelocity = 9,
    CyclicTorque = 10,
}

impl Mode {
    fn new(code: i8) -> Option<Self> {
        Some(match code {
            0 => Mode::None,
            1 => Mode::ProfilePosition,
            3 => Mode::ProfileVelocity,
            4 => Mode::ProfileTorque,
            6 => Mode::Homing,
            8 => Mode::CyclicPosition,
            9 => Mode::CyclicVelocity,
            10 => Mode::CyclicTorque,
            _ => return None,
        })
    }
}

/// Whether the drive has this mode (0x6502).
pub(super) fn is_supported(code: i8) -> bool {
    code == 0 || (1..=32).contains(&code) && SUPPORTED_MODES >> (code - 1) & 1 != 0
}

/// What the user allows now.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    pub torque_n_m: f64,
    pub speed_counts_s: f64,
}

/// What the power state makes of the motor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Actuation {
    /// The motor has current.
    pub is_energized: bool,
    /// The rate of a stop on its way.
    pub stop_rate_counts_s2: Option<f64>,
}

/// What the loops follow.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Reference {
    /// A position that moves evenly from `from` at `start` to `to` at `end`, counts.
    Position { from: f64, to: f64, start: HostTime, end: HostTime },
    /// A trapezoid to `to`, counts.
    Profile { to: f64, velocity: f64, acceleration: f64, deceleration: f64 },
    /// A speed, counts/s, reached with at most `rate` counts/s² (infinite: at once).
    Speed { to: f64, rate: f64 },
    /// A torque, N·m, reached with at most `rate` N·m/s.
    Torque { to: f64, rate: f64 },
}

/// Loops and what they remember. Positions in counts since power-on, not wrapped.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    counts_per_rad: f64,
    rated_torque_n_m: f64,
    position_gain: f64,
    speed_gain: f64,
    integral_gain: f64,
    torque_time_constant_s: f64,
    loop_period_ns: u64,
    /// Difference of 0x6064 and the axis' own counts.
    offset: i64,
    initial_position: i32,
    encoder: Encoder,
    now: HostTime,
    next_loop: HostTime,
    state: AxisState,
    mode: Mode,
    reference: Reference,
    limits: Limits,
    halted: bool,
    /// Demands of the loops: position (counts), its speed (counts/s), torque (N·m).
    position_demand: f64,
    speed_demand: f64,
    torque_demand: f64,
    integral: f64,
    torque: f64,
    speed_offset: f64,
    torque_offset: f64,
    limited: bool,
    follows: bool,
    set_point_acknowledged: bool,
    next_target: Option<f64>,
    reached: bool,
    bad_since: Option<HostTime>,
    follows_badly: bool,
    homing: Homing,
}

impl Motion {
    pub fn new(config: &ServoConfig, axis: &dyn Axis) -> Self {
        let counts_per_revolution = f64::from(config.counts_per_revolution);
        let inertia_kg_m2 = axis.nominal_inertia_kg_m2();
        let loop_s = config.loop_period_ns as f64 * 1e-9;
        let speed_gain =
            (inertia_kg_m2 * config.speed_bandwidth_rad_s).min(axis.greatest_speed_gain_n_m_s(loop_s));
        Motion {
            counts_per_rad: counts_per_revolution / TAU,
            rated_torque_n_m: config.rated_torque_n_m,
            position_gain: config.position_gain_per_s,
            speed_gain,
            integral_gain: speed_gain * config.speed_bandwidth_rad_s * INTEGRAL_RATIO,
            torque_time_constant_s: config.torque_time_constant_s,
            loop_period_ns: config.loop_period_ns.max(1),
            offset: 0,
            initial_position: config.initial_position,
            encoder: config.encoder,
            now: HostTime(0),
            next_loop: HostTime(config.loop_period_ns.max(1)),
            state: AxisState::default(),
            mode: Mode::None,
            reference: Reference::Torque { to: 0.0, rate: f64::INFINITY },
            limits: Limits { torque_n_m: 0.0, speed_counts_s: 0.0 },
            halted: false,
            position_demand: 0.0,
            speed_demand: 0.0,
            torque_demand: 0.0,
            integral: 0.0,
            torque: 0.0,
            speed_offset: 0.0,
            torque_offset: 0.0,
            limited: false,
            follows: false,
            set_point_acknowledged: false,
            next_target: None,
            reached: false,
            bad_since: None,
            follows_badly: false,
            homing: Homing::default(),
        }
    }

    /// The encoder shows its initial position where the axis is at the first power-on; an incremental one begins at 0 at later ones.
    pub fn power_on(&mut self, now: HostTime, state: AxisState) {
        if self.now == HostTime(0) {
            self.offset = i64::from(self.initial_position) - self.encoder(state);
        } else if self.encoder == Encoder::Incremental {
            self.offset = -self.encoder(state);
        }
        self.now = now;
        self.plan_loop();
        self.state = state;
        self.mode = Mode::None;
        self.torque = 0.0;
        self.homing = Homing::default();
        self.hold_here();
    }

    /// The reference becomes the present state: nothing jumps.
    pub fn hold_here(&mut self) {
        self.position_demand = self.counts();
        self.speed_demand = self.state.speed_rad_s * self.counts_per_rad;
        self.torque_demand = 0.0;
        self.integral = 0.0;
        self.next_target = None;
        self.set_point_acknowledged = false;
        self.bad_since = None;
        self.follows_badly = false;
        self.reference = self.resting_reference();
    }

    /// The limits from now on.
    pub fn limit(&mut self, limits: Limits) {
        self.limits = limits;
    }

    pub fn is_still(&self, limit_rad_s: f64) -> bool {
        self.state.speed_rad_s.abs() < limit_rad_s
    }

    fn resting_reference(&self) -> Reference {
        match self.mode {
            Mode::ProfilePosition | Mode::CyclicPosition => {
                let at = self.position_demand;
                Reference::Position { from: at, to: at, start: self.now, end: self.now }
            }
            Mode::ProfileVelocity | Mode::CyclicVelocity | Mode::Homing => {
                Reference::Speed { to: 0.0, rate: f64::INFINITY }
            }
            _ => Reference::Torque { to: 0.0, rate: f64::INFINITY },
        }
    }

    /// Whole counts of an ideal encoder.
    fn encoder(&self, state: AxisState) -> i64 {
        whole(state.position_rad * self.counts_per_rad)
    }

    /// The axis' position in counts of 0x6064, not wrapped.
    fn counts(&self) -> f64 {
        self.state.position_rad * self.counts_per_rad + self.offset as f64
    }

    /// The position nearest to the present demand that reads as `wrapped` in 32 bits.
    fn unwrap(&self, wrapped: i32) -> f64 {
        let near = self.position_demand.floor();
        near + f64::from(wrapped.wrapping_sub(near as i64 as i32))
    }

    /// Moves axis and loops on to `now` under the references that held so far.
    pub fn advance(&mut self, axis: &mut dyn Axis, now: HostTime, actuation: Actuation) {
        while self.now < now {
            let left_ns = now.0 - self.now.0;
            let still = self.torque == 0.0 && self.state.speed_rad_s == 0.0;
            let at_once = self.holds_torque(actuation) || !actuation.is_energized && still;
            let step_ns = if at_once { left_ns } else { left_ns.min(self.loop_period_ns) };
            self.now = HostTime(self.now.0 + step_ns);
            self.state = axis.advance(self.now);
            let step_s = step_ns as f64 * 1e-9;
            self.move_demands(step_s, actuation.stop_rate_counts_s2);
            self.integrate(step_s, actuation.is_energized);
            if self.now < now {
                self.apply(axis, actuation);
            }
        }
        if self.next_loop <= self.now {
            self.plan_loop();
        }
    }

    /// Whether the torque stays as it is until the drive is told another one, whenever its loops run.
    pub fn holds_torque(&self, actuation: Actuation) -> bool {
        actuation.is_energized
            && actuation.stop_rate_counts_s2.is_none()
            && self.torque_time_constant_s == 0.0
            && matches!(self.reference, Reference::Torque { rate: f64::INFINITY, .. })
    }

    /// Whether the motor still has a torque.
    pub fn drives(&self) -> bool {
        self.torque != 0.0
    }

    /// When the loops run next by themselves: all servos at the same instants, so that those that share a body see
    /// it in the same state.
    pub fn next_loop(&self) -> HostTime {
        self.next_loop
    }

    fn plan_loop(&mut self) {
        // Mostly it is one period on: quotients of 64 bits cost much.
        let following = self.next_loop.0 + self.loop_period_ns;
        let is_following = (self.next_loop.0..following).contains(&self.now.0);
        let whole = |now: u64| (now / self.loop_period_ns + 1) * self.loop_period_ns;
        self.next_loop = HostTime(if is_following { following } else { whole(self.now.0) });
    }

    /// Demands as they are at `self.now`.
    fn move_demands(&mut self, step_s: f64, stop_rate: Option<f64>) {
        if let Some(rate) = stop_rate {
            self.speed_demand = towards(self.speed_demand, 0.0, rate * step_s);
            self.position_demand += self.speed_demand * step_s;
            return;
        }
        match self.reference {
            Reference::Position { from, to, start, end } => {
                let (span, passed) = (end.0.saturating_sub(start.0), self.now.0.saturating_sub(start.0));
                if passed < span {
                    let part = passed as f64 / span as f64;
                    self.position_demand = from + (to - from) * part;
                } else {
                    self.position_demand = to;
                }
                if passed > span {
                    // No new target came: the drive stops at the last one.
                    self.speed_demand = 0.0;
                }
            }
            Reference::Profile { to, velocity, acceleration, deceleration } => {
                self.run_profile(
                    to,
                    velocity.min(self.limits.speed_counts_s),
                    acceleration,
                    deceleration,
                    step_s,
                );
            }
            Reference::Speed { to, rate } => {
                self.speed_demand = towards(self.speed_demand, to, rate * step_s);
                self.position_demand = self.counts();
            }
            Reference::Torque { to, rate } => {
                self.torque_demand = towards(self.torque_demand, to, rate * step_s);
                self.position_demand = self.counts();
                self.speed_demand = self.state.speed_rad_s * self.counts_per_rad;
            }
        }
    }

    /// The integral part and the current loop's lag over a step.
    fn integrate(&mut self, step_s: f64, is_energized: bool) {
        if !is_energized {
            self.torque = 0.0;
            self.integral = 0.0;
            return;
        }
        let error = self.speed_error();
        if self.uses_speed_loop() && !(self.limited && error * self.torque_demand > 0.0) {
            self.integral += self.integral_gain * error * step_s;
        }
        let part = step_s / (self.torque_time_constant_s + step_s);
        self.torque += (self.within_limit(self.torque_demand) - self.torque) * part;
    }

    fn within_limit(&self, torque_n_m: f64) -> f64 {
        torque_n_m.clamp(-self.limits.torque_n_m, self.limits.torque_n_m)
    }

    fn uses_speed_loop(&self) -> bool {
        !matches!(self.reference, Reference::Torque { .. })
    }

    fn speed_error(&self) -> f64 {
        let position_part = match self.reference {
            Reference::Position { .. } | Reference::Profile { .. } => {
                self.position_gain * (self.position_demand - self.counts())
            }
            _ => 0.0,
        };
        let ceiling = self.limits.speed_counts_s;
        let wished = (self.speed_demand + position_part + self.speed_offset).clamp(-ceiling, ceiling);
        wished / self.counts_per_rad - self.state.speed_rad_s
    }

    /// Computes the torque of the next step and applies it.
    pub fn apply(&mut self, axis: &mut dyn Axis, actuation: Actuation) {
        if !actuation.is_energized {
            self.torque_demand = 0.0;
            self.torque = 0.0;
            axis.apply(0.0);
            return;
        }
        if self.uses_speed_loop() || actuation.stop_rate_counts_s2.is_some() {
            self.torque_demand = self.speed_gain * self.speed_error() + self.integral + self.torque_offset;
        }
        let wished = self.torque_demand;
        self.torque_demand = self.within_limit(wished);
        self.limited = wished != self.torque_demand;
        if self.torque_time_constant_s == 0.0 {
            self.torque = self.torque_demand;
        }
        axis.apply(self.within_limit(self.torque));
    }

    /// Takes over mode and targets; `follows` is `None` where the drive doesn't obey them, else whether they are new.
    pub fn command(
        &mut self,
        dictionary: &Dictionary,
        fields: &Fields,
        follows: Option<bool>,
        moment: Moment,
    ) {
        let code = dictionary.get(fields.mode);
        if let Some(mode) = Mode::new(code).filter(|mode| *mode != self.mode) {
            self.homing.interrupt();
            self.mode = mode;
            self.hold_here();
        }
        self.follows = follows.is_some();
        let Some(fresh) = follows else {
            self.homing.interrupt();
            if !matches!(self.reference, Reference::Torque { .. }) {
                self.position_demand = self.counts();
            }
            return;
        };
        let control = dictionary.get(fields.control);
        self.speed_offset = f64::from(dictionary.get(fields.velocity_offset));
        self.torque_offset = f64::from(dictionary.get(fields.torque_offset)) / 1000.0 * self.rated_torque_n_m;
        self.halted = control & HALT != 0;
        let get = |field| f64::from(dictionary.get(field));
        match self.mode {
            Mode::None => self.reference = Reference::Torque { to: 0.0, rate: f64::INFINITY },
            Mode::CyclicPosition if fresh => {
                let to = self.unwrap(dictionary.get(fields.target_position));
                let period = moment.cycle_ns.map_or_else(|| period(dictionary, fields), u64::from);
                let (from, start) = (self.position_demand, self.now);
                self.speed_demand = (to - from) / (period.max(1) as f64 * 1e-9);
                let end = start + Duration::from_nanos(period);
                self.reference = Reference::Position { from, to, start, end };
            }
            Mode::CyclicPosition => {}
            Mode::CyclicVelocity => {
                let to = f64::from(dictionary.get(fields.target_velocity));
                self.reference = Reference::Speed { to, rate: f64::INFINITY };
                self.speed_demand = to;
            }
            Mode::CyclicTorque => {
                let target = f64::from(dictionary.get(fields.target_torque)) / 1000.0;
                let to = target * self.rated_torque_n_m + self.torque_offset;
                self.reference = Reference::Torque { to, rate: f64::INFINITY };
                self.torque_demand = to;
            }
            Mode::ProfileVelocity => {
                let limit = get(fields.max_profile_velocity);
                let to = f64::from(dictionary.get(fields.target_velocity)).clamp(-limit, limit);
                let to = if self.halted { 0.0 } else { to };
                let slower = to.abs() < self.speed_demand.abs();
                let rate = match slower {
                    _ if self.halted => halt_rate(dictionary, fields),
                    true => get(fields.profile_deceleration),
                    false => get(fields.profile_acceleration),
                };
                self.reference = Reference::Speed { to, rate };
                self.reached =
                    (to - self.state.speed_rad_s * self.counts_per_rad).abs() <= get(fields.velocity_window);
            }
            Mode::ProfileTorque => {
                let unit = self.rated_torque_n_m / 1000.0;
                let to =
                    if self.halted { 0.0 } else { f64::from(dictionary.get(fields.target_torque)) * unit };
                self.reference = Reference::Torque { to, rate: get(fields.torque_slope) * unit };
                self.reached = self.torque_demand == to;
            }
            Mode::ProfilePosition => self.command_profile_position(dictionary, fields, control),
            Mode::Homing => self.command_homing(dictionary, fields, control),
        }
    }

    /// Whether the following error was outside of its window (0x6065) for longer than allowed (0x6066).
    pub fn follows_badly(&mut self, dictionary: &Dictionary, fields: &Fields, now: HostTime) -> bool {
        let window = dictionary.get(fields.following_window);
        let positions = matches!(self.reference, Reference::Position { .. } | Reference::Profile { .. });
        if !positions
            || window == u32::MAX
            || (self.position_demand - self.counts()).abs() <= f64::from(window)
        {
            self.bad_since = None;
            self.follows_badly = false;
            return false;
        }
        self.follows_badly = true;
        let since = *self.bad_since.get_or_insert(now);
        let timeout = Duration::from_millis(u64::from(dictionary.get(fields.following_timeout_ms)));
        now - since >= timeout
    }
}

/// The interpolation period (0x60C2), ns.
fn period(dictionary: &Dictionary, fields: &Fields) -> u64 {
    let exponent = 9 + i32::from(dictionary.get(fields.interpolation_index));
    let value = u64::from(dictionary.get(fields.interpolation_value));
    value * 10u64.pow(exponent.clamp(0, 9) as u32)
}

/// The greatest whole number that isn't above `value`.
fn whole(value: f64) -> i64 {
    let towards_zero = value as i64;
    towards_zero.saturating_sub(i64::from(towards_zero as f64 > value))
}

/// The nearest whole number, halves away from zero.
fn nearest(value: f64) -> i32 {
    let towards_zero = value as i32;
    let rest = value - f64::from(towards_zero);
    towards_zero.saturating_add(i32::from(rest >= 0.5) - i32::from(rest <= -0.5))
}

/// `from` moved to `to` by at most `step`.
fn towards(from: f64, to: f64, step: f64) -> f64 {
    from + (to - from).clamp(-step, step)
}

#[cfg(test)]
mod tests {
    use super::{nearest, whole};

    #[test]
    fn whole_numbers_are_those_of_floor_and_round() {
        let near = [-2.5, -1.0, -0.5, -0.0, 0.0, 0.49999999999999994, 0.5, 1.5, 2147483646.5, 2147483647.5];
        let far = [-1e10, 1e10, 9007199254740993.0, -1e19, 1e19, f64::NEG_INFINITY, f64::INFINITY, f64::NAN];
        let beside = |value: f64| [value.next_down(), value, value.next_up(), -value];
        for value in near.into_iter().chain(far).flat_map(beside) {
            assert_eq!(whole(value), value.floor() as i64, "{value:?}");
            assert_eq!(nearest(value), value.round() as i32, "{value:?}");
        }
    }
}
