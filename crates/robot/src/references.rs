//! References: wished motions that begin where the platform stands, and begin and end at rest.

use omnibase_platform::{Pose2, wrap_angle_rad};
use omnibase_trajectory::limits::{self, Peaks};
use omnibase_trajectory::{
    Heading, Interpolation, PathPoint, PathPoints, Placed, PointTrajectory, Shape, ShapeError,
    ShapeTrajectory, SpeedRule, Trajectory,
};

use crate::config::{HeadingName, InterpolationName, Limits, PathFrame, ReferenceTable};
use crate::registry::{Registry, StageError};
use crate::signals::{ReferenceStatus, Setpoint};
use crate::stages::Reference;

/// Kinds of references that are trajectories.
const TRAJECTORIES: [&str; 6] = ["circle", "ellipse", "spiral", "eight", "holonomic", "path"];
/// A motion without a duration keeps this far from the limits, so that catching up has room.
const ROOM: f64 = 1.02;

/// Registers the built-in references.
pub fn register(registry: &mut Registry) {
    registry.reference("hold", |_| Ok(Box::new(Hold::default())));
    for name in TRAJECTORIES {
        registry.reference(name, |plan| {
            reference(&plan.reference, &plan.limits).map_err(|refusals| StageError::Refused {
                setting: "reference".into(),
                reason: refusals.iter().map(|refusal| refusal.reason.as_str()).collect::<Vec<_>>().join("; "),
            })
        });
    }
}

/// The reference that a table asks for, or every reason why not.
pub fn reference(
    table: &ReferenceTable,
    limits: &Limits,
) -> Result<Box<dyn Reference>, Vec<ReferenceRefusal>> {
    Ok(match trajectory(table, limits)? {
        Some(trajectory) => {
            Box::new(Tracked { frame: table.frame.unwrap_or(PathFrame::Start), ..Tracked::new(trajectory) })
        }
        None => Box::new(Hold::default()),
    })
}

/// A trajectory that can be handed to the cycle's thread.
pub type AnyTrajectory = Box<dyn Trajectory + Send>;

/// Why a reference can't be made: a key of its table, or none for the whole of it, and the reason.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReferenceRefusal {
    /// The key, such as `points[2]`; empty for the whole table.
    pub key: String,
    /// Why, with the time that would be needed where time is what lacks.
    pub reason: String,
}

/// The trajectory that a table asks for, or every reason why not; `None` where it asks for none.
pub fn trajectory(
    table: &ReferenceTable,
    limits: &Limits,
) -> Result<Option<AnyTrajectory>, Vec<ReferenceRefusal>> {
    let kind = table.kind.as_deref().unwrap_or("hold");
    if kind == "path" {
        return path(table, limits).map(|path| Some(Box::new(path) as AnyTrajectory));
    }
    let heading = match table.heading {
        Some(HeadingName::FollowsTangent) => Heading::FollowsTangent,
        Some(HeadingName::Fixed) => Heading::Fixed,
        None if kind == "holonomic" => Heading::FollowsTangent,
        None => Heading::Fixed,
    };
    let shape = match (kind, table) {
        ("circle" | "holonomic", &ReferenceTable { radius_m: Some(radius_m), .. }) => {
            Shape::Circle { radius_m }
        }
        ("ellipse", &ReferenceTable { semi_axis_x_m: Some(x_m), semi_axis_y_m: Some(y_m), .. }) => {
            Shape::Ellipse { half_length_m: x_m, half_width_m: y_m }
        }
        ("spiral", &ReferenceTable { step_m: Some(step_m), .. }) => Shape::Spiral { step_m },
        ("eight", &ReferenceTable { half_length_m: Some(half_length_m), .. }) => {
            Shape::Eight { half_length_m }
        }
        // Nothing to follow, or a key is missing, which is told elsewhere.
        _ => return Ok(None),
    };
    let turns = table.turns.unwrap_or(1.0);
    let make = |duration_s: f64| {
        let key = if table.duration_s.is_some() { "duration_s" } else { "" };
        ShapeTrajectory::new(shape, heading, turns, duration_s).map_err(|error| match error {
            ShapeError::TooLong { .. } => refused(key, error),
            ShapeError::Setting { .. } => refused("", error),
        })
    };
    let Some(duration_s) = table.duration_s else {
        let (stretch, _) = Peaks::of(&make(1.0)?).stretch(&motion_limits(limits));
        return Ok(Some(Box::new(make(stretch * ROOM)?)));
    };
    let trajectory = make(duration_s)?;
    limits::check(&trajectory, &motion_limits(limits)).map_err(|refusal| refused("duration_s", refusal))?;
    Ok(Some(Box::new(trajectory)))
}

fn path(table: &ReferenceTable, limits: &Limits) -> Result<PointTrajectory, Vec<ReferenceRefusal>> {
    let points = table.points.iter().flatten().map(|&[time_s, x_m, y_m, heading_rad]| PathPoint {
        time_s,
        odom_from_base: Pose2::new(x_m, y_m, heading_rad),
    });
    let points = PathPoints::new(points.collect()).map_err(|error| refused("points", error))?;
    let interpolation = match table.interpolation.unwrap_or(InterpolationName::CubicPreviousSlope) {
        InterpolationName::CubicPreviousSlope => Interpolation::Cubic(SpeedRule::PreviousSlope),
        InterpolationName::CubicMeanSlope => Interpolation::Cubic(SpeedRule::MeanSlope),
        InterpolationName::Quintic => Interpolation::Quintic,
        InterpolationName::Spline => Interpolation::Spline,
        InterpolationName::BSpline => Interpolation::BSpline,
    };
    limits::plan(&points, interpolation, &motion_limits(limits)).map_err(|refusals| {
        let refusal = |refusal: &limits::Refusal| ReferenceRefusal {
            key: refusal.part.point.map_or_else(|| "points".into(), |point| format!("points[{point}]")),
            reason: refusal.to_string(),
        };
        refusals.iter().map(refusal).collect()
    })
}

fn refused(key: &str, reason: impl ToString) -> Vec<ReferenceRefusal> {
    vec![ReferenceRefusal { key: key.into(), reason: reason.to_string() }]
}

/// The platform's limits as trajectories know them.
pub fn motion_limits(limits: &Limits) -> omnibase_trajectory::Limits {
    omnibase_trajectory::Limits {
        speed_m_s: limits.speed_m_s,
        acceleration_m_s2: limits.acceleration_m_s2,
        jerk_m_s3: limits.jerk_m_s3,
        rate_rad_s: limits.turn_speed_rad_s,
        angular_acceleration_rad_s2: limits.turn_acceleration_rad_s2,
        angular_jerk_rad_s3: limits.turn_jerk_rad_s3,
    }
}

/// Reads a file of path points.
pub(crate) fn read_points(text: &str) -> Result<Vec<[f64; 4]>, String> {
    let points = PathPoints::parse(text).map_err(|error| error.to_string())?;
    let row = |point: &PathPoint| {
        let Pose2 { x_m, y_m, heading_rad } = point.odom_from_base;
        [point.time_s, x_m, y_m, heading_rad]
    };
    Ok(points.as_slice().iter().map(row).collect())
}

/// Follows a trajectory.
pub struct Tracked {
    /// Taken out only while it is put in its place.
    placed: Option<Placed<AnyTrajectory>>,
    duration_s: f64,
    frame: PathFrame,
    /// The trajectory's own first and last pose.
    first: Pose2,
    last: Pose2,
}

impl Tracked {
    /// Where it begins from a pose.
    fn begin(&self, here: &Pose2) -> Pose2 {
        match self.frame {
            PathFrame::Start => *here,
            // The platform's heading counts its turns.
            PathFrame::Odom => {
                let turn_rad = wrap_angle_rad(self.first.heading_rad - here.heading_rad);
                Pose2 { heading_rad: here.heading_rad + turn_rad, ..self.first }
            }
        }
    }

    /// A reference that follows a trajectory from where the platform stands.
    pub fn new(trajectory: AnyTrajectory) -> Self {
        let duration_s = trajectory.duration_s();
        let [first, last] = [0.0, duration_s].map(|time_s| trajectory.sample(time_s).odom_from_base);
        Tracked { placed: Some(Placed::new(trajectory)), duration_s, frame: PathFrame::Start, first, last }
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

    fn duration_s(&self) -> Option<f64> {
        Some(self.duration_s)
    }

    fn start_pose(&self) -> Option<Pose2> {
        match self.frame {
            PathFrame::Start => None,
            PathFrame::Odom => Some(self.first),
        }
    }

    fn end_pose(&self, odom_from_body: &Pose2) -> Option<Pose2> {
        Some(self.begin(odom_from_body).then(self.first.inverse().then(self.last)))
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

    fn duration_s(&self) -> Option<f64> {
        None
    }
}
