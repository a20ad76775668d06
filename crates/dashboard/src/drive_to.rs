//! Driving to a pose through the room: planned, driven, planned again where the way is blocked, given up with the reason.
//!
//! What is planned is loaded and started as any other reference is; what looks after it only pauses it, and only by itself. Whoever stops the
//! robot, or loads something else, ends it.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use omnibase_platform::Pose2;
use omnibase_robot::RequestKind;
use omnibase_robot::config::BestWay;
use omnibase_robot::guard::{MAX_OBSTACLES, Obstacle};
use omnibase_robot::signals::{Course, Phase, SafetyReason};
use omnibase_run::live::{Answer, Ask, Asker, Live, Snapshot, Stamp};
use omnibase_run::room::{Room, Way};
use schemars::JsonSchema;
use serde::Serialize;

use crate::robot_info::RobotInfo;

/// How often what is under way is looked at.
pub(crate) const LOOK: Duration = Duration::from_millis(100);
/// So long after a way was begun the robot may not be seen on it yet.
const BEGINS: Duration = Duration::from_secs(2);
/// Between two tries where there is no way now.
const AGAIN: Duration = Duration::from_millis(500);
/// An obstacle that moved by less than this is the same one, m.
const SAME_M: f64 = 0.01;
/// Nearer than this to the goal it is there, m and rad.
const THERE: f64 = 0.02;

type Obstacles = [Option<Obstacle>; MAX_OBSTACLES];

/// A way that is under way.
#[derive(Clone, Debug)]
struct Drive {
    asker: Asker,
    goal: Pose2,
    best: BestWay,
    /// Times that it was planned again.
    replans: u32,
    stage: Stage,
    since: Instant,
}

#[derive(Clone, Debug)]
enum Stage {
    /// On its way.
    Driving { number: u32, poses: Vec<Pose2>, obstacles: Box<Obstacles>, is_seen: bool },
    /// It comes to rest, or stands, and is planned again.
    Blocked { tried: Option<Instant> },
}

/// What a page is told of it.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub struct WaySeen {
    /// Where it goes: x m, y m, heading rad.
    goal: [f64; 3],
    /// What it does, or how it ended, in words.
    text: String,
    /// It is under way.
    under_way: bool,
    /// It ended without being there.
    failed: bool,
}

/// The one way at a time.
#[derive(Debug, Default)]
pub(crate) struct DriveTo {
    under_way: Mutex<Option<Drive>>,
    seen: Mutex<Option<WaySeen>>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A way that was begun: its ticket, and what to say.
pub(crate) struct Begun {
    pub(crate) ticket: u64,
    pub(crate) text: String,
    pub(crate) number: u32,
    pub(crate) table: omnibase_robot::config::ReferenceTable,
}

impl DriveTo {
    /// What pages are told.
    pub(crate) fn seen(&self) -> Option<WaySeen> {
        lock(&self.seen).clone()
    }

    /// Whether there is anything to look after.
    pub(crate) fn is_under_way(&self) -> bool {
        lock(&self.under_way).is_some()
    }

    /// Plans a way, and begins it.
    pub(crate) fn begin(
        &self,
        (live, about): (&Live, &RobotInfo),
        asker: Asker,
        (goal, best): (Pose2, Option<BestWay>),
    ) -> Result<Begun, String> {
        let snapshot = live.snapshot();
        if snapshot.phase != Phase::Holding {
            return Err(crate::status::unfit(snapshot.phase).trim_start_matches("refused: ").to_owned());
        }
        // It is as old as it is now, however long planning takes; a stop that comes meanwhile still counts.
        live.check_age(asker.stamp).map_err(|why| Answer::Refused(why).text().into_owned())?;
        let mut drive = Drive {
            asker: asker.stamped(Stamp::Here),
            goal,
            best: best.unwrap_or(about.room.way),
            replans: 0,
            stage: Stage::Blocked { tried: None },
            since: Instant::now(),
        };
        let begun = drive.go((live, about), &snapshot)?;
        self.say(&drive, begun.text.clone());
        *lock(&self.under_way) = Some(drive);
        Ok(begun)
    }

    fn say(&self, drive: &Drive, text: String) {
        let goal = [drive.goal.x_m, drive.goal.y_m, drive.goal.heading_rad];
        *lock(&self.seen) = Some(WaySeen { goal, text, under_way: true, failed: false });
    }

    /// It is over, well or not.
    fn end(&self, live: &Live, drive: &Drive, how: Result<&str, &str>) {
        *lock(&self.under_way) = None;
        let text = match how {
            Ok(text) => text.to_owned(),
            Err(why) => format!("drive_to was given up: {why}"),
        };
        if how.is_err() {
            live.tell(&text, Some(drive.asker.client));
        }
        if let Some(seen) = &mut *lock(&self.seen) {
            (seen.text, seen.under_way, seen.failed) = (text, false, how.is_err());
        }
    }

    /// Looks after the way that is under way; what was begun anew.
    pub(crate) fn look(&self, live: &Live, about: &RobotInfo) -> Option<Begun> {
        let drive = lock(&self.under_way).clone()?;
        let snapshot = live.snapshot();
        match &drive.stage {
            Stage::Driving { number, is_seen, .. } => {
                let is_own = snapshot.reference == *number && snapshot.record.course == Course::Reference;
                match snapshot.phase {
                    Phase::Tracking if is_own => self.watch(live, about, (drive, &snapshot)),
                    _ if !is_seen && drive.since.elapsed() < BEGINS => {}
                    Phase::Holding if is_there(&snapshot, &drive.goal) => self.end(live, &drive, Ok("there")),
                    Phase::Stopping | Phase::Holding
                        if snapshot.record.stop_reason == SafetyReason::WayBlocked && *is_seen =>
                    {
                        self.block(drive);
                    }
                    _ => self.end(live, &drive, Err("somebody or something else stopped it")),
                }
                None
            }
            Stage::Blocked { tried } => {
                let is_due = tried.is_none_or(|tried| tried.elapsed() >= AGAIN);
                match snapshot.phase {
                    Phase::Holding if is_due => self.again((live, about), drive, &snapshot),
                    Phase::Holding | Phase::Tracking | Phase::Stopping => None,
                    _ => {
                        self.end(live, &drive, Err("the robot was stopped"));
                        None
                    }
                }
            }
        }
    }

    /// Pauses a way onto which something came.
    fn watch(&self, live: &Live, about: &RobotInfo, (mut drive, snapshot): (Drive, &Snapshot)) {
        let Stage::Driving { poses, obstacles, is_seen, .. } = &mut drive.stage else { return };
        *is_seen = true;
        let here = snapshot.record.setpoint.odom_from_body;
        let now = new_obstacles(&snapshot.obstacles, obstacles);
        let is_blocked = now.iter().any(|obstacle| about.room.meets(left(poses, &here), obstacle));
        if is_blocked {
            live.send(drive.asker, Ask::Robot(RequestKind::Pause));
            self.block(drive);
        } else {
            *lock(&self.under_way) = Some(drive);
        }
    }

    fn block(&self, mut drive: Drive) {
        (drive.stage, drive.since) = (Stage::Blocked { tried: None }, Instant::now());
        self.say(&drive, "the way is blocked: it is planned again".to_owned());
        *lock(&self.under_way) = Some(drive);
    }

    /// Plans again from where the robot stands; gives up where there was no way for too long.
    fn again(&self, robot: (&Live, &RobotInfo), mut drive: Drive, snapshot: &Snapshot) -> Option<Begun> {
        let give_up_s = robot.1.robot.plan.guard.give_up_s;
        match drive.go(robot, snapshot) {
            Ok(begun) => {
                drive.replans += 1;
                let text = format!("{}; planned again {} times", begun.text, drive.replans);
                robot.0.tell(&format!("drive_to: the way was blocked, another one of {}", begun.text), None);
                self.say(&drive, text);
                *lock(&self.under_way) = Some(drive);
                Some(begun)
            }
            Err(why) if drive.since.elapsed().as_secs_f64() >= give_up_s => {
                self.end(robot.0, &drive, Err(&why));
                None
            }
            Err(why) => {
                drive.stage = Stage::Blocked { tried: Some(Instant::now()) };
                self.say(&drive, format!("it waits: {why}"));
                *lock(&self.under_way) = Some(drive);
                None
            }
        }
    }
}

impl Drive {
    /// Plans from where the robot stands, and asks it to go.
    fn go(&mut self, (live, about): (&Live, &RobotInfo), snapshot: &Snapshot) -> Result<Begun, String> {
        let obstacles: Vec<Obstacle> = snapshot.obstacles.iter().flatten().copied().collect();
        let from = snapshot.record.setpoint.odom_from_body;
        let way = Way { from, to: self.goal, obstacles: &obstacles, best: self.best };
        let limits = &about.robot.plan.limits;
        let timed = about.room.timed(&way, limits, &about.registry).map_err(|error| error.to_string())?;
        // What was looked at has been sampled; the robot gets one that begins anew.
        let fresh = about
            .registry
            .make_reference(&timed.table, &omnibase_robot::Ability::from(limits))
            .map_err(|error| error.to_string())?;
        let full = "too much was asked at once";
        let (number, _) = live.load(self.asker, timed.table.clone(), fresh).ok_or(full)?;
        let ticket = live.send(self.asker, Ask::Robot(RequestKind::Track)).ok_or(full)?;
        self.stage = Stage::Driving {
            number,
            poses: timed.plan.poses,
            obstacles: Box::new(snapshot.obstacles),
            is_seen: false,
        };
        self.since = Instant::now();
        let text = format!("{:.2} m in {:.1} s", timed.plan.length_m, timed.duration_s);
        Ok(Begun { ticket, text, number, table: timed.table })
    }
}

/// Obstacles that aren't where they were when the way was planned; those that move by themselves are the guard's.
fn new_obstacles(now: &Obstacles, planned: &Obstacles) -> Vec<Obstacle> {
    let is_new = |(obstacle, before): &(&Option<Obstacle>, &Option<Obstacle>)| match (obstacle, before) {
        (Some(obstacle), _) if obstacle.velocity_m_s != [0.0; 2] => false,
        (Some(obstacle), Some(before)) => {
            let moved = [0, 1].map(|axis| obstacle.centre_m[axis] - before.centre_m[axis]);
            moved[0].hypot(moved[1]) > SAME_M || obstacle.radius_m > before.radius_m + SAME_M
        }
        (Some(_), None) => true,
        (None, _) => false,
    };
    now.iter().zip(planned).filter(is_new).filter_map(|(obstacle, _)| *obstacle).collect()
}

/// What is left of a way from the place nearest to a pose on.
fn left<'p>(poses: &'p [Pose2], here: &Pose2) -> &'p [Pose2] {
    let near = |(_, pose): &(usize, &Pose2)| pose.distance_m(*here);
    let nearest = poses.iter().enumerate().min_by(|a, b| near(a).total_cmp(&near(b)));
    &poses[nearest.map_or(0, |(at, _)| at)..]
}

fn is_there(snapshot: &Snapshot, goal: &Pose2) -> bool {
    let here = snapshot.record.setpoint.odom_from_body;
    let turned = omnibase_platform::wrap_angle_rad(here.heading_rad - goal.heading_rad).abs();
    here.distance_m(*goal) < THERE && turned < THERE
}

/// The map as a page draws it.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct MapSeen {
    /// Cells along x and y.
    size: [usize; 2],
    /// Side of a cell, m.
    cell_m: f64,
    /// Outer corner of the first cell in odom, and how the rows are turned: x m, y m, rad.
    odom_from_grid: [f64; 3],
    /// Each row from below: how many cells are free, then in the way, then free, and so on.
    rows: Vec<Vec<usize>>,
    /// Polygons that are in the way, in odom, m.
    blocked_m: Vec<Vec<[f64; 2]>>,
}

impl MapSeen {
    /// The room's.
    pub(crate) fn of(room: &Room) -> Self {
        let blocked_m = room.blocked_m();
        let Some(map) = room.map() else {
            let (size, odom_from_grid) = ([0; 2], [0.0; 3]);
            return MapSeen { size, cell_m: 0.0, odom_from_grid, rows: Vec::new(), blocked_m };
        };
        let runs = |row: &[bool]| {
            let mut runs = vec![0];
            let mut is_blocked = false;
            for cell in row {
                if *cell != is_blocked {
                    is_blocked = *cell;
                    runs.push(0);
                }
                if let Some(last) = runs.last_mut() {
                    *last += 1;
                }
            }
            runs
        };
        let Pose2 { x_m, y_m, heading_rad } = map.map_from_grid;
        MapSeen {
            size: [map.width, map.height],
            cell_m: map.cell_m,
            odom_from_grid: [x_m, y_m, heading_rad],
            rows: map.blocked.chunks_exact(map.width).map(runs).collect(),
            blocked_m,
        }
    }
}
