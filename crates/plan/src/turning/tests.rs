use super::*;
use crate::footprint::Footprint;
use crate::map::Map;
use crate::space::Space;

/// What is kept around it.
const ROOM_M: f64 = 0.02;

/// A footprint of 12 by 4 cells, and looks of its discs in a room with cells of 5 cm.
fn in_room<T>(space: &Space, look: impl FnOnce(&mut Turning<'_, '_>) -> T) -> T {
    let footprint = Footprint::new(vec![[-0.3, -0.1], [0.3, -0.1], [0.3, 0.1], [-0.3, 0.1]]).unwrap();
    let [outer_m, inner_m] =
        [footprint.outer_radius_m(), footprint.inner_radius_m()].map(|radius_m| radius_m + ROOM_M);
    let mut checker = space.checker(&footprint, ROOM_M).coarse(ROOM_M);
    let [outer, inner] = [outer_m, inner_m].map(|radius_m| Search::new(space, space.clearance(), radius_m));
    look(&mut Turning::new(&mut checker, outer, inner, space.clearance(), [0; 2]).unwrap())
}

#[test]
fn whether_there_is_a_way_is_known_before_it_is_looked_for() {
    let mut state = 3_u64;
    let mut next = |low: f64, high: f64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (state >> 33) as f64 / (1_u64 << 31) as f64
    };
    let mut count = [0; 2];
    for number in 0..60 {
        let mut map = Map::empty([60, 40], 0.05).unwrap();
        for _ in 0..14 + number % 6 {
            let ([x, y], turn) = ([next(0.0, 3.0), next(0.0, 2.0)], next(0.0, 3.0));
            let half = [next(0.03, 0.5), next(0.03, 0.1)];
            let (sin, cos) = f64::sin_cos(turn);
            let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
                .map(|[a, b]| [a * half[0], b * half[1]])
                .map(|[a, b]| [x + cos * a - sin * b, y + sin * a + cos * b]);
            map.block_polygon(&corners);
        }
        let space = Space::new(map);
        in_room(&space, |turning| {
            let cells = turning.looked.len() / turning.headings;
            let mut free = Vec::new();
            for at in (0..cells).step_by(7) {
                free.extend((0..turning.headings).step_by(5).map(|heading| (at, heading)));
            }
            free.retain(|(cell, heading)| turning.is_free(*cell, *heading));
            for _ in 0..5 {
                let [from, to] = [0, 1].map(|_| free[next(0.0, free.len() as f64) as usize]);
                let outer = turning.outer;
                let regions = turning.regions(|cell| outer.is_open(cell));
                let is_there = turning.hang_together(&[from], &[to], &regions);
                let is_near = turning.ways_to(to.0)[from.0].is_finite();
                let is_found = is_near && turning.way(&[from], &[to]).is_some();
                assert_eq!(is_there, is_found, "{number}: {from:?} to {to:?}");
                count[usize::from(is_there)] += 1;
            }
        });
    }
    assert!(count.iter().all(|count| *count > 30), "{count:?}");
}

#[test]
fn what_cannot_be_reached_is_told_by_looks_in_the_passage_alone() {
    // Two halls, and a passage between them that is wide enough, with a bend around which nothing long gets.
    let mut map = Map::empty([240, 160], 0.05).unwrap();
    for [left, low, right, high] in
        [[5.5, 0.0, 6.5, 4.0], [5.5, 4.25, 6.2, 8.0], [6.5, 3.0, 6.8, 4.5], [6.2, 4.75, 6.5, 8.0]]
    {
        map.block_polygon(&[[left, low], [right, low], [right, high], [left, high]]);
    }
    let space = Space::new(map);
    in_room(&space, |turning| {
        let [from, to] = [[2.0, 4.0], [10.0, 4.0]].map(|[x, y]| Pose2::new(x / 0.05, y / 0.05, 0.0));
        assert_eq!(turning.shortest(&from, &to), Vec::<Vec<CellPose>>::new());
        let looked = turning.looked.iter().filter(|looked| **looked != 0).count();
        let cells = 0..turning.looked.len() / turning.headings;
        let narrow =
            cells.filter(|cell| turning.inner.is_open(*cell) && !turning.outer.is_open(*cell)).count();
        let all = narrow * turning.headings;
        assert!(looked > 10 && looked * 10 < all, "{looked} of {all}");
    });
}

#[test]
fn a_state_takes_few_looks() {
    let mut map = Map::empty([60, 40], 0.05).unwrap();
    // A door that one heading passes, and nothing beside it.
    for [low, high] in [[0.0, 0.85], [1.15, 2.0]] {
        map.block_polygon(&[[1.4, low], [1.6, low], [1.6, high], [1.4, high]]);
    }
    let space = Space::new(map);
    in_room(&space, |turning| {
        let [from, to] = [[0.5, 1.0], [2.5, 1.0]].map(|[x, y]| Pose2::new(x / 0.05, y / 0.05, 1.5));
        let looks_at_states = |turning: &mut Turning<'_, '_>| {
            let states = turning.looked.iter().filter(|looked| **looked != 0).count();
            (turning.checker.looks, states)
        };
        let (begins, ends) = (turning.around(&from), turning.around(&to));
        assert!(turning.way(&begins, &ends).is_some());
        // Those in the door's middle that something is in the way of are looked for beside it, too.
        let (looks, states) = looks_at_states(turning);
        assert!(states > 300 && looks < 9 * states, "{looks} looks at {states} states");
        // On the way back all of them are.
        assert_eq!(turning.shortest(&from, &to).len(), 2);
        let (looks, states) = looks_at_states(turning);
        assert!(looks < 30 * states, "{looks} looks at {states} states");
    });
}
