"""What mcap and foxglove's own classes read of a viewers' file, as one JSON object on the standard output."""

import json
import math
import sys

from google.protobuf.descriptor import FieldDescriptor
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from foxglove_own import differs, own

(path,) = sys.argv[1:]


def heading(rotation):
    return 2 * math.atan2(rotation.z, rotation.w)


counts, schemas, differing, log, frames, believed, wheels = {}, {}, [], [], {}, [], []
poses, entities, phases, scenes = {"/pose": [], "/wished_pose": []}, {}, [], 0
states = {}
log_times = []
with open(path, "rb") as file:
    reader = make_reader(file, decoder_factories=[DecoderFactory()])
    summary = reader.get_summary()
    keys = [key for metadata in reader.iter_metadata() for key in metadata.metadata]
    for schema, channel, message, content in reader.iter_decoded_messages():
        topic = channel.topic
        counts[topic] = counts.get(topic, 0) + 1
        schemas[topic] = schema.name
        log_times.append(message.log_time)
        package, name = schema.name.rsplit(".", 1)
        if package == "foxglove":
            # Read with their descriptors, not with ours.
            theirs = own(name)()
            theirs.ParseFromString(message.data)
            if differs(content, theirs) or theirs.SerializeToString(deterministic=True) == b"":
                differing.append(topic)
            content = theirs
            if hasattr(content, "timestamp"):
                stamp = content.timestamp.seconds * 10**9 + content.timestamp.nanos
                assert stamp == message.log_time, (topic, stamp, message.log_time)
        if topic == "/tf":
            for one in content.transforms:
                frames[one.child_frame_id] = one.parent_frame_id
                norm = math.hypot(one.rotation.x, one.rotation.y, one.rotation.z, one.rotation.w)
                assert abs(norm - 1) < 1e-9, one
                if one.child_frame_id == "base_link":
                    believed.append((message.publish_time, one.translation.x, one.translation.y, heading(one.rotation)))
                elif one.child_frame_id == "wheel_1_link":
                    axis = (one.rotation.x, one.rotation.y, one.rotation.z)
                    angle = 2 * math.atan2(math.hypot(*axis), one.rotation.w)
                    wheels.append((message.publish_time, angle, axis))
        elif topic in poses:
            poses[topic].append((message.publish_time, content.pose.position.x, content.pose.position.y, heading(content.pose.orientation)))
            assert content.frame_id == "odom"
        elif topic == "/scene":
            scenes += len(content.entities) > 3
            for entity in content.entities:
                kinds = {kind: len(getattr(entity, kind)) for kind in ("lines", "cylinders") if getattr(entity, kind)}
                points = [[point.x, point.y] for line in entity.lines for point in line.points]
                at = [[one.pose.position.x, one.pose.position.y, one.size.x / 2] for one in entity.cylinders]
                entities[entity.id] = {"frame": entity.frame_id, "kinds": kinds, "points": points, "at": at}
        elif topic == "/log":
            log.append([content.message, own("Log").Level.Name(content.level), message.publish_time])
        elif topic == "/cycle":
            value = content.DESCRIPTOR.fields_by_name["phase"].enum_type.values_by_number[content.phase].name
            assert content.DESCRIPTOR.fields_by_name["phase"].type == FieldDescriptor.TYPE_ENUM
            if not phases or phases[-1] != value:
                phases.append(value)
        elif topic == "/state":
            states[message.publish_time] = (content.pose_x_m, content.pose_y_m, content.pose_heading_rad)

off = max(
    max(abs(x - states[at][0]), abs(y - states[at][1]), abs(math.sin(turned - states[at][2])))
    for rows in (believed, poses["/pose"])
    for at, x, y, turned in rows
)
# From one drawing to the next a wheel turns by what its speed tells: all of it, for none is missing.
turned = sum(
    math.remainder((after[1] * (1 if after[2] >= (0, 0, 0) else -1)) - (before[1] * (1 if before[2] >= (0, 0, 0) else -1)), 2 * math.pi)
    for before, after in zip(wheels, wheels[1:])
)
print(json.dumps({
    "counts": counts, "schemas": schemas, "differing": sorted(set(differing)), "frames": frames, "log": log, "off": off,
    "entities": entities, "phases": phases, "whole_scenes": scenes, "turned_rad": abs(turned), "keys": keys,
    "begun_ns": log_times[0], "counted": summary.statistics.message_count,
    "path_end": poses["/wished_pose"][-1][1:], "ordered": log_times == sorted(log_times),
}))
