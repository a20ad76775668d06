//! Readings that arrive in any order, up to 0.2 s late or another time: whether what is known in the end is what their own order gives.
//!
//! `cargo run --release -p omnibase-fusion --example orders [-- <orders> [<late by at most s>]]`: 1000 and 0.2 by default, at most
//! 1.1. Each world is heard in a hundred random orders, a cycle is one epoch of the filter, and every reading has an instant of its own within it.

use omnibase_fusion::{Filter, FilterSettings, Motion, Reading, Sensor, SensorKind};
use omnibase_platform::layout::omni;
use omnibase_platform::{BodyStep, CovarianceSettings, Kinematics, Pose2};

const PERIOD_NS: u64 = 5_000_000;
/// Cycles in which something is measured. After them come those in which it arrives, and twice as many in which what came last is
/// computed in.
const MEASURED: u64 = 8;
/// Orders in which a world is heard.
const ORDERS_A_WORLD: u64 = 100;

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
    let mut words = std::env::args().skip(1);
    let orders: u64 = words.next().map_or(1000, |text| text.parse().expect("how many orders"));
    let latest_s: f64 = words.next().map_or(0.2, |text| text.parse().expect("how late, in s"));
    let latest_ns = (1e9 * latest_s) as u64;
    let threads = std::thread::available_parallelism().map_or(1, usize::from) as u64;
    let greatest = std::thread::scope(|scope| {
        let share = |thread| {
            let worlds = (thread..orders.div_ceil(ORDERS_A_WORLD)).step_by(threads as usize);
            scope.spawn(move || {
                let heard = |world| {
                    let first = world * ORDERS_A_WORLD;
                    World::new(world, latest_ns).difference(first..orders.min(first + ORDERS_A_WORLD))
                };
                worlds.map(heard).fold(0.0, f64::max)
            })
        };
        let workers: Vec<_> = (0..threads).map(share).collect();
        workers.into_iter().map(|worker| worker.join().expect("a thread")).fold(0.0, f64::max)
    });
    println!(
        "{orders} orders, up to {latest_s} s late: at most {greatest:e} off the state of the filter in order (m, rad, what is wrong with a step, and the \
         variances of the pose together)"
    );
}

/// Motion, what was measured of it, and what the filter makes of that in order.
struct World {
    latest_ns: u64,
    motions: Vec<Motion>,
    measured: Vec<(usize, u64, Reading)>,
    empty: Filter,
    in_order: Filter,
}

/// The last cycles are short: much of the past is passed in the time of an epoch.
fn instant_ns(cycle: u64, latest_ns: u64) -> u64 {
    let settling = cycle.saturating_sub(MEASURED + latest_ns.div_ceil(PERIOD_NS));
    1_000_000_000 + (cycle - settling) * PERIOD_NS + settling * 1_000_000
}

impl World {
    fn new(seed: u64, latest_ns: u64) -> World {
        let kinematics = Kinematics::new(omni(3, 0.3, 0.06, 0.0)).expect("a platform");
        let settings = FilterSettings::new(&kinematics, CovarianceSettings::default(), PERIOD_NS);
        let sensors = [SensorKind::Turn, SensorKind::Pose, SensorKind::Flow].map(Sensor::of);
        let empty = Filter::new(settings, &sensors);
        let mut in_order = empty.clone();
        let mut chance = Chance(seed);
        let (mut motions, mut measured) = (Vec::new(), Vec::new());
        let mut truth = Pose2::default();
        for cycle in 1..=MEASURED + 3 * latest_ns.div_ceil(PERIOD_NS) {
            let moves = if cycle <= MEASURED { 1e-9 * PERIOD_NS as f64 } else { 0.0 };
            let step = BodyStep::new(0.5 * moves, 0.1 * moves, 0.4 * moves);
            truth = truth.moved_by(step);
            let motion = Motion { body_from_next: step.exp(), is_heard: true, ..Motion::default() };
            in_order.advance(instant_ns(cycle, latest_ns), &motion);
            motions.push(motion);
            if cycle <= MEASURED {
                let from = measured.len();
                measure(&mut measured, cycle, truth, &mut chance);
                for (sensor, instant_ns, reading) in &measured[from..] {
                    assert!(in_order.hear(*sensor, *instant_ns, reading), "it has its place");
                }
            }
        }
        assert!(in_order.is_settled());
        World { latest_ns, motions, measured, empty, in_order }
    }

    /// Between the filter in order and those that hear in the orders of seeds, at most.
    fn difference(&self, seeds: std::ops::Range<u64>) -> f64 {
        seeds.map(|seed| difference(&self.in_order, &self.heard(seed))).fold(0.0, f64::max)
    }

    fn heard(&self, seed: u64) -> Filter {
        let mut chance = Chance(seed ^ 0x07DE_5000_0000_0000);
        let mut late = self.empty.clone();
        let arrives = |(sensor, instant_ns, reading): &(usize, u64, Reading)| -> Message {
            (instant_ns + (self.latest_ns as f64 * chance.unit()) as u64, *sensor, *instant_ns, *reading)
        };
        let mut under_way: Vec<Message> = self.measured.iter().map(arrives).collect();
        for (cycle, motion) in (1..).zip(&self.motions) {
            let now_ns = instant_ns(cycle, self.latest_ns);
            late.advance(now_ns, motion);
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
        assert!(under_way.is_empty() && late.is_settled());
        late
    }
}

/// What the sensors tell in a cycle: the gyro each millisecond, the others once.
fn measure(measured: &mut Vec<(usize, u64, Reading)>, cycle: u64, truth: Pose2, chance: &mut Chance) {
    let end_ns = 1_000_000_000 + cycle * PERIOD_NS;
    let mut noise = |size: f64| size * (2.0 * chance.unit() - 1.0);
    for before in (0..5).rev() {
        measured.push((0, end_ns - before * 1_000_000, Reading::Turn(0.4 + noise(5e-3))));
    }
    let map_from_sensor = Pose2 { x_m: truth.x_m + noise(2e-3), y_m: truth.y_m + noise(2e-3), ..truth };
    measured.push((1, end_ns, Reading::Pose { map_from_sensor, covariance: [0.0; 6] }));
    measured.push((2, end_ns - 1_000_000, Reading::Flow([0.5 + noise(0.02), 0.1 + noise(0.02)])));
}

fn difference(one: &Filter, other: &Filter) -> f64 {
    let (a, b) = (one.estimate(), other.estimate());
    let pose = a.map_from_body.distance_m(b.map_from_body)
        + (a.map_from_body.heading_rad - b.map_from_body.heading_rad).abs();
    let steps = [BodyStep::new(1.0, 0.0, 0.0), BodyStep::new(0.0, 1.0, 0.0), BodyStep::new(0.0, 0.0, 1.0)];
    let wrong = steps.iter().fold(pose, |sum, step| {
        let (a, b) = (one.corrected(*step, 1.0), other.corrected(*step, 1.0));
        sum + (a.x_m - b.x_m).abs() + (a.y_m - b.y_m).abs() + (a.angle_rad - b.angle_rad).abs()
    });
    a.covariance.iter().zip(b.covariance).fold(wrong, |sum, (a, b)| sum + (a - b).abs())
}
