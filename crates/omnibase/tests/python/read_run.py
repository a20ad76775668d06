"""Reads a run as a user of the official packages does: every message of the MCAP file, every column of the text file.

Prints one JSON object; exits with an error where a message or a line can't be read.
"""

import json
import sys

import numpy
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

mcap_file, column_file = sys.argv[1:]
messages, decoded, events, times_s = {}, {}, [], []
with open(mcap_file, "rb") as file:
    reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
    statistics = reader.get_summary().statistics
    robot = next(reader.iter_metadata()).metadata["robot"]
    for schema, channel, message, content in reader.iter_decoded_messages():
        topic = channel.topic
        messages[topic] = messages.get(topic, 0) + 1
        if topic == "/events":
            events.append(content.text)
        else:
            times_s.append(message.publish_time / 1e9)
            parts = [field.name for field in content.DESCRIPTOR.fields if field.message_type]
            for part in parts:
                signals = getattr(content, part)
                for field in signals.DESCRIPTOR.fields:
                    decoded.setdefault(f"{part}.{field.name}", []).append(getattr(signals, field.name))
decoded["time_s"] = times_s

columns = numpy.genfromtxt(column_file, names=True, deletechars="")
with open(column_file) as file:
    names = file.readline().split()
table = numpy.loadtxt(column_file, skiprows=1)

differing = [
    name
    for number, name in enumerate(names)
    if not numpy.array_equal(table[:, number], numpy.array(decoded[name]), equal_nan=True)
]
print(
    json.dumps(
        {
            "robot": robot,
            "messages": messages,
            "counted": statistics.message_count,
            "events": events,
            "rows": table.shape[0],
            "names": names,
            "column_names": columns.dtype.names,
            "differing": differing,
        }
    )
)
