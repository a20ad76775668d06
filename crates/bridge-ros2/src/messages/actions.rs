//! Actions: `FollowPath` of nav2, `FollowJointTrajectory` of the standard controllers.

use super::*;

message!("nav2_msgs/action/FollowPath_Goal" FollowPathGoal {
    path: Path,
    controller_id: String,
    goal_checker_id: String,
    progress_checker_id: String,
});
message!("nav2_msgs/action/FollowPath_Result" FollowPathResult {
    result: Empty,
    error_code: u16,
    error_msg: String,
});
message!("nav2_msgs/action/FollowPath_Feedback" FollowPathFeedback { distance_to_goal: f32, speed: f32 });

message!("trajectory_msgs/msg/JointTrajectoryPoint" JointTrajectoryPoint {
    positions: Vec<f64>,
    velocities: Vec<f64>,
    accelerations: Vec<f64>,
    effort: Vec<f64>,
    time_from_start: Duration,
});
message!("trajectory_msgs/msg/JointTrajectory" JointTrajectory {
    header: Header,
    joint_names: Vec<String>,
    points: Vec<JointTrajectoryPoint>,
});
message!("trajectory_msgs/msg/MultiDOFJointTrajectoryPoint" MultiDofPoint {
    transforms: Vec<Transform>,
    velocities: Vec<Twist>,
    accelerations: Vec<Twist>,
    time_from_start: Duration,
});
message!("trajectory_msgs/msg/MultiDOFJointTrajectory" MultiDofTrajectory {
    header: Header,
    joint_names: Vec<String>,
    points: Vec<MultiDofPoint>,
});
message!("control_msgs/msg/JointTolerance" JointTolerance {
    name: String,
    position: f64,
    velocity: f64,
    acceleration: f64,
});
message!("control_msgs/msg/JointComponentTolerance" JointComponentTolerance {
    joint_name: String,
    component: u16,
    position: f64,
    velocity: f64,
    acceleration: f64,
});
message!("control_msgs/action/FollowJointTrajectory_Goal" FollowJointTrajectoryGoal {
    trajectory: JointTrajectory,
    multi_dof_trajectory: MultiDofTrajectory,
    path_tolerance: Vec<JointTolerance>,
    component_path_tolerance: Vec<JointComponentTolerance>,
    goal_tolerance: Vec<JointTolerance>,
    component_goal_tolerance: Vec<JointComponentTolerance>,
    goal_time_tolerance: Duration,
});
message!("control_msgs/action/FollowJointTrajectory_Result" FollowJointTrajectoryResult {
    error_code: i32,
    error_string: String,
});
message!("control_msgs/action/FollowJointTrajectory_Feedback" FollowJointTrajectoryFeedback {
    header: Header,
    joint_names: Vec<String>,
    desired: JointTrajectoryPoint,
    actual: JointTrajectoryPoint,
    error: JointTrajectoryPoint,
    multi_dof_joint_names: Vec<String>,
    multi_dof_desired: MultiDofPoint,
    multi_dof_actual: MultiDofPoint,
    multi_dof_error: MultiDofPoint,
});
