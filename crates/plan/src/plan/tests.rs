use super::*;
use crate::map::Map;

fn room(walls: &[[f64; 4]]) -> Space {
    let mut map = Map::of_room(&[[0.0, 0.0], [8.0, 0.0], [8.0, 6.0], [0.0, 6.0]], 0.05).unwrap();
    for [left, low, right, high] in walls {
        map.block_polygon(&[[*left, *low], [*right, *low], [*right, *high], [*left, *high]]);
    }
    Space::new(map)
}

fn long() -> Footprint {
    Footprint::new(vec![[-0.7, -0.25], [0.7, -0.25], [0.7, 0.25], [-0.7, 0.25]]).unwrap()
}

fn ask<'a>(space: &'a Space, footprint: &'a Footprint, [from, to]: [[f64; 3]; 2]) -> Task<'a> {
    let pose = |[x, y, heading]: [f64; 3]| Pose2::new(x, y, heading);
    Task {
        space,
        footprint,
        from: pose(from),
        to: pose(to),
        clearance_m: 0.03,
        cost: Cost::Shortest,
        until: Until::default(),
    }
}

/// Whether a place lies in a footprint, a look of its own.
fn covers(footprint: &Footprint, pose: &Pose2, place: [f64; 2]) -> bool {
    let corners = footprint.placed_m(pose);
    (0..corners.len()).all(|at| {
        let (from, to) = (corners[at], corners[(at + 1) % corners.len()]);
        (to[0] - from[0]) * (place[1] - from[1]) - (to[1] - from[1]) * (place[0] - from[0]) >= 0.0
    })
}

/// Walks a plan in steps of a few millimetres and looks at all walls by their corners and at the footprint's corners.
fn touched(plan: &Plan, footprint: &Footprint, walls: &[[f64; 4]]) -> Option<Pose2> {
    for pair in plan.poses.windows(2) {
        for part in 0..20 {
            let pose = crate::smooth::between(&pair[0], &pair[1], f64::from(part) / 20.0);
            for [left, low, right, high] in walls {
                let corner_in = [[*left, *low], [*right, *low], [*left, *high], [*right, *high]]
                    .into_iter()
                    .any(|corner| covers(footprint, &pose, corner));
                let inside = |[x, y]: &[f64; 2]| x > left && x < right && y > low && y < high;
                if corner_in || footprint.placed_m(&pose).iter().any(inside) {
                    return Some(pose);
                }
            }
            if footprint.placed_m(&pose).iter().any(|[x, y]| *x < 0.0 || *y < 0.0 || *x > 8.0 || *y > 6.0) {
                return Some(pose);
            }
        }
    }
    None
}

#[test]
fn a_long_robot_turns_to_pass_a_door_that_one_heading_passes() {
    // A door 0.7 m wide in a wall; the robot is 1.4 m long and 0.5 m wide, and stands across.
    let walls = [[4.0, 0.0, 4.2, 2.65], [4.0, 3.35, 4.2, 6.0]];
    let (space, footprint) = (room(&walls), long());
    let plan = plan(&ask(&space, &footprint, [[1.5, 1.5, 1.57], [6.5, 4.5, 1.57]])).unwrap();
    assert_eq!(plan.by, By::Turning);
    assert_eq!(touched(&plan, &footprint, &walls), None);
    let in_door = plan.poses.iter().find(|pose| (pose.x_m - 4.1).abs() < 0.1).unwrap();
    // With its clearance it fits by 0.45 rad at most.
    assert!(in_door.heading_rad.sin().abs() < 0.4, "{in_door:?}");
    assert_eq!(plan.poses[0], Pose2::new(1.5, 1.5, 1.57));
    let end = plan.poses[plan.poses.len() - 1];
    assert!(
        end.distance_m(Pose2::new(6.5, 4.5, 0.0)) < 1e-9 && (end.heading_rad - 1.57).abs() < 1e-9,
        "{end:?}"
    );
    // The straight way is 5.83 m; through the door's middle 5.9 m.
    assert!(plan.length_m < 6.2, "{}", plan.length_m);
}

#[test]
fn ways_are_as_short_as_the_corners_allow_and_smooth() {
    // Around the end of a wall: straight to the disc around its corner, along it, straight on.
    let walls = [[3.9, 0.0, 4.1, 4.0]];
    let (space, footprint) = (room(&walls), Footprint::disc(0.4).unwrap());
    let plan = plan(&ask(&space, &footprint, [[2.0, 2.0, 0.0], [6.0, 2.0, 1.0]])).unwrap();
    assert_eq!((plan.by, touched(&plan, &footprint, &walls)), (By::Disc, None));
    // Tangents to circles of 0.43 m around (3.9, 4) and (4.1, 4).
    let (reach, radius): (f64, f64) = (1.9_f64.hypot(2.0), 0.43);
    let tangent = (reach * reach - radius * radius).sqrt();
    let arc = (2.0_f64 / 1.9).atan() + (radius / reach).asin();
    let best = 2.0 * (tangent + radius * arc) + 0.2;
    assert!((best * 0.999..best * 1.01).contains(&plan.length_m), "{} m, best {best} m", plan.length_m);
    let sharpest = plan.poses.windows(3).map(|three| {
        let way = |a: &Pose2, b: &Pose2| (b.y_m - a.y_m).atan2(b.x_m - a.x_m);
        wrap_angle_rad(way(&three[1], &three[2]) - way(&three[0], &three[1])).abs()
    });
    let sharpest = sharpest.fold(0.0, f64::max);
    assert!(sharpest < 0.35, "a kink of {sharpest} rad");
}

#[test]
fn of_two_ways_on_different_sides_the_shorter_one_is_taken() {
    let footprint = Footprint::disc(0.3).unwrap();
    let mut state = 5_u64;
    let mut between = |low: f64, high: f64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (state >> 33) as f64 / (1_u64 << 31) as f64
    };
    let mut near = 0;
    for _ in 0..150 {
        // A block turned by any angle, and ends on both sides of it; then the same with either side closed.
        let (middle, angle_rad) =
            ([between(3.7, 4.3), between(2.7, 3.3)], between(0.0, std::f64::consts::PI));
        let half = [between(0.3, 1.6), between(0.1, 0.5)];
        let (sin, cos) = f64::sin_cos(angle_rad);
        let block = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|[x, y]| [x * half[0], y * half[1]])
            .map(|[x, y]| [middle[0] + cos * x - sin * y, middle[1] + sin * x + cos * y]);
        let ends = [[between(0.6, 1.6), between(2.4, 3.6), 0.0], [between(6.4, 7.4), between(2.4, 3.6), 0.0]];
        let length_m = |closed: &[[f64; 2]]| {
            let mut map = Map::of_room(&[[0.0, 0.0], [8.0, 0.0], [8.0, 6.0], [0.0, 6.0]], 0.05).unwrap();
            map.block_polygon(&block);
            if let [low, high] = closed {
                map.block_polygon(&[
                    [low[0], low[1]],
                    [high[0], low[1]],
                    [high[0], high[1]],
                    [low[0], high[1]],
                ]);
            }
            let space = Space::new(map);
            plan(&ask(&space, &footprint, ends)).unwrap().length_m
        };
        let [x, y] = middle;
        let sides = [[[x - 0.01, y], [x + 0.01, 6.0]], [[x - 0.01, 0.0], [x + 0.01, y]]];
        let sides = sides.map(|side| length_m(&side));
        let ratio = length_m(&[]) / sides[0].min(sides[1]);
        near += usize::from((sides[0] / sides[1] - 1.0).abs() < 0.03);
        assert!(ratio < 1.003, "{ratio} of the shorter of {sides:?} m: {block:?}, {ends:?}");
    }
    assert!(near > 15, "{near} with sides that are nearly equal");
}

#[test]
fn a_long_robot_turns_where_that_is_a_tenth_shorter() {
    // Through the near door it is 6.0 m for who turns; through the wide one any heading goes, and 6.64 m.
    let walls = [[3.9, 0.0, 4.1, 2.55], [3.9, 3.45, 4.1, 3.65], [3.9, 5.5, 4.1, 6.0]];
    let (space, long) = (room(&walls), long());
    let upright = std::f64::consts::FRAC_PI_2;
    let found = plan(&ask(&space, &long, [[1.0, 3.0, upright], [7.0, 3.0, upright]])).unwrap();
    assert!(found.by == By::Turning && found.length_m < 6.06, "{:?}, {} m", found.by, found.length_m);
    assert_eq!(touched(&found, &long, &walls), None);
}

#[test]
fn a_way_is_as_short_as_the_way_back() {
    let mut state = 5_u64;
    let mut between = |low: f64, high: f64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (state >> 33) as f64 / (1_u64 << 31) as f64
    };
    let footprint = long();
    let mut turning = 0;
    for room_number in 0..6 {
        let walls: Vec<[f64; 4]> = (0..8)
            .map(|_| {
                let (x, y) = (between(1.0, 7.0), between(1.0, 5.0));
                let (w, h) = (between(0.05, 0.8), between(0.05, 0.4));
                [x - w, y - h, x + w, y + h]
            })
            .collect();
        let space = room(&walls);
        for number in 0..8 {
            let [there, back] = {
                let mut end = || [between(0.8, 7.2), between(0.8, 5.2), between(-3.0, 3.0)];
                let [from, to] = [end(), end()];
                [[from, to], [to, from]].map(|ends| plan(&ask(&space, &footprint, ends)))
            };
            let (Ok(there), Ok(back)) = (there, back) else { continue };
            turning += usize::from(there.by == By::Turning);
            let ratio = there.length_m / back.length_m;
            assert!((0.99..1.01).contains(&ratio), "{room_number}, {number}: {ratio}");
        }
    }
    assert!(turning > 3, "{turning}");
}

#[test]
fn the_ridge_keeps_to_the_middle() {
    let walls = [[2.0, 0.0, 6.0, 1.5], [2.0, 4.5, 6.0, 6.0]];
    let (space, footprint) = (room(&walls), Footprint::disc(0.3).unwrap());
    let ends = [[0.8, 1.0, 0.0], [7.2, 1.0, 0.0]];
    let short = plan(&ask(&space, &footprint, ends)).unwrap();
    let ridge = plan(&Task { cost: Cost::Ridge, ..ask(&space, &footprint, ends) }).unwrap();
    let least = |plan: &Plan| {
        let in_passage =
            plan.poses.iter().zip(&plan.room_m).filter(|(pose, _)| (3.0..5.0).contains(&pose.x_m));
        in_passage.map(|(_, room_m)| *room_m).fold(f64::INFINITY, f64::min)
    };
    assert!(least(&short) < 0.5 && least(&ridge) > 1.2, "{} {}", least(&short), least(&ridge));
    assert_eq!(touched(&ridge, &footprint, &walls), None);
}

#[test]
fn an_end_near_a_wall_takes_the_clearance_from_nothing_else() {
    // It stands 10 mm before a wall; the way leads around the end of another one.
    let walls = [[3.9, 0.0, 4.1, 4.0]];
    let (space, footprint) = (room(&walls), Footprint::disc(0.4).unwrap());
    let near_m = footprint.outer_radius_m() + 0.01;
    let plan = plan(&ask(&space, &footprint, [[near_m, 2.0, 0.0], [6.0, 2.0, 0.0]])).unwrap();
    assert_eq!((plan.clearance_m, touched(&plan, &footprint, &walls)), (0.03, None));
    assert!(plan.poses[0].distance_m(Pose2::new(near_m, 2.0, 0.0)) < 1e-9);
    let beside =
        |pose: &Pose2| (3.9 - pose.x_m).max(pose.x_m - 4.1).max(0.0).hypot((pose.y_m - 4.0).max(0.0));
    let least_m = plan.poses.iter().map(beside).fold(f64::INFINITY, f64::min);
    assert!((0.4 + 0.75 * 0.03..0.45).contains(&least_m), "{least_m}");
    // In a passage with 17 mm on both sides less is kept.
    let passage = [[0.0, 0.0, 8.0, 1.0], [0.0, 1.85, 8.0, 6.0]];
    let (space, footprint) = (room(&passage), Footprint::disc(0.4).unwrap());
    let narrow = super::plan(&ask(&space, &footprint, [[1.0, 1.425, 0.0], [6.0, 1.425, 0.0]])).unwrap();
    assert_eq!((narrow.clearance_m, touched(&narrow, &footprint, &passage)), (0.5 * 0.03, None));
}

#[test]
fn who_has_turned_around_by_the_end_doesn_t_turn_back_before_a_wall() {
    // A corridor with three bends to the left, 10 mm before the end of which it stands: nothing turns back in it.
    let walls = [
        [0.0, 0.0, 8.0, 0.75],
        [4.0, 0.75, 8.0, 6.0],
        [0.0, 3.0, 4.0, 6.0],
        [0.0, 1.25, 2.0, 3.0],
        [2.5, 1.25, 3.5, 2.5],
        [2.0, 1.25, 2.5, 1.75],
    ];
    let footprint = Footprint::new(vec![[-0.3, -0.1], [0.3, -0.1], [0.3, 0.1], [-0.3, 0.1]]).unwrap();
    let down = -std::f64::consts::FRAC_PI_2;
    let plan = plan(&ask(&room(&walls), &footprint, [[0.6, 1.0, 0.0], [2.25, 2.06, down]])).unwrap();
    assert_eq!(touched(&plan, &footprint, &walls), None);
    let last = plan.poses[plan.poses.len() - 1];
    assert!((last.heading_rad - 3.0 * std::f64::consts::FRAC_PI_2).abs() < 1e-9, "{last:?}");
    let turn = plan.poses.windows(2).map(|pair| (pair[1].heading_rad - pair[0].heading_rad).abs());
    assert!(turn.fold(0.0, f64::max) < 1.0);
}

#[test]
fn beside_a_wall_it_turns_only_where_its_corners_have_room() {
    let walls = [[0.0, 0.0, 8.0, 1.0]];
    let space = room(&walls);
    let footprint = Footprint::new(vec![[-0.35, -0.25], [0.35, -0.25], [0.35, 0.25], [-0.35, 0.25]]).unwrap();
    let plan = plan(&ask(&space, &footprint, [[4.0, 1.375, 0.0], [4.0, 1.375, 3.1]])).unwrap();
    // Away from the wall and back, by as much as its corners need.
    assert_eq!(touched(&plan, &footprint, &walls), None);
    assert!((0.13..0.25).contains(&plan.length_m), "{} m", plan.length_m);
}

#[test]
fn a_search_ends_where_nobody_waits_for_it() {
    // Around a wall for the disc, and through a door for the long one that has to turn.
    let door = [[4.0, 0.0, 4.2, 2.65], [4.0, 3.35, 4.2, 6.0]];
    let disc = Footprint::disc(0.3).unwrap();
    let ends = [[1.5, 1.5, 1.57], [6.5, 4.5, 1.57]];
    for footprint in [long(), disc] {
        let space = room(&door);
        // Wherever it is by then, until it is done before.
        let is_done = (0..1000).any(|last| {
            let asked = std::cell::Cell::new(0);
            let is_over = || {
                asked.set(asked.get() + 1);
                asked.get() > last
            };
            let task = Task { until: Until::over(&is_over), ..ask(&space, &footprint, ends) };
            let found = plan(&task);
            let late = asked.get() - last;
            assert!(late < 100, "{late} questions after it was over");
            assert!(found.is_ok() || found == Err(PlanError::Ended), "{found:?}");
            found.is_ok()
        });
        assert!(is_done);
    }
}

#[test]
fn what_cannot_be_reached_is_told_with_the_reason() {
    let closed = [[4.0, 0.0, 4.2, 6.0]];
    let narrow = [[4.0, 0.0, 4.2, 2.8], [4.0, 3.2, 4.2, 6.0]];
    // A corridor as wide as the robot is, with a bend: nothing long gets around it.
    let bend = [[2.0, 0.0, 2.2, 5.3], [2.2, 4.4, 8.0, 5.3], [0.0, 4.4, 1.3, 6.0]];
    let ends = [[1.0, 1.5, 1.57], [6.5, 4.0, 1.57]];
    let tell = |walls: &[[f64; 4]], ends| {
        let (space, footprint) = (room(walls), long());
        plan(&ask(&space, &footprint, ends)).unwrap_err().to_string()
    };
    assert_eq!(tell(&closed, ends), "there is no way: what is in the way lies all around goal");
    let text = tell(&narrow, ends);
    assert_eq!(
        text,
        "there is no way: the narrowest place of the widest one is at most 0.40 m wide, the robot needs 0.56 m"
    );
    let text = tell(&bend, [[1.0, 1.5, 1.57], [6.5, 5.65, 0.0]]);
    assert_eq!(
        text,
        "there is no way: a passage is wide enough, but the robot can't turn so as to get through"
    );
    assert_eq!(
        tell(&closed, [[3.8, 1.0, 0.0], [6.0, 1.0, 0.0]]),
        "start (3.800, 1.000, 0.000): the footprint touches what is in the way there"
    );
    assert_eq!(
        tell(&closed, [[1.0, 1.5, 0.0], [9.0, 1.0, 0.0]]),
        "goal (9.000, 1.000, 0.000): the footprint reaches beyond the map, or the fence"
    );
    assert_eq!(
        tell(&closed, [[1.0, f64::NAN, 0.0], [6.0, 1.0, 0.0]]),
        "start: expected finite numbers, found (1, NaN, 0)"
    );
}

type Polygon = Vec<[f64; 2]>;

/// The length of a way of a robot of 0.7 by 0.5 m in a room with blocks.
fn length_among_m(blocks: &[[[f64; 2]; 4]], ends: [[f64; 3]; 2]) -> f64 {
    let footprint = Footprint::new(vec![[-0.35, -0.25], [0.35, -0.25], [0.35, 0.25], [-0.35, 0.25]]).unwrap();
    let mut map = Map::of_room(&[[0.0, 0.0], [8.0, 0.0], [8.0, 6.0], [0.0, 6.0]], 0.05).unwrap();
    blocks.iter().for_each(|block| map.block_polygon(block));
    plan(&ask(&Space::new(map), &footprint, ends)).unwrap().length_m
}

#[test]
fn a_short_way_around_a_corner_is_as_short_as_with_a_side_towards_it() {
    // The disc's way is 4.66 m; with a side towards the corner it is 4.60 m, by cells half as large.
    let block = [[4.895, 1.933], [6.089, 2.536], [5.783, 3.145], [4.589, 2.539]];
    let length_m = length_among_m(&[block], [[4.675, 0.512, 0.346], [7.155, 4.312, -1.897]]);
    assert!((4.58..1.01 * 4.595).contains(&length_m), "{length_m}");
}

#[test]
fn a_narrow_place_beside_an_end_is_found_though_there_is_another_way() {
    // Around the block's other side it is 1.78 m.
    let block = [[4.75261, 2.83627], [5.21589, 3.08373], [5.15077, 3.20565], [4.68749, 2.95819]];
    let walls = [
        [[3.83082, 3.70001], [8.3223, 16.435], [8.20666, 16.47578], [3.71519, 3.74079]],
        [[3.38513, 2.80495], [-1.10635, -9.93005], [-0.99071, -9.97083], [3.50076, 2.76416]],
    ];
    let ends = [[4.17361, 2.87167, 2.13781], [5.60841, 3.18713, -2.06857]];
    let length_m = length_among_m(&[block, walls[0], walls[1]], ends);
    assert!((1.72..1.01 * 1.732).contains(&length_m), "{length_m}");
}

/// A wall across the room, turned by an angle about its middle, with a door of a width in it; and the poses on both sides of the door.
fn turned_door(angle_rad: f64, width_m: f64) -> (Space, [[f64; 3]; 2], Vec<Polygon>) {
    let (sin, cos) = angle_rad.sin_cos();
    let place = |[x, y]: [f64; 2]| [4.013 + cos * x - sin * y, 3.021 + sin * x + cos * y];
    let walls = [-1.0, 1.0].map(|side| {
        let (near, far) = (side * 0.5 * width_m, side * 9.0);
        [[-0.1, near], [0.1, near], [0.1, far], [-0.1, far]].map(place).to_vec()
    });
    let mut map = Map::of_room(&[[0.0, 0.0], [8.0, 0.0], [8.0, 6.0], [0.0, 6.0]], 0.05).unwrap();
    walls.iter().for_each(|wall| map.block_polygon(wall));
    let ends = [-1.5, 1.5].map(|x| {
        let [x_m, y_m] = place([x, 0.3 * x]);
        [x_m, y_m, 1.57]
    });
    (Space::new(map), ends, walls.to_vec())
}

/// The least distance from corners of walls to the line that a plan's base_link goes.
fn least_room_m(plan: &Plan, walls: &[Polygon]) -> f64 {
    let corners = || walls.iter().flatten();
    let places = plan.poses.windows(2).flat_map(|pair| {
        (0..20).map(|part| crate::smooth::between(&pair[0], &pair[1], f64::from(part) / 20.0))
    });
    let room = places.flat_map(|pose| corners().map(move |[x, y]| (pose.x_m - x).hypot(pose.y_m - y)));
    room.fold(f64::INFINITY, f64::min)
}

#[test]
fn a_gap_that_hardly_takes_a_disc_is_found_wherever_it_lies_between_the_cells() {
    let footprint = Footprint::disc(0.3).unwrap();
    let needed_m = 2.0 * (footprint.outer_radius_m() + 0.03);
    for number in 0..40 {
        let angle_rad = 0.039 * f64::from(number) - 0.78;
        let (space, ends, walls) = turned_door(angle_rad, needed_m + 0.003);
        let plan =
            plan(&ask(&space, &footprint, ends)).unwrap_or_else(|error| panic!("{angle_rad} rad: {error}"));
        // Straight it would be 3.13 m.
        assert!(plan.length_m < 3.3, "{angle_rad} rad: {} m", plan.length_m);
        assert!(least_room_m(&plan, &walls) > 0.3, "{angle_rad} rad");
        // Its sides are 0.3 m away; they keep 0.03 m.
        let (closed, ends, _) = turned_door(angle_rad, 0.657);
        assert!(plan_fails(&closed, &footprint, ends), "{angle_rad} rad");
    }
}

fn plan_fails(space: &Space, footprint: &Footprint, ends: [[f64; 3]; 2]) -> bool {
    // All of the clearance is to be kept: the ends have it.
    super::plan(&ask(space, footprint, ends)).is_err()
}

#[test]
fn a_door_that_one_heading_passes_is_passed_whatever_its_direction() {
    let footprint = long();
    for number in 0..12 {
        let angle_rad = 0.13 * f64::from(number) - 0.75;
        // The robot is 0.5 m wide and keeps 0.03 m on either side: 0.02 m are left, and cells are 0.05 m wide.
        let (space, ends, _) = turned_door(angle_rad, 0.58);
        let plan =
            plan(&ask(&space, &footprint, ends)).unwrap_or_else(|error| panic!("{angle_rad} rad: {error}"));
        assert_eq!(plan.by, By::Turning);
        let in_door = plan.poses.iter().min_by(|a, b| {
            let off = |pose: &Pose2| (pose.x_m - 4.013).hypot(pose.y_m - 3.021);
            off(a).total_cmp(&off(b))
        });
        let along_rad = (in_door.unwrap().heading_rad - angle_rad).sin().asin();
        assert!(along_rad.abs() < 0.1, "{angle_rad} rad: {along_rad} rad off");
    }
}
