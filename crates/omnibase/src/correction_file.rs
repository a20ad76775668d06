//! Whose a correction is: of a robot and its motion.

use crate::progress::warn;
use anyhow::ensure;
use omnibase_platform::{Pose2, wrap_angle_rad};
use omnibase_robot::config::ReferenceTable;
use omnibase_robot::signals::Setpoint;
use omnibase_robot::{Ability, Registry, RobotPlan};
use std::path::Path;

/// Before what a correction's file says of whose it is.
const FOR: &str = "Learnt for: ";

/// The line that says so, behind another one.
pub fn head(plan: &RobotPlan, registry: &Registry) -> anyhow::Result<String> {
    Ok(format!("\n# {FOR}{}", whose(plan, registry)?))
}

/// Of whom a correction is: a robot and its motion.
fn whose(plan: &RobotPlan, registry: &Registry) -> anyhow::Result<String> {
    let Motion { duration_s, poses } = Motion::of(plan, registry)?;
    let way_m: f64 = poses.windows(2).map(|two| two[0].distance_m(two[1])).sum();
    let Pose2 { x_m, y_m, heading_rad } = poses.last().copied().unwrap_or_default();
    let (name, wheels) = (&plan.name, plan.drives.len());
    Ok(format!(
        "{name} with {wheels} wheels, a motion of {duration_s:.3} s and {way_m:.2} m to ({x_m:.2}, {y_m:.2}, {heading_rad:.2})"
    ))
}

/// Warns where a correction's file says that it was learnt of another robot, or of another motion.
pub fn warn_of_anothers(plan: &RobotPlan, folder: &Path, registry: &Registry) {
    let Some(name) = &plan.reference.correction_file else { return };
    let Ok(text) = omnibase_run::small_file::text(&folder.join(name)) else { return };
    let learnt = text.lines().find_map(|line| line.trim_start_matches(['#', ' ']).strip_prefix(FOR));
    if let (Some(learnt), Ok(own)) = (learnt, whose(plan, registry))
        && learnt.trim() != own
    {
        warn(format_args!("{name} was learnt for {learnt}; this is {own}"));
    }
}

/// Where a motion leads, from where it begins, at even times.
#[derive(Clone)]
pub struct Motion {
    duration_s: f64,
    poses: Vec<Pose2>,
}

impl Motion {
    /// So many times.
    const LOOKS: u32 = 64;
    /// Motions that are nowhere farther apart are one, m and rad.
    const SAME: f64 = 1e-3;

    /// That of a plan, without a correction.
    pub fn of(plan: &RobotPlan, registry: &Registry) -> anyhow::Result<Motion> {
        let table = ReferenceTable { correction: None, correction_file: None, ..plan.reference.clone() };
        let mut reference = registry.make_reference(&table, &Ability::of(plan))?;
        let duration_s = reference.duration_s().unwrap_or(f64::INFINITY);
        reference.start(&Setpoint::default());
        let last_s = if duration_s.is_finite() { duration_s } else { 0.0 };
        let times_s = (0..=Self::LOOKS).map(|look| last_s * f64::from(look) / f64::from(Self::LOOKS));
        let poses = times_s.map(|time_s| reference.sample(time_s).odom_from_body).collect();
        Ok(Motion { duration_s, poses })
    }

    /// Refuses another one.
    pub fn check(&self, other: &Motion) -> anyhow::Result<()> {
        let apart = |(one, other): (&Pose2, &Pose2)| {
            let turned_rad = wrap_angle_rad(one.heading_rad - other.heading_rad).abs();
            one.distance_m(*other).max(turned_rad)
        };
        let most = self.poses.iter().zip(&other.poses).map(apart).fold(0.0, f64::max);
        // Two without an end are as long.
        let is_as_long =
            self.duration_s == other.duration_s || (self.duration_s - other.duration_s).abs() <= Self::SAME;
        ensure!(
            most <= Self::SAME && is_as_long,
            "it is of another motion: of {} s, expected {} s, and up to {most:.3} m or rad beside the one that is learnt",
            other.duration_s,
            self.duration_s
        );
        Ok(())
    }
}
