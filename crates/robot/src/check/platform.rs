//! The wheels, by the layout that stands in the file.

use omnibase_platform::{Kinematics, layout};

use super::Check;
use super::kind_keys::Given;
use crate::config::{PlatformTable, ProblemKind};
use crate::registry::Registry;

const LAYOUT: &str = "platform.layout";

pub(super) fn resolve(
    check: &mut Check,
    table: &PlatformTable,
    drives: usize,
    registry: &Registry,
) -> Option<Kinematics> {
    let Some(name) = table.layout.as_deref() else {
        if !check.refused(LAYOUT) {
            let reason = "must be given: it says where the wheels stand";
            check.report(ProblemKind::Missing, LAYOUT, reason).limit =
                Some(registry.layouts.names().join(", "));
        }
        return None;
    };
    check.need(table.wheel_radius_m, "platform.wheel_radius_m", "speeds are scaled by it");
    let (kind, make) = check.known(&registry.layouts, LAYOUT, Some(name))?;
    check.keys(kind, &Given::of(table), &registry.layouts.sort);
    if !check.is_sound("platform") {
        return None;
    }
    let wheels = check.made(make(table).map_err(|error| error.under("platform")))?;
    if wheels.len() != drives {
        let problem = check.report(ProblemKind::Contradiction, LAYOUT, "each wheel has one `[[drive]]`");
        problem.value = Some(format!("{} wheels", wheels.len()));
        problem.limit = Some(format!("{drives} drives"));
    }
    for reason in layout::problems(&wheels) {
        check.report(ProblemKind::Contradiction, "platform", reason);
    }
    Kinematics::new(wheels).ok()
}
