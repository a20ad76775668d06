//! Why there is no plan.

use omnibase_platform::Pose2;

use crate::turning::MOST_TURNING_CELLS;

/// Why there is no plan.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlanError {
    /// NaN or infinity.
    #[error("{end}: expected finite numbers, found ({}, {}, {})", pose.x_m, pose.y_m, pose.heading_rad)]
    NotFinite {
        /// Which end.
        end: End,
        /// The pose.
        pose: Pose2,
    },
    /// The clearance.
    #[error("clearance: expected 0 m to 10 m, found {found_m} m")]
    Clearance {
        /// What was asked, m.
        found_m: f64,
    },
    /// Something is where the robot stands or shall stand.
    #[error("{end} ({:.3}, {:.3}, {:.3}): the footprint touches what is in the way there", pose.x_m, pose.y_m, pose.heading_rad)]
    Blocked {
        /// Which end.
        end: End,
        /// The pose.
        pose: Pose2,
    },
    /// Beyond the map.
    #[error("{end} ({:.3}, {:.3}, {:.3}): the footprint reaches beyond the map, or the fence", pose.x_m, pose.y_m, pose.heading_rad)]
    Outside {
        /// Which end.
        end: End,
        /// The pose.
        pose: Pose2,
    },
    /// No way is wide enough.
    #[error(
        "there is no way: the narrowest place of the widest one is at most {widest_m:.2} m wide, the robot needs {needed_m:.2} m"
    )]
    TooNarrow {
        /// The width, m, to a cell.
        widest_m: f64,
        /// What the narrowest side of the footprint needs, m.
        needed_m: f64,
    },
    /// What is in the way closes all around.
    #[error("there is no way: what is in the way lies all around {end}")]
    Enclosed {
        /// Which end.
        end: End,
    },
    /// It would have to turn where it can't.
    #[error("there is no way: a passage is wide enough, but the robot can't turn so as to get through")]
    NoTurn,
    /// Whoever waited ended it.
    #[error("no way was found in the time that was given for it")]
    Ended,
    /// Too many cells.
    #[error(
        "there is no way for a disc around the whole robot; to look where it could turn a map may have {MOST_TURNING_CELLS} cells at most, found {found}: larger cells are fewer"
    )]
    TooLarge {
        /// The map's cells.
        found: usize,
    },
}

/// An end of a way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// Where it begins.
    Start,
    /// Where it leads.
    Goal,
}

impl std::fmt::Display for End {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            End::Start => "start",
            End::Goal => "goal",
        })
    }
}
