//! What the file says of the floor, and what an earlier run found.

use super::{Check, ReadFile};
use crate::config::{GripPlan, GripTable, ProblemKind, RememberedFloor};

/// Height of a centre of mass of which nothing is said, m: that of a platform with its load.
const HEIGHT_M: f64 = 0.4;
/// Bounds of a friction and of its deviation.
const BOUNDS: [f64; 2] = [0.0, 2.0];
/// By how much more, over itself, what an earlier run found may be off: floors change overnight.
const SINCE_SHARE: f64 = 0.2;

pub(super) fn resolve(check: &mut Check, table: &GripTable, read_file: ReadFile<'_>) -> GripPlan {
    let remembered =
        table.memory.as_ref().and_then(|name| match read_file(name).and_then(|text| read(&text)) {
            Ok(remembered) => remembered,
            Err(reason) => {
                let problem = check.report(ProblemKind::File, "grip.memory", reason);
                problem.value = Some(format!("\"{name}\""));
                None
            }
        });
    GripPlan {
        friction: table.friction,
        height_m: table.centre_of_mass_height_m.unwrap_or(HEIGHT_M),
        told_height_m: table.centre_of_mass_height_m,
        memory: table.memory.clone(),
        remembered: remembered.map(|floor| RememberedFloor {
            friction_sigma: floor.friction_sigma.hypot(SINCE_SHARE * floor.friction),
            ..floor
        }),
    }
}

/// What a file remembers; an empty one nothing.
fn read(text: &str) -> Result<Option<RememberedFloor>, String> {
    if text.trim().is_empty() {
        return Ok(None);
    }
    let what =
        "expected `friction` and `friction_sigma`, as a run writes them; delete the file to begin anew";
    let floor: RememberedFloor = toml::from_str(text).map_err(|error| {
        let line = error.span().map_or(1, |span| 1 + text[..span.start].matches('\n').count());
        format!("line {line}: {}: {what}", error.message())
    })?;
    let [least, most] = BOUNDS;
    for (key, value) in [("friction", floor.friction), ("friction_sigma", floor.friction_sigma)] {
        if !(value > least && value <= most) {
            return Err(format!(
                "`{key}` is {value}: expected more than {least}, at most {most}; delete the file to begin anew"
            ));
        }
    }
    Ok(Some(floor))
}
