//! Reading TOML tables key by key, with every problem at its line and column.

use super::{Mistake, SegmentFileError};
use core::ops::{Range, RangeInclusive};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The text of a file, and what is wrong in it.
pub(super) struct Document<'a> {
    text: &'a str,
    problems: Vec<(usize, String)>,
}

impl<'a> Document<'a> {
    /// The file's table, as far as it could be read.
    pub fn parse(text: &'a str) -> (Self, Spanned<DeTable<'a>>) {
        let (table, errors) = DeTable::parse_recoverable(text);
        let problem =
            |error: toml::de::Error| (error.span().map_or(0, |span| span.start), error.message().to_owned());
        let problems = errors.into_iter().map(problem).collect();
        (Document { text, problems }, table)
    }

    /// Whether the text isn't even TOML.
    pub fn is_broken(&self) -> bool {
        !self.problems.is_empty()
    }

    /// Notes a problem.
    pub fn problem(&mut self, span: Range<usize>, text: String) {
        self.problems.push((span.start, text));
    }

    /// Line and column of a place, from 1.
    pub fn place(&self, span: Range<usize>) -> (usize, usize) {
        let before = self.text.get(..span.start).unwrap_or(self.text);
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }

    /// The value, where nothing is wrong.
    pub fn into_result<T>(mut self, value: T) -> Result<T, SegmentFileError> {
        if self.problems.is_empty() {
            return Ok(value);
        }
        self.problems.sort();
        let problems = self.problems.iter().map(|(start, text)| {
            let (line, column) = self.place(*start..*start);
            Mistake { line, column, text: text.clone() }
        });
        Err(SegmentFileError { problems: problems.collect() })
    }
}

/// A table that is being read; keys that nobody asked for are problems.
pub(super) struct TableReader<'t, 'a> {
    table: &'t DeTable<'a>,
    span: Range<usize>,
    known: Vec<&'static str>,
    checked: bool,
}

impl<'t, 'a> TableReader<'t, 'a> {
    pub fn new(table: &'t Spanned<DeTable<'a>>) -> Self {
        TableReader { table: table.get_ref(), span: table.span(), known: Vec::new(), checked: true }
    }

    /// Where the table is.
    pub fn span(&self) -> Range<usize> {
        self.span.clone()
    }

    pub fn has(&self, key: &str) -> bool {
        self.table.contains_key(key)
    }

    fn value(&mut self, key: &'static str) -> Option<&'t Spanned<DeValue<'a>>> {
        self.known.push(key);
        self.table.get(key)
    }

    /// A text and where it is.
    pub fn text(&mut self, key: &'static str, document: &mut Document) -> Option<(String, Range<usize>)> {
        let value = self.value(key)?;
        match value.get_ref() {
            DeValue::String(text) if !text.is_empty() => Some((text.to_string(), value.span())),
            other => {
                document.problem(value.span(), format!("\"{key}\" must be text, found {}", describe(other)));
                None
            }
        }
    }

    /// A whole number within limits.
    pub fn integer(
        &mut self,
        key: &'static str,
        limits: RangeInclusive<i64>,
        document: &mut Document,
    ) -> Option<i64> {
        let value = self.value(key)?;
        let number = match value.get_ref() {
            DeValue::Integer(integer) => i64::from_str_radix(integer.as_str(), integer.radix()).ok(),
            _ => None,
        };
        if number.is_none_or(|number| !limits.contains(&number)) {
            let expected = format!("a whole number from {} to {}", limits.start(), limits.end());
            let found = describe(value.get_ref());
            document.problem(value.span(), format!("\"{key}\" must be {expected}, found {found}"));
            return None;
        }
        number
    }

    /// A number within limits.
    pub fn number(
        &mut self,
        key: &'static str,
        limits: RangeInclusive<f64>,
        document: &mut Document,
    ) -> Option<f64> {
        let value = self.value(key)?;
        let number: Option<f64> = match value.get_ref() {
            DeValue::Float(float) => float.as_str().parse().ok(),
            DeValue::Integer(integer) => {
                i64::from_str_radix(integer.as_str(), integer.radix()).ok().map(|integer| integer as f64)
            }
            _ => None,
        };
        if number.is_none_or(|number| !limits.contains(&number)) {
            let expected = format!("a number from {} to {}", limits.start(), limits.end());
            let found = describe(value.get_ref());
            document.problem(value.span(), format!("\"{key}\" must be {expected}, found {found}"));
            return None;
        }
        number
    }

    /// A list of texts, each with its place.
    pub fn texts(
        &mut self,
        key: &'static str,
        document: &mut Document,
    ) -> Option<Vec<(String, Range<usize>)>> {
        let value = self.value(key)?;
        let DeValue::Array(array) = value.get_ref() else {
            let found = describe(value.get_ref());
            document.problem(value.span(), format!("\"{key}\" must be a list of texts, found {found}"));
            return None;
        };
        let mut texts = Vec::new();
        for element in array.iter() {
            match element.get_ref() {
                DeValue::String(text) => texts.push((text.to_string(), element.span())),
                other => {
                    let found = describe(other);
                    document.problem(element.span(), format!("\"{key}\" holds texts, found {found}"));
                }
            }
        }
        Some(texts)
    }

    /// A table inside of this one.
    pub fn table(&mut self, key: &'static str, document: &mut Document) -> Option<TableReader<'t, 'a>> {
        let value = self.value(key)?;
        let reader = as_table(value);
        if reader.is_none() {
            let found = describe(value.get_ref());
            document.problem(value.span(), format!("\"{key}\" must be a table, found {found}"));
        }
        reader
    }

    /// The tables of an array of tables.
    pub fn tables(&mut self, key: &'static str, document: &mut Document) -> Vec<TableReader<'t, 'a>> {
        let Some(value) = self.value(key) else { return Vec::new() };
        let elements = match value.get_ref() {
            DeValue::Array(array) => array.iter().collect(),
            _ => vec![value],
        };
        let mut tables = Vec::new();
        for element in elements {
            match as_table(element) {
                Some(table) if matches!(value.get_ref(), DeValue::Array(_)) => tables.push(table),
                _ => document.problem(element.span(), format!("\"{key}\" must be written as [[{key}]]")),
            }
        }
        tables
    }

    /// No key of this table is checked: what it may hold isn't known.
    pub fn ignore_rest(&mut self) {
        self.checked = false;
    }

    /// Every key that nobody asked for is a problem.
    pub fn finish(self, document: &mut Document) {
        for key in self.table.keys().filter(|_| self.checked) {
            let name: &str = key.get_ref();
            if !self.known.contains(&name) {
                let hint = match nearest(name, &self.known) {
                    Some(near) => format!("did you mean \"{near}\"?"),
                    None => format!("known are {}", self.known.join(", ")),
                };
                document.problem(key.span(), format!("unknown key \"{name}\"; {hint}"));
            }
        }
    }
}

fn as_table<'t, 'a>(value: &'t Spanned<DeValue<'a>>) -> Option<TableReader<'t, 'a>> {
    match value.get_ref() {
        DeValue::Table(table) => {
            Some(TableReader { table, span: value.span(), known: Vec::new(), checked: true })
        }
        _ => None,
    }
}

fn describe(value: &DeValue) -> String {
    match value {
        DeValue::String(text) => format!("\"{text}\""),
        DeValue::Integer(integer) => integer.to_string(),
        DeValue::Float(float) => float.to_string(),
        DeValue::Boolean(boolean) => boolean.to_string(),
        DeValue::Datetime(time) => time.to_string(),
        DeValue::Array(_) => "a list".into(),
        DeValue::Table(_) => "a table".into(),
    }
}

/// The known name that differs least, where it differs by at most half of its letters.
pub(super) fn nearest<'n>(name: &str, known: &[&'n str]) -> Option<&'n str> {
    let (distance, near) = known.iter().map(|known| (distance(name, known), *known)).min()?;
    (distance * 2 <= near.len().max(name.len())).then_some(near)
}

/// Letters to insert, delete or replace (Levenshtein).
fn distance(one: &str, other: &str) -> usize {
    let other: Vec<char> = other.chars().collect();
    let mut row: Vec<usize> = (0..=other.len()).collect();
    for (i, a) in one.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, b) in other.iter().enumerate() {
            let replaced = diagonal + usize::from(a != *b);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[other.len()]
}
