//! What fence and obstacles let through of a motion.

use super::coded;

/// What held a motion back.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LimitedBy {
    /// Neither fence nor obstacle.
    #[default]
    Nothing,
    /// The fence.
    Fence,
    /// An obstacle.
    Obstacle,
}

coded!(LimitedBy { Nothing = 0, Fence = 1, Obstacle = 2 });

/// Where the platform stands between fence and obstacles, and what held it back.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GuardReport {
    /// From the footprint, where the platform is believed to be, to the fence, m; below 0 outside; `None` without fence.
    pub fence_margin_m: Option<f64>,
    /// What the footprint keeps from it, m: its margin, and how far the platform may truly be from where it is believed
    /// to be; `None` without fence.
    pub fence_kept_m: Option<f64>,
    /// From the footprint to the nearest obstacle, m; below 0 where they overlap; `None` without obstacles.
    pub obstacle_distance_m: Option<f64>,
    /// Number of the nearest obstacle from 1; 0 without obstacles.
    pub nearest_obstacle: u64,
    /// What held the motion back in this cycle.
    pub limited_by: LimitedBy,
}
