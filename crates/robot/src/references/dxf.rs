//! The polyline of a DXF file: pairs of lines, a group code and its value (Autodesk, *DXF Reference*, "Group Codes").

use std::collections::BTreeMap;
use std::fmt::Write;

use super::curves::Drawing;

/// What one unit is by `$INSUNITS`, m.
const UNITS_M: [(&str, f64); 10] = [
    ("1", 0.0254),
    ("2", 0.3048),
    ("3", 1609.344),
    ("4", 1e-3),
    ("5", 1e-2),
    ("6", 1.0),
    ("7", 1e3),
    ("10", 0.9144),
    ("13", 1e-6),
    ("14", 0.1),
];

/// Flags of a polyline: it is closed; it is a mesh of any kind. Of a vertex: it only draws a spline.
const CLOSED: u32 = 1;
const MESH: u32 = 16 | 64;
const FRAME_OF_SPLINE: u32 = 16;

/// A group code and its value, with the line of the value.
struct Group<'a> {
    code: i32,
    value: &'a str,
    line: usize,
}

impl Group<'_> {
    fn number<T: std::str::FromStr>(&self) -> Result<T, String> {
        let Group { code, value, line } = self;
        value
            .parse()
            .map_err(|_| format!("line {line}: expected a number for group code {code}, found \"{value}\""))
    }

    fn length(&self) -> Result<f64, String> {
        let found: f64 = self.number()?;
        let Group { value, line, .. } = self;
        if found.is_finite() { Ok(found) } else { Err(format!("line {line}: {value} is no finite number")) }
    }
}

#[derive(Clone, Copy, Default)]
struct Vertex {
    x: f64,
    y: f64,
    /// The tangent of a quarter of the angle of the arc to the next vertex, to the left; 0: straight.
    bulge: f64,
    flags: u32,
}

#[derive(Default)]
struct Polyline {
    layer: String,
    flags: u32,
    vertices: Vec<Vertex>,
    /// It lies on the side of a layout, not in the drawing; it is seen from below.
    is_on_paper: bool,
    is_mirrored: bool,
}

/// The one polyline among a file's entities, as path data of SVG, and the file's unit where it says one.
pub(super) fn read(text: &str) -> Result<Drawing, String> {
    let mut section = "";
    let (mut variable, mut unit_m) = ("", None);
    let mut polylines: Vec<Polyline> = Vec::new();
    let mut others: BTreeMap<&str, usize> = BTreeMap::new();
    let mut entity = "";
    let mut before = (0, "");
    for group in groups(text) {
        let group = group?;
        match (section, group.code) {
            (_, 2) if before == (0, "SECTION") => section = group.value,
            (_, 0) if group.value == "ENDSEC" => section = "",
            ("HEADER", 9) => variable = group.value,
            ("HEADER", 70) if variable == "$INSUNITS" => {
                unit_m = UNITS_M.iter().find(|(number, _)| *number == group.value).map(|(_, unit_m)| *unit_m);
            }
            ("ENTITIES", 0) => {
                entity = group.value;
                match entity {
                    "LWPOLYLINE" | "POLYLINE" => polylines.push(Polyline::default()),
                    "VERTEX" => {
                        polylines
                            .last_mut()
                            .into_iter()
                            .for_each(|last| last.vertices.push(Vertex::default()));
                    }
                    "SEQEND" => {}
                    other => *others.entry(other).or_default() += 1,
                }
            }
            ("ENTITIES", _) if matches!(entity, "LWPOLYLINE" | "POLYLINE" | "VERTEX") => {
                if let Some(polyline) = polylines.last_mut() {
                    polyline.take(entity, &group)?;
                }
            }
            _ => {}
        }
        before = (group.code, group.value);
    }
    polylines.retain(|polyline| !polyline.is_on_paper && polyline.flags & MESH == 0);
    match &polylines[..] {
        [polyline] => Ok(Drawing { data: polyline.data()?, unit_m }),
        [] if others.is_empty() => Err("no entities of DXF in it, expected a polyline".into()),
        [] => {
            let others: Vec<String> = others.iter().map(|(name, count)| format!("{count} {name}")).collect();
            Err(format!(
                "no polyline among its entities ({}): expected 1, join them to one",
                others.join(", ")
            ))
        }
        more => {
            let layers: Vec<&str> = more.iter().map(|polyline| polyline.layer.as_str()).collect();
            Err(format!("{} polylines, on layers {}: expected 1", more.len(), layers.join(", ")))
        }
    }
}

/// The pairs of a file.
fn groups(text: &str) -> impl Iterator<Item = Result<Group<'_>, String>> {
    let mut lines = text.trim_start_matches('\u{feff}').lines().zip(1..);
    std::iter::from_fn(move || {
        let (code, line) = lines.next()?;
        let value = lines.next();
        let (Ok(code), Some((value, line))) = (code.trim().parse(), value) else {
            let found = code.trim();
            // Empty lines at the end are none of a pair.
            return (!found.is_empty() || value.is_some()).then(|| {
                Err(format!("line {line}: expected a group code of DXF and its value, found \"{found}\""))
            });
        };
        Some(Ok(Group { code, value: value.trim(), line }))
    })
}

impl Polyline {
    /// Takes a group of the polyline's own entity or of one of its vertices'.
    fn take(&mut self, entity: &str, group: &Group<'_>) -> Result<(), String> {
        match (entity, group.code) {
            ("LWPOLYLINE", 10) => self.vertices.push(Vertex { x: group.length()?, ..Vertex::default() }),
            ("LWPOLYLINE" | "VERTEX", 10 | 20 | 42 | 70) if entity == "VERTEX" || group.code != 70 => {
                let Some(vertex) = self.vertices.last_mut() else { return Ok(()) };
                match group.code {
                    10 => vertex.x = group.length()?,
                    20 => vertex.y = group.length()?,
                    42 => vertex.bulge = group.length()?,
                    _ => vertex.flags = group.number()?,
                }
            }
            ("LWPOLYLINE" | "POLYLINE", 70) => self.flags = group.number()?,
            ("LWPOLYLINE" | "POLYLINE", 8) => group.value.clone_into(&mut self.layer),
            ("LWPOLYLINE" | "POLYLINE", 67) => self.is_on_paper = group.value != "0",
            ("LWPOLYLINE" | "POLYLINE", 230) => self.is_mirrored = group.length()? < 0.0,
            _ => {}
        }
        Ok(())
    }

    /// As path data of SVG, where y points down.
    fn data(&self) -> Result<String, String> {
        if self.is_mirrored {
            return Err("its polyline is seen from below (an extrusion along −z): draw it from above".into());
        }
        let on_way = |vertex: &&Vertex| vertex.flags & FRAME_OF_SPLINE == 0;
        let mut vertices: Vec<Vertex> = self.vertices.iter().filter(on_way).copied().collect();
        let Some(first) = vertices.first().copied() else {
            return Err("its polyline has no vertices".into());
        };
        if self.flags & CLOSED != 0 {
            vertices.push(first);
        }
        let mut data = format!("M {} {}", first.x, -first.y);
        for pair in vertices.windows(2) {
            let [from, to] = [pair[0], pair[1]];
            let _ = if from.bulge == 0.0 {
                write!(data, " L {} {}", to.x, -to.y)
            } else {
                let size = from.bulge.abs();
                let radius = (to.x - from.x).hypot(to.y - from.y) * (size + 1.0 / size) / 4.0;
                let (is_large, is_clockwise) = (u8::from(size > 1.0), u8::from(from.bulge < 0.0));
                write!(data, " A {radius} {radius} 0 {is_large} {is_clockwise} {} {}", to.x, -to.y)
            };
        }
        Ok(data)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file of pairs, "code value" a line.
    fn file(header: &str, entities: &str) -> String {
        let all = format!(
            "0 SECTION\n2 HEADER\n9 $ACADVER\n1 AC1015\n{header}\n0 ENDSEC\n0 SECTION\n2 ENTITIES\n{entities}\n0 ENDSEC\n0 EOF"
        );
        let pair = |line: &str| line.split_once(' ').map(|(code, value)| format!("{code:>3}\r\n{value}\r\n"));
        all.lines().filter_map(pair).collect()
    }

    const BENT: &str =
        "0 LWPOLYLINE\n8 WAY\n90 3\n70 0\n43 0.0\n10 0.0\n20 0.0\n10 2.0\n20 0.0\n42 1.0\n10 2.0\n20 2.0";

    #[test]
    fn a_polyline_of_either_kind_is_read_with_its_arcs_and_its_unit() {
        let drawn = read(&file("9 $INSUNITS\n70 4", BENT)).unwrap();
        // Half a circle to the left: where y points down it is counter-clockwise still, which SVG says by 0.
        assert_eq!(drawn.data, "M 0 -0 L 2 -0 A 1 1 0 0 0 2 -2");
        assert_eq!(drawn.unit_m, Some(1e-3));
        let old = "0 POLYLINE\n8 WAY\n66 1\n70 1\n10 0\n20 0\n0 VERTEX\n10 1\n20 0\n42 -2.5\n0 VERTEX\n10 1\n20 4\n0 SEQEND\n8 WAY";
        let drawn = read(&file("", old)).unwrap();
        assert_eq!(drawn.data, "M 1 -0 A 2.9 2.9 0 1 1 1 -4 L 1 -0", "closed");
        assert_eq!(drawn.unit_m, None);
        assert_eq!(read(&file("9 $INSUNITS\n70 0", BENT)).unwrap().unit_m, None);
        // What is drawn beside a layout, and another's groups, are none of it.
        let more = format!("0 LWPOLYLINE\n67 1\n10 9\n20 9\n{BENT}\n0 CIRCLE\n10 7\n20 7\n40 1");
        assert_eq!(read(&file("", &more)).unwrap().data, "M 0 -0 L 2 -0 A 1 1 0 0 0 2 -2");
    }

    #[test]
    fn what_is_no_one_polyline_is_refused_with_what_there_is() {
        let broken = file("", BENT).replacen("2.0", "2,0", 1);
        for (text, expected) in [
            (file("", ""), "no entities of DXF in it, expected a polyline"),
            (
                file("", "0 LINE\n8 0\n10 0\n20 0\n0 LINE\n8 0\n0 ARC\n8 0"),
                "no polyline among its entities (1 ARC, 2 LINE): expected 1, join them to one",
            ),
            (file("", &format!("{BENT}\n{BENT}")), "2 polylines, on layers WAY, WAY: expected 1"),
            (
                file("", &format!("{BENT}\n230 -1.0")),
                "its polyline is seen from below (an extrusion along −z): draw it from above",
            ),
            (broken, "line 30: expected a number for group code 10, found \"2,0\""),
            ("no drawing".into(), "line 1: expected a group code of DXF and its value, found \"no drawing\""),
            (file("", "0 LWPOLYLINE\n8 WAY"), "its polyline has no vertices"),
            (file("", &BENT.replace("42 1.0", "42 inf")), "line 34: inf is no finite number"),
        ] {
            assert_eq!(read(&text).map(|drawn| drawn.data), Err(expected.to_owned()));
        }
    }
}
