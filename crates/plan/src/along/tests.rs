use super::*;
use crate::footprint::Footprint;
use crate::map::Map;
use crate::search::Search;
use crate::space::Space;

/// What is kept around it, m.
const ROOM_M: f64 = 0.02;

/// A footprint of 12 by 4 cells in a room of 120 by 80 with walls, and what is found along the way of its inner disc.
fn in_room<T>(walls: &[[f64; 4]], ends: [Pose2; 2], look: impl FnOnce(&mut Places<'_, '_>) -> T) -> T {
    let mut map = Map::empty([120, 80], 0.05).unwrap();
    for [left, low, right, high] in walls {
        map.block_polygon(&[[*left, *low], [*right, *low], [*right, *high], [*left, *high]]);
    }
    let space = Space::new(map);
    let footprint = Footprint::new(vec![[-0.3, -0.1], [0.3, -0.1], [0.3, 0.1], [-0.3, 0.1]]).unwrap();
    let [outer_m, inner_m] =
        [footprint.outer_radius_m(), footprint.inner_radius_m()].map(|radius_m| radius_m + ROOM_M);
    let search = Search::new(&space, space.clearance(), inner_m);
    let cell = |pose: &Pose2| search.index(pose.x_m as usize, pose.y_m as usize);
    let cells = search.shortest(cell(&ends[0]), cell(&ends[1])).unwrap();
    let places = cells[1..cells.len() - 1].iter().map(|cell| {
        let [x, y] = search.place(*cell).map(|at| f64::from(at) + 0.5);
        Pose2::new(x, y, 0.0)
    });
    let way: Vec<Pose2> = [ends[0]].into_iter().chain(places).chain([ends[1]]).collect();
    let mut checker = space.checker(&footprint, ROOM_M).coarse(ROOM_M);
    look(&mut Places::new(&way, ends, &mut checker, outer_m / space.map.cell_m))
}

/// In cells, from m.
fn pose(x_m: f64, y_m: f64, heading_rad: f64) -> Pose2 {
    Pose2::new(x_m / 0.05, y_m / 0.05, heading_rad)
}

/// Two walls across the room, with a door on each side that one heading passes.
const DOORS: [[f64; 4]; 4] =
    [[2.0, 0.0, 2.2, 0.5], [2.0, 0.8, 2.2, 4.0], [4.0, 0.0, 4.2, 3.2], [4.0, 3.5, 4.2, 4.0]];

#[test]
fn it_turns_through_doors_and_looks_at_few_states() {
    let ends = [pose(1.0, 2.0, 1.57), pose(5.0, 2.0, -1.57)];
    in_room(&DOORS, ends, |along| {
        let way = along.way(Until::default()).unwrap();
        assert_eq!(way[0], ends[0]);
        let last = way[way.len() - 1];
        assert!(last.distance_m(ends[1]) < 1e-9, "{last:?}");
        assert!(wrap_angle_rad(last.heading_rad - ends[1].heading_rad).abs() < 1e-9, "{last:?}");
        for pair in way.windows(2) {
            assert!(along.checker.is_motion_free_in_cells(&pair[0], &pair[1]), "{pair:?}");
            assert!((pair[1].heading_rad - pair[0].heading_rad).abs() < 2.0 * along.step_rad(), "{pair:?}");
        }
        let length = |way: &[Pose2]| way.windows(2).map(|pair| pair[0].distance_m(pair[1])).sum::<f64>();
        // Drawn taut it is shorter.
        let least = f64::from(along.left[0]);
        assert!((least - 1.0..1.1 * least).contains(&length(&way)), "{} of {least}", length(&way));
    });
}

#[test]
fn where_it_needn_t_turn_few_states_are_looked_at() {
    // Past a corner, with a side towards it.
    let ends = [pose(1.0, 2.0, 0.0), pose(5.0, 1.5, 0.0)];
    in_room(&[[2.5, 1.3, 3.5, 4.0]], ends, |along| {
        assert!(along.way(Until::default()).is_some());
        let looked = along.stands.iter().filter(|stands| !matches!(stands, Stands::Unknown)).count();
        assert!(looked < 6 * along.places.len(), "{looked} at {} places", along.places.len());
    });
}

#[test]
fn what_nothing_long_gets_around_is_no_way() {
    // A corridor as wide as the robot is, with a bend.
    let bend = [[2.0, 0.0, 6.0, 1.0], [2.0, 1.3, 3.0, 4.0], [3.3, 1.0, 6.0, 4.0]];
    let ends = [pose(1.0, 1.0, 0.0), pose(3.15, 3.6, 1.57)];
    assert!(in_room(&bend, ends, |along| along.way(Until::default()).is_none()));
}

#[test]
fn it_ends_where_nobody_waits_for_it() {
    let ends = [pose(1.0, 2.0, 1.57), pose(5.0, 2.0, -1.57)];
    assert!(in_room(&DOORS, ends, |along| along.way(Until::over(&|| true)).is_none()));
}
