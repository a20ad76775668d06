//! The whole simulated robot, moved by frames alone.

mod main_device;

use main_device::{Input, MainDevice};
use omnibase_ethercat_sim::device::drive::DriveKind;
use omnibase_ethercat_wire::HostTime;
use omnibase_robot_sim::machine::DEFAULT_STEP_NS;
use omnibase_robot_sim::{
    BodyParameters, Contact, DriveStation, Floor, MachineParameters, MotorParameters, Payload, RobotSim,
    RobotSimDescription, RobotSimError, SharedMachine, WheelDrive, WheelParameters,
};
use std::f64::consts::TAU;

const HALF_SQRT3: f64 = 0.866_025_403_784_438_6;
const COUNTS_PER_RAD: f64 = 1_048_576.0 / TAU;
const CSV: i8 = 9;
const CST: i8 = 10;
const CYCLE_NS: u64 = 1_000_000;

fn description(contact: Contact) -> RobotSimDescription {
    let p = 0.35;
    let wheel = |position, rolling| WheelDrive {
        wheel: WheelParameters { contact, ..WheelParameters::omni(position, rolling, 0.1) },
        motor: MotorParameters::default(),
    };
    let machine = MachineParameters {
        body: BodyParameters {
            mass_kg: 100.0,
            yaw_inertia_kg_m2: 8.0,
            center_of_mass_m: [0.0, 0.0],
            center_of_mass_height_m: 0.4,
        },
        payload: Payload::default(),
        floor: Floor::default(),
        wheels: vec![
            wheel([-p, 0.0], [0.0, 1.0]),
            wheel([0.5 * p, -HALF_SQRT3 * p], [-HALF_SQRT3, -0.5]),
            wheel([0.5 * p, HALF_SQRT3 * p], [HALF_SQRT3, -0.5]),
        ],
        step_ns: DEFAULT_STEP_NS,
        wires: Vec::new(),
    };
    let drives = (0..3).map(|wheel| DriveStation::new(DriveKind::Generic, wheel)).collect();
    RobotSimDescription { machine, drives }
}

fn bring_up(description: &RobotSimDescription, mode: i8) -> (MainDevice, SharedMachine) {
    let robot = RobotSim::new(description).expect("a sound robot");
    let (segment, machine) = robot.into_line().expect("a line");
    (MainDevice::bring_up(segment, mode, CYCLE_NS), machine)
}

fn counts_s(rad_s: f64) -> i32 {
    (rad_s * COUNTS_PER_RAD).round() as i32
}

#[test]
fn three_equal_speeds_turn_it_clockwise_on_the_spot() {
    let (mut main, machine) = bring_up(&description(Contact::ideal(0.5)), CSV);
    for ms in 0..3000 {
        let speed = 2.0 * (f64::from(ms) / 500.0).min(1.0);
        main.outputs.iter_mut().for_each(|output| output.speed_counts_s = counts_s(speed));
        main.cycle();
    }
    let truth = machine.truth();
    assert!((truth.twist_in_body.w_rad_s + 2.0 * 0.1 / 0.35).abs() < 1e-3, "{truth:?}");
    // Three drives alike on a symmetric machine move alike, though they run one after the other; the frame reaches
    // each 0.3 us after the one before, which at 2 rad/s is 6e-7 rad.
    let angles: Vec<f64> = machine.lock().body().wheels().iter().map(|wheel| wheel.angle_rad).collect();
    assert!(angles[0] > 4.0, "{angles:?}");
    assert!(angles.iter().all(|angle| (angle - angles[0]).abs() < 2e-6), "{angles:?}");
    assert!(truth.pose.x_m.hypot(truth.pose.y_m) < 1e-6, "{truth:?}");
}

#[test]
fn the_encoders_show_the_truth_of_the_time_before_to_a_count() {
    let (mut main, machine) = bring_up(&description(Contact::default()), CSV);
    let start: Vec<i32> = main.inputs.iter().map(|input| input.position).collect();
    let turned = |machine: &SharedMachine| -> Vec<f64> {
        let machine = machine.lock();
        (0..3).map(|wheel| machine.shaft(wheel).angle_rad).collect()
    };
    assert!(start.iter().all(|position| *position != 0) && start[0] != start[1], "{start:?}");
    let zero = turned(&machine);
    let mut before = zero.clone();
    for ms in 0..2000 {
        let t = f64::from(ms) * 1e-3;
        for (i, output) in main.outputs.iter_mut().enumerate() {
            output.speed_counts_s = counts_s(3.0 * (2.0 * t + i as f64).sin() * t.min(1.0));
        }
        main.cycle();
        for i in 0..3 {
            let shown = f64::from(main.inputs[i].position - start[i]);
            let exact = (before[i] - zero[i]) * COUNTS_PER_RAD;
            // One count of rounding at each end, and a microsecond between first and last drive at 3 rad/s.
            assert!((shown - exact).abs() < 3.0, "ms {ms} wheel {i}: {shown} {exact}");
        }
        before = turned(&machine);
        let late_ns = machine.truth().time_ns.abs_diff(main.now_ns);
        assert!(late_ns < 5_000, "the truth is {late_ns} ns from the frame");
    }
    let moved: f64 = machine.truth().pose.x_m.hypot(machine.truth().pose.y_m);
    assert!(moved > 0.005, "{moved}");
}

#[test]
fn torque_arrives_as_asked_and_is_shown_as_it_is() {
    let (mut main, machine) = bring_up(&description(Contact::ideal(0.5)), CST);
    // 2.1 N·m on every wheel.
    main.outputs.iter_mut().for_each(|output| output.torque_permille = -300);
    main.cycle();
    // One cycle later the current loop has done its work: 1 − e^(−0.875 ms/0.16 ms), no other lag is in the way.
    main.cycle();
    let torque = machine.lock().motors()[0].torque_n_m();
    assert!((-2.1..-2.08).contains(&torque), "{torque}");
    (0..200).for_each(|_| main.cycle());
    let motors: Vec<f64> = machine.lock().motors().iter().map(|motor| motor.torque_n_m()).collect();
    assert!(motors.iter().all(|torque| (torque + 2.1).abs() < 1e-6), "{motors:?}");
    assert!(main.inputs.iter().all(|input| input.torque_permille == -300), "{:?}", main.inputs);
    assert!(machine.truth().twist_in_body.w_rad_s > 0.1);
}

#[test]
fn a_hot_motor_gives_less_and_the_drive_shows_it() {
    let mut description = description(Contact::ideal(0.9));
    for drive in &mut description.machine.wheels {
        drive.motor.heating_time_constant_s = 2.0;
        // So heavy that it hardly moves.
        drive.wheel.inertia_kg_m2 = 1e4;
    }
    let (mut main, machine) = bring_up(&description, CST);
    main.outputs.iter_mut().for_each(|output| output.torque_permille = 2000);
    (0..20).for_each(|_| main.cycle());
    assert!(main.inputs.iter().all(|input| input.torque_permille == 2000), "{:?}", main.inputs);
    (0..20_000).for_each(|_| main.cycle());
    let (limit, temperature) = {
        let machine = machine.lock();
        (machine.motors()[0].thermal_limit_n_m(), machine.motors()[0].winding_temperature_c())
    };
    assert!(limit < 7.2 && (temperature - 105.0).abs() < 2.0, "{limit} N·m at {temperature} °C");
    let shown = f64::from(main.inputs[0].torque_permille) * 7e-3;
    assert!((shown - limit).abs() < 0.01, "{shown} N·m shown, {limit} N·m allowed");
}

#[test]
fn wheels_stop_when_the_bus_falls_silent() {
    for mode in [CSV, CST] {
        let (mut main, machine) = bring_up(&description(Contact::default()), mode);
        for output in &mut main.outputs {
            (output.speed_counts_s, output.torque_permille) = (counts_s(3.0), 500);
        }
        (0..500).for_each(|_| main.cycle());
        assert!(machine.truth().twist_in_body.w_rad_s < -0.5, "{:?}", machine.truth());
        // After the watchdog (100 ms) the drives let go and don't look at the machine any more: it coasts.
        main.now_ns += 200_000_000;
        main.segment.advance(HostTime(main.now_ns));
        assert!(machine.lock().motors().iter().all(|motor| motor.asked_n_m() == 0.0), "mode {mode}");
        machine.lock().advance(main.now_ns + 10_000_000_000);
        assert!(machine.lock().body().at_rest(), "mode {mode}: {:?}", machine.truth());
    }
}

#[test]
fn a_payload_put_on_while_driving_slows_nothing_at_once_and_loads_the_floor() {
    let (mut main, machine) = bring_up(&description(Contact::default()), CSV);
    let speed = counts_s(2.0);
    (main.outputs[1].speed_counts_s, main.outputs[2].speed_counts_s) = (-speed, speed);
    (0..1500).for_each(|_| main.cycle());
    let before = machine.truth();
    let payload = Payload { mass_kg: 100.0, yaw_inertia_kg_m2: 4.0, position_m: [0.0, 0.0], height_m: 0.6 };
    machine.set_payload(payload).expect("it stands");
    (0..1000).for_each(|_| main.cycle());
    let after = machine.truth();
    assert!((before.twist_in_body.vx_m_s - after.twist_in_body.vx_m_s).abs() < 2e-3, "{before:?} {after:?}");
    let load: f64 = machine.lock().body().wheels().iter().map(|wheel| wheel.normal_load_n).sum();
    assert!((load - 200.0 * 9.806_65).abs() < 1.0, "{load}");
}

#[test]
fn the_same_commands_give_the_same_bits() {
    let record = || {
        let (mut main, machine) = bring_up(&description(Contact::default()), CSV);
        let mut inputs: Vec<Input> = Vec::new();
        for ms in 0..500 {
            let t = f64::from(ms) * 1e-3;
            for (i, output) in main.outputs.iter_mut().enumerate() {
                output.speed_counts_s = counts_s(8.0 * (20.0 * t + i as f64).sin());
            }
            main.cycle();
            inputs.extend(&main.inputs);
        }
        let pose = machine.truth().pose;
        (inputs, [pose.x_m.to_bits(), pose.y_m.to_bits(), pose.heading_rad.to_bits()])
    };
    assert_eq!(record(), record());
}

#[test]
fn drives_without_wheel_and_wheels_with_two_drives_are_refused() {
    let mut far = description(Contact::default());
    far.drives[2].wheel = 3;
    let text = RobotSim::new(&far).expect_err("refused").to_string();
    assert_eq!(text, "the drive at position 2 is for wheel 4, but there are 3 wheels");
    let mut twice = description(Contact::default());
    twice.drives[2].wheel = 0;
    let expected = RobotSimError::TwoDrives { wheel: 0, first: 0, second: 2 };
    assert_eq!(RobotSim::new(&twice).expect_err("refused"), expected);
}
