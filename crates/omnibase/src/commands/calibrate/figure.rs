//! Which figures are driven, shown before any wheel turns, and what each is expected to show.

use super::{Arguments, Known};
use crate::WrongUsage;
use crate::terminal::fixed;
use anyhow::bail;
use omnibase_calibrate::figures::{self, Figure, Pace, Witness};
use omnibase_calibrate::observed::unseen;
use omnibase_calibrate::rehearsal::{GyroSensor, PoseSensor, Tape};
use omnibase_calibrate::{Solution, Unknown};
use omnibase_platform::Pose2;
use omnibase_robot::RobotPlan;
use omnibase_robot::config::{InterpolationName, PathFrame, ReferenceTable};
use std::io::{self, Write};

/// The figure for poses unless another one is asked for.
const DEFAULT: &str = "full";
/// The side of the square for figures where nothing is said, m.
const SIDE_M: f64 = 2.0;
/// Figures are driven so much below the robot's limits.
const ROOM: f64 = 0.8;
/// No faster than this, whatever the limits: treads creep with acceleration.
const GENTLE: Pace =
    Pace { speed_m_s: 0.4, acceleration_m_s2: 0.4, turn_speed_rad_s: 0.8, turn_acceleration_rad_s2: 0.8 };
/// How often the figures for a tape may be driven, as `--show` compares them.
const COMPARED_ROUNDS: [usize; 3] = [1, 2, 4];
/// Poses at which the way is compared with the fence, per second.
const LOOKS_PER_S: f64 = 20.0;

/// How fast.
pub(super) fn pace(plan: &RobotPlan) -> Pace {
    let limits = &plan.limits;
    // A wheel's share of a motion: its own limit, in the worst direction.
    let slowest = |per_unit: fn(&[f64; 3]) -> f64| {
        let rows = plan.kinematics.matrix().iter().zip(plan.kinematics.wheels());
        let fastest = rows.map(|(row, wheel)| per_unit(row) / wheel.radius_m).fold(1e-9, f64::max);
        limits.wheel_speed_rad_s / fastest
    };
    Pace {
        speed_m_s: GENTLE
            .speed_m_s
            .min(ROOM * limits.speed_m_s)
            .min(0.5 * slowest(|row| row[0].hypot(row[1]))),
        acceleration_m_s2: GENTLE.acceleration_m_s2.min(ROOM * limits.acceleration_m_s2),
        turn_speed_rad_s: GENTLE
            .turn_speed_rad_s
            .min(ROOM * limits.turn_speed_rad_s)
            .min(0.5 * slowest(|row| row[2].abs())),
        turn_acceleration_rad_s2: GENTLE.turn_acceleration_rad_s2.min(ROOM * limits.turn_acceleration_rad_s2),
    }
}

/// What tells where the robot is, as far as it is known beforehand.
pub(super) fn witness(arguments: &Arguments, plan: &RobotPlan) -> Witness {
    let [sigma_m, sigma_rad] = arguments.tape_sigma;
    let tape = Tape { sigma_m, sigma_rad };
    match &arguments.truth {
        Some(_) => Witness::Poses(PoseSensor::default()),
        None if has_gyro(arguments, plan) => Witness::GyroAndTape(GyroSensor::default(), tape),
        None => Witness::Tape(tape),
    }
}

/// Whether a gyro tells turns: by the command line, or by the robot's file.
pub(super) fn has_gyro(arguments: &Arguments, plan: &RobotPlan) -> bool {
    arguments.gyro.is_some() || plan.safety.gyro_input.is_some()
}

/// The figures that are driven, in order.
pub(super) fn chosen(arguments: &Arguments, plan: &RobotPlan) -> anyhow::Result<Vec<Figure>> {
    let (side_m, pace) = (arguments.side.unwrap_or(SIDE_M), pace(plan));
    if arguments.truth.is_none() && arguments.figure.is_none() {
        let once = figures::between_tapes(side_m, pace, plan.kinematics.wheels());
        return Ok(vec![once; usize::from(arguments.rounds.unwrap_or(1))].concat());
    }
    let all = figures::all(side_m, pace, plan.kinematics.wheels());
    let name = arguments.figure.as_deref().unwrap_or(DEFAULT);
    let names: Vec<&str> = all.iter().map(|figure| figure.name).collect();
    let one = all.iter().find(|figure| figure.name == name).cloned();
    one.map(|figure| vec![figure]).ok_or_else(|| {
        let words = format!("--figure {name}: expected one of {}", names.join(", "));
        WrongUsage(anyhow::Error::msg(words)).into()
    })
}

/// As a reference of the robot.
pub(super) fn reference(figure: &Figure) -> ReferenceTable {
    ReferenceTable {
        interpolation: Some(InterpolationName::Quintic),
        frame: Some(PathFrame::Start),
        ..ReferenceTable::path(figure.points.clone())
    }
}

/// Shows the figures that will be driven; an error where one leaves the fence.
pub(super) fn announce(figures: &[Figure], plan: &RobotPlan, output: &mut dyn Write) -> anyhow::Result<()> {
    for figure in figures {
        let [x, y] = figure.extent_m();
        write!(
            output,
            "{}: {}; {} s, x from {} to {} m, y from {} to {} m from where it stands",
            figure.name,
            figure.meaning,
            fixed(figure.duration_s(), 0),
            fixed(x[0], 2),
            fixed(x[1], 2),
            fixed(y[0], 2),
            fixed(y[1], 2)
        )?;
        let Some(fence) = &plan.guard.fence else {
            writeln!(output, "; no fence is told")?;
            continue;
        };
        let (room_m, pose) = least_room(figure, &plan.guard.footprint_m, &fence.corners_m);
        let needed_m = fence.margin_m;
        if room_m < needed_m {
            writeln!(output)?;
            bail!(
                "{}: at ({}, {}) m the platform would be {} m from the fence, expected at least {} m (fence.margin_m): \
                 give a smaller --side, or start elsewhere",
                figure.name,
                fixed(pose.x_m, 2),
                fixed(pose.y_m, 2),
                fixed(room_m, 3),
                fixed(needed_m, 3)
            );
        }
        writeln!(output, "; {} m to the fence at least", fixed(room_m, 2))?;
    }
    Ok(())
}

/// All figures, and what each is expected to show: standard deviations of the worst wheel, and how many combinations stay dark.
pub(super) fn compare(
    arguments: &Arguments,
    plan: &RobotPlan,
    known: &Known,
    output: &mut dyn Write,
) -> anyhow::Result<()> {
    let witness = witness(arguments, plan);
    let (side_m, pace, wheels) = (arguments.side.unwrap_or(SIDE_M), pace(plan), plan.kinematics.wheels());
    let compared: Vec<(String, Vec<Figure>)> = match witness {
        Witness::Poses(_) => {
            let all = figures::all(side_m, pace, wheels);
            all.into_iter().map(|figure| (figure.name.to_owned(), vec![figure])).collect()
        }
        Witness::GyroAndTape(..) | Witness::Tape(_) => {
            let once = figures::between_tapes(side_m, pace, wheels);
            let rounds = |count: usize| (format!("--rounds {count}"), vec![once.clone(); count].concat());
            COMPARED_ROUNDS.map(rounds).into()
        }
    };
    writeln!(output, "expected of each figure, ± of the worst wheel:")?;
    writeln!(
        output,
        "{:<10} {:>6} {:>10} {:>12} {:>10} {:>14}",
        "", "s", "radius %", "direction °", "across mm", "not observed"
    )?;
    for (name, figures) in compared {
        let solution = figures::foreseen(&figures, &known.build, &known.tolerances, witness)?;
        let duration_s: f64 = figures.iter().map(Figure::duration_s).sum();
        line(&name, duration_s, &solution, unseen(&solution, &known.build).len(), output)?;
    }
    writeln!(output)?;
    Ok(())
}

fn line(
    name: &str,
    duration_s: f64,
    solution: &Solution,
    unseen: usize,
    output: &mut dyn Write,
) -> io::Result<()> {
    let worst = |is_such: fn(Unknown) -> bool| {
        let such = solution.found.iter().filter(|found| is_such(found.unknown));
        such.map(|found| found.sigma_held).fold(0.0, f64::max)
    };
    writeln!(
        output,
        "{name:<10} {:>6} {:>10} {:>12} {:>10} {unseen:>14}",
        fixed(duration_s, 0),
        fixed(100.0 * worst(|unknown| matches!(unknown, Unknown::Radius(_))), 4),
        fixed(worst(|unknown| matches!(unknown, Unknown::Direction(_))).to_degrees(), 4),
        fixed(1e3 * worst(|unknown| matches!(unknown, Unknown::Across(_))), 3),
    )
}

type Point = [f64; 2];

/// The least room between platform and fence on a figure from the origin of odom, m, and where; below 0 outside.
fn least_room(figure: &Figure, footprint: &[Point], fence: &[Point]) -> (f64, Pose2) {
    let looks = (figure.duration_s() * LOOKS_PER_S).ceil() as usize;
    let rooms = (0..=looks).map(|look| {
        let pose = figure.at(look as f64 / LOOKS_PER_S).0;
        (room_m(&placed(footprint, pose), fence), pose)
    });
    rooms.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, Pose2::default()))
}

fn placed(footprint: &[Point], pose: Pose2) -> Vec<Point> {
    let put = |[x, y]: &Point| {
        let there = pose.then(Pose2::new(*x, *y, 0.0));
        [there.x_m, there.y_m]
    };
    footprint.iter().map(put).collect()
}

fn sides(polygon: &[Point]) -> impl Iterator<Item = [Point; 2]> + '_ {
    (0..polygon.len()).map(|at| [polygon[at], polygon[(at + 1) % polygon.len()]])
}

fn distance_m([px, py]: Point, [[ax, ay], [bx, by]]: [Point; 2]) -> f64 {
    let (dx, dy) = (bx - ax, by - ay);
    let along = (((px - ax) * dx + (py - ay) * dy) / (dx * dx + dy * dy).max(1e-12)).clamp(0.0, 1.0);
    (px - ax - along * dx).hypot(py - ay - along * dy)
}

fn is_inside(polygon: &[Point], [px, py]: Point) -> bool {
    let crossed = sides(polygon).filter(|[[ax, ay], [bx, by]]| {
        (*ay > py) != (*by > py) && px < (bx - ax) * (py - ay) / (by - ay) + ax
    });
    crossed.count() % 2 == 1
}

/// From a convex body to the fence around it, m.
fn room_m(body: &[Point], fence: &[Point]) -> f64 {
    let corners = body.iter().flat_map(|corner| sides(fence).map(|side| distance_m(*corner, side)));
    let posts = fence.iter().flat_map(|post| sides(body).map(|side| distance_m(*post, side)));
    let nearest = corners.chain(posts).fold(f64::INFINITY, f64::min);
    let is_out = body.iter().any(|corner| !is_inside(fence, *corner))
        || fence.iter().any(|post| is_inside(body, *post));
    if is_out { -nearest } else { nearest }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn room_to_a_fence_is_that_of_the_nearest_corner_and_negative_outside() {
        let square = |half: f64| vec![[-half, -half], [half, -half], [half, half], [-half, half]];
        let room = |x, heading| room_m(&placed(&square(0.5), Pose2::new(x, 0.0, heading)), &square(2.0));
        assert!((room(0.0, 0.0) - 1.5).abs() < 1e-12);
        assert!((room(1.0, 0.0) - 0.5).abs() < 1e-12);
        assert!((room(0.0, std::f64::consts::FRAC_PI_4) - (2.0 - 0.5_f64.sqrt())).abs() < 1e-12);
        assert!(room(1.6, 0.0) < 0.0 && room(3.0, 0.0) < 0.0);
    }
}
