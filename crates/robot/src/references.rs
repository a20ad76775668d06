//! References: wished motions that begin where the platform stands, and begin and end at rest.

mod curves;
mod dxf;

use std::borrow::Cow;

use omnibase_platform::{Pose2, wrap_angle_rad};
use omnibase_trajectory::curve;
use omnibase_trajectory::limits::{self, Peaks};
use omnibase_trajectory::{
    Corrected, Correction, CurveHeading, FastestError, FastestTrajectory, GeometricPath, Heading,
    InPlatformAxes, Interpolation, Joining, Nurbs, Passing, PathPoint, PathPoints, PathPointsError,
    PiecewisePath, Placed, PlatformBounds, PointTrajectory, Shape, ShapeError, ShapePath, ShapeTrajectory,
    SpeedRule, Trajectory,
};

use crate::ability::{Ability, ROOM};
use crate::config::{
    AtObstacles, EndlessName, HeadingName, InterpolationName, Limits, PathFrame, Problem, ReferenceTable,
    Timing, Turns, motion_limits,
};
use crate::registry::{Key, Kind, Made, Registry, StageError, given, needed, optional};
use crate::signals::{ReferenceStatus, Setpoint};
use crate::stages::{PlannedFor, Reference};

/// Where points turn by more than this they are a corner, rad: 30°.
const CORNER_RAD: f64 = std::f64::consts::FRAC_PI_6;

/// Most turns of a shape that are planned as fast as can be: its memory is a megabyte for a hundred of them.
const MOST_TURNS: f64 = 1e4;

/// The keys of the fastest motion's speeds: the greatest ones, and those with which ends are passed.
const SPEEDS: [&str; 4] = ["speed_m_s", "turn_speed_rad_s", "start_speed_m_s", "end_speed_m_s"];
/// Where in them those of the ends begin.
const ENDS: usize = 2;

/// The name of the path through points.
const PATH: &str = "path";

impl ReferenceTable {
    /// A path through lines `[t, x, y, θ]`, SI.
    pub fn path(points: Vec<[f64; 4]>) -> Self {
        ReferenceTable { kind: Some(PATH.to_owned()), points: Some(points), ..Default::default() }
    }

    /// A path through the lines of a file.
    pub fn path_of_file(file: String) -> Self {
        ReferenceTable { kind: Some(PATH.to_owned()), points_file: Some(file), ..Default::default() }
    }

    /// A path through points.
    pub fn through(points: &PathPoints) -> Self {
        ReferenceTable::path(lines_of(points))
    }
}

/// The keys of what repeats taught.
fn correction_keys() -> [Key; 2] {
    let file = optional("correction_file").file("correction", |text, table| {
        table.correction = Some(read_points(text)?);
        Ok(())
    });
    [optional("correction"), file]
}

/// A geometric shape by its name.
struct ShapeKind {
    name: &'static str,
    meaning: &'static str,
    needs: &'static [&'static str],
    heading: Heading,
    shape: fn(&ReferenceTable) -> Made<Shape>,
}

const SHAPES: [ShapeKind; 5] = [
    ShapeKind {
        name: "circle",
        meaning: "A circle to the left; the heading stays",
        needs: &["radius_m"],
        heading: Heading::Fixed,
        shape: circle,
    },
    ShapeKind {
        name: "ellipse",
        meaning: "An ellipse to the left",
        needs: &["semi_axis_x_m", "semi_axis_y_m"],
        heading: Heading::Fixed,
        shape: |table| {
            let half_length_m = given(table.semi_axis_x_m, "semi_axis_x_m")?;
            Ok(Shape::Ellipse { half_length_m, half_width_m: given(table.semi_axis_y_m, "semi_axis_y_m")? })
        },
    },
    ShapeKind {
        name: "spiral",
        meaning: "An Archimedes spiral outwards, to the left",
        needs: &["step_m"],
        heading: Heading::Fixed,
        shape: |table| Ok(Shape::Spiral { step_m: given(table.step_m, "step_m")? }),
    },
    ShapeKind {
        name: "eight",
        meaning: "A lying eight, which ends as it began",
        needs: &["half_length_m"],
        heading: Heading::Fixed,
        shape: |table| Ok(Shape::Eight { half_length_m: given(table.half_length_m, "half_length_m")? }),
    },
    ShapeKind {
        name: "holonomic",
        meaning: "A circle to the left; the heading follows the tangent",
        needs: &["radius_m"],
        heading: Heading::FollowsTangent,
        shape: circle,
    },
];

fn circle(table: &ReferenceTable) -> Made<Shape> {
    Ok(Shape::Circle { radius_m: given(table.radius_m, "radius_m")? })
}

/// Registers the built-in references.
pub fn register(registry: &mut Registry) {
    let references = &mut registry.references;
    references
        .add(Kind { name: "hold", meaning: "Stays where the platform stands", keys: Vec::new() }, |_, _| {
            Ok(Hold::default())
        });
    for shape in SHAPES {
        let further = ["duration_s", "period_s", "turns", "heading", "timing", "frame", "obstacles"];
        let further = further.into_iter().chain(SPEEDS).map(optional).chain(correction_keys());
        let keys = shape.needs.iter().copied().map(needed).chain(further).collect();
        references.add(Kind { name: shape.name, meaning: shape.meaning, keys }, move |table, ability| {
            Tracked::new(shape.trajectory(table, ability)?, table, ability)
        });
    }
    references.add(
        Kind {
            name: PATH,
            meaning: "A path through points with their times",
            keys: [
                needed("points"),
                optional("points_file").file("points", |text, table| {
                    table.points = Some(read_points(text)?);
                    Ok(())
                }),
                optional("interpolation"),
                optional("heading"),
                optional("timing"),
                optional("corner_m"),
                optional("frame"),
                optional("obstacles"),
            ]
            .into_iter()
            .chain(SPEEDS.map(optional))
            .chain(correction_keys())
            .collect(),
        },
        |table, ability| Tracked::new(path(table, ability)?, table, ability),
    );
    curves::register(registry);
}

impl ShapeKind {
    /// As a table asks for it; without a duration as fast as the limits allow.
    fn trajectory(&self, table: &ReferenceTable, ability: &Ability) -> Made<AnyTrajectory> {
        let limits = &ability.limits;
        let heading = match table.heading {
            Some(HeadingName::FollowsTangent) => Heading::FollowsTangent,
            Some(HeadingName::Fixed) => Heading::Fixed,
            Some(HeadingName::Given | HeadingName::Free) | None => self.heading,
        };
        let shape = (self.shape)(table)?;
        let turns = table.turns.unwrap_or(Turns::Count(1.0));
        let (time_s, key) = match (table.duration_s, table.period_s, turns) {
            (Some(_), Some(_), _) => {
                let reason = "`duration_s` says the time of the whole motion already: give one of the two";
                return Err(Problem::refused("period_s", reason).into());
            }
            (Some(_), None, Turns::Named(EndlessName::Endless)) => {
                let reason = "an endless motion has no duration: give the time of one turn, `period_s`";
                return Err(Problem::refused("duration_s", reason).into());
            }
            (Some(duration_s), None, Turns::Count(_)) => (Some(duration_s), "duration_s"),
            (None, Some(period_s), Turns::Count(count)) => (Some(count * period_s), "period_s"),
            (None, Some(period_s), Turns::Named(EndlessName::Endless)) => (Some(period_s), "period_s"),
            (None, None, _) => (None, ""),
        };
        if table.timing == Some(Timing::Fastest) {
            let refused = |key: &str, reason: &str| Err(Problem::refused(key, reason).into());
            return match (time_s, turns) {
                (Some(_), _) => {
                    refused(key, "the fastest motion takes the time that the limits allow: leave it out")
                }
                (None, Turns::Named(EndlessName::Endless)) => {
                    refused("turns", "the fastest motion goes from rest to rest, so it has an end")
                }
                (None, Turns::Count(turns)) if turns > MOST_TURNS => {
                    let expected = format!("expected at most {MOST_TURNS} for the fastest motion");
                    refused("turns", &expected)
                }
                (None, Turns::Count(turns)) => {
                    let way = ShapePath { shape, heading, turns };
                    let own = fastest(way, table, ability)?;
                    if is_free(table) { freely(own, [&way; 2], table, ability) } else { Ok(own) }
                }
            };
        }
        needs_fastest(table, &[HeadingName::Free])?;
        let make = |time_s: f64| {
            let made = match turns {
                Turns::Count(count) => ShapeTrajectory::new(shape, heading, count, time_s),
                Turns::Named(EndlessName::Endless) => ShapeTrajectory::endless(shape, heading, time_s),
            };
            let made = made.map_err(|error| match error {
                ShapeError::TooLong { .. } => StageError::from(Problem::refused(key, error)),
                ShapeError::Setting { .. } => Problem::refused("", error).into(),
            });
            in_frame(made?, table)
        };
        let Some(time_s) = time_s else {
            let (stretch, _) = Peaks::of(&make(1.0)?).stretch(&motion_limits(limits));
            return make(stretch * ROOM);
        };
        let trajectory = make(time_s)?;
        if table.timing == Some(Timing::Stretched) {
            return Ok(stretched(trajectory, limits));
        }
        let given_s = table.period_s.unwrap_or(time_s);
        limits::check(&trajectory, given_s, &motion_limits(limits))
            .map_err(|refusal| Problem::refused(key, refusal))?;
        Ok(trajectory)
    }
}

fn path(table: &ReferenceTable, ability: &Ability) -> Made<AnyTrajectory> {
    let limits = &ability.limits;
    let mut points = points_of(given(table.points.as_ref(), "points")?)
        .map_err(|error| Problem::refused("points", error))?;
    if table.heading == Some(HeadingName::Fixed) {
        points = points.with_first_heading();
    }
    let interpolation = match table.interpolation.unwrap_or(InterpolationName::Smooth) {
        InterpolationName::Smooth => Interpolation::Smooth,
        InterpolationName::CubicPreviousSlope => Interpolation::Cubic(SpeedRule::PreviousSlope),
        InterpolationName::CubicMeanSlope => Interpolation::Cubic(SpeedRule::MeanSlope),
        InterpolationName::Quintic => Interpolation::Quintic,
        InterpolationName::Spline => Interpolation::Spline,
        InterpolationName::BSpline => Interpolation::BSpline,
    };
    if table.timing != Some(Timing::Fastest) {
        needs_fastest(table, &[HeadingName::Free, HeadingName::FollowsTangent])?;
    }
    match table.timing {
        Some(Timing::Fastest) => {
            let poses: Vec<Pose2> = points.as_slice().iter().map(|point| point.odom_from_base).collect();
            if table.heading == Some(HeadingName::FollowsTangent) {
                return along_tangent(&poses, table, ability);
            }
            let radius_m = limits.speed_m_s / limits.turn_speed_rad_s;
            return fastest_through(&poses, radius_m, table, ability);
        }
        Some(Timing::Stretched) => {
            let path = in_frame(PointTrajectory::new(&points, interpolation), table)?;
            return Ok(stretched(path, limits));
        }
        Some(Timing::AsGiven) | None => {}
    }
    let planned = limits::plan(&points, interpolation, &motion_limits(limits)).map_err(|refusals| {
        let problem = |refusal: &limits::Refusal| {
            let key = refusal.part.point.map_or_else(|| "points".into(), |point| format!("points[{point}]"));
            Problem::refused(key, refusal)
        };
        StageError(refusals.iter().map(problem).collect())
    })?;
    let path = in_frame(planned, table)?;
    if table.frame == Some(PathFrame::Platform) {
        // Axes that turn add to the acceleration.
        limits::check(&path, path.duration_s(), &motion_limits(limits))
            .map_err(|refusal| Problem::refused("points", refusal))?;
    }
    Ok(path)
}

fn points_of(lines: &[[f64; 4]]) -> Result<PathPoints, PathPointsError> {
    let point = |&[time_s, x_m, y_m, heading_rad]: &[f64; 4]| PathPoint {
        time_s,
        odom_from_base: Pose2::new(x_m, y_m, heading_rad),
    };
    PathPoints::new(lines.iter().map(point).collect())
}

/// What repeats taught of a motion of this duration, s.
fn correction(duration_s: f64, table: &ReferenceTable) -> Made<Option<Correction>> {
    let Some(lines) = &table.correction else { return Ok(None) };
    let controls = points_of(lines).map_err(|error| Problem::refused("correction", error))?;
    let correction = Correction::new(duration_s, &controls);
    Ok(Some(correction.map_err(|error| Problem::refused("correction", error))?))
}

/// A way through poses in the shortest time that the limits allow; a turn by one radian counts as so much of the way.
fn fastest_through(
    poses: &[Pose2],
    radius_m: f64,
    table: &ReferenceTable,
    ability: &Ability,
) -> Made<AnyTrajectory> {
    let joining = Joining { radius_m, corner_rad: CORNER_RAD, tolerance_m: table.corner_m.unwrap_or(0.0) };
    let reason = "all of them are the same pose: there is no way to go fast along";
    let way = PiecewisePath::through(poses, joining).ok_or_else(|| Problem::refused("points", reason))?;
    let own = fastest(way.clone(), table, ability)?;
    let unturned = is_free(table).then(|| PiecewisePath::through(&unturned(poses), joining)).flatten();
    match unturned {
        Some(unturned) => freely(own, [&way, &unturned], table, ability),
        None => Ok(own),
    }
}

/// A way through places in the shortest time, with the heading along it.
fn along_tangent(poses: &[Pose2], table: &ReferenceTable, ability: &Ability) -> Made<AnyTrajectory> {
    let joining = Joining { radius_m: 0.0, corner_rad: CORNER_RAD, tolerance_m: 0.0 };
    let reason = "all of them are the same place: there is no tangent to follow";
    let way = PiecewisePath::through(&unturned(poses), joining)
        .ok_or_else(|| Problem::refused("points", reason))?;
    let curves: Result<Vec<Nurbs>, _> =
        way.beziers().map(|controls| Nurbs::new(&controls, 3, None, None)).collect();
    let curves = curves.map_err(|error| Problem::refused("points", error))?;
    let poses = curve::poses(&curves, CurveHeading::Tangent, CORNER_RAD);
    fastest_through(&poses, curves::TURN_COUNTS_M, table, ability)
}

/// The same places with one heading.
fn unturned(poses: &[Pose2]) -> Vec<Pose2> {
    poses.iter().map(|pose| Pose2::new(pose.x_m, pose.y_m, 0.0)).collect()
}

fn is_free(table: &ReferenceTable) -> bool {
    table.heading == Some(HeadingName::Free)
}

/// Some headings, and speeds at the ends, come with the fastest motion alone.
fn needs_fastest(table: &ReferenceTable, names: &[HeadingName]) -> Made<()> {
    let given = [table.speed_m_s, table.turn_speed_rad_s, table.start_speed_m_s, table.end_speed_m_s];
    if let Some((key, _)) = SPEEDS.into_iter().zip(given).find(|(_, speed)| speed.is_some()) {
        let reason = "a motion has speeds of its own by `timing = \"fastest\"` alone";
        return Err(Problem::refused(key, reason).into());
    }
    if table.heading.is_some_and(|heading| names.contains(&heading)) {
        let reason = "such a heading is planned together with the times: it needs `timing = \"fastest\"`";
        return Err(Problem::refused("heading", reason).into());
    }
    Ok(())
}

/// A motion along the second of two ways with the heading that makes it fastest, from that of the first one's beginning to that of its
/// end; the motion along the first one itself where none is faster.
fn freely<P: GeometricPath + Clone + Send + 'static>(
    own: AnyTrajectory,
    [way, unturned]: [&P; 2],
    table: &ReferenceTable,
    ability: &Ability,
) -> Made<AnyTrajectory> {
    let ends_rad = [0.0, way.length()].map(|sigma| way.sample(sigma, 0.0)[2][0]);
    let Ok(free) = FastestTrajectory::with_free_heading(unturned, ends_rad, &*bounds(table, ability)?) else {
        return Ok(own);
    };
    // Its ends were sought at rest.
    let free = fastest(free.path().clone(), table, ability);
    Ok(free.ok().filter(|free| free.duration_s() < own.duration_s()).unwrap_or(own))
}

/// A way in the shortest time that the limits allow.
fn fastest(
    way: impl GeometricPath + Send + 'static,
    table: &ReferenceTable,
    ability: &Ability,
) -> Made<AnyTrajectory> {
    if table.frame == Some(PathFrame::Platform) {
        let reason = "the fastest motion is planned in `start` or `odom`";
        return Err(Problem::refused("frame", reason).into());
    }
    let [start_m_s, end_m_s] =
        [table.start_speed_m_s, table.end_speed_m_s].map(|speed_m_s| speed_m_s.unwrap_or(0.0));
    let motion = FastestTrajectory::passing(way, Passing { start_m_s, end_m_s }, &*bounds(table, ability)?);
    let motion = motion.map_err(|error| {
        let key = match error {
            FastestError::NoSpeed { end, .. } | FastestError::OnTheSpot(end) => SPEEDS[ENDS + end as usize],
            _ => "timing",
        };
        Problem::refused(key, error)
    })?;
    Ok(Box::new(motion))
}

/// What bounds the fastest motion of a table.
fn bounds<'a>(table: &ReferenceTable, ability: &'a Ability) -> Made<Cow<'a, PlatformBounds>> {
    let [speed_m_s, turn_speed_rad_s] = [table.speed_m_s, table.turn_speed_rad_s];
    for (key, speed) in SPEEDS.into_iter().zip([speed_m_s, turn_speed_rad_s]) {
        if let Some(found) = speed.filter(|speed| !(speed.is_finite() && *speed > 0.0)) {
            return Err(Problem::refused(key, format!("expected a number above 0, found {found}")).into());
        }
    }
    if speed_m_s.is_none() && turn_speed_rad_s.is_none() {
        return Ok(Cow::Borrowed(&ability.bounds));
    }
    let mut bounds = ability.bounds.clone();
    let limits = &mut bounds.limits;
    limits.speed_m_s = limits.speed_m_s.min(speed_m_s.unwrap_or(f64::INFINITY));
    limits.rate_rad_s = limits.rate_rad_s.min(turn_speed_rad_s.unwrap_or(f64::INFINITY));
    Ok(Cow::Owned(bounds))
}

/// A motion that takes longer where the limits ask for it.
fn stretched(trajectory: AnyTrajectory, limits: &Limits) -> AnyTrajectory {
    let (factor, _) = Peaks::of(&trajectory).stretch(&motion_limits(limits));
    if factor <= 1.0 { trajectory } else { Box::new(Placed::new(trajectory).stretched(factor * ROOM)) }
}

type AnyTrajectory = Box<dyn Trajectory + Send>;

/// A trajectory in the axes that a table asks for.
fn in_frame(trajectory: impl Trajectory + Send + 'static, table: &ReferenceTable) -> Made<AnyTrajectory> {
    if table.frame != Some(PathFrame::Platform) {
        return Ok(Box::new(trajectory));
    }
    let reason = "a motion in the platform's axes has an end, within 2000 s";
    let turned = InPlatformAxes::new(trajectory).ok_or_else(|| Problem::refused("frame", reason))?;
    Ok(Box::new(turned))
}

/// Reads a file of path points.
fn read_points(text: &str) -> Result<Vec<[f64; 4]>, String> {
    Ok(lines_of(&PathPoints::parse(text).map_err(|error| error.to_string())?))
}

fn lines_of(points: &PathPoints) -> Vec<[f64; 4]> {
    let line = |point: &PathPoint| {
        let Pose2 { x_m, y_m, heading_rad } = point.odom_from_base;
        [point.time_s, x_m, y_m, heading_rad]
    };
    points.as_slice().iter().map(line).collect()
}

/// Follows a trajectory.
struct Tracked {
    /// Taken out only while it is put in its place.
    placed: Option<Placed<AnyTrajectory>>,
    /// What is in it of repeats.
    correction: Option<Correction>,
    duration_s: f64,
    passes_s: [Option<f64>; 2],
    planned_for: Option<PlannedFor>,
    frame: PathFrame,
    keeps_path: bool,
    /// The trajectory's own first and last pose; without an end it has no last.
    first: Pose2,
    last: Option<Pose2>,
}

impl Tracked {
    /// A reference that follows a trajectory in the frame that a table asks for.
    fn new(trajectory: AnyTrajectory, table: &ReferenceTable, ability: &Ability) -> Made<Self> {
        let (duration_s, passes_s) = (trajectory.duration_s(), trajectory.passes_s());
        let correction = correction(duration_s, table)?;
        let trajectory: AnyTrajectory = match &correction {
            Some(correction) => Box::new(Corrected::new(trajectory, correction.clone())),
            None => trajectory,
        };
        let sure = ability.sure.filter(|_| table.timing == Some(Timing::Fastest));
        let planned_for = sure.map(|sure| PlannedFor {
            heat: ability.bounds.heat.as_ref().map_or(0.0, |heat| heat.most(&trajectory)),
            ..sure
        });
        let first = trajectory.sample(0.0).odom_from_base;
        let last = duration_s.is_finite().then(|| trajectory.sample(duration_s).odom_from_base);
        let (placed, frame) = (Some(Placed::new(trajectory)), table.frame.unwrap_or(PathFrame::Start));
        let keeps_path = table.obstacles == Some(AtObstacles::Wait);
        Ok(Tracked { placed, correction, duration_s, passes_s, planned_for, frame, keeps_path, first, last })
    }

    /// Where it begins from a pose.
    fn begin(&self, here: &Pose2) -> Pose2 {
        match self.frame {
            PathFrame::Start | PathFrame::Platform => *here,
            // The platform's heading counts its turns.
            PathFrame::Odom => {
                let turn_rad = wrap_angle_rad(self.first.heading_rad - here.heading_rad);
                Pose2 { heading_rad: here.heading_rad + turn_rad, ..self.first }
            }
        }
    }
}

impl Reference for Tracked {
    fn start(&mut self, from: &Setpoint) {
        let begin = self.begin(&from.odom_from_body);
        self.placed = self.placed.take().map(|placed| placed.beginning_at(begin));
    }

    fn sample(&mut self, since_start_s: f64) -> Setpoint {
        self.preview(since_start_s).unwrap_or_default()
    }

    fn preview(&self, since_start_s: f64) -> Option<Setpoint> {
        let sample = self.placed.as_ref()?.sample(since_start_s);
        Some(Setpoint {
            odom_from_body: sample.odom_from_base,
            twist_in_odom: sample.twist_in_odom,
            acceleration_in_odom: sample.acceleration_in_odom,
            status: if since_start_s < self.duration_s {
                ReferenceStatus::Moving
            } else {
                ReferenceStatus::Finished
            },
        })
    }

    fn correction(&self, since_start_s: f64) -> Pose2 {
        self.correction.as_ref().map_or_else(Pose2::default, |correction| correction.at(since_start_s))
    }

    fn duration_s(&self) -> Option<f64> {
        self.duration_s.is_finite().then_some(self.duration_s)
    }

    fn passes_s(&self) -> [Option<f64>; 2] {
        self.passes_s
    }

    fn planned_for(&self) -> Option<PlannedFor> {
        self.planned_for
    }

    fn keeps_path(&self) -> bool {
        self.keeps_path
    }

    fn start_pose(&self) -> Option<Pose2> {
        match self.frame {
            PathFrame::Start | PathFrame::Platform => None,
            PathFrame::Odom => Some(self.first),
        }
    }

    fn end_pose(&self, odom_from_body: &Pose2) -> Option<Pose2> {
        Some(self.begin(odom_from_body).then(self.first.inverse().then(self.last?)))
    }
}

/// Stays where the platform stands.
#[derive(Clone, Copy, Debug, Default)]
pub struct Hold {
    pose: Pose2,
}

impl Reference for Hold {
    fn start(&mut self, from: &Setpoint) {
        self.pose = from.odom_from_body;
    }

    fn sample(&mut self, _: f64) -> Setpoint {
        Setpoint::at_rest(self.pose)
    }
}
