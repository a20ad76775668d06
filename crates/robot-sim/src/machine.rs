//! Body and motors together, moved on to any instant.

use crate::body::{Body, BodyError, BodyParameters, Payload};
use crate::floor::{Floor, Surface};
use crate::mechanics::Mechanics;
use crate::motor::{Motor, MotorParameters};
use crate::pose::{Pose, Twist};
use crate::wheel::WheelParameters;
use crate::wiring::{self, Wire};

/// A wheel and the motor that drives it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelDrive {
    /// The wheel.
    pub wheel: WheelParameters,
    /// The motor.
    pub motor: MotorParameters,
}

/// A whole machine without its electronics.
#[derive(Clone, Debug, PartialEq)]
pub struct MachineParameters {
    /// The body.
    pub body: BodyParameters,
    /// What it carries from the start.
    pub payload: Payload,
    /// What it stands on.
    pub floor: Floor,
    /// Wheels with their motors, in the order of the drives.
    pub wheels: Vec<WheelDrive>,
    /// Step of the integration; 50 to 250 us give good results.
    pub step_ns: u32,
    /// How the drives are wired to the motors, in the order of the drives; empty: each to its own.
    pub wires: Vec<Wire>,
}

/// The step of the integration by default.
pub const DEFAULT_STEP_NS: u32 = 125_000;

/// A machine that can't be simulated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MachineError {
    /// Body, wheels or payload.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// A motor's figure outside of what has a meaning.
    #[error("motor {motor}: {parameter} is {value}; it must be {must}")]
    Motor {
        /// Which motor, counted from 1.
        motor: usize,
        /// The field.
        parameter: &'static str,
        /// What was given.
        value: f64,
        /// What is allowed.
        must: &'static str,
    },
    /// Drives and motors don't belong together one to one.
    #[error("the wires must lead from each of {wheels} drives to a motor of its own")]
    Wires {
        /// How many motors there are.
        wheels: usize,
    },
    /// The step is too short to get anywhere or too long to be true.
    #[error("a step of {step_ns} ns; it must be between 1000 and 2000000 ns")]
    Step {
        /// What was given.
        step_ns: u32,
    },
}

/// What a motor's encoder and its drive see.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shaft {
    /// Angle that the motor's shaft turned since the start, counting on over full turns.
    pub angle_rad: f64,
    /// Its speed.
    pub speed_rad_s: f64,
    /// Torque of the motor.
    pub torque_n_m: f64,
}

/// Where the machine really is and how it really moves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Truth {
    /// The instant for which this holds.
    pub time_ns: u64,
    /// Pose of `base_link` in the fixed frame.
    pub pose: Pose,
    /// Twist in `base_link`.
    pub twist_in_body: Twist,
}

/// Body and motors on a common clock.
///
/// Time runs on a grid of whole steps from zero, so that it doesn't matter how often or by how many drives the machine
/// is asked to move on (but for the rounding of a resting winding's temperature). Between two points of the grid everything goes on at its present speed: at 100 rad/s² that is
/// wrong by less than a count of a 20-bit encoder.
#[derive(Debug)]
pub struct Machine {
    body: Body,
    /// What moves the body in place of its own equations.
    mechanics: Option<Box<dyn Mechanics>>,
    motors: Vec<Motor>,
    wires: Vec<Wire>,
    torques_n_m: Vec<f64>,
    /// What somebody turns each wheel by, in the order of the wheels.
    pushes_n_m: Vec<f64>,
    /// The greatest that each of them ever was, either way.
    greatest_n_m: Vec<f64>,
    step_ns: u64,
    step_s: f64,
    /// The last point of the grid.
    grid_ns: u64,
    /// The latest instant asked for.
    now_ns: u64,
}

impl Machine {
    /// A machine at rest at the origin, at time zero.
    pub fn new(parameters: &MachineParameters) -> Result<Self, MachineError> {
        if !(1_000..=2_000_000).contains(&parameters.step_ns) {
            return Err(MachineError::Step { step_ns: parameters.step_ns });
        }
        let step_s = f64::from(parameters.step_ns) * 1e-9;
        let mut wheels = Vec::with_capacity(parameters.wheels.len());
        let mut motors = Vec::with_capacity(parameters.wheels.len());
        for (i, drive) in parameters.wheels.iter().enumerate() {
            if let Some((parameter, value, must)) = drive.motor.problem() {
                return Err(MachineError::Motor { motor: i + 1, parameter, value, must });
            }
            let gear = drive.motor.gear_ratio;
            let rotor = gear * gear * drive.motor.rotor_inertia_kg_m2;
            wheels.push(WheelParameters { inertia_kg_m2: drive.wheel.inertia_kg_m2 + rotor, ..drive.wheel });
            motors.push(Motor::new(drive.motor, step_s));
        }
        let mut body = Body::new(parameters.body, &wheels)?;
        body.set_payload(parameters.payload)?;
        body.set_floor(parameters.floor.clone())?;
        let wheels = parameters.wheels.len();
        Ok(Self {
            body,
            mechanics: None,
            motors,
            wires: wiring::complete(&parameters.wires, wheels).ok_or(MachineError::Wires { wheels })?,
            torques_n_m: vec![0.0; parameters.wheels.len()],
            pushes_n_m: vec![0.0; parameters.wheels.len()],
            greatest_n_m: vec![0.0; parameters.wheels.len()],
            step_ns: u64::from(parameters.step_ns),
            step_s,
            grid_ns: 0,
            now_ns: 0,
        })
    }

    /// Moves on to `now_ns` with the torques asked for; an instant before the present one changes nothing.
    pub fn advance(&mut self, now_ns: u64) {
        if now_ns <= self.now_ns {
            return;
        }
        self.now_ns = now_ns;
        while now_ns - self.grid_ns >= self.step_ns {
            let moved = self.step();
            self.grid_ns += self.step_ns;
            if !moved {
                // Nothing will move until something is asked for: a pause of hours costs nothing.
                let steps = (now_ns - self.grid_ns) / self.step_ns;
                self.body.settle();
                self.motors.iter_mut().for_each(|motor| motor.rest(steps));
                self.grid_ns += steps * self.step_ns;
            }
        }
    }

    /// One step of the grid; `false` where nothing moved and nothing would in the next one.
    fn step(&mut self) -> bool {
        let rested = self.body.at_rest();
        let mut settled = true;
        let torques = self.torques_n_m.iter_mut().zip(&mut self.greatest_n_m).zip(&self.pushes_n_m);
        for ((motor, wheel), ((torque_n_m, greatest_n_m), push_n_m)) in
            self.motors.iter_mut().zip(self.body.wheels()).zip(torques)
        {
            let gear = motor.parameters().gear_ratio;
            motor.step(gear * wheel.speed_rad_s);
            let motor_n_m = gear * motor.shaft_torque_n_m(gear * wheel.angle_rad);
            if motor_n_m.abs() > *greatest_n_m {
                *greatest_n_m = motor_n_m.abs();
            }
            *torque_n_m = motor_n_m + push_n_m;
            settled &= motor.settled();
        }
        if let Some(mechanics) = &mut self.mechanics {
            self.body.follow(mechanics.step(&self.torques_n_m));
            return true;
        }
        self.body.step(&self.torques_n_m, self.step_s);
        !(rested && settled && self.body.at_rest())
    }

    /// Asks the motor of drive `index` for a torque at its shaft, until the next call; an index without a drive is ignored.
    pub fn ask(&mut self, index: usize, torque_n_m: f64) {
        let Some(wire) = self.wires.get(index) else { return };
        if let Some(motor) = self.motors.get_mut(wire.wheel) {
            motor.ask(wire.motor_sign() * torque_n_m);
        }
    }

    /// The motor of drive `index` is held by a brake that bears so much at its shaft, from now on; 0 opens it. An index without
    /// a drive is ignored.
    pub fn brake(&mut self, index: usize, torque_n_m: f64) {
        let Some(wire) = self.wires.get(index) else { return };
        let gear = self.motors.get(wire.wheel).map_or(0.0, |motor| motor.parameters().gear_ratio.abs());
        self.body.set_brake(wire.wheel, gear * torque_n_m);
    }

    /// Somebody turns the shaft of the motor of drive `index` by so much, from now on. An index without a drive is ignored.
    pub fn push(&mut self, index: usize, torque_n_m: f64) {
        let Some(wire) = self.wires.get(index) else { return };
        if let (Some(motor), Some(push)) = (self.motors.get(wire.wheel), self.pushes_n_m.get_mut(wire.wheel))
        {
            *push = wire.motor_sign() * motor.parameters().gear_ratio * torque_n_m;
        }
    }

    /// The greatest torque that the motor of each wheel ever gave, either way, at the wheel.
    pub fn greatest_torques_n_m(&self) -> &[f64] {
        &self.greatest_n_m
    }

    /// What drive `index` sees at the present instant; zeros for an index without a drive.
    pub fn shaft(&self, index: usize) -> Shaft {
        let Some(wire) = self.wires.get(index) else { return Shaft::default() };
        let (Some(motor), Some(wheel)) = (self.motors.get(wire.wheel), self.body.wheels().get(wire.wheel))
        else {
            return Shaft::default();
        };
        let gear = wire.encoder_sign() * motor.parameters().gear_ratio;
        let turned = wheel.angle_rad + wheel.speed_rad_s * self.since_grid_s();
        Shaft {
            angle_rad: gear * turned,
            speed_rad_s: gear * wheel.speed_rad_s,
            torque_n_m: wire.motor_sign() * motor.torque_n_m(),
        }
    }

    /// The truth at the present instant: the one for which the drives read their encoders last.
    pub fn truth(&self) -> Truth {
        let (pose, twist) = (self.body.pose(), self.body.twist_in_body());
        let ahead_s = self.since_grid_s();
        let (sin, cos) = self.body.heading();
        Truth {
            time_ns: self.now_ns,
            pose: Pose {
                x_m: pose.x_m + ahead_s * (cos * twist.vx_m_s - sin * twist.vy_m_s),
                y_m: pose.y_m + ahead_s * (sin * twist.vx_m_s + cos * twist.vy_m_s),
                heading_rad: pose.heading_rad + ahead_s * twist.w_rad_s,
            },
            twist_in_body: twist,
        }
    }

    /// The inertia that motor `index` moves, at its shaft, when the machine drives straight along its force direction
    /// with all wheels pulling alike: what one sets in a drive. Zero for an index without a motor.
    pub fn nominal_inertia_kg_m2(&self, index: usize) -> f64 {
        let Some(motor) = self.motors.get(index) else { return 0.0 };
        let gear = motor.parameters().gear_ratio;
        let share = self.body.mass_kg() / self.motors.len() as f64;
        (self.body.wheel_inertia_kg_m2(index) + share * self.body.lever_m(index).powi(2)) / (gear * gear)
    }

    /// The greatest gain, N·m·s/rad at the shaft, that motor `index` may have in a speed loop that runs once in `loop_s`: where its
    /// wheel gives way on its tread, or has no grip, the motor moves the wheel alone. Inertia of that over the loop's period and half of the
    /// current loop's lag leaves at least 6 dB and 40° (a sampled integrator behind a lag). Infinite for an index without a motor.
    pub fn greatest_speed_gain_n_m_s(&self, index: usize, loop_s: f64) -> f64 {
        let Some(motor) = self.motors.get(index) else { return f64::INFINITY };
        let MotorParameters { gear_ratio, current_loop_s, .. } = *motor.parameters();
        let alone_kg_m2 = self.body.wheel_inertia_kg_m2(index) / (gear_ratio * gear_ratio);
        alone_kg_m2 / (loop_s + 0.5 * current_loop_s)
    }

    /// Lets something else move the body from now on: with the masses, wheels and floor that it has, and in steps of
    /// [`Machine::step_s`]. Loads, forces and grip of the wheels stay as they are.
    pub fn set_mechanics(&mut self, mechanics: Box<dyn Mechanics>) {
        self.mechanics = Some(mechanics);
    }

    /// The step of the integration.
    pub fn step_s(&self) -> f64 {
        self.step_s
    }

    /// The body, with wheels, loads and forces.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// The motors, with temperatures and limits.
    pub fn motors(&self) -> &[Motor] {
        &self.motors
    }

    /// The present instant.
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Changes the payload at the present instant; see [`Body::set_payload`].
    pub fn set_payload(&mut self, payload: Payload) -> Result<(), BodyError> {
        self.body.set_payload(payload)
    }

    /// Puts another floor under the body; see [`Body::set_floor`].
    pub fn set_floor(&mut self, floor: Floor) -> Result<(), BodyError> {
        self.body.set_floor(floor)
    }

    /// Makes the whole floor alike; see [`Body::set_surface`].
    pub fn set_surface(&mut self, surface: Option<Surface>) -> Result<(), BodyError> {
        self.body.set_surface(surface)
    }

    /// What the shaft of motor `index` gives over what its current promises, from now on; an index without a motor is ignored.
    pub fn set_torque_ratio(&mut self, index: usize, ratio: f64) {
        if let Some(motor) = self.motors.get_mut(index) {
            motor.set_torque_ratio(ratio);
        }
    }

    /// Pushes the body from outside; see [`Body::set_push`].
    pub fn set_push(&mut self, push: crate::pose::Wrench) {
        self.body.set_push(push);
    }

    /// Pushes it in its own axes; see [`Body::set_push_in_body`].
    pub fn set_push_in_body(&mut self, push: crate::pose::Wrench) {
        self.body.set_push_in_body(push);
    }

    /// Puts the body somewhere; see [`Body::set_pose`].
    pub fn set_pose(&mut self, pose: Pose) {
        self.body.set_pose(pose);
    }

    fn since_grid_s(&self) -> f64 {
        // Less than a step: it fits, and the conversion of 32 bits is one instruction.
        f64::from((self.now_ns - self.grid_ns) as u32) * 1e-9
    }
}

#[cfg(test)]
mod tests;
