//! A way is planned, and the robot asked to go it.

use std::time::{Duration, Instant};

use omnibase_plan::{PlanError, Until};
use omnibase_robot::Ability;
use omnibase_robot::guard::{Obstacle, spread_m};
use omnibase_robot::signals::Phase;
use omnibase_run::live::{Live, Snapshot};
use omnibase_run::room::{RoomError, WayRequest};

use super::lead::lead;
use super::{Begun, Drive, DriveTo, FULL, Stage, is_there};
use crate::robot_info::RobotInfo;
use crate::work::Waiting;

/// A way is looked for with so much of a processor: who asked is told by then, later only where others have the processor.
const LONGEST: Duration = Duration::from_secs(1);
/// Whoever asked so long ago may have given up, after a wait for others or for a busy machine: nothing begins for them.
pub(super) const TOO_LATE: Duration = Duration::from_millis(3500);
/// Why nothing begins for somebody, and what to do.
pub(super) const GONE: &str = "whoever asked for it waits no more";
pub(super) const BUSY: &str = "the machine was too busy to plan it in time: ask again";
/// Why a way isn't begun.
pub(super) const MEANWHILE: &str =
    "the robot was stopped, came to rest, or was asked for something else, while it was planned";
impl Drive {
    /// Plans from where the robot stands, or from where it goes, and asks it to go.
    pub(super) fn go(
        &mut self,
        live: &Live,
        about: &RobotInfo,
        snapshot: &Snapshot,
        waiting: &Waiting,
        drives: &DriveTo,
    ) -> Result<Begun, String> {
        let begun = computed();
        let is_over = || {
            computed().saturating_sub(begun) >= LONGEST
                || too_late(waiting).is_some()
                || drives.check_latest(self).is_err()
        };
        let walls = drives.walls();
        let obstacles: Vec<Obstacle> = snapshot.obstacles.iter().flatten().copied().collect();
        let lead = lead(live, about, snapshot);
        let from = lead.last().copied().unwrap_or(snapshot.record.setpoint.odom_from_body);
        let way = WayRequest {
            from,
            lead: &lead,
            to: self.goal,
            obstacles: &obstacles,
            spread_m: spread(about, snapshot),
            fence_m: snapshot.fence.corners_m(),
            walls_m: &walls.polygons_m,
            best: self.best,
            until: Until::over(&is_over),
        };
        // With all that it can do, as its replay makes it again of the table.
        let ability = Ability::of(&about.robot.plan);
        let timed = about.room.timed(&way, &ability, &about.registry).map_err(|error| {
            let has_ended = matches!(error, RoomError::Plan(PlanError::Ended));
            match (drives.check_latest(self), too_late(waiting)) {
                (Err(stopped), _) => stopped,
                (Ok(()), Some(late)) if has_ended => late.to_owned(),
                _ => error.to_string(),
            }
        })?;
        // What was looked at has been sampled; the robot gets one that begins anew.
        let fresh =
            about.registry.make_reference(&timed.table, &ability).map_err(|error| error.to_string())?;
        // Nobody who stopped it finds another reference loaded, and nothing moves for somebody who has gone away.
        drives.check_latest(self)?;
        if !is_still(&live.snapshot(), snapshot) {
            return Err(MEANWHILE.to_owned());
        }
        if let Some(late) = too_late(waiting) {
            return Err(late.to_owned());
        }
        let (number, _) = live.load(self.asker, timed.table.clone(), fresh).ok_or(FULL)?;
        (self.before, self.number) = (snapshot.reference, number);
        let ticket = drives.track(live, self)?;
        self.stage = Stage::Driving {
            poses: timed.plan.poses,
            obstacles: Box::new(snapshot.obstacles),
            walls: walls.number,
            is_seen: false,
            ticket,
        };
        self.since = Instant::now();
        let set = snapshot.setting("speed_factor").map_or(1.0, |(_, gain)| gain.value);
        let text = format!("{:.2} m in {:.1} s", timed.plan.length_m, timed.duration_s / set);
        Ok(Begun { ticket, text, number, table: timed.table })
    }
}

/// How far the footprint may truly be from where it is believed to be, at one standard deviation, m.
pub(super) fn spread(about: &RobotInfo, snapshot: &Snapshot) -> f64 {
    spread_m(&snapshot.record.state, &about.robot.plan.guard.footprint_m)
}

/// Why nothing begins for whoever asked, who waits no more, or perhaps no more.
pub(super) fn too_late(waiting: &Waiting) -> Option<&'static str> {
    if waiting.is_over() {
        return Some(GONE);
    }
    waiting.is_longer_than(TOO_LATE).then_some(BUSY)
}

/// What this thread has had of a processor.
fn computed() -> Duration {
    let used = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    Duration::try_from(used).unwrap_or_default()
}

/// Whether a robot that a way is planned for does what it did then: it follows the same, or stands where it stood.
pub(super) fn is_still(now: &Snapshot, then: &Snapshot) -> bool {
    let before = then.record.setpoint.odom_from_body;
    now.phase == then.phase
        && now.reference == then.reference
        && (then.phase == Phase::Tracking || is_there(now, &before))
}
