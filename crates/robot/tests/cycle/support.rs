//! A rigid body on ideal wheels and drives without delay, for tests of the cycle: not the simulator.

use omnibase_platform::{Kinematics, PerWheel, Pose2, Twist2, Wrench2};
use omnibase_robot::registry::Kind;
use omnibase_robot::signals::Quantity;
use omnibase_robot::{
    CycleRecord, CycleTime, Exchange, ImageBuffer, Phase, Registry, Request, RequestKind, Robot, RobotPlan,
};

pub const BMM: &str = include_str!("../../../../robots/bmm.toml");
pub const MECANUM: &str = include_str!("../../../../robots/mecanum.toml");

pub fn plan(text: &str) -> RobotPlan {
    plan_with(text, &Registry::with_built_in())
}

/// The built-in control laws.
pub fn laws() -> Vec<&'static str> {
    Registry::with_built_in().controllers.names()
}

/// Those of them that command torques.
pub fn laws_of_torque() -> Vec<&'static str> {
    let registry = Registry::with_built_in();
    let commands = |law: &str| {
        let text = BMM.replace("kind = \"closed_loop_speed\"", &format!("kind = \"{law}\""));
        registry.make_controllers(&plan(&text)).unwrap()[0].quantity()
    };
    laws().into_iter().filter(|law| commands(law) == Quantity::Torque).collect()
}

/// A kind of a test's own, which reads no keys.
pub fn kind(name: &'static str) -> Kind {
    Kind { name, meaning: "For a test", keys: Vec::new() }
}

pub fn plan_with(text: &str, registry: &Registry) -> RobotPlan {
    let no_files = |name: &str| Err(format!("no file {name}"));
    RobotPlan::from_toml(text, registry, &no_files).unwrap_or_else(|problems| {
        panic!("{}", problems.iter().map(|problem| format!("{problem}\n")).collect::<String>())
    })
}

/// One of the drives, seen from its process data: it obeys within one cycle.
#[derive(Clone, Debug)]
struct Servo {
    status: u16,
    mode: i8,
    counts: f64,
    first_counts: i32,
    fault: bool,
    fault_reset: bool,
    /// The torque that it shows, N·m at the wheel, where it isn't the one that it gives.
    shown_nm: Option<f64>,
    /// By how much that swings to and fro, 62.5 Hz at 1 kHz, N·m.
    ringing_nm: f64,
    /// Bits that it shows beside its state.
    more_status: u16,
}

/// A body on wheels that never slip, its drives, and the cycle that drives it.
pub struct Bench {
    pub robot: Robot,
    pub plan: RobotPlan,
    pub image: ImageBuffer,
    pub kinematics: Kinematics,
    pub pose: Pose2,
    pub twist_in_body: Twist2,
    pub mass_kg: f64,
    pub inertia_kg_m2: f64,
    /// Dry friction of each wheel's axle, N·m.
    pub friction_nm: f64,
    /// What pushes the body while its wheels turn by torque, in odom.
    pub push: Wrench2,
    /// What the next exchanges will be.
    pub exchange: Exchange,
    pub index: u64,
    /// Where the next inputs are noise, its seed.
    pub noise: Option<u64>,
    servos: Vec<Servo>,
    wheel_speeds: PerWheel,
    torques: PerWheel,
}

impl Bench {
    pub fn new(plan: RobotPlan) -> Bench {
        Bench::with_registry(plan, &Registry::with_built_in())
    }

    pub fn with_registry(plan: RobotPlan, registry: &Registry) -> Bench {
        let robot = Robot::build(&plan, registry).unwrap();
        let wheels = plan.drives.len();
        let servo = |wheel: usize| Servo {
            status: 0x0250,
            mode: 0,
            counts: 0.0,
            // Any first value, close to the wrap of one of them.
            first_counts: [2_147_483_000, -5, 123_456, 0, 7, 9, 11, 13][wheel],
            fault: false,
            fault_reset: false,
            shown_nm: None,
            ringing_nm: 0.0,
            more_status: 0,
        };
        Bench {
            robot,
            image: ImageBuffer::new(&plan),
            kinematics: plan.kinematics.clone(),
            pose: Pose2::default(),
            twist_in_body: Twist2::default(),
            mass_kg: plan.simulation.mass_kg.unwrap_or(70.0),
            inertia_kg_m2: plan.simulation.inertia_kg_m2.unwrap_or(7.0),
            friction_nm: 1.0,
            push: Wrench2::default(),
            exchange: Exchange::Complete,
            index: 0,
            noise: None,
            servos: (0..wheels).map(servo).collect(),
            wheel_speeds: PerWheel::from_fn(wheels, |_| 0.0),
            torques: PerWheel::from_fn(wheels, |_| 0.0),
            plan,
        }
    }

    pub fn fail_drive(&mut self, wheel: usize) {
        self.servos[wheel].fault = true;
    }

    /// From now on a drive shows another torque than it gives, N·m at the wheel.
    pub fn lie_about_torque(&mut self, wheel: usize, shown_nm: impl Into<Option<f64>>) {
        self.servos[wheel].shown_nm = shown_nm.into();
    }

    /// From now on the torque that a drive shows swings to and fro.
    pub fn ring(&mut self, wheel: usize, ringing_nm: f64) {
        self.servos[wheel].ringing_nm = ringing_nm;
    }

    /// From now on a drive shows that a limit of its own is active, or no longer.
    pub fn limit_drive(&mut self, wheel: usize, is_limited: bool) {
        self.servos[wheel].more_status = if is_limited { 0x0800 } else { 0 };
    }

    pub fn repair_drive(&mut self, wheel: usize) {
        self.servos[wheel].fault = false;
    }

    /// Status word of a drive, as its process data say.
    pub fn status(&self, wheel: usize) -> u16 {
        self.servos[wheel].status
    }

    pub fn control_word(&self, wheel: usize) -> u16 {
        u16::from_le_bytes([self.image.outputs[wheel][0], self.image.outputs[wheel][1]])
    }

    /// One cycle, and one period of the body.
    pub fn step(&mut self, kind: Option<RequestKind>) -> CycleRecord {
        let period_ns = self.plan.bus.cycle_ns;
        let time = CycleTime::on_grid(self.index, period_ns);
        self.index += 1;
        for wheel in 0..self.servos.len() {
            if self.exchange.has_inputs_of(wheel) {
                self.servo_reads_and_answers(wheel);
            }
        }
        if let Some(seed) = self.noise {
            let mut random = Random(seed | 1);
            self.image.inputs.iter_mut().flatten().for_each(|byte| *byte = random.next() as u8);
        }
        let request = kind.map(Request::lasting);
        let record = *self.robot.compute(time, self.exchange, request, &mut self.image);
        self.move_body(period_ns as f64 * 1e-9);
        record
    }

    pub fn run(&mut self, cycles: u64) -> CycleRecord {
        for _ in 0..cycles {
            self.step(None);
        }
        *self.robot.record()
    }

    /// To operation; panics where that takes more than a second.
    pub fn enable(&mut self) {
        self.step(None);
        self.step(Some(RequestKind::Enable));
        for _ in 0..1000 {
            if self.robot.phase() == Phase::Holding {
                return;
            }
            self.step(None);
        }
        panic!("not enabled: {:?} {:?}", self.robot.phase(), self.robot.drive_problems().collect::<Vec<_>>());
    }

    fn field(&self, inputs: bool, wheel: usize, object: u16) -> Option<(usize, usize)> {
        let drive = &self.plan.drives[wheel];
        let pdos = if inputs { &drive.inputs } else { &drive.outputs };
        let mut bit = 0;
        for entry in pdos.iter().flat_map(|pdo| &pdo.entries) {
            if entry.index == object {
                return Some((bit / 8, usize::from(entry.bits) / 8));
            }
            bit += usize::from(entry.bits);
        }
        None
    }

    /// What a drive is sent: the value of an object of its outputs, its sign extended; 0 where it isn't mapped.
    pub fn output(&self, wheel: usize, object: u16) -> i64 {
        let Some((at, bytes)) = self.field(false, wheel, object) else { return 0 };
        let raw =
            self.image.outputs[wheel][at..at + bytes].iter().rev().fold(0_i64, |v, b| v << 8 | i64::from(*b));
        let unused = 64 - 8 * bytes;
        raw << unused >> unused
    }

    fn input(&mut self, wheel: usize, object: u16, value: i64) {
        if let Some((at, bytes)) = self.field(true, wheel, object) {
            self.image.inputs[wheel][at..at + bytes].copy_from_slice(&value.to_le_bytes()[..bytes]);
        }
    }

    fn servo_reads_and_answers(&mut self, wheel: usize) {
        let control = self.output(wheel, 0x6040) as u16;
        let mode = self.output(wheel, 0x6060) as i8;
        let scale = self.plan.drives[wheel].scale;
        let counts_per_rad =
            f64::from(scale.counts_per_revolution) * scale.gear_ratio / std::f64::consts::TAU;
        let servo = &mut self.servos[wheel];
        let state = servo.status & 0x6F;
        let reset = control & 0x80 != 0 && !servo.fault_reset;
        servo.fault_reset = control & 0x80 != 0;
        let next = match state {
            _ if servo.fault => 0x08,
            0x08 if reset => 0x40,
            0x08 => 0x08,
            _ if control & 0x02 == 0 => 0x40,
            0x27 if control & 0x04 == 0 => 0x07,
            0x07 => 0x07,
            _ if control & 0x06 == 0x06 => match (state, control & 0x0F) {
                (0x40, _) => 0x21,
                (0x21, 0x07 | 0x0F) => 0x23,
                (0x23, 0x0F) => 0x27,
                (now, 0x0F) => now,
                (0x27, 0x07) => 0x23,
                (_, 0x06) => 0x21,
                (now, _) => now,
            },
            now => now,
        };
        servo.status = 0x0210 | next;
        servo.mode = mode;
        let speed = self.wheel_speeds[wheel];
        let counts = servo.first_counts.wrapping_add(servo.counts.round() as i64 as i32);
        let (status, mode) = (servo.status | servo.more_status, servo.mode);
        let side = if (self.index / 8).is_multiple_of(2) { 1.0 } else { -1.0 };
        let servo = &self.servos[wheel];
        let torque_nm = servo.shown_nm.unwrap_or(self.torques[wheel]) + side * servo.ringing_nm;
        let torque = 1000.0 * torque_nm / (scale.rated_torque_nm * scale.gear_ratio);
        self.input(wheel, 0x6041, status.into());
        self.input(wheel, 0x6061, mode.into());
        self.input(wheel, 0x6064, counts.into());
        self.input(wheel, 0x606C, (speed * counts_per_rad).round() as i64);
        self.input(wheel, 0x6077, torque.round() as i64);
    }

    /// What the wheels' dry friction does to the body, in odom.
    fn rubs(&self, twist: Twist2, grip: f64) -> Wrench2 {
        let in_body = twist.rotated(-self.pose.heading_rad);
        let speeds_rad_s = self.kinematics.wheel_speeds_rad_s(in_body);
        let torques = speeds_rad_s.map(|speed| -self.friction_nm * grip * (speed / 0.05).clamp(-1.0, 1.0));
        self.kinematics.wrench(&torques).rotated(self.pose.heading_rad)
    }

    fn move_body(&mut self, period_s: f64) {
        let wheels = self.servos.len();
        let running = (0..wheels).filter(|wheel| self.servos[*wheel].status & 0x6F == 0x27).count() == wheels;
        let by_torque = self.servos[0].mode == 10;
        let scale = |wheel: usize| self.plan.drives[wheel].scale;
        let command = |bench: &Bench, object: u16, wheel: usize| bench.output(wheel, object) as f64;
        if running && !by_torque {
            // A stiff speed loop: the wheels turn as told.
            let told = PerWheel::from_fn(wheels, |wheel| {
                let counts = f64::from(scale(wheel).counts_per_revolution) * scale(wheel).gear_ratio;
                command(self, 0x60FF, wheel) * std::f64::consts::TAU / counts
            });
            let before = self.twist_in_body.rotated(self.pose.heading_rad);
            self.twist_in_body = self.kinematics.twist(&told).twist_in_base;
            let twist = self.twist_in_body.rotated(self.pose.heading_rad);
            let gains = Twist2::new(
                (twist.vx_m_s - before.vx_m_s) / period_s,
                (twist.vy_m_s - before.vy_m_s) / period_s,
                (twist.w_rad_s - before.w_rad_s) / period_s,
            );
            let rubs = self.rubs(twist, 1.0);
            let wrench = Wrench2::new(
                self.mass_kg * gains.vx_m_s - rubs.fx_n,
                self.mass_kg * gains.vy_m_s - rubs.fy_n,
                self.inertia_kg_m2 * gains.w_rad_s - rubs.torque_nm,
            );
            self.torques = self.kinematics.wheel_torques_nm(wrench.rotated(-self.pose.heading_rad));
        } else {
            let torques = PerWheel::from_fn(wheels, |wheel| {
                let drive = scale(wheel);
                command(self, 0x6071, wheel) * drive.rated_torque_nm * drive.gear_ratio / 1000.0
            });
            self.torques = if running { torques } else { torques.map(|_| 0.0) };
            let wrench = self.kinematics.wrench(&self.torques).rotated(self.pose.heading_rad);
            let mut twist = self.twist_in_body.rotated(self.pose.heading_rad);
            // Quick stop: the drives brake hard.
            let braking = (0..wheels).any(|wheel| self.servos[wheel].status & 0x6F == 0x07);
            let grip = if braking { 5.0 } else { 1.0 };
            let rubs = self.rubs(twist, grip);
            twist.vx_m_s += period_s * (wrench.fx_n + rubs.fx_n + self.push.fx_n) / self.mass_kg;
            twist.vy_m_s += period_s * (wrench.fy_n + rubs.fy_n + self.push.fy_n) / self.mass_kg;
            let torque_nm = wrench.torque_nm + rubs.torque_nm + self.push.torque_nm;
            twist.w_rad_s += period_s * torque_nm / self.inertia_kg_m2;
            self.twist_in_body = twist.rotated(-self.pose.heading_rad);
        }
        self.wheel_speeds = self.kinematics.wheel_speeds_rad_s(self.twist_in_body);
        let heading = self.pose.heading_rad + self.twist_in_body.w_rad_s * period_s;
        let moved = Pose2 { heading_rad: heading, ..self.pose.moved_by(self.twist_in_body.over(period_s)) };
        // Its velocity over the floor stays as it is until a force changes it.
        self.twist_in_body = self.twist_in_body.rotated(self.pose.heading_rad - heading);
        self.pose = moved;
        for wheel in 0..wheels {
            let drive = scale(wheel);
            let counts = f64::from(drive.counts_per_revolution) * drive.gear_ratio / std::f64::consts::TAU;
            self.servos[wheel].counts += self.wheel_speeds[wheel] * period_s * counts;
        }
    }
}

/// A small generator of its own (xorshift), so that the commands are the same everywhere.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    pub fn within(&mut self, greatest: f64) -> f64 {
        greatest * ((self.next() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0)
    }
}
