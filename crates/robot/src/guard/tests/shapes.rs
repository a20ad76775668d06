//! Distances and rooms against the plainest computation of them, and lower bounds against what they bound.

use super::*;
use crate::guard::shape::{MAX_FOOTPRINT_CORNERS, hull, is_inside, nearest_on, sides};

fn corners_of(footprint: &[Point], pose: &Pose2) -> Vec<Point> {
    let (sin, cos) = pose.heading_rad.sin_cos();
    footprint.iter().map(|[x, y]| [pose.x_m + cos * x - sin * y, pose.y_m + sin * x + cos * y]).collect()
}

fn to_side_m(point: Point, from: Point, to: Point) -> f64 {
    let [x, y] = plus(point, nearest_on(from, to, point), -1.0);
    x.hypot(y)
}

fn to_outline_m(polygon: &[Point], point: Point) -> f64 {
    sides(polygon).map(|(from, to)| to_side_m(point, from, to)).fold(f64::INFINITY, f64::min)
}

/// From outline to outline; 0 where one reaches into the other.
fn apart_m(one: &[Point], other: &[Point]) -> f64 {
    let crosses = one.iter().any(|point| is_inside(other, *point))
        || other.iter().any(|point| is_inside(one, *point))
        || sides(one).any(|(a, b)| {
            sides(other).any(|(c, d)| {
                let turn = |a: Point, b: Point, c: Point| shape::cross(plus(b, a, -1.0), plus(c, a, -1.0));
                turn(a, b, c) * turn(a, b, d) < 0.0 && turn(c, d, a) * turn(c, d, b) < 0.0
            })
        });
    let from = |one: &[Point], other: &[Point]| {
        one.iter().map(|point| to_outline_m(other, *point)).fold(f64::INFINITY, f64::min)
    };
    if crosses { 0.0 } else { from(one, other).min(from(other, one)) }
}

fn footprint(r: &mut Random) -> Vec<Point> {
    let points: Vec<Point> = (0..3 + (r.between(0.0, 12.0) as usize))
        .map(|_| {
            let reach_m = r.between(0.1, 0.6);
            r.direction(reach_m)
        })
        .collect();
    hull(&points)
}

fn pose(r: &mut Random, reach_m: f64) -> Pose2 {
    let [x_m, y_m] = r.direction(reach_m);
    Pose2::new(x_m, y_m, r.between(-7.0, 7.0))
}

#[test]
fn distances_are_those_of_the_plainest_computation() {
    let (mut inside, mut apart, mut over) = (0, 0, 0);
    for seed in 1..=4000 {
        let mut r = Random(seed);
        let footprint = footprint(&mut r);
        if footprint.len() < 3 || footprint.len() > MAX_FOOTPRINT_CORNERS {
            continue;
        }
        let (outline, pose) = (Outline::new(&footprint), pose(&mut r, 1.0));
        let (body, corners) = (outline.placed(&pose), corners_of(&footprint, &pose));
        let reach_m = r.between(0.0, 2.0);
        let point = r.direction(reach_m);
        let plain_m = to_outline_m(&corners, point);
        let is_in = is_inside(&corners, point);
        inside += u32::from(is_in);
        let found_m = body.distance_to_m(point);
        assert!((found_m - if is_in { -plain_m } else { plain_m }).abs() < 1e-12, "seed {seed}");
        assert!(body.distance_at_least_m(point) <= found_m + 1e-12, "seed {seed}");
        assert_eq!(body.covers(point), is_in, "seed {seed}");
        let [x, y] = plus(point, body.nearest(point), -1.0);
        assert!((x.hypot(y) - plain_m).abs() < 1e-12, "seed {seed}");
        let normal = body.sight(point).normal;
        let further_m = body.distance_to_m(plus(point, normal, 1e-6)) - found_m;
        assert!(
            (shape::square(normal) - 1.0).abs() < 1e-12 && (further_m - 1e-6).abs() < 1e-9,
            "seed {seed}"
        );
        // A patch: a point, a side or an area.
        let [along, across] = [0.0, 1.0].map(|part| {
            let size = if r.chance(0.3) { 0.0 } else { r.between(0.1, 1.0) + part };
            r.direction(size)
        });
        let patch = Patch { origin: point, along, across };
        let plain_m = apart_m(&corners, &patch.corners());
        let found_m = body.distance_m(&patch, f64::INFINITY);
        apart += u32::from(plain_m > 0.0);
        over += u32::from(plain_m == 0.0);
        assert!((found_m.max(0.0) - plain_m).abs() < 1e-12, "seed {seed}: {found_m} {plain_m}");
        for enough_m in [0.5 * plain_m, plain_m + 0.01] {
            let enough = body.distance_m(&patch, enough_m);
            let is_enough = enough >= enough_m && found_m >= enough_m;
            assert!(is_enough || (enough - found_m).abs() < 1e-12, "seed {seed}");
        }
    }
    assert!(inside > 50 && apart > 1000 && over > 500, "{inside} {apart} {over}");
}

#[test]
fn rooms_are_those_of_the_plainest_computation() {
    let fences: [&[Point]; 3] = [
        &[[-1.5, -1.0], [1.5, -1.0], [1.8, 0.5], [0.0, 1.5], [-1.5, 1.0]],
        // With a corner that points inwards; and the other way round.
        &[[-2.0, -2.0], [2.0, -2.0], [2.0, 0.0], [0.0, 0.3], [0.0, 2.0], [-2.0, 2.0]],
        &[[-2.0, 2.0], [0.0, 2.0], [0.0, 0.3], [2.0, 0.0], [2.0, -2.0], [-2.0, -2.0]],
    ];
    let (mut inside, mut outside) = (0, 0);
    for seed in 1..=3000 {
        let mut r = Random(seed);
        let footprint = footprint(&mut r);
        if footprint.len() < 3 || footprint.len() > MAX_FOOTPRINT_CORNERS {
            continue;
        }
        let polygon = fences[seed as usize % 3];
        let (fence, outline) = (Fence::new(polygon), Outline::new(&footprint));
        let pose = pose(&mut r, 1.2);
        let (body, corners) = (outline.placed(&pose), corners_of(&footprint, &pose));
        let room_m = fence.room_m(&body);
        let is_in = corners.iter().all(|corner| is_inside(polygon, *corner))
            && !polygon.iter().any(|corner| is_inside(&corners, *corner));
        if is_in {
            inside += 1;
            let plain_m = sides(polygon).map(|(from, to)| apart_m(&corners, &[from, to]));
            let plain_m = plain_m.fold(f64::INFINITY, f64::min);
            assert!((room_m - plain_m).abs() < 1e-12, "seed {seed}: {room_m} {plain_m}");
            // Along a way it is that of the place on it with the least.
            let way = r.direction(0.3);
            let places = (0..=64).map(|part| {
                let at = f64::from(part) / 64.0;
                fence.room_m(&outline.placed(&Pose2::new(
                    pose.x_m + at * way[0],
                    pose.y_m + at * way[1],
                    pose.heading_rad,
                )))
            });
            let least_m = places.fold(f64::INFINITY, f64::min);
            let swept_m = fence.swept_room_m(&body, way, f64::INFINITY);
            assert!(swept_m <= least_m.max(0.0) + 1e-12, "seed {seed}: {swept_m} {least_m}");
            assert!(swept_m >= least_m - 0.3 / 64.0, "seed {seed}: {swept_m} {least_m}");
            if swept_m > 0.0 {
                assert_eq!(fence.swept_room_m(&body, way, 0.5 * swept_m), 0.5 * swept_m);
            }
        } else {
            outside += 1;
            let deep = |corner: &Point| {
                if is_inside(polygon, *corner) { 0.0 } else { to_outline_m(polygon, *corner) }
            };
            let within = |corner: &Point| {
                if is_inside(&corners, *corner) { to_outline_m(&corners, *corner) } else { 0.0 }
            };
            let plain_m = corners.iter().map(deep).chain(polygon.iter().map(within)).fold(0.0, f64::max);
            assert!((room_m + plain_m).abs() < 1e-12, "seed {seed}: {room_m} {plain_m}");
        }
    }
    assert!(inside > 300 && outside > 300, "{inside} {outside}");
}
