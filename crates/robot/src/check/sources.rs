//! Other programs that send inputs, and receivers: their names, values and ages.

use super::Check;
use super::kind_keys::Given;
use crate::config::{DeviceTable, ProblemKind, SentPlan, SentTable, SourcePlan, SourceTable};
use crate::registry::{Received, Registry};
use crate::signals::{Carries, MAX_SOURCE_VALUES, MAX_SOURCES, column_name};

/// What a program sent longer ago isn't believed where the file doesn't say, ms.
const MAX_AGE_MS: u32 = 100;

pub(super) fn resolve(
    check: &mut Check,
    tables: &[SourceTable],
    devices: &[DeviceTable],
    registry: &Registry,
) -> Option<Vec<SourcePlan>> {
    if tables.len() > MAX_SOURCES {
        let problem = check.report(ProblemKind::OutOfRange, "source", "too many programs that send inputs");
        (problem.value, problem.limit) =
            (Some(tables.len().to_string()), Some(format!("at most {MAX_SOURCES}")));
    }
    let mut taken: Vec<(String, &str)> = devices
        .iter()
        .enumerate()
        .filter_map(|(n, device)| Some((format!("device[{n}]"), device.name.as_deref()?)))
        .collect();
    let mut plans = Vec::new();
    for (n, own) in tables.iter().enumerate() {
        let table = format!("source[{n}]");
        let setting = format!("{table}.name");
        if let Some(name) = own.name.as_deref() {
            if let Some((other, _)) = taken.iter().find(|(_, taken)| *taken == name) {
                let reason = format!("{other} has the same name");
                check.report(ProblemKind::Duplicate, &setting, reason).value = Some(format!("\"{name}\""));
            }
            taken.push((table.clone(), name));
        }
        let name = check.topic_name(own.name.as_deref(), &setting);
        let received = received(check, &table, own, registry);
        let received = received.and_then(|received| Some((sent(check, &table, own, &received)?, received)));
        plans.push(name.zip(received).map(|(name, (input, received))| SourcePlan {
            name,
            carries: received.carries,
            input,
            any_order: false,
            max_age_ns: u64::from(own.max_age_ms.unwrap_or(MAX_AGE_MS)) * 1_000_000,
            receiver: received.receiver,
        }));
    }
    plans.into_iter().collect()
}

/// How its values come in, as its kind makes it of its keys.
fn received(check: &mut Check, table: &str, own: &SourceTable, registry: &Registry) -> Option<Received> {
    let kinds = &registry.receivers;
    let (kind, make) = check.known(kinds, &format!("{table}.receiver"), own.receiver.as_deref())?;
    let given = Given::of(own);
    check.kind_reads(kind, &given, &|key| format!("{table}.{key}"));
    check.nobody_reads(&[kind], &given, &kinds.sort, table);
    if kind.keys.iter().any(|key| key.is_needed && !given.has(key.name)) {
        return None;
    }
    check.made(make(own).map_err(|error| error.under(table)))
}

/// A program's values: its own, or those that what it sends has.
fn sent(check: &mut Check, table: &str, own: &SourceTable, received: &Received) -> Option<Vec<SentPlan>> {
    if !received.input.is_empty() {
        return Some(received.input.clone());
    }
    let carries = received.carries;
    let setting = format!("{table}.input");
    if carries != Carries::Values {
        if !own.input.is_empty() {
            let reason = "what it sends has its own values";
            let problem = check.report(ProblemKind::Contradiction, &setting, reason);
            problem.limit = Some("no `input`, or `carries = \"values\"`".into());
            return None;
        }
        let plan = |(name, unit): &(&str, &str)| SentPlan {
            name: (*name).to_owned(),
            unit: (*unit).to_owned(),
            bounds: [f64::NEG_INFINITY, f64::INFINITY],
        };
        return Some(carries.values().iter().map(plan).collect());
    }
    if own.input.is_empty() || own.input.len() > MAX_SOURCE_VALUES {
        let problem =
            check.report(ProblemKind::OutOfRange, &setting, "too few or too many values of one program");
        problem.value = Some(format!("{} values", own.input.len()));
        problem.limit = Some(format!("1 to {MAX_SOURCE_VALUES}"));
        return None;
    }
    // Recordings have a column for each, and two beside them.
    let mut seen = vec!["age".to_owned(), column_name("age", "s"), column_name("instant", "ns")];
    seen.push("instant".to_owned());
    let resolved: Vec<Option<SentPlan>> = own
        .input
        .iter()
        .enumerate()
        .map(|(n, sent)| {
            let table = format!("{setting}[{n}]");
            let plan = value(check, &table, sent)?;
            let column = column_name(&plan.name, &plan.unit);
            if seen.contains(&plan.name) || seen.contains(&column) {
                let reason =
                    "another value of this program, its age or its instant is called so, or so with its unit";
                check.report(ProblemKind::Duplicate, &format!("{table}.name"), reason).value =
                    Some(format!("\"{}\"", plan.name));
                return None;
            }
            seen.extend([plan.name.clone(), column]);
            Some(plan)
        })
        .collect();
    resolved.into_iter().collect()
}

fn value(check: &mut Check, table: &str, own: &SentTable) -> Option<SentPlan> {
    let name = check.signal_name(own.name.as_deref(), &format!("{table}.name"));
    let unit = check.unit(own.unit.as_deref(), &format!("{table}.unit"));
    let bounds = [own.least.unwrap_or(f64::NEG_INFINITY), own.greatest.unwrap_or(f64::INFINITY)];
    let [least, greatest] = bounds;
    if least.is_nan() || greatest.is_nan() || least >= greatest {
        let problem = check.report(
            ProblemKind::OutOfRange,
            &format!("{table}.greatest"),
            "no value lies between `least` and `greatest`",
        );
        (problem.value, problem.limit) = (Some(greatest.to_string()), Some(format!("above least = {least}")));
        return None;
    }
    Some(SentPlan { name: name?, unit: unit?, bounds })
}
