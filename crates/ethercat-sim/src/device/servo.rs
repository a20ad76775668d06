//! A CiA 402 servo: power state machine, modes, inner loops, encoder.

mod motion;
mod objects;
mod power;
#[cfg(test)]
mod tests;

pub(super) use objects::standard_objects;
pub use power::PowerState;

use crate::device::axis::{Axis, AxisState, Outside};
use crate::device::{Device, Moment, Outputs};
use crate::dictionary::Dictionary;
use crate::dictionary::standard::{Nameplate, PdoMap, SAVE, STORE_PARAMETERS, keep_parameters};
use crate::firmware::{SyncMonitoring, Synchronization};
use core::f64::consts::TAU;
use motion::{Actuation, Limits, Motion};
use objects::Fields;
use omnibase_ethercat_wire::coe::{AbortCode, Emergency, ObjectAddress};
use omnibase_ethercat_wire::{AlState, AlStatusCode, HostTime};
use power::{PowerCommand, Reaction, react};

/// Time from power-on to "switch on disabled", ns.
const START_UP_NS: u64 = 10_000_000;
/// Controlword bit 7: fault reset, at its rising edge.
const FAULT_RESET: u16 = 1 << 7;
/// Error code: following error (CiA 402, 0x8611).
const FOLLOWING_ERROR: u16 = 0x8611;
/// Error code of a servo that lost its process data: EtherCAT communication (0x7500).
const COMMUNICATION_LOST: u16 = 0x7500;
/// Error code of a servo that lost its beat: synchronisation (0x8700).
const BEAT_LOST: u16 = 0x8700;
/// A motor slower than this stands still, rad/s.
const STANDSTILL_RAD_S: f64 = 0.1;

/// A servo's motor, drive and timing.
#[derive(Clone, Debug, PartialEq)]
pub struct ServoConfig {
    /// Counts of the encoder per revolution.
    pub counts_per_revolution: u32,
    /// Rated torque, N·m: 1000 in 0x6071, 0x6072 and 0x6077.
    pub rated_torque_n_m: f64,
    /// The most torque that the drive gives, N·m.
    pub peak_torque_n_m: f64,
    /// The most speed, rad/s.
    pub max_speed_rad_s: f64,
    /// Gain of the position loop, 1/s.
    pub position_gain_per_s: f64,
    /// Bandwidth of the speed loop, rad/s.
    pub speed_bandwidth_rad_s: f64,
    /// Time constant of the current loop, s.
    pub torque_time_constant_s: f64,
    /// Longest step of the inner loops, ns.
    pub loop_period_ns: u64,
    /// 0x6064 at power-on.
    pub initial_position: i32,
    /// What it shows at later power-ons.
    pub encoder: Encoder,
    /// What the drive can be synchronised with.
    pub synchronization: Synchronization,
    /// Error codes of 0x603F for faults of the communication.
    pub faults: CommunicationFaults,
    /// Objects of its maker's own that it takes beside the standard's, each with its bytes; nothing follows from them.
    pub parameters: Vec<(ObjectAddress, usize)>,
}

/// What an encoder shows after its supply was off.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Encoder {
    /// It counts from 0.
    #[default]
    Incremental,
    /// Its position, with every turn meanwhile.
    Absolute,
}

/// Error codes (0x603F) with which a drive answers faults of the communication in OP.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CommunicationFaults {
    /// The process data stopped (AL status code 0x001B), or OP was left with the drive enabled.
    pub lost: u16,
    /// SYNC0 and process data don't fit together (0x001A, 0x002C).
    pub synchronization: u16,
    /// Error code of the emergency; `None` sends the drive's own.
    pub emergency: Option<u16>,
}

impl Default for ServoConfig {
    fn default() -> Self {
        ServoConfig {
            counts_per_revolution: 1 << 20,
            rated_torque_n_m: 7.0,
            peak_torque_n_m: 21.0,
            max_speed_rad_s: 50.0,
            position_gain_per_s: 60.0,
            speed_bandwidth_rad_s: 300.0,
            torque_time_constant_s: 0.000_2,
            loop_period_ns: 250_000,
            initial_position: 0,
            encoder: Encoder::Incremental,
            synchronization: Synchronization {
                supported: Synchronization::FREE_RUN
                    | Synchronization::SYNC_MANAGER
                    | Synchronization::SYNC0
                    | Synchronization::SYNC1,
                cycle_step_ns: 62_500,
                shortest_cycle_ns: 62_500,
                longest_cycle_ns: 20_000_000,
                monitoring: SyncMonitoring::Op,
            },
            faults: CommunicationFaults {
                lost: COMMUNICATION_LOST,
                synchronization: BEAT_LOST,
                emergency: None,
            },
            parameters: Vec::new(),
        }
    }
}

impl ServoConfig {
    /// A speed in counts per second.
    pub fn counts_per_s(&self, rad_s: f64) -> f64 {
        rad_s * f64::from(self.counts_per_revolution) / TAU
    }
}

/// A deceleration on its way, and the state behind it; `None` holds.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stop {
    rate_counts_s2: f64,
    then: Option<PowerState>,
}

/// The servo behind the communication.
pub struct Servo {
    config: ServoConfig,
    fields: Fields,
    axis: Box<dyn Axis>,
    motion: Motion,
    power: PowerState,
    stop: Option<Stop>,
    started: HostTime,
    control: u16,
    /// Its safety input takes the torque away.
    torque_is_off: bool,
    /// What its brake holds when it is closed, N·m.
    brake_n_m: f64,
    /// What else acts on the shaft now.
    outside: Outside,
    /// The AL state is OP, or the drive is commanded by SDOs and not yet by process data.
    commanded: bool,
    error_code: u16,
    emergencies: [Option<Emergency>; 2],
}

impl Servo {
    /// The objects of a servo with these PDOs, and the servo that works on them.
    pub fn new(
        config: ServoConfig,
        nameplate: &Nameplate,
        pdos: &[PdoMap],
        axis: Box<dyn Axis>,
    ) -> (Self, Dictionary) {
        let dictionary = Dictionary::new(objects::objects(&config, nameplate, pdos));
        let servo = Servo::on(config, &dictionary, axis);
        (servo, dictionary)
    }

    /// The servo that works on a dictionary that has every object of [`standard_objects`].
    pub(super) fn on(config: ServoConfig, dictionary: &Dictionary, axis: Box<dyn Axis>) -> Self {
        let fields = match Fields::find(dictionary) {
            Ok(fields) => fields,
            Err(index) => unreachable!("a servo's dictionary has 0x{index:04X}"),
        };
        let motion = Motion::new(&config, &*axis);
        Servo {
            config,
            fields,
            axis,
            motion,
            power: PowerState::NotReadyToSwitchOn,
            stop: None,
            started: HostTime(0),
            control: 0,
            torque_is_off: false,
            brake_n_m: 0.0,
            outside: Outside::default(),
            commanded: true,
            error_code: 0,
            emergencies: [None; 2],
        }
    }

    fn raise_fault(&mut self, dictionary: &mut Dictionary, code: u16) {
        if matches!(self.power, PowerState::Fault | PowerState::FaultReactionActive) {
            return;
        }
        self.error_code = code;
        dictionary.set(self.fields.error_code, code);
        dictionary.set(self.fields.error_register, 0x01);
        let [low, high] = code.to_le_bytes();
        let emergency = Emergency {
            code: self.config.faults.emergency.unwrap_or(code),
            register: 0x01,
            data: if self.config.faults.emergency.is_some() { [low, high, 0, 0, 0] } else { [0; 5] },
        };
        self.queue(emergency);
        let rate = match dictionary.get(self.fields.fault_option) {
            1 => Some(f64::from(dictionary.get(self.fields.profile_deceleration))),
            2 => Some(f64::from(dictionary.get(self.fields.quick_stop_deceleration))),
            _ => None,
        };
        match rate {
            Some(rate_counts_s2) if self.power.is_energized() => {
                self.power = PowerState::FaultReactionActive;
                self.stop = Some(Stop { rate_counts_s2, then: Some(PowerState::Fault) });
            }
            _ => self.enter(PowerState::Fault),
        }
    }

    fn queue(&mut self, emergency: Emergency) {
        if let Some(free) = self.emergencies.iter_mut().find(|slot| slot.is_none()) {
            *free = Some(emergency);
        }
    }

    fn enter(&mut self, state: PowerState) {
        if state == PowerState::OperationEnabled && self.power != PowerState::OperationEnabled {
            self.motion.hold_here();
        }
        self.stop = None;
        self.power = state;
    }

    /// Controlword and time move the power state machine on.
    fn run_power(&mut self, dictionary: &mut Dictionary, now: HostTime) {
        if self.power == PowerState::NotReadyToSwitchOn {
            if (now - self.started).as_nanos() as u64 >= START_UP_NS {
                self.power = PowerState::SwitchOnDisabled;
            }
            return;
        }
        if !self.commanded {
            self.finish_stop();
            return;
        }
        let control = dictionary.get(self.fields.control);
        let reset = control & FAULT_RESET != 0 && self.control & FAULT_RESET == 0;
        self.control = control;
        if self.power == PowerState::Fault {
            if reset {
                self.clear_fault(dictionary);
            }
            return;
        }
        self.finish_stop();
        // A stop that leads to another state is ended early only by losing the voltage.
        let command = PowerCommand::new(control);
        let leads_on = self.stop.is_some_and(|stop| stop.then.is_some());
        if leads_on && command != PowerCommand::DisableVoltage {
            return;
        }
        let option = |field| dictionary.get(field);
        match react(self.power, command) {
            Reaction::Stay => {}
            Reaction::Enter(PowerState::OperationEnabled)
                if self.power == PowerState::QuickStopActive && option(self.fields.quick_stop_option) < 5 => {
            }
            // Without the safety input's consent nothing is switched on.
            Reaction::Enter(state) if self.torque_is_off && state.is_switched_on() => {}
            Reaction::Enter(state) => self.enter(state),
            Reaction::QuickStop => self.quick_stop(dictionary, option(self.fields.quick_stop_option)),
            Reaction::Shutdown => {
                self.ramp_down(dictionary, option(self.fields.shutdown_option), PowerState::ReadyToSwitchOn);
            }
            Reaction::Disable => {
                self.ramp_down(dictionary, option(self.fields.disable_option), PowerState::SwitchedOn);
            }
        }
    }

    fn clear_fault(&mut self, dictionary: &mut Dictionary) {
        self.error_code = 0;
        dictionary.set(self.fields.error_code, 0);
        dictionary.set(self.fields.error_register, 0);
        self.queue(Emergency { code: 0, register: 0, data: [0; 5] });
        self.enter(PowerState::SwitchOnDisabled);
    }

    fn finish_stop(&mut self) {
        let Some(Stop { then: Some(state), .. }) = self.stop else { return };
        if self.motion.is_still(STANDSTILL_RAD_S) {
            self.enter(state);
        }
    }

    /// 0x605A: 0 lets go; 1 and 5 the profile's ramp, 2 and 6 the quick stop's, 3 and 7 as hard as possible; from
    /// 5 on the drive then holds.
    fn quick_stop(&mut self, dictionary: &Dictionary, option: i16) {
        let rate_counts_s2 = match option {
            0 => return self.enter(PowerState::SwitchOnDisabled),
            1 | 5 => f64::from(dictionary.get(self.fields.profile_deceleration)),
            2 | 6 => f64::from(dictionary.get(self.fields.quick_stop_deceleration)),
            _ => f64::INFINITY,
        };
        self.power = PowerState::QuickStopActive;
        let then = (option < 5).then_some(PowerState::SwitchOnDisabled);
        self.stop = Some(Stop { rate_counts_s2, then });
    }

    fn ramp_down(&mut self, dictionary: &Dictionary, option: i16, then: PowerState) {
        if option == 0 {
            return self.enter(then);
        }
        let rate_counts_s2 = f64::from(dictionary.get(self.fields.profile_deceleration));
        self.stop = Some(Stop { rate_counts_s2, then: Some(then) });
    }

    /// Whether nothing comes of [`Device::tick`] but that what it shows is newer: it gives the torque that it was told last.
    pub fn holds_torque(&self) -> bool {
        self.motion.holds_torque(self.actuation())
    }

    fn actuation(&self) -> Actuation {
        Actuation {
            is_energized: self.power.is_energized(),
            stop_rate_counts_s2: self.stop.map(|stop| stop.rate_counts_s2),
        }
    }

    /// The motor's torque from now on, and a brake that closes where it has none.
    fn apply(&mut self) {
        let actuation = self.actuation();
        self.motion.apply(self.axis.as_mut(), actuation);
        self.act_on_shaft(actuation.is_energized, self.outside.push_n_m);
    }

    /// Brake and hand; `false` where they can't act.
    fn act_on_shaft(&mut self, is_energized: bool, push_n_m: f64) -> bool {
        let outside = Outside { brake_n_m: if is_energized { 0.0 } else { self.brake_n_m }, push_n_m };
        // Axes that share a body are behind a lock.
        if outside == self.outside || self.axis.outside(outside) {
            self.outside = outside;
            return true;
        }
        false
    }

    fn limits(&self, dictionary: &Dictionary) -> Limits {
        let f = &self.fields;
        let torque = f64::from(dictionary.get(f.max_torque)) / 1000.0 * self.config.rated_torque_n_m;
        Limits {
            torque_n_m: torque.min(self.config.peak_torque_n_m),
            speed_counts_s: f64::from(dictionary.get(f.max_motor_speed)),
        }
    }

    /// What the drive shows, from what it measured.
    fn show(&mut self, dictionary: &mut Dictionary) {
        let f = &self.fields;
        let shown = self.motion.shown();
        let mut status = self.power.status_bits() | shown.status;
        if self.power != PowerState::NotReadyToSwitchOn {
            // Voltage, and "remote": the controlword is obeyed.
            status |= 1 << 4 | 1 << 9;
        }
        dictionary.set(f.status, status);
        dictionary.set(f.mode_display, shown.mode);
        dictionary.set(f.position, shown.position);
        dictionary.set(f.position_internal, shown.position);
        dictionary.set(f.position_demand, shown.position_demand);
        dictionary.set(f.position_demand_internal, shown.position_demand);
        dictionary.set(f.following_error, shown.following_error);
        dictionary.set(f.velocity, shown.velocity);
        dictionary.set(f.velocity_demand, shown.velocity_demand);
        dictionary.set(f.torque, shown.torque);
        dictionary.set(f.torque_demand, shown.torque_demand);
        dictionary.set(f.digital_inputs, shown.digital_inputs);
    }
}

impl Device for Servo {
    fn power_on(&mut self, dictionary: &mut Dictionary, now: HostTime) {
        self.axis.apply(0.0);
        let at: AxisState = self.axis.advance(now);
        self.motion.power_on(now, at);
        self.power = PowerState::NotReadyToSwitchOn;
        self.stop = None;
        self.started = now;
        self.control = 0;
        self.commanded = true;
        self.error_code = 0;
        self.emergencies = [None; 2];
        self.show(dictionary);
    }

    fn power_off(&mut self) {
        self.axis.apply(0.0);
        self.act_on_shaft(false, self.outside.push_n_m);
    }

    fn run(&mut self, dictionary: &mut Dictionary, moment: Moment) {
        let actuation = self.actuation();
        self.motion.advance(self.axis.as_mut(), moment.now, actuation);
        self.motion.limit(self.limits(dictionary));
        self.run_power(dictionary, moment.now);
        let follows = self.power == PowerState::OperationEnabled && self.stop.is_none();
        let fresh = moment.outputs != Outputs::Held;
        self.motion.command(dictionary, &self.fields, follows.then_some(fresh), moment);
        if follows && self.motion.follows_badly(dictionary, &self.fields, moment.now) {
            self.raise_fault(dictionary, FOLLOWING_ERROR);
        }
        self.apply();
        self.show(dictionary);
    }

    fn due(&self) -> Option<HostTime> {
        (self.power.is_energized() || self.motion.drives()).then(|| self.motion.next_loop())
    }

    fn tick(&mut self, dictionary: &mut Dictionary, now: HostTime) {
        let actuation = self.actuation();
        self.motion.advance(self.axis.as_mut(), now, actuation);
        self.motion.limit(self.limits(dictionary));
        self.finish_stop();
        self.apply();
    }

    fn check_write(&self, _: &Dictionary, address: ObjectAddress, data: &[u8]) -> Result<(), AbortCode> {
        if address.index == 0x6060 && !motion::is_supported(data[0] as i8) {
            return Err(AbortCode::VALUE_RANGE);
        }
        if address == STORE_PARAMETERS && data != SAVE {
            return Err(AbortCode::CANNOT_TRANSFER);
        }
        Ok(())
    }

    fn written(&mut self, dictionary: &mut Dictionary, address: ObjectAddress) {
        if address == STORE_PARAMETERS {
            keep_parameters(dictionary);
        }
    }

    fn state_changed(&mut self, dictionary: &mut Dictionary, state: AlState, code: AlStatusCode) {
        let in_process_data = state == AlState::Op;
        let was_commanded =
            core::mem::replace(&mut self.commanded, in_process_data || state < AlState::SafeOp);
        if in_process_data {
            return;
        }
        match code {
            AlStatusCode::SYNCHRONIZATION_ERROR | AlStatusCode::FATAL_SYNC_ERROR => {
                self.raise_fault(dictionary, self.config.faults.synchronization);
            }
            _ if was_commanded && self.power.is_energized() => {
                match dictionary.get(self.fields.abort_option) {
                    0 => {}
                    1 => self.raise_fault(dictionary, self.config.faults.lost),
                    2 => self.enter(PowerState::SwitchOnDisabled),
                    _ => self.quick_stop(dictionary, dictionary.get(self.fields.quick_stop_option)),
                }
            }
            _ => {}
        }
    }

    fn safe_torque_off(&mut self, active: bool) -> bool {
        self.torque_is_off = active;
        if active && self.power.is_switched_on() {
            let is_fault = self.power == PowerState::FaultReactionActive;
            self.enter(if is_fault { PowerState::Fault } else { PowerState::SwitchOnDisabled });
            self.apply();
        }
        true
    }

    fn brake(&mut self, per_mille: u16) -> bool {
        let before = std::mem::replace(
            &mut self.brake_n_m,
            f64::from(per_mille) / 1000.0 * self.config.rated_torque_n_m,
        );
        let acts = self.act_on_shaft(self.power.is_energized(), self.outside.push_n_m);
        if !acts {
            self.brake_n_m = before;
        }
        acts
    }

    fn push(&mut self, per_mille: i16) -> bool {
        let push_n_m = f64::from(per_mille) / 1000.0 * self.config.rated_torque_n_m;
        self.act_on_shaft(self.power.is_energized(), push_n_m)
    }

    fn fault(&mut self, dictionary: &mut Dictionary, code: u16) -> bool {
        self.raise_fault(dictionary, code);
        true
    }

    fn take_emergency(&mut self) -> Option<Emergency> {
        let first = self.emergencies[0].take()?;
        self.emergencies.swap(0, 1);
        Some(first)
    }
}
