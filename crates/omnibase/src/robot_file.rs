//! Robot files as commands read them, and their problems as a person reads them.

use crate::{progress, small_file};
use omnibase_robot::{Problem, Registry};
use omnibase_run::{LoadedRobot, RobotText};
use std::path::{Path, PathBuf};

/// What a command is told about a robot file's settings.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct Changes {
    /// Replace a setting of the robot file, as `controller.kind=open_loop`; may be given several times.
    #[arg(long = "set", value_name = "KEY=VALUE", value_parser = parse_change)]
    changes: Vec<String>,
    /// The control law by its name; `omnibase check --kinds` lists them.
    #[arg(long, value_name = "NAME")]
    controller: Option<String>,
    /// Payload of the simulated robot, kg.
    #[arg(long, value_name = "KG")]
    payload_kg: Option<f64>,
    /// File of events for the simulated robot, `[[event]]` each; `omnibase check --kinds` lists their kinds.
    #[arg(long, value_name = "FILE", value_parser = parse_path)]
    events_file: Option<String>,
}

impl Changes {
    /// Whether something is changed that only a simulated robot has.
    pub fn are_for_simulation(&self) -> bool {
        let is_simulations = |line: &String| {
            let key = line.split('=').next().unwrap_or_default().trim();
            key == "simulation" || key.starts_with("simulation.")
        };
        self.lines().iter().any(is_simulations)
    }

    /// As options of a command that takes them, too.
    pub fn as_options(&self) -> Vec<String> {
        self.lines().into_iter().flat_map(|line| ["--set".to_owned(), line]).collect()
    }

    /// As lines of TOML; what has an option of its own comes first, so that `--set` has the last word.
    fn lines(&self) -> Vec<String> {
        let controller = self.controller.iter().map(|name| format!("controller.kind = {name:?}"));
        let payload = self.payload_kg.iter().map(|kg| format!("simulation.payload_kg = {kg:?}"));
        let events = self.events_file.iter().map(|path| format!("simulation.events_file = {path:?}"));
        controller.chain(payload).chain(events).chain(self.changes.iter().cloned()).collect()
    }
}

/// A robot file on its way to a plan.
pub struct RobotSource {
    path: PathBuf,
    /// What is read and checked.
    pub text: RobotText,
}

impl RobotSource {
    /// Reads a robot's file.
    pub fn read(path: &Path, changes: &Changes) -> anyhow::Result<Self> {
        let text = small_file::text(path)?;
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        let text = RobotText { text, folder, changes: changes.lines(), reference: None };
        Ok(RobotSource { path: path.to_owned(), text })
    }

    /// Checks it: the robot, or every problem at once.
    pub fn load(&self, registry: &Registry) -> Result<LoadedRobot, Vec<Problem>> {
        progress::meanwhile("checking the robot and its motion", || self.text.load(registry))
    }

    /// As [`RobotSource::load`], with all problems as one error.
    pub fn load_or_explain(&self, registry: &Registry) -> anyhow::Result<LoadedRobot> {
        self.load(registry).map_err(|problems| {
            let count = problems.len();
            let words: Vec<String> = problems.iter().map(|problem| self.explain(problem)).collect();
            anyhow::anyhow!("{} in {}\n\n{}", plural(count), self.path.display(), words.join("\n"))
        })
    }

    /// A problem with file, line and column, and the line itself.
    pub fn explain(&self, problem: &Problem) -> String {
        let own = self.path.display().to_string();
        let Some(place) = &problem.place else { return format!("{own}: {problem}\n") };
        let file = place.file.as_deref().unwrap_or(&own);
        let line = match &place.file {
            None => self.text.text.lines().nth(place.line - 1),
            // A line of another file is found by its name; the command line's own is not worth repeating.
            Some(_) => None,
        };
        let mut words = format!("{file}:{problem}");
        if let Some(prefix) =
            place.file.as_deref().and_then(|file| problem.to_string().strip_prefix(file).map(str::to_owned))
        {
            words = format!("{file}{prefix}");
        }
        words.push('\n');
        if let Some(line) = line {
            let marked = problem_width(place, line);
            let (number, space) = (place.line, " ".repeat(place.line.to_string().len()));
            let indent: String =
                line.chars().take(place.column - 1).map(|c| if c == '\t' { '\t' } else { ' ' }).collect();
            words += &format!(" {space} |\n {number} | {line}\n {space} | {indent}{}\n", "^".repeat(marked));
        }
        words
    }
}

/// How many characters of the line the problem is about; at least one.
fn problem_width(place: &omnibase_robot::config::Location, line: &str) -> usize {
    let rest = line.chars().count().saturating_sub(place.column - 1);
    place.span.len().min(rest).max(1)
}

/// A count of problems in words.
pub fn plural(count: usize) -> String {
    if count == 1 { "1 problem".to_owned() } else { format!("{count} problems") }
}

/// A path from the working folder, as one that doesn't depend on it: the robot's file may be elsewhere.
fn parse_path(text: &str) -> Result<String, String> {
    let path = std::path::absolute(text).map_err(|error| error.to_string())?;
    path.into_os_string().into_string().map_err(|_| "the path isn't UTF-8".to_owned())
}

/// `key=value` as a line of TOML; what isn't a value of TOML is taken as text.
pub fn parse_change(text: &str) -> Result<String, String> {
    let (key, value) = text.split_once('=').ok_or("expected key=value, as controller.kind=open_loop")?;
    let (key, value) = (key.trim(), value.trim());
    if key.is_empty() || value.is_empty() {
        return Err("expected key=value, as controller.kind=open_loop".to_owned());
    }
    let line = format!("{key} = {value}");
    Ok(if line.parse::<toml::Table>().is_ok() { line } else { format!("{key} = {value:?}") })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_is_toml_or_text() {
        assert_eq!(parse_change("limits.speed_m_s=0.5").unwrap(), "limits.speed_m_s = 0.5");
        assert_eq!(parse_change("controller.kind = open_loop").unwrap(), "controller.kind = \"open_loop\"");
        assert_eq!(parse_change("a.b=[1, 2]").unwrap(), "a.b = [1, 2]");
        assert!(parse_change("a").is_err() && parse_change("a=").is_err());
    }
}
