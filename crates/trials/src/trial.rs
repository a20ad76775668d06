//! A robot on its simulated machine, cycle by cycle.

use omnibase_ethercat_sim::device::Outputs;
use omnibase_measure::truth::TruePlatform;
use omnibase_platform::{Pose2, Twist2};
use omnibase_robot::signals::Heard;
use omnibase_robot::{
    CycleRecord, CycleTime, Exchange, ImageBuffer, Phase, Registry, Request, RequestKind, Robot, RobotPlan,
};
use omnibase_robot_sim::{Machine, MachineParameters, SharedMachine};
use omnibase_run::simulated::{self, Sensors};

use crate::servo_box::ServoBox;

/// The plan of a robot's file.
///
/// # Panics
/// With every problem of the file, where it has any.
pub fn plan_of(text: &str) -> RobotPlan {
    let no_files = |name: &str| Err(format!("no file {name}"));
    RobotPlan::from_toml(text, &Registry::with_built_in(), &no_files).unwrap_or_else(|problems| {
        panic!("{}", problems.iter().map(|problem| format!("{problem}\n")).collect::<String>())
    })
}

/// Position from which the first drive counts: 0.02 rad below the greatest.
const CLOSE_TO_WRAP: i32 = 2_147_480_000;

/// What a drive is without.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Without {
    /// Its power: its motor turns freely, and what it counts has another origin afterwards.
    Power,
    /// Its process data: it goes on as it was until its watchdog expires.
    Data,
}

/// A robot and everything that it moves.
pub struct Trial {
    /// The control half.
    pub robot: Robot,
    /// Its plan.
    pub plan: RobotPlan,
    /// The machine behind the drives.
    pub machine: SharedMachine,
    /// Process data between robot and drives; inputs may be falsified between [`Trial::exchange`] and
    /// [`Trial::compute`].
    pub image: ImageBuffer,
    /// What the next exchange comes to; inputs stay as they were where it isn't complete.
    pub next_exchange: Exchange,
    /// The source that a gyro without errors speaks through, where the robot has one: its only value is the turn, rad/s.
    pub gyro: Option<usize>,
    /// The sensors that the plan simulates.
    sensors: Option<Sensors>,
    twist_before: Twist2,
    map_shift_m: [f64; 2],
    servos: Vec<ServoBox>,
    /// Drives that take no part.
    away: Vec<Option<Without>>,
    index: u64,
    pose_before: Pose2,
    /// The true pose at the instant at which the present inputs were measured.
    measured_pose: Pose2,
}

impl Trial {
    /// The robot of a plan, its drives powered, nothing enabled.
    ///
    /// # Panics
    /// Where the plan can't be built or simulated.
    pub fn new(plan: RobotPlan) -> Trial {
        Trial::on_machine(plan, |_| {})
    }

    /// As [`Trial::new`], on a machine that isn't quite what the robot's file says.
    ///
    /// # Panics
    /// Where the plan can't be built, or the machine can't be simulated.
    pub fn on_machine(plan: RobotPlan, change: impl FnOnce(&mut MachineParameters)) -> Trial {
        let robot = match Robot::build(&plan, &Registry::with_built_in()) {
            Ok(robot) => robot,
            Err(error) => panic!("{error}"),
        };
        let mut description = simulated::description(&plan);
        change(&mut description.machine);
        let machine = match Machine::new(&description.machine) {
            Ok(machine) => SharedMachine::new(machine),
            Err(error) => panic!("{error}"),
        };
        description.drives.sort_by_key(|station| station.wheel);
        if let Some(station) = description.drives.first_mut() {
            station.initial_position = CLOSE_TO_WRAP;
        }
        let wheels = plan.drives.iter().zip(&description.drives).zip(&description.machine.wheels);
        let servos = wheels
            .map(|((drive, station), wheel)| ServoBox::new(drive, station, &wheel.motor, &machine))
            .collect();
        let sensors = Sensors::new(&plan);
        Trial {
            robot,
            image: ImageBuffer::new(&plan),
            servos,
            away: vec![None; plan.drives.len()],
            plan,
            machine,
            next_exchange: Exchange::Complete,
            gyro: None,
            sensors,
            twist_before: Twist2::default(),
            map_shift_m: [0.0; 2],
            index: 0,
            pose_before: Pose2::default(),
            measured_pose: Pose2::default(),
        }
    }

    /// The true pose at the instant of the measurements on which the last cycle worked.
    pub fn measured_pose(&self) -> Pose2 {
        self.measured_pose
    }

    /// The true pose now.
    pub fn pose(&self) -> Pose2 {
        let pose = self.machine.truth().pose;
        Pose2 { x_m: pose.x_m, y_m: pose.y_m, heading_rad: pose.heading_rad }
    }

    /// Moves the world on by a period, then swaps process data: inputs of the beat before, outputs for this one.
    pub fn exchange(&mut self) {
        self.index += 1;
        let period_ns = self.plan.bus.cycle_ns;
        // A little later than the grid: the drives' own loops stand on it.
        let now_ns = self.index * period_ns + 1_000;
        while let Some(due_ns) =
            self.servos.iter().filter_map(ServoBox::due_ns).min().filter(|due| *due < now_ns)
        {
            self.servos.iter_mut().for_each(|servo| servo.tick(due_ns));
        }
        let turn_rad_s = {
            let mut machine = self.machine.lock();
            machine.advance(now_ns);
            machine.body().twist_in_body().w_rad_s
        };
        if let Some(source) = self.gyro {
            let mut heard = Heard { instant_ns: self.time().now_ns, ..Heard::NOTHING };
            heard.values[0] = turn_rad_s;
            self.robot.hear(source, &heard);
        }
        self.measured_pose = self.pose_before;
        if let Some(sensors) = &mut self.sensors {
            let mut odom_from_body = self.measured_pose;
            odom_from_body.x_m += self.map_shift_m[0];
            odom_from_body.y_m += self.map_shift_m[1];
            let truth = TruePlatform { odom_from_body, twist_in_body: self.twist_before };
            sensors.look((self.index - 1) * period_ns, &truth);
            sensors.hear(&mut self.robot, self.index * period_ns);
        }
        let exchange = self.next_exchange;
        let images = self.image.inputs.iter_mut().zip(&self.image.outputs);
        for (wheel, (servo, (inputs, outputs))) in self.servos.iter_mut().zip(images).enumerate() {
            let is_there = self.away[wheel].is_none();
            if is_there && exchange.has_inputs_of(wheel) {
                servo.read(inputs);
            }
            // A frame that misses one SubDevice's answer reached the others all the same.
            let takes_part = is_there && exchange != Exchange::Lost;
            if takes_part {
                servo.write(outputs);
            }
            servo.beat(now_ns, period_ns, if takes_part { Outputs::New } else { Outputs::Held });
        }
        self.pose_before = self.pose();
        let twist = self.machine.truth().twist_in_body;
        self.twist_before = Twist2::new(twist.vx_m_s, twist.vy_m_s, twist.w_rad_s);
    }

    /// Computes the cycle that belongs to the exchange.
    pub fn compute(&mut self, kind: Option<RequestKind>) -> &CycleRecord {
        self.compute_asked(kind.map(Request::lasting))
    }

    /// As [`Trial::compute`], with a request that counts for some time only.
    pub fn compute_asked(&mut self, request: Option<Request>) -> &CycleRecord {
        let time = self.time();
        self.robot.compute(time, self.next_exchange, request, &mut self.image)
    }

    /// A simulated sensor falls silent, by its name.
    pub fn silence_sensor(&mut self, name: &str) {
        self.sensors.iter_mut().for_each(|sensors| sensors.silence(name));
    }

    /// What measures poses is moved by so much, m: from now on it tells so much more.
    pub fn shift_map(&mut self, by_m: [f64; 2]) {
        self.map_shift_m = by_m;
    }

    /// The moment of the present cycle.
    pub fn time(&self) -> CycleTime {
        CycleTime::on_grid(self.index, self.plan.bus.cycle_ns)
    }

    /// The drives' process-data watchdogs run out: they fall back to SAFE-OP.
    pub fn watchdogs_expire(&mut self) {
        self.servos.iter_mut().for_each(ServoBox::watchdog_expires);
    }

    /// The drives are in OP again, as after a recovery; bit n for wheel n of those that had lost their power.
    pub fn back_in_op(&mut self) -> u16 {
        let now_ns = self.index * self.plan.bus.cycle_ns + 1_000;
        let mut restarted = 0;
        for (wheel, (servo, away)) in self.servos.iter_mut().zip(&mut self.away).enumerate() {
            match away.take() {
                Some(Without::Power) => {
                    servo.power_on(now_ns);
                    restarted |= 1 << wheel;
                }
                Some(Without::Data) | None => servo.back_in_op(),
            }
        }
        restarted
    }

    /// A drive takes no part any more.
    pub fn lose_drive(&mut self, wheel: usize, without: Without) {
        self.away[wheel] = Some(without);
        if without == Without::Power {
            self.servos[wheel].power_off();
        }
    }

    /// A drive fails by itself, with this error.
    pub fn fail_drive(&mut self, wheel: usize, error: u16) {
        self.servos[wheel].fail(error);
    }

    /// The process-data watchdog of one drive runs out.
    pub fn watchdog_expires(&mut self, wheel: usize) {
        self.servos[wheel].watchdog_expires();
    }

    /// One cycle: exchange and computation.
    pub fn step(&mut self, kind: Option<RequestKind>) -> &CycleRecord {
        self.exchange();
        self.compute(kind)
    }

    /// So many cycles without any request.
    pub fn run(&mut self, cycles: u64) -> &CycleRecord {
        for _ in 0..cycles {
            self.step(None);
        }
        self.robot.record()
    }

    /// Brings the drives to operation.
    ///
    /// # Panics
    /// Where that takes more than a second.
    pub fn enable(&mut self) {
        self.run(20);
        self.step(Some(RequestKind::Enable));
        for _ in 0..1000 {
            if self.robot.phase() == Phase::Holding {
                return;
            }
            self.step(None);
        }
        let problems: Vec<_> = self.robot.drive_problems().collect();
        panic!("not enabled: {:?} {problems:?}", self.robot.phase());
    }
}
