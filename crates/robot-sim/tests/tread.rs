//! Elastic treads against closed forms.

use omnibase_robot_sim::floor::GRAVITY_M_S2;
use omnibase_robot_sim::{Body, BodyParameters, Contact, Grip, Tread, Twist, WheelParameters, Wrench};

const STEP_S: f64 = 125e-6;
const RADIUS_M: f64 = 0.1;
const MASS_KG: f64 = 100.0;
const INERTIA_KG_M2: f64 = 0.02;
const HALF_SQRT3: f64 = 0.866_025_403_784_438_6;

/// Three omni wheels as on the BMM, without any loss but the tread's and what `contact` has.
fn wheels(contact: Contact) -> Vec<WheelParameters> {
    let p = 0.35;
    let lossless = |position, rolling| WheelParameters {
        inertia_kg_m2: INERTIA_KG_M2,
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

fn body(wheels: &[WheelParameters]) -> Body {
    let parameters = BodyParameters {
        mass_kg: MASS_KG,
        yaw_inertia_kg_m2: 8.0,
        center_of_mass_m: [0.0, 0.0],
        center_of_mass_height_m: 0.0,
    };
    Body::new(parameters, wheels).expect("a sound machine")
}

fn elastic(stiffness_n_m: f64, damping_ratio: f64, contact: Contact) -> Contact {
    Contact { tread: Some(Tread { stiffness_n_m, damping_ratio }), ..contact }
}

/// Wheels that don't turn: friction of their axles holds them.
fn held(contact: Contact) -> Vec<WheelParameters> {
    let mut wheels = wheels(contact);
    wheels.iter_mut().for_each(|wheel| wheel.bearing_coulomb_n_m = 1e6);
    wheels
}

/// Straight ahead, wheels 2 and 3 at 30° to the way swing against the body: mass at the rims, stiffness, damping.
struct Mode {
    frequency_rad_s: f64,
    ratio: f64,
}

impl Mode {
    fn ahead(tread: &Tread) -> Self {
        let rims_kg = 1.5 * INERTIA_KG_M2 / (RADIUS_M * RADIUS_M);
        let reduced_kg = MASS_KG * rims_kg / (MASS_KG + rims_kg);
        Mode {
            frequency_rad_s: (1.5 * tread.stiffness_n_m / reduced_kg).sqrt(),
            ratio: tread.damping_ratio * (rims_kg / reduced_kg).sqrt(),
        }
    }

    /// Of a swing that starts from the middle with speed 1.
    fn speed(&self, time_s: f64) -> f64 {
        let Mode { frequency_rad_s, ratio } = *self;
        let damped = frequency_rad_s * (1.0 - ratio * ratio).sqrt();
        let (sin, cos) = (damped * time_s).sin_cos();
        (-ratio * frequency_rad_s * time_s).exp() * (cos - ratio * frequency_rad_s / damped * sin)
    }
}

/// Greatest error of the wheels' swing against the closed form over 20 ms, in its own size.
fn swing_error(tread: Tread, step_s: f64) -> f64 {
    let mut body = body(&wheels(Contact { tread: Some(tread), ..Contact::ideal(100.0) }));
    let slip_m_s = 0.05;
    for (i, side) in [(1, -1.0), (2, 1.0)] {
        // The body's own way is taken off by momentum: it gets the wheels' share.
        body.set_wheel_speed(i, side * slip_m_s * HALF_SQRT3 / RADIUS_M);
    }
    let mode = Mode::ahead(&tread);
    let mut worst: f64 = 0.0;
    for step in 1..=(0.02 / step_s).round() as u32 {
        body.step(&[], step_s);
        let found = body.wheels()[2].slip_m_s / (-slip_m_s * HALF_SQRT3);
        worst = worst.max((found - mode.speed(f64::from(step) * step_s)).abs());
    }
    worst
}

#[test]
fn a_wheel_swings_on_its_tread_as_a_mass_on_a_spring() {
    for stiffness_n_m in [1e5, 3e5, 1e6, 4e6] {
        for damping_ratio in [0.0, 0.1, 0.3, 0.6, 0.9] {
            let tread = Tread { stiffness_n_m, damping_ratio };
            let errors = [250e-6, 125e-6, 62.5e-6, 31.25e-6].map(|step_s| swing_error(tread, step_s));
            let order = (errors[1] / errors[3]).log2() / 2.0;
            println!("{stiffness_n_m:e} N/m, {damping_ratio}: {errors:?} of the swing, order {order:.2}");
            assert!((1.8..2.2).contains(&order), "{tread:?}: {errors:?}");
        }
    }
    assert!(swing_error(Tread { stiffness_n_m: 1e6, damping_ratio: 0.3 }, STEP_S) < 2e-3);
}

#[test]
fn a_push_bends_the_treads_by_force_over_stiffness() {
    let contact = elastic(2e5, 0.5, Contact::ideal(0.5));
    let mut body = body(&held(contact));
    body.set_push(Wrench { fx_n: 30.0, ..Wrench::default() });
    for _ in 0..80_000 {
        body.step(&[], STEP_S);
    }
    let exact_m = 30.0 / (1.5 * 2e5);
    let found_m = body.pose().x_m;
    assert!((found_m / exact_m - 1.0).abs() < 1e-6, "{found_m} {exact_m}");
    assert!(body.at_rest());
    // Let go it springs back.
    body.set_push(Wrench::default());
    for _ in 0..80_000 {
        body.step(&[], STEP_S);
    }
    assert!(body.pose().x_m.abs() < 1e-10 && body.at_rest(), "{:?}", body.pose());
}

#[test]
fn a_bristle_that_asks_for_too_much_slides_with_coulombs_friction() {
    let friction = Contact { sliding_friction: 0.3, ..Contact::ideal(0.5) };
    let contact = elastic(3e5, 0.3, friction);
    let locked = |x: f64, y: f64| WheelParameters {
        bearing_coulomb_n_m: 1e6,
        contact,
        ..WheelParameters::omni([x, y], [1.0, 0.0], RADIUS_M)
    };
    let square = [locked(0.3, 0.2), locked(0.3, -0.2), locked(-0.3, 0.2), locked(-0.3, -0.2)];
    // Just below the static limit it holds; above, it slides: m·a = F − μ·m·g.
    let weight_n = MASS_KG * GRAVITY_M_S2;
    for (share, slides) in [(0.499, false), (0.501, true)] {
        let mut body = body(&square);
        // Slowly, so that it doesn't swing over the limit.
        for step in 0..40_000 {
            let part = f64::from(step.min(39_000)) / 39_000.0;
            body.set_push(Wrench { fx_n: share * weight_n * part, ..Wrench::default() });
            body.step(&[], STEP_S);
        }
        let is_sliding = body.wheels().iter().all(|wheel| wheel.grip == Grip::Sliding);
        assert_eq!(is_sliding, slides, "{share}: {:?}", body.twist_in_body());
        if slides {
            let before = body.twist_in_body().vx_m_s;
            (0..800).for_each(|_| body.step(&[], STEP_S));
            let acceleration = (body.twist_in_body().vx_m_s - before) / 0.1;
            let exact = (share - 0.3) * GRAVITY_M_S2;
            assert!((acceleration / exact - 1.0).abs() < 1e-9, "{acceleration} {exact}");
            // The bristle holds what friction holds.
            let bent = body.wheels()[0].deflection_m[0] * 3e5;
            assert!((bent / (0.3 * 0.25 * weight_n) - 1.0).abs() < 1e-6, "{bent}");
        }
        assert_eq!(body.twist_in_body().vx_m_s > 0.01, slides);
    }
}

#[test]
fn an_elastic_tread_creeps_as_a_rigid_one_does_once_it_is_bent() {
    let creeping = Contact { creep: 0.02, ..Contact::ideal(0.5) };
    let speeds = [0.0, -4.0 * HALF_SQRT3, 4.0 * HALF_SQRT3];
    let slip = |contact: Contact| {
        let mut body = body(&wheels(contact));
        body.set_push(Wrench { fx_n: -30.0, ..Wrench::default() });
        for _ in 0..24_000 {
            let torques =
                [0, 1, 2].map(|i| (40.0 * (speeds[i] - body.wheels()[i].speed_rad_s)).clamp(-6.0, 6.0));
            body.step(&torques, STEP_S);
        }
        body.wheels()[2].slip_m_s
    };
    let (rigid, bent) = (slip(creeping), slip(elastic(3e5, 0.3, creeping)));
    assert!(rigid < -1e-4 && (bent / rigid - 1.0).abs() < 1e-6, "{bent} {rigid}");
}

#[test]
fn nothing_but_the_motors_gives_energy_to_elastic_treads() {
    for damping_ratio in [0.0, 0.1, 1.0] {
        for stiffness_n_m in [1e5, 1e6, 4e6] {
            let mut wheels = wheels(elastic(stiffness_n_m, damping_ratio, Contact::default()));
            wheels
                .iter_mut()
                .for_each(|wheel| wheel.bearing_coulomb_n_m = WheelParameters::BEARING_COULOMB_N_M);
            let parameters = BodyParameters {
                mass_kg: MASS_KG,
                yaw_inertia_kg_m2: 8.0,
                center_of_mass_m: [0.01, -0.02],
                center_of_mass_height_m: 0.4,
            };
            let mut body = Body::new(parameters, &wheels).expect("a sound machine");
            body.set_twist(Twist { vx_m_s: 1.2, vy_m_s: -0.8, w_rad_s: 3.0 });
            [9.0, -30.0, 4.0].iter().enumerate().for_each(|(i, speed)| body.set_wheel_speed(i, *speed));
            let energy = |body: &Body| body.kinetic_energy_j() + body.elastic_energy_j();
            let start = energy(&body);
            let mut before = start;
            for step in 0..240_000 {
                body.step(&[], STEP_S);
                let now = energy(&body);
                assert!(
                    now <= before * (1.0 + 1e-12),
                    "{stiffness_n_m:e} N/m, {damping_ratio}, step {step}: {before} J became {now} J"
                );
                before = now;
            }
            println!("{stiffness_n_m:e} N/m, {damping_ratio}: {start} J, at the end {before:e} J");
            assert!(start > 100.0 && before < 1e-3, "{before} J");
            assert!(damping_ratio == 0.0 || body.at_rest(), "{:?}", body.twist_in_body());
        }
    }
}

#[test]
fn a_stiff_tread_is_a_rigid_one() {
    let end = |contact: Contact| {
        let mut body = body(&wheels(contact));
        for k in 0..12_000 {
            let t = f64::from(k) * STEP_S;
            body.step(&[2.0 * (4.0 * t).sin(), -3.0 + t, 2.4 * (2.0 * t).cos()], STEP_S);
        }
        body.pose()
    };
    let rigid = end(Contact::default());
    for (stiffness_n_m, tolerance_m) in [(1e9, 1e-4), (4e6, 1e-3), (1e5, 2e-2)] {
        let pose = end(elastic(stiffness_n_m, 0.3, Contact::default()));
        let apart_m = (pose.x_m - rigid.x_m).hypot(pose.y_m - rigid.y_m);
        println!("{stiffness_n_m:e} N/m: {apart_m:e} m from the rigid tread");
        assert!(apart_m < tolerance_m, "{stiffness_n_m:e} N/m: {apart_m} m");
    }
}
