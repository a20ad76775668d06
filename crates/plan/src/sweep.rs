//! Whole motions: nothing between two looks is left out.
//!
//! A look at one pose with room around the footprint covers all of a motion in which no point of it moves farther than that room. Where
//! there isn't so much room the motion is halved.

use omnibase_platform::Pose2;

use crate::footprint::Footprint;
use crate::space::{Checker, Space};

/// The room of the widest look, m.
const WIDEST_M: f64 = 0.04;
/// Each is half as wide as the one before: the narrowest keeps 0.08 mm.
const WIDTHS: i32 = 10;

/// Looks at motions of a footprint.
#[derive(Clone, Debug)]
pub struct Sweep<'a> {
    /// From the widest on.
    looks: Vec<(f64, Checker<'a>)>,
}

impl<'a> Sweep<'a> {
    /// For a footprint in a space.
    pub fn new(space: &'a Space, footprint: &Footprint) -> Self {
        let width_m = |number| WIDEST_M * 0.5_f64.powi(number);
        let look = |number| (width_m(number), space.checker(footprint, width_m(number)));
        Sweep { looks: (0..WIDTHS).map(look).collect() }
    }

    /// Where a motion comes nearer to anything than the narrowest look's room: a pose in the map's frame of a time, of which no point of the
    /// footprint moves faster than `fastest_m_s`; `None` where it touches nothing.
    pub fn touches(
        &mut self,
        [from_s, to_s]: [f64; 2],
        fastest_m_s: f64,
        pose: &dyn Fn(f64) -> Pose2,
    ) -> Option<Pose2> {
        let middle_s = 0.5 * (from_s + to_s);
        let moves_m = 0.5 * (to_s - from_s) * fastest_m_s;
        let look = self.looks.iter().rposition(|(width_m, _)| moves_m <= *width_m);
        if let Some(number) = look {
            let at = pose(middle_s);
            if self.looks[number].1.is_free(&at) {
                return None;
            }
            // What isn't finite is never split into something that is.
            if number + 1 == self.looks.len() || !at.is_finite() {
                return Some(at);
            }
        }
        self.touches([from_s, middle_s], fastest_m_s, pose)
            .or_else(|| self.touches([middle_s, to_s], fastest_m_s, pose))
    }

    /// Whether a footprint gets from one pose to another, place and heading changing evenly, without touching anything.
    pub fn passes(&mut self, [from, to]: [&Pose2; 2], footprint: &Footprint) -> bool {
        let turn_rad = (to.heading_rad - from.heading_rad).abs();
        let moves_m = from.distance_m(*to) + footprint.outer_radius_m() * turn_rad;
        self.touches([0.0, 1.0], moves_m, &|part| crate::smooth::between(from, to, part)).is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::Map;

    #[test]
    fn a_corner_between_two_looks_is_seen() {
        // A pillar of one cell; the robot is a thin one that swings past it within one step of any even look.
        let mut map = Map::empty([200, 200], 0.05).unwrap();
        map.block_polygon(&[[6.0, 5.0], [6.05, 5.0], [6.05, 5.05], [6.0, 5.05]]);
        let space = Space::new(map);
        let thin = Footprint::new(vec![[-0.1, -0.01], [1.5, -0.01], [1.5, 0.01], [-0.1, 0.01]]).unwrap();
        let pose = |heading_rad| Pose2::new(5.0, 5.0, heading_rad);
        let mut sweep = Sweep::new(&space, &thin);
        assert!(!sweep.passes([&pose(-0.5), &pose(0.5)], &thin));
        // The pillar's lower side lies at y 5 m: what stays below by a tenth of a millimetre passes, what reaches it doesn't.
        let beside = |gap_m: f64| {
            let ends = [-2.0, 2.0].map(|x_m| Pose2::new(5.0 + x_m, 4.99 - gap_m, 0.0));
            sweep.passes([&ends[0], &ends[1]], &thin)
        };
        assert_eq!([1e-4, -1e-4].map(beside), [true, false]);
        // A motion so fast that two looks every 20 ms lie on both sides of it.
        let flung = |time_s: f64| pose(-0.5 + 50.0 * time_s);
        let touched = sweep.touches([0.0, 0.02], 50.0 * thin.outer_radius_m(), &flung).unwrap();
        assert!((-0.03..0.07).contains(&touched.heading_rad), "{touched:?}");
    }
}
