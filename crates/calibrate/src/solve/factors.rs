//! What ties poses to each other, to measurements and to the unknowns.

use nalgebra::{DVector, Matrix3, Vector3};
use omnibase_platform::{BodyStep, Pose2, wrap_angle_rad};

use super::Prepared;
use crate::build::{Build, Tolerances};
use crate::chain::{Chain, Shared};
use crate::dataset::Run;
use crate::unknown::Unknown;
use crate::way::{Displacement, Steps, carried_back, small};

/// Poses closer together than this are left out, s.
const LEAST_APART_S: f64 = 0.008;
/// Without poses one is solved for so often, s.
const KNOT_S: f64 = 0.1;
/// What wheels that stand may hide, m and rad: keeps weights finite.
const STANDING: f64 = 3e-6;
/// Poses farther off than so many standard deviations, over all three directions, count for less: chance alone does that to one in
/// 65,000.
const DOUBTED_AT: f64 = 5.0;
/// Nothing is known of where a run begins, m and rad.
const ANYWHERE: [f64; 2] = [100.0, 10.0];

/// What a gyro turned since its first sample.
pub(crate) struct Turned {
    /// Instant s, turned rad, rate rad/s.
    samples: Vec<[f64; 3]>,
}

impl Turned {
    pub(crate) fn of(run: &Run) -> Option<Turned> {
        let mut samples: Vec<[f64; 3]> = Vec::with_capacity(run.turns.len());
        for turn in &run.turns {
            let so_far = samples.last().map_or(0.0, |[instant_s, turned, rate]| {
                turned + 0.5 * (rate + turn.rate_rad_s) * (turn.instant_s - instant_s)
            });
            samples.push([turn.instant_s, so_far, turn.rate_rad_s]);
        }
        (samples.len() > 1).then_some(Turned { samples })
    }

    /// Turned until an instant, rad, and the rate there.
    fn until(&self, instant_s: f64) -> Option<[f64; 2]> {
        let after = self.samples.partition_point(|sample| sample[0] < instant_s);
        let [to_s, turned, to_rate] = *self.samples.get(after)?;
        if to_s == instant_s {
            return Some([turned, to_rate]);
        }
        let [from_s, from, from_rate] = *self.samples.get(after.checked_sub(1)?)?;
        let share = (instant_s - from_s) / (to_s - from_s);
        let rate = from_rate + share * (to_rate - from_rate);
        Some([from + 0.5 * (from_rate + rate) * (instant_s - from_s), rate])
    }
}

/// Where in time the poses of a run are, and which measurement belongs to each.
pub(crate) struct Knots {
    stated_s: Vec<f64>,
    /// The sensor's, by their place; otherwise places on the floor.
    measured: Vec<Option<usize>>,
    is_sensor: bool,
}

impl Knots {
    pub(crate) fn of(run: &Run, delay_s: f64) -> Knots {
        let mut knots =
            Knots { stated_s: Vec::new(), measured: Vec::new(), is_sensor: !run.poses.is_empty() };
        if knots.is_sensor {
            let counted = run.begin_s..=run.end_s();
            for (at, pose) in run.poses.iter().enumerate() {
                let is_apart =
                    knots.stated_s.last().is_none_or(|last| pose.instant_s - last >= LEAST_APART_S);
                if is_apart && counted.contains(&(pose.instant_s - delay_s)) {
                    knots.stated_s.push(pose.instant_s);
                    knots.measured.push(Some(at));
                }
            }
            return knots;
        }
        let count = ((run.end_s() - run.begin_s) / KNOT_S).ceil().max(1.0) as usize;
        let even = |number: usize| run.begin_s + (run.end_s() - run.begin_s) * number as f64 / count as f64;
        let mut all: Vec<(f64, Option<usize>)> = (0..=count).map(|number| (even(number), None)).collect();
        for (at, place) in run.places.iter().enumerate() {
            match all.iter_mut().find(|knot| (knot.0 - place.instant_s).abs() < 1e-6 && knot.1.is_none()) {
                Some(knot) => knot.1 = Some(at),
                None => all.push((place.instant_s, Some(at))),
            }
        }
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        (knots.stated_s, knots.measured) = all.into_iter().unzip();
        knots
    }

    /// Instants of the wheels' clock.
    pub(crate) fn instants_s(&self, delay_s: f64) -> Vec<f64> {
        let delay_s = if self.is_sensor { delay_s } else { 0.0 };
        self.stated_s.iter().map(|stated_s| stated_s - delay_s).collect()
    }
}

/// A pose moved a little in its own axes.
pub(crate) fn shifted(pose: Pose2, step: &Vector3<f64>) -> Pose2 {
    pose.moved_by(BodyStep::new(step[0], step[1], step[2]))
}

/// Where the poses of a run are before anything is solved: dead reckoning, put where the measurements are.
pub(crate) fn first_poses(prepared: &Prepared<'_>, steps: &Steps, expected: &Build) -> Vec<Pose2> {
    let Prepared { run, knots, .. } = prepared;
    let ways = steps.ways(run, &prepared.treads, &knots.instants_s(expected.sensor.delay_s));
    let mut reckoned = vec![Pose2::default(); knots.stated_s.len().min(1)];
    for way in &ways {
        let last = reckoned.last().copied().unwrap_or_default();
        reckoned.push(last.then(way.moved));
    }
    let mount = if knots.is_sensor { expected.sensor.base_from_sensor } else { Pose2::default() };
    // The turn that brings both ways together best (Procrustes): that of the sum of products about the means.
    let pairs = knots.measured.iter().zip(&reckoned).filter_map(|(measured, pose)| {
        let at = (*measured)?;
        let there =
            if knots.is_sensor { run.poses[at].world_from_sensor } else { run.places[at].floor_from_base };
        Some((pose.then(mount), there))
    });
    let pairs: Vec<(Pose2, Pose2)> = pairs.collect();
    let Some((first_here, first_there)) = pairs.first().copied() else { return reckoned };
    let (mut dot, mut cross) = (0.0, 0.0);
    for (here, there) in &pairs {
        let (ax, ay) = (here.x_m - first_here.x_m, here.y_m - first_here.y_m);
        let (bx, by) = (there.x_m - first_there.x_m, there.y_m - first_there.y_m);
        dot += ax * bx + ay * by;
        cross += ax * by - ay * bx;
    }
    let has_heading = !knots.is_sensor || run.poses.first().is_some_and(|pose| pose.sigma_rad.is_finite());
    let turn = if has_heading { first_there.heading_rad - first_here.heading_rad } else { cross.atan2(dot) };
    let world_from_reckoned =
        Pose2 { heading_rad: first_here.heading_rad + turn, ..first_there }.then(first_here.inverse());
    reckoned.into_iter().map(|pose| world_from_reckoned.then(pose)).collect()
}

/// What poses are seen with.
pub(crate) struct View<'a> {
    /// Variances of the floor over what tolerances say.
    pub(crate) unevenness: f64,
    pub(crate) build: &'a Build,
    pub(crate) tolerances: &'a Tolerances,
    pub(crate) unknowns: &'a [Unknown],
    pub(crate) amounts: &'a DVector<f64>,
}

/// How well a run's measurements fit.
#[derive(Clone, Debug, Default)]
pub(crate) struct Look {
    pub(crate) residuals: Vec<[f64; 3]>,
    pub(crate) doubted: usize,
}

/// Everything about a moment, to first order.
pub(crate) struct Linear {
    chains: Vec<Chain>,
    pub(crate) shared: Shared,
    /// What is made least: squares of residuals over standard deviations, of doubted poses less.
    pub(crate) cost: f64,
    /// What of it doubted poses cost beyond that of one at the edge of doubt.
    pub(crate) of_doubted: f64,
    /// Sum of the logarithms of the weights of what the wheels say.
    pub(crate) log_weight: f64,
    pub(crate) residuals: usize,
    pub(crate) looks: Vec<Look>,
}

/// A residual with its derivatives.
struct Residual {
    error: Vector3<f64>,
    /// One over the variance of each.
    weight: Vector3<f64>,
    /// By the later pose, in its own axes.
    by_pose: Matrix3<f64>,
    /// By the earlier one.
    by_before: Option<Matrix3<f64>>,
    /// By unknowns, with their places; by all others 0.
    by_unknown: Vec<(usize, Vector3<f64>)>,
}

impl Linear {
    pub(crate) fn new(shared: Shared) -> Linear {
        Linear {
            chains: Vec::new(),
            shared,
            cost: 0.0,
            of_doubted: 0.0,
            log_weight: 0.0,
            residuals: 0,
            looks: Vec::new(),
        }
    }

    pub(crate) fn chains(&self) -> impl Iterator<Item = Chain> + '_ {
        self.chains.iter().cloned()
    }

    /// Adds a run; `ways` are those between its poses.
    pub(crate) fn add(
        &mut self,
        prepared: &Prepared<'_>,
        poses: &[Pose2],
        ways: &[Displacement],
        view: &View<'_>,
    ) {
        let instants_s = prepared.knots.instants_s(view.build.sensor.delay_s);
        let mut chain = Chain::new(poses.len(), view.unknowns.len());
        let mut look = Look::default();
        for (at, pose) in poses.iter().enumerate() {
            if let Some(before) = at.checked_sub(1) {
                let pair = [poses[before], *pose];
                let residual = by_wheels(&ways[before], pair, view);
                self.log_weight += residual.weight.map(f64::ln).sum();
                self.take(&mut chain, at, &residual);
                let span_s = [instants_s[before], instants_s[at]];
                if let Some(residual) = by_gyro(prepared, pair, span_s, view) {
                    self.take(&mut chain, at, &residual);
                    self.residuals -= 2;
                }
            } else {
                let [m, rad] = ANYWHERE.map(|sigma: f64| sigma.powi(-2));
                chain.own[0] += Matrix3::from_diagonal(&Vector3::new(m, m, rad));
                self.residuals += 3;
            }
            let Some(measured) = prepared.knots.measured[at] else { continue };
            let mut residual = if prepared.knots.is_sensor {
                by_sensor(prepared.run, measured, *pose, view)
            } else {
                by_tape(prepared.run, measured, *pose)
            };
            let sigmas = residual.error.component_mul(&residual.weight.map(f64::sqrt));
            look.residuals.push(sigmas.into());
            let size = sigmas.norm();
            if size > DOUBTED_AT && prepared.knots.is_sensor {
                look.doubted += 1;
                residual.weight *= DOUBTED_AT / size;
                // Huber's cost is 2·k·size − k²; half of its first part is added below.
                self.cost += DOUBTED_AT * (size - DOUBTED_AT);
                self.of_doubted += 2.0 * DOUBTED_AT * (size - DOUBTED_AT);
            }
            if residual.weight[2] == 0.0 {
                self.residuals -= 1;
            }
            self.take(&mut chain, at, &residual);
        }
        self.chains.push(chain);
        self.looks.push(look);
    }

    fn take(&mut self, chain: &mut Chain, at: usize, residual: &Residual) {
        let Residual { error, weight, by_pose, by_before, by_unknown } = residual;
        let weighted = Matrix3::from_diagonal(weight);
        self.cost += error.dot(&(weighted * error));
        self.residuals += 3;
        let of_pose = by_pose.transpose() * weighted;
        chain.own[at] += of_pose * by_pose;
        chain.right[at] -= of_pose * error;
        for (place, column) in by_unknown {
            chain.shared[at][*place] += of_pose * column;
        }
        if let Some(by_before) = by_before {
            let of_before = by_before.transpose() * weighted;
            chain.own[at - 1] += of_before * by_before;
            chain.right[at - 1] -= of_before * error;
            for (place, column) in by_unknown {
                chain.shared[at - 1][*place] += of_before * column;
            }
            chain.before[at] += of_pose * by_before;
        }
        for (row, one) in by_unknown {
            let weighted = one.component_mul(weight);
            self.shared.right[*row] -= weighted.dot(error);
            for (column, other) in by_unknown {
                self.shared.matrix[(*row, *column)] += weighted.dot(other);
            }
        }
    }
}

/// From one pose to the next as the wheels say.
fn by_wheels(way: &Displacement, [before, pose]: [Pose2; 2], view: &View<'_>) -> Residual {
    let (tolerances, floor) = (view.tolerances, view.unevenness);
    let moved = before.inverse().then(pose);
    let error = small(way.moved.inverse().then(moved));
    let (m, rad) = (way.length_m, way.turned_rad);
    let position = STANDING.powi(2) + floor * (tolerances.way_m2_per_m * m + tolerances.way_m2_per_rad * rad);
    let heading =
        STANDING.powi(2) + floor * (tolerances.turn_rad2_per_m * m + tolerances.turn_rad2_per_rad * rad);
    Residual {
        error,
        weight: Vector3::new(1.0 / position, 1.0 / position, 1.0 / heading),
        by_pose: Matrix3::identity(),
        by_before: Some(-carried_back(moved)),
        by_unknown: way.per_unknown.iter().map(|(place, column)| (*place, -column)).collect(),
    }
}

/// The turn between two poses as the gyro has it: one residual, the other two count for nothing.
fn by_gyro(
    prepared: &Prepared<'_>,
    [before, pose]: [Pose2; 2],
    [from_s, to_s]: [f64; 2],
    view: &View<'_>,
) -> Option<Residual> {
    let turned = prepared.turned.as_ref()?;
    let ([from, from_rate], [to, to_rate]) = (turned.until(from_s)?, turned.until(to_s)?);
    let bias = prepared.bias?;
    let (scale, time_s) = (1.0 + view.build.gyro_scale, to_s - from_s);
    // Chains don't wrap: a step between two poses is far less than half a turn.
    let turn = wrap_angle_rad(pose.heading_rad - before.heading_rad);
    let error = (to - from) - scale * turn - view.amounts[bias] * time_s;
    let first = |value: f64| Vector3::new(value, 0.0, 0.0);
    let mut by_unknown = vec![(bias, first(-time_s))];
    for (at, unknown) in view.unknowns.iter().enumerate() {
        match unknown {
            Unknown::GyroScale => by_unknown.push((at, first(-turn))),
            Unknown::Delay if prepared.knots.is_sensor => by_unknown.push((at, first(from_rate - to_rate))),
            _ => {}
        }
    }
    let row = |value: f64| Matrix3::new(0.0, 0.0, value, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    Some(Residual {
        error: Vector3::new(error, 0.0, 0.0),
        weight: Vector3::new(1.0 / (view.tolerances.gyro_density.powi(2) * time_s), 0.0, 0.0),
        by_pose: row(-scale),
        by_before: Some(row(scale)),
        by_unknown,
    })
}

/// A pose as the sensor saw it, in the sensor's axes.
fn by_sensor(run: &Run, measured: usize, pose: Pose2, view: &View<'_>) -> Residual {
    let sample = &run.poses[measured];
    let mount = view.build.sensor.base_from_sensor;
    let error = small(pose.then(mount).inverse().then(sample.world_from_sensor));
    let mut by_unknown = Vec::with_capacity(3);
    let (sin, cos) = mount.heading_rad.sin_cos();
    for (at, unknown) in view.unknowns.iter().enumerate() {
        let column = match unknown {
            Unknown::SensorX => Vector3::new(-cos, sin, 0.0),
            Unknown::SensorY => Vector3::new(-sin, -cos, 0.0),
            Unknown::SensorHeading => Vector3::new(0.0, 0.0, -1.0),
            _ => continue,
        };
        by_unknown.push((at, column));
    }
    let position = sample.sigma_m.powi(-2);
    Residual {
        error,
        weight: Vector3::new(position, position, sample.sigma_rad.powi(-2)),
        by_pose: -carried_back(mount),
        by_before: None,
        by_unknown,
    }
}

/// A pose as somebody measured it on the floor.
fn by_tape(run: &Run, measured: usize, pose: Pose2) -> Residual {
    let sample = &run.places[measured];
    let position = sample.sigma_m.powi(-2);
    Residual {
        error: small(pose.inverse().then(sample.floor_from_base)),
        weight: Vector3::new(position, position, sample.sigma_rad.powi(-2)),
        by_pose: -Matrix3::identity(),
        by_before: None,
        by_unknown: Vec::new(),
    }
}
