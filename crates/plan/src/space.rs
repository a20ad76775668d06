//! A map in which footprints are looked for: exact, row by row.

use std::borrow::Cow;
use std::ops::Range;

use omnibase_platform::Pose2;

use crate::Point;
use crate::distance::{self, Between};
use crate::footprint::{self, Footprint};
use crate::map::{Map, Solid, range};
use crate::smooth::between;
use crate::tiles::Tiles;

#[cfg(test)]
mod tests;

/// How far a footprint may reach into a cell that is in the way, in cells: rounding.
const TOUCH: f64 = 1e-9;
/// A coarse look's step in parts of the room: half a step away from a look less than the room is used.
const COARSE: f64 = 1.6;
/// No step of a motion is looked at more finely than this, m.
const FINEST_M: f64 = 0.005;

/// An outline whose nearest side is at least so far from its middle, in parts of its farthest corner, is nearly a disc.
const NEARLY_DISC: f64 = 0.9;

/// So much farther than it reaches a disc is looked at, in cells: what is seen needn't be looked at again.
const FARTHER: f64 = 1.0;
/// Polygons with more corners are looked at side by side.
const MOST_CORNERS: usize = 16;
/// Discs that cover an outline together lie apart by this part of its width.
const APART: f64 = 0.5;
/// And are so many at most: very long ones are covered by larger discs.
const MOST_DISCS: f64 = 16.0;

/// A map with what makes looking fast. Beyond its borders everything is in the way.
#[derive(Clone, Debug)]
pub struct Space {
    /// The map.
    pub map: Map,
    /// From each cell's centre to the nearest square in the way, in cells.
    clearance: Vec<f32>,
    /// How many cells beside polygons are in the way before each one, in its row and those below: a row has one more than cells, and there is one
    /// row more.
    counts: Vec<u32>,
    /// Whether any cell is in the way beside polygons.
    has_cells: bool,
    /// Which polygons may be the nearest.
    tiles: Tiles,
}

/// Looks for a footprint with some room around it.
#[derive(Clone, Debug)]
pub struct Checker<'a> {
    space: &'a Space,
    /// The outline with its room, in cells.
    outline: Vec<Point>,
    /// From base_link to its farthest corner, in cells.
    reach: f64,
    /// From base_link to its nearest side, in cells, 0 where that isn't inside.
    inner: f64,
    is_nearly_disc: bool,
    /// Middles of discs that cover it together, and the radius of all, in cells.
    cover: Vec<Point>,
    cover_radius: f64,
    /// How far points may move from one look to the next, in cells.
    step: f64,
    /// Its sides: their directions outwards, and how far out they lie, in cells.
    sides: Vec<(Point, f64)>,
    rows: Vec<[f64; 2]>,
    /// Poses that were looked at.
    #[cfg(test)]
    pub(crate) looks: usize,
}

impl Space {
    /// Of a map.
    pub fn new(map: Map) -> Space {
        let width = map.width;
        let touched = map.touched();
        let (clearance, counts) = (clearance_of(&touched, width), counts_of(&map.blocked, width));
        drop(touched);
        let has_cells = map.blocked.contains(&true);
        let tiles = Tiles::new(&map);
        Space { map, clearance, counts, has_cells, tiles }
    }

    /// The clearance, with polygons as they are where a radius in this range, in cells, depends on it: the squares that they touch come nearer
    /// by up to a square's diagonal.
    pub fn sharpened(&self, [least, most]: [f64; 2]) -> Cow<'_, [f32]> {
        if self.map.solids.is_empty() {
            return Cow::Borrowed(&self.clearance);
        }
        let width = self.map.width;
        let may_count = least - std::f64::consts::SQRT_2..most;
        let sharpen = |(at, rough): (usize, &f32)| {
            if !may_count.contains(&f64::from(*rough)) {
                return *rough;
            }
            let centre = [(at % width) as f64 + 0.5, (at / width) as f64 + 0.5];
            // The squares that polygons touch come nearer by a square's diagonal at most. Rounded down: what is open is.
            let nearest = self.distance(centre, f64::from(*rough) + std::f64::consts::SQRT_2);
            (nearest as f32).next_down().max(*rough)
        };
        self.clearance.iter().enumerate().map(sharpen).collect()
    }

    /// From a place to the nearest thing in the way or the border, in cells; `most` where nothing is so near.
    pub(crate) fn distance(&self, [x, y]: Point, most: f64) -> f64 {
        let (width, height) = (self.map.width, self.map.height);
        let mut near = most.min(x).min(y).min(width as f64 - x).min(height as f64 - y).max(0.0);
        let rows = (y - near).max(0.0) as usize..up(y + near).min(height);
        let are_free = !self.has_cells || self.are_free([(x - near).max(0.0), x + near], rows.clone());
        for row in if are_free { 0..0 } else { rows } {
            let off = (row as f64 - y).max(y - row as f64 - 1.0).max(0.0);
            let half = (near * near - off * off).max(0.0).sqrt();
            let range = [(x - half).max(0.0), x + half];
            if self.are_free(range, row..row + 1) {
                continue;
            }
            for column in range[0] as usize..up(range[1]).min(width) {
                if self.map.blocked[row * width + column] {
                    let across = (column as f64 - x).max(x - column as f64 - 1.0).max(0.0);
                    near = near.min(across.hypot(off));
                }
            }
        }
        if near <= 0.0 {
            return 0.0;
        }
        self.tiles.nearest(&self.map.solids, [x, y]).fold(near, |near, solid| solid.distance([x, y], near))
    }

    /// From each cell's centre to the nearest square in the way or the border, in cells, row by row.
    pub fn clearance(&self) -> &[f32] {
        &self.clearance
    }

    /// A checker for a footprint with room around it, m.
    pub fn checker(&self, footprint: &Footprint, room_m: f64) -> Checker<'_> {
        let cell_m = self.map.cell_m;
        // What is looked at with half a step of room covers all that lies between two looks.
        let step_m = (0.5 * room_m).max(FINEST_M);
        let outline: Vec<Point> =
            if room_m > 0.0 { footprint.around(room_m) } else { footprint.corners_m().to_vec() };
        let outline: Vec<Point> = outline.iter().map(|corner| corner.map(|part| part / cell_m)).collect();
        let reach = outline.iter().map(|corner| corner[0].hypot(corner[1])).fold(0.0, f64::max);
        // Most that touch nothing are told by the disc around them.
        let inner = (footprint.inner_radius_m() + room_m) / cell_m;
        let is_nearly_disc = inner >= NEARLY_DISC * reach;
        let (cover, cover_radius) = covering(&outline);
        Checker {
            space: self,
            sides: sides_of(&outline),
            outline,
            reach,
            inner,
            is_nearly_disc,
            cover,
            cover_radius,
            step: step_m / cell_m,
            rows: Vec::new(),
            #[cfg(test)]
            looks: 0,
        }
    }

    /// From a place in cells to the nearest thing in the way, at least, in cells.
    pub(crate) fn room(&self, pose: &Pose2) -> f64 {
        self.least_clearance([pose.x_m, pose.y_m]).unwrap_or(0.0).max(0.0)
    }

    /// Whether nothing but polygons is in the way between two coordinates along x, in these rows.
    fn are_free(&self, [from, to]: [f64; 2], rows: Range<usize>) -> bool {
        let width = self.map.width;
        let first = (from + TOUCH) as usize;
        let end = up(to - TOUCH).min(width);
        let [below, above] = [rows.start, rows.end].map(|row| {
            let counts = &self.counts[row * (width + 1)..(row + 1) * (width + 1)];
            if end > first { counts[end] - counts[first] } else { 0 }
        });
        above == below
    }

    /// A place's clearance is at least this, in cells; `None` beyond the borders.
    fn least_clearance(&self, [x, y]: Point) -> Option<f64> {
        if !(x >= 0.0 && y >= 0.0) {
            return None;
        }
        let (column, row) = (x as usize, y as usize);
        if column >= self.map.width || row >= self.map.height {
            return None;
        }
        let off = [x - column as f64 - 0.5, y - row as f64 - 0.5];
        let room = f64::from(self.clearance[row * self.map.width + column]);
        Some(room - (off[0] * off[0] + off[1] * off[1]).sqrt())
    }
}

impl<'a> Checker<'a> {
    /// The same that looks only so often that between two looks nothing touches the bare outline; it keeps this room, m.
    pub(crate) fn coarse(&self, room_m: f64) -> Checker<'a> {
        Checker { step: (COARSE * room_m).max(FINEST_M) / self.space.map.cell_m, ..self.clone() }
    }

    /// The same for an outline whose sides are nearer by so many cells; `None` where there is none.
    pub(crate) fn smaller(&self, by: f64) -> Option<Checker<'a>> {
        let count = self.sides.len();
        let corner = |at: usize| {
            let [before, after] = [count - 1, 0].map(|beside| self.sides[(at + beside) % count].0);
            let step = by / (1.0 + before[0] * after[0] + before[1] * after[1]);
            [0, 1].map(|axis| self.outline[at][axis] - step * (before[axis] + after[axis]))
        };
        let outline: Vec<Point> = (0..count).map(corner).collect();
        let reach = outline.iter().map(|corner| corner[0].hypot(corner[1])).fold(0.0, f64::max);
        let inner = self.inner - by;
        // The larger one's discs cover it.
        (inner > 0.0).then(|| Checker { sides: sides_of(&outline), outline, reach, inner, ..self.clone() })
    }

    /// Whether headings hardly count for it.
    pub(crate) fn is_nearly_disc(&self) -> bool {
        self.is_nearly_disc
    }

    /// Whether nothing is in the way of a pose in the map's frame.
    pub fn is_free(&mut self, pose: &Pose2) -> bool {
        let pose = self.in_cells(pose);
        self.is_free_in_cells(&pose)
    }

    /// A pose in the map's frame as the grid has it, in cells.
    pub(crate) fn in_cells(&self, pose: &Pose2) -> Pose2 {
        let map = &self.space.map;
        let at = map.map_from_grid.inverse().then(*pose);
        Pose2 { x_m: at.x_m / map.cell_m, y_m: at.y_m / map.cell_m, ..at }
    }

    pub(crate) fn is_free_in_cells(&mut self, pose: &Pose2) -> bool {
        self.spare(pose).is_some()
    }

    /// How far the outline's points may move at least until one touches anything, in cells; `None` where one does.
    fn spare(&mut self, pose: &Pose2) -> Option<f64> {
        #[cfg(test)]
        {
            self.looks += 1;
        }
        let at = [pose.x_m, pose.y_m];
        let spare = self.space.least_clearance(at)? - self.reach;
        if spare >= 0.0 {
            return Some(spare);
        }
        if self.is_nearly_disc {
            let room = self.space.distance(at, self.reach + FARTHER);
            if room >= self.reach - TOUCH {
                return Some((room - self.reach).max(0.0));
            }
            if room < self.inner - TOUCH {
                return None;
            }
        }
        let turn = Rotation::by(pose.heading_rad);
        // Where cells are in the way, discs tell most of it.
        if self.space.has_cells && !self.is_nearly_disc {
            let spare = self.cover_spare(at, turn);
            if spare >= if self.space.map.solids.is_empty() { 0.0 } else { FARTHER } {
                return Some(spare);
            }
        }
        self.outline_spare(at, turn)
    }

    /// How far points may move at least until a disc that covers the outline touches anything, in cells; negative where one may already.
    fn cover_spare(&self, at: Point, turn: Rotation) -> f64 {
        let mut least = f64::INFINITY;
        for middle in &self.cover {
            let room = self.space.least_clearance(turned(*middle, at, turn)).unwrap_or(f64::NEG_INFINITY);
            least = least.min(room - self.cover_radius);
            if least < 0.0 {
                break;
            }
        }
        least
    }

    /// Whether nothing is in the way of a motion along which place and heading change evenly, in cells.
    pub(crate) fn is_motion_free_in_cells(&mut self, from: &Pose2, to: &Pose2) -> bool {
        // What is in the way is mostly at the end that was wished for, or half way to it.
        let Some(last) = self.spare(to) else { return false };
        let Some(first) = self.spare(from) else { return false };
        let moves = from.distance_m(*to) + self.reach * (to.heading_rad - from.heading_rad).abs();
        self.is_free_within([from, to], moves, [first, moves - last])
    }

    /// Whether nothing is in the way of the part of a motion of so many cells of the farthest corner that lies between two places of it.
    fn is_free_within(&mut self, ends: [&Pose2; 2], moves: f64, [begin, end]: [f64; 2]) -> bool {
        // At each look all is free for as far as the clearance lasts.
        let pieces = ((end - begin) / self.step).ceil();
        if pieces <= 1.0 {
            return true;
        }
        let middle = begin + (end - begin) * (0.5 * pieces).ceil() / pieces;
        let Some(spare) = self.spare(&between(ends[0], ends[1], middle / moves)) else { return false };
        self.is_free_within(ends, moves, [begin, middle - spare])
            && self.is_free_within(ends, moves, [middle + spare, end])
    }

    /// The same of a motion whose ends are known to be free: only between them is looked.
    pub(crate) fn is_free_between_in_cells(&mut self, from: &Pose2, to: &Pose2) -> bool {
        let moves = from.distance_m(*to) + self.reach * (to.heading_rad - from.heading_rad).abs();
        self.is_free_within([from, to], moves, [0.0, moves])
    }

    /// How far the outline's points may move at least, no farther than [`FARTHER`], until one touches anything; `None` where one does.
    fn outline_spare(&mut self, at: Point, turn: Rotation) -> Option<f64> {
        let (space, farthest) = (self.space, self.reach + FARTHER);
        let mut placed = [[0.0; 2]; 2 * footprint::MOST_CORNERS];
        let corners = &mut placed[..self.outline.len()];
        corners.iter_mut().zip(&self.outline).for_each(|(corner, own)| *corner = turned(*own, at, turn));
        let listed = space.tiles.within(&space.map.solids, at, farthest);
        let mut spare = FARTHER;
        for solid in listed.filter(|solid| solid.is_within(at, farthest)) {
            spare = self.apart(solid, at, turn, corners, spare)?;
        }
        let size = [space.map.width as f64, space.map.height as f64];
        let is_inside = (0..2).all(|axis| at[axis] >= farthest && at[axis] + farthest <= size[axis]);
        if is_inside && !space.has_cells {
            return Some(spare);
        }
        let range = range(corners);
        let [[left, low], [right, high]] = range;
        let border = left.min(low).min(size[0] - right).min(size[1] - high);
        if border < -TOUCH {
            return None;
        }
        let spare = spare.min(border).max(0.0);
        if space.has_cells {
            let [below, above] = [low - spare, high + spare].map(|y| y.max(0.0));
            let rows = below as usize..up(above).min(space.map.height);
            if !space.are_free([(left - spare).max(0.0), right + spare], rows) {
                return self.is_polygon_free(corners, range).then_some(0.0);
            }
        }
        Some(spare)
    }

    /// How far beyond any one of a polygon's sides the outline lies, or the polygon beyond any one of the outline's, where that is less than `most`,
    /// in cells; 0 where it isn't known, `None` where they overlap.
    fn apart(
        &self,
        solid: &Solid,
        at: Point,
        Rotation { sin, cos }: Rotation,
        corners: &[Point],
        most: f64,
    ) -> Option<f64> {
        let mut apart = f64::NEG_INFINITY;
        for (normal, far) in solid.normals() {
            // No farther than the outline's middle is.
            if normal[0] * at[0] + normal[1] * at[1] - far - self.inner <= apart {
                continue;
            }
            let out = |corner: &Point| normal[0] * corner[0] + normal[1] * corner[1];
            apart = apart.max(corners.iter().map(out).fold(f64::INFINITY, least) - far);
            if apart >= most {
                return Some(most);
            }
        }
        if solid.corners().len() <= MOST_CORNERS {
            for (normal, far) in &self.sides {
                let [x, y] = [cos * normal[0] - sin * normal[1], sin * normal[0] + cos * normal[1]];
                let out = |corner: &Point| x * (corner[0] - at[0]) + y * (corner[1] - at[1]);
                apart = apart.max(solid.corners().iter().map(out).fold(f64::INFINITY, least) - far);
                if apart >= most {
                    return Some(most);
                }
            }
        }
        let is_free =
            apart > -TOUCH || solid.normals().is_empty() && !solid.overlaps(corners, range(corners));
        is_free.then_some(apart.max(0.0))
    }

    /// Whether a convex polygon within the map, and within this range, touches no cell that is in the way: a row of cells meets it in one range.
    fn is_polygon_free(&mut self, corners: &[Point], [[left, low], [right, high]]: [Point; 2]) -> bool {
        let first = (low + TOUCH) as usize;
        let end = up(high - TOUCH).min(self.space.map.height);
        if self.space.are_free([left, right], first..end.max(first)) {
            return true;
        }
        self.rows.clear();
        self.rows.resize(end.saturating_sub(first), [f64::INFINITY, f64::NEG_INFINITY]);
        for (number, from) in corners.iter().enumerate() {
            let to = corners[(number + 1) % corners.len()];
            let (below, above) = if from[1] <= to[1] { (*from, to) } else { (to, *from) };
            let slope = if above[1] > below[1] { (above[0] - below[0]) / (above[1] - below[1]) } else { 0.0 };
            let last = (above[1] as usize).min(end.max(1) - 1);
            for row in (below[1] as usize).max(first)..=last {
                let [y_from, y_to] = [(row as f64).max(below[1]), (row as f64 + 1.0).min(above[1])];
                let ends = if above[1] > below[1] {
                    [y_from, y_to].map(|y| below[0] + slope * (y - below[1]))
                } else {
                    [below[0], above[0]]
                };
                let range = &mut self.rows[row - first];
                range[0] = range[0].min(ends[0]).min(ends[1]);
                range[1] = range[1].max(ends[0]).max(ends[1]);
            }
        }
        let mut rows = self.rows.iter().zip(first..);
        rows.all(|(range, row)| self.space.are_free(*range, row..row + 1))
    }
}

/// A turn by an angle of this sine and cosine.
#[derive(Clone, Copy)]
struct Rotation {
    sin: f64,
    cos: f64,
}

impl Rotation {
    fn by(angle_rad: f64) -> Rotation {
        let (sin, cos) = angle_rad.sin_cos();
        Rotation { sin, cos }
    }
}

/// A place of a footprint that stands at another one, turned.
fn turned([x, y]: Point, at: Point, Rotation { sin, cos }: Rotation) -> Point {
    [at[0] + cos * x - sin * y, at[1] + sin * x + cos * y]
}

/// The sides of a convex outline: their directions outwards, and how far out they lie.
fn sides_of(outline: &[Point]) -> Vec<(Point, f64)> {
    let side = |(at, from): (usize, &Point)| {
        let to = outline[(at + 1) % outline.len()];
        let way = [to[0] - from[0], to[1] - from[1]];
        let size = way[0].hypot(way[1]);
        let normal = [way[1] / size, -way[0] / size];
        (normal, normal[0] * from[0] + normal[1] * from[1])
    };
    outline.iter().enumerate().map(side).collect()
}

/// Middles of discs in a row along an outline that cover it together, and the radius of all.
fn covering(outline: &[Point]) -> (Vec<Point>, f64) {
    let [low, high] = range(outline);
    let size = [high[0] - low[0], high[1] - low[1]];
    let along = usize::from(size[1] > size[0]);
    let width = size[1 - along];
    let count = (size[along] / (APART * width)).ceil().clamp(1.0, MOST_DISCS);
    let length = size[along] / count;
    let middle = |number: usize| {
        let mut at = [0, 1].map(|axis| 0.5 * (low[axis] + high[axis]));
        at[along] = low[along] + (number as f64 + 0.5) * length;
        at
    };
    ((0..count as usize).map(middle).collect(), 0.5 * length.hypot(width))
}

/// How many cells before each one, in its row and those below, are in the way.
fn counts_of(blocked: &[bool], width: usize) -> Vec<u32> {
    let mut counts = vec![0; width + 1];
    counts.reserve((width + 1) * (blocked.len() / width));
    for row in blocked.chunks_exact(width) {
        let (below, mut count) = (counts.len() - width - 1, 0);
        counts.push(0);
        for (column, blocked) in row.iter().enumerate() {
            count += u32::from(*blocked);
            counts.push(counts[below + column + 1] + count);
        }
    }
    counts
}

/// From each cell's centre to the nearest of these squares or the border, in cells.
fn clearance_of(blocked: &[bool], width: usize) -> Vec<f32> {
    let height = blocked.len() / width;
    let squares = distance::squares(blocked, width, Between::CentreAndSquare);
    let border = |at: usize, count: usize| at.min(count - 1 - at) as f32 + 0.5;
    let across: Vec<f32> = (0..width).map(|column| border(column, width)).collect();
    let mut clearance = Vec::with_capacity(blocked.len());
    for (row, squares) in squares.chunks_exact(width).enumerate() {
        let along = border(row, height);
        // The root of what was rounded once is rounded right.
        let nearest = squares
            .iter()
            .zip(&across)
            .map(|(square, across)| (*square as f32).sqrt().min(across.min(along)));
        clearance.extend(nearest);
    }
    clearance
}

/// The first whole number that isn't below this; 0 where it is negative. Unlike `ceil` it is no call.
fn up(value: f64) -> usize {
    let whole = value as usize;
    whole + usize::from((whole as f64) < value)
}

/// The lesser one; unlike `min` it is no call.
fn least(one: f64, other: f64) -> f64 {
    if other < one { other } else { one }
}
