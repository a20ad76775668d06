//! Plans for another checker.

use std::io::{self, Write};

use omnibase_plan::{Footprint, Plan};

/// Writes a room and plans in it as a line of JSON, as `check_plans.py` reads it: m and rad.
pub fn write(
    file: &mut impl Write,
    size_m: [f64; 2],
    blocks: &[impl std::fmt::Debug],
    footprint: &Footprint,
    plans: &[Plan],
) -> io::Result<()> {
    let poses = |plan: &Plan| -> Vec<[f64; 3]> {
        plan.poses.iter().map(|pose| [pose.x_m, pose.y_m, pose.heading_rad]).collect()
    };
    writeln!(
        file,
        "{{\"room\": {size_m:?}, \"blocks\": {blocks:?}, \"outline\": {:?}, \"plans\": {:?}}}",
        footprint.corners_m(),
        plans.iter().map(poses).collect::<Vec<_>>()
    )
}
