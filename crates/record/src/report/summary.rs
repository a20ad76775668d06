//! The head of the page: which run this is, and its figures.

use super::signals::Signals;
use super::text::{self, escape};
use super::totals::Totals;
use super::tracking::{BelievedAndTrue, Tracking};
use std::f64::consts::{PI, TAU};
use std::fmt::Write;

/// Which run this is.
pub(super) fn title(signals: &Signals<'_>) -> String {
    let robot = signals.text("robot").unwrap_or("robot");
    match signals.text("reference") {
        Some(reference) => format!("{robot}: {reference}"),
        None => format!("Run of {robot}"),
    }
}

/// Title, figures, and what the reader must know about the file.
pub(super) fn html(signals: &Signals<'_>, tracking: &Tracking, totals: &Totals, title: &str) -> String {
    let mut html = format!("<header><h1>{}</h1>\n<p class=\"facts\">", escape(title));
    let facts = [("mode", "controller"), ("date", "recorded"), ("version", "omnibase")];
    let facts: Vec<String> = facts
        .iter()
        .filter_map(|(key, name)| Some(format!("{name} <b>{}</b>", escape(signals.text(key)?))))
        .collect();
    html.push_str(&facts.join(" · "));
    html.push_str("</p>\n");
    if let Some(reason) = &signals.run().truncated {
        let reason = escape(reason);
        let _ = writeln!(
            html,
            "<p class=\"warning\">The recording ends early ({reason}): what follows is what could be read.</p>"
        );
    }
    if let Some(end) = signals.text("ended_early") {
        let _ = writeln!(html, "<p class=\"warning\">The run ended early: {}</p>", escape(end));
    }
    html.push_str("</header>\n<section id=\"summary\"><h2>Summary</h2>\n<div class=\"tables\">");
    html.push_str(&errors(tracking, totals));
    html.push_str(&measured(signals, tracking));
    html.push_str(&counts(signals, totals));
    html.push_str("</div></section>\n");
    html
}

/// Lengths of errors in mm, of mad ones in m; the same for a whole table, that its numbers compare at a glance.
fn length(value: f64) -> String {
    if value.abs() < 10.0 {
        format!("{} mm", text::fixed(value * 1e3, 3))
    } else {
        format!("{} m", text::significant(value))
    }
}

fn angle(value: f64) -> String {
    format!("{} mrad <small>({}°)</small>", text::fixed(value * 1e3, 3), text::fixed(value.to_degrees(), 4))
}

/// A cell of a table: programs read the exact value, in SI units.
fn cell(value: f64, words: fn(f64) -> String) -> String {
    format!("<td class=\"number\"><data value=\"{value:e}\">{}</data></td>", words(value))
}

fn errors(tracking: &Tracking, totals: &Totals) -> String {
    let figures = tracking.figures(totals);
    let knows_truth = tracking.truth.is_some();
    let shown = |value: Option<f64>, words: fn(f64) -> String| {
        value.map_or("<td class=\"number\">\u{2013}</td>".to_owned(), |value| cell(value, words))
    };
    let row = |name: &str, figure: BelievedAndTrue, words: fn(f64) -> String| {
        let truth = if knows_truth { shown(figure.truth, words) } else { String::new() };
        format!("<tr><th>{name}</th>{}{truth}</tr>\n", shown(figure.believed, words))
    };
    let truth = if knows_truth { "<th class=\"number\">true</th>" } else { "" };
    let mut html = format!(
        "<table class=\"figures\"><thead><tr><th>Error</th><th class=\"number\">believed</th>{truth}</tr></thead>\
         <tbody>\n"
    );
    html.push_str(&row("Final position", figures.final_error_m, length));
    html.push_str(&row("RMS position", figures.rms_error_m, length));
    html.push_str(&row("Greatest position", figures.max_error_m, length));
    html.push_str(&row("Final heading", figures.final_heading_error_rad, angle));
    html.push_str("</tbody></table>\n");
    html
}

/// What a person measured on the floor, from where it should have ended and from where it believed to stand.
fn measured(signals: &Signals<'_>, tracking: &Tracking) -> String {
    let Some(&[there]) = signals.tuples::<3>(super::MEASURED).first_chunk() else { return String::new() };
    let mut html = String::from(
        "<table class=\"figures\"><thead><tr><th>Measured on the floor</th><th class=\"number\">x</th>\
         <th class=\"number\">y</th><th class=\"number\">distance</th><th class=\"number\">heading</th></tr></thead>\n<tbody>",
    );
    let [wished, believed] = tracking.ends();
    for (name, from) in
        [("in odom", Some([0.0; 3])), ("from the wished end", wished), ("from the believed", believed)]
    {
        let Some(from) = from else { continue };
        let [x, y, turned] = std::array::from_fn(|at| there[at] - from[at]);
        let heading = (turned + PI).rem_euclid(TAU) - PI;
        let cells = [cell(x, length), cell(y, length), cell(x.hypot(y), length), cell(heading, angle)];
        let _ = writeln!(html, "<tr><th>{name}</th>{}</tr>", cells.concat());
    }
    html.push_str("</tbody></table>\n");
    html
}

fn counts(signals: &Signals<'_>, totals: &Totals) -> String {
    let duration = signals.times_s.last().copied();
    let whole = |key: &str| signals.number(key).map(|number| number.max(0.0) as u64);
    let number = |value: Option<u64>| value.map(text::count);
    let entries = [
        ("Cycles", number(whole("cycles").or(Some(totals.cycles)))),
        ("Duration", duration.map(text::duration)),
        ("Lost or incomplete frames", number(whole("lost_frames").or(totals.lost))),
        ("Overruns", number(whole("overruns"))),
        ("Records dropped", number(whole("records_dropped"))),
        ("Times real time", signals.number("realtime_factor").map(text::significant)),
    ];
    let mut html = String::from("<table class=\"figures\"><tbody>\n");
    for (name, value) in entries {
        let value = value.unwrap_or_else(|| "not recorded".to_owned());
        let _ = writeln!(html, "<tr><th>{name}</th><td class=\"number\">{value}</td></tr>");
    }
    html.push_str("</tbody></table>\n");
    html
}
