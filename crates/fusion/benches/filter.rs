//! What a cycle of the filter costs, set of sensors by set: instructions in the mean and in the dearest cycle, and time.
//!
//! `cargo bench -p omnibase-fusion`: a platform on a circle at 0.5 m/s, its cycle 1 ms. Gyro or imu in each of them,
//! two mice at 125 Hz, a twist at 50 Hz, poses at 100 Hz that are late by so many milliseconds. Instructions are
//! counted by callgrind where valgrind is installed: the difference of two runs, each in a process of its own.
//!
//! Time is that of the quickest of 31 batches of a thousand cycles. The dearest cycle is the longest of a
//! thousand, each taken as the least of thirty runs through the same: both leave out what else the machine
//! does.

use std::hint::black_box;
use std::process::Command;
use std::time::Instant;

use omnibase_fusion::{Filter, FilterSettings, Motion, Reading, Sensor, SensorKind};
use omnibase_platform::layout::omni;
use omnibase_platform::{BodyStep, CovarianceSettings, Kinematics, Pose2};

const PERIOD_NS: u64 = 1_000_000;
const SPEED_M_S: f64 = 0.5;
const TURN_RAD_S: f64 = 0.5;
/// All is heard and learnt of by then.
const WARM: u64 = 3000;
/// What the issue allows a cycle with gyro, two mice and poses at 100 Hz, us.
const ALLOWED_US: f64 = 3.0;

/// Which sensors tell speeds, and how late poses are.
#[derive(Clone, Copy)]
struct Set {
    name: &'static str,
    speeds: &'static [SensorKind],
    late_ms: Option<u64>,
}

const GYRO: &[SensorKind] = &[SensorKind::Turn];
const MICE: &[SensorKind] = &[SensorKind::Turn, SensorKind::Flow, SensorKind::Flow];
const IMU: &[SensorKind] = &[SensorKind::Inertial, SensorKind::Flow, SensorKind::Flow];
const TWIST: &[SensorKind] = &[SensorKind::Inertial, SensorKind::Flow, SensorKind::Flow, SensorKind::Twist];

const SETS: [Set; 11] = [
    Set { name: "wheels", speeds: &[], late_ms: None },
    Set { name: "gyro", speeds: GYRO, late_ms: None },
    Set { name: "gyro, two mice", speeds: MICE, late_ms: None },
    Set { name: "gyro, two mice, poses 0 ms late", speeds: MICE, late_ms: Some(0) },
    Set { name: "gyro, two mice, poses 20 ms late", speeds: MICE, late_ms: Some(20) },
    Set { name: "gyro, two mice, poses 200 ms late", speeds: MICE, late_ms: Some(200) },
    Set { name: "gyro, two mice, poses 1 s late", speeds: MICE, late_ms: Some(1000) },
    Set { name: "imu, two mice, poses 20 ms late", speeds: IMU, late_ms: Some(20) },
    Set { name: "imu, two mice, poses 1 s late", speeds: IMU, late_ms: Some(1000) },
    Set { name: "imu, two mice, twist, poses 20 ms late", speeds: TWIST, late_ms: Some(20) },
    Set { name: "imu, two mice, twist, poses 1 s late", speeds: TWIST, late_ms: Some(1000) },
];

/// A filter under way.
#[derive(Clone)]
struct Driven {
    filter: Filter,
    sensors: Vec<Sensor>,
    late_ns: u64,
    begun_ns: u64,
    index: u64,
}

impl Driven {
    fn new(set: Set) -> Driven {
        let kinematics = Kinematics::new(omni(3, 0.3, 0.06, 0.0)).expect("a platform");
        let settings = FilterSettings::new(&kinematics, CovarianceSettings::default(), PERIOD_NS);
        let places = [[0.0, 0.0], [0.2, 0.1], [-0.2, 0.1], [0.1, 0.2]];
        let at = |(kind, [x_m, y_m]): (SensorKind, [f64; 2])| Sensor {
            body_from_sensor: Pose2::new(x_m, y_m, 0.3),
            ..Sensor::of(kind)
        };
        let mut sensors: Vec<Sensor> = set.speeds.iter().copied().zip(places).map(at).collect();
        sensors.extend(set.late_ms.map(|_| at((SensorKind::Pose, [0.1, -0.05]))));
        let filter = Filter::new(settings, &sensors);
        let late_ns = 1_000_000 * set.late_ms.unwrap_or(0);
        let mut driven = Driven { filter, sensors, late_ns, begun_ns: 2000 * PERIOD_NS, index: 2000 };
        (0..WARM).for_each(|_| driven.cycle());
        driven
    }

    /// Where the platform is, as on its circle.
    fn pose(now_ns: u64) -> Pose2 {
        let time_s = now_ns as f64 * 1e-9;
        BodyStep::new(SPEED_M_S * time_s, 0.0, TURN_RAD_S * time_s).exp()
    }

    fn cycle(&mut self) {
        self.index += 1;
        let now_ns = self.index * PERIOD_NS;
        // Never twice the same.
        let noise = 1e-4 * ((self.index * 7919 % 11) as f64 - 5.0);
        let body_from_next = BodyStep::new(SPEED_M_S * 1e-3, 0.0, TURN_RAD_S * 1e-3).exp();
        self.filter.advance(now_ns, &Motion { body_from_next, is_heard: true, ..Motion::default() });
        for place in 0..self.sensors.len() {
            let mount = self.sensors[place].body_from_sensor;
            let (sin, cos) = mount.heading_rad.sin_cos();
            let turned = |[x, y]: [f64; 2]| [cos * x + sin * y + noise, cos * y - sin * x - noise];
            let (every_ms, reading) = match self.sensors[place].kind {
                SensorKind::Turn => (1, Reading::Turn(TURN_RAD_S + noise)),
                SensorKind::Inertial => {
                    let acceleration = turned([0.0, SPEED_M_S * TURN_RAD_S]);
                    (1, Reading::Inertial { turn: TURN_RAD_S + noise, acceleration })
                }
                SensorKind::Pose => {
                    let there = Driven::pose(now_ns - self.late_ns).then(mount);
                    let map_from_sensor = Pose2 { x_m: there.x_m + noise, ..there };
                    (10, Reading::Pose { map_from_sensor, covariance: [0.0; 6] })
                }
                kind => {
                    let at = turned([SPEED_M_S - TURN_RAD_S * mount.y_m, TURN_RAD_S * mount.x_m]);
                    match kind {
                        SensorKind::Twist => (20, Reading::Twist([at[0], at[1], TURN_RAD_S + noise])),
                        _ => (8, Reading::Flow(at)),
                    }
                }
            };
            if self.index.is_multiple_of(every_ms) {
                let late_ns = if every_ms == 10 { self.late_ns } else { 0 };
                let is_heard = self.filter.hear(place, now_ns - late_ns, &reading);
                assert!(is_heard || now_ns - late_ns <= self.begun_ns, "{place}: {reading:?} at {now_ns}");
            }
        }
        black_box(self.filter.estimate());
    }

    fn cycles(&mut self, count: u64) {
        (0..count).for_each(|_| self.cycle());
    }
}

/// Instructions a cycle, by the difference of two runs.
fn instructions(set: usize) -> Option<u64> {
    let total = |cycles: u64| -> Option<u64> {
        let output = Command::new("valgrind")
            .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
            .arg(std::env::current_exe().ok()?)
            .args(["--run", &set.to_string(), &cycles.to_string()])
            .output()
            .ok()?;
        let text = String::from_utf8(output.stderr).ok()?;
        text.lines().find_map(|line| line.split("Collected : ").nth(1))?.trim().parse().ok()
    };
    Some((total(3000)? - total(1000)?) / 2000)
}

/// The quickest of batches, and the dearest of a thousand cycles, us.
fn times_us(set: Set) -> [f64; 2] {
    let begun = Driven::new(set);
    let mut driven = begun.clone();
    let batches_us = (0..31)
        .map(|_| {
            let start = Instant::now();
            driven.cycles(1000);
            start.elapsed().as_secs_f64() * 1e3
        })
        .fold(f64::INFINITY, f64::min);
    let mut least_us = vec![f64::INFINITY; 1000];
    for _ in 0..30 {
        let mut driven = begun.clone();
        for least_us in &mut least_us {
            let start = Instant::now();
            driven.cycle();
            *least_us = least_us.min(start.elapsed().as_secs_f64() * 1e6);
        }
    }
    [batches_us, least_us.into_iter().fold(0.0, f64::max)]
}

fn main() {
    let words: Vec<String> = std::env::args().collect();
    if let Some(at) = words.iter().position(|word| word == "--run") {
        let number = |word: &str| word.parse::<u64>().expect("a number");
        let mut driven = Driven::new(SETS[number(&words[at + 1]) as usize]);
        return driven.cycles(number(&words[at + 2]));
    }
    println!("| a cycle with | instructions | us | dearest cycle, us |");
    println!("|---|---|---|---|");
    for (number, set) in SETS.into_iter().enumerate() {
        let counted = instructions(number).map_or("not counted".to_owned(), |count| count.to_string());
        let [batch_us, dearest_us] = times_us(set);
        println!("| {} | {counted} | {batch_us:.2} | {dearest_us:.2} |", set.name);
    }
    println!("\nallowed with gyro, two mice and poses at 100 Hz: {ALLOWED_US} us");
}
