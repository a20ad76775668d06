"""A real ROS 2 (rclpy with Fast DDS) against a robot that runs behind the bridge: every check fails with its own words.

    python witness.py NAME ...        of checks or groups, with ROS_DOMAIN_ID set; without a name all groups
"""

import math
import os
import sys
import time
from xml.etree import ElementTree

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PolygonStamped, PoseStamped, PoseWithCovarianceStamped, Twist, TwistStamped
from nav_msgs.msg import Odometry, Path
from rcl_interfaces.msg import Parameter, ParameterEvent, ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters, GetParameters, GetParameterTypes, ListParameters, SetParameters, SetParametersAtomically,
)
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage
from witness_actions import paths_are_followed, trajectories_are_followed
from witness_node import LATCHED, LONGEST_S, RESTS_M_S, Witness


def odom_from_the_first(w):
    first = w.node.create_subscription(Odometry, "odom", lambda message: heard.append(message), 10)
    heard = []
    w.until("odom", lambda: heard)
    message = heard[0]
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_link"), message.header
    for covariance in (message.pose.covariance, message.twist.covariance):
        assert all(covariance[7 * n] > 0 for n in range(6)), covariance
        assert all(covariance[6 * a + b] == covariance[6 * b + a] for a in range(6) for b in range(6))
    q = message.pose.pose.orientation
    assert abs(q.x**2 + q.y**2 + q.z**2 + q.w**2 - 1) < 1e-9
    w.node.destroy_subscription(first)
    w.until("joints", lambda: w.joints)
    assert w.joints[-1].name == [f"wheel_{n}_joint" for n in (1, 2, 3)], w.joints[-1].name
    assert len(w.joints[-1].position) == len(w.joints[-1].velocity) == len(w.joints[-1].effort) == 3


def drives_and_recovers(w):
    w.hold()
    publisher = w.publisher(TwistStamped)
    for vx in (0.2, -0.2):
        w.drives(publisher, lambda: w.stamped(vx))
        # It falls silent: at rest by itself, and with the next command it drives again by itself.
        w.rests()
    w.drives(publisher, lambda: w.stamped(0.0, 0.4))
    w.rests()
    w.gone(publisher)


def what_is_wrong_moves_nothing(w):
    w.hold()
    publisher = w.publisher(TwistStamped)

    def changed(change):
        message = w.stamped()
        change(message)
        return message

    def stamp(message, sec):
        message.header.stamp.sec = sec

    cases = {
        "NaN": lambda: changed(lambda m: setattr(m.twist.linear, "x", math.nan)),
        "infinity": lambda: changed(lambda m: setattr(m.twist.angular, "z", math.inf)),
        "1e308": lambda: changed(lambda m: setattr(m.twist.linear, "y", 1e308)),
        "NaN where nothing is driven": lambda: changed(lambda m: setattr(m.twist.angular, "x", math.nan)),
        "a stamp of three seconds ago": lambda: w.stamped(age=3.0),
        "a stamp of 1970": lambda: changed(lambda m: stamp(m, 1)),
        "no stamp": lambda: changed(lambda m: (stamp(m, 0), setattr(m.header.stamp, "nanosec", 0))),
        "a stamp of three seconds ahead": lambda: w.stamped(age=-3.0),
        "a stamp of 2038": lambda: changed(lambda m: stamp(m, 2**31 - 1)),
    }
    for what, message in cases.items():
        w.moves_nothing(what, 0.7, lambda: publisher.publish(message()))
    w.drives(publisher, w.stamped)
    w.rests()
    w.gone(publisher)


def another_type_moves_nothing(w):
    w.hold()
    twist = Twist()
    twist.linear.x = 0.25
    # The wrong one alone, then beside the right one, in both orders of creation.
    wrong = w.unheard(Twist)
    w.moves_nothing("Twist alone", 1.0, lambda: wrong.publish(twist))
    right = w.publisher(TwistStamped)
    w.moves_nothing("Twist, then TwistStamped", 1.0, lambda: (wrong.publish(twist), right.publish(w.stamped())))
    w.gone(wrong)
    w.drives(right, w.stamped)
    w.rests()
    wrong = w.unheard(Twist)
    w.moves_nothing("TwistStamped, then Twist", 1.0, lambda: (wrong.publish(twist), right.publish(w.stamped())))
    w.gone(right)
    w.moves_nothing("Twist that is left", 1.0, lambda: wrong.publish(twist))
    w.gone(wrong)
    # Other types, of other lengths.
    for kind in (PoseStamped, String, Odometry, PoseWithCovarianceStamped):
        other = w.unheard(kind)
        message = kind()
        if kind is String:
            message.data = "\x00" * 200
        w.moves_nothing(kind.__name__, 0.5, lambda: other.publish(message))
        w.gone(other)


def two_publishers_move_nothing(w):
    w.hold()
    one, two = w.publisher(TwistStamped), w.publisher(TwistStamped)
    w.moves_nothing("two publishers", 1.0, lambda: (one.publish(w.stamped()), two.publish(w.stamped(-0.2))))
    w.moves_nothing("one of two", 1.0, lambda: one.publish(w.stamped()))
    w.gone(two)
    w.drives(one, w.stamped)
    # A second one that comes while the first drives ends that.
    two = w.node.create_publisher(TwistStamped, "cmd_vel", 10)
    w.until("it rests", lambda: w.speed() < RESTS_M_S, each=lambda: one.publish(w.stamped()))
    w.came(1)
    w.gone(one, two)


def never_after_another_stop(w):
    w.hold()
    publisher = w.publisher(TwistStamped)
    w.drives(publisher, w.stamped)
    # While commands go on to come.
    client = w.node.create_client(Trigger, "stop")
    assert client.wait_for_service(timeout_sec=LONGEST_S)
    future = client.call_async(Trigger.Request())
    w.until("it is stopped", lambda: future.done(), each=lambda: publisher.publish(w.stamped()))
    assert future.result().success, future.result()
    w.until("it rests", lambda: w.speed() < RESTS_M_S, each=lambda: publisher.publish(w.stamped()))
    w.moves_nothing("after a stop", 2.0, lambda: publisher.publish(w.stamped()))
    w.spin(1.0)
    w.moves_nothing("after a stop and a silence", 1.0, lambda: publisher.publish(w.stamped()))
    assert w.call(Trigger, "enable").success
    w.drives(publisher, w.stamped)
    w.rests()
    w.gone(publisher)


def odom_without_gaps(w):
    """Every message of SECONDS (10) at HZ (50), by their stamps; with BRIDGE, a process, its share of a CPU."""
    seconds, hz = float(os.environ.get("SECONDS", 10)), float(os.environ.get("HZ", 50))
    bridge = os.environ.get("BRIDGE")
    stamps = []
    every = QoSProfile(
        history=HistoryPolicy.KEEP_LAST, depth=5000,
        durability=DurabilityPolicy.VOLATILE, reliability=ReliabilityPolicy.RELIABLE)
    w.node.destroy_subscription(w.odom_subscription)
    w.node.create_subscription(
        Odometry, "odom", lambda m: stamps.append(m.header.stamp.sec * 1_000_000_000 + m.header.stamp.nanosec), every)

    def used():
        if not bridge:
            return 0.0
        with open(f"/proc/{bridge}/stat") as stat:
            fields = stat.read().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    w.until("odom", lambda: len(stamps) > 10)
    stamps.clear()
    before, began = used(), time.monotonic()
    w.spin(seconds)
    share = (used() - before) / (time.monotonic() - began)
    steps = [(b - a) * 1e-9 * hz for a, b in zip(stamps, stamps[1:])]
    gaps = sum(1 for step in steps if step > 1.5)
    print(f"{len(stamps)} messages of odom in {seconds:.0f} s at {hz:.0f} Hz: {gaps} gaps, longest step {max(steps):.2f}"
          f" periods; the bridge took {100 * share:.1f} % of a CPU")
    assert len(stamps) > 0.95 * seconds * hz, len(stamps)
    assert gaps == 0, gaps


def drive_on(w):
    """Drives until it is killed."""
    w.hold()
    publisher = w.node.create_publisher(TwistStamped, "cmd_vel", 10)
    while True:
        publisher.publish(w.stamped())
        w.spin(0.02)


def topics_are_there(w):
    """Every topic that is told: its type, its reliability and durability, and one message of it."""
    volatile, latched = DurabilityPolicy.VOLATILE, DurabilityPolicy.TRANSIENT_LOCAL
    told = {
        "/odom": ("nav_msgs/msg/Odometry", volatile), "/joint_states": ("sensor_msgs/msg/JointState", volatile),
        "/tf": ("tf2_msgs/msg/TFMessage", volatile), "/diagnostics": ("diagnostic_msgs/msg/DiagnosticArray", volatile),
        "/robot_description": ("std_msgs/msg/String", latched), "/footprint": ("geometry_msgs/msg/PolygonStamped", latched),
        "/path": ("nav_msgs/msg/Path", latched), "/parameter_events": ("rcl_interfaces/msg/ParameterEvent", volatile),
    }

    def of_bridge(topic, infos):
        return [info for info in infos(topic) if info.node_name == "omnibase"]

    for topic, (kind, durability) in told.items():
        w.until(topic, lambda: of_bridge(topic, w.node.get_publishers_info_by_topic))
        info, *_ = of_bridge(topic, w.node.get_publishers_info_by_topic)
        assert info.topic_type == kind, info
        assert info.qos_profile.reliability == ReliabilityPolicy.RELIABLE, (topic, info.qos_profile)
        if topic != "/parameter_events":
            assert info.qos_profile.durability == durability, (topic, info.qos_profile)
    heard_kinds = {
        "/cmd_vel": "geometry_msgs/msg/TwistStamped", "/pose": "geometry_msgs/msg/PoseWithCovarianceStamped",
        "/initialpose": "geometry_msgs/msg/PoseWithCovarianceStamped",
        "/set_pose": "geometry_msgs/msg/PoseWithCovarianceStamped",
    }
    for topic, kind in heard_kinds.items():
        w.until(topic, lambda: of_bridge(topic, w.node.get_subscriptions_info_by_topic))
        (info,) = of_bridge(topic, w.node.get_subscriptions_info_by_topic)
        assert info.topic_type == kind, info
        reliable = topic in ("/initialpose", "/set_pose")
        expected = ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT
        assert info.qos_profile.reliability == expected, (topic, info.qos_profile)
    services = dict(w.node.get_service_names_and_types_by_node("omnibase", "/"))
    for name in ("enable", "acknowledge", "stop", "emergency_stop", "release", "track", "resume", "load", "enable_stick"):
        assert services[f"/{name}"] == ["std_srvs/srv/Trigger"], services
    assert services["/teach"] == ["std_srvs/srv/SetBool"], services
    assert services["/set_pose"] == ["robot_localization/srv/SetPose"], services
    for action, kind in {
        "follow_path": "nav2_msgs/action/FollowPath",
        "follow_joint_trajectory": "control_msgs/action/FollowJointTrajectory",
    }.items():
        assert services[f"/{action}/_action/send_goal"] == [f"{kind}_SendGoal"], services
        assert services[f"/{action}/_action/get_result"] == [f"{kind}_GetResult"], services
        assert services[f"/{action}/_action/cancel_goal"] == ["action_msgs/srv/CancelGoal"], services


def what_changes_seldom_is_for_those_who_come_later(w):
    heard = {}

    def hear(kind, topic, qos):
        return w.node.create_subscription(kind, topic, lambda message: heard.__setitem__(topic, message), qos)

    subscriptions = [
        hear(String, "robot_description", LATCHED), hear(PolygonStamped, "footprint", LATCHED),
        hear(Path, "path", LATCHED), hear(DiagnosticArray, "/diagnostics", 10),
    ]
    w.until("all of them", lambda: len(heard) == 4)
    robot = ElementTree.fromstring(heard["robot_description"].data)
    assert robot.get("name") == "bmm" and len(robot.findall("joint")) == 3, robot
    named = [joint.get("name") for joint in robot.findall("joint")]
    assert named == list(w.joints[-1].name), (named, w.joints[-1].name)
    assert len(heard["footprint"].polygon.points) >= 3
    assert heard["footprint"].header.frame_id == "base_link"
    statuses = {status.name: status for status in heard["/diagnostics"].status}
    expected = ["state", "bus", "drive wheel_1", "drive wheel_2", "drive wheel_3", "slip", "timing", "bridge"]
    assert list(statuses) == [f"bmm: {name}" for name in expected], list(statuses)
    assert all(len(status.values) > 0 for status in statuses.values())
    for subscription in subscriptions:
        w.node.destroy_subscription(subscription)


def settings_are_parameters(w):
    # All at once: they become known to the bridge beside each other.
    for kind, name in (
        (ListParameters, "list_parameters"), (DescribeParameters, "describe_parameters"),
        (GetParameterTypes, "get_parameter_types"), (GetParameters, "get_parameters"),
        (SetParameters, "set_parameters"), (SetParametersAtomically, "set_parameters_atomically"),
    ):
        w.client(kind, f"omnibase/{name}")
    names = w.call(ListParameters, "omnibase/list_parameters").result.names
    assert "speed_factor" in names and "path_name" in names, names
    request = DescribeParameters.Request(names=["speed_factor"])
    (described,) = w.call(DescribeParameters, "omnibase/describe_parameters", request).descriptors
    span = described.floating_point_range[0]
    assert described.type == 3 and span.from_value < span.to_value, described
    types = w.call(GetParameterTypes, "omnibase/get_parameter_types", GetParameterTypes.Request(names=["speed_factor", "x"]))
    assert list(types.types) == [3, 0], types

    def value():
        request = GetParameters.Request(names=["speed_factor"])
        return w.call(GetParameters, "omnibase/get_parameters", request).values[0].double_value

    def double(name, number):
        return Parameter(name=name, value=ParameterValue(type=3, double_value=number))

    events = []
    hears = w.node.create_subscription(ParameterEvent, "/parameter_events", events.append, 10)
    before = value()
    request = SetParameters.Request(parameters=[double("speed_factor", 0.5), double("no_such", 1.0)])
    right, wrong = w.call(SetParameters, "omnibase/set_parameters", request).results
    assert right.successful and not wrong.successful and "no_such" in wrong.reason, (right, wrong)
    w.until("it is so", lambda: value() == 0.5)
    w.until("who listens is told", lambda: any(
        changed.name == "speed_factor" and changed.value.double_value == 0.5
        for event in events if event.node == "/omnibase" for changed in event.changed_parameters))
    # Out of its bounds: refused in the robot's own words, and nothing of what came with it is set.
    request = SetParametersAtomically.Request(parameters=[double("speed_factor", 0.7), double("speed_factor", 1e6)])
    answer = w.call(SetParametersAtomically, "omnibase/set_parameters_atomically", request).result
    assert not answer.successful and answer.reason, answer
    request = SetParameters.Request(parameters=[double("speed_factor", span.to_value * 2 + 1)])
    (refused,) = w.call(SetParameters, "omnibase/set_parameters", request).results
    assert not refused.successful and "speed_factor" in refused.reason, refused
    assert value() == 0.5
    request = SetParametersAtomically.Request(parameters=[double("speed_factor", before)])
    answer = w.call(SetParametersAtomically, "omnibase/set_parameters_atomically", request).result
    assert answer.successful, answer
    w.until("it is so again", lambda: value() == before)
    w.node.destroy_subscription(hears)


def the_pose_is_set_and_measured(w):
    w.hold()

    def pose(x, heading, frame="odom"):
        message = PoseWithCovarianceStamped()
        now = w.node.get_clock().now().nanoseconds
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(now, 1_000_000_000)
        message.header.frame_id = frame
        message.pose.pose.position.x = x
        message.pose.pose.orientation.z, message.pose.pose.orientation.w = math.sin(heading / 2), math.cos(heading / 2)
        for n in (0, 7, 35):
            message.pose.covariance[6 * (n // 6) + n % 6] = 1e-4
        return message

    def x():
        return w.odom[-1].pose.pose.position.x

    publisher = w.publisher(PoseWithCovarianceStamped, "initialpose")
    publisher.publish(pose(9.0, 0.0, "map"))
    w.spin(0.5)
    assert abs(x() - 9.0) > 1.0, x()
    publisher.publish(pose(3.0, 0.5))
    w.until("it stands there", lambda: abs(x() - 3.0) < 1e-3)
    assert abs(w.odom[-1].pose.pose.orientation.z - math.sin(0.25)) < 1e-3
    assert 5e-5 < w.odom[-1].pose.covariance[0] < 2e-4, w.odom[-1].pose.covariance[0]
    publisher.publish(pose(0.0, 0.0))
    w.until("it stands at the beginning", lambda: abs(x()) < 1e-3)
    w.node.destroy_publisher(publisher)


def services_ask_the_robot(w):
    for name in ("enable", "load", "emergency_stop", "track", "release"):
        w.client(Trigger, name)
    w.client(SetBool, "teach")
    w.hold()

    def call_it(name):
        value = ParameterValue(type=4, string_value=name)
        request = SetParameters.Request(parameters=[Parameter(name="path_name", value=value)])
        assert w.call(SetParameters, "omnibase/set_parameters", request).results[0].successful

    # The robot's own words, where it refuses.
    call_it("of_nobody")
    refused = w.call(Trigger, "load")
    assert not refused.success and refused.message, refused
    assert w.call(Trigger, "emergency_stop").success
    w.until("it rests", lambda: w.speed() < RESTS_M_S)
    refused = w.call(Trigger, "track")
    assert not refused.success and refused.message, refused
    assert w.call(Trigger, "release").success
    w.spin(1.0)
    assert w.call(Trigger, "enable").success
    w.spin(1.0)
    # A path that is driven by commands is kept, loaded and driven again.
    call_it("of_the_witness")
    assert w.call(SetBool, "teach", SetBool.Request(data=True)).success
    publisher = w.publisher(TwistStamped)
    until = time.monotonic() + 1.5
    while time.monotonic() < until:
        publisher.publish(w.stamped(0.2))
        w.spin(0.02)
    w.rests()
    w.gone(publisher)
    taught = w.call(SetBool, "teach", SetBool.Request(data=False))
    assert taught.success, taught
    loaded = w.call(Trigger, "load")
    assert loaded.success, loaded


def two_robots_in_one_graph(w):
    """`/one` by the clock of its simulation, `/two` by plain twists and with transforms of its own: each hears itself alone."""
    odom, transforms, clock = {"one": [], "two": []}, {"/tf": [], "/two/tf": []}, []
    for name, heard in odom.items():
        w.node.create_subscription(Odometry, f"/{name}/odom", heard.append, 10)
    for topic, heard in transforms.items():
        w.node.create_subscription(TFMessage, topic, lambda message, heard=heard: heard.extend(message.transforms), 10)
    w.node.create_subscription(Clock, "/clock", lambda message: clock.append(message.clock), 10)
    w.until("both", lambda: clock and all(odom.values()) and all(transforms.values()))

    def names():
        return {namespace + "/" + name for name, namespace in w.node.get_node_names_and_namespaces()}

    # Who is there is told beside what they say.
    w.until("both are known by name", lambda: {"/one/omnibase", "/two/omnibase"} <= names())
    for name, heard in odom.items():
        assert (heard[0].header.frame_id, heard[0].child_frame_id) == (f"{name}/odom", f"{name}/base_link"), heard[0]
        assert w.call(Trigger, f"/{name}/enable").success, name

    def speed(name):
        return abs(odom[name][-1].twist.twist.linear.x)

    def twist(of, vx=0.2):
        of.linear.x = vx
        return of

    def stamped():
        message = TwistStamped()
        message.header.stamp = clock[-1]
        twist(message.twist)
        return message

    commands = {"one": (TwistStamped, stamped), "two": (Twist, lambda: twist(Twist()))}
    for name, other in (("one", "two"), ("two", "one")):
        kind, message = commands[name]
        publisher = w.node.create_publisher(kind, f"/{name}/cmd_vel", 10)

        def drive():
            publisher.publish(message())
            assert speed(other) < RESTS_M_S, (name, speed(other))

        w.until(f"{name} drives", lambda: speed(name) > 0.1, each=drive)
        w.node.destroy_publisher(publisher)
        w.until(f"{name} rests", lambda: speed(name) < RESTS_M_S)
    of = {topic: {(one.header.frame_id, one.child_frame_id) for one in heard} for topic, heard in transforms.items()}
    assert of == {"/tf": {("one/odom", "one/base_link")}, "/two/tf": {("two/odom", "two/base_link")}}, of
    seconds = [time.sec + 1e-9 * time.nanosec for time in clock]
    assert all(a <= b for a, b in zip(seconds, seconds[1:])) and seconds[-1] > seconds[0], seconds[:5]
    # Of the same clock are the stamps of `/one`, and no others: those of `/two` are of today.
    ages = {name: seconds[-1] - heard[-1].header.stamp.sec for name, heard in odom.items()}
    assert abs(ages["one"]) < 5 and ages["two"] < -1e9, ages


# What runs by itself: each group against a robot of its own, beside the others.
GROUPS = {
    "tells": [
        odom_from_the_first, topics_are_there, what_changes_seldom_is_for_those_who_come_later, settings_are_parameters,
        the_pose_is_set_and_measured, services_ask_the_robot,
    ],
    "commands": [drives_and_recovers, what_is_wrong_moves_nothing, never_after_another_stop],
    "publishers": [another_type_moves_nothing, two_publishers_move_nothing],
    "actions": [paths_are_followed, trajectories_are_followed],
}


def main():
    witness = Witness()
    alone = {check.__name__: [check] for check in (odom_without_gaps, drive_on, two_robots_in_one_graph)}
    known = {check.__name__: [check] for checks in GROUPS.values() for check in checks} | alone | GROUPS
    checks = [check for name in sys.argv[1:] or GROUPS for check in known[name]]
    for check in checks:
        began = time.monotonic()
        check(witness)
        print(f"{check.__name__}: {time.monotonic() - began:.1f} s", flush=True)
    print(f"{len(checks)} checks hold")


if __name__ == "__main__":
    main()
