//! Curves with no more points than can be seen.

/// Columns of a chart in which a curve is drawn by its least and its greatest value.
pub(super) const COLUMNS: usize = 800;

/// The stretches without gaps of a curve over time, each at most two points per column of `1 / COLUMNS` of the time.
///
/// A value that isn't finite is a gap, and so is a time without any value, ten times the usual step and more; but not
/// one that is narrower than a column, for it can't be seen.
pub(super) fn envelope(times: &[f64], values: &[f64]) -> Vec<Vec<(f64, f64)>> {
    let count = times.len().min(values.len());
    let (Some(&first), Some(&last)) = (times.first(), times.get(count.wrapping_sub(1))) else {
        return Vec::new();
    };
    let step = if count > 1 { (last - first) / (count - 1) as f64 } else { 0.0 };
    let width = (last - first) / COLUMNS as f64;
    // Where there are few values, each is a column of its own.
    let is_dense = count > 2 * COLUMNS && width > 0.0;
    let mut stretches = vec![Vec::new()];
    let mut column: Option<Column> = None;
    let (mut before, mut is_gap) = (first, false);
    for (row, (&time, &value)) in times.iter().zip(values).take(count).enumerate() {
        is_gap |= !value.is_finite() || time - before > 10.0 * step;
        before = time;
        if !value.is_finite() {
            continue;
        }
        let number = if is_dense { ((time - first) / width) as usize } else { row };
        if let Some(open) = column.take_if(|open| number != open.number) {
            open.close(&mut stretches);
            if is_gap && (number > open.number + 1 || !is_dense) {
                stretches.push(Vec::new());
            }
        }
        is_gap = false;
        let point = (time, value);
        let open = column.get_or_insert(Column { number, least: point, greatest: point });
        if value < open.least.1 {
            open.least = point;
        }
        if value > open.greatest.1 {
            open.greatest = point;
        }
    }
    if let Some(open) = column {
        open.close(&mut stretches);
    }
    stretches.retain(|stretch| !stretch.is_empty());
    stretches
}

#[derive(Clone, Copy)]
struct Column {
    number: usize,
    least: (f64, f64),
    greatest: (f64, f64),
}

impl Column {
    fn close(self, stretches: &mut [Vec<(f64, f64)>]) {
        let Some(stretch) = stretches.last_mut() else { return };
        let (one, other) = (self.least, self.greatest);
        match one.0.partial_cmp(&other.0) {
            Some(std::cmp::Ordering::Less) => stretch.extend([one, other]),
            Some(std::cmp::Ordering::Greater) => stretch.extend([other, one]),
            _ => stretch.push(one),
        }
    }
}

/// Points of a path that are thinned at once: what the method costs grows faster than their number.
const WINDOW: usize = 4096;

/// A path in the plane with few enough points that none is off by more than `tolerance`, in stretches without gaps.
///
/// A gap between points that are closer to each other than that is none. Points closer than half the tolerance to
/// the last one are left out first; then [`thinned`].
pub(super) fn simplified(x: &[f64], y: &[f64], tolerance: f64) -> Vec<Vec<(f64, f64)>> {
    let mut stretches: Vec<Vec<(f64, f64)>> = vec![Vec::new()];
    let (mut skipped, mut is_gap) = (None, false);
    for point in x.iter().copied().zip(y.iter().copied()) {
        if !(point.0.is_finite() && point.1.is_finite()) {
            is_gap = true;
            continue;
        }
        let Some(stretch) = stretches.last_mut() else { break };
        let is_near = stretch.last().is_some_and(|last| squared(point, *last) < 0.25 * tolerance * tolerance);
        if is_near {
            skipped = Some(point);
        } else {
            stretch.extend(skipped.take());
            if is_gap {
                stretches.push(vec![point]);
            } else {
                stretch.push(point);
            }
        }
        is_gap = false;
    }
    if let Some(stretch) = stretches.last_mut() {
        stretch.extend(skipped);
    }
    stretches.retain(|stretch| !stretch.is_empty());
    // Twice: what stands between two windows needn't stay, seen from both.
    stretches.iter().map(|path| thinned(&thinned(path, 0.25 * tolerance), 0.25 * tolerance)).collect()
}

/// The points of a path that must stay, that no other is farther than `tolerance` from the lines between them:
/// Douglas and Peucker's method (1973), window by window.
pub(super) fn thinned(path: &[(f64, f64)], tolerance: f64) -> Vec<(f64, f64)> {
    let mut thin: Vec<(f64, f64)> = Vec::new();
    let mut from = 0;
    while from < path.len() {
        // The last point of a window is the first of the next.
        let to = (from + WINDOW).min(path.len());
        let window = &path[from.saturating_sub(1)..to];
        let first = usize::from(from > 0);
        let keep = kept(window, tolerance);
        thin.extend(window.iter().zip(keep).skip(first).filter(|(_, keep)| *keep).map(|(point, _)| *point));
        from = to;
    }
    thin
}

/// Which points of a path must stay, that no other is farther than `tolerance` from the lines between them.
fn kept(path: &[(f64, f64)], tolerance: f64) -> Vec<bool> {
    let mut keep = vec![false; path.len()];
    let Some(last) = path.len().checked_sub(1) else { return keep };
    (keep[0], keep[last]) = (true, true);
    let mut open = vec![(0, last)];
    while let Some((from, to)) = open.pop() {
        let between = (from + 1..to).map(|at| (at, squared_distance(path[at], path[from], path[to])));
        let farthest = between.max_by(|one, other| one.1.total_cmp(&other.1));
        if let Some((at, distance)) = farthest
            && distance > tolerance * tolerance
        {
            keep[at] = true;
            open.extend([(from, at), (at, to)]);
        }
    }
    keep
}

/// The points of a path that shape it most, by their numbers: `most` at most beside its finite ends, none of which is nearer than
/// `tolerance` to the line that the others make; the method of [`thinned`], the farthest first.
pub(super) fn corners(path: impl Iterator<Item = (f64, f64)>, most: usize, tolerance: f64) -> Vec<usize> {
    let (numbers, path): (Vec<usize>, Vec<(f64, f64)>) =
        path.enumerate().filter(|(_, (x, y))| x.is_finite() && y.is_finite()).unzip();
    let Some(last) = path.len().checked_sub(1) else { return Vec::new() };
    let farthest = |from: usize, to: usize| {
        let between = (from + 1..to).map(|at| (squared_distance(path[at], path[from], path[to]), at));
        let (distance, at) = between.max_by(|one, other| one.0.total_cmp(&other.0))?;
        (distance > tolerance * tolerance).then_some((distance, from, at, to))
    };
    let mut corners = vec![numbers[0], numbers[last]];
    let mut open: Vec<_> = farthest(0, last).into_iter().collect();
    while corners.len() < most + 2 {
        let next = open.iter().enumerate().max_by(|one, other| one.1.0.total_cmp(&other.1.0));
        let Some((place, &(_, from, at, to))) = next else { break };
        open.swap_remove(place);
        corners.push(numbers[at]);
        open.extend(farthest(from, at).into_iter().chain(farthest(at, to)));
    }
    corners
}

fn squared(one: (f64, f64), other: (f64, f64)) -> f64 {
    let (dx, dy) = (one.0 - other.0, one.1 - other.1);
    dx * dx + dy * dy
}

/// The square of the distance of a point from the line between two others.
fn squared_distance(point: (f64, f64), from: (f64, f64), to: (f64, f64)) -> f64 {
    let (along, across) = (to.0 - from.0, to.1 - from.1);
    let square = along * along + across * across;
    let (px, py) = (point.0 - from.0, point.1 - from.1);
    let part = if square > 0.0 { ((px * along + py * across) / square).clamp(0.0, 1.0) } else { 0.0 };
    let (dx, dy) = (px - part * along, py - part * across);
    dx * dx + dy * dy
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_envelope_keeps_the_single_spike_and_the_ends() {
        let times: Vec<f64> = (0..100_000).map(|n| f64::from(n) * 1e-3).collect();
        let mut values: Vec<f64> = times.iter().map(|time| time.sin()).collect();
        values[54_321] = 7.0;
        let stretches = envelope(&times, &values);
        assert_eq!(stretches.len(), 1);
        let points = &stretches[0];
        assert!(points.len() <= 2 * COLUMNS + 2, "{}", points.len());
        assert!(points.contains(&(times[54_321], 7.0)));
        assert!(points.windows(2).all(|pair| pair[0].0 < pair[1].0));
        assert!(points[0].0 < 0.2 && points[points.len() - 1].0 > 99.8);
    }

    #[test]
    fn what_is_not_finite_is_a_gap_and_so_is_a_time_without_rows() {
        let times = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0];
        let values = [f64::NAN, 1.0, 2.0, f64::INFINITY, 3.0, f64::NAN];
        assert_eq!(envelope(&times, &values), [vec![(1.0, 1.0), (2.0, 2.0)], vec![(4.0, 3.0)]]);
        let mut times: Vec<f64> = (0..1000).map(f64::from).collect();
        times.extend((0..1000).map(|n| f64::from(n) + 50_000.0));
        let stretches = envelope(&times, &vec![1.0; times.len()]);
        assert_eq!(stretches.len(), 2, "{stretches:?}");
        assert!(envelope(&[], &[]).is_empty());
        assert_eq!(envelope(&[3.0], &[1.0]), [vec![(3.0, 1.0)]]);
    }

    #[test]
    fn a_simplified_path_keeps_corners_and_its_tolerance() {
        let square: Vec<(f64, f64)> = (0..4000)
            .map(|n| {
                let along = f64::from(n % 1000) * 1e-3;
                [(along, 0.0), (1.0, along), (1.0 - along, 1.0), (0.0, 1.0 - along)][n as usize / 1000]
            })
            .collect();
        let (x, y): (Vec<f64>, Vec<f64>) = square.iter().copied().unzip();
        let stretches = simplified(&x, &y, 1e-3);
        assert_eq!(stretches.len(), 1);
        assert!(stretches[0].len() <= 6, "{:?}", stretches[0]);
        for corner in [(1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            let near = |point: &(f64, f64)| (point.0 - corner.0).hypot(point.1 - corner.1) <= 1e-3;
            assert!(stretches[0].iter().any(near), "{corner:?}: {:?}", stretches[0]);
        }
        assert_eq!(simplified(&[0.0, f64::NAN, 1.0], &[0.0; 3], 0.1).len(), 2);
    }
}
