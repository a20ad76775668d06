//! A distribution in a few numbers.

use hdrhistogram::Histogram;
use serde::Serialize;

/// Counts values from 0 to a minute in nanoseconds, to three digits, without allocating after its making.
#[derive(Clone, Debug)]
pub struct Distribution(Histogram<u64>);

impl Default for Distribution {
    fn default() -> Self {
        Self::new()
    }
}

/// Values of a distribution that lie close together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Bin {
    /// The least that they may be.
    pub from: u64,
    /// What they are less than; `None` for the last bin, which holds the rest.
    pub below: Option<u64>,
    /// How many there are.
    pub count: u64,
}

/// The numbers of a distribution that people ask for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Quantiles {
    /// The smallest; text only.
    #[serde(skip)]
    pub min: u64,
    /// Half of the values are at most this.
    pub p50: u64,
    /// 99 of 100 are at most this.
    pub p99: u64,
    /// 999 of 1000 are at most this.
    pub p999: u64,
    /// The largest.
    pub max: u64,
}

/// One minute, ns: larger values count as this.
const LARGEST: u64 = 60_000_000_000;

impl Distribution {
    /// No values yet.
    pub fn new() -> Self {
        // Bounds and digits are constants that hdrhistogram accepts; a failure would be found by any test.
        Distribution(Histogram::new_with_bounds(1, LARGEST, 3).expect("valid bounds"))
    }

    /// No values yet, and two digits only: to be asked for its quantiles while it grows.
    pub fn coarse() -> Self {
        Distribution(Histogram::new_with_bounds(1, LARGEST, 2).expect("valid bounds"))
    }

    /// What this share of the values is at most; 0 without values.
    pub fn at(&self, quantile: f64) -> u64 {
        self.0.value_at_quantile(quantile).min(self.0.max())
    }

    /// Counts one value.
    pub fn record(&mut self, value: u64) {
        self.0.saturating_record(value);
    }

    /// Its numbers; `None` without values.
    pub fn quantiles(&self) -> Option<Quantiles> {
        let at = |quantile| self.at(quantile);
        (!self.0.is_empty()).then(|| Quantiles {
            min: self.0.min(),
            p50: at(0.5),
            p99: at(0.99),
            p999: at(0.999),
            max: self.0.max(),
        })
    }

    /// How many values lie where: `rows` bins of equal width up to the 99.9 % quantile and one for the rest, the empty
    /// ones left out.
    pub fn bins(&self, rows: usize) -> Vec<Bin> {
        let Some(Quantiles { min, p999, .. }) = self.quantiles() else { return Vec::new() };
        let rows = rows.max(1);
        let step = ((p999 - min) / rows as u64 + 1).max(1);
        let bin = |row: usize| {
            let from = min + step * row as u64;
            Bin { from, below: (row < rows).then_some(from + step), count: 0 }
        };
        let mut bins: Vec<Bin> = (0..=rows).map(bin).collect();
        for value in self.0.iter_recorded() {
            let row = (value.value_iterated_to().saturating_sub(min) / step) as usize;
            bins[row.min(rows)].count += value.count_since_last_iteration();
        }
        bins.retain(|bin| bin.count > 0);
        bins
    }
}

/// Bins as lines of bars, each with its bound and count.
pub fn bars(bins: &[Bin]) -> Vec<String> {
    const WIDTH: u64 = 40;
    let largest = bins.iter().map(|bin| bin.count).max().unwrap_or(1).max(1);
    let bar = |bin: &Bin| {
        let bar = "#".repeat((bin.count * WIDTH).div_ceil(largest) as usize);
        let bound = match bin.below {
            Some(below) => format!("< {}", microseconds(below)),
            None => format!("> {}", microseconds(bin.from)),
        };
        format!("{bound:>14} {:>9} {bar}", bin.count)
    };
    bins.iter().map(bar).collect()
}

/// Nanoseconds as microseconds with three digits behind the point.
pub fn microseconds(ns: u64) -> String {
    format!("{}.{:03} us", ns / 1000, ns % 1000)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_the_values_to_three_digits() {
        let mut distribution = Distribution::new();
        assert_eq!(distribution.quantiles(), None);
        for value in 1..=1000 {
            distribution.record(value);
        }
        let found = distribution.quantiles().unwrap();
        assert_eq!(found, Quantiles { min: 1, p50: 500, p99: 990, p999: 999, max: 1000 });
        distribution.record(u64::MAX);
        assert!(distribution.quantiles().unwrap().max >= LARGEST, "too large values are kept as the largest");
    }

    #[test]
    fn bars_hold_every_value() {
        let mut distribution = Distribution::new();
        for value in [10_000, 10_000, 20_000, 30_000, 900_000] {
            distribution.record(value);
        }
        let bars = bars(&distribution.bins(10));
        let counted: u64 =
            bars.iter().map(|bar| bar[15..].split_whitespace().next().unwrap().parse::<u64>().unwrap()).sum();
        assert_eq!(counted, 5, "{bars:#?}");
        assert!(Distribution::new().bins(10).is_empty());
    }
}
