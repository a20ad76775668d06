//! What a millisecond of simulated time costs. `cargo bench -p omnibase-robot-sim`

use omnibase_robot_sim::{Body, BodyParameters, WheelParameters};

fn main() {
    divan::main();
}

const STEPS_PER_MS: u32 = 8;

fn body(count: usize) -> Body {
    let parameters = BodyParameters {
        mass_kg: 100.0,
        yaw_inertia_kg_m2: 8.0,
        center_of_mass_m: [0.01, -0.02],
        center_of_mass_height_m: 0.4,
    };
    let wheels: Vec<WheelParameters> = (0..count)
        .map(|i| {
            let (sin, cos) = (std::f64::consts::TAU * i as f64 / count as f64).sin_cos();
            WheelParameters::omni([0.35 * cos, 0.35 * sin], [-sin, cos], 0.1)
        })
        .collect();
    Body::new(parameters, &wheels).expect("a sound machine")
}

/// Body and wheels alone: one simulated millisecond in eight steps, rolling with changing torques.
#[divan::bench(args = [3, 4])]
fn body_ms(bencher: divan::Bencher, wheels: usize) {
    let mut body = body(wheels);
    let mut time_ms = 0_u32;
    bencher.bench_local(move || {
        let phase = 0.006 * f64::from(time_ms % 100_000);
        time_ms += 1;
        let torques = [2.0 * phase.sin(), -1.5 * (0.7 * phase).cos(), 1.0 - phase.cos(), phase.sin()];
        for _ in 0..STEPS_PER_MS {
            body.step(divan::black_box(&torques[..wheels]), 1e-3 / f64::from(STEPS_PER_MS));
        }
        body.pose()
    });
}
