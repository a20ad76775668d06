//! What stands beside the drives: inputs, outputs and axes.

use super::bands::{self, Band};
use super::chart::{LOOKS, Line, TimeChart};
use super::signals::{Signals, ValueBeside};
use super::text::Unit;

/// Charts of each device and each program: what is only on or off as bands, the rest as curves, those of one unit together.
/// Nothing for a robot that has none.
pub(super) fn html(signals: &Signals<'_>) -> String {
    let mut switches = Vec::new();
    let mut curves = String::new();
    for (of, values) in signals.beside() {
        let (on_or_off, others): (Vec<_>, Vec<_>) = values.into_iter().partition(ValueBeside::is_on_or_off);
        switches.extend(on_or_off.into_iter().map(|value| Band {
            name: format!("{of}: {}", value.name).into(),
            choices: &bands::SWITCH,
            codes: value.values,
        }));
        let mut left = others;
        while let Some(first) = left.first() {
            let unit = first.unit;
            // Numbers without a unit have nothing in common.
            let (together, rest) = match unit {
                Some(_) => left.into_iter().partition(|value| value.unit == unit),
                None => {
                    let rest = left.split_off(1);
                    (left, rest)
                }
            };
            left = rest;
            curves.push_str(&chart(&of, unit.unwrap_or_default(), &together, &signals.times_s));
        }
    }
    if !switches.is_empty() {
        curves.insert_str(0, &bands::html("Switched on and off", &signals.times_s, &switches));
    }
    curves
}

fn chart(of: &str, unit: &'static str, values: &[ValueBeside], times: &[f64]) -> String {
    let names: Vec<&str> = values.iter().map(|value| value.name.as_str()).collect();
    let lines = values.iter().zip(LOOKS.iter().cycle()).map(|(value, look)| Line {
        name: value.name.clone(),
        class: (*look).to_owned(),
        values: &value.values,
    });
    TimeChart {
        title: &format!("{of}: {}", names.join(", ")),
        unit: Unit::plain(unit),
        times,
        lines: lines.collect(),
        limits: Vec::new(),
        marked: &[],
    }
    .html()
}
