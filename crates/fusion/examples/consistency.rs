//! Whether the filter errs by as much as it says: NEES of the pose and NIS of each kind of sensor, set by set, over many worlds.
//!
//! `cargo run --release -p omnibase-fusion --example consistency [-- <worlds> [<first>]]`: 1000 by default, each of 8 s. Both are chi² over
//! their degrees of freedom (Bar-Shalom, Li and Kirubarajan, *Estimation with Applications to Tracking and Navigation*, 2001, 5.4), so
//! that their means over all worlds lie in the band that is printed at 19 of 20 instants.

use omnibase_fusion::{Filter, Sensor, SensorKind};

#[path = "../tests/filter/world.rs"]
mod world;
use world::{PERIOD_NS, World, error, gyro, mouse, nees, settings, tracker};

/// Instants at which all worlds are looked at, this apart, ms.
const LOOKS: usize = 40;
const BETWEEN_MS: u64 = 200;

/// A sensor and how many milliseconds lie between its readings.
type Heard = (Sensor, u64);

/// Of what a mean is taken, and of how many degrees of freedom.
#[derive(Clone, Copy, PartialEq)]
struct Measure {
    name: &'static str,
    freedoms: f64,
    /// The sensors whose NIS it is; of the pose's NEES none.
    kind: Option<SensorKind>,
}

/// Sums over worlds, look by look.
type Sums = [[f64; LOOKS]; 4];

fn main() {
    let mut words = std::env::args().skip(1).map(|word| word.parse().expect("a number"));
    let (worlds, first): (u64, u64) = (words.next().unwrap_or(1000), words.next().unwrap_or(0));
    let mice = [(mouse(0.2, 0.1), 8), (mouse(-0.2, 0.1), 8)];
    let sets: [(&str, Vec<Heard>); 5] = [
        ("wheels", Vec::new()),
        ("wheels, gyro", vec![(gyro(), 1)]),
        ("wheels, gyro, two mice", [&[(gyro(), 1)][..], &mice].concat()),
        ("wheels, poses at 100 Hz", vec![(tracker(), 10)]),
        ("all", [&[(gyro(), 1)][..], &mice, &[(tracker(), 10)]].concat()),
    ];
    println!("{worlds} worlds of {} s each, seen {LOOKS} times\n", LOOKS as u64 * BETWEEN_MS / 1000);
    println!(
        "| sensors | of | at the end | mean of all looks | 95 % band of a look | looks inside | RMS at the end mm |"
    );
    println!("|---|---|---|---|---|---|---|");
    for (name, sensors) in &sets {
        let (sums, squares_m2) = all(first..first + worlds, sensors);
        let rms_mm = 1e3 * (squares_m2 / worlds as f64).sqrt();
        for (measure, sums) in measures().iter().zip(&sums) {
            let count = measure.kind.map_or(1, |kind| of_kind(sensors, kind).count());
            if count > 0 {
                print_row((name, measure), sums, worlds as f64 * count as f64, rms_mm);
            }
        }
    }
}

fn measures() -> [Measure; 4] {
    let nis = |name, freedoms, kind| Measure { name, freedoms, kind: Some(kind) };
    [
        Measure { name: "NEES of the pose", freedoms: 3.0, kind: None },
        nis("NIS of the gyro", 1.0, SensorKind::Turn),
        nis("NIS of the mice", 2.0, SensorKind::Flow),
        nis("NIS of the poses", 3.0, SensorKind::Pose),
    ]
}

fn of_kind(sensors: &[Heard], kind: SensorKind) -> impl Iterator<Item = usize> + '_ {
    sensors.iter().enumerate().filter(move |(_, (sensor, _))| sensor.kind == kind).map(|(place, _)| place)
}

fn print_row((set, measure): (&str, &Measure), sums: &[f64; LOOKS], summed: f64, rms_mm: f64) {
    let means = sums.map(|sum| sum / summed);
    let half = 1.96 * (2.0 / measure.freedoms / summed).sqrt();
    let inside = means.iter().filter(|mean| (*mean - 1.0).abs() <= half).count();
    println!(
        "| {set} | {} | {:.3} | {:.3} | {:.3} to {:.3} | {inside} of {LOOKS} | {rms_mm:.2} |",
        measure.name,
        means[LOOKS - 1],
        means.iter().sum::<f64>() / LOOKS as f64,
        1.0 - half,
        1.0 + half,
    );
}

/// All worlds on all cores: sums, and the squares of the distance at the end, m².
fn all(worlds: std::ops::Range<u64>, sensors: &[Heard]) -> (Sums, f64) {
    let threads = std::thread::available_parallelism().map_or(1, usize::from) as u64;
    std::thread::scope(|scope| {
        let share = |thread| {
            let worlds = worlds.clone();
            scope.spawn(move || {
                let mut sums = ([[0.0; LOOKS]; 4], 0.0);
                for seed in worlds.skip(thread as usize).step_by(threads as usize) {
                    drive(seed, sensors, &mut sums);
                }
                sums
            })
        };
        let workers: Vec<_> = (0..threads).map(share).collect();
        let mut all = ([[0.0; LOOKS]; 4], 0.0);
        for worker in workers {
            let (sums, squares_m2) = worker.join().expect("a thread");
            for (sum, more) in all.0.iter_mut().flatten().zip(sums.iter().flatten()) {
                *sum += more;
            }
            all.1 += squares_m2;
        }
        all
    })
}

fn drive(seed: u64, sensors: &[Heard], (sums, squares_m2): &mut (Sums, f64)) {
    let known: Vec<Sensor> = sensors.iter().map(|(sensor, _)| *sensor).collect();
    let mut world = World::new(seed, &known);
    let mut filter = Filter::new(settings(), &known);
    for look in 0..LOOKS {
        for _ in 0..BETWEEN_MS {
            let motion = world.step();
            filter.advance(world.now_ns, &motion);
            for (sensor, (_, every)) in sensors.iter().enumerate() {
                if (world.now_ns / PERIOD_NS).is_multiple_of(*every) {
                    let reading = world.read(sensor);
                    filter.hear(sensor, world.now_ns, &reading);
                }
            }
        }
        for (measure, sums) in measures().iter().zip(sums.iter_mut()) {
            sums[look] += match measure.kind {
                None => nees(&filter, world.truth),
                Some(kind) => of_kind(sensors, kind).map(|sensor| filter.verdict(sensor).1).sum(),
            };
        }
    }
    let [x, y, _] = error(&filter, world.truth);
    *squares_m2 += x * x + y * y;
}
