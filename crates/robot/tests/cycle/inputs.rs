//! Signals beside the drives: aged, believed or not, seen and told by stages; the robot stops by those that it lacks.

use std::sync::{Arc, Mutex};

use omnibase_robot::devices::Cia402Device;
use omnibase_robot::registry::{Key, Kind, PeripheralDefaults, needed};
use omnibase_robot::signals::{
    Commands, CycleTime, DriveMeasurement, DriveProgress, Inputs, Outputs, Phase, PlatformState, Quantity,
    RequestAnswer, SafetyAction, SafetyReason, Setpoint, StopCategory,
};
use omnibase_robot::stages::{Controller, Device, DriveCommand, Estimator, Observation, Peripheral};
use omnibase_robot::{CycleRecord, Exchange, ImageBuffer, Registry, RequestKind, Robot};

use crate::support::{Bench, kind, plan, plan_with};

const IO: &str = include_str!("../../../../robots/bmm_io.toml");
/// Places in the robot's file.
const BUTTONS: usize = 1;
const SUPPLY: usize = 3;
const WITHOUT_BUTTONS: Exchange = Exchange::Without { wheels: 0, devices: 1 << BUTTONS };

fn bench(text: &str) -> Bench {
    let mut bench = Bench::new(plan(text));
    bench.image.device_inputs[BUTTONS][0] = 0b01;
    bench
}

fn set(index: u32, value: f64) -> Option<RequestKind> {
    Some(RequestKind::SetOutput { index, value })
}

#[test]
fn an_input_that_isnt_heard_grows_old_and_then_stops_as_if_it_were_set() {
    // What is lost alone ramps down, so that the input's own reason is told.
    for (safety, reason) in [
        ("stop_input = \"buttons.stop\"", SafetyReason::StopInput),
        ("enable_input = \"buttons.released\"", SafetyReason::EnableInput),
    ] {
        let (both, _) = IO.split_once("[safety]").unwrap();
        let rest = IO.split_once("[controller]").unwrap().1;
        let text = format!(
            "{both}[safety]\n{safety}\ninput_stop = \"category_0\"\non_lost_device = \"ramp\"\n[controller]{rest}"
        );
        let mut bench = bench(&text);
        bench.enable();
        bench.exchange = WITHOUT_BUTTONS;
        for missed in 1..=3 {
            let signals = bench.step(None).signals;
            assert!((signals.ages_s[BUTTONS] - 1e-3 * f64::from(missed)).abs() < 1e-12);
            assert_eq!(signals.believed, 0b111, "as long as lost exchanges are tolerated");
            assert_eq!(bench.robot.phase(), Phase::Holding);
        }
        let record = bench.step(None);
        assert_eq!(record.signals.believed, 0b100, "the voltage is still heard");
        assert_eq!(record.signals.inputs[..2], [1.0, 0.0], "the last that was heard");
        assert_eq!((bench.robot.phase(), record.stop_reason), (Phase::Fault, reason));
        // Nor is it enabled while nothing is heard.
        bench.step(Some(RequestKind::Acknowledge));
        let refused = match reason {
            SafetyReason::StopInput => RequestAnswer::StopInput,
            _ => RequestAnswer::EnableInput,
        };
        assert_eq!(bench.step(Some(RequestKind::Enable)).answer, refused);
        bench.exchange = Exchange::Complete;
        bench.step(None);
        assert_eq!(bench.step(Some(RequestKind::Enable)).answer, RequestAnswer::Taken);
    }
}

#[test]
fn the_loss_of_a_subdevice_without_a_wheel_is_a_loss_that_may_come_back() {
    let mut bench = bench(IO);
    bench.enable();
    bench.exchange = WITHOUT_BUTTONS;
    bench.run(4);
    let record = bench.run(1);
    // Of two stops the harder one tells its reason: the loss, whatever the input says meanwhile.
    assert_eq!((record.stop_reason, record.stop_where), (SafetyReason::DeviceLost, 8 + BUTTONS as u64));
}

#[test]
fn nothing_is_believed_before_it_was_heard() {
    let mut bench = bench(IO);
    bench.exchange = Exchange::Lost;
    let record = bench.step(Some(RequestKind::Enable));
    assert_eq!((record.answer, record.signals.believed), (RequestAnswer::StopInput, 0));
    assert!(record.signals.ages_s[..4].iter().all(|age_s| age_s.is_infinite()));
}

#[test]
fn a_stop_by_an_input_is_kept_until_a_person_acknowledges() {
    for (text, category) in [
        (IO.to_owned(), StopCategory::RampThenRemove),
        (IO.replace("[safety]", "[safety]\ninput_stop = \"category_0\""), StopCategory::RemoveTorque),
    ] {
        let mut bench = bench(&text);
        bench.enable();
        bench.step(Some(RequestKind::Track));
        bench.image.device_inputs[BUTTONS][0] = 0b11;
        let record = bench.step(None);
        assert_eq!((record.allowed.reason, record.allowed.where_index), (SafetyReason::StopInput, 1));
        assert_eq!(record.allowed.action, SafetyAction::Stop(category));
        // For one cycle alone.
        bench.image.device_inputs[BUTTONS][0] = 0b01;
        bench.run(500);
        assert_eq!(bench.robot.phase(), Phase::Fault);
        assert_eq!(bench.step(Some(RequestKind::Enable)).answer, RequestAnswer::WrongPhase);
    }
}

#[test]
fn outputs_go_where_the_file_says_in_every_stop_that_takes_torque() {
    use StopCategory::{RampAndHold, RampThenRemove, RemoveTorque};
    let stop = |category| Some(RequestKind::Stop(category));
    for (request, kept) in
        [(stop(RemoveTorque), false), (stop(RampThenRemove), false), (stop(RampAndHold), true)]
    {
        let mut bench = bench(IO);
        bench.enable();
        assert_eq!(bench.step(set(0, 1.0)).answer, RequestAnswer::Taken);
        assert_eq!(bench.step(set(1, 0.0)).answer, RequestAnswer::Taken);
        assert_eq!(bench.run(1).signals.outputs[..3], [1.0, 0.0, 0.0]);
        assert_eq!(bench.image.device_outputs[2], [0b001]);
        let record = bench.step(request);
        let (expected, byte) = if kept { ([1.0, 0.0, 0.0], 0b001) } else { ([0.0, 1.0, 0.0], 0b010) };
        assert_eq!(record.signals.outputs[..3], expected, "{request:?}");
        assert_eq!(bench.image.device_outputs[2], [byte], "{request:?}");
        assert_eq!(bench.run(300).signals.outputs[..3], expected, "{request:?}: nor does it come back");
    }
}

#[test]
fn a_stop_of_a_robot_that_stands_without_torque_lets_outputs_go_too() {
    let mut bench = bench(IO);
    bench.run(3);
    assert_eq!(bench.step(set(0, 1.0)).answer, RequestAnswer::Taken);
    assert_eq!(bench.run(1).signals.outputs[..2], [1.0, 1.0]);
    bench.step(Some(RequestKind::Stop(StopCategory::RemoveTorque)));
    assert_eq!(bench.run(3).signals.outputs[..2], [0.0, 1.0]);
}

#[test]
fn what_was_set_before_a_loss_does_not_come_back_with_its_terminal() {
    const LAMPS: u16 = 1 << 2;
    let mut bench = bench(IO);
    bench.run(3);
    assert_eq!(bench.step(set(0, 1.0)).answer, RequestAnswer::Taken);
    assert_eq!(bench.run(3).signals.outputs[..2], [1.0, 1.0]);
    bench.exchange = Exchange::Without { wheels: 0, devices: LAMPS };
    bench.run(20);
    bench.exchange = Exchange::Complete;
    assert_eq!(bench.run(3).signals.outputs[..2], [0.0, 1.0]);
}

/// An estimator and a controller that look at an input, and a controller that tells an output.
struct Looking(Arc<Mutex<Vec<Option<f64>>>>);

impl Estimator for Looking {
    fn reset(&mut self, _: &PlatformState) {}
    fn update(&mut self, observation: &Observation<'_>) -> PlatformState {
        self.0.lock().unwrap().push(observation.inputs.value("supply.voltage"));
        PlatformState { pose_known: true, ..PlatformState::default() }
    }
    fn sees_beyond_wheels(&self) -> bool {
        true
    }
}

#[derive(Default)]
struct Horn(f64);

impl Controller for Horn {
    fn quantity(&self) -> Quantity {
        Quantity::Speed
    }
    fn signals(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) {
        self.0 = inputs.value("supply.voltage").unwrap_or(0.0);
        assert_eq!(inputs.value("supply.current"), None);
        assert!(!outputs.set("lamps.blue", 1.0) && !outputs.set("lamps.horn", f64::NAN));
        if self.0 > 20.0 {
            assert!(outputs.set("lamps.horn", 1.0));
            // A lamp is on or off.
            outputs.set("lamps.green", 2.0);
        }
    }
    fn update(&mut self, _: &CycleTime, _: &PlatformState, _: &Setpoint) -> Commands {
        Commands { quantity: Quantity::Speed, ..Commands::default() }
    }
}

#[test]
fn stages_see_inputs_and_set_outputs_and_all_is_computed_again_to_the_bit() {
    let mut registry = Registry::with_built_in();
    let seen = Arc::new(Mutex::new(Vec::new()));
    let shared = seen.clone();
    registry.estimators.add(kind("looking"), move |_| Ok(Looking(shared.clone())));
    registry.controllers.add(kind("horn"), |_| Ok(Horn::default()));
    let text =
        IO.replace("kind = \"closed_loop_speed\"", "kind = \"horn\"").replace("mass_kg = 70.0   ", "#");
    let text = text.replace("inertia_kg_m2 = 7.0\n\n[sim", "\n[estimator]\nkind = \"looking\"\n[sim");
    let plan = plan_with(&text, &registry);
    let mut bench = Bench::with_registry(plan.clone(), &registry);
    bench.image.device_inputs[BUTTONS][0] = 0b01;
    let mut records: Vec<CycleRecord> = Vec::new();
    for cycle in 0..400_u16 {
        let request = match cycle {
            1 => Some(RequestKind::Enable),
            100 => set(2, 0.0),
            _ => None,
        };
        // 30 V from cycle 200 on; every seventh exchange is without the supply.
        let counts: i16 = if cycle < 200 { 100 } else { 19660 };
        bench.image.device_inputs[SUPPLY][1..3].copy_from_slice(&counts.to_le_bytes());
        bench.exchange = match cycle % 7 {
            6 => Exchange::Without { wheels: 0, devices: 1 << SUPPLY },
            _ => Exchange::Complete,
        };
        records.push(bench.step(request));
    }
    assert_eq!(bench.robot.phase(), Phase::Holding);
    let volts = |cycle: usize| seen.lock().unwrap()[cycle].unwrap();
    assert!((volts(50) - 0.1526).abs() < 1e-3 && (volts(300) - 30.0).abs() < 1e-2);
    assert_eq!([150, 300].map(|cycle: usize| records[cycle].signals.outputs[2]), [0.0, 1.0]);
    assert_eq!(records[300].signals.outputs[0], 0.0, "what it can't be told counts as if nobody had");
    // Its inputs come from the record alone.
    let mut again = Robot::build(&plan, &registry).unwrap();
    let mut image = ImageBuffer::new(&plan);
    for record in &records {
        let computed = again.replay(record, &mut image);
        assert_eq!(computed, record, "cycle {}", record.time.index);
    }
}

/// A gyroscope of one's own: it counts, and knows its rate after two readings.
#[derive(Default)]
struct Gyro(Option<u8>);

impl Peripheral for Gyro {
    fn read(&mut self, time: &CycleTime, bytes: &[u8], inputs: &mut [f64]) {
        let before = self.0.replace(bytes[0]);
        let rate = |before: u8| f64::from(bytes[0].wrapping_sub(before) as i8) / time.period_s();
        inputs[0] = before.map_or(f64::NAN, rate);
    }
}

#[test]
fn a_users_kind_brings_its_maps_and_signals_and_no_number_isnt_believed() {
    let mut registry = Registry::with_built_in();
    let keys: Vec<Key> = vec![needed("range").number("Range, rad/s", 1.0..=100.0)];
    let bmm = plan(IO);
    let defaults = PeripheralDefaults {
        inputs: vec![omnibase_robot::config::PdoPlan {
            index: 0x1A00,
            entries: omnibase_robot::config::parse_map("6000.1:8").unwrap(),
        }],
        input: vec![omnibase_robot::config::InputPlan {
            name: "rate".into(),
            unit: "rad/s".into(),
            coding: None,
            simulated: None,
        }],
        ..PeripheralDefaults::default()
    };
    let meaning = "A gyroscope";
    registry.peripherals.add(Kind { name: "gyro", meaning, keys }, defaults, |_| Ok(Gyro::default()));
    let table = "[[device]]\nname = \"gyro\"\nposition = 7\nkind = \"gyro\"\ncustom.range = 10\n[platform]";
    let plan = plan_with(&IO.replace("[platform]", table), &registry);
    assert_eq!(plan.signals().inputs.last().unwrap().name, "gyro.rate");
    assert_eq!(plan.signals().inputs.len(), bmm.signals().inputs.len() + 1);
    let mut bench = Bench::with_registry(plan, &registry);
    assert_eq!(bench.step(None).signals.believed >> 3, 0, "it isn't a number yet");
    bench.image.device_inputs[4][0] = 3;
    let signals = bench.step(None).signals;
    assert_eq!((signals.believed >> 3, signals.inputs[3]), (1, 3000.0));
}

/// A drive that says by a lamp when its supply is above 20 V.
struct SaysSupply(Cia402Device);

impl Device for SaysSupply {
    fn read(&mut self, time: &CycleTime, inputs: &[u8]) -> DriveMeasurement {
        self.0.read(time, inputs)
    }
    fn signals(&mut self, inputs: &Inputs<'_>, outputs: &mut Outputs<'_>) {
        if inputs.value("supply.voltage").is_some_and(|volts| volts > 20.0) {
            assert!(outputs.set("lamps.green", 1.0));
        }
    }
    fn write(&mut self, time: &CycleTime, command: &DriveCommand, outputs: &mut [u8]) -> DriveProgress {
        self.0.write(time, command, outputs)
    }
}

/// A display beside the drives that shows whole volts.
#[derive(Default)]
struct Voltmeter(f64);

impl Peripheral for Voltmeter {
    fn signals(&mut self, inputs: &Inputs<'_>, _: &mut Outputs<'_>) {
        self.0 = inputs.value("supply.voltage").unwrap_or(0.0);
    }
    fn write(&mut self, _: &CycleTime, _: &[f64], bytes: &mut [u8]) {
        bytes[0] = self.0.round() as u8;
    }
}

#[test]
fn drives_and_other_subdevices_see_inputs_and_drives_tell_outputs() {
    let mut registry = Registry::with_built_in();
    let (_, sgdv) = registry.devices.find(Some("sgdv")).unwrap();
    let defaults = sgdv.defaults.clone();
    let device = |plan: &_| Ok(SaysSupply(Cia402Device::new(plan)?));
    registry.devices.add(kind("says_supply"), defaults, device);
    let defaults = PeripheralDefaults {
        outputs: vec![omnibase_robot::config::PdoPlan {
            index: 0x1600,
            entries: omnibase_robot::config::parse_map("7000.1:8").unwrap(),
        }],
        ..PeripheralDefaults::default()
    };
    registry.peripherals.add(kind("voltmeter"), defaults, |_| Ok(Voltmeter::default()));
    let table = "[[device]]\nname = \"display\"\nposition = 7\nkind = \"voltmeter\"\n[platform]";
    let text = IO.replace("[platform]", table).replace("device = \"sgdv\"", "device = \"says_supply\"");
    let plan = plan_with(&text, &registry);
    let mut bench = Bench::with_registry(plan.clone(), &registry);
    bench.image.device_inputs[BUTTONS][0] = 0b01;
    let mut records: Vec<CycleRecord> = Vec::new();
    for cycle in 0..400_u16 {
        // 30 V from cycle 200 on.
        let counts: i16 = if cycle < 200 { 100 } else { 19660 };
        bench.image.device_inputs[SUPPLY][1..3].copy_from_slice(&counts.to_le_bytes());
        let request = (cycle == 1).then_some(RequestKind::Enable);
        records.push(bench.step(request));
        let shown = bench.image.device_outputs.last().unwrap()[0];
        assert_eq!(shown, if cycle < 200 { 0 } else { 30 }, "cycle {cycle}");
    }
    assert_eq!([150, 300].map(|cycle: usize| records[cycle].signals.outputs[0]), [0.0, 1.0]);
    // A robot that lets go of its drives lets go of the outputs.
    bench.step(Some(RequestKind::Stop(StopCategory::RemoveTorque)));
    assert_eq!(bench.run(2).signals.outputs[0], 0.0);
    let mut again = Robot::build(&plan, &registry).unwrap();
    let mut image = ImageBuffer::new(&plan);
    for record in &records {
        assert_eq!(again.replay(record, &mut image), record, "cycle {}", record.time.index);
    }
}

/// One that is told what it shall do once.
#[derive(Default)]
struct ToldOnce(bool);

impl Peripheral for ToldOnce {
    fn write(&mut self, _: &CycleTime, _: &[f64], bytes: &mut [u8]) {
        if !std::mem::replace(&mut self.0, true) {
            bytes[0] = 7;
        }
    }
}

#[test]
fn what_a_kind_wrote_last_is_there_when_it_writes_again() {
    let mut registry = Registry::with_built_in();
    let defaults = PeripheralDefaults {
        outputs: vec![omnibase_robot::config::PdoPlan {
            index: 0x1600,
            entries: omnibase_robot::config::parse_map("7000.1:8").unwrap(),
        }],
        ..PeripheralDefaults::default()
    };
    registry.peripherals.add(kind("told_once"), defaults, |_| Ok(ToldOnce::default()));
    let table = "[[device]]\nname = \"told\"\nposition = 7\nkind = \"told_once\"\n[platform]";
    let mut bench = Bench::with_registry(plan_with(&IO.replace("[platform]", table), &registry), &registry);
    bench.step(None);
    assert_eq!(bench.image.device_outputs[4], [7]);
    // Nothing is left of it where a SubDevice is away: a replay, which knows of no bus, must come out the same.
    bench.image.device_outputs[4].fill(0);
    bench.step(None);
    assert_eq!(bench.image.device_outputs[4], [7]);
}
