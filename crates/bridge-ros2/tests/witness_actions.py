"""The bridge's actions, by real clients: what they accept, tell, cancel and refuse."""

import math

from action_msgs.msg import GoalStatus
from control_msgs.action import FollowJointTrajectory
from geometry_msgs.msg import PoseStamped
from nav2_msgs.action import FollowPath
from nav_msgs.msg import Path
from rclpy.action import ActionClient
from trajectory_msgs.msg import JointTrajectoryPoint
from witness_node import LONGEST_S


def follows(w, kind, name, goal, cancels=False):
    """Sends a goal, and cancels it where that is wished once it moves: its status, its result, how often it told where it is."""
    client = ActionClient(w.node, kind, name)
    told = []
    try:
        assert client.wait_for_server(timeout_sec=LONGEST_S), f"no action {name}"
        sent = client.send_goal_async(goal, feedback_callback=lambda message: told.append(message.feedback))
        w.until("an answer", sent.done)
        handle = sent.result()
        if not handle.accepted:
            return None, None, 0
        result = handle.get_result_async()
        if cancels:
            w.until("it moves", lambda: w.speed() > 0.05)
            cancelled = handle.cancel_goal_async()
            w.until("an answer", cancelled.done)
            assert len(cancelled.result().goals_canceling) == 1, cancelled.result()
        w.until("a result", result.done)
        return result.result().status, result.result().result, len(told)
    finally:
        client.destroy()


def paths_are_followed(w):
    """nav2's action."""
    w.hold()

    def x():
        return w.odom[-1].pose.pose.position.x

    def goal(metres, frame="odom"):
        path = Path()
        path.header.frame_id = frame
        for n in range(1, 21):
            pose = PoseStamped()
            pose.pose.position.x = x() + metres * n / 20
            pose.pose.position.y = w.odom[-1].pose.pose.position.y
            pose.pose.orientation = w.odom[-1].pose.pose.orientation
            path.poses.append(pose)
        return FollowPath.Goal(path=path)

    for metres in (0.4, -0.4):
        end = x() + metres
        status, result, told = follows(w, FollowPath, "follow_path", goal(metres))
        assert (status, result.error_code) == (GoalStatus.STATUS_SUCCEEDED, 0), (status, result)
        assert told > 5, told
        w.until("its end", lambda: abs(x() - end) < 0.01)
    status, result, _ = follows(w, FollowPath, "follow_path", goal(1.0), cancels=True)
    assert status == GoalStatus.STATUS_CANCELED and result.error_msg == "cancelled", (status, result)
    w.rests()
    assert follows(w, FollowPath, "follow_path", goal(1.0, "map"))[0] is None


def trajectories_are_followed(w):
    """The standard controllers' action."""
    w.hold()
    pose = w.odom[-1].pose.pose
    heading = 2 * math.atan2(pose.orientation.z, pose.orientation.w)

    def goal(names):
        goal = FollowJointTrajectory.Goal()
        goal.trajectory.joint_names = names
        point = JointTrajectoryPoint(positions=[heading + 0.3, pose.position.x, pose.position.y + 0.2])
        point.time_from_start.sec = 3
        goal.trajectory.points = [point]
        return goal

    joints = ["platform_heading", "platform_x", "platform_y"]
    status, result, told = follows(w, FollowJointTrajectory, "follow_joint_trajectory", goal(joints))
    assert (status, result.error_code) == (GoalStatus.STATUS_SUCCEEDED, 0), (status, result)
    assert told > 5, told
    w.until("its end", lambda: abs(w.odom[-1].pose.pose.position.y - pose.position.y - 0.2) < 0.01)
    assert follows(w, FollowJointTrajectory, "follow_joint_trajectory", goal(["a", "b", "c"]))[0] is None
