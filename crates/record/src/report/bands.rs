//! What the robot was doing, as coloured bands over time.

use super::chart::{self, Marked, Stretch};
use super::curve;
use super::text::escape;
use std::borrow::Cow;
use std::fmt::Write;

/// A choice: its code, its name, its look.
pub(super) type Choice = (u64, &'static str, &'static str);

/// Phases of a robot's life by the codes that the recording holds.
pub(super) const PHASES: [Choice; 7] = [
    (0, "disabled", "band-off"),
    (1, "enabling", "band-wait"),
    (2, "holding", "band-hold"),
    (3, "tracking", "band-go"),
    (4, "stopping", "band-stop"),
    (5, "quick stop", "band-quick"),
    (6, "fault", "band-fault"),
];

/// What safety did, by the codes that the recording holds.
pub(super) const ACTIONS: [Choice; 5] = [
    (0, "pass", "band-off"),
    (1, "quick stop", "band-quick"),
    (2, "remove torque", "band-fault"),
    (3, "ramp down, then remove torque", "band-stop"),
    (4, "ramp down and hold", "band-wait"),
];

/// What became of the frames, by the codes that the recording holds.
pub(super) const EXCHANGES: [Choice; 4] = [
    (0, "complete", "band-off"),
    (1, "lost", "band-fault"),
    (2, "working counter short", "band-stop"),
    (3, "drives started anew", "band-wait"),
];

/// Whether commands had to be scaled down.
pub(super) const SATURATION: [Choice; 2] = [(0, "as wished", "band-off"), (1, "scaled down", "band-sat")];

/// What is only on or off.
pub(super) const SWITCH: [Choice; 2] = [(0, "off", "band-off"), (1, "on", "band-go")];

/// A row of bands.
pub(super) struct Band {
    /// Its name.
    pub(super) name: Cow<'static, str>,
    /// What there is to see.
    pub(super) choices: &'static [Choice],
    /// The code of each cycle.
    pub(super) codes: Vec<f64>,
}

impl Band {
    /// Stretches of one code, in order. What is shorter than can be seen is joined to what lies close by.
    fn stretches(&self, times: &[f64], code: u64) -> Vec<Stretch> {
        let least = chart::time_span(times).width() / curve::COLUMNS as f64;
        let mut stretches: Vec<Stretch> = Vec::new();
        for (row, (&time, &now)) in times.iter().zip(&self.codes).enumerate() {
            if now != code as f64 {
                continue;
            }
            let to = times.get(row + 1).copied().unwrap_or(time);
            match stretches.last_mut() {
                Some(last) if time - last.to <= least || time - last.from <= least => last.to = to,
                _ => stretches.push(Stretch { from: time, to }),
            }
        }
        stretches
    }

    /// The stretches of `code`, to be marked behind curves by `name`.
    pub(super) fn marked(&self, times: &[f64], code: u64, name: &'static str) -> Option<Marked> {
        let (_, _, class) = *self.choices.iter().find(|choice| choice.0 == code)?;
        let stretches = self.stretches(times, code);
        (!stretches.is_empty()).then_some(Marked { name, class, stretches })
    }
}

/// The bands, one below the other, with a legend of what occurs.
pub(super) fn html(title: &str, times: &[f64], bands: &[Band]) -> String {
    let time = chart::time_span(times);
    let (mut rows, mut legend) = (String::new(), String::new());
    for band in bands {
        let (mut pieces, mut words) = (String::new(), String::new());
        // What was so for a long time is drawn first, that what was short stands above it.
        let mut found: Vec<(f64, Choice, Vec<Stretch>)> = Vec::new();
        for choice in band.choices {
            let stretches = band.stretches(times, choice.0);
            let total = stretches.iter().map(|stretch| stretch.to - stretch.from).sum();
            found.push((total, *choice, stretches));
        }
        found.sort_by(|one, other| other.0.total_cmp(&one.0));
        let mut present: Vec<Choice> = Vec::new();
        for (_, choice, stretches) in found.iter().filter(|(_, _, stretches)| !stretches.is_empty()) {
            present.push(*choice);
            for stretch in stretches {
                let (from, to) = (100.0 * time.part(stretch.from), 100.0 * time.part(stretch.to));
                let width = (to - from).max(0.15);
                let _ = write!(
                    pieces,
                    "<rect class=\"{}\" x=\"{from:.2}%\" width=\"{width:.2}%\" height=\"100%\"/>",
                    choice.2
                );
                // A letter is about 1 % of the chart wide on paper, and more on a phone, which shows no words.
                if width > 2.0 + 1.1 * choice.1.chars().count() as f64 {
                    let _ = write!(
                        words,
                        "<text class=\"in-band\" x=\"{:.2}%\" y=\"50%\" dy=\"0.34em\" text-anchor=\"middle\">{}</text>",
                        from + 0.5 * width,
                        escape(choice.1)
                    );
                }
            }
        }
        present.sort_by_key(|choice| choice.0);
        if let [only] = present.as_slice() {
            // One word in the whole of the band says it all, on a phone too.
            words = format!(
                "<text class=\"in-band whole\" x=\"50%\" y=\"50%\" dy=\"0.34em\" text-anchor=\"middle\">{}</text>",
                escape(only.1)
            );
        }
        let entries: String = present.iter().map(|choice| chart::key(choice.2, "area", choice.1)).collect();
        if present.len() > 1 {
            let name = escape(&band.name);
            let _ = write!(legend, "<ul class=\"legend\"><li><b>{name}:</b></li>{entries}</ul>");
        }
        let _ = write!(
            rows,
            "<div class=\"band\"><svg role=\"img\" aria-label=\"{0}\">{pieces}{words}</svg><span>{0}</span></div>",
            escape(&band.name)
        );
    }
    let mut axis = String::new();
    for (number, tick) in time.ticks(8).iter().enumerate() {
        let odd = if number % 2 == 1 { " class=\"odd\"" } else { "" };
        let at = 100.0 * time.part(tick.value);
        let _ = write!(
            axis,
            "<text{odd} x=\"{at:.2}%\" y=\"0\" dy=\"1.1em\" text-anchor=\"middle\">{}</text>",
            tick.label
        );
    }
    format!(
        "<figure class=\"chart\"><figcaption>{}</figcaption>{legend}<div class=\"plot bands\">{rows}\
         <svg class=\"band-axis grid\" aria-hidden=\"true\">{axis}\
         <text class=\"axis\" x=\"100%\" y=\"0\" dy=\"2.4em\" text-anchor=\"end\">time in s</text></svg>\
         </div></figure>\n",
        escape(title)
    )
}
