use super::*;
use crate::footprint::Footprint;
use crate::map::Map;
use crate::plan::{Cost, plan};
use crate::until::Until;

/// What is kept around it, m.
const ROOM_M: f64 = 0.03;

/// A room of 8 by 6 m with polygons in it.
fn room(polygons: &[Vec<[f64; 2]>]) -> Space {
    let mut map = Map::of_room(&[[0.0, 0.0], [8.0, 0.0], [8.0, 6.0], [0.0, 6.0]], 0.05).unwrap();
    polygons.iter().for_each(|polygon| map.block_polygon(polygon));
    Space::new(map)
}

fn wall([left, low, right, high]: [f64; 4]) -> Vec<[f64; 2]> {
    vec![[left, low], [right, low], [right, high], [left, high]]
}

fn oblong(length_m: f64) -> Footprint {
    let half = 0.5 * length_m;
    Footprint::new(vec![[-half, -0.25], [half, -0.25], [half, 0.25], [-half, 0.25]]).unwrap()
}

fn task<'a>(space: &'a Space, footprint: &'a Footprint, ends: [[f64; 3]; 2]) -> Task<'a> {
    let [from, to] = ends.map(|[x, y, heading]| Pose2::new(x, y, heading));
    let (cost, until) = (Cost::Shortest, Until::default());
    Task { space, footprint, from, to, clearance_m: ROOM_M, cost, until }
}

/// What is found along the inner disc's ways, and the looks for it.
fn along(polygons: &[Vec<[f64; 2]>], footprint: &Footprint, ends: [[f64; 3]; 2]) -> (Along, usize) {
    let space = room(polygons);
    let mut planner = Planner::new(&task(&space, footprint, ends), true).unwrap();
    let [outer_m, inner_m] = [footprint.outer_radius_m(), footprint.inner_radius_m()].map(|m| m + ROOM_M);
    let [outer, inner] = [outer_m, inner_m].map(|radius_m| radius_m / space.map.cell_m);
    let clearance = space.sharpened([inner - 1.0, outer + 1.0]);
    let gaps = Gaps::new(&space, &clearance, inner as f32, inner as f32 + 1.0, &[]);
    let discs = Discs {
        inner: Search::through(&space, &gaps, inner_m),
        outer: Search::new(&space, &clearance, outer_m),
        gaps: &gaps,
    };
    let way = planner.inner_way(&discs.inner).unwrap();
    let mut coarse = planner.checker.coarse(ROOM_M);
    let found = planner.along(&way, &discs, &mut coarse);
    (found, coarse.looks)
}

/// Two rooms and a corridor of 0.6 m between them, with a bend.
fn bend() -> Vec<Vec<[f64; 2]>> {
    [[3.0, 0.0, 5.0, 2.0], [3.0, 2.6, 3.7, 6.0], [4.3, 2.0, 5.0, 4.4], [3.7, 5.0, 5.0, 6.0]]
        .map(wall)
        .to_vec()
}

/// On both sides of them.
const SIDES: [[f64; 3]; 2] = [[1.5, 2.3, 0.0], [6.5, 4.7, 0.0]];

#[test]
fn where_it_is_stopped_and_nothing_else_leads_on_there_is_no_way_and_few_looks_tell_it() {
    let (found, looks) = along(&bend(), &oblong(1.4), SIDES);
    assert!(matches!(found, Along::NoWay));
    assert!(looks < 18_000, "{looks}");
}

#[test]
fn where_it_is_stopped_the_disc_s_next_way_is_taken() {
    // Another passage, two metres farther.
    let mut polygons = bend();
    polygons[0] = wall([3.0, 0.9, 5.0, 2.0]);
    let (found, looks) = along(&polygons, &oblong(1.4), SIDES);
    let Along::OtherWay(plan) = found else { panic!("nothing else") };
    let lowest = plan.poses.iter().map(|pose| pose.y_m).fold(6.0, f64::min);
    assert!(lowest < 0.7 && plan.length_m < 8.8, "{lowest}, {} m", plan.length_m);
    assert!(looks < 20_000, "{looks}");
}

#[test]
fn what_stops_it_is_passed_from_farther_beside_the_disc_s_way() {
    // A door 0.7 m wide beside the way: it has to be straight before it by then.
    let door = [[4.0, 0.0, 4.3, 3.3], [4.0, 3.95, 4.3, 6.0]].map(wall);
    let ends = [[3.2, 0.9, 1.57], [5.0, 0.9, 1.57]];
    let (found, _) = along(&door, &oblong(1.4), ends);
    let Along::OtherWay(plan) = found else { panic!("it isn't passed") };
    assert_eq!(plan.by, By::Turning);
    let in_door = plan.poses.iter().find(|pose| (pose.x_m - 4.15).abs() < 0.1).unwrap();
    assert!(in_door.heading_rad.sin().abs() < 0.3, "{in_door:?}");
}

#[test]
fn a_passage_that_only_finer_cells_show_is_passed() {
    // Between a block and a wall, 2 cm wider than the robot with its room, into which it has to turn.
    let block = vec![[7.42, 1.349], [6.455, 2.101], [6.207, 1.781], [7.171, 1.03]];
    let (space, footprint) = (room(&[block]), oblong(0.7));
    let ends = [[7.624, 0.779, 1.517], [6.426, 3.289, 0.657]];
    let found = plan(&task(&space, &footprint, ends)).unwrap();
    assert!(found.length_m < 2.95, "{} m", found.length_m);
}

#[test]
fn a_map_s_part_in_finer_cells_has_the_same_in_the_way() {
    let mut map = Map::of_room(&[[0.0, 0.0], [8.0, 0.0], [8.0, 6.0], [0.0, 6.0]], 0.05).unwrap();
    map.map_from_grid = Pose2::new(1.0, 2.0, 0.4);
    map.block_polygon(&[[3.0, 3.0], [4.0, 3.2], [3.5, 4.0]]);
    map.block_circle([5.0, 4.0], 0.3);
    let finer = map.finer([20, 10], [60, 70]).unwrap();
    assert_eq!([finer.width, finer.height], [120, 140]);
    let spaces = [&map, &finer].map(|map| Space::new(map.clone()));
    let mut blocked = 0;
    for number in 0..3000 {
        let at = [f64::from(number % 60) + 20.3, f64::from(number / 60) + 10.7];
        let in_map = map.map_from_grid.then(Pose2::new(at[0] * map.cell_m, at[1] * map.cell_m, 0.0));
        let in_finer = finer.grid_cells([in_map.x_m, in_map.y_m]);
        let border = (0..2).map(|axis| in_finer[axis].min([120.0, 140.0][axis] - in_finer[axis]));
        let most = border.fold(8.0, f64::min);
        let [coarse, fine] = [spaces[0].distance(at, 0.5 * most), 0.5 * spaces[1].distance(in_finer, most)];
        assert!((coarse - fine).abs() < 1e-9, "{at:?}: {coarse}, {fine}");
        blocked += usize::from(fine < 0.5 * most);
    }
    assert!(blocked > 100, "{blocked}");
}
