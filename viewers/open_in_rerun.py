"""Opens what `omnibase export run.mcap --output view.mcap` wrote in Rerun, with a layout, and draws its scene, which Rerun 0.41
doesn't know: python open_in_rerun.py view.mcap [--save view.rrd]

Takes the Python packages rerun-sdk, mcap and mcap-protobuf-support.
"""

import argparse

import rerun as rr
import rerun.blueprint as rrb
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

arguments = argparse.ArgumentParser(description="Opens a robot's file for viewers in Rerun.")
arguments.add_argument("file", help="what `omnibase export run.mcap --output view.mcap` wrote")
arguments.add_argument("--save", metavar="FILE", help="write view.rrd in place of opening the viewer")
wanted = arguments.parse_args()

PLOTS = {"error": ["believed_m", "true_m"], "wheels": ["speed_rad_s"]}
axes = {"/tf": rr.TransformAxes3D(0.15), "/pose": rr.TransformAxes3D(0.3), "/wished_pose": rr.TransformAxes3D(0.2)}
robot = rrb.Spatial3DView(
    name="robot",
    origin="/",
    contents=["/tf/**", "/pose/**", "/wished_pose/**", "/scene_drawn/**"],
    overrides=axes,
    spatial_information=rrb.SpatialInformation(target_frame="odom"),
    eye_controls=rrb.EyeControls3D(position=(1.1, -0.9, 1.1), look_target=(0.05, 0.1, 0.0)),
)
plots = [rrb.TimeSeriesView(name=name, origin=f"/plots/{name}") for name in PLOTS]
layout = rrb.Blueprint(
    rrb.Horizontal(robot, rrb.Vertical(rrb.TextLogView(name="log", origin="/log"), *plots), column_shares=[3, 2]),
    rrb.TimePanel(state="collapsed", timeline="message_log_time"),
    rrb.SelectionPanel(state="collapsed"),
    rrb.BlueprintPanel(state="collapsed"),
)


def colour(one):
    return [int(255 * part) for part in (one.r, one.g, one.b, one.a)]


def draw(entity):
    """An entity of Foxglove's SceneUpdate as far as a robot has them: lines and cylinders."""
    place = f"/scene_drawn/{entity.id}"
    rr.log(place, rr.CoordinateFrame(entity.frame_id))
    for line in entity.lines:
        points = [(point.x, point.y, point.z) for point in line.points]
        # Type 1 is a loop.
        points += points[:1] if line.type == 1 else []
        rr.log(place, rr.LineStrips3D([points], radii=line.thickness / 2, colors=[colour(line.color)]))
    for one in entity.cylinders:
        at, turned = one.pose.position, one.pose.orientation
        drawn = rr.Cylinders3D(
            lengths=[one.size.z],
            radii=[one.size.x / 2],
            centers=[(at.x, at.y, at.z)],
            quaternions=[rr.Quaternion(xyzw=(turned.x, turned.y, turned.z, turned.w))],
            colors=[colour(one.color)],
            fill_mode="solid",
        )
        rr.log(f"{place}/solid", rr.CoordinateFrame(entity.frame_id), drawn)


rr.init("omnibase", spawn=wanted.save is None, default_blueprint=layout)
if wanted.save:
    rr.save(wanted.save, default_blueprint=layout)
rr.log_file_from_path(wanted.file)
with open(wanted.file, "rb") as file:
    messages = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
    for schema, channel, message, content in messages:
        rr.set_time("message_log_time", timestamp=1e-9 * message.log_time)
        if schema.name == "foxglove.SceneUpdate":
            for one in content.deletions:
                rr.log(f"/scene_drawn/{one.id}", rr.Clear(recursive=True))
            for one in content.entities:
                draw(one)
        name = "wheels" if channel.topic.startswith("/wheel_") else channel.topic.strip("/")
        for field in PLOTS.get(name, []):
            of = f"{channel.topic}/{field}" if name == "wheels" else f"/{field}"
            if hasattr(content, field):
                rr.log(f"/plots/{name}{of}", rr.Scalars(getattr(content, field)))
rr.disconnect()
