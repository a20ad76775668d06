//! The fastest progress against that of `toppra`, the implementation of the method's authors, on the same grid.

#[path = "../../omnibase/tests/python_tools/mod.rs"]
mod python_tools;

use omnibase_trajectory::interpolation::clamped_spline_speeds;
use omnibase_trajectory::polynomial::{End, Polynomial};
use omnibase_trajectory::reach::{self, AccelerationBounds, Bend, Interval, Plane};
use python_tools::python;
use serde_json::{Value, json};
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

const PATHS: usize = 100;
const GRID: usize = 100;

/// Numbers from 0 to 1 (G. Marsaglia, *Xorshift RNGs*, 2003).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        for shift in [13, -7, 17_i32] {
            self.0 ^= if shift > 0 { self.0 << shift } else { self.0 >> -shift };
        }
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.next()
    }
}

/// A path of cubics through random points, its limits, and the speeds at its ends.
struct Task {
    pieces: Vec<[Polynomial; 3]>,
    speeds: [f64; 3],
    accelerations: [f64; 3],
    first: f64,
    last: f64,
    /// Rows over the twist in base, and planes on the acceleration there; none for a task of axes.
    wheel_speeds: Vec<[f64; 3]>,
    planes: Vec<Plane>,
}

impl Task {
    fn new(random: &mut Random) -> Task {
        let points = 4 + (random.next() * 6.0) as usize;
        let axes: [Vec<f64>; 3] =
            std::array::from_fn(|_| (0..points).map(|_| random.between(-1.5, 1.5)).collect());
        let ones = vec![1.0; points - 1];
        let speeds = axes.each_ref().map(|values| {
            let mut speeds = clamped_spline_speeds(values, &ones);
            // A path that doesn't begin at rest in σ.
            (speeds[0], speeds[points - 1]) =
                (values[1] - values[0], values[points - 1] - values[points - 2]);
            speeds
        });
        let end = |axis: usize, at: usize| End {
            position: axes[axis][at],
            speed: speeds[axis][at],
            ..End::default()
        };
        let piece =
            |at: usize| std::array::from_fn(|axis| Polynomial::cubic(end(axis, at), end(axis, at + 1), 1.0));
        Task {
            pieces: (0..points - 1).map(piece).collect(),
            speeds: std::array::from_fn(|_| random.between(0.3, 2.0)),
            accelerations: std::array::from_fn(|_| random.between(0.5, 4.0)),
            // Now and then a start or an end that moves.
            first: if random.next() < 0.3 { random.between(0.0, 0.1) } else { 0.0 },
            last: if random.next() < 0.3 { random.between(0.0, 0.1) } else { 0.0 },
            wheel_speeds: Vec::new(),
            planes: Vec::new(),
        }
    }

    /// On three or four omni wheels, their speeds, torques and grip with shifted loads.
    fn on_wheels(random: &mut Random) -> Task {
        let mut task = Task::new(random);
        let count = if random.next() < 0.5 { 3 } else { 4 };
        let [mass_kg, inertia_kg_m2] = [random.between(40.0, 200.0), random.between(3.0, 20.0)];
        let [height_m, radius_m] = [random.between(0.1, 0.5), random.between(0.2, 0.5)];
        let [friction, torque_n] = [random.between(0.1, 0.8), random.between(30.0, 250.0)];
        let wheels = f64::from(count);
        let load_n = mass_kg * 9.80665 / wheels;
        let speed_m_s = random.between(0.5, 2.0);
        for wheel in 0..count {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(wheel) / wheels).sin_cos();
            task.wheel_speeds.push([-sin, cos, radius_m].map(|part| part / speed_m_s));
            let share = 2.0 * mass_kg / wheels;
            let force = [-sin * share, cos * share, inertia_kg_m2 / (wheels * radius_m)];
            let lighter = friction * load_n * 2.0 * height_m / (radius_m * 9.80665);
            for sign in [1.0, -1.0] {
                let torque = force.map(|part| sign * part);
                let grip = [torque[0] + lighter * cos, torque[1] + lighter * sin, torque[2]];
                task.planes.push(Plane { normal: torque, most: torque_n, ..Plane::default() });
                task.planes.push(Plane { normal: grip, most: friction * load_n, ..Plane::default() });
            }
        }
        task
    }

    /// A vector at a place of the way in base.
    fn in_base(&self, sigma: f64, [x, y, turn]: [f64; 3]) -> [f64; 3] {
        let (sin, cos) = self.place(sigma)[2][0].sin_cos();
        [cos * x + sin * y, cos * y - sin * x, turn]
    }

    fn sigma(&self) -> Vec<f64> {
        (0..=GRID).map(|at| self.pieces.len() as f64 * at as f64 / GRID as f64).collect()
    }

    fn place(&self, sigma: f64) -> [[f64; 4]; 3] {
        let piece = (sigma as usize).min(self.pieces.len() - 1);
        self.pieces[piece].each_ref().map(|axis| axis.derivatives(sigma - piece as f64))
    }

    fn bend(&self, sigma: f64) -> Bend {
        let axes = self.place(sigma);
        Bend { rate: axes.map(|axis| axis[1]), curve: axes.map(|axis| axis[2]) }
    }

    fn json(&self) -> Value {
        let pieces: Vec<_> = self
            .pieces
            .iter()
            .map(|piece| piece.each_ref().map(|axis| axis.coefficients[..4].to_vec()))
            .collect();
        json!({
            "pieces": pieces,
            "breaks": (0..=self.pieces.len()).collect::<Vec<_>>(),
            "sigma": self.sigma(),
            "speeds": self.speeds,
            "accelerations": self.accelerations,
            "first": self.first,
            "last": self.last,
            "wheel_speeds": self.wheel_speeds,
            "normals": self.planes.iter().map(|plane| plane.normal).collect::<Vec<_>>(),
            "most": self.planes.iter().map(|plane| plane.most).collect::<Vec<_>>(),
        })
    }

    /// σ̇ on the grid.
    fn solve(&self) -> Option<Vec<f64>> {
        let length = self.pieces.len() as f64 / GRID as f64;
        let sigma = self.sigma();
        let bends: Vec<Bend> = sigma.iter().map(|sigma| self.bend(*sigma)).collect();
        let intervals: Vec<Interval> =
            bends.windows(2).map(|pair| Interval { length, ends: [pair[0], pair[1]], share: 1.0 }).collect();
        let most = |(sigma, bend): (&f64, &Bend)| {
            let rates = bend.rate.iter().zip(self.speeds).map(|(rate, most)| rate.abs() / most);
            let rate_in_base = self.in_base(*sigma, bend.rate);
            let wheels = self.wheel_speeds.iter().map(|row| dot(row, &rate_in_base).abs());
            rates.chain(wheels).fold(0.0, f64::max).powi(-2)
        };
        let most: Vec<f64> = sigma.iter().zip(&bends).map(most).collect();
        let planes = (0..6).map(|at| {
            let mut normal = [0.0; 3];
            normal[at / 2] = if at % 2 == 0 { 1.0 } else { -1.0 };
            Plane { normal, most: self.accelerations[at / 2], ..Plane::default() }
        });
        let ends = [self.first.powi(2), self.last.powi(2)];
        let x = if self.planes.is_empty() {
            let bounds = AccelerationBounds { planes: planes.collect(), ..Default::default() };
            reach::fastest(&intervals, &most, &bounds, ends).ok()?
        } else {
            let intervals: Vec<Interval> = intervals
                .iter()
                .zip(sigma.windows(2))
                .map(|(interval, pair)| Interval {
                    ends: std::array::from_fn(|end| Bend {
                        rate: self.in_base(pair[end], interval.ends[end].rate),
                        curve: self.in_base(pair[end], interval.ends[end].curve),
                    }),
                    ..*interval
                })
                .collect();
            let bounds = AccelerationBounds { planes: self.planes.clone(), ..Default::default() };
            reach::fastest(&intervals, &most, &bounds, ends).ok()?
        };
        Some(x.into_iter().map(f64::sqrt).collect())
    }
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn time_s(task: &Task, speeds: &[f64]) -> f64 {
    let length = task.pieces.len() as f64 / GRID as f64;
    speeds.windows(2).map(|pair| 2.0 * length / (pair[0] + pair[1])).sum()
}

#[test]
fn a_hundred_random_paths_take_the_same_time() {
    same_times(0x9e37_79b9_7f4a_7c15, Task::new);
}

#[test]
fn and_so_do_a_hundred_on_wheels_that_turn_and_grip_only_so_much() {
    same_times(0x2545_f491_4f6c_dd1d, Task::on_wheels);
}

/// The times of a hundred tasks, by both.
fn same_times(seed: u64, make: fn(&mut Random) -> Task) {
    let Some(python) = python("python-toppra", &["toppra==0.6.10"], "import toppra") else { return };
    let mut random = Random(seed);
    let tasks: Vec<Task> = (0..PATHS).map(|_| make(&mut random)).collect();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/time_optimal.py");
    let mut child =
        Command::new(python).arg(script).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let lines: Vec<String> = tasks.iter().map(|task| task.json().to_string()).collect();
    let writer = std::thread::spawn(move || writeln!(stdin, "{}", lines.join("\n")).unwrap());
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap();
    let answers = String::from_utf8(output.stdout).unwrap();
    let answers: Vec<Option<Vec<f64>>> =
        answers.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(answers.len(), PATHS);
    let mut solved = 0;
    let mut worst: f64 = 0.0;
    for (at, (task, answer)) in tasks.iter().zip(answers).enumerate() {
        let own = task.solve();
        assert_eq!(own.is_some(), answer.is_some(), "path {at}");
        let (Some(own), Some(answer)) = (own, answer) else { continue };
        let (own_s, their_s) = (time_s(task, &own), time_s(task, &answer));
        worst = worst.max((own_s / their_s - 1.0).abs());
        assert!((own_s / their_s - 1.0).abs() < 1e-6, "path {at}: {own_s} s, by toppra {their_s} s");
        solved += 1;
    }
    println!("{solved} of {PATHS} paths, times within {worst:e} of toppra's");
    assert!(solved >= 90, "{solved}");
}
