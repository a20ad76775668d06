//! A robot's file with what Python changes in it, as a plan.

use std::path::{Path, PathBuf};

use omnibase_robot::config::{ReferenceTable, Source};
use omnibase_robot::{Problem, Registry, RobotPlan};
use omnibase_run::stepped::Leader;
use omnibase_run::{RobotText, small_file};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Map, Value};

use crate::failure::Failure;

/// What a robot is made of.
#[derive(Clone)]
pub struct Wanted {
    /// Its file.
    pub robot: PathBuf,
    /// A file of path points to follow.
    pub path: Option<PathBuf>,
    /// The keys of a table `reference` to follow.
    pub reference: Option<Map<String, Value>>,
    /// Settings in place of the file's, by their names.
    pub settings: Map<String, Value>,
}

impl Wanted {
    /// What Python says.
    pub fn new(
        robot: PathBuf,
        path: Option<PathBuf>,
        reference: Option<&Bound<'_, PyDict>>,
        settings: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        if path.is_some() && reference.is_some() {
            return Err(Failure::of("path and reference: expected one motion, found two").into());
        }
        let reference = reference.map(|table| object("reference", table)).transpose()?;
        let settings = settings.map_or_else(|| Ok(Map::new()), |table| object("settings", table))?;
        Ok(Wanted { robot, path, reference, settings })
    }

    /// With this control law, and no other.
    pub fn controlled_by(&mut self, kind: &str) -> Result<(), Failure> {
        for (key, value) in
            [("controller.kind", Value::from(kind)), ("controller.others", Value::Array(Vec::new()))]
        {
            if self.settings.insert(key.to_owned(), value).is_some() {
                let words = format!("controller and settings: {key}: expected one control law, found two");
                return Err(Failure::Broken(words));
            }
        }
        Ok(())
    }

    /// Reads and checks: the plan and who leads, or every problem at once.
    pub fn load(&self, registry: &Registry) -> Result<(RobotPlan, Leader), Failure> {
        let name = self.robot.display();
        let text = small_file::text(&self.robot)
            .map_err(|error| Failure::of(format_args!("reading `{name}`: {error}")))?;
        let folder = self.robot.parent().unwrap_or(Path::new("")).to_owned();
        let changes = self.settings.iter().map(|(key, value)| line(key, value)).collect::<Result<_, _>>()?;
        let reference = self.reference()?;
        let leader = if reference.is_some() { Leader::Plan } else { Leader::Owner };
        let loaded = RobotText { text, folder, changes, reference }.load(registry);
        let loaded = loaded.map_err(|problems| explained(&name.to_string(), &problems))?;
        Ok((loaded.plan, leader))
    }

    fn reference(&self) -> Result<Option<Source<ReferenceTable>>, Failure> {
        if let Some(path) = &self.path {
            let points_file = std::path::absolute(path).map_err(Failure::of)?;
            let points_file = points_file.to_string_lossy().into_owned();
            return Ok(Some(ReferenceTable::path_of_file(points_file).into()));
        }
        Ok(self.reference.clone().map(Source::read_json))
    }
}

/// Problems with where they are.
fn explained(file: &str, problems: &[Problem]) -> Failure {
    let words = |problem: &Problem| match &problem.place {
        Some(place) if place.file.is_none() => format!("{file}:{problem}"),
        Some(_) => problem.to_string(),
        None => format!("{file}: {problem}"),
    };
    Failure::Broken(problems.iter().map(words).collect::<Vec<_>>().join("\n"))
}

/// A setting as a line of TOML.
fn line(key: &str, value: &Value) -> Result<String, Failure> {
    let wrong = |error: &dyn std::fmt::Display| Failure::of(format_args!("settings: {key}: {error}"));
    let value = toml::Value::try_from(value).map_err(|error| wrong(&error))?;
    if key.contains(['\n', '=']) {
        return Err(wrong(&"expected a setting's name, as controller.kind"));
    }
    Ok(format!("{key} = {value}"))
}

/// A dict, by Python's own JSON.
pub fn object(name: &str, table: &Bound<'_, PyDict>) -> PyResult<Map<String, Value>> {
    let text: String = table.py().import("json")?.call_method1("dumps", (table,))?.extract()?;
    let wrong = |error| Failure::of(format_args!("{name}: {error}"));
    Ok(serde_json::from_str(&text).map_err(wrong)?)
}
