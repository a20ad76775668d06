//! How often what was how long.

use super::chart::{self, Axes, Figure, HEIGHT, WIDTH};
use super::scale::{Span, Tick};
use super::text::{self, Unit};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Bars of a histogram.
const BARS: usize = 80;
/// From this ratio of the greatest to the median on, the axis of values is logarithmic.
const LONG_TAIL: f64 = 20.0;

/// Bits of a number that don't tell it from its neighbours: what is left differs by less than 0.007 %.
const ALIKE_BITS: u32 = 38;

/// Places of a sorted list by their share, of which values that are alike stand once: any number of them needs little room.
#[derive(Clone, Debug, Default)]
pub(super) struct Quantiles {
    alike: BTreeMap<i64, Alike>,
    count: u64,
}

/// Values that are alike.
#[derive(Clone, Copy, Debug)]
struct Alike {
    least: f64,
    greatest: f64,
    count: u64,
}

impl Quantiles {
    /// Takes another value, where it is finite.
    pub(super) fn push(&mut self, value: f64) {
        if !value.is_finite() {
            return;
        }
        // In the order of `total_cmp`.
        let bits = value.to_bits().cast_signed();
        let order = bits ^ ((bits >> 63).cast_unsigned() >> 1).cast_signed();
        let first = Alike { least: value, greatest: value, count: 0 };
        let alike = self.alike.entry(order >> ALIKE_BITS).or_insert(first);
        alike.least = alike.least.min(value);
        alike.greatest = alike.greatest.max(value);
        alike.count += 1;
        self.count += 1;
    }

    /// A value that at least `share` of all values don't exceed, and that hardly any more do; `None` where there is none.
    pub(super) fn at(&self, share: f64) -> Option<f64> {
        let rank = (share * self.count as f64).ceil() as u64;
        if rank == 0 {
            return self.alike.values().next().map(|alike| alike.least);
        }
        let mut before = 0;
        let found = self.alike.values().find(|alike| {
            before += alike.count;
            before >= rank
        });
        found.or(self.alike.values().next_back()).map(|alike| alike.greatest)
    }
}

/// A histogram of times in s, with a logarithmic axis of counts, that the rarest is seen too; and the period of the
/// cycle, in s, where it is known.
pub(super) fn html(title: &str, quantiles: &Quantiles, period_s: Option<f64>) -> String {
    let (Some(least), Some(median), Some(greatest)) =
        (quantiles.at(0.0), quantiles.at(0.5), quantiles.at(1.0))
    else {
        return format!("<p class=\"absent\">{}: no values were recorded.</p>\n", text::escape(title));
    };
    if greatest == 0.0 {
        let title = text::escape(title);
        return format!(
            "<p class=\"absent\">{title}: none in any cycle, for virtual time stands still meanwhile.</p>\n"
        );
    }
    let unit = Unit::time(greatest);
    let is_logarithmic = least > 0.0 && greatest > LONG_TAIL * median;
    let along = |value: f64| if is_logarithmic { (value * unit.factor).log10() } else { value * unit.factor };
    let span = Span { low: along(least), high: along(greatest) }.padded(0.02);
    let mut counts = [0u64; BARS];
    for alike in quantiles.alike.values() {
        let bar = (span.part(along(alike.greatest)) * BARS as f64) as usize;
        counts[bar.min(BARS - 1)] += alike.count;
    }
    let most = counts.iter().copied().max().unwrap_or(1).max(1);
    // Half a decade below one, that a single cycle is a bar that can be seen.
    let heights = Span { low: -0.5, high: (most as f64).log10() + 0.15 };
    let width = WIDTH / BARS as f64;
    let mut inner = String::new();
    for (bar, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0) {
        let top = HEIGHT * (1.0 - heights.part((*count as f64).log10()));
        let (left, height) = (width * bar as f64, HEIGHT - top);
        let _ = write!(
            inner,
            "<rect class=\"bar\" x=\"{left:.0}\" y=\"{top:.0}\" width=\"{:.0}\" height=\"{height:.0}\"/>",
            width - 2.0
        );
    }
    let decades = (0..=heights.high.floor().max(0.0) as i32).map(|power| Tick {
        value: f64::from(power),
        label: text::count(10u64.saturating_pow(power.unsigned_abs())),
    });
    let x = if is_logarithmic { logarithmic_ticks(span) } else { span.ticks(8) };
    let axis = format!("time in {}{}", unit.name, if is_logarithmic { ", logarithmic" } else { "" });
    let axes =
        Axes { x, x_span: span, x_title: &axis, y: decades.collect(), y_span: heights, y_title: "cycles" };
    let mut legend = String::new();
    for (name, share) in [("median", 0.5), ("99 %", 0.99), ("99.9 %", 0.999), ("max", 1.0)] {
        if let Some(value) = quantiles.at(share) {
            let entry = format!("{name} {} {}", text::significant(value * unit.factor), unit.name);
            legend.push_str(&chart::key("", "none", &entry));
        }
    }
    if let Some(period) = period_s.filter(|period| *period > 0.0) {
        let name = format!("period {} {}", text::significant(period * unit.factor), unit.name);
        let at = (WIDTH * span.part(along(period))).round();
        let sort = if (0.0..=WIDTH).contains(&at) { "line" } else { "none" };
        legend.push_str(&chart::key("limit", sort, &name));
        if sort == "line" {
            let _ = write!(inner, "<path class=\"limit\" d=\"M{at} 0V{HEIGHT}\"/>");
        }
    }
    chart::figure(&Figure {
        title,
        class: "chart low",
        style: "",
        legend,
        axes,
        inner,
        labels: String::new(),
    })
}

/// Marks at 1, 2 and 5 times each power of ten, of a span of decadic logarithms.
fn logarithmic_ticks(span: Span) -> Vec<Tick> {
    let mut ticks = Vec::new();
    for power in span.low.floor() as i32..=span.high.floor() as i32 {
        for digit in [1.0, 2.0, 5.0] {
            let value: f64 = digit * 10f64.powi(power);
            if (span.low..=span.high).contains(&value.log10()) {
                let decimals = (-power).max(0).unsigned_abs() as usize;
                ticks.push(Tick { value: value.log10(), label: text::fixed(value, decimals) });
            }
        }
    }
    if ticks.len() > 8 {
        ticks.retain(|tick| (tick.value - tick.value.round()).abs() < 1e-9);
    }
    ticks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_values_that_occurred() {
        let of = |values: &mut dyn Iterator<Item = f64>| {
            let mut quantiles = Quantiles::default();
            values.for_each(|value| quantiles.push(value));
            quantiles
        };
        let quantiles = of(&mut (1..=1000).rev().map(f64::from).chain([f64::NAN]));
        assert_eq!(
            [0.0, 0.5, 0.99, 0.999, 1.0].map(|share| quantiles.at(share)),
            [1.0, 500.0, 990.0, 999.0, 1000.0].map(Some)
        );
        assert_eq!(of(&mut std::iter::empty()).at(0.5), None);
        assert_eq!(of(&mut [3.0].into_iter()).at(1.0), Some(3.0));
        let signed = of(&mut [2.0, -3.0, 0.5, -0.25].into_iter());
        assert_eq!(
            [0.0, 0.25, 0.5, 0.75, 1.0].map(|share| signed.at(share).unwrap()),
            [-3.0, -3.0, -0.25, 0.5, 2.0]
        );
    }

    #[test]
    fn one_late_cycle_among_many_is_a_bar() {
        let mut values = vec![50e-6; 100_000];
        values[77] = 5e-3;
        let mut quantiles = Quantiles::default();
        values.into_iter().for_each(|value| quantiles.push(value));
        let html = html("Round trip", &quantiles, Some(1e-3));
        assert_eq!(html.matches("class=\"bar\"").count(), 2);
        assert!(html.contains("time in us, logarithmic") && html.contains("max 5000 us"), "{html}");
        // The period of 1 ms lies between 50 us and 5 ms, as log 20 lies between 0 and log 100, but for the margins.
        let at = html.split("<path class=\"limit\" d=\"M").nth(2).unwrap().split(' ').next().unwrap();
        let expected = WIDTH * (0.02 + 20f64.log10() / 2.0) / 1.04;
        assert!((at.parse::<f64>().unwrap() - expected).abs() < 1.0, "{at}");
        assert!(html.contains("period 1000 us"), "{html}");
    }
}
