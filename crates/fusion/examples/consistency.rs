//! Whether the filter errs by as much as it says: NEES of the pose and NIS of each kind of sensor, set by set, over many worlds.
//!
//! `cargo run --release -p omnibase-fusion --example consistency [-- <worlds> [<first> [<sensors>]]]`: 1000 by
//! default, each of 8 s, with each set of sensors or with that one alone.
//!
//! Both are chi² over their degrees of freedom (Bar-Shalom, Li and Kirubarajan, *Estimation with Applications
//! to Tracking and Navigation*, 2001, 5.4), so that their means over all worlds lie in the band that is printed
//! at 19 of 20 instants.
//!
//! The looks of one world hang together, so that they leave the band together: what that makes of the mean of
//! all looks, and how often a filter without a fault has so few looks inside, is told by drawing worlds anew
//! from these (Efron and Tibshirani, *An Introduction to the Bootstrap*, 1993, 16.4).

use omnibase_fusion::{Filter, Sensor, SensorKind};

#[allow(dead_code, reason = "the tests use more of it")]
#[path = "../tests/filter/world.rs"]
mod world;
use world::{Chance, PERIOD_NS, World, camera, error, gyro, imu, mouse, nees, settings, tracker};

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

/// What each measure was in a world, look by look.
type Looks = [[f64; LOOKS]; 6];
/// How often all worlds are drawn anew.
const DRAWS: u32 = 1000;

fn main() {
    let mut words = std::env::args().skip(1);
    let mut number = |default| words.next().map_or(default, |word| word.parse().expect("a number"));
    let (worlds, first): (u64, u64) = (number(1000), number(0));
    let asked = words.next();
    let mice = [(mouse(0.2, 0.1), 8), (mouse(-0.2, 0.1), 8)];
    let sets: [(&str, Vec<Heard>); 9] = [
        ("wheels", Vec::new()),
        ("wheels, gyro", vec![(gyro(), 1)]),
        ("wheels, imu", vec![(imu(), 1)]),
        ("wheels, twist", vec![(camera(), 20)]),
        ("wheels, two mice", mice.to_vec()),
        ("wheels, gyro, two mice", [&[(gyro(), 1)][..], &mice].concat()),
        ("wheels, poses at 100 Hz", vec![(tracker(), 10)]),
        ("wheels, imu, twist, poses", vec![(imu(), 1), (camera(), 20), (tracker(), 10)]),
        ("all", [&[(gyro(), 1)][..], &mice, &[(tracker(), 10)]].concat()),
    ];
    println!("{worlds} worlds of {} s each, seen {LOOKS} times\n", LOOKS as u64 * BETWEEN_MS / 1000);
    println!(
        "| sensors | of | at the end | mean of all looks, its 95 % band | 95 % band of a look | looks inside | chance of so few | RMS at the end mm |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for (name, sensors) in sets.iter().filter(|(name, _)| asked.as_ref().is_none_or(|asked| asked == name)) {
        let (seen, squares_m2) = all(first..first + worlds, sensors);
        let rms_mm = 1e3 * (squares_m2 / worlds as f64).sqrt();
        for (at, measure) in measures().iter().enumerate() {
            let count = measure.kind.map_or(1, |kind| of_kind(sensors, kind).count());
            if count > 0 {
                let seen: Vec<[f64; LOOKS]> = seen.iter().map(|looks| looks[at]).collect();
                let half = 1.96 * (2.0 / measure.freedoms / (worlds * count as u64) as f64).sqrt();
                print_row((name, measure), &seen, half, rms_mm);
            }
        }
    }
}

fn measures() -> [Measure; 6] {
    let nis = |name, freedoms, kind| Measure { name, freedoms, kind: Some(kind) };
    [
        Measure { name: "NEES of the pose", freedoms: 3.0, kind: None },
        nis("NIS of the gyro", 1.0, SensorKind::Turn),
        nis("NIS of the imu", 1.0, SensorKind::Inertial),
        nis("NIS of the mice", 2.0, SensorKind::Flow),
        nis("NIS of the twist", 3.0, SensorKind::Twist),
        nis("NIS of the poses", 3.0, SensorKind::Pose),
    ]
}

fn of_kind(sensors: &[Heard], kind: SensorKind) -> impl Iterator<Item = usize> + '_ {
    sensors.iter().enumerate().filter(move |(_, (sensor, _))| sensor.kind == kind).map(|(place, _)| place)
}

/// The mean over worlds, look by look.
fn mean<'a>(seen: impl Iterator<Item = &'a [f64; LOOKS]>) -> [f64; LOOKS] {
    let (mut sums, mut worlds) = ([0.0; LOOKS], 0.0);
    for looks in seen {
        for (sum, look) in sums.iter_mut().zip(looks) {
            *sum += look;
        }
        worlds += 1.0;
    }
    sums.map(|sum| sum / worlds)
}

fn of_looks(means: &[f64; LOOKS]) -> f64 {
    means.iter().sum::<f64>() / LOOKS as f64
}

fn print_row((set, measure): (&str, &Measure), seen: &[[f64; LOOKS]], half: f64, rms_mm: f64) {
    let means = mean(seen.iter());
    let inside = |means: &[f64; LOOKS]| means.iter().filter(|mean| (*mean - 1.0).abs() <= half).count();
    let found = inside(&means);
    let mut chance = Chance::new(1);
    let (mut as_few, mut squares) = (0, 0.0);
    for _ in 0..DRAWS {
        let drawn = mean((0..seen.len()).map(|_| &seen[(chance.unit() * seen.len() as f64) as usize]));
        // As if the true means were 1.
        let faultless = std::array::from_fn(|look| 1.0 + drawn[look] - means[look]);
        as_few += u32::from(inside(&faultless) <= found);
        squares += (of_looks(&faultless) - 1.0).powi(2);
    }
    let half_of_all = 1.96 * (squares / f64::from(DRAWS)).sqrt();
    println!(
        "| {set} | {} | {:.3} | {:.3}, {:.3} to {:.3} | {:.3} to {:.3} | {found} of {LOOKS} | {:.2} | {rms_mm:.2} |",
        measure.name,
        means[LOOKS - 1],
        of_looks(&means),
        1.0 - half_of_all,
        1.0 + half_of_all,
        1.0 - half,
        1.0 + half,
        f64::from(as_few) / f64::from(DRAWS),
    );
}

/// All worlds on all cores: what was seen in each, and the sum of the squares of the distance at the end, m².
fn all(worlds: std::ops::Range<u64>, sensors: &[Heard]) -> (Vec<Looks>, f64) {
    let threads = std::thread::available_parallelism().map_or(1, usize::from) as u64;
    std::thread::scope(|scope| {
        let share = |thread| {
            let worlds = worlds.clone();
            let own = move || {
                worlds
                    .skip(thread as usize)
                    .step_by(threads as usize)
                    .map(|seed| drive(seed, sensors))
                    .collect()
            };
            scope.spawn(own)
        };
        let workers: Vec<_> = (0..threads).map(share).collect();
        let all =
            workers.into_iter().flat_map(|worker| -> Vec<(Looks, f64)> { worker.join().expect("a thread") });
        let (seen, squares_m2): (Vec<_>, Vec<_>) = all.unzip();
        (seen, squares_m2.iter().sum())
    })
}

/// One world: what was seen in it, and the square of the distance at the end, m².
fn drive(seed: u64, sensors: &[Heard]) -> (Looks, f64) {
    let known: Vec<Sensor> = sensors.iter().map(|(sensor, _)| *sensor).collect();
    let mut world = World::new(seed, &known);
    let mut filter = Filter::new(settings(), &known);
    let mut seen = [[0.0; LOOKS]; 6];
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
        for (measure, looks) in measures().iter().zip(&mut seen) {
            looks[look] = match measure.kind {
                None => nees(&filter, world.truth),
                Some(kind) => {
                    let each: Vec<f64> =
                        of_kind(sensors, kind).map(|sensor| filter.verdict(sensor).1).collect();
                    each.iter().sum::<f64>() / each.len().max(1) as f64
                }
            };
        }
    }
    let [x, y, _] = error(&filter, world.truth);
    (seen, x * x + y * y)
}
