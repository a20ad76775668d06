//! The table of the map.

use super::Check;
use crate::config::{MapTable, ProblemKind};
use crate::obstacle::GREATEST;

/// Most polygons of a map, and most corners of one.
const MOST: usize = 1000;

pub(super) fn check(check: &mut Check, table: &MapTable) {
    for (number, corners) in table.blocked_m.iter().flatten().enumerate() {
        let setting = format!("map.blocked_m[{number}]");
        if number >= MOST || !(3..=MOST).contains(&corners.len()) {
            let problem = check.report(ProblemKind::OutOfRange, &setting, "a polygon covers some floor");
            problem.value = Some(format!("polygon {number} with {} corners", corners.len()));
            problem.limit = Some(format!("at most {MOST} polygons of 3 to {MOST} corners"));
            return;
        }
        let is_place = |corner: &[f64; 2]| corner.iter().all(|part| part.abs() <= GREATEST);
        if let Some(wrong) = corners.iter().position(|corner| !is_place(corner)) {
            let problem = check.report(
                ProblemKind::OutOfRange,
                &format!("{setting}[{wrong}]"),
                "the corner is no place on the floor",
            );
            problem.value = Some(format!("{:?}", corners[wrong]));
            problem.limit = Some(format!("numbers from -{GREATEST:?} to {GREATEST:?}"));
        }
    }
    if let Some(pose) = table.odom_from_map.filter(|pose| !pose.iter().all(|part| part.abs() <= GREATEST)) {
        let problem = check.report(
            ProblemKind::OutOfRange,
            "map.odom_from_map",
            "the pose isn't finite, or too far away",
        );
        problem.value = Some(format!("{pose:?}"));
        problem.limit = Some(format!("numbers from -{GREATEST:?} to {GREATEST:?}"));
    }
}
