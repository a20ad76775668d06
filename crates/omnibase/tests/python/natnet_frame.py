"""Reads NatNet frames as lines of JSON `{"version": [major, minor], "bytes": hex}` by the package `natnet`, and says what it saw."""

import json
import sys

from natnet.data_descriptions import DataDescriptions
from natnet.data_frame import DataFrame
from natnet.packet_buffer import PacketBuffer
from natnet.version import Version

for line in sys.stdin:
    sent = json.loads(line)
    buffer = PacketBuffer(bytes.fromhex(sent["bytes"]))
    sort, _ = buffer.read_uint16(), buffer.read_uint16()
    version = Version(*sent["version"])
    if sort == 5:
        read = DataDescriptions.read_from_buffer(buffer, version)
        print(json.dumps({body.name: body.id_num for body in read.rigid_bodies}))
        continue
    frame = DataFrame.read_from_buffer(buffer, version)
    print(json.dumps({
        "number": frame.prefix.frame_number,
        "exposed": frame.suffix.stamp_camera_mid_exposure,
        "sent": frame.suffix.stamp_transmit,
        "bodies": [
            {"id": body.id_num, "position": body.pos, "rotation": body.rot, "error": body.marker_error,
             "is_tracked": body.tracking_valid}
            for body in frame.rigid_bodies
        ],
    }))
