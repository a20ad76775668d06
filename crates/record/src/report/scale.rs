//! From numbers to places on paper, and the round numbers that stand beside an axis.

use super::text;

/// A stretch of numbers along an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Span {
    /// Where the axis begins.
    pub(super) low: f64,
    /// Where it ends; above `low`.
    pub(super) high: f64,
}

/// A mark beside an axis.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tick {
    /// The number.
    pub(super) value: f64,
    /// The number in words.
    pub(super) label: String,
}

impl Span {
    /// The least span that holds all finite `values`; `None` where there are none.
    pub(super) fn of(values: impl IntoIterator<Item = f64>) -> Option<Span> {
        let mut span: Option<Span> = None;
        for value in values.into_iter().filter(|value| value.is_finite()) {
            let known = span.get_or_insert(Span { low: value, high: value });
            *known = Span { low: known.low.min(value), high: known.high.max(value) };
        }
        span
    }

    /// This span, widened to hold `value`.
    pub(super) fn including(self, value: f64) -> Span {
        Span { low: self.low.min(value), high: self.high.max(value) }
    }

    /// This span with a margin of `part` of its width; a span of one number becomes one with a width.
    pub(super) fn padded(self, part: f64) -> Span {
        let width = self.width();
        // What differs by rounding only is one number: no axis can tell such numbers apart.
        let least = 1e-9 * self.low.abs().max(self.high.abs());
        if width > least {
            return Span { low: self.low - part * width, high: self.high + part * width };
        }
        let margin = if self.low == 0.0 { 1.0 } else { 0.5 * self.low.abs() };
        Span { low: self.low - margin, high: self.high + margin }
    }

    /// From end to end.
    pub(super) fn width(self) -> f64 {
        self.high - self.low
    }

    /// Where `value` lies: 0 at the beginning, 1 at the end.
    pub(super) fn part(self, value: f64) -> f64 {
        (value - self.low) / self.width()
    }

    /// Round numbers within the span, about `count` of them: multiples of 1, 2 or 5 times a power of ten.
    pub(super) fn ticks(self, count: usize) -> Vec<Tick> {
        let raw = self.width() / count.max(1) as f64;
        if !(raw > 0.0 && raw.is_finite()) {
            return Vec::new();
        }
        let power = raw.log10().floor();
        let unit = 10f64.powf(power);
        let step =
            unit * [1.0, 2.0, 5.0, 10.0].into_iter().find(|&m| m * unit >= raw * 0.999).unwrap_or(10.0);
        let decimals = (-(step * 1.001).log10().floor()).max(0.0) as usize;
        let first = (self.low / step - 1e-9).ceil();
        let last = (self.high / step + 1e-9).floor();
        let steps = (last - first).max(-1.0) as usize;
        let ticks = (0..=steps).take_while(|_| last >= first).map(|number| {
            let value = (first + number as f64) * step;
            Tick { value, label: text::fixed(value, decimals) }
        });
        ticks.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(low: f64, high: f64, count: usize) -> Vec<String> {
        Span { low, high }.ticks(count).into_iter().map(|tick| tick.label).collect()
    }

    #[test]
    fn ticks_are_round_and_within() {
        assert_eq!(labels(0.0, 10.0, 5), ["0", "2", "4", "6", "8", "10"]);
        assert_eq!(labels(-0.034, 0.07, 5), ["0.00", "0.05"]);
        assert_eq!(labels(-0.034, 0.07, 6), ["\u{2212}0.02", "0.00", "0.02", "0.04", "0.06"]);
        assert_eq!(labels(3.0, 3.001, 2), ["3.0000", "3.0005", "3.0010"]);
        assert_eq!(labels(0.0, 600.0, 6), ["0", "100", "200", "300", "400", "500", "600"]);
        assert!(Span { low: 1.0, high: 1.0 }.ticks(5).is_empty());
    }

    #[test]
    fn a_span_of_one_number_gets_a_width() {
        assert_eq!(Span { low: 0.0, high: 0.0 }.padded(0.1), Span { low: -1.0, high: 1.0 });
        let constant = Span { low: 70.0, high: 70.0 + 1e-12 }.padded(0.1);
        assert!(constant.low < 50.0 && constant.high > 90.0);
        assert_eq!(Span::of([f64::NAN, f64::INFINITY]), None);
        assert_eq!(Span::of([f64::NAN, 2.0, -1.0]), Some(Span { low: -1.0, high: 2.0 }));
    }
}
