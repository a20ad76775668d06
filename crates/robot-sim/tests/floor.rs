//! Slopes, patches, pushes and motors that aren't as their data sheets say, against closed forms.

use omnibase_robot_sim::floor::GRAVITY_M_S2;
use omnibase_robot_sim::machine::DEFAULT_STEP_NS;
use omnibase_robot_sim::{
    Body, BodyError, BodyParameters, Contact, Floor, Machine, MachineParameters, MotorParameters, Patch,
    Payload, Pose, Region, Slope, Surface, Twist, Waves, WheelDrive, WheelParameters, Wrench,
};

const STEP_S: f64 = 125e-6;
const RADIUS_M: f64 = 0.1;
const MASS_KG: f64 = 100.0;
const HEIGHT_M: f64 = 0.2;

fn parameters() -> BodyParameters {
    BodyParameters {
        mass_kg: MASS_KG,
        yaw_inertia_kg_m2: 8.0,
        center_of_mass_m: [0.0, 0.0],
        center_of_mass_height_m: HEIGHT_M,
    }
}

/// Four wheels that all roll ahead, at the corners of 0.6 m by 0.4 m, without any loss.
fn wheels(contact: Contact) -> Vec<WheelParameters> {
    [[0.3, 0.2], [0.3, -0.2], [-0.3, 0.2], [-0.3, -0.2]]
        .map(|position_m| WheelParameters {
            inertia_kg_m2: 0.02,
            bearing_coulomb_n_m: 0.0,
            bearing_viscous_n_m_s: 0.0,
            contact,
            ..WheelParameters::omni(position_m, [1.0, 0.0], RADIUS_M)
        })
        .to_vec()
}

/// The same, with wheels that don't turn.
fn held(contact: Contact) -> Body {
    let mut wheels = wheels(contact);
    wheels.iter_mut().for_each(|wheel| wheel.bearing_coulomb_n_m = 1e6);
    Body::new(parameters(), &wheels).expect("a sound machine")
}

fn slope(angle_rad: f64, downhill_rad: f64) -> Floor {
    Floor { slope: Slope { angle_rad, downhill_rad }, ..Floor::default() }
}

fn run(body: &mut Body, torques_n_m: &[f64], seconds: f64) {
    for _ in 0..(seconds / STEP_S).round() as usize {
        body.step(torques_n_m, STEP_S);
    }
}

#[test]
fn a_held_robot_slides_down_a_slope_steeper_than_its_friction() {
    let (sticks, slides) = (0.5, 0.4);
    let contact = Contact { sliding_friction: slides, ..Contact::ideal(sticks) };
    for (angle_rad, moves) in [(0.999 * f64::atan(sticks), false), (1.001 * f64::atan(sticks), true)] {
        let mut body = held(contact);
        body.set_floor(slope(angle_rad, 0.0)).expect("it stands");
        run(&mut body, &[], 0.1);
        if !moves {
            assert!(body.at_rest() && body.pose().x_m == 0.0, "{:?}", body.twist_in_body());
            continue;
        }
        let before = body.twist_in_body().vx_m_s;
        run(&mut body, &[], 0.5);
        let acceleration = (body.twist_in_body().vx_m_s - before) / 0.5;
        let exact = GRAVITY_M_S2 * (angle_rad.sin() - slides * angle_rad.cos());
        assert!((acceleration / exact - 1.0).abs() < 1e-6, "{acceleration} {exact}");
    }
}

#[test]
fn standing_on_a_slope_takes_the_torque_of_its_downhill_force() {
    let angle_rad = 0.1;
    let mut body = Body::new(parameters(), &wheels(Contact::ideal(0.5))).expect("a sound machine");
    body.set_floor(slope(angle_rad, 0.0)).expect("it stands");
    let torque_n_m = -MASS_KG * GRAVITY_M_S2 * angle_rad.sin() * RADIUS_M / 4.0;
    run(&mut body, &[torque_n_m; 4], 2.0);
    assert!(body.pose().x_m.abs() < 1e-9, "{:?}", body.pose());
    // The weight shifts downhill: m·g·(cos/4 ± sin·h/(2·0.6)).
    let weight_n = MASS_KG * GRAVITY_M_S2;
    let shift_n = weight_n * angle_rad.sin() * HEIGHT_M / 1.2;
    for (wheel, side) in body.wheels().iter().zip([1.0, 1.0, -1.0, -1.0]) {
        let exact = weight_n * angle_rad.cos() / 4.0 + side * shift_n;
        assert!((wheel.normal_load_n - exact).abs() < 1e-9 * exact, "{} {exact}", wheel.normal_load_n);
    }
    // Let go it rolls: a = g·sin/(1 + 4·I/(R²·m)), and the loads are those of that acceleration.
    run(&mut body, &[0.0; 4], 0.5);
    let exact = GRAVITY_M_S2 * angle_rad.sin() / (1.0 + 4.0 * 0.02 / (RADIUS_M * RADIUS_M * MASS_KG));
    let found = body.twist_in_body().vx_m_s / 0.5;
    assert!((found / exact - 1.0).abs() < 1e-9, "{found} {exact}");
}

#[test]
fn downhill_is_a_direction_of_the_floor_and_not_of_the_robot() {
    // Turned by a quarter it rolls on its rollers, without friction across.
    let mut body = Body::new(parameters(), &wheels(Contact::ideal(0.5))).expect("a sound machine");
    body.set_pose(Pose { heading_rad: std::f64::consts::FRAC_PI_2, ..Default::default() });
    body.set_floor(slope(0.05, 0.0)).expect("it stands");
    run(&mut body, &[0.0; 4], 1.0);
    let twist = body.twist_in_body();
    assert!((twist.vy_m_s + GRAVITY_M_S2 * 0.05_f64.sin()).abs() < 1e-9, "{twist:?}");
    assert!(twist.vx_m_s.abs() < 1e-9 && body.pose().x_m > 0.2, "{twist:?}");
}

#[test]
fn a_slope_on_which_it_would_fall_over_is_refused() {
    let high = BodyParameters { center_of_mass_height_m: 0.8, ..parameters() };
    let mut body = Body::new(high, &wheels(Contact::ideal(0.9))).expect("a sound machine");
    // It falls over its longer side too where tan α is half the width over the height: 0.25.
    body.set_floor(slope(0.95 * f64::atan(0.2), 0.0)).expect("it stands");
    let refused = body.set_floor(slope(f64::atan(0.26), 0.0));
    assert!(matches!(refused, Err(BodyError::FallsOver { wheel: 1, .. })), "{refused:?}");
    let refused = body.set_floor(slope(-0.1, 0.0)).expect_err("refused").to_string();
    assert_eq!(refused, "floor: slope angle_rad is -0.1; it must be zero or positive, and below 1.5");
}

#[test]
fn a_patch_counts_for_the_wheels_that_are_on_it() {
    let contact = Contact::ideal(0.5);
    let ice = Surface { static_friction: 0.1, sliding_friction: 0.1 };
    let low = BodyParameters { center_of_mass_height_m: 0.0, ..parameters() };
    for (place, friction) in [
        // Under no wheel, under the two in front, under all of them.
        (Region::Disc { centre_m: [1.0, 0.0], radius_m: 0.7 }, 0.5),
        (Region::Rectangle { from_m: [0.2, -1.0], to_m: [2.0, 1.0] }, 0.3),
        (Region::Disc { centre_m: [0.0, 0.0], radius_m: 5.0 }, 0.1),
    ] {
        let mut wheels = wheels(contact);
        wheels.iter_mut().for_each(|wheel| wheel.bearing_coulomb_n_m = 1e6);
        let mut body = Body::new(low, &wheels).expect("a sound machine");
        let patches = vec![Patch { place, surface: ice }];
        body.set_floor(Floor { patches, ..Floor::default() }).expect("it stands");
        body.set_twist(Twist { vx_m_s: 0.2, ..Twist::default() });
        run(&mut body, &[], 0.02);
        let deceleration = (0.2 - body.twist_in_body().vx_m_s) / 0.02;
        assert!((deceleration / (friction * GRAVITY_M_S2) - 1.0).abs() < 1e-6, "{place:?}: {deceleration}");
    }
}

#[test]
fn a_gap_gives_its_wheel_no_hold() {
    let mut body = Body::new(parameters(), &wheels(Contact::ideal(0.5))).expect("a sound machine");
    let gap = Surface { static_friction: 0.0, sliding_friction: 0.0 };
    let patches = vec![Patch { place: Region::Disc { centre_m: [0.3, 0.2], radius_m: 0.05 }, surface: gap }];
    body.set_floor(Floor { patches, ..Floor::default() }).expect("it stands");
    run(&mut body, &[1.0, 0.0, 0.0, 0.0], 0.1);
    let wheel = body.wheels()[0];
    assert!(
        (wheel.speed_rad_s / (0.1 / 0.02) - 1.0).abs() < 1e-9 && body.twist_in_body().vx_m_s == 0.0,
        "{wheel:?}"
    );
}

#[test]
fn the_whole_floor_may_become_slippery_and_be_as_before() {
    let mut body = held(Contact::ideal(0.5));
    body.set_push(Wrench { fx_n: 0.3 * MASS_KG * GRAVITY_M_S2, ..Wrench::default() });
    run(&mut body, &[], 0.1);
    assert!(body.at_rest());
    body.set_surface(Some(Surface { static_friction: 0.1, sliding_friction: 0.1 })).expect("a floor");
    run(&mut body, &[], 0.1);
    assert!((body.twist_in_body().vx_m_s / (0.2 * GRAVITY_M_S2 * 0.1) - 1.0).abs() < 1e-6);
    body.set_surface(None).expect("a floor");
    run(&mut body, &[], 1.0);
    assert!(body.at_rest(), "{:?}", body.twist_in_body());
    let wrong = body.set_surface(Some(Surface { static_friction: 0.1, sliding_friction: 0.2 }));
    assert!(wrong.expect_err("refused").to_string().contains("at most static_friction"));
}

#[test]
fn a_push_gives_its_impulse_to_a_robot_that_nothing_holds() {
    let mut body = Body::new(parameters(), &wheels(Contact::ideal(0.0))).expect("a sound machine");
    body.set_push(Wrench { fx_n: 200.0, fy_n: -100.0, moment_n_m: 0.0 });
    run(&mut body, &[], 0.25);
    body.set_push(Wrench::default());
    run(&mut body, &[], 0.25);
    let twist = body.twist_in_body();
    assert!((MASS_KG * twist.vx_m_s - 200.0 * 0.25).abs() < 1e-9, "{twist:?}");
    assert!((MASS_KG * twist.vy_m_s + 100.0 * 0.25).abs() < 1e-9, "{twist:?}");
    body.set_push(Wrench { moment_n_m: 8.0, ..Wrench::default() });
    run(&mut body, &[], 0.25);
    assert!((8.0 * body.twist_in_body().w_rad_s - 8.0 * 0.25).abs() < 1e-9);
}

#[test]
fn a_push_of_the_platform_turns_with_it() {
    let mut body = Body::new(parameters(), &wheels(Contact::ideal(0.0))).expect("a sound machine");
    body.set_pose(Pose { heading_rad: 0.7, ..Pose::default() });
    body.set_push_in_body(Wrench { fx_n: 50.0, fy_n: -20.0, moment_n_m: 0.0 });
    run(&mut body, &[], 0.5);
    let twist = body.twist_in_body();
    assert!((twist.vx_m_s - 0.25).abs() < 1e-9 && (twist.vy_m_s + 0.1).abs() < 1e-9, "{twist:?}");
    body.set_push_in_body(Wrench { moment_n_m: 8.0, ..Wrench::default() });
    run(&mut body, &[], 0.25);
    assert!((body.twist_in_body().w_rad_s - 0.25).abs() < 1e-9);
}

fn machine(motor: MotorParameters) -> Machine {
    let wheels = wheels(Contact::ideal(0.5)).into_iter();
    let parameters = MachineParameters {
        body: parameters(),
        payload: Payload::default(),
        floor: Floor::default(),
        wheels: wheels.map(|wheel| WheelDrive { wheel, motor }).collect(),
        step_ns: DEFAULT_STEP_NS,
        wires: Vec::new(),
    };
    Machine::new(&parameters).expect("a sound machine")
}

/// Speed after so long at 2 N·m on every wheel.
fn speed_m_s(motor: MotorParameters, seconds: f64) -> f64 {
    let mut machine = machine(motor);
    (0..4).for_each(|wheel| machine.ask(wheel, 2.0));
    machine.advance((seconds * 1e9) as u64);
    machine.truth().twist_in_body.vx_m_s
}

#[test]
fn a_weaker_motor_accelerates_in_proportion_and_its_drive_doesnt_see_it() {
    let sound = MotorParameters { current_loop_s: 0.0, ..MotorParameters::default() };
    let (strong, weak) =
        (speed_m_s(sound, 0.5), speed_m_s(MotorParameters { torque_ratio: 0.4, ..sound }, 0.5));
    assert!((weak / strong - 0.4).abs() < 1e-9, "{weak} {strong}");
    let mut machine = machine(sound);
    machine.ask(0, 5.0);
    machine.set_torque_ratio(0, 0.5);
    machine.advance(10_000_000);
    assert_eq!((machine.shaft(0).torque_n_m, machine.greatest_torques_n_m()[0]), (5.0, 2.5));
}

#[test]
fn cogging_stores_energy_and_gives_it_back() {
    let (torque_n_m, teeth) = (0.3, 24.0);
    let waves = Waves { cogging_n_m: torque_n_m, cogging_per_turn: teeth, ..Waves::default() };
    let sound = MotorParameters { current_loop_s: 0.0, waves, ..MotorParameters::default() };
    let mut machine = machine(sound);
    // Over the first top by torque, then free.
    let top_rad = std::f64::consts::PI / teeth;
    (0..4).for_each(|wheel| machine.ask(wheel, 0.5));
    let mut ms = 0;
    while machine.shaft(0).angle_rad < top_rad {
        ms += 1;
        machine.advance(ms * 125_000);
    }
    let start = energy(&machine, &waves);
    (0..4).for_each(|wheel| machine.ask(wheel, 0.0));
    let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
    for step in 1..=16_000 {
        machine.advance((ms + step) * 125_000);
        let now = energy(&machine, &waves);
        (least, most) = (least.min(now), most.max(now));
    }
    // First order in the step: half a per cent of the teeth's height.
    let height = 4.0 * 2.0 * torque_n_m / teeth;
    assert!(machine.shaft(0).angle_rad > 2.0 * top_rad, "{:?}", machine.shaft(0));
    assert!(most - least < 0.01 * height && (start - least).abs() < 0.01 * height, "{least} {start} {most}");
}

/// Of motion, and of the teeth.
fn energy(machine: &Machine, waves: &Waves) -> f64 {
    let teeth = (0..4).map(|wheel| {
        let angle = waves.cogging_per_turn * machine.shaft(wheel).angle_rad;
        waves.cogging_n_m / waves.cogging_per_turn * (1.0 - angle.cos())
    });
    machine.body().kinetic_energy_j() + teeth.sum::<f64>()
}

#[test]
fn ripple_does_the_work_of_its_waves() {
    let waves = Waves { ripple: 0.1, ripple_per_turn: 30.0, ..Waves::default() };
    let sound = MotorParameters { current_loop_s: 0.0, waves, ..MotorParameters::default() };
    let mut machine = machine(sound);
    (0..4).for_each(|wheel| machine.ask(wheel, 2.0));
    for step in 1..=8000 {
        machine.advance(step * 125_000);
        // ∫T·(1 + r·sin(n·θ))dθ, four times.
        let angle = machine.shaft(0).angle_rad;
        let work = 4.0 * 2.0 * (angle + 0.1 / 30.0 * (1.0 - (30.0 * angle).cos()));
        let found = machine.body().kinetic_energy_j();
        assert!((found - work).abs() < 1e-3 + 1e-4 * work, "step {step}: {found} J from {work} J");
    }
    assert!(machine.shaft(0).angle_rad > 3.0);
}
