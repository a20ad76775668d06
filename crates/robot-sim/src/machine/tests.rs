use super::*;
use crate::floor::Floor;
use crate::pose::Wrench;

const HALF_SQRT3: f64 = 0.866_025_403_784_438_6;

fn parameters() -> MachineParameters {
    let p = 0.35;
    let wheel = |position, rolling| WheelDrive {
        wheel: WheelParameters::omni(position, rolling, 0.1),
        motor: MotorParameters::default(),
    };
    MachineParameters {
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
    }
}

fn machine() -> Machine {
    Machine::new(&parameters()).expect("a sound machine")
}

const MS: u64 = 1_000_000;

#[test]
fn it_does_not_matter_how_often_it_is_asked() {
    let (mut once, mut often) = (machine(), machine());
    for ms in 0..500_u64 {
        for machine in [&mut once, &mut often] {
            machine.ask(1, -4.0 + 0.004 * ms as f64);
            machine.ask(2, 3.5);
        }
        once.advance((ms + 1) * MS);
        for part in 1..=7 {
            often.advance(ms * MS + part * MS / 7);
            often.advance(ms * MS);
        }
        often.advance((ms + 1) * MS);
    }
    assert!(once.truth().pose.x_m > 0.01);
    assert_eq!(once.truth(), often.truth());
    for i in 0..3 {
        assert_eq!(once.shaft(i), often.shaft(i));
    }
}

#[test]
fn a_rest_leaves_nothing_of_the_braking_before_it() {
    let (mut once, mut often) = (machine(), machine());
    for machine in [&mut once, &mut often] {
        for (until_ms, torque) in [(200, 10.0), (240, -12.0), (260, 0.0)] {
            machine.ask(1, -torque);
            machine.ask(2, torque);
            machine.advance(until_ms * MS);
        }
    }
    once.advance(5_000 * MS);
    (260..=5_000).for_each(|ms| often.advance(ms * MS));
    for machine in [&mut once, &mut often] {
        assert!(machine.body().at_rest());
        machine.ask(2, 4.0);
        machine.advance(5_001 * MS);
        let loads: Vec<f64> = machine.body().wheels().iter().map(|wheel| wheel.normal_load_n).collect();
        assert!(loads.iter().all(|load| (load - 100.0 * 9.806_65 / 3.0).abs() < 20.0), "{loads:?}");
    }
    assert_eq!(once.truth(), often.truth());
}

#[test]
fn between_the_points_of_the_grid_motion_goes_on() {
    let mut machine = machine();
    machine.ask(1, -3.0);
    machine.ask(2, 3.0);
    machine.advance(500 * MS);
    let (start, pose) = (machine.shaft(2), machine.truth().pose);
    machine.advance(500 * MS + 100_000);
    let (between, ahead) = (machine.shaft(2), machine.truth());
    assert_eq!(ahead.time_ns, 500 * MS + 100_000);
    assert!((between.angle_rad - start.angle_rad - 1e-4 * start.speed_rad_s).abs() < 1e-12);
    assert!((ahead.pose.x_m - pose.x_m - 1e-4 * ahead.twist_in_body.vx_m_s).abs() < 1e-12);
    // What is shown just before a point of the grid and at it differ by less than a count.
    machine.advance(500 * MS + 124_999);
    let before = machine.shaft(2).angle_rad;
    machine.advance(500 * MS + 125_001);
    let jump = machine.shaft(2).angle_rad - before - 2e-9 * start.speed_rad_s;
    assert!(jump.abs() < std::f64::consts::TAU / 1_048_576.0, "{jump}");
}

#[test]
fn a_gear_turns_speed_down_and_torque_up() {
    let mut geared = parameters();
    let direct = parameters();
    let mut slow = parameters();
    slow.wheels.iter_mut().for_each(|drive| drive.motor.gear_ratio = -5.0);
    let mut slow = Machine::new(&slow).expect("a sound machine");
    for drive in &mut geared.wheels {
        drive.motor.gear_ratio = -5.0;
        drive.motor.rated_speed_rad_s *= 5.0;
        drive.motor.maximum_speed_rad_s *= 5.0;
        drive.motor.rotor_inertia_kg_m2 = 0.0077 / 25.0;
    }
    let mut geared = Machine::new(&geared).expect("a sound machine");
    let mut direct = Machine::new(&direct).expect("a sound machine");
    for i in 0..3 {
        direct.ask(i, 1.0);
        geared.ask(i, -0.2);
    }
    direct.advance(1000 * MS);
    geared.advance(1000 * MS);
    let (a, b) = (direct.truth().pose.heading_rad, geared.truth().pose.heading_rad);
    assert!(a < -0.1 && (a - b).abs() < 1e-9, "{a} {b}");
    assert_eq!(direct.shaft(7), Shaft::default());
    assert!((geared.shaft(0).angle_rad + 5.0 * direct.shaft(0).angle_rad).abs() < 1e-8);
    assert!((25.0 * geared.nominal_inertia_kg_m2(0) - direct.nominal_inertia_kg_m2(0)).abs() < 1e-12);
    // The motor's own speed is what its voltage limits: 52.4 rad/s, five times the wheel's.
    (0..3).for_each(|i| slow.ask(i, -4.0));
    slow.advance(20_000 * MS);
    let speed = slow.body().wheels()[0].speed_rad_s;
    assert!((9.0..52.4 / 5.0).contains(&speed), "{speed}");
    // 100 kg on three wheels of 0.1 m, a disc of 2.5 kg and the rotor.
    assert!((direct.nominal_inertia_kg_m2(0) - (1.0 / 3.0 + 0.0125 + 0.0077)).abs() < 1e-12);
}

#[test]
fn a_long_rest_passes_at_once_and_as_if_in_steps() {
    let drive = |machine: &mut Machine, from_ms: u64| {
        for ms in from_ms..from_ms + 300 {
            machine.ask(1, -3.0);
            machine.ask(2, 3.0);
            machine.advance((ms + 1) * MS);
        }
        for i in 0..3 {
            machine.ask(i, 0.0);
        }
    };
    let mut machine = machine();
    drive(&mut machine, 0);
    machine.advance(60_000 * MS);
    let (pose, warm) = (machine.truth().pose, machine.motors()[1].thermal_load());
    assert!(machine.body().at_rest() && pose.x_m > 0.01, "{pose:?}");
    // A month in one call: were it done in steps, the test would not end.
    let month_ms = 30 * 24 * 3600 * 1000;
    machine.advance(month_ms * MS);
    assert_eq!(machine.truth().pose, pose);
    assert_eq!(machine.truth().time_ns, month_ms * MS);
    assert!(machine.motors()[1].thermal_load() < 1e-9 && warm > 1e-6);
    // And it still drives.
    drive(&mut machine, month_ms);
    assert!(machine.truth().pose.x_m > pose.x_m + 0.01);
}

#[test]
fn a_push_wakes_a_resting_machine() {
    let mut machine = machine();
    machine.advance(1000 * MS);
    assert_eq!(machine.truth().pose, Pose::default());
    machine.set_push(Wrench { fx_n: 200.0, ..Wrench::default() });
    machine.advance(1500 * MS);
    assert!(machine.truth().pose.x_m > 0.05, "{:?}", machine.truth());
    let payload = Payload { mass_kg: 50.0, height_m: 0.5, ..Payload::default() };
    machine.set_payload(payload).expect("it stands");
    assert_eq!(machine.body().payload(), payload);
}

#[test]
fn figures_without_meaning_are_refused() {
    let mut wrong = parameters();
    wrong.wheels[1].motor.peak_torque_n_m = 1.0;
    let text = Machine::new(&wrong).expect_err("refused").to_string();
    assert_eq!(text, "motor 2: peak_torque_n_m is 1; it must be at least rated_torque_n_m");
    let coarse = MachineParameters { step_ns: 5_000_000, ..parameters() };
    assert_eq!(Machine::new(&coarse).expect_err("refused"), MachineError::Step { step_ns: 5_000_000 });
    let mut unbalanced = parameters();
    unbalanced.payload = Payload { mass_kg: 300.0, position_m: [1.0, 0.0], ..Payload::default() };
    assert!(matches!(Machine::new(&unbalanced), Err(MachineError::Body(BodyError::TipsOver { .. }))));
}

#[test]
fn a_drive_turns_and_counts_what_its_wires_lead_to() {
    let mut wires: Vec<Wire> = (0..3).map(Wire::straight).collect();
    wires.swap(0, 1);
    wires[0].turns_motor = true;
    wires[2].turns_encoder = true;
    let mut machine = Machine::new(&MachineParameters { wires, ..parameters() }).unwrap();
    machine.ask(0, 2.0);
    machine.ask(2, 2.0);
    machine.advance(200_000_000);
    let speeds: Vec<f64> = machine.body().wheels().iter().map(|wheel| wheel.speed_rad_s).collect();
    // The first drive turns the second wheel backwards, and its encoder tells so; the third's counts against its motor.
    assert!(speeds[1] < -0.1 && speeds[2] > 0.1, "{speeds:?}");
    let seen: Vec<f64> = (0..3).map(|drive| machine.shaft(drive).speed_rad_s).collect();
    assert_eq!(seen, [speeds[1], speeds[0], -speeds[2]]);
    assert!(machine.shaft(0).torque_n_m > 1.9 && machine.motors()[1].torque_n_m() < -1.9);
}

#[test]
fn wires_lead_from_each_drive_to_a_motor_of_its_own() {
    let refused = |wheels: &[usize]| {
        let wires = wheels.iter().copied().map(Wire::straight).collect();
        Machine::new(&MachineParameters { wires, ..parameters() }).err()
    };
    for wheels in [&[0, 1][..], &[0, 1, 1], &[0, 1, 3]] {
        assert_eq!(refused(wheels), Some(MachineError::Wires { wheels: 3 }), "{wheels:?}");
    }
    assert_eq!(refused(&[2, 0, 1]), None);
}

/// How fast wheel 0 still swings, over its first speed, 50 ms after a speed loop that runs every 250 us began to hold it still,
/// with so many times the gain that a drive may have; on a floor without friction, so that the motor moves the wheel alone.
fn left_of_a_swing(lag_s: f64, times: f64) -> f64 {
    const LOOP_NS: u64 = 250_000;
    let mut slippery = parameters();
    for drive in &mut slippery.wheels {
        drive.motor.current_loop_s = lag_s;
        drive.wheel.bearing_coulomb_n_m = 0.0;
        drive.wheel.contact = crate::floor::Contact::ideal(0.0);
    }
    let mut machine = Machine::new(&slippery).expect("a sound machine");
    let gain = times * machine.greatest_speed_gain_n_m_s(0, LOOP_NS as f64 * 1e-9);
    machine.ask(0, 0.01);
    machine.advance(8 * LOOP_NS);
    let first = machine.shaft(0).speed_rad_s;
    let mut last = 0.0_f64;
    for step in 9..200 {
        let torque = -gain * machine.shaft(0).speed_rad_s;
        machine.ask(0, torque);
        machine.advance(step * LOOP_NS);
        last = if step > 180 { last.max(machine.shaft(0).speed_rad_s.abs()) } else { 0.0 };
    }
    last / first
}

#[test]
fn a_speed_loop_with_the_greatest_gain_holds_a_wheel_without_grip_with_6_db_to_spare() {
    for lag_us in [0.0, 20.0, 60.0, 110.0, 160.0, 300.0, 500.0] {
        let spare = left_of_a_swing(1e-6 * lag_us, 1.99);
        assert!(spare < 0.5, "{lag_us} us: {spare}");
    }
    // Three times as much rings away with a fast current loop; for the whole platform, 300 rad/s of 0.35 kg·m², it would be nearly two.
    let whole = 300.0 * machine().nominal_inertia_kg_m2(0);
    let alone = machine().greatest_speed_gain_n_m_s(0, 250e-6);
    assert!(left_of_a_swing(20e-6, 3.0) > 1.0 && whole > 1.5 * alone, "{whole} {alone}");
}
