//! A simulated servo on a wheel of the machine, and its process data as bytes: a SubDevice without its chip.

use omnibase_ethercat_sim::device::axis::{Axis, AxisState};
use omnibase_ethercat_sim::device::servo::{Encoder, Servo, ServoConfig};
use omnibase_ethercat_sim::device::{Device, Moment, Outputs};
use omnibase_ethercat_sim::dictionary::Dictionary;
use omnibase_ethercat_sim::dictionary::pdo::{self, Direction, Layout};
use omnibase_ethercat_sim::dictionary::standard::{Nameplate, PdoMap};
use omnibase_ethercat_wire::coe::ObjectAddress;
use omnibase_ethercat_wire::sii::Identity;
use omnibase_ethercat_wire::{AlState, AlStatusCode, HostTime};
use omnibase_robot::config::{DrivePlan, EncoderName};
use omnibase_robot_sim::{MotorParameters, SharedMachine};

/// One motor of the machine, as its servo knows it.
struct WheelAxis {
    machine: SharedMachine,
    wheel: usize,
}

impl Axis for WheelAxis {
    fn advance(&mut self, now: HostTime) -> AxisState {
        let mut machine = self.machine.lock();
        machine.advance(now.0);
        let shaft = machine.shaft(self.wheel);
        AxisState {
            position_rad: shaft.angle_rad,
            speed_rad_s: shaft.speed_rad_s,
            torque_n_m: shaft.torque_n_m,
        }
    }

    fn apply(&mut self, torque_n_m: f64) {
        self.machine.lock().ask(self.wheel, torque_n_m);
    }

    fn nominal_inertia_kg_m2(&self) -> f64 {
        self.machine.lock().nominal_inertia_kg_m2(self.wheel)
    }
}

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
        drive: &DrivePlan,
        motor: &MotorParameters,
        machine: SharedMachine,
        wheel: usize,
    ) -> Self {
        let config = ServoConfig {
            counts_per_revolution: drive.scale.counts_per_revolution,
            rated_torque_n_m: motor.rated_torque_n_m,
            peak_torque_n_m: motor.peak_torque_n_m,
            max_speed_rad_s: motor.maximum_speed_rad_s,
            // The current loop is the motor's, in the machine's fine steps.
            torque_time_constant_s: 0.0,
            // Any first value, one of them close to its wrap.
            initial_position: [2_147_480_000, -77_777, 123_456, 0][wheel % 4],
            encoder: match drive.encoder {
                EncoderName::Incremental => Encoder::Incremental,
                EncoderName::Absolute => Encoder::Absolute,
            },
            ..ServoConfig::default()
        };
        let maps = |pdos: &[omnibase_robot::config::PdoPlan]| -> Vec<PdoMap> {
            pdos.iter()
                .map(|pdo| PdoMap {
                    index: pdo.index,
                    name: "PDO".into(),
                    entries: pdo
                        .entries
                        .iter()
                        .map(|entry| (ObjectAddress::new(entry.index, entry.subindex), entry.bits))
                        .collect(),
                })
                .collect()
        };
        let pdos: Vec<PdoMap> = maps(&drive.outputs).into_iter().chain(maps(&drive.inputs)).collect();
        let nameplate = Nameplate {
            device_type: 0x0002_0192,
            name: "servo".into(),
            hardware_version: "1".into(),
            software_version: "1".into(),
            identity: Identity { vendor_id: 1, product_code: 1, revision: 1, serial: 1 },
        };
        let axis = Box::new(WheelAxis { machine, wheel });
        let (servo, dictionary) = Servo::new(config, &nameplate, &pdos, axis);
        let layout =
            |dictionary: &Dictionary, object, direction| match pdo::layout(dictionary, object, direction) {
                Ok(layout) => layout,
                Err(error) => panic!("the plan's mapping doesn't fit a servo: {error:?}"),
            };
        let outputs = layout(&dictionary, 0x1C12, Direction::Outputs);
        let inputs = layout(&dictionary, 0x1C13, Direction::Inputs);
        let parameters = drive.parameters.iter().map(|parameter| {
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

    /// When its inner loops run next between two beats.
    pub(crate) fn due_ns(&self) -> Option<u64> {
        self.servo.due().filter(|_| self.is_powered).map(|due| due.0)
    }

    /// Its inner loops run.
    pub(crate) fn tick(&mut self, now_ns: u64) {
        if self.is_powered {
            self.servo.tick(&mut self.dictionary, HostTime(now_ns));
        }
    }
}
