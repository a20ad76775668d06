//! The way of the platform between two instants, and how it changes with each unknown.

use nalgebra::{Matrix3, Vector3};
use omnibase_platform::{BodyStep, Kinematics, LayoutError, PerWheel, Pose2, wrap_angle_rad};

use crate::build::Build;
use crate::creep::Tread;
use crate::dataset::Run;
use crate::unknown::Unknown;

/// By how much a wheel is changed to see what that does: far above rounding, far below where squares count.
const NUDGE: f64 = 1e-5;

/// What a build makes of turns of its wheels.
pub(crate) struct Steps {
    wheels: Vec<Rolling>,
    creep: f64,
    /// What changes steps: each with its place among the unknowns.
    changes: Vec<(usize, Change)>,
    /// The place of the delay.
    delay: Option<usize>,
}

/// A wheel's equation: what its rim rolls, radius times turn, is its row times the platform's motion.
#[derive(Clone, Copy)]
struct Rolling {
    radius_m: f64,
    row: Vector3<f64>,
}

enum Change {
    /// The change of one wheel's equation by one of it.
    Wheel(usize, Rolling),
    Creep,
}

/// A step of the platform: x, y in m and the turn in rad, along base, and how it comes about.
struct Stepped {
    step: Vector3<f64>,
    /// Without creep.
    rolled: Vector3<f64>,
    /// What gives way to a force of each axis.
    gives: Matrix3<f64>,
}

/// Turns of the wheels, rad, on what treads, and for which share of a step.
type Part<'a> = (&'a PerWheel, &'a Tread, f64);

/// The way from one instant to another.
pub(crate) struct Displacement {
    /// Its end, seen from its beginning.
    pub(crate) moved: Pose2,
    /// Its end's change in its own axes by one of each unknown that changes it, with the unknown's place.
    pub(crate) per_unknown: Vec<(usize, Vector3<f64>)>,
    /// Length, m, and all turns, rad.
    pub(crate) length_m: f64,
    pub(crate) turned_rad: f64,
}

fn rolling(build: &Build) -> Result<Vec<Rolling>, LayoutError> {
    let kinematics = Kinematics::new(build.wheels.clone())?;
    let each = kinematics.wheels().iter().zip(kinematics.matrix());
    Ok(each.map(|(wheel, row)| Rolling { radius_m: wheel.radius_m, row: Vector3::from(*row) }).collect())
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
                Unknown::Radius(wheel) | Unknown::Direction(wheel) | Unknown::Across(wheel) => {
                    let nudged = |amount: f64| {
                        let mut nudged = build.clone();
                        unknown.add_to(&mut nudged, expected, amount);
                        Ok(rolling(&nudged)?[*wheel])
                    };
                    let [above, below] = [nudged(NUDGE)?, nudged(-NUDGE)?];
                    let change = Rolling {
                        radius_m: (above.radius_m - below.radius_m) / (2.0 * NUDGE),
                        row: (above.row - below.row) / (2.0 * NUDGE),
                    };
                    changes.push((place, Change::Wheel(*wheel, change)));
                }
                Unknown::Creep => changes.push((place, Change::Creep)),
                _ => {}
            }
        }
        Ok(Steps {
            wheels: rolling(build)?,
            creep: build.creep,
            changes,
            delay: unknowns.iter().position(|unknown| *unknown == Unknown::Delay),
        })
    }

    /// The step of turns in rad; `share` of what a whole step lacks by creep is lacking.
    fn step(&self, turned_rad: &PerWheel, tread: &Tread, share: f64) -> Stepped {
        let (mut resists, mut pushes) = (Matrix3::zeros(), Vector3::zeros());
        for (at, wheel) in self.wheels.iter().enumerate() {
            let weighted = wheel.row * tread.weights[at];
            resists += weighted * wheel.row.transpose();
            pushes += weighted * (wheel.radius_m * turned_rad[at]);
        }
        let gives = resists.try_inverse().unwrap_or_default();
        let rolled = gives * pushes;
        Stepped { step: rolled - tread.lacking * (self.creep * share), rolled, gives }
    }

    /// The change of a step by one of an unknown: that of the weighted least squares.
    fn change(
        &self,
        change: &Change,
        (turned_rad, tread, share): Part<'_>,
        stepped: &Stepped,
    ) -> Vector3<f64> {
        match change {
            Change::Creep => -tread.lacking * share,
            Change::Wheel(at, change) => {
                let (wheel, turned) = (&self.wheels[*at], turned_rad[*at]);
                let left = wheel.radius_m * turned - wheel.row.dot(&stepped.rolled);
                let more = change.radius_m * turned - change.row.dot(&stepped.rolled);
                stepped.gives * (wheel.row * more + change.row * left) * tread.weights[*at]
            }
        }
    }

    /// The ways between instants that don't run back; what lies beyond the run's steps stands still.
    pub(crate) fn ways(&self, run: &Run, treads: &[Tread], instants_s: &[f64]) -> Vec<Displacement> {
        let mut ways = Vec::with_capacity(instants_s.len().saturating_sub(1));
        let mut cursor = Cursor { run, at: 0, from_s: run.begin_s };
        if let Some(first_s) = instants_s.first() {
            cursor.go_to(*first_s);
        }
        let mut speed_at_start = self.speed(run, treads, &cursor);
        for to_s in instants_s.iter().skip(1) {
            let way = self.way(treads, &mut cursor, *to_s);
            let speed_at_end = self.speed(run, treads, &cursor);
            let way = self.with_delay(way, speed_at_start, speed_at_end);
            speed_at_start = speed_at_end;
            ways.push(way);
        }
        ways
    }

    fn way(&self, treads: &[Tread], cursor: &mut Cursor<'_>, to_s: f64) -> Displacement {
        let mut way = Displacement {
            moved: Pose2::default(),
            per_unknown: self.changes.iter().map(|(place, _)| (*place, Vector3::zeros())).collect(),
            length_m: 0.0,
            turned_rad: 0.0,
        };
        while let Some((at, share)) = cursor.next_part(to_s) {
            let tread = &treads[at];
            let turned = cursor.run.steps[at].turned_rad.map(|turned| share * turned);
            let stepped = self.step(&turned, tread, share);
            let step_body = BodyStep::new(stepped.step[0], stepped.step[1], stepped.step[2]);
            way.moved = way.moved.moved_by(step_body);
            way.length_m += step_body.distance_m();
            way.turned_rad += stepped.step[2].abs();
            let back = carried_back(step_body.exp());
            for ((_, change), (_, so_far)) in self.changes.iter().zip(&mut way.per_unknown) {
                *so_far = back * *so_far + self.change(change, (&turned, tread, share), &stepped);
            }
        }
        way
    }

    /// A longer delay puts both ends earlier.
    fn with_delay(&self, mut way: Displacement, start: Vector3<f64>, end: Vector3<f64>) -> Displacement {
        if let Some(place) = self.delay {
            way.per_unknown.push((place, carried_back(way.moved) * start - end));
        }
        way
    }

    /// The body's twist at the cursor.
    fn speed(&self, run: &Run, treads: &[Tread], cursor: &Cursor<'_>) -> Vector3<f64> {
        let at = cursor.at.min(run.steps.len() - 1);
        let begin_s = if at == 0 { run.begin_s } else { run.steps[at - 1].end_s };
        let inside = cursor.from_s >= run.begin_s && cursor.at < run.steps.len();
        let period_s = if inside { run.steps[at].end_s - begin_s } else { f64::INFINITY };
        self.step(&run.steps[at].turned_rad, &treads[at], 1.0).step / period_s
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
