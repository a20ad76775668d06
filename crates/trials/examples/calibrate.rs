//! Calibration of robots built with tolerances, seed by seed: what is left of each error, and the true RMS on the 2 m square
//! before and after.
//!
//! `calibrate [BUILDS [ROBOT [WITNESS]]]`: 60 builds of `bmm` (or `mecanum`) told by `poses` (or `gyro`, `tape`).

use omnibase_trials::calibration::{Told, calibrate};
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
    println!("{builds} builds of {robot}, {told:?}");
    println!("| build | radius % | direction ° | across mm | chi²/f | square before mm | after mm |");
    println!("|---|---|---|---|---|---|---|");
    let (mut within, mut squares) = (0, [0.0_f64; 2]);
    let mut most = [0.0_f64; 3];
    let mut said: [Vec<[f64; 2]>; 3] = Default::default();
    for seed in 1..=builds {
        let calibrated = calibrate(&plan, told, seed);
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
         square {:.1} mm in the mean before, {:.2} mm at most after",
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
