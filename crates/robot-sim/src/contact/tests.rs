use super::*;

/// Numbers that look random and are the same in every run (xorshift64*).
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn around_zero(&mut self, size: f64) -> f64 {
        (2.0 * self.unit() - 1.0) * size
    }
}

/// How far the solution is from fulfilling every equation, relative to the forces in it.
fn residual(mass: &Mass, wheels: &[Wheel], v: &[f64; 3]) -> f64 {
    let mut body = [0, 1, 2].map(|i| mass.stiffness[i] * v[i] - mass.drive[i]);
    let mut worst = 0.0_f64;
    let mut scale = 1.0_f64;
    for wheel in wheels {
        let along = -wheel.grip.resistance(wheel.slip_along(v, wheel.speed));
        let across = -wheel.roller.resistance(wheel.slip_across(v, wheel.speed));
        for (i, rest) in body.iter_mut().enumerate() {
            *rest -= wheel.along[i] * along + wheel.across[i] * across;
        }
        let spin = wheel.stiffness * wheel.speed - wheel.drive
            + wheel.axle.resistance(wheel.speed)
            + wheel.arm_along * along
            + wheel.arm_across * across;
        worst = worst.max(spin.abs());
        scale = scale.max(wheel.drive.abs()).max(wheel.grip.limit);
    }
    body.iter().fold(worst, |w, r| w.max(r.abs())) / scale.max(mass.drive[0].abs()).max(mass.drive[1].abs())
}

fn random_problem(random: &mut Random, count: usize) -> (Mass, Vec<Wheel>, [f64; 3]) {
    let rate = 8000.0;
    // From a machine in motion down to one that hardly feels anything, where most contacts stick.
    let vigour = random.unit().powi(12);
    let before = [0.3, 0.3, 1.0].map(|size| random.around_zero(size * vigour));
    let inertia = [20.0 + 200.0 * random.unit(), 2.0 + 20.0 * random.unit()];
    let stiffness = [inertia[0] * rate, inertia[0] * rate, inertia[1] * rate];
    let mass = Mass {
        stiffness,
        drive: [0, 1, 2].map(|i| stiffness[i] * before[i] + random.around_zero(300.0 * vigour)),
    };
    let wheels = (0..count)
        .map(|_| {
            let (sin, cos) = random.around_zero(3.2).sin_cos();
            let (x, y) = (random.around_zero(0.5), random.around_zero(0.5));
            let arm = 0.05 + 0.1 * random.unit();
            let tilt = random.around_zero(1.0);
            let spin = random.around_zero(4.0 * vigour) * (random.unit() - 0.3).max(0.0);
            let inertia = 0.005 + 0.03 * random.unit();
            let mut wheel = Wheel {
                along: [cos, sin, x * sin - y * cos],
                arm_along: arm * tilt.cos(),
                across: [-sin, cos, x * cos + y * sin],
                arm_across: arm * tilt.sin(),
                stiffness: inertia * rate + 0.005,
                drive: inertia * rate * spin + random.around_zero(30.0 * vigour),
                speed: spin,
                ..Wheel::default()
            };
            let load = 600.0 * random.unit();
            wheel.grip.set(0.5 * load, STICTION_M_S + 0.01 * random.unit().powi(8));
            wheel.roller.set(0.03 * load, STICTION_M_S);
            wheel.axle.set(0.05 + 0.001 * load, STICTION_RAD_S);
            if random.unit() < 0.5 && load > 1.0 {
                wheel.is_elastic = true;
                for friction in [&mut wheel.grip, &mut wheel.roller] {
                    let bent_n = random.around_zero(friction.limit);
                    friction.set_line(bent_n, 10.0_f64.powf(1.0 + 3.0 * random.unit()));
                }
            }
            for friction in [&mut wheel.grip, &mut wheel.roller, &mut wheel.axle] {
                friction.regime =
                    [Regime::Stick, Regime::Forward, Regime::Backward][(random.unit() * 3.0) as usize];
            }
            wheel
        })
        .collect();
    (mass, wheels, before)
}

/// 20,000 problems of 3 to 6 wheels with arbitrary geometry, loads, torques and a wrong guess of what sticks.
#[test]
fn every_equation_holds_after_a_step() {
    let mut random = Random(0x5EED);
    let (mut worst, mut resting) = (0.0_f64, 0);
    for case in 0..20_000 {
        let (mass, mut wheels, before) = random_problem(&mut random, 3 + case % 4);
        let v = balance(&mass, &mut wheels, before);
        let off = residual(&mass, &wheels, &v);
        assert!(off < 1e-8, "case {case}: {off}");
        worst = worst.max(off);
        resting += usize::from(wheels.iter().all(Wheel::at_rest));
    }
    // Rounding of a slip speed (1e-16 m/s) on the slope of stiction (300 N over 1e-9 m/s) is 3e-5 N.
    eprintln!("worst relative residual {worst:e}, {resting} at rest");
    assert!((500..10_000).contains(&resting), "{resting} of 20,000 at rest: not all kinds were tried");
}

/// The line search alone reaches the same solution as the plain steps.
#[test]
fn the_search_agrees_with_the_plain_steps() {
    let mut random = Random(0xBEEF);
    for case in 0..2_000 {
        let (mass, wheels, before) = random_problem(&mut random, 3 + case % 2);
        let mut plain = wheels.clone();
        let mut searched = wheels;
        let v = balance(&mass, &mut plain, before);
        let w = search(&mass, &mut searched, before);
        for i in 0..3 {
            assert!((v[i] - w[i]).abs() < 1e-8, "case {case}: {v:?} {w:?}");
        }
        for (p, s) in plain.iter().zip(&searched) {
            assert!((p.speed - s.speed).abs() < 1e-7, "case {case}: {} {}", p.speed, s.speed);
        }
    }
}
