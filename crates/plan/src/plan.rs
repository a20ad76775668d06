//! From pose to pose through a known room.

use omnibase_platform::{Pose2, wrap_angle_rad};

use crate::along::Places;
use crate::footprint::Footprint;
use crate::gaps::Gaps;
use crate::ridge;
use crate::search::Search;
use crate::smooth::{SPACING_M, TIGHTENINGS, divided, shortened, smooth, tightened};
use crate::space::{Checker, Space};
use crate::sweep::Sweep;
use crate::turning::Turning;
use crate::until::Until;

mod error;
mod stops;
#[cfg(test)]
mod tests;

pub use error::{End, PlanError};
use stops::{Along, Discs, turned};

/// What is planned.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// The room.
    pub space: &'a Space,
    /// The robot.
    pub footprint: &'a Footprint,
    /// Where it stands, in the map's frame.
    pub from: Pose2,
    /// Where it shall stand.
    pub to: Pose2,
    /// What the footprint keeps from everything, m. Where it stands, or shall stand, nearer than this, a straight piece leads from there
    /// to where it has it; where none does, less is kept.
    pub clearance_m: f64,
    /// What is the best way.
    pub cost: Cost,
    /// How long it is looked for.
    pub until: Until<'a>,
}

/// What is the best way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Cost {
    /// The shortest one.
    #[default]
    Shortest,
    /// One that keeps to the middle between walls: the generalised Voronoi diagram's ridge draws it.
    Ridge,
}

/// A way that touches nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// From the first pose to the last, in the map's frame; place and heading change evenly from one to the next.
    pub poses: Vec<Pose2>,
    /// Its length, m.
    pub length_m: f64,
    /// What is kept from everything, but for straight pieces at ends that stand nearer, m.
    pub clearance_m: f64,
    /// At each pose the room of base_link to the nearest thing in the way, at least, m.
    pub room_m: Vec<f64>,
    /// How it was found.
    pub by: By,
}

/// How a way was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum By {
    /// Straight there.
    Straight,
    /// As a disc, whatever the heading.
    Disc,
    /// By turning where it is narrow.
    Turning,
}

/// A way may be longer than the way of the disc that each heading covers, before a shorter one is looked for.
const LONGER: f64 = 1.003;
/// A footprint whose farthest corner is by no larger part farther than its nearest side is nearly a disc.
const NEARLY_DISC: f64 = 0.1;
/// Beside the cells that count the clearance is known by as much more, so that ridges are seen, in cells.
const RIDGE_CELLS: f64 = 1.0;
/// Parts of the clearance that are tried, where an end stands in too narrow a place for all of it.
const SHARES: [f64; 3] = [1.0, 0.5, 0.25];
/// Directions in which a way out is looked for.
const DIRECTIONS: u32 = 32;
/// Poses of a way that are no farther apart are one, in cells and rad.
const SAME: f64 = 1e-3;
/// How far from a pose a cell may be where the search begins, in cells.
const NEAR: isize = 2;

/// The way from one pose to another.
pub fn plan(task: &Task<'_>) -> Result<Plan, PlanError> {
    let found = Planner::new(task, true)?.plan();
    // A search that was ended found nothing either.
    if found.is_err() && task.until.is_over() { Err(PlanError::Ended) } else { found }
}

/// For both ends the nearest pose where the footprint has a clearance, and to which it gets straight; `None` where there is none.
fn ways_out(task: &Task<'_>, clearance_m: f64) -> Option<[Pose2; 2]> {
    let mut checker = task.space.checker(task.footprint, clearance_m);
    let mut sweep = Sweep::new(task.space, task.footprint);
    let step_m = 0.5 * task.space.map.cell_m;
    let farthest_m = 2.0 * clearance_m + 4.0 * task.space.map.cell_m;
    let mut out = |end: Pose2| {
        let rings = 1..=(farthest_m / step_m).ceil() as u32;
        let around = rings.flat_map(|ring| (0..DIRECTIONS).map(move |number| (ring, number)));
        let places = around.map(|(ring, number)| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(number) / f64::from(DIRECTIONS)).sin_cos();
            let far_m = f64::from(ring) * step_m;
            Pose2 { x_m: end.x_m + far_m * cos, y_m: end.y_m + far_m * sin, ..end }
        });
        let fits = |pose: &Pose2| {
            checker.is_free(pose) && (*pose == end || sweep.passes([&end, pose], task.footprint))
        };
        std::iter::once(end).chain(places).find(fits)
    };
    Some([out(task.from)?, out(task.to)?])
}

struct Planner<'a> {
    task: Task<'a>,
    checker: Checker<'a>,
    clearance_m: f64,
    /// Both ends of what keeps the clearance, in cells.
    ends: [Pose2; 2],
    /// Where it stands, and shall stand, where that is nearer to something, in cells.
    tips: [Option<Pose2>; 2],
    /// Whether passages are looked at in finer cells, too.
    is_coarse: bool,
}

impl<'a> Planner<'a> {
    fn new(task: &Task<'a>, is_coarse: bool) -> Result<Self, PlanError> {
        if !(0.0..=10.0).contains(&task.clearance_m) {
            return Err(PlanError::Clearance { found_m: task.clearance_m });
        }
        let ends = [(End::Start, task.from), (End::Goal, task.to)];
        for (end, pose) in ends {
            if !pose.is_finite() {
                return Err(PlanError::NotFinite { end, pose });
            }
            if !task.space.checker(task.footprint, 0.0).is_free(&pose) {
                let map = &task.space.map;
                let is_outside = |corner: &crate::Point| {
                    let [x, y] = map.grid_cells(*corner);
                    !((0.0..=map.width as f64).contains(&x) && (0.0..=map.height as f64).contains(&y))
                };
                let is_outside = task.footprint.placed_m(&pose).iter().any(is_outside);
                return Err(if is_outside {
                    PlanError::Outside { end, pose }
                } else {
                    PlanError::Blocked { end, pose }
                });
            }
        }
        let least = (0.0, [task.from, task.to]);
        let mut kept = SHARES.iter().map(|share| share * task.clearance_m);
        let (clearance_m, outs) =
            kept.find_map(|kept_m| Some((kept_m, ways_out(task, kept_m)?))).unwrap_or(least);
        let checker = task.space.checker(task.footprint, clearance_m);
        let mut ends = outs.map(|pose| checker.in_cells(&pose));
        ends[1].heading_rad = ends[0].heading_rad + wrap_angle_rad(ends[1].heading_rad - ends[0].heading_rad);
        let tip = |number: usize, asked: Pose2| {
            let heading_rad = ends[number].heading_rad;
            (outs[number] != asked).then(|| Pose2 { heading_rad, ..checker.in_cells(&asked) })
        };
        let tips = [tip(0, task.from), tip(1, task.to)];
        Ok(Planner { task: *task, checker, clearance_m, ends, tips, is_coarse })
    }

    fn plan(mut self) -> Result<Plan, PlanError> {
        let is_shortest = self.task.cost == Cost::Shortest;
        if is_shortest && self.checker.is_motion_free_in_cells(&self.ends[0], &self.ends[1]) {
            return Ok(self.finished(self.ends.to_vec(), By::Straight, f64::INFINITY));
        }
        let space = self.task.space;
        let outer_m = self.task.footprint.outer_radius_m() + self.clearance_m;
        let inner_m = self.task.footprint.inner_radius_m() + self.clearance_m;
        let [outer, inner] = [outer_m, inner_m].map(|radius_m| radius_m / space.map.cell_m);
        let (clearance, until) =
            (space.sharpened([inner - RIDGE_CELLS, outer + RIDGE_CELLS]), self.task.until);
        let as_disc = |planner: &mut Self| {
            let ends = planner.ends.map(|pose| [pose.x_m, pose.y_m]);
            let gaps = Gaps::new(space, &clearance, outer as f32, outer as f32, &ends);
            let way = planner.disc_way(&Search::through(space, &gaps, outer_m).until(until))?;
            // How long a way is, is known once it is drawn taut.
            Some(planner.finished(way, By::Disc, 0.0))
        };
        let turns = is_shortest && outer_m - inner_m > NEARLY_DISC * inner_m;
        if !turns && let Some(plan) = as_disc(&mut self) {
            return Ok(plan);
        }
        // No way is shorter than that of the disc which every heading covers.
        let gaps = Gaps::new(space, &clearance, inner as f32, outer.min(inner + RIDGE_CELLS) as f32, &[]);
        let discs = Discs {
            inner: Search::through(space, &gaps, inner_m).until(until),
            outer: Search::new(space, &clearance, outer_m).until(until),
            gaps: &gaps,
        };
        let by_centres = Search::new(space, &clearance, inner_m).until(until);
        let least = self.least_way(&discs.inner, &by_centres, inner_m);
        let mut coarse = self.checker.coarse(self.clearance_m);
        let mut plans = Vec::new();
        if turns {
            let least_m = least.as_ref().map_or(0.0, |way| self.length_m(way));
            let is_enough = |plan: &Plan| plan.length_m <= LONGER * least_m;
            if let Ok(way) = &least {
                match self.along(way, &discs, &mut coarse) {
                    Along::Way(plan) => plans.push(plan),
                    Along::OtherWay(plan) => return Ok(plan),
                    Along::NoWay => return Err(PlanError::NoTurn),
                    Along::Unknown => {}
                }
                // From the other end, too, where the first is longer.
                if !plans.is_empty() && !plans.iter().any(is_enough) {
                    let back: Vec<Pose2> = way.iter().rev().copied().collect();
                    let ends = [self.ends[1], self.ends[0]];
                    if let Some(mut found) = Places::new(&back, ends, &mut coarse, outer).way(until) {
                        found.reverse();
                        plans.push(self.finished(found, By::Turning, least_m));
                    }
                }
            }
            if !plans.iter().any(is_enough) {
                plans.extend(as_disc(&mut self));
            }
            if let Some(plan) = plans.iter().find(|plan| is_enough(plan)) {
                return Ok(plan.clone());
            }
        }
        if plans.is_empty() {
            least?;
        }
        // In finer cells everything takes too long.
        if !self.is_coarse {
            return plans.into_iter().next().ok_or(PlanError::NoTurn);
        }
        let ways = match Turning::new(&mut coarse, discs.outer, discs.inner, space.clearance(), [0; 2]) {
            Some(mut turning) => turning.shortest(&self.ends[0], &self.ends[1]),
            None if plans.is_empty() => {
                return Err(PlanError::TooLarge { found: space.clearance().len() });
            }
            None => Vec::new(),
        };
        for places in ways {
            let way = turned(self.ends, &places);
            plans.push(self.finished(way, By::Turning, 0.0));
        }
        plans.into_iter().min_by(|a, b| a.length_m.total_cmp(&b.length_m)).ok_or(PlanError::NoTurn)
    }

    /// The length of a way in cells, with what leads to it from where the robot stands and shall stand, m.
    fn length_m(&self, way: &[Pose2]) -> f64 {
        let tips = self.tips.iter().zip(&self.ends);
        let tips: f64 = tips.filter_map(|(tip, end)| tip.map(|tip| tip.distance_m(*end))).sum();
        (length(way) + tips) * self.task.space.map.cell_m
    }

    /// The cell from which a disc's way begins or ends.
    fn cell_near(&mut self, search: &Search<'_>, end: usize) -> Option<usize> {
        let pose = self.ends[end];
        let map = &self.task.space.map;
        let [column, row] = [pose.x_m, pose.y_m].map(|at| at.floor() as isize);
        let mut near: Vec<(f64, usize)> = Vec::new();
        for y in row - NEAR..=row + NEAR {
            for x in column - NEAR..=column + NEAR {
                if x < 0 || y < 0 || x as usize >= map.width || y as usize >= map.height {
                    continue;
                }
                let cell = search.index(x as usize, y as usize);
                if search.takes(cell) {
                    let [x, y] = search.place(cell).map(|at| f64::from(at) + 0.5);
                    let off = (x - pose.x_m).hypot(y - pose.y_m);
                    near.push((off, cell));
                }
            }
        }
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut free = near.iter().filter(|(_, cell)| {
            let [x, y] = search.place(*cell).map(|at| f64::from(at) + 0.5);
            self.checker.is_motion_free_in_cells(&pose, &Pose2::new(x, y, pose.heading_rad))
        });
        free.next().map(|(_, cell)| *cell)
    }

    /// A disc's way; the heading changes evenly along it.
    fn disc_way(&mut self, search: &Search<'_>) -> Option<Vec<Pose2>> {
        let cells = [self.cell_near(search, 0)?, self.cell_near(search, 1)?];
        let way = match self.task.cost {
            Cost::Shortest => search.shortest(cells[0], cells[1])?,
            Cost::Ridge => search.cheapest(cells, &ridge::field(self.task.space))?,
        };
        let [from, to] = self.ends;
        let mut poses: Vec<Pose2> = way
            .iter()
            .map(|cell| {
                let [x, y] = search.place(*cell).map(|at| f64::from(at) + 0.5);
                Pose2::new(x, y, from.heading_rad)
            })
            .collect();
        let whole = length(&poses).max(f64::MIN_POSITIVE);
        let mut done = 0.0;
        for at in 1..poses.len() {
            done += poses[at].distance_m(poses[at - 1]);
            poses[at].heading_rad += (to.heading_rad - from.heading_rad) * done / whole;
        }
        // To the first cell and from the last one the disc may not fit: there it doesn't turn. Where it fits, the ends are places of their cells.
        let last = poses.last().map(|last| Pose2 { heading_rad: to.heading_rad, ..*last });
        let mut poses: Vec<Pose2> = [from].into_iter().chain(poses).chain(last).chain([to]).collect();
        let turns = |pose: &Pose2, before: &Pose2| (pose.heading_rad - before.heading_rad).abs();
        poses.dedup_by(|pose, before| pose.distance_m(*before) < SAME && turns(pose, before) < SAME);
        if let Some(last) = poses.last_mut() {
            *last = to;
        }
        Some(poses)
    }

    /// The way of the disc that every heading covers, from end to end in cells, or why there is none.
    fn least_way(
        &self,
        search: &Search<'_>,
        by_centres: &Search<'_>,
        inner_m: f64,
    ) -> Result<Vec<Pose2>, PlanError> {
        if let Some(way) = self.inner_way(search) {
            return Ok(way);
        }
        let (map, cells) = (&self.task.space.map, self.cells(search));
        // Between centres there may be one cell more.
        let widest_m = (2.0 * f64::from(by_centres.widest(cells[0], cells[1])) + 1.0) * map.cell_m;
        if widest_m < 1.5 * map.cell_m {
            let end = if by_centres.is_small(cells[0]) { End::Start } else { End::Goal };
            return Err(PlanError::Enclosed { end });
        }
        Err(PlanError::TooNarrow { widest_m, needed_m: 2.0 * inner_m })
    }

    /// The cells of both ends.
    fn cells(&self, search: &Search<'_>) -> [usize; 2] {
        let [width, height] = search.size();
        self.ends.map(|pose| {
            let [x, y] = [pose.x_m, pose.y_m].map(|at| at.max(0.0) as usize);
            search.index(x.min(width - 1), y.min(height - 1))
        })
    }

    /// The way of the disc that every heading covers, from end to end in cells.
    fn inner_way(&self, search: &Search<'_>) -> Option<Vec<Pose2>> {
        // The ends stand there: what their cells' centres lack is a cell at most.
        let [from, to] = self.cells(search).map(|cell| search.open_near(cell));
        let way = search.shortest(from?, to?)?;
        let places = way.iter().skip(1).take(way.len().saturating_sub(2)).map(|cell| {
            let [x, y] = search.place(*cell).map(|at| f64::from(at) + 0.5);
            Pose2::new(x, y, 0.0)
        });
        let [from, to] = self.ends;
        Some([from].into_iter().chain(places).chain([to]).collect())
    }

    /// A way in cells without what isn't needed of it, its turns where it is shorter.
    fn taut(&mut self, way: &[Pose2]) -> Vec<Pose2> {
        let spacing = SPACING_M / self.task.space.map.cell_m;
        let turn_length = self.task.footprint.outer_radius_m() / self.task.space.map.cell_m;
        let short = shortened(&divided(way, spacing, turn_length), &mut self.checker);
        let mut tight = shortened(&divided(&short, 2.0 * spacing, turn_length), &mut self.checker);
        tightened(&mut tight, &mut self.checker, TIGHTENINGS[0]);
        tight
    }

    /// A way in cells, without what isn't needed of it, bent smooth, in the map's frame. So many m long it is short enough.
    fn finished(&mut self, way: Vec<Pose2>, by: By, enough_m: f64) -> Plan {
        let (space, cell_m) = (self.task.space, self.task.space.map.cell_m);
        let turn_length = self.task.footprint.outer_radius_m() / cell_m;
        let way = match self.task.cost {
            Cost::Shortest => {
                let mut tight = self.taut(&way);
                // What is left out depends on the end from which it is looked at. A disc leaves out the same.
                if !self.checker.is_nearly_disc() && length(&tight) * cell_m > enough_m {
                    tight.reverse();
                    tight = self.taut(&tight);
                    tight.reverse();
                }
                // Along an arc pieces half as long are a quarter as much longer than it.
                let mut tight = divided(&tight, SPACING_M / cell_m, turn_length);
                tightened(&mut tight, &mut self.checker, TIGHTENINGS[1]);
                tight
            }
            Cost::Ridge => way,
        };
        let mut points = divided(&way, SPACING_M / cell_m, turn_length);
        smooth(&mut points, &mut self.checker);
        // It may have turned around by then.
        let beside =
            |tip: Option<Pose2>, end: Option<&Pose2>| Some(Pose2 { heading_rad: end?.heading_rad, ..tip? });
        let [first, last] = [beside(self.tips[0], points.first()), beside(self.tips[1], points.last())];
        let points: Vec<Pose2> = first.into_iter().chain(points).chain(last).collect();
        let map = &space.map;
        let room_m = points.iter().map(|point| space.room(point) * cell_m).collect();
        let mut poses: Vec<Pose2> = points
            .iter()
            .map(|at| map.map_from_grid.then(Pose2::new(at.x_m * cell_m, at.y_m * cell_m, at.heading_rad)))
            .collect();
        let turns = self.task.from.heading_rad - poses[0].heading_rad;
        poses.iter_mut().for_each(|pose| pose.heading_rad += turns);
        Plan { length_m: length(&poses), poses, clearance_m: self.clearance_m, room_m, by }
    }
}

/// The length of a way.
fn length(way: &[Pose2]) -> f64 {
    way.windows(2).map(|pair| pair[0].distance_m(pair[1])).sum()
}
