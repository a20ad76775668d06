"""What a client of Foxglove's WebSocket protocol sees of a running robot, as one JSON object on the standard output."""

import base64
import contextlib
import json
import struct
import sys
import time
import urllib.error
import urllib.request

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from foxglove_own import differs, own

address, page, token = sys.argv[1:]
LONGEST_S = 60


def answer(path, what=None):
    headers = {"Authorization": f"Bearer {token}", "Content-Type": "application/json"}
    request = urllib.request.Request(f"http://{page}/api/{path}", what and json.dumps(what).encode(), headers)
    try:
        with urllib.request.urlopen(request) as answered:
            return json.load(answered)
    except urllib.error.HTTPError as error:
        return json.load(error)


def call(**what):
    done = answer("call", {**what, "stamp": answer("now")["stamp"]})
    assert done["done"], (what, done)


def message_class(channel):
    """What the channel's own descriptors make of its messages."""
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(base64.b64decode(channel["schema"])).file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(channel["schemaName"]))


def refused(protocols):
    try:
        with connect(address, subprotocols=protocols):
            return None
    except InvalidStatus as error:
        return error.response.status_code


class Viewer:
    """Subscribed to everything; remembers what it saw."""

    def __init__(self, socket):
        self.socket = socket
        self.server = json.loads(self.socket.recv())
        self.channels = {one["id"]: one for one in json.loads(self.socket.recv())["channels"]}
        self.classes = {number: message_class(channel) for number, channel in self.channels.items()}
        self.counts, self.differing, self.frames, self.phases, self.log = {}, set(), {}, [], []
        self.entities, self.gone, self.off, self.late_s, self.states, self.status = {}, [], 0.0, 0.0, {}, []
        self.ask(op="subscribe", subscriptions=[{"id": 1000 + number, "channelId": number} for number in self.channels])

    def ask(self, **what):
        self.socket.send(json.dumps(what))

    def see(self):
        frame = self.socket.recv(timeout=LONGEST_S)
        if isinstance(frame, str):
            self.status.append(json.loads(frame))
            return
        kind, subscription, log_time = struct.unpack_from("<BIQ", frame)
        assert kind == 1, kind
        self.late_s = max(self.late_s, abs(time.time() - log_time / 1e9))
        channel = self.channels[subscription - 1000]
        topic = channel["topic"]
        content = self.classes[channel["id"]].FromString(frame[13:])
        self.counts[topic] = self.counts.get(topic, 0) + 1
        if channel["schemaName"].startswith("foxglove."):
            theirs = own(channel["schemaName"].split(".")[1]).FromString(frame[13:])
            if differs(content, theirs):
                self.differing.add(topic)
            content = theirs
        self.take(topic, log_time, content)

    def take(self, topic, log_time, content):
        if topic == "/state":
            self.states[log_time] = (content.pose_x_m, content.pose_y_m)
        elif topic == "/tf":
            for one in content.transforms:
                self.frames[one.child_frame_id] = one.parent_frame_id
                # The signals of a moment are sent before it is drawn.
                if one.child_frame_id == "base_link" and log_time in self.states:
                    x, y = self.states[log_time]
                    self.off = max(self.off, abs(one.translation.x - x), abs(one.translation.y - y))
        elif topic == "/scene":
            self.gone += [one.id for one in content.deletions]
            for one in content.entities:
                points = [[point.x, point.y] for line in one.lines for point in line.points]
                self.entities[one.id] = {"frame": one.frame_id, "points": points}
        elif topic == "/cycle":
            name = content.DESCRIPTOR.fields_by_name["phase"].enum_type.values_by_number[content.phase].name
            if self.phases[-1:] != [name]:
                self.phases.append(name)
        elif topic == "/log":
            self.log.append([content.message, own("Log").Level.Name(content.level)])

    def until(self, what, is_so):
        began = time.monotonic()
        while not is_so():
            assert time.monotonic() - began < LONGEST_S, f"{what}: {self.counts} {self.phases} {self.log}"
            self.see()


open_ = contextlib.ExitStack()
# The app offers both.
protocols = ["foxglove.websocket.v1", "foxglove.sdk.v1"]
viewer = Viewer(open_.enter_context(connect(address, subprotocols=protocols, max_size=None)))
viewer.until("it is in OP", lambda: viewer.counts.get("/state", 0) > 10)
call(do="enable")
viewer.until("it holds", lambda: "PHASE_HOLDING" in viewer.phases)
call(do="track")
viewer.until("the robot drives, drawn", lambda: "path" in viewer.entities and "PHASE_TRACKING" in viewer.phases)
call(do="set_obstacle", index=2, centre_m=[2.5, 2.5], radius_m=0.2)
viewer.until("an obstacle", lambda: "obstacle_3" in viewer.entities)
call(do="remove_obstacle", index=2)
viewer.until("it is gone", lambda: "obstacle_3" in viewer.gone)
moved = viewer.counts["/tf"]
viewer.until("a hundred drawings", lambda: viewer.counts["/tf"] >= moved + 100)
call(do="stop", category="category_1")
viewer.until("it stops", lambda: any(level == "WARNING" for _, level in viewer.log))
viewer.ask(op="subscribe", subscriptions=[{"id": 9, "channelId": 999}])
viewer.until("a refusal", lambda: viewer.status)
number = next(number for number, channel in viewer.channels.items() if channel["topic"] == "/state")
viewer.ask(op="unsubscribe", subscriptionIds=[1000 + number])
# What was on its way comes still.
last = viewer.counts["/tf"]
viewer.until("ten drawings more", lambda: viewer.counts["/tf"] >= last + 10)
states = viewer.counts["/state"]
viewer.until("ten drawings more", lambda: viewer.counts["/tf"] >= last + 20)
told = {
    "server": viewer.server, "protocol": viewer.socket.subprotocol, "counts": viewer.counts,
    "schemas": {one["topic"]: one["schemaName"] for one in viewer.channels.values()},
    "fields": {
        one["topic"]: [field.name for field in viewer.classes[number].DESCRIPTOR.fields]
        for number, one in viewer.channels.items()
    },
    "differing": sorted(viewer.differing), "frames": viewer.frames, "phases": viewer.phases, "log": viewer.log,
    "entities": viewer.entities, "off_m": viewer.off, "late_s": viewer.late_s, "status": viewer.status,
    "after_unsubscribing": viewer.counts["/state"] - states, "refused": [refused(None), refused(["another.v1"])],
}
open_.close()
print(json.dumps(told))
