//! Distances on the floor, measured apart from the robot's own geometry.

use omnibase_platform::Pose2;

type Point = [f64; 2];

/// The footprint's corners in odom.
fn corners(footprint: &[Point], pose: &Pose2) -> Vec<Point> {
    let turned = |&[x, y]: &Point| {
        let corner = pose.then(Pose2::new(x, y, 0.0));
        [corner.x_m, corner.y_m]
    };
    footprint.iter().map(turned).collect()
}

fn sides(polygon: &[Point]) -> impl Iterator<Item = (Point, Point)> + '_ {
    let next = polygon.iter().cycle().skip(1);
    polygon.iter().copied().zip(next.copied())
}

fn to_segment_m(point: Point, from: Point, to: Point) -> f64 {
    let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
    let (px, py) = (point[0] - from[0], point[1] - from[1]);
    let square = dx * dx + dy * dy;
    let part = if square > 0.0 { ((px * dx + py * dy) / square).clamp(0.0, 1.0) } else { 0.0 };
    (px - part * dx).hypot(py - part * dy)
}

/// How often a polygon winds around a point.
fn winding(polygon: &[Point], point: Point) -> i32 {
    let mut turns = 0;
    for (from, to) in sides(polygon) {
        let left = (to[0] - from[0]) * (point[1] - from[1]) - (to[1] - from[1]) * (point[0] - from[0]);
        if from[1] <= point[1] && to[1] > point[1] && left > 0.0 {
            turns += 1;
        } else if from[1] > point[1] && to[1] <= point[1] && left < 0.0 {
            turns -= 1;
        }
    }
    turns
}

/// Room from a footprint to the fence around it, m; below 0 where the footprint crosses it or lies outside.
pub fn room_in_fence_m(footprint: &[Point], pose: &Pose2, fence: &[Point]) -> f64 {
    let body = corners(footprint, pose);
    let mut room_m = f64::INFINITY;
    let mut outside_m = 0.0_f64;
    for corner in &body {
        let nearest =
            sides(fence).map(|(from, to)| to_segment_m(*corner, from, to)).fold(f64::INFINITY, f64::min);
        room_m = room_m.min(nearest);
        if winding(fence, *corner) == 0 {
            outside_m = outside_m.max(nearest);
        }
    }
    for corner in fence {
        let nearest =
            sides(&body).map(|(from, to)| to_segment_m(*corner, from, to)).fold(f64::INFINITY, f64::min);
        room_m = room_m.min(nearest);
        if winding(&body, *corner) != 0 {
            outside_m = outside_m.max(nearest);
        }
    }
    if outside_m > 0.0 { -outside_m } else { room_m }
}

/// Distance from a footprint to a circle, m; below 0 where they overlap.
pub fn distance_to_circle_m(footprint: &[Point], pose: &Pose2, centre: Point, radius_m: f64) -> f64 {
    let body = corners(footprint, pose);
    let nearest = sides(&body).map(|(from, to)| to_segment_m(centre, from, to)).fold(f64::INFINITY, f64::min);
    if winding(&body, centre) != 0 { -nearest - radius_m } else { nearest - radius_m }
}
