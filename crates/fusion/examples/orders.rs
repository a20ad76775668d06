//! Readings that arrive in any order, up to 0.3 s late: whether what is known in the end is what their own order gives.
//!
//! `cargo run --release -p omnibase-fusion --example orders [-- <orders>]`: 1000 by default.

use omnibase_fusion::{Filter, FilterSettings, Motion, Reading, Sensor, SensorKind};
use omnibase_platform::layout::omni;
use omnibase_platform::{BodyStep, CovarianceSettings, Kinematics, Pose2};

const PERIOD_NS: u64 = 1_000_000;
/// Cycles in which something is measured, and those after them in which it arrives.
const MEASURED: u64 = 100;
const ARRIVING: u64 = 310;

/// A message on its way: when it arrives, of which sensor, its instant, what it says.
type Message = (u64, usize, u64, Reading);

/// Numbers that look random, the same for the same seed (SplitMix64: Steele, Lea and Flood, OOPSLA 2014).
struct Chance(u64);

impl Chance {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

fn main() {
    let orders = std::env::args().nth(1).map_or(1000, |text| text.parse().expect("how many orders"));
    let threads = std::thread::available_parallelism().map_or(1, usize::from) as u64;
    let greatest = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads)
            .map(|thread| {
                scope.spawn(move || {
                    (thread..orders).step_by(threads as usize).map(difference).fold(0.0, f64::max)
                })
            })
            .collect();
        workers.into_iter().map(|worker| worker.join().expect("a thread")).fold(0.0, f64::max)
    });
    println!(
        "{orders} orders: at most {greatest:e} off the state of the filter in order (m, rad and their variances together)"
    );
}

/// Between the filter in order and one that hears in the order of a seed.
fn difference(seed: u64) -> f64 {
    let kinematics = Kinematics::new(omni(3, 0.3, 0.06, 0.0)).expect("a platform");
    let settings = FilterSettings::new(&kinematics, CovarianceSettings::default(), PERIOD_NS);
    let sensors = [SensorKind::Turn, SensorKind::Pose, SensorKind::Flow].map(Sensor::of);
    let mut in_order = Filter::new(settings, &sensors);
    let mut late = in_order.clone();
    let mut chance = Chance(seed);
    let mut under_way: Vec<Message> = Vec::new();
    let mut truth = Pose2::default();
    for cycle in 1..=MEASURED + ARRIVING {
        let now_ns = 1_000_000_000 + cycle * PERIOD_NS;
        let moves = if cycle <= MEASURED { 1e-3 } else { 0.0 };
        let step = BodyStep::new(0.5 * moves, 0.1 * moves, 0.4 * moves);
        truth = truth.moved_by(step);
        let motion = Motion { body_from_next: step.exp(), is_heard: true, ..Motion::default() };
        in_order.advance(now_ns, &motion);
        late.advance(now_ns, &motion);
        let noise = |chance: &mut Chance, size: f64| size * (2.0 * chance.unit() - 1.0);
        let readings = [
            (0, 1, Reading::Turn(0.4 + noise(&mut chance, 5e-3))),
            (
                1,
                10,
                Reading::Pose {
                    map_from_sensor: Pose2 { x_m: truth.x_m + noise(&mut chance, 2e-3), ..truth },
                    covariance: [0.0; 6],
                },
            ),
            (2, 8, Reading::Flow([0.5 + noise(&mut chance, 0.02), 0.1 + noise(&mut chance, 0.02)])),
        ];
        for (sensor, every, reading) in readings {
            if cycle <= MEASURED && cycle.is_multiple_of(every) {
                in_order.hear(sensor, now_ns, &reading);
                let at_ns = now_ns + (0.3e9 * chance.unit()) as u64;
                under_way.push((at_ns, sensor, now_ns, reading));
            }
        }
        let mut index = 0;
        while index < under_way.len() {
            if under_way[index].0 <= now_ns {
                let (_, sensor, instant_ns, reading) = under_way.swap_remove(index);
                assert!(late.hear(sensor, instant_ns, &reading), "it has its place");
            } else {
                index += 1;
            }
        }
    }
    // What came last is still being computed in.
    for cycle in 1..=150 {
        let now_ns = 1_000_000_000 + (MEASURED + ARRIVING + cycle) * PERIOD_NS;
        let motion = Motion { is_heard: true, ..Motion::default() };
        in_order.advance(now_ns, &motion);
        late.advance(now_ns, &motion);
    }
    assert!(in_order.is_settled() && late.is_settled());
    let (a, b) = (in_order.estimate(), late.estimate());
    let pose = a.map_from_body.distance_m(b.map_from_body)
        + (a.map_from_body.heading_rad - b.map_from_body.heading_rad).abs();
    a.covariance.iter().zip(b.covariance).fold(pose, |sum, (a, b)| sum + (a - b).abs())
}
