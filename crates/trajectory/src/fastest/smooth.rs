//! The mean over a window of time of a progress whose acceleration jumps.

/// σ over time: cubic between its times, with a continuous acceleration.
#[derive(Clone, Debug, Default)]
pub(super) struct Progress {
    times_s: Vec<f64>,
    /// σ, σ̇, σ̈ and σ⃛ from each time on.
    values: Vec<[f64; 4]>,
}

/// A speed below this part of the greatest is rest.
const REST: f64 = 1e-9;
/// Cubics between two knots that a progress goes through.
pub(super) const PARTS: usize = 3;
/// Above this part it moves, however it began.
const MOVES: f64 = 1e-3;
/// Steps of finding when it is at a place of a piece: the pieces are short, and all but even.
const NEWTON: usize = 4;
/// Joints that only rounding parts are one, over their time: what lies between them would have a jerk of rounding alone.
const SAME_TIME: f64 = 1e-12;

impl Progress {
    /// From σ and σ̇² at the points of a grid, with a constant σ̈ between them; where it rests it waits for the window.
    pub(super) fn new(sigma: &[f64], x: &[f64], window_s: f64) -> Progress {
        let speeds: Vec<f64> = x.iter().map(|x| x.max(0.0).sqrt()).collect();
        let greatest = speeds.iter().fold(0.0_f64, |most, speed| most.max(*speed));
        // Times and speeds of the progress before the mean, with its waits.
        let (mut times_s, mut rates) = (vec![0.0], vec![speeds[0]]);
        let mut time_s = 0.0;
        for (at, (ways, pair)) in sigma.windows(2).zip(speeds.windows(2)).enumerate() {
            time_s += 2.0 * (ways[1] - ways[0]) / (pair[0] + pair[1]);
            times_s.push(time_s);
            rates.push(pair[1]);
            if pair[1] <= REST * greatest && at + 2 < sigma.len() {
                time_s += window_s;
                times_s.push(time_s);
                rates.push(pair[1]);
            }
        }
        let mut progress = if window_s > 0.0 {
            mean(&times_s, &rates, window_s)
        } else {
            // Without a window accelerations jump.
            let slopes = times_s.windows(2).zip(rates.windows(2)).map(|(t, v)| (v[1] - v[0]) / (t[1] - t[0]));
            let values =
                rates.iter().zip(slopes.chain([0.0])).map(|(v, slope)| [0.0, *v, slope, 0.0]).collect();
            Progress { times_s, values }
        };
        progress.integrate(sigma[sigma.len() - 1]);
        progress
    }

    /// Finds σ from what its rates are.
    fn integrate(&mut self, length: f64) {
        let mut at = 0.0;
        for (index, pair) in self.times_s.windows(2).enumerate() {
            self.values[index][0] = at;
            at = ahead(self.values[index], pair[1] - pair[0])[0];
        }
        // What rounding left.
        let scale = length / at;
        for values in &mut self.values {
            *values = values.map(|value| value * scale);
        }
        if let Some(last) = self.values.last_mut() {
            *last = [length, 0.0, 0.0, 0.0];
        }
    }

    /// When it rests, with its beginning and its end, s.
    pub(super) fn rests_s(&self) -> Vec<f64> {
        let greatest = self.values.iter().fold(0.0_f64, |most, values| most.max(values[1]));
        let (mut rests_s, mut has_moved) = (Vec::new(), true);
        for (time_s, values) in self.times_s.iter().zip(&self.values) {
            if values[1] <= REST * greatest && has_moved {
                rests_s.push(*time_s);
                has_moved = false;
            }
            has_moved |= values[1] > MOVES * greatest;
        }
        rests_s
    }

    /// A part of it between two rests by a cubic B-spline over so many even steps, exact where its third derivative is constant; `None`
    /// where it would go back.
    pub(super) fn spline(&self, [from_s, to_s]: [f64; 2], steps: usize) -> Option<Progress> {
        let step_s = (to_s - from_s) / steps as f64;
        let [begin, end] = [from_s, to_s].map(|time_s| self.at(time_s)[0]);
        // At rest three are the same.
        let inner = (2..steps - 1).map(|at| {
            let [sigma, _, second, _] = self.at(from_s + step_s * at as f64);
            sigma - step_s * step_s * second / 6.0
        });
        let weights: Vec<f64> = [begin; 3].into_iter().chain(inner).chain([end; 3]).collect();
        if !weights.is_sorted() {
            return None;
        }
        let times_s = (0..=steps).map(|at| step_s * at as f64).collect();
        let pieces = weights.windows(4).map(|weights| {
            let [a, b, c, d] = [weights[0], weights[1], weights[2], weights[3]];
            let rates = [0.5 * (c - a), c - 2.0 * b + a, d - 3.0 * c + 3.0 * b - a];
            [
                (a + 4.0 * b + c) / 6.0,
                rates[0] / step_s,
                rates[1] / (step_s * step_s),
                rates[2] / (step_s * step_s * step_s),
            ]
        });
        Some(Progress { times_s, values: pieces.chain([[end, 0.0, 0.0, 0.0]]).collect() })
    }

    /// Through σ, its rate and the rate of that at times, by three cubics between two of them.
    pub(super) fn through(knots: &[(f64, [f64; 3])]) -> Progress {
        let mut progress = Progress::default();
        for pair in knots.windows(2) {
            let [(from_s, [at, rate, second]), (to_s, end)] = [pair[0], pair[1]];
            let part_s = (to_s - from_s) / 3.0;
            let all_s = to_s - from_s;
            // What constant thirds of the third derivative make of the second, the rate and σ.
            let a = (end[2] - second) / part_s;
            let b = (end[1] - rate - second * all_s) / part_s.powi(2);
            let c = 6.0 * (end[0] - at - rate * all_s - 0.5 * second * all_s * all_s) / part_s.powi(3);
            let d = b - 0.5 * a;
            let first = (c - a) / 6.0 - d;
            let middle = d - 2.0 * first;
            let mut now = [at, rate, second, first];
            for (part, third) in [first, middle, a - first - middle].into_iter().enumerate() {
                now[3] = third;
                progress.times_s.push(from_s + part_s * part as f64);
                progress.values.push(now);
                now = ahead(now, part_s);
            }
        }
        let (time_s, [at, ..]) = knots[knots.len() - 1];
        progress.times_s.push(time_s);
        progress.values.push([at, 0.0, 0.0, 0.0]);
        progress
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.times_s.last().copied().unwrap_or_default()
    }

    pub(super) fn times_s(&self) -> &[f64] {
        &self.times_s
    }

    /// When it is at σ, s.
    pub(super) fn time_s(&self, sigma: f64) -> f64 {
        let piece = self.values.partition_point(|values| values[0] <= sigma).saturating_sub(1);
        let end_s = self.times_s.get(piece + 1).copied().unwrap_or(self.duration_s());
        let mut span = [0.0, end_s - self.times_s[piece]];
        // Within a piece σ rises: halved to the last bit.
        for _ in 0..f64::MANTISSA_DIGITS {
            let middle = 0.5 * (span[0] + span[1]);
            span[usize::from(ahead(self.values[piece], middle)[0] > sigma)] = middle;
        }
        self.times_s[piece] + span[0]
    }

    /// How many cubics it has.
    pub(super) fn piece_count(&self) -> usize {
        self.times_s.len().saturating_sub(1)
    }

    /// A time within a piece, from 0 to 1 of it, and σ there with its derivatives.
    pub(super) fn in_piece(&self, piece: usize, part: f64) -> (f64, [f64; 4]) {
        let since_s = part * (self.times_s[piece + 1] - self.times_s[piece]);
        (self.times_s[piece] + since_s, ahead(self.values[piece], since_s))
    }

    /// When it is at a σ of a piece, s, and σ there with its derivatives.
    pub(super) fn in_piece_at(&self, piece: usize, sigma: f64) -> (f64, [f64; 4]) {
        let lasts_s = self.times_s[piece + 1] - self.times_s[piece];
        let (begin, end) = (self.values[piece][0], ahead(self.values[piece], lasts_s)[0]);
        let mut since_s = lasts_s * (sigma - begin) / (end - begin);
        for _ in 0..NEWTON {
            let [at, rate, ..] = ahead(self.values[piece], since_s);
            let nearer_s = since_s + (sigma - at) / rate;
            // At rest there is no rate.
            since_s = if nearer_s.is_finite() { nearer_s.clamp(0.0, lasts_s) } else { since_s };
        }
        (self.times_s[piece] + since_s, ahead(self.values[piece], since_s))
    }

    /// Takes `factor` times as long.
    pub(super) fn stretch(&mut self, factor: f64) {
        self.times_s.iter_mut().for_each(|time_s| *time_s *= factor);
        for values in &mut self.values {
            let [at, rate, second, third] = *values;
            *values = [at, rate / factor, second / factor.powi(2), third / factor.powi(3)];
        }
    }

    /// σ and its first three derivatives; at rest before and after.
    pub(super) fn at(&self, time_s: f64) -> [f64; 4] {
        let piece = self.times_s.partition_point(|begin_s| *begin_s <= time_s);
        match (piece, self.values.last()) {
            // NaN is before the beginning: it must not move anything.
            (0, _) | (_, None) => [0.0; 4],
            (piece, Some(last)) if piece == self.values.len() => [last[0], 0.0, 0.0, 0.0],
            (piece, _) => ahead(self.values[piece - 1], time_s - self.times_s[piece - 1]),
        }
    }
}

/// A cubic after a time.
fn ahead([at, rate, second, third]: [f64; 4], time_s: f64) -> [f64; 4] {
    [
        at + time_s * (rate + time_s * (second / 2.0 + time_s * third / 6.0)),
        rate + time_s * (second + time_s * third / 2.0),
        second + time_s * third,
        third,
    ]
}

/// The mean of rates that are linear between times, at rest before and after: its joints lie half a window beside them.
fn mean(times_s: &[f64], rates: &[f64], window_s: f64) -> Progress {
    let count = times_s.len();
    let rate = |time_s: f64, from: usize| -> f64 {
        if from == 0 || from >= count {
            return 0.0;
        }
        let part = (time_s - times_s[from - 1]) / (times_s[from] - times_s[from - 1]);
        rates[from - 1] + part * (rates[from] - rates[from - 1])
    };
    // Both ends of the window go along the times; the mean's own time begins when the first end does.
    let (mut old, mut new) = (0, 0);
    let mut joints: Vec<(f64, f64)> = Vec::with_capacity(2 * count);
    while old < count {
        let from_old = times_s[old] + window_s;
        let time_s = if new < count { times_s[new].min(from_old) } else { from_old };
        let [newer, older] = [(time_s, new), (time_s - window_s, old)];
        let second = (rate(newer.0, newer.1) - rate(older.0, older.1)) / window_s;
        match joints.last() {
            Some((last_s, _)) if time_s - last_s <= SAME_TIME * time_s => {}
            _ => joints.push((time_s, second)),
        }
        if new < count && times_s[new] <= time_s {
            new += 1;
        }
        if from_old <= time_s {
            old += 1;
        }
    }
    let mut progress = Progress::default();
    let mut speed = 0.0;
    for pair in joints.windows(2) {
        let [(from_s, from), (to_s, to)] = [pair[0], pair[1]];
        let third = (to - from) / (to_s - from_s);
        progress.times_s.push(from_s);
        progress.values.push([0.0, speed, from, third]);
        speed += 0.5 * (from + to) * (to_s - from_s);
    }
    progress.times_s.push(joints.last().map_or(0.0, |(time_s, _)| *time_s));
    progress.values.push([0.0; 4]);
    progress
}
