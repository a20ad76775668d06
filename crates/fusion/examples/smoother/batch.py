"""What wheels and sensors told, all at once: GTSAM by Gauss and Newton over poses, slip, the matrix E of what wheels do wrong,
and each sensor's own errors. Reads the table of `smoother.rs`, prints x, y, heading at the end and their standard deviations."""

import sys

import gtsam
import numpy as np

X, S, B = (lambda n, c=c: gtsam.symbol(c, n) for c in "xsb")
E, G, M = gtsam.symbol("e", 0), gtsam.symbol("g", 0), [gtsam.symbol("m", n) for n in (0, 1)]
SLIP_TIME_S = 0.15
RESTING = (5e-5, 5e-5, 1e-4)
# Poses and what wheels say of them agree within this, m and rad: 1e-6 in an epoch.
EXACT = gtsam.noiseModel.Isotropic.Sigma(3, 1e-6)


def sigmas(values):
    return gtsam.noiseModel.Diagonal.Sigmas(np.array(values, dtype=float))


def exp(u):
    """The pose at the end of a step along an arc: x, y, turn."""
    half = 0.5 * u[2]
    shrink = np.sinc(half / np.pi)
    c, s = np.cos(half) * shrink, np.sin(half) * shrink
    return np.array([c * u[0] - s * u[1], s * u[0] + c * u[1], u[2]])


def factor(noise, keys, of):
    """A factor whose derivatives are central differences; `of` takes each key's value and gives the error."""

    def error(this, values, jacobians):
        at = []
        for key in this.keys():
            at.append(values.atVector(key))
        base = of(*at)
        if jacobians is not None:
            for n, one in enumerate(at):
                columns = np.zeros((len(base), len(one)), order="F")
                for column in range(len(one)):
                    step = np.zeros(len(one))
                    step[column] = 1e-6
                    above = of(*at[:n], one + step, *at[n + 1 :])
                    below = of(*at[:n], one - step, *at[n + 1 :])
                    columns[:, column] = (above - below) / 2e-6
                jacobians[n] = columns
        return base

    return gtsam.CustomFactor(noise, keys, error)


def wrap(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


def main():
    lines = [[float(word) for word in line.split(",")] for line in open(sys.argv[1]).read().split()]
    epoch_s = lines[0][0]
    (start_m2, start_rad2), floor = lines[1], lines[2]
    geometry = np.array(lines[3]).reshape(9, 9)
    sensors, rows = lines[4:8], lines[8:]
    graph, first = gtsam.NonlinearFactorGraph(), gtsam.Values()
    start = sigmas([start_m2**0.5, start_m2**0.5, start_rad2**0.5])

    # E, whitened: its covariance may have directions of no width.
    values, vectors = np.linalg.eigh(geometry)
    root = vectors @ np.diag(np.sqrt(np.maximum(values, 0.0)))
    one = gtsam.noiseModel.Isotropic.Sigma
    graph.add(gtsam.PriorFactorVector(E, np.zeros(9), one(9, 1.0)))
    graph.add(gtsam.PriorFactorVector(G, np.zeros(1), one(1, sensors[0][8])))
    graph.add(gtsam.PriorFactorVector(B(0), np.zeros(1), one(1, sensors[0][6])))
    for key, mouse in zip(M, sensors[1:3]):
        graph.add(gtsam.PriorFactorVector(key, np.zeros(2), sigmas(mouse[8:10])))
    # The filter begins at the first pose that it hears; only that says where.
    graph.add(gtsam.PriorFactorVector(X(0), np.zeros(3), sigmas([10.0, 10.0, 10.0])))
    graph.add(gtsam.PriorFactorVector(S(0), np.zeros(3), one(3, 1e-9)))
    for key, size in ((E, 9), (G, 1), (M[0], 2), (M[1], 2)):
        first.insert(key, np.zeros(size))

    def truly(u, e, s):
        return u + (root @ e).reshape(3, 3) @ u - s * epoch_s

    keep = np.exp(-epoch_s / SLIP_TIME_S)
    pose, last, placed = np.zeros(3), None, False
    first.insert(X(0), pose)
    first.insert(S(0), np.zeros(3))
    first.insert(B(0), np.zeros(1))
    for k, row in enumerate(rows):
        u = np.array(row[:3])
        gain = np.zeros(3) if last is None else (u - last) / epoch_s**2
        last = u

        def on(x, e, s, after, u=u):
            step = exp(truly(u, e, s))
            c, n = np.cos(x[2]), np.sin(x[2])
            there = x + np.array([c * step[0] - n * step[1], n * step[0] + c * step[1], step[2]])
            off = after - there
            return np.array([off[0], off[1], wrap(off[2])])

        graph.add(factor(EXACT, [X(k), E, S(k), X(k + 1)], on))
        way, turn = np.hypot(u[0], u[1]), abs(u[2])
        m2, rad2 = floor[0] * way + floor[1] * turn, floor[2] * way + floor[3] * turn
        slip = [np.hypot((v / (2 * SLIP_TIME_S * epoch_s)) ** 0.5, r) for v, r in zip((m2, m2, rad2), RESTING)]
        drive = sigmas([v * (1 - keep * keep) ** 0.5 for v in slip])
        graph.add(factor(drive, [S(k), S(k + 1)], lambda s, after: after - keep * s))
        walk = one(1, sensors[0][7] * epoch_s**0.5)
        graph.add(factor(walk, [B(k), B(k + 1)], lambda b, after: after - b))

        def twist(e, s, later, u=u, gain=gain):
            return truly(u, e, s) / epoch_s + gain * later

        told = [row[3 + 5 * n : 8 + 5 * n] for n in range(4)]
        count, later, turned = told[0][:3]
        if count:
            noise = one(1, sensors[0][3] / count**0.5)

            def gyro(e, s, b, g, turned=turned, later=later, twist=twist):
                return np.array([(1 + g[0]) * twist(e, s, later)[2] + b[0] - turned])

            graph.add(factor(noise, [E, S(k), B(k + 1), G], gyro))
        for key, mouse, (count, later, x, y, _) in zip(M, sensors[1:3], told[1:3]):
            if count:
                noise = sigmas([mouse[3] / count**0.5, mouse[4] / count**0.5])

                def flow(e, s, m, mouse=mouse, later=later, said=(x, y), twist=twist):
                    v = twist(e, s, later)
                    at = (v[0] - v[2] * mouse[1], v[1] + v[2] * mouse[0])
                    c, n = np.cos(mouse[2] + m[1]), np.sin(mouse[2] + m[1])
                    along = np.array([c * at[0] + n * at[1], -n * at[0] + c * at[1]])
                    return (1 + m[0]) * along - np.array(said)

                graph.add(factor(noise, [E, S(k), key], flow))
        count, _, x, y, heading = told[3]
        step = exp(u)
        c, n = np.cos(pose[2]), np.sin(pose[2])
        pose = pose + np.array([c * step[0] - n * step[1], n * step[0] + c * step[1], step[2]])
        if count:
            mount = sensors[3]

            def seen(p, mount=mount, said=(x, y, heading)):
                c, n = np.cos(p[2]), np.sin(p[2])
                at = (p[0] + c * mount[0] - n * mount[1], p[1] + n * mount[0] + c * mount[1])
                return np.array([at[0] - said[0], at[1] - said[1], wrap(p[2] + mount[2] - said[2])])

            graph.add(factor(sigmas(mount[3:6]), [X(k + 1)], seen))
        first.insert(X(k + 1), pose)
        first.insert(S(k + 1), np.zeros(3))
        first.insert(B(k + 1), np.zeros(1))
    settings = gtsam.GaussNewtonParams()
    settings.setLinearSolverType("MULTIFRONTAL_QR")
    settings.setRelativeErrorTol(1e-8)
    found = gtsam.GaussNewtonOptimizer(graph, first, settings).optimize()
    # The end last: its own corner of the root of the information is the root of its marginal's.
    end, order = X(len(rows)), gtsam.Ordering()
    for key in first.keys():
        if key != end:
            order.push_back(key)
    order.push_back(end)
    whole, _ = graph.linearize(found).jacobian(order)
    corner = np.linalg.inv(np.linalg.qr(whole, mode="r")[-3:, -3:])
    covariance = corner @ corner.T
    print(*found.atVector(end), *np.sqrt(np.diag(covariance)))


main()
