//! Random plans in random rooms: none touches anything by a look of its own, and how long they are against the best known.
//!
//! `cargo run --release -p omnibase-plan --example plans -- 100000` prints the table; a second argument is a file for the plans, a room a
//! line, which `check_plans.py` beside this file looks at with shapely. With `lengths` in place of it only rooms count whose best ways
//! are looked for.

mod written;

use std::fs::File;
use std::io::{BufWriter, Write as _};

use omnibase_plan::plan::By;
use omnibase_plan::{Cost, Footprint, Map, Plan, PlanError, Point, Space, Task, Until, plan};
use omnibase_platform::Pose2;

const ROOM_M: [f64; 2] = [8.0, 6.0];
const CELL_M: f64 = 0.05;
const CLEARANCE_M: f64 = 0.03;
/// Plans in each room.
const EACH: usize = 20;
/// Of the rooms two in so many are solved for the disc by its visibility graph, and for others on cells half as large and backwards, too.
const GRAPHS: usize = 20;
/// One room in so many has a wall across it with a door that the long robot passes with one heading alone.
const DOORS: usize = 2;
/// A way may be so many times as long as the best one that is known.
const LONGER: f64 = 1.01;
/// The door's width, m.
const DOOR_M: [f64; 2] = [0.66, 1.0];

/// What this thread has had of a processor, ms: others at work on this machine don't count.
fn used_ms() -> f64 {
    let used = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    used.tv_sec as f64 * 1e3 + used.tv_nsec as f64 * 1e-6
}

struct Random(u64);

impl Random {
    /// From 0 to 1 (a linear congruential generator's upper half).
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / (1_u64 << 31) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.next()
    }
}

/// A convex obstacle, counter-clockwise.
type Block = Vec<Point>;

fn blocks(random: &mut Random) -> Vec<Block> {
    let count = 3 + (random.next() * 7.0) as usize;
    (0..count)
        .map(|_| {
            let centre = [random.between(0.0, ROOM_M[0]), random.between(0.0, ROOM_M[1])];
            let half = [random.between(0.05, 1.2), random.between(0.05, 0.4)];
            let (sin, cos) = random.between(0.0, std::f64::consts::PI).sin_cos();
            [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
                .map(|[x, y]| [x * half[0], y * half[1]])
                .map(|[x, y]| [centre[0] + cos * x - sin * y, centre[1] + sin * x + cos * y])
                .to_vec()
        })
        .collect()
}

/// A wall across the room in any direction, and the door in it.
fn wall(random: &mut Random) -> [Block; 2] {
    let middle = [random.between(2.5, ROOM_M[0] - 2.5), random.between(2.0, ROOM_M[1] - 2.0)];
    let half_m = 0.5 * random.between(DOOR_M[0], DOOR_M[1]);
    let (sin, cos) = random.between(0.0, std::f64::consts::PI).sin_cos();
    let (half_width_m, end_m) = (random.between(0.03, 0.15), ROOM_M[0] + ROOM_M[1]);
    [1.0, -1.0].map(|side| {
        let corners =
            [[half_m, -half_width_m], [end_m, -half_width_m], [end_m, half_width_m], [half_m, half_width_m]];
        corners
            .map(|[x, y]| [side * x, side * y])
            .map(|[x, y]| [middle[0] + cos * x - sin * y, middle[1] + sin * x + cos * y])
            .to_vec()
    })
}

fn cross(o: Point, a: Point, b: Point) -> f64 {
    (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0])
}

/// Whether two convex polygons overlap: no side of either parts them.
fn overlap(one: &[Point], other: &[Point]) -> bool {
    let parted = |a: &[Point], b: &[Point]| {
        (0..a.len()).any(|at| b.iter().all(|point| cross(a[at], a[(at + 1) % a.len()], *point) <= 0.0))
    };
    !parted(one, other) && !parted(other, one)
}

/// The first pose of a plan, in steps of 5 mm and half a degree, at which the outline touches a block or leaves the room.
fn touches(plan: &Plan, outline: &[Point], blocks: &[Block]) -> Option<Pose2> {
    for pair in plan.poses.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        let turned = (to.heading_rad - from.heading_rad).abs();
        let steps = (from.distance_m(to) / 0.005).max(turned / 0.0087).ceil().max(1.0) as usize;
        for step in 0..=steps {
            let part = step as f64 / steps as f64;
            let at = |a: f64, b: f64| a + part * (b - a);
            let pose =
                Pose2::new(at(from.x_m, to.x_m), at(from.y_m, to.y_m), at(from.heading_rad, to.heading_rad));
            let (sin, cos) = pose.heading_rad.sin_cos();
            let placed: Vec<Point> = outline
                .iter()
                .map(|[x, y]| [pose.x_m + cos * x - sin * y, pose.y_m + sin * x + cos * y])
                .collect();
            let is_outside =
                placed.iter().any(|[x, y]| *x < 0.0 || *y < 0.0 || *x > ROOM_M[0] || *y > ROOM_M[1]);
            if is_outside || blocks.iter().any(|block| overlap(&placed, block)) {
                return Some(pose);
            }
        }
    }
    None
}

fn to_segment(point: Point, from: Point, to: Point) -> f64 {
    let side = [to[0] - from[0], to[1] - from[1]];
    let square = side[0] * side[0] + side[1] * side[1];
    let along = (point[0] - from[0]) * side[0] + (point[1] - from[1]) * side[1];
    let part = if square > 0.0 { (along / square).clamp(0.0, 1.0) } else { 0.0 };
    (point[0] - from[0] - part * side[0]).hypot(point[1] - from[1] - part * side[1])
}

/// Whether a disc of a radius gets straight from one place to another.
fn is_clear(from: Point, to: Point, radius: f64, blocks: &[Block]) -> bool {
    let inside =
        |[x, y]: Point| x >= radius && y >= radius && x <= ROOM_M[0] - radius && y <= ROOM_M[1] - radius;
    if !inside(from) || !inside(to) {
        return false;
    }
    blocks.iter().all(|block| {
        let sides = || (0..block.len()).map(|at| (block[at], block[(at + 1) % block.len()]));
        let crosses = sides().any(|(a, b)| {
            cross(from, to, a) * cross(from, to, b) < 0.0 && cross(a, b, from) * cross(a, b, to) < 0.0
        });
        let holds = sides().all(|(a, b)| cross(a, b, from) > 0.0);
        let far = sides().all(|(a, b)| {
            let ends = to_segment(a, from, to).min(to_segment(from, a, b)).min(to_segment(to, a, b));
            ends >= radius - 1e-9
        });
        !crosses && !holds && far
    })
}

/// The visibility graph of a disc among blocks: places on circles around the blocks' corners.
struct Graph {
    places: Vec<Point>,
    reach: Vec<Vec<(usize, f64)>>,
    radius: f64,
}

impl Graph {
    fn new(radius: f64, blocks: &[Block]) -> Graph {
        const ON_CIRCLE: usize = 48;
        // Chords between neighbours stay outside the circle.
        let outer = radius / (std::f64::consts::PI / ON_CIRCLE as f64).cos() + 1e-9;
        let mut places = Vec::new();
        for corner in blocks.iter().flatten() {
            for number in 0..ON_CIRCLE {
                let (sin, cos) = (std::f64::consts::TAU * number as f64 / ON_CIRCLE as f64).sin_cos();
                let place = [corner[0] + outer * cos, corner[1] + outer * sin];
                if is_clear(place, place, radius, blocks) {
                    places.push(place);
                }
            }
        }
        let mut graph = Graph { reach: vec![Vec::new(); places.len()], places, radius };
        for one in 0..graph.places.len() {
            for other in one + 1..graph.places.len() {
                let (a, b) = (graph.places[one], graph.places[other]);
                if is_clear(a, b, radius, blocks) {
                    let length = (a[0] - b[0]).hypot(a[1] - b[1]);
                    graph.reach[one].push((other, length));
                    graph.reach[other].push((one, length));
                }
            }
        }
        graph
    }

    fn shortest(&self, from: Point, to: Point, blocks: &[Block]) -> Option<f64> {
        let length = |a: Point, b: Point| (a[0] - b[0]).hypot(a[1] - b[1]);
        if is_clear(from, to, self.radius, blocks) {
            return Some(length(from, to));
        }
        let sees = |place: &Point, end: Point| {
            is_clear(*place, end, self.radius, blocks).then(|| length(*place, end))
        };
        let mut best: Vec<f64> =
            self.places.iter().map(|place| sees(place, from).unwrap_or(f64::INFINITY)).collect();
        let last: Vec<f64> =
            self.places.iter().map(|place| sees(place, to).unwrap_or(f64::INFINITY)).collect();
        let mut done = vec![false; best.len()];
        let mut found = f64::INFINITY;
        loop {
            let next = (0..best.len()).filter(|at| !done[*at]).min_by(|a, b| best[*a].total_cmp(&best[*b]));
            let Some(at) = next.filter(|at| best[*at] < found) else { break };
            done[at] = true;
            found = found.min(best[at] + last[at]);
            for (other, length) in &self.reach[at] {
                best[*other] = best[*other].min(best[at] + length);
            }
        }
        found.is_finite().then_some(found)
    }
}

#[derive(Default)]
struct Row {
    asked: usize,
    found: [usize; 3],
    none: usize,
    touched: usize,
    times_ms: Vec<f64>,
    /// The longest until it was said that there is no way, ms.
    none_ms: f64,
    ratios: Vec<f64>,
    missed: usize,
}

fn percentile(sorted: &[f64], share: f64) -> f64 {
    sorted.get(((sorted.len() as f64 - 1.0) * share).round() as usize).copied().unwrap_or(f64::NAN)
}

fn main() {
    let count: usize = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(10_000);
    let second = std::env::args().nth(2);
    let of_lengths = second.as_deref() == Some("lengths");
    let mut file = second
        .filter(|_| !of_lengths)
        .map(|name| BufWriter::new(File::create(name).expect("the file can be written")));
    let rectangle = |length: f64, width: f64| {
        let (a, b) = (0.5 * length, 0.5 * width);
        Footprint::new(vec![[-a, -b], [a, -b], [a, b], [-a, b]]).expect("convex")
    };
    let robots = [
        ("disc, radius 0.30 m", Footprint::disc(0.3).expect("convex"), true),
        ("0.7 by 0.5 m", rectangle(0.7, 0.5), false),
        ("1.4 by 0.5 m", rectangle(1.4, 0.5), false),
    ];
    println!(
        "{:<20} {:>7} {:>8} {:>7} {:>7} {:>7} {:>8} {:>24} {:>10} {:>34}",
        "robot",
        "plans",
        "straight",
        "disc",
        "turning",
        "no way",
        "touched",
        "ms half / 99 % / most",
        "no way ms",
        "length over best: mean / 99 % / most"
    );
    let mut rows = robots.each_ref().map(|_| Row::default());
    let rooms = count / robots.len() / EACH;
    let is_measured = |number: usize| number % GRAPHS < DOORS;
    for number in (0..rooms).filter(|number| !of_lengths || is_measured(*number)) {
        let mut random = Random(17 + number as u64);
        let mut blocks = blocks(&mut random);
        if number % DOORS == 1 {
            blocks.extend(wall(&mut random));
        }
        let room = |cell_m: f64| {
            let corners = [[0.0, 0.0], [ROOM_M[0], 0.0], ROOM_M, [0.0, ROOM_M[1]]];
            let mut map = Map::of_room(&corners, cell_m).expect("a room");
            blocks.iter().for_each(|block| map.block_polygon(block));
            Space::new(map)
        };
        let is_measured = is_measured(number);
        let (space, fine) = (room(CELL_M), is_measured.then(|| room(0.5 * CELL_M)));
        // All robots in each room: a run that is ended has looked at all of them.
        for ((_, footprint, is_disc), row) in robots.iter().zip(&mut rows) {
            // It takes minutes.
            let graph = (*is_disc && is_measured && !of_lengths)
                .then(|| Graph::new(footprint.outer_radius_m() + CLEARANCE_M, &blocks));
            let fine = fine.as_ref().filter(|_| !is_disc);
            let scene = Scene { number, space: &space, fine, footprint, blocks: &blocks, graph };
            let plans: Vec<Plan> = (0..EACH).filter_map(|_| ask(row, &mut random, &scene)).collect();
            if let Some(file) = &mut file {
                written::write(file, ROOM_M, scene.blocks, footprint, &plans)
                    .expect("the file can be written");
            }
        }
    }
    for ((name, ..), row) in robots.iter().zip(&mut rows) {
        row.times_ms.sort_by(f64::total_cmp);
        row.ratios.sort_by(f64::total_cmp);
        let ms = |share| percentile(&row.times_ms, share);
        let mean = row.ratios.iter().sum::<f64>() / row.ratios.len() as f64;
        let lengths = if row.ratios.is_empty() {
            "-".to_owned()
        } else {
            format!(
                "{mean:.4} / {:.4} / {:.4} ({} ways, {} beyond {LONGER})",
                percentile(&row.ratios, 0.99),
                percentile(&row.ratios, 1.0),
                row.ratios.len(),
                row.ratios.iter().filter(|ratio| **ratio > LONGER).count()
            )
        };
        println!(
            "{name:<20} {:>7} {:>8} {:>7} {:>7} {:>7} {:>8} {:>24} {:>10} {lengths:>34}",
            row.asked,
            row.found[0],
            row.found[1],
            row.found[2],
            row.none,
            row.touched,
            format!("{:.2} / {:.1} / {:.0}", ms(0.5), ms(0.99), ms(1.0)),
            format!("{:.0}", row.none_ms)
        );
        if row.missed > 0 {
            println!("  {} ways that are known were not found", row.missed);
        }
    }
    if let Some(mut file) = file {
        file.flush().expect("the file can be written");
    }
    if of_lengths {
        return;
    }
    let [(disc, of_disc, _), (oblong, of_oblong, _), (long, of_long, _)] = &robots;
    cold(disc, of_disc, 200, false);
    cold(oblong, of_oblong, 200, false);
    cold(&format!("{long}, narrow doors"), of_long, 40, true);
}

const LARGE_CELLS: [usize; 2] = [420, 350];
/// The width of a door that the long robot hardly passes, in a wall of a large map, m.
const NARROW_M: [f64; 2] = [0.6, 0.75];

/// A map of 147,000 cells, a wall with a narrow door through it where it is asked for, and ends of a way on both sides.
fn large(random: &mut Random, has_door: bool) -> (Map, [Pose2; 2]) {
    let size_m = LARGE_CELLS.map(|count| count as f64 * CELL_M);
    let mut map = Map::empty(LARGE_CELLS, CELL_M).expect("a map");
    for _ in 0..40 {
        let centre = [random.between(0.0, size_m[0]), random.between(0.0, size_m[1])];
        let half = [random.between(0.1, 1.5), random.between(0.1, 1.0)];
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        map.block_polygon(&corners.map(|[x, y]| [centre[0] + x * half[0], centre[1] + y * half[1]]));
    }
    if has_door {
        let (x_m, half_m) = (random.between(0.3, 0.7) * size_m[0], random.between(0.05, 0.5));
        let low_m = random.between(0.1, 0.9) * size_m[1];
        let high_m = low_m + random.between(NARROW_M[0], NARROW_M[1]);
        for [low, high] in [[0.0, low_m], [high_m, size_m[1]]] {
            let sides = [x_m - half_m, x_m + half_m];
            map.block_polygon(&[[sides[0], low], [sides[1], low], [sides[1], high], [sides[0], high]]);
        }
    }
    let pose = |x, y| Pose2::new(x * size_m[0], y * size_m[1], 0.0);
    let ends = [pose(0.05, random.between(0.05, 0.95)), pose(0.95, random.between(0.05, 0.95))];
    (map, ends)
}

/// Large maps, each seen for the first time: everything from the cells to the way.
fn cold(who: &str, footprint: &Footprint, plans: usize, has_door: bool) {
    let mut random = Random(3);
    let (mut times_ms, mut none_ms, mut of_space) = (Vec::new(), Vec::new(), Vec::new());
    while times_ms.len() < plans {
        let (map, [from, to]) = large(&mut random, has_door);
        let begun_ms = used_ms();
        let space = Space::new(map);
        of_space.push(used_ms() - begun_ms);
        let task = Task {
            space: &space,
            footprint,
            from,
            to,
            clearance_m: CLEARANCE_M,
            cost: Cost::Shortest,
            until: Until::default(),
        };
        let planned = plan(&task);
        let took_ms = used_ms() - begun_ms;
        if planned.is_ok() { times_ms.push(took_ms) } else { none_ms.push(took_ms) }
    }
    for times in [&mut times_ms, &mut none_ms, &mut of_space] {
        times.sort_by(f64::total_cmp);
    }
    println!(
        "147,000 cells, cold, {who}: half {:.1} ms, 99 % {:.1} ms, most {:.1} ms of {plans} plans ({} had none: most {:.1} ms); of it distances {:.1} ms",
        percentile(&times_ms, 0.5),
        percentile(&times_ms, 0.99),
        percentile(&times_ms, 1.0),
        none_ms.len(),
        percentile(&none_ms, 1.0),
        percentile(&of_space, 0.5)
    );
}

/// A room and who drives in it.
struct Scene<'a> {
    /// The room's number.
    number: usize,
    space: &'a Space,
    /// The same with cells half as large, where ways on it are asked for.
    fine: Option<&'a Space>,
    footprint: &'a Footprint,
    blocks: &'a [Block],
    /// The shortest ways of a disc in it, where they are asked for.
    graph: Option<Graph>,
}

/// One plan between two free poses of a room, where there is one.
fn ask(row: &mut Row, random: &mut Random, scene: &Scene<'_>) -> Option<Plan> {
    let Scene { number, space, fine, footprint, blocks, graph } = scene;
    let mut checker = space.checker(footprint, CLEARANCE_M);
    let mut free = || {
        // A crowded room may have no place: then whatever comes is told to be blocked.
        let mut draw = || {
            let heading = random.between(-3.0, 3.0);
            Pose2::new(random.between(0.0, ROOM_M[0]), random.between(0.0, ROOM_M[1]), heading)
        };
        (0..200).map(|_| draw()).find(|pose| checker.is_free(pose)).unwrap_or_default()
    };
    let (from, to) = (free(), free());
    let task = Task {
        space,
        footprint,
        from,
        to,
        clearance_m: CLEARANCE_M,
        cost: Cost::Shortest,
        until: Until::default(),
    };
    let begun_ms = used_ms();
    let planned = plan(&task);
    let took_ms = used_ms() - begun_ms;
    row.times_ms.push(took_ms);
    row.asked += 1;
    let best =
        graph.as_ref().and_then(|graph| graph.shortest([from.x_m, from.y_m], [to.x_m, to.y_m], blocks));
    // The shortest of all that are known: on finer cells, and of the ways back.
    let others = fine.iter().flat_map(|fine| {
        let back = Task { from: to, to: from, ..task };
        [task, back, Task { space: fine, ..task }, Task { space: fine, ..back }]
    });
    let known = others.filter_map(|task| plan(&task).ok()).map(|plan| plan.length_m).reduce(f64::min);
    let best = best.or(known);
    match planned {
        Ok(plan) => {
            let by = match plan.by {
                By::Straight => 0,
                By::Disc => 1,
                By::Turning => 2,
            };
            row.found[by] += 1;
            if let Some(pose) = touches(&plan, footprint.corners_m(), blocks) {
                row.touched += 1;
                eprintln!("touches at {pose:?}, {from:?} to {to:?}, {:?}", plan.by);
            }
            if let Some(best) = best.filter(|best| *best > 0.2) {
                row.ratios.push(plan.length_m / best);
                if plan.length_m > LONGER * best {
                    eprintln!(
                        "room {number}: {:.3} of {best:.3} m: {from:?} to {to:?}, {:?}",
                        plan.length_m, plan.by
                    );
                }
            }
            Some(plan)
        }
        Err(PlanError::Blocked { .. } | PlanError::Outside { .. }) => {
            row.asked -= 1;
            None
        }
        Err(_) => {
            row.none += 1;
            row.none_ms = row.none_ms.max(took_ms);
            if let Some(best) = best {
                row.missed += 1;
                eprintln!("room {number}: not found, known with {best:.3} m: {from:?} to {to:?}");
            }
            None
        }
    }
}
