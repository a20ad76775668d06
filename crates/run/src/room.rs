//! The room of a robot's file, and ways through it.

use std::cell::Cell;
use std::path::Path;

use omnibase_plan::map::Unknown;
use omnibase_plan::{Cost, Footprint, Map, MapError, Plan, PlanError, Point, Space, Sweep, Task, Until};
use omnibase_platform::{Pose2, Twist2};
use omnibase_robot::config::{
    AtObstacles, BestWay, FencePlan, GuardPlan, Limits, MapTable, PathFrame, ReferenceTable, Timing,
    UnknownCells,
};
use omnibase_robot::guard::Obstacle;
use omnibase_robot::limiter::Limiter;
use omnibase_robot::stages::Reference;
use omnibase_robot::{Ability, Registry, RobotPlan};

use crate::small_file;

/// The side of a cell where no map says it, m.
const CELL_M: f64 = 0.05;
/// What a footprint keeps from walls, m.
const CLEARANCE_M: f64 = 0.05;
/// Room beside what the guard keeps from fence and obstacles, so that it lets the robot pass, m.
const BESIDE_GUARD_M: f64 = 0.05;
/// Where there is neither map nor fence, the floor goes so far beyond both ends of a way and all obstacles, m.
const OPEN_M: f64 = 5.0;
/// The longest YAML file of a map, and the longest image, bytes.
const LONGEST_YAML: u64 = 64 * 1024;
const LONGEST_IMAGE: u64 = 128 * 1024 * 1024;
/// A kink that couldn't be bent is cut by at most this, m.
const CORNER_M: f64 = 0.01;
/// Parts of the platform's speeds with which a way is tried until every stop on it touches nothing.
const SPEEDS: [f64; 6] = [1.0, 0.7, 0.5, 0.35, 0.2, 0.1];
/// A stop is looked at in such steps, from every fourth of them on a way, s.
const STOP_STEP_S: f64 = 0.01;
const STOP_EVERY: u32 = 4;
/// So many obstacles at once are left straight away from.
const LEFT_AT_ONCE: usize = 4;
/// Rounding of a speed.
const SPEED_ROUNDING: f64 = 1.001;
/// Nearer than this there is no way to go, m and rad.
const THERE: f64 = 1e-6;
/// Nearer points than this are one for the timing, m and rad.
const SAME: f64 = 1e-3;

/// What of a room doesn't change while the robot runs.
#[derive(Clone, Debug)]
pub struct Room {
    /// The map's file, read; its frame is odom.
    map: Option<Map>,
    blocked_m: Vec<Vec<Point>>,
    odom_from_map: Pose2,
    cell_m: f64,
    clearance_m: f64,
    footprint: Footprint,
    guard: GuardPlan,
    /// What the robot's file chose.
    pub way: BestWay,
}

/// What is asked of a room.
#[derive(Clone, Debug)]
pub struct WayRequest<'a> {
    /// Where the robot stands, in odom.
    pub from: Pose2,
    /// Where it goes already, up to `from`: the way begins there. None where it stands.
    pub lead: &'a [Pose2],
    /// Where it shall stand, in odom.
    pub to: Pose2,
    /// Obstacles as they are now.
    pub obstacles: &'a [Obstacle],
    /// How far a place of the footprint may truly be from where it is believed to be, at one standard deviation, m: the guard keeps more
    /// from obstacles for that.
    pub spread_m: f64,
    /// The fence as it is now, in odom, m; no corners where there is none.
    pub fence_m: &'a [Point],
    /// Walls that were drawn, in odom, m.
    pub walls_m: &'a [Vec<Point>],
    /// Which way is the best one.
    pub best: BestWay,
    /// How long it is looked for.
    pub until: Until<'a>,
}

/// A way with its times.
pub struct TimedWay {
    /// The way, in odom.
    pub plan: Plan,
    /// As a reference's table: what `run --path` and `load` take.
    pub table: ReferenceTable,
    /// As a reference.
    pub reference: Box<dyn Reference>,
    /// How long it takes, s.
    pub duration_s: f64,
}

/// Why there is no way, or no room.
#[derive(Debug, thiserror::Error)]
pub enum RoomError {
    /// The map.
    #[error("map: {0}")]
    Map(#[from] MapError),
    /// The map's file.
    #[error("map.file {name}: {why}")]
    File {
        /// Its name.
        name: String,
        /// What is wrong with it.
        why: String,
    },
    /// The footprint.
    #[error("footprint: {0}")]
    Footprint(#[from] omnibase_plan::FootprintError),
    /// The way.
    #[error("{0}")]
    Plan(#[from] PlanError),
    /// There is no way to go.
    #[error("it stands there already")]
    There,
    /// Its timing.
    #[error("the way was found, but it can't be timed: {0}")]
    Timing(String),
    /// The timed motion isn't quite the way, or it can't be known beforehand.
    #[error("the way was found, but the motion along it touches what is in the way at x {:.3} m, y {:.3} m", at.x_m, at.y_m)]
    Touches {
        /// Where.
        at: Pose2,
    },
    /// Whoever is stopped on it goes straight on.
    #[error("the way was found, but a stop on it touches what is in the way at x {:.3} m, y {:.3} m, however slowly it is gone along", at.x_m, at.y_m)]
    StopTouches {
        /// Where.
        at: Pose2,
    },
}

/// Reads a map of ROS's map_server.
pub fn read_map(path: &Path, unknown: UnknownCells) -> Result<Map, RoomError> {
    let name = path.display().to_string();
    let wrong = |why: String| RoomError::File { name: name.clone(), why };
    let bytes = small_file::read(path, LONGEST_YAML).map_err(|error| wrong(error.to_string()))?;
    let yaml = String::from_utf8(bytes)
        .map_err(|error| wrong(format!("byte {}: expected UTF-8", error.utf8_error().valid_up_to())))?;
    let unknown = match unknown {
        UnknownCells::Blocked => Unknown::Blocked,
        UnknownCells::Free => Unknown::Free,
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    let image =
        |image: &str| small_file::read(&folder.join(image), LONGEST_IMAGE).map_err(|error| error.to_string());
    Map::read(&yaml, unknown, image).map_err(|error| wrong(error.to_string()))
}

impl Room {
    /// The room of a robot; its map's file is looked for in a folder.
    pub fn of(plan: &RobotPlan, folder: &Path) -> Result<Room, RoomError> {
        let table = plan.map.clone().unwrap_or_default();
        let unknown = table.unknown.unwrap_or_default();
        let map = table.file.as_ref().map(|file| read_map(&folder.join(file), unknown)).transpose()?;
        Room::with_map(plan, map)
    }

    /// The room of a robot with another map than its file's.
    pub fn with_map(plan: &RobotPlan, map: Option<Map>) -> Result<Room, RoomError> {
        let MapTable { blocked_m, odom_from_map, cell_m, clearance_m, way, .. } =
            plan.map.clone().unwrap_or_default();
        let [x_m, y_m, heading_rad] = odom_from_map.unwrap_or_default();
        let odom_from_map = Pose2::new(x_m, y_m, heading_rad);
        let map = map.map(|mut map| {
            map.map_from_grid = odom_from_map.then(map.map_from_grid);
            map
        });
        Ok(Room {
            map,
            blocked_m: blocked_m.unwrap_or_default(),
            odom_from_map,
            cell_m: cell_m.unwrap_or(CELL_M),
            clearance_m: clearance_m.unwrap_or(CLEARANCE_M),
            footprint: Footprint::new(plan.guard.footprint_m.clone())?,
            guard: plan.guard.clone(),
            way: way.unwrap_or_default(),
        })
    }

    /// The same, keeping another clearance from walls, m.
    #[must_use]
    pub fn keeping(self, clearance_m: f64) -> Room {
        Room { clearance_m, ..self }
    }

    /// The map's file, in odom.
    pub fn map(&self) -> Option<&Map> {
        self.map.as_ref()
    }

    /// Polygons that are in the way, in odom, m.
    pub fn blocked_m(&self) -> Vec<Vec<Point>> {
        let in_odom = |corner: &Point| {
            let at = self.odom_from_map.then(Pose2::new(corner[0], corner[1], 0.0));
            [at.x_m, at.y_m]
        };
        self.blocked_m.iter().map(|polygon| polygon.iter().map(in_odom).collect()).collect()
    }

    /// The footprint.
    pub fn footprint(&self) -> &Footprint {
        &self.footprint
    }

    /// Everything that is in the way of a way.
    pub fn space(&self, way: &WayRequest<'_>) -> Result<Space, RoomError> {
        let mut map = match (&self.map, way.fence_m) {
            (Some(map), _) => map.clone(),
            (None, []) => self.open_floor(way)?,
            (None, fence_m) => Map::of_room(fence_m, self.cell_m)?,
        };
        for polygon in self.blocked_m().iter().chain(way.walls_m) {
            map.block_polygon(polygon);
        }
        let beside_m = BESIDE_GUARD_M - self.clearance_m;
        if !way.fence_m.is_empty() {
            let margin_m = self.guard.fence.as_ref().map_or(FencePlan::NONE.margin_m, |fence| fence.margin_m);
            map.keep_inside(way.fence_m);
            map.block_sides(way.fence_m, margin_m + beside_m);
        }
        for obstacle in way.obstacles {
            // Nobody could begin inside what is kept.
            let near_m = self.gap_m(&way.from, obstacle) - self.clearance_m - 0.5 * map.cell_m;
            let kept_m = (self.kept_m(way.spread_m) + beside_m).max(0.0).min(near_m.max(0.0));
            map.block_circle(obstacle.centre_m, obstacle.radius_m + kept_m);
        }
        Ok(Space::new(map))
    }

    /// From the footprint at a pose to an obstacle, m, at most: by its corners and sides.
    fn gap_m(&self, pose: &Pose2, obstacle: &Obstacle) -> f64 {
        let [x_m, y_m] = self.away_m(pose, obstacle);
        x_m.hypot(y_m) - obstacle.radius_m
    }

    /// From the middle of an obstacle to the nearest place on the footprint's sides, m.
    fn away_m(&self, pose: &Pose2, obstacle: &Obstacle) -> [f64; 2] {
        let corners = self.footprint.placed_m(pose);
        let to_side = |at: usize| {
            let (from, to) = (corners[at], corners[(at + 1) % corners.len()]);
            let side = [to[0] - from[0], to[1] - from[1]];
            let away = [obstacle.centre_m[0] - from[0], obstacle.centre_m[1] - from[1]];
            let square = side[0] * side[0] + side[1] * side[1];
            let part = ((away[0] * side[0] + away[1] * side[1]) / square).clamp(0.0, 1.0);
            [part * side[0] - away[0], part * side[1] - away[1]]
        };
        let length_m = |[x_m, y_m]: &[f64; 2]| x_m.hypot(*y_m);
        let nearest = (0..corners.len()).map(to_side).min_by(|a, b| length_m(a).total_cmp(&length_m(b)));
        nearest.unwrap_or([f64::INFINITY; 2])
    }

    /// Where a robot that stands inside of what is planned to be kept from obstacles is out of it: straight away from them, for the guard lets nothing
    /// else pass there. Where it stands, where that is no way out.
    fn way_out(&self, way: &WayRequest<'_>) -> Pose2 {
        let (mut at, cell_m) = (way.from, self.map.as_ref().map_or(self.cell_m, |map| map.cell_m));
        // Just beside it the guard lets nothing come nearer either, as it would by a cell.
        let beside_m = self.kept_m(way.spread_m) + BESIDE_GUARD_M;
        let (enough_m, free_m) = (beside_m + 0.5 * cell_m, beside_m + cell_m);
        for _ in 0..LEFT_AT_ONCE {
            let gap_m = |obstacle: &&Obstacle| self.gap_m(&at, obstacle);
            let nearest = way.obstacles.iter().min_by(|a, b| gap_m(a).total_cmp(&gap_m(b)));
            let Some(nearest) = nearest.filter(|nearest| gap_m(nearest) < enough_m) else { return at };
            let [x_m, y_m] = self.away_m(&at, nearest);
            let (apart_m, lacks_m) = (x_m.hypot(y_m), free_m - gap_m(&nearest));
            if apart_m <= nearest.radius_m {
                break;
            }
            (at.x_m, at.y_m) = (at.x_m + lacks_m * x_m / apart_m, at.y_m + lacks_m * y_m / apart_m);
        }
        way.from
    }

    /// What the guard keeps from an obstacle, m.
    fn kept_m(&self, spread_m: f64) -> f64 {
        self.guard.distance_m + self.guard.obstacle_sigmas * spread_m
    }

    /// Whether a way comes nearer to an obstacle than the robot keeps from it, whose pose is spread as [`WayRequest::spread_m`] says.
    pub fn meets(&self, way: &[Pose2], obstacle: &Obstacle, spread_m: f64) -> bool {
        let holds = |pose: &Pose2| {
            let at = pose.inverse().then(Pose2::new(obstacle.centre_m[0], obstacle.centre_m[1], 0.0));
            let corners = self.footprint.corners_m();
            (0..corners.len()).all(|number| {
                let (from, to) = (corners[number], corners[(number + 1) % corners.len()]);
                (to[0] - from[0]) * (at.y_m - from[1]) - (to[1] - from[1]) * (at.x_m - from[0]) >= 0.0
            })
        };
        way.iter().any(|pose| holds(pose) || self.gap_m(pose, obstacle) < self.kept_m(spread_m))
    }

    fn open_floor(&self, way: &WayRequest<'_>) -> Result<Map, RoomError> {
        let ends = [way.from, way.to].map(|pose| [pose.x_m, pose.y_m]);
        let blocked = self.blocked_m();
        let places = || {
            let obstacles = way.obstacles.iter().map(|obstacle| obstacle.centre_m);
            ends.into_iter().chain(obstacles).chain(blocked.iter().chain(way.walls_m).flatten().copied())
        };
        let far_m = OPEN_M + self.footprint.outer_radius_m();
        let range = |axis: usize| {
            let low = places().map(|place| place[axis]).fold(f64::INFINITY, f64::min) - far_m;
            let high = places().map(|place| place[axis]).fold(f64::NEG_INFINITY, f64::max) + far_m;
            [low, high]
        };
        let ([left, right], [low, high]) = (range(0), range(1));
        // However far it is: no more cells than half a million or so.
        let cell_m = self.cell_m.max(((right - left) * (high - low) / 5e5).sqrt());
        Ok(Map::of_room(&[[left, low], [right, low], [right, high], [left, high]], cell_m)?)
    }

    /// The best way, in odom.
    pub fn plan(&self, way: &WayRequest<'_>, space: &Space) -> Result<Plan, RoomError> {
        let cost = match way.best {
            BestWay::Shortest => Cost::Shortest,
            BestWay::Ridge => Cost::Ridge,
        };
        let task = Task {
            space,
            footprint: &self.footprint,
            from: way.from,
            to: way.to,
            clearance_m: self.clearance_m,
            cost,
            until: way.until,
        };
        Ok(omnibase_plan::plan(&task)?)
    }

    /// The best way in the shortest time that a robot can do it in, looked at again as it will be driven, and as every stop leads straight on
    /// from it. A replay makes its table into a motion by all that the robot can do: whoever drives it does, too.
    pub fn timed(
        &self,
        way: &WayRequest<'_>,
        ability: &Ability,
        registry: &Registry,
    ) -> Result<TimedWay, RoomError> {
        if way.lead.is_empty() && stands_at(&way.from, &way.to) {
            return Err(RoomError::There);
        }
        let out = self.way_out(way);
        let found = self.timed_from(out, way, ability, registry);
        // Something else may be in the way straight out.
        if found.is_err() && out != way.from && !way.until.is_over() {
            return self.timed_from(way.from, way, ability, registry);
        }
        found
    }

    /// The best way from where what is kept from obstacles begins, behind the way out to there.
    fn timed_from(
        &self,
        out: Pose2,
        way: &WayRequest<'_>,
        ability: &Ability,
        registry: &Registry,
    ) -> Result<TimedWay, RoomError> {
        let mut space = self.space(&WayRequest { from: out, ..way.clone() })?;
        let mut plan = self.plan(&WayRequest { from: out, ..way.clone() }, &space)?;
        if out != way.from {
            plan.poses.insert(0, way.from);
            space = self.space(way)?;
        }
        plan.poses.splice(0..0, way.lead.iter().copied());
        let mut found = Err(PlanError::Ended.into());
        for share in SPEEDS {
            found = self.timed_at(share, way, &plan, &space, ability, registry);
            if !matches!(found, Err(RoomError::StopTouches { .. })) {
                break;
            }
        }
        let (table, reference, duration_s) = found?;
        Ok(TimedWay { plan, table, reference, duration_s })
    }

    /// A way in the shortest time with a part of the platform's speeds: its table, as a motion, and how long that takes, s.
    fn timed_at(
        &self,
        share: f64,
        way: &WayRequest<'_>,
        plan: &Plan,
        space: &Space,
        ability: &Ability,
        registry: &Registry,
    ) -> Result<(ReferenceTable, Box<dyn Reference>, f64), RoomError> {
        let begun = way.lead.first().copied().unwrap_or(way.from);
        let table = table_of(plan, &ability.limits, share);
        let mut reference =
            registry.make_reference(&table, ability).map_err(|error| RoomError::Timing(error.to_string()))?;
        reference.start(&omnibase_robot::signals::Setpoint::at_rest(begun));
        let duration_s = reference.duration_s().unwrap_or_default();
        let limits = &ability.limits;
        let fastest_m_s =
            SPEED_ROUNDING * (limits.speed_m_s + self.footprint.outer_radius_m() * limits.turn_speed_rad_s);
        // Where it can't be known beforehand, nothing is known of it.
        let (looks, ended) = (Cell::new(0_u32), Cell::new(false));
        let pose = |time_s: f64| {
            let nowhere = Pose2 { x_m: f64::NAN, ..Pose2::default() };
            looks.set(looks.get().wrapping_add(1));
            ended.set(ended.get() || way.until.is_over_at(looks.get()));
            if ended.get() {
                return nowhere;
            }
            reference.preview(time_s).map_or(nowhere, |setpoint| setpoint.odom_from_body)
        };
        let mut sweep = Sweep::new(space, &self.footprint);
        let touched = sweep.touches([0.0, duration_s], fastest_m_s, &pose);
        if ended.get() {
            return Err(PlanError::Ended.into());
        }
        if let Some(at) = touched {
            return Err(RoomError::Touches { at });
        }
        self.check_stops(&*reference, duration_s, begun, limits, &mut sweep, way.until)?;
        Ok((table, reference, duration_s))
    }

    /// Whether no stop from somewhere on a motion touches anything: made as the robot makes it.
    fn check_stops(
        &self,
        reference: &dyn Reference,
        duration_s: f64,
        begun: Pose2,
        limits: &Limits,
        sweep: &mut Sweep<'_>,
        until: Until<'_>,
    ) -> Result<(), RoomError> {
        // Where no limiter can be made of the limits there is no such robot.
        let Ok(mut limiter) = Limiter::new(limits, STOP_STEP_S) else { return Ok(()) };
        limiter.reset(begun);
        for number in 1..=(duration_s / STOP_STEP_S).ceil() as u32 {
            let Some(along) = reference.preview(STOP_STEP_S * f64::from(number)) else { break };
            let mut from = limiter.follow(&along).odom_from_body;
            if !number.is_multiple_of(STOP_EVERY) {
                continue;
            }
            if until.is_over() {
                return Err(PlanError::Ended.into());
            }
            let mut stopping = limiter.clone();
            while !stopping.is_at_rest() {
                let to = stopping.toward(Twist2::default()).odom_from_body;
                if !sweep.passes([&from, &to], &self.footprint) {
                    return Err(RoomError::StopTouches { at: to });
                }
                from = to;
            }
        }
        Ok(())
    }
}

/// Whether somebody who is at one pose is at the other, but for rounding.
pub fn stands_at(here: &Pose2, there: &Pose2) -> bool {
    here.distance_m(*there) < THERE && (here.heading_rad - there.heading_rad).abs() < THERE
}

/// A way as a reference's table, gone along with a part of the platform's speeds at most: its points' times are those of half the speed, and don't count.
fn table_of(plan: &Plan, limits: &Limits, share: f64) -> ReferenceTable {
    let mut points: Vec<[f64; 4]> = Vec::with_capacity(plan.poses.len());
    let mut time_s = 0.0;
    for (number, pose) in plan.poses.iter().enumerate() {
        if let Some([.., x_m, y_m, heading_rad]) = points.last() {
            let moved_m = (pose.x_m - x_m).hypot(pose.y_m - y_m);
            let turned_rad = (pose.heading_rad - heading_rad).abs();
            if moved_m < SAME && turned_rad < SAME && number + 1 < plan.poses.len() {
                continue;
            }
            time_s +=
                (2.0 * moved_m / limits.speed_m_s).max(2.0 * turned_rad / limits.turn_speed_rad_s).max(1e-3);
        }
        points.push([time_s, pose.x_m, pose.y_m, pose.heading_rad]);
    }
    ReferenceTable {
        timing: Some(Timing::Fastest),
        corner_m: Some(CORNER_M),
        frame: Some(PathFrame::Odom),
        obstacles: Some(AtObstacles::Wait),
        speed_m_s: (share < 1.0).then_some(share * limits.speed_m_s),
        turn_speed_rad_s: (share < 1.0).then_some(share * limits.turn_speed_rad_s),
        ..ReferenceTable::path(points)
    }
}

#[cfg(test)]
mod tests;
