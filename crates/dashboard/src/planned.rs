//! The planned path as the page draws it: drawn once, and laid where the robot began it.

use omnibase_platform::Pose2;
use omnibase_robot::RobotPlan;
use omnibase_robot::config::ReferenceTable;
use omnibase_robot::dry::{DryRun, limit_colour, limit_name};
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
    binds: Binds,
}

/// Which limits bind a motion, and where.
#[derive(Clone, Debug, Default, Serialize, JsonSchema)]
pub(crate) struct Binds {
    /// Those that bind it anywhere.
    limits: Vec<BindingLimit>,
    /// Which of them binds at each pose; nothing where none does, or where that isn't known beforehand.
    at: Vec<Option<u8>>,
}

/// A limit that binds a motion.
#[derive(Clone, Debug, Serialize, JsonSchema)]
pub(crate) struct BindingLimit {
    name: &'static str,
    colour: &'static str,
    /// The part of the time in which it binds.
    share: f64,
}

impl Binds {
    /// Of a motion that is planned dry.
    fn of(plan: &RobotPlan, reference: &mut dyn Reference) -> Binds {
        let Ok(run) = DryRun::of(plan, reference) else { return Binds::default() };
        let asked: Vec<_> = run.asked.iter().filter(|asked| asked.share > 0.0).collect();
        let number = |limit| asked.iter().position(|asked| asked.limit == limit).map(|number| number as u8);
        let last = run.moments.len() - 1;
        let moment = |point: u32| &run.moments[last * point as usize / POINTS as usize];
        Binds {
            limits: asked
                .iter()
                .map(|asked| BindingLimit {
                    name: limit_name(asked.limit),
                    colour: limit_colour(Some(asked.limit)),
                    share: asked.share,
                })
                .collect(),
            at: (0..=POINTS).map(|point| moment(point).binding().and_then(number)).collect(),
        }
    }
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
    /// What binds it where.
    binds: Binds,
}

impl Drawn {
    /// Draws a robot's reference, which is used up by it.
    pub(crate) fn of(plan: &RobotPlan, table: &ReferenceTable, mut made: Box<dyn Reference>) -> Self {
        let binds = Binds::of(plan, &mut *made);
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
            binds,
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
            binds: self.binds.clone(),
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
            let laid = Drawn::of(&robot.plan, &table, made()).laid(1, begin);
            let mut made = made();
            made.start(&Setpoint::at_rest(begin));
            let duration_s = made.duration_s().unwrap();
            assert_eq!((laid.duration_s, laid.poses.len()), (Some(duration_s), 401));
            assert_eq!(laid.binds.at.len(), 401);
            for (n, [x_m, y_m, heading_rad]) in laid.poses.iter().enumerate() {
                let pose = made.sample(duration_s * n as f64 / 400.0).odom_from_body;
                let turned = (heading_rad - pose.heading_rad).sin().abs();
                assert!((x_m - pose.x_m).hypot(y_m - pose.y_m) < 1e-9 && turned < 1e-9, "{text}: {n}");
            }
        }
    }

    #[test]
    fn what_binds_a_straight_way_is_told_where_it_does() {
        let text = include_str!("../../../robots/bmm.toml").into();
        let registry = Registry::with_built_in();
        let robot = RobotText { text, ..RobotText::default() }.load(&registry).unwrap();
        let table: ReferenceTable = toml::from_str(
            "kind = \"path\"\ntiming = \"fastest\"\npoints = [[0.0, 0.0, 0.0, 0.0], [9.0, 4.0, 0.0, 0.0]]",
        )
        .unwrap();
        let made = registry.make_reference(&table, &omnibase_robot::Ability::of(&robot.plan)).unwrap();
        let Binds { limits, at } = Drawn::of(&robot.plan, &table, made).binds;
        let name = |point: usize| at[point].map(|number| limits[usize::from(number)].name);
        assert_eq!([name(40), name(200), name(360)], ["acceleration", "speed", "acceleration"].map(Some));
        assert_eq!(name(0), None, "it stands");
        assert!(limits.iter().map(|limit| limit.share).sum::<f64>() <= 1.0);
        // Who can't be foreseen is bound by nothing that is known.
        let turns: ReferenceTable =
            toml::from_str("kind = \"circle\"\nradius_m = 0.5\nperiod_s = 9.0\nturns = \"endless\"").unwrap();
        let made = registry.make_reference(&turns, &omnibase_robot::Ability::of(&robot.plan)).unwrap();
        assert!(Drawn::of(&robot.plan, &turns, made).binds.at.is_empty());
    }
}
