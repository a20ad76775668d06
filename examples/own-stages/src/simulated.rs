//! The simulated robot in the process: drives, cables and body on virtual time, as fast as the machine computes.

use anyhow::{Context, bail};
use omnibase_ethercat::cyclic::{
    ClockDirection, CyclicBus, DcFollower, FollowerGains, Goal, Handover, Phase as BusPhase,
    TransitionOptions,
};
use omnibase_ethercat::subdevice::Direction;
use omnibase_ethercat::wire::{Clock, HostTime};
use omnibase_ethercat::{Bus, BusOptions, Exchange as BusExchange, ImagePlan, ProcessImage as BusImage};
use omnibase_ethercat_sim::device::drive::DriveKind;
use omnibase_ethercat_sim::{SimLink, VirtualClock, in_process};
use omnibase_robot::config::{DrivePlan, RobotPlan};
use omnibase_robot::signals::{MAX_WHEELS, RequestKind};
use omnibase_robot::{CycleRecord, CycleTime, Exchange, ProcessImage, Registry, Request, Robot};
use omnibase_robot_sim::machine::DEFAULT_STEP_NS;
use omnibase_robot_sim::{
    BodyParameters, DriveStation, MachineParameters, MotorParameters, Payload, RobotSim, RobotSimDescription,
    SharedMachine, Truth, WheelDrive, WheelParameters,
};
use std::ops::Range;
use std::time::Duration;

/// A robot whose drives, wheels and floor are simulated.
pub struct SimulatedRobot {
    /// The control half, the same as on a real robot.
    pub robot: Robot,
    machine: SharedMachine,
    bus: CyclicBus<SimLink>,
    clock: VirtualClock,
    follower: DcFollower,
    image: Image,
    wake: HostTime,
    cycle: Duration,
    index: u64,
}

/// The bus's image, cut into the wheels' drives.
struct Image {
    bytes: BusImage,
    inputs: Vec<Range<usize>>,
    outputs: Vec<Range<usize>>,
}

impl Image {
    fn new(plan: &ImagePlan, wheels: usize) -> Self {
        // Drive by drive in the order of the wheels: here wheel n stands at position n.
        let of = |direction| {
            let areas = plan.placements.iter().filter(move |area| area.direction == direction);
            areas.map(|area| area.bytes()).take(wheels).collect()
        };
        Image { bytes: plan.image(), inputs: of(Direction::Inputs), outputs: of(Direction::Outputs) }
    }
}

impl ProcessImage for Image {
    fn inputs(&self, wheel: usize) -> &[u8] {
        self.inputs.get(wheel).map_or(&[], |range| &self.bytes.inputs[range.clone()])
    }

    fn outputs(&mut self, wheel: usize) -> &mut [u8] {
        self.outputs.get(wheel).map_or(&mut [], |range| &mut self.bytes.outputs[range.clone()])
    }
}

impl SimulatedRobot {
    /// Builds the robot of a plan, finds its simulated drives and brings them to OP.
    pub fn bring_up(plan: &RobotPlan, registry: &Registry) -> anyhow::Result<Self> {
        let robot = Robot::build(plan, registry)?;
        let (segment, machine) = RobotSim::new(&description(plan)?)?.into_line()?;
        let (link, clock) = in_process(segment);
        let mut bus = Bus::new(link, clock, BusOptions::default());
        bus.scan()?;
        let configs: Vec<_> = plan.drives.iter().map(|drive| drive.subdevice_config(&plan.bus)).collect();
        bus.configure(&configs)?;
        let Handover { mut bus, clock, .. } = bus.into_cyclic(ClockDirection::CycleFollowsDc)?;
        bus.request(Goal::Op, TransitionOptions::default(), clock.now());
        let cycle = Duration::from_nanos(plan.bus.cycle_ns);
        let mut simulated = SimulatedRobot {
            robot,
            machine,
            image: Image::new(bus.plan(), plan.drives.len()),
            wake: clock.now() + cycle,
            follower: DcFollower::new(cycle, Duration::ZERO, FollowerGains::default()),
            bus,
            clock,
            cycle,
            index: 0,
        };
        while simulated.bus.phase() != BusPhase::Reached(Goal::Op) {
            if let BusPhase::Failed(error) = simulated.bus.phase() {
                return Err(error).context("on the way to OP");
            }
            simulated.exchange()?;
        }
        Ok(simulated)
    }

    /// One cycle of bus, robot and body.
    pub fn cycle(&mut self, request: Option<RequestKind>) -> anyhow::Result<&CycleRecord> {
        let exchange = self.exchange()?;
        let time = CycleTime::on_grid(self.index, self.cycle.as_nanos() as u64);
        self.index += 1;
        Ok(self.robot.compute(time, exchange, request.map(Request::lasting), &mut self.image))
    }

    /// Cycles until a condition holds; refused after `most` cycles with what the robot says.
    pub fn until(
        &mut self,
        request: RequestKind,
        most: u64,
        done: impl Fn(&CycleRecord, &Robot) -> bool,
    ) -> anyhow::Result<CycleRecord> {
        let mut request = Some(request);
        for _ in 0..most {
            let record = *self.cycle(request.take())?;
            if done(&record, &self.robot) {
                return Ok(record);
            }
        }
        let problems: Vec<String> = self.robot.drive_problems().map(|(_, text)| text).collect();
        let reason = self.robot.record().stop_reason.text();
        bail!("not done after {most} cycles: {:?}, {reason} {}", self.robot.phase(), problems.join(", "))
    }

    /// Where the body really is.
    pub fn truth(&self) -> Truth {
        self.machine.truth()
    }

    /// The same outputs go out and new inputs come in; the cycle follows the drives' clock.
    fn exchange(&mut self) -> anyhow::Result<Exchange> {
        self.clock.sleep_until(self.wake);
        let deadline = self.wake + self.cycle / 2;
        let exchange = self.bus.exchange(&mut self.image.bytes, deadline)?;
        self.wake = self.follower.next_wake(self.wake, self.bus.clock());
        Ok(match exchange {
            BusExchange::Complete => Exchange::Complete,
            BusExchange::ShortCount { expected, received, .. } => Exchange::ShortCount { expected, received },
            BusExchange::Without { .. } | BusExchange::Lost { .. } => Exchange::Lost,
        })
    }
}

/// The machine to simulate: the plan's wheels and body, with the simulator's own figures for floor and motors.
fn description(plan: &RobotPlan) -> anyhow::Result<RobotSimDescription> {
    let wheel = |(wheel, drive): (&omnibase_platform::Wheel, &DrivePlan)| WheelDrive {
        wheel: WheelParameters::mecanum(
            wheel.position_m,
            wheel.rolling_direction,
            wheel.force_direction,
            wheel.radius_m,
        ),
        motor: MotorParameters {
            rated_torque_n_m: drive.scale.rated_torque_nm,
            peak_torque_n_m: drive.scale.peak_torque_nm,
            gear_ratio: drive.scale.gear_ratio,
            ..MotorParameters::default()
        },
    };
    let simulation = &plan.simulation;
    let body = BodyParameters {
        mass_kg: simulation.mass_kg.context("simulation.mass_kg must be given")?,
        yaw_inertia_kg_m2: simulation.inertia_kg_m2.context("simulation.inertia_kg_m2 must be given")?,
        center_of_mass_m: [0.0; 2],
        center_of_mass_height_m: 0.3,
    };
    let wheels = plan.kinematics.wheels().iter().zip(&plan.drives).map(wheel).collect();
    let machine = MachineParameters { body, payload: Payload::default(), wheels, step_ns: DEFAULT_STEP_NS };
    let drives = (0..plan.drives.len().min(MAX_WHEELS)).map(|at| DriveStation::new(DriveKind::Generic, at));
    Ok(RobotSimDescription { machine, drives: drives.collect() })
}
