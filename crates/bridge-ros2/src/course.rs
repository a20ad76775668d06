//! Paths of ROS 2 as the robot's own: points with times, from where it stands.

use crate::messages::{FollowJointTrajectoryGoal, FollowPathGoal};
use crate::robot::Limits;

/// The platform's joints: x m, y m, and the turn, rad, all in the fixed frame.
pub const JOINTS: [&str; 3] = ["platform_x", "platform_y", "platform_heading"];
/// Of the platform's greatest speeds, as a path without times is driven.
const SHARE: f64 = 0.6;
/// How such a path speeds up and comes to rest, m/s².
const ACCELERATION: f64 = 0.3;
/// A turn by 1 rad counts as so long a way, m.
const TURN_M: f64 = 0.3;
/// The slowest on such a path, m/s.
const SLOWEST: f64 = 0.03;
/// Points nearer than that to the one before say nothing more, m.
const NEAR_M: f64 = 0.002;
/// So many points at most, so that a path is one message.
const MOST: usize = 500;

/// t s, x m, y m, heading rad.
pub type Point = [f64; 4];

/// The next heading that looks where `to` does, rad.
fn nearest_turn(from: f64, to: f64) -> f64 {
    from + (to - from).sin().atan2((to - from).cos())
}

fn way(from: &[f64; 3], to: &[f64; 3]) -> f64 {
    (to[0] - from[0]).hypot(to[1] - from[1]) + TURN_M * (to[2] - from[2]).abs()
}

/// A path without times, from where the platform stands, as fast as a part of its limits allows.
pub fn of_path(
    goal: &FollowPathGoal,
    here: [f64; 3],
    odom_frame: &str,
    limits: &Limits,
) -> Result<Vec<Point>, String> {
    let mut poses = vec![here];
    for stamped in &goal.path.poses {
        for frame in [&goal.path.header.frame_id, &stamped.header.frame_id] {
            if !frame.is_empty() && frame != odom_frame {
                return Err(format!("expected a path in `{odom_frame}`, found `{frame}`"));
            }
        }
        let (at, turn) = (&stamped.pose.position, &stamped.pose.orientation);
        let heading =
            turn.upright_heading_rad().ok_or("an orientation is no turn about the vertical axis")?;
        let before = poses[poses.len() - 1];
        let pose = [at.x, at.y, nearest_turn(before[2], heading)];
        if pose.iter().any(|number| !number.is_finite()) {
            return Err("a number isn't finite".to_owned());
        }
        if way(&before, &pose) > NEAR_M {
            poses.push(pose);
        }
    }
    if goal.path.header.frame_id.is_empty() || goal.path.poses.is_empty() {
        return Err("expected poses in a frame".to_owned());
    }
    let step = poses.len().div_ceil(MOST);
    let last = poses[poses.len() - 1];
    let mut poses: Vec<[f64; 3]> = poses.into_iter().step_by(step).collect();
    if poses[poses.len() - 1] != last {
        poses.push(last);
    }
    if poses.len() < 2 {
        // Where it stands already: a moment there.
        return Ok(vec![[0.0, here[0], here[1], here[2]], [0.1, last[0], last[1], last[2]]]);
    }
    let whole: f64 = poses.windows(2).map(|two| way(&two[0], &two[1])).sum();
    let fastest = SHARE * limits.speed_m_s.min(TURN_M * limits.turn_speed_rad_s);
    let speed = |gone: f64| {
        let rising = (2.0 * ACCELERATION * gone).sqrt().max(SLOWEST);
        let falling = (2.0 * ACCELERATION * (whole - gone).max(0.0)).sqrt().max(SLOWEST);
        rising.min(falling).min(fastest)
    };
    let (mut gone, mut time) = (0.0, 0.0);
    let mut points = vec![[0.0, here[0], here[1], here[2]]];
    for two in poses.windows(2) {
        let length = way(&two[0], &two[1]);
        // In small steps: a long leg has its rise and its fall within.
        let steps = (length / 0.01).ceil().max(1.0);
        for step in 0..steps as usize {
            let middle = gone + length * (step as f64 + 0.5) / steps;
            time += length / steps / speed(middle);
        }
        gone += length;
        points.push([time, two[1][0], two[1][1], two[1][2]]);
    }
    Ok(points)
}

/// A trajectory of the platform's joints, from where it stands.
pub fn of_trajectory(goal: &FollowJointTrajectoryGoal, here: [f64; 3]) -> Result<Vec<Point>, String> {
    if !goal.multi_dof_trajectory.points.is_empty() {
        return Err("expected the joints of `trajectory` alone, found a `multi_dof_trajectory`".to_owned());
    }
    if !goal.path_tolerance.is_empty() || !goal.component_path_tolerance.is_empty() {
        return Err("a path's tolerance is the robot's own: safety.tracking_error_m".to_owned());
    }
    let names = &goal.trajectory.joint_names;
    let places = JOINTS.map(|joint| names.iter().position(|name| name == joint));
    let [Some(x), Some(y), Some(heading)] = places else {
        return Err(format!("expected the joints {}, found {}", JOINTS.join(", "), names.join(", ")));
    };
    if names.len() != 3 || goal.trajectory.points.len() > MOST || goal.trajectory.points.is_empty() {
        return Err(format!("expected 1 to {MOST} points of three joints"));
    }
    let mut points = vec![[0.0, here[0], here[1], here[2]]];
    for point in &goal.trajectory.points {
        let &[a, b, c] = &point.positions[..] else {
            return Err(format!("expected three positions in each point, found {}", point.positions.len()));
        };
        let all = [a, b, c];
        if all.iter().any(|number| !number.is_finite()) {
            return Err("a number isn't finite".to_owned());
        }
        let time = f64::from(point.time_from_start.sec) + f64::from(point.time_from_start.nanosec) * 1e-9;
        let point = [time, all[x], all[y], all[heading]];
        // Where it stands now is where it begins.
        if time == 0.0 && points.len() == 1 {
            continue;
        }
        if time <= points[points.len() - 1][0] {
            return Err(format!("expected rising times, found {time} s"));
        }
        points.push(point);
    }
    if points.len() < 2 {
        return Err("expected a point behind the beginning".to_owned());
    }
    Ok(points)
}

#[cfg(test)]
mod tests {
    use super::{JOINTS, Limits, of_path, of_trajectory};
    use crate::messages::*;

    const LIMITS: Limits =
        Limits { speed_m_s: 1.0, turn_speed_rad_s: 2.0, wheel_speed_rad_s: 15.0, wheel_torque_nm: 20.0 };

    fn path(poses: &[[f64; 3]]) -> FollowPathGoal {
        let pose = |[x, y, heading]: &[f64; 3]| PoseStamped {
            header: Header::default(),
            pose: Pose {
                position: Point { x: *x, y: *y, z: 0.0 },
                orientation: Quaternion::heading(*heading),
            },
        };
        let header = Header { frame_id: "odom".into(), ..Header::default() };
        FollowPathGoal {
            path: Path { header, poses: poses.iter().map(pose).collect() },
            ..Default::default()
        }
    }

    #[test]
    fn a_path_begins_where_the_platform_stands_and_keeps_its_speed() {
        let goal = path(&[[0.0, 0.0, 3.0], [0.5, 0.0, 3.1], [1.0, 0.0, -3.1]]);
        let points = of_path(&goal, [0.0, 0.0, 3.0], "odom", &LIMITS).unwrap();
        assert_eq!((points.len(), points[0]), (3, [0.0, 0.0, 0.0, 3.0]));
        // The short way round, and neither faster than a part of the limit nor slower than it needs.
        assert!((points[2][3] - (std::f64::consts::TAU - 3.1)).abs() < 1e-9, "{points:?}");
        let fastest = points.windows(2).map(|two| (two[1][1] - two[0][1]) / (two[1][0] - two[0][0]));
        assert!(
            fastest.clone().all(|speed| speed < 0.36) && fastest.clone().all(|speed| speed > 0.1),
            "{points:?}"
        );
        assert!(of_path(&goal, [0.0; 3], "map", &LIMITS).unwrap_err().contains("expected a path in `map`"));
        assert!(of_path(&path(&[]), [0.0; 3], "odom", &LIMITS).is_err());
        assert!(of_path(&path(&[[f64::NAN, 0.0, 0.0]]), [0.0; 3], "odom", &LIMITS).is_err());
        let many: Vec<_> = (0..5000).map(|n| [f64::from(n) * 0.01, 0.0, 0.0]).collect();
        let points = of_path(&path(&many), [0.0; 3], "odom", &LIMITS).unwrap();
        assert!(points.len() <= 501 && points[points.len() - 1][1] == 49.99, "{}", points.len());
    }

    #[test]
    fn a_trajectory_is_of_the_platforms_joints_with_rising_times() {
        let point = |positions: &[f64], sec| JointTrajectoryPoint {
            positions: positions.to_vec(),
            time_from_start: Duration { sec, nanosec: 0 },
            ..Default::default()
        };
        let goal = |names: &[&str], points: Vec<JointTrajectoryPoint>| FollowJointTrajectoryGoal {
            trajectory: JointTrajectory {
                joint_names: names.iter().map(|name| (*name).to_owned()).collect(),
                points,
                ..Default::default()
            },
            ..Default::default()
        };
        let turned = ["platform_heading", "platform_x", "platform_y"];
        let points =
            of_trajectory(&goal(&turned, vec![point(&[0.3, 1.0, 2.0], 4)]), [0.5, 0.0, 0.0]).unwrap();
        assert_eq!(points, [[0.0, 0.5, 0.0, 0.0], [4.0, 1.0, 2.0, 0.3]]);
        let wrong = [
            goal(&["a", "b", "c"], vec![point(&[0.0; 3], 1)]),
            goal(&JOINTS, vec![]),
            goal(&JOINTS, vec![point(&[0.0; 2], 1)]),
            goal(&JOINTS, vec![point(&[f64::NAN; 3], 1)]),
            goal(&JOINTS, vec![point(&[0.0; 3], 2), point(&[0.1; 3], 2)]),
            goal(&JOINTS, vec![point(&[0.0; 3], 0)]),
        ];
        for goal in wrong {
            assert!(of_trajectory(&goal, [0.0; 3]).is_err(), "{goal:?}");
        }
    }
}
