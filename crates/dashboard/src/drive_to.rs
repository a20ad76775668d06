//! Driving to a pose through the room: planned, driven, planned again where the way is blocked, given up with the reason.
//!
//! What is planned is loaded and started as any other reference is, but by what looks after it alone: nobody else begins it or goes on with it.
//! Whoever stops or pauses the robot, or asks it for something else, ends it, whatever is planned meanwhile.

mod going;
mod lead;

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use omnibase_platform::Pose2;
use omnibase_robot::RequestKind;
use omnibase_robot::config::BestWay;
use omnibase_robot::guard::{MAX_OBSTACLES, Obstacle};
use omnibase_robot::signals::{Course, Phase, SafetyReason};
use omnibase_run::live::{Answer, Ask, Asker, Client, Commander, Live, Refusal, Snapshot, Stamp};
use omnibase_run::room::stands_at;

use crate::robot_info::RobotInfo;
use crate::room_seen::WaySeen;
use crate::work::Waiting;
use going::{MEANWHILE, is_still, spread};

/// Most walls that are drawn, and most corners of one.
const MOST: usize = 100;
/// Farther than this from the origin nobody draws, m.
const GREATEST: f64 = 1e4;
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
/// A drive that got farther than this from where it was held up got on, m and rad.
const GOT_ON: f64 = 0.1;
/// Why a drive is over that others ended.
const REPLACED: &str = "it was stopped, or something else was asked";
/// Why something can't be sent.
const FULL: &str = "too much was asked at once";

type Point = [f64; 2];
type Obstacles = [Option<Obstacle>; MAX_OBSTACLES];

/// A way that is under way.
#[derive(Clone, Debug)]
struct Drive {
    /// Which of all that were asked for it is.
    order: u64,
    asker: Asker,
    goal: Pose2,
    best: BestWay,
    /// Times that it was planned again.
    replans: u32,
    /// The number of the reference that was loaded for it.
    number: u32,
    /// That of the one before, on which the robot is until it goes over, and stays where it can't.
    before: u32,
    stage: Stage,
    since: Instant,
    held_up: Option<HeldUp>,
    /// The one whose place it takes once the robot goes; it goes on where the robot refuses.
    replaces: Option<Box<Drive>>,
}

/// Where a drive gets no farther, and since when.
#[derive(Clone, Copy, Debug, PartialEq)]
struct HeldUp {
    at: Pose2,
    since: Instant,
}

impl HeldUp {
    /// It is held up here now; that began when it was held up about here before.
    fn again(before: Option<HeldUp>, here: Pose2, now: Instant) -> HeldUp {
        let turned_rad = |at: &Pose2| omnibase_platform::wrap_angle_rad(at.heading_rad - here.heading_rad);
        let is_same = |one: &HeldUp| one.at.distance_m(here) < GOT_ON && turned_rad(&one.at).abs() < GOT_ON;
        before.filter(is_same).unwrap_or(HeldUp { at: here, since: now })
    }
}

#[derive(Clone, Debug)]
enum Stage {
    /// On its way.
    Driving {
        poses: Vec<Pose2>,
        obstacles: Box<Obstacles>,
        /// The walls' number.
        walls: u32,
        is_seen: bool,
        /// Of what asked the robot to go.
        ticket: u64,
    },
    /// It comes to rest, or stands, and is planned again.
    Blocked { tried: Option<Instant> },
}

/// The one way at a time.
#[derive(Debug, Default)]
pub(crate) struct DriveTo {
    under_way: Mutex<Option<Drive>>,
    /// The only one that may still begin or go on; changed with `under_way` locked.
    latest: AtomicU64,
    seen: Mutex<Option<WaySeen>>,
    walls: Mutex<Walls>,
}

/// Walls that were drawn, and how often.
#[derive(Clone, Debug, Default)]
struct Walls {
    number: u32,
    polygons_m: Arc<Vec<Vec<Point>>>,
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

    /// How often walls were drawn.
    pub(crate) fn walls_number(&self) -> u32 {
        lock(&self.walls).number
    }

    /// The walls that are drawn, in odom, m.
    pub(crate) fn walls_m(&self) -> Arc<Vec<Vec<Point>>> {
        lock(&self.walls).polygons_m.clone()
    }

    /// Draws walls in place of those before.
    pub(crate) fn draw_walls(&self, polygons_m: Vec<Vec<Point>>) -> Result<String, String> {
        if polygons_m.len() > MOST {
            return Err(format!("polygons_m: expected at most {MOST} walls, found {}", polygons_m.len()));
        }
        for (number, corners) in polygons_m.iter().enumerate() {
            if !(3..=MOST).contains(&corners.len()) {
                return Err(format!(
                    "polygons_m[{number}]: expected 3 to {MOST} corners, found {}",
                    corners.len()
                ));
            }
            if let Some(wrong) = corners.iter().flatten().find(|part| part.is_nan() || part.abs() > GREATEST)
            {
                return Err(format!(
                    "polygons_m[{number}]: expected numbers from -{GREATEST} to {GREATEST}, found {wrong}"
                ));
            }
        }
        let mut walls = lock(&self.walls);
        let text = match polygons_m.len() {
            1 => "1 wall is drawn".to_owned(),
            count => format!("{count} walls are drawn"),
        };
        *walls = Walls { number: walls.number + 1, polygons_m: polygons_m.into() };
        Ok(text)
    }

    /// Whether there is anything to look after.
    pub(crate) fn is_under_way(&self) -> bool {
        lock(&self.under_way).is_some()
    }

    /// Plans a way, and begins it; nothing where the robot stands there already. What is refused leaves all as it was.
    pub(crate) fn begin(
        &self,
        live: &Live,
        about: &RobotInfo,
        asker: Asker,
        waiting: &Waiting,
        goal: Pose2,
        best: Option<BestWay>,
    ) -> Result<Option<Begun>, String> {
        let snapshot = live.snapshot();
        if !matches!(snapshot.phase, Phase::Holding | Phase::Tracking) {
            return Err(crate::status::unfit(snapshot.phase).to_owned());
        }
        // It is as old as it is now, however long planning takes; a stop that comes meanwhile still counts.
        live.check_age(asker.stamp).map_err(|why| Answer::Refused(why).text().into_owned())?;
        if let Commander::Reference(leader) = snapshot.extras.authority.commander
            && leader != asker.client
        {
            return Err(Answer::Refused(Refusal::Led).text().into_owned());
        }
        if snapshot.phase == Phase::Holding && stands_at(&snapshot.record.setpoint.odom_from_body, &goal) {
            return Ok(None);
        }
        let (order, replaces) = self.take_over();
        let mut drive = Drive {
            order,
            asker: asker.stamped(Stamp::OnBehalf),
            goal,
            best: best.unwrap_or(about.room.way),
            replans: 0,
            number: snapshot.reference,
            before: snapshot.reference,
            stage: Stage::Blocked { tried: None },
            since: Instant::now(),
            held_up: None,
            replaces: replaces.map(Box::new),
        };
        match drive.go(live, about, &snapshot, waiting, self) {
            Ok(begun) => {
                self.keep(drive, Some(begun.text.clone()));
                Ok(Some(begun))
            }
            Err(why) => self.give_back(drive).and(Err(why)),
        }
    }

    fn walls(&self) -> Walls {
        lock(&self.walls).clone()
    }

    /// Somebody stopped or paused the robot, or ended what this client alone had begun: no way begins, or goes on, that was asked for
    /// before, wherever it is: planned, driven, planned again, or waiting for that.
    pub(crate) fn stop(&self, live: &Live, whose: Option<Client>) {
        let is_anothers = |drive: &Drive| whose.is_some_and(|client| client != drive.asker.client);
        if lock(&self.under_way).as_ref().is_some_and(is_anothers) {
            return;
        }
        if let (_, Some(drive)) = self.take_over() {
            self.tell_end(live, &drive, Err(REPLACED));
        }
    }

    /// Nobody goes on with the one before; the order of the next.
    fn take_over(&self) -> (u64, Option<Drive>) {
        let mut under_way = lock(&self.under_way);
        (self.latest.fetch_add(1, Ordering::Relaxed) + 1, under_way.take())
    }

    /// A drive that doesn't begin leaves the place to the one that it would have replaced, unless both were ended meanwhile.
    fn give_back(&self, drive: Drive) -> Result<(), String> {
        let mut under_way = lock(&self.under_way);
        self.check_latest(&drive)?;
        *under_way = drive.replaces.map(|before| Drive { order: drive.order, ..*before });
        Ok(())
    }

    /// Goes on with a drive, unless it was ended meanwhile; what to say of it.
    fn keep(&self, drive: Drive, text: Option<String>) {
        let mut under_way = lock(&self.under_way);
        if self.check_latest(&drive).is_err() {
            return;
        }
        if let Some(text) = text {
            let goal = [drive.goal.x_m, drive.goal.y_m, drive.goal.heading_rad];
            *lock(&self.seen) = Some(WaySeen { goal, text, under_way: true, failed: false });
        }
        *under_way = Some(drive);
    }

    fn check_latest(&self, drive: &Drive) -> Result<(), String> {
        if self.latest.load(Ordering::Relaxed) == drive.order {
            return Ok(());
        }
        Err(MEANWHILE.to_owned())
    }

    /// Lets the robot go, unless the drive was ended while it was planned: its ticket.
    fn track(&self, live: &Live, drive: &Drive) -> Result<u64, String> {
        let under_way = lock(&self.under_way);
        self.check_latest(drive)?;
        let ticket = live.send(drive.asker, Ask::Robot(RequestKind::Track));
        drop(under_way);
        ticket.ok_or_else(|| FULL.to_owned())
    }

    /// It is over, well or not; unless it was before.
    fn end(&self, live: &Live, drive: &Drive, how: Result<&str, &str>) {
        let ended = lock(&self.under_way).take_if(|other| other.order == drive.order);
        if ended.is_some() {
            self.tell_end(live, drive, how);
        }
    }

    fn tell_end(&self, live: &Live, drive: &Drive, how: Result<&str, &str>) {
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
            Stage::Driving { is_seen, ticket, .. } => {
                let is_own = snapshot.reference == drive.number && follows(&snapshot);
                match snapshot.phase {
                    _ if !is_seen && is_refused(live, *ticket) => self.refused(live, about, drive, &snapshot),
                    Phase::Tracking if is_own => return self.watch(live, about, drive, &snapshot),
                    _ if !is_seen && drive.since.elapsed() < BEGINS => {}
                    Phase::Holding if is_there(&snapshot, &drive.goal) => self.end(live, &drive, Ok("there")),
                    Phase::Stopping | Phase::Holding
                        if snapshot.record.stop_reason == SafetyReason::WayBlocked && *is_seen =>
                    {
                        self.block(live, about, drive, &snapshot);
                    }
                    _ => self.end(live, &drive, Err("somebody or something else stopped it")),
                }
                None
            }
            Stage::Blocked { tried } => {
                let is_due = tried.is_none_or(|tried| tried.elapsed() >= AGAIN);
                // Whoever leads it elsewhere, or loads something else, has it.
                let is_led = snapshot.phase == Phase::Tracking && !follows(&snapshot);
                let is_own = [drive.number, drive.before].contains(&snapshot.reference);
                // Only what comes onto its way, and its own pause, lets it go on by itself.
                let is_of_the_way = matches!(
                    snapshot.record.stop_reason,
                    SafetyReason::None | SafetyReason::Requested | SafetyReason::WayBlocked
                );
                match snapshot.phase {
                    Phase::Holding if !is_of_the_way => {
                        self.end(live, &drive, Err("the robot was stopped"));
                        None
                    }
                    _ if is_led || !is_own => {
                        self.end(live, &drive, Err("something else was asked of the robot"));
                        None
                    }
                    Phase::Holding if is_there(&snapshot, &drive.goal) => {
                        self.end(live, &drive, Ok("there"));
                        None
                    }
                    Phase::Holding if is_due => self.again(live, about, drive, &snapshot),
                    Phase::Holding | Phase::Tracking | Phase::Stopping => None,
                    _ => {
                        self.end(live, &drive, Err("the robot was stopped"));
                        None
                    }
                }
            }
        }
    }

    /// Goes over into another way where something came onto this one; where there is none the robot is paused.
    fn watch(&self, live: &Live, about: &RobotInfo, mut drive: Drive, snapshot: &Snapshot) -> Option<Begun> {
        let Stage::Driving { poses, obstacles, walls, is_seen, .. } = &mut drive.stage else { return None };
        *is_seen = true;
        if let Some(before) = drive.replaces.take() {
            live.tell(&format!("drive_to was given up: {REPLACED}"), Some(before.asker.client));
        }
        let here = snapshot.record.setpoint.odom_from_body;
        let spread_m = spread(about, snapshot);
        let now = new_obstacles(&snapshot.obstacles, obstacles);
        // Walls that were drawn meanwhile: it is planned anew whatever they are.
        let is_blocked = *walls != self.walls_number()
            || now.iter().any(|obstacle| about.room.meets(left(poses, &here), obstacle, spread_m));
        if !is_blocked {
            self.keep(drive, None);
            return None;
        }
        let mut other = drive.clone();
        let Ok(begun) = other.go(live, about, snapshot, &Waiting::here(), self) else {
            // Whoever stopped it, or asked it for something else, meanwhile has it: it is looked at anew.
            if self.check_latest(&drive).is_ok() && is_still(&live.snapshot(), snapshot) {
                self.pause(live, about, drive, snapshot);
            } else {
                self.keep(drive, None);
            }
            return None;
        };
        let why = if now.is_empty() { "walls were drawn" } else { "the way was blocked" };
        Some(self.go_on(live, other, begun, why))
    }

    /// The robot goes on by another way.
    fn go_on(&self, live: &Live, mut drive: Drive, begun: Begun, why: &str) -> Begun {
        drive.replans += 1;
        let times = if drive.replans == 1 { "once".to_owned() } else { format!("{} times", drive.replans) };
        let text = format!("{}; planned again {times}", begun.text);
        live.tell(&format!("drive_to: {why}, another one of {}", begun.text), None);
        self.keep(drive, Some(text));
        begun
    }

    /// The robot doesn't go. What it was asked for anew leaves it as it was; where its way was blocked it has to wait.
    fn refused(&self, live: &Live, about: &RobotInfo, drive: Drive, snapshot: &Snapshot) {
        let Stage::Driving { ticket, .. } = drive.stage else { return };
        let answer = live.answer(ticket);
        if drive.replans == 0 {
            let why = answer.map_or_else(String::new, |answer| answer.text().into_owned());
            let goes_on = drive.replaces.as_ref().map(|before| before.goal);
            let text = if goes_on.is_some() { format!("on the way; another one was {why}") } else { why };
            let goal = goes_on.unwrap_or(drive.goal);
            if self.give_back(drive).is_err() {
                return;
            }
            let goal = [goal.x_m, goal.y_m, goal.heading_rad];
            let (under_way, failed) = (goes_on.is_some(), goes_on.is_none());
            *lock(&self.seen) = Some(WaySeen { goal, text, under_way, failed });
        } else if let Some(Answer::Robot(_)) = answer {
            self.pause(live, about, drive, snapshot);
        } else {
            self.end(live, &drive, Err("somebody else has the robot"));
        }
    }

    fn pause(&self, live: &Live, about: &RobotInfo, drive: Drive, snapshot: &Snapshot) {
        live.send(drive.asker, Ask::Robot(RequestKind::Pause));
        self.block(live, about, drive, snapshot);
    }

    /// It waits to be planned again, unless it got no farther since that was done.
    fn block(&self, live: &Live, about: &RobotInfo, mut drive: Drive, snapshot: &Snapshot) {
        let now = Instant::now();
        let held_up = HeldUp::again(drive.held_up, snapshot.record.setpoint.odom_from_body, now);
        if (now - held_up.since).as_secs_f64() >= about.robot.plan.guard.give_up_s {
            return self.end(
                live,
                &drive,
                Err("however it is planned, it gets no farther from where it stands"),
            );
        }
        drive.held_up = Some(held_up);
        (drive.stage, drive.since) = (Stage::Blocked { tried: None }, now);
        self.keep(drive, Some("the way is blocked: it is planned again".to_owned()));
    }

    /// Plans again from where the robot stands; gives up where there was no way for too long.
    fn again(&self, live: &Live, about: &RobotInfo, mut drive: Drive, snapshot: &Snapshot) -> Option<Begun> {
        let give_up_s = about.robot.plan.guard.give_up_s;
        match drive.go(live, about, snapshot, &Waiting::here(), self) {
            Ok(begun) => Some(self.go_on(live, drive, begun, "the way was blocked")),
            Err(why) if drive.since.elapsed().as_secs_f64() >= give_up_s => {
                self.end(live, &drive, Err(&why));
                None
            }
            Err(why) => {
                drive.stage = Stage::Blocked { tried: Some(Instant::now()) };
                self.keep(drive, Some(format!("it waits: {why}")));
                None
            }
        }
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

/// Whether it follows its reference, or is on the way onto it.
fn follows(snapshot: &Snapshot) -> bool {
    matches!(snapshot.record.course, Course::Reference | Course::Onto)
}

/// Whether the robot couldn't go over into it.
fn is_refused(live: &Live, ticket: u64) -> bool {
    live.answer(ticket).is_some_and(|answer| !answer.is_done())
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

#[cfg(test)]
mod tests;
