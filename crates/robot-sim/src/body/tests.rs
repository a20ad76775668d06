use super::*;
use crate::floor::{Contact, GRAVITY_M_S2};

const STEP_S: f64 = 125e-6;
const RADIUS_M: f64 = 0.1;
const HALF_SQRT3: f64 = 0.866_025_403_784_438_6;

fn platform(center_of_mass_m: [f64; 2]) -> BodyParameters {
    BodyParameters { mass_kg: 100.0, yaw_inertia_kg_m2: 8.0, center_of_mass_m, center_of_mass_height_m: 0.0 }
}

/// The layout of the BMM: wheel 1 behind, rolling to the left; 2 and 3 in front, right and left.
fn bmm_wheels(contact: Contact) -> Vec<WheelParameters> {
    let p = 0.35;
    let lossless = |position, rolling| WheelParameters {
        inertia_kg_m2: 0.02,
        bearing_coulomb_n_m: 0.0,
        bearing_viscous_n_m_s: 0.0,
        contact,
        ..WheelParameters::omni(position, rolling, RADIUS_M)
    };
    vec![
        lossless([-p, 0.0], [0.0, 1.0]),
        lossless([0.5 * p, -HALF_SQRT3 * p], [-HALF_SQRT3, -0.5]),
        lossless([0.5 * p, HALF_SQRT3 * p], [HALF_SQRT3, -0.5]),
    ]
}

fn bmm(contact: Contact) -> Body {
    Body::new(platform([0.0, 0.0]), &bmm_wheels(contact)).expect("a sound machine")
}

/// The same with all losses of the default figures.
fn lossy_bmm() -> Body {
    let mut wheels = bmm_wheels(Contact::default());
    for wheel in &mut wheels {
        wheel.bearing_coulomb_n_m = WheelParameters::BEARING_COULOMB_N_M;
        wheel.bearing_viscous_n_m_s = WheelParameters::BEARING_VISCOUS_N_M_S;
    }
    let mut parameters = platform([0.01, -0.02]);
    parameters.center_of_mass_height_m = 0.4;
    Body::new(parameters, &wheels).expect("a sound machine")
}

fn mecanum() -> Body {
    let contact = Contact::ideal(0.5);
    let wheel = |x: f64, y: f64| WheelParameters {
        bearing_coulomb_n_m: 0.0,
        bearing_viscous_n_m_s: 0.0,
        contact,
        // Seen from above the rollers of the wheels on the floor form an X turned inside out: axes point to the centre.
        ..WheelParameters::mecanum([x, y], [1.0, 0.0], [1.0, -(x * y).signum()], 0.075)
    };
    let wheels = [wheel(0.25, 0.2), wheel(0.25, -0.2), wheel(-0.25, 0.2), wheel(-0.25, -0.2)];
    Body::new(BodyParameters { mass_kg: 60.0, yaw_inertia_kg_m2: 4.0, ..platform([0.0, 0.0]) }, &wheels)
        .expect("a sound machine")
}

fn run(body: &mut Body, torques: &[f64], seconds: f64) {
    for _ in 0..(seconds / STEP_S).round() as usize {
        body.step(torques, STEP_S);
    }
}

/// Speed control stiff enough to impose wheel speeds.
fn run_at(body: &mut Body, speeds: &[f64], seconds: f64) {
    let mut torques = vec![0.0; speeds.len()];
    for _ in 0..(seconds / STEP_S).round() as usize {
        for (i, torque) in torques.iter_mut().enumerate() {
            *torque = (40.0 * (speeds[i] - body.wheels()[i].speed_rad_s)).clamp(-6.0, 6.0);
        }
        body.step(&torques, STEP_S);
    }
}

#[test]
fn a_body_that_slides_freely_is_braked_by_friction_alone() {
    // Wheels along x, locked by enormous inertia: every contact slides straight ahead.
    let contact = Contact { sliding_friction: 0.3, ..Contact::ideal(0.5) };
    let locked = |x: f64, y: f64| WheelParameters {
        inertia_kg_m2: 1e9,
        contact,
        ..WheelParameters::omni([x, y], [1.0, 0.0], RADIUS_M)
    };
    let wheels = [locked(0.3, 0.2), locked(0.3, -0.2), locked(-0.3, 0.2), locked(-0.3, -0.2)];
    let mut body = Body::new(platform([0.05, 0.0]), &wheels).expect("a sound machine");
    body.set_twist(Twist { vx_m_s: 2.0, ..Twist::default() });
    body.step(&[], STEP_S);
    let before = body.twist_in_body().vx_m_s;
    let start = body.pose().x_m;
    run(&mut body, &[], 0.5);
    let deceleration = (before - body.twist_in_body().vx_m_s) / 0.5;
    assert!((deceleration / (0.3 * GRAVITY_M_S2) - 1.0).abs() < 1e-9, "{deceleration}");
    let way = body.pose().x_m - start;
    let exact = before * 0.5 - 0.5 * 0.3 * GRAVITY_M_S2 * 0.25;
    assert!((way - exact).abs() < 1e-9, "{way} {exact}");
    // It comes to rest at the end of v²/(2μg) and stays there.
    run(&mut body, &[], 1.0);
    assert!(body.twist_in_body().vx_m_s.abs() < 1e-9, "{:?}", body.twist_in_body());
    let total = body.pose().x_m - start;
    let stop = before * before / (2.0 * 0.3 * GRAVITY_M_S2);
    assert!((total - stop).abs() < 1e-4, "{total} {stop}");
}

#[test]
fn constant_torque_without_slip_gives_the_analytic_acceleration() {
    let torque = 2.0;
    let mut body = bmm(Contact::ideal(0.5));
    run(&mut body, &[-torque; 3], 1.0);
    let p = 0.35;
    // All wheels alike: J·w' = 3·p·F, I·w'·p/R = tau − F·R.
    let lever = p / RADIUS_M;
    let exact = 3.0 * lever * torque / (8.0 + 3.0 * 0.02 * lever * lever);
    let found = body.twist_in_body().w_rad_s;
    assert!((found / exact - 1.0).abs() < 1e-9, "{found} {exact}");
    assert!((body.pose().heading_rad / (0.5 * exact) - 1.0).abs() < 1e-9, "{:?}", body.pose());
    // Straight ahead: wheels 2 and 3 against each other, wheel 1 idle.
    let mut body = bmm(Contact::ideal(0.5));
    run(&mut body, &[0.0, -torque, torque], 1.0);
    let lever = HALF_SQRT3 / RADIUS_M;
    let exact = 2.0 * lever * torque / (100.0 + 2.0 * 0.02 * lever * lever);
    let found = body.twist_in_body();
    assert!((found.vx_m_s / exact - 1.0).abs() < 1e-9, "{found:?} {exact}");
    assert!(found.vy_m_s.abs() < 1e-12 && found.w_rad_s.abs() < 1e-12, "{found:?}");
    assert!((body.pose().x_m / (0.5 * exact) - 1.0).abs() < 1e-9, "{:?}", body.pose());
}

#[test]
fn the_work_of_the_motors_is_the_kinetic_energy() {
    let mut body = bmm(Contact::ideal(0.9));
    let mut work = 0.0;
    let mut spent: Vec<f64> = body.wheels().iter().map(|w| w.angle_rad).collect();
    for k in 0..8000 {
        let t = f64::from(k) * STEP_S;
        let torques = [3.0 * (7.0 * t).sin(), -4.0 + t, 5.0 * (3.0 * t).cos()];
        body.step(&torques, STEP_S);
        for (i, wheel) in body.wheels().iter().enumerate() {
            work += torques[i] * (wheel.angle_rad - spent[i]);
            spent[i] = wheel.angle_rad;
        }
        assert!(body.wheels().iter().all(|w| w.grip == Grip::Sticking));
    }
    let energy = body.kinetic_energy_j();
    assert!((energy / work - 1.0).abs() < 1e-4, "{energy} J from {work} J");
    assert!(energy > 1.0, "{energy}");
}

#[test]
fn nothing_but_the_motors_gives_energy() {
    // Everything slides, creeps and rolls at once, and the loads shift: friction only ever takes.
    let mut body = lossy_bmm();
    body.set_twist(Twist { vx_m_s: 1.2, vy_m_s: -0.8, w_rad_s: 3.0 });
    [9.0, -30.0, 4.0].iter().enumerate().for_each(|(i, speed)| body.set_wheel_speed(i, *speed));
    let start = body.kinetic_energy_j();
    let mut before = start;
    for step in 0..120_000 {
        body.step(&[], STEP_S);
        let energy = body.kinetic_energy_j();
        assert!(energy <= before * (1.0 + 1e-12), "step {step}: {before} J became {energy} J");
        before = energy;
    }
    assert!(start > 100.0 && before == 0.0, "{start} J, at the end {before} J");
}

#[test]
fn a_body_without_grip_keeps_its_momentum() {
    let mut body =
        Body::new(platform([0.08, 0.03]), &bmm_wheels(Contact::ideal(0.0))).expect("a sound machine");
    body.set_twist(Twist { vx_m_s: 0.7, vy_m_s: -0.2, w_rad_s: 1.5 });
    let energy = body.kinetic_energy_j();
    let center = |b: &Body| {
        let (sin, cos) = b.pose().heading_rad.sin_cos();
        (b.pose().x_m + cos * 0.08 - sin * 0.03, b.pose().y_m + sin * 0.08 + cos * 0.03)
    };
    let (x0, y0) = center(&body);
    run(&mut body, &[], 2.0);
    let (x1, y1) = center(&body);
    // The centre of mass goes straight at its own speed: v + w × c.
    assert!((x1 - x0 - 2.0 * (0.7 - 1.5 * 0.03)).abs() < 1e-7, "{}", x1 - x0);
    assert!((y1 - y0 - 2.0 * (-0.2 + 1.5 * 0.08)).abs() < 1e-7, "{}", y1 - y0);
    assert!((body.pose().heading_rad - 3.0).abs() < 1e-9);
    // 16,000 rotations, each rounded to 1e-16.
    assert!((body.kinetic_energy_j() / energy - 1.0).abs() < 1e-10);
}

#[test]
fn a_steady_circle_keeps_its_radius() {
    let mut body = bmm(Contact::ideal(0.8));
    // Twist (0.5, 0.1, 1.0) in wheel speeds, by hand: R·w_i = u_i·v + p·(…), see the layout.
    let (vx, vy, w, p) = (0.5, 0.1, 1.0, 0.35);
    let speeds = [
        (vy - p * w) / RADIUS_M,
        (-HALF_SQRT3 * vx - 0.5 * vy - p * w) / RADIUS_M,
        (HALF_SQRT3 * vx - 0.5 * vy - p * w) / RADIUS_M,
    ];
    run_at(&mut body, &speeds, 3.0);
    let twist = body.twist_in_body();
    let radius = (twist.vx_m_s.hypot(twist.vy_m_s)) / twist.w_rad_s;
    let pose = body.pose();
    // Centre of the circle: to the left of the velocity.
    let (sin, cos) = pose.heading_rad.sin_cos();
    let center = [
        pose.x_m - (sin * twist.vx_m_s + cos * twist.vy_m_s) / twist.w_rad_s,
        pose.y_m + (cos * twist.vx_m_s - sin * twist.vy_m_s) / twist.w_rad_s,
    ];
    for _ in 0..20 {
        run_at(&mut body, &speeds, 0.5);
        let found = (body.pose().x_m - center[0]).hypot(body.pose().y_m - center[1]);
        assert!((found - radius).abs() < 1e-9, "{found} {radius}");
    }
}

#[test]
fn three_equal_positive_wheel_speeds_turn_the_bmm_clockwise() {
    let mut body = bmm(Contact::ideal(0.5));
    run_at(&mut body, &[2.0; 3], 1.0);
    let twist = body.twist_in_body();
    assert!((twist.w_rad_s + 2.0 * RADIUS_M / 0.35).abs() < 1e-6, "{twist:?}");
    assert!(twist.vx_m_s.abs() < 1e-9 && twist.vy_m_s.abs() < 1e-9, "{twist:?}");
}

#[test]
fn mecanum_wheels_drive_ahead_sideways_and_turn() {
    // Order: front left, front right, rear left, rear right.
    for (speeds, expected) in [
        ([2.0, 2.0, 2.0, 2.0], [0.15, 0.0, 0.0]),
        ([-2.0, 2.0, 2.0, -2.0], [0.0, 0.15, 0.0]),
        ([-2.0, 2.0, -2.0, 2.0], [0.0, 0.0, 0.15 / 0.45]),
    ] {
        let mut body = mecanum();
        run_at(&mut body, &speeds, 1.0);
        let twist = body.twist_in_body();
        let found = [twist.vx_m_s, twist.vy_m_s, twist.w_rad_s];
        for i in 0..3 {
            assert!((found[i] - expected[i]).abs() < 1e-6, "{speeds:?}: {found:?}");
        }
    }
}

#[test]
fn symmetric_torques_give_symmetric_motion() {
    let mut body = mecanum();
    run(&mut body, &[1.0; 4], 1.0);
    let (pose, wheels) = (body.pose(), body.wheels());
    assert!(pose.x_m > 0.1 && pose.y_m.abs() < 1e-12 && pose.heading_rad.abs() < 1e-12, "{pose:?}");
    assert!(wheels.iter().all(|w| (w.angle_rad - wheels[0].angle_rad).abs() < 1e-12));
    // The mirror image of the BMM: wheels 2 and 3 change places and turn the other way round, wheel 1 turns back.
    let torques = [1.0, 2.0, -0.5];
    let mut body = lossy_bmm();
    let mut mirrored = {
        let mut wheels = bmm_wheels(Contact::default());
        for wheel in &mut wheels {
            wheel.bearing_coulomb_n_m = WheelParameters::BEARING_COULOMB_N_M;
            wheel.bearing_viscous_n_m_s = WheelParameters::BEARING_VISCOUS_N_M_S;
        }
        let mut parameters = platform([0.01, 0.02]);
        parameters.center_of_mass_height_m = 0.4;
        Body::new(parameters, &wheels).expect("a sound machine")
    };
    run(&mut body, &torques, 2.0);
    run(&mut mirrored, &[-torques[0], -torques[2], -torques[1]], 2.0);
    let (a, b) = (body.pose(), mirrored.pose());
    assert!(a.x_m.hypot(a.y_m) > 0.01, "{a:?}");
    assert!((a.x_m - b.x_m).abs() < 1e-9 && (a.y_m + b.y_m).abs() < 1e-9, "{a:?} {b:?}");
    assert!((a.heading_rad + b.heading_rad).abs() < 1e-9, "{a:?} {b:?}");
}

#[test]
fn a_standing_machine_stands_still() {
    let mut body = lossy_bmm();
    // Torque below the friction of bearings and rolling (0.05 N·m + 0.009·327 N·0.1 m), and a push below all of it.
    body.set_push(Wrench { fx_n: 3.0, fy_n: -2.0, moment_n_m: 0.5 });
    run(&mut body, &[0.05, -0.05, 0.03], 60.0);
    assert_eq!(body.pose(), Pose::default());
    assert!(body.wheels().iter().all(|w| w.speed_rad_s == 0.0 && w.angle_rad == 0.0));
    // Above it, it moves.
    run(&mut body, &[1.0, 1.0, 1.0], 0.5);
    assert!(body.pose().heading_rad < -0.01, "{:?}", body.pose());
    // Left alone it comes to rest, to the bit.
    body.set_push(Wrench::default());
    run(&mut body, &[], 10.0);
    let pose = body.pose();
    run(&mut body, &[], 1.0);
    assert_eq!(body.pose(), pose);
    assert_eq!(body.twist_in_body(), Twist::default());
}

#[test]
fn stiction_holds_up_to_its_limit_and_not_beyond() {
    // Turning all wheels of the BMM at rest: the axle friction is exactly known.
    let mut wheels = bmm_wheels(Contact::ideal(0.5));
    wheels.iter_mut().for_each(|w| w.bearing_coulomb_n_m = 0.2);
    // Where it begins to move is known to STICTION_RAD_S times inertia over step: 2e-5 N·m.
    for (torque, moves) in [(0.199_999, false), (0.200_1, true)] {
        let mut body = Body::new(platform([0.0, 0.0]), &wheels).expect("a sound machine");
        run(&mut body, &[torque; 3], 1.0);
        assert_eq!(body.pose().heading_rad != 0.0, moves, "{torque} N·m: {:?}", body.pose());
    }
}

#[test]
fn too_much_torque_spins_the_wheel_and_pushes_with_friction_only() {
    let contact = Contact { sliding_friction: 0.2, ..Contact::ideal(0.25) };
    let mut body = bmm(contact);
    // The first step still has the grip of rest.
    body.step(&[-21.0; 3], STEP_S);
    let before = body.twist_in_body().w_rad_s;
    let spun = body.wheels()[0].speed_rad_s;
    run(&mut body, &[-21.0; 3], 0.2);
    // 21 N·m at 0.1 m are 210 N; the floor gives 0.2·327 N.
    let load = 100.0 * GRAVITY_M_S2 / 3.0;
    let turning = (body.twist_in_body().w_rad_s - before) / 0.2;
    let exact = 3.0 * 0.35 * 0.2 * load / 8.0;
    assert!((turning / exact - 1.0).abs() < 1e-6, "{turning} {exact}");
    for (i, wheel) in body.wheels().iter().enumerate() {
        assert_eq!(wheel.grip, Grip::Sliding);
        let [along_n, across_n] = body.forces_n(i);
        assert!((along_n.abs() / (0.2 * load) - 1.0).abs() < 1e-9 && across_n == 0.0, "{along_n} {across_n}");
        let spin = (21.0 - 0.2 * load * RADIUS_M) / 0.02 * 0.2;
        assert!(((spun - wheel.speed_rad_s) / spin - 1.0).abs() < 1e-6, "{wheel:?} {spin}");
    }
    // Released and braked to the body's speed it grips again.
    let speeds = [0.0; 3];
    run_at(&mut body, &speeds, 3.0);
    assert!(body.wheels().iter().all(|w| w.grip == Grip::Sticking && w.slip_m_s.abs() < 1e-9));
}

#[test]
fn rollers_let_the_wheel_go_sideways_against_their_resistance_only() {
    let contact = Contact { roller_resistance: 0.03, ..Contact::ideal(0.5) };
    let mut body = bmm(contact);
    // Forward, wheel 1 rolls on its rollers only. Coasting: m·a = −0.03·N1 − …, with 2 and 3 at 60 deg to the way.
    body.set_twist(Twist { vx_m_s: 0.5, ..Twist::default() });
    body.set_wheel_speed(1, -HALF_SQRT3 * 0.5 / RADIUS_M);
    body.set_wheel_speed(2, HALF_SQRT3 * 0.5 / RADIUS_M);
    let load = 100.0 * GRAVITY_M_S2 / 3.0;
    let effective = 100.0 + 2.0 * 0.02 * (HALF_SQRT3 / RADIUS_M).powi(2);
    let exact = (0.03 * load + 2.0 * 0.5 * 0.03 * load) / effective;
    run(&mut body, &[], 0.5);
    let found = (0.5 - body.twist_in_body().vx_m_s) / 0.5;
    assert!((found / exact - 1.0).abs() < 1e-6, "{found} {exact}");
}

#[test]
fn a_pulling_tread_creeps_by_the_law_of_creep() {
    let contact = Contact { creep: 0.02, ..Contact::ideal(0.5) };
    let mut body = bmm(contact);
    // A push back of 30 N is held by wheels 2 and 3 at constant speed: 30/(2·0.866) N each, on 327 N.
    body.set_push(Wrench { fx_n: -30.0, ..Wrench::default() });
    let speed = 0.4 * HALF_SQRT3 / RADIUS_M;
    run_at(&mut body, &[0.0, -speed, speed], 3.0);
    let twist = body.twist_in_body();
    let rolled = body.wheels()[2].speed_rad_s * RADIUS_M / HALF_SQRT3;
    let force = 30.0 / (2.0 * HALF_SQRT3);
    let slip = 0.02 * twist.vx_m_s * force / (100.0 * GRAVITY_M_S2 / 3.0);
    assert!((body.wheels()[2].slip_m_s / -slip - 1.0).abs() < 1e-3, "{:?} {slip}", body.wheels()[2]);
    assert!((rolled - twist.vx_m_s - slip / HALF_SQRT3).abs() < 1e-3 * slip, "{rolled} {twist:?} {slip}");
}

#[test]
fn braking_loads_the_front_wheels() {
    let mut parameters = platform([0.0, 0.0]);
    parameters.center_of_mass_height_m = 0.5;
    let mut body = Body::new(parameters, &bmm_wheels(Contact::ideal(0.9))).expect("a sound machine");
    run(&mut body, &[0.0, 8.0, -8.0], 0.1);
    let acceleration = body.twist_in_body().vx_m_s / 0.1;
    let base = 100.0 * GRAVITY_M_S2 / 3.0;
    // Moment balance about the centre: m·a·h on wheels at −p and twice at p/2.
    let shift = 100.0 * acceleration * 0.5 / (1.5 * 0.35);
    assert!(acceleration < -1.0, "{acceleration}");
    let rear = body.wheels()[0].normal_load_n;
    let front = body.wheels()[1].normal_load_n;
    assert!((rear - (base + shift)).abs() < 1e-3 * base, "{rear} {base} {shift}");
    assert!((front - (base - 0.5 * shift)).abs() < 1e-3 * base, "{front} {base} {shift}");
}

#[test]
fn a_payload_changes_mass_inertia_and_loads_at_once_but_not_the_speed() {
    let mut body = bmm(Contact::ideal(0.5));
    run_at(&mut body, &[1.0, -2.0, 2.0], 1.0);
    let before = body.twist_in_body();
    let payload = Payload { mass_kg: 50.0, yaw_inertia_kg_m2: 2.0, position_m: [0.1, 0.0], height_m: 0.6 };
    body.set_payload(payload).expect("it stands");
    let after = body.twist_in_body();
    assert!((before.vx_m_s - after.vx_m_s).abs() < 1e-15 && (before.w_rad_s - after.w_rad_s).abs() < 1e-15);
    assert!((body.mass_kg() - 150.0).abs() < 1e-12);
    assert!((body.yaw_inertia_kg_m2() - (8.0 + 2.0 + 100.0 * 50.0 / 150.0 * 0.01)).abs() < 1e-12);
    body.step(&[], STEP_S);
    let sum: f64 = body.wheels().iter().map(|w| w.normal_load_n).sum();
    assert!((sum - 150.0 * GRAVITY_M_S2).abs() < 1.0, "{sum}");
    assert!(body.wheels()[0].normal_load_n < body.wheels()[1].normal_load_n);
    // Too far out: refused, and nothing changed.
    let refused = body.set_payload(Payload { mass_kg: 200.0, position_m: [1.0, 0.0], ..payload });
    assert!(matches!(refused, Err(BodyError::TipsOver { wheel: 1, .. })), "{refused:?}");
    assert_eq!(body.payload(), payload);
    body.set_payload(Payload::default()).expect("empty again");
    assert!((body.mass_kg() - 100.0).abs() < 1e-12);
}

/// Ends of a run with everything in it, for several steps: the error falls with the step (first order).
#[test]
fn a_finer_step_converges() {
    let end = |step_s: f64| {
        let mut body = lossy_bmm();
        for k in 0..(1.5 / step_s).round() as u32 {
            let t = f64::from(k) * step_s;
            body.step(&[2.0 * (4.0 * t).sin(), -3.0 + t, 2.4 * (2.0 * t).cos()], step_s);
        }
        body.pose()
    };
    let truth = end(1.5 / 768_000.0);
    let errors = [500e-6, 250e-6, 125e-6, 62.5e-6].map(|step_s| {
        let pose = end(step_s);
        (pose.x_m - truth.x_m).hypot(pose.y_m - truth.y_m)
    });
    eprintln!("errors of 500, 250, 125, 62.5 us: {errors:?} m, end {truth:?}");
    assert!(truth.x_m.hypot(truth.y_m) > 0.1, "{truth:?}");
    assert!(errors[2] < 5e-5, "{errors:?}");
    let order = (errors[0] / errors[3]).log2() / 3.0;
    assert!((0.8..2.5).contains(&order), "order {order}, {errors:?}");
}

#[test]
fn the_same_input_gives_the_same_bits() {
    let record = || {
        let mut body = lossy_bmm();
        for k in 0..20_000 {
            let t = f64::from(k) * STEP_S;
            if k == 7_000 {
                let load =
                    Payload { mass_kg: 40.0, position_m: [0.05, 0.02], height_m: 0.5, ..Payload::default() };
                body.set_payload(load).expect("it stands");
            }
            body.step(&[9.0 * (9.0 * t).sin(), -4.0 * (5.0 * t).cos(), 14.0 * (3.0 * t).cos()], STEP_S);
        }
        let pose = body.pose();
        let mut bits = vec![pose.x_m.to_bits(), pose.y_m.to_bits(), pose.heading_rad.to_bits()];
        bits.extend(body.wheels().iter().map(|w| w.angle_rad.to_bits()));
        bits
    };
    assert_eq!(record(), record());
}

#[test]
fn machines_that_cannot_be_are_refused_with_the_reason() {
    let wheels = bmm_wheels(Contact::default());
    let refused = |parameters, wheels: &[WheelParameters]| {
        Body::new(parameters, wheels).expect_err("refused").to_string()
    };
    let light = BodyParameters { mass_kg: 0.0, ..platform([0.0, 0.0]) };
    assert_eq!(refused(light, &wheels), "body: mass_kg is 0; it must be positive");
    let mut flat = wheels.clone();
    flat[1].radius_m = f64::NAN;
    assert_eq!(refused(platform([0.0, 0.0]), &flat), "wheel 2: radius_m is NaN; it must be positive");
    let mut slick = wheels.clone();
    slick[2].contact.sliding_friction = 0.7;
    assert_eq!(
        refused(platform([0.0, 0.0]), &slick),
        "wheel 3: contact sliding_friction is 0.7; it must be at most static_friction"
    );
    assert!(refused(platform([0.0, 0.0]), &wheels[..2]).contains("2 wheels stand on one line"));
    assert!(refused(platform([0.9, 0.0]), &wheels).contains("wheel 1 would carry"));
}
