"""Many simulated robots side by side."""

import unittest

import numpy as np
import omnibase
from places import BMM

SIGNALS = ["truth.pose_x_m", "truth.pose_y_m", "truth.pose_heading_rad", "wheel_2.torque_nm"]


class SideBySide(unittest.TestCase):
    def test_each_does_what_it_does_alone_to_the_bit(self):
        robots = omnibase.Simulations(BMM, 5, threads=3)
        twists = np.array([[0.05 * number, 0.1, 0.1 * number] for number in range(5)])
        robots.enable()
        robots.drive(twists)
        self.assertEqual(robots.step(500), [True] * 5)
        together = robots.values(SIGNALS)
        self.assertEqual(together.shape, (5, 4))
        for number, twist in enumerate(twists):
            alone = omnibase.Simulation(BMM)
            alone.enable()
            alone.drive(*twist)
            alone.step(500)
            np.testing.assert_array_equal(together[number], [alone[name] for name in SIGNALS])

    def test_some_begin_again(self):
        robots = omnibase.Simulations(BMM, 3)
        robots.enable()
        robots.drive(np.full((3, 3), 0.1))
        robots.step(300)
        before = robots.values(["truth.pose_x_m"])
        robots.reset([1])
        self.assertEqual(robots.phases, ["tracking", "disabled", "tracking"])
        after = robots.values(["truth.pose_x_m"])
        self.assertEqual(after[0], before[0])
        self.assertEqual(after[1], 0.0)
        # Nobody moves again by itself: what drove the one that was begun again is refused.
        robots.drive(np.full((3, 3), 0.1))
        self.assertEqual(robots.step(10), [True, False, True])
        robots.enable([1])
        self.assertEqual(robots.phases[1], "holding")

    def test_mistakes_are_told(self):
        robots = omnibase.Simulations(BMM, 2)
        with self.assertRaisesRegex(omnibase.Error, r"twists: expected an array of shape \(2, 3\), found \[3\]"):
            robots.drive([0.1, 0.0, 0.0])
        with self.assertRaisesRegex(omnibase.Error, "expected robots from 0 to 1, found 2"):
            robots.reset([2])
        with self.assertRaisesRegex(omnibase.Error, "no signal has this name"):
            robots.values(["nothing"])
        with self.assertRaisesRegex(omnibase.Error, "expected at least 1, found 0"):
            omnibase.Simulations(BMM, 0)
        self.assertEqual(len(robots), 2)
