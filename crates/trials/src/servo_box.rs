//! A simulated servo on a wheel of the machine, and its process data as bytes: a SubDevice without its chip.

use omnibase_ethercat_sim::device::servo::Servo;
use omnibase_ethercat_sim::device::{Device, Moment, Outputs};
use omnibase_ethercat_sim::dictionary::Dictionary;
use omnibase_ethercat_sim::dictionary::pdo::{self, Direction, Layout};
use omnibase_ethercat_sim::dictionary::standard::PdoMap;
use omnibase_ethercat_wire::coe::ObjectAddress;
use omnibase_ethercat_wire::{AlState, AlStatusCode, HostTime};
use omnibase_robot::config::{DrivePlan, PdoPlan};
use omnibase_robot_sim::{DriveStation, MotorParameters, SharedMachine};

pub(crate) struct ServoBox {
    servo: Servo,
    dictionary: Dictionary,
    outputs: Layout,
    inputs: Layout,
    /// What its start-up writes, after each loss of power again.
    parameters: Vec<(ObjectAddress, Vec<u8>)>,
    is_powered: bool,
}

impl ServoBox {
    /// The servo of a wheel, in OP, with the plan's mapping.
    pub(crate) fn new(
        plan: &DrivePlan,
        station: &DriveStation,
        motor: &MotorParameters,
        machine: &SharedMachine,
    ) -> Self {
        let pdos: Vec<PdoMap> = plan.outputs.iter().chain(&plan.inputs).map(pdo_map).collect();
        let axis = machine.axis(station.wheel);
        let (servo, dictionary) = station.drive(motor).servo(&station.piece, &pdos, axis);
        let layout =
            |dictionary: &Dictionary, object, direction| match pdo::layout(dictionary, object, direction) {
                Ok(layout) => layout,
                Err(error) => panic!("the plan's mapping doesn't fit a servo: {error:?}"),
            };
        let outputs = layout(&dictionary, 0x1C12, Direction::Outputs);
        let inputs = layout(&dictionary, 0x1C13, Direction::Inputs);
        let parameters = plan.parameters.iter().map(|parameter| {
            (ObjectAddress::new(parameter.index, parameter.subindex), parameter.data.clone())
        });
        let parameters = parameters.collect();
        let mut servo = ServoBox { servo, dictionary, outputs, inputs, parameters, is_powered: false };
        servo.power_on(1);
        servo
    }

    /// It gets power, and the way to OP with its whole start-up.
    pub(crate) fn power_on(&mut self, now_ns: u64) {
        self.servo.power_on(&mut self.dictionary, HostTime(now_ns));
        for (address, data) in &self.parameters {
            self.dictionary.store(*address, data);
        }
        self.is_powered = true;
        self.back_in_op();
    }

    /// It loses its power: its motor turns freely.
    pub(crate) fn power_off(&mut self) {
        self.servo.power_off();
        self.is_powered = false;
    }

    /// What the drive measured at its last beat.
    pub(crate) fn read(&self, image: &mut [u8]) {
        self.inputs.put(&self.dictionary, image);
    }

    /// What the drive is to do from its next beat on.
    pub(crate) fn write(&mut self, image: &[u8]) {
        self.outputs.take(image, &mut self.dictionary);
    }

    /// A beat: takes the outputs, measures.
    pub(crate) fn beat(&mut self, now_ns: u64, cycle_ns: u64, outputs: Outputs) {
        let cycle_ns = u32::try_from(cycle_ns).ok();
        if !self.is_powered {
            return;
        }
        self.servo.run(&mut self.dictionary, Moment { now: HostTime(now_ns), outputs, cycle_ns });
    }

    /// Its process-data watchdog ran out: it falls back to SAFE-OP and does what 0x6007 says.
    pub(crate) fn watchdog_expires(&mut self) {
        if !self.is_powered {
            return;
        }
        let code = AlStatusCode(0x001B);
        self.servo.state_changed(&mut self.dictionary, AlState::SafeOp, code);
    }

    /// It fails by itself.
    pub(crate) fn fail(&mut self, error: u16) {
        if self.is_powered {
            self.servo.fault(&mut self.dictionary, error);
        }
    }

    /// It is in OP again, as after a recovery.
    pub(crate) fn back_in_op(&mut self) {
        self.servo.state_changed(&mut self.dictionary, AlState::Op, AlStatusCode(0));
    }

    /// When its inner loops run next between two beats, where anything comes of it.
    pub(crate) fn due_ns(&self) -> Option<u64> {
        let runs = self.is_powered && !self.servo.holds_torque();
        self.servo.due().filter(|_| runs).map(|due| due.0)
    }

    /// Its inner loops run.
    pub(crate) fn tick(&mut self, now_ns: u64) {
        if self.is_powered {
            self.servo.tick(&mut self.dictionary, HostTime(now_ns));
        }
    }
}

fn pdo_map(pdo: &PdoPlan) -> PdoMap {
    let entries = pdo.entries.iter();
    PdoMap {
        index: pdo.index,
        name: "PDO".into(),
        entries: entries.map(|entry| (ObjectAddress::new(entry.index, entry.subindex), entry.bits)).collect(),
    }
}
