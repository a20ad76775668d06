//! Whether the covariance of the pose says how wrong it is: robots built with the tolerances of their file.
//!
//! `cargo run --release -p omnibase-trials --example nees [-- <robots> [<lines of [estimator]> [<robot and
//! path> [<first seed>]]]]`: 1000 robots by default, seeds from 1, whose file says what creep their treads
//! have. The table is that of `docs/accuracy.md`.
//!
//! In place of lines a set of sensors (`gyro`, `gyro and mice`, `gyro, mice and poses`, `imu`) is joined with
//! the wheels; the floor is then the simulator's, known to be even, and each sensor errs as its file says that
//! it may.

use std::ops::Range;

use omnibase_trials::builds::{
    CREEP_TOLD, Case, Driven, PLACES, PoseError, Summary, Wheels, drive, nees_band,
};
use omnibase_trials::sensed::{SETS, sensors};

/// What is known of a floor that is even, as the simulator's is.
const EVEN_FLOOR: &str = "way_sigma_m = 1e-4\nway_sigma_rad = 1e-4\nturn_sigma_rad = 1e-4\n";

fn main() {
    let mut arguments = std::env::args().skip(1);
    let robots = arguments.next().map_or(1000, |text| text.parse().expect("how many robots"));
    let estimator = arguments.next().unwrap_or_else(|| CREEP_TOLD.to_owned());
    let set = SETS.iter().position(|set| *set == estimator).filter(|set| *set > 0);
    let estimator = set
        .map_or(estimator, |set| format!("{CREEP_TOLD}\nkind = \"fused\"\n{EVEN_FLOOR}\n{}", sensors(set)));
    let asked = arguments.next().unwrap_or_default();
    let first = arguments.next().map_or(1, |text| text.parse().expect("a seed"));
    let [low, high] = nees_band(robots);
    println!("{robots} robots; their mean NEES is right between {low:.3} and {high:.3}\n");
    println!(
        "| robot | path | drawn | NEES at 1/4, 1/2, 3/4 | NEES at the end | e²/σ² of x, y, ψ there | outside 3σ there | at most anywhere | median off mm |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let is_asked = |case: &Case| format!("{} {}", case.robot, case.path).contains(&asked);
    for case in Case::all().into_iter().filter(is_asked) {
        let driven = all(&case, &estimator, first..first + robots as u64);
        let even = |driven: &Driven| driven.even;
        if set.is_some() {
            print_row(&case, "wheels, sensors", &driven, even);
            continue;
        }
        let exact = [drive(case.plan(&estimator), Wheels::Exact, 1)];
        print_row(&case, "wheels, start, floor", &driven, |driven| driven.drawn);
        print_row(&case, "wheels", &driven, even);
        print_row(&case, "nothing", &exact, even);
    }
}

/// These seeds, on all cores.
fn all(case: &Case, estimator: &str, seeds: Range<u64>) -> Vec<Driven> {
    let plan = case.plan(estimator);
    let (first, robots) = (seeds.start, seeds.count());
    let mut driven = vec![Driven::default(); robots];
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let share = robots.div_ceil(threads).max(1);
    std::thread::scope(|scope| {
        for (thread, part) in driven.chunks_mut(share).enumerate() {
            let plan = &plan;
            scope.spawn(move || {
                for (at, slot) in part.iter_mut().enumerate() {
                    *slot = drive(plan.clone(), Wheels::Drawn, first + (thread * share + at) as u64);
                }
            });
        }
    });
    driven
}

fn print_row(case: &Case, drawn: &str, driven: &[Driven], places: impl Fn(&Driven) -> [PoseError; PLACES]) {
    let summaries: Vec<Summary> = (0..PLACES)
        .map(|place| Summary::of(&driven.iter().map(|driven| places(driven)[place]).collect::<Vec<_>>()))
        .collect();
    let under_way = summaries[..PLACES - 1].iter().map(|summary| format!("{:.2}", summary.nees));
    let end = &summaries[PLACES - 1];
    let [x, y, heading] = end.squares;
    let [out_x, out_y, out_heading] = end.outside;
    let most = summaries.iter().flat_map(|summary| summary.outside).max().unwrap_or_default();
    println!(
        "| {} | {} | {drawn} | {} | {:.3} | {x:.2}, {y:.2}, {heading:.2} | {out_x}, {out_y}, {out_heading} | {most} | {:.2} |",
        case.robot,
        case.path,
        under_way.collect::<Vec<_>>().join(", "),
        end.nees,
        1e3 * end.median_m,
    );
}
