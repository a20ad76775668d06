//! The wheels, by the layout that stands in the file.

use omnibase_platform::{Kinematics, layout};

use super::Check;
use super::kind_keys::Given;
use crate::config::{PlatformTable, ProblemKind};
use crate::registry::Registry;

pub(super) fn resolve(
    check: &mut Check,
    table: &PlatformTable,
    drives: usize,
    registry: &Registry,
) -> Option<Kinematics> {
    let name = check.need(table.layout.as_deref(), "platform.layout", "a layout is required")?;
    check.need(table.wheel_radius_m, "platform.wheel_radius_m", "speeds are scaled by it");
    let (kind, make) = check.known(&registry.layouts, "platform.layout", Some(name))?;
    check.keys(kind, &Given::of(table), &registry.layouts.sort);
    if !check.is_sound("platform") {
        return None;
    }
    let wheels = check.made(make(table).map_err(|error| error.under("platform")))?;
    if wheels.len() != drives {
        let problem =
            check.report(ProblemKind::Contradiction, "platform.layout", "each wheel has one `[[drive]]`");
        problem.value = Some(format!("{} wheels", wheels.len()));
        problem.limit = Some(format!("{drives} drives"));
    }
    for reason in layout::problems(&wheels) {
        check.report(ProblemKind::Contradiction, "platform", reason);
    }
    Kinematics::new(wheels).ok()
}
