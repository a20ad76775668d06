//! What is told of all cycles of a run, however few of its rows are kept to be drawn.

use super::histogram::Quantiles;
use super::sensors::{self, Counted, MapSeries};
use super::signals::Signals;
use super::tracking::Tracking;

/// Times of the cycle that have a histogram each: its title, and the ends of the signals' names.
pub(super) const TIMINGS: [(&str, &[&str]); 3] = [
    ("Round trip of the frames", &["round_trip", "roundtrip"]),
    ("Late wake-up", &["wake_up", "wakeup", "wake_up_late", "wakeup_late", "latency"]),
    ("Computation", &["compute", "computation"]),
];

/// Codes of exchanges that brought nothing, or a working counter too small.
const LOST: [f64; 2] = [1.0, 2.0];

/// Finite values, their squares and the greatest of them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Squares {
    count: u64,
    sum: f64,
    /// 0 where all are below.
    greatest: f64,
}

impl Squares {
    fn push(&mut self, value: f64) {
        if value.is_finite() {
            self.count += 1;
            self.sum += value * value;
            self.greatest = self.greatest.max(value);
        }
    }

    /// The greatest; `None` where there was no value.
    pub(super) fn greatest(&self) -> Option<f64> {
        (self.count > 0).then_some(self.greatest)
    }

    /// The root of the mean square; `None` where there was no value.
    pub(super) fn root_mean_square(&self) -> Option<f64> {
        (self.count > 0).then(|| (self.sum / self.count as f64).sqrt())
    }
}

/// Sums and counts over all rows, taken piece by piece.
#[derive(Clone, Debug, Default)]
pub(super) struct Totals {
    /// Rows.
    pub(super) cycles: u64,
    /// Frames that were lost or incomplete; `None` where nobody recorded it.
    pub(super) lost: Option<u64>,
    /// Distance of the believed and of the true pose from the plan while tracking, m; `None` where it isn't known.
    pub(super) errors: [Option<Squares>; 2],
    /// Torque of each wheel, N·m; `None` where it isn't known.
    pub(super) torques: Vec<Option<Squares>>,
    /// Times of the cycle, s, as [`TIMINGS`]; `None` where they weren't recorded.
    pub(super) timings: [Option<Quantiles>; 3],
    /// Each sensor beside the wheels.
    pub(super) sensors: Vec<Counted>,
    /// How well the place in map was known, m, and the heading there, rad: three standard deviations.
    pub(super) known: [Quantiles; 2],
}

impl Totals {
    /// All of a run that is there as a whole.
    pub(super) fn of(signals: &Signals<'_>, tracking: &Tracking) -> Self {
        let mut totals = Totals::default();
        totals.add(signals, tracking, MapSeries::of(signals, tracking).as_ref(), 0);
        totals
    }

    /// Takes the next rows of a run: those of this piece from `first` on.
    pub(super) fn add(
        &mut self,
        signals: &Signals<'_>,
        tracking: &Tracking,
        place: Option<&MapSeries>,
        first: usize,
    ) {
        let rows = signals.times_s.len();
        self.cycles += rows.saturating_sub(first) as u64;
        let of = |values: &[f64]| values.get(first..).unwrap_or_default().to_vec();
        if let Some(codes) = signals.column(&["exchange_result"]) {
            let lost = of(&codes).iter().filter(|code| LOST.contains(code)).count() as u64;
            *self.lost.get_or_insert_default() += lost;
        }
        for (total, error) in self.errors.iter_mut().zip([&tracking.believed_error, &tracking.true_error]) {
            let Some(error) = error else { continue };
            let total = total.get_or_insert_default();
            (first..rows)
                .filter(|&row| tracking.is_tracking(row))
                .for_each(|row| total.push(error.distance[row]));
        }
        let wheels = signals.wheels();
        self.torques.resize(wheels.len(), None);
        for (total, wheel) in self.torques.iter_mut().zip(&wheels) {
            let Some(torque) = &wheel.torque else { continue };
            let total = total.get_or_insert_default();
            of(torque).iter().for_each(|value| total.push(*value));
        }
        for (total, (_, ends)) in self.timings.iter_mut().zip(TIMINGS) {
            let Some(values) = timing(signals, ends) else { continue };
            let total = total.get_or_insert_default();
            of(&values).iter().for_each(|value| total.push(*value));
        }
        sensors::count(&mut self.sensors, signals, first);
        if let Some(place) = place {
            for (total, known) in self.known.iter_mut().zip([&place.known_m, &place.known_rad]) {
                of(known).iter().for_each(|value| total.push(*value));
            }
        }
    }
}

/// One of the cycle's times, s.
fn timing(signals: &Signals<'_>, ends: &[&str]) -> Option<Vec<f64>> {
    let prefixes = ["timing", "cycle", "exchange", "statistics"];
    let names: Vec<String> =
        prefixes.iter().flat_map(|prefix| ends.iter().map(move |end| format!("{prefix}_{end}"))).collect();
    signals.column(&names.iter().map(String::as_str).collect::<Vec<_>>())
}
