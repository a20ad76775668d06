//! The motion that the command line asks for.

use crate::WrongUsage;
use anyhow::{Context, bail};
use omnibase_robot::config::{HeadingName, ReferenceTable};
use omnibase_run::robot_text::NewReference;
use std::path::{Path, PathBuf};

/// The motion, in place of the robot file's own.
#[derive(Debug, clap::Args)]
#[group(multiple = false)]
pub struct ReferenceChoice {
    /// A reference file: the keys of a robot file's [reference] table.
    #[arg(long, value_name = "FILE")]
    reference: Option<PathBuf>,
    /// A file of path points, lines of (t, x, y, heading) in s, m and rad.
    #[arg(long, value_name = "FILE")]
    path: Option<PathBuf>,
    /// A circle: radius=0.5,period=10 and optionally turns, heading=tangent.
    #[arg(long, value_name = "KEY=VALUE,...")]
    circle: Option<String>,
    /// An ellipse: a=1.0,b=0.5 (semi-axes along x and y) and optionally period, turns, heading.
    #[arg(long, value_name = "KEY=VALUE,...")]
    ellipse: Option<String>,
    /// An Archimedes spiral: step=0.3 (between turns) and optionally period, turns, heading.
    #[arg(long, value_name = "KEY=VALUE,...")]
    spiral: Option<String>,
    /// A lying eight: length=0.8 (from its centre to an end) and optionally period, turns, heading.
    #[arg(long, value_name = "KEY=VALUE,...")]
    eight: Option<String>,
    /// A circle whose heading follows the tangent: radius=0.5 and optionally period, turns.
    #[arg(long, value_name = "KEY=VALUE,...")]
    holonomic: Option<String>,
}

impl ReferenceChoice {
    /// What was chosen; `None` leaves the robot file's own.
    pub fn chosen(&self) -> anyhow::Result<Option<NewReference>> {
        if let Some(path) = &self.reference {
            let text =
                std::fs::read_to_string(path).with_context(|| format!("reading `{}`", path.display()))?;
            let folder = path.parent().unwrap_or(Path::new("")).to_owned();
            return Ok(Some(NewReference::File { name: path.display().to_string(), text, folder }));
        }
        if let Some(path) = &self.path {
            let path = std::path::absolute(path)?;
            let table = ReferenceTable {
                kind: Some("path".to_owned()),
                points_file: Some(path.to_string_lossy().into_owned()),
                ..Default::default()
            };
            return Ok(Some(NewReference::Table(Box::new(table))));
        }
        let shapes = [
            ("circle", &self.circle),
            ("ellipse", &self.ellipse),
            ("spiral", &self.spiral),
            ("eight", &self.eight),
            ("holonomic", &self.holonomic),
        ];
        let chosen = shapes.into_iter().find_map(|(kind, keys)| Some((kind, keys.as_deref()?)));
        chosen.map(|(kind, keys)| Ok(shape(kind, keys).map_err(WrongUsage)?)).transpose()
    }
}

/// A shape from `key=value,key=value`.
fn shape(kind: &str, keys: &str) -> anyhow::Result<NewReference> {
    let mut table = ReferenceTable { kind: Some(kind.to_owned()), ..Default::default() };
    let own: &[&str] = match kind {
        "ellipse" => &["a", "b"],
        "spiral" => &["step"],
        "eight" => &["length"],
        _ => &["radius"],
    };
    let wanted = || format!("--{kind} takes {}, period, turns, heading", own.join(", "));
    for part in keys.split(',').filter(|part| !part.trim().is_empty()) {
        let (key, value) = part.split_once('=').with_context(|| format!("`{part}`: {}", wanted()))?;
        let (key, value) = (key.trim(), value.trim());
        if key == "heading" {
            table.heading = Some(match value {
                "fixed" => HeadingName::Fixed,
                "tangent" => HeadingName::FollowsTangent,
                _ => bail!("--{kind}: heading is `fixed` or `tangent`, not `{value}`"),
            });
            continue;
        }
        let slot = match key {
            "period" => &mut table.duration_s,
            "turns" => &mut table.turns,
            _ if !own.contains(&key) => bail!("`{key}`: {}", wanted()),
            "a" => &mut table.semi_axis_x_m,
            "b" => &mut table.semi_axis_y_m,
            "step" => &mut table.step_m,
            "length" => &mut table.half_length_m,
            _ => &mut table.radius_m,
        };
        let number: f64 = value.parse().with_context(|| format!("--{kind}: {key} = `{value}`"))?;
        if !(number.is_finite() && number > 0.0) {
            bail!("--{kind}: {key} = {value} must be above 0");
        }
        *slot = Some(number);
    }
    Ok(NewReference::Table(Box::new(table)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(kind: &str, keys: &str) -> ReferenceTable {
        match shape(kind, keys).unwrap() {
            NewReference::Table(table) => *table,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn shapes_are_read_from_their_keys() {
        let circle = table("circle", "radius=0.5, period=10");
        assert_eq!((circle.radius_m, circle.duration_s), (Some(0.5), Some(10.0)));
        let ellipse = table("ellipse", "a=1,b=0.5,turns=2,heading=tangent");
        assert_eq!((ellipse.semi_axis_x_m, ellipse.semi_axis_y_m), (Some(1.0), Some(0.5)));
        assert_eq!((ellipse.turns, ellipse.heading), (Some(2.0), Some(HeadingName::FollowsTangent)));
        for wrong in ["radius", "radius=x", "radius=-1", "step=1", "radius=nan", "heading=up"] {
            assert!(shape("circle", wrong).is_err(), "{wrong}");
        }
    }
}
