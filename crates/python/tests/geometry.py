"""Kinematics, odometry and trajectories."""

import math
import unittest

import numpy as np
import omnibase
from places import BMM, MECANUM, ROOT


class Geometry(unittest.TestCase):
    def test_wheel_speeds_and_twist_are_each_others_inverse(self):
        for file, wheels in ((BMM, 3), (MECANUM, 4)):
            kinematics = omnibase.Kinematics(file)
            self.assertEqual((len(kinematics.wheels), kinematics.matrix.shape), (wheels, (wheels, 3)))
            twist, residual = kinematics.twist(kinematics.wheel_speeds_rad_s((0.3, -0.2, 0.5)))
            np.testing.assert_allclose(twist, (0.3, -0.2, 0.5), atol=1e-12)
            self.assertAlmostEqual(residual, 0.0, places=12)
            wrench = kinematics.wrench(kinematics.wheel_torques_nm((10.0, 5.0, -2.0)))
            np.testing.assert_allclose(wrench, (10.0, 5.0, -2.0), atol=1e-9)
        speeds = kinematics.wheel_speeds_rad_s((0.3, 0.0, 0.0))
        speeds[0] += 1.0
        self.assertGreater(kinematics.twist(speeds)[1], 0.01)
        with self.assertRaisesRegex(omnibase.Error, "expected 4 values, found 3"):
            kinematics.twist([0.0] * 3)

    def test_odometry_rolls_a_circle_back_to_its_beginning(self):
        kinematics = omnibase.Kinematics(BMM)
        odometry = omnibase.Odometry(kinematics)
        # 0.5 m/s ahead and 1 rad/s to the left for a whole turn: a circle of 0.5 m.
        steps = 1000
        period_s = math.tau / steps
        increments = [speed * period_s for speed in kinematics.wheel_speeds_rad_s((0.5, 0.0, 1.0))]
        poses = np.array([odometry.advance(increments, period_s) for _ in range(steps)])
        np.testing.assert_allclose(poses[-1], (0.0, 0.0, 0.0), atol=1e-9)
        np.testing.assert_allclose(np.hypot(poses[:, 0], poses[:, 1] - 0.5), 0.5, atol=1e-9)
        self.assertTrue((np.linalg.eigvalsh(odometry.covariance) > 0.0).all())
        odometry.set_pose((1.0, 2.0, 0.5))
        self.assertEqual(odometry.pose, (1.0, 2.0, 0.5))
        with self.assertRaisesRegex(omnibase.Error, "wheel 1 is not finite"):
            odometry.advance([0.0, math.nan, 0.0], 0.001)
        with self.assertRaisesRegex(omnibase.Error, "0 s between two samples"):
            odometry.advance([0.0] * 3, 0.0)

    def test_a_trajectory_goes_through_its_points_and_its_twist_is_its_rate(self):
        lines = (ROOT / "robots/square.dat").read_text().splitlines()
        points = np.array([[float(value) for value in line.strip("()").split(",")] for line in lines if line[:1] == "("])
        for interpolation in ("cubic", "quintic", "spline"):
            motion = omnibase.trajectory(points, 0.001, interpolation)
            times, poses, twists = motion[:, 0], motion[:, 1:4], motion[:, 4:7]
            at = np.searchsorted(times, points[:, 0] - points[0, 0] - 1e-6).clip(max=len(times) - 1)
            np.testing.assert_allclose(poses[at], points[:, 1:4], atol=1e-3)
            np.testing.assert_allclose(np.gradient(poses, times, axis=0)[5:-5], twists[5:-5], atol=0.02)
        for arguments, words in (
            (([[0, 0, 0, 0]], 0.1), "point"),
            (([[0, 0, 0], [1, 1, 1]], 0.1), r"expected an array of shape \(2, 4\)"),
            ((points, 0.0), "period_s: expected a positive time"),
            ((points, 0.1, "linear"), "expected smooth, cubic, quintic, spline or b_spline, found `linear`"),
        ):
            with self.assertRaisesRegex(omnibase.Error, words):
                omnibase.trajectory(*arguments)
