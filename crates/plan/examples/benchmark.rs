//! Plans in rooms of the grid benchmarks (maps `.map` with scenarios `.scen`), whose optimal lengths along eight directions are known.
//!
//! `cargo run --release -p omnibase-plan --example benchmark -- FOLDER` takes every `NAME.map` with a `NAME.map.scen` beside it. A way at any
//! angle is never longer than one along eight directions; it may be shorter by up to 8 %. Each way is looked at cell by cell.

use omnibase_plan::search::Search;
use omnibase_plan::{Map, Space};

fn used_ms() -> f64 {
    let used = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    used.tv_sec as f64 * 1e3 + used.tv_nsec as f64 * 1e-6
}

/// The map of a text, its rows from below.
fn read(text: &str) -> Option<Map> {
    let (header, rows) = text.split_once("map\n")?;
    let number =
        |key: &str| header.lines().find_map(|line| line.strip_prefix(key)?.trim().parse::<usize>().ok());
    let (height, width) = (number("height ")?, number("width ")?);
    let mut map = Map::empty([width, height], 1.0).ok()?;
    for (row, line) in rows.lines().take(height).enumerate() {
        for (column, cell) in line.bytes().take(width).enumerate() {
            map.blocked[row * width + column] = !matches!(cell, b'.' | b'G' | b'S');
        }
    }
    Some(map)
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

fn main() -> std::io::Result<()> {
    let folder = std::env::args().nth(1).expect("a folder with maps");
    let mut names: Vec<_> =
        std::fs::read_dir(&folder)?.filter_map(|entry| Some(entry.ok()?.path())).collect();
    names.sort();
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
    for path in names.iter().filter(|path| path.extension().is_some_and(|ending| ending == "map")) {
        let Ok(scenarios) = std::fs::read_to_string(format!("{}.scen", path.display())) else { continue };
        let Some(map) = read(&std::fs::read_to_string(path)?) else { continue };
        let space = Space::new(map);
        // Half a cell: any free cell takes the disc.
        let search = Search::new(&space, space.clearance(), 0.5);
        let (mut ratios, mut times_ms, mut missing, mut touching) = (Vec::new(), Vec::new(), 0, 0);
        for line in scenarios.lines().skip(1) {
            let words: Vec<&str> = line.split_whitespace().collect();
            let number = |at: usize| words.get(at).and_then(|word| word.parse::<f64>().ok());
            let (Some(x), Some(y), Some(x_to), Some(y_to), Some(best)) =
                (number(4), number(5), number(6), number(7), number(8))
            else {
                continue;
            };
            let cell = |x: f64, y: f64| y as usize * space.map.width + x as usize;
            let begun_ms = used_ms();
            let way = search.shortest(cell(x, y), cell(x_to, y_to));
            times_ms.push(used_ms() - begun_ms);
            match way {
                Some(way) => {
                    if best > 0.0 {
                        ratios.push(search.length(&way) / best);
                    }
                    touching += usize::from(!is_free(&space.map, &way));
                }
                None => missing += 1,
            }
        }
        times_ms.sort_by(f64::total_cmp);
        let ms = |share: f64| {
            times_ms.get(((times_ms.len() as f64 - 1.0) * share) as usize).copied().unwrap_or(0.0)
        };
        let mean = ratios.iter().sum::<f64>() / ratios.len().max(1) as f64;
        let most = ratios.iter().copied().fold(0.0, f64::max);
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        println!(
            "{name:<24} {:>9} {:>7} {missing:>8} {touching:>9} {:>38} {:>24}",
            space.map.blocked.len(),
            times_ms.len(),
            format!("{mean:.4} / {most:.4}"),
            format!("{:.2} / {:.1} / {:.0}", ms(0.5), ms(0.99), ms(1.0))
        );
    }
    Ok(())
}
