//! Plans in rooms of the grid benchmarks (maps `.map` with scenarios `.scen`), whose optimal lengths along eight directions are known.
//!
//! `cargo run --release -p omnibase-plan --example benchmark -- FOLDER` takes every `NAME.map` with a `NAME.map.scen` beside it. A way at any
//! angle is never longer than one along eight directions; it may be shorter by up to 8 %. Each way is looked at cell by cell.
//!
//! A second argument is a file: then some scenarios of each room (a third argument says how many, 20 if it doesn't) are planned for two robots
//! with their headings, at cells of 0.5 m, and written as `check_plans.py` reads them.

mod rooms;
mod written;

use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::Path;

use omnibase_plan::search::Search;
use omnibase_plan::{Footprint, Map};
use rooms::Room;

fn used_ms() -> f64 {
    let used = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    used.tv_sec as f64 * 1e3 + used.tv_nsec as f64 * 1e-6
}

/// Whether straight pieces between centres stay in free cells, looked at every hundredth of a cell.
fn is_free(map: &Map, way: &[usize]) -> bool {
    way.windows(2).all(|pair| {
        let [[x, y], [x_to, y_to]] =
            [pair[0], pair[1]].map(|at| [(at % map.width) as f64, (at / map.width) as f64]);
        let steps = ((x_to - x).hypot(y_to - y) * 100.0).ceil() as usize;
        (0..=steps).all(|step| {
            let part = step as f64 / steps.max(1) as f64;
            let at = |from: f64, to: f64| (from + part * (to - from) + 0.5).floor() as usize;
            !map.blocked[at(y, y_to) * map.width + at(x, x_to)]
        })
    })
}

/// Half of them, 99 % and the most, ms.
fn times(times_ms: &mut [f64]) -> String {
    times_ms.sort_by(f64::total_cmp);
    let ms = |share: f64| times_ms.get(((times_ms.len() as f64 - 1.0) * share) as usize).unwrap_or(&0.0);
    format!("{:.2} / {:.1} / {:.0}", ms(0.5), ms(0.99), ms(1.0))
}

fn main() -> std::io::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().expect("a folder with maps");
    let folder = Path::new(&folder);
    println!(
        "{:<24} {:>9} {:>7} {:>8} {:>9} {:>38} {:>24}",
        "map",
        "cells",
        "ways",
        "missing",
        "touching",
        "over eight directions: mean / most",
        "ms half / 99 % / most"
    );
    rooms::read(folder, 1.0)?.iter().for_each(ways);
    let Some(name) = arguments.next() else { return Ok(()) };
    let count = arguments.next().and_then(|count| count.parse().ok()).unwrap_or(20);
    let mut file = BufWriter::new(File::create(name)?);
    println!(
        "\n{:<24} {:<22} {:>7} {:>7} {:>24}",
        "map", "robot", "plans", "no way", "ms half / 99 % / most"
    );
    for room in rooms::read(folder, 0.5)? {
        plans(&room, count, &mut file)?;
    }
    file.flush()
}

/// All ways of a room, for half a cell: any free cell takes the disc.
fn ways(room: &Room) {
    let Room { name, space, asked } = room;
    let search = Search::new(space, space.clearance(), 0.5);
    let (mut ratios, mut times_ms, mut missing, mut touching) = (Vec::new(), Vec::new(), 0, 0);
    for (ends, best) in asked {
        let [from, to] = ends.map(|[x, y]| y * space.map.width + x);
        let begun_ms = used_ms();
        let way = search.shortest(from, to);
        times_ms.push(used_ms() - begun_ms);
        match way {
            Some(way) => {
                if *best > 0.0 {
                    ratios.push(search.length(&way) / best);
                }
                touching += usize::from(!is_free(&space.map, &way));
            }
            None => missing += 1,
        }
    }
    let mean = ratios.iter().sum::<f64>() / ratios.len().max(1) as f64;
    let most = ratios.iter().copied().fold(0.0, f64::max);
    println!(
        "{name:<24} {:>9} {:>7} {missing:>8} {touching:>9} {:>38} {:>24}",
        space.map.blocked.len(),
        times_ms.len(),
        format!("{mean:.4} / {most:.4}"),
        times(&mut times_ms)
    );
}

/// Some plans of a room for robots with headings.
fn plans(room: &Room, count: usize, file: &mut impl std::io::Write) -> std::io::Result<()> {
    let rectangle = |length: f64, width: f64| {
        let (a, b) = (0.5 * length, 0.5 * width);
        Footprint::new(vec![[-a, -b], [a, -b], [a, b], [-a, b]]).expect("convex")
    };
    let robots = [
        ("disc, radius 0.20 m", Footprint::disc(0.2).expect("convex")),
        ("0.9 by 0.4 m", rectangle(0.9, 0.4)),
    ];
    let size_m =
        [room.space.map.width, room.space.map.height].map(|cells| cells as f64 * room.space.map.cell_m);
    let blocks = room.space.map.rectangles(usize::MAX);
    for (robot, footprint) in robots {
        let (mut found, mut times_ms, mut none) = (Vec::new(), Vec::new(), 0);
        for (number, (ends, _)) in room.asked.iter().step_by((room.asked.len() / count).max(1)).enumerate() {
            let begun_ms = used_ms();
            match room.plan(&footprint, *ends, [0.0, number as f64], 0.03) {
                Ok(plan) => found.push(plan),
                Err(_) => none += 1,
            }
            times_ms.push(used_ms() - begun_ms);
        }
        println!("{:<24} {robot:<22} {:>7} {none:>7} {:>24}", room.name, found.len(), times(&mut times_ms));
        written::write(file, size_m, &blocks, &footprint, &found)?;
    }
    Ok(())
}
