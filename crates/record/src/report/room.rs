//! The room around a path: what the description tells of walls, fence and obstacles, as they were when the run began.

use super::chart;
use super::overhead::Floor;
use super::signals::Signals;
use std::fmt::Write;

/// What stands around the path, in odom.
pub(super) struct Room {
    /// Corners, m.
    fence: Vec<[f64; 2]>,
    /// Corners of each, m.
    walls: Vec<Vec<[f64; 2]>>,
    /// Centre and radius, m.
    obstacles: Vec<[f64; 3]>,
}

impl Room {
    /// By `fence_m`, `walls_m` and `obstacles_m`.
    pub(super) fn of(signals: &Signals<'_>) -> Self {
        Room {
            fence: signals.tuples("fence_m"),
            walls: signals.lists("walls_m"),
            obstacles: signals.tuples("obstacles_m"),
        }
    }

    /// The places that are shown in any case: a map may be far larger than what was driven.
    pub(super) fn places(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        self.fence.iter().copied()
    }

    /// Draws it below all paths, with what it is in the legend.
    pub(super) fn draw(&self, floor: &Floor, inner: &mut String, legend: &mut String) {
        let mut data = String::new();
        self.walls.iter().for_each(|wall| outline(&mut data, floor, wall));
        let mut put = |class: &str, sort: &str, name: &str, data: &str| {
            if !data.is_empty() {
                let _ = write!(inner, "<path class=\"{class}\" d=\"{data}\"/>");
                legend.push_str(&chart::key(class, sort, name));
            }
        };
        put("wall", "area", "walls", &data);
        data.clear();
        for &[x, y, radius] in &self.obstacles {
            let around = (0..32).map(|number| {
                let (sin, cos) = (f64::from(number) * std::f64::consts::TAU / 32.0).sin_cos();
                [x + radius * cos, y + radius * sin]
            });
            outline(&mut data, floor, &around.collect::<Vec<_>>());
        }
        put("obstacle", "area", "obstacles", &data);
        data.clear();
        outline(&mut data, floor, &self.fence);
        put("fence", "line", "fence", &data);
    }
}

fn outline(data: &mut String, floor: &Floor, corners: &[[f64; 2]]) {
    for (number, [x, y]) in corners.iter().enumerate() {
        let (px, py) = floor.place(*x, *y);
        let _ = write!(data, "{}{px:.1} {py:.1}", ["M", "L"][number.min(1)]);
    }
    data.push_str(if corners.is_empty() { "" } else { "Z" });
}
