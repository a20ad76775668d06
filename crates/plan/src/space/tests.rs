use super::*;

#[test]
fn an_outline_may_move_as_far_as_it_is_told_and_no_look_is_wrong() {
    let mut state = 4_u64;
    let mut next = |low: f64, high: f64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (state >> 33) as f64 / (1_u64 << 31) as f64
    };
    let footprint = Footprint::new(vec![[-3.5, -2.5], [4.5, -2.5], [4.5, 2.5], [-3.5, 2.5]]).unwrap();
    let mut told = [0; 3];
    for room in 0..60 {
        let mut map = Map::empty([60, 50], 1.0).unwrap();
        for number in 0..8 {
            let ([x, y], turn) = ([next(0.0, 60.0), next(0.0, 50.0)], next(0.0, 3.0));
            let corner = |part: f64| [x + 4.0 * (turn + part).cos(), y + 2.0 * (turn + part).sin()];
            // Polygons alone, cells alone, and both.
            if room % 3 != 1 && number > 0 {
                map.block_polygon(&[0.0, 2.0, 4.0].map(corner));
            } else if room % 3 != 0 {
                (0..9).for_each(|at| {
                    map.blocked[(y as usize + at / 3).min(49) * 60 + (x as usize + at % 3).min(59)] = true
                });
            }
        }
        let space = Space::new(map);
        let mut checker = space.checker(&footprint, 0.0);
        for _ in 0..300 {
            let pose = Pose2::new(next(0.0, 60.0), next(0.0, 50.0), next(-3.0, 3.0));
            let found = checker.spare(&pose);
            let corners = footprint.placed_m(&pose);
            let is_exact = |corners: &[Point]| {
                let range = range(corners);
                let [[left, low], [right, high]] = range;
                left >= 0.0
                    && low >= 0.0
                    && right <= 60.0
                    && high <= 50.0
                    && !space.map.solids.iter().any(|solid| solid.overlaps(corners, range))
                    && space.clone().checker(&footprint, 0.0).is_polygon_free(corners, range)
            };
            assert_eq!(found.is_some(), is_exact(&corners), "{room}: {pose:?}");
            let Some(spare) = found else { continue };
            told[0] += 1;
            told[1] += usize::from(spare > 0.0);
            told[2] += usize::from(spare > 0.0 && spare < FARTHER);
            for _ in 0..4 {
                let (sin, cos) = next(0.0, 6.3).sin_cos();
                let far = 0.999 * spare;
                let moved: Vec<Point> = corners.iter().map(|[x, y]| [x + far * cos, y + far * sin]).collect();
                assert!(is_exact(&moved), "{room}: {pose:?} by {far}");
            }
        }
    }
    assert!(told[1] > 500 && told[2] > 100, "{told:?}");
}

#[test]
fn discs_cover_an_outline() {
    let rectangle = |a: f64, b: f64| vec![[-a, -b], [a, -b], [a, b], [-a, b]];
    let wedge = vec![[-5.0, -3.0], [7.0, -0.5], [7.0, 0.5], [-5.0, 3.0]];
    for outline in [rectangle(14.0, 5.0), rectangle(5.0, 14.0), rectangle(200.0, 2.0), wedge] {
        let (cover, radius) = covering(&outline);
        for (at, from) in outline.iter().enumerate() {
            let to = outline[(at + 1) % outline.len()];
            for part in (0..=100).map(|part| f64::from(part) / 100.0) {
                let [x, y] = [0, 1].map(|axis| from[axis] + part * (to[axis] - from[axis]));
                let off = cover.iter().map(|middle| (middle[0] - x).hypot(middle[1] - y));
                assert!(off.fold(f64::INFINITY, f64::min) <= radius + 1e-9, "({x}, {y}) of {outline:?}");
            }
        }
        let width = outline.iter().map(|corner| corner[1].abs().min(corner[0].abs())).fold(0.0, f64::max);
        assert!(cover.len() == 16 || radius < 1.2 * width, "{radius} around {outline:?}");
    }
}

#[test]
fn beside_a_wall_a_look_tells_all_the_room_there_is() {
    let mut map = Map::empty([60, 50], 1.0).unwrap();
    // Not along the cells, so that no side of the outline is along it either.
    map.block_polygon(&[[0.0, 0.0], [60.0, 6.0], [60.0, 5.0], [0.0, -1.0]]);
    let space = Space::new(map);
    let footprint = Footprint::new(vec![[-3.5, -2.5], [4.5, -2.5], [4.5, 2.5], [-3.5, 2.5]]).unwrap();
    let mut checker = space.checker(&footprint, 0.0);
    let out = |[x, y]: Point| (y - 0.1 * x) / 1.0_f64.hypot(0.1);
    for turn in 0..60 {
        let pose = Pose2::new(30.0, 8.0, 0.1 * f64::from(turn));
        let room = footprint.placed_m(&pose).into_iter().map(out).fold(f64::INFINITY, f64::min);
        let told = checker.spare(&pose);
        let expected = if room > 0.0 { Some(room.min(FARTHER)) } else { None };
        assert!(
            told.zip(expected).is_none_or(|(told, room)| (told - room).abs() < 1e-9),
            "{told:?}, {expected:?}"
        );
        assert_eq!(told.is_some(), expected.is_some(), "{turn}");
    }
}
