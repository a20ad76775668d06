//! Prescribed figures: paths whose motions show the most of a platform, and what each is expected to show.

use std::f64::consts::{PI, TAU};

use omnibase_platform::{Kinematics, Pose2, Twist2, Wheel};

use crate::build::{Build, Tolerances};
use crate::dataset::{Dataset, PlaceSample, PoseSample, Run, Step, TurnSample};
use crate::rehearsal::{GyroSensor, PoseSensor, Tape};
use crate::solve::{Solution, SolveError, solve};

/// How fast figures are driven.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// Greatest speed, m/s.
    pub speed_m_s: f64,
    /// Greatest acceleration, m/s².
    pub acceleration_m_s2: f64,
    /// Greatest turning speed, rad/s.
    pub turn_speed_rad_s: f64,
    /// Greatest turning acceleration, rad/s².
    pub turn_acceleration_rad_s2: f64,
}

/// How long a figure stands at each point, s: what shook is still.
const REST_S: f64 = 0.5;
/// Standing at the beginning and at the end, s: a gyro's bias is seen there.
const STAND_S: f64 = 3.0;

/// A path from rest to rest through points, at each of which it stands for a moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Its name.
    pub name: &'static str,
    /// What is driven.
    pub meaning: &'static str,
    /// Lines of t, x, y, heading in s, m and rad, each stretch a quintic from rest to rest.
    pub points: Vec<[f64; 4]>,
}

/// Where to go next, and how.
struct Drawing {
    pace: Pace,
    points: Vec<[f64; 4]>,
}

impl Drawing {
    fn new(pace: Pace) -> Drawing {
        Drawing { pace, points: vec![[0.0; 4], [STAND_S, 0.0, 0.0, 0.0]] }
    }

    /// On to a pose, as fast as the pace allows (a quintic's peaks: 15/8 of its mean speed, 10/√3 over the square of its time), and
    /// a rest there.
    fn to(&mut self, x: f64, y: f64, heading: f64) {
        let [t, x0, y0, heading0] = self.points.last().copied().unwrap_or_default();
        let (way, turn) = ((x - x0).hypot(y - y0), (heading - heading0).abs());
        let peak = 10.0 / 3.0_f64.sqrt();
        let Pace { speed_m_s, acceleration_m_s2, turn_speed_rad_s, turn_acceleration_rad_s2 } = self.pace;
        let time = (1.875 * way / speed_m_s)
            .max((peak * way / acceleration_m_s2).sqrt())
            .max(1.875 * turn / turn_speed_rad_s)
            .max((peak * turn / turn_acceleration_rad_s2).sqrt());
        if time > 0.0 {
            self.points.push([t + time, x, y, heading]);
            self.points.push([t + time + REST_S, x, y, heading]);
        }
    }

    fn done(mut self, name: &'static str, meaning: &'static str) -> Figure {
        let [t, x, y, heading] = self.points.last().copied().unwrap_or_default();
        self.points.push([t + STAND_S, x, y, heading]);
        Figure { name, meaning, points: self.points }
    }
}

/// Lines of a star.
const RAYS: usize = 3;

/// Where the first line of a star goes, rad: away from where wheels roll straight ahead, for there rollers stand, hold the platform
/// with what they resist, and millimetres decide which way.
fn first_ray_rad(wheels: &[Wheel]) -> f64 {
    let apart_rad = PI / RAYS as f64;
    let nearest = |first_rad: f64| {
        let straight =
            wheels.iter().map(|wheel| wheel.rolling_direction[1].atan2(wheel.rolling_direction[0]));
        let away = straight.map(|angle| {
            let beside = (angle - first_rad).rem_euclid(apart_rad);
            beside.min(apart_rad - beside)
        });
        away.fold(f64::INFINITY, f64::min)
    };
    let tried = (0..12).map(|part| apart_rad * f64::from(part) / 12.0);
    // The first of the best, whatever rounding says.
    tried.fold(0.0, |best, one| if nearest(one) > nearest(best) + 1e-6 { one } else { best })
}

/// All figures within a square of this side about their beginning, m, in the order in which they are compared.
///
/// No turns in place are in `full`: which way rollers turn is then decided by the millimetres by which wheels stand elsewhere than
/// they should, and treads creep by it. Lines with turns show as much, and don't have that.
pub fn all(side_m: f64, pace: Pace, wheels: &[Wheel]) -> Vec<Figure> {
    let half_m = 0.5 * side_m;
    let first_rad = first_ray_rad(wheels);
    // In axes along and across the first ray.
    let (ray_sin, ray_cos) = first_rad.sin_cos();
    let along =
        move |x: f64, y: f64| [half_m * (ray_cos * x - ray_sin * y), half_m * (ray_sin * x + ray_cos * y)];
    let star = |drawing: &mut Drawing, heading: f64| {
        for ray in 0..RAYS {
            let (sin, cos) = (PI * ray as f64 / RAYS as f64).sin_cos();
            for share in [1.0, -1.0, 0.0] {
                let [x, y] = along(share * cos, share * sin);
                drawing.to(x, y, heading);
            }
        }
    };
    let mut line = Drawing::new(pace);
    line.to(half_m, 0.0, 0.0);
    line.to(-half_m, 0.0, 0.0);
    line.to(0.0, 0.0, 0.0);
    let mut rays = Drawing::new(pace);
    star(&mut rays, 0.0);
    let mut turns = Drawing::new(pace);
    turns.to(0.0, 0.0, 2.0 * TAU);
    turns.to(0.0, 0.0, 0.0);
    let mut square = Drawing::new(pace);
    for heading in [0.0, TAU] {
        square.to(half_m, -half_m, heading);
        square.to(half_m, half_m, heading);
        square.to(-half_m, half_m, heading);
        square.to(-half_m, -half_m, heading);
        square.to(half_m, -half_m, heading);
    }
    square.to(0.0, 0.0, 0.0);
    let mut full = Drawing::new(pace);
    star(&mut full, 0.0);
    let turned = [
        (1.0, 0.0, 0.0),
        (-1.0, 0.0, TAU),
        (0.0, 1.0, TAU),
        (0.0, -1.0, 2.0 * TAU),
        (0.0, 0.0, 2.0 * TAU + PI),
    ];
    let turned_back = [
        (0.0, 1.0, 2.0 * TAU + PI),
        (0.0, -1.0, TAU + PI),
        (-1.0, 0.0, TAU + PI),
        (1.0, 0.0, PI),
        (0.0, 0.0, 0.0),
    ];
    let go = |drawing: &mut Drawing, stretch: [(f64, f64, f64); 5]| {
        for (share_x, share_y, heading) in stretch {
            let [x, y] = along(share_x, share_y);
            drawing.to(x, y, heading);
        }
    };
    go(&mut full, turned);
    star(&mut full, 2.0 * TAU + PI);
    go(&mut full, turned_back);
    vec![
        line.done("line", "forward, back, and again"),
        turns.done("turns", "two turns in place to the left, two to the right"),
        rays.done("star", "straight lines in six directions"),
        square.done("square", "a square twice, turning once on its way"),
        full.done("full", "a star, lines with turns to the left, the star the other way round, lines with turns to the right"),
    ]
}

/// Figures for a tape, each from one place where it is measured to the next one: lines in three directions out and back, then
/// lines on which it turns by an odd number of half turns, so that a wheel that stands elsewhere shows where they end.
pub fn between_tapes(side_m: f64, pace: Pace, wheels: &[Wheel]) -> Vec<Figure> {
    let one = |name, meaning, x: f64, y: f64, heading: f64| {
        let mut drawing = Drawing::new(pace);
        drawing.to(x, y, heading);
        drawing.done(name, meaning)
    };
    let mut list = Vec::new();
    let first_rad = first_ray_rad(wheels);
    for (number, [out, back]) in
        [["out-1", "back-1"], ["out-2", "back-2"], ["out-3", "back-3"]].into_iter().enumerate()
    {
        let (sin, cos) = (first_rad + PI * number as f64 / RAYS as f64).sin_cos();
        list.push(one(out, "a straight line", side_m * cos, side_m * sin, 0.0));
        list.push(one(back, "back again", -side_m * cos, -side_m * sin, 0.0));
    }
    list.push(one("turning-left", "a line ahead with five half turns to the left", side_m, 0.0, 2.5 * TAU));
    list.push(one(
        "turning-on",
        "the same line on, as it looks now: back, with five half turns more",
        side_m,
        0.0,
        2.5 * TAU,
    ));
    list.push(one(
        "turning-right",
        "a line ahead with five half turns to the right",
        side_m,
        0.0,
        -2.5 * TAU,
    ));
    list.push(one(
        "turning-back",
        "the same line on, as it looks now: back, with five half turns more",
        side_m,
        0.0,
        -2.5 * TAU,
    ));
    list
}

/// What drives of figures by the expected platform, one after the other, are expected to show: standard deviations, and what
/// stays unseen.
pub fn foreseen(
    figures: &[Figure],
    expected: &Build,
    tolerances: &Tolerances,
    witness: Witness,
) -> Result<Solution, SolveError> {
    let runs = figures.iter().map(|figure| figure.drawn(expected, witness)).collect::<Result<_, _>>()?;
    solve(&Dataset { runs }, expected, tolerances)
}

/// What tells where the platform is while it drives a figure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Witness {
    /// A sensor of poses.
    Poses(PoseSensor),
    /// A gyro, and a tape at the beginning and at the end.
    GyroAndTape(GyroSensor, Tape),
    /// A tape at the beginning and at the end.
    Tape(Tape),
}

impl Figure {
    /// How long it takes, s.
    pub fn duration_s(&self) -> f64 {
        self.points.last().map_or(0.0, |point| point[0])
    }

    /// Least and greatest x and y of its points, m: between them it goes straight.
    pub fn extent_m(&self) -> [[f64; 2]; 2] {
        let of = |axis: usize| {
            let values = self.points.iter().map(|point| point[axis]);
            [values.clone().fold(f64::INFINITY, f64::min), values.fold(f64::NEG_INFINITY, f64::max)]
        };
        [of(1), of(2)]
    }

    /// Pose and twist in base at a time, s: quintics from rest to rest.
    pub fn at(&self, time_s: f64) -> (Pose2, Twist2) {
        let after = self.points.partition_point(|point| point[0] <= time_s);
        let (Some(from), to) = (self.points.get(after.max(1) - 1), self.points.get(after)) else {
            return Default::default();
        };
        let to = to.unwrap_or(from);
        let duration_s = to[0] - from[0];
        if duration_s <= 0.0 {
            return (Pose2::new(from[1], from[2], from[3]), Twist2::default());
        }
        let s = ((time_s - from[0]) / duration_s).clamp(0.0, 1.0);
        let part = s * s * s * (10.0 + s * (6.0 * s - 15.0));
        let rate = 30.0 * s * s * (1.0 - s) * (1.0 - s) / duration_s;
        let way = [1, 2, 3].map(|axis| to[axis] - from[axis]);
        let pose = Pose2::new(from[1] + part * way[0], from[2] + part * way[1], from[3] + part * way[2]);
        let twist_in_world = Twist2::new(rate * way[0], rate * way[1], rate * way[2]);
        (pose, twist_in_world.rotated(-pose.heading_rad))
    }

    /// A drive without any error.
    fn drawn(&self, expected: &Build, witness: Witness) -> Result<Run, SolveError> {
        let kinematics = Kinematics::new(expected.wheels.clone())?;
        let period_s = 0.02;
        let count = (self.duration_s() / period_s).ceil() as usize;
        let mut run = Run { name: self.name.to_owned(), ..Run::default() };
        for number in 1..=count {
            let middle_s = (number as f64 - 0.5) * period_s;
            let speeds = kinematics.wheel_speeds_rad_s(self.at(middle_s).1);
            let turned_rad = speeds.map(|speed| speed * period_s);
            run.steps.push(Step { end_s: number as f64 * period_s, turned_rad });
        }
        // Where these steps lead, so that nothing is off.
        let mut pose = Pose2::default();
        let mut truth = vec![(0.0, pose)];
        for step in &run.steps {
            pose = pose.moved_by(kinematics.body_step(&step.turned_rad).0);
            truth.push((step.end_s, pose));
        }
        match witness {
            Witness::Poses(sensor) => {
                let mount = expected.sensor;
                run.poses = truth
                    .iter()
                    .map(|(instant_s, pose)| PoseSample {
                        instant_s: instant_s + mount.delay_s,
                        world_from_sensor: pose.then(mount.base_from_sensor),
                        // As many as there are, as one in each step would be.
                        sigma_m: sensor.sigma_m * (sensor.every_s / period_s).sqrt().min(1.0),
                        sigma_rad: sensor.sigma_rad * (sensor.every_s / period_s).sqrt().min(1.0),
                    })
                    .collect();
            }
            Witness::GyroAndTape(..) | Witness::Tape(_) => {
                if let Witness::GyroAndTape(..) = witness {
                    let rate = |pair: &[(f64, Pose2)]| TurnSample {
                        instant_s: 0.5 * (pair[0].0 + pair[1].0),
                        rate_rad_s: (pair[1].1.heading_rad - pair[0].1.heading_rad) / period_s,
                    };
                    run.turns = truth.windows(2).map(rate).collect();
                }
                let (Witness::GyroAndTape(_, tape) | Witness::Tape(tape)) = witness else { return Ok(run) };
                let ends = [truth.first(), truth.last()];
                run.places = ends
                    .into_iter()
                    .flatten()
                    .map(|(instant_s, floor_from_base)| PlaceSample {
                        instant_s: *instant_s,
                        floor_from_base: *floor_from_base,
                        sigma_m: tape.sigma_m,
                        sigma_rad: tape.sigma_rad,
                    })
                    .collect();
            }
        }
        Ok(run)
    }
}
