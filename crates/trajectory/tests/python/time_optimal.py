"""Times paths of polynomial pieces by toppra: a line of JSON in for each, a line with the speeds at its grid out."""

import json
import logging
import sys

import numpy as np
import toppra
from toppra import algorithm, constraint

logging.disable(logging.CRITICAL)


class Cubics:
    """The polynomials that the other side has, by their coefficients."""

    def __init__(self, pieces, breaks):
        self.pieces, self.breaks = np.array(pieces), np.array(breaks)

    @property
    def dof(self):
        return self.pieces.shape[1]

    @property
    def path_interval(self):
        return np.array([self.breaks[0], self.breaks[-1]])

    def __call__(self, sigma, order=0):
        sigma = np.asarray(sigma)
        if sigma.ndim == 0:
            return self(sigma[None], order)[0]
        at = np.clip(np.searchsorted(self.breaks, sigma, side="right") - 1, 0, len(self.pieces) - 1)
        within = sigma - self.breaks[at]
        found = np.zeros((len(sigma), self.dof))
        for power in range(order, self.pieces.shape[2]):
            factor = np.prod(range(power - order + 1, power + 1)) if order else 1.0
            found += factor * self.pieces[at, :, power] * within[:, None] ** (power - order)
        return found

    def eval(self, sigma):
        return self(sigma)

    def evald(self, sigma):
        return self(sigma, 1)

    def evaldd(self, sigma):
        return self(sigma, 2)


def in_base(q, vector):
    """A vector of x, y and turn in the axes of the platform, which the third coordinate turns."""
    cos, sin = np.cos(q[2]), np.sin(q[2])
    return np.array([cos * vector[0] + sin * vector[1], cos * vector[1] - sin * vector[0], vector[2]])


class WheelSpeeds(constraint.LinearConstraint):
    """Rows over the twist in base: each product is at most 1 in size."""

    def __init__(self, rows):
        super().__init__()
        self.rows = np.array(rows)
        self.dof = 3

    def compute_constraint_params(self, path, gridpoints):
        places, rates = path(gridpoints), path(gridpoints, 1)
        most = [max(abs(self.rows @ in_base(q, rate))) ** -2 for q, rate in zip(places, rates)]
        return None, None, None, None, None, None, np.array([[0.0, x] for x in most])


def wheels(task):
    """The speeds of wheels, and planes on the acceleration in base: torques and grip."""
    normals, most = np.array(task["normals"]), np.array(task["most"])
    return [
        WheelSpeeds(task["wheel_speeds"]),
        constraint.SecondOrderConstraint(
            lambda q, _rate, acceleration: in_base(q, acceleration),
            lambda _: normals,
            lambda _: most,
            3,
            discretization_scheme=constraint.DiscretizationType.Interpolation,
        ),
    ]


for line in sys.stdin:
    task = json.loads(line)
    path = Cubics(task["pieces"], task["breaks"])
    limits = [np.array([[-most, most] for most in task[key]]) for key in ("speeds", "accelerations")]
    constraints = [
        constraint.JointVelocityConstraint(limits[0]),
        constraint.JointAccelerationConstraint(
            limits[1], discretization_scheme=constraint.DiscretizationType.Interpolation
        ),
    ]
    if task["wheel_speeds"]:
        constraints = constraints[:1] + wheels(task)
    instance = algorithm.TOPPRA(
        constraints, path, gridpoints=np.array(task["sigma"]), parametrizer="ParametrizeConstAccel"
    )
    _, speeds, _ = instance.compute_parameterization(task["first"], task["last"])
    print(json.dumps(None if speeds is None else list(speeds)))
