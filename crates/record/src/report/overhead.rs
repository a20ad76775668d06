//! The path seen from above, with equal axes and the platform drawn where it was at times.

use super::chart::{self, Axes, Figure, HEIGHT, WIDTH};
use super::curve;
use super::room::Room;
use super::scale::Span;
use super::signals::{Poses, Signals};
use super::text::{self, Unit};
use super::tracking::Tracking;
use std::fmt::Write;

/// Points of a path that are drawn at most; more are never seen.
const MOST_POINTS: usize = 8000;
/// Platforms drawn at most.
const MOST_PLATFORMS: usize = 9;

/// What is known of the platform's shape, in its own frame.
pub(super) struct Shape {
    /// Corners, m.
    footprint: Vec<[f64; 2]>,
    /// Wheels: x and y, m, direction of rolling, rad, radius, m.
    wheels: Vec<[f64; 4]>,
}

impl Shape {
    /// The shape that the description tells, by `footprint_m` and `wheels_m`; corners around the wheels where it
    /// tells no footprint.
    pub(super) fn of(signals: &Signals<'_>) -> Self {
        let wheels: Vec<[f64; 4]> = signals.tuples("wheels_m");
        let mut footprint: Vec<[f64; 2]> = signals.tuples("footprint_m");
        if footprint.len() < 3 {
            footprint = hull(wheels.iter().flat_map(|&[x, y, _, radius]| {
                [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]]
                    .map(|[right, up]| [x + right * radius, y + up * radius])
            }));
        }
        Shape { footprint, wheels }
    }

    /// From the middle to the farthest corner, m.
    fn reach(&self) -> f64 {
        self.footprint.iter().map(|[x, y]| x.hypot(*y)).fold(0.0, f64::max)
    }
}

/// The corners of the convex hull of some points, counterclockwise (Andrew's monotone chain).
fn hull(points: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
    let mut points: Vec<_> = points.collect();
    points.sort_by(|one, other| one[0].total_cmp(&other[0]).then(one[1].total_cmp(&other[1])));
    let turns_left = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 1e-12
    };
    let half = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut corners: Vec<[f64; 2]> = Vec::new();
        for point in points {
            while let [.., a, b] = corners.as_slice()
                && !turns_left(*a, *b, point)
            {
                corners.pop();
            }
            corners.push(point);
        }
        corners.pop();
        corners
    };
    let mut corners = half(&mut points.iter().copied());
    corners.extend(half(&mut points.iter().rev().copied()));
    corners
}

/// One of the paths.
struct Path<'a> {
    name: &'static str,
    class: &'static str,
    x: &'a [f64],
    y: &'a [f64],
}

/// The rectangle of the floor that is shown, m.
pub(super) struct Floor {
    x: Span,
    y: Span,
}

/// Where a platform is drawn, m and rad.
#[derive(Clone, Copy, Debug)]
struct Pose {
    x: f64,
    y: f64,
    heading: f64,
}

impl Floor {
    /// A place on the floor in units of the drawing.
    pub(super) fn place(&self, x: f64, y: f64) -> (f64, f64) {
        (WIDTH * self.x.part(x), HEIGHT * (1.0 - self.y.part(y)))
    }

    /// The floor that holds all paths, platforms and places of a room; `None` where there is no finite point.
    fn around(paths: &[Path<'_>], platforms: &[Pose], reach: f64, room: Option<&Room>) -> Option<Floor> {
        let axis = |values: &mut dyn Iterator<Item = f64>| Span::of(values);
        let mut x = axis(&mut paths.iter().flat_map(|path| path.x.iter().copied()))?;
        let mut y = axis(&mut paths.iter().flat_map(|path| path.y.iter().copied()))?;
        for Pose { x: px, y: py, .. } in platforms {
            x = x.including(px - reach).including(px + reach);
            y = y.including(py - reach).including(py + reach);
        }
        for [px, py] in room.into_iter().flat_map(Room::places) {
            (x, y) = (x.including(px), y.including(py));
        }
        // A straight path is given some floor beside it, and a single point too.
        let least = 0.3 * x.width().max(y.width()).max(1e-6);
        let widened = |span: Span| {
            let missing = 0.5 * (least - span.width()).max(0.0) + 0.03 * span.width().max(least);
            Span { low: span.low - missing, high: span.high + missing }
        };
        Some(Floor { x: widened(x), y: widened(y) })
    }

    /// Words on the left of a platform's middle, beside its arrow.
    fn label(&self, labels: &mut String, shape: &Shape, pose: Pose, words: &str) {
        let Pose { x, y, heading } = pose;
        let (sin, cos) = heading.sin_cos();
        let (forward, left) = (-0.1 * shape.reach(), 0.33 * shape.reach());
        let x = 100.0 * self.x.part(x + cos * forward - sin * left);
        let y = 100.0 - 100.0 * self.y.part(y + sin * forward + cos * left);
        let _ = write!(
            labels,
            "<text class=\"at\" x=\"{x:.1}%\" y=\"{y:.1}%\" dy=\"0.35em\" text-anchor=\"middle\">{words}</text>"
        );
    }

    fn figure(&self, title: &str, legend: String, inner: String, labels: String) -> String {
        let ratio = self.x.width() / self.y.width();
        let step = |span: Span, longest: f64| ((7.0 * span.width() / longest).round() as usize).max(2);
        let longest = self.x.width().max(self.y.width());
        let axes = Axes {
            x: self.x.ticks(step(self.x, longest)),
            x_span: self.x,
            x_title: "x in m",
            y: self.y.ticks(step(self.y, longest)),
            y_span: self.y,
            y_title: "y in m",
        };
        let style = format!("--ratio:{ratio:.4}");
        chart::figure(&Figure { title, class: "chart plan", style: &style, legend, axes, inner, labels })
    }

    fn path_data(&self, path: &Path<'_>) -> String {
        // Finer than a pixel of a large drawing.
        let mut tolerance = self.x.width().max(self.y.width()) / 2500.0;
        let mut stretches = curve::simplified(path.x, path.y, tolerance);
        while stretches.iter().map(Vec::len).sum::<usize>() > MOST_POINTS && tolerance < self.x.width() {
            tolerance *= 2.0;
            stretches = stretches.iter().map(|stretch| curve::thinned(stretch, 0.5 * tolerance)).collect();
        }
        chart::path(&stretches, self.x, self.y)
    }
}

/// The path from above; `None` where no pose was recorded.
pub(super) fn html(tracking: &Tracking, times: &[f64], shape: &Shape, room: &Room) -> Option<String> {
    let paths: Vec<Path<'_>> = paths(tracking);
    let shown = tracking.truth.as_ref().or(tracking.believed.as_ref()).or(tracking.planned.as_ref())?;
    let rows = platforms(shown, shape.reach());
    let pose = |&row: &usize| Pose { x: shown.x[row], y: shown.y[row], heading: shown.heading[row] };
    let poses: Vec<Pose> = rows.iter().map(pose).collect();
    let floor = Floor::around(&paths, &poses, shape.reach(), Some(room))?;
    let (mut inner, mut labels, mut legend) = (String::new(), String::new(), String::new());
    room.draw(&floor, &mut inner, &mut legend);
    for pose in &poses {
        draw_platform(&mut inner, &floor, shape, *pose);
    }
    for path in &paths {
        let _ = write!(inner, "<path class=\"{}\" d=\"{}\"/>", path.class, floor.path_data(path));
        legend.push_str(&chart::key(path.class, "line", path.name));
    }
    let finite: Vec<usize> = (0..shown.x.len()).filter(|&row| is_finite(shown, row)).collect();
    for (row, class, sort) in [(finite.first(), "start", "mark"), (finite.last(), "end", "square")] {
        let Some(&row) = row else { continue };
        let (x, y) = floor.place(shown.x[row], shown.y[row]);
        // A line of hardly any length with wide ends is a mark that isn't stretched with the drawing.
        let _ = write!(inner, "<path class=\"dot {class}\" d=\"M{x:.0} {y:.0}h.1\"/>");
        legend.push_str(&chart::key(&format!("mark-{class}"), sort, class));
    }
    if !shape.footprint.is_empty() {
        let whose = if tracking.truth.is_some() { "as it truly was" } else { "as believed" };
        legend.push_str(&chart::key("platform", "area", &format!("platform at times, {whose}")));
        for (&row, pose) in rows.iter().zip(&poses) {
            let time = times.get(row).copied().unwrap_or(f64::NAN);
            floor.label(&mut labels, shape, *pose, &format!("{} s", text::fixed(time, 1)));
        }
    }
    let path = floor.figure("Path from above", legend, inner, labels);
    let errors = magnified(tracking, &floor).unwrap_or_default();
    Some(format!("<div class=\"plans\">{path}{errors}</div>"))
}

fn paths(tracking: &Tracking) -> Vec<Path<'_>> {
    let named = [
        ("planned", "planned", &tracking.planned),
        // What is believed lies above what is true: where both agree, both are seen, for it is thinner.
        ("true", "true", &tracking.truth),
        ("believed", "believed", &tracking.believed),
    ];
    let paths = named.into_iter().filter_map(|(name, class, poses)| {
        poses.as_ref().map(|poses| Path { name, class, x: &poses.x, y: &poses.y })
    });
    paths.collect()
}

fn is_finite(poses: &Poses, row: usize) -> bool {
    poses.x[row].is_finite() && poses.y[row].is_finite() && poses.heading[row].is_finite()
}

/// The rows in which the platform is drawn: the first, the last, and others where it stands apart from all of them.
fn platforms(poses: &Poses, reach: f64) -> Vec<usize> {
    let way = |one: usize, other: usize| (poses.x[one] - poses.x[other]).hypot(poses.y[one] - poses.y[other]);
    // A tenth of the distance that counts: a few hundred rows for each round, however long the run is.
    let mut candidates: Vec<usize> = Vec::new();
    for row in (0..poses.x.len()).filter(|&row| is_finite(poses, row)) {
        if candidates.last().is_none_or(|&last| way(row, last) >= 0.15 * reach.max(1e-3)) {
            candidates.push(row);
        }
    }
    let last = (0..poses.x.len()).rev().find(|&row| is_finite(poses, row));
    let mut apart = reach.max(1e-9);
    loop {
        let mut rows: Vec<usize> = Vec::new();
        for row in candidates.iter().copied().take(1).chain(last).chain(candidates.iter().copied().skip(1)) {
            // The end is shown even on a short way: it says what became of the platform.
            let apart = if Some(row) == last { 0.3 * apart } else { apart };
            if rows.iter().all(|&other| way(row, other) >= apart) {
                rows.push(row);
            }
        }
        if rows.len() <= MOST_PLATFORMS {
            rows.sort_unstable();
            return rows;
        }
        apart *= 1.1;
    }
}

fn draw_platform(inner: &mut String, floor: &Floor, shape: &Shape, pose: Pose) {
    let Pose { x, y, heading } = pose;
    let (sin, cos) = heading.sin_cos();
    let outline = |corners: &[[f64; 2]]| {
        let mut data = String::new();
        for (number, [cx, cy]) in corners.iter().enumerate() {
            let (px, py) = floor.place(x + cos * cx - sin * cy, y + sin * cx + cos * cy);
            let _ = write!(data, "{}{px:.1} {py:.1}", ["M", "L"][number.min(1)]);
        }
        data
    };
    if shape.footprint.is_empty() {
        return;
    }
    let _ = write!(inner, "<path class=\"platform\" d=\"{}Z\"/>", outline(&shape.footprint));
    for &[wx, wy, rolling, radius] in &shape.wheels {
        let (along, across) = ([rolling.cos(), rolling.sin()], [-rolling.sin(), rolling.cos()]);
        let corner = |a: f64, b: f64| {
            [0, 1].map(|axis| [wx, wy][axis] + radius * (a * along[axis] + 0.35 * b * across[axis]))
        };
        let corners = [corner(1.0, 1.0), corner(-1.0, 1.0), corner(-1.0, -1.0), corner(1.0, -1.0)];
        let _ = write!(inner, "<path class=\"wheel\" d=\"{}Z\"/>", outline(&corners));
    }
    // An arrow from the middle forward.
    let tip = 0.6 * shape.reach();
    let arrow = [[0.0, 0.0], [tip, 0.0], [0.72 * tip, 0.16 * tip], [tip, 0.0], [0.72 * tip, -0.16 * tip]];
    let _ = write!(inner, "<path class=\"heading\" d=\"{}\"/>", outline(&arrow));
}

/// The same paths with the errors drawn larger than they are, where they would hardly be seen.
fn magnified(tracking: &Tracking, floor: &Floor) -> Option<String> {
    let planned = tracking.planned.as_ref()?;
    let errors = [("believed", &tracking.believed_error), ("true", &tracking.true_error)];
    let greatest = errors.iter().filter_map(|(_, error)| {
        let error = error.as_ref()?;
        Span::of(error.distance.iter().copied()).map(|span| span.high)
    });
    let greatest = greatest.fold(0.0, f64::max);
    let wished = 0.06 * floor.x.width().max(floor.y.width()) / greatest;
    if !wished.is_finite() || wished < 2.0 {
        return None;
    }
    // Beyond a million there is nothing but rounding.
    let power = 10f64.powf(wished.log10().floor());
    let times = (power * [5.0, 2.0, 1.0].into_iter().find(|m| m * power <= wished).unwrap_or(1.0)).min(1e6);
    let larger = |wished: &[f64], actual: &[f64]| -> Vec<f64> {
        wished.iter().zip(actual).map(|(planned, actual)| planned + times * (actual - planned)).collect()
    };
    let scaled = |poses: &Option<Poses>| {
        let poses = poses.as_ref()?;
        Some((larger(&planned.x, &poses.x), larger(&planned.y, &poses.y)))
    };
    let (believed, truth) = (scaled(&tracking.believed), scaled(&tracking.truth));
    let mut paths = vec![Path { name: "planned", class: "planned", x: &planned.x, y: &planned.y }];
    for (name, scaled) in [("true", &truth), ("believed", &believed)] {
        paths.extend(scaled.as_ref().map(|(x, y)| Path { name, class: name, x, y }));
    }
    let floor = Floor::around(&paths, &[], 0.0, None)?;
    let (mut inner, mut legend) = (String::new(), String::new());
    for path in &paths {
        let _ = write!(inner, "<path class=\"{}\" d=\"{}\"/>", path.class, floor.path_data(path));
        legend.push_str(&chart::key(path.class, "line", path.name));
    }
    let unit = Unit::length(greatest);
    let title = format!(
        "Errors {} times as large (the greatest is {} {})",
        text::count(times as u64),
        text::significant(greatest * unit.factor),
        unit.name
    );
    Some(floor.figure(&title, legend, inner, String::new()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hull_of_a_square_with_points_inside_is_the_square() {
        let points = [[0.0, 0.0], [1.0, 0.0], [0.5, 0.5], [1.0, 1.0], [0.0, 1.0], [0.5, 0.0]];
        assert_eq!(hull(points.into_iter()), [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        assert!(hull(std::iter::empty()).is_empty());
    }

    #[test]
    fn platforms_stand_apart_and_are_few() {
        let turn: Vec<f64> = (0..20_000).map(|n| f64::from(n) * 1e-3).collect();
        let poses = Poses {
            x: turn.iter().map(|angle| angle.cos()).collect(),
            y: turn.iter().map(|angle| angle.sin()).collect(),
            heading: vec![0.0; turn.len()],
        };
        let rows = platforms(&poses, 0.3);
        assert!((2..=MOST_PLATFORMS).contains(&rows.len()), "{rows:?}");
        for (number, &one) in rows.iter().enumerate() {
            for &other in &rows[..number] {
                let apart = (poses.x[one] - poses.x[other]).hypot(poses.y[one] - poses.y[other]);
                assert!(apart >= 0.45, "{one} and {other}: {apart} m");
            }
        }
    }
}
