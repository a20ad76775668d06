//! The robot's outline on the floor.

use omnibase_platform::Pose2;

use crate::Point;

/// Most corners of an outline.
pub const MOST_CORNERS: usize = 16;

/// A convex outline in the frame of base_link, counter-clockwise, m.
#[derive(Clone, Debug, PartialEq)]
pub struct Footprint {
    corners_m: Vec<Point>,
}

/// Why an outline was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FootprintError {
    /// Too few or too many corners.
    #[error("a footprint has 3 to {MOST_CORNERS} corners, found {found}")]
    Count {
        /// How many there are.
        found: usize,
    },
    /// A corner that no robot has.
    #[error("corner {corner} of the footprint, from 0: expected finite numbers up to 100 m, found {found:?}")]
    Corner {
        /// Its number.
        corner: usize,
        /// Where it is, m.
        found: Point,
    },
    /// Corners that turn inwards, or lie on a line.
    #[error(
        "the footprint turns to the right, or not at all, at corner {corner}, from 0: expected a convex outline, counter-clockwise"
    )]
    NotConvex {
        /// Its number.
        corner: usize,
    },
}

impl Footprint {
    /// From corners in order, counter-clockwise.
    pub fn new(corners_m: Vec<Point>) -> Result<Footprint, FootprintError> {
        let count = corners_m.len();
        if !(3..=MOST_CORNERS).contains(&count) {
            return Err(FootprintError::Count { found: count });
        }
        for (corner, found) in corners_m.iter().enumerate() {
            if !found.iter().all(|part| part.is_finite() && part.abs() <= 100.0) {
                return Err(FootprintError::Corner { corner, found: *found });
            }
        }
        for corner in 0..count {
            let [a, b, c] = [corner + count - 1, corner, corner + 1].map(|at| corners_m[at % count]);
            if (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]) <= 0.0 {
                return Err(FootprintError::NotConvex { corner });
            }
        }
        Ok(Footprint { corners_m })
    }

    /// A disc, as the polygon around it; its radius in m.
    pub fn disc(radius_m: f64) -> Result<Footprint, FootprintError> {
        let outer_m = radius_m / (std::f64::consts::PI / MOST_CORNERS as f64).cos();
        let corner = |number: usize| {
            let (sin, cos) = (std::f64::consts::TAU * number as f64 / MOST_CORNERS as f64).sin_cos();
            [outer_m * cos, outer_m * sin]
        };
        Footprint::new((0..MOST_CORNERS).map(corner).collect())
    }

    /// The corners.
    pub fn corners_m(&self) -> &[Point] {
        &self.corners_m
    }

    /// From base_link to the farthest corner, m: whatever the heading, it reaches no further.
    pub fn outer_radius_m(&self) -> f64 {
        self.corners_m.iter().map(|corner| corner[0].hypot(corner[1])).fold(0.0, f64::max)
    }

    /// From base_link to the nearest side, m: whatever the heading, so much is covered; 0 where base_link lies outside.
    pub fn inner_radius_m(&self) -> f64 {
        self.normals()
            .map(|(corner, normal)| corner[0] * normal[0] + corner[1] * normal[1])
            .fold(f64::INFINITY, f64::min)
            .max(0.0)
    }

    /// Each side's first corner and its direction outwards.
    fn normals(&self) -> impl Iterator<Item = (Point, Point)> + '_ {
        let count = self.corners_m.len();
        self.corners_m.iter().enumerate().map(move |(at, from)| {
            let to = self.corners_m[(at + 1) % count];
            let side = [to[0] - from[0], to[1] - from[1]];
            let size = side[0].hypot(side[1]);
            (*from, [side[1] / size, -side[0] / size])
        })
    }

    /// The corners of an outline that holds everything within a distance of this one, m: twice as many.
    pub(crate) fn around(&self, distance_m: f64) -> Vec<Point> {
        let normals: Vec<(Point, Point)> = self.normals().collect();
        let count = normals.len();
        let mut corners = Vec::with_capacity(2 * count);
        for at in 0..count {
            let (corner, after) = normals[at];
            let (_, before) = normals[(at + count - 1) % count];
            // The corner's circle is held by a third line, across its middle.
            let middle = [before[0] + after[0], before[1] + after[1]];
            let size = middle[0].hypot(middle[1]).max(1e-9);
            let middle = middle.map(|part| part / size);
            for normal in [before, after] {
                // Where both lines are `distance_m` away.
                let reach_m = distance_m / (1.0 + normal[0] * middle[0] + normal[1] * middle[1]);
                corners.push([0, 1].map(|axis| corner[axis] + reach_m * (normal[axis] + middle[axis])));
            }
        }
        corners
    }

    /// The corners at a pose.
    pub fn placed_m(&self, pose: &Pose2) -> Vec<Point> {
        placed(&self.corners_m, pose)
    }
}

/// Corners put where a pose is.
pub(crate) fn placed(corners: &[Point], pose: &Pose2) -> Vec<Point> {
    let (sin, cos) = pose.heading_rad.sin_cos();
    corners.iter().map(|[x, y]| [pose.x_m + cos * x - sin * y, pose.y_m + sin * x + cos * y]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outlines_are_checked_and_grow_by_a_distance_everywhere() {
        let long = vec![[0.6, -0.2], [0.6, 0.2], [-0.4, 0.2], [-0.4, -0.2]];
        let footprint = Footprint::new(long.clone()).unwrap();
        assert!((footprint.outer_radius_m() - 0.6_f64.hypot(0.2)).abs() < 1e-12);
        assert!((footprint.inner_radius_m() - 0.2).abs() < 1e-12);
        let around = Footprint::new(footprint.around(0.1)).unwrap();
        // Each place at the distance is held, and nothing much further out.
        for number in 0..720 {
            let (sin, cos) = (f64::from(number) / 720.0 * std::f64::consts::TAU).sin_cos();
            for corner in &long {
                let place = [corner[0] + 0.1 * cos, corner[1] + 0.1 * sin];
                let out = |(from, normal): (Point, Point)| {
                    (place[0] - from[0]) * normal[0] + (place[1] - from[1]) * normal[1]
                };
                let most = around.normals().map(out).fold(f64::NEG_INFINITY, f64::max);
                assert!(most < 1e-12, "{place:?} is {most} m outside");
            }
        }
        for corner in around.corners_m() {
            let off =
                [0.0_f64.max(corner[0] - 0.6).max(-0.4 - corner[0]), 0.0_f64.max(corner[1].abs() - 0.2)];
            let off_m = off[0].hypot(off[1]);
            assert!((0.1 - 1e-12..0.11).contains(&off_m), "{corner:?}: {off_m}");
        }
        let mut clockwise = long.clone();
        clockwise.reverse();
        let text = |corners| Footprint::new(corners).unwrap_err().to_string();
        assert!(text(clockwise).contains("counter-clockwise"));
        assert_eq!(text(long[..2].to_vec()), "a footprint has 3 to 16 corners, found 2");
        assert!(text(vec![[0.0, 0.0], [f64::NAN, 0.0], [0.0, 1.0]]).contains("corner 1"));
    }
}
