"""Shortest times along waves by a direct method (casadi, Ipopt): a line of JSON in for each, its time out.

σ over time is a polynomial of constant acceleration, or of constant jerk where jerk is limited, between times; all limits are kept at
both ends and in the middle of each part.
"""

import json
import sys

import casadi as ca

PARTS = 100


def place(waves, sigma):
    """x, y and heading, each with its derivatives by σ."""
    axes = []
    for axis in waves:
        value = sum(size * ca.sin(rate * sigma + phase) for size, rate, phase in axis)
        orders = [value]
        for _ in range(3):
            orders.append(ca.jacobian(orders[-1], sigma))
        axes.append(orders)
    return axes


def limited(waves, task):
    """What must stay below 1, over σ and its derivatives by time."""
    sigma, v, a, j = (ca.MX.sym(name) for name in "svaj")
    axes = place(waves, sigma)
    speeds = [q[1] * v for q in axes]
    accelerations = [q[1] * a + q[2] * v**2 for q in axes]
    jerks = [q[1] * j + 3 * q[2] * v * a + q[3] * v**3 for q in axes]
    found = []
    for values, (most, turning) in zip((speeds, accelerations, jerks), task["limits"]):
        if most is not None:
            found += [(values[0] ** 2 + values[1] ** 2) / most**2, values[2] ** 2 / turning**2]
    return ca.Function("limited", [sigma, v, a, j], [ca.vertcat(*found)])


def shortest(task):
    has_jerk = task["limits"][2][0] is not None
    keep = limited(task["waves"], task)
    problem = ca.Opti()
    time = problem.variable()
    sigma, v, a = (problem.variable(PARTS + 1) for _ in range(3))
    jerk = problem.variable(PARTS) if has_jerk else [0] * PARTS
    width = time / PARTS
    for at in range(PARTS):
        def ahead(part):
            t = part * width
            return (
                sigma[at] + v[at] * t + a[at] * t**2 / 2 + jerk[at] * t**3 / 6,
                v[at] + a[at] * t + jerk[at] * t**2 / 2,
                a[at] + jerk[at] * t,
                jerk[at],
            )

        for part in (0, 0.5, 1):
            problem.subject_to(keep(*ahead(part)) <= 1)
        end = ahead(1)
        problem.subject_to([sigma[at + 1] == end[0], v[at + 1] == end[1]])
        if has_jerk:
            problem.subject_to(a[at + 1] == end[2])
    problem.subject_to([sigma[0] == 0, v[0] == 0, sigma[PARTS] == 1, v[PARTS] == 0, v >= 0, time >= 0.1])
    if has_jerk:
        problem.subject_to([a[0] == 0, a[PARTS] == 0])
    guess = task["guess_s"]
    problem.set_initial(time, 1.5 * guess)
    for at in range(PARTS + 1):
        part = at / PARTS
        problem.set_initial(sigma[at], part**2 * (3 - 2 * part))
        problem.set_initial(v[at], 6 * part * (1 - part) / (1.5 * guess))
    problem.minimize(time)
    problem.solver("ipopt", {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "max_iter": 1000}})
    return problem.solve().value(time)


for line in sys.stdin:
    if line.strip():
        print(json.dumps(shortest(json.loads(line))), flush=True)
