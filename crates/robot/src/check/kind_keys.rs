//! Tables whose keys belong to kinds: what a kind needs is there and within its bounds, what nobody reads is refused.

use serde::Serialize;
use serde_json::{Map, Value};

use super::Check;
use crate::config::{ProblemKind, nearest};
use crate::registry::{Custom, Kind, Kinds, Sort};

/// The keys that a table gives, those of its table `custom` as `custom.key`.
pub(super) struct Given(Map<String, Value>);

impl Given {
    pub(super) fn of(table: &impl Serialize) -> Self {
        let Ok(Value::Object(mut keys)) = serde_json::to_value(table) else { return Given(Map::new()) };
        if let Some(Value::Object(custom)) = keys.remove("custom") {
            keys.extend(custom.into_iter().map(|(key, value)| (format!("custom.{key}"), value)));
        }
        keys.retain(|_, value| !value.is_null() && value.as_array().is_none_or(|list| !list.is_empty()));
        Given(keys)
    }

    pub(super) fn has(&self, key: &str) -> bool {
        self.0.contains_key(key)
    }

    pub(super) fn get(&self, key: &str) -> Option<&Value> {
        self.0.get(key)
    }

    /// The same with the keys of another table that this one doesn't give.
    pub(super) fn or(&self, other: &Given) -> Given {
        let mut keys = other.0.clone();
        keys.extend(self.0.clone());
        Given(keys)
    }
}

impl Check {
    /// The kind of a name, or of the default, and how it is made.
    pub(super) fn known<'k, Make>(
        &mut self,
        kinds: &'k Kinds<Make>,
        setting: &str,
        name: Option<&str>,
    ) -> Option<&'k (Kind, Make)> {
        self.made(kinds.find(name).map_err(|error| error.named(setting)))
    }

    /// The keys of a table that is read by one kind alone.
    pub(super) fn keys(&mut self, kind: &Kind, given: &Given, sort: &Sort) {
        self.kind_reads(kind, given, &|key| format!("{}.{key}", sort.table));
        self.nobody_reads(&[kind], given, sort, sort.table);
    }

    /// What a kind needs is given, and what is its own lies within its bounds.
    pub(super) fn kind_reads(&mut self, kind: &Kind, given: &Given, setting: &dyn Fn(&str) -> String) {
        for key in &kind.keys {
            let path = key.path();
            let setting = setting(&path);
            match (given.0.get(&path), &key.custom) {
                (None, _) if key.is_needed => {
                    self.need(None::<()>, &setting, &format!("`{}` needs it", kind.name));
                }
                (Some(value), Some(Custom { bounds: Some(bounds), .. }))
                    if !value.as_f64().is_some_and(|number| bounds.contains(&number))
                        && !self.refused(&setting) =>
                {
                    let reason = "expected a number within its bounds";
                    let problem = self.report(ProblemKind::OutOfRange, &setting, reason);
                    problem.value = Some(shown(value));
                    problem.limit = Some(format!("{} to {}", bounds.start(), bounds.end()));
                }
                _ => {}
            }
        }
    }

    /// A key that none of these kinds reads is a slip: it would change nothing.
    pub(super) fn nobody_reads(&mut self, kinds: &[&Kind], given: &Given, sort: &Sort, table: &str) {
        for (path, value) in &given.0 {
            let is_own = path.starts_with("custom.");
            if kinds.iter().any(|kind| kind.reads(path)) || (!is_own && sort.is_common(path)) {
                continue;
            }
            let mut paths: Vec<String> = kinds.iter().flat_map(|kind| kind.paths()).collect();
            paths.sort();
            paths.dedup();
            let near = nearest(path, paths.iter().map(String::as_str)).filter(|_| is_own);
            let near = near.map_or_else(String::new, |near| format!("; did you mean `{near}`?"));
            let reason = match kinds {
                [one] => format!("the {} `{}` doesn't read it{near}", sort.name, one.name),
                _ => format!("no {} reads it{near}", sort.name),
            };
            let problem = self.report(ProblemKind::UnknownKey, &format!("{table}.{path}"), reason);
            problem.value = Some(shown(value));
            problem.limit = Some(if paths.is_empty() { "none".into() } else { paths.join(", ") });
        }
    }
}

/// A value in few words.
fn shown(value: &Value) -> String {
    match value {
        Value::Array(list) => format!("a list of {}", list.len()),
        Value::Object(_) => "a table".into(),
        other => other.to_string(),
    }
}
