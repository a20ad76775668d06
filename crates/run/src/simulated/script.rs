//! What happens to the simulated robot by time.

use omnibase_ethercat_sim::pdi::ApplicationFault;
use omnibase_ethercat_sim::{Fault, Injector, Segment};
use omnibase_platform::Wheel;
use omnibase_robot::RobotPlan;
use omnibase_robot::config::{EventPlan, Happening, PushFrame, SimulationTable};
use omnibase_robot_sim::{BodyError, Payload, SharedMachine, Surface, Wrench};
use omnibase_session::Words;

use super::{Member, PAYLOAD_HEIGHT_M, disc_kg_m2, line, payload, torque_ratio};

/// The events of a robot's file, applied to its machine and its drives when their time has come.
pub struct Script {
    machine: SharedMachine,
    injector: Injector,
    /// What is still to come, the next one last.
    events: Vec<EventPlan>,
    /// Position of each wheel's drive.
    positions: Vec<usize>,
    names: Vec<String>,
    table: SimulationTable,
    wheels: Vec<Wheel>,
}

impl Script {
    /// The events of a plan for the segment and the machine that were made of it; `None` where nothing happens.
    pub fn new(plan: &RobotPlan, segment: &mut Segment, machine: &SharedMachine) -> Option<Self> {
        if plan.events.is_empty() {
            return None;
        }
        let mut events = plan.events.clone();
        events.reverse();
        Some(Script {
            machine: machine.clone(),
            injector: segment.injector(),
            events,
            positions: positions(plan),
            names: plan.drives.iter().map(|drive| drive.name.clone()).collect(),
            table: plan.simulation.clone(),
            wheels: plan.kinematics.wheels().to_vec(),
        })
    }

    /// Lets the next thing happen whose time has come, and says what it was; `None` where there is none. Time counts from
    /// the first cycle.
    pub fn next(&mut self, now_ns: u64) -> Option<Words> {
        let EventPlan { happening, .. } = self.events.pop_if(|event| event.at_ns <= now_ns)?;
        Some(match self.happen(&happening) {
            Ok(()) => self.words(&happening),
            Err(error) => {
                Words::new(format_args!("simulated: {} is not possible: {error}", self.words(&happening)))
            }
        })
    }

    fn happen(&self, happening: &Happening) -> Result<(), BodyError> {
        match *happening {
            Happening::Push { force_n: [fx_n, fy_n], moment_nm, frame } => {
                let push = Wrench { fx_n, fy_n, moment_n_m: moment_nm };
                let mut machine = self.machine.lock();
                match frame {
                    PushFrame::Odom => machine.set_push(push),
                    PushFrame::Platform => machine.set_push_in_body(push),
                }
            }
            Happening::Payload { mass_kg, inertia_kg_m2, position_m, height_m } => {
                let height_m = height_m.or(self.table.payload_height_m).unwrap_or(PAYLOAD_HEIGHT_M);
                let yaw_inertia_kg_m2 = inertia_kg_m2.unwrap_or_else(|| disc_kg_m2(mass_kg, &self.wheels));
                self.machine.set_payload(Payload { mass_kg, yaw_inertia_kg_m2, position_m, height_m })?;
            }
            Happening::PayloadOfFile => self.machine.set_payload(payload(&self.table, &self.wheels))?,
            Happening::Floor { static_friction, sliding_friction } => {
                self.machine.lock().set_surface(Some(Surface { static_friction, sliding_friction }))?;
            }
            Happening::FloorOfFile => self.machine.lock().set_surface(None)?,
            Happening::TorqueRatio { wheel, ratio } => self.machine.lock().set_torque_ratio(wheel, ratio),
            Happening::TorqueRatioOfFile { wheel } => {
                self.machine.lock().set_torque_ratio(wheel, torque_ratio(&self.table, wheel));
            }
            Happening::DriveFault { wheel, error_code } => {
                self.inject(wheel, ApplicationFault::DriveFault(error_code).into());
            }
            Happening::SafeTorqueOff { wheel, is_off } => {
                self.inject(wheel, ApplicationFault::SafeTorqueOff(is_off).into());
            }
            Happening::Supply { wheel, is_on } => {
                self.inject(wheel, if is_on { Fault::PowerOn } else { Fault::PowerOff });
            }
        }
        Ok(())
    }

    fn inject(&self, wheel: usize, fault: Fault) {
        if let Some(position) = self.positions.get(wheel) {
            self.injector.inject(*position, fault);
        }
    }

    fn words(&self, happening: &Happening) -> Words {
        let name = |wheel: usize| self.names.get(wheel).map_or("?", String::as_str);
        match *happening {
            Happening::Push { force_n: [0.0, 0.0], moment_nm: 0.0, .. } => "simulated: the push ends".into(),
            Happening::Push { force_n: [fx_n, fy_n], moment_nm, frame } => {
                let axes = match frame {
                    PushFrame::Odom => "odom",
                    PushFrame::Platform => "the platform",
                };
                Words::new(format_args!(
                    "simulated: a push of {fx_n} N, {fy_n} N in the axes of {axes}, and {moment_nm} N·m"
                ))
            }
            Happening::Payload { mass_kg, position_m: [x_m, y_m], .. } => {
                Words::new(format_args!("simulated: a payload of {mass_kg} kg at {x_m} m, {y_m} m"))
            }
            Happening::PayloadOfFile => "simulated: the payload is as before".into(),
            Happening::Floor { static_friction, sliding_friction } => Words::new(format_args!(
                "simulated: the floor's friction is {static_friction:.3} sticking, {sliding_friction:.3} sliding"
            )),
            Happening::FloorOfFile => "simulated: the floor is as before".into(),
            Happening::TorqueRatio { wheel, ratio } => Words::new(format_args!(
                "simulated: the motor of {} gives {ratio} of its torque",
                name(wheel)
            )),
            Happening::TorqueRatioOfFile { wheel } => {
                Words::new(format_args!("simulated: the motor of {} is as before", name(wheel)))
            }
            Happening::DriveFault { wheel, error_code } => {
                Words::new(format_args!("simulated: {} fails with error 0x{error_code:04X}", name(wheel)))
            }
            Happening::SafeTorqueOff { wheel, is_off: true } => {
                Words::new(format_args!("simulated: STO takes the torque of {}", name(wheel)))
            }
            Happening::SafeTorqueOff { wheel, is_off: false } => {
                Words::new(format_args!("simulated: STO of {} is over", name(wheel)))
            }
            Happening::Supply { wheel, is_on: false } => {
                Words::new(format_args!("simulated: {} loses its supply", name(wheel)))
            }
            Happening::Supply { wheel, is_on: true } => {
                Words::new(format_args!("simulated: {} has its supply again", name(wheel)))
            }
        }
    }
}

/// Position of each wheel's drive on the simulated bus.
fn positions(plan: &RobotPlan) -> Vec<usize> {
    let line = line(plan);
    let of = |wheel| line.iter().position(|other| *other == Member::Wheel(wheel)).unwrap_or(usize::MAX);
    (0..plan.drives.len()).map(of).collect()
}
