"""A robot on omni wheels in MuJoCo, as the plant behind another process's drives.

Standard input begins with one line of JSON that describes the machine (see `outside.rs`). After that every step is one
binary message in, the torques of the wheels in N m, and one out: the pose of the base (x, y, heading), its twist in its own
axes, each wheel's angle and speed, each wheel's load. All numbers are little-endian doubles; one of them per value.

Each wheel is a hub on a hinge with passive rollers on hinges of their own, bodies all of them. A roller is an ellipsoid whose
outline along the rim follows the wheel's circle. Neighbours overlap along the rim, which no wheel of one row could, and don't
touch each other: so the wheel rolls nearly as a disc does. Friction is MuJoCo's: one coefficient, an elliptic cone, and a
contact that gives way like a damper below it.
"""

import json
import math
import os
import struct
import sys

os.environ.setdefault("MUJOCO_GL", "disable")
import mujoco  # noqa: E402


def roller_shape(radius, height, rollers):
    """Half axes along the rim and across it: the outline meets the circle in the middle and where the next one takes over."""
    at = math.pi / rollers
    along, depth = radius * math.sin(at), radius * (1.0 - math.cos(at))
    return along / math.sqrt(1.0 - (1.0 - depth / height) ** 2), height


def numbers(values):
    return " ".join(f"{value:.12g}" for value in values)


def model(machine):
    """The MJCF text."""
    wheels, rollers = machine["wheels"], machine["rollers"]
    bodies, pairs, motors = [], [], []
    for index, wheel in enumerate(wheels):
        radius = wheel["radius_m"]
        height = wheel["roller_radius_m"]
        along, across = roller_shape(radius, height, rollers)
        ring = radius - height
        roller_kg = machine["roller_kg"]
        spin = 0.4 * roller_kg * across**2
        tumble = 0.2 * roller_kg * (along**2 + across**2)
        # Hub and rollers together have the wheel's inertia.
        hub = wheel["inertia_kg_m2"] - rollers * (roller_kg * ring**2 + tumble)
        hub_kg = machine["wheel_kg"] - rollers * roller_kg
        assert hub > 0.0 and hub_kg > 0.0, "rollers heavier than their wheel"
        x, y = wheel["position_m"]
        dx, dy = wheel["direction"]
        parts = []
        for number in range(rollers):
            angle = 2.0 * math.pi * number / rollers
            sin, cos = math.sin(angle), math.cos(angle)
            name = f"roller_{index}_{number}"
            parts.append(
                f'<body pos="{numbers([ring * sin, 0, -ring * cos])}" xyaxes="{numbers([cos, 0, sin])} 0 1 0">'
                f'<inertial pos="0 0 0" mass="{roller_kg}" diaginertia="{numbers([spin, tumble, tumble])}"/>'
                f'<joint type="hinge" axis="1 0 0" frictionloss="{wheel["roller_friction_n_m"]:.9g}"/>'
                f'<geom name="{name}" type="ellipsoid" size="{numbers([along, across, across])}"/></body>'
            )
            pairs.append(
                f'<pair geom1="floor" geom2="{name}" condim="3" friction="{machine["friction"]} {machine["friction"]} 0 0 0"'
                f' solref="{machine["contact_s"]} 1" solreffriction="{machine["grip_s"]} 1"'
                f' solimp="{machine["impedance"]} {machine["impedance"]} 0.001"/>'
            )
        bodies.append(
            f'<body pos="{numbers([x, y, radius])}" xyaxes="{numbers([dx, dy, 0, -dy, dx, 0])}">'
            f'<inertial pos="0 0 0" mass="{hub_kg}" diaginertia="{numbers([0.6 * hub, hub, 0.6 * hub])}"/>'
            f'<joint name="wheel_{index}" type="hinge" axis="0 1 0" damping="{wheel["viscous_n_m_s"]}"'
            f' frictionloss="{wheel["friction_n_m"]:.9g}"/>{"".join(parts)}</body>'
        )
        motors.append(f'<motor joint="wheel_{index}"/>')
    masses = "".join(
        f'<body pos="{numbers(mass["position_m"])}"><inertial pos="0 0 0" mass="{mass["kg"]}"'
        f' diaginertia="{numbers(mass["inertia_kg_m2"])}"/></body>'
        for mass in machine["masses"]
    )
    return f"""<mujoco>
<option timestep="{machine["step_s"]}" integrator="implicitfast" cone="elliptic" impratio="{machine["impratio"]}"
 gravity="0 0 -9.80665" iterations="50" tolerance="1e-10"/>
<default><geom contype="0" conaffinity="0"/></default>
<worldbody>
<geom name="floor" type="plane" size="0 0 1"/>
<body name="base"><freejoint/><inertial pos="0 0 0.1" mass="0.001" diaginertia="1e-6 1e-6 1e-6"/>
{masses}{"".join(bodies)}</body>
</worldbody>
<contact>{"".join(pairs)}</contact>
<actuator>{"".join(motors)}</actuator>
</mujoco>"""


class Plant:
    def __init__(self, machine):
        self.model = mujoco.MjModel.from_xml_string(model(machine))
        self.data = mujoco.MjData(self.model)
        self.count = len(machine["wheels"])
        joints = [self.model.joint(f"wheel_{index}") for index in range(self.count)]
        self.angles = [int(joint.qposadr[0]) for joint in joints]
        self.speeds = [int(joint.dofadr[0]) for joint in joints]
        self.heading = 0.0
        # It settles on its treads.
        for _ in range(round(0.5 / machine["step_s"])):
            mujoco.mj_step(self.model, self.data)
        self.start = [float(self.data.qpos[angle]) for angle in self.angles]
        x, y, heading = self.pose()
        self.origin = (x, y, heading)

    def pose(self):
        qpos = self.data.qpos
        w, i, j, k = qpos[3:7].tolist()
        heading = math.atan2(2.0 * (w * k + i * j), 1.0 - 2.0 * (j * j + k * k))
        self.heading += math.remainder(heading - self.heading, 2.0 * math.pi)
        return float(qpos[0]), float(qpos[1]), self.heading

    def step(self, torques):
        self.data.ctrl[:] = torques
        mujoco.mj_step(self.model, self.data)
        x, y, heading = self.pose()
        x0, y0, heading0 = self.origin
        sin, cos = math.sin(heading0), math.cos(heading0)
        place = (cos * (x - x0) + sin * (y - y0), cos * (y - y0) - sin * (x - x0), heading - heading0)
        vx, vy, _, _, _, turn = self.data.qvel[:6].tolist()
        sin, cos = math.sin(heading), math.cos(heading)
        twist = (cos * vx + sin * vy, cos * vy - sin * vx, turn)
        angles = [self.data.qpos[angle] - start for angle, start in zip(self.angles, self.start)]
        speeds = [self.data.qvel[speed] for speed in self.speeds]
        return (*place, *twist, *angles, *speeds)


def main():
    machine = json.loads(sys.stdin.buffer.readline())
    plant = Plant(machine)
    taken, given = struct.Struct(f"<{plant.count}d"), struct.Struct(f"<{6 + 2 * plant.count}d")
    read, write = sys.stdin.buffer.read, os.write
    write(1, b"ready\n")
    while True:
        asked = read(taken.size)
        if len(asked) < taken.size:
            return
        write(1, given.pack(*plant.step(taken.unpack(asked))))


if __name__ == "__main__":
    main()
