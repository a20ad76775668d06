//! The motion that the command line asks for: a file, or one of the registered kinds.

use crate::robot_file::parse_change;
use crate::{WrongUsage, small_file};
use anyhow::{Context, bail};
use clap::builder::PossibleValuesParser;
use clap::{Arg, ArgGroup, ArgMatches, Command};
use omnibase_robot::Registry;
use omnibase_robot::config::{HeadingName, ReferenceTable, Source, Timing, choice_names, nearest};
use omnibase_robot::registry::Kind;
use omnibase_run::robot_text::read_reference;
use serde::Deserialize;
use serde::de::IntoDeserializer;
use std::path::Path;

const GROUP: &str = "motion";

/// The motion, in place of the robot file's own.
#[derive(Clone, Debug, Default)]
pub struct ReferenceChoice {
    /// An option and its value.
    motion: Option<(String, String)>,
    timing: Option<Timing>,
    heading: Option<HeadingName>,
    /// A file with what repeats taught of it.
    correction: Option<String>,
}

impl ReferenceChoice {
    /// The command with an option for each kind that has keys. One whose name is an option already is reached by a file.
    pub fn options(command: Command, registry: &Registry) -> Command {
        let option = |name: &'static str| Arg::new(name).long(name).group(GROUP).help_heading("Motion");
        let command = command
            .group(ArgGroup::new(GROUP).multiple(false))
            .arg(
                option("reference")
                    .value_name("FILE")
                    .help("A reference file: the keys of a robot file's [reference] table"),
            )
            .arg(
                option("path")
                    .value_name("FILE")
                    .help("A file of path points, lines of (t, x, y, heading) in s, m and rad"),
            );
        let taken: Vec<String> =
            command.get_arguments().filter_map(|taken| taken.get_long().map(str::to_owned)).collect();
        let kinds = registry.references.kinds().filter(|kind| !kind.keys.is_empty());
        let shapes = kinds.filter(|kind| !taken.iter().any(|taken| taken == kind.name)).map(|kind| {
            let help = format!("{}; takes {}", kind.meaning, keys(kind));
            option(kind.name).value_name("KEY=VALUE,...").help(help)
        });
        command
            .args(shapes)
            .arg(
                Arg::new("timing")
                    .long("timing")
                    .help_heading("Motion")
                    .value_name("HOW")
                    .value_parser(PossibleValuesParser::new(choice_names::<Timing>()))
                    .requires(GROUP)
                    .help("How fast the motion is gone along: by its own times, by longer ones, or as fast as the limits allow"),
            )
            .arg(
                Arg::new("heading")
                    .long("heading")
                    .help_heading("Motion")
                    .value_name("HOW")
                    .value_parser(PossibleValuesParser::new(choice_names::<HeadingName>()))
                    .requires(GROUP)
                    .help("How the heading goes along: as the motion has it, as it is at the start, along the way, or as is fastest between its first and last one"),
            )
    }

    /// The command with an option for what repeats taught of the motion.
    pub fn with_correction(command: Command) -> Command {
        command.arg(
            Arg::new("correction")
                .long("correction")
                .value_name("FILE")
                .requires(GROUP)
                .help_heading("Motion")
                .help("What repeats of this motion taught, as `omnibase learn` writes it"),
        )
    }

    /// What the matched options say.
    pub fn of(matches: &ArgMatches) -> Self {
        let chosen = matches.get_one::<clap::Id>(GROUP).map(clap::Id::as_str);
        let value = |option: &str| Some((option.to_owned(), matches.get_one::<String>(option)?.clone()));
        let correction = matches.try_get_one::<String>("correction").ok().flatten().cloned();
        ReferenceChoice {
            motion: chosen.and_then(value),
            timing: choice(matches, "timing"),
            heading: choice(matches, "heading"),
            correction,
        }
    }

    /// Whether the command line says anything of a motion.
    pub fn is_chosen(&self) -> bool {
        self.motion.is_some()
    }

    /// What was chosen; `None` leaves the robot file's own.
    pub fn chosen(&self, registry: &Registry) -> anyhow::Result<Option<Source<ReferenceTable>>> {
        let Some((option, value)) = &self.motion else { return Ok(None) };
        let absolute = |name: &String| -> std::io::Result<String> {
            Ok(std::path::absolute(name)?.to_string_lossy().into_owned())
        };
        let mut chosen = match option.as_str() {
            "reference" => {
                let text = small_file::text(Path::new(value))?;
                read_reference(&text, value, Path::new(value).parent().unwrap_or(Path::new("")), registry)
            }
            "path" => ReferenceTable::path_of_file(absolute(value)?).into(),
            name => shape(name, value, registry).map_err(WrongUsage)?,
        };
        if let Some(name) = &self.correction {
            chosen.file.correction_file = Some(absolute(name)?);
        }
        chosen.file.timing = self.timing.or(chosen.file.timing);
        chosen.file.heading = self.heading.or(chosen.file.heading);
        Ok(Some(chosen))
    }
}

/// What was chosen by one of the names that a file has for it.
fn choice<'a, T: Deserialize<'a>>(matches: &'a ArgMatches, option: &str) -> Option<T> {
    let name = matches.get_one::<String>(option)?.as_str();
    let name: serde::de::value::StrDeserializer<'_, serde::de::value::Error> = name.into_deserializer();
    T::deserialize(name).ok()
}

/// The keys of a kind.
fn keys(kind: &Kind) -> String {
    kind.keys.iter().map(|key| key.name).collect::<Vec<_>>().join(", ")
}

/// A text at its commas, but for those within brackets or quotes.
fn parts(text: &str) -> Vec<&str> {
    let (mut depth, mut is_quoted) = (0_i32, false);
    let is_between = |character: char| {
        match character {
            '"' => is_quoted = !is_quoted,
            '[' if !is_quoted => depth += 1,
            ']' if !is_quoted => depth -= 1,
            _ => {}
        }
        character == ',' && depth <= 0 && !is_quoted
    };
    text.split(is_between).collect()
}

/// A motion of a kind from `key=value,key=value`: its keys by their names in the file.
fn shape(name: &str, text: &str, registry: &Registry) -> anyhow::Result<Source<ReferenceTable>> {
    let (kind, _) = registry.references.find(Some(name))?;
    let mut lines = format!("kind = {:?}\n", kind.name);
    for part in parts(text).into_iter().filter(|part| !part.trim().is_empty()) {
        let wanted = || format!("`{}`: --{} takes {}", part.trim(), kind.name, keys(kind));
        let (name, value) = part.split_once('=').with_context(wanted)?;
        let (name, value) = (name.trim(), value.trim());
        let key = kind.keys.iter().find(|key| key.name == name).with_context(|| {
            let near = nearest(name, kind.keys.iter().map(|key| key.name));
            let near = near.map_or_else(String::new, |near| format!("; did you mean `{near}`?"));
            format!("{}{near}", wanted())
        })?;
        let change = parse_change(&format!("{}={value}", key.path()));
        lines += &change.map_err(|error| anyhow::anyhow!("{}: {error}", wanted()))?;
        lines.push('\n');
    }
    // Files are named from where the command is given.
    let Source { file, problems, .. } = read_reference(&lines, "", Path::new(""), registry);
    if problems.is_empty() {
        return Ok(file.into());
    }
    let words =
        problems.into_iter().map(|problem| omnibase_robot::Problem { place: None, ..problem }.to_string());
    bail!("--{}: {}", kind.name, words.collect::<Vec<_>>().join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use omnibase_robot::config::{EndlessName, Turns};

    fn read(kind: &str, keys: &str) -> anyhow::Result<ReferenceTable> {
        Ok(shape(kind, keys, &Registry::with_built_in())?.file)
    }

    #[test]
    fn a_drawing_is_named_from_where_the_command_is_given() {
        let table = read("drawing", "drawing_file=way.svg,unit_m=0.02").unwrap();
        let expected = std::path::absolute("way.svg").unwrap();
        assert_eq!(table.drawing_file.as_deref(), expected.to_str());
    }

    #[test]
    fn commas_within_a_value_are_its_own() {
        let nurbs = read("nurbs", "controls=[[0,0,0],[1,0,0],[1,1,0],[0,1,0]],degree=2").unwrap();
        assert_eq!(nurbs.controls.map(|controls| controls.len()), Some(4));
        let drawing = read("drawing", "drawing=\"M0,0h1v1h-1z\",unit_m=1").unwrap();
        assert_eq!(drawing.drawing.as_deref(), Some("M0,0h1v1h-1z"));
    }

    #[test]
    fn shapes_are_read_from_their_keys() {
        let circle = read("circle", "radius_m=0.5, duration_s=10").unwrap();
        assert_eq!((circle.radius_m, circle.duration_s), (Some(0.5), Some(10.0)));
        let endless = read("circle", "radius_m=0.5,period_s=10,turns=endless").unwrap();
        assert_eq!((endless.period_s, endless.turns), (Some(10.0), Some(Turns::Named(EndlessName::Endless))));
        let near = format!("{:#}", read("circle", "radius=0.5").unwrap_err());
        assert!(near.ends_with("did you mean `radius_m`?"), "{near}");
        let keys = "semi_axis_x_m=1,semi_axis_y_m=0.5,turns=2,heading=follows_tangent";
        let ellipse = read("ellipse", keys).unwrap();
        assert_eq!((ellipse.semi_axis_x_m, ellipse.semi_axis_y_m), (Some(1.0), Some(0.5)));
        assert_eq!(
            (ellipse.turns, ellipse.heading),
            (Some(Turns::Count(2.0)), Some(HeadingName::FollowsTangent))
        );
        for wrong in
            ["radius_m", "radius_m=x", "radius_m=-1", "step_m=1", "radius_m=nan", "heading=up", "kind=eight"]
        {
            assert!(read("circle", wrong).is_err(), "{wrong}");
        }
        assert!(read("circle", "radius_m=1,turns=forever").is_err(), "the one name is `endless`");
    }
}
