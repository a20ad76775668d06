//! Curves over time as SVG.
//!
//! A chart is as wide as there is room, on a phone as on paper: places are parts of the whole, and only the curves
//! themselves, which have no letters, are stretched.

use super::curve;
use super::scale::{Span, Tick};
use super::text::{self, Unit, escape};
use std::fmt::Write;

/// Width and height of the stretched part, in its own units: two per column of a curve.
pub(super) const WIDTH: f64 = 2.0 * curve::COLUMNS as f64;
pub(super) const HEIGHT: f64 = 1000.0;
/// A limit farther away than this many times the greatest value is told in words: drawn, it would flatten the curves.
const FAR_LIMIT: f64 = 5.0;

/// Looks of curves that stand side by side, as those of wheels.
pub(super) const LOOKS: [&str; 8] = ["w1", "w2", "w3", "w4", "w5", "w6", "w7", "w8"];

/// One curve.
pub(super) struct Line<'a> {
    /// Its name.
    pub(super) name: String,
    /// Its look, a class of the style sheet.
    pub(super) class: String,
    /// Its values, one per time.
    pub(super) values: &'a [f64],
}

/// A limit to both sides of zero.
pub(super) struct Limit {
    /// Its name.
    pub(super) name: String,
    /// Its look.
    pub(super) class: &'static str,
    /// What isn't to be exceeded.
    pub(super) value: f64,
}

/// A stretch of time that is marked behind the curves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stretch {
    /// Begin, s.
    pub(super) from: f64,
    /// End, s.
    pub(super) to: f64,
}

/// Stretches of time that mean the same.
pub(super) struct Marked {
    /// What they mean.
    pub(super) name: &'static str,
    /// Their look.
    pub(super) class: &'static str,
    /// Where they are.
    pub(super) stretches: Vec<Stretch>,
}

/// Curves over time.
pub(super) struct TimeChart<'a> {
    /// What is shown.
    pub(super) title: &'a str,
    /// In which unit.
    pub(super) unit: Unit,
    /// When, s.
    pub(super) times: &'a [f64],
    /// The curves; later ones lie above.
    pub(super) lines: Vec<Line<'a>>,
    /// Limits.
    pub(super) limits: Vec<Limit>,
    /// What is marked.
    pub(super) marked: &'a [Marked],
}

/// The time of a run as an axis.
pub(super) fn time_span(times: &[f64]) -> Span {
    let span = Span::of([times.first(), times.last()].into_iter().flatten().copied());
    span.filter(|span| span.width() > 0.0).unwrap_or(Span { low: 0.0, high: 1.0 })
}

impl TimeChart<'_> {
    /// The limits, those of one value as one.
    fn limits(&self) -> Vec<Limit> {
        let mut limits: Vec<Limit> = Vec::new();
        for Limit { name, class, value } in &self.limits {
            match limits.iter_mut().find(|known| known.value == *value) {
                Some(known) => known.name = format!("{} and {name}", known.name),
                None => limits.push(Limit { name: name.clone(), class, value: *value }),
            }
        }
        limits
    }

    /// The chart; a word instead where there is nothing to draw.
    pub(super) fn html(&self) -> String {
        let values = self.lines.iter().flat_map(|line| line.values.iter().copied());
        let Some(data) = Span::of(values) else {
            return format!("<p class=\"absent\">{}: no values were recorded.</p>\n", escape(self.title));
        };
        let greatest = data.low.abs().max(data.high.abs());
        let mut span = data.including(0.0);
        let mut legend =
            self.lines.iter().map(|line| key(&line.class, "line", &line.name)).collect::<String>();
        let mut limits = String::new();
        for limit in self.limits() {
            let value = text::significant(limit.value * self.unit.factor);
            let mut name = format!("{} ±{value} {}", limit.name, self.unit.name);
            if limit.value > FAR_LIMIT * greatest && greatest > 0.0 {
                name.push_str(" (beyond the chart)");
                legend.push_str(&key("", "none", &name));
                continue;
            }
            if data.low < 0.0 {
                span = span.including(-limit.value);
            }
            span = span.including(limit.value);
            legend.push_str(&key(limit.class, "line", &name));
        }
        let span = span.padded(0.05);
        let span = if data.low >= 0.0 { Span { low: span.low.max(0.0), ..span } } else { span };
        let scaled = Span { low: span.low * self.unit.factor, high: span.high * self.unit.factor };
        let time = time_span(self.times);
        for limit in self.limits() {
            for value in [limit.value, -limit.value] {
                let part = 1.0 - span.part(value);
                if (0.0..=1.0).contains(&part) {
                    let y = HEIGHT * part;
                    let _ = write!(limits, "<path class=\"{}\" d=\"M0 {y:.0}H{WIDTH}\"/>", limit.class);
                }
            }
        }
        let mut shades = String::new();
        for marked in self.marked.iter().filter(|marked| !marked.stretches.is_empty()) {
            legend.push_str(&key(marked.class, "area", marked.name));
            for stretch in &marked.stretches {
                let (from, to) = (WIDTH * time.part(stretch.from), WIDTH * time.part(stretch.to));
                let width = (to - from).max(1.0);
                let class = marked.class;
                let _ = write!(
                    shades,
                    "<rect class=\"{class}\" x=\"{from:.0}\" width=\"{width:.0}\" height=\"{HEIGHT}\"/>"
                );
            }
        }
        let mut curves = String::new();
        for line in &self.lines {
            let path = path(&curve::envelope(self.times, line.values), time, span);
            let _ = write!(curves, "<path class=\"{}\" d=\"{path}\"/>", line.class);
        }
        let axes = Axes {
            x: time.ticks(8),
            x_span: time,
            x_title: "time in s",
            y: scaled.ticks(5),
            y_span: scaled,
            y_title: self.unit.name,
        };
        let inner = format!("{shades}{limits}{curves}");
        figure(&Figure {
            title: self.title,
            class: "chart",
            style: "",
            legend,
            axes,
            inner,
            labels: String::new(),
        })
    }
}

/// An entry of a legend.
pub(super) fn key(class: &str, sort: &str, name: &str) -> String {
    let swatch = match sort {
        "line" => format!("<path class=\"{class}\" d=\"M0 5H26\"/>"),
        "area" => format!("<rect class=\"{class}\" width=\"26\" height=\"10\"/>"),
        "square" => format!("<rect class=\"{class}\" x=\"8.5\" y=\"0.5\" width=\"9\" height=\"9\"/>"),
        "mark" => format!("<circle class=\"{class}\" cx=\"13\" cy=\"5\" r=\"4.5\"/>"),
        _ => String::new(),
    };
    let picture = if swatch.is_empty() {
        String::new()
    } else {
        format!("<svg class=\"swatch\" viewBox=\"0 0 26 10\" aria-hidden=\"true\">{swatch}</svg>")
    };
    format!("<li>{picture}{}</li>", escape(name))
}

/// What stands beside a chart.
pub(super) struct Axes<'a> {
    pub(super) x: Vec<Tick>,
    pub(super) x_span: Span,
    pub(super) x_title: &'a str,
    pub(super) y: Vec<Tick>,
    pub(super) y_span: Span,
    pub(super) y_title: &'a str,
}

/// A chart with everything around it.
pub(super) struct Figure<'a> {
    pub(super) title: &'a str,
    pub(super) class: &'a str,
    pub(super) style: &'a str,
    /// Entries made by [`key`].
    pub(super) legend: String,
    pub(super) axes: Axes<'a>,
    /// What is drawn, in [`WIDTH`] by [`HEIGHT`].
    pub(super) inner: String,
    /// Words above it, at parts of the whole.
    pub(super) labels: String,
}

/// A chart with title, legend, grid and axes.
pub(super) fn figure(figure: &Figure<'_>) -> String {
    let Axes { x, x_span, x_title, y, y_span, y_title } = &figure.axes;
    let title = escape(figure.title);
    let mut grid = String::new();
    for (number, tick) in x.iter().enumerate() {
        let at = 100.0 * x_span.part(tick.value);
        // Every other number is hidden where there is no room.
        let odd = if number % 2 == 1 { " class=\"odd\"" } else { "" };
        let _ = write!(
            grid,
            "<line x1=\"{at:.2}%\" x2=\"{at:.2}%\" y2=\"100%\"/>\
             <text{odd} x=\"{at:.2}%\" y=\"100%\" dy=\"1.4em\" text-anchor=\"middle\">{}</text>",
            tick.label
        );
    }
    for tick in y {
        let at = 100.0 - 100.0 * y_span.part(tick.value);
        let zero = if tick.value == 0.0 { " class=\"zero\"" } else { "" };
        let _ = write!(
            grid,
            "<line{zero} x2=\"100%\" y1=\"{at:.2}%\" y2=\"{at:.2}%\"/>\
             <text x=\"-6\" y=\"{at:.2}%\" dy=\"0.32em\" text-anchor=\"end\">{}</text>",
            tick.label
        );
    }
    let style = if figure.style.is_empty() { String::new() } else { format!(" style=\"{}\"", figure.style) };
    format!(
        "<figure class=\"{}\"><figcaption>{title}</figcaption><ul class=\"legend\">{}</ul>\
         <div class=\"plot\"{style}><svg class=\"frame\" role=\"img\" aria-label=\"{title}\">\
         <rect class=\"paper\" width=\"100%\" height=\"100%\"/><g class=\"grid\">{grid}</g>\
         <text class=\"axis\" x=\"-6\" y=\"0\" dy=\"-0.9em\" text-anchor=\"end\">{}</text>\
         <text class=\"axis\" x=\"100%\" y=\"100%\" dy=\"2.7em\" text-anchor=\"end\">{}</text>\
         <svg class=\"data\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" preserveAspectRatio=\"none\" width=\"100%\" \
         height=\"100%\">{}</svg>{}</svg></div></figure>\n",
        figure.class,
        figure.legend,
        escape(y_title),
        escape(x_title),
        figure.inner,
        figure.labels
    )
}

/// Stretches of points as the data of an SVG path; points that don't show are left out.
pub(super) fn path(stretches: &[Vec<(f64, f64)>], x: Span, y: Span) -> String {
    let mut data = String::new();
    for stretch in stretches {
        let place = |point: &(f64, f64)| {
            let across = (WIDTH * x.part(point.0)).round().clamp(-WIDTH, 2.0 * WIDTH);
            let down = (HEIGHT * (1.0 - y.part(point.1))).round().clamp(-HEIGHT, 2.0 * HEIGHT);
            (across as i64, down as i64)
        };
        let mut points: Vec<(i64, i64)> = Vec::with_capacity(stretch.len());
        for point in stretch.iter().map(place) {
            match points.as_slice() {
                [.., last] if *last == point => continue,
                // On the way along a level or a column, only its ends are needed.
                [.., before, last]
                    if before.1 == last.1 && last.1 == point.1 && last.0 <= point.0 && before.0 <= last.0 =>
                {
                    points.pop();
                }
                _ => {}
            }
            points.push(point);
        }
        for (number, (across, down)) in points.iter().enumerate() {
            let letter = ["M", "L", " "][number.min(2)];
            let _ = write!(data, "{letter}{across} {down}");
        }
        if points.len() == 1 {
            // With round ends a line of no length is a dot.
            data.push_str("h0");
        }
    }
    data
}
