//! A motion that was planned dry, as a picture: its way over the floor, and its speed over time, in the colours of the limits that bind.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use omnibase_platform::Pose2;
use omnibase_robot::RobotPlan;
use omnibase_robot::dry::{DryRun, Moment, limit_colour, limit_name};
use omnibase_trajectory::fastest::Limit;

const WIDTH: f64 = 900.0;
/// Of the floor.
const FLOOR: [f64; 2] = [900.0, 520.0];
/// Of the speed over time, and from the picture's left edge to it.
const SPEED: [f64; 2] = [800.0, 150.0];
const LEFT: f64 = 80.0;
const MARGIN: f64 = 30.0;
/// Points of a stroke at most this far apart over time are drawn, over the whole.
const DRAWN: usize = 1500;

/// The floor in the picture: metres become its units, y goes up.
struct Floor {
    least: [f64; 2],
    scale: f64,
    top: f64,
}

impl Floor {
    fn around(points: impl Iterator<Item = [f64; 2]>) -> Floor {
        let (mut least, mut most) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for point in points {
            for axis in 0..2 {
                (least[axis], most[axis]) = (least[axis].min(point[axis]), most[axis].max(point[axis]));
            }
        }
        let room = |axis: usize| (FLOOR[axis] - 2.0 * MARGIN) / (most[axis] - least[axis]).max(0.1);
        let scale = room(0).min(room(1));
        Floor { least, scale, top: 50.0 + MARGIN + scale * (most[1] - least[1]) }
    }

    fn at(&self, [x_m, y_m]: [f64; 2]) -> String {
        let x = MARGIN + self.scale * (x_m - self.least[0]);
        format!("{x:.1},{:.1}", self.top - self.scale * (y_m - self.least[1]))
    }

    fn polygon(&self, corners_m: &[[f64; 2]], style: &str) -> String {
        let points: Vec<String> = corners_m.iter().map(|corner| self.at(*corner)).collect();
        format!("<polygon points=\"{}\" {style}/>\n", points.join(" "))
    }
}

/// The footprint at a pose.
fn placed(footprint_m: &[[f64; 2]], pose: &Pose2) -> Vec<[f64; 2]> {
    let (sin, cos) = pose.heading_rad.sin_cos();
    footprint_m.iter().map(|[x, y]| [pose.x_m + cos * x - sin * y, pose.y_m + sin * x + cos * y]).collect()
}

/// Strokes of moments in a row that the same limit binds, each with the first moment of the next one.
fn strokes(moments: &[Moment]) -> Vec<(Option<Limit>, Vec<Moment>)> {
    let every = moments.len().div_ceil(DRAWN).max(1);
    let mut strokes: Vec<(Option<Limit>, Vec<Moment>)> = Vec::new();
    for moment in moments.iter().step_by(every).chain(moments.last()) {
        let binding = moment.binding();
        match strokes.last_mut() {
            Some((limit, stroke)) if *limit == binding => stroke.push(*moment),
            last => {
                if let Some((_, stroke)) = last {
                    stroke.push(*moment);
                }
                strokes.push((binding, vec![*moment]));
            }
        }
    }
    strokes
}

fn line(points: &[String], limit: Option<Limit>) -> String {
    format!(
        "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"3\" stroke-linejoin=\"round\" stroke-linecap=\"round\"/>\n",
        points.join(" "),
        limit_colour(limit)
    )
}

/// The picture of a robot's motion.
pub(in crate::commands) fn svg(plan: &RobotPlan, run: &DryRun) -> String {
    let strokes = strokes(&run.moments);
    let place = |moment: &Moment| [moment.setpoint.odom_from_body.x_m, moment.setpoint.odom_from_body.y_m];
    let ends = [run.moments.first(), run.moments.last()].into_iter().flatten();
    let bodies: Vec<_> =
        ends.map(|moment| placed(&plan.guard.footprint_m, &moment.setpoint.odom_from_body)).collect();
    let fence = plan.guard.fence.as_ref().map(|fence| fence.corners_m.clone()).unwrap_or_default();
    let obstacles = plan.guard.obstacles.iter().flat_map(|obstacle| {
        let ([x, y], r) = (obstacle.centre_m, obstacle.radius_m);
        [[x - r, y - r], [x + r, y + r]]
    });
    let floor = Floor::around(
        run.moments
            .iter()
            .map(place)
            .chain(bodies.iter().flatten().copied())
            .chain(fence.iter().copied())
            .chain(obstacles),
    );
    let top = floor.top + MARGIN + 40.0;
    let height = top + SPEED[1] + 50.0;
    let robot = plan.name.replace('&', "&amp;").replace('<', "&lt;");
    let mut picture = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height:.0}\" width=\"{WIDTH}\" height=\"{height:.0}\" \
         font-family=\"sans-serif\" font-size=\"13\" fill=\"#222\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
         <text x=\"20\" y=\"24\" font-size=\"17\">{robot}: {:.3} m in {:.3} s, needs friction {:.2}</text>\n",
        run.way_m, run.duration_s, run.friction.0
    );
    picture += &legend(run);
    if !fence.is_empty() {
        picture += &floor.polygon(&fence, "fill=\"none\" stroke=\"#c00\" stroke-dasharray=\"7 4\"");
    }
    for obstacle in &plan.guard.obstacles {
        let at = floor.at(obstacle.centre_m);
        let (x, y) = at.split_once(',').unwrap_or_default();
        let _ = writeln!(
            picture,
            "<circle cx=\"{x}\" cy=\"{y}\" r=\"{:.1}\" fill=\"#f3c9c9\" stroke=\"#c00\"/>",
            floor.scale * obstacle.radius_m
        );
    }
    for body in &bodies {
        picture += &floor.polygon(body, "fill=\"#eef2f6\" fill-opacity=\"0.6\" stroke=\"#667\"");
    }
    for (limit, stroke) in &strokes {
        let points: Vec<String> = stroke.iter().map(|moment| floor.at(place(moment))).collect();
        picture += &line(&points, *limit);
    }
    picture += &end_words(run, &floor);
    picture += &speeds(run, &strokes, top);
    picture + "</svg>\n"
}

/// Which end is which; one word where it comes back to its start.
fn end_words(run: &DryRun, floor: &Floor) -> String {
    let Some((start, end)) = run.moments.first().zip(run.moments.last()) else { return String::new() };
    let [start, end] = [start, end].map(|moment| moment.setpoint.odom_from_body);
    let is_closed = start.distance_m(end) < 0.01;
    let words = if is_closed { vec![(start, "start, end")] } else { vec![(start, "start"), (end, "end")] };
    let mut text = String::new();
    for (pose, word) in words {
        let at = floor.at([pose.x_m, pose.y_m]);
        let (x, y) = at.split_once(',').unwrap_or_default();
        let _ = writeln!(
            text,
            "<text x=\"{x}\" y=\"{y}\" dy=\"-8\" text-anchor=\"middle\" font-weight=\"600\" stroke=\"#fff\" stroke-width=\"4\" \
             paint-order=\"stroke\">{word}</text>"
        );
    }
    text
}

fn legend(run: &DryRun) -> String {
    let mut words = String::new();
    let bound = run.asked.iter().filter(|asked| asked.share > 0.0).map(|asked| Some(asked.limit));
    let mut x = 20.0;
    for limit in bound.chain([None]) {
        let text = limit.map_or("none binds", limit_name);
        let _ = writeln!(
            words,
            "<path d=\"M{x} 42h22\" stroke=\"{}\" stroke-width=\"3\"/><text x=\"{}\" y=\"46\">{text}</text>",
            limit_colour(limit),
            x + 27.0
        );
        x += 45.0 + 7.2 * text.chars().count() as f64;
    }
    words
}

/// The speed over time, with its axes.
fn speeds(run: &DryRun, strokes: &[(Option<Limit>, Vec<Moment>)], top: f64) -> String {
    let speed = |moment: &Moment| moment.setpoint.twist_in_odom.speed_m_s();
    let most = run.moments.iter().map(speed).fold(0.1, f64::max);
    let bottom = top + SPEED[1];
    let at = |moment: &Moment| {
        let x = LEFT + SPEED[0] * moment.time_s / run.duration_s.max(f64::MIN_POSITIVE);
        format!("{x:.1},{:.1}", bottom - SPEED[1] * speed(moment) / most)
    };
    let mut picture = format!(
        "<path d=\"M{LEFT} {top:.1}V{bottom:.1}H{:.1}\" fill=\"none\" stroke=\"#889\"/>\n\
         <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{most:.2} m/s</text>\n\
         <text x=\"{:.1}\" y=\"{bottom:.1}\" text-anchor=\"end\">0</text>\n\
         <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{:.2} s</text>\n",
        LEFT + SPEED[0],
        LEFT - 6.0,
        top + 5.0,
        LEFT - 6.0,
        LEFT + SPEED[0],
        bottom + 20.0,
        run.duration_s
    );
    for (limit, stroke) in strokes {
        picture += &line(&stroke.iter().map(at).collect::<Vec<_>>(), *limit);
    }
    picture
}

/// The name of a picture.
pub fn svg_file(text: &str) -> Result<PathBuf, String> {
    let is_svg = Path::new(text).extension().is_some_and(|ending| ending.eq_ignore_ascii_case("svg"));
    is_svg
        .then(|| text.into())
        .ok_or_else(|| format!("it is drawn as SVG: expected a name that ends in .svg, found `{text}`"))
}
