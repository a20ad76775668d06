//! The cycle: one function, its stages in source order.

mod pose;
mod requests;
mod wishes;

use std::fmt::Write;

use omnibase_trajectory::LimitsError;

use crate::ability::Ability;
use crate::blind_ramp::BlindRamp;
use crate::config::{Problem, RobotPlan, SafetyPlan};
use crate::devices::mode_of;
use crate::drive_modes::DriveModes;
use crate::grip::{Grip, Wished};
use crate::guard::{Guard, MAX_OBSTACLES, Obstacle};
use crate::image::{ImageBuffer, ProcessImage};
use crate::joystick_shape::JoystickShape;
use crate::lifecycle::{Lifecycle, Outcome};
use crate::limiter::Limiter;
use crate::motion::{Motion, is_there};
use crate::peripherals::Peripherals;
use crate::registry::{Registry, StageError};
use crate::safety::SafetyChain;
use crate::settings::{MOST_SETTINGS, Settings};
use crate::signals::{
    Between, Commands, Course, CycleRecord, CycleTime, Exchange, GripReport, Heard, LimitedBy, MAX_DEVICES,
    MAX_PROCESS_BYTES, Phase, PlatformState, ProcessBytes, Quantity, ReferenceStatus, Request, RequestAnswer,
    RequestKind, SafetyReason, StopCategory, WheelCommand,
};
use crate::stages::{
    Controller, Device, DriveCommand, Estimator, Gain, Leave, Observation, Reference, Safety, SafetyView,
};
use crate::traction::Traction;
use pose::Counted;

/// A robot: its stages, and what they remember from cycle to cycle.
pub struct Robot {
    devices: Vec<Box<dyn Device>>,
    peripherals: Peripherals,
    grip: Grip,
    traction: Traction,
    estimator: Box<dyn Estimator>,
    limiter: Limiter,
    /// Never empty; the present one is `active`.
    controllers: Vec<Box<dyn Controller>>,
    active: usize,
    blind_ramp: BlindRamp,
    drive_modes: DriveModes,
    safety: Box<dyn Safety>,
    lifecycle: Lifecycle,
    counted: Counted,
    command_age_ns: u64,
    safety_plan: SafetyPlan,
    motion: Motion,
    guard: Guard,
    settings: Settings,
    record: CycleRecord,
}

impl Robot {
    /// Makes the stages of a plan.
    pub fn build(plan: &RobotPlan, registry: &Registry) -> Result<Robot, StageError> {
        Robot::build_with_safety(plan, registry, Box::new(SafetyChain::new(plan)))
    }

    /// Makes the stages of a plan, with a safety chain of the user's.
    pub fn build_with_safety(
        plan: &RobotPlan,
        registry: &Registry,
        safety: Box<dyn Safety>,
    ) -> Result<Robot, StageError> {
        let devices = registry.make_devices(plan)?;
        let period_s = plan.bus.cycle_ns as f64 * 1e-9;
        let refused = |error: LimitsError| Problem::refused("limits", error);
        let limiter = Limiter::new(&plan.limits, period_s).map_err(refused)?;
        let reference = registry.make_reference(&plan.reference, &Ability::of(plan))?;
        let motion =
            Motion::new(reference, &plan.limits, &plan.safety, &plan.guard, period_s).map_err(refused)?;
        let controllers = registry.make_controllers(plan)?;
        if controllers.is_empty() {
            return Err(Problem::missing("controller.kind", "there is no default control law").into());
        }
        let commanded: Vec<Quantity> = controllers.iter().map(|controller| controller.quantity()).collect();
        let mut record = CycleRecord::default();
        record.measurements.wheels = plan.drives.len();
        let peripherals = Peripherals::new(plan, registry)?;
        record.signals = peripherals.begin();
        let estimator = registry.make_estimator(plan)?;
        Ok(Robot {
            devices,
            peripherals,
            guard: Guard::new(&plan.guard, &plan.limits, period_s, &estimator.growth()),
            grip: Grip::new(plan),
            traction: Traction::new(plan),
            estimator,
            limiter,
            controllers,
            active: 0,
            blind_ramp: BlindRamp::new(plan),
            drive_modes: DriveModes::new(plan, &commanded),
            safety,
            lifecycle: Lifecycle::new(plan.safety),
            counted: Counted::default(),
            command_age_ns: plan.safety.command_age_ns,
            safety_plan: plan.safety,
            motion,
            settings: Settings::new(plan),
            record,
        })
    }

    /// One cycle without link, clock or queue: the same arguments in the same order give the same bits.
    pub fn compute(
        &mut self,
        time: CycleTime,
        exchange: Exchange,
        request: Option<Request>,
        image: &mut dyn ProcessImage,
    ) -> &CycleRecord {
        self.record.time = time;
        self.record.exchange = exchange;
        self.record.request = request;
        self.record.phase = self.lifecycle.phase();

        self.read(exchange, image);
        self.peripherals.read(&time, exchange, image, &mut self.record.signals);
        self.record.grip = self.feel();
        self.record.state = self.estimate();
        self.carry();
        self.guard.advance(&self.record.time, &self.record.state);
        self.settings.settle(&self.record);
        self.record.answer = request.map_or(RequestAnswer::None, |request| self.take(&request));
        self.record.wished = self.wish();
        self.record.setpoint = self.limit();
        self.record.guard = self.guard.report(&self.record.state.odom_from_body);
        self.record.commands = self.control();
        self.record.allowed = self.allow();
        self.advance();
        self.write(image);

        self.record.traction = self.traction.report();
        self.record.controller = self.active as u64;
        self.record.force_n = self.controllers[self.active].force_n();
        self.record.stop_reason = self.lifecycle.reason();
        self.record.stop_where = self.lifecycle.where_index();
        self.record.course = self.motion.course();
        self.record.reference_time_s = self.motion.time_s();
        self.record.reference_rate = self.motion.rate();
        self.record.reference_begun = u64::from(self.motion.is_interrupted());
        [self.record.reference, self.record.reference_next] = self.motion.numbers().map(u64::from);
        &self.record
    }

    /// What another program sent, by its place among the plan's sources; it counts in the next cycle, where it is no
    /// older than what was heard before.
    pub fn hear(&mut self, source: usize, heard: &Heard) {
        self.peripherals.hear(source, heard);
    }

    /// What another program said since the last cycle, beside the last of it: a stop that was asked for in between counts.
    pub fn hear_between(&mut self, source: usize, between: Between) {
        self.peripherals.hear_between(source, between);
    }

    /// Computes a recorded cycle again, from what came in then; `buffer` takes the outputs.
    pub fn replay(&mut self, record: &CycleRecord, buffer: &mut ImageBuffer) -> &CycleRecord {
        for (inputs, recorded) in buffer.inputs.iter_mut().zip(&record.inputs) {
            let length = inputs.len().min(MAX_PROCESS_BYTES);
            inputs[..length].copy_from_slice(&recorded.0[..length]);
        }
        self.peripherals.replay(&record.signals, buffer);
        self.compute(record.time, record.exchange, record.request, buffer)
    }

    /// The last cycle.
    pub fn record(&self) -> &CycleRecord {
        &self.record
    }

    /// Where the robot is in its life, after the last cycle.
    pub fn phase(&self) -> Phase {
        self.lifecycle.phase()
    }

    /// What may be set while the robot runs, with its index below [`MOST_SETTINGS`]: the robot's own, its joystick's, the
    /// controller's gains, the wheels' limits. An index that nothing has is left out.
    pub fn settings(&self) -> impl Iterator<Item = (u32, Gain)> + '_ {
        let controller = &*self.controllers[self.active];
        (0..MOST_SETTINGS)
            .filter_map(move |index| Some((index as u32, self.settings.get(&self.guard, controller, index)?)))
    }

    /// How its joystick is shaped from now on.
    pub fn joystick_shape(&self) -> JoystickShape {
        self.settings.joystick()
    }

    /// The obstacles, where they are after the last cycle.
    pub fn obstacles(&self) -> &[Option<Obstacle>; MAX_OBSTACLES] {
        self.guard.obstacles()
    }

    /// The fence's corners in odom, m; none without a fence.
    pub fn fence_m(&self) -> &[[f64; 2]] {
        self.guard.fence_m()
    }

    /// Puts a reference in waiting for [`RequestKind::UseReference`]; gives back the one that waited, or that was
    /// replaced last, so that it can be dropped elsewhere. It is for the cycle: nothing is allocated.
    pub fn offer_reference(
        &mut self,
        number: u32,
        reference: Box<dyn Reference>,
    ) -> Option<(u32, Box<dyn Reference>)> {
        self.motion.offer(number, reference)
    }

    /// Time of the reference's whole motion, s; `None` where it has no end.
    pub fn reference_duration_s(&self) -> Option<f64> {
        self.motion.reference().duration_s()
    }

    /// What is wrong with each drive, in words; not for the cycle, for it allocates.
    pub fn drive_problems(&self) -> impl Iterator<Item = (usize, String)> + '_ {
        self.devices.iter().enumerate().filter_map(|(wheel, device)| Some((wheel, device.problem()?)))
    }

    /// What is wrong with each SubDevice without a wheel, in words; not for the cycle, for it allocates.
    pub fn device_problems(&self) -> impl Iterator<Item = (usize, String)> + '_ {
        (0..MAX_DEVICES).filter_map(|device| {
            let mut words = String::new();
            self.tell_device_problem(device, &mut words).then_some((device, words))
        })
    }

    /// Says what is wrong with a SubDevice without a wheel, in words, and whether anything is.
    pub fn tell_device_problem(&self, device: usize, words: &mut dyn Write) -> bool {
        self.peripherals.tell_problem(device, words)
    }

    /// Devices: from process data to measurements.
    fn read(&mut self, exchange: Exchange, image: &dyn ProcessImage) {
        if let Exchange::Restarted { wheels } = exchange {
            self.counted.restart(wheels);
        }
        let record = &mut self.record;
        // Old inputs are no measurement: nothing moved that is known of.
        record.inputs = Default::default();
        record.measurements.drives.iter_mut().for_each(|drive| drive.increment_rad = 0.0);
        let drives = record.measurements.drives.iter_mut().zip(&mut record.inputs);
        for (wheel, (device, (drive, recorded))) in self.devices.iter_mut().zip(drives).enumerate() {
            if !exchange.has_inputs_of(wheel) {
                continue;
            }
            let inputs = image.inputs(wheel);
            *recorded = ProcessBytes::of(inputs);
            *drive = self.counted.count(wheel, &mut **device, &record.time, exchange, inputs);
        }
        self.counted.remember(&self.record);
    }

    /// Grip: what the wheels' torques did.
    fn feel(&mut self) -> GripReport {
        let record = &self.record;
        let drives = matches!(record.phase, Phase::Tracking | Phase::Stopping)
            && record.setpoint.status == ReferenceStatus::Moving;
        let wished = drives.then(|| {
            let heading_rad = record.setpoint.odom_from_body.heading_rad;
            let acceleration = record.setpoint.acceleration_in_odom.rotated(-heading_rad);
            let by_torque = record.allowed.commands.quantity == Quantity::Torque;
            let asks_floor = self.controllers[self.active].asks_floor();
            let acceleration = omnibase_platform::axes(&acceleration);
            Wished { acceleration, by_torque, asks_floor, time: record.time }
        });
        let turn_rad_s = self.safety_plan.gyro_input.and_then(|input| record.signals.believed(input));
        let turn_rad_s = turn_rad_s.filter(|turn_rad_s| turn_rad_s.is_finite());
        self.grip.look(&record.time, record.exchange, &record.measurements, turn_rad_s, wished)
    }

    /// Traction: what the floor carries.
    fn carry(&mut self) {
        let record = &mut self.record;
        record.traction = self.traction.look(&record.time, &record.grip, &record.state);
        self.traction.warm(&record.time, &record.measurements);
        self.motion.keep_to(self.traction.carried(&record.setpoint, &record.grip));
        // A motion that goes as its every wheel was planned to grip may do more than is carried in whatever direction.
        let carried = self.traction.limits();
        let followed = if self.motion.is_planned() { self.traction.told_limits() } else { carried };
        self.guard.keep_to(&carried, &followed);
    }

    /// Estimator: from measurements to the platform's state.
    fn estimate(&mut self) -> PlatformState {
        let record = &self.record;
        let mut unread_rad = self.counted.take_unread(record.exchange);
        for (wheel, unread_rad) in unread_rad.iter_mut().enumerate().take(record.measurements.wheels) {
            *unread_rad += self.grip.unread_rad(wheel);
        }
        let state = self.estimator.update(&Observation {
            time: &record.time,
            exchange: record.exchange,
            measurements: &record.measurements,
            inputs: self.peripherals.inputs(&record.signals),
            wished: &record.wished,
            unread_rad: &unread_rad,
            slip_m_s: slip_m_s(&record.grip),
            is_free: matches!(record.phase, Phase::Disabled | Phase::Fault),
        });
        self.record.fusion = self.estimator.fusion();
        if self.estimator.sees_beyond_wheels() {
            return state;
        }
        PlatformState { pose_known: !self.counted.pose_lost, ..state }
    }

    /// What is wished and told begins anew where the platform stands. Only a pose that isn't finite is forgotten.
    fn begin(&mut self) {
        if !self.record.state.is_finite() {
            self.forget_pose();
        }
        self.controllers[self.active].reset();
        self.limiter.reset(self.record.state.odom_from_body);
        self.motion.leave();
    }

    /// Controller: what the wheels are told.
    fn control(&mut self) -> Commands {
        let record = &self.record;
        match self.lifecycle.phase() {
            Phase::Stopping if self.lifecycle.is_blind() => {
                self.blind_ramp.next(&record.allowed.commands, &record.setpoint)
            }
            Phase::Holding | Phase::Tracking | Phase::Stopping => {
                let controller = &mut self.controllers[self.active];
                controller.limit_wheels(&self.settings.wheel_limits());
                let is_heard = matches!(record.exchange, Exchange::Complete);
                controller.knows(&record.grip.dynamics);
                if is_heard {
                    controller.feels(&record.measurements);
                }
                let is_capped = record.traction.is_capped();
                let is_held_back = record.measurements.is_held_back() || is_capped;
                if is_held_back || record.grip.slips() || !is_heard {
                    controller.limited_by_drives();
                }
                let (inputs, mut outputs) = self.peripherals.open(&record.signals);
                controller.signals(&inputs, &mut outputs);
                let commands = controller.update(&record.time, &record.state, &record.setpoint);
                // What the drives' maps were checked for is the quantity that the law names.
                let is_of_its_kind = commands.quantity == controller.quantity();
                if is_of_its_kind {
                    let stops = self.lifecycle.phase() == Phase::Stopping;
                    self.traction.cap(commands, &record.setpoint, &record.grip, stops)
                } else {
                    Commands { values: [f64::NAN; crate::signals::MAX_WHEELS], ..commands }
                }
            }
            Phase::Disabled | Phase::Enabling | Phase::QuickStopping | Phase::Fault => Commands::default(),
        }
    }

    /// Safety: the last word.
    fn allow(&mut self) -> crate::signals::Allowed {
        let record = &self.record;
        self.safety.apply(&SafetyView {
            time: &record.time,
            exchange: record.exchange,
            phase: self.lifecycle.phase(),
            is_ramp_blind: self.lifecycle.is_blind(),
            measurements: &record.measurements,
            signals: &record.signals,
            failed_device: self.peripherals.readiness(record.exchange).1,
            state: &record.state,
            wished: &record.wished,
            setpoint: &record.setpoint,
            velocity: self.motion.velocity(),
            wished_fence_room_m: match self.lifecycle.phase() {
                Phase::Tracking => self.motion.spare_room_m(),
                _ => f64::INFINITY,
            },
            is_way_blocked: self.lifecycle.phase() == Phase::Tracking && self.motion.is_blocked(),
            guard: &record.guard,
            grip: &record.grip,
            commands: &record.commands,
            wheel_limits: self.settings.wheel_limits(),
            has_torque_drives: self.drive_modes.has_torque_drives(),
        })
    }

    fn advance(&mut self) {
        let record = &self.record;
        let is_followed = self.motion.course() != Course::Velocity;
        let is_paused = self.motion.is_paused();
        let is_held_back = is_paused && self.guard.limited_by() != LimitedBy::Nothing;
        let [wished, here] = [&record.wished, &record.setpoint].map(|at| &at.odom_from_body);
        let is_held_off = is_held_back && !is_there(wished, here);
        let is_there = match is_held_back {
            true => !is_held_off && all_but_rests(&record.setpoint.twist_in_odom),
            false => self.limiter.has_reached(wished),
        };
        let did_stop = self.lifecycle.phase() == Phase::Stopping;
        self.lifecycle.advance(&Outcome {
            time: &record.time,
            exchange: record.exchange,
            measurements: &record.measurements,
            allowed: &record.allowed,
            setpoint_rests: self.limiter.is_at_rest()
                && !(self.lifecycle.is_blind() && record.commands.is_moving()),
            peripherals: self.peripherals.readiness(record.exchange).0,
            is_finished: is_followed
                && (record.setpoint.status == ReferenceStatus::Finished || is_paused && is_there),
            is_held_off,
            finished_by: if self.motion.is_paused_at_fence() {
                SafetyReason::Fence
            } else {
                SafetyReason::None
            },
        });
        self.motion.arrive(&record.time, &record.setpoint);
        if self.lifecycle.phase() == Phase::Stopping && !did_stop {
            self.limiter.stop_with(&self.record.state);
        }
        if self.lifecycle.phase() != Phase::Tracking {
            self.motion.leave();
        }
        self.motion.settle(self.lifecycle.phase() == Phase::Tracking);
    }

    /// Devices: from commands to process data.
    fn write(&mut self, image: &mut dyn ProcessImage) {
        let idle = match self.controllers[self.active].quantity() {
            Quantity::Torque => WheelCommand::TorqueNm(0.0),
            Quantity::Speed | Quantity::Nothing => WheelCommand::SpeedRadS(0.0),
        };
        let allowed = &self.record.allowed.commands;
        for (wheel, device) in self.devices.iter_mut().enumerate() {
            let command = match allowed.quantity {
                Quantity::Nothing => self.drive_modes.idle(wheel, idle),
                Quantity::Speed | Quantity::Torque => {
                    let is_heard = self.record.exchange.has_inputs_of(wheel);
                    let measured = is_heard.then(|| &self.record.measurements.drives[wheel]);
                    let limits = self.settings.wheel_limits();
                    self.drive_modes.close(&self.record.time, wheel, allowed.wheel(wheel), measured, &limits)
                }
            };
            let command = DriveCommand {
                wanted: self.lifecycle.wanted(),
                mode: mode_of(&command),
                command,
                torque_limit_nm: self.settings.wheel_limits().torque_nm,
            };
            let (inputs, mut told) = self.peripherals.open(&self.record.signals);
            device.signals(&inputs, &mut told);
            let outputs = image.outputs(wheel);
            let progress = device.write(&self.record.time, &command, outputs);
            self.record.outputs[wheel] = ProcessBytes::of(outputs);
            self.record.measurements.drives[wheel].progress = progress;
        }
        let is_let_go = self.lifecycle.phase() == Phase::Disabled && self.record.phase != Phase::Disabled;
        // Also where no drive was enabled.
        let is_stopped = self.record.request.is_some_and(|request| match request.kind {
            RequestKind::Stop(category) => category != StopCategory::RampAndHold,
            _ => false,
        });
        let lets_go = self.lifecycle.lets_go() || is_let_go || is_stopped;
        let leave = Leave {
            wanted: self.lifecycle.wanted(),
            may_move: matches!(self.lifecycle.phase(), Phase::Holding | Phase::Tracking),
        };
        self.peripherals.write(&self.record.time, &leave, lets_go, image, &mut self.record.signals);
    }
}

/// Slower than this, m/s and rad/s, what is left of a way until it rests is micrometres.
const ALL_BUT_REST: f64 = 1e-3;

fn all_but_rests(twist: &omnibase_platform::Twist2) -> bool {
    twist.speed_m_s() <= ALL_BUT_REST && twist.w_rad_s.abs() <= ALL_BUT_REST
}

/// How fast the wheel that slips most slips, m/s.
fn slip_m_s(grip: &GripReport) -> f64 {
    let slipping = grip.slip_m_s.iter().zip(&grip.slipped_m).filter(|(_, way_m)| **way_m > 0.0);
    slipping.map(|(slip_m_s, _)| slip_m_s.abs()).fold(0.0, f64::max)
}
