use super::tree::NOBODY;
use super::*;
use crate::ahead::Ahead;
use crate::map::Map;

/// Squares of one to six cells, wherever they come; the corners of the room stay free.
fn cluttered(seed: u64, [width, height]: [usize; 2]) -> Space {
    let mut state = seed;
    let mut next = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    let mut map = Map::empty([width, height], 1.0).unwrap();
    for _ in 0..width * height / 60 {
        let (column, row, side) = (next(width), next(height), 1 + next(6));
        for row in row..(row + side).min(height) {
            for column in column..(column + side).min(width) {
                let is_corner = column.min(width - 1 - column) < 4 && row.min(height - 1 - row) < 4;
                map.blocked[row * width + column] |= !is_corner;
            }
        }
    }
    Space::new(map)
}

#[test]
fn whoever_is_reached_is_seen_from_where_the_way_turned() {
    let size = [90, 70];
    let (mut found, mut looked) = (0, 0);
    for seed in 0..40 {
        let space = cluttered(seed, size);
        let search = Search::new(&space, space.clearance(), 1.0);
        let (from, to) = (search.index(1, 1), search.index(size[0] - 2, size[1] - 2));
        let Some(tree) = search.tree(from, to) else { continue };
        found += 1;
        for (at, cell) in tree.cells.iter().enumerate().filter(|(_, cell)| cell.is_done) {
            if cell.parent != NOBODY {
                looked += 1;
                assert!(search.sees(cell.parent as usize, at), "seed {seed}: {} to {at}", cell.parent);
            }
        }
    }
    assert!(found > 20 && looked > 10_000, "{found} ways, {looked} cells");
}

#[test]
fn what_is_left_of_a_way_is_never_told_longer_than_it_is_and_around_walls_hardly_shorter() {
    let size = [90, 70];
    let mut found = 0;
    for seed in 0..200 {
        let space = cluttered(seed, size);
        let search = Search::new(&space, space.clearance(), 1.0);
        let (from, to) = (search.index(1, 1), search.index(size[0] - 2, size[1] - 2));
        let Some(way) = search.shortest(from, to) else { continue };
        found += 1;
        let ahead = Ahead::new(&search, size, from, to).unwrap();
        for (number, at) in way.iter().enumerate() {
            let (left, rest) = (ahead.left(search.place(*at)), search.length(&way[number..]) as f32);
            assert!(left <= rest + 1e-3, "seed {seed}: {left} of {rest}");
        }
    }
    assert!(found > 100, "{found} ways");
    // Around the ends of three walls.
    let mut map = Map::empty([200, 200], 1.0).unwrap();
    for (column, rows) in [(50, 0..180), (100, 20..200), (150, 0..180)] {
        rows.for_each(|row| map.blocked[row * 200 + column] = true);
    }
    let space = Space::new(map);
    let search = Search::new(&space, space.clearance(), 3.0);
    let (from, to) = (search.index(10, 10), search.index(190, 10));
    let length = search.length(&search.shortest(from, to).unwrap()) as f32;
    let left = Ahead::new(&search, [200, 200], from, to).unwrap().left(search.place(from));
    assert!(length > 500.0 && left > 0.95 * length, "{left} of {length}");
    // What is closed off is told at once.
    let mut map = space.map.clone();
    (180..200).for_each(|row| map.blocked[row * 200 + 50] = true);
    let space = Space::new(map);
    let search = Search::new(&space, space.clearance(), 3.0);
    assert!(Ahead::new(&search, [200, 200], from, to).is_none() && search.shortest(from, to).is_none());
}

/// A room of polygons, in cells of 1 m.
fn polygons(seed: u64) -> Space {
    let mut state = seed;
    let mut next = |low: f64, high: f64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (state >> 33) as f64 / (1_u64 << 31) as f64
    };
    let mut map = Map::empty([120, 90], 1.0).unwrap();
    for _ in 0..12 {
        let [x, y] = [next(0.0, 120.0), next(0.0, 90.0)];
        let corner = |far: f64, turn: f64| [x + far * turn.cos(), y + far * turn.sin()];
        map.block_polygon(&[0.5, 2.6, 4.7].map(|turn| corner(next(1.0, 12.0), turn)));
    }
    Space::new(map)
}

#[test]
fn along_a_view_the_disc_has_its_room_and_where_it_has_more_it_is_seen() {
    const RADIUS: f64 = 5.0;
    let (mut seen, mut missed) = (0, 0);
    for seed in 0..40 {
        let space = polygons(seed);
        let clearance = space.sharpened([RADIUS - 1.0, RADIUS + 1.0]);
        let search = Search::new(&space, &clearance, RADIUS);
        let open: Vec<usize> = (0..clearance.len()).filter(|at| search.is_open(*at)).collect();
        for (number, from) in open.iter().enumerate().step_by(97) {
            let to = open[number * 31 % open.len()];
            let [a, b] = [*from, to].map(|at| search.place(at).map(|at| f64::from(at) + 0.5));
            let steps = 4.0 * search.apart(*from, to).ceil();
            let room = |step: usize| {
                let at = |axis: usize| a[axis] + (b[axis] - a[axis]) * step as f64 / f64::from(steps);
                space.distance([at(0), at(1)], 2.0 * RADIUS)
            };
            let least = (0..=steps as usize).map(room).fold(f64::INFINITY, f64::min);
            if search.sees(*from, to) {
                seen += 1;
                // Three times what one thing in the way is bent by between two centres.
                assert!(least > RADIUS - 0.375 / (RADIUS - 1.0), "seed {seed}: {from} to {to}: {least}");
            } else if least > RADIUS + 0.1 {
                missed += 1;
            }
        }
    }
    assert!(seen > 500 && missed < seen / 100, "{seen} seen, {missed} missed");
}

#[test]
fn what_is_barred_is_neither_seen_through_nor_gone_through() {
    // Two halls, and a door between them with much room, or hardly any and between the cells; one column of it is barred.
    const RADIUS: f64 = 3.0;
    for [low, high] in [[31.0, 49.0], [36.6, 43.05]] {
        let mut map = Map::empty([120, 80], 1.0).unwrap();
        for [low, high] in [[0.0, low], [high, 80.0]] {
            map.block_polygon(&[[59.8, low], [61.2, low], [61.2, high], [59.8, high]]);
        }
        let space = Space::new(map);
        let clearance = space.sharpened([RADIUS - 1.0, RADIUS + 8.0]);
        let free = Gaps::new(&space, &clearance, RADIUS as f32, RADIUS as f32 + 1.0, &[]);
        let whole = Search::through(&space, &free, RADIUS);
        let column = (0..80).map(|row| whole.index(60, row)).filter(|cell| whole.takes(*cell));
        let mut gaps = free.clone();
        gaps.bar(&column.collect::<Vec<usize>>());
        let barred = whole.barred(&gaps, 6.5);
        let mut seen = 0;
        for number in 0..60 * 60 {
            let [from, to] = [(8 + number % 45, 12 + number / 60), (68 + number % 45, 70 - number / 60)]
                .map(|(column, row)| whole.index(column, row));
            seen += usize::from(whole.sees(from, to));
            assert!(!barred.sees(from, to) && !barred.sees(to, from), "{from} to {to}");
            assert!(barred.sees(from, from + 1));
        }
        assert!(low > 35.0 || seen > 100, "{seen}");
        let [from, to] = [whole.index(20, 40), whole.index(100, 40)];
        assert!(whole.shortest(from, to).is_some() && barred.shortest(from, to).is_none());
    }
}
