//! Ways that are curves: B-splines with weights, and drawings.

use omnibase_trajectory::curve::{self, CurveHeading, Nurbs};
use svgtypes::{SimplePathSegment, SimplifyingPathParser, Transform};

use crate::ability::Ability;
use crate::config::{HeadingName, Problem, ReferenceTable, Timing};
use crate::registry::{Kind, Made, Registry, given, needed, optional};

use super::{AnyTrajectory, CORNER_RAD, SPEEDS, Tracked, correction_keys, dxf, fastest_through};

/// Without a degree a spline bends smoothly.
const CUBIC: u32 = 3;

/// What a turn by one radian counts on the way: so little that a heading whose rate jumps, where a bend begins, is no corner.
pub(super) const TURN_COUNTS_M: f64 = 0.02;

/// Registers them.
pub(super) fn register(registry: &mut Registry) {
    let further = ["heading", "timing", "corner_m", "frame", "obstacles"];
    let keys = |own: &[crate::registry::Key]| {
        let further = further.into_iter().chain(SPEEDS).map(optional).chain(correction_keys());
        own.iter().cloned().chain(further).collect()
    };
    let spline = [needed("controls"), optional("degree"), optional("weights"), optional("knots")];
    let meaning = "A B-spline by its control points, with weights (NURBS), as fast as the limits allow";
    registry.references.add(Kind { name: "nurbs", meaning, keys: keys(&spline) }, |table, ability| {
        tracked(&[spline_of(table)?], table, ability)
    });
    let file = optional("drawing_file").file("drawing", |text, table| {
        let drawing = read_drawing(text)?;
        table.drawing = Some(drawing.data);
        table.unit_m = table.unit_m.or(drawing.unit_m);
        Ok(())
    });
    let drawing = [needed("drawing"), file, needed("unit_m")];
    let meaning = "A drawn way (an SVG path or a DXF polyline), as fast as the limits allow";
    registry.references.add(Kind { name: "drawing", meaning, keys: keys(&drawing) }, |table, ability| {
        let unit_m = given(table.unit_m, "unit_m")?;
        let curves = curves_of(given(table.drawing.as_ref(), "drawing")?, unit_m)
            .map_err(|error| Problem::refused("drawing", error))?;
        tracked(&curves, table, ability)
    });
}

fn spline_of(table: &ReferenceTable) -> Made<Nurbs> {
    let degree = table.degree.unwrap_or(CUBIC) as usize;
    let controls = given(table.controls.as_ref(), "controls")?;
    let made = Nurbs::new(controls, degree, table.weights.as_deref(), table.knots.as_deref());
    Ok(made.map_err(|error| Problem::refused("controls", error))?)
}

/// Curves in the shortest time.
fn tracked(curves: &[Nurbs], table: &ReferenceTable, ability: &Ability) -> Made<Tracked> {
    if matches!(table.timing, Some(Timing::AsGiven | Timing::Stretched)) {
        let reason = "a curve has no times of its own: expected \"fastest\", or leave it out";
        return Err(Problem::refused("timing", reason).into());
    }
    let table = ReferenceTable { timing: Some(Timing::Fastest), ..table.clone() };
    let heading = match table.heading {
        Some(HeadingName::FollowsTangent) => CurveHeading::Tangent,
        Some(HeadingName::Given | HeadingName::Fixed | HeadingName::Free) | None => CurveHeading::Given,
    };
    let mut poses = curve::poses(curves, heading, CORNER_RAD);
    if table.heading == Some(HeadingName::Fixed) {
        let first_rad = poses[0].heading_rad;
        poses.iter_mut().for_each(|pose| pose.heading_rad = first_rad);
    }
    let trajectory: AnyTrajectory = fastest_through(&poses, TURN_COUNTS_M, &table, ability)?;
    Tracked::new(trajectory, &table, ability)
}

/// The curves of path data as SVG has them; there y points down, here to the left.
fn curves_of(data: &str, unit_m: f64) -> Result<Vec<Nurbs>, String> {
    let mut curves = Vec::new();
    let point = |x: f64, y: f64| [x * unit_m, -y * unit_m, 0.0];
    let (mut here, mut first) = ([0.0; 3], [0.0; 3]);
    for segment in SimplifyingPathParser::from(data) {
        let further = match segment.map_err(|error| error.to_string())? {
            SimplePathSegment::MoveTo { x, y } => {
                if !curves.is_empty() {
                    return Err("it is drawn in more than one go: a way can't be interrupted".into());
                }
                (here, first) = (point(x, y), point(x, y));
                continue;
            }
            SimplePathSegment::LineTo { x, y } => vec![point(x, y)],
            SimplePathSegment::Quadratic { x1, y1, x, y } => vec![point(x1, y1), point(x, y)],
            SimplePathSegment::CurveTo { x1, y1, x2, y2, x, y } => {
                vec![point(x1, y1), point(x2, y2), point(x, y)]
            }
            SimplePathSegment::ClosePath => vec![first],
        };
        let degree = further.len();
        let controls: Vec<[f64; 3]> = std::iter::once(here).chain(further).collect();
        here = controls[degree];
        if controls.iter().any(|control| *control != here) {
            curves.push(Nurbs::new(&controls, degree, None, None).map_err(|error| error.to_string())?);
        }
    }
    if curves.is_empty() { Err("nothing is drawn in it".into()) } else { Ok(curves) }
}

/// A drawn way.
#[derive(Debug)]
pub(super) struct Drawing {
    /// Path data as SVG has them.
    pub(super) data: String,
    /// What one unit of it is, m, where its file says so.
    pub(super) unit_m: Option<f64>,
}

/// The one way in a file: an SVG file's path, or a DXF file's polyline.
fn read_drawing(text: &str) -> Result<Drawing, String> {
    if text.trim_start_matches('\u{feff}').trim_start().starts_with('<') {
        Ok(Drawing { data: read_svg(text)?, unit_m: None })
    } else {
        dxf::read(text)
    }
}

/// The data of the one path in an SVG file, with the transformations that it stands in.
fn read_svg(text: &str) -> Result<String, String> {
    let document = roxmltree::Document::parse(text).map_err(|error| error.to_string())?;
    let paths: Vec<_> = document.descendants().filter(|node| node.has_tag_name((SVG, "path"))).collect();
    let [path] = paths[..] else {
        return Err(format!("{} elements `path` of SVG, expected 1", paths.len()));
    };
    let data = path.attribute("d").ok_or("its `path` has no `d`")?;
    let mut whole = Transform::new(1.0, 0.0, 0.0, 1.0, 0.0, 0.0);
    for node in path.ancestors() {
        let Some(text) = node.attribute("transform") else { continue };
        let outer: Transform = text.parse().map_err(|error| format!("transform=\"{text}\": {error}"))?;
        whole = after(&outer, &whole);
    }
    transformed(data, &whole)
}

const SVG: &str = "http://www.w3.org/2000/svg";

/// One transformation and then another one.
fn after(then: &Transform, first: &Transform) -> Transform {
    let linear = |x: f64, y: f64| (then.a * x + then.c * y, then.b * x + then.d * y);
    let ((a, b), (c, d), (e, f)) =
        (linear(first.a, first.b), linear(first.c, first.d), linear(first.e, first.f));
    Transform::new(a, b, c, d, e + then.e, f + then.f)
}

/// Path data moved by a transformation, of lines and Bézier curves alone.
fn transformed(data: &str, by: &Transform) -> Result<String, String> {
    let point = |x: f64, y: f64| format!("{} {}", by.a * x + by.c * y + by.e, by.b * x + by.d * y + by.f);
    let word = |segment| match segment {
        SimplePathSegment::MoveTo { x, y } => format!("M {}", point(x, y)),
        SimplePathSegment::LineTo { x, y } => format!("L {}", point(x, y)),
        SimplePathSegment::Quadratic { x1, y1, x, y } => format!("Q {} {}", point(x1, y1), point(x, y)),
        SimplePathSegment::CurveTo { x1, y1, x2, y2, x, y } => {
            format!("C {} {} {}", point(x1, y1), point(x2, y2), point(x, y))
        }
        SimplePathSegment::ClosePath => "Z".to_owned(),
    };
    let words: Result<Vec<String>, _> =
        SimplifyingPathParser::from(data).map(|segment| segment.map(word)).collect();
    Ok(words.map_err(|error| format!("`d` of its path: {error}"))?.join(" "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Limits, Source};

    fn made(lines: &str) -> Result<Box<dyn crate::stages::Reference>, String> {
        let table = Source::<ReferenceTable>::read_reference(lines, "").file;
        let limits = Limits {
            speed_m_s: 1.0,
            acceleration_m_s2: 1.5,
            jerk_m_s3: 40.0,
            turn_speed_rad_s: 1.5,
            turn_acceleration_rad_s2: 3.0,
            turn_jerk_rad_s3: 80.0,
            wheel_speed_rad_s: 20.0,
            wheel_torque_nm: 20.0,
        };
        let made = Registry::with_built_in().make_reference(&table, &Ability::from(&limits));
        made.map_err(|error| error.to_string())
    }

    /// Where a motion ends, from the origin.
    fn end(lines: &str) -> [f64; 3] {
        let mut reference = made(lines).unwrap();
        reference.start(&crate::signals::Setpoint::default());
        let duration_s = reference.duration_s().unwrap();
        let pose = reference.sample(duration_s).odom_from_body;
        [pose.x_m, pose.y_m, pose.heading_rad]
    }

    /// The least speed between a tenth and nine tenths of the time.
    fn least_speed_m_s(lines: &str) -> f64 {
        let mut reference = made(lines).unwrap();
        reference.start(&crate::signals::Setpoint::default());
        let duration_s = reference.duration_s().unwrap();
        let speed = |at: u32| reference.sample(duration_s * f64::from(at) / 1000.0).twist_in_odom.speed_m_s();
        (100..=900).map(speed).fold(f64::INFINITY, f64::min)
    }

    fn is_near(found: [f64; 3], expected: [f64; 3]) {
        assert!(
            found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6),
            "{found:?}, expected {expected:?}"
        );
    }

    #[test]
    fn a_spline_is_driven_with_the_heading_that_is_asked_for() {
        let spline = "kind = \"nurbs\"\ncontrols = [[0, 0, 0], [1, 0, 0.2], [1, 1, 0.3], [0, 1, 0.5]]\n";
        is_near(end(spline), [0.0, 1.0, 0.5]);
        is_near(end(&format!("{spline}heading = \"fixed\"")), [0.0, 1.0, 0.0]);
        is_near(end(&format!("{spline}heading = \"follows_tangent\"")), [0.0, 1.0, std::f64::consts::PI]);
        let stranger = made(&format!("{spline}degree = 4")).err().unwrap();
        assert!(stranger.contains("degree is 4, expected from 1 to 3"), "{stranger}");
        let late = made(&format!("{spline}timing = \"stretched\"")).err().unwrap();
        assert!(late.contains("a curve has no times of its own"), "{late}");
    }

    #[test]
    fn a_spline_that_turns_on_the_spot_is_driven_as_it_is_given() {
        let spline = |controls: &str, degree: u32| {
            format!("kind = \"nurbs\"\ncontrols = {controls}\ndegree = {degree}\n")
        };
        let to_and_fro = spline("[[1, 2, 0], [1, 2, 2], [1, 2, 0.5]]", 2);
        is_near(end(&to_and_fro), [0.0, 0.0, 0.5]);
        is_near(end(&spline("[[0, 0, 0], [0, 0, 1], [0, 0, 8]]", 1)), [0.0, 0.0, 8.0]);
        // It turns back at 4/7 of its parameter, at 8/7 rad.
        let mut reference = made(&to_and_fro).unwrap();
        reference.start(&crate::signals::Setpoint::default());
        let duration_s = reference.duration_s().unwrap();
        let headings_rad = (0..=1000)
            .map(|at| reference.sample(duration_s * f64::from(at) / 1000.0).odom_from_body.heading_rad);
        let most_rad = headings_rad.fold(0.0, f64::max);
        assert!((most_rad - 8.0 / 7.0).abs() < 1e-5, "{most_rad} rad");
        for heading in ["fixed", "follows_tangent"] {
            let said = made(&format!("{to_and_fro}heading = \"{heading}\"")).err().unwrap();
            assert!(said.contains("all of them are the same pose"), "{heading}: {said}");
        }
    }

    fn duration_s(lines: &str) -> f64 {
        made(lines).unwrap().duration_s().unwrap()
    }

    #[test]
    fn a_free_heading_is_never_slower_and_ends_as_given() {
        let fastest = "timing = \"fastest\"\n";
        let points =
            "kind = \"path\"\npoints = [[0, 0, 0, 0], [1, 1, 0, 3], [2, 1, 1, -2], [3, 0, 1, 1.5]]\n";
        let places =
            "kind = \"path\"\npoints = [[0, 0, 0, 0], [1, 1, 0, 0], [2, 1.9, 0.3, 0], [3, 2.5, 1, 0]]\n";
        for (motion, given_rad) in [
            (format!("{points}{fastest}"), 1.5),
            (format!("{points}{fastest}corner_m = 0.05\n"), 1.5),
            (format!("{places}{fastest}"), 0.0),
            (format!("kind = \"holonomic\"\nradius_m = 0.4\n{fastest}"), 0.0),
            ("kind = \"nurbs\"\ncontrols = [[0, 0, 0], [1, 0, 2.2], [1, 1, 0.3], [0, 1, 0.5]]\n".into(), 0.5),
            ("kind = \"drawing\"\nunit_m = 0.01\ndrawing = \"m 10 20 h 100 v 50\"\n".into(), 0.0),
        ] {
            let free = format!("{motion}heading = \"free\"\n");
            let [free_s, own_s] = [&free, &motion].map(|lines| duration_s(lines));
            assert!(free_s <= own_s, "{free_s} s, {own_s} s as given: {motion}");
            let [x, y, heading_rad] = end(&free);
            let own = end(&motion);
            is_near(
                [x, y, omnibase_platform::wrap_angle_rad(heading_rad - given_rad)],
                [own[0], own[1], 0.0],
            );
        }
        // Points that turn to and fro, and a circle that turns once, are slowed by that.
        let gained = |motion: &str| {
            1.0 - duration_s(&format!("{motion}{fastest}heading = \"free\""))
                / duration_s(&format!("{motion}{fastest}"))
        };
        assert!(gained(points) > 0.05, "{}", gained(points));
        let circle = "kind = \"holonomic\"\nradius_m = 0.4\n";
        assert!(gained(circle) > 0.05, "{}", gained(circle));
        for (lines, expected) in [
            (format!("{points}heading = \"free\""), "it needs `timing = \"fastest\"`"),
            (format!("{points}heading = \"follows_tangent\""), "it needs `timing = \"fastest\"`"),
            ("kind = \"circle\"\nradius_m = 1\nheading = \"free\"".into(), "it needs `timing = \"fastest\"`"),
        ] {
            let said = made(&lines).err().unwrap();
            assert!(said.contains(expected), "{said}");
        }
    }

    #[test]
    fn ends_are_passed_with_the_speed_that_is_asked_for() {
        let speeds = "start_speed_m_s = 0.3\nend_speed_m_s = 0.4\n";
        let points = "kind = \"path\"\npoints = [[0, 0, 0, 0], [1, 1, 0.1, 0.3], [2, 1.9, 0.4, 0.5]]\n";
        for motion in [
            format!("{points}timing = \"fastest\"\n"),
            format!("{points}timing = \"fastest\"\nheading = \"free\"\n"),
            format!("{points}timing = \"fastest\"\nheading = \"follows_tangent\"\n"),
            "kind = \"holonomic\"\nradius_m = 0.6\nturns = 0.6\ntiming = \"fastest\"\n".into(),
            "kind = \"nurbs\"\ncontrols = [[0, 0, 0], [1, 0, 0.2], [1, 1, 0.3]]\ndegree = 2\n".into(),
            "kind = \"drawing\"\nunit_m = 0.01\ndrawing = \"m 10 20 h 100 v 50\"\n".into(),
        ] {
            let mut reference = made(&format!("{motion}{speeds}")).unwrap();
            reference.start(&crate::signals::Setpoint::default());
            let [Some(start_s), Some(end_s)] = reference.passes_s() else { panic!("{motion}") };
            let mut at = |time_s: f64| reference.sample(time_s);
            for (time_s, speed_m_s) in [(start_s, 0.3), (end_s, 0.4)] {
                let found_m_s = at(time_s).twist_in_odom.speed_m_s();
                assert!((found_m_s / speed_m_s - 1.0).abs() < 2e-3, "{found_m_s} at {time_s}: {motion}");
            }
            // From rest to rest, and the way between its ends is the one without runs.
            let [from, to] = [at(start_s), at(end_s)].map(|setpoint| setpoint.odom_from_body);
            let way = from.inverse().then(to);
            let of_way = end(&motion);
            if !motion.contains("free") {
                is_near([way.x_m, way.y_m, way.heading_rad], of_way);
            }
            let duration_s = reference.duration_s().unwrap();
            for time_s in [0.0, duration_s] {
                assert!(reference.sample(time_s).twist_in_odom.speed_m_s() < 1e-6, "{motion}");
            }
        }
        for (lines, expected) in [
            (format!("{points}{speeds}"), "start_speed_m_s: a motion has speeds of its own"),
            (
                "kind = \"circle\"\nradius_m = 1\nend_speed_m_s = 0.2".into(),
                "end_speed_m_s: a motion has speeds of its own",
            ),
            (
                format!("{points}timing = \"fastest\"\nend_speed_m_s = 1.2"),
                "end_speed_m_s: its end can't be passed at 1.2 m/s: the limits leave",
            ),
        ] {
            let said = made(&lines).err().unwrap_or_else(|| panic!("{lines}"));
            assert!(said.contains(expected), "{said}");
        }
    }

    #[test]
    fn points_are_driven_with_the_heading_that_is_asked_for() {
        let points = "kind = \"path\"\ntiming = \"fastest\"\npoints = [[0, 0, 0, 0], [1, 1, 0, 1], [2, 1.9, 0.3, 0], [3, 2.6, 0.9, 0.4]]\n";
        is_near(end(points), [2.6, 0.9, 0.4]);
        let of = |heading: &str| {
            let mut reference = made(&format!("{points}heading = \"{heading}\"")).unwrap();
            reference.start(&crate::signals::Setpoint::default());
            reference
        };
        let mut fixed = of("fixed");
        let mut tangent = of("follows_tangent");
        for part in 1..50 {
            let at = |reference: &mut dyn crate::stages::Reference| {
                reference.sample(reference.duration_s().unwrap() * f64::from(part) / 50.0)
            };
            assert!(at(&mut *fixed).odom_from_body.heading_rad.abs() < 1e-9);
            let setpoint = at(&mut *tangent);
            let twist = setpoint.twist_in_odom;
            let along_rad = twist.vy_m_s.atan2(twist.vx_m_s) - setpoint.odom_from_body.heading_rad;
            assert!(omnibase_platform::wrap_angle_rad(along_rad).abs() < 0.04, "{along_rad} at {part}");
        }
    }

    #[test]
    fn a_drawing_is_driven_in_its_unit_and_turned_up() {
        let drawing =
            "kind = \"drawing\"\nunit_m = 0.01\ndrawing = \"m 10 20 h 100 a 20 20 0 0 1 20 20 v 50\"\n";
        is_near(end(drawing), [1.2, -0.7, 0.0]);
        is_near(
            end(&format!("{drawing}heading = \"follows_tangent\"")),
            [1.2, -0.7, -std::f64::consts::FRAC_PI_2],
        );
        // It doesn't stop where the bend begins, but at a corner.
        let bend = format!("{drawing}heading = \"follows_tangent\"");
        assert!(least_speed_m_s(&bend) > 0.05, "{}", least_speed_m_s(&bend));
        let corner = "kind = \"drawing\"\nunit_m = 0.01\ndrawing = \"m 0 0 h 100 v 100\"\n";
        assert!(least_speed_m_s(&format!("{corner}heading = \"follows_tangent\"")) < 0.02);
        for (data, expected) in [
            ("M 0 0 L 1 x", "Invalid"),
            ("M 0 0 L 1 0 M 2 0 L 3 0", "more than one go"),
            ("M 0 0", "nothing is drawn"),
        ] {
            let said = made(&format!("kind = \"drawing\"\nunit_m = 1\ndrawing = \"{data}\"")).err().unwrap();
            assert!(said.to_lowercase().contains(&expected.to_lowercase()), "{said}");
        }
    }

    #[test]
    fn a_file_is_read_with_its_transformations() {
        let file = |inside: &str| format!("<svg xmlns=\"http://www.w3.org/2000/svg\">{inside}</svg>");
        let moved = "<g transform=\"translate(5 1)\"><path transform=\"scale(2)\" d=\"M1 1h3\"/></g>";
        assert_eq!(read_drawing(&file(moved)).unwrap().data, "M 7 3 L 13 3");
        for (inside, expected) in [
            ("", "0 elements `path` of SVG, expected 1"),
            ("<path d=\"M0 0\"/><path d=\"M0 0\"/>", "2 elements `path` of SVG, expected 1"),
            ("<path/>", "its `path` has no `d`"),
        ] {
            assert_eq!(read_drawing(&file(inside)).unwrap_err(), expected);
        }
        assert!(read_drawing("no drawing").is_err());
    }
}
