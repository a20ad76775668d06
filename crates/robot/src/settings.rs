//! Values of the whole robot that may change while it runs: how much of its limits is used, how its joystick is shaped.

use omnibase_platform::Twist2;

use crate::config::{AvoidanceKind, Limits, RobotPlan, TorqueLimitTold, WheelLimits};
use crate::guard::Guard;
use crate::joystick_shape::JoystickShape;
use crate::signals::{Batch, CycleRecord, Quantity, RequestAnswer};
use crate::stages::{Controller, Gain};

/// Slower than this share of its speed a robot is not asked to go; it is paused instead.
const LEAST_FACTOR: f64 = 0.01;
/// Settings that can wait for others.
const MOST_WAITING: usize = 48;
/// Settings of the robot itself; those of its joystick, then those of the controller stand behind them.
const OWN: usize = 6;
const BEFORE_CONTROLLER: usize = OWN + JoystickShape::SETTINGS;
/// Places of the wheels' limits: behind whatever a controller has, so that they are the same with each of them.
const WHEEL_SPEED: usize = MOST_SETTINGS - 2;
const WHEEL_TORQUE: usize = MOST_SETTINGS - 1;
/// Places that a setting may have.
pub const MOST_SETTINGS: usize = 48;

/// What may be set while the robot runs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Settings {
    /// Share of the wished speed.
    speed_factor: f64,
    /// Speeds that no wish exceeds; never above the limits of the robot's file.
    speed_m_s: f64,
    turn_speed_rad_s: f64,
    /// What the wheels may do; never above the limits of the robot's file.
    wheels: WheelLimits,
    /// The wheel speed that is held: it comes down to what was set as fast as the wheels do.
    held_rad_s: f64,
    /// Greatest wheel speed per speed and per turning speed of the platform, 1/m and 1, whatever its direction.
    wheel_speed_per: [f64; 2],
    torque_told: TorqueLimitTold,
    /// The least torque that every drive can be told, N·m.
    least_torque_nm: f64,
    limits: Limits,
    joystick: JoystickShape,
    waiting: [(usize, f64); MOST_WAITING],
    waiting_count: usize,
    /// The one that must come next for those that wait to act; `None` where none does, or one of them was refused.
    next: Option<Batch>,
}

impl Settings {
    pub(crate) fn new(plan: &RobotPlan) -> Self {
        let (limits, drives) = (&plan.limits, &plan.drives);
        let rows = plan.kinematics.matrix().iter().zip(plan.kinematics.wheels());
        let per =
            rows.map(|([x, y, turn], wheel)| [x.hypot(*y), turn.abs()].map(|part| part / wheel.radius_m));
        let is_at_start_up = |told| told == TorqueLimitTold::AtStartUp;
        Settings {
            speed_factor: 1.0,
            speed_m_s: limits.speed_m_s,
            turn_speed_rad_s: limits.turn_speed_rad_s,
            wheels: limits.wheels(),
            held_rad_s: limits.wheel_speed_rad_s,
            wheel_speed_per: per.fold([0.0; 2], |[a, b], [c, d]| [f64::max(a, c), f64::max(b, d)]),
            torque_told: match drives.iter().any(|drive| is_at_start_up(drive.torque_limit.told)) {
                true => TorqueLimitTold::AtStartUp,
                false => TorqueLimitTold::EveryCycle,
            },
            least_torque_nm: drives
                .iter()
                .map(|drive| drive.scale.wheel_nm_per_mille())
                .fold(LEAST_FACTOR * limits.wheel_torque_nm, f64::max)
                .min(limits.wheel_torque_nm),
            limits: *limits,
            joystick: JoystickShape::of(&plan.joystick),
            waiting: [(0, 0.0); MOST_WAITING],
            waiting_count: 0,
            next: None,
        }
    }

    /// How its joystick is shaped.
    pub(crate) fn joystick(&self) -> JoystickShape {
        self.joystick
    }

    /// The setting of a place: first the robot's own, then its joystick's, then the controller's.
    pub(crate) fn get(&self, guard: &Guard, controller: &dyn Controller, index: usize) -> Option<Gain> {
        let share =
            |name, value, greatest: f64| Gain { name, value, least: LEAST_FACTOR * greatest, greatest };
        let Limits { speed_m_s, turn_speed_rad_s, .. } = self.limits;
        match index {
            0 => Some(share("speed_factor", self.speed_factor, 1.0)),
            1 => Some(share("speed_m_s", self.speed_m_s, speed_m_s)),
            2 => Some(share("turn_speed_rad_s", self.turn_speed_rad_s, turn_speed_rad_s)),
            3 => Some(Gain {
                name: "avoidance",
                value: guard.avoidance.code(),
                least: AvoidanceKind::Off.code(),
                greatest: AvoidanceKind::Guarded.code(),
            }),
            4 => Some(Gain {
                name: "avoidance_distance_m",
                value: guard.distance_m,
                least: 0.0,
                greatest: 10.0,
            }),
            5 => {
                Some(Gain { name: "circulate_1_s", value: guard.circulate_1_s, least: 0.01, greatest: 100.0 })
            }
            OWN..BEFORE_CONTROLLER => self.joystick.setting(index - OWN),
            WHEEL_SPEED => {
                Some(share("wheel_speed_rad_s", self.wheels.speed_rad_s, self.limits.wheel_speed_rad_s))
            }
            WHEEL_TORQUE => Some(Gain {
                name: "wheel_torque_nm",
                value: self.wheels.torque_nm,
                least: match self.torque_told {
                    TorqueLimitTold::EveryCycle => self.least_torque_nm,
                    TorqueLimitTold::AtStartUp => self.limits.wheel_torque_nm,
                },
                greatest: self.limits.wheel_torque_nm,
            }),
            BEFORE_CONTROLLER..WHEEL_SPEED => controller.gain(index - BEFORE_CONTROLLER),
            _ => None,
        }
    }

    /// Takes one; the last of a batch sets all of it. A batch of which one was refused, or is missing, sets nothing.
    pub(crate) fn set(
        &mut self,
        guard: &mut Guard,
        controller: &mut dyn Controller,
        index: usize,
        value: f64,
        batch: Batch,
    ) -> RequestAnswer {
        let fits = |gain: Gain| {
            let is_choice = gain.name != "avoidance" || AvoidanceKind::from_code(value).is_some();
            (gain.least..=gain.greatest).contains(&value) && is_choice
        };
        let follows = batch.place() == 0 || self.next == Some(batch);
        if batch.place() == 0 {
            self.drop_waiting();
        }
        let has_room = usize::from(batch.size()) <= MOST_WAITING;
        let is_told_once = index == WHEEL_TORQUE && self.torque_told == TorqueLimitTold::AtStartUp;
        if is_told_once && value != self.wheels.torque_nm {
            self.drop_waiting();
            return RequestAnswer::AtStartUpOnly;
        }
        if !follows || !has_room || !self.get(guard, controller, index).is_some_and(fits) {
            self.drop_waiting();
            return RequestAnswer::Refused;
        }
        self.waiting[self.waiting_count] = (index, value);
        self.waiting_count += 1;
        self.next = batch.next();
        if self.next.is_none() {
            self.put(guard, controller);
            self.drop_waiting();
        }
        RequestAnswer::Taken
    }

    /// What waits for the rest of its batch is forgotten, and the rest will be refused.
    pub(crate) fn drop_waiting(&mut self) {
        (self.waiting_count, self.next) = (0, None);
    }

    fn put(&mut self, guard: &mut Guard, controller: &mut dyn Controller) {
        for (index, value) in self.waiting.into_iter().take(self.waiting_count) {
            match index {
                0 => self.speed_factor = value,
                1 => self.speed_m_s = value,
                2 => self.turn_speed_rad_s = value,
                3 => guard.avoidance = AvoidanceKind::from_code(value).unwrap_or_default(),
                4 => guard.distance_m = value,
                5 => guard.circulate_1_s = value,
                OWN..BEFORE_CONTROLLER => self.joystick.set(index - OWN, value),
                WHEEL_SPEED => {
                    self.wheels.speed_rad_s = value;
                    self.held_rad_s = self.held_rad_s.max(value);
                }
                WHEEL_TORQUE => self.wheels.torque_nm = value,
                _ => controller.set_gain(index - BEFORE_CONTROLLER, value),
            }
        }
    }

    /// What the wheels may do in this cycle.
    pub(crate) fn wheel_limits(&self) -> WheelLimits {
        WheelLimits { speed_rad_s: self.held_rad_s, ..self.wheels }
    }

    /// A lower wheel speed slows the wishes at once, and holds when the ramp has brought the wheels there: held before,
    /// it would brake them at once.
    pub(crate) fn settle(&mut self, last: &CycleRecord) {
        let told = &last.allowed.commands;
        let told = told.values.iter().filter(|_| told.quantity == Quantity::Speed).copied();
        let measured = last.measurements.present().iter().map(|drive| drive.speed_rad_s);
        let fastest_rad_s = told.chain(measured).map(f64::abs).fold(0.0, f64::max);
        self.held_rad_s = self.held_rad_s.min(fastest_rad_s).max(self.wheels.speed_rad_s);
    }

    /// A wished speed, scaled as a whole.
    pub(crate) fn slowed(&self, wished: Twist2) -> Twist2 {
        let wished = wished.scaled(self.speed_factor);
        wished.scaled(self.share_of(wished))
    }

    /// The greatest speed and turning speed that are set, m/s and rad/s: both at once are possible.
    pub(crate) fn speeds(&self) -> [f64; 2] {
        let speed_m_s = (self.speed_factor * self.limits.speed_m_s).min(self.speed_m_s);
        let turn_rad_s = (self.speed_factor * self.limits.turn_speed_rad_s).min(self.turn_speed_rad_s);
        let share = self.share_of(Twist2::new(speed_m_s, 0.0, turn_rad_s));
        [share * speed_m_s, share * turn_rad_s]
    }

    /// The rate at which a reference may go on that moves so.
    pub(crate) fn rate(&self, twist: Twist2) -> f64 {
        self.speed_factor * self.share_of(twist.scaled(self.speed_factor))
    }

    /// How much of a speed is within what is set.
    fn share_of(&self, twist: Twist2) -> f64 {
        let share = |most: f64, speed: f64| if speed > most { most / speed } else { 1.0 };
        // Unset, limits are the limiter's work alone.
        let linear = if self.speed_m_s < self.limits.speed_m_s {
            share(self.speed_m_s, twist.speed_m_s())
        } else {
            1.0
        };
        let turning = if self.turn_speed_rad_s < self.limits.turn_speed_rad_s {
            share(self.turn_speed_rad_s, twist.w_rad_s.abs())
        } else {
            1.0
        };
        let [per_speed, per_turn] = self.wheel_speed_per;
        let wheels = if self.wheels.speed_rad_s < self.limits.wheel_speed_rad_s {
            share(self.wheels.speed_rad_s, per_speed * twist.speed_m_s() + per_turn * twist.w_rad_s.abs())
        } else {
            1.0
        };
        linear.min(turning).min(wheels)
    }
}
