//! The way of the platform between two instants, and how it changes with each unknown.

use nalgebra::{Matrix3, Vector3};
use omnibase_platform::{BodyStep, Kinematics, LayoutError, MAX_WHEELS, PerWheel, Pose2, wrap_angle_rad};

use crate::build::Build;
use crate::dataset::Run;
use crate::unknown::Unknown;

/// By how much a wheel is changed to see what that does: far above rounding, far below where squares count.
const NUDGE: f64 = 1e-5;

/// The body's step per rad of each wheel.
type PerRad = [Vector3<f64>; MAX_WHEELS];

/// What a build makes of turns of its wheels.
pub(crate) struct Steps {
    wheels: usize,
    per_rad: PerRad,
    creep: f64,
    /// What changes steps: each with its place among the unknowns.
    changes: Vec<(usize, Change)>,
    /// The place of the delay.
    delay: Option<usize>,
}

enum Change {
    /// The change of the step per rad by one of it.
    Wheels(Box<PerRad>),
    Creep,
}

/// The way from one instant to another.
pub(crate) struct Way {
    /// Its end, seen from its beginning.
    pub(crate) moved: Pose2,
    /// Its end's change in its own axes by one of each unknown that changes it, with the unknown's place.
    pub(crate) per_unknown: Vec<(usize, Vector3<f64>)>,
    /// Length, m, and all turns, rad.
    pub(crate) length_m: f64,
    pub(crate) turned_rad: f64,
}

fn per_rad(build: &Build) -> Result<PerRad, LayoutError> {
    let kinematics = Kinematics::new(build.wheels.clone())?;
    let count = kinematics.wheel_count();
    Ok(std::array::from_fn(|wheel| {
        let alone = PerWheel::from_fn(count, |at| if at == wheel { 1.0 } else { 0.0 });
        vector(kinematics.body_step(&alone).0)
    }))
}

fn vector(step: BodyStep) -> Vector3<f64> {
    Vector3::new(step.x_m, step.y_m, step.angle_rad)
}

/// How a small motion in a frame looks in the frame that stands at `pose` in it: Ad of the inverse.
pub(crate) fn carried_back(pose: Pose2) -> Matrix3<f64> {
    let (sin, cos) = pose.heading_rad.sin_cos();
    // v' = Rᵀ·(v + ω×t).
    Matrix3::new(
        cos,
        sin,
        -cos * pose.y_m + sin * pose.x_m,
        -sin,
        cos,
        sin * pose.y_m + cos * pose.x_m,
        0.0,
        0.0,
        1.0,
    )
}

/// The small motion from nothing to a pose close to it.
pub(crate) fn small(pose: Pose2) -> Vector3<f64> {
    let angle = wrap_angle_rad(pose.heading_rad);
    // The logarithm to second order.
    Vector3::new(pose.x_m + 0.5 * angle * pose.y_m, pose.y_m - 0.5 * angle * pose.x_m, angle)
}

impl Steps {
    pub(crate) fn new(build: &Build, expected: &Build, unknowns: &[Unknown]) -> Result<Steps, LayoutError> {
        let mut changes = Vec::new();
        for (place, unknown) in unknowns.iter().enumerate() {
            match unknown {
                Unknown::Radius(_) | Unknown::Direction(_) | Unknown::Across(_) => {
                    let nudged = |amount: f64| {
                        let mut nudged = build.clone();
                        unknown.add_to(&mut nudged, expected, amount);
                        per_rad(&nudged)
                    };
                    let [above, below] = [nudged(NUDGE)?, nudged(-NUDGE)?];
                    let change = std::array::from_fn(|at| (above[at] - below[at]) / (2.0 * NUDGE));
                    changes.push((place, Change::Wheels(Box::new(change))));
                }
                Unknown::Creep => changes.push((place, Change::Creep)),
                _ => {}
            }
        }
        Ok(Steps {
            wheels: build.wheels.len(),
            per_rad: per_rad(build)?,
            creep: build.creep,
            changes,
            delay: unknowns.iter().position(|unknown| *unknown == Unknown::Delay),
        })
    }

    fn step(&self, per_rad: &PerRad, turned_rad: &PerWheel) -> Vector3<f64> {
        let mut sum = Vector3::zeros();
        for (per_rad, turned) in per_rad.iter().zip(turned_rad.iter()) {
            sum += per_rad * *turned;
        }
        sum
    }

    /// The ways between instants that don't run back; what lies beyond the run's steps stands still.
    pub(crate) fn ways(&self, run: &Run, slips_rad: &[PerWheel], instants_s: &[f64]) -> Vec<Way> {
        let mut ways = Vec::with_capacity(instants_s.len().saturating_sub(1));
        let mut cursor = Cursor { run, at: 0, from_s: run.begin_s };
        if let Some(first_s) = instants_s.first() {
            cursor.go_to(*first_s);
        }
        let mut speed_at_start = self.speed(run, slips_rad, &cursor);
        for to_s in instants_s.iter().skip(1) {
            let way = self.way(slips_rad, &mut cursor, *to_s);
            let speed_at_end = self.speed(run, slips_rad, &cursor);
            let way = self.with_delay(way, speed_at_start, speed_at_end);
            speed_at_start = speed_at_end;
            ways.push(way);
        }
        ways
    }

    fn way(&self, slips_rad: &[PerWheel], cursor: &mut Cursor<'_>, to_s: f64) -> Way {
        let mut way = Way {
            moved: Pose2::default(),
            per_unknown: self.changes.iter().map(|(place, _)| (*place, Vector3::zeros())).collect(),
            length_m: 0.0,
            turned_rad: 0.0,
        };
        while let Some((at, share)) = cursor.next_part(to_s) {
            let slipped = &slips_rad[at];
            let counted = cursor.run.steps[at].turned_rad;
            let turned = PerWheel::from_fn(self.wheels, |wheel| {
                share * (counted[wheel] - self.creep * slipped[wheel])
            });
            let step = self.step(&self.per_rad, &turned);
            let step_body = BodyStep::new(step[0], step[1], step[2]);
            way.moved = way.moved.moved_by(step_body);
            way.length_m += step_body.distance_m();
            way.turned_rad += step[2].abs();
            let back = carried_back(step_body.exp());
            for ((_, change), (_, so_far)) in self.changes.iter().zip(&mut way.per_unknown) {
                let changed = match change {
                    Change::Wheels(per_rad) => self.step(per_rad, &turned),
                    Change::Creep => -share * self.step(&self.per_rad, slipped),
                };
                *so_far = back * *so_far + changed;
            }
        }
        way
    }

    /// A longer delay puts both ends earlier.
    fn with_delay(&self, mut way: Way, start: Vector3<f64>, end: Vector3<f64>) -> Way {
        if let Some(place) = self.delay {
            way.per_unknown.push((place, carried_back(way.moved) * start - end));
        }
        way
    }

    /// The body's twist at the cursor.
    fn speed(&self, run: &Run, slips_rad: &[PerWheel], cursor: &Cursor<'_>) -> Vector3<f64> {
        let at = cursor.at.min(run.steps.len() - 1);
        let begin_s = if at == 0 { run.begin_s } else { run.steps[at - 1].end_s };
        let inside = cursor.from_s >= run.begin_s && cursor.at < run.steps.len();
        let period_s = if inside { run.steps[at].end_s - begin_s } else { f64::INFINITY };
        let (counted, slipped) = (run.steps[at].turned_rad, &slips_rad[at]);
        let turned = PerWheel::from_fn(self.wheels, |wheel| counted[wheel] - self.creep * slipped[wheel]);
        self.step(&self.per_rad, &turned) / period_s
    }
}

/// A place in a run's steps.
struct Cursor<'a> {
    run: &'a Run,
    /// The step in which it is.
    at: usize,
    /// Its instant.
    from_s: f64,
}

impl Cursor<'_> {
    fn go_to(&mut self, to_s: f64) {
        while self.next_part(to_s).is_some() {}
        self.from_s = self.from_s.max(to_s);
    }

    /// The next step up to an instant and the share of it, which is taken; `None` when it is reached.
    fn next_part(&mut self, to_s: f64) -> Option<(usize, f64)> {
        let step = self.run.steps.get(self.at)?;
        let begin_s = if self.at == 0 { self.run.begin_s } else { self.run.steps[self.at - 1].end_s };
        let from_s = self.from_s.max(begin_s);
        if to_s <= from_s {
            return None;
        }
        let at = self.at;
        let until_s = step.end_s.min(to_s);
        if until_s >= step.end_s {
            self.at += 1;
        }
        self.from_s = until_s;
        Some((at, (until_s - from_s) / (step.end_s - begin_s)))
    }
}
