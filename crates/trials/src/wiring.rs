//! Robots that aren't as their file says: a wheel wired backwards, two swapped, an encoder that counts against its motor, motors
//! too weak; and robots that are, on every floor. Whether they are named, and how far they went by then.

use omnibase_robot::signals::SafetyReason;
use omnibase_robot::{Phase, RequestKind};
use omnibase_robot_sim::{Payload, Wire, Wrench};

use crate::approaches::Random;
use crate::robots::{BMM, MECANUM, with_payload};
use crate::sensed::GYRO;
use crate::{Trial, laws, plan_of};

/// The paths.
pub const PATHS: [&str; 5] = ["square", "circle", "eight", "tangent", "spiral"];

/// What is wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// Nothing.
    None,
    /// Motor and encoder of a wheel are both wired the other way round.
    Turned(usize),
    /// Two drives have one another's motor and encoder.
    Swapped(usize, usize),
    /// The encoder of a wheel counts against its motor.
    Encoder(usize),
    /// A motor gives such a part of what its current promises.
    Weak(usize, f64),
    /// All motors give at most this torque, N·m, where the file says more.
    Limited(f64),
}

impl Fault {
    /// All that a robot of so many wheels can have.
    pub fn all(wheels: usize) -> Vec<Fault> {
        let mut all: Vec<Fault> = (0..wheels).map(Fault::Turned).collect();
        all.extend(
            (0..wheels).flat_map(|one| (one + 1..wheels).map(move |other| Fault::Swapped(one, other))),
        );
        all.extend((0..wheels).map(Fault::Encoder));
        all.extend((0..wheels).flat_map(|wheel| [0.3, 0.6].map(|part| Fault::Weak(wheel, part))));
        all.push(Fault::Limited(2.0));
        all
    }

    /// Its name without its wheel.
    pub fn kind(&self) -> &'static str {
        match self {
            Fault::None => "nothing",
            Fault::Turned(_) => "a wheel wired backwards",
            Fault::Swapped(..) => "two wheels swapped",
            Fault::Encoder(_) => "an encoder against its motor",
            Fault::Weak(_, part) if *part < 0.5 => "a motor that gives 30 %",
            Fault::Weak(..) => "a motor that gives 60 %",
            Fault::Limited(_) => "motors of 2 N·m",
        }
    }
}

/// A robot on a path, in a world.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// `bmm` or `mecanum`.
    pub robot: &'static str,
    /// The control law.
    pub law: &'static str,
    /// The path.
    pub path: &'static str,
    /// What is wrong.
    pub fault: Fault,
    /// Payload, kg.
    pub payload_kg: f64,
    /// First estimate of mass and inertia over the truth.
    pub estimate: f64,
    /// More of the table `simulation` and what follows it.
    pub world: String,
    /// What part of its turn its gyro tells, where it has one; negative: of the opposite.
    pub gyro: Option<f64>,
    /// A push on its way.
    pub push: Option<Push>,
    /// When its payload becomes another, s after the start, and what part of the first one it is then.
    pub loaded: Option<(f64, f64)>,
}

/// A push from outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Push {
    /// When, s after the start.
    pub at_s: f64,
    /// For how long, s.
    pub lasts_s: f64,
    /// Force in the world's axes, N, and moment, N·m.
    pub wrench: [f64; 3],
}

/// What became of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Named {
    /// Why it stopped.
    pub reason: SafetyReason,
    /// Which wheel that is about.
    pub wheel: u64,
    /// How far its wheels' places went over the floor by then, m.
    pub way_m: f64,
    /// How far it is from where it believes to be, m.
    pub astray_m: f64,
}

impl Named {
    /// Whether the reason is one of those that name a robot which isn't as its file says.
    pub fn is_named(&self) -> bool {
        use SafetyReason::{EncoderDirection, WeakMotor, Wiring};
        matches!(self.reason, Wiring | EncoderDirection | WeakMotor)
    }
}

impl Case {
    /// A robot with a fault in a plain world.
    pub fn plain(robot: &'static str, law: &'static str, path: &'static str, fault: Fault) -> Case {
        let world = String::new();
        let (push, loaded) = (None, None);
        Case { robot, law, path, fault, payload_kg: 0.0, estimate: 1.0, world, gyro: None, push, loaded }
    }

    /// A robot that is as its file says, by a seed: mass and what is known of it, load, floor, patches, tread, slope, pushes and
    /// loads on the way, cogging.
    pub fn seeded(seed: u64) -> Case {
        let mut random = Random::new(seed ^ 0x317E_0000_0000_0000);
        let robot = ["bmm", "mecanum"][random.below(2) as usize];
        // The last law came later: robots of before keep theirs.
        let (law, path) = (laws::ALL[random.below(3) as usize], PATHS[random.below(5) as usize]);
        let payload_kg = if random.below(3) == 0 { 0.0 } else { random.between(0.0, 200.0) };
        let friction = random.spread(0.08, 0.7);
        let at_m = [random.between(-0.12, 0.12), random.between(-0.08, 0.08)];
        let mut world = format!(
            "payload_position_m = {at_m:?}\nstatic_friction = {friction:?}\nsliding_friction = {:?}\n",
            random.between(0.7, 1.0) * friction
        );
        if random.below(2) == 0 {
            let (stiffness, damping) = (random.spread(1e5, 4e6), random.spread(0.1, 1.0));
            world += &format!("tread_stiffness_n_m = {stiffness:?}\ntread_damping_ratio = {damping:?}\n");
        }
        if random.below(2) == 0 {
            let (slope, direction) = (random.between(0.0, 0.06), random.between(0.0, 6.2));
            world += &format!("slope_rad = {slope:?}\nslope_direction_rad = {direction:?}\n");
        }
        if random.below(3) == 0 {
            world += &format!("cogging_nm = {:?}\ntorque_ripple = 0.03\n", random.between(0.0, 0.05));
        }
        if random.below(3) == 0 {
            let (x, y) = (random.between(-0.5, 2.0), random.between(-0.5, 2.0));
            let slippery = random.spread(0.05, 0.3);
            world += &format!(
                "[[simulation.patch]]\ncentre_m = [{x:?}, {y:?}]\nradius_m = 0.5\nstatic_friction = {slippery:?}\n"
            );
        }
        let mut drawn = Random::new(seed ^ 0x0E7E_0000_0000_0000);
        let push = (drawn.below(2) == 0).then(|| Push {
            at_s: drawn.between(0.5, 12.0),
            lasts_s: drawn.spread(0.1, 3.0),
            wrench: [drawn.between(-150.0, 150.0), drawn.between(-150.0, 150.0), drawn.between(-20.0, 20.0)],
        });
        let loaded = (drawn.below(4) == 0).then(|| (drawn.between(1.0, 12.0), drawn.between(0.2, 2.0)));
        let estimate = drawn.spread(0.6, 1.6);
        Case { robot, law, path, fault: Fault::None, payload_kg, estimate, world, gyro: None, push, loaded }
    }

    fn text(&self) -> String {
        let robot = if self.robot == "bmm" { BMM } else { MECANUM };
        let text = with_payload(robot, self.law, self.estimate, self.payload_kg);
        let limited = match self.fault {
            Fault::Limited(most_nm) => format!(
                "motor_torque_limit_nm = {:?}\n",
                if self.robot == "bmm" { most_nm } else { 0.1 * most_nm }
            ),
            _ => String::new(),
        };
        let path = match self.path {
            "circle" => "kind = \"circle\"\nradius_m = 0.5\nduration_s = 9.0",
            "eight" => "kind = \"eight\"\nhalf_length_m = 0.8\nduration_s = 14.0",
            "tangent" => {
                "kind = \"eight\"\nhalf_length_m = 0.8\nheading = \"follows_tangent\"\nduration_s = 24.5"
            }
            "spiral" => "kind = \"spiral\"\nstep_m = 0.3\nturns = 2.5\nduration_s = 18.0",
            _ => {
                "kind = \"path\"\npoints = [[0, 0, 0, 0], [4, 2, 0, 0], [8, 2, 2, 0], [12, 0, 2, 0], [16, 0, 0, 0]]"
            }
        };
        let gyro = self.gyro.map_or_else(String::new, |tells| {
            let scale = format!("sigma_rad_s = 0.002\nscale = {:?}", f64::signum(tells));
            let told = GYRO
                .replace("scale_error = 0.002", &format!("scale_error = {:?}", tells.abs() - 1.0))
                .replace("sigma_rad_s = 0.002", &scale);
            format!("[estimator]\nkind = \"fused\"\n{told}[safety]\ngyro_input = \"imu.turn\"\n")
        });
        format!("{text}{limited}{}\n[reference]\n{path}\n{gyro}", self.world)
    }

    /// What happens to it in the cycle at this time, s.
    fn happen(&self, trial: &Trial, now_s: f64) {
        let is_now = |at_s: f64| (at_s..at_s + 1e-3).contains(&now_s);
        if let Some(Push { at_s, lasts_s, wrench: [fx_n, fy_n, moment_n_m] }) = self.push {
            if is_now(at_s) {
                trial.machine.lock().set_push(Wrench { fx_n, fy_n, moment_n_m });
            } else if is_now(at_s + lasts_s) {
                trial.machine.lock().set_push(Wrench::default());
            }
        }
        if let Some((_, part)) = self.loaded.filter(|(at_s, _)| is_now(*at_s)) {
            let mut machine = trial.machine.lock();
            let first = machine.body().payload();
            let payload = Payload {
                mass_kg: part * first.mass_kg,
                yaw_inertia_kg_m2: part * first.yaw_inertia_kg_m2,
                ..first
            };
            if let Err(error) = machine.set_payload(payload) {
                panic!("{error}");
            }
        }
    }

    /// Drives it until it stops or is so far, m.
    ///
    /// # Panics
    /// Where the robot can't be made.
    pub fn ride(&self, far_m: f64) -> Named {
        let mut trial = Trial::on_machine(plan_of(&self.text()), |machine| {
            let wheels = machine.wheels.len();
            let mut wires: Vec<Wire> = (0..wheels).map(Wire::straight).collect();
            match self.fault {
                Fault::None => {}
                // Small motors: their rated torque is no more than that.
                Fault::Limited(_) => machine.wheels.iter_mut().for_each(|wheel| {
                    let motor = &mut wheel.motor;
                    motor.rated_torque_n_m = motor.rated_torque_n_m.min(motor.peak_torque_n_m);
                }),
                Fault::Turned(wheel) => {
                    (wires[wheel].turns_motor, wires[wheel].turns_encoder) = (true, true);
                }
                Fault::Swapped(one, other) => wires.swap(one, other),
                Fault::Encoder(wheel) => wires[wheel].turns_encoder = true,
                Fault::Weak(wheel, part) => machine.wheels[wheel].motor.torque_ratio = part,
            }
            machine.wires = wires;
        });
        let period_s = trial.plan.bus.cycle_ns as f64 * 1e-9;
        let wheels = trial.plan.kinematics.wheels();
        let arm_m =
            wheels.iter().map(|wheel| wheel.position_m[0].hypot(wheel.position_m[1])).fold(0.0, f64::max);
        let mut named = Named::default();
        let mut is_asked = false;
        for cycle in 0..30_000 {
            let kind = match trial.robot.phase() {
                _ if cycle == 20 => Some(RequestKind::Enable),
                Phase::Holding if !is_asked => Some(RequestKind::Track),
                _ => None,
            };
            self.happen(&trial, f64::from(cycle) * period_s);
            is_asked |= kind == Some(RequestKind::Track);
            let record = trial.step(kind);
            let (phase, reason, wheel) = (record.phase, record.stop_reason, record.stop_where);
            let believed = record.state.odom_from_body;
            let twist = trial.machine.truth().twist_in_body;
            named.way_m += period_s * (twist.vx_m_s.hypot(twist.vy_m_s) + arm_m * twist.w_rad_s.abs());
            named.astray_m = trial.pose().distance_m(believed);
            if reason != SafetyReason::None {
                return Named { reason, wheel, ..named };
            }
            let is_over = is_asked && phase == Phase::Holding && trial.robot.record().reference_time_s > 1.0;
            if is_over || named.way_m > far_m {
                break;
            }
        }
        named
    }
}
