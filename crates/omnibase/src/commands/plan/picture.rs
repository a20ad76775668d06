//! A way in its room, drawn: SVG, or a page that holds it.

use omnibase_plan::{Footprint, Plan, Space};
use omnibase_platform::Pose2;
use omnibase_run::room::TimedWay;
use std::fmt::Write;

/// Outlines of the robot are drawn about so far from each other, in parts of its size.
const OUTLINES_APART: f64 = 0.8;
/// The longer side of the picture, pixels.
const SIDE: f64 = 1000.0;

/// A way's motion, sampled.
pub(super) struct Driven {
    /// Pose and speed in m/s, evenly in time.
    samples: Vec<(Pose2, f64)>,
    /// The greatest speed, m/s.
    pub(super) greatest_m_s: f64,
}

impl Driven {
    /// The motion of a way in so many samples.
    pub(super) fn of(timed: &mut TimedWay, count: u32) -> Driven {
        let (duration_s, reference) = (timed.duration_s, &mut timed.reference);
        let samples: Vec<(Pose2, f64)> = (0..=count)
            .map(|number| {
                let at = reference.sample(duration_s * f64::from(number) / f64::from(count));
                (at.odom_from_body, at.twist_in_odom.speed_m_s())
            })
            .collect();
        let greatest_m_s = samples.iter().map(|(_, speed)| *speed).fold(0.0, f64::max);
        Driven { samples, greatest_m_s }
    }
}

/// From slow to fast: blue, green, yellow, red; they differ in lightness too.
fn colour(share: f64) -> String {
    const STOPS: [[f64; 3]; 4] =
        [[49.0, 54.0, 149.0], [26.0, 152.0, 120.0], [236.0, 178.0, 46.0], [215.0, 48.0, 39.0]];
    let at = share.clamp(0.0, 1.0) * 3.0;
    let stop = (at as usize).min(2);
    let part = at - stop as f64;
    let [r, g, b] =
        [0, 1, 2].map(|n| (STOPS[stop][n] + part * (STOPS[stop + 1][n] - STOPS[stop][n])).round());
    format!("rgb({r},{g},{b})")
}

/// From the room to the picture.
struct Sheet {
    left_m: f64,
    top_m: f64,
    scale: f64,
    size: [f64; 2],
}

impl Sheet {
    fn of(space: &Space) -> Sheet {
        let map = &space.map;
        let corners = [[0, 0], [map.width, 0], [0, map.height], [map.width, map.height]].map(|[x, y]| {
            let at = Pose2::new(x as f64 * map.cell_m, y as f64 * map.cell_m, 0.0);
            let at = map.map_from_grid.then(at);
            [at.x_m, at.y_m]
        });
        let range = |axis: usize| {
            let low = corners.iter().map(|corner| corner[axis]).fold(f64::INFINITY, f64::min);
            [low, corners.iter().map(|corner| corner[axis]).fold(f64::NEG_INFINITY, f64::max)]
        };
        let ([left_m, right_m], [low_m, top_m]) = (range(0), range(1));
        let scale = SIDE / (right_m - left_m).max(top_m - low_m);
        Sheet { left_m, top_m, scale, size: [(right_m - left_m) * scale, (top_m - low_m) * scale] }
    }

    fn at(&self, [x_m, y_m]: [f64; 2]) -> [f64; 2] {
        [(x_m - self.left_m) * self.scale, (self.top_m - y_m) * self.scale]
    }

    fn points(&self, corners: &[[f64; 2]]) -> String {
        let each = corners.iter().map(|corner| {
            let [x, y] = self.at(*corner);
            format!("{x:.1},{y:.1}")
        });
        each.collect::<Vec<_>>().join(" ")
    }
}

/// The way in its room.
pub(super) fn draw(name: &str, space: &Space, footprint: &Footprint, plan: &Plan, driven: &Driven) -> String {
    let sheet = Sheet::of(space);
    let [width, height] = sheet.size;
    let below = height + 56.0;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {below:.0}\" font-family=\"system-ui, sans-serif\" font-size=\"15\">\n\
         <rect width=\"{width:.0}\" height=\"{below:.0}\" fill=\"#fff\"/>\n"
    );
    blocked(&mut svg, space, &sheet);
    outlines(&mut svg, footprint, plan, &sheet);
    let greatest_m_s = driven.greatest_m_s.max(f64::MIN_POSITIVE);
    for pair in driven.samples.windows(2) {
        let [from, to] = [pair[0], pair[1]].map(|(pose, _)| sheet.at([pose.x_m, pose.y_m]));
        let colour = colour(0.5 * (pair[0].1 + pair[1].1) / greatest_m_s);
        let _ = writeln!(
            svg,
            "<path d=\"M{:.1} {:.1}L{:.1} {:.1}\" stroke=\"{colour}\" stroke-width=\"4\" stroke-linecap=\"round\"/>",
            from[0], from[1], to[0], to[1]
        );
    }
    end_words(&mut svg, footprint, plan, &sheet);
    legend(&mut svg, name, [height, greatest_m_s], plan);
    svg + "</svg>\n"
}

/// Cells that are in the way, each run of a row as one.
fn blocked(svg: &mut String, space: &Space, sheet: &Sheet) {
    let map = &space.map;
    let mut path = String::new();
    for (row, cells) in map.touched().chunks_exact(map.width).enumerate() {
        let mut at = 0;
        while at < cells.len() {
            let end = at + cells[at..].iter().take_while(|cell| **cell == cells[at]).count();
            if cells[at] {
                let corner = |x: usize, y: usize| {
                    let grid = Pose2::new(x as f64 * map.cell_m, y as f64 * map.cell_m, 0.0);
                    let at = map.map_from_grid.then(grid);
                    let [x, y] = sheet.at([at.x_m, at.y_m]);
                    format!("{x:.1} {y:.1}")
                };
                let corners = [corner(at, row), corner(end, row), corner(end, row + 1), corner(at, row + 1)];
                let _ = write!(path, "M{}Z", corners.join("L"));
            }
            at = end;
        }
    }
    let _ = writeln!(svg, "<path d=\"{path}\" fill=\"#5b6b79\" stroke=\"#5b6b79\" stroke-width=\"0.4\"/>");
}

/// The robot along its way.
fn outlines(svg: &mut String, footprint: &Footprint, plan: &Plan, sheet: &Sheet) {
    let apart_m = OUTLINES_APART * footprint.outer_radius_m();
    let mut moved_m = f64::INFINITY;
    let last = plan.poses.len() - 1;
    for (number, pose) in plan.poses.iter().enumerate() {
        if number > 0 {
            let before = plan.poses[number - 1];
            let turned_m = footprint.outer_radius_m() * (pose.heading_rad - before.heading_rad).abs();
            moved_m += pose.distance_m(before) + turned_m;
        }
        let is_end = number == 0 || number == last;
        if !is_end && moved_m < apart_m {
            continue;
        }
        moved_m = 0.0;
        let (width, shade) = if is_end { (2.5, 0.25) } else { (0.8, 0.08) };
        let _ = writeln!(
            svg,
            "<polygon points=\"{}\" fill=\"#0b66c3\" fill-opacity=\"{shade}\" stroke=\"#0b66c3\" stroke-width=\"{width}\"/>",
            sheet.points(&footprint.placed_m(pose))
        );
        let nose = 0.7 * footprint.inner_radius_m();
        let (sin, cos) = pose.heading_rad.sin_cos();
        let ends = [[pose.x_m, pose.y_m], [pose.x_m + nose * cos, pose.y_m + nose * sin]];
        let _ = writeln!(
            svg,
            "<polyline points=\"{}\" stroke=\"#0b66c3\" stroke-width=\"{width}\"/>",
            sheet.points(&ends)
        );
    }
}

/// Which end is which, above the robot there.
fn end_words(svg: &mut String, footprint: &Footprint, plan: &Plan, sheet: &Sheet) {
    let Some((start, goal)) = plan.poses.first().zip(plan.poses.last()) else { return };
    for (pose, word) in [(start, "start"), (goal, "goal")] {
        let [x, y] = sheet.at([pose.x_m, pose.y_m + footprint.outer_radius_m()]);
        let [x, y] = [x.clamp(24.0, sheet.size[0] - 24.0), (y - 4.0).max(16.0)];
        let _ = writeln!(
            svg,
            "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"middle\" font-weight=\"600\" fill=\"#14202b\" stroke=\"#fff\" \
             stroke-width=\"4\" paint-order=\"stroke\">{word}</text>"
        );
    }
}

fn legend(svg: &mut String, name: &str, [top, greatest_m_s]: [f64; 2], plan: &Plan) {
    let name = name.replace('&', "&amp;").replace('<', "&lt;");
    let _ = writeln!(
        svg,
        "<text x=\"8\" y=\"{:.0}\" fill=\"#14202b\">{name}: {:.2} m, keeps {:.2} m</text>",
        top + 24.0,
        plan.length_m,
        plan.clearance_m
    );
    for step in 0..60 {
        let share = (f64::from(step) + 0.5) / 60.0;
        let _ = writeln!(
            svg,
            "<rect x=\"{:.1}\" y=\"{:.0}\" width=\"3.4\" height=\"10\" fill=\"{}\"/>",
            60.0 + 3.2 * f64::from(step),
            top + 36.0,
            colour(share)
        );
    }
    let _ = writeln!(
        svg,
        "<text x=\"8\" y=\"{0:.0}\" fill=\"#14202b\">0 m/s</text><text x=\"262\" y=\"{0:.0}\" fill=\"#14202b\">{greatest_m_s:.2} m/s</text>",
        top + 46.0
    );
}

/// A page with a picture.
pub(super) fn page(svg: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\"><title>A planned way</title>\
         <style>body{{margin:1rem;background:#f6f7f9}}svg{{max-width:100%;max-height:95vh}}</style></head>\n<body>\n{svg}</body></html>\n"
    )
}
