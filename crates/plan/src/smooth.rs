//! A way without kinks where there is room: a band that resists bending, held off what is in the way.

use omnibase_platform::Pose2;

use crate::space::Checker;

/// Between two points of a band, m.
pub const SPACING_M: f64 = 0.1;
/// Rounds of bending back.
const ROUNDS: usize = 60;
/// A band becomes longer by bending back at most by this.
const LONGER: f64 = 1.004;
/// Rounds of tightening: the pieces of a way, and then pieces half as long.
pub(crate) const TIGHTENINGS: [usize; 2] = [16, 8];
/// By how much a heading gives way where a point would else not move, rad.
const GIVES_WAY_RAD: f64 = 0.05;
/// Points of a way that would move by less than this stay while it is drawn taut, in cells.
const STILL: f64 = 1e-2;
/// And those of a band while it bends back: slow waves along it go on for ever, and what they move is less than is driven.
const STILL_IN_BAND: f64 = 5e-3;

/// The points of a way in cells, evenly between its turns; a heading changes evenly along each piece.
pub(crate) fn divided(way: &[Pose2], spacing: f64, turn_length: f64) -> Vec<Pose2> {
    let mut points: Vec<Pose2> = way.first().copied().into_iter().collect();
    for pair in way.windows(2) {
        let length = pair[0].distance_m(pair[1]);
        let turn = (pair[1].heading_rad - pair[0].heading_rad).abs() * turn_length;
        let count = (length.hypot(turn) / spacing).ceil().max(1.0) as usize;
        for number in 1..=count {
            points.push(between(&pair[0], &pair[1], number as f64 / count as f64));
        }
    }
    points
}

/// A pose between two others.
pub(crate) fn between(from: &Pose2, to: &Pose2, part: f64) -> Pose2 {
    let mix = |a: f64, b: f64| if part >= 1.0 { b } else { a + part * (b - a) };
    Pose2::new(mix(from.x_m, to.x_m), mix(from.y_m, to.y_m), mix(from.heading_rad, to.heading_rad))
}

/// Leaves out what of a way isn't needed: places from which the footprint gets straight to a later one.
pub(crate) fn shortened(way: &[Pose2], checker: &mut Checker<'_>) -> Vec<Pose2> {
    let mut kept: Vec<Pose2> = way.first().copied().into_iter().collect();
    let mut at = 0;
    while at + 1 < way.len() {
        // As far as it goes: by doubling, then by halving.
        let mut reached = at + 1;
        let mut step = 1;
        while step > 0 {
            let next = (reached + step).min(way.len() - 1);
            if next > reached && checker.is_motion_free_in_cells(&way[at], &way[next]) {
                reached = next;
                step *= 2;
            } else {
                step /= 2;
            }
        }
        kept.push(way[reached]);
        at = reached;
    }
    kept
}

/// Moves turns to where the way is shorter, as far as the footprint's room allows: the ends stay.
pub(crate) fn tightened(way: &mut [Pose2], checker: &mut Checker<'_>, rounds: usize) {
    // A heading costs nothing: where it is in the way, it gives way. A disc's never is.
    let turns_rad: &[f64] =
        if checker.is_nearly_disc() { &[0.0] } else { &[0.0, GIVES_WAY_RAD, -GIVES_WAY_RAD] };
    let mut is_moving = vec![true; way.len()];
    for _ in 0..rounds {
        let mut has_moved = vec![false; way.len()];
        for at in 1..way.len().max(1) - 1 {
            // What lies between points that stay, stays.
            if !is_moving[at - 1..=at + 1].contains(&true) {
                continue;
            }
            let (before, here, after) = (way[at - 1], way[at], way[at + 1]);
            let chord = [after.x_m - before.x_m, after.y_m - before.y_m];
            let square = chord[0] * chord[0] + chord[1] * chord[1];
            let along = (here.x_m - before.x_m) * chord[0] + (here.y_m - before.y_m) * chord[1];
            let part = if square > 0.0 { (along / square).clamp(0.0, 1.0) } else { 0.5 };
            let wished = between(&before, &after, part);
            if wished.distance_m(here) + (wished.heading_rad - here.heading_rad).abs() < STILL {
                continue;
            }
            let turned = |part: f64| {
                let next = between(&here, &wished, part);
                turns_rad
                    .iter()
                    .map(move |turn_rad| Pose2 { heading_rad: next.heading_rad + turn_rad, ..next })
            };
            let free = [1.0, 0.3, 0.1, 0.03].into_iter().flat_map(turned).find(|next| {
                checker.is_free_in_cells(next)
                    && checker.is_free_between_in_cells(&before, next)
                    && checker.is_free_between_in_cells(next, &after)
            });
            if let Some(next) = free {
                has_moved[at] = next.distance_m(here) > STILL;
                way[at] = next;
            }
        }
        if !has_moved.contains(&true) {
            break;
        }
        is_moving = has_moved;
    }
}

/// Bends a band's points back as far as the footprint's room allows; its ends stay.
pub(crate) fn smooth(points: &mut [Pose2], checker: &mut Checker<'_>) {
    let count = points.len();
    if count < 3 {
        return;
    }
    let mut is_moving = vec![true; count];
    let most = LONGER * length(points);
    let mut before = points.to_vec();
    for _ in 0..ROUNDS {
        let mut has_moved = vec![false; count];
        for at in 1..count - 1 {
            let near = at.saturating_sub(2)..(at + 3).min(count);
            if !is_moving[near.clone()].iter().any(|moving| *moving) {
                continue;
            }
            let here = points[at];
            let wished = bent_back(points, at);
            let moves = (wished.x_m - here.x_m).hypot(wished.y_m - here.y_m);
            if moves + (wished.heading_rad - here.heading_rad).abs() < STILL_IN_BAND {
                continue;
            }
            let free = [1.0, 0.4].into_iter().map(|part| between(&here, &wished, part)).find(|wished| {
                checker.is_free_in_cells(wished)
                    && checker.is_free_between_in_cells(&points[at - 1], wished)
                    && checker.is_free_between_in_cells(wished, &points[at + 1])
            });
            if let Some(wished) = free {
                points[at] = wished;
                has_moved[at] = true;
            }
        }
        if length(points) > most {
            points.copy_from_slice(&before);
            break;
        }
        if !has_moved.iter().any(|moved| *moved) {
            break;
        }
        before.copy_from_slice(points);
        is_moving = has_moved;
    }
}

fn length(points: &[Pose2]) -> f64 {
    points.windows(2).map(|pair| pair[0].distance_m(pair[1])).sum()
}

/// Where a point bends its band least, half the way there: from the fourth difference, at the ends from the second.
fn bent_back(points: &[Pose2], at: usize) -> Pose2 {
    let last = points.len() - 1;
    let before = if at >= 2 { points[at - 2] } else { mirrored(&points[0], &points[1]) };
    let after = if at + 2 <= last { points[at + 2] } else { mirrored(&points[last], &points[last - 1]) };
    let value = |of: fn(&Pose2) -> f64| {
        let near = of(&points[at - 1]) + of(&points[at + 1]);
        let wished = (4.0 * near - of(&before) - of(&after)) / 6.0;
        0.5 * (wished + of(&points[at]))
    };
    Pose2::new(value(|pose| pose.x_m), value(|pose| pose.y_m), value(|pose| pose.heading_rad))
}

/// A point as far beyond an end as another one is before it.
fn mirrored(end: &Pose2, point: &Pose2) -> Pose2 {
    Pose2::new(
        2.0 * end.x_m - point.x_m,
        2.0 * end.y_m - point.y_m,
        2.0 * end.heading_rad - point.heading_rad,
    )
}
