//! A growth as a picture: both axes by decades where there is more than one of them across, else even from 0.

use std::fmt::Write;

use super::Growth;

const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 470.0;
/// Left, top, right and bottom of the curves.
const AREA: [f64; 4] = [70.0, 90.0, 740.0, 420.0];
const COLOURS: [&str; 5] = ["#0b5fa5", "#c4501b", "#2d8a4e", "#7b4ab0", "#7a6a00"];

/// From values to places in the picture.
#[derive(Clone, Copy)]
enum Axis {
    /// From a power of ten to another one.
    Decades([i32; 2]),
    /// From 0 to so much, in steps.
    Even { most: f64, step: f64 },
}

impl Axis {
    fn of(values: &[f64], by_decades: bool) -> Axis {
        let most = values.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        if by_decades {
            let least = values.iter().copied().fold(most, f64::min);
            let low = least.log10().floor() as i32;
            return Axis::Decades([low, (most.log10().ceil() as i32).max(low + 1)]);
        }
        let decade = 10_f64.powf(most.log10().floor());
        let step = [0.2, 0.5, 1.0, 2.0].map(|part| part * decade).into_iter().find(|step| most / step <= 8.0);
        let step = step.unwrap_or(2.0 * decade);
        Axis::Even { most: (most / step).ceil() * step, step }
    }

    /// Share of the axis.
    fn share(self, value: f64) -> f64 {
        match self {
            Axis::Decades([low, high]) => (value.log10() - f64::from(low)) / f64::from(high - low),
            Axis::Even { most, .. } => value / most,
        }
    }

    /// Values with a line.
    fn lines(self) -> Vec<f64> {
        match self {
            Axis::Decades([low, high]) => (low..=high).map(|power| 10_f64.powi(power)).collect(),
            Axis::Even { most, step } => {
                (0..=(most / step).round() as u32).map(|n| f64::from(n) * step).collect()
            }
        }
    }
}

/// A number on an axis.
fn number(value: f64) -> String {
    if value >= 1e4 { format!("{value:e}") } else { format!("{}", (1e3 * value).round() * 1e-3) }
}

pub(super) fn svg(growth: &Growth) -> String {
    let [left, top, right, bottom] = AREA;
    let across: Vec<f64> = growth.rows.iter().map(|(count, _)| *count).collect();
    let up: Vec<f64> = growth.rows.iter().flat_map(|(_, values)| values.iter().copied()).collect();
    let most = across.iter().copied().fold(0.0, f64::max);
    let by_decades = across.first().is_some_and(|first| *first > 0.0 && most / first > 10.0);
    let axes = [Axis::of(&across, by_decades), Axis::of(&up, by_decades)];
    let x = |count: f64| left + (right - left) * axes[0].share(count);
    let y = |value: f64| bottom - (bottom - top) * axes[1].share(value);
    let mut picture = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" \
         font-family=\"sans-serif\" font-size=\"13\" fill=\"#222\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
         <text x=\"20\" y=\"28\" font-size=\"17\">{}</text>\n\
         <text x=\"{right}\" y=\"{}\" text-anchor=\"end\">{}</text>\n",
        growth.title,
        bottom + 36.0,
        growth.across
    );
    for value in axes[0].lines() {
        let (at, below) = (x(value), bottom + 18.0);
        let _ = writeln!(
            picture,
            "<path d=\"M{at:.1} {top}V{bottom}\" stroke=\"#ddd\"/><text x=\"{at:.1}\" y=\"{below}\" text-anchor=\"middle\">{}</text>",
            number(value)
        );
    }
    for value in axes[1].lines() {
        let at = y(value);
        let _ = writeln!(
            picture,
            "<path d=\"M{left} {at:.1}H{right}\" stroke=\"#ddd\"/><text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            left - 7.0,
            at + 4.5,
            number(value)
        );
    }
    let mut beside = 20.0;
    for (curve, (name, colour)) in growth.curves.iter().zip(COLOURS).enumerate() {
        let points: Vec<[f64; 2]> =
            growth.rows.iter().map(|(count, values)| [x(*count), y(values[curve])]).collect();
        let line: Vec<String> = points.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        let _ = writeln!(
            picture,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>",
            line.join(" ")
        );
        for [x, y] in points {
            let _ = writeln!(picture, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.5\" fill=\"{colour}\"/>");
        }
        let _ = writeln!(
            picture,
            "<path d=\"M{beside} 58h22\" stroke=\"{colour}\" stroke-width=\"2.5\"/><text x=\"{}\" y=\"62\">{name}</text>",
            beside + 28.0
        );
        beside += 46.0 + 7.0 * name.chars().count() as f64;
    }
    picture + "</svg>\n"
}
