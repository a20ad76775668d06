//! Absolute and relative errors of a trajectory, as `evo` (M. Grupp) computes them.

use omnibase_platform::{Pose2, wrap_angle_rad};

/// A pose at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stamped {
    /// When, s.
    pub time_s: f64,
    /// Where.
    pub pose: Pose2,
}

/// How far a trajectory is from the true one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrajectoryErrors {
    /// How many true poses were compared.
    pub poses: usize,
    /// The believed way, m: noise makes none longer.
    pub way_m: f64,
    /// RMS of the distance after the best rigid alignment (Umeyama, without scale), m.
    pub absolute_m: f64,
    /// RMS of what a metre of the true way is off by, m; `None` where the way is shorter.
    pub relative_m: Option<f64>,
    /// The same of its turn, rad.
    pub relative_rad: Option<f64>,
}

/// The way over which relative errors are taken, and by how much a pair's own may differ, m.
const OVER_M: f64 = 1.0;
const OVER_WITHIN_M: f64 = 0.1;
/// A pose jumps that is off by so many times what half of them are, and by so much, m; where so many in a row do, it is there.
const JUMPS: f64 = 10.0;
const LEAST_JUMP_M: f64 = 5e-3;
const MOST_LEFT_OUT: u32 = 20;
/// Poses of both trajectories belong together within so much, s.
const TOGETHER_S: f64 = 0.01;

impl TrajectoryErrors {
    /// Of what is believed against the true poses; `None` where fewer than three belong together.
    pub fn of(truth: &[Stamped], believed: &[Stamped]) -> Option<TrajectoryErrors> {
        let pairs = together(truth, believed);
        if pairs.len() < 3 {
            return None;
        }
        let absolute_m = rms(aligned_distances_m(&pairs).into_iter())?;
        let way_m = pairs.windows(2).map(|two| two[0].1.distance_m(two[1].1)).sum();
        let relative: Vec<Pose2> = a_metre_apart(&pairs)
            .map(|(begin, end)| {
                let step = |from: Pose2, to: Pose2| from.inverse().then(to);
                step(step(pairs[begin].0, pairs[end].0), step(pairs[begin].1, pairs[end].1))
            })
            .collect();
        Some(TrajectoryErrors {
            poses: pairs.len(),
            way_m,
            absolute_m,
            relative_m: rms(relative.iter().map(|off| off.x_m.hypot(off.y_m))),
            relative_rad: rms(relative.iter().map(|off| wrap_angle_rad(off.heading_rad))),
        })
    }
}

/// Each pose of the trajectory that has fewer with the nearest one in time of the other: true and believed ones.
fn together(truth: &[Stamped], believed: &[Stamped]) -> Vec<(Pose2, Pose2)> {
    let truth_is_longer = truth.len() > believed.len();
    let (fewer, more) = if truth_is_longer { (believed, truth) } else { (truth, believed) };
    let pair = |one: &Stamped| {
        let (one, other) = (one.pose, nearest(more, one.time_s)?);
        Some(if truth_is_longer { (other, one) } else { (one, other) })
    };
    fewer.iter().filter_map(pair).collect()
}

/// The pose of a trajectory that is nearest to a time, where one belongs to it.
fn nearest(trajectory: &[Stamped], time_s: f64) -> Option<Pose2> {
    let after = trajectory.partition_point(|one| one.time_s <= time_s);
    let near = trajectory[after.saturating_sub(1)..].iter().take(if after == 0 { 1 } else { 2 });
    let apart_s = |one: &Stamped| (one.time_s - time_s).abs();
    let nearest = near.min_by(|a, b| apart_s(a).total_cmp(&apart_s(b)))?;
    (apart_s(nearest) <= TOGETHER_S).then_some(nearest.pose)
}

/// The true poses without those that jump: from the one before farther than is believed, by ten times what half of them are off by.
pub fn without_jumps(truth: &[Stamped], believed: &[Stamped]) -> Vec<Stamped> {
    type Pair = (Stamped, Pose2);
    let pairs: Vec<Pair> =
        truth.iter().filter_map(|one| Some((*one, nearest(believed, one.time_s)?))).collect();
    let off_m =
        |one: &Pair, next: &Pair| (one.0.pose.distance_m(next.0.pose) - one.1.distance_m(next.1)).abs();
    let steps_m: Vec<f64> = pairs.windows(2).map(|two| off_m(&two[0], &two[1])).collect();
    let mut sorted_m = steps_m.clone();
    sorted_m.sort_by(f64::total_cmp);
    let Some(median_m) = sorted_m.get(sorted_m.len() / 2) else { return truth.to_vec() };
    let gate_m = (JUMPS * median_m).max(LEAST_JUMP_M);
    let begin = steps_m.iter().position(|step_m| *step_m <= gate_m).unwrap_or(0);
    let mut kept: Vec<Pair> = Vec::new();
    let mut left_out = 0;
    for pair in &pairs[begin..] {
        let jumps = kept.last().is_some_and(|last| off_m(last, pair) > gate_m);
        if jumps && left_out < MOST_LEFT_OUT {
            left_out += 1;
        } else {
            left_out = 0;
            kept.push(*pair);
        }
    }
    kept.into_iter().map(|(one, _)| one).collect()
}

/// From each pose to that later one whose believed way is nearest to a metre, where it is one within a tenth.
fn a_metre_apart(pairs: &[(Pose2, Pose2)]) -> impl Iterator<Item = (usize, usize)> {
    let mut ways_m = vec![0.0];
    for two in pairs.windows(2) {
        ways_m.push(ways_m[ways_m.len() - 1] + two[0].1.distance_m(two[1].1));
    }
    let count = pairs.len();
    (0..count - 1).filter_map(move |begin| {
        let wanted_m = ways_m[begin] + OVER_M;
        let first_from = |way_m: f64| ways_m.partition_point(|way| *way < way_m).max(begin + 1);
        let after = first_from(wanted_m);
        // The first of those that stand at the same place.
        let before = first_from(ways_m[after - 1]);
        let off_m = |end: &usize| (ways_m[*end] - wanted_m).abs();
        let ends = [before, after].into_iter().filter(|end| *end < count);
        let end = ends.min_by(|a, b| off_m(a).total_cmp(&off_m(b)))?;
        (off_m(&end) <= OVER_WITHIN_M).then_some((begin, end))
    })
}

/// Distances of the true places from the others, turned and moved to fit best.
fn aligned_distances_m(pairs: &[(Pose2, Pose2)]) -> Vec<f64> {
    let count = pairs.len() as f64;
    let mean = |of: &dyn Fn(&(Pose2, Pose2)) -> Pose2| {
        let sum = pairs.iter().map(of).fold([0.0; 2], |sum, pose| [sum[0] + pose.x_m, sum[1] + pose.y_m]);
        sum.map(|sum| sum / count)
    };
    let (true_mean, other_mean) = (mean(&|pair| pair.0), mean(&|pair| pair.1));
    let from = |pose: Pose2, mean: [f64; 2]| [pose.x_m - mean[0], pose.y_m - mean[1]];
    let (mut along, mut across) = (0.0, 0.0);
    for (truth, other) in pairs {
        let (t, o) = (from(*truth, true_mean), from(*other, other_mean));
        along += o[0] * t[0] + o[1] * t[1];
        across += o[0] * t[1] - o[1] * t[0];
    }
    let (sin, cos) = across.atan2(along).sin_cos();
    let off = |(truth, other): &(Pose2, Pose2)| {
        let (t, o) = (from(*truth, true_mean), from(*other, other_mean));
        (cos * o[0] - sin * o[1] - t[0]).hypot(sin * o[0] + cos * o[1] - t[1])
    };
    pairs.iter().map(off).collect()
}

fn rms(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value * value, count + 1.0));
    (count > 0.0).then(|| (sum / count).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A quarter of a circle of 2 m, each pose changed.
    fn trajectory(change: impl Fn(f64, Pose2) -> Pose2) -> Vec<Stamped> {
        let pose = |n: usize| {
            let angle = std::f64::consts::FRAC_PI_2 * n as f64 / 100.0;
            let pose = Pose2::new(2.0 * angle.sin(), 2.0 - 2.0 * angle.cos(), angle);
            Stamped { time_s: 0.1 * n as f64, pose: change(angle, pose) }
        };
        (0..=100).map(pose).collect()
    }

    #[test]
    fn what_is_only_turned_and_moved_has_no_error() {
        let truth = trajectory(|_, pose| pose);
        let moved = trajectory(|_, pose| Pose2::new(3.0, -1.0, 0.7).then(pose));
        let errors = TrajectoryErrors::of(&truth, &moved).unwrap();
        assert!(errors.absolute_m < 1e-12 && errors.relative_m.unwrap() < 1e-12, "{errors:?}");
        assert!((errors.way_m - std::f64::consts::PI).abs() < 1e-3 && errors.poses == 101);
    }

    #[test]
    fn a_scale_is_seen_in_each_metre_and_a_turn_as_one() {
        let truth = trajectory(|_, pose| pose);
        let longer = trajectory(|_, pose| Pose2::new(1.01 * pose.x_m, 1.01 * pose.y_m, pose.heading_rad));
        let relative_m = TrajectoryErrors::of(&truth, &longer).unwrap().relative_m.unwrap();
        // The chord of a metre of that circle: 4·sin(1/4).
        assert!((relative_m - 0.01 * 4.0 * 0.25_f64.sin()).abs() < 2e-4, "{relative_m}");
        let turning =
            trajectory(|angle, pose| Pose2 { heading_rad: pose.heading_rad + 0.02 * angle, ..pose });
        let relative_rad = TrajectoryErrors::of(&truth, &turning).unwrap().relative_rad.unwrap();
        assert!((relative_rad - 0.02 * 0.5).abs() < 2e-4, "half a radian a metre: {relative_rad}");
    }

    #[test]
    fn pairs_are_those_whose_believed_way_is_nearest_to_a_metre() {
        // Steps of 0.31 m: 0.93 m is nearer than 1.24; and the last three have none.
        let line = |scale: f64| -> Vec<Stamped> {
            let pose = |n: u8| Pose2::new(scale * 0.31 * f64::from(n), 0.0, 0.0);
            (0..8).map(|n| Stamped { time_s: 0.1 * f64::from(n), pose: pose(n) }).collect()
        };
        let pairs = together(&line(1.0), &line(1.0));
        let found: Vec<(usize, usize)> = a_metre_apart(&pairs).collect();
        assert_eq!(found, [(0, 3), (1, 4), (2, 5), (3, 6), (4, 7)]);
        // Believed steps of 0.465 m: 0.93 m are two of them.
        let pairs = together(&line(1.0), &line(1.5));
        assert_eq!(a_metre_apart(&pairs).next(), Some((0, 2)));
        // And of 0.62 m: neither 0.62 nor 1.24 m is within a tenth.
        assert_eq!(a_metre_apart(&together(&line(1.0), &line(2.0))).count(), 0);
    }

    #[test]
    fn poses_that_jump_are_left_out_and_where_it_was_carried_to_isnt() {
        let believed = trajectory(|_, pose| pose);
        let wave = |n: usize| 1e-3 * (7.0 * n as f64).sin();
        let seen = |jumps: &dyn Fn(usize) -> bool| -> Vec<Stamped> {
            let all = believed.iter().enumerate();
            all.map(|(n, one)| {
                let x_m = one.pose.x_m + wave(n) + if jumps(n) { 1.0 } else { 0.0 };
                Stamped { pose: Pose2 { x_m, ..one.pose }, ..*one }
            })
            .collect()
        };
        for (jumps, left_out) in [
            (&(|_: usize| false) as &dyn Fn(usize) -> bool, 0),
            (&|n| [0, 20, 21, 70, 100].contains(&n), 5),
            (&|n| n >= 40, MOST_LEFT_OUT as usize),
        ] {
            let truth = seen(jumps);
            assert_eq!(truth.len() - without_jumps(&truth, &believed).len(), left_out);
        }
        // The way is the believed one, whatever jumps.
        let errors = TrajectoryErrors::of(&seen(&|n| n % 30 == 7), &believed).unwrap();
        assert!((errors.way_m - std::f64::consts::PI).abs() < 1e-3, "{errors:?}");
    }

    #[test]
    fn pairs_are_found_past_a_rest() {
        let way = [0.0, 0.5, 0.5, 0.5, 0.97, 0.97, 1.5, 2.0];
        let line: Vec<Stamped> =
            (0..8).map(|n| Stamped { time_s: 0.1 * n as f64, pose: Pose2::new(way[n], 0.0, 0.0) }).collect();
        let found: Vec<(usize, usize)> = a_metre_apart(&together(&line, &line)).collect();
        assert_eq!(found, [(0, 4), (1, 6), (2, 6), (3, 6), (4, 7), (5, 7)]);
    }

    #[test]
    fn poses_of_two_rates_belong_together_where_they_are_nearest() {
        let at = |time_s: f64| Stamped { time_s, pose: Pose2::new(time_s, 0.0, 0.0) };
        let truth = [at(0.004), at(0.011), at(0.023), at(0.5)];
        let believed = [at(0.0), at(0.01), at(0.02), at(0.03), at(0.04)];
        let pairs = together(&truth, &believed);
        assert_eq!(pairs.iter().map(|pair| pair.1.x_m).collect::<Vec<_>>(), [0.0, 0.01, 0.02]);
        assert_eq!(together(&believed, &truth).len(), 3);
    }

    #[test]
    fn another_clock_compares_nothing() {
        let truth = trajectory(|_, pose| pose);
        let later: Vec<Stamped> =
            truth.iter().map(|one| Stamped { time_s: one.time_s + 100.0, ..*one }).collect();
        assert_eq!(TrajectoryErrors::of(&truth, &later), None);
    }
}
