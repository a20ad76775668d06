//! What tables of SubDevices have in common: places on the bus, identities, PDO maps, parameters.

use std::collections::HashMap;
use std::ops::RangeInclusive;

use omnibase_ethercat::start_up::{ReadBack, SdoAccess};

use super::Check;
use crate::config::*;

/// What a table says about who it is and where; `table` is as settings name it, such as `drive[0]`.
pub(super) struct Claims<'a> {
    pub(super) table: String,
    pub(super) position: Option<u16>,
    pub(super) alias: Option<u16>,
    pub(super) identification: Option<u16>,
    pub(super) name: Option<&'a String>,
}

/// One SubDevice has one table, and no name stands for two.
pub(super) fn duplicates<'a>(check: &mut Check, tables: impl Iterator<Item = Claims<'a>>) {
    let mut first = HashMap::new();
    for Claims { table, position, alias, identification, name } in tables {
        let claims = [
            position.map(|position| ("position", position.to_string())),
            alias.map(|alias| ("alias", alias.to_string())),
            identification.map(|number| ("identification", number.to_string())),
            name.map(|name| ("name", format!("\"{name}\""))),
        ];
        for (key, value) in claims.into_iter().flatten() {
            if let Some(other) = first.insert((key, value.clone()), table.clone()) {
                let line = check.locations.place(&format!("{other}.{key}")).map_or(0, |place| place.line);
                let reason = format!("{other} has the same {key} (line {line})");
                check.report(ProblemKind::Duplicate, &format!("{table}.{key}"), reason).value = Some(value);
            }
        }
    }
}

/// Where a SubDevice is: by one of position, alias and identification. `what` says who is looked for.
pub(super) fn place(
    check: &mut Check,
    table: &str,
    [position, alias, identification]: [Option<u16>; 3],
    what: &str,
) -> Option<BusPlace> {
    let setting = format!("{table}.position");
    let places = [
        position.map(BusPlace::Position),
        alias.map(BusPlace::Alias),
        identification.map(BusPlace::Identification),
    ];
    let mut given = places.into_iter().flatten();
    match (given.next(), given.next()) {
        (Some(place), None) => Some(place),
        (Some(_), Some(_)) => {
            let reason = "give one of `position`, `alias` and `identification`";
            check.report(ProblemKind::Contradiction, &setting, reason);
            None
        }
        (None, _) => {
            let why = format!("{what} is found by its `position`, its `alias` or its `identification`");
            check.need(None, &setting, &why)
        }
    }
}

/// A number of an identity as text: `0x539` or `1337`.
pub(super) fn identity_number(check: &mut Check, setting: &str, text: &str) -> Option<u32> {
    let number = match text.strip_prefix("0x").or(text.strip_prefix("0X")) {
        Some(digits) => u32::from_str_radix(digits, 16),
        None => text.parse(),
    };
    if number.is_err() {
        let problem = check.report(ProblemKind::WrongType, setting, "not a number of 32 bits");
        problem.value = Some(format!("\"{text}\""));
        problem.limit = Some("such as \"0x539\" or \"1337\"".into());
    }
    number.ok()
}

/// Indices of the PDOs to a SubDevice.
pub(super) const OUTPUT_PDOS: RangeInclusive<u16> = 0x1600..=0x17FF;
/// Indices of the PDOs from a SubDevice.
pub(super) const INPUT_PDOS: RangeInclusive<u16> = 0x1A00..=0x1BFF;

/// The most entries of a PDO's map.
const MOST_ENTRIES: usize = 254;

/// PDO maps of one direction, whose indices lie in a range.
pub(super) fn pdos(
    check: &mut Check,
    setting: &str,
    tables: &[PdoTable],
    indices: &RangeInclusive<u16>,
) -> Option<Vec<PdoPlan>> {
    let mut pdos = Some(Vec::new());
    for (index, table) in tables.iter().enumerate() {
        let setting = format!("{setting}[{index}]");
        let why = "a PDO has an index and a map";
        let name = check.need(table.pdo.as_ref(), &format!("{setting}.pdo"), why);
        let map = check.need(table.map.as_ref(), &format!("{setting}.map"), why);
        let pdo = name.and_then(|name| match parse_object(name) {
            Ok((index, 0)) if indices.contains(&index) => Some(index),
            _ => {
                let reason = if *indices == OUTPUT_PDOS {
                    "a PDO of outputs, which the SubDevice receives, has an index of its own range"
                } else {
                    "a PDO of inputs, which the SubDevice sends, has an index of its own range"
                };
                let problem = check.report(ProblemKind::OutOfRange, &format!("{setting}.pdo"), reason);
                problem.value = Some(format!("\"{name}\""));
                problem.limit = Some(format!("\"0x{:04X}\" to \"0x{:04X}\"", indices.start(), indices.end()));
                None
            }
        });
        let entries = map.and_then(|map| match parse_map(map) {
            Ok(entries) if entries.len() > MOST_ENTRIES => {
                let reason = "a map has fewer entries (CoE: subindices 1 to 254)";
                let problem = check.report(ProblemKind::OutOfRange, &format!("{setting}.map"), reason);
                problem.value = Some(format!("{} entries", entries.len()));
                problem.limit = Some(format!("at most {MOST_ENTRIES}"));
                None
            }
            Ok(entries) => Some(entries),
            Err(error) => {
                check.report(ProblemKind::WrongType, &format!("{setting}.map"), error).value =
                    Some(format!("\"{map}\""));
                None
            }
        });
        match (pdo, entries, &mut pdos) {
            (Some(index), Some(entries), Some(pdos)) => pdos.push(PdoPlan { index, entries }),
            _ => pdos = None,
        }
    }
    pdos
}

/// One SDO to write.
pub(super) fn parameter(check: &mut Check, table: &ParameterTable, setting: &str) -> Option<ParameterPlan> {
    let why = "a parameter has object, type and value";
    let object = check.need(table.object.as_ref(), &format!("{setting}.object"), why);
    let data = match &table.bytes {
        Some(bytes) => parameter_bytes(check, table, bytes, setting),
        None => parameter_value(check, table, setting),
    };
    let object = object.and_then(|text| match parse_object(text) {
        Ok(object) => Some(object),
        Err(error) => {
            check.report(ProblemKind::WrongType, &format!("{setting}.object"), error);
            None
        }
    });
    let (data, (index, subindex)) = (data?, object?);
    let place = check.locations.place(&format!("{setting}.object"));
    let origin = place.map_or_else(String::new, |place| match place.file {
        Some(file) => format!("{file} line {}", place.line),
        None => format!("line {}", place.line),
    });
    let read_back = match table.read_back.unwrap_or(ReadBackChoice::Compare) {
        ReadBackChoice::Compare => ReadBack::Compare,
        ReadBackChoice::Skip => ReadBack::Skip,
    };
    let access = match table.complete_access.unwrap_or(false) {
        false => SdoAccess::Entry,
        true if table.bytes.is_some() && subindex <= 1 => SdoAccess::Complete,
        true => {
            let reason = "a whole object is given as `bytes`, from its subindex 0 or 1 on";
            check.report(ProblemKind::Contradiction, &format!("{setting}.complete_access"), reason);
            return None;
        }
    };
    let state = table.state.unwrap_or_default();
    Some(ParameterPlan { index, subindex, data, access, read_back, state, origin })
}

/// A parameter's number as it is sent.
fn parameter_value(check: &mut Check, table: &ParameterTable, setting: &str) -> Option<Vec<u8>> {
    let why = "a parameter has object, type and value";
    let kind = check.need(table.kind, &format!("{setting}.type"), why);
    let value = check.need(table.value, &format!("{setting}.value"), why);
    let (kind, value) = (kind?, value?);
    let (bytes, low, high) = match kind {
        ParameterType::I8 => (1, i64::from(i8::MIN), i64::from(i8::MAX)),
        ParameterType::I16 => (2, i64::from(i16::MIN), i64::from(i16::MAX)),
        ParameterType::I32 => (4, i64::from(i32::MIN), i64::from(i32::MAX)),
        ParameterType::U8 => (1, 0, i64::from(u8::MAX)),
        ParameterType::U16 => (2, 0, i64::from(u16::MAX)),
        ParameterType::U32 => (4, 0, i64::from(u32::MAX)),
    };
    if !(low..=high).contains(&value) {
        let reason = "the value doesn't fit its type";
        let problem = check.report(ProblemKind::OutOfRange, &format!("{setting}.value"), reason);
        problem.value = Some(value.to_string());
        problem.limit = Some(format!("{low} to {high}"));
        return None;
    }
    Some(value.to_le_bytes()[..bytes].to_vec())
}

/// The most bytes of one parameter.
const PARAMETER_BYTES: usize = 4096;

/// A parameter's bytes as they are sent.
fn parameter_bytes(check: &mut Check, table: &ParameterTable, text: &str, setting: &str) -> Option<Vec<u8>> {
    let setting_of = |key: &str| format!("{setting}.{key}");
    if table.kind.is_some() || table.value.is_some() {
        let reason = "give `bytes`, or `type` and `value`, not both";
        check.report(ProblemKind::Contradiction, &setting_of("bytes"), reason);
        return None;
    }
    let digits: Vec<u32> =
        text.chars().filter(|one| !one.is_whitespace()).map_while(|one| one.to_digit(16)).collect();
    let given = text.chars().filter(|one| !one.is_whitespace()).count();
    let is_whole =
        digits.len() == given && given > 0 && given.is_multiple_of(2) && given <= 2 * PARAMETER_BYTES;
    if !is_whole {
        let problem = check.report(ProblemKind::WrongType, &setting_of("bytes"), "not bytes in hexadecimal");
        problem.value = Some(format!("\"{}\"", text.chars().take(60).collect::<String>()));
        problem.limit = Some(format!("1 to {PARAMETER_BYTES} bytes, two digits each, such as \"6D61 64\""));
        return None;
    }
    Some(digits.chunks(2).map(|pair| (pair[0] * 16 + pair[1]) as u8).collect())
}
