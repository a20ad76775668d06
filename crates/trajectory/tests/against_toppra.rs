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
        }
    }

    fn sigma(&self) -> Vec<f64> {
        (0..=GRID).map(|at| self.pieces.len() as f64 * at as f64 / GRID as f64).collect()
    }

    fn bend(&self, sigma: f64) -> Bend {
        let piece = (sigma as usize).min(self.pieces.len() - 1);
        let axes = self.pieces[piece].each_ref().map(|axis| axis.derivatives(sigma - piece as f64));
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
        })
    }

    /// σ̇ on the grid.
    fn solve(&self) -> Option<Vec<f64>> {
        let bends: Vec<Bend> = self.sigma().into_iter().map(|sigma| self.bend(sigma)).collect();
        let length = self.pieces.len() as f64 / GRID as f64;
        let intervals: Vec<Interval> =
            bends.windows(2).map(|pair| Interval { length, ends: [pair[0], pair[1]], share: 1.0 }).collect();
        let most = |bend: &Bend| {
            let rates = bend.rate.iter().zip(self.speeds).map(|(rate, most)| rate.abs() / most);
            rates.fold(0.0, f64::max).powi(-2)
        };
        let planes = (0..6).map(|at| {
            let mut normal = [0.0; 3];
            normal[at / 2] = if at % 2 == 0 { 1.0 } else { -1.0 };
            Plane { normal, most: self.accelerations[at / 2], ..Plane::default() }
        });
        let bounds = AccelerationBounds { planes: planes.collect(), ..Default::default() };
        let most: Vec<f64> = bends.iter().map(most).collect();
        let x = reach::fastest(&intervals, &most, &bounds, [self.first.powi(2), self.last.powi(2)]).ok()?;
        Some(x.into_iter().map(f64::sqrt).collect())
    }
}

fn time_s(task: &Task, speeds: &[f64]) -> f64 {
    let length = task.pieces.len() as f64 / GRID as f64;
    speeds.windows(2).map(|pair| 2.0 * length / (pair[0] + pair[1])).sum()
}

#[test]
fn a_hundred_random_paths_take_the_same_time() {
    let python = match python("python-toppra", &["toppra==0.6.10"], "import toppra") {
        Ok(python) => python,
        Err(why) => return eprintln!("SKIPPED: no Python with toppra: {why}"),
    };
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let tasks: Vec<Task> = (0..PATHS).map(|_| Task::new(&mut random)).collect();
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
