"""Third-order optima by the SOCP of `copp` (pip `copp-py`, the crate's own bindings): a path and its limits a line, a time out each.

A path is sums of sines over s from 0 to 1 on x, y and heading, as in `direct_optimum.py`. `copp` knows limits of single axes: the length of
a vector is one of its projections onto DIRECTIONS directions, which together are longer by at most 0.2 % of a limit.
"""

import json
import sys

import copp_py as copp
import numpy as np

STATIONS = 200
DIRECTIONS = 24
# Rounds of linearising the limits on jerk about the last optimum, until the time stays.
ROUNDS = 12
STAYS = 2e-4


def derivatives(waves, s):
    found = np.zeros((4, len(s)))
    for size, rate, phase in waves:
        at = rate * s + phase
        found += size * np.array([np.sin(at), rate * np.cos(at), -(rate**2) * np.sin(at), -(rate**3) * np.cos(at)])
    return found


def optimum(waves, limits):
    s = np.linspace(0.0, 1.0, STATIONS + 1)
    x, y, turn = (derivatives(axis, s) for axis in waves)
    angles = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    axes = np.array([np.cos(angle) * x + np.sin(angle) * y for angle in angles] + [turn])
    speed, acceleration, jerk = ([pair[0]] * DIRECTIONS + [pair[1]] for pair in limits)
    robot = copp.Robot(len(axes))
    robot.append_s(s)
    q = [np.ascontiguousarray(axes[:, order, :].T) for order in range(4)]
    robot.set_q(q[0], q[1], q[2], 0, dddq=q[3])
    length = len(s)
    for add, bound in (
        (robot.add_velocity_limits, speed),
        (robot.add_acceleration_limits, acceleration),
        (robot.add_jerk_limits, jerk),
    ):
        bound = np.array(bound)
        add(bound, -bound, start_idx_s=0, length=length)
    second = copp.solver.topp2_ra.solve(copp.solver.topp2_ra.Problem(robot.constraints, (0, length - 1)))
    a, b, best = np.maximum(np.asarray(second), 1e-6), None, None
    for _ in range(ROUNDS):
        problem = copp.solver.topp3_socp.Problem(robot.constraints, a, b_linearization=b)
        profile = copp.solver.topp3_socp.solve(problem)
        time, _ = copp.interpolation.s_to_t_topp3(s, profile)
        a, b = np.maximum(profile.a, 1e-9), profile.b
        if best is not None and abs(best - time) < STAYS * time:
            break
        best = time
    return time


for line in sys.stdin:
    path = json.loads(line)
    try:
        print(json.dumps(optimum(path["waves"], path["limits"])), flush=True)
    except copp.CoppError as error:
        print(json.dumps(str(error)), flush=True)
