"""A node of real ROS 2, and what it heard of the robot behind the bridge."""

import math
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

LONGEST_S = 30.0
RESTS_M_S = 5e-3
# By what a robot says that it was asked too late.
LATE = ("the line is slow; ask again", "it came too late")
LATCHED = QoSProfile(
    history=HistoryPolicy.KEEP_LAST, depth=1,
    durability=DurabilityPolicy.TRANSIENT_LOCAL, reliability=ReliabilityPolicy.RELIABLE)


class Other:
    """A publisher of cmd_vel in a participant of its own: one participant has one type for a name."""

    def __init__(self, kind):
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node("other", context=self.context)
        self.publisher = self.node.create_publisher(kind, "cmd_vel", 10)

    def publish(self, message):
        self.publisher.publish(message)

    def end(self):
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


class Witness:
    """A node, with what it heard."""

    def __init__(self):
        rclpy.init()
        self.node = rclpy.create_node("witness")
        # Else each `spin_once` adds it and takes it away, and all that is waited for is gathered anew.
        rclpy.get_global_executor().add_node(self.node)
        self.odom = []
        self.joints = []
        self.odom_subscription = self.node.create_subscription(Odometry, "odom", self.odom.append, 1000)
        self.node.create_subscription(JointState, "joint_states", self.joints.append, 1000)
        self.phase = None
        # By the services' names: until the bridge knows a new one, a second passes.
        self.clients = {}
        # Publishers of cmd_vel that are there, and that the bridge says it knows.
        self.publishers, self.known_publishers = 0, None
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self.diagnosed, 10)

    def diagnosed(self, message):
        (state,) = [status for status in message.status if status.name.endswith(": state")]
        self.phase = state.message
        (bridge,) = [status for status in message.status if status.name.endswith(": bridge")]
        (count,) = [one.value for one in bridge.values if one.key == "cmd_vel_publishers"]
        self.known_publishers = int(count)

    def came(self, count):
        """So many publishers of cmd_vel came, or went: until the bridge knows."""
        self.publishers += count
        self.known_publishers = None
        self.until("the bridge knows who publishes cmd_vel", lambda: self.known_publishers == self.publishers)

    def spin(self, seconds):
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            rclpy.spin_once(self.node, timeout_sec=max(0.0, until - time.monotonic()))

    def until(self, what, is_true, longest=LONGEST_S, each=None):
        until = time.monotonic() + longest
        while not is_true():
            assert time.monotonic() < until, f"never: {what}; odom {self.odom[-1:]}"
            if each:
                each()
            self.spin(0.02)

    def speed(self):
        twist = self.odom[-1].twist.twist
        return math.hypot(twist.linear.x, twist.linear.y) + abs(twist.angular.z)

    def turned(self):
        """How far the wheels turned so far, rad."""
        return list(self.joints[-1].position)

    def client(self, kind, name):
        if name not in self.clients:
            self.clients[name] = self.node.create_client(kind, name)
        return self.clients[name]

    def call(self, kind, name, request=None):
        """What the robot answers in time: what a busy machine makes late it refuses, as it shall, and is asked again."""
        client, until = self.client(kind, name), time.monotonic() + LONGEST_S
        assert client.wait_for_service(timeout_sec=LONGEST_S), f"no service {name}"
        while True:
            future = client.call_async(request if request is not None else kind.Request())
            rclpy.spin_until_future_complete(self.node, future, timeout_sec=LONGEST_S)
            assert future.done(), f"no answer of {name}"
            answer = future.result()
            told = [answer, getattr(answer, "result", None), *getattr(answer, "results", [])]
            words = "".join(getattr(one, "message", "") + getattr(one, "reason", "") for one in told)
            if not any(late in words for late in LATE):
                return answer
            assert time.monotonic() < until, f"{name}: {words}"

    def stamped(self, vx=0.2, turn=0.0, age=0.0):
        message = TwistStamped()
        stamp = self.node.get_clock().now().nanoseconds - int(age * 1e9)
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 1_000_000_000)
        message.header.frame_id = "base_link"
        message.twist.linear.x = vx
        message.twist.angular.z = turn
        return message

    def rests(self):
        self.until("it rests", lambda: self.speed() < RESTS_M_S)

    def hold(self):
        """Enabled, and at rest."""
        self.until("odom", lambda: len(self.odom) > 0 and len(self.joints) > 0)
        answer = self.call(Trigger, "enable")
        # What was told before it was asked is of no use.
        self.phase = None
        self.until("its drives are enabled", lambda: self.phase not in (None, "disabled", "enabling"))
        self.rests()
        return answer

    def publisher(self, kind, topic="cmd_vel"):
        publisher = self.node.create_publisher(kind, topic, 10)
        self.until(f"{topic} is heard", lambda: publisher.get_subscription_count() > 0)
        if topic == "cmd_vel":
            self.came(1)
        return publisher

    def unheard(self, kind):
        """A publisher of cmd_vel with which ROS 2 itself matches no reader: its type is another one."""
        other = Other(kind)
        self.came(1)
        assert other.publisher.get_subscription_count() == 0, kind
        return other

    def gone(self, *publishers):
        for publisher in publishers:
            if isinstance(publisher, Other):
                publisher.end()
            else:
                self.node.destroy_publisher(publisher)
        self.came(-len(publishers))

    def moves_nothing(self, what, seconds, each):
        """No wheel moves while something is done fifty times a second."""
        self.rests()
        self.spin(0.3)
        before = self.turned()
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            each()
            self.spin(0.02)
            assert self.speed() < RESTS_M_S, f"{what}: {self.speed()} m/s"
        moved = max(abs(a - b) for a, b in zip(before, self.turned()))
        assert moved < 2e-3, f"{what}: a wheel turned by {moved} rad"

    def drives(self, publisher, message, least=0.1):
        self.until("it drives", lambda: self.speed() > least, each=lambda: publisher.publish(message()))
