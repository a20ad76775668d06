//! Plans in public rooms: maps of the grid benchmarks, from a folder outside the repository that `OMNIBASE_ROOMS` names.

#[path = "../examples/rooms/mod.rs"]
mod rooms;

use omnibase_plan::{Footprint, Map};
use omnibase_platform::Pose2;

/// Plans of a robot in a room.
const PLANS: usize = 12;
const CELL_M: f64 = 0.5;
const RADIUS_M: f64 = 0.2;

/// From a place to the nearest occupied square among those around it, m.
fn room_m(map: &Map, at: &Pose2) -> f64 {
    let [column, row] = [at.x_m, at.y_m].map(|at| (at / CELL_M) as usize);
    let around = |cell: usize, count: usize| cell.saturating_sub(2)..(cell + 3).min(count);
    let mut least = f64::INFINITY;
    for y in around(row, map.height) {
        for x in around(column, map.width).filter(|x| map.blocked[y * map.width + x]) {
            let off = |at: f64, cell: usize| {
                (cell as f64 * CELL_M - at).max(at - (cell + 1) as f64 * CELL_M).max(0.0)
            };
            least = least.min(off(at.x_m, x).hypot(off(at.y_m, y)));
        }
    }
    least
}

#[test]
fn a_disc_gets_through_public_rooms_without_touching_anything() {
    let Some(folder) = std::env::var_os("OMNIBASE_ROOMS") else {
        return println!("SKIPPED: OMNIBASE_ROOMS names no folder with maps of the grid benchmarks");
    };
    let rooms = rooms::read(folder.as_ref(), CELL_M).unwrap();
    assert!(!rooms.is_empty(), "no NAME.map with a NAME.map.scen in {}", folder.display());
    let footprint = Footprint::disc(RADIUS_M).unwrap();
    for room in rooms {
        // The longest are last; those of a maze take minutes.
        let asked = &room.asked[..room.asked.len() / 4];
        for (number, (ends, best)) in asked.iter().step_by((asked.len() / PLANS).max(1)).enumerate() {
            let plan = match room.plan(&footprint, *ends, [0.0, number as f64], 0.03) {
                Ok(plan) => plan,
                Err(error) => panic!("{}: {ends:?}: {error}", room.name),
            };
            // Along eight directions ways through centres are never shorter than one at any angle, but a disc keeps away from corners.
            assert!(plan.length_m <= 1.1 * best * CELL_M + 0.5, "{}: {ends:?}: {}", room.name, plan.length_m);
            for pair in plan.poses.windows(2) {
                for step in 0..20 {
                    let part = f64::from(step) / 20.0;
                    let at = |from: f64, to: f64| from + part * (to - from);
                    let pose = Pose2::new(at(pair[0].x_m, pair[1].x_m), at(pair[0].y_m, pair[1].y_m), 0.0);
                    let room_m = room_m(&room.space.map, &pose);
                    assert!(room_m >= RADIUS_M, "{}: {ends:?}: {room_m} m at {pose:?}", room.name);
                }
            }
        }
    }
}
