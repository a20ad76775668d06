//! Footprint, fence and obstacles of a file.

use omnibase_platform::{Kinematics, Pose2};

use super::Check;
use crate::config::{FencePlan, FenceTable, FootprintSource, GuardPlan, ProblemKind, RobotFile};
use crate::guard::fence::Fence;
use crate::guard::outline::Outline;
use crate::guard::shape::{self, MAX_FENCE_CORNERS, MAX_FOOTPRINT_CORNERS, Point};
use crate::obstacle::{GREATEST, MAX_OBSTACLES, Obstacle};

#[cfg(test)]
mod tests;

/// What it keeps from an obstacle, m.
const OBSTACLE_DISTANCE_M: f64 = 0.1;
/// Coefficient of the circular speed, 1/s.
const CIRCULATE_1_S: f64 = 0.5;
/// Standard deviations of the believed pose that are kept.
const SIGMAS: f64 = 3.0;
/// After so long without headway a plan is given up, s.
const GIVE_UP_S: f64 = 5.0;
/// How much faster than the path's own speed is caught up.
const CATCH_UP_FACTOR: f64 = 1.2;

pub(super) fn resolve(
    check: &mut Check,
    file: &RobotFile,
    kinematics: Option<&Kinematics>,
) -> Option<GuardPlan> {
    let footprint = match &file.platform.footprint_m {
        Some(corners) => given_footprint(check, corners).map(|hull| (hull, FootprintSource::Given)),
        None => kinematics.map(|kinematics| (footprint_of_wheels(kinematics), FootprintSource::Wheels)),
    };
    let obstacles = obstacles(check, file);
    // Both are told about, whatever else is wrong.
    let fence = match &file.fence {
        Some(table) => Some(fence(check, table, footprint.as_ref().map(|(corners, _)| corners.as_slice()))?),
        None => None,
    };
    let (footprint_m, footprint_source) = footprint?;
    let obstacles = obstacles?;
    stand_outside(check, &footprint_m, &obstacles)?;
    Some(GuardPlan {
        footprint_m,
        footprint_source,
        fence,
        avoidance: file.avoidance.kind.unwrap_or_default(),
        distance_m: file.avoidance.distance_m.unwrap_or(OBSTACLE_DISTANCE_M),
        circulate_1_s: file.avoidance.circulate_1_s.unwrap_or(CIRCULATE_1_S),
        obstacle_sigmas: file.avoidance.sigmas.unwrap_or(SIGMAS),
        give_up_s: file.avoidance.give_up_s.unwrap_or(GIVE_UP_S),
        catch_up_factor: file.avoidance.catch_up_factor.unwrap_or(CATCH_UP_FACTOR),
        obstacles,
    })
}

fn given_footprint(check: &mut Check, corners: &[Point]) -> Option<Vec<Point>> {
    let setting = "platform.footprint_m";
    if check.refused(setting) {
        return None;
    }
    all_possible(check, setting, corners)?;
    let hull = shape::hull(corners);
    if hull.len() < 3 {
        let problem = check.report(ProblemKind::Contradiction, setting, "the footprint has no area");
        problem.value = Some(format!("{} corners of a hull", hull.len()));
        problem.limit = Some("at least 3 corners that don't lie on one line".into());
        return None;
    }
    if hull.len() > MAX_FOOTPRINT_CORNERS {
        let problem = check.report(ProblemKind::OutOfRange, setting, "the footprint has too many corners");
        problem.value = Some(format!("{} corners of a hull", hull.len()));
        problem.limit = Some(format!("at most {MAX_FOOTPRINT_CORNERS}"));
        return None;
    }
    if let Some((one, other)) = shape::crossing(corners) {
        let reason = format!(
            "its sides {one} and {other}, from 0, cross or touch: are the corners in order, each once?"
        );
        check.report(ProblemKind::Contradiction, setting, reason);
        return None;
    }
    Some(hull)
}

/// Each wheel as a square of its diameter, and the hull of all.
fn footprint_of_wheels(kinematics: &Kinematics) -> Vec<Point> {
    let mut points = Vec::new();
    for wheel in kinematics.wheels() {
        let ([x, y], r) = (wheel.position_m, wheel.radius_m);
        points.extend([[x - r, y - r], [x + r, y - r], [x + r, y + r], [x - r, y + r]]);
    }
    let hull = shape::hull(&points);
    if hull.len() <= MAX_FOOTPRINT_CORNERS {
        return hull;
    }
    let far = |axis: usize| {
        let of = |pick: fn(f64, f64) -> f64, from: f64| points.iter().map(|p| p[axis]).fold(from, pick);
        (of(f64::min, f64::INFINITY), of(f64::max, f64::NEG_INFINITY))
    };
    let ((left, right), (low, high)) = (far(0), far(1));
    vec![[left, low], [right, low], [right, high], [left, high]]
}

fn fence(check: &mut Check, table: &FenceTable, footprint: Option<&[Point]>) -> Option<FencePlan> {
    // What couldn't be read is missing here, and was told about.
    if check.refused("fence.rectangle_m") || check.refused("fence.polygon_m") {
        return None;
    }
    let (setting, corners_m) = match (&table.rectangle_m, &table.polygon_m) {
        (Some([x_min, y_min, x_max, y_max]), None) => {
            let setting = "fence.rectangle_m";
            if !(x_min < x_max && y_min < y_max) {
                let reason = "a rectangle is x_min, y_min, x_max, y_max";
                let problem = check.report(ProblemKind::Contradiction, setting, reason);
                problem.value = Some(format!("[{x_min}, {y_min}, {x_max}, {y_max}]"));
                problem.limit = Some("x_min < x_max and y_min < y_max".into());
                return None;
            }
            (setting, vec![[*x_min, *y_min], [*x_max, *y_min], [*x_max, *y_max], [*x_min, *y_max]])
        }
        (None, Some(corners)) => ("fence.polygon_m", corners.clone()),
        (None, None) => {
            check.report(ProblemKind::Missing, "fence", "give `rectangle_m` or `polygon_m`");
            return None;
        }
        (Some(_), Some(_)) => {
            let reason = "give `rectangle_m` or `polygon_m`, not both";
            check.report(ProblemKind::Contradiction, "fence.polygon_m", reason);
            return None;
        }
    };
    all_possible(check, setting, &corners_m)?;
    if !(3..=MAX_FENCE_CORNERS).contains(&corners_m.len()) {
        let problem = check.report(ProblemKind::OutOfRange, setting, "a fence is a polygon of few corners");
        problem.value = Some(format!("{} corners", corners_m.len()));
        problem.limit = Some(format!("3 to {MAX_FENCE_CORNERS}"));
        return None;
    }
    if let Some((one, other)) = shape::crossing(&corners_m) {
        let reason = format!(
            "its sides {one} and {other}, from 0, cross or touch: are the corners in order, each once?"
        );
        check.report(ProblemKind::Contradiction, setting, reason);
        return None;
    }
    let margin_m = table.margin_m.unwrap_or(FencePlan::NONE.margin_m);
    let outline = Outline::new(footprint?);
    let room_m = Fence::new(&corners_m).room_m(&outline.placed(&Pose2::default()));
    if room_m < margin_m {
        let reason = "the footprint at start, the origin of odom, must stand inside";
        let problem = check.report(ProblemKind::Contradiction, setting, reason);
        problem.value = Some(format!("{room_m:.3} m of room"));
        problem.limit = Some(format!("at least fence.margin_m = {margin_m}"));
        return None;
    }
    Some(FencePlan { corners_m, margin_m, sigmas: table.sigmas.unwrap_or(FencePlan::NONE.sigmas) })
}

fn obstacles(check: &mut Check, file: &RobotFile) -> Option<Vec<Obstacle>> {
    if file.obstacle.len() > MAX_OBSTACLES {
        let setting = format!("obstacle[{MAX_OBSTACLES}]");
        let problem = check.report(ProblemKind::OutOfRange, &setting, "too many obstacles");
        problem.value = Some(file.obstacle.len().to_string());
        problem.limit = Some(format!("at most {MAX_OBSTACLES}"));
        return None;
    }
    let mut list = Some(Vec::new());
    for (index, table) in file.obstacle.iter().enumerate() {
        let why = "an obstacle is a circle on the floor";
        let centre = check.need(table.centre_m, &format!("obstacle[{index}].centre_m"), why);
        let radius = check.need(table.radius_m, &format!("obstacle[{index}].radius_m"), why);
        let (Some(centre_m), Some(radius_m)) = (centre, radius) else {
            list = None;
            continue;
        };
        let obstacle = Obstacle { centre_m, radius_m, velocity_m_s: table.velocity_m_s.unwrap_or_default() };
        if !obstacle.is_possible() {
            let reason = "its numbers must be finite, its radius not negative";
            let problem = check.report(ProblemKind::OutOfRange, &format!("obstacle[{index}]"), reason);
            problem.value = Some(format!("{centre_m:?}, {radius_m:?}, {:?}", obstacle.velocity_m_s));
            problem.limit = Some(format!("numbers up to {GREATEST:?}, a radius from 0"));
            list = None;
        } else if let Some(list) = &mut list {
            list.push(obstacle);
        }
    }
    list
}

/// An obstacle that is there from the start and in the robot is a slip of the pen.
fn stand_outside(check: &mut Check, footprint: &[Point], obstacles: &[Obstacle]) -> Option<()> {
    let outline = Outline::new(footprint);
    let start = outline.placed(&Pose2::default());
    let mut all = Some(());
    for (index, obstacle) in obstacles.iter().enumerate() {
        let distance_m = start.distance_to_m(obstacle.centre_m) - obstacle.radius_m;
        if distance_m < 0.0 {
            let reason = "it must not reach into the footprint at start, the origin of odom";
            let problem = check.report(ProblemKind::Contradiction, &format!("obstacle[{index}]"), reason);
            problem.value = Some(format!("{:.3} m into the footprint", -distance_m));
            problem.limit = Some("a distance from 0".into());
            all = None;
        }
    }
    all
}

fn all_possible(check: &mut Check, setting: &str, corners: &[Point]) -> Option<()> {
    let possible = |corner: &Point| corner.iter().all(|value| value.abs() <= GREATEST);
    let Some(wrong) = corners.iter().position(|corner| !possible(corner)) else { return Some(()) };
    let problem = check.report(
        ProblemKind::OutOfRange,
        &format!("{setting}[{wrong}]"),
        "the corner is no place on the floor",
    );
    problem.value = Some(format!("{:?}", corners[wrong]));
    problem.limit = Some(format!("numbers from -{GREATEST:?} to {GREATEST:?}"));
    None
}
