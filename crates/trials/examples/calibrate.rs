//! Calibration of robots built with tolerances, seed by seed: what is left of each error, and the true RMS on the 2 m square
//! before and after.
//!
//! `calibrate [BUILDS [ROBOT [WITNESS [ROUNDS [SIDE [MRAD]]]]]]`: 60 builds of `bmm` (or `mecanum`) told by `poses` (or `gyro`, `tape`), all
//! figures driven once on 2 m, headings measured to 2 mrad.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use omnibase_calibrate::rehearsal::Tape;
use omnibase_trials::calibration::{Calibrated, Manner, SIDE_M, Told, calibrate};
use omnibase_trials::{plan_of, robots};

fn main() {
    let mut words = std::env::args().skip(1);
    let builds: u64 = words.next().and_then(|word| word.parse().ok()).unwrap_or(60);
    let robot = words.next().unwrap_or_else(|| "bmm".to_owned());
    let plan = plan_of(if robot == "mecanum" { robots::MECANUM } else { robots::BMM });
    let told = match words.next().as_deref() {
        Some("gyro") => Told::GyroAndTape,
        Some("tape") => Told::Tape,
        _ => Told::Poses,
    };
    let mut number = |default| words.next().map_or(default, |word| word.parse().expect("a number"));
    let (rounds, side_m) = (number(1.0) as usize, number(SIDE_M));
    let usual = Tape::default();
    let tape = Tape { sigma_rad: 1e-3 * number(1e3 * usual.sigma_rad), ..usual };
    let manner = Manner { told, rounds, side_m, tape };
    println!("{builds} builds of {robot}, {manner:?}");
    println!("| build | radius % | direction ° | across mm | chi²/f | square before mm | after mm |");
    println!("|---|---|---|---|---|---|---|");
    let (mut within, mut square_within, mut squares) = (0, 0, [0.0_f64; 2]);
    let mut most = [0.0_f64; 3];
    let mut said: [Vec<[f64; 2]>; 3] = Default::default();
    for (seed, calibrated) in (1..).zip(all(builds, |seed| calibrate(&plan, &manner, seed))) {
        for (all, one) in said.iter_mut().zip(calibrated.said()) {
            all.extend(one);
        }
        let [radius, direction, across] = calibrated.greatest();
        let shown = [100.0 * radius, direction.to_degrees(), 1e3 * across];
        let [before, after] = calibrated.square_m.map(|metres| 1e3 * metres);
        println!(
            "| {seed} | {:.4} | {:.4} | {:.3} | {:.2} | {before:.2} | {after:.2} |",
            shown[0],
            shown[1],
            shown[2],
            calibrated.solution.reduced_chi_square()
        );
        square_within += u64::from(after <= 2.0);
        let is_within = shown[0] <= 0.1 && shown[1] <= 0.02 && shown[2] <= 0.2 && after <= 2.0;
        within += u64::from(is_within);
        for (most, shown) in most.iter_mut().zip(shown) {
            *most = most.max(shown);
        }
        squares[0] += before / builds as f64;
        squares[1] = squares[1].max(after);
    }
    println!();
    println!(
        "{within} of {builds} within 0.1 %, 0.02°, 0.2 mm and 2 mm on the square; greatest {:.4} %, {:.4}°, {:.3} mm; \
         square {:.1} mm in the mean before, {:.2} mm at most after, {square_within} within 2 mm",
        most[0], most[1], most[2], squares[0], squares[1]
    );
    println!();
    println!("| of each wheel | RMS error | ± that was said, in the mean | RMS of error over ± | greatest |");
    println!("|---|---|---|---|---|");
    let units =
        [("radius %", 100.0), ("direction °", 180.0 / std::f64::consts::PI), ("place across mm", 1e3)];
    for ((name, scale), said) in units.into_iter().zip(&said) {
        let count = said.len().max(1) as f64;
        let rms =
            |of: fn(&[f64; 2]) -> f64| (said.iter().map(|one| of(one).powi(2)).sum::<f64>() / count).sqrt();
        let mean = said.iter().map(|[_, sigma]| sigma).sum::<f64>() / count;
        let over = |[error, sigma]: &[f64; 2]| error / sigma;
        let greatest = said.iter().map(|one| over(one).abs()).fold(0.0, f64::max);
        println!(
            "| {name} | {:.4} | {:.4} | {:.2} | {greatest:.1} |",
            scale * rms(|[error, _]| *error),
            scale * mean,
            rms(over)
        );
    }
}

/// All builds, on all cores.
fn all(builds: u64, calibrated: impl Fn(u64) -> Calibrated + Sync) -> Vec<Calibrated> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let (next, found) = (AtomicU64::new(1), Mutex::new(Vec::new()));
    let work = || {
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed > builds {
                return;
            }
            let one = calibrated(seed);
            found.lock().expect("nobody fails").push((seed, one));
        }
    };
    std::thread::scope(|scope| (0..threads).for_each(|_| drop(scope.spawn(work))));
    let mut found = found.into_inner().expect("nobody fails");
    found.sort_by_key(|(seed, _)| *seed);
    found.into_iter().map(|(_, one)| one).collect()
}
