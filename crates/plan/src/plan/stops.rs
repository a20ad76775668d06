//! Past places that stop the footprint on the way of the disc that every heading covers.
//!
//! Where it is stopped, cells are barred for the disc, and its next way is looked along. Where that is longer, or there is none, it is looked for a way
//! past the place first: over all places and headings, but only near it.

use omnibase_platform::{Pose2, wrap_angle_rad};

use super::{By, Plan, Planner, Task, length};
use crate::along::{self, Places};
use crate::gaps::{Gaps, Part};
use crate::search::Search;
use crate::space::{Checker, Space};
use crate::turning::{CellPose, Turning};

#[cfg(test)]
mod tests;

/// Most places that stop it before everything is looked at.
const MOST_STOPS: usize = 6;
/// The disc's next way may be so many times as long as its first one, before a way past the place is looked for.
const NEXT: f64 = 1.005;
/// A way past a place may be so many times as long as the disc's, before another one is looked for.
const LONGER: f64 = 1.01;
/// And so many times, before everything is looked at.
const FAR_LONGER: f64 = 1.05;
/// Where the disc's next way is so many times as long, it is looked in finer cells for a way past the place, too.
const FAR: f64 = 1.01;
/// But only where an outline that is so much smaller gets past it, in cells.
const SMALLER: f64 = 0.15;
/// And in so many cells at most.
const MOST_FINE: usize = 10_000;
/// Beside the way it is looked as far as the farthest corner reaches, and by so many cells more.
const BESIDE: f64 = 4.0;

/// The discs that no heading, and every heading, reaches out of and covers.
pub(super) struct Discs<'a> {
    /// That every heading covers.
    pub(super) inner: Search<'a>,
    /// The inner one's.
    pub(super) gaps: &'a Gaps<'a>,
    /// That covers every heading.
    pub(super) outer: Search<'a>,
}

/// What was found along the inner disc's ways.
pub(super) enum Along {
    /// The footprint gets along the first one.
    Way(Plan),
    /// It gets along another one, or past what stopped it.
    OtherWay(Plan),
    /// There is no way at all.
    NoWay,
    /// It isn't known.
    Unknown,
}

impl Discs<'_> {
    fn cell(&self, place: &Pose2) -> usize {
        self.inner.index(place.x_m as usize, place.y_m as usize)
    }

    /// How much more room the outer one needs, in cells.
    fn narrow(&self) -> f32 {
        self.outer.radius() - self.inner.radius()
    }

    /// The cells around a place that bar the inner one there: those that hang together, and take not every heading.
    fn around(&self, place: &Pose2) -> Vec<usize> {
        let width = self.inner.size()[0];
        // As far as a passage is wide that doesn't take every heading.
        let reach = 2.0 * self.narrow() + 1.0;
        let is_near = |cell: usize| {
            let off = [(cell % width) as f64 + 0.5 - place.x_m, (cell / width) as f64 + 0.5 - place.y_m];
            off[0].hypot(off[1]) <= f64::from(reach)
        };
        let is_narrow = |cell: &usize| !self.outer.is_open(*cell) && is_near(*cell);
        let mut found: Vec<usize> =
            self.inner.open_near(self.cell(place)).into_iter().filter(is_narrow).collect();
        let mut at = 0;
        while at < found.len() {
            let (neighbours, count) = self.inner.neighbours(found[at]);
            for next in neighbours[..count].iter().filter(|next| is_narrow(next)) {
                if !found.contains(next) {
                    found.push(*next);
                }
            }
            at += 1;
        }
        found
    }

    /// The cells that are no farther from any place of a way than this.
    fn part(&self, way: &[Pose2], reach: f64) -> Part {
        let size = self.inner.size();
        let range = |axis: usize| {
            let at = |place: &Pose2| [place.x_m, place.y_m][axis];
            let low = way.iter().map(at).fold(f64::INFINITY, f64::min) - reach;
            let high = way.iter().map(at).fold(0.0, f64::max) + reach;
            (low.max(0.0) as usize, (high as usize + 1).min(size[axis]))
        };
        let [(left, right), (low, high)] = [range(0), range(1)];
        let mut part = Part {
            low: [left, low],
            size: [right - left, high - low],
            counts: vec![false; (right - left) * (high - low)],
            width: size[0],
        };
        for place in way {
            let [x, y] = [place.x_m, place.y_m];
            for row in ((y - reach).max(0.0) as usize..(y + reach) as usize + 1).filter(|row| *row < high) {
                let half = (reach * reach - (row as f64 + 0.5 - y).powi(2)).max(0.0).sqrt();
                let columns = (x - half).max(0.0) as usize..((x + half) as usize + 1).min(right);
                let first = (row - low) * part.size[0];
                part.counts[first + columns.start - left..first + columns.end - left].fill(true);
            }
        }
        part
    }
}

impl Planner<'_> {
    /// Along the inner disc's way, or its next ones.
    pub(super) fn along<'c>(
        &mut self,
        least: &[Pose2],
        discs: &Discs<'_>,
        coarse: &mut Checker<'c>,
    ) -> Along {
        let (until, reach) = (self.task.until, f64::from(discs.outer.radius()));
        let most_m = NEXT * self.length_m(least);
        let mut gaps = discs.gaps.clone();
        let (mut way, mut rest, mut done) = (least.to_vec(), least.to_vec(), Vec::new());
        // Another way, and what is barred on it, in place of passing what stopped it.
        let mut other: Option<(Vec<Pose2>, Gaps<'_>)> = None;
        let mut best: Option<Plan> = None;
        let (mut has_passed, mut is_back, mut is_enough) = (false, false, false);
        for stops in 0..MOST_STOPS {
            let from = done.last().copied().unwrap_or(self.ends[0]);
            let mut places = Places::new(&rest, [from, self.ends[1]], coarse, reach);
            if let Some(found) = places.way(until) {
                done.extend(found);
                let plan =
                    self.finished(unwound(std::mem::take(&mut done)), By::Turning, self.length_m(&way));
                if stops == 0 {
                    return Along::Way(plan);
                }
                let is_long = plan.length_m > LONGER * self.length_m(&way);
                let is_far = plan.length_m > FAR_LONGER * self.length_m(&way);
                if best.as_ref().is_none_or(|best| plan.length_m < best.length_m) {
                    best = Some(plan);
                    is_enough = !is_far;
                }
                let found_m = best.as_ref().map_or(f64::INFINITY, |best| best.length_m);
                // What stopped it is passed otherwise from its other side.
                if is_long && has_passed && !is_back {
                    is_back = true;
                } else if let Some((next, barred)) = other.take()
                    && NEXT * self.length_m(&next) < found_m
                {
                    (way, gaps, is_back) = (next, barred, false);
                } else {
                    break;
                }
                has_passed = false;
                rest.clone_from(&way);
                continue;
            }
            if until.is_over() {
                return Along::Unknown;
            }
            let last = places.places().len() - 1;
            let stop = places.places()[(places.farthest() + 1).min(last)];
            let mut barred = gaps.clone();
            barred.bar(&discs.around(&stop));
            let past = discs.inner.barred(&barred, discs.narrow());
            let next = self.inner_way(&past);
            if !next.as_ref().is_some_and(|next| self.length_m(next) <= most_m) {
                let stop = Stop::new(&mut places, discs);
                if next.is_none() && best.is_none() && other.is_none() && !self.may_pass(discs, &past, coarse)
                {
                    return if until.is_over() { Along::Unknown } else { Along::NoWay };
                }
                let look = Look {
                    past: next.as_ref().map(|_| &barred),
                    is_back,
                    is_fine: next.as_ref().is_none_or(|next| length(next) > FAR * length(&way)),
                };
                if let Some(stop) = stop
                    && let Some(poses) = stop.passed(self, discs, &look, coarse)
                {
                    done.extend(poses);
                    rest = stop.rest;
                    has_passed = true;
                    if let Some(next) = next
                        && other.as_ref().is_none_or(|(other, _)| length(&next) < length(other))
                    {
                        other = Some((next, barred));
                    }
                    continue;
                }
            }
            let next = next.map(|next| (next, barred)).or_else(|| other.take());
            let Some((next, barred)) = next else { break };
            (way, gaps, done) = (next, barred, Vec::new());
            (has_passed, is_back) = (false, false);
            rest.clone_from(&way);
        }
        best.map_or(Along::Unknown, if is_enough { Along::OtherWay } else { Along::Way })
    }

    /// Whether anything gets past cells that are barred for the inner disc.
    fn may_pass(&self, discs: &Discs<'_>, past: &Search<'_>, coarse: &mut Checker<'_>) -> bool {
        let [from, to] = &self.ends;
        Turning::new(coarse, discs.outer, discs.inner, self.task.space.clearance(), [0; 2])
            .is_none_or(|mut turning| turning.may_pass(from, to, past))
    }
}

/// How it is looked past a stop.
struct Look<'a> {
    /// What is barred for the inner disc, where it has another way then.
    past: Option<&'a Gaps<'a>>,
    /// Whether from behind it.
    is_back: bool,
    /// Whether in finer cells, too.
    is_fine: bool,
}

/// Where the footprint is stopped on a way.
struct Stop {
    /// As far as every heading fits before it.
    before: Vec<Pose2>,
    /// The places from there to where every heading fits behind it.
    places: Vec<Pose2>,
    /// The way from there on.
    rest: Vec<Pose2>,
}

impl Stop {
    fn new(places: &mut Places<'_, '_>, discs: &Discs<'_>) -> Option<Stop> {
        let (all, stop) = (places.places().to_vec(), places.farthest());
        let margin = (f64::from(discs.outer.radius()) / along::SPACING) as usize;
        let is_hall = |at: &usize| discs.outer.is_open(discs.cell(&all[*at]));
        let begin = (0..=stop.saturating_sub(margin)).rev().find(is_hall).unwrap_or(0);
        let end = (stop + margin..all.len()).find(is_hall).unwrap_or(all.len() - 1);
        let before = places.way_to(begin)?;
        Some(Stop { before, places: all[begin..=end].to_vec(), rest: all[end..].to_vec() })
    }

    /// Where it begins and ends.
    fn ends(&self, goal: Pose2) -> [Pose2; 2] {
        let [from, end] = [&self.before, &self.places].map(|poses| poses[poses.len() - 1]);
        // In the middle of its cell every heading fits.
        let middle = Pose2::new(end.x_m.floor() + 0.5, end.y_m.floor() + 0.5, from.heading_rad);
        [from, if self.rest.len() == 1 { goal } else { middle }]
    }

    /// The poses of a way past it; `None` where none is near.
    fn passed(
        &self,
        planner: &Planner<'_>,
        discs: &Discs<'_>,
        look: &Look<'_>,
        coarse: &mut Checker<'_>,
    ) -> Option<Vec<Pose2>> {
        let [from, mut to] = self.ends(planner.ends[1]);
        let part = discs.part(&self.places, f64::from(discs.outer.radius()) + BESIDE);
        let clearance = part.of(discs.outer.clearance());
        let rough = part.of(planner.task.space.clearance());
        let gaps = discs.gaps.within(&part);
        let [outer, inner] = [discs.outer.of(part.size, &clearance), discs.inner.by(part.size, &gaps)];
        let past = look.past.map(|past| past.within(&part));
        let may_pass = |checker: &mut Checker<'_>| {
            past.as_ref().is_none_or(|past| {
                let past = discs.inner.by(part.size, past);
                let turning = Turning::new(checker, outer, inner, &rough, part.low);
                turning.is_none_or(|mut turning| turning.may_pass(&from, &to, &past))
            })
        };
        if !coarse.smaller(SMALLER).is_none_or(|mut smaller| may_pass(&mut smaller)) {
            return None;
        }
        let turning = |checker| Turning::new(checker, outer, inner, &rough, part.low);
        let found = if may_pass(coarse) { turning(coarse)?.passed(&from, &to, look.is_back) } else { None };
        let Some(found) = found else {
            let is_fine = look.is_fine && planner.is_coarse && part.counts.len() <= MOST_FINE;
            return if is_fine { self.passed_finely([from, to], planner, &part) } else { None };
        };
        if self.rest.len() > 1 {
            to.heading_rad =
                found.iter().rev().find_map(|place| place.heading_rad).unwrap_or(from.heading_rad);
        }
        Some(self.before.iter().copied().chain(turned([from, to], &found)).collect())
    }

    /// The poses of a way past it that only cells half as large show.
    fn passed_finely(&self, ends: [Pose2; 2], planner: &Planner<'_>, part: &Part) -> Option<Vec<Pose2>> {
        let map = &planner.task.space.map;
        let space = Space::new(map.finer(part.low, part.size).ok()?);
        let [from, to] = ends.map(|Pose2 { x_m, y_m, heading_rad }| {
            map.map_from_grid.then(Pose2::new(x_m * map.cell_m, y_m * map.cell_m, heading_rad))
        });
        let task = Task { space: &space, from, to, clearance_m: planner.clearance_m, ..planner.task };
        let plan = Planner::new(&task, false).ok()?.plan().ok()?;
        let poses = plan.poses.iter().map(|pose| planner.checker.in_cells(pose));
        (plan.clearance_m >= planner.clearance_m).then(|| self.before.iter().copied().chain(poses).collect())
    }
}

/// The same poses, none of which turns by more than half a turn from the one before.
fn unwound(mut poses: Vec<Pose2>) -> Vec<Pose2> {
    for at in 1..poses.len() {
        poses[at] = along::near(&poses[at - 1].clone(), poses[at]);
    }
    poses
}

/// A way over places and headings as poses: where any heading will do, it changes evenly.
pub(super) fn turned([from, to]: [Pose2; 2], places: &[CellPose]) -> Vec<Pose2> {
    let end = |pose: Pose2| CellPose { x: pose.x_m, y: pose.y_m, heading_rad: Some(pose.heading_rad) };
    let mut all: Vec<CellPose> = vec![end(from)];
    for place in places {
        // Into and out of a narrow place the heading stays.
        match (all.last().copied(), place.heading_rad) {
            (Some(before), None) if before.heading_rad.is_some() => {
                all.push(CellPose { heading_rad: before.heading_rad, ..*place });
            }
            (Some(before), Some(_)) if before.heading_rad.is_none() => {
                all.push(CellPose { heading_rad: place.heading_rad, ..before });
            }
            _ => {}
        }
        all.push(*place);
    }
    match all.last().copied() {
        Some(last) if last.heading_rad.is_none() => {
            all.push(CellPose { heading_rad: Some(to.heading_rad), ..last });
        }
        _ => {}
    }
    all.push(end(to));
    let mut poses: Vec<Pose2> = Vec::with_capacity(all.len());
    let mut known = 0;
    for at in 0..all.len() {
        let Some(heading_rad) = all[at].heading_rad else { continue };
        let before_rad = poses.last().map_or(from.heading_rad, |pose| pose.heading_rad);
        let heading_rad = before_rad + wrap_angle_rad(heading_rad - before_rad);
        let piece: Vec<Pose2> =
            all[known..=at].iter().map(|place| Pose2::new(place.x, place.y, 0.0)).collect();
        let whole = length(&piece).max(f64::MIN_POSITIVE);
        let mut done = 0.0;
        for number in 1..piece.len() {
            done += piece[number].distance_m(piece[number - 1]);
            let turned_rad = before_rad + (heading_rad - before_rad) * done / whole;
            let turned_rad = if number + 1 == piece.len() { heading_rad } else { turned_rad };
            poses.push(Pose2 { heading_rad: turned_rad, ..piece[number] });
        }
        if at == 0 {
            poses.push(from);
        }
        known = at;
    }
    poses
}
