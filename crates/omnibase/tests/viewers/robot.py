"""What yourdfpy, pinocchio and MuJoCo read of a robot's URDF and MJCF, as one JSON object on the standard output."""

import json
import sys

import mujoco
import numpy
import pinocchio
import yourdfpy

urdf_file, mjcf_file = sys.argv[1:]


def of_yourdfpy():
    robot = yourdfpy.URDF.load(urdf_file, build_scene_graph=True, load_meshes=False)
    joints = {
        name: {
            "type": joint.type, "parent": joint.parent, "child": joint.child, "axis": list(map(float, joint.axis)),
            "position": list(map(float, joint.origin[:3, 3])), "velocity": joint.limit.velocity,
            "effort": joint.limit.effort,
        }
        for name, joint in robot.joint_map.items()
    }
    # Where a wheel's rim under its centre goes when the joint turns a little: it rolls the other way.
    rolls = {}
    for name, joint in robot.joint_map.items():
        step = 1e-6
        robot.update_cfg({name: step})
        turned = robot.get_transform(joint.child, "base_link")[:3, :3]
        robot.update_cfg({name: 0.0})
        still = robot.get_transform(joint.child, "base_link")[:3, :3]
        rim = ((turned @ still.T - numpy.eye(3)) @ numpy.array([0.0, 0.0, -1.0])) / step
        rolls[name] = (-rim[:2]).tolist()
    masses = {name: link.inertial.mass for name, link in robot.link_map.items()}
    return {"base": robot.base_link, "joints": joints, "rolls": rolls, "mass_kg": sum(masses.values())}


def of_pinocchio():
    model = pinocchio.buildModelFromUrdf(urdf_file, pinocchio.JointModelPlanar())
    data = model.createData()
    still = pinocchio.neutral(model)
    inertia = pinocchio.crba(model, data, still)
    centre = pinocchio.centerOfMass(model, data, still)
    return {
        "names": list(model.names)[2:], "mass_kg": pinocchio.computeTotalMass(model), "centre_m": centre.tolist(),
        "planar_kg": inertia[0, 0], "inertia_at_base_kg_m2": inertia[2, 2], "wheels_kg_m2": numpy.diag(inertia)[3:].tolist(),
    }


def of_mujoco():
    model = mujoco.MjModel.from_xml_path(mjcf_file)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    matrix = numpy.zeros((model.nv, model.nv))
    for row, unit in zip(matrix, numpy.eye(model.nv)):
        mujoco.mj_mulM(model, data, row, unit)
    base = model.body("base_link").id
    wheels = [joint for joint in range(model.njnt) if model.joint(joint).name.endswith("_joint")]
    seen = {
        "names": [model.joint(joint).name for joint in wheels],
        "axes": [data.xaxis[joint].tolist() for joint in wheels],
        "mass_kg": float(model.body_subtreemass[base]), "centre_m": data.subtree_com[base].tolist(),
        "planar_kg": float(matrix[0, 0]), "inertia_at_base_kg_m2": float(matrix[2, 2]),
        "wheels_kg_m2": numpy.diag(matrix)[3:].tolist(), "motors": model.nu,
        "torque_nm": model.actuator_ctrlrange[:, 1].tolist(),
    }
    # One second of a torque on the first wheel: it turns by half of torque over inertia, the base stays.
    data.ctrl[0] = 1.0
    while data.time < 1.0 - 1e-9:
        mujoco.mj_step(model, data)
    seen["turned_rad"] = float(data.qpos[3])
    seen["speed_rad_s"] = float(data.qvel[3])
    return seen


print(json.dumps({"yourdfpy": of_yourdfpy(), "pinocchio": of_pinocchio(), "mujoco": of_mujoco()}))
