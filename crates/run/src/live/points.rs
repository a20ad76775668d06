//! Poses that a person remembers one by one, by a call, a page's button or the joystick's.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use omnibase_platform::Pose2;

use omnibase_trajectory::path_points::nearest_turn_rad;

use super::carriers::Live;

/// Poses that are remembered at most.
const MOST: usize = 500;
/// Two poses nearer than this are one place, m, and rad.
const SAME: f64 = 1e-3;

/// Why a pose isn't remembered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotRemembered {
    /// Nobody began.
    #[error("expected `teach by=\"points\"` before it: nobody teaches points")]
    NotBegun,
    /// There is no pose yet, or it isn't known.
    #[error("the pose is unknown: set it first")]
    PoseUnknown,
    /// It stands there still.
    #[error("the robot stands where the last point is")]
    SamePlace,
    /// There are too many.
    #[error("expected at most {MOST} points")]
    TooMany,
}

/// The list of such poses; `None` while nobody teaches points.
#[derive(Clone, Default)]
pub(super) struct PointList(Arc<Mutex<Option<Vec<Pose2>>>>);

impl PointList {
    /// A guard whose holder panicked still guards whole poses.
    fn lock(&self) -> MutexGuard<'_, Option<Vec<Pose2>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Live {
    /// From now on poses are remembered one by one; what was remembered before is forgotten.
    pub fn begin_points(&self) {
        *self.points.lock() = Some(Vec::new());
    }

    /// Remembers where the platform believes it stands; how many there are then.
    pub fn remember_point(&self) -> Result<usize, NotRemembered> {
        let snapshot = self.snapshot();
        let mut points = self.points.lock();
        let points = points.as_mut().ok_or(NotRemembered::NotBegun)?;
        if snapshot.cycles == 0 || !snapshot.record.state.pose_known {
            return Err(NotRemembered::PoseUnknown);
        }
        let here = snapshot.record.state.odom_from_body;
        let is_same = |last: &Pose2| {
            let away_m = (last.x_m - here.x_m).hypot(last.y_m - here.y_m);
            let turn_rad = nearest_turn_rad(here.heading_rad, last.heading_rad) - last.heading_rad;
            away_m < SAME && turn_rad.abs() < SAME
        };
        if points.last().is_some_and(is_same) {
            return Err(NotRemembered::SamePlace);
        }
        if points.len() == MOST {
            return Err(NotRemembered::TooMany);
        }
        points.push(here);
        Ok(points.len())
    }

    /// The poses so far; `None` while nobody teaches points.
    pub fn points(&self) -> Option<Vec<Pose2>> {
        self.points.lock().clone()
    }

    /// No more of them, where there are so many still; `false` where there are others.
    pub fn end_points(&self, count: usize) -> bool {
        let mut points = self.points.lock();
        let is_same = points.as_ref().is_some_and(|points| points.len() == count);
        if is_same {
            *points = None;
        }
        is_same
    }

    /// Goes on with these.
    pub fn resume_points(&self, poses: &[Pose2]) {
        *self.points.lock() = Some(poses.to_vec());
    }

    /// No more of them, and those that there are forgotten.
    pub fn forget_points(&self) {
        *self.points.lock() = None;
    }
}
