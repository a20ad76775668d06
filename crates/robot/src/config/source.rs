//! A TOML text into a struct, guided by that struct's own JSON schema: every unknown key, wrong type and value out
//! of bounds is found in one pass, with its place; what is wrong is left out, so that the rest can be checked too.

use std::collections::BTreeMap;
use std::ops::Range;

use schemars::{JsonSchema, schema_for};
use serde::de::DeserializeOwned;
use serde_json::{Map, Number, Value};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::file::RobotFile;
use super::problem::{Location, Problem, ProblemKind};
use super::reference_table::ReferenceTable;
use super::units;

/// Where each setting stands, in one text or several.
#[derive(Clone, Debug, Default)]
pub struct Locations {
    texts: Vec<Text>,
    /// The text and the bytes of each setting.
    spans: BTreeMap<String, (usize, Range<usize>)>,
}

#[derive(Clone, Debug)]
struct Text {
    text: String,
    /// Its name where it isn't the robot's file itself.
    file: Option<String>,
}

impl Locations {
    /// Where `setting` stands; for what is missing, where the table around it stands.
    pub fn place(&self, setting: &str) -> Option<Location> {
        let mut name = setting;
        loop {
            if let Some((text, span)) = self.spans.get(name) {
                return Some(self.texts.get(*text)?.place_of(span.clone()));
            }
            name = &name[..name.rfind(['.', '['])?];
        }
    }

    /// The settings of a table stand elsewhere.
    fn replace(&mut self, table: &str, elsewhere: Locations) {
        self.spans.retain(|setting, _| setting != table && !setting.starts_with(&format!("{table}.")));
        let before = self.texts.len();
        self.texts.extend(elsewhere.texts);
        let moved = elsewhere.spans.into_iter();
        self.spans.extend(moved.map(|(setting, (text, span))| (setting, (before + text, span))));
    }
}

impl Text {
    fn place_of(&self, span: Range<usize>) -> Location {
        let before = self.text.get(..span.start).unwrap_or(&self.text);
        let line_start = before.rfind('\n').map_or(0, |end| end + 1);
        Location {
            file: self.file.clone(),
            line: before.matches('\n').count() + 1,
            column: before[line_start..].chars().count() + 1,
            span,
        }
    }
}

/// What was read from a text.
#[derive(Clone, Debug)]
pub struct Source<T> {
    /// The settings that could be read.
    pub file: T,
    /// Where they stand.
    pub locations: Locations,
    /// What couldn't be read.
    pub problems: Vec<Problem>,
}

/// A table that stands in no text.
impl<T> From<T> for Source<T> {
    fn from(file: T) -> Self {
        Source { file, locations: Locations::default(), problems: Vec::new() }
    }
}

impl<T: JsonSchema + DeserializeOwned + Default> Source<T> {
    /// Reads a text; `file` names it in problems where it isn't the robot's file itself.
    pub fn read(text: &str, file: Option<&str>) -> Self {
        Source::read_table(text, file, "")
    }

    fn read_table(text: &str, file: Option<&str>, name: &str) -> Self {
        let schema = Value::from(schema_for!(T));
        let (table, errors) = DeTable::parse_recoverable(text);
        let spans = BTreeMap::from([(name.to_owned(), (0, 0..0))]);
        let texts = vec![Text { text: text.into(), file: file.map(Into::into) }];
        let mut walk = Walk { root: &schema, locations: Locations { texts, spans }, problems: Vec::new() };
        for error in errors {
            let span = error.span().unwrap_or(0..0);
            let is_header = line_of(text, span.start).trim_start().starts_with('[');
            let kind = if is_header { ProblemKind::Header } else { ProblemKind::Syntax };
            let place = walk.locations.texts.first().map(|text| text.place_of(span));
            let problem = Problem::new(kind, "the text", error.message().trim());
            walk.problems.push(Problem { place, ..problem });
        }
        let value = Value::Object(walk.table(table.get_ref(), &schema, name));
        let file = match serde_json::from_value(value) {
            Ok(file) => file,
            Err(error) => {
                walk.problem(ProblemKind::WrongType, name, None, error.to_string());
                T::default()
            }
        };
        Source { file, locations: walk.locations, problems: walk.problems }
    }
}

impl Source<ReferenceTable> {
    /// Reads a text whose keys are those of the robot file's table `reference`; `file` names it in problems.
    pub fn read_reference(text: &str, file: &str) -> Self {
        Source::read_table(text, Some(file), "reference")
    }

    /// Reads that table out of JSON, where nothing has a place; keys that are null aren't given.
    pub fn read_json(mut table: Map<String, Value>) -> Self {
        table.retain(|_, value| !value.is_null());
        match toml::to_string(&table) {
            Ok(text) => {
                let Source { file, problems, .. } = Self::read_table(&text, None, "reference");
                let problems = problems.into_iter().map(|problem| Problem { place: None, ..problem });
                Source { problems: problems.collect(), ..Source::from(file) }
            }
            Err(error) => {
                let problems = vec![Problem::new(ProblemKind::WrongType, "reference", error)];
                Source { problems, ..Source::from(ReferenceTable::default()) }
            }
        }
    }
}

impl Source<RobotFile> {
    /// Another reference takes the place of the file's own.
    pub fn replace_reference(&mut self, reference: Source<ReferenceTable>) {
        self.problems.extend(reference.problems);
        self.locations.replace("reference", reference.locations);
        self.file.reference = reference.file;
    }
}

/// Keys that were once there: the list or table, the key, and what to write now.
const RETIRED_KEYS: [(&str, &str, &str); 2] = [
    (
        "device",
        "sync0",
        "its clock's events stand in its table `dc` now: write `dc = { assign_activate = \"0x0300\" }` for a SYNC0 in each of its cycles",
    ),
    ("device", "sync0_shift_us", "it stands in the table `dc` now: write `dc = { sync0_shift_us = … }`"),
];

/// Choices that were once there: their setting, their name, and what to write now.
const RETIRED: [(&str, &str, &str); 1] = [(
    "safety.after_lost_device",
    "resume",
    "no robot goes on by that name any more: `hold` ends in holding, and a person resumes; \
     `move_again_unattended` moves again without a person, after a warning (docs/faults.md)",
)];

struct Walk<'s> {
    root: &'s Value,
    locations: Locations,
    problems: Vec<Problem>,
}

impl<'s> Walk<'s> {
    fn problem(
        &mut self,
        kind: ProblemKind,
        setting: &str,
        value: Option<String>,
        reason: String,
    ) -> &mut Problem {
        let place = self.locations.place(setting);
        self.problems.push(Problem { value, place, ..Problem::new(kind, setting, reason) });
        self.problems.last_mut().expect("just pushed")
    }

    /// Follows `$ref`, and the one choice of an optional value that isn't null.
    fn resolve(&self, mut schema: &'s Value) -> &'s Value {
        loop {
            if let Some(reference) = schema.get("$ref").and_then(Value::as_str) {
                let target = reference.strip_prefix('#').and_then(|pointer| self.root.pointer(pointer));
                match target {
                    Some(target) => schema = target,
                    None => return schema,
                }
            } else if let Some(some) = schema
                .get("anyOf")
                .and_then(Value::as_array)
                .and_then(|choices| choices.iter().find(|choice| choice["type"] != "null"))
            {
                schema = some;
            } else {
                return schema;
            }
        }
    }

    fn table(&mut self, table: &DeTable<'_>, schema: &'s Value, path: &str) -> Map<String, Value> {
        let mut known = Map::new();
        let properties = schema.get("properties").and_then(Value::as_object);
        for (key, value) in table {
            let name = key.get_ref().as_ref();
            let setting = if path.is_empty() { name.to_string() } else { format!("{path}.{name}") };
            let span = key.span().start..value.span().end.max(key.span().end);
            self.locations.spans.insert(setting.clone(), (0, span));
            if let Some(named) = schema.get("additionalProperties").filter(|named| named.is_object()) {
                // Names of one's own, for tables that are all alike.
                if let Some(value) = self.value(value, named, &setting) {
                    known.insert(name.into(), value);
                }
                continue;
            }
            let Some(properties) = properties else {
                // A registered stage's own parameters: no schema here.
                if let Some(value) = self.free(value, &setting) {
                    known.insert(name.into(), value);
                }
                continue;
            };
            match properties.get(name) {
                Some(schema) => {
                    if let Some(value) = self.value(value, schema, &setting) {
                        known.insert(name.into(), value);
                    }
                }
                None => self.unknown(&setting, name, properties),
            }
        }
        known
    }

    fn unknown(&mut self, setting: &str, name: &str, properties: &Map<String, Value>) {
        let (stem, unit) = units::split(name);
        let same_stem = properties.keys().find(|key| {
            let (other, other_unit) = units::split(key);
            other == stem && other_unit.is_some()
        });
        if let Some(right) = same_stem {
            let wanted = units::split(right).1.unwrap_or_default();
            let reason = match unit {
                Some(unit) => format!("the unit of this setting is {wanted}, not {unit}: write `{right}`"),
                None => format!("the unit belongs to the name: write `{right}`"),
            };
            self.problem(ProblemKind::WrongUnit, setting, None, reason).limit = Some(right.clone());
            return;
        }
        let table = setting.split(['.', '[']).next().unwrap_or_default();
        let retired = RETIRED_KEYS.iter().find(|(whose, key, _)| (*whose, *key) == (table, name));
        let reason = match (retired, nearest(name, properties.keys().map(String::as_str))) {
            (Some((.., words)), _) => (*words).to_string(),
            (None, Some(near)) => format!("no setting has this name; did you mean `{near}`?"),
            (None, None) => "no setting has this name".to_string(),
        };
        let names: Vec<&str> = properties.keys().map(String::as_str).collect();
        self.problem(ProblemKind::UnknownKey, setting, None, reason).limit = Some(names.join(", "));
    }

    fn value(&mut self, value: &Spanned<DeValue<'_>>, schema: &'s Value, path: &str) -> Option<Value> {
        let schema_here = schema;
        let schema = self.resolve(schema);
        let expected = expected_types(schema);
        let found = match value.get_ref() {
            DeValue::Table(table) if expected.contains(&"object") => {
                return Some(Value::Object(self.table(table, schema, path)));
            }
            DeValue::Array(items) if expected.contains(&"array") => return self.array(items, schema, path),
            DeValue::String(text) if !choices(schema).is_empty() => {
                let names = choices(schema);
                if names.contains(&text.as_ref()) {
                    return Some(Value::String(text.to_string()));
                }
                let retired = RETIRED.iter().find(|(setting, value, _)| *setting == path && value == text);
                let reason = match (retired, nearest(text, names.iter().copied())) {
                    (Some((.., words)), _) => (*words).to_string(),
                    (None, Some(near)) => format!("no choice has this name; did you mean `{near}`?"),
                    (None, None) => "no choice has this name".to_string(),
                };
                let value = Some(format!("\"{text}\""));
                self.problem(ProblemKind::UnknownName, path, value, reason).limit = Some(names.join(", "));
                return None;
            }
            DeValue::String(text) if expected.contains(&"string") => {
                return Some(Value::String(text.to_string()));
            }
            DeValue::Boolean(yes) if expected.contains(&"boolean") => return Some(Value::Bool(*yes)),
            DeValue::Integer(_) | DeValue::Float(_) => match number(value.get_ref()) {
                Some(number)
                    if expected.contains(&"number")
                        || (expected.contains(&"integer") && !number.is_f64()) =>
                {
                    return self.within(number, [schema_here, schema], path);
                }
                Some(number) => number.to_string(),
                None => {
                    let reason = "the value isn't a finite number".to_string();
                    self.problem(ProblemKind::WrongType, path, Some(shown(value.get_ref())), reason);
                    return None;
                }
            },
            other => shown(other),
        };
        let expected =
            if choices(schema).is_empty() { expected.join(" or ") } else { choices(schema).join(", ") };
        let reason = format!("the value has another type than {expected}");
        self.problem(ProblemKind::WrongType, path, Some(found), reason).limit = Some(expected);
        None
    }

    fn array(&mut self, items: &[Spanned<DeValue<'_>>], schema: &'s Value, path: &str) -> Option<Value> {
        let length = schema.get("minItems").and_then(Value::as_u64);
        if let Some(length) = length
            && items.len() as u64 != length
        {
            let reason = "the list has the wrong length".to_string();
            self.problem(ProblemKind::WrongType, path, Some(format!("{} values", items.len())), reason)
                .limit = Some(format!("{length} values"));
            return None;
        }
        let item_schema = schema.get("items")?;
        let before = self.problems.len();
        let mut list = Vec::new();
        for (index, item) in items.iter().enumerate() {
            let setting = format!("{path}[{index}]");
            self.locations.spans.insert(setting.clone(), (0, item.span()));
            list.extend(self.value(item, item_schema, &setting));
        }
        // A list of fixed length with a wrong value can't be used; a list of tables keeps its other tables.
        (length.is_none() || self.problems.len() == before).then_some(Value::Array(list))
    }

    fn within(&mut self, number: Number, schemas: [&Value; 2], path: &str) -> Option<Value> {
        let bound = |name: &str| schemas.iter().find_map(|schema| schema.get(name).and_then(Value::as_f64));
        let value = number.as_f64()?;
        let mut limits = Vec::new();
        let mut inside = true;
        if let Some(least) = bound("minimum") {
            inside &= value >= least;
            limits.push(format!("at least {least}"));
        }
        if let Some(least) = bound("exclusiveMinimum") {
            inside &= value > least;
            limits.push(format!("above {least}"));
        }
        if let Some(greatest) = bound("maximum") {
            inside &= value <= greatest;
            limits.push(format!("at most {greatest}"));
        }
        if inside {
            return Some(Value::Number(number));
        }
        let reason = "the value is outside its bounds".to_string();
        self.problem(ProblemKind::OutOfRange, path, Some(number.to_string()), reason).limit =
            Some(limits.join(" and "));
        None
    }

    fn free(&mut self, value: &Spanned<DeValue<'_>>, path: &str) -> Option<Value> {
        Some(match value.get_ref() {
            DeValue::String(text) => Value::String(text.to_string()),
            DeValue::Boolean(yes) => Value::Bool(*yes),
            DeValue::Array(items) => {
                let free = |(index, item)| self.free(item, &format!("{path}[{index}]"));
                Value::Array(items.iter().enumerate().filter_map(free).collect())
            }
            DeValue::Table(table) => Value::Object(self.table(table, &Value::Null, path)),
            DeValue::Datetime(moment) => Value::String(moment.to_string()),
            number_value => match number(number_value) {
                Some(number) => Value::Number(number),
                None => {
                    let reason = "the value isn't a finite number".to_string();
                    self.problem(ProblemKind::WrongType, path, Some(shown(number_value)), reason);
                    return None;
                }
            },
        })
    }
}

fn expected_types(schema: &Value) -> Vec<&str> {
    match schema.get("type") {
        Some(Value::String(one)) => vec![one.as_str()],
        Some(Value::Array(several)) => {
            several.iter().filter_map(Value::as_str).filter(|t| *t != "null").collect()
        }
        _ => Vec::new(),
    }
}

/// The names by which a file has a choice of this type, in their order.
pub fn choice_names<T: JsonSchema>() -> Vec<String> {
    let schema = schema_for!(T).to_value();
    choices(&schema).into_iter().map(str::to_owned).collect()
}

/// Names that a value can have.
fn choices(schema: &Value) -> Vec<&str> {
    if let Some(names) = schema.get("enum").and_then(Value::as_array) {
        return names.iter().filter_map(Value::as_str).collect();
    }
    let documented = schema.get("oneOf").and_then(Value::as_array);
    documented.into_iter().flatten().filter_map(|choice| choice.get("const")?.as_str()).collect()
}

fn number(value: &DeValue<'_>) -> Option<Number> {
    match value {
        DeValue::Integer(integer) => {
            i64::from_str_radix(integer.as_str(), integer.radix()).ok().map(Number::from)
        }
        DeValue::Float(float) => float.as_str().parse().ok().and_then(Number::from_f64),
        _ => None,
    }
}

fn shown(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) => format!("\"{text}\""),
        DeValue::Integer(integer) => integer.as_str().into(),
        DeValue::Float(float) => float.as_str().into(),
        DeValue::Boolean(yes) => yes.to_string(),
        DeValue::Datetime(moment) => moment.to_string(),
        DeValue::Array(items) => format!("a list of {}", items.len()),
        DeValue::Table(_) => "a table".into(),
    }
}

/// The line of which a byte is.
fn line_of(text: &str, byte: usize) -> &str {
    let begin = text.get(..byte).and_then(|before| before.rfind('\n')).map_or(0, |end| end + 1);
    text[begin..].lines().next().unwrap_or_default()
}

/// The name that was most probably meant.
pub fn nearest<'n>(name: &str, known: impl Iterator<Item = &'n str>) -> Option<&'n str> {
    known
        .map(|known| (strsim::jaro_winkler(name, known), known))
        .filter(|(likeness, _)| *likeness > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, known)| known)
}
