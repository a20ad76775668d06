//! A robot on its simulated machine, cycle by cycle.

use omnibase_ethercat_sim::device::Outputs;
use omnibase_platform::Pose2;
use omnibase_robot::{
    CycleRecord, CycleTime, Exchange, ImageBuffer, Phase, Registry, Request, RequestKind, Robot, RobotPlan,
};
use omnibase_robot_sim::{Machine, SharedMachine};

use crate::plant;
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
    servos: Vec<ServoBox>,
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
        let robot = match Robot::build(&plan, &Registry::with_built_in()) {
            Ok(robot) => robot,
            Err(error) => panic!("{error}"),
        };
        let parameters = plant::machine(&plan);
        let machine = match Machine::new(&parameters) {
            Ok(machine) => SharedMachine::new(machine),
            Err(error) => panic!("{error}"),
        };
        let servos = plan.drives.iter().zip(&parameters.wheels).enumerate();
        let servos = servos.map(|(wheel, (drive, parameters))| {
            ServoBox::new(drive, &parameters.motor, machine.clone(), wheel)
        });
        Trial {
            robot,
            image: ImageBuffer::new(&plan),
            servos: servos.collect(),
            plan,
            machine,
            next_exchange: Exchange::Complete,
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
        self.machine.lock().advance(now_ns);
        self.measured_pose = self.pose_before;
        let complete = self.next_exchange == Exchange::Complete;
        if complete {
            for (servo, (inputs, outputs)) in
                self.servos.iter_mut().zip(self.image.inputs.iter_mut().zip(&self.image.outputs))
            {
                servo.read(inputs);
                servo.write(outputs);
            }
        }
        let outputs = if complete { Outputs::New } else { Outputs::Held };
        self.servos.iter_mut().for_each(|servo| servo.beat(now_ns, period_ns, outputs));
        self.pose_before = self.pose();
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

    /// The moment of the present cycle.
    pub fn time(&self) -> CycleTime {
        CycleTime::on_grid(self.index, self.plan.bus.cycle_ns)
    }

    /// The drives' process-data watchdogs run out: they fall back to SAFE-OP.
    pub fn watchdogs_expire(&mut self) {
        self.servos.iter_mut().for_each(ServoBox::watchdog_expires);
    }

    /// The drives are in OP again, as after a recovery.
    pub fn back_in_op(&mut self) {
        self.servos.iter_mut().for_each(ServoBox::back_in_op);
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
