//! A fence that is told corner by corner while the robot runs.

use omnibase_platform::Pose2;

use super::fence::Fence;
use super::shape::{self, MAX_FENCE_CORNERS, Point};
use super::{Guard, INSIDE_M};
use crate::config::FencePlan;
use crate::obstacle::GREATEST;
use crate::signals::{Batch, RequestAnswer};

/// What was told of it so far.
#[derive(Clone, Debug)]
pub(super) struct Draft {
    fence: Fence,
    /// For the draft where there was no fence before.
    spare: Option<Fence>,
    corners_m: [Point; MAX_FENCE_CORNERS],
    /// The one that must come next; `None` where none does, or one was refused.
    next: Option<Batch>,
}

/// What is wrong with the corners of a fence, in words.
pub fn check_fence(corners_m: &[Point]) -> Result<(), String> {
    if !(3..=MAX_FENCE_CORNERS).contains(&corners_m.len()) {
        return Err(format!("expected 3 to {MAX_FENCE_CORNERS} corners, found {}", corners_m.len()));
    }
    let is_impossible = |corner: &Point| corner.iter().any(|part| part.is_nan() || part.abs() > GREATEST);
    if let Some(number) = corners_m.iter().position(is_impossible) {
        let found = corners_m[number];
        return Err(format!("corner {number}, from 0: expected -{GREATEST} to {GREATEST}, found {found:?}"));
    }
    match shape::crossing(corners_m) {
        None => Ok(()),
        Some((one, other)) => Err(format!(
            "expected corners in order, each once: the sides {one} and {other}, from 0, cross or touch"
        )),
    }
}

impl Draft {
    pub(super) fn new() -> Self {
        let empty = || Fence::new(&[]);
        Draft { fence: empty(), spare: Some(empty()), corners_m: [[0.0; 2]; MAX_FENCE_CORNERS], next: None }
    }

    /// Takes a corner; whether it was the last one, with which the fence is whole.
    fn take(&mut self, corner_m: Point, batch: Batch) -> Result<bool, RequestAnswer> {
        let follows = batch.place() == 0 || self.next == Some(batch);
        self.next = None;
        let is_possible = corner_m.iter().all(|part| part.abs() <= GREATEST);
        let count = usize::from(batch.size());
        if !(follows && is_possible && (3..=MAX_FENCE_CORNERS).contains(&count)) {
            return Err(RequestAnswer::Refused);
        }
        self.corners_m[usize::from(batch.place())] = corner_m;
        self.next = batch.next();
        let corners_m = &self.corners_m[..count];
        if self.next.is_some() {
            return Ok(false);
        }
        if shape::crossing(corners_m).is_some() {
            return Err(RequestAnswer::Refused);
        }
        self.fence.become_one_of(corners_m);
        Ok(true)
    }
}

impl Guard {
    /// Takes a corner of another fence; with the last one it is in force, unless the footprint at one of these poses, at which the platform
    /// stands, hasn't the room in it that must be kept.
    pub(crate) fn put_fence(&mut self, corner_m: Point, batch: Batch, poses: [Pose2; 2]) -> RequestAnswer {
        match self.draft.take(corner_m, batch) {
            Ok(true) => {}
            Ok(false) => return RequestAnswer::Taken,
            Err(refused) => return refused,
        }
        let plan = match &self.fence {
            Some((plan, _)) => FencePlan { corners_m: Vec::new(), ..*plan },
            None => FencePlan::NONE,
        };
        let needed_m = self.fence_kept_m(&plan).max(poses[0].distance_m(poses[1])) - INSIDE_M;
        let has_room = |pose: &Pose2| {
            let room_m = self.draft.fence.room_m(&self.outline.placed(pose));
            pose.is_finite() && room_m >= needed_m
        };
        if !poses.iter().all(has_room) {
            return RequestAnswer::OutsideFence;
        }
        if let Some((_, fence)) = &mut self.fence {
            std::mem::swap(fence, &mut self.draft.fence);
        } else if let Some(spare) = self.draft.spare.take() {
            self.fence = Some((plan, std::mem::replace(&mut self.draft.fence, spare)));
        }
        RequestAnswer::Taken
    }

    /// Its corners in odom, m; none without a fence.
    pub(crate) fn fence_m(&self) -> &[Point] {
        self.fence.as_ref().map_or(&[], |(_, fence)| fence.corners_m())
    }
}
