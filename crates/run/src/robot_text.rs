//! The robot's file with what the command line changes in it: a plan, and everything that replay needs.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use omnibase_robot::config::{Locations, ProblemKind, ReferenceTable, RobotFile, Source};
use omnibase_robot::{Problem, Registry, RobotPlan};
use serde_json::Value;

use crate::{channels, small_file};

/// Key of the robot's file, as it was in effect, in the description of a recording.
pub const ROBOT_KEY: &str = "robot.toml";
/// What stands before the name of each file that the robot's file names, in the description of a recording.
pub const FILE_KEY: &str = "file/";
/// The name by which problems call what the command line says.
const COMMAND_LINE: &str = "command line";

/// A robot's file as text, and what is changed in it.
#[derive(Clone, Debug, Default)]
pub struct RobotText {
    /// The file's text.
    pub text: String,
    /// The folder from which the files it names are read.
    pub folder: PathBuf,
    /// Lines of TOML, each `table.key = value`, that replace what the file says.
    pub changes: Vec<String>,
    /// The reference in place of the file's own.
    pub reference: Option<Source<ReferenceTable>>,
}

/// A robot that was read and checked.
#[derive(Clone, Debug)]
pub struct LoadedRobot {
    /// What it resolves to.
    pub plan: RobotPlan,
    /// Everything from which the same plan is made again.
    pub description: BTreeMap<String, String>,
}

impl RobotText {
    /// Reads and checks: the robot, or every problem at once.
    pub fn load(&self, registry: &Registry) -> Result<LoadedRobot, Vec<Problem>> {
        let mut source: Source<RobotFile> = Source::read(&self.text, None);
        for change in &self.changes {
            let changed: Source<RobotFile> = Source::read(change, Some(COMMAND_LINE));
            source.problems.extend(changed.problems);
            source.file = merged(&source.file, &changed.file);
        }
        if let Some(reference) = &self.reference {
            source.replace_reference(reference.clone());
        }
        let effective = toml::to_string(&source.file).unwrap_or_else(|_| self.text.clone());
        let memory = source.file.grip.memory.clone();
        let read = RefCell::new(BTreeMap::new());
        let read_file = |name: &str| {
            let text = match small_file::text(&self.folder.join(name)) {
                // Before its first run a robot remembers nothing.
                Err(error) if error.kind() == ErrorKind::NotFound && memory.as_deref() == Some(name) => {
                    String::new()
                }
                read => read.map_err(|error| error.to_string())?,
            };
            read.borrow_mut().insert(format!("{FILE_KEY}{name}"), text.clone());
            Ok(text)
        };
        let locations = source.locations.clone();
        let plan = RobotPlan::check(source, registry, &read_file)?;
        let problems = unknown_signals(&plan, &locations);
        if !problems.is_empty() {
            return Err(problems);
        }
        let mut description = read.into_inner();
        description.insert(ROBOT_KEY.into(), effective);
        without_places(&mut description);
        Ok(LoadedRobot { plan, description })
    }
}

/// Calls files of the description by their own names where the robot's file names them by their places on this machine.
fn without_places(description: &mut BTreeMap<String, String>) {
    let is_placed =
        |key: &&String| key.strip_prefix(FILE_KEY).is_some_and(|name| Path::new(name).is_absolute());
    let placed: Vec<String> = description.keys().filter(is_placed).cloned().collect();
    let robot = description.get(ROBOT_KEY).and_then(|text| text.parse::<toml::Table>().ok());
    let Some(mut robot) = robot.filter(|_| !placed.is_empty()).map(toml::Value::Table) else { return };
    for key in &placed {
        let place = key.trim_start_matches(FILE_KEY);
        let name = Path::new(place).file_name().unwrap_or_default().to_string_lossy().into_owned();
        let names = std::iter::once(name.clone()).chain((2..).map(|number| format!("{number}/{name}")));
        let mut free = names.filter(|name| !description.contains_key(&format!("{FILE_KEY}{name}")));
        let name = free.next().unwrap_or_default();
        rename(&mut robot, place, &name);
        let text = description.get(key).cloned().unwrap_or_default();
        description.insert(format!("{FILE_KEY}{name}"), text);
    }
    if let Ok(text) = toml::to_string(&robot) {
        description.insert(ROBOT_KEY.into(), text);
        description.retain(|key, _| !placed.contains(key));
    }
}

/// Replaces one text wherever it is a value.
fn rename(value: &mut toml::Value, from: &str, to: &str) {
    match value {
        toml::Value::String(text) if text == from => to.clone_into(text),
        toml::Value::Array(values) => values.iter_mut().for_each(|value| rename(value, from, to)),
        toml::Value::Table(table) => table.iter_mut().for_each(|(_, value)| rename(value, from, to)),
        _ => {}
    }
}

/// Patterns of the table `recording` that no signal fits.
fn unknown_signals(plan: &RobotPlan, locations: &Locations) -> Vec<Problem> {
    let patterns = plan.recording.iter().flat_map(|recording| &recording.signals).enumerate();
    let problem = |(index, pattern): (usize, &String)| {
        let setting = format!("recording.signals[{index}]");
        let why = channels::known(pattern, plan).err()?;
        let place = locations.place(&setting);
        let value = Some(format!("{pattern:?}"));
        Some(Problem { value, place, ..Problem::new(ProblemKind::UnknownName, setting, why) })
    };
    patterns.filter_map(problem).collect()
}

/// The robot of a recording's description.
pub fn from_description(
    description: &BTreeMap<String, String>,
    registry: &Registry,
) -> Result<RobotPlan, Vec<Problem>> {
    let text = description.get(ROBOT_KEY).map_or("", String::as_str);
    let read_file = |name: &str| {
        let found = description.get(&format!("{FILE_KEY}{name}"));
        found.cloned().ok_or_else(|| "the recording doesn't hold it".to_owned())
    };
    RobotPlan::from_toml(text, registry, &read_file)
}

/// A reference file, as text with the name by which problems call it; the files that it names stand in a folder.
pub fn read_reference(text: &str, name: &str, folder: &Path, registry: &Registry) -> Source<ReferenceTable> {
    let Source { file, locations, problems } = Source::read_reference(text, name);
    let beside = |name: &str| {
        let place = std::path::absolute(folder.join(name));
        Some(place.map_or_else(|_| name.to_owned(), |place| place.to_string_lossy().into_owned()))
    };
    Source { file: registry.with_files(file, beside), locations, problems }
}

/// A file with the keys that the other one has.
fn merged(file: &RobotFile, change: &RobotFile) -> RobotFile {
    let (Ok(mut whole), Ok(change)) = (serde_json::to_value(file), serde_json::to_value(change)) else {
        return file.clone();
    };
    merge(&mut whole, &change);
    serde_json::from_value(whole).unwrap_or_else(|_| file.clone())
}

fn merge(whole: &mut Value, change: &Value) {
    match (whole, change) {
        (Value::Object(whole), Value::Object(change)) => {
            for (key, value) in change {
                merge(whole.entry(key.clone()).or_insert(Value::Null), value);
            }
        }
        // What isn't said changes nothing.
        (_, Value::Null) => {}
        (_, Value::Array(items)) if items.is_empty() => {}
        (whole, value) => *whole = value.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BMM: &str = include_str!("../../../robots/bmm.toml");

    #[test]
    fn changes_replace_single_keys_and_the_description_gives_the_same_plan() {
        let registry = Registry::with_built_in();
        let text = RobotText {
            text: BMM.into(),
            changes: vec!["controller.kind = \"open_loop\"".into(), "simulation.payload_kg = 0.1".into()],
            ..Default::default()
        };
        let robot = text.load(&registry).unwrap();
        assert_eq!(robot.plan.controllers().collect::<Vec<_>>(), ["open_loop"]);
        assert_eq!(
            (robot.plan.simulation.payload_kg, robot.plan.simulation.mass_kg),
            (Some(0.1), Some(70.0))
        );
        let again = from_description(&robot.description, &registry).unwrap();
        // All but the lines in which parameters stand.
        let text = |mut plan: RobotPlan| {
            let parameters = plan.drives.iter_mut().flat_map(|drive| &mut drive.parameters);
            parameters.for_each(|parameter| parameter.origin.clear());
            format!("{plan:?}")
        };
        assert_eq!(text(again), text(robot.plan));
    }

    #[test]
    fn files_are_called_by_their_names_and_not_by_where_they_lie() {
        let registry = Registry::with_built_in();
        let folder = std::env::temp_dir().join(format!("omnibase-places-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let points = "(0, 0, 0, 0)\n(10, 1, 0, 0)\n(20, 1, 1, 0)\n";
        std::fs::write(folder.join("way.dat"), points).unwrap();
        std::fs::write(folder.join("events.toml"), "").unwrap();
        let table = "kind = \"path\"\npoints_file = \"way.dat\"\n";
        let text = RobotText {
            text: BMM.into(),
            changes: vec![format!("simulation.events_file = {:?}", folder.join("events.toml"))],
            reference: Some(read_reference(table, "way.toml", &folder, &registry)),
            ..Default::default()
        };
        let robot = text.load(&registry).unwrap();
        let keys: Vec<&str> = robot.description.keys().map(String::as_str).collect();
        assert_eq!(keys, ["file/events.toml", "file/way.dat", "robot.toml"]);
        assert_eq!(robot.description["file/way.dat"], points);
        let here = folder.to_str().unwrap();
        assert!(!robot.description[ROBOT_KEY].contains(here), "{}", robot.description[ROBOT_KEY]);
        let again = from_description(&robot.description, &registry).unwrap();
        assert_eq!(again.reference.points_file.as_deref(), Some("way.dat"));
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_wrong_change_is_a_problem_of_the_command_line() {
        let text = RobotText {
            text: BMM.into(),
            changes: vec!["controller.mode = \"open_loop\"".into(), "limits.speed_m_s = -1.0".into()],
            ..Default::default()
        };
        let problems = text.load(&Registry::with_built_in()).unwrap_err();
        let words: Vec<String> = problems.iter().map(ToString::to_string).collect();
        assert_eq!(words.len(), 2, "{words:#?}");
        assert!(words.iter().all(|text| text.starts_with("command line:1:")), "{words:#?}");
    }

    #[test]
    fn a_wrong_key_of_a_reference_file_has_its_place_there() {
        let problems = |text: &str| {
            let registry = Registry::with_built_in();
            let reference = Some(read_reference(text, "ring.toml", Path::new(""), &registry));
            let text = RobotText { text: BMM.into(), reference, ..Default::default() };
            let problems = text.load(&registry).unwrap_err();
            problems.iter().map(ToString::to_string).collect::<Vec<_>>()
        };
        let circle = "kind = \"circle\"\nradius_m = 0.5\n";
        let unread = "ring.toml:3:1: reference.step_m = 0.1: the reference `circle` doesn't read it";
        assert!(problems(&format!("{circle}step_m = 0.1"))[0].starts_with(unread));
        let unknown = "ring.toml:3:1: reference.turn: no setting has this name; did you mean `turns`?";
        assert!(problems(&format!("{circle}turn = 2"))[0].starts_with(unknown));
        let missing = "ring.toml:1:1: reference.step_m: must be given: `spiral` needs it";
        assert_eq!(problems("kind = \"spiral\""), [missing]);
        assert!(
            problems(&format!("{circle}duration_s = 0.1"))[0]
                .starts_with("ring.toml:3:1: reference.duration_s: ")
        );
    }
}
