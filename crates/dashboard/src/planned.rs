//! The planned path as the page draws it: drawn once, and laid where the robot began it.

use omnibase_platform::Pose2;
use omnibase_robot::config::ReferenceTable;
use omnibase_robot::signals::Setpoint;
use omnibase_robot::stages::Reference;
use schemars::JsonSchema;
use serde::Serialize;

/// Points of a planned path as the page draws it.
const POINTS: u32 = 400;
/// How much of a motion without an end is drawn, s.
const ENDLESS_SHOWN_S: f64 = 60.0;

/// A reference, drawn.
#[derive(Debug)]
pub(crate) struct Drawn {
    name: String,
    duration_s: Option<f64>,
    /// Where the platform must stand at its start, in odom; `None` where it begins wherever that stands.
    pub(crate) start_pose: Option<Pose2>,
    /// In odom, or from its start where it has no pose of its own.
    poses: Vec<Pose2>,
    /// The speed at each, m/s.
    speeds_m_s: Vec<f64>,
}

/// The planned path, where the robot follows it.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Planned {
    number: u32,
    name: String,
    duration_s: Option<f64>,
    /// x m, y m, heading rad.
    poses: Vec<[f64; 3]>,
    /// The speed at each, m/s.
    speeds_m_s: Vec<f64>,
}

impl Drawn {
    /// Draws a reference, which is used up by it.
    pub(crate) fn of(table: &ReferenceTable, mut made: Box<dyn Reference>) -> Self {
        made.start(&Setpoint::at_rest(Pose2::default()));
        let duration_s = made.duration_s();
        let at = |duration_s: f64, n: u32| duration_s * f64::from(n) / f64::from(POINTS);
        let shown_s = duration_s.unwrap_or(ENDLESS_SHOWN_S);
        let setpoint = |n| made.sample(at(shown_s, n));
        let all: Vec<(Pose2, f64)> = (0..=POINTS)
            .map(setpoint)
            .map(|setpoint| (setpoint.odom_from_body, setpoint.twist_in_odom.speed_m_s()))
            .collect();
        let (poses, speeds_m_s) = all.into_iter().unzip();
        Drawn {
            name: table.kind.clone().unwrap_or_default(),
            duration_s,
            start_pose: made.start_pose(),
            poses,
            speeds_m_s,
        }
    }

    /// The path from where the platform stands, or stood, at its start.
    pub(crate) fn laid(&self, number: u32, odom_from_start: Pose2) -> Planned {
        let start = if self.start_pose.is_some() { Pose2::default() } else { odom_from_start };
        let laid = self.poses.iter().map(|pose| {
            let pose = start.then(*pose);
            [pose.x_m, pose.y_m, pose.heading_rad]
        });
        Planned {
            number,
            name: self.name.clone(),
            duration_s: self.duration_s,
            poses: laid.collect(),
            speeds_m_s: self.speeds_m_s.clone(),
        }
    }
}

impl Planned {
    /// Its points, in odom, m.
    pub(crate) fn points_m(&self) -> impl ExactSizeIterator<Item = [f64; 2]> + '_ {
        self.poses.iter().map(|[x, y, _]| [*x, *y])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use omnibase_robot::Registry;
    use omnibase_run::RobotText;

    #[test]
    fn what_was_drawn_once_lies_where_the_reference_itself_goes_from_any_start() {
        let text = include_str!("../../../robots/bmm.toml").into();
        let registry = Registry::with_built_in();
        let robot = RobotText { text, ..RobotText::default() }.load(&registry).unwrap();
        let begin = Pose2 { x_m: 3.0, y_m: -2.0, heading_rad: 7.5 };
        let circle = "kind = \"circle\"\nradius_m = 0.5\nduration_s = 20.0";
        let path = "kind = \"path\"\nframe = \"odom\"\npoints = [[0.0, 1.0, 2.0, 0.3], [5.0, 1.5, 2.0, 0.3], [9.0, 2.0, 2.5, 0.1]]";
        for text in [circle, path] {
            let table: ReferenceTable = toml::from_str(text).unwrap();
            let made = || registry.make_reference(&table, &omnibase_robot::Ability::of(&robot.plan)).unwrap();
            let laid = Drawn::of(&table, made()).laid(1, begin);
            let mut made = made();
            made.start(&Setpoint::at_rest(begin));
            let duration_s = made.duration_s().unwrap();
            assert_eq!((laid.duration_s, laid.poses.len()), (Some(duration_s), 401));
            for (n, [x_m, y_m, heading_rad]) in laid.poses.iter().enumerate() {
                let pose = made.sample(duration_s * n as f64 / 400.0).odom_from_body;
                let turned = (heading_rad - pose.heading_rad).sin().abs();
                assert!((x_m - pose.x_m).hypot(y_m - pose.y_m) < 1e-9 && turned < 1e-9, "{text}: {n}");
            }
        }
    }
}
